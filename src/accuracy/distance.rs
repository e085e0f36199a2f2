//! After chaos: how far the distributions of two samples of slips are apart, with bootstrap intervals.
//!
//! Wasserstein-1 is ∫ |F - G|, in the unit of the quantity. It is positive even between samples of the same distribution;
//! the floor says how large that is. Biases of mean and standard deviation have a sign and no floor. Resampling draws blocks
//! of consecutive slips, since neighbours are correlated, and is keyed: the same samples give the same intervals.

use crate::table::columns::columns;
use crate::table::value::floored;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Consecutive slips that are drawn together: slips are correlated with the next one or two.
const BLOCK: usize = 5;
/// Resamples behind an interval: its ends are then good to a tenth of its width.
const RESAMPLES: usize = 400;
/// Tails left out of an interval, on each side.
const TAIL: f64 = 0.025;
/// Quantile of the distances under the null hypothesis that makes the floor.
const FLOOR: f64 = 0.95;

columns! {
    /// What sets a sample apart from a reference. Bounds are the ends of 95 % intervals. A bias whose interval leaves out
    /// zero is one that the samples show. Samples of these sizes from the same distribution stay under a floor in 95 % of
    /// cases.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Distances {
        mean_bias: f64 = "", "mean less that of the reference";
        mean_bias_low: f64 = "", "lower end of its 95 % interval";
        mean_bias_high: f64 = "", "upper end";
        deviation_bias: f64 = "", "standard deviation less that of the reference";
        deviation_bias_low: f64 = "", "lower end of its 95 % interval";
        deviation_bias_high: f64 = "", "upper end";
        w1: f64 = "", "Wasserstein-1 distance";
        w1_low: f64 = "", "lower end of its 95 % interval";
        w1_high: f64 = "", "upper end";
        w1_floor: f64 = "", "95 % quantile of the distance by chance alone";
    }
}

/// Distances of a sample from a reference, both in the order of slips; `None` if one is empty. Comparisons with
/// different keys have independent random numbers.
pub fn distances(sample: &[f64], reference: &[f64], key: u64) -> Option<Distances> {
    if sample.is_empty() || reference.is_empty() {
        return None;
    }
    let mut generator = ChaCha8Rng::seed_from_u64(key);
    let (mut resampled, mut by_chance) = (Vec::new(), Vec::new());
    for _ in 0..RESAMPLES {
        let other = resample(reference, reference.len(), &mut generator);
        resampled.push(differences(
            &resample(sample, sample.len(), &mut generator),
            &other,
        ));
        by_chance.push(wasserstein(
            &resample(reference, sample.len(), &mut generator),
            &other,
        ));
    }
    let found = differences(&sorted(sample), &sorted(reference));
    let interval = |which: usize| {
        shifted(
            found[which],
            resampled.iter().map(|other| other[which]).collect(),
        )
    };
    let [(w1_low, w1_high), mean, deviation] = [0, 1, 2].map(interval);
    let [w1, mean_bias, deviation_bias] = found;
    Some(Distances {
        mean_bias,
        mean_bias_low: mean.0,
        mean_bias_high: mean.1,
        deviation_bias,
        deviation_bias_low: deviation.0,
        deviation_bias_high: deviation.1,
        w1,
        w1_low: w1_low.max(0.0),
        w1_high,
        w1_floor: quantile(&mut by_chance, FLOOR),
    })
}

/// Differences of two sorted samples: Wasserstein-1, of the means, of the standard deviations.
fn differences(sample: &[f64], reference: &[f64]) -> [f64; 3] {
    [
        wasserstein(sample, reference),
        mean(sample) - mean(reference),
        deviation(sample) - deviation(reference),
    ]
}

pub(super) fn mean(sample: &[f64]) -> f64 {
    sample.iter().sum::<f64>() / sample.len() as f64
}

/// Standard deviation of a sample, by n - 1.
pub(super) fn deviation(sample: &[f64]) -> f64 {
    let mean = mean(sample);
    let squares: f64 = sample
        .iter()
        .map(|value| (value - mean) * (value - mean))
        .sum();
    (squares / (sample.len() as f64 - 1.0).max(1.0)).sqrt()
}

/// The interval of the resampled values, shifted so that their median lies on the value: resampling adds noise, and noise
/// makes distances longer.
fn shifted(value: f64, mut resampled: Vec<f64>) -> (f64, f64) {
    let [low, median, high] =
        [TAIL, 0.5, 1.0 - TAIL].map(|probability| quantile(&mut resampled, probability));
    (value + (low - median), value + (high - median))
}

fn sorted(sample: &[f64]) -> Vec<f64> {
    let mut sorted = sample.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// A sorted resample of a given size, in blocks that wrap around.
fn resample(sample: &[f64], size: usize, generator: &mut ChaCha8Rng) -> Vec<f64> {
    let mut drawn = Vec::with_capacity(size + BLOCK);
    while drawn.len() < size {
        let first = below(sample.len(), generator);
        drawn.extend((first..first + BLOCK).map(|i| sample[i % sample.len()]));
    }
    drawn.truncate(size);
    drawn.sort_by(f64::total_cmp);
    drawn
}

/// A whole number below a bound, by the upper half of a product; the bias of 2^-64 times the bound is of no account.
fn below(bound: usize, generator: &mut ChaCha8Rng) -> usize {
    #[expect(clippy::cast_possible_truncation, reason = "below the bound")]
    let drawn = ((u128::from(generator.next_u64()) * bound as u128) >> 64) as usize;
    drawn
}

/// The distance of sorted samples.
fn wasserstein(left: &[f64], right: &[f64]) -> f64 {
    let (mut i, mut j, mut distance) = (0, 0, 0.0);
    let mut before = left[0].min(right[0]);
    while i < left.len() || j < right.len() {
        let [l, r] =
            [left.get(i), right.get(j)].map(|value| value.copied().unwrap_or(f64::INFINITY));
        let gap = (i as f64 / left.len() as f64 - j as f64 / right.len() as f64).abs();
        distance += gap * (l.min(r) - before);
        before = l.min(r);
        i += usize::from(l <= r);
        j += usize::from(r <= l);
    }
    distance
}

/// Nearest-rank quantile.
fn quantile(values: &mut [f64], probability: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let index = floored((probability * (values.len() - 1) as f64).round());
    values[index]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(count: usize, shift: f64, key: u64) -> Vec<f64> {
        let mut generator = ChaCha8Rng::seed_from_u64(key);
        (0..count)
            .map(|_| shift + generator.next_u64() as f64 / 2.0_f64.powi(64))
            .collect()
    }

    #[test]
    fn distances_of_small_samples_are_those_by_hand() {
        assert_eq!(wasserstein(&[0.0, 1.0], &[0.0, 1.0]), 0.0);
        assert_eq!(wasserstein(&[0.0, 1.0], &[2.0, 3.0]), 2.0);
        assert_eq!(wasserstein(&[1.0, 1.0, 4.0], &[1.0]), 1.0);
        assert!((wasserstein(&[1.0, 2.0, 3.0], &[2.0]) - 2.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn a_shift_is_distinguished_from_chance_and_chance_from_a_shift() {
        let reference = uniform(1000, 0.0, 1);
        let same = distances(&uniform(500, 0.0, 2), &reference, 3).unwrap();
        assert!(same.w1 <= 1.5 * same.w1_floor, "{same:?}");
        let moved = distances(&uniform(500, 0.1, 2), &reference, 3).unwrap();
        assert!(moved.w1 > 2.0 * moved.w1_floor, "{moved:?}");
        assert!(moved.w1_low < 0.1 && 0.1 < moved.w1_high, "{moved:?}");
        assert!(
            moved.mean_bias_low > 0.0 && moved.mean_bias_low < 0.1 && 0.1 < moved.mean_bias_high,
            "{moved:?}"
        );
        assert!(
            moved.deviation_bias_low < 0.0 && 0.0 < moved.deviation_bias_high,
            "{moved:?}"
        );
    }

    #[test]
    fn every_interval_holds_its_value_and_a_wider_sample_shows_in_its_deviation() {
        let reference = uniform(1000, 0.0, 1);
        let wide: Vec<f64> = uniform(500, -0.5, 2)
            .into_iter()
            .map(|value| 1.2 * value + 0.5)
            .collect();
        for sample in [uniform(500, 0.0, 2), uniform(1000, 0.0, 1), wide.clone()] {
            let found = distances(&sample, &reference, 3).unwrap();
            for (least, low, value, high) in [
                (0.0, found.w1_low, found.w1, found.w1_high),
                (
                    f64::NEG_INFINITY,
                    found.mean_bias_low,
                    found.mean_bias,
                    found.mean_bias_high,
                ),
                (
                    f64::NEG_INFINITY,
                    found.deviation_bias_low,
                    found.deviation_bias,
                    found.deviation_bias_high,
                ),
            ] {
                assert!(
                    least <= low && low <= value && value <= high,
                    "{low} {value} {high}"
                );
            }
        }
        let wider = distances(&wide, &reference, 3).unwrap();
        // 0.2 times the deviation of a uniform distribution, 1/sqrt(12).
        assert!(
            0.0 < wider.deviation_bias_low
                && wider.deviation_bias_low < 0.0577
                && 0.0577 < wider.deviation_bias_high,
            "{wider:?}"
        );
        assert!(
            wider.mean_bias_low < 0.0 && 0.0 < wider.mean_bias_high,
            "{wider:?}"
        );
    }

    #[test]
    fn the_same_samples_give_the_same_intervals() {
        let (sample, reference) = (uniform(50, 0.0, 1), uniform(60, 0.0, 2));
        assert_eq!(
            distances(&sample, &reference, 7),
            distances(&sample, &reference, 7)
        );
        assert_ne!(
            distances(&sample, &reference, 7),
            distances(&sample, &reference, 8)
        );
        assert_eq!(distances(&[], &reference, 7), None);
    }
}
