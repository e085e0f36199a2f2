//! The shear force between two contact events, as a closed-form function of time: values, extremes and integral of F_S.

use super::harmonic::Harmonic;
use super::polynomial;

/// How F_S runs along a segment.
#[derive(Clone, Copy, Debug)]
pub enum ForcePath<'a> {
    /// `Σ c_p s^p` newtons, with s = `first` + (time since the start)/`scale`. s lies in [0, 1].
    Polynomial {
        /// Coefficients c_p, in N.
        coefficients: &'a [f64],
        /// Bound on the second derivative by s over [0, 1], in N.
        curvature_bound: f64,
        /// Where the segment starts.
        first: f64,
        /// Time per unit of s, in s.
        scale: f64,
        /// The shear force at both ends of the segment.
        ends: [ForceAt; 2],
    },
    /// A ramp with a cosine, in N, with the time since the start.
    Harmonic(Harmonic),
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

impl<'a> Segment<'a> {
    /// A segment along a polynomial from s = 0, with s = 1 after `duration` s.
    pub fn polynomial(start: f64, duration: f64, coefficients: &'a [f64]) -> Self {
        let ends = [0.0, 1.0].map(|s| ForceAt::new(coefficients, s));
        let curvature_bound = polynomial::second_derivative_bound(coefficients);
        Self {
            start,
            duration,
            path: ForcePath::Polynomial { coefficients, curvature_bound, first: 0.0, scale: duration, ends },
        }
    }
}

impl Segment<'_> {
    /// F_S at its end, in N.
    pub fn end_force(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial { ends: [_, end], .. } => end.force,
            ForcePath::Harmonic(harmonic) => harmonic.value(self.duration),
        }
    }

    /// Its last instant, in s.
    pub fn end(&self) -> f64 {
        self.start + self.duration
    }

    /// F_S in N, at a time in s after the start.
    pub fn force_after(&self, elapsed: f64) -> f64 {
        match self.path {
            ForcePath::Polynomial { coefficients, first, scale, .. } => {
                polynomial::value(coefficients, first + elapsed / scale)
            }
            ForcePath::Harmonic(harmonic) => harmonic.value(elapsed),
        }
    }

    /// Time in s and value in N of the largest F_S, if it lies above `floor`.
    pub fn maximum_above(&self, floor: f64) -> Option<(f64, f64)> {
        self.extreme_beyond(floor, 1.0)
    }

    /// Time in s and value in N of the smallest F_S, if it lies below `ceiling`.
    pub fn minimum_below(&self, ceiling: f64) -> Option<(f64, f64)> {
        let (time, mirrored) = self.extreme_beyond(-ceiling, -1.0)?;
        Some((time, -mirrored))
    }

    /// Lower and upper bound on F_S, in N; not the tightest.
    pub fn bounds(&self) -> (f64, f64) {
        match self.path {
            ForcePath::Polynomial { curvature_bound, scale, ends, .. } => {
                let width = self.duration / scale;
                let spread = 0.125 * curvature_bound * width * width;
                let [start, end] = ends.map(|end| end.force);
                (start.min(end) - spread, start.max(end) + spread)
            }
            ForcePath::Harmonic(Harmonic { start, rate, amplitude, .. }) => {
                let end = start + rate * self.duration;
                (start.min(end) - amplitude.abs(), start.max(end) + amplitude.abs())
            }
        }
    }

    /// Times in s and values in N of the local extremes of F_S, in order of time. Of a harmonic segment these are the
    /// first and the last maximum and minimum; those in between lie on lines between them.
    pub fn for_each_turn(&self, mut visit: impl FnMut(f64, f64)) {
        match self.path {
            ForcePath::Polynomial { coefficients, first, scale, .. } => {
                let last = first + self.duration / scale;
                let (_, slope_spread) = polynomial::beyond_linear(coefficients);
                if coefficients.get(1).is_none_or(|slope| slope.abs() >= slope_spread) {
                    return;
                }
                polynomial::for_each_turn(coefficients, first, last, &mut |s| {
                    visit(self.start + (s - first) * scale, polynomial::value(coefficients, s));
                });
            }
            ForcePath::Harmonic(harmonic) => {
                let crests = |sign: f64| harmonic.times(sign).crests(self.duration);
                let mut turns: Vec<f64> = [crests(1.0), crests(-1.0)].concat().into_iter().flatten().collect();
                turns.sort_by(f64::total_cmp);
                for elapsed in turns {
                    visit(self.start + elapsed, self.force_after(elapsed));
                }
            }
        }
    }

    /// Integral of F_S over the segment, in N s.
    pub fn impulse(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial { scale, ends: [start, end], .. } => scale * (end.integral - start.integral),
            ForcePath::Harmonic(harmonic) => harmonic.integral(self.duration),
        }
    }

    /// The largest `sign` · F_S and its time, if it lies above `floor`.
    fn extreme_beyond(&self, floor: f64, sign: f64) -> Option<(f64, f64)> {
        let (elapsed, extreme) = match self.path {
            ForcePath::Polynomial { coefficients, curvature_bound, first, scale, ends } => {
                let [at_first, at_last] = ends.map(|at| sign * at.force);
                let width = self.duration / scale;
                let last = first + width;
                let (s, extreme) = if at_last > at_first { (last, at_last) } else { (first, at_first) };
                // The second derivative bounds both how far the ends are exceeded and how much the slope turns.
                if extreme + 0.125 * curvature_bound * width * width <= floor {
                    return None;
                }
                let is_monotone = (at_last - at_first).abs() >= curvature_bound * width * width || {
                    let (_, slope_spread) = polynomial::beyond_linear(coefficients);
                    coefficients.get(1).map_or(0.0, |c| c.abs()) >= slope_spread
                };
                let (s, extreme) = if is_monotone {
                    (s, extreme)
                } else {
                    let mut signed = [0.0; polynomial::MAX_COEFFICIENTS];
                    for (s, c) in signed.iter_mut().zip(coefficients) {
                        *s = sign * c;
                    }
                    polynomial::maximum(&signed[..coefficients.len()], first, last)
                };
                ((s - first) * scale, extreme)
            }
            ForcePath::Harmonic(harmonic) => {
                let turns = harmonic.times(sign).crests(self.duration);
                [Some(0.0), Some(self.duration)].into_iter().chain(turns).flatten().fold(
                    (0.0, f64::NEG_INFINITY),
                    |best: (f64, f64), elapsed| {
                        let value = sign * self.force_after(elapsed);
                        if value > best.1 { (elapsed, value) } else { best }
                    },
                )
            }
        };
        (extreme > floor).then_some((self.start + elapsed, extreme))
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
            let force =
                |step: u32| segment.force_after(pair[0] - segment.start + f64::from(step) / 50.0 * (pair[1] - pair[0]));
            let sign = (force(50) - force(0)).signum();
            for step in 0..50 {
                assert!(sign * (force(step + 1) - force(step)) >= -1e-12, "{turns:?}");
                assert!((low - 1e-12..=high + 1e-12).contains(&force(step)), "{low} {high}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_force_turns_nowhere_else(coefficients in prop::collection::vec(-1.0_f64..1.0, 1..14)) {
            assert_turns(&Segment::polynomial(3.0, 0.5, &coefficients));
        }

        /// With at most two maxima and minima there is no other turn in between.
        #[test]
        fn a_short_swing_turns_nowhere_else(rate in -1.0_f64..1.0, amplitude in -1.0_f64..1.0, phase in 0.0_f64..6.3) {
            let harmonic = Harmonic { start: 0.2, rate, amplitude, phase, angular_frequency: 9.0 };
            assert_turns(&Segment { start: 3.0, duration: 1.3, path: ForcePath::Harmonic(harmonic) });
        }
    }
}
