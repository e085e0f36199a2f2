//! Checks of a sweep as a whole: nothing is set twice, nothing is without effect, every job is valid.
//!
//! Single values were checked where they were read. What is left are rules between parameters (`N N_s`, `dfs <= fs`, the
//! period behind η, a whole ramp), checked at every point. No rule reads the seed, so the points of one seed stand for all;
//! where one of them is invalid, all are walked through, since a condition may drop it.

use super::axes::Axis;
use super::grid::Sweep;
use super::quantity::{Point, Quantity};
use super::rounds::Rounds;
use super::set::Statistic;
use super::source::{Refused, Section, Source};
use crate::model::Symbol;
use crate::model::theory::typical_interval;
use crate::observe::Recording;
use crate::solver::{Resolve, Solver};
use crate::table::value::Shortest;
use std::ops::RangeInclusive;

/// Where each quantity is set.
pub(super) struct Places<'a> {
    source: &'a Source<'a>,
    set: Vec<Place>,
}

struct Place {
    quantity: Quantity,
    /// Byte of the text.
    at: usize,
    section: &'static str,
}

impl<'a> Places<'a> {
    pub const fn new(source: &'a Source<'a>) -> Self {
        Self {
            source,
            set: Vec::new(),
        }
    }

    /// A quantity is set in a section; refused if something else sets it, or the period, already.
    pub fn set(&mut self, quantity: Quantity, at: usize, section: &'static str) {
        let clash = |place: &&Place| {
            place.quantity == quantity || (place.quantity.is_period() && quantity.is_period())
        };
        if let Some(place) = self.set.iter().find(clash) {
            let (key, other) = (quantity.key(), place.quantity.key());
            let here = self.source.in_section(section);
            let there = self.source.in_section(place.section);
            let line = self.source.line_in_words(place.at);
            let problem = if place.quantity == quantity {
                format!("{key}{here}: is set{there}, too{line}; keep one")
            } else {
                format!("{key}{here}: fixes the period, as does {other}{there}{line}; keep one")
            };
            self.source.refuse(at, problem);
        } else {
            self.set.push(Place {
                quantity,
                at,
                section,
            });
        }
    }

    /// Reports a mistake where a quantity is set, or the one that bounds it, or at the head of the file.
    fn refuse(&self, quantity: Quantity, problem: String) -> Refused {
        let bound = match quantity {
            Quantity::Parameter(Symbol::Dfs) => Quantity::Parameter(Symbol::Fs),
            Quantity::Parameter(Symbol::Ns) => Quantity::Parameter(Symbol::N),
            other => other,
        };
        let place = |quantity| self.set.iter().find(|place| place.quantity == quantity);
        self.source.refuse(
            place(quantity)
                .or_else(|| place(bound))
                .map_or(0, |place| place.at),
            problem,
        )
    }
}

/// Most points of a sweep. Each process that works on it walks through all of them before it starts a job, at 0.14 to 0.2 µs
/// each, and longer where earlier sweeps of the directory are asked for them: seconds, in which nothing needs to be watched.
const MAX_POINTS: u64 = 10_000_000;

/// All checks of a sweep that is read. What is new in this program is asked of a new one only.
pub(super) fn whole(
    sweep: &Sweep,
    file: &Section<'_>,
    places: &Places<'_>,
    is_new: bool,
) -> Result<(), Refused> {
    let points = sweep
        .axes
        .iter()
        .try_fold(1_u64, |points, axis| points.checked_mul(axis.len()));
    if points.is_none_or(|points| points > MAX_POINTS) {
        let points = points.map_or_else(
            || "2^64 points or more".to_owned(),
            |points| format!("{points} points"),
        );
        let problem = format!(
            "[axes]: {points}; a sweep has at most {MAX_POINTS}, before conditions. Take fewer, or a sample \
             ([axes.sobol]), or several sweeps"
        );
        return Err(file.source.refuse(file.place_of("axes"), problem));
    }
    modulation(sweep, file, places)?;
    if let Some((quantity, problem)) = sweep.twins().filter(|_| is_new) {
        return Err(places.refuse(quantity, problem));
    }
    let problem_at = |point: &Point| {
        invalid(point).or_else(|| too_slow(point, &sweep.recording).filter(|_| is_new))
    };
    if sweep
        .points_of_one_seed()
        .any(|point| problem_at(&point).is_some())
        && let Some(((quantity, problem), point)) = sweep
            .admitted(0..sweep.point_count())
            .find_map(|(_, point)| Some((problem_at(&point)?, point)))
    {
        return Err(places.refuse(quantity, problem + &place(sweep, &point)));
    }
    let Some((_, first)) = sweep.admitted(0..sweep.point_count()).next() else {
        return Err(file.source.refuse(
            file.place_of("where"),
            "where: drops every point; relax it, or extend the axes",
        ));
    };
    let Recording { time, max_time, .. } = sweep.recording;
    if let (Some(time), Some(max_time)) = (time, max_time)
        && max_time <= time
    {
        let problem = format!(
            "time = {}: no job gets there, as max_time = {} ends it before; leave one of them out",
            Shortest(time),
            Shortest(max_time)
        );
        return Err(file.source.refuse(file.place_of("record"), problem));
    }
    if sweep.recording.energies
        && matches!(
            sweep.solver,
            Solver::EventDriven {
                resolve: Resolve::Grid,
                ..
            }
        )
    {
        let problem = "energies: are recorded along Taylor steps only; remove resolve = \"grid\" from [solver]";
        return Err(file.source.refuse(file.place_of("record"), problem));
    }
    // A later job can only differ where an axis moves masses or stiffnesses; it then fails by itself, and others continue.
    let solver = file
        .entry("solver")
        .and_then(|entry| entry.section("[solver]"));
    let time_step = solver.map_or(0, |solver| solver.place_of("dt"));
    sweep
        .solver
        .check(&first.parameters)
        .map_err(|error| file.source.refuse(time_step, error.to_string()))
}

/// Drive velocity in m/s from which a slip of microseconds would be driven through: micrometres per second were meant.
const FAST: f64 = 0.1;
/// η where there is something to see: far below, the load hardly swings; far above, a cycle gains less than a slip's inertia
/// hides.
const USUAL_ETA: RangeInclusive<f64> = 1e-3..=1e5;
/// Most points that are looked at for warnings.
const MAX_LOOKED_AT: usize = 100_000;

impl Sweep {
    /// What is allowed but hardly meant.
    pub fn warnings(&self) -> Vec<String> {
        let points: Vec<Point> = self.points_of_one_seed().take(MAX_LOOKED_AT).collect();
        let worst = |quantity: Quantity, is_odd: &dyn Fn(f64) -> bool| {
            points
                .iter()
                .map(|point| point.number(quantity))
                .find(|number| is_odd(*number))
        };
        let fast = worst(Quantity::Parameter(Symbol::V0), &|velocity| {
            velocity >= FAST
        });
        let odd = worst(Quantity::Eta, &|eta| {
            eta != 0.0 && !USUAL_ETA.contains(&eta)
        });
        let fast = fast.map(|velocity| {
            format!(
                "V0 = {} m/s is far too fast for stick-slip; 100 micrometres per second are V0 = 1e-4",
                Shortest(velocity)
            )
        });
        let odd = odd.map(|eta| {
            let (low, high) = (USUAL_ETA.start(), USUAL_ETA.end());
            format!(
                "eta = {eta:.3e} at a point; from {low:e} to {high:e} there is locking to see: check Delta, T and V0"
            )
        });
        let few = self
            .rounds
            .as_ref()
            .filter(|rounds| rounds.asked < *rounds.seeds.start());
        let few = few.map(|Rounds { asked, seeds, .. }| {
            format!(
                "seeds: from = {asked} is raised to {}: intervals of fewer seeds are not trusted",
                seeds.start()
            )
        });
        let discard = self.recording.discard;
        let start_up = points
            .iter()
            .map(|point| discard as f64 * typical_interval(&point.parameters))
            .fold(0.0, f64::max);
        let early = self.recording.time.filter(|time| *time < start_up);
        let early = early.map(|time| {
            format!(
                "time = {} s: start-up of {discard} slips takes up to some {start_up:.3} s, and a job records one slip after it",
                Shortest(time)
            )
        });
        let odd = odd.into_iter().chain(early);
        fast.into_iter().chain(odd).chain(few).collect()
    }
}

/// A period and controls without modulation have no effect, a modulation without period no meaning, and what the drive alone
/// explains needs controls.
fn modulation(sweep: &Sweep, file: &Section<'_>, places: &Places<'_>) -> Result<(), Refused> {
    let is_modulated = sweep.points_of_one_seed().any(|point| point.is_modulated());
    match places.set.iter().find(|place| place.quantity.is_period()) {
        Some(place) if !is_modulated => {
            let key = place.quantity.key();
            let problem =
                format!("{key}: has no effect while Delta = 0; set Delta > 0 (m), or remove {key}");
            return Err(places.source.refuse(place.at, problem));
        }
        None if is_modulated => {
            let problem = "Delta > 0: needs a period; set T (s), frequency (Hz) or eta";
            return Err(places.refuse(Quantity::Parameter(Symbol::Delta), problem.to_owned()));
        }
        _ => {}
    }
    if sweep.controls.is_some() {
        let problem =
            "control: has no effect while Delta = 0; set Delta > 0 (m), or remove control";
        return if is_modulated {
            Ok(())
        } else {
            Err(file.source.refuse(file.place_of("record"), problem))
        };
    }
    let Some(Rounds {
        precision,
        refinement,
        ..
    }) = &sweep.rounds
    else {
        return Ok(());
    };
    let precise = precision
        .iter()
        .flat_map(|precision| &precision.statistics)
        .map(|by| ("precision", by));
    let refined = refinement
        .iter()
        .flat_map(|refinement| &refinement.by)
        .map(|by| ("refine", by));
    match precise.chain(refined).find(|(_, by)| by.needs_control()) {
        None => Ok(()),
        Some((section, Statistic { key, .. })) => {
            let problem =
                format!("[{section}]: {key} needs controls; set control = true in [record]");
            Err(file.source.refuse(file.place_of(section), problem))
        }
    }
}

/// What is wrong with a canonical point, and the quantity to blame.
fn invalid(point: &Point) -> Option<(Quantity, String)> {
    if !point.period_is_derivable() {
        let period = Shortest(point.number(Quantity::Parameter(Symbol::T)));
        let problem =
            format!("eta: gives T = {period} s; T, Delta and V0 must lie between 1e-100 and 1e100");
        return Some((Quantity::Eta, problem));
    }
    let error = point.parameters.check_rules().err()?;
    Some((Quantity::Parameter(error.symbol), error.to_string()))
}

/// Share of the wave crossing time, which separates ruptures, to which the times of a job must be known.
const RESOLUTION: f64 = 1e-3;

/// A drive so slow that the doubles which hold the time of a job do not resolve its slips.
fn too_slow(point: &Point, recording: &Recording) -> Option<(Quantity, String)> {
    let parameters = &point.parameters;
    let time = recording.expected_time(typical_interval(parameters));
    let longest = RESOLUTION * parameters.wave_crossing_time() / f64::EPSILON;
    if time <= longest {
        return None;
    }
    let problem = format!(
        "V0 = {}: a job takes {time:.1e} s, a time that is known to {:.0e} s, too coarse for fronts that cross the \
         slider in {:.0e} s; write V0 = {:.2e} or more, fewer slips, or a max_time",
        Shortest(parameters.drive_velocity),
        time * f64::EPSILON,
        parameters.wave_crossing_time(),
        // Rounded up.
        1.005 * parameters.drive_velocity * time / longest,
    );
    Some((Quantity::Parameter(Symbol::V0), problem))
}

/// Where a point lies on the axes, and the way out.
fn place(sweep: &Sweep, point: &Point) -> String {
    let quantities = sweep
        .axes
        .iter()
        .flat_map(Axis::quantities)
        .filter(|quantity| *quantity != Quantity::BREAK_ON);
    let moved: Vec<String> = quantities
        .map(|quantity| format!("{} = {}", quantity.key(), Shortest(point.number(quantity))))
        .collect();
    if moved.is_empty() {
        return String::new();
    }
    format!(
        ", at the point {}; change the axes, or drop it by a where",
        moved.join(", ")
    )
}
