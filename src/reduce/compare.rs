//! Sets of two directories compared seed by seed. A seed gives the same disorder in both, so its effect cancels in
//! their difference, and smaller effects show than in two separate intervals. Measured slips have no such pair: all
//! their series count, and the errors of both sides are independent.
//!
//! Values are those of the table of sets, of the jobs with seeds that both have.

use super::differences::Difference;
use super::estimate::Estimate;
use super::gather::{Gathering, MAX_SLIPS, sets_of};
use super::set::{FinishedSet, SetJobs};
use super::values::Values;
use crate::model::{Parameters, Symbol};
use crate::results::tables::RecordedTable;
use crate::results::{Results, ResultsError};
use crate::sets::{SetRow, by_frequency, column_of, label};
use crate::table::columns::Kind;
use std::collections::{BTreeMap, HashMap};

/// What the names and labels of columns of a side end with, and of their difference.
const A: (&str, &str) = ("a", ", A");
const B: (&str, &str) = ("b", ", B");
const DIFFERENCE: (&str, &str) = ("difference", ", B − A");
/// What is compared: columns of the sets.
const STATISTICS: [&str; 3] = ["tau_mean", "mean_friction", "resultant_length"];

/// The sets of a directory with a job that did not fail, controls left out.
fn sets_in(results: &Results<'_>) -> Result<Vec<SetJobs>, ResultsError> {
    let plan = results.plan();
    let mut sets = sets_of(&results.dataset(RecordedTable::Jobs)?, &|set| {
        !plan.is_control(set)
    })?;
    sets.retain(|set| !set.finished.is_empty());
    by_frequency(&mut sets, |set| &set.parameters);
    Ok(sets)
}

fn varies(sets: &[SetJobs], symbol: Symbol) -> bool {
    let values = || sets.iter().map(|set| set.parameters.get(symbol));
    symbol != Symbol::Seed && values().any(|value| Some(value) != values().next())
}

/// A set of A and one of B, with the seeds that both have, or all seeds of each, in order.
struct Pair<'a> {
    a: &'a SetJobs,
    b: &'a SetJobs,
    seeds_of_a: Vec<u64>,
    seeds_of_b: Vec<u64>,
}

/// The sets with these seeds, by their ids.
fn found_in(
    results: &Results<'_>,
    wanted: &HashMap<&str, &[u64]>,
) -> Result<HashMap<String, FinishedSet>, ResultsError> {
    let is_wanted = |parameters: &Parameters| {
        let seeds = wanted.get(&*results.sweep().set_id(parameters));
        seeds.is_some_and(|seeds| seeds.binary_search(&parameters.seed).is_ok())
    };
    let mut found = HashMap::new();
    Gathering::of_jobs(results, &is_wanted)?.each_set(MAX_SLIPS, u64::MAX, |set, _| {
        found.insert(set.jobs.set_id.clone(), set.slips.finish(&set.jobs));
        Ok(())
    })?;
    Ok(found)
}

/// Sets of A and B that agree in these parameters, with their common seeds, of which there are any, or all.
fn pairs<'a>(
    a: &'a [SetJobs],
    b: &'a [SetJobs],
    keys: &[Symbol],
    have_common_seeds: bool,
) -> Vec<Pair<'a>> {
    let key = |set: &SetJobs| {
        let values = keys
            .iter()
            .map(|&symbol| set.parameters.get(symbol).to_string());
        values.collect::<Vec<_>>()
    };
    let mut of_b: BTreeMap<Vec<String>, Vec<&SetJobs>> = BTreeMap::new();
    for set in b {
        of_b.entry(key(set)).or_default().push(set);
    }
    let pair = |set: &'a SetJobs, other: &'a SetJobs| {
        let is_used =
            |seeds: &SetJobs, seed: &u64| !have_common_seeds || seeds.finished.contains(seed);
        let seeds_of_a = set.finished.iter().filter(|seed| is_used(other, seed));
        let seeds_of_b = other.finished.iter().filter(|seed| is_used(set, seed));
        let pair = Pair {
            a: set,
            b: other,
            seeds_of_a: seeds_of_a.copied().collect(),
            seeds_of_b: seeds_of_b.copied().collect(),
        };
        (!pair.seeds_of_a.is_empty()).then_some(pair)
    };
    let others = |set: &SetJobs| of_b.get(&key(set)).cloned().unwrap_or_default();
    let all = a
        .iter()
        .flat_map(|set| others(set).into_iter().map(move |other| (set, other)));
    all.filter_map(|(set, other)| pair(set, other)).collect()
}

/// Two directories A and B side by side.
pub struct Comparison {
    /// Of their sets that agree in all parameters that either varies and both know: the parameters that either varies,
    /// the seeds that count, and mean interval, mean friction and resultant length in A, in B, and their differences
    /// B - A with 95 % intervals.
    pub columns: Vec<Values>,
    /// In what all sets of A differ from all of B.
    pub differences: Vec<Difference>,
}

pub fn compare(a: &Results<'_>, b: &Results<'_>) -> Result<Comparison, ResultsError> {
    let sets_of_a = sets_in(a)?;
    let sets_of_b = sets_in(b)?;
    let both = [&sets_of_a, &sets_of_b];
    let parameters = both.map(|sets| sets.iter().map(|set| &set.parameters).collect());
    let mut differences = Difference::all(&parameters);
    let is_varied = |key: &Symbol| both.iter().any(|sets| varies(sets, *key));
    let varied: Vec<Symbol> = Symbol::ALL.into_iter().filter(is_varied).collect();
    differences.retain(|found| found.is_constant() && !varied.contains(&found.symbol));
    let unknown = |key: &Symbol| {
        let mut sets = both.iter().filter_map(|sets| sets.first());
        sets.any(|set| set.parameters.unknown.contains(key))
    };
    let keys: Vec<Symbol> = varied.iter().copied().filter(|key| !unknown(key)).collect();
    let have_common_seeds = [a, b]
        .iter()
        .all(|results| results.sweep().measured().is_none());
    let pairs = pairs(&sets_of_a, &sets_of_b, &keys, have_common_seeds);
    let of_a = pairs
        .iter()
        .map(|pair| (&*pair.a.set_id, &*pair.seeds_of_a));
    let found_in_a = found_in(a, &of_a.collect())?;
    let of_b = pairs
        .iter()
        .map(|pair| (&*pair.b.set_id, &*pair.seeds_of_b));
    let found_in_b = found_in(b, &of_b.collect())?;
    let of_pair = |pair: &Pair<'_>| (&found_in_a[&pair.a.set_id], &found_in_b[&pair.b.set_id]);
    let sets: Vec<(&FinishedSet, &FinishedSet)> = pairs.iter().map(of_pair).collect();

    let column = |name: &str, (side, words): (&str, &str), kind, found: Vec<_>| {
        let of_side = label(name).with(words);
        Values::computed(&format!("{name}_{side}"), of_side, kind, found)
    };
    let seeds = |side, count: fn(&Pair<'_>) -> usize| {
        let counts = pairs.iter().map(|pair| (Some(count(pair) as f64), None));
        column("seeds", side, Kind::Count, counts.collect())
    };
    let mut found = vec![
        seeds(A, |pair| pair.seeds_of_a.len()),
        seeds(B, |pair| pair.seeds_of_b.len()),
    ];
    for name in STATISTICS {
        let of = |set: &FinishedSet| set.estimates.get(name).cloned();
        let difference = |(a, b): &(&FinishedSet, &FinishedSet)| {
            let in_a = of(a).map(|a| if have_common_seeds { a } else { a.apart() });
            let both = of(b).zip(in_a);
            let difference = both.map(|(b, a)| Estimate::function([&b, &a], |[b, a]| b - a));
            Estimate::both(difference.as_ref())
        };
        let number = |set: &FinishedSet| (of(set).map(|found| found.value), None);
        let in_a = sets.iter().map(|(a, _)| number(a)).collect();
        let in_b = sets.iter().map(|(_, b)| number(b)).collect();
        let differences = sets.iter().map(difference).collect();
        let mut of_statistic = [(A, in_a), (B, in_b), (DIFFERENCE, differences)]
            .map(|(side, found)| column(name, side, Kind::Real, found));
        let sizes = of_statistic.iter().map(|values| values.largest);
        let largest = sizes.fold(0.0, f64::max);
        for values in &mut of_statistic {
            values.largest = largest;
        }
        found.extend(of_statistic);
    }
    found.retain(|values| values.numbers.iter().any(Option::is_some));
    let of_a: Vec<SetRow> = sets.iter().map(|(a, _)| a.row.clone()).collect();
    let of_b: Vec<SetRow> = sets.iter().map(|(_, b)| b.row.clone()).collect();
    let parameters = varied.into_iter().filter_map(|key| {
        let is_of_a = sets_of_a
            .iter()
            .all(|set| !set.parameters.unknown.contains(&key));
        Values::of(if is_of_a { &of_a } else { &of_b }, column_of(key)).ok()
    });
    Ok(Comparison {
        columns: parameters.chain(found).collect(),
        differences,
    })
}
