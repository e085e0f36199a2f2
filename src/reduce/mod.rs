//! Reduction: the tables of a sweep become Fig. 3-style data: statistics per parameter set, the φ-η back-bone, histograms
//! of τ, and a sample of slips for scatter figures.

mod backbone;
mod circular;
mod compare;
mod confidence;
mod crossings;
mod drive_alone;
mod gather;
mod histogram;
mod jobs_of_set;
#[cfg(test)]
mod pool;
mod quantile;
mod reduced;
mod reduction;
mod sample;
mod sequence;
mod set;
mod set_writer;
mod swept;
mod tongue;
mod values;

pub use crate::sets::{FREQUENCY, SetRow};
pub use crate::table::columns::Interval;
pub use backbone::BackboneBin;
pub use compare::compare;
#[cfg(test)]
pub(crate) use confidence::mean_of;
pub(crate) use confidence::student_at;
#[cfg(test)]
pub(crate) use crossings::{Edge, GROUPS, Sample};
pub use crossings::{EdgeRow, Line, SetOfEdges, lines, sets_of_edges};
pub use gather::reduce_chosen;
pub use histogram::HistogramBin;
#[cfg(test)]
pub(crate) use pool::{Pool, PooledJob};
pub use quantile::quantile;
pub use reduced::{Renewed, advise, read_reduced, read_sets, renew};
pub(crate) use reduction::WRITER;
pub use reduction::{NoJobs, ReductionSummary, reduce};
pub use sample::{Point, RampStage};
#[cfg(test)]
pub(crate) use set_writer::RoundOfSet;
pub use set_writer::{SetInRounds, error_over_target};
pub use swept::{differing, has_even_steps, is_spread, swept};
pub use values::{Values, ascending, is_same, sets_where};

use crate::model::theory::{load_maximum_phase, minimum_phase};
use std::f64::consts::{PI, TAU};

/// Upper end of the turn in which mean phases at some η are given, in rad. For η >= 1 the seam is in the middle of the gap
/// between Φ_max - 2π and φ_min, where no slip begins.
fn top_of_phases(eta: f64) -> f64 {
    minimum_phase(eta)
        .zip(load_maximum_phase(eta))
        .map_or(PI, |(low, high)| 0.5 * (low + high + TAU))
}
