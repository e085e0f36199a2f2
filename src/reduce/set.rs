//! One parameter set, all seeds together: intervals, locking and phase statistics.

use super::circular::Directions;
use super::moments::{Moments, quantile};
use super::{PhaseLimits, SlipSample};
use crate::model::{Parameters, Symbol};
use crate::store::columns::{Column, Getter, Table};
use std::f64::consts::TAU;

/// Largest Rayleigh p-value of a locked set: among the 1,000 or so sets of a sweep, about one that is not locked passes.
pub const LOCKED_PROBABILITY: f64 = 1e-3;
/// Least resultant length of a locked set. With many slips the faintest preference becomes significant; at 1/2 the phases
/// keep within about a sixth of a turn (s.d. 1.2 rad).
pub const LOCKED_LENGTH: f64 = 0.5;

/// Quantiles of τ that are reported.
pub const QUANTILES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Gathers the slips of a set.
#[derive(Clone, Debug, Default)]
pub(super) struct SetSlips {
    intervals: Vec<f64>,
    /// Each interval in periods of the modulation at its end.
    periods: Vec<f64>,
    slips: u64,
    phases: Directions,
    /// Load phases, for η < 1.
    loads: Directions,
    below: u64,
    drop: Moments,
    peak_force: Moments,
    duration: Moments,
    precursors: Moments,
    front_speed: Moments,
    slow_front_speed: Moments,
}

impl SetSlips {
    pub(super) fn push(&mut self, slip: &SlipSample, limits: &PhaseLimits) {
        self.slips += 1;
        self.intervals.extend(slip.interval);
        self.periods.extend(slip.interval.zip(slip.period).map(|(interval, period)| interval / period));
        if let Some(phase) = slip.phase {
            self.phases.push(phase);
            if let Some(load) = limits.load_phase(phase) {
                self.loads.push(load);
            }
            self.below += u64::from(limits.is_below(phase));
        }
        self.drop.push(slip.drop);
        self.peak_force.push(slip.peak_force);
        self.duration.push(slip.duration);
        self.precursors.push(slip.precursors);
        self.front_speed.extend(slip.front_speed);
        self.slow_front_speed.extend(slip.slow_front_speed);
    }

    /// The statistics of the set.
    pub(super) fn finish(mut self, jobs: SetJobs) -> FinishedSet {
        let eta = jobs.parameters.eta();
        let limits = PhaseLimits::at(eta);
        let (mut tau, mut periods, mut locking) = (Moments::default(), Moments::default(), Directions::default());
        tau.extend(self.intervals.iter().copied());
        for &count in &self.periods {
            periods.push(count);
            // The whole turns go first: they would cost the sine its digits.
            locking.push(TAU * count.fract());
        }
        self.intervals.sort_by(f64::total_cmp);
        let has_limit = limits.minimum.is_some() && self.phases.count() > 0;
        let rayleigh_p = self.phases.rayleigh();
        let resultant_length = self.phases.resultant_length();
        let row = SetRow {
            eta,
            slips: self.slips,
            intervals: tau.count(),
            tau_mean: tau.mean(),
            tau_deviation: tau.deviation(),
            tau_quantiles: QUANTILES.map(|share| quantile(&self.intervals, share)),
            periods_mean: periods.mean(),
            locking_index: locking.resultant_length(),
            phase_mean: self.phases.mean(limits.top),
            resultant_length,
            rayleigh_p,
            load_rayleigh_p: self.loads.rayleigh(),
            share_below: has_limit.then(|| self.below as f64 / self.phases.count() as f64),
            is_locked: rayleigh_p.is_some_and(|p| p < LOCKED_PROBABILITY)
                && resultant_length.is_some_and(|length| length > LOCKED_LENGTH),
            drop_mean: self.drop.mean(),
            drop_deviation: self.drop.deviation(),
            peak_force_mean: self.peak_force.mean(),
            duration_mean: self.duration.mean(),
            precursors_mean: self.precursors.mean(),
            front_speed_mean: self.front_speed.mean(),
            slow_front_speed_mean: self.slow_front_speed.mean(),
            jobs,
        };
        FinishedSet { row, intervals: self.intervals, phases: self.phases, loads: self.loads, below: self.below }
    }
}

/// A set whose slips are all there.
#[derive(Clone, Debug)]
pub(super) struct FinishedSet {
    /// Its statistics.
    pub(super) row: SetRow,
    /// Its intervals in s, sorted.
    pub(super) intervals: Vec<f64>,
    /// Its phases.
    pub(super) phases: Directions,
    /// Its load phases, for η < 1.
    pub(super) loads: Directions,
    /// Slips under the back-bone.
    pub(super) below: u64,
}

/// What the jobs table tells about a set.
#[derive(Clone, Debug, PartialEq)]
pub struct SetJobs {
    /// Id of the set, 32 hexadecimal characters.
    pub set_id: String,
    /// Its parameters; the seed is that of any of its jobs.
    pub parameters: Parameters,
    /// Jobs that were run to an end.
    pub finished: u64,
    /// Jobs that failed.
    pub failed: u64,
    /// Slips that the jobs recorded.
    pub slips: u64,
    /// Time-averaged shear force of the jobs, in N.
    pub friction: Moments,
}

/// A row of the reduced sets. Quantities are SI; `None` where there is nothing to average.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each is described in `sets`, the table of these rows")]
pub struct SetRow {
    pub jobs: SetJobs,
    pub eta: f64,
    pub slips: u64,
    pub intervals: u64,
    pub tau_mean: Option<f64>,
    pub tau_deviation: Option<f64>,
    pub tau_quantiles: [Option<f64>; 5],
    pub periods_mean: Option<f64>,
    pub locking_index: Option<f64>,
    pub phase_mean: Option<f64>,
    pub resultant_length: Option<f64>,
    pub rayleigh_p: Option<f64>,
    pub load_rayleigh_p: Option<f64>,
    pub share_below: Option<f64>,
    pub is_locked: bool,
    pub drop_mean: Option<f64>,
    pub drop_deviation: Option<f64>,
    pub peak_force_mean: Option<f64>,
    pub duration_mean: Option<f64>,
    pub precursors_mean: Option<f64>,
    pub front_speed_mean: Option<f64>,
    pub slow_front_speed_mean: Option<f64>,
}

/// The table of sets.
#[must_use]
pub fn sets() -> Table<SetRow> {
    use Getter::{Count, Flag, OptionalReal, Real, Text};
    let mut columns = vec![Column::new(
        "set_id",
        "",
        "hash of all that defines a job but the seed",
        Text(|row: &SetRow| row.jobs.set_id.clone()),
    )];
    let parameters = Symbol::ALL.into_iter().filter(|&symbol| symbol != Symbol::Seed);
    columns.extend(parameters.map(|symbol| Column::parameter(symbol, |row: &SetRow| &row.jobs.parameters)));
    columns.extend([
        Column::new("eta", "", "2 pi Delta / (T V0); 0 without modulation", Real(|row: &SetRow| row.eta)),
        Column::new("jobs", "", "jobs run to an end, one per seed", Count(|row| row.jobs.finished)),
        Column::new("failed_jobs", "", "jobs that failed", Count(|row| row.jobs.failed)),
        Column::new("slips", "", "slips of all seeds", Count(|row| row.slips)),
        Column::new("intervals", "", "intervals between slips", Count(|row| row.intervals)),
        Column::new("tau_mean", "s", "mean interval", OptionalReal(|row| row.tau_mean)),
        Column::new("tau_sd", "s", "standard deviation of the intervals", OptionalReal(|row| row.tau_deviation)),
        Column::new("tau_05", "s", "5 % quantile of the intervals", OptionalReal(|row| row.tau_quantiles[0])),
        Column::new("tau_25", "s", "25 % quantile", OptionalReal(|row| row.tau_quantiles[1])),
        Column::new("tau_50", "s", "median", OptionalReal(|row| row.tau_quantiles[2])),
        Column::new("tau_75", "s", "75 % quantile", OptionalReal(|row| row.tau_quantiles[3])),
        Column::new("tau_95", "s", "95 % quantile", OptionalReal(|row| row.tau_quantiles[4])),
        Column::new("periods_mean", "", "mean of the intervals over T at their onset", OptionalReal(|row| row.periods_mean)),
        Column::new(
            "locking_index",
            "",
            "|<exp(2 pi i tau / T)>|: 1 if every interval is a whole number of periods",
            OptionalReal(|row| row.locking_index),
        ),
        Column::new("phase_mean", "rad", "circular mean of the phase", OptionalReal(|row| row.phase_mean)),
        Column::new(
            "resultant_length",
            "",
            "|<exp(i phi)>|: 1 if every slip has the same phase",
            OptionalReal(|row| row.resultant_length),
        ),
        Column::new(
            "rayleigh_p",
            "",
            "p-value of the Rayleigh test against uniform phases",
            OptionalReal(|row| row.rayleigh_p),
        ),
        Column::new(
            "load_rayleigh_p",
            "",
            "p-value of the Rayleigh test of the load phases phi + eta cos(phi), for eta < 1: slips at random loads are uniform in it",
            OptionalReal(|row| row.load_rayleigh_p),
        ),
        Column::new(
            "share_below",
            "",
            "share of slips with a phase under phi_min(eta) - 0.15 rad; null for eta < 1",
            OptionalReal(|row| row.share_below),
        ),
        Column::new("locked", "", "rayleigh_p < 0.001 and resultant_length > 0.5", Flag(|row| row.is_locked)),
        Column::new("drop_mean", "N", "mean stress drop", OptionalReal(|row| row.drop_mean)),
        Column::new("drop_sd", "N", "standard deviation of the stress drop", OptionalReal(|row| row.drop_deviation)),
        Column::new(
            "peak_force_mean",
            "N",
            "mean shear force at the onset of slips",
            OptionalReal(|row| row.peak_force_mean),
        ),
        Column::new(
            "mean_friction",
            "N",
            "time-averaged shear force, mean over jobs",
            OptionalReal(|row| row.jobs.friction.mean()),
        ),
        Column::new("duration_mean", "s", "mean duration of slips", OptionalReal(|row| row.duration_mean)),
        Column::new("precursors_mean", "", "mean precursors per slip", OptionalReal(|row| row.precursors_mean)),
        Column::new("front_speed_mean", "m/s", "mean front speed of slips", OptionalReal(|row| row.front_speed_mean)),
        Column::new(
            "slow_front_speed_mean",
            "m/s",
            "mean speed of slow fronts, where there were any",
            OptionalReal(|row| row.slow_front_speed_mean),
        ),
    ]);
    Table { name: "sets", meaning: "One row per parameter set, all seeds together", columns }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::reduce) fn jobs(amplitude: f64, period: f64) -> SetJobs {
        let parameters =
            Parameters { modulation_amplitude: amplitude, modulation_period: Some(period), ..Parameters::default() }
                .validated()
                .unwrap();
        SetJobs {
            set_id: format!("{amplitude:e} {period}"),
            parameters,
            finished: 1,
            failed: 0,
            slips: 0,
            friction: Moments::default(),
        }
    }

    pub(in crate::reduce) fn slip(interval: Option<f64>, phase: Option<f64>) -> SlipSample {
        SlipSample {
            onset: 1.0,
            interval,
            period: None,
            amplitude: 1e-6,
            phase,
            periods: None,
            drop: 100.0,
            peak_force: 480.0,
            duration: 0.005,
            precursors: 2.0,
            front_speed: Some(300.0),
            slow_front_speed: None,
        }
    }

    fn reduced(jobs: SetJobs, slips: impl IntoIterator<Item = SlipSample>) -> SetRow {
        let limits = PhaseLimits::at(jobs.parameters.eta());
        let mut set = SetSlips::default();
        slips.into_iter().for_each(|slip| set.push(&slip, &limits));
        set.finish(jobs).row
    }

    #[test]
    fn intervals_of_whole_periods_lock_whatever_their_number() {
        let period = 1.0 / 29.0;
        let slip = |n: f64, period| SlipSample { period: Some(period), ..slip(Some(n * period), Some(-1.2)) };
        let row = reduced(jobs(1e-6, period), [3.0, 4.0, 4.0, 5.0, 400.0].map(|n| slip(n, period)));
        assert!(row.locking_index.unwrap() > 1.0 - 1e-9);
        assert!((row.periods_mean.unwrap() - 83.2).abs() < 1e-9);
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
            let load = TAU * (f64::from(step) / 400.0 - 0.5);
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
        assert_eq!((still.share_below, still.phase_mean, still.locking_index), (None, None, None));
        assert!((still.tau_mean.unwrap() - 0.15).abs() < 1e-15);
        assert!(!still.is_locked);
    }
}
