//! Sets of two directories compared seed by seed. A seed gives the same disorder in both, so its effect cancels in their
//! difference, and smaller effects show than in two separate intervals.
//!
//! Values are those of the table of sets, of the jobs with seeds that both have. The error of a difference is that of a mean
//! over these seeds, of what each adds to it: the jackknife to first order, in a time proportional to the number of slips.

use super::circular::{Sum, unit};
use super::gather::{Gathering, JobOfSet, MAX_SLIPS, each_job};
use super::sequence::Sequences;
use super::values::Values;
use crate::model::{Parameters, Symbol};
use crate::results::tables::{JOBS, JobOfSlip, JobOutcome, SLIPS};
use crate::results::{Results, ResultsError};
use crate::sets::{FREQUENCY, SetRow};
use crate::table::columns::{Interval, Kind, columns};
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};

columns! {
    struct Compared {
        interval: Option<f64>;
        phase: Option<f64>;
    }
}

/// Sums of a job, whose means are the statistics.
#[derive(Clone, Copy, Debug, Default)]
struct JobSums {
    interval: Sum,
    friction: Sum,
    phase: Sum,
}

type SumOf = fn(&JobSums) -> Sum;

/// What is compared: columns of the sets, and their sums.
const STATISTICS: [(&str, SumOf); 3] = [
    ("tau_mean", |job| job.interval),
    ("mean_friction", |job| job.friction),
    ("resultant_length", |job| job.phase),
];

/// The jobs of a set.
struct Set {
    id: String,
    parameters: Parameters,
    /// By their seeds.
    jobs: BTreeMap<u64, JobSums>,
}

fn sets_of(results: &Results<'_>) -> Result<Vec<Set>, ResultsError> {
    let plan = results.plan();
    let jobs = results.dataset(JOBS)?;
    let slips = results.committed_files(SLIPS, &jobs)?;
    let mut sets: HashMap<String, Set> = HashMap::new();
    let is_wanted = |parameters: &Parameters| !plan.is_control(parameters);
    each_job(
        &jobs,
        &is_wanted,
        |JobOfSet { set_id, facts }, parameters| {
            if facts.outcome == JobOutcome::Failed {
                return;
            }
            let seed = parameters.seed;
            let mut sums = JobSums::default();
            if let Some((time, force)) = facts.averaged_time.zip(facts.mean_friction) {
                sums.friction.push([time * force, 0.0], time);
            }
            let new = |id: &String| Set {
                id: id.clone(),
                parameters,
                jobs: BTreeMap::new(),
            };
            let set = sets.entry(set_id).or_insert_with_key(new);
            set.jobs.insert(seed, sums);
        },
    )?;
    for batch in slips.rows::<(JobOfSlip, Compared)>() {
        for (job, slip) in batch? {
            let set = sets.get_mut(&job.set_id);
            let Some(sums) = set.and_then(|set| set.jobs.get_mut(&job.seed)) else {
                continue;
            };
            if let Some(interval) = slip.interval {
                sums.interval.push([interval, 0.0], 1.0);
            }
            if let Some(angle) = slip.phase {
                sums.phase.push(unit(angle), 1.0);
            }
        }
    }
    let mut sets: Vec<Set> = sets.into_values().collect();
    sets.sort_by(|left, right| {
        let key = |set: &Set| Symbol::ALL.map(|symbol| set.parameters.get(symbol));
        let order = key(left).partial_cmp(&key(right));
        order.unwrap_or(Ordering::Equal)
    });
    Ok(sets)
}

/// Whether a parameter differs between sets.
fn varies(sets: &[Set], symbol: Symbol) -> bool {
    let values = || sets.iter().map(|set| set.parameters.get(symbol));
    symbol != Symbol::Seed && values().any(|value| Some(value) != values().next())
}

/// A set of A and one of B, with the seeds that both have, in order.
struct Pair<'a> {
    a: &'a Set,
    b: &'a Set,
    seeds: Vec<u64>,
}

impl Pair<'_> {
    /// The interval of a difference B - A, less the difference itself.
    fn error(&self, sum: SumOf) -> Option<Interval> {
        let added = |set: &Set| {
            let sums = self.seeds.iter().map(|seed| sum(&set.jobs[seed]));
            Sum::added(&sums.collect::<Vec<_>>())
        };
        let added = added(self.a).into_iter().zip(added(self.b));
        let added = added.map(|(a, b)| [b - a]).collect();
        Sequences::independent(added).estimate().interval()
    }
}

/// The rows of sets, of the jobs with these seeds.
fn rows_of(
    results: &Results<'_>,
    wanted: &HashMap<&str, &[u64]>,
) -> Result<HashMap<String, SetRow>, ResultsError> {
    let is_wanted = |parameters: &Parameters| {
        let seeds = wanted.get(&*results.sweep().set_id(parameters));
        seeds.is_some_and(|seeds| seeds.binary_search(&parameters.seed).is_ok())
    };
    let mut rows = HashMap::new();
    Gathering::of_jobs(results, &is_wanted)?.each_set(MAX_SLIPS, u64::MAX, |set, _| {
        let row = set.slips.finish(&set.jobs).row;
        rows.insert(row.set_id.clone(), row);
        Ok(())
    })?;
    Ok(rows)
}

/// Sets of A and B that agree in these parameters and have seeds in common.
fn pairs<'a>(a: &'a [Set], b: &'a [Set], keys: &[Symbol]) -> Vec<Pair<'a>> {
    let key = |set: &Set| {
        let values = keys
            .iter()
            .map(|&symbol| set.parameters.get(symbol).to_string());
        values.collect::<Vec<_>>()
    };
    let of_b: BTreeMap<Vec<String>, &Set> = b.iter().map(|set| (key(set), set)).collect();
    let pair = |set: &'a Set| {
        let other = of_b.get(&key(set)).copied()?;
        let seeds = set.jobs.keys().copied();
        let seeds: Vec<u64> = seeds.filter(|seed| other.jobs.contains_key(seed)).collect();
        (!seeds.is_empty()).then_some(Pair {
            a: set,
            b: other,
            seeds,
        })
    };
    a.iter().filter_map(pair).collect()
}

/// Sets of two directories A and B that agree in all parameters that either varies: these parameters, the common seeds, and
/// mean interval, mean friction and resultant length in A, in B, and their differences B - A with 95 % intervals.
pub fn compare(a: &Results<'_>, b: &Results<'_>) -> Result<Vec<Values>, ResultsError> {
    let sets_of_a = sets_of(a)?;
    let sets_of_b = sets_of(b)?;
    let is_varied = |key: &Symbol| varies(&sets_of_a, *key) || varies(&sets_of_b, *key);
    let keys: Vec<Symbol> = Symbol::ALL.into_iter().filter(is_varied).collect();
    let pairs = pairs(&sets_of_a, &sets_of_b, &keys);
    let of_a = pairs.iter().map(|pair| (&*pair.a.id, &*pair.seeds));
    let rows_of_a = rows_of(a, &of_a.collect())?;
    let of_b = pairs.iter().map(|pair| (&*pair.b.id, &*pair.seeds));
    let rows_of_b = rows_of(b, &of_b.collect())?;

    let seeds = pairs
        .iter()
        .map(|pair| (Some(pair.seeds.len() as f64), None));
    let mut found = vec![Values::computed("seeds", Kind::Count, seeds)];
    for (name, sum) in STATISTICS {
        let of_a = |pair: &Pair<'_>| rows_of_a[&pair.a.id].number(name);
        let of_b = |pair: &Pair<'_>| rows_of_b[&pair.b.id].number(name);
        let difference = |pair: &Pair<'_>| {
            let whole = of_b(pair).zip(of_a(pair)).map(|(b, a)| b - a);
            let interval = whole.zip(pair.error(sum));
            let interval = interval.map(|(whole, error)| (whole + error.low, whole + error.high));
            (whole, interval)
        };
        let in_a = pairs.iter().map(|pair| (of_a(pair), None));
        let in_b = pairs.iter().map(|pair| (of_b(pair), None));
        let differences = pairs.iter().map(difference);
        let name = |which| format!("{name}_{which}");
        found.extend([
            Values::computed(&name("a"), Kind::Real, in_a),
            Values::computed(&name("b"), Kind::Real, in_b),
            Values::computed(&name("difference"), Kind::Real, differences),
        ]);
    }
    found.retain(|values| values.numbers.iter().any(Option::is_some));
    let rows = pairs.iter().map(|pair| rows_of_a[&pair.a.id].clone());
    let rows: Vec<SetRow> = rows.collect();
    let column = |symbol: &Symbol| match symbol {
        Symbol::T => FREQUENCY,
        symbol => symbol.key(),
    };
    let parameters = keys.iter().map(column);
    let parameters = parameters.filter_map(|name| Values::of(&rows, name).ok());
    Ok(parameters.chain(found).collect())
}
