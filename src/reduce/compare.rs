//! Sets of two directories compared seed by seed. A seed gives the same disorder in both, so what both owe to it drops out of
//! their difference, and smaller effects show than two separate intervals would tell.

use super::circular::unit;
use super::gather::{JobOfSet, each_job};
use super::sequence::Sequences;
use super::set::SetRow;
use super::values::{FREQUENCY, Values};
use crate::model::selected::Selected;
use crate::model::{Parameters, Symbol};
use crate::results::tables::{JOBS, JobOfSlip, SLIPS};
use crate::results::{Results, ResultsError};
use crate::table::columns::{Column, Kind, columns};
use std::cmp::Ordering;
use std::collections::BTreeMap;

columns! {
    struct Compared {
        interval: Option<f64>;
        phase: Option<f64>;
    }
}

/// What is compared: columns of the sets.
const STATISTICS: [&str; 3] = ["tau_mean", "mean_friction", "resultant_length"];

/// Sums over a job: of the intervals, the number of them; the force over time, the time; the vectors of phases, their number.
type Sums = [f64; 7];

/// The jobs of a set by their seeds.
type Set = (Parameters, BTreeMap<u64, Sums>);

fn statistics(jobs: impl Iterator<Item = Sums>) -> [Option<f64>; 3] {
    let total = jobs.fold(Sums::default(), |total, job| {
        std::array::from_fn(|index| total[index] + job[index])
    });
    let [intervals, count, force, time, x, y, phases] = total;
    let ratio = |sum: f64, of: f64| (of > 0.0).then(|| sum / of);
    [
        ratio(intervals, count),
        ratio(force, time),
        ratio(libm::hypot(x, y), phases),
    ]
}

fn sets_of(results: &Results<'_>) -> Result<Vec<Set>, ResultsError> {
    let sweep = results.sweep();
    let jobs = results.dataset(JOBS)?;
    let slips = results.committed_files(SLIPS, &jobs)?;
    let mut sets: BTreeMap<String, Set> = BTreeMap::new();
    each_job(
        &jobs,
        &|parameters| !sweep.is_control(parameters),
        |JobOfSet { set_id, facts }, parameters| {
            let seed = parameters.seed;
            let (_, jobs) = sets
                .entry(set_id)
                .or_insert_with(|| (parameters, BTreeMap::new()));
            let friction = facts.averaged_time.zip(facts.mean_friction);
            let (time, force) =
                friction.map_or((0.0, 0.0), |(time, friction)| (time, time * friction));
            jobs.insert(seed, [0.0, 0.0, force, time, 0.0, 0.0, 0.0]);
        },
    )?;
    for batch in slips.rows::<(JobOfSlip, Compared)>() {
        for (job, Compared { interval, phase }) in batch? {
            let Some(sums) = sets
                .get_mut(&job.set_id)
                .and_then(|(_, jobs)| jobs.get_mut(&job.seed))
            else {
                continue;
            };
            let [x, y] = phase.map_or([0.0; 2], unit);
            let one = |is_there: bool| f64::from(u8::from(is_there));
            let slip = [
                interval.unwrap_or(0.0),
                one(interval.is_some()),
                0.0,
                0.0,
                x,
                y,
                one(phase.is_some()),
            ];
            sums.iter_mut()
                .zip(slip)
                .for_each(|(sum, slip)| *sum += slip);
        }
    }
    let mut sets: Vec<Set> = sets.into_values().collect();
    sets.sort_by(|(left, _), (right, _)| {
        let key = |set: &Parameters| Symbol::ALL.map(|symbol| set.get(symbol));
        key(left)
            .partial_cmp(&key(right))
            .unwrap_or(Ordering::Equal)
    });
    Ok(sets)
}

/// Parameters that differ between sets.
fn varied(sets: &[Set]) -> impl Fn(&Symbol) -> bool {
    |symbol| {
        *symbol != Symbol::Seed
            && sets
                .iter()
                .any(|(set, _)| set.get(*symbol) != sets[0].0.get(*symbol))
    }
}

/// Sets of two directories A and B that agree in all parameters that either varies: these parameters, the common seeds, and
/// mean interval, mean friction and resultant length in A, in B, and their differences B - A with 95 % intervals, from the
/// jackknife over common seeds.
pub fn compare(a: &Results<'_>, b: &Results<'_>) -> Result<Vec<Values>, ResultsError> {
    let (a, b) = (sets_of(a)?, sets_of(b)?);
    let keys: Vec<Symbol> = Symbol::ALL
        .into_iter()
        .filter(|key| varied(&a)(key) || varied(&b)(key))
        .collect();
    let key = |set: &Parameters| {
        keys.iter()
            .map(|&symbol| set.get(symbol).to_string())
            .collect::<Vec<_>>()
    };
    let of_b: BTreeMap<Vec<String>, &BTreeMap<u64, Sums>> =
        b.iter().map(|(set, jobs)| (key(set), jobs)).collect();
    let mut found: [Values; 10] = std::array::from_fn(|index| {
        let name = match index.checked_sub(1) {
            None => "seeds".to_owned(),
            Some(index) => format!(
                "{}_{}",
                STATISTICS[index / 3],
                ["a", "b", "difference"][index % 3]
            ),
        };
        let column = Column {
            name: name.into(),
            unit: "",
            meaning: "",
            kind: Kind::Real,
            nullable: true,
        };
        Values {
            column,
            numbers: Vec::new(),
            intervals: Vec::new(),
            words: Vec::new(),
        }
    });
    let mut rows = Vec::new();
    for (set, of_a) in &a {
        let Some(of_b) = of_b.get(&key(set)) else {
            continue;
        };
        let seeds: Vec<u64> = of_a
            .keys()
            .copied()
            .filter(|seed| of_b.contains_key(seed))
            .collect();
        let without = |left_out: Option<u64>| {
            let kept = seeds.iter().filter(move |&&seed| Some(seed) != left_out);
            [of_a, *of_b].map(|jobs| statistics(kept.clone().map(|seed| jobs[seed])))
        };
        let ([in_a, in_b], parts) = (
            without(None),
            seeds
                .iter()
                .map(|&seed| without(Some(seed)))
                .collect::<Vec<_>>(),
        );
        rows.push(SetRow {
            parameters: Selected::new(set.clone()),
            ..SetRow::default()
        });
        let count = seeds.len() as f64;
        let mut put = |index: usize, number: Option<f64>, interval| {
            found[index].numbers.push(number);
            found[index].intervals.push(interval);
        };
        put(0, Some(count), None);
        for index in 0..STATISTICS.len() {
            let difference = |[a, b]: [[Option<f64>; 3]; 2]| Some(b[index]? - a[index]?);
            let whole = difference([in_a, in_b]);
            let pseudo: Option<Vec<[f64; 1]>> = parts
                .iter()
                .map(|part| Some([count * whole? - (count - 1.0) * difference(*part)?]))
                .collect();
            let interval =
                pseudo.and_then(|values| Sequences::independent(values).estimate().interval());
            put(3 * index + 1, in_a[index], None);
            put(3 * index + 2, in_b[index], None);
            put(
                3 * index + 3,
                whole,
                interval.map(|interval| (interval.low, interval.high)),
            );
        }
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
    let found = found
        .into_iter()
        .filter(|values| values.numbers.iter().any(Option::is_some));
    Ok(parameters.chain(found).collect())
}
