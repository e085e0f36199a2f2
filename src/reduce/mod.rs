//! Reduction: the tables of a sweep become Fig. 3-style data: statistics per parameter set, the φ-η back-bone, histograms
//! of τ, and a sample of slips for scatter figures.

mod backbone;
mod circular;
mod confidence;
mod drive_alone;
mod edges;
mod gather;
mod histogram;
mod product_limit;
mod quantile;
mod reduced;
mod reduction;
mod rounds;
mod sample;
mod sequence;
mod set;
mod slip_stats;
mod statistic;

pub use crate::sweep::{Interval, SetRow};
pub use backbone::BackboneBin;
#[cfg(test)]
pub(crate) use backbone::bin_of_sets;
#[cfg(test)]
pub(crate) use confidence::mean_of;
#[cfg(test)]
pub(crate) use edges::{Edge, GROUPS, Sample};
pub use edges::{EdgeRow, Line, SetOfEdges, lines, sets_of_edges};
pub use gather::reduce_chosen;
#[cfg(test)]
pub(crate) use gather::{PooledJob, pool_of, row_of};
pub use histogram::HistogramBin;
pub use quantile::quantile;
pub use reduced::{Statistic, advise, read_reduced, read_sets};
pub(crate) use reduction::WRITER;
pub use reduction::{NoJobs, ReductionSummary, reduce};
pub use rounds::SetInRounds;
pub use sample::{Point, RampStage};

use crate::model::theory::{load_maximum_phase, minimum_phase};
use std::f64::consts::{PI, TAU};

/// How far under φ_min a phase must lie to count as under the back-bone, in rad. Inertia and the finite duration of the
/// rupture shift onsets by some hundredths of a radian; this is well past them and well inside the empty region.
const BELOW_MARGIN: f64 = 0.15;

/// Where phases can lie at some η.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PhaseLimits {
    eta: f64,
    /// φ_min, in rad; `None` for η < 1.
    minimum: Option<f64>,
    /// Upper end of the turn in which a mean phase is given, in rad. For η >= 1 the seam is in the middle of the gap between
    /// Φ_max - 2π and φ_min, where no slip begins.
    top: f64,
}

impl PhaseLimits {
    fn at(eta: f64) -> Self {
        let minimum = minimum_phase(eta);
        let seam = minimum.zip(load_maximum_phase(eta)).map(|(low, high)| 0.5 * (low + high - TAU));
        Self { eta, minimum, top: seam.map_or(PI, |seam| seam + TAU) }
    }

    /// φ + η cos φ for η < 1, where the load only grows: how far the load is between one maximum of the modulation and the
    /// next, in rad. Slips that come at random loads are uniform in it; in φ their density is 1 - η sin φ.
    fn load_phase(&self, phase: f64) -> Option<f64> {
        self.minimum.is_none().then(|| phase + self.eta * libm::cos(phase))
    }

    fn is_below(&self, phase: f64) -> bool {
        self.minimum.is_some_and(|minimum| phase < minimum - BELOW_MARGIN)
    }
}

#[cfg(test)]
mod tests {
    use super::rounds::RoundOfSet;
    use super::*;
    use crate::documented::assert_documented;
    use crate::documented::{UNITS, markdown};

    #[test]
    fn documented_reduced_tables_are_those_written() {
        let tables = [
            markdown::<SetRow>(),
            markdown::<RoundOfSet>(),
            markdown::<EdgeRow>(),
            markdown::<HistogramBin>(),
            markdown::<BackboneBin>(),
            markdown::<Point>(),
        ];
        let text = format!(
            "# Reduced tables\n\n[How they follow from the tables](results.md#reduced-data) of a sweep.\n{UNITS}\n{}",
            tables.join("\n")
        );
        assert_documented("reduced-tables.md", &text);
    }
}
