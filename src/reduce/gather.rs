//! The sets of jobs, gathered from the tables: jobs once, slips as often as memory asks for.
//!
//! Contract: a function of the wanted jobs and their rows alone. Sums over the jobs of a set are taken in the order of
//! their seeds, in whatever files they lie, so that no digit depends on what was run earlier in the directory.
//!
//! Memory: 5 kB per set with its row and histogram, 50 bytes per job, 24 per slip of a control, 50 more for the jobs of
//! [`MAX_SLIPS`] slips and 48 to 96 for each of these, and as much again for those of the set at hand; where the tables
//! hold more, the slips are read again for the next sets.
//!
//! A sample of the slips becomes points of scatter figures.

use super::drive_alone::{Controls, Explained};
use super::set::{FinishedSet, JobFacts, SetJobs, SetSlips};
use crate::model::{Parameters, Selected, Selection as _, Symbol, Value};
use crate::observe::Slip;
use crate::results::tables::{All, JobOfSlip, RecordedTable};
use crate::results::{Results, ResultsError};
use crate::sets::{AllButSeed, SetRow};
use crate::sweep::Plan;
use crate::table::columns::{Class, columns};
use crate::table::file::Dataset;
use crate::table::tables;
use crate::table::value::words;
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};

/// Slips that are held at once: some 300 MB.
pub(super) const MAX_SLIPS: u64 = 1 << 22;
/// Which jobs are wanted, by their parameters.
type Wanted<'a> = &'a dyn Fn(&Parameters) -> bool;

/// Whether a directory has its tables, and not reduced data alone.
pub(super) fn has_jobs(results: &Results<'_>) -> Result<bool, ResultsError> {
    let layout = results.layout();
    Ok(layout.storage.exists(&layout.table(RecordedTable::Jobs))?)
}

/// The sets that the rounds of a directory have chosen, by their numbers, controls left out: of the chosen jobs alone.
pub fn reduce_chosen(results: &Results<'_>) -> Result<BTreeMap<u64, SetRow>, ResultsError> {
    of_chosen(results, |set, explained| set.finish_with(explained).0.row)
}

/// What a function makes of each of these sets, before anything is computed, and of what the drive alone explains.
pub(super) fn of_chosen<T>(
    results: &Results<'_>,
    of_set: impl Fn(Gathered, &Explained) -> T,
) -> Result<BTreeMap<u64, T>, ResultsError> {
    let mut found = BTreeMap::new();
    let sweep = results.sweep();
    let chosen = results.chosen();
    let is_chosen = |parameters: &Parameters| {
        let point = sweep.find(parameters);
        point.is_some_and(|point| chosen.has(point))
    };
    let is_of_grid = |number: &u64| *number < sweep.point_count();
    Gathering::of_jobs(results, &is_chosen)?.each_set(MAX_SLIPS, u64::MAX, |set, explained| {
        let number = sweep.set_with(&set.jobs.parameters);
        if let Some(number) = number.filter(is_of_grid) {
            found.insert(number, of_set(set, explained));
        }
        Ok(())
    })?;
    Ok(found)
}

/// The jobs of a directory, whose slips are still to be gathered.
pub(super) struct Gathering<'a> {
    pub(super) sets: Vec<SetJobs>,
    slips: Dataset<'a>,
    is_wanted: Wanted<'a>,
    plan: Plan<'a>,
    controls: Controls,
}

impl<'a> Gathering<'a> {
    /// The sets of the wanted jobs, in the order of their parameters.
    pub(super) fn of_jobs(
        results: &'a Results<'a>,
        is_wanted: Wanted<'a>,
    ) -> Result<Self, ResultsError> {
        let plan = results.plan();
        // Listed once: what other runs commit meanwhile is left out as a whole.
        let jobs = results.dataset(RecordedTable::Jobs)?;
        let slips = results.committed_files(RecordedTable::Slips, &jobs)?;
        let sets = sets_of(&jobs, is_wanted)?;
        let controls = Controls::read(slips.clone(), plan, sets.iter().map(|set| &set.parameters))?;
        Ok(Self {
            sets,
            slips,
            is_wanted,
            plan,
            controls,
        })
    }

    /// Hands on set after set before anything is computed, each with every `spacing`-th slip of the table as a point
    /// and its place in the table, and with what the drive alone explains.
    pub(super) fn each_set(
        mut self,
        max_slips: u64,
        spacing: u64,
        mut gathered: impl FnMut(Gathered, &Explained) -> Result<(), ResultsError>,
    ) -> Result<(), ResultsError> {
        for chunk in chunks(std::mem::take(&mut self.sets), max_slips) {
            for set in self.slips_of(chunk, spacing)? {
                let explained = self.controls.explain(self.plan, &set.jobs.parameters);
                gathered(set, &explained)?;
            }
        }
        Ok(())
    }

    /// Reads all slips and keeps those of the wanted jobs of these sets.
    fn slips_of(&self, sets: Vec<SetJobs>, spacing: u64) -> Result<Vec<Gathered>, ResultsError> {
        let ids = sets.iter().map(|set| set.set_id.clone());
        let index: HashMap<String, usize> = ids.zip(0..).collect();
        let mut gathered: Vec<Gathered> = sets.into_iter().map(Gathered::new).collect();
        // The job of the last slip, and its set if the job is wanted.
        let mut last = None;
        let mut found = None;
        let rows = self.slips.clone().rows::<(JobOfSlip, Slip)>();
        for (place, row) in (0..).zip(rows) {
            let (job, slip) = row?;
            if last.as_ref() != Some(&job) {
                let is_wanted = |&index: &usize| {
                    (self.is_wanted)(&gathered[index].jobs.parameters.with_seed(job.seed))
                };
                found = index.get(&job.set_id).copied().filter(is_wanted);
                last = Some(job);
            }
            let (Some(index), Some(job)) = (found, &last) else {
                continue;
            };
            let set = &mut gathered[index];
            if place % spacing == 0 {
                let point = Point::of(&set.jobs.parameters, &slip);
                set.points.push((place, point));
            }
            set.slips.push(job.seed, &slip);
        }
        Ok(gathered)
    }
}

/// The sets of the wanted jobs, in the order of their parameters.
pub(super) fn sets_of(
    jobs: &Dataset<'_>,
    is_wanted: Wanted<'_>,
) -> Result<Vec<SetJobs>, ResultsError> {
    let mut sets: BTreeMap<String, SetJobs> = BTreeMap::new();
    for row in jobs.clone().rows::<(JobFacts, Selected<All>)>() {
        let (
            job,
            Selected {
                all: parameters, ..
            },
        ) = row?;
        if !is_wanted(&parameters) {
            continue;
        }
        let seed = parameters.seed;
        let new = |set_id: &String| SetJobs {
            set_id: set_id.clone(),
            parameters,
            ..SetJobs::default()
        };
        let set = sets.entry(job.set_id.clone()).or_insert_with_key(new);
        set.push(seed, &job);
    }
    let mut sorted: Vec<SetJobs> = sets.into_values().collect();
    // From a map: sets that agree in all parameters stay in the order of their ids.
    sorted.sort_by(|left, right| by_parameters(&left.parameters, &right.parameters));
    Ok(sorted)
}

/// The order of sets in every table.
fn by_parameters(left: &Parameters, right: &Parameters) -> Ordering {
    let order = |&symbol: &Symbol| match (left.get(symbol), right.get(symbol)) {
        (Value::Real(left), Value::Real(right)) => left.total_cmp(&right),
        (Value::Count(left), Value::Count(right)) => left.cmp(&right),
        (left, right) => left.to_string().cmp(&right.to_string()),
    };
    let mut orders = AllButSeed::SYMBOLS.iter().map(order);
    let order = orders.find(|order| order.is_ne());
    order.unwrap_or(Ordering::Equal)
}

/// Cuts the sets where their slips would exceed the most.
fn chunks(sets: Vec<SetJobs>, max_slips: u64) -> Vec<Vec<SetJobs>> {
    let mut chunks: Vec<Vec<SetJobs>> = Vec::new();
    let mut slips = 0;
    for set in sets {
        slips = set.slips.saturating_add(slips);
        match chunks.last_mut() {
            Some(chunk) if slips <= max_slips => chunk.push(set),
            _ => {
                slips = set.slips;
                chunks.push(vec![set]);
            }
        }
    }
    chunks
}

/// A set and its slips so far.
pub(super) struct Gathered {
    pub(super) jobs: SetJobs,
    pub(super) slips: SetSlips,
    /// Points among them, with their place in table order.
    points: Vec<(u64, Point)>,
}

impl Gathered {
    pub(super) fn new(jobs: SetJobs) -> Self {
        Self {
            jobs,
            slips: SetSlips::default(),
            points: Vec::new(),
        }
    }

    pub(super) fn finish_with(self, explained: &Explained) -> (FinishedSet, Vec<(u64, Point)>) {
        let mut set = self.slips.finish(&self.jobs);
        explained.add_to(&mut set);
        (set, self.points)
    }
}

/// Slips up to which all become points; of more, every k-th in table order remains.
const MAX_POINTS: u64 = 20_000;

words! {
    /// A part of a run under a ramp of the modulation.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum RampStage {
        /// On the way to the turning point.
        Up = "up",
        Down = "down",
        After = "after",
    }
}

impl RampStage {
    /// The stage at a time in s, of a ramp that takes `ramp_time` s each way.
    fn at(time: f64, ramp_time: f64) -> Self {
        match time / ramp_time {
            share if share < 1.0 => Self::Up,
            share if share < 2.0 => Self::Down,
            _ => Self::After,
        }
    }
}

columns! {
    /// A slip as a point of a scatter figure.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Point {
        drive_velocity as "V0": f64 = "m/s", "drive velocity", "", Class::Parameter;
        amplitude as "Delta": f64 = "m", "amplitude of the modulation at the onset";
        period as "T": Option<f64> = "s", "period of the modulation at the onset", "", Class::Period;
        eta: f64 = "", "2 pi Delta / (T V0); 0 without modulation";
        ramp_stage: Option<RampStage> = "",
            "where on the ramp of the modulation the onset lies: up, down, after; null without a ramp";
        onset: f64 = "s", "time of the onset";
        interval: Option<f64> = "s", "time since the previous onset";
        periods: Option<u64> = "", "interval in periods T, rounded";
        phase: Option<f64> = "rad", "phase of the onset against the modulation";
        has_phase: bool = "", "whether the set of the slip has a phase";
    }
}

impl Point {
    /// A slip of a job with these parameters; whether its set has a phase is not known yet.
    pub(super) fn of(parameters: &Parameters, slip: &Slip) -> Self {
        let is_ramped = parameters.ramp_time > 0.0;
        Self {
            drive_velocity: parameters.drive_velocity,
            amplitude: slip.modulation.amplitude,
            period: slip.modulation.period,
            eta: slip.modulation.eta(parameters.drive_velocity),
            ramp_stage: is_ramped.then(|| RampStage::at(slip.onset, parameters.ramp_time)),
            onset: slip.onset,
            interval: slip.interval,
            periods: slip.periods,
            phase: slip.phase,
            has_phase: false,
        }
    }
}

tables! { Point = "points", "Slips for scatter figures: all up to 20,000, or every k-th in table order"; }

/// Distance k of the points among `slips` rows.
pub(super) fn spacing(slips: u64) -> u64 {
    slips.div_ceil(MAX_POINTS).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_points_are_kept_than_a_figure_bears() {
        for slips in [0_u64, 1, 19_999, 20_000, 20_001, 40_000, 1_000_003] {
            assert!(slips.div_ceil(spacing(slips)) <= MAX_POINTS, "{slips}");
        }
        assert_eq!((spacing(20_000), spacing(20_001)), (1, 2));
    }
}
