//! Ranges and points on them: evenly spaced, and space-filling in several dimensions.
//!
//! Sobol points, Owen-scrambled (B. Burley, JCGT 9(4), 2020; crate `sobol_burley`): the first points of a longer sample are
//! those of a shorter one. Logarithms and exponentials come from `libm`: the same bits on every machine.

/// Length of the Sobol sequence.
pub(super) const MAX_SAMPLE: u64 = 1 << 16;
/// Significant digits of a value between the ends of a range: 1e-4 as people write it, not what a logarithm makes of it.
const DIGITS: usize = 12;

/// A range of a quantity, low < high.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub low: f64,
    pub high: f64,
    /// Even in the logarithm; both ends are > 0.
    pub logarithmic: bool,
    /// Whether the quantity takes whole numbers only.
    pub whole: bool,
}

impl Range {
    /// The value at a fraction of the way, 0 to 1, rounded; the ends are exact.
    pub fn at(&self, fraction: f64) -> f64 {
        if fraction <= 0.0 {
            return self.low;
        }
        if fraction >= 1.0 {
            return self.high;
        }
        let value = if self.logarithmic {
            let low = libm::log(self.low);
            let high = libm::log(self.high);
            libm::exp(low + (high - low) * fraction)
        } else {
            // Two terms: the difference of the ends may overflow.
            self.low * (1.0 - fraction) + self.high * fraction
        };
        let rounded = if self.whole {
            value.round()
        } else {
            significant(value)
        };
        rounded.clamp(self.low, self.high)
    }

    /// Evenly spaced values, ends included. At least two.
    pub fn spaced(&self, points: u64) -> impl Iterator<Item = f64> {
        let last = (points - 1) as f64;
        (0..points).map(move |point| self.at(point as f64 / last))
    }
}

/// The double that is nearest to a value in [`DIGITS`].
fn significant(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value)
}

/// The coordinates of the first Sobol points in one dimension, each in [0, 1).
pub(super) fn sobol(dimension: u32, points: u32, seed: u32) -> impl Iterator<Item = f64> {
    (0..points).map(move |point| f64::from(sobol_burley::sample(point, dimension, seed)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_range_are_exact_and_its_steps_even() {
        for logarithmic in [false, true] {
            let range = Range {
                low: 3e-7,
                high: 1e-4,
                logarithmic,
                whole: false,
            };
            let values: Vec<f64> = range.spaced(7).collect();
            assert_eq!((values[0], values[6]), (3e-7, 1e-4));
            for pair in values.windows(3) {
                let even = if logarithmic {
                    pair[1] * pair[1] / (pair[0] * pair[2])
                } else {
                    2.0 * pair[1] / (pair[0] + pair[2])
                };
                // Each value is rounded by 5e-12 of itself at most.
                assert!((even - 1.0).abs() < 2e-11, "{values:?}");
            }
        }
        let ends = (1.234_567_890_123_456_7, 9.876_543_210_987_654);
        let long = Range {
            low: ends.0,
            high: ends.1,
            logarithmic: true,
            whole: false,
        };
        assert_eq!(
            (long.at(0.0), long.at(1.0), long.at(1e-15)),
            (ends.0, ends.1, ends.0)
        );
        let widest = Range {
            low: -f64::MAX,
            high: f64::MAX,
            logarithmic: false,
            whole: false,
        };
        assert_eq!(widest.at(0.5), 0.0);
    }

    #[test]
    fn a_longer_sobol_sample_begins_with_the_shorter() {
        let long: Vec<f64> = sobol(2, 64, 1).collect();
        assert!(sobol(2, 16, 1).eq(long[..16].iter().copied()));
    }

    #[test]
    fn samples_are_pinned() {
        // Known answers: points of a sample are parameters of jobs, and so part of every id.
        let points: Vec<f64> = sobol(1, 3, 7).collect();
        let known = [
            0.592_596_173_286_438,
            0.194_618_463_516_235_35,
            0.365_000_367_164_611_8,
        ];
        assert_eq!(points, known);
    }
}
