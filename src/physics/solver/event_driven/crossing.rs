//! First crossings: the first instant at which a polynomial, or a ramp with a cosine, reaches a level from below.
//!
//! Contract: no crossing is missed but one that touches the level within rounding, and none is found in the wrong
//! order: an interval is dismissed only if a bound on the excursion excludes the level, or the function falls
//! throughout.

use crate::solver::harmonic::Harmonic;
use crate::solver::polynomial::{
    CUBIC, QUADRATIC, beyond_linear, expanded, halley_step, newton_step, rescaled, rising_root,
    value,
};
use std::f64::consts::{PI, TAU};

/// Halvings after which an interval counts as a point: 2^-40 of a step.
const MAX_HALVINGS: u32 = 40;

/// First s in [`from`, `end`], within [0, 1], at which the polynomial leaves the open interval between two levels. The
/// coefficients are changed.
pub(super) fn first_exit(
    coefficients: &mut [f64],
    [lower, upper]: [f64; 2],
    from: f64,
    end: f64,
) -> Option<f64> {
    let start = coefficients[0];
    let slope = coefficients[1];
    let (value_spread, slope_spread) = beyond_linear(coefficients);
    let mut first = None;
    if start + slope.max(0.0) + value_spread >= upper {
        coefficients[0] = start - upper;
        first = first_reach(coefficients, slope_spread, from, end);
    }
    if start + slope.min(0.0) - value_spread <= lower {
        coefficients[0] = start - lower;
        for coefficient in &mut *coefficients {
            *coefficient = -*coefficient;
        }
        first = first_reach(coefficients, slope_spread, from, first.unwrap_or(end)).or(first);
    }
    first
}

/// First s in [`from`, `end`] at which the polynomial is not below zero. What is beyond its linear term changes the
/// slope by at most `slope_spread`.
fn first_reach(coefficients: &[f64], slope_spread: f64, from: f64, end: f64) -> Option<f64> {
    let [here, slope, half_curvature] = if from > 0.0 {
        expanded(coefficients, from)
    } else {
        [coefficients[0], coefficients[1], coefficients[2]]
    };
    if here >= 0.0 {
        return Some(from);
    }
    if coefficients[1].abs() > slope_spread {
        // Start where the parabola crosses.
        let guess = from
            - 2.0 * here
                / (slope
                    + (slope * slope - 4.0 * here * half_curvature)
                        .max(0.0)
                        .sqrt());
        return if slope > 0.0 {
            rise(coefficients, from, end, guess)
        } else {
            None
        };
    }
    first_in(coefficients, from, end, MAX_HALVINGS)
}

fn first_in(coefficients: &[f64], low: f64, high: f64, depth: u32) -> Option<f64> {
    let middle = 0.5 * (low + high);
    let half = 0.5 * (high - low);
    let about = &rescaled(coefficients, low, high)[..coefficients.len()];
    let (value_spread, slope_spread) = beyond_linear(about);
    let slope = about[1];
    if about[0] + slope.abs() + value_spread < 0.0 {
        return None;
    }
    if slope.abs() > slope_spread {
        // It may start at or above the level only if the interval before ended there.
        if value(about, -1.0) >= 0.0 {
            return Some(low);
        }
        let root = if slope > 0.0 {
            rise(about, -1.0, 1.0, -about[0] / slope)
        } else {
            None
        };
        return root.map(|r| (middle + half * r).clamp(low, high));
    }
    if depth == 0 {
        return (about[0] >= 0.0).then_some(middle);
    }
    first_in(coefficients, low, middle, depth - 1)
        .or_else(|| first_in(coefficients, middle, high, depth - 1))
}

/// The root of a polynomial that rises from below zero throughout [low, high], sought from `first`; `None` if it stays
/// below.
fn rise(coefficients: &[f64], low: f64, high: f64, first: f64) -> Option<f64> {
    (value(coefficients, high) >= 0.0)
        .then(|| rising_root(low, high, first, CUBIC, |s| halley_step(coefficients, s)))
}

impl Harmonic {
    /// First instant at or after `from` at which the motion is not below `level`; infinite if never.
    pub(super) fn first_rise_to(&self, level: f64, from: f64) -> f64 {
        if self.value(from) >= level {
            return from;
        }
        if self.amplitude == 0.0 {
            return if self.rate > 0.0 {
                ((level - self.start) / self.rate).max(from)
            } else {
                f64::INFINITY
            };
        }
        let newton = |low: f64, high: f64| {
            rising_root(low, high, high, QUADRATIC, |elapsed| {
                let (height, slope) = self.value_and_slope(elapsed);
                newton_step(elapsed, height - level, slope)
            })
        };
        let speed = self.amplitude * self.angular_frequency;
        if speed <= self.rate {
            let latest = (level - self.start + self.amplitude) / self.rate;
            return newton(from, latest.max(from) * (1.0 + f64::EPSILON));
        }
        // Maxima lie at ψ = asin(p1/Aω) mod 2π and grow by p1 T from one to the next.
        let crest = libm::asin(self.rate / speed);
        let period = TAU / self.angular_frequency;
        let behind = (crest - self.angle(from)).rem_euclid(TAU);
        let first = from + behind / self.angular_frequency;
        let short = level - self.value(first);
        let skipped = if short <= 0.0 {
            0.0
        } else if self.rate > 0.0 {
            (short / (self.rate * period)).ceil()
        } else {
            return f64::INFINITY;
        };
        let high = first + skipped * period;
        // The branch that rises to a maximum begins at the minimum before it: π + 2 asin(p1/Aω) earlier in phase.
        let low = (high - (PI + 2.0 * crest) / self.angular_frequency).max(from);
        if self.value(high) < level {
            high
        } else {
            newton(low, high)
        }
    }

    /// First instant at or after `from` at which the motion is not above `level`; infinite if never. Minima grow too,
    /// so it lies within the first period.
    pub(super) fn first_fall_to(&self, level: f64, from: f64) -> f64 {
        if self.value(from) <= level {
            return from;
        }
        let speed = self.amplitude * self.angular_frequency;
        if speed <= self.rate {
            return f64::INFINITY;
        }
        let trough = PI - libm::asin(self.rate / speed);
        let behind = (trough - self.angle(from)).rem_euclid(TAU);
        let low = from + behind / self.angular_frequency;
        if self.value(low) > level {
            return f64::INFINITY;
        }
        // Before the trough the motion falls, from the crest or from the start.
        let crest = low - (PI - 2.0 * (PI - trough)) / self.angular_frequency;
        let high = crest.max(from);
        rising_root(high, low, low, QUADRATIC, |elapsed| {
            let (height, slope) = self.value_and_slope(elapsed);
            newton_step(elapsed, level - height, -slope)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_bump_that_just_reaches_the_level_is_not_missed() {
        // -(s - 0.3)² + 1e-10: above zero for 2e-5 of the step only.
        let coefficients = [-0.09 + 1e-10, 0.6, -1.0];
        let reached = first_exit(
            &mut coefficients.clone(),
            [f64::NEG_INFINITY, 0.0],
            0.0,
            1.0,
        )
        .unwrap();
        assert!((reached - (0.3 - 1e-5)).abs() < 1e-9, "{reached}");
        assert_eq!(
            first_exit(
                &mut [-0.09 - 1e-10, 0.6, -1.0],
                [f64::NEG_INFINITY, 0.0],
                0.0,
                1.0
            ),
            None
        );
        // The same from above, past its foot.
        let reached = first_exit(
            &mut coefficients.map(|c| -c),
            [0.0, f64::INFINITY],
            0.2,
            1.0,
        )
        .unwrap();
        assert!((reached - (0.3 - 1e-5)).abs() < 1e-9, "{reached}");
    }

    proptest! {
        #[test]
        fn the_first_crossing_of_a_polynomial_is_the_first(
            coefficients in prop::collection::vec(-1.0_f64..1.0, 2..14),
            from in 0.0_f64..0.5,
            length in 0.05_f64..0.5,
            levels in (0.001_f64..1.0, 0.001_f64..1.0),
        ) {
            let start = value(&coefficients, from);
            let lower = start - levels.0;
            let upper = start + levels.1;
            let found = first_exit(&mut coefficients.clone(), [lower, upper], from, from + length);
            let until = found.unwrap_or(from + length);
            for i in 0..400 {
                let s = from + (until - from) * (1.0 - 1e-9) * f64::from(i) / 400.0;
                let here = value(&coefficients, s);
                prop_assert!(here < upper + 1e-12 && here > lower - 1e-12, "missed at {}", s);
            }
            if let Some(s) = found {
                let here = value(&coefficients, s);
                prop_assert!((here - upper).abs().min((here - lower).abs()) < 1e-12);
            }
        }

        #[test]
        fn the_first_rise_and_fall_of_a_driven_block_are_the_first(
            start in -1.0_f64..1.0, rate in 0.001_f64..2.0, amplitude in 0.0_f64..1.5, phase in -7.0_f64..7.0,
            level in 0.0_f64..4.0, from in 0.0_f64..9.0
        ) {
            let driven = Harmonic { start, rate, amplitude, phase, angular_frequency: 2.5 };
            let rise = driven.first_rise_to(level, from);
            prop_assert!(rise >= from);
            let fall = driven.first_fall_to(-level, from);
            for i in 1..2000 {
                let elapsed = from + (rise - from).min(50.0) * f64::from(i) / 2001.0;
                prop_assert!(rise == from || driven.value(elapsed) < level + 1e-9, "rise missed at {}", elapsed);
                let elapsed = from + (fall - from).min(50.0) * f64::from(i) / 2001.0;
                prop_assert!(fall == from || driven.value(elapsed) > -level - 1e-9, "fall missed at {}", elapsed);
            }
            if rise > from {
                prop_assert!((driven.value(rise) - level).abs() < 1e-9);
            }
            if fall.is_finite() && fall > from {
                prop_assert!((driven.value(fall) + level).abs() < 1e-9);
            }
        }
    }
}
