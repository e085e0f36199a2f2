//! The first pass: from second differences of the force, its noise; from its slopes, the stiffness of the loading; and
//! whether it was cut off at a largest value. Medians, so that slips do not count.

use super::{Pass, Samples, TraceDrive};
use crate::model::Drive;
use std::f64::consts::TAU;

/// Samples over which the slope of the force is taken: the fewest over which it rises by `RISE` times the noise.
const SLOPES: [usize; 3] = [1, 4, 16];
const RISE: f64 = 2.0;
const LONGEST_SLOPE: usize = SLOPES[2];
/// Samples at the largest force from which on they are cut off there, if no others stay equal for half as long.
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

    /// NaN without numbers.
    fn median(&self) -> f64 {
        let mut left = self.0.iter().sum::<u64>().div_ceil(2);
        let is_reached = |count: &u64| {
            left = left.saturating_sub(*count);
            left == 0
        };
        let class = self.0.iter().position(is_reached).unwrap_or(0) as u64;
        f64::from_bits((class << Self::BELOW) | (1 << (Self::BELOW - 1)))
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
    stiffness: [Histogram; 3],
    pub low: f64,
    pub high: f64,
    pub samples: u64,
    pub seconds: f64,
    /// The last samples of the piece before.
    times: Vec<f64>,
    driven: Vec<f64>,
    forces: Vec<f64>,
    /// Equal samples in succession: now, and at most at the largest force and at others.
    equal: u64,
    at_high: u64,
    elsewhere: u64,
}

impl Survey {
    /// The standard deviation of the noise: the median absolute second difference of Gaussian noise is 1/1.4826 of its
    /// standard deviation, and this the square root of 6 times that of the noise. 0 where it is that of rounding.
    pub fn noise(&self) -> f64 {
        let noise = 1.4826 * self.noise.median();
        let rounding = f64::EPSILON * self.low.abs().max(self.high.abs());
        if noise > rounding { noise } else { 0.0 }
    }

    /// The slope of the loading parts over the velocity of the drive, in N/m.
    pub fn stiffness(&self) -> f64 {
        let step = self.velocity * self.seconds / self.samples as f64;
        let mut scales = SLOPES
            .into_iter()
            .zip(self.stiffness.iter().map(Histogram::median));
        let is_seen = |&(length, slope): &(usize, f64)| {
            length == LONGEST_SLOPE || slope * step * length as f64 > RISE * self.noise()
        };
        scales.find(is_seen).map_or(f64::NAN, |(_, slope)| slope)
    }

    /// Samples in succession at the largest force, if it was cut off there.
    pub fn clipped(&self) -> Option<u64> {
        let is_clipped = self.at_high >= CLIPPED.max(2 * self.elsewhere);
        is_clipped.then_some(self.at_high)
    }

    /// Weights of five samples in a row: their second difference, or under modulation that of what a sine of its period
    /// leaves at this step; the noise keeps its standard deviation.
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

    fn count_equal(&mut self, forces: &[f64]) {
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
        self.count_equal(samples.forces);
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
            let even = loading.drive.velocity * step * length as f64;
            for end in (known.max(length)..=last).step_by(length) {
                let begin = end - length;
                let driven = self.driven[end] - self.driven[begin];
                if driven >= 0.999 * even {
                    slopes.push((forces[end] - forces[begin]) / driven);
                }
            }
        }
        let old = last.saturating_sub(LONGEST_SLOPE);
        self.times.drain(..old);
        self.driven.drain(..old);
        self.forces.drain(..old);
    }
}
