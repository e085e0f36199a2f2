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
