//! The table of sets, a row for each with all seeds together: what the jobs table says (outcomes, averages over the
//! time of each job), and from the slips, statistics of intervals, locking and phases.

use super::estimate::{
    Estimate, MAX_UNSEEN, Numbers, Sums, Units, at_rank, length, mean, plus, unit,
};
use crate::model::theory::{load_maximum_phase, minimum_phase, resultant_at_random};
use crate::model::{Parameters, Selected};
use crate::observe::{Regime, Slip};
use crate::results::tables::JobOutcome;
use crate::sets::{SetRow, parameter};
use crate::table::columns::{Column, Interval, columns};
use crate::table::value::floored;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{PI, TAU};

/// Width from which an interval of a mean phase counts as the whole turn, in rad: others are half a turn wide at most.
const WHOLE_TURN: f64 = 1.5 * PI;

/// The numbers of a slip that are kept until its set is complete. Missing values are NaN, so that a slip takes 48
/// bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlipStats {
    pub(super) onset: f64,
    /// Interval before it, in s.
    pub(super) interval: f64,
    /// The interval in periods of the modulation at its end.
    periods: f64,
    pub(super) phase: f64,
    /// In N.
    peak_force: f64,
    /// Force drop, in N.
    drop: f64,
}

impl SlipStats {
    fn of(slip: &Slip) -> Self {
        let or_missing = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let both = slip.interval.zip(slip.modulation.period);
        let periods = both.map(|(interval, period)| interval / period);
        Self {
            onset: slip.onset,
            interval: or_missing(slip.interval),
            periods: or_missing(periods),
            phase: or_missing(slip.phase),
            peak_force: slip.peak_force,
            drop: slip.drop,
        }
    }
}

pub(super) fn non_nan(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}

#[derive(Clone, Debug, Default)]
pub(super) struct SetSlips {
    /// By their seeds.
    jobs: BTreeMap<u64, Vec<SlipStats>>,
}

impl SetSlips {
    pub(super) fn push(&mut self, seed: u64, slip: &Slip) {
        let job = self.jobs.entry(seed).or_default();
        job.push(SlipStats::of(slip));
    }

    pub(super) fn of_job(&self, seed: u64) -> &[SlipStats] {
        self.jobs.get(&seed).map_or(&[], Vec::as_slice)
    }

    fn largest(&self, quantity: impl Fn(&SlipStats) -> f64) -> f64 {
        let slips = self.jobs.values().flatten();
        slips.map(quantity).fold(0.0, f64::max)
    }

    /// The share of the intervals that are nearest to this number of periods.
    pub(super) fn share_of_periods(&self, periods: f64) -> Option<Estimate> {
        let is_nearest = |slip: &SlipStats| {
            Some(f64::from(u8::from(
                non_nan(slip.periods)?.round() == periods,
            )))
        };
        let [share, _] = Numbers::of(&self.each(is_nearest), 0.0).estimates(0.0);
        share
    }

    /// A quantity that some of the slips have, by seeds.
    fn each<T>(&self, quantity: impl Fn(&SlipStats) -> Option<T>) -> Vec<(u64, Vec<T>)> {
        each(&self.by_job(), quantity)
    }

    fn by_job(&self) -> Vec<(u64, &[SlipStats])> {
        let jobs = self.jobs.iter();
        jobs.map(|(&seed, slips)| (seed, slips.as_slice()))
            .collect()
    }

    pub(super) fn finish(self, jobs: &SetJobs) -> FinishedSet {
        let mut set = FinishedSet {
            row: jobs.row(),
            ..FinishedSet::default()
        };
        set.row.slips = self.jobs.values().map(|job| job.len() as u64).sum();
        set.describe_time(jobs);
        let off = set.describe_intervals(&self, jobs);
        set.describe_forces(&self, off);
        set.describe_locking(&self, jobs.running.len());
        set.describe_phases(&self, &jobs.parameters);
        set
    }
}

fn each<T>(
    jobs: &[(u64, &[SlipStats])],
    quantity: impl Fn(&SlipStats) -> Option<T>,
) -> Vec<(u64, Vec<T>)> {
    let of_job =
        |(seed, slips): &(u64, &[SlipStats])| (*seed, slips.iter().filter_map(&quantity).collect());
    jobs.iter().map(of_job).collect()
}

/// Whole cycles of a modulation whose period is at least the mean interval: a run holds few of them, and its beginning
/// and end would show as a phase.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cycles {
    period: f64,
}

impl Cycles {
    /// Cycles that a job must have on average.
    const MIN: f64 = 2.0;

    /// The cycles of a set with this mean interval; `None` if all slips count.
    fn of(parameters: &Parameters, tau_mean: Option<f64>) -> Option<Self> {
        let period = parameters.modulation_period?;
        let is_slow = parameters.ramp_time == 0.0 && period >= tau_mean?;
        is_slow.then_some(Self { period })
    }

    /// The slips of each job within whole cycles from its first one on; empty if these are too few.
    pub(super) fn within<T>(
        self,
        mut jobs: Vec<(u64, &[T])>,
        onset: impl Fn(&T) -> f64,
    ) -> Vec<(u64, &[T])> {
        let mut total = 0.0;
        for (_, slips) in &mut jobs {
            let onsets = || slips.iter().map(&onset).filter(|onset| !onset.is_nan());
            let Some((first, last)) = onsets().next().zip(onsets().last()) else {
                *slips = &[];
                continue;
            };
            let cycles = ((last - first) / self.period).floor();
            total += cycles;
            let end = first + cycles * self.period;
            *slips = &slips[..onsets().take_while(|onset| *onset < end).count()];
        }
        if total < Self::MIN * jobs.len() as f64 {
            jobs.clear();
        }
        jobs
    }
}

/// Lengths of intervals, of which some still ran when their jobs gave up: these are longer than all others.
struct Ranked {
    sorted: Vec<f64>,
    running: usize,
}

impl Ranked {
    fn of(jobs: &[(u64, Vec<f64>)], running: usize) -> Self {
        let mut sorted: Vec<f64> = jobs.iter().flat_map(|(_, all)| all).copied().collect();
        sorted.sort_by(f64::total_cmp);
        Self { sorted, running }
    }

    /// A quantile of all; `None` if that interval still ran.
    fn quantile(&self, share: f64) -> Option<f64> {
        let last = (self.sorted.len() + self.running).checked_sub(1)?;
        at_rank(&self.sorted, share.clamp(0.0, 1.0) * last as f64)
    }
}

/// Ranges of statistics.
pub(super) const SHARE: [f64; 2] = [0.0, 1.0];
const POSITIVE: [f64; 2] = [0.0, f64::INFINITY];
pub(super) const ANY: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Mean intervals up to which a period is the least by which a slip comes early or late: less than all that lies
/// between two slips, with room for their spread.
const NEXT_PERIOD: f64 = 1.2;
/// Periods of two slips have two mean intervals, to this part of one.
const TWO_SLIPS: f64 = 0.1;
/// Error of a mean, over that of independent intervals, below which intervals alternate.
const REGULAR: f64 = 0.5;

/// The time by which a slip of a kind that was not seen may come early or late: to another period of the modulation, or
/// at another of its slips; 0 where no period says so.
fn off(period: Option<f64>, mean: f64, numbers: &Numbers) -> f64 {
    let is_regular = || {
        numbers
            .regularity()
            .is_some_and(|regularity| regularity < REGULAR)
    };
    match period {
        Some(period) if period <= NEXT_PERIOD * mean => period.min(mean),
        Some(period) if (period / mean - 2.0).abs() < TWO_SLIPS && is_regular() => period,
        _ => 0.0,
    }
}

/// By how much a slip that was not seen may shorten the sum of vectors.
#[derive(Clone, Copy)]
struct Loss {
    /// For each unit by which the length at random loads is short of 1.
    times: f64,
    most: f64,
}

/// Of a slip.
const OF_PHASES: Loss = Loss {
    times: 3.0,
    most: 0.75,
};
/// Of the two intervals beside it, whose vectors have the square of that length.
const OF_INTERVALS: Loss = Loss {
    times: 6.0,
    most: 1.5,
};

/// By how much slips that were not seen may shorten the mean of vectors, if slips at random loads have this length.
fn lost(length_at_random: f64, loss: Loss, vectors: &Units) -> f64 {
    let [count, ..] = vectors.total();
    MAX_UNSEEN * (loss.times * (1.0 - length_at_random)).min(loss.most) / count
}

/// Ratio of variances above which jobs still share their start: errors are then more than twice what seeds show.
const MAX_RATIO: f64 = 4.0;

/// Variance of vectors between slips of different number over what seeds alone make of it (F ratio; 1 if jobs have
/// forgotten their start). NaN for fewer than two jobs of two slips.
fn ratio_of_numbers(jobs: &[(u64, Vec<Sums>)]) -> f64 {
    let numbers = jobs.iter().map(|(_, job)| job.len()).min().unwrap_or(0);
    let of_number = |number: usize| {
        let vectors = jobs.iter().map(|(_, job)| job[number]);
        vectors.fold([0.0; 3], |sum, vector| plus(sum, 1.0, vector))
    };
    let sums: Vec<Sums> = (0..numbers).map(of_number).collect();
    let square = |[weight, x, y]: Sums| (x * x + y * y) / weight;
    let seeds = jobs.len() as f64;
    let total = sums
        .iter()
        .fold([0.0; 3], |sum, of_one| plus(sum, 1.0, *of_one));
    let within_numbers: f64 = sums.iter().copied().map(square).sum();
    let differing = within_numbers - square(total);
    // Rounding leaves this where all vectors are one.
    if differing < 1e-12 * total[0] {
        return 0.0;
    }
    let between = differing / (numbers as f64 - 1.0);
    let by_seeds = (total[0] - within_numbers) / (numbers as f64 * (seeds - 1.0));
    between / by_seeds
}

/// Of values in order of time: between quantiles at the ends of the interval of the share that does not exceed the
/// median (R. S. Woodruff, J. Am.
/// Stat. Assoc. 47, 635 (1952)).
fn median_interval(jobs: &[(u64, Vec<f64>)], ranked: &Ranked) -> Option<Interval> {
    let median = ranked.quantile(0.5)?;
    let is_below = |length: &f64| [1.0, f64::from(u8::from(*length <= median)), 0.0];
    let flags = jobs
        .iter()
        .map(|(seed, lengths)| (*seed, lengths.iter().map(is_below).collect()));
    let share = Units::of(flags).estimate(mean)?;
    // A value more or less is the least that a share can be off.
    let half = share.half_width()?.max(1.0 / ranked.sorted.len() as f64);
    Some(Interval {
        low: ranked.quantile(0.5 - half)?,
        high: ranked.quantile(0.5 + half)?,
    })
}

/// A set whose sums are complete.
#[derive(Clone, Debug, Default)]
pub(super) struct FinishedSet {
    pub(super) row: SetRow,
    /// Its intervals in s, sorted.
    pub(super) intervals: Vec<f64>,
    pub(super) phases: Units,
    /// Intervals in periods, as angles.
    pub(super) locking: Units,
    /// The cycles within which phases count, if not all do.
    pub(super) cycles: Option<Cycles>,
    /// Its statistics that are functions of sums, by their columns.
    pub(super) estimates: BTreeMap<&'static str, Estimate>,
}

impl FinishedSet {
    /// A statistic, or a parameter; `None` of what has no error that is known.
    pub(super) fn estimate(&self, column: &Column) -> Option<Estimate> {
        let known = self.estimates.get(&*column.name).cloned();
        known.or_else(|| {
            parameter(column)?;
            self.row.number(&column.name).map(Estimate::exact)
        })
    }

    /// Notes the estimate of a column: its value, and its interval within a range.
    pub(super) fn note(
        &mut self,
        column: &'static str,
        estimate: Option<Estimate>,
        [least, most]: [f64; 2],
    ) -> (Option<f64>, Option<Interval>) {
        let (value, interval) = Estimate::both(estimate.as_ref());
        self.estimates
            .extend(estimate.map(|estimate| (column, estimate)));
        let within = |Interval { low, high }| Interval {
            low: low.max(least),
            high: high.min(most),
        };
        (value, interval.map(within))
    }

    fn describe_time(&mut self, jobs: &SetJobs) {
        let over_time = |of: fn(&JobAverages) -> f64| {
            let sums = |(seed, job): (&u64, &JobAverages)| {
                (*seed, vec![[job.time, job.time * of(job), 0.0]])
            };
            Units::of(jobs.averages.iter().map(sums)).estimate(mean)
        };
        let share = over_time(|job| job.slip_share);
        let friction = over_time(|job| job.friction);
        let force = jobs.parameters.normal_force;
        let coefficient = friction
            .as_ref()
            .map(|friction| friction.times(1.0 / force));
        (self.row.slip_share, self.row.slip_share_interval) = self.note("slip_share", share, SHARE);
        (self.row.mean_friction, self.row.mean_friction_interval) =
            self.note("mean_friction", friction, ANY);
        (
            self.row.friction_coefficient,
            self.row.friction_coefficient_interval,
        ) = self.note("friction_coefficient", coefficient, ANY);
    }

    /// Returns the part of the mean interval by which a slip that was not seen may come early or late.
    fn describe_intervals(&mut self, slips: &SetSlips, jobs: &SetJobs) -> f64 {
        let intervals = slips.each(|slip| non_nan(slip.interval));
        let ranked = Ranked::of(&intervals, jobs.running.len());
        let numbers = Numbers::of(&intervals, slips.largest(|slip| slip.onset));
        let off = off(jobs.parameters.modulation_period, numbers.mean, &numbers);
        self.row.intervals = ranked.sorted.len() as u64;
        self.row.tau_05 = ranked.quantile(0.05);
        self.row.tau_25 = ranked.quantile(0.25);
        self.row.tau_50 = ranked.quantile(0.5);
        self.row.tau_75 = ranked.quantile(0.75);
        self.row.tau_95 = ranked.quantile(0.95);
        if jobs.running.is_empty() {
            let [mean, deviation] = numbers.estimates(off);
            (self.row.tau_mean, self.row.tau_interval) = self.note("tau_mean", mean, POSITIVE);
            (self.row.tau_deviation, self.row.tau_deviation_interval) =
                self.note("tau_sd", deviation, POSITIVE);
            self.row.median_interval = median_interval(&intervals, &ranked);
        } else {
            let total = ranked.sorted.iter().chain(&jobs.running).sum::<f64>();
            self.row.tau_bound = Some(total / (ranked.sorted.len() + jobs.running.len()) as f64);
        }
        if jobs.cut > 0 {
            let both = self.row.tau_deviation.zip(self.row.tau_mean);
            let relative = both.map(|(deviation, mean)| deviation / mean);
            let cut_share = jobs.cut as f64 / ranked.sorted.len() as f64;
            self.row.tau_off = relative.map(|relative| -relative * relative * cut_share);
        }
        self.intervals = ranked.sorted;
        off / numbers.mean
    }

    fn describe_forces(&mut self, slips: &SetSlips, off: f64) {
        let drops = slips.each(|slip| non_nan(slip.drop));
        let drops = Numbers::of(&drops, slips.largest(|slip| slip.peak_force.max(slip.drop)));
        // A longer interval ends at a force that is higher by the additional drop.
        let drop_off = off * drops.mean;
        let [mean, deviation] = drops.estimates(drop_off);
        let both = deviation.as_ref().zip(mean.as_ref());
        let variation = both.map(|(deviation, mean)| {
            Estimate::function([deviation, mean], |[deviation, mean]| deviation / mean)
        });
        (self.row.drop_mean, self.row.drop_interval) = self.note("drop_mean", mean, ANY);
        (self.row.drop_deviation, self.row.drop_deviation_interval) =
            self.note("drop_sd", deviation, POSITIVE);
        (self.row.drop_variation, _) = self.note("drop_cv", variation, POSITIVE);
        let forces = slips.each(|slip| non_nan(slip.peak_force));
        let [force, _] = Numbers::of(&forces, 0.0).estimates(drop_off);
        (self.row.peak_force_mean, self.row.peak_force_interval) =
            self.note("peak_force_mean", force, ANY);
    }

    /// Intervals in periods, as angles.
    fn describe_locking(&mut self, slips: &SetSlips, running: usize) {
        let periods = slips.each(|slip| non_nan(slip.periods));
        let median = Ranked::of(&periods, running).quantile(0.5);
        self.row.periods = median.map(|n| floored(n.round()) as u64);
        // Whole turns are removed first: they would cost the sine its digits.
        let vectors = |periods: &Vec<f64>| {
            periods
                .iter()
                .map(|periods| unit(TAU * periods.fract()))
                .collect()
        };
        self.locking = Units::of(
            periods
                .iter()
                .map(|(seed, periods)| (*seed, vectors(periods))),
        );
        if self.row.periods != Some(0) {
            let locking = self.length_of_intervals(&self.locking);
            let (length, interval) = self.note("locking_index", locking, SHARE);
            self.row.locking_index = length;
            self.row.locking_interval = interval.map(|ends| self.locking.with_zero(ends));
        }
    }

    fn describe_phases(&mut self, slips: &SetSlips, parameters: &Parameters) {
        self.cycles = Cycles::of(parameters, self.row.tau_mean);
        let jobs = match self.cycles {
            None => slips.by_job(),
            Some(cycles) => cycles.within(slips.by_job(), |slip| slip.onset),
        };
        let vectors = each(&jobs, |slip| non_nan(slip.phase).map(unit));
        self.row.shares_start = ratio_of_numbers(&vectors) > MAX_RATIO;
        self.phases = Units::of(vectors);
        let lost = self.lost_of_phases(&self.phases);
        if let Some((direction, interval)) =
            self.phases.direction(top_of_phases(self.row.eta), lost)
        {
            self.row.phase_mean = Some(direction.value);
            self.row.phase_interval = interval;
            let is_narrow = |ends: Interval| ends.high - ends.low < WHOLE_TURN;
            self.row.has_phase = interval.is_some_and(is_narrow);
        }
        let length = self.length_of_phases(&self.phases);
        let (length, interval) = self.note("resultant_length", length, SHARE);
        self.row.resultant_length = length;
        self.row.length_interval = interval.map(|ends| self.phases.with_zero(ends));
        self.row.schuster = self.phases.schuster();
    }

    fn lost_of_phases(&self, phases: &Units) -> f64 {
        lost(resultant_at_random(self.row.eta), OF_PHASES, phases)
    }

    /// Length of vectors of phases.
    pub(super) fn length_of_phases(&self, phases: &Units) -> Option<Estimate> {
        let lost = self.lost_of_phases(phases);
        Some(phases.estimate(length)?.allowing_for(lost))
    }

    /// Of intervals in periods, as angles.
    pub(super) fn length_of_intervals(&self, intervals: &Units) -> Option<Estimate> {
        let at_random = resultant_at_random(self.row.eta);
        let lost = lost(at_random * at_random, OF_INTERVALS, intervals);
        Some(intervals.estimate(length)?.allowing_for(lost))
    }
}

columns! {
    /// What a reduction takes from the jobs table beside parameters.
    #[derive(Clone, Debug)]
    pub(super) struct JobFacts {
        set_id: String;
        outcome: JobOutcome;
        slips: Option<u64>;
        averaged_time: Option<f64>;
        mean_friction: Option<f64>;
        slip_share: Option<f64>;
        regime: Option<Regime>;
        running_interval: Option<f64>;
    }
}

/// What the jobs table says about a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SetJobs {
    /// Id of the set, 32 hexadecimal characters.
    pub set_id: String,
    /// Its parameters; the seed is that of any of its jobs.
    pub parameters: Parameters,
    /// Seeds of the jobs that were run to an end.
    pub finished: BTreeSet<u64>,
    pub failed: u64,
    /// Slips that the jobs recorded.
    pub slips: u64,
    /// Jobs that gave up, since no slip came.
    pub without_slips: u64,
    /// Averages over the time of each job, by its seed.
    pub averages: BTreeMap<u64, JobAverages>,
    /// Jobs that `max_time` ended.
    pub cut: u64,
    /// Times since the last slip in jobs that gave up after one, in s.
    pub running: Vec<f64>,
    /// How the slider moved in the jobs; mixed if they differ.
    pub regime: Option<Regime>,
}

/// Averages over the time of a job, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JobAverages {
    pub time: f64,
    /// In N.
    pub friction: f64,
    pub slip_share: f64,
}

impl SetJobs {
    /// A job of the set has ended.
    pub(super) fn push(&mut self, seed: u64, job: &JobFacts) {
        if job.outcome == JobOutcome::Failed {
            self.failed += 1;
            return;
        }
        self.finished.insert(seed);
        self.slips = self.slips.saturating_add(job.slips.unwrap_or(0));
        self.without_slips += u64::from(job.outcome == JobOutcome::NoSlips);
        self.cut += u64::from(job.outcome == JobOutcome::TimeLimit);
        let averages = || {
            let averages = JobAverages {
                time: job.averaged_time?,
                friction: job.mean_friction?,
                slip_share: job.slip_share?,
            };
            Some((seed, averages))
        };
        self.averages.extend(averages());
        self.running.extend(job.running_interval);
        self.regime = match (self.regime, job.regime) {
            (Some(regime), Some(other)) if regime != other => Some(Regime::Mixed),
            (regime, other) => other.or(regime),
        };
    }

    /// The row of the set with all that does not need its slips.
    pub(super) fn row(&self) -> SetRow {
        SetRow {
            set_id: self.set_id.clone(),
            parameters: Selected::new(self.parameters.clone()),
            frequency: self.parameters.frequency(),
            eta: self.parameters.eta(),
            finished_jobs: self.finished.len() as u64,
            failed_jobs: self.failed,
            jobs_without_slips: self.without_slips,
            jobs_cut: self.cut,
            regime: self.regime,
            ..SetRow::default()
        }
    }
}

/// Upper end of the turn in which mean phases at some η are given, in rad. For η >= 1 the seam is in the middle of the
/// gap between Φ_max - 2π and φ_min, where no slip begins.
pub(super) fn top_of_phases(eta: f64) -> f64 {
    minimum_phase(eta)
        .zip(load_maximum_phase(eta))
        .map_or(PI, |(low, high)| 0.5 * (low + high + TAU))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::estimate::tests::Draws;
    use super::*;
    use crate::observe::Modulation;
    use crate::results::tables::JobOutcome;
    use crate::sets::STATISTICS;
    use proptest::prelude::*;

    pub(in crate::reduce) fn jobs(amplitude: f64, period: f64) -> SetJobs {
        let parameters = Parameters {
            modulation_amplitude: amplitude,
            modulation_period: Some(period),
            ..Parameters::default()
        }
        .validated()
        .unwrap();
        SetJobs {
            set_id: format!("{amplitude:e} {period}"),
            parameters,
            finished: [0].into(),
            ..SetJobs::default()
        }
    }

    pub(in crate::reduce) fn slip(interval: Option<f64>, phase: Option<f64>) -> Slip {
        let modulation = Modulation {
            period: None,
            amplitude: 1e-6,
        };
        Slip {
            number: 1,
            interval,
            modulation,
            phase,
            ..crate::results::tables::tests::slip(1)
        }
    }

    fn modulated(period: f64) -> Modulation {
        Modulation {
            period: Some(period),
            amplitude: 1e-6,
        }
    }

    fn reduced(jobs: &SetJobs, slips: impl IntoIterator<Item = Slip>) -> SetRow {
        let mut set = SetSlips::default();
        let mut seed = 0;
        for slip in slips {
            seed += u64::from(slip.number == 0);
            set.push(seed, &slip);
        }
        set.finish(jobs).row
    }

    #[test]
    fn intervals_of_whole_periods_lock_whatever_their_number() {
        let period = 1.0 / 29.0;
        let slip = |n: f64, period| Slip {
            modulation: modulated(period),
            ..slip(Some(n * period), Some(-1.2))
        };
        let row = reduced(
            &jobs(1e-6, period),
            [3.0, 4.0, 4.0, 5.0, 400.0].map(|n| slip(n, period)),
        );
        assert!(row.locking_index.unwrap() > 1.0 - 1e-9);
        assert_eq!(row.periods, Some(4));
        assert!((row.phase_mean.unwrap() + 1.2).abs() < 1e-12);
        let halves = reduced(
            &jobs(1e-6, period),
            [3.0, 3.5, 4.0, 4.5].map(|n| slip(n, period)),
        );
        assert!(halves.locking_index.unwrap() < 1e-9);
        // On a ramp, of the periods at the onsets.
        let ramped = reduced(
            &jobs(1e-6, period),
            [0.03, 0.0313, 0.0371].map(|period| slip(4.0, period)),
        );
        assert!(ramped.locking_index.unwrap() > 1.0 - 1e-9 && ramped.periods == Some(4));
    }

    #[test]
    fn slips_at_random_loads_have_a_resultant_of_half_eta() {
        let jobs = jobs(1e-6, 0.1);
        let eta = jobs.parameters.eta();
        assert!((0.3..0.9).contains(&eta), "{eta}");
        // φ + η cos φ at even spacing, by bisection.
        let phases = (0..400).map(|step| {
            // One after the other by most of a turn, so that no slip predicts the next.
            let load = TAU * (f64::from(step * 163 % 400) / 400.0 - 0.5);
            let mut low = -2.0 * TAU;
            let mut high = 2.0 * TAU;
            for _ in 0..80 {
                let middle = 0.5 * (low + high);
                if middle + eta * libm::cos(middle) < load {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            slip(None, Some(low))
        });
        let row = reduced(&jobs, phases);
        assert!((row.resultant_length.unwrap() - 0.5 * eta).abs() < 1e-3);
    }

    #[test]
    fn a_set_has_a_phase_if_its_slips_exclude_a_direction() {
        let at = |phases: &[f64]| {
            reduced(
                &jobs(1e-6, 0.01),
                phases.iter().map(|&phase| slip(None, Some(phase))),
            )
        };
        assert!(at(&[-0.9; 12]).has_phase && at(&[-0.7, -0.9, -1.1]).has_phase);
        assert!(!at(&[-0.9]).has_phase, "one slip has no interval");
        assert!(!at(&[-0.7, 1.1]).has_phase, "two slips far apart");
        // Evenly over the turn; and with a faint preference that 3,000 slips show.
        let turn = |count: u32, at_zero: u32| -> Vec<f64> {
            (0..count)
                .map(|slip| {
                    if slip % at_zero == 0 {
                        0.0
                    } else {
                        f64::from(slip % 3) * TAU / 3.0
                    }
                })
                .collect()
        };
        let even = at(&turn(3000, 3));
        let faint = at(&turn(3000, 5));
        assert!(
            !even.has_phase && even.phase_interval.is_some(),
            "{:?}",
            even.phase_interval
        );
        assert!(
            faint.has_phase && faint.resultant_length < Some(0.4),
            "{:?}",
            faint.resultant_length
        );
        assert!(!at(&turn(15, 5)).has_phase, "the same of 15");
        let still = reduced(
            &jobs(0.0, 1.0),
            [slip(Some(0.1), None), slip(Some(0.2), None)],
        );
        assert_eq!(
            (still.phase_mean, still.locking_index, still.periods),
            (None, None, None)
        );
        assert!((still.tau_mean.unwrap() - 0.15).abs() < 1e-15);
        assert!(!still.has_phase);
    }

    fn facts(
        outcome: JobOutcome,
        time: f64,
        friction: f64,
        running_interval: Option<f64>,
    ) -> JobFacts {
        JobFacts {
            set_id: String::new(),
            outcome,
            slips: Some(1),
            averaged_time: Some(time),
            mean_friction: Some(friction),
            slip_share: Some(0.1),
            regime: None,
            running_interval,
        }
    }

    #[test]
    fn friction_counts_jobs_by_their_time_and_has_the_interval_of_the_textbook() {
        let of = |jobs: &[(f64, f64)]| {
            let mut set = SetJobs {
                parameters: jobs_without_modulation(),
                ..SetJobs::default()
            };
            for (seed, &(time, friction)) in (0..).zip(jobs) {
                set.push(seed, &facts(JobOutcome::Done, time, friction, None));
            }
            reduced(&set, [])
        };
        let equal = of(&[(2.0, 430.0), (2.0, 434.0)]);
        assert!((equal.mean_friction.unwrap() - 432.0).abs() < 1e-9);
        let Interval { low, high } = equal.mean_friction_interval.unwrap();
        assert!(
            (low - (432.0 - 2.0 * 12.706_205)).abs() < 1e-4
                && (high - (432.0 + 2.0 * 12.706_205)).abs() < 1e-4
        );
        // Of three quarters of the time at 430.
        let unequal = of(&[(3.0, 430.0), (1.0, 434.0)]);
        assert!((unequal.mean_friction.unwrap() - 431.0).abs() < 1e-9);
        assert_eq!(unequal.slip_share, Some(0.1));
        assert_eq!(of(&[(3.0, 430.0)]).mean_friction_interval, None);
    }

    fn jobs_without_modulation() -> Parameters {
        jobs(0.0, 1.0).parameters
    }

    /// Three slips of a set of jobs that ended otherwise, each with what the job had waited.
    fn ended(outcome: JobOutcome, waited: &[f64]) -> SetRow {
        let mut set = SetJobs {
            parameters: jobs_without_modulation(),
            ..SetJobs::default()
        };
        let gave_up = outcome == JobOutcome::NoSlips;
        for (seed, &interval) in (0..).zip(waited) {
            set.push(
                seed,
                &facts(outcome, 1.0, 430.0, gave_up.then_some(interval)),
            );
        }
        let slips = [0.1, 0.3, 0.5].map(|interval| slip(Some(interval), None));
        reduced(&set, slips)
    }

    fn assert_close(value: Option<f64>, expected: f64) {
        assert!((value.unwrap() - expected).abs() < 1e-12, "{value:?}");
    }

    #[test]
    fn where_a_job_gave_up_the_mean_has_a_bound_alone_and_what_still_ran_is_the_longest() {
        let row = ended(JobOutcome::NoSlips, &[2.0]);
        assert_eq!(
            (row.tau_mean, row.tau_interval, row.tau_deviation),
            (None, None, None)
        );
        assert_close(row.tau_bound, (0.1 + 0.3 + 0.5 + 2.0) / 4.0);
        assert_close(row.tau_50, 0.4);
        assert_eq!((row.tau_95, row.median_interval), (None, None));
        assert_eq!((row.slips, row.intervals, row.tau_off), (3, 3, None));
        assert_close(
            row.drop_mean,
            ended(JobOutcome::Done, &[]).drop_mean.unwrap(),
        );
        // Half of the intervals still ran.
        let half = ended(JobOutcome::NoSlips, &[2.0; 3]);
        assert_eq!((half.tau_25, half.tau_50), (Some(0.35), None));
    }

    #[test]
    fn a_cut_interval_counts_for_nothing_and_the_set_says_how_much_is_missing() {
        let row = ended(JobOutcome::TimeLimit, &[0.2, 0.2]);
        let whole = ended(JobOutcome::Done, &[]);
        assert_eq!(
            (row.tau_mean, row.tau_interval, row.tau_50),
            (whole.tau_mean, whole.tau_interval, whole.tau_50)
        );
        assert_eq!(
            (row.jobs_cut, row.tau_bound, whole.tau_off),
            (2, None, None)
        );
        // Of three intervals with cv = 0.2/0.3, two jobs lost one each.
        assert_close(row.tau_off, -(0.04 / 0.09) * 2.0 / 3.0);
    }

    proptest! {
        #[test]
        fn few_slips_have_no_interval_or_one_that_holds_the_estimate_and_is_no_rounding_error(
            seed in 0_u64..1_000_000,
            jobs_count in 1_u64..5,
            slips in 1_u64..7,
            jitter in prop::sample::select(vec![0.0, 1e-3, 0.05, 1.0]),
        ) {
            let mut draws = Draws::new(seed);
            let period = 0.01;
            let slip = |number: u64, draws: &mut Draws| Slip {
                number,
                modulation: modulated(period),
                drop: 100.0 + jitter * draws.normal(),
                peak_force: 400.0 + jitter * draws.normal(),
                ..slip(
                    Some(period * (3.0 + jitter * draws.normal()).abs()),
                    Some(-1.2 + jitter * draws.normal()),
                )
            };
            let all: Vec<Slip> = (0..jobs_count)
                .flat_map(|_| 0..slips)
                .map(|number| slip(number, &mut draws))
                .collect();
            let row = reduced(&jobs(1e-6, period), all);
            for statistic in STATISTICS.iter().filter(|statistic| statistic.has_interval) {
                let end = |end: &str| row.number(&format!("{}{end}", statistic.key));
                let (Some(value), Some(low), Some(high)) = (end(""), end("_low"), end("_high"))
                else {
                    continue;
                };
                prop_assert!(low <= value && value <= high, "{}: {low} {value} {high}", statistic.key);
                let width = high - low;
                prop_assert!(
                    if jitter == 0.0 { width >= 0.0 } else { width > 1e-9 * value.abs() },
                    "{}: {value} has a width of {width}",
                    statistic.key
                );
            }
        }
    }

    /// Slips on a lattice of one period each, up to a jitter of their phases; a share of them comes a period later.
    #[test]
    fn intervals_cover_where_few_slips_are_off_n() {
        const REPETITIONS: u64 = 500;
        const PERIOD: f64 = 0.01;
        const SLIPS: u64 = 15;
        let covers = |repetition: u64, count: u64, jitter: f64, share: f64| {
            let mut draws = Draws::new(repetition);
            let mut all = Vec::new();
            for _ in 0..count {
                let mut last = jitter * draws.normal();
                for number in 0..SLIPS {
                    let phase = jitter * draws.normal();
                    let periods = 1.0 + f64::from(u8::from(draws.uniform() < share));
                    all.push(Slip {
                        number,
                        modulation: modulated(PERIOD),
                        ..slip(
                            Some(PERIOD * (periods + phase - last)),
                            Some(TAU * phase - 1.0),
                        )
                    });
                    last = phase;
                }
            }
            let row = reduced(&jobs(3e-6, PERIOD), all);
            let Interval { low, high } = row.tau_interval.unwrap();
            let mean = PERIOD * (1.0 + share);
            low <= mean && mean <= high
        };
        for (jitter, share) in [(0.02, 0.005), (0.02, 0.02), (0.05, 0.01), (0.05, 0.05)] {
            for count in [8, 16] {
                let held = (0..REPETITIONS)
                    .filter(|&repetition| covers(repetition, count, jitter, share))
                    .count();
                let coverage = 100.0 * held as f64 / REPETITIONS as f64;
                // 500 repetitions give 91 % to 1.3 (standard error).
                assert!(coverage > 87.5, "{jitter} {share} {count}: {coverage}");
            }
        }
    }

    #[test]
    fn seeds_that_share_their_start_are_found_and_those_that_have_forgotten_it_are_not() {
        // Each slip a tenth of a turn after the one before, from one phase or from a phase of each job.
        let shares_start = |spread: f64, jitter: f64| {
            let mut draws = Draws::new(1);
            let slips = (0..8).flat_map(|_| {
                let start = spread * draws.uniform();
                let phases: Vec<f64> = (0..15)
                    .map(|number| 0.1 * TAU * f64::from(number) + start + jitter * draws.normal())
                    .collect();
                (0..).zip(phases)
            });
            let slips: Vec<Slip> = slips
                .map(|(number, phase)| Slip {
                    number,
                    ..slip(Some(0.1), Some(phase))
                })
                .collect();
            reduced(&jobs(1e-6, 0.01), slips).shares_start
        };
        assert!(shares_start(0.0, 0.1) && shares_start(0.0, 0.5));
        assert!(!shares_start(TAU, 0.1) && !shares_start(0.0, 3.0));
        // Locked slips differ neither between numbers nor between seeds.
        let locked = (0..8).flat_map(|_| {
            (0..15).map(|number| Slip {
                number,
                ..slip(Some(0.1), Some(-1.0))
            })
        });
        assert!(!reduced(&jobs(1e-6, 0.01), locked).shares_start);
    }

    #[test]
    fn jobs_begin_with_their_first_slip_and_are_independent() {
        // Each job holds its own phase and interval: as many independent values as jobs.
        let of_job = |job: u32| {
            let own = 0.01 * f64::from(job * 7 % 20);
            (0..10).map(move |number| Slip {
                number,
                modulation: modulated(0.01),
                ..slip(Some(0.1 + 0.3 * own), Some(-1.0 - own))
            })
        };
        let row = reduced(&jobs(1e-6, 0.01), (0..20).flat_map(of_job));
        let mean = row.phase_mean.unwrap();
        let interval = row.phase_interval.unwrap();
        assert!(interval.low < mean && mean < interval.high);
        assert!(row.tau_interval.unwrap().low < row.tau_mean.unwrap());
        assert!(row.locking_interval.unwrap().high > row.locking_index.unwrap());
        assert_eq!(row.mean_friction_interval, None);
    }
}
