//! The first pass over a trace.
//!
//! - Noise: the median size of a difference of the force in which loading and modulation vanish.
//! - Stiffness of the loading: the median slope of the force against the drive, over the shortest of [`SLOPES`] that the
//!   noise allows.
//! - Whether the force was cut off: at its largest value, at least twice as many samples in a row are equal as elsewhere,
//!   and at least [`CLIPPED`].
//!
//! Medians ignore slips, which take up few samples.

use super::{Pass, Samples, TraceDrive};
use crate::model::Drive;
use std::f64::consts::TAU;

/// Distances in samples over which slopes are taken. The shortest over which the force rises by `RISE` times the noise
/// gives the stiffness, else the longest with a slope.
const SLOPES: [usize; 3] = [1, 4, 16];
const RISE: f64 = 2.0;
/// Part of the mean velocity that the drive needs for a slope to count: where a modulated drive is slower, the rise is
/// less and the noise counts more. Below 1, since sampling times are rounded.
const STEADY: f64 = 0.999;
/// Equal samples in a row at the largest force that show that it was cut off there, if they are at least twice as many
/// as at any other force.
const CLIPPED: u64 = 3;

/// Counts of numbers in classes 1.6 % wide, for a median in constant memory; those below 0 are one class.
#[derive(Clone, Debug)]
struct Histogram(Vec<u64>);

impl Histogram {
    /// Bits of a number that are below its class.
    const BELOW: u32 = 46;

    fn push(&mut self, number: f64) {
        self.0[(number.max(0.0).to_bits() >> Self::BELOW) as usize] += 1;
    }

    /// `None` without numbers.
    fn median(&self) -> Option<f64> {
        let mut counted = 0;
        let half = self.0.iter().sum::<u64>().div_ceil(2);
        let is_reached = |count: &u64| {
            counted += count;
            counted > 0 && counted >= half
        };
        let class = self.0.iter().position(is_reached)? as u64;
        Some(f64::from_bits(
            (class << Self::BELOW) | (1 << (Self::BELOW - 1)),
        ))
    }
}

impl Default for Histogram {
    fn default() -> Self {
        Self(vec![0; 1 << (64 - Self::BELOW)])
    }
}

/// The noise of a trace and the stiffness of its loading.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// Of the drive, in m/s.
    velocity: f64,
    noise: Histogram,
    stiffness: [Histogram; SLOPES.len()],
    /// Range of the force.
    pub low: f64,
    pub high: f64,
    pub samples: u64,
    /// Duration of all runs, in s.
    pub seconds: f64,
    /// The samples of the present piece, after the last ones of the piece before.
    times: Vec<f64>,
    driven: Vec<f64>,
    forces: Vec<f64>,
    /// Equal samples in a row up to the present one.
    equal: u64,
    /// Most of them at the largest force so far.
    at_high: u64,
    /// Most of them at any other force.
    elsewhere: u64,
}

impl Survey {
    /// The standard deviation of the noise, if it is Gaussian: 1.4826 times the median size of the difference that
    /// `weights` makes, which keep it. 0 where it is no more than rounding.
    pub fn noise(&self) -> f64 {
        let noise = 1.4826 * self.noise.median().unwrap_or(0.0);
        let rounding = f64::EPSILON * self.low.abs().max(self.high.abs());
        if noise > rounding { noise } else { 0.0 }
    }

    /// The slope of the loading parts over the velocity of the drive, in N/m; 0 without slopes.
    pub fn stiffness(&self) -> f64 {
        let distance = self.velocity * self.seconds / self.samples as f64;
        let noise = self.noise();
        let mut stiffness = 0.0;
        for (length, slopes) in SLOPES.into_iter().zip(&self.stiffness) {
            let Some(slope) = slopes.median() else {
                break;
            };
            stiffness = slope;
            if slope * distance * length as f64 > RISE * noise {
                break;
            }
        }
        stiffness
    }

    /// Equal samples in a row at the largest force, if it was cut off there.
    pub fn clipped(&self) -> Option<u64> {
        let is_clipped = self.at_high >= CLIPPED.max(2 * self.elsewhere);
        is_clipped.then_some(self.at_high)
    }

    /// Weights of five samples in a row, `step` s apart, for a difference in which a ramp vanishes, and so does a sine of
    /// the period of the modulation, if there is one. Their squares add up to 1, so that it has the standard deviation
    /// of the noise.
    fn weights(drive: &Drive, step: f64) -> [f64; 5] {
        if drive.period == 0.0 {
            return [0.0, 1.0, -2.0, 1.0, 0.0].map(|weight| weight / 6.0_f64.sqrt());
        }
        let twice = 2.0 * libm::cos(TAU * step / drive.period);
        let side = -2.0 - twice;
        let middle = 2.0 + 2.0 * twice;
        let weights = [1.0, side, middle, side, 1.0];
        let norm = weights.iter().map(|weight| weight * weight).sum::<f64>();
        weights.map(|weight| weight / norm.sqrt())
    }

    /// Takes in the forces, with their range and how many in a row are equal.
    fn take_forces(&mut self, forces: &[f64]) {
        for &force in forces {
            let is_equal = self.forces.last() == Some(&force);
            self.forces.push(force);
            self.equal = if is_equal { self.equal + 1 } else { 1 };
            if force > self.high {
                self.elsewhere = self.elsewhere.max(self.at_high);
                self.at_high = 1;
            } else if force == self.high {
                self.at_high = self.at_high.max(self.equal);
            } else {
                self.elsewhere = self.elsewhere.max(self.equal);
            }
            self.high = self.high.max(force);
            self.low = self.low.min(force);
        }
    }
}

impl Pass for Survey {
    fn begin(&mut self) {
        if self.samples == 0 {
            [self.low, self.high] = [f64::INFINITY, f64::NEG_INFINITY];
        }
        self.times.clear();
        self.driven.clear();
        self.forces.clear();
    }

    fn push(&mut self, loading: &TraceDrive, samples: Samples<'_>) {
        self.velocity = loading.drive.velocity;
        let known = self.times.len();
        self.times.extend(samples.times);
        let driven = samples.times.iter().map(|time| loading.driven(*time));
        self.driven.extend(driven);
        self.take_forces(samples.forces);
        self.samples += samples.times.len() as u64;
        let times = &self.times;
        let forces = &self.forces;
        let last = times.len() - 1;
        self.seconds += times[last] - times[known.saturating_sub(1)];
        let step = (times[last] - times[0]) / (last.max(1)) as f64;
        let weights = Self::weights(&loading.drive, step);
        for five in forces[known.saturating_sub(4)..].windows(5) {
            let pairs = five.iter().zip(weights);
            let difference: f64 = pairs.map(|(force, weight)| force * weight).sum();
            self.noise.push(difference.abs());
        }
        for (length, slopes) in SLOPES.into_iter().zip(&mut self.stiffness) {
            let steady = loading.drive.velocity * step * length as f64;
            for end in (known.max(length)..=last).step_by(length) {
                let begin = end - length;
                let distance = self.driven[end] - self.driven[begin];
                if distance >= STEADY * steady {
                    slopes.push((forces[end] - forces[begin]) / distance);
                }
            }
        }
        let [.., longest] = SLOPES;
        let old = last.saturating_sub(longest);
        self.times.drain(..old);
        self.driven.drain(..old);
        self.forces.drain(..old);
    }
}
