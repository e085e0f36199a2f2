//! The shear force between two contact events, as a closed-form function of time: values, extremes and integral of F_S.

use super::harmonic::Harmonic;
use super::polynomial::{self, Extreme};
use crate::value::floored;

/// How F_S runs along a segment.
#[derive(Clone, Copy, Debug)]
pub enum ForcePath<'a> {
    Polynomial(PolynomialPath<'a>),
    /// A ramp with a cosine, in N, with the time since the start.
    Harmonic(Harmonic),
    Grid(GridPath<'a>),
}

/// `Σ c_p s^p` newtons, with s = `first` + (time since the start)/`scale`. s lies in [0, 1].
#[derive(Clone, Copy, Debug)]
pub struct PolynomialPath<'a> {
    /// Coefficients c_p, in N.
    pub coefficients: &'a [f64],
    /// Bound on the second derivative by s over [0, 1], in N.
    pub curvature_bound: f64,
    pub first: f64,
    /// Time per unit of s, in s.
    pub scale: f64,
    /// The shear force at both ends of the segment.
    pub ends: [ForceAt; 2],
}

/// Cubics on a grid of time, from `first` in the first of them on.
#[derive(Clone, Copy, Debug)]
pub struct GridPath<'a> {
    /// The cubics, one a step.
    pub steps: &'a [CubicStep],
    /// Where in the first step the segment starts, from 0 to 1.
    pub first: f64,
    /// Length of a step, in s.
    pub spacing: f64,
    /// Extremes of F_S over all steps but the first and the last.
    pub inner: Extremes,
    /// Lower and upper bound on F_S over all steps, in N.
    pub bounds: [f64; 2],
    /// F_S at the end, in N.
    pub end: f64,
    /// Integral of F_S over the segment by steps, in N.
    pub integral: f64,
}

/// The largest and the least shear force over a number of steps.
#[derive(Clone, Copy, Debug)]
pub struct Extremes {
    pub largest: Extreme,
    pub least: Extreme,
}

impl Default for Extremes {
    fn default() -> Self {
        Self {
            largest: Extreme {
                at: 0.0,
                value: f64::NEG_INFINITY,
            },
            least: Extreme {
                at: 0.0,
                value: f64::INFINITY,
            },
        }
    }
}

impl Extremes {
    #[inline(always)]
    fn include(&mut self, at: f64, value: f64) {
        if value > self.largest.value {
            self.largest = Extreme { at, value };
        }
        if value < self.least.value {
            self.least = Extreme { at, value };
        }
    }

    /// Takes in a whole step, which begins after `begin` steps.
    #[inline(always)]
    pub(super) fn include_step(&mut self, begin: f64, step: &CubicStep) {
        for sign in [1.0, -1.0] {
            let largest = step.maximum(sign, 0.0, 1.0);
            self.include(begin + largest.at, sign * largest.value);
        }
    }
}

/// The shear force over one step of a grid: a cubic, of which the second derivative is linear.
#[derive(Clone, Copy, Debug)]
pub struct CubicStep {
    /// F_S at both ends, in N.
    pub force: [f64; 2],
    /// Its second derivative by steps there, in N.
    pub bend: [f64; 2],
}

impl CubicStep {
    /// Coefficients by s, from 0 to 1, in N.
    #[inline(always)]
    fn coefficients(&self) -> [f64; 4] {
        let [start, end] = self.force;
        let [from, to] = self.bend;
        [
            start,
            (end - start) - (2.0 * from + to) / 6.0,
            0.5 * from,
            (to - from) / 6.0,
        ]
    }

    /// F_S at s, in N.
    #[inline(always)]
    pub(super) fn value(&self, s: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients();
        c0 + s * (c1 + s * (c2 + s * c3))
    }

    /// Where `sign` · F_S has its local maximum; not a number or anywhere if it has none.
    #[inline]
    fn crest(&self, sign: f64) -> f64 {
        let [_, slope, half, cube] = self.coefficients().map(|coefficient| sign * coefficient);
        // The root of slope + 2 half s + 3 cube s² at which it falls, without cancellation.
        let root = (half * half - 3.0 * slope * cube).sqrt();
        if half < 0.0 {
            slope / (root - half)
        } else {
            -(half + root) / (3.0 * cube)
        }
    }

    /// The largest `sign` · F_S between `from` and `to`, in N.
    #[inline]
    fn maximum(&self, sign: f64, from: f64, to: f64) -> Extreme {
        let [c0, c1, c2, c3] = self.coefficients().map(|coefficient| sign * coefficient);
        let force = |s: f64| Extreme {
            at: s,
            value: c0 + s * (c1 + s * (c2 + s * c3)),
        };
        let slope = |s: f64| c1 + s * (2.0 * c2 + s * 3.0 * c3);
        let at_from = force(from);
        let at_to = force(to);
        let at_end = if at_to.value > at_from.value {
            at_to
        } else {
            at_from
        };
        // The second derivative is linear. If it keeps its sign, there is a crest only where the slope changes its own.
        let keeps_sign = (c2 + 3.0 * c3 * from) * (c2 + 3.0 * c3 * to) > 0.0;
        if keeps_sign && !(slope(from) > 0.0 && slope(to) < 0.0) {
            return at_end;
        }
        let crest = self.crest(sign);
        if !(crest > from && crest < to) {
            return at_end;
        }
        let at_crest = force(crest);
        if at_crest.value > at_end.value {
            at_crest
        } else {
            at_end
        }
    }

    /// Integral of F_S by s over the step, in N.
    #[inline(always)]
    pub(super) fn integral(&self) -> f64 {
        0.5 * (self.force[0] + self.force[1]) - (self.bend[0] + self.bend[1]) / 24.0
    }

    /// The same from 0 to s.
    #[inline]
    pub(super) fn integral_to(&self, s: f64) -> f64 {
        let [c0, c1, c2, c3] = self.coefficients();
        s * (c0 + s * (c1 / 2.0 + s * (c2 / 3.0 + s * c3 / 4.0)))
    }

    /// Whether F_S is larger at the end.
    #[inline(always)]
    pub(super) fn rises(&self) -> bool {
        self.force[1] > self.force[0]
    }

    /// Lower and upper bound on F_S, in N.
    #[inline(always)]
    pub(super) fn bounds(&self) -> [f64; 2] {
        let [start, end] = self.force;
        let [from, to] = self.bend;
        let largest = |a: f64, b: f64| if a > b { a } else { b };
        let spread = 0.125 * largest(from.abs(), to.abs());
        [
            -largest(-start, -end) - spread,
            largest(start, end) + spread,
        ]
    }
}

/// A polynomial shear force at some s.
#[derive(Clone, Copy, Debug)]
pub struct ForceAt {
    /// F_S, in N.
    pub force: f64,
    /// Its integral by s from 0 to here, in N.
    pub integral: f64,
}

impl ForceAt {
    /// At s of the polynomial with these coefficients, in N.
    pub(super) fn new(coefficients: &[f64], s: f64) -> Self {
        let (force, integral) = polynomial::value_and_integral(coefficients, s);
        Self { force, integral }
    }
}

/// A stretch of time without a contact event.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// Its first instant, in s.
    pub start: f64,
    /// Its length, in s.
    pub duration: f64,
    /// The shear force along it.
    pub path: ForcePath<'a>,
}

#[cfg(test)]
impl<'a> Segment<'a> {
    /// A segment along a polynomial from s = 0, with s = 1 after `duration` s.
    pub(crate) fn polynomial(start: f64, duration: f64, coefficients: &'a [f64]) -> Self {
        let path = PolynomialPath {
            coefficients,
            curvature_bound: polynomial::second_derivative_bound(coefficients),
            first: 0.0,
            scale: duration,
            ends: [0.0, 1.0].map(|s| ForceAt::new(coefficients, s)),
        };
        Self {
            start,
            duration,
            path: ForcePath::Polynomial(path),
        }
    }
}

impl Segment<'_> {
    /// F_S at its end, in N.
    pub fn end_force(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial(path) => path.ends[1].force,
            ForcePath::Harmonic(harmonic) => harmonic.value(self.duration),
            ForcePath::Grid(path) => path.end,
        }
    }

    /// Its last instant, in s.
    pub fn end(&self) -> f64 {
        self.start + self.duration
    }

    /// F_S in N, at a time in s after the start.
    pub fn force_after(&self, elapsed: f64) -> f64 {
        match self.path {
            ForcePath::Polynomial(path) => path.value(elapsed),
            ForcePath::Harmonic(harmonic) => harmonic.value(elapsed),
            ForcePath::Grid(path) => path.value(elapsed),
        }
    }

    /// The largest F_S in N, at a time in s, if it lies above `floor`.
    pub fn maximum_above(&self, floor: f64) -> Option<Extreme> {
        self.extreme_beyond(floor, 1.0)
    }

    /// The least F_S in N, at a time in s, if it lies below `ceiling`.
    pub fn minimum_below(&self, ceiling: f64) -> Option<Extreme> {
        let mirrored = self.extreme_beyond(-ceiling, -1.0)?;
        Some(Extreme {
            value: -mirrored.value,
            ..mirrored
        })
    }

    /// The largest `sign` · F_S, if it lies above `floor`.
    fn extreme_beyond(&self, floor: f64, sign: f64) -> Option<Extreme> {
        let largest = match self.path {
            ForcePath::Polynomial(path) => path.extreme(self.duration, floor, sign)?,
            ForcePath::Harmonic(harmonic) => harmonic.extreme(self.duration, sign),
            ForcePath::Grid(path) => path.extreme(self.duration, floor, sign)?,
        };
        (largest.value > floor).then_some(Extreme {
            at: self.start + largest.at,
            ..largest
        })
    }

    /// Lower and upper bound on F_S, in N; not the tightest.
    pub fn bounds(&self) -> (f64, f64) {
        match self.path {
            ForcePath::Polynomial(path) => path.bounds(self.duration),
            ForcePath::Harmonic(harmonic) => harmonic.bounds(self.duration),
            ForcePath::Grid(path) => path.bounds.into(),
        }
    }

    /// Times in s and values in N of the local extremes of F_S, in order of time. Of a harmonic segment these are the
    /// first and the last maximum and minimum; those in between lie on lines between them. On a grid its points are
    /// visited as well.
    pub fn for_each_turn(&self, mut visit: impl FnMut(f64, f64)) {
        let visit = |elapsed: f64, force: f64| visit(self.start + elapsed, force);
        match self.path {
            ForcePath::Polynomial(path) => path.for_each_turn(self.duration, visit),
            ForcePath::Harmonic(harmonic) => harmonic.for_each_turn(self.duration, visit),
            ForcePath::Grid(path) => path.for_each_turn(self.duration, visit),
        }
    }

    /// Integral of F_S over the segment, in N s.
    pub fn impulse(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial(PolynomialPath { scale, ends, .. }) => {
                scale * (ends[1].integral - ends[0].integral)
            }
            ForcePath::Harmonic(harmonic) => harmonic.integral(self.duration),
            ForcePath::Grid(path) => path.spacing * path.integral,
        }
    }
}

/// Times are those since the start of the segment, in s, which lasts for `duration` s; forces are in N.
impl PolynomialPath<'_> {
    fn value(&self, elapsed: f64) -> f64 {
        polynomial::value(self.coefficients, self.first + elapsed / self.scale)
    }

    fn bounds(&self, duration: f64) -> (f64, f64) {
        let width = duration / self.scale;
        let spread = 0.125 * self.curvature_bound * width * width;
        let [start, end] = self.ends.map(|end| end.force);
        (start.min(end) - spread, start.max(end) + spread)
    }

    /// Whether the slope keeps its sign over [0, 1], by a bound on how far it changes.
    fn is_monotone(&self) -> bool {
        let (_, slope_spread) = polynomial::beyond_linear(self.coefficients);
        let slope = self.coefficients.get(1).map_or(0.0, |slope| slope.abs());
        slope >= slope_spread
    }

    fn for_each_turn(&self, duration: f64, mut visit: impl FnMut(f64, f64)) {
        if self.is_monotone() {
            return;
        }
        let last = self.first + duration / self.scale;
        polynomial::for_each_turn(self.coefficients, self.first, last, &mut |s| {
            visit(
                (s - self.first) * self.scale,
                polynomial::value(self.coefficients, s),
            );
        });
    }

    /// The largest `sign` · F_S; `None` if a bound shows that it does not exceed `floor`.
    fn extreme(&self, duration: f64, floor: f64, sign: f64) -> Option<Extreme> {
        let [at_first, at_last] = self.ends.map(|at| sign * at.force);
        let width = duration / self.scale;
        let last = self.first + width;
        let mut largest = if at_last > at_first {
            Extreme {
                at: last,
                value: at_last,
            }
        } else {
            Extreme {
                at: self.first,
                value: at_first,
            }
        };
        // The second derivative bounds both how far the ends are exceeded and how much the slope turns.
        if largest.value + 0.125 * self.curvature_bound * width * width <= floor {
            return None;
        }
        let rises_or_falls = (at_last - at_first).abs() >= self.curvature_bound * width * width
            || self.is_monotone();
        if !rises_or_falls {
            let mut signed = [0.0; polynomial::MAX_COEFFICIENTS];
            for (signed, coefficient) in signed.iter_mut().zip(self.coefficients) {
                *signed = sign * coefficient;
            }
            let signed = &signed[..self.coefficients.len()];
            largest = polynomial::maximum(signed, self.first, last);
        }
        Some(Extreme {
            at: (largest.at - self.first) * self.scale,
            ..largest
        })
    }
}

/// Times are those since the start of the segment, in s, which lasts for `duration` s; forces are in N.
impl GridPath<'_> {
    fn value(&self, elapsed: f64) -> f64 {
        let at = self.first + elapsed / self.spacing;
        let step = floored(at).min(self.steps.len() - 1);
        self.steps[step].value(at - step as f64)
    }

    fn for_each_turn(&self, duration: f64, mut visit: impl FnMut(f64, f64)) {
        let count = self.steps.len();
        let last = (self.first + duration / self.spacing - count as f64 + 1.0).min(1.0);
        for (index, cubic) in self.steps.iter().enumerate() {
            let begin = index as f64;
            let from = if index == 0 { self.first } else { 0.0 };
            let to = if index + 1 == count { last } else { 1.0 };
            let mut turns = [1.0, -1.0].map(|sign| cubic.crest(sign));
            turns.sort_by(f64::total_cmp);
            // Where cubics join, their slopes need not have the same sign.
            let joint = (index + 1 < count).then_some(to);
            let inside = turns.into_iter().filter(|s| *s > from && *s < to);
            for s in inside.chain(joint) {
                visit((begin + s - self.first) * self.spacing, cubic.value(s));
            }
        }
    }

    /// The largest `sign` · F_S; `None` if a bound shows that it does not exceed `floor`.
    fn extreme(&self, duration: f64, floor: f64, sign: f64) -> Option<Extreme> {
        let above = |[low, high]: [f64; 2]| if sign > 0.0 { high } else { -low };
        if above(self.bounds) <= floor {
            return None;
        }
        let inner = if sign > 0.0 {
            self.inner.largest
        } else {
            self.inner.least
        };
        let mut largest = Extreme {
            at: inner.at,
            value: sign * inner.value,
        };
        let mut offer = |begin: f64, cubic: &CubicStep, from: f64, to: f64| {
            let least = if largest.value > floor {
                largest.value
            } else {
                floor
            };
            if above(cubic.bounds()) > least {
                let found = cubic.maximum(sign, from, to);
                if found.value > largest.value {
                    largest = Extreme {
                        at: begin + found.at,
                        ..found
                    };
                }
            }
        };
        // The last first, since the force mostly rises.
        let last = self.steps.len() - 1;
        let begin = last as f64;
        let from = if begin > 0.0 { 0.0 } else { self.first };
        let to = (self.first + duration / self.spacing - begin).min(1.0);
        offer(begin, &self.steps[last], from, to);
        if begin > 0.0 {
            offer(0.0, &self.steps[0], self.first, 1.0);
        }
        Some(Extreme {
            at: (largest.at - self.first) * self.spacing,
            ..largest
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Between the turns, in order, the force is monotone, and it stays within its bounds.
    fn assert_turns(segment: &Segment<'_>) {
        let mut turns = vec![segment.start];
        segment.for_each_turn(|time, _| turns.push(time));
        turns.push(segment.end());
        let (low, high) = segment.bounds();
        for pair in turns.windows(2) {
            assert!(pair[0] <= pair[1], "{turns:?}");
            let force = |step: u32| {
                segment.force_after(
                    pair[0] - segment.start + f64::from(step) / 50.0 * (pair[1] - pair[0]),
                )
            };
            let sign = (force(50) - force(0)).signum();
            for step in 0..50 {
                assert!(
                    sign * (force(step + 1) - force(step)) >= -1e-12,
                    "{turns:?}"
                );
                assert!(
                    (low - 1e-12..=high + 1e-12).contains(&force(step)),
                    "{low} {high}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn the_force_turns_nowhere_else(coefficients in prop::collection::vec(-1.0_f64..1.0, 1..14)) {
            assert_turns(&Segment::polynomial(3.0, 0.5, &coefficients));
        }

        /// Of cubics that share their values and second derivatives where they join.
        #[test]
        fn the_force_on_a_grid_turns_nowhere_else(
            points in prop::collection::vec((-1.0_f64..1.0, -1.0_f64..1.0), 2..8), first in 0.0_f64..0.9, s in 0.1_f64..1.0
        ) {
            let steps: Vec<CubicStep> = points
                .windows(2)
                .map(|pair| CubicStep { force: [pair[0].0, pair[1].0], bend: [pair[0].1, pair[1].1] })
                .collect();
            let last = (steps.len() - 1) as f64 + if steps.len() == 1 { first + (1.0 - first) * s } else { s };
            let spacing = 0.25;
            let mut inner = Extremes::default();
            for (begin, step) in steps.iter().enumerate().take(steps.len() - 1).skip(1) {
                inner.include_step(begin as f64, step);
            }
            let whole: f64 = steps[..steps.len() - 1].iter().map(CubicStep::integral).sum();
            let integral = whole + steps[steps.len() - 1].integral_to(last.fract()) - steps[0].integral_to(first);
            let end = steps[steps.len() - 1].value(last - (steps.len() - 1) as f64);
            let bounds = steps.iter().map(CubicStep::bounds).fold([f64::MAX, f64::MIN], |[low, high], step| {
                [low.min(step[0]), high.max(step[1])]
            });
            let path = GridPath { steps: &steps, first, spacing, inner, bounds, end, integral };
            let segment = Segment { start: 3.0, duration: (last - first) * spacing, path: ForcePath::Grid(path) };
            assert_turns(&segment);
            let samples = || (0..=2000).map(|i| segment.force_after(segment.duration * f64::from(i) / 2000.0));
            let highest = samples().fold(f64::MIN, f64::max);
            let lowest = samples().fold(f64::MAX, f64::min);
            let maximum = segment.maximum_above(f64::NEG_INFINITY).unwrap().value;
            let minimum = segment.minimum_below(f64::INFINITY).unwrap().value;
            prop_assert!(maximum >= highest - 1e-12 && maximum < highest + 2e-2, "{} {}", maximum, highest);
            prop_assert!(minimum <= lowest + 1e-12 && minimum > lowest - 2e-2, "{} {}", minimum, lowest);
            prop_assert_eq!(segment.maximum_above(maximum), None);
            let mean = samples().sum::<f64>() / 2001.0;
            prop_assert!((segment.impulse() - mean * segment.duration).abs() < 1e-2 * segment.duration);
        }

        /// With at most two maxima and minima there is no other turn in between.
        #[test]
        fn a_short_swing_turns_nowhere_else(rate in -1.0_f64..1.0, amplitude in -1.0_f64..1.0, phase in 0.0_f64..6.3) {
            let harmonic = Harmonic { start: 0.2, rate, amplitude, phase, angular_frequency: 9.0 };
            assert_turns(&Segment { start: 3.0, duration: 1.3, path: ForcePath::Harmonic(harmonic) });
        }
    }
}
