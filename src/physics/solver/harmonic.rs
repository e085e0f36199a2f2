//! A ramp with a cosine, a + b τ + A cos(ω τ + φ): the drive, the driven motion of a block, and the shear force that
//! follows.

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
    pub(super) fn value_and_slope(&self, elapsed: f64) -> (f64, f64) {
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
    pub(super) fn crests(&self, duration: f64) -> [Option<f64>; 2] {
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

    /// The same multiplied by `sign`.
    pub(super) fn times(&self, sign: f64) -> Self {
        Self {
            start: sign * self.start,
            rate: sign * self.rate,
            amplitude: sign * self.amplitude,
            ..*self
        }
    }
}
