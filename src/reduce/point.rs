//! A sample of slips for scatter figures.

use crate::store::columns::{Column, Getter, Table};

/// Slips up to which all become points; of more, every k-th in table order, so that at most so many remain.
pub const MOST_POINTS: u64 = 20_000;

/// A slip as a point of a scatter figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Drive velocity V0, in m/s.
    pub drive_velocity: f64,
    /// Amplitude Δ, in m.
    pub amplitude: f64,
    /// Period T, in s; `None` without modulation.
    pub period: Option<f64>,
    /// η; 0 without modulation.
    pub eta: f64,
    /// Interval τ, in s; `None` for the first slip of a job.
    pub interval: Option<f64>,
    /// Interval in periods, rounded.
    pub periods: Option<u64>,
    /// Phase φ, in rad.
    pub phase: Option<f64>,
    /// Whether its set is locked.
    pub is_locked: bool,
}

/// Distance k of the points among `slips` rows.
pub(super) const fn spacing(slips: u64) -> u64 {
    let spacing = slips.div_ceil(MOST_POINTS);
    if spacing == 0 { 1 } else { spacing }
}

/// The table of points.
#[must_use]
pub fn points() -> Table<Point> {
    use Getter::{Flag, OptionalCount, OptionalReal, Real};
    let columns = vec![
        Column::new("V0", "m/s", "drive velocity", Real(|row: &Point| row.drive_velocity)),
        Column::new("Delta", "m", "amplitude of the modulation", Real(|row| row.amplitude)),
        Column::new("T", "s", "period of the modulation", OptionalReal(|row| row.period)),
        Column::new("eta", "", "2 pi Delta / (T V0); 0 without modulation", Real(|row| row.eta)),
        Column::new("interval", "s", "time since the previous onset", OptionalReal(|row| row.interval)),
        Column::new("n", "", "interval in periods T, rounded", OptionalCount(|row| row.periods)),
        Column::new("phase", "rad", "phase of the onset against the modulation", OptionalReal(|row| row.phase)),
        Column::new("locked", "", "whether the set of the slip is locked", Flag(|row| row.is_locked)),
    ];
    Table {
        name: "points",
        meaning: "Slips for scatter figures: all up to 20,000, or every k-th in table order",
        columns,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_points_are_kept_than_a_figure_bears() {
        for slips in [0_u64, 1, 19_999, 20_000, 20_001, 40_000, 1_000_003] {
            assert!(slips.div_ceil(spacing(slips)) <= MOST_POINTS, "{slips}");
        }
        assert_eq!((spacing(20_000), spacing(20_001)), (1, 2));
    }
}
