//! A sample of slips for scatter figures.

use crate::model::Parameters;
use crate::observe::Slip;
use crate::table::columns::{columns, tables};
use crate::table::value::words;

/// Slips up to which all become points; of more, every k-th in table order remains.
const MAX_POINTS: u64 = 20_000;

words! {
    /// A part of a run under a ramp of the modulation.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum RampStage {
        /// On the way to the turning point.
        Up = "up",
        Down = "down",
        /// When the ramp is over.
        After = "after",
    }
}

impl RampStage {
    /// The stage at a time in s, of a ramp that takes `ramp_time` s each way.
    fn at(time: f64, ramp_time: f64) -> Self {
        match time / ramp_time {
            share if share < 1.0 => Self::Up,
            share if share < 2.0 => Self::Down,
            _ => Self::After,
        }
    }
}

columns! {
    /// A slip as a point of a scatter figure.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Point {
        drive_velocity as "V0": f64 = "m/s", "drive velocity";
        amplitude as "Delta": f64 = "m", "amplitude of the modulation at the onset";
        period as "T": Option<f64> = "s", "period of the modulation at the onset";
        eta: f64 = "", "2 pi Delta / (T V0); 0 without modulation";
        ramp_stage: Option<RampStage> = "",
            "where on the ramp of the modulation the onset lies: up, down, after; null without a ramp";
        onset: f64 = "s", "time of the onset";
        interval: Option<f64> = "s", "time since the previous onset";
        periods: Option<u64> = "", "interval in periods T, rounded";
        phase: Option<f64> = "rad", "phase of the onset against the modulation";
        has_phase: bool = "", "whether the set of the slip has a phase";
    }
}

impl Point {
    /// A slip of a job with these parameters; whether its set has a phase is not known yet.
    pub(super) fn of(parameters: &Parameters, slip: &Slip) -> Self {
        let is_ramped = parameters.ramp_time > 0.0;
        Self {
            drive_velocity: parameters.drive_velocity,
            amplitude: slip.modulation.amplitude,
            period: slip.modulation.period,
            eta: slip.modulation.eta(parameters.drive_velocity),
            ramp_stage: is_ramped.then(|| RampStage::at(slip.onset, parameters.ramp_time)),
            onset: slip.onset,
            interval: slip.interval,
            periods: slip.periods,
            phase: slip.phase,
            has_phase: false,
        }
    }
}

tables! { Point = "points", "Slips for scatter figures: all up to 20,000, or every k-th in table order"; }

/// Distance k of the points among `slips` rows.
pub(super) const fn spacing(slips: u64) -> u64 {
    let spacing = slips.div_ceil(MAX_POINTS);
    if spacing == 0 { 1 } else { spacing }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_points_are_kept_than_a_figure_bears() {
        for slips in [0_u64, 1, 19_999, 20_000, 20_001, 40_000, 1_000_003] {
            assert!(slips.div_ceil(spacing(slips)) <= MAX_POINTS, "{slips}");
        }
        assert_eq!((spacing(20_000), spacing(20_001)), (1, 2));
    }
}
