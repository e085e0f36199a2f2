//! Rank tests of whether two samples come from one distribution.

use std::f64::consts::SQRT_2;

/// A sample and n/n_eff: how many times the variance of its mean exceeds that of independent values.
#[derive(Clone, Copy)]
pub(super) struct Sample<'a> {
    pub(super) values: &'a [f64],
    pub(super) inflation: f64,
}

/// Two-sided p-value of the test of Mann and Whitney, Ann. Math. Stat. 18, 50 (1947), in the normal limit with ties;
/// `None` for an empty sample. The variance of U, (n1 n2)² (1/n1 + 1/n2 + 1/(n1 n2))/12, is taken with effective
/// numbers.
pub(super) fn rank_test(first: Sample<'_>, second: Sample<'_>) -> Option<f64> {
    if first.values.is_empty() || second.values.is_empty() {
        return None;
    }
    let (n1, n2) = (first.values.len() as f64, second.values.len() as f64);
    // The second sample first: it is the longer one and may be sorted already.
    let mut all: Vec<(f64, bool)> = second.values.iter().map(|&value| (value, false)).collect();
    all.extend(first.values.iter().map(|&value| (value, true)));
    all.sort_by(|left, right| left.0.total_cmp(&right.0));
    let (mut below, mut ranks, mut ties) = (0.0, 0.0, 0.0);
    for equal in all.chunk_by(|left, right| left.0 == right.0) {
        let length = equal.len() as f64;
        let of_first = equal.iter().filter(|(_, is_first)| *is_first).count() as f64;
        ranks += of_first * (below + 0.5 * (length + 1.0));
        below += length;
        ties += length * (length * length - 1.0);
    }
    let n = n1 + n2;
    let untied = 1.0 - ties / (n * (n * n - 1.0));
    // Of U/(n1 n2), the probability that a value of the first exceeds one of the second.
    let excess = (ranks - 0.5 * n1 * (n1 + 1.0)) / (n1 * n2) - 0.5;
    let variance = untied / 12.0 * (first.inflation / n1 + second.inflation / n2 + 1.0 / (n1 * n2));
    Some(if variance > 0.0 { libm::erfc(excess.abs() / variance.sqrt() / SQRT_2) } else { 1.0 })
}

/// p-values adjusted for multiple tests, after Holm, Scand. J. Stat. 6, 65 (1979): those below α are significant at a
/// family-wise level of α.
pub(super) fn holm(values: &[Option<f64>]) -> Vec<Option<f64>> {
    let mut order: Vec<(usize, f64)> =
        values.iter().enumerate().filter_map(|(index, value)| value.map(|value| (index, value))).collect();
    order.sort_by(|left, right| left.1.total_cmp(&right.1));
    let (mut adjusted, mut lower_bound) = (vec![None; values.len()], 0.0_f64);
    for (rank, &(index, value)) in order.iter().enumerate() {
        lower_bound = lower_bound.max((value * (order.len() - rank) as f64).min(1.0));
        adjusted[index] = Some(lower_bound);
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::super::confidence::tests::Draws;
    use super::*;

    fn plain(values: &[f64]) -> Sample<'_> {
        Sample { values, inflation: 1.0 }
    }

    #[test]
    fn the_rank_test_is_that_of_scipy() {
        // scipy.stats.mannwhitneyu(..., method="asymptotic", use_continuity=False), with and without ties.
        let (first, second) = ([1.1, 2.5, 0.3, 1.9, 2.2], [2.7, 3.1, 1.7, 4.0, 3.3, 2.6]);
        assert!((rank_test(plain(&first), plain(&second)).unwrap() - SCIPY[0]).abs() < 1e-12);
        let (first, second) = ([1.0, 2.0, 2.0, 3.0], [2.0, 3.0, 3.0, 4.0, 5.0]);
        assert!((rank_test(plain(&first), plain(&second)).unwrap() - SCIPY[1]).abs() < 1e-12);
        assert_eq!(rank_test(plain(&[2.0]), plain(&[2.0, 2.0])), Some(1.0));
        assert_eq!(rank_test(plain(&[]), plain(&[2.0])), None);
    }

    const SCIPY: [f64; 2] = [0.028_459_736_916_310_565, 0.075_926_962_982_567_63];

    #[test]
    fn the_rank_test_of_correlated_values_keeps_its_level() {
        // Values of 0.7 memory have an n/n_eff of 1.7/0.3.
        let rejected = |inflation: f64| {
            (0..1000)
                .filter(|&seed| {
                    let mut draws = Draws::new(seed);
                    let first = draws.autoregressive(0.7, 60);
                    let second = draws.autoregressive(0.7, 200);
                    let (first, second) = (Sample { values: &first, inflation }, Sample { values: &second, inflation });
                    rank_test(first, second).unwrap() < 0.05
                })
                .count()
        };
        assert!((20..80).contains(&rejected(1.7 / 0.3)), "{}", rejected(1.7 / 0.3));
        assert!(rejected(1.0) > 250);
    }

    #[test]
    fn holm_multiplies_by_the_number_of_hypotheses_that_are_left() {
        let adjusted = holm(&[Some(0.01), None, Some(0.04), Some(0.03), Some(0.9)]);
        let expected = [Some(0.04), None, Some(0.09), Some(0.09), Some(0.9)];
        for (found, expected) in adjusted.iter().zip(expected) {
            assert!(found.zip(expected).is_none_or(|(found, expected)| (found - expected).abs() < 1e-15));
            assert_eq!(found.is_some(), expected.is_some());
        }
    }
}
