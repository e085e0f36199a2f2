//! Histograms of the interval τ, one per parameter set (Fig. 2).

use super::SetRow;
use crate::table::columns::{columns, tables};

/// Bins per mean interval: 1.9 ms at the paper's standard case, where the peaks are 5 ms wide and 50 ms apart.
const BINS_PER_MEAN: f64 = 60.0;

columns! {
    /// A bin of a histogram that holds at least one interval.
    #[derive(Clone, Debug, PartialEq)]
    pub struct HistogramBin {
        set_id: String = "", "the set, a row of the sets table";
        low: f64 = "s", "lower edge, included";
        high: f64 = "s", "upper edge, excluded";
        count: u64 = "", "intervals between slips";
        density: f64 = "1/s", "share of the set's intervals per second";
    }
}

tables! {
    HistogramBin = "histograms",
        "One row per bin of the intervals of a set, of a width of mean tau / 60; empty bins are left out";
}

/// The histogram of a set: bins of a width of mean τ/60, with an edge at 0; empty bins are left out.
pub(super) fn histogram(set: &SetRow, sorted: &[f64]) -> Vec<HistogramBin> {
    let width = set.tau_mean.unwrap_or_default() / BINS_PER_MEAN;
    if width <= 0.0 {
        return Vec::new();
    }
    let bin_of = |interval: f64| (interval / width).floor();
    let row = |members: &[f64]| {
        let bin = bin_of(members[0]);
        HistogramBin {
            set_id: set.set_id.clone(),
            low: bin * width,
            high: (bin + 1.0) * width,
            count: members.len() as u64,
            density: members.len() as f64 / (sorted.len() as f64 * width),
        }
    };
    let bins = sorted.chunk_by(|&left, &right| bin_of(left) == bin_of(right));
    bins.map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::set::SetSlips;
    use super::super::set::tests::{jobs, slip};
    use super::*;

    #[test]
    fn a_histogram_counts_every_interval_once_and_its_density_integrates_to_one() {
        let mut set = SetSlips::default();
        for step in 0..500_u32 {
            set.push(0, &slip(Some(0.1 + 0.001 * f64::from(step % 37)), None));
        }
        let set = set.finish(&jobs(0.0, 1.0));
        let bins = histogram(&set.row, &set.intervals);
        assert_eq!(bins.iter().map(|bin| bin.count).sum::<u64>(), 500);
        let integral: f64 = bins
            .iter()
            .map(|bin| bin.density * (bin.high - bin.low))
            .sum();
        assert!((integral - 1.0).abs() < 1e-12);
        assert!(
            bins.windows(2)
                .all(|pair| pair[0].high <= pair[1].low * (1.0 + 1e-12))
        );
        assert!(histogram(&set.row, &[]).is_empty());
    }
}
