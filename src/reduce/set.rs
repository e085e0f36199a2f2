//! The table of sets, a row for each with all seeds together: what the jobs table says (outcomes, averages over the
//! time of each job), and from the slips, statistics of intervals, locking and phases.

use super::confidence::{OF_INTERVALS, OF_PHASES, Tongue, Unseen};
use super::sequence::{Centred, Estimate, Sequences, at_rank, unit};
use super::top_of_phases;
use crate::model::{Parameters, Selected};
use crate::observe::{Regime, Slip};
use crate::results::tables::JobOutcome;
use crate::sets::SetRow;
use crate::table::columns::{Interval, columns};
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
    /// Stress drop, in N.
    drop: f64,
}

impl SlipStats {
    fn of(slip: &Slip) -> Self {
        let or_missing = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let periods = slip.interval.zip(slip.modulation.period);
        let periods = periods.map(|(interval, period)| interval / period);
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

    /// Leaves the slips of other seeds out.
    pub(super) fn retain(&mut self, keeps: impl Fn(u64) -> bool) {
        self.jobs.retain(|&seed, _| keeps(seed));
    }

    /// The share of the intervals that are nearest to this number of periods.
    pub(super) fn share_of_periods(&self, periods: f64) -> Option<f64> {
        let slips = self.jobs.values().flatten();
        let all: Vec<f64> = slips.filter_map(|slip| non_nan(slip.periods)).collect();
        let nearest = all.iter().filter(|found| found.round() == periods).count();
        (!all.is_empty()).then(|| nearest as f64 / all.len() as f64)
    }

    pub(super) fn finish(self, jobs: &SetJobs) -> FinishedSet {
        let by_job: Vec<&[SlipStats]> = self.jobs.values().map(Vec::as_slice).collect();
        let tau = Intervals::new(&by_job, |slip| slip.interval, &jobs.running);
        let in_periods = Intervals::new(&by_job, |slip| slip.periods, &jobs.running);
        let n = in_periods.quantile(0.5).map(|n| floored(n.round()) as u64);
        let mean_periods = in_periods.estimate(|periods| [periods]).value();
        let tongue = Tongue::of(&in_periods.sorted, n, mean_periods);
        let mut row = jobs.row();
        row.slips = by_job.iter().map(|job| job.len() as u64).sum();
        row.periods = n;
        tau.describe(&mut row, jobs.cut, tongue);
        describe_forces(&mut row, &by_job, tongue);
        let locking = describe_locking(&mut row, &by_job, tongue);
        let cycles = Cycles::of(&jobs.parameters, row.tau_mean);
        let in_cycles = match cycles {
            None => by_job.clone(),
            Some(cycles) => cycles.within(&by_job, |slip| slip.onset),
        };
        let phases = describe_phases(&mut row, &in_cycles, tongue);
        FinishedSet {
            row,
            intervals: tau.sorted,
            seeds: self.jobs.keys().copied().collect(),
            phases,
            locking,
            tongue,
            cycles,
        }
    }
}

fn describe_forces(row: &mut SetRow, jobs: &[&[SlipStats]], tongue: Option<Tongue>) {
    let drops = sequences(jobs, |slip| Some([non_nan(slip.drop)?])).estimate();
    // A longer interval ends at a force that is higher by the additional drop.
    let unseen = tongue.map_or_else(Unseen::default, |tongue| tongue.of_mean(&drops));
    row.drop_mean = drops.value();
    row.drop_interval = drops.interval_with(unseen);
    let peak_forces = sequences(jobs, |slip| Some([non_nan(slip.peak_force)?])).estimate();
    row.peak_force_mean = peak_forces.value();
    row.peak_force_interval = peak_forces.interval_with(unseen);
    let square = drops.square_of_deviation(largest(jobs, |slip| slip.peak_force.max(slip.drop)));
    let squares = sequences(jobs, |slip| Some([square(non_nan(slip.drop)?)])).estimate();
    let unseen = tongue.map_or_else(Unseen::default, |tongue| tongue.of_squares(&drops));
    (row.drop_deviation, row.drop_deviation_interval) = squares.deviation(unseen);
    let ratio = row.drop_deviation.zip(row.drop_mean);
    row.drop_variation = ratio.map(|(deviation, mean)| deviation / mean);
}

/// Intervals in periods, as angles.
fn describe_locking(row: &mut SetRow, jobs: &[&[SlipStats]], tongue: Option<Tongue>) -> Centred<2> {
    // Whole turns are removed first: they would cost the sine its digits.
    let angle = |slip: &SlipStats| Some(unit(TAU * non_nan(slip.periods)?.fract()));
    let locking = sequences(jobs, angle).centred();
    if row.periods != Some(0) {
        row.locking_index = locking.mean.resultant_length();
        row.locking_interval = locking.length_interval(tongue.map_or(0.0, |_| OF_INTERVALS));
    }
    locking
}

fn describe_phases(row: &mut SetRow, jobs: &[&[SlipStats]], tongue: Option<Tongue>) -> Centred<2> {
    let phases = sequences(jobs, |slip| non_nan(slip.phase).map(unit)).centred();
    let top = top_of_phases(row.eta);
    row.phase_mean = phases.mean.direction(top);
    row.phase_interval = phases.mean.direction_interval(top);
    row.has_phase = row
        .phase_interval
        .is_some_and(|ends| ends.high - ends.low < WHOLE_TURN);
    row.resultant_length = phases.mean.resultant_length();
    row.length_interval = phases.length_interval(tongue.map_or(0.0, |_| OF_PHASES));
    phases
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
    pub(super) fn within<'a, T>(self, jobs: &[&'a [T]], onset: impl Fn(&T) -> f64) -> Vec<&'a [T]> {
        let mut total = 0.0;
        let mut of_job = |slips: &&'a [T]| -> &'a [T] {
            let onsets = || slips.iter().map(&onset).filter(|onset| !onset.is_nan());
            let Some((first, last)) = onsets().next().zip(onsets().last()) else {
                return &[];
            };
            let cycles = ((last - first) / self.period).floor();
            total += cycles;
            let end = first + cycles * self.period;
            &slips[..onsets().take_while(|onset| *onset < end).count()]
        };
        let within = jobs.iter().map(&mut of_job).collect();
        if total >= Self::MIN * jobs.len() as f64 {
            within
        } else {
            Vec::new()
        }
    }
}

fn largest(jobs: &[&[SlipStats]], quantity: impl Fn(&SlipStats) -> f64) -> f64 {
    jobs.iter()
        .copied()
        .flatten()
        .map(quantity)
        .fold(0.0, f64::max)
}

/// A quantity that some of the slips have.
fn sequences<const D: usize>(
    jobs: &[&[SlipStats]],
    quantity: impl Fn(&SlipStats) -> Option<[f64; D]>,
) -> Sequences<D> {
    Sequences::of(jobs.iter().map(|job| job.iter().filter_map(&quantity)))
}

/// Intervals between slips, in some unit.
struct Intervals<'a> {
    jobs: &'a [&'a [SlipStats]],
    length: fn(&SlipStats) -> f64,
    sorted: Vec<f64>,
    /// Seeds of jobs that gave up after a slip, and the time since it in s: these intervals are longer than all others.
    running: &'a [(u64, f64)],
}

impl<'a> Intervals<'a> {
    fn new(
        jobs: &'a [&'a [SlipStats]],
        length: fn(&SlipStats) -> f64,
        running: &'a [(u64, f64)],
    ) -> Self {
        let all = jobs.iter().copied().flatten().map(length);
        let mut sorted: Vec<f64> = all.filter_map(non_nan).collect();
        sorted.sort_by(f64::total_cmp);
        Self {
            jobs,
            length,
            sorted,
            running,
        }
    }

    /// The mean of a value over them; unknown if a job gave up.
    fn estimate(&self, value: impl Fn(f64) -> [f64; 1]) -> Estimate<1> {
        if !self.running.is_empty() {
            return Sequences::default().estimate();
        }
        sequences(self.jobs, |slip| non_nan((self.length)(slip)).map(&value)).estimate()
    }

    /// A quantile of all intervals; `None` if that interval still ran.
    fn quantile(&self, share: f64) -> Option<f64> {
        let last = (self.sorted.len() + self.running.len()).checked_sub(1)?;
        at_rank(&self.sorted, share.clamp(0.0, 1.0) * last as f64)
    }

    fn median_interval(&self) -> Option<Interval> {
        let median = self.quantile(0.5)?;
        let is_below = self.estimate(|length| [f64::from(u8::from(length <= median))]);
        let [low, high] = is_below.shares_about_median()?;
        Some(Interval {
            low: self.quantile(low)?,
            high: self.quantile(high)?,
        })
    }

    /// Writes their statistics into a row, if `max_time` cut those of some jobs.
    fn describe(&self, row: &mut SetRow, cut: u64, tongue: Option<Tongue>) {
        row.intervals = self.sorted.len() as u64;
        let mean = self.estimate(|interval| [interval]);
        let unseen = tongue.map_or_else(Unseen::default, |tongue| tongue.of_mean(&mean));
        row.tau_mean = mean.value();
        row.tau_interval = mean.interval_with(unseen);
        let square = mean.square_of_deviation(largest(self.jobs, |slip| slip.onset));
        let squares = self.estimate(|interval| [square(interval)]);
        let unseen = tongue.map_or_else(Unseen::default, |tongue| tongue.of_squares(&mean));
        (row.tau_deviation, row.tau_deviation_interval) = squares.deviation(unseen);
        if !self.running.is_empty() {
            let waited = self.running.iter().map(|(_, interval)| interval);
            let total = self.sorted.iter().chain(waited).sum::<f64>();
            row.tau_bound = Some(total / (self.sorted.len() + self.running.len()) as f64);
        }
        if cut > 0 {
            let relative = row.tau_deviation.zip(row.tau_mean);
            let relative = relative.map(|(deviation, mean)| deviation / mean);
            let cut_share = cut as f64 / self.sorted.len() as f64;
            row.tau_off = relative.map(|relative| -relative * relative * cut_share);
        }
        row.tau_05 = self.quantile(0.05);
        row.tau_25 = self.quantile(0.25);
        row.tau_50 = self.quantile(0.5);
        row.median_interval = self.median_interval();
        row.tau_75 = self.quantile(0.75);
        row.tau_95 = self.quantile(0.95);
    }
}

#[derive(Clone, Debug)]
pub(super) struct FinishedSet {
    pub(super) row: SetRow,
    /// Its intervals in s, sorted.
    pub(super) intervals: Vec<f64>,
    /// Seeds of the jobs of these phases and intervals.
    pub(super) seeds: Vec<u64>,
    pub(super) phases: Centred<2>,
    /// Intervals in periods, as angles.
    pub(super) locking: Centred<2>,
    pub(super) tongue: Option<Tongue>,
    /// The cycles within which phases count, if not all do.
    pub(super) cycles: Option<Cycles>,
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
    /// Seeds of jobs that gave up after a slip, and the time since it, in s.
    pub running: Vec<(u64, f64)>,
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
        let running = job.running_interval.map(|interval| (seed, interval));
        self.running.extend(running);
        self.regime = match (self.regime, job.regime) {
            (Some(regime), Some(other)) if regime != other => Some(Regime::Mixed),
            (regime, other) => other.or(regime),
        };
    }

    /// The row of the set with all that does not need its slips.
    pub(super) fn row(&self) -> SetRow {
        let slip_share = self.over_time(|job| job.slip_share);
        let friction = self.over_time(|job| job.friction);
        let coefficient = self.over_time(|job| job.friction / self.parameters.normal_force);
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
            slip_share: slip_share.value(),
            slip_share_interval: slip_share.interval().map(|ends| Interval {
                low: ends.low.max(0.0),
                high: ends.high.min(1.0),
            }),
            mean_friction: friction.value(),
            mean_friction_interval: friction.interval(),
            friction_coefficient: coefficient.value(),
            friction_coefficient_interval: coefficient.interval(),
            ..SetRow::default()
        }
    }

    /// An average over the time of all jobs: by pseudo-values, one for each job, which weigh it by its time.
    pub(super) fn over_time(&self, of: impl Fn(&JobAverages) -> f64) -> Estimate<1> {
        let sum = |of: &dyn Fn(&JobAverages) -> f64| self.averages.values().map(of).sum::<f64>();
        let time = sum(&|job| job.time);
        let average = sum(&|job| job.time * of(job)) / time;
        let weight = self.averages.len() as f64 / time;
        let jobs = self.averages.values();
        let pseudo = jobs.map(|job| [[average + (of(job) - average) * job.time * weight]]);
        Sequences::of(pseudo).estimate()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::confidence::tests::Draws;
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
