//! The shear force between two contact events, as a closed-form function of time: values, extremes and integral of F_S.

use super::polynomial;
use std::f64::consts::{PI, TAU};

/// How F_S runs along a segment.
#[derive(Clone, Copy, Debug)]
pub enum ForcePath<'a> {
    /// `Σ c_p s^p` newtons, with s = `first` + (time since the start)/`scale`. s lies in [0, 1].
    Polynomial {
        /// Coefficients c_p, in N.
        coefficients: &'a [f64],
        /// Bound on the second derivative by s over [0, 1], in N.
        bend: f64,
        /// Where the segment starts.
        first: f64,
        /// Time that s = 1 stands for, in s.
        scale: f64,
        /// The shear force at both ends of the segment.
        ends: [ForceAt; 2],
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
        let bend = polynomial::second_derivative_bound(coefficients);
        Self { start, duration, path: ForcePath::Polynomial { coefficients, bend, first: 0.0, scale: duration, ends } }
    }
}

impl Segment<'_> {
    /// F_S at its end, in N.
    pub fn end_force(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial { ends: [_, end], .. } => end.force,
            ForcePath::Harmonic { .. } => self.force_after(self.duration),
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
            ForcePath::Polynomial { scale, ends: [start, end], .. } => scale * (end.integral - start.integral),
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
            ForcePath::Polynomial { coefficients, bend, first, scale, ends } => {
                let [at_first, at_last] = ends.map(|at| sign * at.force);
                let width = self.duration / scale;
                let last = first + width;
                let (s, extreme) = if at_last > at_first { (last, at_last) } else { (first, at_first) };
                // The second derivative bounds both how far the ends are exceeded and how much the slope turns.
                if extreme + 0.125 * bend * width * width <= floor {
                    return None;
                }
                let is_monotone = (at_last - at_first).abs() >= bend * width * width || {
                    let (_, slope_varies) = polynomial::beyond_linear(coefficients);
                    coefficients.get(1).map_or(0.0, |c| c.abs()) >= slope_varies
                };
                let (s, extreme) = if is_monotone {
                    (s, extreme)
                } else {
                    let mut signed = [0.0; polynomial::MOST_COEFFICIENTS];
                    for (s, c) in signed.iter_mut().zip(coefficients) {
                        *s = sign * c;
                    }
                    polynomial::maximum(&signed[..coefficients.len()], first, last)
                };
                ((s - first) * scale, extreme)
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
