//! After chaos: by how much the slips of an ensemble differ from those of a reference, in mean and standard deviation.
//!
//! Realisations are independent, slips of one are not. So errors are those of the sums of realisations, and a difference has
//! the degrees of freedom of the smaller ensemble: those of Welch are too many far out, where many comparisons look.

use crate::reduce::student_at;
use crate::table::columns::{Interval, columns};

/// Probability with which the interval of one bias holds it.
const CONFIDENCE: f64 = 0.95;

columns! {
    /// How a sample differs from a reference. A bias whose interval leaves out zero is one that the samples show.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Bias {
        of_mean as "mean_bias": f64 = "", "mean less that of the reference";
        interval_of_mean as "mean_bias": Option<Interval> = "",
            "lower end of its 95 % interval; null for fewer than two realisations";
        freedom: Option<f64> = "", "its degrees of freedom";
        of_deviation as "deviation_bias": f64 = "", "standard deviation less that of the reference";
        interval_of_deviation as "deviation_bias": Option<Interval> = "", "lower end of its 95 % interval";
    }
}

impl Bias {
    pub fn of(sample: &Sample, reference: &Sample) -> Self {
        let of_mean = sample.mean - reference.mean;
        let of_deviation = sample.deviation - reference.deviation;
        let others = [sample.others, reference.others];
        let error_of_mean = Error::of([sample.error_of_mean, reference.error_of_mean], others);
        let error_of_deviation = Error::of(
            [sample.error_of_deviation, reference.error_of_deviation],
            others,
        );
        Self {
            of_mean,
            interval_of_mean: error_of_mean.map(|error| error.about(of_mean)),
            freedom: error_of_mean.map(|error| error.freedom),
            of_deviation,
            interval_of_deviation: error_of_deviation.map(|error| error.about(of_deviation)),
        }
    }

    /// Half of the interval of the mean.
    pub fn half_width(&self) -> Option<f64> {
        let Interval { low, high } = self.interval_of_mean?;
        Some(0.5 * (high - low))
    }

    /// Half of the interval which so many biases together lie in as surely as one in its own (Bonferroni).
    pub fn half_width_among(&self, comparisons: usize) -> Option<f64> {
        let freedom = self.freedom?;
        let together = 1.0 - (1.0 - CONFIDENCE) / comparisons as f64;
        let wider = student_at(together, freedom) / student_at(CONFIDENCE, freedom);
        Some(wider * self.half_width()?)
    }
}

/// Mean and standard deviation of the values of realisations, with their standard errors.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    pub count: usize,
    pub mean: f64,
    pub deviation: f64,
    error_of_mean: f64,
    error_of_deviation: f64,
    /// Realisations with values, less one.
    others: f64,
}

impl Sample {
    /// `None` without a value.
    pub fn of(realisations: &[Vec<f64>]) -> Option<Self> {
        let count: usize = realisations.iter().map(Vec::len).sum();
        if count == 0 {
            return None;
        }
        let n = count as f64;
        let with_values = realisations.iter().filter(|values| !values.is_empty());
        let others = with_values.count() as f64 - 1.0;
        // The mean of a function of the values, and the standard error by its sums over realisations.
        let mean_of = |of: &dyn Fn(f64) -> f64| {
            let sum = |values: &Vec<f64>| values.iter().map(|&value| of(value)).sum::<f64>();
            let mean = realisations.iter().map(sum).sum::<f64>() / n;
            let deviations = realisations
                .iter()
                .map(|values| sum(values) - mean * values.len() as f64);
            let squares: f64 = deviations.map(|deviation| deviation * deviation).sum();
            (mean, (squares * (others + 1.0) / others).sqrt() / n)
        };
        let (mean, error_of_mean) = mean_of(&|value| value);
        let (square, error_of_square) = mean_of(&|value| (value - mean) * (value - mean));
        let deviation = (square * n / (n - 1.0).max(1.0)).sqrt();
        Some(Self {
            count,
            mean,
            deviation,
            error_of_mean,
            error_of_deviation: error_of_square / (2.0 * deviation),
            others,
        })
    }
}

/// The standard error of a difference, and its degrees of freedom.
#[derive(Clone, Copy, Debug)]
struct Error {
    size: f64,
    freedom: f64,
}

impl Error {
    /// `None` if one of the two has fewer than two realisations.
    fn of(errors: [f64; 2], others: [f64; 2]) -> Option<Self> {
        let freedom = others[0].min(others[1]);
        (freedom >= 1.0).then(|| Self {
            size: libm::hypot(errors[0], errors[1]),
            freedom,
        })
    }

    fn about(self, bias: f64) -> Interval {
        let half = student_at(CONFIDENCE, self.freedom) * self.size;
        Interval {
            low: bias - half,
            high: bias + half,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    /// Realisations of 20 uniform values, each realisation moved as a whole.
    fn realisations(count: usize, width: f64, shift: f64, seed: u64) -> Sample {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let mut uniform = || generator.next_u64() as f64 / 2.0_f64.powi(64) - 0.5;
        let all: Vec<Vec<f64>> = (0..count)
            .map(|_| {
                let own = shift + 0.3 * uniform();
                (0..20).map(|_| own + width * uniform()).collect()
            })
            .collect();
        Sample::of(&all).unwrap()
    }

    #[test]
    fn the_error_of_means_of_equal_realisations_is_that_of_the_textbook() {
        let sample = Sample::of(&[vec![1.0, 3.0], vec![2.0, 2.0], vec![4.0, 6.0]]).unwrap();
        // Means 2, 2 and 5.
        assert!((sample.mean - 3.0).abs() < 1e-15);
        assert!((sample.error_of_mean - 1.0).abs() < 1e-15);
        assert!((sample.deviation - (16.0_f64 / 5.0).sqrt()).abs() < 1e-15);
        let bias = Bias::of(&sample, &sample);
        assert_eq!(bias.freedom, Some(2.0));
        let half = student_at(0.95, 2.0) * 2.0_f64.sqrt();
        assert!((bias.half_width().unwrap() - half).abs() < 1e-12);
        assert!(bias.half_width_among(5) > bias.half_width());
    }

    #[test]
    fn one_realisation_has_no_error() {
        let one = Sample::of(&[vec![1.0, 2.0, 3.0]]).unwrap();
        let bias = Bias::of(&one, &realisations(5, 1.0, 0.0, 1));
        assert_eq!(
            (
                bias.interval_of_mean,
                bias.freedom,
                bias.half_width_among(3)
            ),
            (None, None, None)
        );
        assert!(Sample::of(&[Vec::new()]).is_none());
    }

    #[test]
    fn intervals_hold_both_biases_in_95_of_100_studies() {
        const STUDIES: u64 = 1000;
        let mut means = 0;
        let mut deviations = 0;
        for study in 0..STUDIES {
            let bias = Bias::of(
                &realisations(8, 1.2, 0.1, 2 * study),
                &realisations(16, 1.0, 0.0, 2 * study + 1),
            );
            let holds = |interval: Option<Interval>, truth| {
                interval.is_some_and(|ends| ends.low <= truth && truth <= ends.high)
            };
            // Variances of uniform values are a twelfth of the square of their width.
            let deviation = |width: f64| ((0.09 + width * width) / 12.0).sqrt();
            means += u32::from(holds(bias.interval_of_mean, 0.1));
            deviations += u32::from(holds(
                bias.interval_of_deviation,
                deviation(1.2) - deviation(1.0),
            ));
        }
        for held in [means, deviations] {
            assert!((930..985).contains(&held), "{means} {deviations}");
        }
    }
}
