//! What a solver is compared by. Before chaos: break times against a reference, contact by contact. After chaos: by how
//! much the slips of an ensemble differ from those of a reference, in mean and standard deviation.
//!
//! A break is identified by block, contact and generation, which mean the same contact in every solver. It is missing
//! if it has not come a tenth of the wave crossing time after the last of the reference.
//!
//! Errors are those of a sweep's statistics: units are realisations, or stretches of few. A difference has the degrees of
//! freedom of the smaller ensemble: those of Welch are too many far out, where many comparisons look.

use crate::model::{Change, ContactEvent, Parameters};
use crate::reduce::{Estimate, Numbers, student_at};
use crate::solver::{Observer, Segment};
use crate::table::columns::{Interval, columns};
use std::collections::HashMap;

/// A break that comes later than the last of the reference by this part of the wave crossing time is missing.
const LATE: f64 = 0.1;

/// One attachment of a contact: block, contact, generation.
type Life = (usize, usize, u32);

fn key(event: &ContactEvent) -> Life {
    (event.block, event.contact, event.generation)
}

/// An observer that keeps the first breaks of a reference.
#[derive(Clone, Debug)]
pub struct Reference {
    wanted: usize,
    /// How long to wait for a break, in s.
    late: f64,
    order: HashMap<Life, usize>,
    times: Vec<f64>,
}

impl Reference {
    pub fn new(parameters: &Parameters, wanted: usize) -> Self {
        Self {
            wanted,
            late: LATE * parameters.wave_crossing_time(),
            order: HashMap::new(),
            times: Vec::new(),
        }
    }
}

impl Observer for Reference {
    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break && self.times.len() < self.wanted {
            self.order.insert(key(event), self.times.len());
            self.times.push(event.time);
        }
    }

    fn is_satisfied(&self) -> bool {
        self.times.len() == self.wanted
    }
}

/// An observer that compares breaks with those of a reference.
#[derive(Clone, Debug)]
pub struct BreakComparison<'a> {
    reference: &'a Reference,
    /// Error of each break of the reference, in s; NaN until the break occurs.
    errors: Vec<f64>,
    now: f64,
}

columns! {
    /// What a comparison gives; nothing where none was made.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct BreakErrors {
        breaks as "compared_breaks": Option<u64> = "",
            "number K of first breaks whose times are compared with those at the tightest tolerance";
        missing as "missing_breaks": Option<u64> = "", "of these, breaks that were not made";
        median as "median_break_error": Option<f64> = "s", "median error of their times";
        largest as "largest_break_error": Option<f64> = "s", "largest error of their times";
    }
}

impl<'a> BreakComparison<'a> {
    pub fn new(reference: &'a Reference) -> Self {
        Self {
            reference,
            errors: vec![f64::NAN; reference.times.len()],
            now: 0.0,
        }
    }

    pub fn errors(&self) -> BreakErrors {
        let errors = self.errors.iter().copied();
        let mut made: Vec<f64> = errors.filter(|error| !error.is_nan()).collect();
        made.sort_by(f64::total_cmp);
        BreakErrors {
            breaks: Some(self.errors.len() as u64),
            missing: Some((self.errors.len() - made.len()) as u64),
            median: made.get(made.len() / 2).copied(),
            largest: made.last().copied(),
        }
    }
}

impl Observer for BreakComparison<'_> {
    fn advance(&mut self, segment: &Segment<'_>) {
        self.now = segment.end();
    }

    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break
            && let Some(&index) = self.reference.order.get(&key(event))
        {
            self.errors[index] = (event.time - self.reference.times[index]).abs();
        }
    }

    fn is_satisfied(&self) -> bool {
        let last = self.reference.times.last();
        last.is_none_or(|last| self.now > last + self.reference.late)
    }
}

/// Probability with which the interval of one bias holds it.
const CONFIDENCE: f64 = 0.95;

columns! {
    /// How a sample differs from a reference. A bias whose interval leaves out zero is one that the samples show.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Bias {
        of_mean as "mean_bias": f64 = "", "mean less that of the reference";
        interval_of_mean as "mean_bias": Option<Interval> = "",
            "lower end of its 95 % interval; null if the slips of a solver are too few";
        freedom: Option<f64> = "", "its degrees of freedom";
        of_deviation as "deviation_bias": f64 = "", "standard deviation less that of the reference";
        interval_of_deviation as "deviation_bias": Option<Interval> = "", "lower end of its 95 % interval";
    }
}

impl Bias {
    pub fn of(sample: &Sample, reference: &Sample) -> Self {
        let of = |which: fn(&Sample) -> &Estimate| {
            let [own, other] = [which(sample), which(reference)];
            let bias = own.value - other.value;
            let both = own.half_width().zip(other.half_width());
            let half = both.map(|(own, other)| libm::hypot(own, other));
            (bias, half.map(|half| Interval::around(bias, half)))
        };
        let (of_mean, interval_of_mean) = of(|sample| &sample.mean);
        let (of_deviation, interval_of_deviation) = of(|sample| &sample.deviation);
        let fewer = sample.mean.freedom().min(reference.mean.freedom());
        Self {
            of_mean,
            interval_of_mean,
            freedom: interval_of_mean.map(|_| fewer),
            of_deviation,
            interval_of_deviation,
        }
    }

    /// Half of the interval of the mean.
    pub fn half_width(&self) -> Option<f64> {
        let Interval { low, high } = self.interval_of_mean?;
        Some(0.5 * (high - low))
    }

    /// Half-width of the mean's interval after Bonferroni's correction for this number of comparisons.
    pub fn half_width_among(&self, comparisons: usize) -> Option<f64> {
        let freedom = self.freedom?;
        let together = 1.0 - (1.0 - CONFIDENCE) / comparisons as f64;
        let wider = student_at(together, freedom) / student_at(CONFIDENCE, freedom);
        Some(wider * self.half_width()?)
    }
}

/// Mean and standard deviation of the values of realisations.
#[derive(Clone, Debug)]
pub struct Sample {
    pub count: usize,
    pub(crate) mean: Estimate,
    pub(crate) deviation: Estimate,
}

impl Sample {
    /// `None` for fewer than two values.
    pub fn of(realisations: Vec<Vec<f64>>) -> Option<Self> {
        let count = realisations.iter().map(Vec::len).sum();
        let jobs: Vec<(u64, Vec<f64>)> = (0..).zip(realisations).collect();
        let [mean, deviation] = Numbers::of(&jobs, 0.0).estimates(0.0);
        Some(Self {
            count,
            mean: mean?,
            deviation: deviation?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ContactChange;
    use crate::solver::{ForcePath, Harmonic};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    fn break_at(time: f64, contact: usize) -> ContactEvent {
        let what = ContactChange {
            time,
            block: 0,
            contact,
            generation: 0,
            change: Change::Break,
            displacement: 0.0,
            force: 1.0,
            threshold: 1.0,
            stiffness: 1.0,
        };
        ContactEvent {
            what,
            attached: 0,
            attached_time: 0.0,
            mean_displacement: 0.0,
        }
    }

    fn compared(times: &[(f64, usize)]) -> BreakErrors {
        let mut reference = Reference::new(&Parameters::default(), 4);
        for contact in 0..4 {
            reference.contact(&break_at(0.1 * (contact + 1) as f64, contact));
        }
        assert!(reference.is_satisfied());
        let mut comparison = BreakComparison::new(&reference);
        for &(time, contact) in times {
            comparison.contact(&break_at(time, contact));
        }
        let rest = Harmonic {
            start: 0.0,
            rate: 0.0,
            amplitude: 0.0,
            phase: 0.0,
            angular_frequency: 0.0,
        };
        comparison.advance(&Segment {
            start: 0.0,
            duration: 1.0,
            path: ForcePath::Harmonic(rest),
        });
        assert!(comparison.is_satisfied());
        comparison.errors()
    }

    #[test]
    fn breaks_are_matched_by_contact_and_not_by_order() {
        let errors = compared(&[(0.2 + 2e-6, 1), (0.1 + 1e-6, 0), (0.3 + 3e-6, 2), (0.4, 3)]);
        assert!(
            (errors.median.unwrap() - 2e-6).abs() < 1e-12
                && (errors.largest.unwrap() - 3e-6).abs() < 1e-12,
            "{errors:?}"
        );
        assert_eq!(errors.missing, Some(0));
    }

    #[test]
    fn a_late_break_has_an_error_and_one_that_never_comes_is_missing() {
        let late = compared(&[(0.1, 0), (0.21, 1), (0.3, 2), (0.4, 3)]);
        assert_eq!(late.missing, Some(0));
        assert!((late.largest.unwrap() - 0.01).abs() < 1e-12, "{late:?}");
        let missing = compared(&[(0.1, 0), (0.2, 1), (0.4, 3)]);
        assert_eq!((missing.breaks, missing.missing), (Some(4), Some(1)));
    }

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
        Sample::of(all).unwrap()
    }

    #[test]
    fn a_bias_has_the_errors_of_both_and_more_comparisons_ask_for_more() {
        let [sample, reference] = [1, 2].map(|seed| realisations(9, 1.0, 0.0, seed));
        let bias = Bias::of(&sample, &reference);
        let halves = [&sample, &reference].map(|sample| sample.mean.half_width().unwrap());
        let both = libm::hypot(halves[0], halves[1]);
        assert!((bias.half_width().unwrap() / both - 1.0).abs() < 1e-12);
        assert_eq!(bias.freedom, Some(8.0));
        assert!(bias.half_width_among(5) > bias.half_width());
    }

    #[test]
    fn two_values_have_an_error_and_one_is_no_sample() {
        let two = Sample::of(vec![vec![1.0, 2.0]]).unwrap();
        let bias = Bias::of(&two, &realisations(5, 1.0, 0.0, 1));
        assert!(bias.half_width_among(3).is_some());
        assert!(Sample::of(vec![vec![1.0]]).is_none() && Sample::of(vec![Vec::new()]).is_none());
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
