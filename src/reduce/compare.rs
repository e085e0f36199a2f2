//! Sets of two directories compared seed by seed. A seed gives the same disorder in both, so what both owe to it drops out of
//! their difference, and smaller effects show than two separate intervals would tell.
//!
//! Values are those of the table of sets, of the jobs with seeds that both have. The error of a difference is that of a mean
//! over these seeds, of what each adds to it: the jackknife to first order, in a time proportional to the number of slips.

use super::circular::unit;
use super::gather::{Gathering, JobOfSet, MAX_SLIPS, each_job};
use super::sequence::Sequences;
use super::set::SetRow;
use super::sum::Sum;
use super::values::{FREQUENCY, Values};
use crate::model::{Parameters, Symbol};
use crate::results::tables::{JOBS, JobOfSlip, JobOutcome, SLIPS};
use crate::results::{Results, ResultsError};
use crate::table::columns::{Column, Kind, columns};
use std::cmp::Ordering;
use std::collections::{BTreeMap, HashMap};

columns! {
    struct Compared {
        interval: Option<f64>;
        phase: Option<f64>;
    }
}

/// What is compared: columns of the sets.
const STATISTICS: [&str; 3] = ["tau_mean", "mean_friction", "resultant_length"];

/// The jobs of a set.
struct Set {
    id: String,
    parameters: Parameters,
    /// By their seeds: sums of what makes each of the statistics.
    jobs: BTreeMap<u64, [Sum; 3]>,
}

fn sets_of(results: &Results<'_>) -> Result<Vec<Set>, ResultsError> {
    let plan = results.plan();
    let jobs = results.dataset(JOBS)?;
    let slips = results.committed_files(SLIPS, &jobs)?;
    let mut sets: HashMap<String, Set> = HashMap::new();
    each_job(
        &jobs,
        &|parameters| !plan.is_control(parameters),
        |JobOfSet { set_id, facts }, parameters| {
            if facts.outcome == JobOutcome::Failed {
                return;
            }
            let seed = parameters.seed;
            let mut friction = Sum::default();
            if let Some((time, force)) = facts.averaged_time.zip(facts.mean_friction) {
                friction.push([time * force, 0.0], time);
            }
            sets.entry(set_id)
                .or_insert_with_key(|id| Set {
                    id: id.clone(),
                    parameters,
                    jobs: BTreeMap::new(),
                })
                .jobs
                .insert(seed, [Sum::default(), friction, Sum::default()]);
        },
    )?;
    for batch in slips.rows::<(JobOfSlip, Compared)>() {
        for (job, slip) in batch? {
            let set = sets.get_mut(&job.set_id);
            let Some([tau, _, phase]) = set.and_then(|set| set.jobs.get_mut(&job.seed)) else {
                continue;
            };
            if let Some(interval) = slip.interval {
                tau.push([interval, 0.0], 1.0);
            }
            if let Some(angle) = slip.phase {
                phase.push(unit(angle), 1.0);
            }
        }
    }
    let mut sets: Vec<Set> = sets.into_values().collect();
    sets.sort_by(|left, right| {
        let key = |set: &Set| Symbol::ALL.map(|symbol| set.parameters.get(symbol));
        let orders = key(left).partial_cmp(&key(right));
        orders.unwrap_or(Ordering::Equal)
    });
    Ok(sets)
}

/// Parameters that differ between sets.
fn varied(sets: &[Set]) -> impl Fn(&Symbol) -> bool {
    |symbol| {
        *symbol != Symbol::Seed
            && sets
                .iter()
                .any(|set| set.parameters.get(*symbol) != sets[0].parameters.get(*symbol))
    }
}

/// A set of A and one of B, with the seeds that both have, in order.
struct Pair<'a> {
    sets: [&'a Set; 2],
    seeds: Vec<u64>,
}

/// The rows of the sets on one side of the pairs, of the jobs with their seeds.
fn rows_of(
    results: &Results<'_>,
    pairs: &[Pair<'_>],
    side: usize,
) -> Result<HashMap<String, SetRow>, ResultsError> {
    let wanted: HashMap<&str, &[u64]> = pairs
        .iter()
        .map(|pair| (&*pair.sets[side].id, &*pair.seeds))
        .collect();
    let is_wanted = |parameters: &Parameters| {
        wanted
            .get(&*results.sweep().set_id(parameters))
            .is_some_and(|seeds| seeds.binary_search(&parameters.seed).is_ok())
    };
    let mut rows = HashMap::new();
    Gathering::of_jobs(results, &is_wanted)?.each_set(MAX_SLIPS, u64::MAX, |set, _| {
        let row = set.slips.finish(set.jobs).row;
        rows.insert(row.set_id.clone(), row);
        Ok(())
    })?;
    Ok(rows)
}

/// A column of what is found, empty so far.
fn empty(name: String, kind: Kind) -> Values {
    let column = Column {
        name: name.into(),
        unit: "",
        meaning: "",
        kind,
        nullable: true,
    };
    Values {
        column,
        numbers: Vec::new(),
        intervals: Vec::new(),
        words: Vec::new(),
    }
}

/// Sets of two directories A and B that agree in all parameters that either varies: these parameters, the common seeds, and
/// mean interval, mean friction and resultant length in A, in B, and their differences B - A with 95 % intervals.
pub fn compare(a: &Results<'_>, b: &Results<'_>) -> Result<Vec<Values>, ResultsError> {
    let sets = [sets_of(a)?, sets_of(b)?];
    let keys: Vec<Symbol> = Symbol::ALL
        .into_iter()
        .filter(|key| sets.iter().any(|sets| varied(sets)(key)))
        .collect();
    let key = |set: &Set| {
        keys.iter()
            .map(|&symbol| set.parameters.get(symbol).to_string())
            .collect::<Vec<_>>()
    };
    let of_b: BTreeMap<Vec<String>, &Set> = sets[1].iter().map(|set| (key(set), set)).collect();
    let pair = |set| {
        let other = of_b.get(&key(set)).copied()?;
        let is_common = |seed: &&u64| other.jobs.contains_key(seed);
        Some(Pair {
            sets: [set, other],
            seeds: set.jobs.keys().filter(is_common).copied().collect(),
        })
    };
    let mut pairs: Vec<Pair<'_>> = sets[0].iter().filter_map(pair).collect();
    pairs.retain(|pair| !pair.seeds.is_empty());
    let rows_of_a = rows_of(a, &pairs, 0)?;
    let rows_of_b = rows_of(b, &pairs, 1)?;

    let mut rows = Vec::new();
    let mut seeds = empty("seeds".to_owned(), Kind::Count);
    let mut found = STATISTICS.map(|name| {
        ["a", "b", "difference"].map(|which| empty(format!("{name}_{which}"), Kind::Real))
    });
    for pair in &pairs {
        let [row_of_a, row_of_b] = [&rows_of_a[&pair.sets[0].id], &rows_of_b[&pair.sets[1].id]];
        seeds.numbers.push(Some(pair.seeds.len() as f64));
        seeds.intervals.push(None);
        for (index, [in_a, in_b, difference]) in found.iter_mut().enumerate() {
            let [of_a, of_b] = [row_of_a, row_of_b].map(|row| row.number(STATISTICS[index]));
            let whole = of_b.zip(of_a).map(|(b, a)| b - a);
            let [added_a, added_b] = pair.sets.map(|set| {
                let sums = pair.seeds.iter().map(|seed| set.jobs[seed][index]);
                Sum::added(&sums.collect::<Vec<_>>())
            });
            let added = added_a.iter().zip(added_b).map(|(a, b)| [b - a]);
            let around_zero = Sequences::independent(added.collect())
                .estimate()
                .interval();
            let interval = whole
                .zip(around_zero)
                .map(|(whole, interval)| (whole + interval.low, whole + interval.high));
            for (values, number, interval) in [
                (in_a, of_a, None),
                (in_b, of_b, None),
                (difference, whole, interval),
            ] {
                values.numbers.push(number);
                values.intervals.push(interval);
            }
        }
        rows.push(row_of_a.clone());
    }
    let column = |symbol: &Symbol| {
        if *symbol == Symbol::T {
            FREQUENCY
        } else {
            symbol.key()
        }
    };
    let parameters = keys
        .iter()
        .filter_map(|symbol| Values::of(&rows, column(symbol)).ok());
    let found = std::iter::once(seeds)
        .chain(found.into_iter().flatten())
        .filter(|values| values.numbers.iter().any(Option::is_some));
    Ok(parameters.chain(found).collect())
}
