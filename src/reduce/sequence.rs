//! Values of a quantity slip by slip, job by job, and the uncertainty of their mean.
//!
//! Jobs of a set are independent, slips of a job are not. The variance of a mean of n values is that of independent
//! ones times 1 + 2 Σ_k ρ_k N_k/n = n/n_eff, with the autocorrelation ρ_k and the N_k pairs at lag k within jobs. The
//! estimate is the Γ-method of U. Wolff, Comput. Phys. Commun. 156, 143 (2004): autocovariances pooled over the jobs
//! about the mean of all, summed up to the lag at which truncation error and noise balance (his automatic window, S =
//! 1.5), and corrected for the bias of a mean estimated from the same values. Counting pairs makes it exact for short
//! jobs, too: a job of one slip has none.
//!
//! Anticorrelated values, such as the intervals of slips at one phase, have a more precise mean than independent ones.
//! In a few jobs anticorrelation is mostly noise, and it counts for nothing.
//!
//! From [`MANY_JOBS`] on, the variance is that of the sums of the jobs, which are independent, whatever the correlation
//! within them: n values in m jobs with the sums S_j of the deviations from the mean have m/(m-1) Σ_j S_j²/n² with m - 1
//! degrees of freedom. It is the jackknife over jobs of any function of means, to first order.

/// Wolff's S: ratio of the decay time of the correlation to its integrated time.
const DECAY: f64 = 1.5;

/// Jobs from which the spread of their sums is the variance: it is known to 27 %.
pub(super) const MANY_JOBS: usize = 8;

/// Values of a quantity with D components, in the order of slips, and where jobs begin.
#[derive(Clone, Debug, Default)]
pub(super) struct Sequences<const D: usize> {
    values: Vec<[f64; D]>,
    starts: Vec<usize>,
}

impl<const D: usize> Sequences<D> {
    /// From the values of each job.
    pub(super) fn of<Job: IntoIterator<Item = [f64; D]>>(
        jobs: impl IntoIterator<Item = Job>,
    ) -> Self {
        let (mut values, mut starts) = (Vec::new(), Vec::new());
        for job in jobs {
            starts.push(values.len());
            values.extend(job);
        }
        Self { values, starts }
    }

    /// Jobs of one value each: independent values.
    pub(super) fn independent(values: Vec<[f64; D]>) -> Self {
        Self {
            starts: (0..values.len()).collect(),
            values,
        }
    }

    pub(super) fn jobs(&self) -> impl Iterator<Item = &[[f64; D]]> {
        let ends = self
            .starts
            .iter()
            .skip(1)
            .copied()
            .chain([self.values.len()]);
        self.starts
            .iter()
            .zip(ends)
            .map(|(&start, end)| &self.values[start..end])
    }

    /// Their mean and its covariance.
    pub(super) fn estimate(self) -> Estimate<D> {
        self.centred().1
    }

    /// Their deviations from the mean, and the mean with its covariance.
    pub(super) fn centred(mut self) -> (Self, Estimate<D>) {
        let count = self.values.len();
        let n = count as f64;
        let total = sum(&self.values);
        let mean = total.map(|sum| sum / n);
        for value in &mut self.values {
            for (component, mean) in value.iter_mut().zip(mean) {
                *component -= mean;
            }
        }
        let zeroth = self.products(0);
        if count < 2 || zeroth.trace() == 0.0 {
            return (
                self,
                Estimate {
                    count: count as u64,
                    total,
                    ..Estimate::default()
                },
            );
        }
        let (mut correlated, mut weight, mut time) = (zeroth, 1.0, 0.5);
        for lag in 1.. {
            let pairs: usize = self.jobs().map(|job| job.len().saturating_sub(lag)).sum();
            let wider = weight + 2.0 * pairs as f64 / n;
            // Beyond half the data, subtracting the mean removes most of the correlation.
            if pairs == 0 || wider > 0.5 * n {
                break;
            }
            weight = wider;
            let lagged = self.products(lag);
            correlated.add(&lagged, 2.0);
            time += lagged.trace() / zeroth.trace();
            if is_wide(lag as f64, time, n) {
                break;
            }
        }
        // Deviations from the mean of the same values: n <δδ> falls short of the variance by that of the mean, at each
        // lag.
        let ratio = correlated.trace() / zeroth.trace();
        let inflation = (ratio / (1.0 - weight / n + ratio / n)).max(1.0);
        let independent = zeroth.times(n / (n - inflation));
        let correlated = correlated.times(n / (n - weight));
        let jobs = self.jobs().filter(|job| !job.is_empty()).count();
        let (covariances, freedom, rare) = if jobs >= MANY_JOBS {
            let sums = Self::of(self.jobs().map(|job| [sum(job)]));
            let of_jobs = sums.products(0).times(jobs as f64 / (jobs as f64 - 1.0));
            ([of_jobs; 2], jobs as f64 - 1.0, rare(&sums.values))
        } else {
            // Exact in two limits: n - 1 for independent values, and the number of jobs - 1 if the slips of a job are
            // equal.
            let freedom = n / weight - 1.0;
            ([independent, correlated], freedom, rare(&self.values))
        };
        let inflation = (correlated.trace() / independent.trace()).max(1.0);
        (
            self,
            Estimate {
                count: count as u64,
                total,
                covariances,
                inflation,
                jobs,
                freedom,
                rare,
            },
        )
    }

    /// Their components along a unit vector.
    pub(super) fn along(&self, direction: &[f64; D]) -> Sequences<1> {
        let component = |value: &[f64; D]| {
            let products = value.iter().zip(direction).map(|(x, part)| x * part);
            [products.sum::<f64>()]
        };
        Sequences {
            values: self.values.iter().map(component).collect(),
            starts: self.starts.clone(),
        }
    }

    /// Sum of the symmetrised products of values a lag apart within jobs.
    fn products(&self, lag: usize) -> Matrix<D> {
        let mut sum = Matrix::default();
        for job in self.jobs() {
            for (early, late) in job.iter().zip(job.iter().skip(lag)) {
                for (row, line) in sum.0.iter_mut().enumerate() {
                    for (column, cell) in line.iter_mut().enumerate() {
                        *cell += 0.5 * (early[row] * late[column] + late[row] * early[column]);
                    }
                }
            }
        }
        sum
    }
}

/// Whether a window is wide enough: Wolff's g (his Eq. 52) is negative. `time` is the integrated autocorrelation time
/// within the window, 1/2 for independent values.
fn is_wide(lag: f64, time: f64, n: f64) -> bool {
    if time <= 0.5 {
        return true;
    }
    let decay = DECAY / libm::log((2.0 * time + 1.0) / (2.0 * time - 1.0));
    libm::exp(-lag / decay) < decay / (lag * n).sqrt()
}

fn sum<const D: usize>(values: &[[f64; D]]) -> [f64; D] {
    values.iter().fold([0.0; D], |mut sum, value| {
        add(&mut sum, value);
        sum
    })
}

/// Third moments over second ones, of deviations that vary independently.
fn rare<const D: usize>(deviations: &[[f64; D]]) -> [f64; D] {
    std::array::from_fn(|component| {
        let of = deviations.iter().map(|deviation| deviation[component]);
        let second: f64 = of.clone().map(|x| x * x).sum();
        let third: f64 = of.map(|x| x * x * x).sum();
        if second > 0.0 { third / second } else { 0.0 }
    })
}

pub(super) fn add<const D: usize>(sum: &mut [f64; D], value: &[f64; D]) {
    sum.iter_mut()
        .zip(value)
        .for_each(|(sum, value)| *sum += value);
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Matrix<const D: usize>([[f64; D]; D]);

impl<const D: usize> Default for Matrix<D> {
    fn default() -> Self {
        Self([[0.0; D]; D])
    }
}

impl<const D: usize> Matrix<D> {
    fn trace(&self) -> f64 {
        (0..D).map(|index| self.0[index][index]).sum()
    }

    fn add(&mut self, other: &Self, factor: f64) {
        for (line, others) in self.0.iter_mut().zip(&other.0) {
            line.iter_mut()
                .zip(others)
                .for_each(|(cell, other)| *cell += factor * other);
        }
    }

    fn times(&self, factor: f64) -> Self {
        Self(self.0.map(|line| line.map(|cell| factor * cell)))
    }

    fn along(&self, direction: &[f64; D]) -> f64 {
        let product = |line: &[f64; D]| {
            line.iter()
                .zip(direction)
                .map(|(cell, part)| cell * part)
                .sum::<f64>()
        };
        self.0
            .iter()
            .zip(direction)
            .map(|(line, part)| part * product(line))
            .sum()
    }
}

/// The mean of a quantity with D components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate<const D: usize> {
    count: u64,
    pub(super) total: [f64; D],
    /// Covariances of the sum, of which the larger counts in any direction: of independent values and with
    /// autocorrelation; or twice that of many jobs.
    covariances: [Matrix<D>; 2],
    /// Variance of the mean over that of independent values, n/n_eff >= 1.
    inflation: f64,
    /// Jobs with values.
    jobs: usize,
    /// Degrees of freedom of the variance; infinite where it is zero.
    freedom: f64,
    /// What a rare event adds to the sum, if rare events make its variance: the third moment over the second.
    pub(super) rare: [f64; D],
}

impl<const D: usize> Default for Estimate<D> {
    fn default() -> Self {
        let covariances = [Matrix::default(); 2];
        Self {
            count: 0,
            total: [0.0; D],
            covariances,
            inflation: 1.0,
            jobs: 0,
            freedom: f64::INFINITY,
            rare: [0.0; D],
        }
    }
}

impl<const D: usize> Estimate<D> {
    /// The mean of `count` values with this total, if these are sums of deviations of such values from known means.
    /// `excess` is the variance of the sums over that of independent deviations.
    pub(super) fn of_sums(self, (count, total): (u64, [f64; D]), excess: f64) -> Self {
        Self {
            count,
            total,
            inflation: (excess * self.inflation).max(1.0),
            ..self
        }
    }

    pub(super) const fn count(&self) -> u64 {
        self.count
    }

    /// Their mean; `None` without values.
    pub(super) fn mean(&self) -> Option<[f64; D]> {
        (self.count > 0).then(|| self.total.map(|sum| sum / self.count as f64))
    }

    /// Variance of the mean along a unit vector.
    pub(super) fn variance(&self, direction: &[f64; D]) -> f64 {
        let [one, other] = self
            .covariances
            .map(|covariance| covariance.along(direction));
        one.max(other) / (self.count as f64 * self.count as f64)
    }

    /// Effective number n_eff <= n of independent values; `None` without values.
    pub(super) fn effective(&self) -> Option<f64> {
        (self.count > 0).then(|| self.count as f64 / self.inflation)
    }

    /// Degrees of freedom of the variance, of which those of slips in a few jobs count for `share`; `None` for fewer than
    /// two values.
    pub(super) fn freedom(&self, share: f64) -> Option<f64> {
        let freedom = if self.jobs >= MANY_JOBS {
            self.freedom
        } else {
            share * self.freedom
        };
        (self.count > 1 || self.jobs > 0).then_some(freedom)
    }
}

#[cfg(test)]
mod tests {
    use super::super::confidence::tests::Draws;
    use super::*;

    /// n/n_eff, averaged over repetitions, of sequences in which a value is `memory` times the previous plus noise.
    fn average_inflation(memory: f64, jobs: usize, length: usize) -> f64 {
        const REPETITIONS: u64 = 200;
        let of = |repetition| {
            let mut draws = Draws::new(repetition);
            let values = Sequences::of((0..jobs).map(|_| {
                draws
                    .autoregressive(memory, length)
                    .into_iter()
                    .map(|x| [x])
            }));
            values.estimate().inflation
        };
        (0..REPETITIONS).map(of).sum::<f64>() / REPETITIONS as f64
    }

    #[test]
    fn the_effective_number_is_that_of_an_autoregressive_sequence() {
        // Exactly: 1 + 2 Σ (1 - k/L) ρ^k for jobs of L values.
        for (memory, jobs, length) in [
            (0.5, 16, 240),
            (0.8, 16, 240),
            (0.8, 100, 15),
            (0.5, 10, 20),
        ] {
            let exact = 1.0
                + 2.0
                    * (1..length)
                        .map(|lag| {
                            (1.0 - lag as f64 / length as f64) * libm::pow(memory, lag as f64)
                        })
                        .sum::<f64>();
            let found = average_inflation(memory, jobs, length);
            // The window leaves out a tail of some percent.
            assert!(
                (found / exact - 1.0).abs() < 0.12,
                "{memory}, {jobs} x {length}: {found} for {exact}"
            );
        }
    }

    #[test]
    fn independent_values_keep_their_number_and_anticorrelated_ones_gain_none() {
        // What is above 1 is noise cut off below.
        assert!(average_inflation(0.0, 16, 240) < 1.05);
        assert!(average_inflation(0.0, 2, 15) < 1.25);
        assert_eq!(
            Sequences::of([[1.0, -1.0, 1.0, -1.0, 1.0, -1.0].map(|x| [x])])
                .estimate()
                .effective(),
            Some(6.0)
        );
    }

    #[test]
    fn intervals_of_anticorrelated_values_cover_where_jobs_are_many_and_cover_more_where_they_are_few()
     {
        // Phases of such slips vary about one value: the intervals between them are their differences.
        let covered = |jobs: usize, length: usize| {
            const REPETITIONS: u64 = 2000;
            let holds = |repetition| {
                let mut draws = Draws::new(repetition);
                let mut of_job = || {
                    let phases: Vec<f64> = (0..=length).map(|_| draws.normal()).collect();
                    phases
                        .windows(2)
                        .map(|pair| [pair[1] - pair[0]])
                        .collect::<Vec<_>>()
                };
                let interval = Sequences::of((0..jobs).map(|_| of_job()))
                    .estimate()
                    .interval()
                    .unwrap();
                interval.low <= 0.0 && 0.0 <= interval.high
            };
            100.0
                * (0..REPETITIONS)
                    .filter(|&repetition| holds(repetition))
                    .count() as f64
                / REPETITIONS as f64
        };
        for (jobs, length) in [(MANY_JOBS, 4), (24, 4), (24, 20), (60, 4), (200, 10)] {
            let found = covered(jobs, length);
            assert!((93.0..97.5).contains(&found), "{jobs} x {length}: {found}");
        }
        assert!(covered(7, 20) > 99.0);
    }

    #[test]
    fn jobs_that_hold_still_count_as_one_value_each() {
        let mut draws = Draws::new(3);
        let levels: Vec<f64> = (0..50).map(|_| draws.normal()).collect();
        let still = Sequences::of(levels.iter().map(|&level| [[level]; 10])).estimate();
        let once = Sequences::independent(levels.iter().map(|&level| [level]).collect()).estimate();
        assert!(
            (still.effective().unwrap() - 50.0).abs() < 2.0,
            "{:?}",
            still.effective()
        );
        assert!((still.variance(&[1.0]) / once.variance(&[1.0]) - 1.0).abs() < 0.05);
        assert!((still.freedom(1.0).unwrap() - 49.0).abs() < 1e-9);
    }

    #[test]
    fn no_pair_crosses_from_one_job_to_the_next() {
        // Each job alternates, and the next begins where it ended: across jobs equal values would follow each other.
        let jobs = Sequences::of((0..40).map(|job| {
            if job % 2 == 0 {
                [[1.0], [-1.0]]
            } else {
                [[-1.0], [1.0]]
            }
        }));
        assert_eq!(jobs.products(1).trace(), -40.0);
        assert_eq!(jobs.products(2).trace(), 0.0);
    }

    #[test]
    fn one_value_and_equal_values_have_no_variance() {
        let one = Sequences::of([[[0.3]]]).estimate();
        assert_eq!(
            (one.mean(), one.effective(), one.freedom(1.0)),
            (Some([0.3]), Some(1.0), None)
        );
        let equal = Sequences::of([[[0.5]; 3]]).estimate();
        assert_eq!(
            (equal.variance(&[1.0]), equal.effective()),
            (0.0, Some(3.0))
        );
        assert_eq!(Sequences::<2>::default().estimate().mean(), None);
    }
}
