//! One estimator of all statistics: functions of sums over units, each with a 95 % interval.
//!
//! Jobs of different seeds are independent, slips of one job are not. So the units are jobs, and of few jobs equal
//! stretches of each (batch means). A unit is known by its seed and stretch: what is left out of one set is left out of
//! all that a statistic is of, such as a control, another directory or the sets of a bin, as a seed is one realisation
//! of the disorder in all of them. Half of an interval is hypot(t · jackknife, not seen) + ends:
//!
//! - the jackknife over units, with Student's t (B. Efron and C. Stein, Ann. Stat. 9, 586 (1981));
//! - *not seen*: of a kind of slip that no unit holds, there may be [`MAX_UNSEEN`];
//! - *ends*: the change if the first and the last value of each job count by half. Where slips alternate, jobs may all
//!   begin and end with the same kind, so that their sums do not vary, and are wrong: an error of one sign, not a random
//!   one, so it is added.
//!
//! A value enters as its weight and two numbers ([`Sums`]), and a statistic is a function of such sums: [`mean`],
//! [`length`] and the like. [`Units`] has the sums of each unit, [`Units::estimate`] the interval.
//! Angles are unit vectors. docs/coverage.md has how often intervals hold the true value.

use crate::model::standard_normal_quantile;
use crate::table::columns::Interval;
use crate::table::value::floored;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, LN_10, PI, TAU};

/// Units, at least: of fewer jobs, each is cut into stretches. An error is then known to 27 %.
const MIN_UNITS: usize = 8;

/// Share of repetitions in which an interval contains the true value.
pub(crate) const CONFIDENCE: f64 = 0.95;

/// Events of which none is seen in 5 of 100 repetitions: -ln 0.05.
pub(super) const MAX_UNSEEN: f64 = 3.0;

/// Relative error of a mean.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A seed, and the number of a stretch of its job.
type Unit = (u64, usize);

/// What a value adds: its weight and two numbers, such as itself and its square, or the components of a vector.
pub(crate) type Sums = [f64; 3];

/// The unit vector of an angle in rad.
pub(super) fn unit(angle: f64) -> Sums {
    [1.0, libm::cos(angle), libm::sin(angle)]
}

/// Mean of numbers; `None` without any.
pub(crate) fn mean([weight, sum, _]: Sums) -> Option<f64> {
    (weight > 0.0).then(|| sum / weight)
}

/// Length of the mean of vectors, 0 to 1; `None` without any.
pub(super) fn length([weight, x, y]: Sums) -> Option<f64> {
    (weight > 0.0).then(|| (libm::hypot(x, y) / weight).min(1.0))
}

/// Population standard deviation; `None` for fewer than two numbers.
fn spread([weight, sum, squares]: Sums) -> Option<f64> {
    let mean = sum / weight;
    (weight >= 2.0).then(|| (squares / weight - mean * mean).max(0.0).sqrt())
}

pub(super) fn plus(sums: Sums, factor: f64, other: Sums) -> Sums {
    std::array::from_fn(|place| sums[place] + factor * other[place])
}

/// Sums over units.
#[derive(Clone, Debug, Default)]
pub(crate) struct Units {
    /// The sums of each, and half of its values at an end of a job.
    of: BTreeMap<Unit, [Sums; 2]>,
    total: Sums,
}

impl Units {
    /// Of the values of jobs in order, by their seeds.
    pub(crate) fn of(jobs: impl IntoIterator<Item = (u64, Vec<Sums>)>) -> Self {
        let with_values = jobs.into_iter().filter(|(_, values)| !values.is_empty());
        let jobs: Vec<(u64, Vec<Sums>)> = with_values.collect();
        let parts = MIN_UNITS.div_ceil(jobs.len().max(1));
        let mut units = Self::default();
        for (seed, values) in &jobs {
            let last = values.len() - 1;
            for (place, value) in values.iter().enumerate() {
                let at_end = if place == 0 || place == last {
                    0.5
                } else {
                    0.0
                };
                // The stretch from len · part / parts on.
                let part = ((place + 1) * parts - 1) / values.len();
                units.push((*seed, part), *value, plus([0.0; 3], at_end, *value));
            }
        }
        units
    }

    fn push(&mut self, unit: Unit, sums: Sums, at_ends: Sums) {
        let [of_unit, ends] = self.of.entry(unit).or_default();
        *of_unit = plus(*of_unit, 1.0, sums);
        *ends = plus(*ends, 1.0, at_ends);
        self.total = plus(self.total, 1.0, sums);
    }

    /// Adds those of another set, in which a seed is the same realisation.
    pub(super) fn merge(&mut self, other: &Self) {
        for (unit, [sums, ends]) in &other.of {
            self.push(*unit, *sums, *ends);
        }
    }

    /// Adds the unit vector of an angle, from which its change is taken if a unit is left out.
    pub(super) fn push_angle(&mut self, angle: &Estimate) {
        let vector = unit(angle.value);
        let total = plus(self.total, 1.0, vector);
        for (of_unit, without) in &angle.without {
            self.push(*of_unit, plus(vector, -1.0, unit(*without)), [0.0; 3]);
        }
        self.total = total;
    }

    /// The units of seeds that another has, too; all if there are none.
    pub(super) fn common(&self, other: &Self) -> Self {
        let seeds: BTreeSet<u64> = other.of.keys().map(|(seed, _)| *seed).collect();
        let mut common = Self::default();
        for (unit, [sums, ends]) in &self.of {
            if seeds.contains(&unit.0) {
                common.push(*unit, *sums, *ends);
            }
        }
        if common.of.is_empty() {
            self.clone()
        } else {
            common
        }
    }

    pub(super) fn total(&self) -> Sums {
        self.total
    }

    /// `None` if the statistic has no value.
    pub(crate) fn estimate(&self, statistic: impl Fn(Sums) -> Option<f64>) -> Option<Estimate> {
        let value = statistic(self.total)?;
        let without = |(unit, [sums, _]): (&Unit, &[Sums; 2])| {
            Some((*unit, statistic(plus(self.total, -1.0, *sums))?))
        };
        let ends = self.of.values();
        let halved = ends.fold(self.total, |total, [_, ends]| plus(total, -1.0, *ends));
        Some(Estimate {
            value,
            without: self
                .of
                .iter()
                .map(without)
                .collect::<Option<_>>()
                .unwrap_or_default(),
            halved: statistic(halved).unwrap_or(value),
            not_seen: 0.0,
        })
    }

    /// Whether vectors without a direction have a mean as long as theirs in more than 5 of 100 samples (H. Hotelling, Ann.
    /// Math. Stat. 2, 360 (1931)).
    pub(super) fn may_cancel(&self) -> bool {
        let component =
            |of: fn(Sums) -> f64| self.estimate(|sums| (sums[0] > 0.0).then(|| of(sums) / sums[0]));
        let Some((x, y)) = component(|[_, x, _]| x).zip(component(|[_, _, y]| y)) else {
            return true;
        };
        let units = self.of.len() as f64;
        let covariances = [[&x, &x], [&x, &y], [&y, &y]].map(|[one, other]| one.covariance(other));
        let [Some(of_x), Some(of_both), Some(of_y)] = covariances else {
            return true;
        };
        // T² is below (n - 1) 2 / (n - 2) times the quantile of F with 2 and n - 2 degrees of freedom.
        let quantile = libm::pow(1.0 - CONFIDENCE, -2.0 / (units - 2.0)) - 1.0;
        let square =
            x.value * x.value * of_y - 2.0 * x.value * y.value * of_both + y.value * y.value * of_x;
        units <= 2.0 || square < (units - 1.0) * quantile * (of_x * of_y - of_both * of_both)
    }

    /// The decimal logarithm of Schuster's p: how probable a mean as long as theirs is for vectors without a direction
    /// (A. Schuster, Proc. R. Soc. London 61, 455 (1897)). They count as the independent ones whose mean would vary as
    /// much, if these are fewer.
    pub(super) fn schuster(&self) -> Option<f64> {
        let [count, ..] = self.total;
        let length = length(self.total)?;
        let component = |of: fn(Sums) -> f64| {
            let mean = self.estimate(|sums| (sums[0] > 0.0).then(|| of(sums) / sums[0]))?;
            mean.covariance(&mean)
        };
        let variance = component(|[_, x, _]| x)? + component(|[_, _, y]| y)?;
        let spread = 1.0 - length * length;
        // Rounding leaves this of equal vectors.
        let effective = if spread > ROUNDING {
            (spread / variance).min(count)
        } else {
            count
        };
        Some(-effective * length * length / LN_10)
    }

    /// The interval of the length of their mean, with 0 in it where they may have no direction: chance alone makes the
    /// length longer.
    pub(super) fn with_zero(&self, length: Interval) -> Interval {
        let low = if self.may_cancel() { 0.0 } else { length.low };
        Interval { low, ..length }
    }

    /// Mean direction of vectors in rad, the representative in (`top` - 2π, `top`], and its interval: the whole turn if
    /// they may have none. By the variation across the mean, so that it holds for short resultants, too (Fieller), if
    /// those that were not seen may take this from its length.
    pub(super) fn direction(
        &self,
        top: f64,
        not_seen: f64,
    ) -> Option<(Estimate, Option<Interval>)> {
        let [_, x, y] = self.total;
        let length = length(self.total)?;
        let size = libm::hypot(x, y).max(f64::MIN_POSITIVE);
        let angle = libm::atan2(y, x);
        let turned = |[_, a, b]: Sums| Some(libm::atan2(x * b - y * a, x * a + y * b));
        let direction = self.estimate(turned)?.plus(wrap(angle, top));
        let across = self
            .estimate(|[weight, a, b]| (weight > 0.0).then(|| (x * b - y * a) / size / weight))?;
        let half = across.allowing_for(not_seen).half_width().map(|half| {
            // Rounding leaves this where vectors cancel.
            let sine = half.max(1e-9);
            if sine < length && !self.may_cancel() {
                libm::asin(sine / length)
            } else {
                PI
            }
        });
        let interval = half.map(|half| Interval {
            low: direction.value - half,
            high: direction.value + half,
        });
        Some((direction, interval))
    }
}

/// Numbers as deviations from their mean, so that sums of squares lose no digits.
pub(crate) struct Numbers {
    /// NaN without any.
    pub(super) mean: f64,
    deviations: Units,
}

impl Numbers {
    /// Of the numbers of jobs in order, by their seeds: deviations within the rounding of what they are differences of,
    /// of up to this size, are 0.
    pub(crate) fn of(jobs: &[(u64, Vec<f64>)], size: f64) -> Self {
        let all = || jobs.iter().flat_map(|(_, numbers)| numbers);
        let mean = all().sum::<f64>() / all().count() as f64;
        let from_mean = |number: &f64| {
            let deviation = number - mean;
            if deviation.abs() <= ROUNDING * size {
                0.0
            } else {
                deviation
            }
        };
        let sums = |number: &f64| {
            let deviation = from_mean(number);
            [1.0, deviation, deviation * deviation]
        };
        let of_jobs = jobs
            .iter()
            .map(|(seed, numbers)| (*seed, numbers.iter().map(sums).collect()));
        Self {
            mean,
            deviations: Units::of(of_jobs),
        }
    }

    /// Their mean and standard deviation (n - 1), if a number that was not seen may be off by this, or by a standard
    /// deviation.
    pub(crate) fn estimates(&self, off: f64) -> [Option<Estimate>; 2] {
        let [count, ..] = self.deviations.total;
        let unbiased = (count / (count - 1.0)).sqrt();
        let seen = spread(self.deviations.total).unwrap_or_default();
        let most_off = off.max(seen);
        let wider = (seen * seen + MAX_UNSEEN * most_off * most_off / count).sqrt();
        let mean = self
            .deviations
            .estimate(mean)
            .map(|mean| mean.plus(self.mean));
        let deviation = self
            .deviations
            .estimate(spread)
            .map(|deviation| deviation.times(unbiased));
        [
            mean.map(|mean| mean.allowing_for(MAX_UNSEEN * most_off / count)),
            deviation.map(|deviation| deviation.allowing_for(unbiased * (wider - seen))),
        ]
    }

    /// Their error over that of as many independent numbers; `None` if they do not vary.
    pub(super) fn regularity(&self) -> Option<f64> {
        let mean = self.deviations.estimate(mean)?;
        let independent = spread(self.deviations.total)? / self.deviations.total[0].sqrt();
        Some(mean.error()? / independent)
    }
}

/// A statistic, and what it is without each of its units.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    without: Vec<(Unit, f64)>,
    /// If the first and the last value of each job count by half.
    halved: f64,
    not_seen: f64,
}

impl Estimate {
    /// Of what no unit changes.
    pub(super) const fn exact(value: f64) -> Self {
        Self {
            value,
            without: Vec::new(),
            halved: value,
            not_seen: 0.0,
        }
    }

    /// A function of statistics: what is left out of one is left out of all.
    pub(crate) fn function<const N: usize>(
        of: [&Self; N],
        function: impl Fn([f64; N]) -> f64,
    ) -> Self {
        Self::of_all(&of, |values| {
            function(std::array::from_fn(|place| values[place]))
        })
    }

    /// The same of any number of them. Where jobs of one are cut otherwise than those of another, units are whole jobs.
    pub(super) fn of_all(of: &[&Self], function: impl Fn(&[f64]) -> f64) -> Self {
        let units: BTreeSet<Unit> = of
            .iter()
            .flat_map(|one| one.without.iter().map(|(unit, _)| *unit))
            .collect();
        let is_cut_otherwise = |one: &&Self| {
            let of_seeds: BTreeSet<u64> = one.without.iter().map(|((seed, _), _)| *seed).collect();
            let of_others = units.iter().filter(|(seed, _)| of_seeds.contains(seed));
            of_others.count() > one.without.len()
        };
        if of.iter().any(is_cut_otherwise) {
            let whole: Vec<Self> = of.iter().map(|one| one.by_seeds()).collect();
            return Self::of_all(&whole.iter().collect::<Vec<_>>(), function);
        }
        let with = |value: &dyn Fn(&Self) -> f64| {
            function(&of.iter().map(|one| value(one)).collect::<Vec<_>>())
        };
        let value = with(&|one| one.value);
        let without = |unit: Unit| (unit, with(&|one| one.left(unit)));
        let changed = |changed: &&Self| {
            with(&|one| {
                if std::ptr::eq(one, *changed) {
                    one.value + one.not_seen
                } else {
                    one.value
                }
            }) - value
        };
        Self {
            value,
            without: units.into_iter().map(without).collect(),
            halved: with(&|one| one.halved),
            not_seen: of.iter().map(changed).fold(0.0, libm::hypot),
        }
    }

    /// Its value without a unit.
    fn left(&self, unit: Unit) -> f64 {
        let place = self.without.binary_search_by_key(&unit, |(unit, _)| *unit);
        place.map_or(self.value, |place| self.without[place].1)
    }

    /// The same with whole jobs as units, to first order.
    fn by_seeds(&self) -> Self {
        let n = self.without.len() as f64;
        let jobs = self
            .without
            .chunk_by(|(left, _), (right, _)| left.0 == right.0);
        let whole = |job: &[(Unit, f64)]| {
            let change: f64 = job.iter().map(|(_, without)| without - self.value).sum();
            let factor = (n - 1.0) / (n - job.len() as f64).max(1.0);
            ((job[0].0.0, 0), self.value + factor * change)
        };
        Self {
            without: jobs.map(whole).collect(),
            ..self.clone()
        }
    }

    /// The same of seeds that no other has.
    pub(super) fn apart(mut self) -> Self {
        for ((seed, _), _) in &mut self.without {
            *seed |= 1 << 63;
        }
        self
    }

    /// The same, further by a constant.
    pub(super) fn plus(mut self, constant: f64) -> Self {
        self.value += constant;
        self.halved += constant;
        self.without
            .iter_mut()
            .for_each(|(_, value)| *value += constant);
        self
    }

    pub(crate) fn times(&self, factor: f64) -> Self {
        Self::function([self], |[value]| factor * value)
    }

    /// The same if slips that were not seen may change it by this.
    pub(super) fn allowing_for(mut self, not_seen: f64) -> Self {
        self.not_seen = not_seen;
        self
    }

    /// How far it is off for what is not seen, and by the ends of jobs.
    pub(super) fn allowances(&self) -> [f64; 2] {
        [self.not_seen, (self.halved - self.value).abs()]
    }

    /// Its covariance with another of the same units, by the jackknife; `None` for fewer than two units.
    pub(super) fn covariance(&self, other: &Self) -> Option<f64> {
        let n = self.without.len() as f64;
        let mean = |of: &Self| of.without.iter().map(|(_, value)| value).sum::<f64>() / n;
        let means = [mean(self), mean(other)];
        let pairs = self.without.iter().zip(&other.without);
        let products = pairs.map(|((_, left), (_, right))| (left - means[0]) * (right - means[1]));
        (n >= 2.0).then(|| (n - 1.0) / n * products.sum::<f64>())
    }

    pub(crate) fn error(&self) -> Option<f64> {
        Some(self.covariance(self)?.sqrt())
    }

    /// Degrees of freedom of its error.
    pub(crate) fn freedom(&self) -> f64 {
        self.without.len() as f64 - 1.0
    }

    /// Student's t with them.
    pub(crate) fn student(&self, confidence: f64) -> f64 {
        student_at(confidence, self.freedom())
    }

    /// Half of its interval.
    pub(crate) fn half_width(&self) -> Option<f64> {
        let [not_seen, ends] = self.allowances();
        let error = self.student(CONFIDENCE) * self.error()?;
        Some(libm::hypot(error, not_seen) + ends)
    }

    /// Interval of a share, of `count` flags (Wilson, J. Am. Stat. Assoc. 22, 209 (1927)). The effective number of flags is
    /// that of independent ones with the same variance; where nothing varies, the number of units. `None` for fewer than
    /// two units.
    pub(super) fn share_interval(&self, count: f64) -> Option<Interval> {
        let share = self.value;
        let error = self.error()?;
        let spread = share * (1.0 - share);
        let number = if error > 0.0 {
            (spread / (error * error)).min(count)
        } else {
            self.without.len() as f64
        };
        let t = self.student(CONFIDENCE);
        let square = t * t / number;
        let middle = (share + 0.5 * square) / (1.0 + square);
        let half = t / (1.0 + square) * ((spread + 0.25 * square) / number).sqrt();
        // Rounding must not leave 0 or 1 outside where none or all are seen.
        Some(Interval {
            low: (middle - half).clamp(0.0, share),
            high: (middle + half).clamp(share, 1.0),
        })
    }

    /// Its value and its interval.
    pub(super) fn both(of: Option<&Self>) -> (Option<f64>, Option<Interval>) {
        (of.map(|of| of.value), of.and_then(Self::interval))
    }

    pub(crate) fn interval(&self) -> Option<Interval> {
        Some(Interval::around(self.value, self.half_width()?))
    }
}
/// Student's t for a two-sided probability, at a whole number >= 1 of degrees of freedom.
pub(crate) fn student_at(confidence: f64, freedom: f64) -> f64 {
    /// From here on the first term of Fisher's expansion gives it to 1e-7.
    const LARGE: f64 = 1e4;
    /// Halvings that leave no more than rounding.
    const STEPS: u32 = 52;
    if freedom > LARGE {
        let normal = standard_normal_quantile(0.5 + 0.5 * confidence);
        return normal + 0.25 * (normal * normal * normal + normal) / freedom;
    }
    let [mut low, mut high] = [0.0, FRAC_PI_2];
    for _ in 0..STEPS {
        let angle = 0.5 * (low + high);
        if share_within(angle, freedom) < confidence {
            low = angle;
        } else {
            high = angle;
        }
    }
    freedom.sqrt() * libm::tan(low)
}

/// Probability that |t| is below √ν tan θ: a finite sum (M. Abramowitz and I. A. Stegun, Handbook of Mathematical
/// Functions (1964), 26.7.3 and 26.7.4).
fn share_within(angle: f64, freedom: f64) -> f64 {
    let (sine, cosine) = libm::sincos(angle);
    let is_odd = freedom % 2.0 == 1.0;
    let [mut term, mut factor] = if is_odd { [cosine, 3.0] } else { [1.0, 2.0] };
    let mut sum = 0.0;
    while factor <= freedom {
        sum += term;
        term *= (factor - 1.0) / factor * cosine * cosine;
        factor += 2.0;
    }
    if is_odd {
        (angle + sine * sum) / FRAC_PI_2
    } else {
        sine * sum
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
pub(super) mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

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
                (student_at(CONFIDENCE, freedom) - expected).abs() < 2e-6,
                "{freedom}: {} for {expected}",
                student_at(CONFIDENCE, freedom)
            );
        }
    }

    #[test]
    fn intervals_of_shares_hold_zero_and_one_where_none_and_all_are_seen() {
        for (units, flag) in (2..200).flat_map(|units| [(units, 0.0), (units, 1.0)]) {
            let flags = Units::of((0..units).map(|seed| (seed, vec![[1.0, flag, 0.0]; 8])));
            let ends = flags
                .estimate(mean)
                .unwrap()
                .share_interval(8.0 * units as f64)
                .unwrap();
            let held = if flag > 0.0 { ends.high } else { ends.low };
            assert_eq!(held, flag, "{units} {ends:?}");
        }
    }

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
                        [1.0, if number % 4 == 0 { half } else { own }, 0.0]
                    });
                    flags.collect::<Vec<_>>()
                };
                let flags = Units::of((0..jobs).map(|seed| (seed, job())));
                let found = flags.estimate(mean).unwrap();
                let count = (jobs * length) as f64;
                let Interval { low, high } = found.share_interval(count).unwrap();
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
            let jobs = (0..).zip(sample);
            let jobs: Vec<(u64, Vec<f64>)> = jobs.collect();
            let vectors = jobs
                .iter()
                .map(|(seed, job)| (*seed, job.iter().map(|&angle| unit(angle)).collect()));
            let vectors = Units::of(vectors);
            let length = vectors.estimate(super::length).unwrap();
            // No direction is near the seam a turn away.
            let (_, direction) = vectors.direction(MEAN + PI, 0.0).unwrap();
            let [real, _] = Numbers::of(&jobs, 0.0).estimates(0.0);
            let holds = |interval: Interval, truth| {
                f64::from(u8::from(interval.low <= truth && truth <= interval.high))
            };
            held[0] += holds(vectors.with_zero(length.interval().unwrap()), resultant);
            held[1] += holds(direction.unwrap(), MEAN);
            held[2] += holds(real.unwrap().interval().unwrap(), MEAN);
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
                // 1000 repetitions give coverage to 0.7 (standard error). Of the widest angles, a direction may be the
                // whole turn.
                let [length, direction, mean] = found;
                let are_near = [length, mean]
                    .iter()
                    .all(|held| (92.0..98.0).contains(held));
                let most = if concentration > 1.0 { 98.0 } else { 100.0 };
                assert!(
                    are_near && (92.0..most).contains(&direction),
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
    fn the_interval_of_the_resultant_length_reaches_zero_for_nineteen_of_twenty_samples_of_uniform_angles()
     {
        for size in SIZES {
            let [length, ..] = coverage(size, 0.0, |draws, length| {
                (0..length).map(|_| TAU * draws.uniform()).collect()
            });
            assert!((92.5..97.5).contains(&length), "{size:?}: {length}");
        }
    }

    #[test]
    fn schusters_p_is_below_a_twentieth_in_one_of_twenty_samples_without_a_direction() {
        const REPETITIONS: u64 = 2000;
        let mut share = |memory: f64| {
            let is_rare = |repetition: &u64| {
                let mut draws = Draws::new(*repetition);
                let mut job = || {
                    let start = TAU * draws.uniform();
                    let steps = draws.autoregressive(memory, 20);
                    // Uniform, as its start is.
                    let angles = steps
                        .iter()
                        .map(|step| unit(start + (1.0 - memory) * 20.0 * step));
                    angles.collect::<Vec<_>>()
                };
                let vectors = Units::of((0..32).map(|seed| (seed, job())));
                vectors.schuster().unwrap() < libm::log10(0.05)
            };
            (0..REPETITIONS).filter(is_rare).count() as f64 / REPETITIONS as f64
        };
        let found = [0.0, 0.9].map(&mut share);
        assert!(
            found.iter().all(|share| (0.03..0.08).contains(share)),
            "{found:?}"
        );
        // Of one direction, the number counts.
        let equal = Units::of((0..8).map(|seed| (seed, vec![unit(0.3); 5])));
        assert!((equal.schuster().unwrap() + 40.0 / LN_10).abs() < 1e-9);
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

    #[test]
    fn what_rounding_leaves_of_equal_values_is_no_deviation() {
        let onsets: Vec<f64> = (0..40)
            .map(|slip| 1000.0 + 0.15 * f64::from(slip))
            .collect();
        let intervals: Vec<f64> = onsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let deviation = |intervals: &[f64], size| {
            let [_, deviation] = Numbers::of(&[(0, intervals.to_vec())], size).estimates(0.0);
            deviation.unwrap().value
        };
        assert!(deviation(&intervals, 0.0) > 0.0 && deviation(&intervals, onsets[39]) == 0.0);
        assert!(deviation(&[0.15, 0.15 + 1e-11], onsets[39]) > 0.0);
    }

    /// How often of 100 the interval of a mean of 0 holds it, for jobs of such values.
    fn covered(jobs: u64, mut values: impl FnMut(&mut Draws) -> Vec<f64>) -> f64 {
        const REPETITIONS: u64 = 2000;
        let mut holds = |repetition| {
            let mut draws = Draws::new(repetition);
            let jobs: Vec<_> = (0..jobs).map(|seed| (seed, values(&mut draws))).collect();
            let [mean, _] = Numbers::of(&jobs, 0.0).estimates(0.0);
            let interval = mean.unwrap().interval().unwrap();
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
            assert!((93.0..99.8).contains(&found), "{jobs} x {length}: {found}");
        }
        assert!(covered(7, differences(20)) > 98.0);
    }

    #[test]
    fn many_jobs_count_as_one_value_each_and_few_are_cut() {
        let mut draws = Draws::new(3);
        let levels: Vec<f64> = (0..50).map(|_| draws.normal()).collect();
        let of = |jobs: Vec<Vec<f64>>| {
            let jobs: Vec<(u64, Vec<f64>)> = (0..).zip(jobs).collect();
            let [mean, _] = Numbers::of(&jobs, 0.0).estimates(0.0);
            mean
        };
        let still = of(levels.iter().map(|&level| vec![level; 10]).collect());
        let once = of(levels.iter().map(|&level| vec![level]).collect());
        let errors = [still, once].map(|mean| mean.unwrap().error().unwrap());
        assert!((errors[0] / errors[1] - 1.0).abs() < 1e-12);
        let units = |lengths: &[usize]| {
            let jobs = lengths
                .iter()
                .map(|&length| (0..length).map(|place| place as f64).collect());
            of(jobs.collect()).map_or(0, |mean| mean.without.len())
        };
        let found = [&[30][..], &[15, 15, 0], &[15, 15, 15], &[2, 1], &[]].map(units);
        assert_eq!(found, [8, 8, 9, 3, 0]);
    }

    #[test]
    fn one_value_has_no_error_and_equal_values_have_none_but_for_what_was_not_seen() {
        let of = |values: &[f64], off| {
            let [mean, _] = Numbers::of(&[(0, values.to_vec())], 0.0).estimates(off);
            let mean = mean.unwrap();
            (mean.value, mean.half_width())
        };
        assert_eq!(of(&[0.3], 0.0), (0.3, None));
        assert_eq!(of(&[0.5; 3], 0.0), (0.5, Some(0.0)));
        assert!((of(&[0.5; 3], 0.2).1.unwrap() - 0.2).abs() < 1e-15);
        assert_eq!(Units::default().estimate(mean), None);
    }

    /// Long and short intervals in turn, of which each job has one long one more than short ones.
    #[test]
    fn where_jobs_begin_and_end_with_the_same_kind_of_interval_the_ends_say_how_far_the_mean_is_off()
     {
        let alternating = |count: u32| {
            let interval = |place: u32| if place.is_multiple_of(2) { 1.1 } else { 0.9 };
            (0..count).map(interval).collect()
        };
        let of = |count| {
            let jobs: Vec<(u64, Vec<f64>)> =
                (0..8).map(|seed| (seed, alternating(count))).collect();
            let numbers = Numbers::of(&jobs, 0.0);
            let [mean, _] = numbers.estimates(0.0);
            (mean.unwrap(), numbers.regularity().unwrap())
        };
        let (odd, regularity) = of(15);
        assert!(regularity < 1e-6 && odd.error().unwrap() < 1e-9);
        assert!((odd.value - 1.0).abs() > 0.005 && odd.interval().unwrap().low < 1.0);
        assert!((of(16).0.value - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_function_of_statistics_has_the_error_of_what_is_left_out_of_all() {
        let mut draws = Draws::new(4);
        let jobs: Vec<(u64, Vec<f64>)> = (0..9)
            .map(|seed| (seed, draws.autoregressive(0.0, 12)))
            .collect();
        let [mean, _] = Numbers::of(&jobs, 0.0).estimates(0.0);
        let mean = mean.unwrap();
        let none = Estimate::function([&mean, &mean.times(2.0)], |[one, two]| two - 2.0 * one);
        assert!(none.value.abs() < 1e-15 && none.error().unwrap() < 1e-15);
        // Of other seeds, errors add by their squares.
        let apart = Estimate::function([&mean, &mean.clone().apart()], |[one, two]| two - one);
        let ratio = apart.error().unwrap() / mean.error().unwrap();
        // Of twice as many units.
        assert!(
            (ratio / (17.0_f64 / 8.0).sqrt() - 1.0).abs() < 1e-9,
            "{ratio}"
        );
        // Three jobs are cut, nine are not: units are the jobs that both have.
        let [few, _] = Numbers::of(&jobs[..3], 0.0).estimates(0.0);
        let both = Estimate::function([&mean, &few.unwrap()], |[all, few]| all - few);
        assert_eq!(both.without.len(), 9);
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

    fn of(angles: &[f64]) -> Units {
        Units::of([(0, angles.iter().map(|&angle| unit(angle)).collect())])
    }

    #[test]
    fn opposite_angles_cancel_and_equal_angles_add() {
        let length_of = |angles: &[f64]| length(of(angles).total());
        let direction = |angles: &[f64], top| of(angles).direction(top, 0.0).unwrap().0.value;
        assert!(length_of(&[0.0, PI]).unwrap() < 1e-15);
        assert!((length_of(&[-3.0; 7]).unwrap() - 1.0).abs() < 1e-15);
        assert!((direction(&[-3.0; 7], PI) + 3.0).abs() < 1e-15);
        assert!((direction(&[-3.0; 7], -4.0) + 3.0 + TAU).abs() < 1e-14);
        assert_eq!(length_of(&[]), None);
        // Mean directions do not jump at the seam.
        let seam = direction(&[PI - 0.1, -PI + 0.1, PI - 0.2, -PI + 0.2], 1.5 * PI);
        assert!((seam - PI).abs() < 1e-14);
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
