//! Confidence intervals: they contain the true value in 95 of 100 repetitions.
//!
//! Where few slips differ from all others, as in a deep tongue, sums of jobs hardly vary, and their small variation is
//! skewed. Two things are added to Student's t: towards the side on which a sum is skewed, what the third moment says
//! of rare events; and slips of a kind that was not seen at all, of which there may be [`MAX_UNSEEN`]. Errors on one
//! side are combined by their squares (MOVER: G. Zou and A. Donner, Stat. Med. 27, 1693 (2008)).
//!
//! In a tongue, the intervals of a set are n periods each, up to a jitter. Few slips are off n there, and a small set
//! may have seen none. Each would change its statistics much, so its intervals allow for some of them (`Unseen`). How
//! much each would change is a choice by which intervals hold the true value as often as they say: docs/coverage.md.

use super::sequence::{Centred, Estimate, heading};
use crate::model::standard_normal_quantile;
use crate::table::columns::Interval;
use std::f64::consts::PI;

/// Share of repetitions in which an interval contains the true value.
const CONFIDENCE: f64 = 0.95;

/// Above this resultant length, chance is mostly that of the vectors along their mean.
const LONG: f64 = 0.5;

/// Events of which none is seen in 5 of 100 repetitions: -ln 0.05.
const MAX_UNSEEN: f64 = 3.0;

/// The interval of a count k of rare events is k + a ± √(1.96² k + a²) with this a: that of the Poisson distribution
/// (mid-P) to 0.07 events, and [`MAX_UNSEEN`] at k = 0.
const RARE: f64 = 0.5 * MAX_UNSEEN;

/// Relative error of a mean.
pub(super) const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Length of a mean of unit vectors that rounding leaves where they cancel.
const CANCELLED: f64 = 1e-9;

/// Values of which a standard deviation or a resultant length has an error: of two, both are as far from their mean.
pub(super) const MIN_VALUES: u64 = 3;

/// A mean and its interval.
pub type Mean = (f64, Option<Interval>);

/// What a slip of a kind that was not seen would take from a sum, or add to it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Unseen {
    pub(super) below: f64,
    pub(super) above: f64,
}

impl Unseen {
    pub(super) const fn below(below: f64) -> Self {
        Self { below, above: 0.0 }
    }
}

impl Estimate<1> {
    /// Half of the interval of the mean by Student's t; `None` for fewer than two values.
    fn half(&self) -> Option<f64> {
        Some(student(self.freedom()?) * self.variance(&[1.0]).sqrt())
    }

    /// Of the mean; `None` for fewer than two values.
    pub(super) fn interval(&self) -> Option<Interval> {
        self.interval_with(Unseen::default())
    }

    /// The same where slips may be missing.
    pub(super) fn interval_with(&self, unseen: Unseen) -> Option<Interval> {
        let [mean] = self.mean()?;
        let half = self.half()?;
        let n = self.count as f64;
        let [skew] = self.rare.map(|rare| RARE * rare / n);
        let wide = skew.abs() + libm::hypot(half, skew);
        let error = |is_skewed: bool, unseen: f64| {
            let seen = if is_skewed { wide } else { half };
            libm::hypot(seen, MAX_UNSEEN * unseen / n).max(ROUNDING * mean.abs())
        };
        Some(Interval {
            low: mean - error(skew < 0.0, unseen.below),
            high: mean + error(skew > 0.0, unseen.above),
        })
    }

    /// Of a share, the mean of flags (Wilson, J. Am. Stat. Assoc. 22, 209 (1927)), with the number of independent flags
    /// that had its variance; where nothing varies, of jobs. `None` for fewer than two.
    pub(super) fn share_interval(&self) -> Option<Interval> {
        let share = self.value()?;
        let freedom = self.freedom()?;
        let variance = self.variance(&[1.0]);
        let spread = share * (1.0 - share);
        let number = if variance > 0.0 {
            (spread / variance).min(self.count as f64)
        } else {
            freedom + 1.0
        };
        let t = student(freedom);
        let square = t * t / number;
        let middle = (share + 0.5 * square) / (1.0 + square);
        let half = t / (1.0 + square) * ((spread + 0.25 * square) / number).sqrt();
        Some(Interval {
            low: (middle - half).max(0.0),
            high: (middle + half).min(1.0),
        })
    }

    /// Standard deviation (n - 1) of the values whose squared deviations from their mean these are, and its interval;
    /// `None` for fewer than two values, and no interval for fewer than [`MIN_VALUES`].
    pub(super) fn deviation(&self, unseen: Unseen) -> (Option<f64>, Option<Interval>) {
        let n = self.count as f64;
        let of_sample = |square: f64| (square.max(0.0) * n / (n - 1.0)).sqrt();
        let square = self.value().filter(|_| n > 1.0);
        let squares = self.interval_with(unseen);
        let ends = squares.filter(|_| self.count >= MIN_VALUES);
        let ends = ends.map(|squares| Interval {
            low: of_sample(squares.low),
            high: of_sample(squares.high),
        });
        (square.map(of_sample), ends)
    }

    /// Shares of the values between whose quantiles the median lies, if these are the values' indicators of not
    /// exceeding it (Woodruff, J. Am. Stat. Assoc. 47, 635 (1952)).
    pub(super) fn shares_about_median(&self) -> Option<[f64; 2]> {
        // A value more or less is the least that a share can be off.
        let half = self.half()?.max(1.0 / self.count as f64);
        Some([0.5 - half, 0.5 + half])
    }
}

impl Estimate<2> {
    /// Of the mean direction of unit vectors, in rad about its representative in (`top` - 2π, `top`]: the whole turn if
    /// no direction is excluded; `None` for fewer than two. By the circular standard error (Fisher, Statistical
    /// Analysis of Circular Data (1993), Sec. 4.4.4), whose (1 - ρ_2)/2 is the variance across the mean; valid for
    /// short resultants, too (Fieller's interval).
    pub(super) fn direction_interval(&self, top: f64) -> Option<Interval> {
        let direction = self.direction(top)?;
        let length = self.resultant_length()?;
        let [x, y] = heading(self.mean()?);
        let across = self.variance(&[-y, x]);
        let sine = (student(self.freedom()?) * across.sqrt()).max(CANCELLED);
        let half = if sine < length {
            libm::asin(sine / length)
        } else {
            PI
        };
        Some(Interval {
            low: direction - half,
            high: direction + half,
        })
    }
}

impl Centred<2> {
    /// Of the resultant length R of unit vectors, of which vectors may be missing that each take `unseen` from the sum;
    /// `None` for fewer than [`MIN_VALUES`].
    ///
    /// Of short ones: the square of the length of a mean has the mean R² + s² + s'² and the variance 4 R² s² + 2 (s⁴ +
    /// s'⁴), with the variances s² along and s'² across. The interval contains every R from which the measured square
    /// is less than t standard deviations away (score interval). It also holds near R = 0, where chance alone makes a
    /// resultant longer. Long ones are the mean of the components along their direction.
    pub(super) fn length_interval(&self, unseen: f64) -> Option<Interval> {
        let mean = &self.mean;
        if mean.count < MIN_VALUES {
            return None;
        }
        let length = mean.resultant_length()?;
        let [x, y] = heading(mean.mean()?);
        let t = student(mean.freedom()?);
        if length > LONG {
            let components = self.deviations.along(&[x, y]).estimate();
            let Interval { low, high } = components.interval_with(Unseen::below(unseen))?;
            return Some(Interval {
                low: (length + low.min(-ROUNDING)).max(0.0),
                high: (length + high.max(ROUNDING)).min(1.0),
            });
        }
        let along = mean.variance(&[x, y]);
        let across = mean.variance(&[-y, x]);
        let unbiased = length * length - along - across;
        let middle = unbiased + 2.0 * t * t * along;
        let constant = unbiased * unbiased - 2.0 * t * t * (along * along + across * across);
        let root = (middle * middle - constant).max(0.0).sqrt();
        let end = |square: f64| square.clamp(0.0, 1.0).sqrt();
        Some(Interval {
            low: end(middle - root),
            high: end(middle + root),
        })
    }
}

/// The mean of independent values, and its interval.
#[cfg(test)]
pub(crate) fn mean_of(values: &[f64]) -> (Option<f64>, Option<Interval>) {
    let values = values.iter().map(|&value| [[value]]);
    let mean = super::sequence::Sequences::of(values).estimate();
    (mean.value(), mean.interval())
}

/// Student's t for a two-sided probability of [`CONFIDENCE`], at >= 1 degrees of freedom, to 1e-6.
pub(super) fn student(freedom: f64) -> f64 {
    student_at(CONFIDENCE, freedom)
}

/// The same for another probability.
pub(crate) fn student_at(confidence: f64, freedom: f64) -> f64 {
    // Beyond the limit t differs from the normal quantile by less than 1e-6.
    const LARGE: f64 = 3e6;
    // Newton steps from the first terms of Fisher's expansion converge from below.
    const STEPS: u32 = 20;
    let normal = standard_normal_quantile(0.5 + 0.5 * confidence);
    if freedom > LARGE {
        return normal;
    }
    let nu = freedom.max(1.0);
    let density =
        libm::exp(libm::lgamma(0.5 * (nu + 1.0)) - libm::lgamma(0.5 * nu)) / (nu * PI).sqrt();
    let mut t = normal + 0.25 * (normal * normal * normal + normal) / nu;
    for _ in 0..STEPS {
        let slope = 2.0 * density * libm::pow(1.0 + t * t / nu, -0.5 * (nu + 1.0));
        t += (confidence
            - 2.0 * density * nu.sqrt() * cosine_integral(libm::atan(t / nu.sqrt()), nu))
            / slope;
    }
    t
}

/// Integral of cos^(ν-1) from 0 to an angle, by Simpson's rule: with t = √ν tan θ, that of the density of t.
fn cosine_integral(angle: f64, nu: f64) -> f64 {
    const STEPS: u32 = 32;
    let width = angle / f64::from(STEPS);
    let weighted = |step: u32| {
        let value = libm::pow(libm::cos(f64::from(step) * width), nu - 1.0);
        match step {
            0 | STEPS => value,
            _ => value * f64::from(2 + 2 * (step % 2)),
        }
    };
    width / 3.0 * (0..=STEPS).map(weighted).sum::<f64>()
}

/// Standard deviation of intervals about whole numbers of periods, in periods, from which jitter alone puts slips off
/// n.
const MAX_JITTER: f64 = 0.1;

/// What a slip off n takes from the sum of phases as unit vectors.
pub(super) const OF_PHASES: f64 = 0.75;

/// The same of the intervals in periods, as angles: those before and after it.
pub(super) const OF_INTERVALS: f64 = 1.4;

/// Periods that are missing after an interval shorter than n: most are followed by one that is as much longer.
const OF_SHORTER: f64 = 0.4;

#[derive(Clone, Copy, Debug)]
pub(super) struct Tongue {
    /// Mean interval in periods.
    mean: Option<f64>,
    /// Periods beyond n, summed over all intervals.
    beyond: f64,
    has_shorter: bool,
}

impl Tongue {
    /// Of intervals in periods, their median and mean; `None` if they are in no tongue with n >= 1.
    pub(super) fn of(periods: &[f64], n: Option<u64>, mean: Option<f64>) -> Option<Self> {
        let n = n.filter(|&n| n > 0)? as f64;
        let count = periods.len() as f64;
        let rest = periods.iter().map(|periods| periods - periods.round());
        let mean_rest = rest.clone().sum::<f64>() / count;
        let squares: f64 = rest
            .map(|rest| (rest - mean_rest) * (rest - mean_rest))
            .sum();
        ((squares / count).sqrt() < MAX_JITTER).then(|| Self {
            mean,
            beyond: periods.iter().map(|periods| periods.round() - n).sum(),
            has_shorter: periods.iter().any(|periods| periods.round() < n),
        })
    }

    /// By how much a quantity that is proportional to the interval grows with each period.
    fn step(&self, of: &Estimate<1>) -> f64 {
        let means = of.value().zip(self.mean);
        means.map_or(0.0, |(mean, periods)| mean / periods)
    }

    /// What slips off n change in the mean of a quantity that is proportional to the interval.
    pub(super) fn of_mean(&self, of: &Estimate<1>) -> Unseen {
        let step = self.step(of);
        Unseen {
            below: if self.has_shorter && self.beyond >= 0.0 {
                OF_SHORTER * step
            } else {
                0.0
            },
            above: if self.beyond > 0.0 { 0.0 } else { step },
        }
    }

    /// What they change in the squared deviations of such a quantity from its mean.
    pub(super) fn of_squares(&self, of: &Estimate<1>) -> Unseen {
        let step = self.step(of);
        Unseen {
            below: 0.0,
            above: if self.beyond == 0.0 { step * step } else { 0.0 },
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::sequence::{Sequences, unit};
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use std::f64::consts::TAU;

    /// Random numbers of the tests, by seed.
    pub(in crate::reduce) struct Draws(ChaCha8Rng);

    impl Draws {
        pub(in crate::reduce) fn new(seed: u64) -> Self {
            Self(ChaCha8Rng::seed_from_u64(seed))
        }

        /// In (0, 1).
        pub(in crate::reduce) fn uniform(&mut self) -> f64 {
            ((self.0.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        }

        pub(in crate::reduce) fn normal(&mut self) -> f64 {
            let radius = (-2.0 * libm::log(self.uniform())).sqrt();
            radius * libm::cos(TAU * self.uniform())
        }

        /// Values of unit variance, each `memory` times the previous plus noise.
        pub(in crate::reduce) fn autoregressive(&mut self, memory: f64, count: usize) -> Vec<f64> {
            let mut value = self.normal();
            let mut next = || {
                let now = value;
                value = memory * value + (1.0 - memory * memory).sqrt() * self.normal();
                now
            };
            (0..count).map(|_| next()).collect()
        }

        /// An angle of a von Mises distribution about 0, by rejection.
        fn von_mises(&mut self, concentration: f64) -> f64 {
            loop {
                let angle = TAU * (self.uniform() - 0.5);
                if self.uniform() < libm::exp(concentration * (libm::cos(angle) - 1.0)) {
                    return angle;
                }
            }
        }
    }

    #[test]
    fn students_t_is_that_of_the_tables() {
        let table = [
            (1.0, 12.706_205),
            (2.0, 4.302_653),
            (3.0, 3.182_446),
            (10.0, 2.228_139),
            (120.0, 1.979_930),
        ];
        for (freedom, expected) in table
            .into_iter()
            .chain([(1e5, 1.959_988), (1e7, 1.959_964)])
        {
            assert!(
                (student(freedom) - expected).abs() < 2e-6,
                "{freedom}: {} for {expected}",
                student(freedom)
            );
        }
        assert!(student(1.5) < student(1.0) && student(1.5) > student(2.0));
    }

    /// Ends of mid-P intervals of the Poisson distribution, from its probabilities.
    /// A quarter of the flags of a job are one draw.
    #[test]
    fn shares_are_covered_also_rare_ones_in_few_jobs() {
        const REPETITIONS: u64 = 1000;
        for (share, jobs, length) in [
            (0.0024, 8, 20),
            (0.0024, 64, 20),
            (0.05, 8, 20),
            (0.3, 16, 20),
        ] {
            let holds = |repetition: &u64| {
                let mut draws = Draws::new(*repetition);
                let mut flag = |chance: f64| f64::from(u8::from(draws.uniform() < chance));
                let mut job = || {
                    let half = flag(share);
                    let flags = (0..length).map(|number| {
                        let own = flag(share);
                        [if number % 4 == 0 { half } else { own }]
                    });
                    flags.collect::<Vec<_>>()
                };
                let flags = Sequences::of((0..jobs).map(|_| job()).collect::<Vec<_>>());
                let Interval { low, high } = flags.estimate().share_interval().unwrap();
                assert!(0.0 <= low && low < high && high <= 1.0);
                low <= share && share <= high
            };
            let held = (0..REPETITIONS).filter(holds).count();
            assert!(
                held > 910,
                "{share} in {jobs} jobs: {held} of {REPETITIONS}"
            );
        }
    }

    #[test]
    fn counts_of_rare_events_have_the_intervals_of_the_poisson_distribution() {
        let exact = [
            (0.0, 0.0, 3.00),
            (1.0, 0.05, 4.93),
            (2.0, 0.34, 6.61),
            (5.0, 1.83, 11.08),
            (10.0, 5.08, 17.82),
            (30.0, 20.61, 42.29),
        ];
        for (count, low, high) in exact {
            let half = libm::hypot(student(1e9) * f64::sqrt(count), RARE);
            let ends = [count + RARE - half, count + RARE + half];
            assert!(
                (ends[0] - low).abs() < 0.07 && (ends[1] - high).abs() < 0.07,
                "{count}: {ends:?}"
            );
        }
    }

    /// How often of 100 the intervals of length, direction and plain mean hold the true values, over repetitions of
    /// jobs of angles about a mean of 0.7.
    fn coverage(
        (jobs, length): (usize, usize),
        resultant: f64,
        mut angles: impl FnMut(&mut Draws, usize) -> Vec<f64>,
    ) -> [f64; 3] {
        const REPETITIONS: u64 = 1000;
        const MEAN: f64 = 0.7;
        let mut held = [0.0; 3];
        for repetition in 0..REPETITIONS {
            let mut draws = Draws::new(repetition);
            let sample: Vec<Vec<f64>> = (0..jobs)
                .map(|_| {
                    angles(&mut draws, length)
                        .iter()
                        .map(|angle| angle + MEAN)
                        .collect()
                })
                .collect();
            let vectors = Sequences::of(
                sample
                    .iter()
                    .map(|job| job.iter().map(|&angle| unit(angle))),
            )
            .centred();
            let reals =
                Sequences::of(sample.iter().map(|job| job.iter().map(|&angle| [angle]))).estimate();
            let holds = |interval: Interval, truth| interval.low <= truth && truth <= interval.high;
            held[0] += f64::from(u8::from(holds(
                vectors.length_interval(0.0).unwrap(),
                resultant,
            )));
            // No direction is near the seam a turn away.
            held[1] += f64::from(u8::from(holds(
                vectors.mean.direction_interval(MEAN + PI).unwrap(),
                MEAN,
            )));
            held[2] += f64::from(u8::from(holds(reals.interval().unwrap(), MEAN)));
        }
        held.map(|held| 100.0 * held / REPETITIONS as f64)
    }

    const SIZES: [(usize, usize); 4] = [(2, 50), (10, 20), (16, 100), (100, 15)];

    #[test]
    fn intervals_of_independent_angles_cover() {
        // Resultant lengths of von Mises distributions: I1/I0.
        for (concentration, resultant) in [
            (0.3, 0.148_337),
            (1.0, 0.446_390),
            (3.0, 0.809_985),
            (30.0, 0.983_190),
        ] {
            for size in SIZES {
                let found = coverage(size, resultant, |draws, length| {
                    (0..length)
                        .map(|_| draws.von_mises(concentration))
                        .collect()
                });
                // 1000 repetitions give coverage to 0.7 (standard error).
                assert!(
                    found.iter().all(|held| (92.0..98.0).contains(held)),
                    "{concentration}, {size:?}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn intervals_of_correlated_angles_cover() {
        for (memory, deviation) in [(0.5, 0.3), (0.5, 1.0), (0.8, 0.8)] {
            let resultant = libm::exp(-0.5 * deviation * deviation);
            // At (2, 50) and (10, 20) fewer than 35 of the most correlated are effective, and lengths cover in 88 to 93
            // %.
            for size in SIZES.into_iter().skip(if memory > 0.6 { 2 } else { 0 }) {
                let found = coverage(size, resultant, |draws, length| {
                    draws
                        .autoregressive(memory, length)
                        .iter()
                        .map(|x| deviation * x)
                        .collect()
                });
                assert!(
                    found.iter().all(|held| (92.0..98.0).contains(held)),
                    "{memory}, {deviation}, {size:?}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn the_interval_of_the_resultant_length_begins_at_zero_for_uniform_angles() {
        for size in SIZES {
            let [length, ..] = coverage(size, 0.0, |draws, length| {
                (0..length).map(|_| TAU * draws.uniform()).collect()
            });
            assert!((92.0..98.0).contains(&length), "{size:?}: {length}");
        }
    }

    #[test]
    fn neglecting_the_correlation_would_miss_the_mean_half_of_the_time() {
        // The same angles, cut into jobs of one, so that no pair is left.
        let [.., cut] = coverage((1600, 1), 1.0, {
            let mut rest = Vec::new();
            move |draws, _| {
                if rest.is_empty() {
                    rest = draws.autoregressive(0.9, 100);
                }
                rest.pop().into_iter().collect()
            }
        });
        assert!(cut < 60.0, "{cut}");
    }
}
