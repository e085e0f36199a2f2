//! Reduction: the tables of a sweep become Fig. 3-style data: statistics per parameter set, the φ-η back-bone,
//! histograms of τ, and a sample of slips for scatter figures.

mod backbone;
mod compare;
mod confidence;
mod crossings;
mod differences;
mod dimension;
mod drive_alone;
mod gather;
#[cfg(test)]
mod pool;
mod reduction;
mod sequence;
mod set;
mod slips;
mod triggers;
mod values;

pub use crate::sets::{FREQUENCY, SetRow, is_same};
pub use crate::table::columns::Interval;
pub use backbone::BackboneBin;
pub use compare::{Comparison, compare};
pub use confidence::Mean;
#[cfg(test)]
pub(crate) use confidence::mean_of;
pub(crate) use confidence::student_at;
#[cfg(test)]
pub(crate) use crossings::{Edge, GROUPS, Sample};
pub use crossings::{EdgeRow, Ended, Line, SetOfEdges, lines, sets_of_edges};
pub use differences::Difference;
pub use gather::{Point, RampStage, reduce_chosen};
#[cfg(test)]
pub(crate) use pool::{Pool, PooledJob};
#[cfg(test)]
pub(crate) use reduction::RoundOfSet;
pub(crate) use reduction::WRITER;
pub use reduction::{
    HistogramBin, NoJobs, ReductionSummary, SetInRounds, advise, error_over_target, read_optional,
    read_reduced, read_sets, read_sets_in_rounds, reduce, renew,
};
pub use sequence::quantile;
pub use slips::{SlipOfSet, means_of_slips, sample_of_slips};
pub use triggers::{Pulses, TriggerRow};
pub use values::{Condition, Values, ascending, differing, has_even_steps, is_spread, swept};

use crate::model::theory::{load_maximum_phase, minimum_phase};
use std::f64::consts::{PI, TAU};

/// Upper end of the turn in which mean phases at some η are given, in rad. For η >= 1 the seam is in the middle of the
/// gap between Φ_max - 2π and φ_min, where no slip begins.
fn top_of_phases(eta: f64) -> f64 {
    minimum_phase(eta)
        .zip(load_maximum_phase(eta))
        .map_or(PI, |(low, high)| 0.5 * (low + high + TAU))
}
