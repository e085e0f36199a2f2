//! The table of sets, a row for each with all seeds together: intervals, locking and phase statistics.

use super::PhaseLimits;
use super::circular::unit;
use super::gather::JobFacts;
use super::moments::{Moments, quantile};
use super::sequence::{Estimate, Sequences};
use super::slip_stats::{SlipStats, non_nan};
use crate::model::Parameters;
use crate::model::selected::Selected;
use crate::model::theory::random_load_mean;
use crate::observe::{Regime, Slip};
use crate::results::tables::JobOutcome;
use crate::sweep::Interval;
pub use crate::sweep::SetRow;
use std::f64::consts::TAU;

/// Largest Rayleigh p-value of a locked set: among the 1,000 or so sets of a sweep, about one that is not locked passes.
const LOCKED_PROBABILITY: f64 = 1e-3;
/// Least resultant length of a locked set. With many slips the faintest preference becomes significant; at 1/2 the phases
/// keep within about a sixth of a turn (s.d. 1.2 rad).
const LOCKED_LENGTH: f64 = 0.5;

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
    /// Time-averaged shear force of the jobs, in N.
    pub friction: Moments,
    /// Time-averaged fraction of contacts that are attached, of the jobs.
    pub attached_fraction: Moments,
    /// Share of time within slips, of the jobs.
    pub slip_share: Moments,
    /// How the slider moved in the jobs; mixed if they differ.
    pub regime: Option<Regime>,
    /// Seed of the last of them, and whether one came after a higher seed.
    pub last_seed: Option<u64>,
    pub is_out_of_order: bool,
}

impl SetJobs {
    /// A job of the set has ended.
    pub(super) fn push(&mut self, seed: u64, job: &JobFacts) {
        self.is_out_of_order |= self.last_seed.is_some_and(|last| last >= seed);
        self.last_seed = Some(seed);
        if job.outcome == JobOutcome::Failed {
            self.failed += 1;
            return;
        }
        self.finished += 1;
        self.slips = self.slips.saturating_add(job.slips.unwrap_or(0));
        self.without_slips += u64::from(job.outcome == JobOutcome::NoSlips);
        self.friction.extend(job.mean_friction);
        self.attached_fraction.extend(job.attached_fraction);
        self.slip_share.extend(job.slip_share);
        self.regime = match (self.regime, job.regime) {
            (Some(regime), Some(other)) if regime != other => Some(Regime::Mixed),
            (regime, other) => other.or(regime),
        };
    }
}

/// Gathers the slips of a set, job after job.
#[derive(Clone, Debug, Default)]
pub(super) struct SetSlips {
    slips: Vec<SlipStats>,
    starts: Vec<usize>,
    /// Seeds of the jobs that have slips.
    seeds: Vec<u64>,
    below: u64,
    peak_force: Moments,
    duration: Moments,
    distance: Moments,
    edge_distance: Moments,
    least_attached: Moments,
    onset_cut: Moments,
    precursors: Moments,
    front_speed: Moments,
    slow_front_speed: Moments,
}

impl SetSlips {
    pub(super) fn push(&mut self, seed: u64, slip: &Slip, limits: &PhaseLimits) {
        if slip.number == 0 || self.seeds.last() != Some(&seed) {
            self.starts.push(self.slips.len());
            self.seeds.push(seed);
        }
        self.slips.push(SlipStats::of(slip, limits));
        self.below += u64::from(slip.phase.is_some_and(|phase| limits.is_below(phase)));
        self.peak_force.push(slip.peak_force);
        self.duration.push(slip.duration);
        self.distance.push(slip.distance);
        self.edge_distance.push(slip.edge_distance);
        self.least_attached.push(slip.least_attached);
        self.onset_cut.push(f64::from(u8::from(slip.onset_cut)));
        self.precursors.push(slip.precursors as f64);
        self.front_speed.extend(slip.front_speed);
        self.slow_front_speed.extend(slip.slow_front_speed);
    }

    pub(super) fn finish(self, jobs: SetJobs) -> FinishedSet {
        let eta = jobs.parameters.eta();
        let limits = PhaseLimits::at(eta);
        let by_job = self.by_job();
        let intervals = estimate(&by_job, |slip| non_nan(slip.interval).map(|interval| [interval]));
        let drops = estimate(&by_job, |slip| Some([slip.drop]));
        // The whole turns go first: they would cost the sine its digits.
        let locking = estimate(&by_job, |slip| non_nan(slip.periods).map(|periods| unit(TAU * periods.fract())));
        let of_angle =
            |angle: fn(&SlipStats) -> f64| sequences(&by_job, |slip| non_nan(angle(slip)).map(unit)).centred();
        let (phase_deviations, phases) = of_angle(|slip| slip.phase);
        let (load_deviations, loads) = of_angle(|slip| slip.load_phase);

        let mut sorted: Vec<f64> = self.slips.iter().filter_map(|slip| non_nan(slip.interval)).collect();
        let mut periods: Vec<f64> = self.slips.iter().filter_map(|slip| non_nan(slip.periods)).collect();
        let mut mean_periods = Moments::default();
        mean_periods.extend(periods.iter().copied());
        sorted.sort_by(f64::total_cmp);
        periods.sort_by(f64::total_cmp);

        let has_limit = limits.minimum.is_some() && phases.count() > 0;
        let (rayleigh_p, resultant_length) = (phases.rayleigh(), phases.resultant_length());
        let expected = (phases.count() > 0).then(|| {
            let [real, imaginary] = random_load_mean(eta);
            real.hypot(imaginary)
        });
        let [tau_05, tau_25, tau_50, tau_75, tau_95] = QUANTILES.map(|share| quantile(&sorted, share));
        let (tau_deviation, tau_deviation_interval) = deviation(&by_job, &intervals, |slip| non_nan(slip.interval));
        let (drop_deviation, drop_deviation_interval) = deviation(&by_job, &drops, |slip| Some(slip.drop));
        let median_interval = tau_50.and_then(|median| {
            let is_below = |interval: f64| [f64::from(u8::from(interval <= median))];
            let shares = estimate(&by_job, |slip| non_nan(slip.interval).map(is_below)).shares_about_median()?;
            let [low, high] = shares.map(|share| quantile(&sorted, share));
            Some(Interval { low: low?, high: high? })
        });
        let mean = |[mean]: [f64; 1]| mean;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a ratio of positive numbers")]
        let whole = |periods: f64| periods.round() as u64;
        let row = SetRow {
            set_id: jobs.set_id,
            parameters: Selected::new(jobs.parameters),
            eta,
            finished_jobs: jobs.finished,
            failed_jobs: jobs.failed,
            jobs_without_slips: jobs.without_slips,
            regime: jobs.regime,
            slip_share: jobs.slip_share.mean(),
            attached_fraction: jobs.attached_fraction.mean(),
            slips: self.slips.len() as u64,
            intervals: intervals.count(),
            effective_slips: phases.effective(),
            effective_intervals: intervals.effective(),
            tau_mean: intervals.mean().map(mean),
            tau_interval: intervals.interval(),
            tau_deviation,
            tau_deviation_interval,
            tau_05,
            tau_25,
            tau_50,
            median_interval,
            tau_75,
            tau_95,
            periods_mean: mean_periods.mean(),
            periods: quantile(&periods, 0.5).map(whole),
            locking_index: locking.resultant_length(),
            locking_interval: locking.length_interval(),
            expected_locking_index: expected.map(|length| length * length),
            phase_mean: phases.direction(limits.top),
            phase_interval: phases.direction_interval(limits.top),
            resultant_length,
            length_interval: phases.length_interval(),
            expected_resultant: expected,
            rayleigh_p,
            load_rayleigh_p: loads.rayleigh(),
            share_below: has_limit.then(|| self.below as f64 / phases.count() as f64),
            is_locked: rayleigh_p.is_some_and(|p| p < LOCKED_PROBABILITY)
                && resultant_length.is_some_and(|length| length > LOCKED_LENGTH),
            drop_mean: drops.mean().map(mean),
            drop_interval: drops.interval(),
            drop_deviation,
            drop_deviation_interval,
            peak_force_mean: self.peak_force.mean(),
            mean_friction: jobs.friction.mean(),
            mean_friction_interval: jobs.friction.interval(),
            duration_mean: self.duration.mean(),
            distance_mean: self.distance.mean(),
            edge_distance_mean: self.edge_distance.mean(),
            least_attached_mean: self.least_attached.mean(),
            onset_cut_share: self.onset_cut.mean(),
            precursors_mean: self.precursors.mean(),
            front_speed_mean: self.front_speed.mean(),
            slow_front_speed_mean: self.slow_front_speed.mean(),
        };
        let phases = OfSet { estimate: phases, deviations: phase_deviations };
        let loads = OfSet { estimate: loads, deviations: load_deviations };
        FinishedSet { row, intervals: sorted, seeds: self.seeds, phases, loads, below: self.below }
    }

    fn by_job(&self) -> Vec<&[SlipStats]> {
        let ends = self.starts.iter().skip(1).copied().chain([self.slips.len()]);
        self.starts.iter().zip(ends).map(|(&start, end)| &self.slips[start..end]).collect()
    }
}

/// A quantity that some of the slips have.
fn sequences<const D: usize>(jobs: &[&[SlipStats]], quantity: impl Fn(&SlipStats) -> Option<[f64; D]>) -> Sequences<D> {
    Sequences::of(jobs.iter().map(|job| job.iter().filter_map(&quantity)))
}

/// Its mean.
fn estimate<const D: usize>(jobs: &[&[SlipStats]], quantity: impl Fn(&SlipStats) -> Option<[f64; D]>) -> Estimate<D> {
    sequences(jobs, quantity).estimate()
}

/// Its standard deviation.
fn deviation(
    jobs: &[&[SlipStats]],
    of: &Estimate<1>,
    quantity: impl Fn(&SlipStats) -> Option<f64>,
) -> (Option<f64>, Option<Interval>) {
    let [mean] = of.mean().unwrap_or_default();
    estimate(jobs, |slip| quantity(slip).map(|value| [(value - mean) * (value - mean)])).deviation()
}

/// Unit vectors of a set.
#[derive(Clone, Debug)]
pub(super) struct OfSet {
    pub(super) estimate: Estimate<2>,
    /// Their deviations from the mean, job by job.
    pub(super) deviations: Sequences<2>,
}

/// A set whose slips are all there.
#[derive(Clone, Debug)]
pub(super) struct FinishedSet {
    pub(super) row: SetRow,
    /// Its intervals in s, sorted.
    pub(super) intervals: Vec<f64>,
    /// Seeds of its jobs that have slips.
    pub(super) seeds: Vec<u64>,
    pub(super) phases: OfSet,
    /// Its load phases, for η < 1.
    pub(super) loads: OfSet,
    pub(super) below: u64,
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::observe::Modulation;

    pub(in crate::reduce) fn jobs(amplitude: f64, period: f64) -> SetJobs {
        let parameters =
            Parameters { modulation_amplitude: amplitude, modulation_period: Some(period), ..Parameters::default() }
                .validated()
                .unwrap();
        SetJobs { set_id: format!("{amplitude:e} {period}"), parameters, finished: 1, ..SetJobs::default() }
    }

    pub(in crate::reduce) fn slip(interval: Option<f64>, phase: Option<f64>) -> Slip {
        let modulation = Modulation { period: None, amplitude: 1e-6 };
        Slip { number: 1, interval, modulation, phase, ..crate::results::tables::tests::slip(1) }
    }

    fn modulated(period: f64) -> Modulation {
        Modulation { period: Some(period), amplitude: 1e-6 }
    }

    fn reduced(jobs: SetJobs, slips: impl IntoIterator<Item = Slip>) -> SetRow {
        let limits = PhaseLimits::at(jobs.parameters.eta());
        let mut set = SetSlips::default();
        slips.into_iter().for_each(|slip| set.push(0, &slip, &limits));
        set.finish(jobs).row
    }

    #[test]
    fn intervals_of_whole_periods_lock_whatever_their_number() {
        let period = 1.0 / 29.0;
        let slip = |n: f64, period| Slip { modulation: modulated(period), ..slip(Some(n * period), Some(-1.2)) };
        let row = reduced(jobs(1e-6, period), [3.0, 4.0, 4.0, 5.0, 400.0].map(|n| slip(n, period)));
        assert!(row.locking_index.unwrap() > 1.0 - 1e-9);
        assert!((row.periods_mean.unwrap() - 83.2).abs() < 1e-9);
        assert_eq!(row.periods, Some(4));
        assert!((row.phase_mean.unwrap() + 1.2).abs() < 1e-12);
        let halves = reduced(jobs(1e-6, period), [3.0, 3.5, 4.0, 4.5].map(|n| slip(n, period)));
        assert!(halves.locking_index.unwrap() < 1e-9);
        // On a ramp, of the periods at the onsets.
        let ramped = reduced(jobs(1e-6, period), [0.03, 0.0313, 0.0371].map(|period| slip(4.0, period)));
        assert!(ramped.locking_index.unwrap() > 1.0 - 1e-9 && (ramped.periods_mean.unwrap() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn slips_at_random_loads_are_uniform_in_the_load_phase_but_not_in_the_phase() {
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
                if middle + eta * libm::cos(middle) < load { low = middle } else { high = middle }
            }
            slip(None, Some(low))
        });
        let row = reduced(jobs, phases);
        assert!(row.rayleigh_p.unwrap() < 1e-3);
        assert!((row.resultant_length.unwrap() - 0.5 * eta).abs() < 1e-3);
        assert!(row.load_rayleigh_p.unwrap() > 0.99);
    }

    #[test]
    fn a_set_is_locked_only_if_phases_are_both_close_and_many() {
        let at = |phases: &[f64]| reduced(jobs(1e-6, 0.01), phases.iter().map(|&phase| slip(None, Some(phase))));
        assert!(at(&[-0.9; 12]).is_locked);
        assert!(!at(&[-0.7, -0.9, -1.1]).is_locked, "three slips prove nothing");
        // A faint preference, highly significant.
        let faint: Vec<f64> =
            (0..3000).map(|slip| f64::from(slip % 3) * TAU / 3.0 * f64::from(u8::from(slip % 5 > 0))).collect();
        let faint = at(&faint);
        assert!(faint.rayleigh_p.unwrap() < LOCKED_PROBABILITY);
        assert!(!faint.is_locked);
    }

    #[test]
    fn slips_under_the_back_bone_are_counted_with_the_margin_of_eq_2() {
        // η = 6.28: φ_min = -1.336 rad.
        let modulated = jobs(1e-6, 0.01);
        let phases = [-1.3, -1.4, -1.47, -1.5, -2.0];
        let row = reduced(modulated.clone(), phases.map(|phase| slip(None, Some(phase))));
        assert_eq!(row.share_below, Some(2.0 / 5.0));
        let slow = jobs(1e-6, 1.0);
        assert_eq!(reduced(slow, phases.map(|phase| slip(None, Some(phase)))).share_below, None);
        let still = reduced(jobs(0.0, 1.0), [slip(Some(0.1), None), slip(Some(0.2), None)]);
        assert_eq!((still.share_below, still.phase_mean, still.locking_index, still.periods), (None, None, None, None));
        assert!((still.tau_mean.unwrap() - 0.15).abs() < 1e-15);
        assert!(!still.is_locked);
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
        for effective in [row.effective_slips, row.effective_intervals] {
            assert!((effective.unwrap() - 20.0).abs() < 2.0, "{effective:?}");
        }
        let (mean, interval) = (row.phase_mean.unwrap(), row.phase_interval.unwrap());
        assert!(interval.low < mean && mean < interval.high);
        assert!(row.tau_interval.unwrap().low < row.tau_mean.unwrap());
        assert!(row.locking_interval.unwrap().high > row.locking_index.unwrap());
        assert_eq!(row.mean_friction_interval, None);
    }
}
