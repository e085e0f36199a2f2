//! Reduction: the tables of a sweep become Fig. 3-style data: statistics per parameter set, the φ-η backbone,
//! histograms of τ, and a sample of slips for scatter figures.
//!
//! ```text
//! reduction.rs              a directory -> its reduced tables
//!     gather.rs             jobs and slips, set by set; drive_alone.rs: slips by the drive alone
//!     set.rs, estimate.rs   a set -> its row: values, and their intervals from units (jobs, or blocks of slips)
//!     backbone.rs, crossings.rs, triggers.rs   bins of η, edges, pulses
//! values.rs, slips.rs       columns and formulas of the rows, for figures and `show`; dimension.rs: their units
//! compare.rs, differences.rs   directories side by side
//! ```

mod backbone;
mod compare;
mod crossings;
mod differences;
mod dimension;
mod drive_alone;
mod estimate;
mod gather;
#[cfg(test)]
mod pool;
mod reduction;
mod set;
mod slips;
mod triggers;
mod values;

pub use crate::sets::{FREQUENCY, SetRow, is_same};
pub use crate::table::columns::Interval;
pub use backbone::BackboneBin;
pub use compare::{Comparison, compare};
#[cfg(test)]
pub(crate) use crossings::Edge;
pub use crossings::{
    EdgePair, EdgeRow, Ended, Line, SetOfEdges, lines, pairs_of_edges, sets_of_edges,
};
pub use differences::Difference;
pub use estimate::quantile;
pub(crate) use estimate::{Estimate, Numbers, student_at};
#[cfg(test)]
pub(crate) use estimate::{Units, mean};
pub use gather::{Point, RampStage, reduce_chosen};
#[cfg(test)]
pub(crate) use pool::{Pool, PooledJob};
#[cfg(test)]
pub(crate) use reduction::RoundOfSet;
pub use reduction::{
    HistogramBin, NoJobs, ReductionSummary, SetInRounds, advise, error_over_target, read_control,
    read_optional, read_reduced, read_sets, read_sets_in_rounds, reduce, renew,
};
pub use slips::{SlipOfSet, add_intervals, means_of_slips, points_of, sample_of_slips};
#[cfg(test)]
pub(crate) use triggers::Pulses;
pub use triggers::{PulseRow, TriggerRow};
pub use values::{Condition, Values, ascending, differing, has_even_steps, is_spread, swept};

use crate::model::theory::{load_maximum_phase, minimum_phase};
use std::f64::consts::{PI, TAU};

/// Resultant of slips at random loads: of the density 1 - η sin φ, for η >= 1 from φ_min to Φ_max.
pub(crate) fn resultant_at_random(eta: f64) -> f64 {
    let Some((low, high)) = minimum_phase(eta).zip(load_maximum_phase(eta)) else {
        return 0.5 * eta;
    };
    let integral = |phase: f64| {
        let (sine, cosine) = libm::sincos(phase);
        [
            sine - 0.5 * eta * sine * sine,
            -cosine - 0.5 * eta * (phase - sine * cosine),
        ]
    };
    let [x, y] = [0, 1].map(|part| integral(high)[part] - integral(low)[part]);
    libm::hypot(x, y) / TAU
}

/// Upper end of the turn in which mean phases at some η are given, in rad. For η >= 1 the seam is in the middle of the
/// gap between Φ_max - 2π and φ_min, where no slip begins.
fn top_of_phases(eta: f64) -> f64 {
    minimum_phase(eta)
        .zip(load_maximum_phase(eta))
        .map_or(PI, |(low, high)| 0.5 * (low + high + TAU))
}
