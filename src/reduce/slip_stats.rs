//! What a reduction keeps of a slip.

use super::PhaseLimits;
use crate::observe::Slip;

/// What is kept of a slip until its set is whole. Missing values are NaN, so that a slip takes 40 bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SlipStats {
    /// Interval before it, in s.
    pub(super) interval: f64,
    /// The interval in periods of the modulation at its end.
    pub(super) periods: f64,
    pub(super) phase: f64,
    pub(super) load_phase: f64,
    /// Stress drop, in N; missing of a slip that is still to come when its job ends.
    pub(super) drop: f64,
}

impl SlipStats {
    pub(super) fn of(slip: &Slip, limits: &PhaseLimits) -> Self {
        let or_missing = |value: Option<f64>| value.unwrap_or(f64::NAN);
        Self {
            interval: or_missing(slip.interval),
            periods: or_missing(slip.interval.zip(slip.modulation.period).map(|(interval, period)| interval / period)),
            phase: or_missing(slip.phase),
            load_phase: or_missing(slip.phase.and_then(|phase| limits.load_phase(phase))),
            drop: slip.drop,
        }
    }

    /// Of a slip that would have come after its job ended: what its interval is at least.
    pub(super) fn to_come(interval: f64, period: Option<f64>) -> Self {
        let periods = period.map_or(f64::NAN, |period| interval / period);
        Self { interval, periods, phase: f64::NAN, load_phase: f64::NAN, drop: f64::NAN }
    }

    pub(super) const fn is_to_come(&self) -> bool {
        self.drop.is_nan()
    }
}

/// A value that is not missing.
pub(super) fn non_nan(value: f64) -> Option<f64> {
    (!value.is_nan()).then_some(value)
}
