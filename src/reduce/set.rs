//! The table of sets, a row for each with all seeds together: intervals, locking and phase statistics.

use super::circular::unit;
use super::confidence::Unseen;
use super::gather::JobFacts;
use super::quantile::at_rank;
use super::sequence::{Estimate, Sequences};
use super::tongue::{OF_INTERVALS, OF_PHASES, Tongue};
use super::top_of_phases;
use crate::model::Parameters;
use crate::model::selected::Selected;
use crate::observe::{Regime, Slip};
use crate::results::tables::JobOutcome;
pub use crate::sweep::SetRow;
use crate::table::columns::Interval;
use crate::table::value::floored;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Width from which an interval of a mean phase counts as the whole turn, in rad: others are half a turn wide at most.
const WHOLE_TURN: f64 = 1.5 * PI;

/// Quantiles of τ that are reported.
const QUANTILES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// What the jobs table says about a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SetJobs {
    /// Id of the set, 32 hexadecimal characters.
    pub set_id: String,
    /// Its parameters; the seed is that of any of its jobs.
    pub parameters: Parameters,
    /// Jobs that were run to an end.
    pub finished: u64,
    pub failed: u64,
    /// Slips that the jobs recorded.
    pub slips: u64,
    /// Jobs that gave up, since no slip came.
    pub without_slips: u64,
    /// What the jobs are on average over time, by their seeds.
    pub averages: BTreeMap<u64, JobAverages>,
    /// Jobs that `max_time` ended.
    pub cut: u64,
    /// Seeds of jobs that gave up after a slip, and the time since it, in s.
    pub running: Vec<(u64, f64)>,
    /// How the slider moved in the jobs; mixed if they differ.
    pub regime: Option<Regime>,
}

/// What a job is on average over a time in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JobAverages {
    time: f64,
    /// In N.
    friction: f64,
    slip_share: f64,
}

impl SetJobs {
    /// A job of the set has ended.
    pub(super) fn push(&mut self, seed: u64, job: &JobFacts) {
        if job.outcome == JobOutcome::Failed {
            self.failed += 1;
            return;
        }
        self.finished += 1;
        self.slips = self.slips.saturating_add(job.slips.unwrap_or(0));
        self.without_slips += u64::from(job.outcome == JobOutcome::NoSlips);
        self.cut += u64::from(job.outcome == JobOutcome::TimeLimit);
        if let (Some(time), Some(friction), Some(slip_share)) =
            (job.averaged_time, job.mean_friction, job.slip_share)
        {
            self.averages.insert(
                seed,
                JobAverages {
                    time,
                    friction,
                    slip_share,
                },
            );
        }
        // Earlier versions have one of jobs that `max_time` ended, too.
        let running = job
            .running_interval
            .filter(|_| job.outcome == JobOutcome::NoSlips);
        self.running
            .extend(running.map(|interval| (seed, interval)));
        self.regime = match (self.regime, job.regime) {
            (Some(regime), Some(other)) if regime != other => Some(Regime::Mixed),
            (regime, other) => other.or(regime),
        };
    }

    /// An average over the time of all jobs: by pseudo-values, one for each job, which weigh it by its time.
    fn over_time(&self, of: impl Fn(&JobAverages) -> f64) -> Estimate<1> {
        let sum = |of: &dyn Fn(&JobAverages) -> f64| self.averages.values().map(of).sum::<f64>();
        let time = sum(&|job| job.time);
        let average = sum(&|job| job.time * of(job)) / time;
        let weight = self.averages.len() as f64 / time;
        let pseudo = self
            .averages
            .values()
            .map(|job| [average + (of(job) - average) * job.time * weight]);
        Sequences::independent(pseudo.collect()).estimate()
    }
}

/// What is kept of a slip until its set is whole. Missing values are NaN, so that a slip takes 48 bytes.
#[derive(Clone, Copy, Debug)]
struct SlipStats {
    onset: f64,
    /// Interval before it, in s.
    interval: f64,
    /// The interval in periods of the modulation at its end.
    periods: f64,
    phase: f64,
    /// In N.
    peak_force: f64,
    /// Stress drop, in N.
    drop: f64,
}

impl SlipStats {
    fn of(slip: &Slip) -> Self {
        let or_missing = |value: Option<f64>| value.unwrap_or(f64::NAN);
        Self {
            onset: slip.onset,
            interval: or_missing(slip.interval),
            periods: or_missing(
                slip.interval
                    .zip(slip.modulation.period)
                    .map(|(interval, period)| interval / period),
            ),
            phase: or_missing(slip.phase),
            peak_force: slip.peak_force,
            drop: slip.drop,
        }
    }
}

/// A value that is not missing.
fn non_nan(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}

/// Gathers the slips of a set.
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

    /// Leaves the slips of other seeds out.
    pub(super) fn retain(&mut self, keeps: impl Fn(u64) -> bool) {
        self.jobs.retain(|&seed, _| keeps(seed));
    }

    /// The share of the intervals that are nearest to this number of periods.
    pub(super) fn share_of_periods(&self, periods: f64) -> Option<f64> {
        let all = self
            .jobs
            .values()
            .flatten()
            .filter_map(|slip| non_nan(slip.periods));
        let nearest: Vec<f64> = all
            .map(|found| f64::from(u8::from(found.round() == periods)))
            .collect();
        (!nearest.is_empty()).then(|| nearest.iter().sum::<f64>() / nearest.len() as f64)
    }

    pub(super) fn finish(self, jobs: SetJobs) -> FinishedSet {
        let slips = self.jobs.values().map(|job| job.len() as u64).sum();
        let by_job: Vec<&[SlipStats]> = self.jobs.values().map(Vec::as_slice).collect();
        let eta = jobs.parameters.eta();
        let top = top_of_phases(eta);
        let running = jobs.running.len();
        let tau = Intervals::new(&by_job, |slip| slip.interval, running);
        let over_period = Intervals::new(&by_job, |slip| slip.periods, running);
        let intervals = tau.estimate(|interval| [interval]);
        let drops = estimate(&by_job, |slip| Some([slip.drop]));
        let periods = over_period.quantile(0.5).map(|n| floored(n.round()) as u64);
        let mean = |[mean]: [f64; 1]| mean;
        let periods_mean = over_period.estimate(|periods| [periods]).mean().map(mean);
        let tongue = Tongue::of(&over_period.sorted, periods);
        let unseen = |of: &dyn Fn(&Tongue) -> Unseen| tongue.as_ref().map(of).unwrap_or_default();
        // What a period more changes.
        let step = |of: &Estimate<1>| {
            let ([mean], periods) = of.mean().zip(periods_mean).unwrap_or(([0.0], 1.0));
            mean / periods
        };
        // A longer interval ends at a force that is higher by what it drops more.
        let unseen_forces = unseen(&|tongue| tongue.of_mean(step(&drops)));
        // The whole turns go first: they would cost the sine its digits.
        let of_intervals = sequences(&by_job, |slip| {
            non_nan(slip.periods).map(|periods| unit(TAU * periods.fract()))
        })
        .centred();
        let tau_mean = intervals.mean().map(mean);
        let cycles = Cycles::of(&jobs.parameters, tau_mean);
        let in_cycles: Vec<&[SlipStats]> = match &cycles {
            None => by_job.clone(),
            Some(cycles) => cycles.within(&by_job, |slip| slip.onset),
        };
        let of_phases = sequences(&in_cycles, |slip| non_nan(slip.phase).map(unit)).centred();
        let (locking, phases) = (of_intervals.1, of_phases.1);

        let phase_interval = phases.direction_interval(top);
        let [tau_05, tau_25, tau_50, tau_75, tau_95] = QUANTILES.map(|share| tau.quantile(share));
        let square = |of: &Estimate<1>| {
            let [mean] = of.mean().unwrap_or_default();
            move |value: f64| [(value - mean) * (value - mean)]
        };
        let (tau_square, drop_square) = (square(&intervals), square(&drops));
        let (tau_deviation, tau_deviation_interval) = tau
            .estimate(tau_square)
            .deviation(unseen(&|tongue| tongue.of_squares(step(&intervals))));
        let (drop_deviation, drop_deviation_interval) =
            estimate(&by_job, |slip| Some(drop_square(slip.drop)))
                .deviation(unseen(&|tongue| tongue.of_squares(step(&drops))));
        let waited = jobs.running.iter().map(|(_, interval)| interval);
        let at_least = tau.sorted.iter().chain(waited).sum::<f64>();
        let tau_bound = (running > 0).then(|| at_least / (tau.sorted.len() + running) as f64);
        let cut_share = jobs.cut as f64 / tau.sorted.len() as f64;
        let relative = tau_deviation.zip(tau_mean).map(|(sd, mean)| sd / mean);
        let tau_off = relative
            .filter(|_| jobs.cut > 0)
            .map(|relative| -relative * relative * cut_share);
        let friction = jobs.over_time(|job| job.friction);
        let coefficient = jobs.over_time(|job| job.friction / jobs.parameters.normal_force);
        let peak_forces = estimate(&by_job, |slip| Some([slip.peak_force]));
        let slip_share = jobs.over_time(|job| job.slip_share);
        let can_lock = periods != Some(0);
        let row = SetRow {
            set_id: jobs.set_id,
            frequency: jobs.parameters.frequency(),
            parameters: Selected::new(jobs.parameters),
            eta,
            finished_jobs: jobs.finished,
            failed_jobs: jobs.failed,
            jobs_without_slips: jobs.without_slips,
            jobs_cut: Some(jobs.cut),
            regime: jobs.regime,
            slip_share: slip_share.mean().map(mean),
            slip_share_interval: slip_share.interval().map(|ends| Interval {
                low: ends.low.max(0.0),
                high: ends.high.min(1.0),
            }),
            slips,
            intervals: tau.sorted.len() as u64,
            tau_mean,
            tau_interval: intervals
                .interval_with(unseen(&|tongue| tongue.of_mean(step(&intervals)))),
            tau_bound,
            tau_off,
            tau_deviation,
            tau_deviation_interval,
            tau_05,
            tau_25,
            tau_50,
            median_interval: tau.median_interval(),
            tau_75,
            tau_95,
            periods,
            locking_index: locking.resultant_length().filter(|_| can_lock),
            locking_interval: locking
                .length_interval(&of_intervals.0, tongue.map_or(0.0, |_| OF_INTERVALS))
                .filter(|_| can_lock),
            phase_mean: phases.direction(top),
            phase_interval,
            has_phase: phase_interval.is_some_and(|Interval { low, high }| high - low < WHOLE_TURN),
            resultant_length: phases.resultant_length(),
            length_interval: phases
                .length_interval(&of_phases.0, tongue.map_or(0.0, |_| OF_PHASES)),
            drop_mean: drops.mean().map(mean),
            drop_interval: drops.interval_with(unseen_forces),
            drop_deviation,
            drop_deviation_interval,
            peak_force_mean: peak_forces.mean().map(mean),
            peak_force_interval: peak_forces.interval_with(unseen_forces),
            mean_friction: friction.mean().map(mean),
            mean_friction_interval: friction.interval(),
            friction_coefficient: coefficient.mean().map(mean),
            friction_coefficient_interval: coefficient.interval(),
            // What the drive alone explains: see `drive_alone.rs`.
            ..SetRow::default()
        };
        let intervals = tau.sorted;
        let seeds = self.jobs.into_keys().collect();
        FinishedSet {
            row,
            intervals,
            seeds,
            phases: of_phases,
            locking: of_intervals,
            tongue,
            cycles,
        }
    }
}

/// Whole cycles of a modulation that is as slow as slips follow each other, or slower: a run holds few of them, and where it
/// begins and ends would be a phase.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cycles {
    period: f64,
}

impl Cycles {
    /// Cycles that a job must have on average.
    const MIN: f64 = 2.0;

    /// Those of a set with this mean interval; `None` if all slips count.
    fn of(parameters: &Parameters, tau_mean: Option<f64>) -> Option<Self> {
        let period = parameters.modulation_period?;
        let is_slow = parameters.ramp_time == 0.0 && period >= tau_mean?;
        is_slow.then_some(Self { period })
    }

    /// Of each job, the slips within whole cycles from its first one on; none if these are too few.
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

/// A quantity that some of the slips have.
fn sequences<const D: usize>(
    jobs: &[&[SlipStats]],
    quantity: impl Fn(&SlipStats) -> Option<[f64; D]>,
) -> Sequences<D> {
    Sequences::of(jobs.iter().map(|job| job.iter().filter_map(&quantity)))
}

/// Its mean.
fn estimate<const D: usize>(
    jobs: &[&[SlipStats]],
    quantity: impl Fn(&SlipStats) -> Option<[f64; D]>,
) -> Estimate<D> {
    sequences(jobs, quantity).estimate()
}

/// Intervals between slips, in some unit.
struct Intervals<'a> {
    jobs: &'a [&'a [SlipStats]],
    length: fn(&SlipStats) -> f64,
    sorted: Vec<f64>,
    /// Those that still ran when their jobs gave up: all that is known of them is that they are long.
    running: usize,
}

impl<'a> Intervals<'a> {
    fn new(jobs: &'a [&'a [SlipStats]], length: fn(&SlipStats) -> f64, running: usize) -> Self {
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

    /// The mean of a value over them; not known if a job gave up.
    fn estimate<const D: usize>(&self, value: impl Fn(f64) -> [f64; D]) -> Estimate<D> {
        if self.running > 0 {
            return Estimate::default();
        }
        estimate(self.jobs, |slip| non_nan((self.length)(slip)).map(&value))
    }

    /// Of all, those that still ran being the longest; none if it is one of them.
    fn quantile(&self, share: f64) -> Option<f64> {
        let last = (self.sorted.len() + self.running).checked_sub(1)?;
        at_rank(&self.sorted, share.clamp(0.0, 1.0) * last as f64)
    }

    fn median_interval(&self) -> Option<Interval> {
        let median = self.quantile(0.5)?;
        let shares = self
            .estimate(|length| [f64::from(u8::from(length <= median))])
            .shares_about_median()?;
        let [low, high] = shares.map(|share| self.quantile(share));
        Some(Interval {
            low: low?,
            high: high?,
        })
    }
}

/// Unit vectors of a set: their deviations from the mean, job by job, and the mean.
pub(super) type OfSet = (Sequences<2>, Estimate<2>);

/// A set whose slips are all there.
#[derive(Clone, Debug, Default)]
pub(super) struct FinishedSet {
    pub(super) row: SetRow,
    /// Its intervals in s, sorted.
    pub(super) intervals: Vec<f64>,
    /// Seeds of the jobs of these phases and intervals.
    pub(super) seeds: Vec<u64>,
    pub(super) phases: OfSet,
    /// Intervals in periods, as angles.
    pub(super) locking: OfSet,
    pub(super) tongue: Option<Tongue>,
    /// The cycles within which phases count, if not all do.
    pub(super) cycles: Option<Cycles>,
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::confidence::tests::Draws;
    use super::*;
    use crate::observe::Modulation;
    use crate::sweep::STATISTICS;
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
            finished: 1,
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

    fn reduced(jobs: SetJobs, slips: impl IntoIterator<Item = Slip>) -> SetRow {
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
            jobs(1e-6, period),
            [3.0, 4.0, 4.0, 5.0, 400.0].map(|n| slip(n, period)),
        );
        assert!(row.locking_index.unwrap() > 1.0 - 1e-9);
        assert_eq!(row.periods, Some(4));
        assert!((row.phase_mean.unwrap() + 1.2).abs() < 1e-12);
        let halves = reduced(
            jobs(1e-6, period),
            [3.0, 3.5, 4.0, 4.5].map(|n| slip(n, period)),
        );
        assert!(halves.locking_index.unwrap() < 1e-9);
        // On a ramp, of the periods at the onsets.
        let ramped = reduced(
            jobs(1e-6, period),
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
            let (mut low, mut high) = (-2.0 * TAU, 2.0 * TAU);
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
        let row = reduced(jobs, phases);
        assert!((row.resultant_length.unwrap() - 0.5 * eta).abs() < 1e-3);
    }

    #[test]
    fn a_set_has_a_phase_if_its_slips_exclude_a_direction() {
        let at = |phases: &[f64]| {
            reduced(
                jobs(1e-6, 0.01),
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
        let (even, faint) = (at(&turn(3000, 3)), at(&turn(3000, 5)));
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
            jobs(0.0, 1.0),
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
            reduced(set, [])
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
        for (seed, &interval) in (0..).zip(waited) {
            set.push(seed, &facts(outcome, 1.0, 430.0, Some(interval)));
        }
        let slips = [0.1, 0.3, 0.5].map(|interval| slip(Some(interval), None));
        reduced(set, slips)
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
        // What earlier versions saw of it is in their tables.
        let row = ended(JobOutcome::TimeLimit, &[0.2, 0.2]);
        let whole = ended(JobOutcome::Done, &[]);
        assert_eq!(
            (row.tau_mean, row.tau_interval, row.tau_50),
            (whole.tau_mean, whole.tau_interval, whole.tau_50)
        );
        assert_eq!(
            (row.jobs_cut, row.tau_bound, whole.tau_off),
            (Some(2), None, None)
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
            let row = reduced(jobs(1e-6, period), all);
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
            let row = reduced(jobs(3e-6, PERIOD), all);
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
        let row = reduced(jobs(1e-6, 0.01), (0..20).flat_map(of_job));
        let (mean, interval) = (row.phase_mean.unwrap(), row.phase_interval.unwrap());
        assert!(interval.low < mean && mean < interval.high);
        assert!(row.tau_interval.unwrap().low < row.tau_mean.unwrap());
        assert!(row.locking_interval.unwrap().high > row.locking_index.unwrap());
        assert_eq!(row.mean_friction_interval, None);
    }
}
