//! How often intervals hold the true value: what stopping by looking does to that, and the intervals of all statistics
//! with the model.

use super::{need, seeds_for};
use crate::model::Parameters;
use crate::reduce::{
    Pool, PooledJob, Pulses, TriggerRow, Units, error_over_target, mean, quantile, read_optional,
};
use crate::results::layout::Layout;
use crate::sets::SetRow;
use crate::sets::{STATISTICS, Statistic};
use crate::sweep::{MIN_SEEDS, Precision, Target};
use crate::table::columns::Interval;
use crate::table::storage::Disk;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use std::f64::consts::TAU;
use std::path::Path;

const FROM: u64 = 4;
const MOST: u64 = 128;

/// What a number of repetitions came to.
#[derive(Debug)]
struct Found {
    /// Share of intervals that hold the true value, in %.
    coverage: f64,
    /// Seeds of a set, on average.
    seeds: f64,
    /// Share of sets that met the target, in %.
    met: f64,
}

/// Lets sets end by the rule; `row` is a repetition with some seeds.
fn ended(
    repetitions: u64,
    least: u64,
    precision: &Precision,
    truth: f64,
    row: impl Fn(u64, u64) -> SetRow,
) -> Found {
    let mut held = 0.0;
    let mut seeds_used = 0.0;
    let mut met = 0.0;
    for repetition in 0..repetitions {
        let mut seeds = FROM.min(least);
        let (last, error) = loop {
            let row = row(repetition, seeds);
            let error = error_over_target(&row, precision).unwrap();
            match seeds_for(seeds, error, least, MOST) {
                Some(more) if more > seeds => seeds = more,
                _ => break (row, error),
            }
        };
        let interval = last.mean_friction_interval.unwrap();
        held += f64::from(u8::from(interval.low <= truth && truth <= interval.high));
        met += f64::from(u8::from(error <= 1.0));
        seeds_used += seeds as f64;
    }
    let share = 100.0 / repetitions as f64;
    Found {
        coverage: share * held,
        seeds: seeds_used / repetitions as f64,
        met: share * met,
    }
}

fn precision(key: &str, target: Target) -> Precision {
    let statistics = Statistic::from_key(key).into_iter().collect();
    Precision { statistics, target }
}

/// Values of mean 0 and variance 1, one a seed.
fn draws(repetition: u64, is_skewed: bool) -> Vec<f64> {
    let mut generator = ChaCha8Rng::seed_from_u64(repetition);
    let mut uniform = || ((generator.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
    let mut draw = || {
        if is_skewed {
            // A gamma distribution of shape 4, of skewness 1.
            0.5 * (-(0..4).map(|_| libm::log(uniform())).sum::<f64>() - 4.0)
        } else {
            (-2.0 * libm::log(uniform())).sqrt() * libm::cos(TAU * uniform())
        }
    };
    (0..MOST).map(|_| draw()).collect()
}

fn of_draws(repetitions: u64, least: u64, target: f64, is_skewed: bool) -> Found {
    let all: Vec<Vec<f64>> = (0..repetitions)
        .map(|repetition| draws(repetition, is_skewed))
        .collect();
    let row = |repetition: u64, seeds: u64| {
        let of_seeds =
            &all[usize::try_from(repetition).unwrap()][..usize::try_from(seeds).unwrap()];
        let jobs = (0..).zip(of_seeds);
        let found = Units::of(jobs.map(|(seed, value)| (seed, vec![[1.0, *value, 0.0]])));
        let found = found.estimate(mean).unwrap();
        SetRow {
            mean_friction: Some(found.value),
            mean_friction_interval: found.interval(),
            ..SetRow::default()
        }
    };
    ended(
        repetitions,
        least,
        &precision("mean_friction", Target::Absolute(target)),
        0.0,
        row,
    )
}

/// Half-widths in standard deviations, which 8 to 64 seeds reach.
const TARGETS: [f64; 5] = [0.84, 0.7, 0.55, 0.4, 0.25];

#[test]
fn sets_that_end_when_they_are_precise_hold_the_true_value_as_often_as_they_say() {
    for target in TARGETS {
        // 2000 repetitions give coverage to 0.5 (standard error).
        let found = of_draws(2000, MIN_SEEDS, target, false);
        assert!(
            (93.0..97.0).contains(&found.coverage) && found.met > 99.9,
            "{target}: {found:?}"
        );
        // Of skewed values, intervals of a fixed number of seeds hold the true one in 94 to 95 %.
        let found = of_draws(2000, MIN_SEEDS, target, true);
        assert!(
            (92.0..97.0).contains(&found.coverage),
            "{target}, skewed: {found:?}"
        );
    }
}

#[test]
fn without_the_least_number_of_seeds_they_would_not() {
    let worst = TARGETS
        .map(|target| of_draws(2000, 2, target, false).coverage)
        .into_iter()
        .fold(100.0, f64::min);
    assert!(worst < 91.5, "{worst}");
}

/// Coverage with a minimum number of seeds, which `docs/rounds.md` sums up: run with `--ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn coverage_by_the_least_number_of_seeds_is_measured() {
    for is_skewed in [false, true] {
        for target in TARGETS {
            for least in [2, 4, 8, 16, MIN_SEEDS] {
                let Found {
                    coverage, seeds, ..
                } = of_draws(4000, least, target, is_skewed);
                println!(
                    "draws, skewed {is_skewed}, target {target}, least {least}: {coverage:.1} %, {seeds:.1} seeds"
                );
            }
        }
    }
}

/// Repetitions of a cell with a fixed number of jobs, and of one that ends by the rule of `[precision]`.
const REPETITIONS: u64 = 1000;
const REPETITIONS_BY_RULE: u64 = 400;
/// Jobs and slips of a job of the cells with a fixed number of jobs.
const SIZES: [(usize, usize); 11] = [
    (1, 30),
    (2, 15),
    (3, 5),
    (3, 15),
    (5, 5),
    (7, 15),
    (8, 8),
    (8, 15),
    (8, 30),
    (16, 15),
    (64, 14),
];
/// Jobs of a pool for each that a repetition takes, so that repetitions have few in common.
const SHARED: usize = 20;
/// Jobs of 15 slips that would do, of the cells that end by the rule of `[precision]`; and jobs at most.
const BY_RULE: f64 = 32.0;
const SLIPS_BY_RULE: usize = 15;
const MAX_JOBS: u64 = 64;
/// Jobs from which coverage and width are promised.
const MANY: usize = 8;
/// Coverage that 1,000 repetitions find of a true one of 91 %, at least, in %.
const MIN_COVERAGE: f64 = 89.5;
/// The same from [`FEW`] jobs on.
const MIN_COVERAGE_OF_FEW: f64 = 85.0;
/// Half-width over the ideal one above which cells are listed.
const MAX_WIDTH: f64 = 6.0;
/// A multiple of `mean_friction`, with the same coverage.
const NOT_LISTED: &str = "friction_coefficient";
/// Jobs from which fewer are promised to do, in the same.
const FEW: usize = 3;
/// The pools that `scripts/coverage` makes, each with one of long jobs.
const POOLS: [&str; 12] = [
    "locking",
    "deep",
    "short",
    "slow",
    "loose",
    "two",
    "two-large",
    "strong",
    "strong-large",
    "long-periods",
    "fast",
    "rare",
];

fn read_pool(folder: &Path, name: &str) -> Pool {
    let folder = folder.join(format!("coverage-{name}"));
    Pool::of(&Layout::new(&Disk, &folder)).unwrap()
}

/// Distinct jobs of a set, by the number of the repetition: the first some of a keyed permutation.
fn of_repetition<J>(jobs: &[J], repetition: u64, most: usize) -> Vec<&J> {
    let mut generator = ChaCha8Rng::seed_from_u64(repetition);
    let mut moved: HashMap<usize, usize> = HashMap::new();
    let next = |place: usize| {
        let other =
            place + usize::try_from(generator.next_u64() % (jobs.len() - place) as u64).unwrap();
        let taken = *moved.get(&other).unwrap_or(&other);
        let here = *moved.get(&place).unwrap_or(&place);
        moved.insert(other, here);
        &jobs[taken]
    };
    (0..most).map(next).collect()
}

/// A statistic of a repetition, less its true value, and the ends of its interval; of an angle, within half a turn.
#[derive(Clone, Copy, Debug)]
struct Repetition {
    off: f64,
    low: f64,
    high: f64,
}

impl Repetition {
    fn of(row: &SetRow, truth: &SetRow, statistic: Statistic) -> Option<Self> {
        let (value, interval) = row.estimate(statistic.key)?;
        let Interval { low, high } = interval?;
        let off = value - truth.number(statistic.key)?;
        let turns = if statistic.is_angle() {
            TAU * (off / TAU).round()
        } else {
            0.0
        };
        Some(Self {
            off: off - turns,
            low: off - turns + low - value,
            high: off - turns + high - value,
        })
    }

    fn holds(&self) -> bool {
        self.low <= 0.0 && 0.0 <= self.high
    }
}

/// What the repetitions of a cell came to.
#[derive(Clone, Copy, Debug)]
struct CoverageCell {
    /// Share of intervals that hold the true value, in %.
    coverage: f64,
    /// Mean half-width over 1.96 times the root of the mean square error.
    width: f64,
}

impl CoverageCell {
    /// `None` if fewer than half of the repetitions have an interval.
    fn of(all: &[Option<Repetition>]) -> Option<Self> {
        let found: Vec<Repetition> = all.iter().copied().flatten().collect();
        if 2 * found.len() < all.len() {
            return None;
        }
        let mean = |of: &dyn Fn(&Repetition) -> f64| {
            found.iter().map(of).sum::<f64>() / found.len() as f64
        };
        let error = mean(&|one| one.off * one.off).sqrt();
        Some(Self {
            coverage: 100.0 * mean(&|one| f64::from(u8::from(one.holds()))),
            width: mean(&|one| 0.5 * (one.high - one.low)) / (1.96 * error),
        })
    }
}

/// The cells of a set, by statistics and then sizes: fixed numbers of jobs, then those that end by the rule. None of
/// those for which the pool is too small.
fn cells(
    pool: &Pool,
    set: usize,
    truth: &SetRow,
    statistics: &[Statistic],
) -> Vec<Vec<Option<CoverageCell>>> {
    let jobs = &pool.sets[set].1;
    let mut found = vec![Vec::new(); statistics.len()];
    for (count, slips) in SIZES {
        if SHARED * count > jobs.len() {
            for cells in &mut found {
                cells.push(None);
            }
            continue;
        }
        let repetitions: Vec<Vec<Option<Repetition>>> = (0..REPETITIONS)
            .into_par_iter()
            .map(|repetition| {
                let row = pool.row(set, of_repetition(jobs, repetition, count), slips);
                let of = |statistic: &Statistic| Repetition::of(&row, truth, *statistic);
                statistics.iter().map(of).collect()
            })
            .collect();
        for (index, of_statistic) in found.iter_mut().enumerate() {
            let all: Vec<_> = repetitions.iter().map(|one| one[index]).collect();
            of_statistic.push(CoverageCell::of(&all));
        }
    }
    if SHARED as u64 * MAX_JOBS <= jobs.len() as u64 {
        for (statistic, of_statistic) in statistics.iter().zip(&mut found) {
            of_statistic.push(by_rule(pool, set, truth, *statistic));
        }
    }
    found
}

/// The cell of sets that end once a statistic is as precise as [`BY_RULE`] jobs make it on average.
fn by_rule(pool: &Pool, set: usize, truth: &SetRow, statistic: Statistic) -> Option<CoverageCell> {
    let jobs = &pool.sets[set].1;
    let of_all = Repetition::of(&pool.row(set, jobs, SLIPS_BY_RULE), truth, statistic)?;
    let half = 0.5 * (of_all.high - of_all.low) * (jobs.len() as f64 / BY_RULE).sqrt();
    let precision = Precision {
        statistics: vec![statistic],
        target: Target::Absolute(half),
    };
    let of_repetition = |repetition| {
        let jobs = of_repetition(jobs, repetition, usize::try_from(MAX_JOBS).unwrap());
        let mut seeds = MIN_SEEDS;
        loop {
            let some = jobs[..usize::try_from(seeds).unwrap()].iter().copied();
            let row = pool.row(set, some, SLIPS_BY_RULE);
            match need(&precision, seeds, MAX_JOBS, &row) {
                Some(more) if more > seeds => seeds = more,
                _ => return Repetition::of(&row, truth, statistic),
            }
        }
    };
    let all: Vec<_> = (0..REPETITIONS_BY_RULE)
        .into_par_iter()
        .map(of_repetition)
        .collect();
    CoverageCell::of(&all)
}

/// The coverage of the mean phase of all slips of a bin, and of the mean over its sets that have one: sets close to
/// each other, with two seeds in common.
fn of_backbone(pool: &Pool) -> [f64; 2] {
    let seeds = pool.sets[0].1.len();
    let truth = pool.bin(0..seeds);
    let mut held = [0; 2];
    let repetitions = seeds / 2;
    for repetition in 0..repetitions {
        let bin = pool.bin(2 * repetition..2 * repetition + 2);
        let holds = |[low, high, truth]: [Option<f64>; 3]| low <= truth && truth <= high;
        held[0] += u32::from(holds([
            bin.phase_mean_low,
            bin.phase_mean_high,
            truth.phase_mean,
        ]));
        held[1] += u32::from(holds([
            bin.set_phase_mean_low,
            bin.set_phase_mean_high,
            truth.set_phase_mean,
        ]));
    }
    held.map(|held| 100.0 * f64::from(held) / repetitions as f64)
}

/// Seeds of a repetition of pulses.
const SEEDS_OF_PULSES: [usize; 3] = [8, 16, 32];
/// Parts of the interval in which pulses begin, by name.
const THIRDS: [(&str, f64); 3] = [("early", 0.0), ("middle", 1.0 / 3.0), ("late", 2.0 / 3.0)];

/// Shares of triggered slips below this are left out.
const MIN_TRIGGERED: f64 = 5e-4;

/// A line for each pulse and third of the interval: the share of slips that are triggered, and by numbers of seeds the
/// coverage of its intervals and of those of its excess over the drive alone.
fn of_pulses(rows: &[TriggerRow]) -> String {
    let mut lines = vec![
        "| Δ (µm) | f (Hz) | third | share | coverage | excess | coverage |".to_owned(),
        "|---|---|---|---|---|---|---|".to_owned(),
    ];
    let seeds: BTreeSet<u64> = rows.iter().map(|row| row.parameters.seed).collect();
    let seeds: Vec<u64> = seeds.into_iter().collect();
    for pulses in Pulses::of(rows) {
        for (name, low) in THIRDS {
            let third = [low, low + 1.0 / 3.0];
            let all = pulses.between(third);
            let truth = all.row(third).expect("pulses in each third");
            let [share, excess] = [truth.triggered_share, truth.triggered_excess];
            if share < MIN_TRIGGERED {
                continue;
            }
            let mut coverage = [Vec::new(), Vec::new()];
            for count in SEEDS_OF_PULSES {
                let of = |repetition: u64| {
                    let some = of_repetition(&seeds, repetition, count);
                    let some: BTreeSet<u64> = some.into_iter().copied().collect();
                    let mut pulses = all.clone();
                    pulses
                        .rows
                        .retain(|row| some.contains(&row.parameters.seed));
                    let row = pulses.row(third)?;
                    let holds = |of: Interval, truth: f64| of.low <= truth && truth <= of.high;
                    let of_share = holds(row.triggered_interval?, share);
                    Some([of_share, holds(row.triggered_excess_interval?, excess)])
                };
                let repetitions = (0..REPETITIONS).into_par_iter().filter_map(of);
                let found: Vec<[bool; 2]> = repetitions.collect();
                for (which, coverage) in coverage.iter_mut().enumerate() {
                    let held = found.iter().filter(|held| held[which]).count();
                    coverage.push(format!("{:.1}", 100.0 * held as f64 / found.len() as f64));
                }
            }
            let [of_share, of_excess] = coverage.map(|of| of.join(", "));
            lines.push(format!(
                "| {:.2} | {:.0} | {name} | {share:.3} | {of_share} | {excess:.3} | {of_excess} |",
                1e6 * pulses.parameters.modulation_amplitude,
                pulses.parameters.frequency().unwrap_or_default(),
            ));
        }
    }
    lines.join("\n")
}

/// A cell with where it stands.
struct CellOfSet {
    set: usize,
    statistic: &'static str,
    truth: f64,
    column: usize,
    cell: CoverageCell,
}

impl CellOfSet {
    /// Whether it has as many jobs as are promised to do.
    fn is_of_many(&self) -> bool {
        SIZES.get(self.column).is_none_or(|&(jobs, _)| jobs >= MANY)
    }

    /// Whether its coverage is below what is promised of many jobs.
    fn is_low(&self) -> bool {
        self.is_of_many() && self.cell.coverage < MIN_COVERAGE
    }

    /// The same of few jobs.
    fn is_low_of_few(&self) -> bool {
        let size = SIZES.get(self.column);
        size.is_some_and(|(jobs, _)| (FEW..MANY).contains(jobs))
            && self.cell.coverage < MIN_COVERAGE_OF_FEW
    }

    /// Whether its intervals are wider than is promised of many jobs.
    fn is_wide(&self) -> bool {
        self.is_of_many() && self.cell.width > MAX_WIDTH
    }

    /// Its jobs and slips of a job.
    fn size(&self) -> (String, usize) {
        let by_rule = || (format!("rule {BY_RULE}"), SLIPS_BY_RULE);
        SIZES
            .get(self.column)
            .map_or_else(by_rule, |&(jobs, slips)| (jobs.to_string(), slips))
    }
}

/// Coverage and half-widths of some cells: least, middle and greatest.
struct CellSummary {
    count: usize,
    coverage: [f64; 3],
    width: [f64; 3],
}

impl CellSummary {
    fn of<'a>(cells: impl Iterator<Item = &'a CellOfSet>) -> Self {
        let cells: Vec<CoverageCell> = cells.map(|measured| measured.cell).collect();
        let quantiles = |of: fn(&CoverageCell) -> f64| {
            let mut values: Vec<f64> = cells.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            [0.0, 0.5, 1.0].map(|share| quantile(&values, share).unwrap_or(f64::NAN))
        };
        Self {
            count: cells.len(),
            coverage: quantiles(|cell| cell.coverage),
            width: quantiles(|cell| cell.width),
        }
    }
}

/// A line for each statistic: its cells below what is promised, the coverage of those with many jobs and their greatest
/// half-width; and the least coverage of those with few jobs.
fn by_statistic(cells: &[CellOfSet], statistics: &[Statistic]) -> String {
    let mut lines = vec![
        "| statistic | cells below | least | median | widest | fewer jobs: least |".to_owned(),
        "|---|---|---|---|---|---|".to_owned(),
    ];
    for statistic in statistics.iter().filter(|one| one.key != NOT_LISTED) {
        let own = || cells.iter().filter(|cell| cell.statistic == statistic.key);
        let many = CellSummary::of(own().filter(|cell| cell.is_of_many()));
        let few = CellSummary::of(own().filter(|cell| !cell.is_of_many()));
        let low = own().filter(|cell| cell.is_low()).count();
        let [least, median, _] = many.coverage;
        let [_, _, widest] = many.width;
        let [few_least, _, _] = few.coverage;
        lines.push(format!(
            "| `{}` | {low} | {least:.1} | {median:.1} | {widest:.2} | {few_least:.1} |",
            statistic.key,
        ));
    }
    lines.join("\n")
}

/// What a set is, and how much it is locked: the first cells of a line, whose heads are [`SET`].
fn of_set((parameters, row): &(Parameters, SetRow)) -> String {
    let resultant = row
        .number("resultant_length")
        .map_or("–".into(), |number| format!("{number:.2}"));
    format!(
        "| {}×{} | {:e} | {:.2} | {:.1} | {:.2} | {resultant} |",
        parameters.blocks,
        parameters.contacts_per_block,
        parameters.drive_velocity,
        1e6 * parameters.modulation_amplitude,
        parameters.frequency().unwrap_or_default(),
        parameters.eta(),
    )
}

const SET: &str = "| N×N_s | V0 (m/s) | Δ (µm) | f (Hz) | η | R |";

/// The statistics of some cells of a set, each with the extreme value of its cells.
fn extremes<'a>(
    cells: impl Iterator<Item = &'a CellOfSet>,
    value: fn(&CoverageCell) -> f64,
    extreme: fn(f64, f64) -> f64,
    digits: usize,
) -> String {
    let mut found: Vec<(&str, f64)> = Vec::new();
    for measured in cells.filter(|cell| cell.statistic != NOT_LISTED) {
        let value = value(&measured.cell);
        match found.last_mut() {
            Some((statistic, known)) if *statistic == measured.statistic => {
                *known = extreme(*known, value);
            }
            _ => found.push((measured.statistic, value)),
        }
    }
    let texts = found
        .iter()
        .map(|(statistic, value)| format!("`{statistic}` {value:.digits$}"));
    texts.collect::<Vec<String>>().join(", ")
}

/// A line for each set with cells that are off what is promised: their statistics with the least coverage or the
/// greatest half-width.
fn by_set(cells: &[CellOfSet], sets: &[(Parameters, SetRow)]) -> String {
    let mut off = Vec::new();
    for (index, set) in sets.iter().enumerate() {
        let own = || cells.iter().filter(move |cell| cell.set == index);
        let many = CellSummary::of(own().filter(|cell| cell.is_of_many()));
        let [least, _, _] = many.coverage;
        let name = of_set(set);
        let coverage = |cell: &CoverageCell| cell.coverage;
        let low = extremes(own().filter(|cell| cell.is_low()), coverage, f64::min, 1);
        let few = own().filter(|cell| cell.is_low_of_few());
        let few = extremes(few, coverage, f64::min, 0);
        let wide = own().filter(|cell| cell.is_wide());
        let wide = extremes(wide, |cell| cell.width, f64::max, 2);
        if [&low, &few, &wide].iter().any(|text| !text.is_empty()) {
            off.push((least, format!("{name} {low} | {few} | {wide} |")));
        }
    }
    off.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut worst = vec![
        format!(
            "{SET} below {MIN_COVERAGE} % from {MANY} jobs on | below {MIN_COVERAGE_OF_FEW} % with {FEW} to {} | half-width above {MAX_WIDTH} |",
            MANY - 1
        ),
        "|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    worst.extend(off.into_iter().map(|(_, line)| line));
    worst.join("\n")
}

/// Every cell, for `docs/coverage.csv`.
fn csv(cells: &[CellOfSet], sets: &[(Parameters, SetRow)]) -> String {
    let mut lines = vec![
        "N,Ns,V0,Delta,frequency,statistic,true_value,jobs,slips,coverage,half_width".to_owned(),
    ];
    for measured in cells {
        let parameters = &sets[measured.set].0;
        let (jobs, slips) = measured.size();
        lines.push(format!(
            "{},{},{:e},{:e},{:.4},{},{:.6e},{jobs},{slips},{:.2},{:.3}",
            parameters.blocks,
            parameters.contacts_per_block,
            parameters.drive_velocity,
            parameters.modulation_amplitude,
            parameters.frequency().unwrap_or_default(),
            measured.statistic,
            measured.truth,
            measured.cell.coverage,
            measured.cell.width,
        ));
    }
    lines.join("\n") + "\n"
}

/// `docs/coverage.md` and `docs/coverage.csv`: run by `scripts/coverage`.
#[test]
#[ignore = "a measurement, with pools of jobs"]
fn coverage_is_measured() {
    let folder = std::env::var_os("STICKSLIP_POOLS").expect("run scripts/coverage");
    let folder = Path::new(&folder);
    let statistics: Vec<Statistic> = STATISTICS
        .iter()
        .copied()
        .filter(|statistic| statistic.has_interval)
        .collect();
    let mut sets = Vec::new();
    let mut all = Vec::new();
    for name in POOLS {
        let pool = read_pool(folder, name);
        let long = read_pool(folder, &format!("{name}-long"));
        for (set, (parameters, _)) in pool.sets.iter().enumerate() {
            let same = |(other, _): &(Parameters, Vec<PooledJob>)| {
                other.with_seed(0) == parameters.with_seed(0)
            };
            let of_long = long.sets.iter().position(same).expect("the same sets");
            let row = long.row(of_long, &long.sets[of_long].1, usize::MAX);
            for (statistic, cells) in statistics.iter().zip(cells(&pool, set, &row, &statistics)) {
                let Some(truth) = row.number(statistic.key) else {
                    continue;
                };
                for (column, cell) in cells.into_iter().enumerate() {
                    all.extend(cell.map(|cell| CellOfSet {
                        set: sets.len(),
                        statistic: statistic.key,
                        truth,
                        column,
                        cell,
                    }));
                }
            }
            println!("{name}: set {set} of {}", pool.sets.len());
            sets.push((parameters.clone(), row));
        }
    }
    let many = CellSummary::of(all.iter().filter(|cell| cell.is_of_many()));
    let few = CellSummary::of(all.iter().filter(|cell| !cell.is_of_many()));
    let low = all.iter().filter(|cell| cell.is_low()).count();
    let is_narrow = |cell: &&CellOfSet| cell.is_of_many() && cell.cell.width <= 3.0;
    let narrow = 100.0 * all.iter().filter(is_narrow).count() as f64 / many.count as f64;
    let [slips, means] = of_backbone(&read_pool(folder, "dense"));
    let pulses = folder.join("coverage-pulses");
    let triggers: Vec<TriggerRow> = read_optional(&Layout::new(&Disk, &pulses)).unwrap();
    let seeds = SEEDS_OF_PULSES.map(|count| count.to_string()).join(", ");
    let worst = by_set(&all, &sets);
    let text = format!(
        "{}\n\
         From {MANY} jobs on, {low} of {} cells lie below {MIN_COVERAGE} %, the least at {:.1} %; the median is {:.1} %.\n\
         The half-width is {:.2} in the median, {:.2} at most, and at most 3 in {narrow:.1} %.\n\
         With fewer jobs the median is {:.1} %, and the half-width {:.2} in the median, {:.2} at most.\n\n\
         {}\n\
         ## Worst cells\n\n\
         Those of {} sets with cells outside the limits of the columns, each statistic with its least coverage or\n\
         greatest half-width. τ_r is 5 ms, and 50 ms without modulation.\n\n{worst}\n\n\
         ## By statistic\n\n\
         From {MANY} jobs on, cells below {MIN_COVERAGE} %, coverage and the greatest half-width; and coverage with fewer.\n\
         `{NOT_LISTED}` has the coverage of `mean_friction`.\n\n{}\n\n\
         ## The backbone\n\n\
         Twelve sets with η from 2 to 2.2 and Δ = 0.6 µm fall into one bin. They have two seeds of 15 slips in common.\n\
         In 100 repetitions the interval of the mean phase of all slips holds the true value in {slips:.1} %,\n\
         that of the mean of the sets that have a phase in {means:.1} %.\n\n\
         ## Triggered slips\n\n\
         Shares of slips that pulses trigger, by the third of the interval in which pulses begin, and coverage with {seeds}\n\
         of 640 seeds. Shares that round to 0.000 are left out.\n\n{}\n\n\
         {}",
        include_str!("coverage.md"),
        many.count,
        many.coverage[0],
        many.coverage[1],
        many.width[1],
        many.width[2],
        few.coverage[1],
        few.width[1],
        few.width[2],
        include_str!("coverage_findings.md"),
        sets.len(),
        by_statistic(&all, &statistics),
        of_pulses(&triggers),
        include_str!("coverage_measured.md"),
    );
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    std::fs::write(docs.join("coverage.md"), text).unwrap();
    std::fs::write(docs.join("coverage.csv"), csv(&all, &sets)).unwrap();
}
