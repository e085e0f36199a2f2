//! A ramp with a cosine, a + b τ + A cos(ω τ + φ): the drive, the driven motion of a block, and the shear force that
//! follows; values, integral, extremes, and first crossings of a level.

use super::polynomial::{Extreme, QUADRATIC, newton_step, rising_root};
use std::f64::consts::{PI, TAU};

/// `start` + `rate` τ + `amplitude` cos(`angular_frequency` τ + `phase`), with the time τ in s since some instant. In N
/// for a force, in m for a displacement.
#[derive(Clone, Copy, Debug)]
pub struct Harmonic {
    /// Ramp at τ = 0, in N or m.
    pub start: f64,
    /// Rate of the ramp, in N/s or m/s.
    pub rate: f64,
    /// Amplitude of the cosine, in N or m.
    pub amplitude: f64,
    /// Its phase at τ = 0, in rad.
    pub phase: f64,
    /// Its angular frequency, in rad/s.
    pub angular_frequency: f64,
}

impl Harmonic {
    pub fn value(&self, elapsed: f64) -> f64 {
        let ramp = self.start + self.rate * elapsed;
        if self.amplitude == 0.0 {
            ramp
        } else {
            ramp + self.amplitude * libm::cos(self.angle(elapsed))
        }
    }

    /// Value and slope after `elapsed` s.
    fn value_and_slope(&self, elapsed: f64) -> (f64, f64) {
        let (sine, cosine) = libm::sincos(self.angle(elapsed));
        let ramp = self.start + self.rate * elapsed;
        (
            ramp + self.amplitude * cosine,
            self.rate - self.amplitude * self.angular_frequency * sine,
        )
    }

    /// Argument of the cosine after `elapsed` s, in rad.
    pub(super) fn angle(&self, elapsed: f64) -> f64 {
        self.turn(elapsed) + self.phase
    }

    /// Increase of the argument in `elapsed` s, in rad. Whole periods are taken off first, so that long times lose
    /// no digits of the phase.
    pub(super) fn turn(&self, elapsed: f64) -> f64 {
        TAU * (elapsed * self.angular_frequency / TAU).fract()
    }

    /// Integral over the first `duration` s.
    pub(super) fn integral(&self, duration: f64) -> f64 {
        let ramp = duration * (self.start + 0.5 * self.rate * duration);
        if self.amplitude == 0.0 {
            return ramp;
        }
        let swing = libm::sin(self.angle(duration)) - libm::sin(self.phase);
        ramp + self.amplitude / self.angular_frequency * swing
    }

    /// First and last local maximum in [0, `duration`], if any: the largest is one of the two.
    fn crests(&self, duration: f64) -> [Option<f64>; 2] {
        let speed = self.amplitude.abs() * self.angular_frequency;
        if speed <= self.rate.abs() {
            return [None; 2];
        }
        // With A < 0 the cosine is shifted by half a turn.
        let shift = if self.amplitude < 0.0 {
            self.phase + PI
        } else {
            self.phase
        };
        let crest = libm::asin(self.rate / speed);
        let period = TAU / self.angular_frequency;
        let first = (crest - shift).rem_euclid(TAU) / self.angular_frequency;
        if first > duration {
            return [None; 2];
        }
        let last = first + ((duration - first) / period).floor() * period;
        [Some(first), Some(last)]
    }

    /// Lower and upper bound over the first `duration` s.
    pub(super) fn bounds(&self, duration: f64) -> (f64, f64) {
        let end = self.start + self.rate * duration;
        let swing = self.amplitude.abs();
        (self.start.min(end) - swing, self.start.max(end) + swing)
    }

    /// Visits time and value of the first and the last maximum and minimum in [0, `duration`], in order of time.
    pub(super) fn for_each_turn(&self, duration: f64, mut visit: impl FnMut(f64, f64)) {
        let crests = |sign: f64| self.times(sign).crests(duration);
        let all = [crests(1.0), crests(-1.0)].concat();
        let mut turns: Vec<f64> = all.into_iter().flatten().collect();
        turns.sort_by(f64::total_cmp);
        for elapsed in turns {
            visit(elapsed, self.value(elapsed));
        }
    }

    /// The largest `sign` · value in [0, `duration`].
    pub(super) fn extreme(&self, duration: f64, sign: f64) -> Extreme {
        let mut best = Extreme {
            at: 0.0,
            value: f64::NEG_INFINITY,
        };
        let ends = [Some(0.0), Some(duration)];
        let turns = self.times(sign).crests(duration);
        for elapsed in ends.into_iter().chain(turns).flatten() {
            let value = sign * self.value(elapsed);
            if value > best.value {
                best = Extreme { at: elapsed, value };
            }
        }
        best
    }

    /// The same multiplied by `sign`.
    pub(super) fn times(&self, sign: f64) -> Self {
        Self {
            start: sign * self.start,
            rate: sign * self.rate,
            amplitude: sign * self.amplitude,
            ..*self
        }
    }

    /// First instant at or after `from` at which the motion is not below `level`; infinite if never. Neither rate nor
    /// amplitude is negative.
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
        // Maxima lie at the angle asin(b/Aω) mod 2π and grow by 2π b/ω from one to the next.
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
        // The branch that rises to a maximum begins at the minimum before it: π + 2 asin(b/Aω) earlier.
        let low = (high - (PI + 2.0 * crest) / self.angular_frequency).max(from);
        if self.value(high) < level {
            high
        } else {
            newton(low, high)
        }
    }

    /// First instant at or after `from` at which the motion is not above `level`; infinite if never. Minima grow too,
    /// so it lies within the first period. Neither rate nor amplitude is negative.
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

    fn assert_first(driven: Harmonic, level: f64, from: f64) {
        let rise = driven.first_rise_to(level, from);
        assert!(rise >= from);
        let fall = driven.first_fall_to(-level, from);
        for i in 1..2000 {
            let value_at =
                |end: f64| driven.value(from + (end - from).min(50.0) * f64::from(i) / 2001.0);
            assert!(
                rise == from || value_at(rise) < level + 1e-9,
                "rise missed: {driven:?}"
            );
            assert!(
                fall == from || value_at(fall) > -level - 1e-9,
                "fall missed: {driven:?}"
            );
        }
        if rise > from {
            assert!((driven.value(rise) - level).abs() < 1e-9);
        }
        if fall.is_finite() && fall > from {
            assert!((driven.value(fall) + level).abs() < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn the_first_rise_and_fall_of_a_driven_block_are_the_first(
            start in -1.0_f64..1.0, rate in 0.001_f64..2.0, amplitude in 0.0_f64..1.5, phase in -7.0_f64..7.0,
            level in 0.0_f64..4.0, from in 0.0_f64..9.0
        ) {
            assert_first(Harmonic { start, rate, amplitude, phase, angular_frequency: 2.5 }, level, from);
        }
    }

    #[test]
    fn a_level_passed_long_ago_is_reached_at_once() {
        let ramp = Harmonic {
            start: 0.0,
            rate: 1.860_662_955_836_161_1,
            amplitude: 0.0,
            phase: 0.0,
            angular_frequency: 2.5,
        };
        assert_first(ramp, 0.0, 5.359_564_334_310_364);
    }
}
