//! Checks of a sweep as a whole: nothing is set twice, nothing is without effect, every job is valid.
//!
//! Single values were checked where they were read. What is left are rules between parameters (`N N_s`, `dfs <= fs`,
//! the period behind η, a whole ramp), checked at every point. No rule reads the seed, so the points of one seed stand
//! for all; where one of them is invalid, all are walked through, since a condition may drop it.
//!
//! Twins are two values of a quantity that agree in twelve digits but not in all, such as 30 and 29.999999999999996.
//! Both would be sets with the same realisations, counted twice where rows are grouped by a column.

use super::axes::Axis;
use super::grid::Sweep;
use super::quantity::{DERIVABLE, GridPoint, Quantity};
use super::rounds::{Goal, MAX_SETS, Rounds};
use super::source::{Refused, Section, Source};
use crate::model::theory::typical_interval;
use crate::model::{Symbol, Value};
use crate::observe::Recording;
use crate::sets::Statistic;
use crate::table::value::Shortest;
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

pub(super) struct Places<'a> {
    source: &'a Source<'a>,
    set: Vec<KeyPlace>,
}

struct KeyPlace {
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
        let clash = |place: &&KeyPlace| {
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
            self.set.push(KeyPlace {
                quantity,
                at,
                section,
            });
        }
    }

    /// Reports a mistake where a quantity is set, else where its bound is set, else at the head of the file.
    fn refuse(&self, quantity: Quantity, problem: String) -> Refused {
        let bound = match quantity {
            Quantity::Parameter(Symbol::Dfs) => Quantity::Parameter(Symbol::Fs),
            Quantity::Parameter(Symbol::Ns) => Quantity::Parameter(Symbol::N),
            other => other,
        };
        let set_at = |quantity| self.set.iter().find(|place| place.quantity == quantity);
        let place = set_at(quantity).or_else(|| set_at(bound));
        self.source
            .refuse(place.map_or(0, |place| place.at), problem)
    }
}

/// Most points of a sweep. Each process that works on it walks through all of them before it starts a job, at 0.14 to
/// 0.2 µs each, and longer where earlier sweeps of the directory are asked for them: seconds, in which nothing needs to
/// be watched.
const MAX_POINTS: u64 = 10_000_000;

/// All checks of a sweep that is read. What is new in this program is asked of a new one only.
pub(super) fn whole(
    sweep: &Sweep,
    file: &Section<'_>,
    places: &Places<'_>,
    is_new: bool,
) -> Result<(), Refused> {
    size(sweep, file)?;
    modulation(sweep, file, places)?;
    if let Some((quantity, problem)) = sweep.twins().filter(|_| is_new) {
        return Err(places.refuse(quantity, problem));
    }
    points(sweep, places, is_new && sweep.measured.is_none())?;
    let Some((_, first)) = sweep.admitted(0..sweep.point_count()).next() else {
        return Err(file.source.refuse(
            file.place_of("where"),
            "where: drops every point; relax it, or extend the axes",
        ));
    };
    recording(sweep, file)?;
    // A later job can only differ where an axis moves masses or stiffnesses; it then fails by itself, and others
    // continue.
    let solver = file
        .entry("solver")
        .and_then(|entry| entry.section("[solver]"));
    let time_step = solver.map_or(0, |solver| solver.place_of("dt"));
    let checked = sweep.solver.check(&first.parameters);
    checked.map_err(|error| file.source.refuse(time_step, error.to_string()))
}

fn size(sweep: &Sweep, file: &Section<'_>) -> Result<(), Refused> {
    let mut rows = sweep.axes.iter().map(Axis::len);
    let points = match rows.try_fold(1_u64, u64::checked_mul) {
        Some(..=MAX_POINTS) => return Ok(()),
        Some(points) => format!("{points} points"),
        None => "2^64 points or more".to_owned(),
    };
    let problem = format!(
        "[axes]: {points}; a sweep has at most {MAX_POINTS}, before conditions. Take fewer, or a sample ([axes.sobol]), \
         or several sweeps"
    );
    Err(file.source.refuse(file.place_of("axes"), problem))
}

/// Every job is valid and, in a new sweep, so fast that its times are resolved.
fn points(sweep: &Sweep, places: &Places<'_>, is_new: bool) -> Result<(), Refused> {
    let problem_at = |point: &GridPoint| {
        invalid(point).or_else(|| too_slow(point, &sweep.recording).filter(|_| is_new))
    };
    let mut of_one_seed = sweep.points_of_one_seed();
    if !of_one_seed.any(|point| problem_at(&point).is_some()) {
        return Ok(());
    }
    let mut admitted = sweep.admitted(0..sweep.point_count());
    let found = admitted.find_map(|(_, point)| Some((problem_at(&point)?, point)));
    found.map_or(Ok(()), |((quantity, problem), point)| {
        Err(places.refuse(quantity, problem + &place(sweep, &point)))
    })
}

/// What is recorded comes within the longest time, and from the solver.
fn recording(sweep: &Sweep, file: &Section<'_>) -> Result<(), Refused> {
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
    Ok(())
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
    match (&rounds.goal, refine.and_then(|refine| refine.entry("jobs"))) {
        (Goal::Edges(refinement), Some(jobs)) if refinement.max_jobs < min_jobs => {
            Err(jobs.must_be(&format!("at least the {min_jobs} of the first round")))
        }
        _ => Ok(()),
    }
}

/// Drive velocity in m/s from which a slip of microseconds would be driven through: micrometres per second were meant.
const FAST: f64 = 0.1;
/// η for which locking is expected: far below, the load hardly swings; far above, a cycle gains less than a slip's
/// inertia hides.
const USUAL_ETA: RangeInclusive<f64> = 1e-3..=1e5;
/// Most points that are examined for warnings.
const MAX_LOOKED_AT: usize = 100_000;

impl Sweep {
    /// What is allowed, but hardly intended.
    pub fn warnings(&self) -> Vec<String> {
        let points: Vec<GridPoint> = self.points_of_one_seed().take(MAX_LOOKED_AT).collect();
        let values = |quantity| points.iter().map(move |point| point.number(quantity));
        let fast = values(Quantity::Parameter(Symbol::V0)).find(|velocity| *velocity >= FAST);
        let fast_warning = fast.map(|velocity| {
            format!(
                "V0 = {} m/s is far too fast for stick-slip; 100 micrometres per second are V0 = 1e-4",
                Shortest(velocity)
            )
        });
        let etas = points.iter().zip(values(Quantity::Eta));
        let without_pulse = etas.filter(|(point, _)| point.parameters.pulse_start.is_none());
        let unusual = without_pulse
            .map(|(_, eta)| eta)
            .find(|eta| *eta != 0.0 && !USUAL_ETA.contains(eta));
        let unusual_warning = unusual.map(|eta| {
            let low = USUAL_ETA.start();
            let high = USUAL_ETA.end();
            format!(
                "eta = {eta:.3e} at a point; locking is expected only for eta from {low:e} to {high:e}: check Delta, T and V0"
            )
        });
        let rounds = self.rounds.iter();
        let few = rounds.filter(|rounds| rounds.asked < *rounds.seeds.start());
        let few_warning = few.map(|Rounds { asked, seeds, .. }| {
            format!(
                "seeds: from = {asked} is raised to {}: intervals of fewer seeds are not trusted",
                seeds.start()
            )
        });
        let of_points = fast_warning.into_iter().chain(unusual_warning);
        of_points.chain(few_warning).collect()
    }
}

/// A period and controls without modulation have no effect, a modulation without period no meaning, and what the drive
/// alone explains needs controls.
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
    let section = match rounds.goal {
        Goal::Precision(_) => "precision",
        Goal::Edges(_) => "refine",
    };
    let mut statistics = rounds.statistics().iter();
    match statistics.find(|statistic| statistic.needs_control) {
        None => Ok(()),
        Some(Statistic { key, .. }) => {
            let problem =
                format!("[{section}]: {key} needs controls; set control = true in [record]");
            Err(file.source.refuse(file.place_of(section), problem))
        }
    }
}

/// What is wrong with a canonical point, and the quantity to blame.
fn invalid(point: &GridPoint) -> Option<(Quantity, String)> {
    let period = point.parameters.modulation_period;
    if let (Some((Quantity::Eta, _)), Some(period)) = (point.fixes_period, period)
        && !DERIVABLE.contains(&period)
    {
        let period = Shortest(period);
        let problem = format!("eta: gives T = {period} s, which must lie between 1e-100 and 1e100");
        return Some((Quantity::Eta, problem));
    }
    let error = point.parameters.check_rules().err()?;
    Some((Quantity::Parameter(error.symbol), error.to_string()))
}

/// Share of the wave crossing time, which separates ruptures, to which the times of a job must be known.
const RESOLUTION: f64 = 1e-3;

/// A drive so slow that the doubles which hold the time of a job do not resolve its slips.
fn too_slow(point: &GridPoint, recording: &Recording) -> Option<(Quantity, String)> {
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
fn place(sweep: &Sweep, point: &GridPoint) -> String {
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

/// Largest relative distance of twins: half of what two values with twelve digits differ by.
const CLOSE: f64 = 5e-13;
const PERIOD: Quantity = Quantity::Parameter(Symbol::T);

fn are_twins(a: f64, b: f64) -> bool {
    a != b && (a - b).abs() <= CLOSE * a.abs().max(b.abs())
}

/// What is wrong with a value of a quantity, and its twin to be written in its place.
fn problem(quantity: Quantity, value: f64, twin: f64) -> String {
    let key = quantity.key();
    let [value, twin] = [value, twin].map(Shortest);
    format!(
        "{key} = {value}: agrees with {twin} in twelve digits but not in all, so both would be sets of the same \
         realisations; write {key} = {twin}"
    )
}

impl Sweep {
    /// What is wrong with twins among the values of an axis; the shorter of the two is to be written.
    pub(super) fn twins(&self) -> Option<(Quantity, String)> {
        let is_set = |quantity: &Quantity| *quantity != PERIOD || self.fixes_period_by().is_none();
        Quantity::all().filter(is_set).find_map(|quantity| {
            let values = self.reals(quantity);
            let pair = values.windows(2).find(|pair| are_twins(pair[0], pair[1]))?;
            let mut pair = [pair[0], pair[1]];
            pair.sort_by_key(|value| Shortest(*value).to_string().len());
            Some((quantity, problem(quantity, pair[1], pair[0])))
        })
    }

    /// What is wrong with a value whose twin an earlier sweep of a directory has.
    pub fn twin_of(&self, earlier: &Self) -> Option<String> {
        let is_mixed = self.fixes_period_by() != earlier.fixes_period_by();
        let quantities = Quantity::all().filter(|quantity| is_mixed || *quantity != PERIOD);
        quantities.into_iter().find_map(|quantity| {
            let known = earlier.reals(quantity);
            self.reals(quantity).into_iter().find_map(|value| {
                let at = known.partition_point(|other| *other < value);
                let around = &known[at.saturating_sub(1)..known.len().min(at + 1)];
                let twin = around.iter().find(|other| are_twins(value, **other))?;
                (!around.contains(&value)).then(|| problem(quantity, value, *twin))
            })
        })
    }

    fn fixes_period_by(&self) -> Option<Quantity> {
        let mut quantities = self.axes.iter().flat_map(Axis::quantities);
        quantities.find(|quantity| matches!(quantity, Quantity::Eta | Quantity::Frequency))
    }

    /// The values of a quantity, each once, ascending, also of the period where another quantity fixes it; empty for
    /// whole numbers and words.
    fn reals(&self, quantity: Quantity) -> Vec<f64> {
        let of_axes = self.axes.iter().find_map(|axis| axis.values_of(quantity));
        let values = match (of_axes, quantity) {
            (Some(values), _) => values.to_vec(),
            (None, PERIOD) if self.fixes_period_by().is_some() => {
                let points = self.points_of_one_seed();
                let periods = points.filter_map(|point| point.parameters.modulation_period);
                let bits: BTreeSet<u64> = periods.map(f64::to_bits).collect();
                return bits.into_iter().map(f64::from_bits).collect();
            }
            (None, Quantity::Parameter(symbol)) => vec![self.base.get(symbol)],
            (None, _) => Vec::new(),
        };
        let mut reals: Vec<f64> = values
            .into_iter()
            .filter(|value| matches!(value, Value::Real(_)))
            .filter_map(Value::number)
            .collect();
        reals.sort_unstable_by(f64::total_cmp);
        reals.dedup();
        reals
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::value::Kind;
    use std::path::Path;

    fn read(axes: &str) -> Result<Sweep, String> {
        let text = format!("name = \"a\"\n[axes]\n{axes}\n");
        Sweep::parse(&text, Path::new("a.toml")).map_err(|error| error.to_string())
    }

    fn twin(axes: &str, earlier: &str) -> Option<String> {
        read(axes).unwrap().twin_of(&read(earlier).unwrap())
    }

    /// Axes without which a value of this quantity has no effect.
    fn beside(quantity: Quantity) -> &'static str {
        match quantity {
            Quantity::Parameter(Symbol::Delta) => "T = [0.03]",
            Quantity::Parameter(Symbol::T) | Quantity::Eta | Quantity::Frequency => {
                "Delta = [1e-6]"
            }
            Quantity::Parameter(Symbol::TTo | Symbol::DeltaTo) => {
                "Delta = [1e-6]\nT = [0.03]\nramp_time = [0.1]"
            }
            Quantity::Parameter(Symbol::RampTime) => "Delta = [1e-6]\nT = [0.03]\nT_to = [0.02]",
            Quantity::Parameter(_) => "",
        }
    }

    #[test]
    fn twins_of_any_quantity_and_axis_are_refused_at_its_line_with_the_value_to_write() {
        let mut tried = 0;
        for quantity in Quantity::all() {
            let key = quantity.key();
            if matches!(quantity, Quantity::Parameter(symbol) if symbol.description().kind != Kind::Real)
            {
                continue;
            }
            tried += 1;
            let value = 0.007_f64;
            let beside = beside(quantity);
            let twin = value.next_up();
            for list in [
                format!("{key} = [{value}, 0.008, {twin}]"),
                format!("{key} = {{ linear = [{value}, {twin}], points = 2 }}"),
                format!("{key} = {{ log = [{value}, {twin}], points = 2 }}"),
                format!("zip = [{{ {key} = [{value}, {twin}], N = [70, 71] }}]"),
                format!("sobol = {{ {key} = {{ linear = [{value}, {twin}] }}, points = 8 }}"),
            ] {
                let problem = read(&format!("{list}\n{beside}")).unwrap_err();
                let is_repeated = problem.contains("repeats row");
                let names_both = problem.contains(&format!(
                    "a.toml:3: {key} = {twin}: agrees with {value} in twelve digits"
                ));
                assert!(is_repeated || names_both, "{list}: {problem}");
            }
        }
        assert!(tried > 15, "{tried}");
    }

    #[test]
    fn values_that_differ_in_the_twelfth_digit_are_two() {
        for list in [
            "[0.3, 0.300000000001]",
            "[9.99999999999e-5, 1e-4]",
            "[2e-4, 2.00000000001e-4]",
        ] {
            read(&format!("V0 = {list}")).unwrap();
        }
        read("V0 = { linear = [1e-4, 1.0000001e-4], points = 10001 }").unwrap();
    }

    #[test]
    fn a_twin_of_a_value_of_the_directory_is_found_whatever_set_it() {
        let frequency = "frequency = [10, 30]\nDelta = [1e-6]\nseed = { count = 3 }";
        let found = twin(
            "frequency = [29.999999999999996]\nDelta = [2e-6]",
            frequency,
        )
        .unwrap();
        assert!(found.ends_with("write frequency = 30"), "{found}");
        assert_eq!(
            twin("frequency = [30, 30.0000001]\nDelta = [1e-6]", frequency),
            None
        );
        // The default of the model, and a value of an axis that is gone.
        assert!(twin("Kd = [4.000000000000001e7]", "V0 = [1e-4]").is_some());
        assert!(twin("V0 = [1e-4]", "Kd = [4.000000000000001e7]").is_some());
        // Periods by other means, whatever the seeds.
        let seeds = "Delta = [1e-6]\nseed = { first = 7, count = 2 }";
        let period = |period: f64| format!("T = [{period:?}]\n{seeds}");
        let thirtieth = 1.0 / 30.0_f64;
        assert!(twin(&period(thirtieth.next_up()), frequency).is_some());
        assert_eq!(twin(&period(thirtieth), frequency), None);
        let own = twin(frequency, &period(thirtieth.next_up())).unwrap();
        assert!(
            own.ends_with(&format!("write T = {}", thirtieth.next_up())),
            "{own}"
        );
        let eta = "eta = [0.5, 2]\nV0 = [1e-4, 2e-4]\nDelta = [1e-6]";
        let parameters = read(eta).unwrap().jobs().last().unwrap().parameters;
        let of_eta = parameters.modulation_period.unwrap();
        let axes = |period: f64| format!("T = [{period:?}]\nV0 = [2e-4]\nDelta = [1e-6]");
        assert!(twin(&axes(of_eta.next_down()), eta).is_some());
        assert!(twin(eta, &axes(of_eta.next_down())).is_some());
        let doubled = eta.replace("[0.5, 2]", "[2, 2.000000000000001]");
        assert!(read(&doubled).unwrap_err().contains("write eta = 2"));
        assert_eq!(twin(&axes(of_eta), eta), None);
    }
}
