//! After chaos: how far the distributions of two samples of slips are apart, with bootstrap intervals.
//!
//! Wasserstein-1 is ∫ |F - G|, in the unit of the quantity; Kolmogorov-Smirnov is max |F - G|. Both are positive even
//! between samples of the same distribution; the floor says how large that is. Biases of mean and standard deviation
//! have a sign and no floor. Resampling draws blocks of consecutive slips, since neighbours are correlated, and is
//! keyed: the same samples give the same intervals.

use crate::table::columns::{Column, Kind, Part, Value, columns};
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

/// A value with further values about it: columns of their own, called after it.
macro_rules! with_columns_about_it {
    ($(#[$attribute:meta])* $name:ident { $($field:ident, $suffix:literal, $meaning:literal;)* }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name {
            /// Of the sample against the reference.
            pub value: f64,
            $(
                #[doc = concat!($meaning, ".")]
                pub $field: f64,
            )*
        }

        impl Part for $name {
            fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column> {
                let column = |(suffix, meaning)| {
                    Column { name: format!("{name}{suffix}").into(), unit, meaning, kind: Kind::Real, nullable: false }
                };
                [("", meaning), $(($suffix, $meaning)),*].map(column).to_vec()
            }

            fn give(&self, give: &mut dyn FnMut(Value<'_>)) {
                for value in [self.value, $(self.$field),*] {
                    give(Value::Real(value));
                }
            }

            fn take<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
                let mut read = || Part::take(name, next);
                Ok(Self { value: read()?, $($field: read()?),* })
            }
        }
    };
}

with_columns_about_it! {
    /// A distance with its 95 % interval, and the one that samples of these sizes from the same distribution stay under in
    /// 95 % of cases.
    Distance {
        low, "_low", "lower end of its 95 % interval";
        high, "_high", "upper end";
        floor, "_floor", "95 % quantile of the distance by chance alone";
    }
}

with_columns_about_it! {
    /// A difference with its 95 % interval. Zero outside of the interval: a bias that the samples show.
    Bias {
        low, "_low", "lower end of its 95 % interval";
        high, "_high", "upper end";
    }
}

columns! {
    /// What sets a sample apart from a reference.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Distances {
        mean as "mean_bias": Bias = "", "mean less that of the reference";
        deviation as "deviation_bias": Bias = "", "standard deviation less that of the reference";
        wasserstein as "w1": Distance = "", "Wasserstein-1 distance";
        kolmogorov as "ks": Distance = "", "Kolmogorov-Smirnov distance";
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
        resampled.push(differences(&resample(sample, sample.len(), &mut generator), &other));
        by_chance.push(differences(&resample(reference, sample.len(), &mut generator), &other));
    }
    let found = differences(&sorted(sample), &sorted(reference));
    let bias = |which: usize| shifted(found[which], resampled.iter().map(|other| other[which]).collect());
    let distance = |which: usize| {
        let Bias { value, low, high } = bias(which);
        let floor = quantile(&mut by_chance.iter().map(|other| other[which]).collect::<Vec<_>>(), FLOOR);
        Distance { value, low: low.max(0.0), high, floor }
    };
    let ([wasserstein, kolmogorov], [mean, deviation]) = ([0, 1].map(distance), [2, 3].map(bias));
    Some(Distances { mean, deviation, wasserstein, kolmogorov })
}

/// Differences of two sorted samples: Wasserstein-1, Kolmogorov-Smirnov, of the means, of the standard deviations.
fn differences(sample: &[f64], reference: &[f64]) -> [f64; 4] {
    let (wasserstein, kolmogorov) = wasserstein_and_kolmogorov(sample, reference);
    [wasserstein, kolmogorov, mean(sample) - mean(reference), deviation(sample) - deviation(reference)]
}

pub(super) fn mean(sample: &[f64]) -> f64 {
    sample.iter().sum::<f64>() / sample.len() as f64
}

/// Standard deviation of a sample, by n - 1.
pub(super) fn deviation(sample: &[f64]) -> f64 {
    let mean = mean(sample);
    let squares: f64 = sample.iter().map(|value| (value - mean) * (value - mean)).sum();
    (squares / (sample.len() as f64 - 1.0).max(1.0)).sqrt()
}

/// A value with the interval of its resampled ones, shifted so that their median lies on the value: resampling adds
/// noise, and noise makes distances longer.
fn shifted(value: f64, mut resampled: Vec<f64>) -> Bias {
    let [low, median, high] = [TAIL, 0.5, 1.0 - TAIL].map(|probability| quantile(&mut resampled, probability));
    Bias { value, low: value + (low - median), high: value + (high - median) }
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

/// Both distances of sorted samples.
fn wasserstein_and_kolmogorov(left: &[f64], right: &[f64]) -> (f64, f64) {
    let (mut i, mut j) = (0, 0);
    let (mut wasserstein, mut kolmogorov) = (0.0, 0.0_f64);
    let mut before = left[0].min(right[0]);
    while i < left.len() || j < right.len() {
        let next = match (left.get(i), right.get(j)) {
            (Some(&l), Some(&r)) => l.min(r),
            (Some(&only), None) | (None, Some(&only)) => only,
            (None, None) => break,
        };
        let gap = (i as f64 / left.len() as f64 - j as f64 / right.len() as f64).abs();
        wasserstein += gap * (next - before);
        kolmogorov = kolmogorov.max(gap);
        before = next;
        while left.get(i) == Some(&next) {
            i += 1;
        }
        while right.get(j) == Some(&next) {
            j += 1;
        }
    }
    (wasserstein, kolmogorov)
}

/// Nearest-rank quantile.
fn quantile(values: &mut [f64], probability: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let index = (probability * (values.len() - 1) as f64).round() as usize;
    values[index]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(count: usize, shift: f64, key: u64) -> Vec<f64> {
        let mut generator = ChaCha8Rng::seed_from_u64(key);
        (0..count).map(|_| shift + generator.next_u64() as f64 / 2.0_f64.powi(64)).collect()
    }

    #[test]
    fn distances_of_small_samples_are_those_by_hand() {
        assert_eq!(wasserstein_and_kolmogorov(&[0.0, 1.0], &[0.0, 1.0]), (0.0, 0.0));
        assert_eq!(wasserstein_and_kolmogorov(&[0.0, 1.0], &[2.0, 3.0]), (2.0, 1.0));
        let (wasserstein, kolmogorov) = wasserstein_and_kolmogorov(&[1.0, 2.0, 3.0], &[2.0]);
        assert!((wasserstein - 2.0 / 3.0).abs() < 1e-15 && (kolmogorov - 1.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn a_shift_is_distinguished_from_chance_and_chance_from_a_shift() {
        let reference = uniform(1000, 0.0, 1);
        let same = distances(&uniform(500, 0.0, 2), &reference, 3).unwrap();
        assert!(same.wasserstein.value <= 1.5 * same.wasserstein.floor, "{same:?}");
        let moved = distances(&uniform(500, 0.1, 2), &reference, 3).unwrap();
        assert!(moved.wasserstein.value > 2.0 * moved.wasserstein.floor, "{moved:?}");
        assert!(moved.wasserstein.low < 0.1 && 0.1 < moved.wasserstein.high, "{moved:?}");
        assert!(moved.kolmogorov.value > moved.kolmogorov.floor, "{moved:?}");
        assert!(moved.mean.low > 0.0 && moved.mean.low < 0.1 && 0.1 < moved.mean.high, "{moved:?}");
        assert!(moved.deviation.low < 0.0 && 0.0 < moved.deviation.high, "{moved:?}");
    }

    #[test]
    fn every_interval_holds_its_value_and_a_wider_sample_shows_in_its_deviation() {
        let reference = uniform(1000, 0.0, 1);
        let wide: Vec<f64> = uniform(500, -0.5, 2).into_iter().map(|value| 1.2 * value + 0.5).collect();
        for sample in [uniform(500, 0.0, 2), uniform(1000, 0.0, 1), wide.clone()] {
            let Distances { wasserstein: w, kolmogorov: k, mean, deviation } =
                distances(&sample, &reference, 3).unwrap();
            for (value, low, high) in [(w.value, w.low, w.high), (k.value, k.low, k.high)] {
                assert!(0.0 <= low && low <= value && value <= high, "{low} {value} {high}");
            }
            for bias in [mean, deviation] {
                assert!(bias.low <= bias.value && bias.value <= bias.high, "{bias:?}");
            }
        }
        let wider = distances(&wide, &reference, 3).unwrap();
        // 0.2 times the deviation of a uniform distribution, 1/sqrt(12).
        assert!(
            0.0 < wider.deviation.low && wider.deviation.low < 0.0577 && 0.0577 < wider.deviation.high,
            "{wider:?}"
        );
        assert!(wider.mean.low < 0.0 && 0.0 < wider.mean.high, "{wider:?}");
    }

    #[test]
    fn the_same_samples_give_the_same_intervals() {
        let (sample, reference) = (uniform(50, 0.0, 1), uniform(60, 0.0, 2));
        assert_eq!(distances(&sample, &reference, 7), distances(&sample, &reference, 7));
        assert_ne!(distances(&sample, &reference, 7), distances(&sample, &reference, 8));
        assert_eq!(distances(&[], &reference, 7), None);
    }
}
