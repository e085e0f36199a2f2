//! Quantiles of a sample.

use crate::table::value::floored;

/// Quantile of sorted values, interpolated linearly (NumPy's default); `None` without values.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    at_rank(sorted, share.clamp(0.0, 1.0) * last as f64)
}

/// The value at a rank from 0, interpolated linearly; `None` beyond the last.
pub(super) fn at_rank(sorted: &[f64], rank: f64) -> Option<f64> {
    let below = floored(rank);
    let value = *sorted.get(below)?;
    let part = rank - below as f64;
    if part == 0.0 {
        return Some(value);
    }
    Some(value + part * (sorted.get(below + 1)? - value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_neighbours() {
        let values = [0.0, 1.0, 2.0, 10.0];
        assert_eq!(quantile(&values, 0.0), Some(0.0));
        assert_eq!(quantile(&values, 0.5), Some(1.5));
        assert_eq!(quantile(&values, 1.0), Some(10.0));
        assert_eq!(quantile(&[7.0], 0.3), Some(7.0));
        assert_eq!(quantile(&[], 0.3), None);
    }

    #[test]
    fn there_is_nothing_beyond_the_last_rank() {
        let ranks = [0.0, 0.5, 1.0, 1.5, 2.0];
        let found = ranks.map(|rank| at_rank(&[1.0, 2.0], rank));
        assert_eq!(found, [Some(1.0), Some(1.5), Some(2.0), None, None]);
    }
}
