//! A sample of slips for scatter figures.

use crate::table::columns::{Column, Getter, Table};

/// Slips up to which all become points; of more, every k-th in table order, so that at most so many remain.
pub const MOST_POINTS: u64 = 20_000;

/// A part of a run under a ramp of the modulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// On the way to the turning point.
    There,
    /// On the way back.
    Back,
    /// When the ramp is over.
    After,
}

impl Way {
    /// Where a time in s lies on a ramp that takes `ramp_time` s each way.
    pub(super) fn at(time: f64, ramp_time: f64) -> Self {
        match time / ramp_time {
            way if way < 1.0 => Self::There,
            way if way < 2.0 => Self::Back,
            _ => Self::After,
        }
    }

    const fn word(self) -> &'static str {
        match self {
            Self::There => "there",
            Self::Back => "back",
            Self::After => "after",
        }
    }

    /// The way with this word.
    pub(super) fn from_word(word: &str) -> Option<Self> {
        [Self::There, Self::Back, Self::After].into_iter().find(|way| way.word() == word)
    }
}

/// A slip as a point of a scatter figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Drive velocity V0, in m/s.
    pub drive_velocity: f64,
    /// Amplitude Δ at the onset, in m.
    pub amplitude: f64,
    /// Period T at the onset, in s; `None` without modulation.
    pub period: Option<f64>,
    /// η at the onset; 0 without modulation.
    pub eta: f64,
    /// Where on the ramp the onset lies; `None` without a ramp.
    pub way: Option<Way>,
    /// Onset, in s.
    pub onset: f64,
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
    use Getter::{Flag, OptionalCount, OptionalReal, OptionalText, Real};
    let columns = vec![
        Column::new("V0", "m/s", "drive velocity", Real(|row: &Point| row.drive_velocity)),
        Column::new("Delta", "m", "amplitude of the modulation at the onset", Real(|row| row.amplitude)),
        Column::new("T", "s", "period of the modulation at the onset", OptionalReal(|row| row.period)),
        Column::new("eta", "", "2 pi Delta / (T V0); 0 without modulation", Real(|row| row.eta)),
        Column::new(
            "way",
            "",
            "where on the ramp of the modulation the onset lies: there, back, after; null without a ramp",
            OptionalText(|row| row.way.map(|way| way.word().to_owned())),
        ),
        Column::new("onset", "s", "time of the onset", Real(|row| row.onset)),
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
