//! The statistics of a set that a sweep file may name: columns of the reduced table of sets, which is described further
//! down the pipeline. A test there holds these names against its columns.

/// A column of the reduced table of sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Statistic {
    pub key: &'static str,
    /// Its SI unit; empty for a pure number or a word.
    pub unit: &'static str,
    /// What can be asked of it.
    pub kind: StatisticKind,
}

/// What can be asked of a statistic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatisticKind {
    /// A number with a confidence interval.
    Estimate,
    /// An angle with a confidence interval: a relative error means nothing.
    Angle,
    Number,
    /// A flag, a word, or a count that tells kinds of sets apart.
    Class,
}

use StatisticKind::{Angle, Class, Estimate, Number};

/// All that a sweep file may name.
pub const STATISTICS: [Statistic; 33] = [
    Statistic::new("tau_mean", "s", Estimate),
    Statistic::new("mean_friction", "N", Estimate),
    Statistic::new("locking_index", "", Estimate),
    Statistic::new("resultant_length", "", Estimate),
    Statistic::new("drop_mean", "N", Estimate),
    Statistic::new("phase_mean", "rad", Angle),
    Statistic::new("locked", "", Class),
    Statistic::new("regime", "", Class),
    Statistic::new("periods", "", Class),
    Statistic::new("slip_share", "", Number),
    Statistic::new("attached_fraction", "", Number),
    Statistic::new("effective_slips", "", Number),
    Statistic::new("effective_intervals", "", Number),
    Statistic::new("tau_sd", "s", Number),
    Statistic::new("tau_05", "s", Number),
    Statistic::new("tau_25", "s", Number),
    Statistic::new("tau_50", "s", Number),
    Statistic::new("tau_75", "s", Number),
    Statistic::new("tau_95", "s", Number),
    Statistic::new("periods_mean", "", Number),
    Statistic::new("rayleigh_p", "", Number),
    Statistic::new("load_rayleigh_p", "", Number),
    Statistic::new("share_below", "", Number),
    Statistic::new("drop_sd", "N", Number),
    Statistic::new("peak_force_mean", "N", Number),
    Statistic::new("duration_mean", "s", Number),
    Statistic::new("slip_distance_mean", "m", Number),
    Statistic::new("edge_distance_mean", "m", Number),
    Statistic::new("least_attached_mean", "", Number),
    Statistic::new("onset_cut_share", "", Number),
    Statistic::new("precursors_mean", "", Number),
    Statistic::new("front_speed_mean", "m/s", Number),
    Statistic::new("slow_front_speed_mean", "m/s", Number),
];

impl Statistic {
    const fn new(key: &'static str, unit: &'static str, kind: StatisticKind) -> Self {
        Self { key, unit, kind }
    }

    /// Whether it has a confidence interval.
    pub const fn has_interval(self) -> bool {
        matches!(self.kind, Estimate | Angle)
    }

    pub(super) fn from_key(key: &str) -> Option<Self> {
        STATISTICS.into_iter().find(|statistic| statistic.key == key)
    }
}
