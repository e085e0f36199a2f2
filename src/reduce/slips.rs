//! Slips one by one, with all parameters of their sets: for figures, and for means that the table of sets lacks.

use super::estimate::{Estimate, Numbers};
use super::gather::{Gathering, MAX_SLIPS as MAX_SLIPS_AT_ONCE, Point, has_jobs};
use super::values::{Condition, Values, formula};
use crate::model::Selected;
use crate::observe::Slip;
use crate::results::tables::{JobOfSlip, Loading, RecordedTable, gaps};
use crate::results::{Results, ResultsError};
use crate::sets::{AllButSeed, SetRow, Statistic};
use crate::sweep::Expression;
use crate::table::columns::{ANGLE, Row, columns};
use std::collections::{BTreeMap, HashMap};

/// Most slips in a figure: more hide each other, and make a picture of some megabytes.
const MAX_SLIPS: usize = 20_000;

columns! {
    /// What comes after a slip.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Following {
        next_interval: Option<f64> = "s", "time to the next onset; null for the last of a job";
    }
}

/// A slip, and what it is a slip of.
pub type SlipOfSet = (
    (JobOfSlip, Selected<AllButSeed>),
    (Loading, Slip, Following),
);

/// Gives each slip of some sets, with the place of its set.
fn each_slip(
    results: &Results<'_>,
    sets: &[SetRow],
    mut give: impl FnMut(usize, SlipOfSet),
) -> Result<(), ResultsError> {
    let ids = sets.iter().map(|set| &*set.set_id);
    let places: HashMap<&str, usize> = ids.zip(0..).collect();
    let mut last: Option<(usize, SlipOfSet)> = None;
    let files =
        results.committed_files(RecordedTable::Slips, &results.dataset(RecordedTable::Jobs)?)?;
    for row in files.rows::<(JobOfSlip, Slip)>() {
        let (job, slip) = row?;
        let Some(&place) = places.get(&*job.set_id) else {
            continue;
        };
        if let Some((place, mut before)) = last.take() {
            if before.0.0 == job {
                before.1.2.next_interval = slip.interval;
            }
            give(place, before);
        }
        let parameters = sets[place].parameters.clone();
        let measured = (Loading::of(&parameters), slip, Following::default());
        last = Some((place, ((job, parameters), measured)));
    }
    if let Some((place, slip)) = last {
        give(place, slip);
    }
    Ok(())
}

/// Every k-th of some slips: all of few, and at most [`MAX_SLIPS`].
pub struct EveryKth<T> {
    pub kept: Vec<T>,
    /// k.
    pub every: usize,
    /// Slips that were given.
    pub count: usize,
}

impl<T> EveryKth<T> {
    const fn new() -> Self {
        Self {
            kept: Vec::new(),
            every: 1,
            count: 0,
        }
    }

    fn push(&mut self, slip: T) {
        if self.count.is_multiple_of(self.every) {
            self.kept.push(slip);
        }
        self.count += 1;
        if self.kept.len() > MAX_SLIPS {
            self.every *= 2;
            let mut is_kept = [true, false].into_iter().cycle();
            self.kept.retain(|_| is_kept.next() == Some(true));
        }
    }
}

/// Some of the slips of these sets for which a condition holds.
pub fn sample_of_slips(
    results: &Results<'_>,
    sets: &[SetRow],
    condition: Option<&Condition>,
) -> Result<EveryKth<SlipOfSet>, ResultsError> {
    let mut slips = EveryKth::new();
    each_slip(results, sets, |_, slip| {
        if condition.is_none_or(|condition| condition.holds(&slip)) {
            slips.push(slip);
        }
    })?;
    Ok(slips)
}

/// Every k-th slip of these sets, as a point of the standing figures.
pub fn points_of(results: &Results<'_>, sets: &[SetRow]) -> Result<Vec<Point>, ResultsError> {
    let mut points = EveryKth::new();
    each_slip(results, sets, |set, (_, (_, slip, _))| {
        points.push(Point {
            has_phase: sets[set].has_phase,
            ..Point::of(&sets[set].parameters, &slip)
        });
    })?;
    Ok(points.kept)
}

/// Gives the values of a formula of columns of sets their intervals, if these are statistics and parameters.
pub fn add_intervals(
    results: &Results<'_>,
    sets: &[SetRow],
    values: &mut Values,
) -> Result<(), ResultsError> {
    let columns = SetRow::columns();
    let has_jobs = has_jobs(results)?;
    let is_measured = values
        .sources
        .iter()
        .any(|source| Statistic::from_key(&source.name).is_some());
    let Some(formula) = formula(values.name(), &columns)
        .ok()
        .filter(|_| is_measured && has_jobs)
    else {
        return Ok(());
    };
    let names: Vec<usize> = formula.names().into_iter().copied().collect();
    let ids = sets.iter().map(|set| set.set_id.clone());
    let places: HashMap<String, usize> = ids.zip(0..).collect();
    Gathering::of_jobs(results, &|_| true)?.each_set(
        MAX_SLIPS_AT_ONCE,
        u64::MAX,
        |set, explained| {
            let Some(&place) = places.get(&set.jobs.set_id) else {
                return Ok(());
            };
            let finished = set.finish_with(explained).0;
            let of = names
                .iter()
                .map(|column| finished.estimate(&columns[*column]));
            let found = of.collect::<Option<Vec<_>>>().map(|of| {
                let value = |values: &[f64]| {
                    let known: HashMap<usize, f64> =
                        names.iter().copied().zip(values.iter().copied()).collect();
                    formula.evaluate(&|column| known[column])
                };
                Estimate::of_all(&of.iter().collect::<Vec<_>>(), value)
            });
            values.intervals[place] = found.as_ref().and_then(Estimate::interval);
            Ok(())
        },
    )
}

/// The means over the slips of each set of a column of slips, or a formula of such; `None` if it is neither.
/// Angles are refused.
pub fn means_of_slips(
    results: &Results<'_>,
    sets: &[SetRow],
    name: &str,
) -> Result<Option<Values>, ResultsError> {
    let columns = SlipOfSet::columns();
    let unknown = gaps(results.sweep()).unknown;
    let is_known = |formula: &Expression<usize>| {
        let mut names = formula.names().into_iter();
        names.all(|place| !unknown.contains(&columns[*place].name))
    };
    let Some(formula) = formula(name, &columns).ok().filter(is_known) else {
        return Ok(None);
    };
    if matches!(formula, Expression::Name(place) if columns[place].unit == ANGLE) {
        let problem = format!(
            "{name}: an angle has no plain mean; phase_mean is the circular mean of the phase"
        );
        return Err(ResultsError::refused(results.layout().root(), problem));
    }
    let mut jobs: Vec<BTreeMap<u64, Vec<f64>>> = vec![BTreeMap::new(); sets.len()];
    each_slip(results, sets, |place, slip| {
        let value = super::values::evaluate(&formula, &slip);
        if value.is_finite() {
            jobs[place].entry(slip.0.0.seed).or_default().push(value);
        }
    })?;
    let found = jobs.into_iter().map(|jobs| {
        let by_seed: Vec<(u64, Vec<f64>)> = jobs.into_iter().collect();
        let [mean, _] = Numbers::of(&by_seed, 0.0).estimates(0.0);
        Estimate::both(mean.as_ref())
    });
    Ok(Some(Values::of_numbers(name, &formula, &columns, found)))
}
