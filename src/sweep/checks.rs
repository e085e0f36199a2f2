//! Checks of a sweep as a whole: nothing is set twice, nothing is without effect, every job is valid.
//!
//! Single values were checked where they were read. What is left are rules between parameters (`N N_s`, `dfs <= fs`, the
//! period behind η, a whole ramp), checked at every point. No rule reads the seed, so the points of one seed stand for all;
//! where one of them is invalid, all are walked through, since a condition may drop it.

use super::axes::Axis;
use super::grid::Sweep;
use super::quantity::{Point, Quantity};
use super::rounds::{MAX_SETS, Rounds};
use super::source::{Refused, Section, Source};
use crate::model::Symbol;
use crate::model::theory::typical_interval;
use crate::observe::Recording;
use crate::sets::Statistic;
use crate::solver::Resolve;
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
            let key = quantity.key();
            let other = place.quantity.key();
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
        let place = place(quantity).or_else(|| place(bound));
        self.source
            .refuse(place.map_or(0, |place| place.at), problem)
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
    let mut rows = sweep.axes.iter().map(Axis::len);
    let points = rows.try_fold(1_u64, u64::checked_mul);
    if points.is_none_or(|points| points > MAX_POINTS) {
        let points = match points {
            Some(points) => format!("{points} points"),
            None => "2^64 points or more".to_owned(),
        };
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
    if let Some((time, max_time)) = time.zip(max_time)
        && max_time <= time
    {
        let problem = format!(
            "time = {}: no job gets there, as max_time = {} ends it before; leave one of them out",
            Shortest(time),
            Shortest(max_time)
        );
        return Err(file.source.refuse(file.place_of("record"), problem));
    }
    if sweep.recording.energies && sweep.solver.resolve == Resolve::Grid {
        let problem = "energies: are recorded along Taylor steps only; remove resolve = \"grid\" from [solver]";
        return Err(file.source.refuse(file.place_of("record"), problem));
    }
    // A later job can only differ where an axis moves masses or stiffnesses; it then fails by itself, and others continue.
    let solver = file
        .entry("solver")
        .and_then(|entry| entry.section("[solver]"));
    let time_step = solver.map_or(0, |solver| solver.place_of("dt"));
    let checked = sweep.solver.check(&first.parameters);
    checked.map_err(|error| file.source.refuse(time_step, error.to_string()))
}

/// An adaptive sweep has not too many sets, and jobs for its first round.
pub(super) fn rounds(sweep: &Sweep, file: &Section<'_>) -> Result<(), Refused> {
    let Some(rounds) = &sweep.rounds else {
        return Ok(());
    };
    let sets = sweep.first_sets().len() as u64;
    if sets > MAX_SETS {
        let problem = format!(
            "[axes]: {sets} sets; a sweep with rounds has at most {MAX_SETS}; take several sweeps"
        );
        return Err(file.source.refuse(file.place_of("axes"), problem));
    }
    let min_jobs = sets * rounds.seeds.start();
    let refine = file
        .entry("refine")
        .and_then(|refine| refine.section("[refine]"));
    match (
        &rounds.refinement,
        refine.and_then(|refine| refine.entry("jobs")),
    ) {
        (Some(refinement), Some(jobs)) if refinement.max_jobs < min_jobs => {
            Err(jobs.must_be(&format!("at least the {min_jobs} of the first round")))
        }
        _ => Ok(()),
    }
}

/// Drive velocity in m/s from which a slip of microseconds would be driven through: micrometres per second were meant.
const FAST: f64 = 0.1;
/// η for which locking is expected: far below, the load hardly swings; far above, a cycle gains less than a slip's inertia
/// hides.
const USUAL_ETA: RangeInclusive<f64> = 1e-3..=1e5;
/// Most points that are examined for warnings.
const MAX_LOOKED_AT: usize = 100_000;

impl Sweep {
    /// What is allowed, but hardly intended.
    pub fn warnings(&self) -> Vec<String> {
        let points: Vec<Point> = self.points_of_one_seed().take(MAX_LOOKED_AT).collect();
        let values = |quantity| points.iter().map(move |point| point.number(quantity));
        let fast = values(Quantity::Parameter(Symbol::V0)).find(|velocity| *velocity >= FAST);
        let fast = fast.map(|velocity| {
            format!(
                "V0 = {} m/s is far too fast for stick-slip; 100 micrometres per second are V0 = 1e-4",
                Shortest(velocity)
            )
        });
        let unusual = values(Quantity::Eta).find(|eta| *eta != 0.0 && !USUAL_ETA.contains(eta));
        let unusual = unusual.map(|eta| {
            let low = USUAL_ETA.start();
            let high = USUAL_ETA.end();
            format!(
                "eta = {eta:.3e} at a point; locking is expected only for eta from {low:e} to {high:e}: check Delta, T and V0"
            )
        });
        let rounds = self.rounds.iter();
        let few = rounds.filter(|rounds| rounds.asked < *rounds.seeds.start());
        let few = few.map(|Rounds { asked, seeds, .. }| {
            format!(
                "seeds: from = {asked} is raised to {}: intervals of fewer seeds are not trusted",
                seeds.start()
            )
        });
        fast.into_iter().chain(unusual).chain(few).collect()
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
    if sweep.controls.is_some() && !is_modulated {
        let problem =
            "control: has no effect while Delta = 0; set Delta > 0 (m), or remove control";
        return Err(file.source.refuse(file.place_of("record"), problem));
    }
    match &sweep.rounds {
        Some(rounds) if sweep.controls.is_none() => without_controls(rounds, file),
        _ => Ok(()),
    }
}

/// Statistics of what the drive alone explains are refused in a sweep without controls.
fn without_controls(rounds: &Rounds, file: &Section<'_>) -> Result<(), Refused> {
    let precise = rounds.precision.iter();
    let precise = precise.flat_map(|precision| &precision.statistics);
    let refined = rounds.refinement.iter();
    let refined = refined.flat_map(|refinement| &refinement.by);
    let section = if rounds.refinement.is_some() {
        "refine"
    } else {
        "precision"
    };
    match precise.chain(refined).find(|by| by.needs_control()) {
        None => Ok(()),
        Some(Statistic { key, .. }) => {
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
    let mut quantities: Vec<Quantity> = sweep.axes.iter().flat_map(Axis::quantities).collect();
    quantities.retain(|quantity| *quantity != Quantity::BREAK_ON);
    let value = |quantity: &Quantity| {
        let number = Shortest(point.number(*quantity));
        format!("{} = {number}", quantity.key())
    };
    let moved: Vec<String> = quantities.iter().map(value).collect();
    if moved.is_empty() {
        return String::new();
    }
    format!(
        ", at the point {}; change the axes, or drop it by a where",
        moved.join(", ")
    )
}
