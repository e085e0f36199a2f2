//! Values of a quantity slip by slip, job by job, and the uncertainty of their mean.
//!
//! Jobs of a set are independent, slips of a job are not. The variance of a mean of n values is that of the sums of
//! jobs, which are independent whatever the correlation within them: n values in m jobs with the sums S_j of the
//! deviations from the mean have m/(m-1) Σ_j S_j²/n² with m - 1 degrees of freedom. It is the jackknife over jobs of
//! any function of means, to first order. Of fewer than [`MIN_STRETCHES`] jobs, each is cut into equal stretches that
//! count as jobs (batch means). What that costs where stretches are no longer than the memory of slips is in
//! docs/coverage.md. Quantiles are of sorted values.
//!
//! Angles are unit vectors: their mean has a direction and a resultant length. What each job adds to a length is the
//! jackknife over jobs, to first order.

use super::confidence::ROUNDING;
use crate::table::value::floored;
use std::f64::consts::TAU;

/// Stretches of slips whose sums make a variance, at least: it is then known to 27 %.
const MIN_STRETCHES: usize = 8;

/// Values of a quantity with D components, job by job, in the order of slips.
#[derive(Clone, Debug, Default)]
pub(super) struct Sequences<const D: usize> {
    pub(super) jobs: Vec<Vec<[f64; D]>>,
}

impl<const D: usize> Sequences<D> {
    pub(super) fn of<Job: IntoIterator<Item = [f64; D]>>(
        jobs: impl IntoIterator<Item = Job>,
    ) -> Self {
        let jobs = jobs.into_iter().map(|job| job.into_iter().collect());
        Self {
            jobs: jobs.collect(),
        }
    }

    pub(super) fn estimate(self) -> Estimate<D> {
        self.centred().mean
    }

    /// Their deviations from the mean, and the mean with its covariance.
    pub(super) fn centred(mut self) -> Centred<D> {
        let count = self.jobs.iter().map(Vec::len).sum::<usize>() as u64;
        let total = sum(self.jobs.iter().flatten());
        let mean = total.map(|sum| sum / count as f64);
        for value in self.jobs.iter_mut().flatten() {
            for (component, mean) in value.iter_mut().zip(mean) {
                *component -= mean;
            }
        }
        let sums = self.stretch_sums().concat();
        let freedom = sums.len() as f64 - 1.0;
        let scale = if freedom > 0.0 {
            sums.len() as f64 / freedom
        } else {
            0.0
        };
        Centred {
            deviations: self,
            mean: Estimate {
                covariance: products(&sums).map(|line| line.map(|cell| scale * cell)),
                rare: rare(&sums),
                ..Estimate::of_sums(count, total, &sums, freedom)
            },
        }
    }

    /// The sums of jobs; of few, those of equal stretches of each job.
    pub(super) fn stretch_sums(&self) -> Vec<Vec<[f64; D]>> {
        let jobs = self.jobs.iter().filter(|job| !job.is_empty()).count();
        let parts = MIN_STRETCHES.div_ceil(jobs.max(1));
        let of_job = |job: &Vec<[f64; D]>| {
            let start = |part: usize| job.len() * part / parts;
            let stretches = (0..parts).map(|part| &job[start(part)..start(part + 1)]);
            let stretches = stretches.filter(|stretch| !stretch.is_empty());
            stretches.map(sum).collect()
        };
        self.jobs.iter().map(of_job).collect()
    }

    /// Their scalar products with a vector.
    pub(super) fn along(&self, direction: &[f64; D]) -> Sequences<1> {
        let component = |value: &[f64; D]| {
            let products = value.iter().zip(direction).map(|(x, part)| x * part);
            [products.sum::<f64>()]
        };
        Sequences::of(self.jobs.iter().map(|job| job.iter().map(component)))
    }
}

/// Values as deviations from their mean, and the mean.
#[derive(Clone, Debug)]
pub(super) struct Centred<const D: usize> {
    pub(super) deviations: Sequences<D>,
    pub(super) mean: Estimate<D>,
}

fn sum<'a, const D: usize>(values: impl IntoIterator<Item = &'a [f64; D]>) -> [f64; D] {
    values.into_iter().fold([0.0; D], |mut sum, value| {
        add(&mut sum, value);
        sum
    })
}

pub(super) fn add<const D: usize>(sum: &mut [f64; D], value: &[f64; D]) {
    sum.iter_mut()
        .zip(value)
        .for_each(|(sum, value)| *sum += value);
}

fn products<const D: usize>(sums: &[[f64; D]]) -> [[f64; D]; D] {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| sums.iter().map(|sum| sum[row] * sum[column]).sum())
    })
}

/// Third moments over second ones, of independent deviations.
fn rare<const D: usize>(deviations: &[[f64; D]]) -> [f64; D] {
    std::array::from_fn(|component| {
        let of = deviations.iter().map(|deviation| deviation[component]);
        let second: f64 = of.clone().map(|x| x * x).sum();
        let third: f64 = of.map(|x| x * x * x).sum();
        if second > 0.0 { third / second } else { 0.0 }
    })
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate<const D: usize> {
    pub(super) count: u64,
    pub(super) total: [f64; D],
    /// Of the sum.
    covariance: [[f64; D]; D],
    /// Degrees of freedom of the covariance; fewer than one if nothing is known of it.
    freedom: f64,
    /// What a rare event adds to the sum, if rare events make its variance: the third moment over the second.
    pub(super) rare: [f64; D],
}

impl Estimate<1> {
    /// The mean as a number; `None` without values.
    pub(super) fn value(&self) -> Option<f64> {
        self.mean().map(|[mean]| mean)
    }

    /// The squared deviation of a value from the mean, 0 within the rounding of what values are differences of, of up
    /// to this size.
    pub(super) fn square_of_deviation(&self, size: f64) -> impl Fn(f64) -> f64 + use<> {
        let mean = self.value().unwrap_or_default();
        move |value| {
            let deviation = value - mean;
            if deviation.abs() <= ROUNDING * size {
                0.0
            } else {
                deviation * deviation
            }
        }
    }
}

impl<const D: usize> Estimate<D> {
    /// The mean of `count` values with this total, if these independent sums make its error.
    pub(super) fn of_sums(count: u64, total: [f64; D], sums: &[[f64; D]], freedom: f64) -> Self {
        Self {
            count,
            total,
            covariance: products(sums),
            freedom,
            rare: [0.0; D],
        }
    }

    /// Their mean; `None` without values.
    pub(super) fn mean(&self) -> Option<[f64; D]> {
        (self.count > 0).then(|| self.total.map(|sum| sum / self.count as f64))
    }

    /// Variance of the mean along a unit vector.
    pub(super) fn variance(&self, direction: &[f64; D]) -> f64 {
        let along = |line: &[f64; D]| {
            let products = line.iter().zip(direction).map(|(cell, part)| cell * part);
            products.sum::<f64>()
        };
        let lines = self.covariance.iter().zip(direction);
        let sum: f64 = lines.map(|(line, part)| part * along(line)).sum();
        sum / (self.count as f64 * self.count as f64)
    }

    /// Degrees of freedom of the variance; `None` if there is none.
    pub(super) fn freedom(&self) -> Option<f64> {
        (self.freedom >= 1.0).then_some(self.freedom)
    }
}

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

/// The unit vector of an angle in rad.
pub(super) fn unit(angle: f64) -> [f64; 2] {
    [libm::cos(angle), libm::sin(angle)]
}

/// The unit vector along a vector; along x if that has no length.
pub(super) fn heading([x, y]: [f64; 2]) -> [f64; 2] {
    let length = libm::hypot(x, y);
    if length > 0.0 {
        [x / length, y / length]
    } else {
        [1.0, 0.0]
    }
}

/// A sum of vectors, or of numbers as vectors along x, and of their weights.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    pub(super) vector: [f64; 2],
    pub(super) weight: f64,
}

impl Sum {
    /// Of vectors of weight 1.
    pub(super) fn of(vectors: impl Iterator<Item = [f64; 2]>) -> Self {
        let mut sum = Self::default();
        vectors.for_each(|vector| sum.push(vector, 1.0));
        sum
    }

    pub(super) fn push(&mut self, vector: [f64; 2], weight: f64) {
        add(&mut self.vector, &vector);
        self.weight += weight;
    }

    pub(super) fn of_all(sums: &[Self]) -> Self {
        let mut total = Self::default();
        for sum in sums {
            total.push(sum.vector, sum.weight);
        }
        total
    }

    /// Length of the mean; `None` without values.
    pub(super) fn length(&self) -> Option<f64> {
        let [x, y] = self.vector;
        (self.weight > 0.0).then(|| libm::hypot(x, y) / self.weight)
    }

    /// The difference of the lengths of two such means, less itself: the mean of what pairs of these add to it.
    pub(super) fn difference(sums: &[Self], less: &[Self]) -> Estimate<1> {
        let added = Self::added(sums).into_iter().zip(Self::added(less));
        Sequences::of(added.map(|(of_one, less)| [[of_one - less]])).estimate()
    }

    /// What each of these adds to the length of their mean, times their number.
    fn added(sums: &[Self]) -> Vec<f64> {
        let total = Self::of_all(sums);
        let length = libm::hypot(total.vector[0], total.vector[1]);
        let [x, y] = heading(total.vector);
        let of_one = |sum: &Self| {
            let along = x * sum.vector[0] + y * sum.vector[1];
            sums.len() as f64 * (along - length / total.weight * sum.weight) / total.weight
        };
        sums.iter().map(of_one).collect()
    }
}

impl Estimate<2> {
    /// Resultant length |<exp(iφ)>| of unit vectors, 0 to 1; `None` without any.
    pub(super) fn resultant_length(&self) -> Option<f64> {
        self.mean().map(|[x, y]| libm::hypot(x, y).min(1.0))
    }

    /// Mean direction, in rad, as the representative in (`top` - 2π, `top`]; `None` without unit vectors.
    pub(super) fn direction(&self, top: f64) -> Option<f64> {
        self.mean().map(|[x, y]| wrap(libm::atan2(y, x), top))
    }
}

/// The representative of an angle in (`top` - 2π, `top`], in rad.
pub fn wrap(angle: f64, top: f64) -> f64 {
    let wrapped = angle - TAU * ((angle - top) / TAU).ceil();
    // Rounding may end just outside.
    if wrapped <= top - TAU {
        wrapped + TAU
    } else {
        wrapped.min(top)
    }
}

#[cfg(test)]
mod tests {
    use super::super::confidence::tests::Draws;
    use super::super::sequence::Sequences;
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn what_rounding_leaves_of_equal_values_is_no_deviation() {
        let onsets: Vec<f64> = (0..40)
            .map(|slip| 1000.0 + 0.15 * f64::from(slip))
            .collect();
        let intervals: Vec<f64> = onsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = Sequences::of([intervals.iter().map(|interval| [*interval])]).estimate();
        let squares = |size| {
            intervals
                .iter()
                .map(|&x| mean.square_of_deviation(size)(x))
                .sum::<f64>()
        };
        assert!(squares(0.0) > 0.0 && squares(onsets[39]) == 0.0);
        assert!(mean.square_of_deviation(onsets[39])(0.15 + 1e-11) > 0.0);
    }

    /// How often of 100 the interval of a mean of 0 holds it, for jobs of such values.
    fn covered(jobs: usize, mut values: impl FnMut(&mut Draws) -> Vec<f64>) -> f64 {
        const REPETITIONS: u64 = 2000;
        let mut holds = |repetition| {
            let mut draws = Draws::new(repetition);
            let of_jobs = (0..jobs).map(|_| values(&mut draws).into_iter().map(|x| [x]));
            let interval = Sequences::of(of_jobs.collect::<Vec<_>>())
                .estimate()
                .interval();
            let interval = interval.unwrap();
            interval.low <= 0.0 && 0.0 <= interval.high
        };
        let held = (0..REPETITIONS).filter(|&repetition| holds(repetition));
        100.0 * held.count() as f64 / REPETITIONS as f64
    }

    #[test]
    fn intervals_of_correlated_values_cover_in_few_jobs_and_in_many() {
        for memory in [0.0, 0.3, 0.5] {
            for (jobs, length) in [(1, 60), (2, 30), (3, 30), (7, 15), (8, 15), (64, 15)] {
                let found = covered(jobs, |draws| draws.autoregressive(memory, length));
                assert!(
                    (91.0..98.5).contains(&found),
                    "{memory} {jobs} x {length}: {found}"
                );
            }
        }
    }

    #[test]
    fn intervals_of_anticorrelated_values_cover_where_jobs_are_many_and_cover_more_where_they_are_few()
     {
        // Phases of such slips vary about one value: the intervals between them are their differences.
        let differences = |length: usize| {
            move |draws: &mut Draws| {
                let phases: Vec<f64> = (0..=length).map(|_| draws.normal()).collect();
                phases.windows(2).map(|pair| pair[1] - pair[0]).collect()
            }
        };
        for (jobs, length) in [(8, 4), (24, 4), (24, 20), (60, 4), (200, 10)] {
            let found = covered(jobs, differences(length));
            assert!((93.0..97.5).contains(&found), "{jobs} x {length}: {found}");
        }
        assert!(covered(7, differences(20)) > 98.0);
    }

    #[test]
    fn many_jobs_count_as_one_value_each_and_few_are_cut() {
        let mut draws = Draws::new(3);
        let levels: Vec<f64> = (0..50).map(|_| draws.normal()).collect();
        let still = Sequences::of(levels.iter().map(|&level| [[level]; 10])).estimate();
        let once = Sequences::of(levels.iter().map(|&level| [[level]])).estimate();
        assert!((still.variance(&[1.0]) / once.variance(&[1.0]) - 1.0).abs() < 1e-12);
        assert_eq!((still.freedom(), once.freedom()), (Some(49.0), Some(49.0)));
        let of = |jobs: &[usize]| {
            let values = |&length: &usize| (0..length).map(|place| [place as f64]);
            Sequences::of(jobs.iter().map(values)).estimate().freedom()
        };
        assert_eq!(of(&[30]), Some(7.0));
        assert_eq!(of(&[15, 15, 0]), Some(7.0));
        assert_eq!(of(&[15, 15, 15]), Some(8.0));
        assert_eq!((of(&[2, 1]), of(&[1]), of(&[])), (Some(2.0), None, None));
    }

    #[test]
    fn one_value_and_equal_values_have_no_variance() {
        let one = Sequences::of([[[0.3]]]).estimate();
        assert_eq!((one.mean(), one.freedom()), (Some([0.3]), None));
        let equal = Sequences::of([[[0.5]; 3]]).estimate();
        assert_eq!(equal.variance(&[1.0]), 0.0);
        assert_eq!(Sequences::<2>::default().estimate().mean(), None);
    }

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

    fn of(angles: &[f64]) -> Estimate<2> {
        Sequences::of([angles.iter().map(|&angle| unit(angle))]).estimate()
    }

    #[test]
    fn opposite_angles_cancel_and_equal_angles_add() {
        assert!(of(&[0.0, PI]).resultant_length().unwrap() < 1e-15);
        let equal = of(&[-3.0; 7]);
        assert!((equal.resultant_length().unwrap() - 1.0).abs() < 1e-15);
        assert!((equal.direction(PI).unwrap() + 3.0).abs() < 1e-15);
        assert!((equal.direction(-4.0).unwrap() + 3.0 + TAU).abs() < 1e-14);
        assert_eq!(of(&[]).resultant_length(), None);
    }

    #[test]
    fn mean_direction_does_not_jump_at_the_seam() {
        let seam = of(&[PI - 0.1, -PI + 0.1, PI - 0.2, -PI + 0.2]);
        assert!((seam.direction(1.5 * PI).unwrap() - PI).abs() < 1e-14);
    }

    #[test]
    fn wrapped_angles_lie_in_the_half_open_window() {
        for top in [PI, 0.1, -2.0] {
            for step in -1000..1000 {
                let angle = f64::from(step) * 0.1 * PI;
                let wrapped = wrap(angle, top);
                assert!(
                    wrapped > top - TAU && wrapped <= top,
                    "{angle} -> {wrapped}"
                );
                assert!((libm::sin(angle) - libm::sin(wrapped)).abs() < 1e-12);
            }
        }
        assert_eq!(wrap(PI, PI), PI);
        assert_eq!(wrap(-PI, PI), PI);
    }
}
