//! The shear force between two contact events, as a closed-form function of time: values, extremes and integral of F_S.

use super::polynomial;
use std::f64::consts::{PI, TAU};

/// How F_S runs along a segment.
#[derive(Clone, Copy, Debug)]
pub enum ForcePath<'a> {
    /// `Σ c_p s^p` newtons, with s = (time since the start)/`scale`.
    Polynomial {
        /// Coefficients c_p, in N.
        coefficients: &'a [f64],
        /// Time that s = 1 stands for, in s.
        scale: f64,
    },
    /// `start` + `rate` τ + `amplitude` cos(`angular_frequency` τ + `phase`), with the time τ since the start.
    Harmonic {
        /// Ramp at the start, in N.
        start: f64,
        /// Rate of the ramp, in N/s.
        rate: f64,
        /// Amplitude of the cosine, in N.
        amplitude: f64,
        /// Its phase at the start, in rad.
        phase: f64,
        /// Its angular frequency, in rad/s.
        angular_frequency: f64,
    },
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

impl Segment<'_> {
    /// Its last instant, in s.
    pub fn end(&self) -> f64 {
        self.start + self.duration
    }

    /// F_S in N, at a time in s after the start.
    pub fn force_after(&self, elapsed: f64) -> f64 {
        match self.path {
            ForcePath::Polynomial { coefficients, scale } => polynomial::value(coefficients, elapsed / scale),
            ForcePath::Harmonic { start, rate, amplitude, phase, angular_frequency } => {
                let ramp = start + rate * elapsed;
                if amplitude == 0.0 {
                    ramp
                } else {
                    let turns = (elapsed * angular_frequency / TAU).fract();
                    ramp + amplitude * libm::cos(TAU * turns + phase)
                }
            }
        }
    }

    /// Time in s and value in N of the largest F_S, if it lies above `floor`.
    pub fn maximum_above(&self, floor: f64) -> Option<(f64, f64)> {
        self.extreme_beyond(floor, 1.0)
    }

    /// Time in s and value in N of the least F_S, if it lies below `ceiling`.
    pub fn minimum_below(&self, ceiling: f64) -> Option<(f64, f64)> {
        let (time, mirrored) = self.extreme_beyond(-ceiling, -1.0)?;
        Some((time, -mirrored))
    }

    /// Integral of F_S over the segment, in N s.
    pub fn impulse(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial { coefficients, scale } => {
                scale * polynomial::integral(coefficients, self.duration / scale)
            }
            ForcePath::Harmonic { start, rate, amplitude, phase, angular_frequency } => {
                let ramp = self.duration * (start + 0.5 * rate * self.duration);
                if amplitude == 0.0 {
                    return ramp;
                }
                let turns = (self.duration * angular_frequency / TAU).fract();
                let swing = libm::sin(TAU * turns + phase) - libm::sin(phase);
                ramp + amplitude / angular_frequency * swing
            }
        }
    }

    /// The largest `sign` · F_S and its time, if it lies above `floor`.
    fn extreme_beyond(&self, floor: f64, sign: f64) -> Option<(f64, f64)> {
        let (elapsed, extreme) = match self.path {
            ForcePath::Polynomial { coefficients, scale } => {
                let (first, end) = (sign * coefficients[0], self.duration / scale);
                if end <= 1.0 {
                    // The common cases in one pass: nothing reaches so far, or an end is the extreme.
                    let (strays, slope_varies) = polynomial::beyond_linear(coefficients);
                    let slope = coefficients.get(1).map_or(0.0, |c| sign * c);
                    if first + slope.max(0.0) + strays <= floor {
                        return None;
                    }
                    if slope.abs() >= slope_varies {
                        let last = sign * polynomial::value(coefficients, end);
                        let (s, extreme) = if last > first { (end, last) } else { (0.0, first) };
                        return (extreme > floor).then_some((self.start + s * scale, extreme));
                    }
                }
                let mut signed = [0.0; polynomial::MOST_COEFFICIENTS];
                for (s, c) in signed.iter_mut().zip(coefficients) {
                    *s = sign * c;
                }
                let (s, extreme) = polynomial::maximum(&signed[..coefficients.len()], end);
                (s * scale, extreme)
            }
            ForcePath::Harmonic { rate, amplitude, phase, angular_frequency, .. } => {
                let turns = harmonic_crests(sign * rate, sign * amplitude, phase, angular_frequency, self.duration);
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

/// First and last local maximum of r τ + A cos(ω τ + φ) in [0, `duration`], if any: the largest is one of the two.
fn harmonic_crests(rate: f64, amplitude: f64, phase: f64, angular_frequency: f64, duration: f64) -> [Option<f64>; 2] {
    let speed = amplitude.abs() * angular_frequency;
    if speed <= rate.abs() {
        return [None; 2];
    }
    // With A < 0 the cosine is shifted by half a turn.
    let shift = if amplitude < 0.0 { phase + PI } else { phase };
    let crest = libm::asin(rate / speed);
    let period = TAU / angular_frequency;
    let first = (crest - shift).rem_euclid(TAU) / angular_frequency;
    if first > duration {
        return [None; 2];
    }
    let last = first + ((duration - first) / period).floor() * period;
    [Some(first), Some(last)]
}
