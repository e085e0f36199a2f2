//! The third pass: the slips for one drop size.
//!
//! Without noise, an onset is the largest sample before a fall, and the drop reaches from there to the least one.
//! Where the noise is seen, the largest sample is a maximum of the noise. So the level before the fall is the median of
//! the last samples near its top; the onset is the last sample at that level, within the noise; and the drop lies
//! between the means of a few samples before the fall and of as many after it. A few are those in which the drive does
//! not load by more than the noise.

use super::super::drops::{Fall, Zigzag};
use super::{Pass, Samples, TraceDrive};
use crate::model::Drive;
use crate::value::floored;

/// Noise of a drop from which on it counts.
const SEEN: f64 = 0.003;
/// Samples of a level, at most: as many as the force loads by the noise in.
const LEVEL: usize = 9;
/// Noises of the largest of some samples, and of one that is surely below a level.
const LARGEST: f64 = 3.0;
const SURE: f64 = 4.0;
/// Samples that are kept before a fall, and at most during one.
const KEPT: usize = 1 << 16;
const LONGEST: usize = 1 << 21;

/// A slip of a trace.
#[derive(Clone, Copy, Debug)]
pub struct SampledSlip {
    pub onset: f64,
    /// From the onset to the first sample that surely lies in the fall, in s.
    pub uncertainty: f64,
    pub drop: f64,
    pub peak_force: f64,
}

/// The slips of each run.
#[derive(Clone, Debug)]
pub struct Finder {
    least: f64,
    noise: f64,
    zigzag: Option<Zigzag>,
    /// When the fall before was at its least.
    before: f64,
    /// Samples from some before the last top on.
    times: Vec<f64>,
    forces: Vec<f64>,
    pub runs: Vec<Vec<SampledSlip>>,
}

impl Finder {
    pub const fn new(least: f64, noise: f64) -> Self {
        Self {
            least,
            noise,
            zigzag: None,
            before: f64::NEG_INFINITY,
            times: Vec::new(),
            forces: Vec::new(),
            runs: Vec::new(),
        }
    }

    /// Adds a fall that a rise has ended at a time, if it is a slip.
    fn add(&mut self, fall: Fall, ended: f64, loading: &TraceDrive) {
        let before = std::mem::replace(&mut self.before, fall.bottom.time);
        if fall.size(loading.drive.stiffness) < self.least {
            return;
        }
        let times = [before, fall.top.time, fall.bottom.time, ended];
        let [before, top, bottom, last] = times.map(|end| {
            let place = self.times.partition_point(|time| *time < end);
            place.min(self.times.len() - 1)
        });
        let forces = &self.forces[..=last];
        let mut slip = SampledSlip {
            onset: fall.top.time,
            uncertainty: 0.0,
            drop: fall.top.force - fall.bottom.force,
            peak_force: fall.top.force,
        };
        let mut onset = top;
        if self.noise > SEEN * slip.drop {
            let step = (self.times[bottom] - self.times[0]) / bottom.max(1) as f64;
            // At the fastest, over a sample.
            let Drive {
                stiffness,
                velocity,
                eta,
                ..
            } = loading.drive;
            let rise = stiffness * velocity * (1.0 + eta) * step;
            let few = floored(self.noise / rise).clamp(1, LEVEL);
            let begin = (top + 1).saturating_sub(LEVEL).max(before);
            let [level, near] = self.last_before_fall(&forces[begin..=bottom], few);
            let level = begin + level;
            onset = begin + near;
            // The same backwards and upside down.
            let after = forces[onset..].iter().rev().map(|force| -force);
            let after: Vec<f64> = after.collect();
            let end = last - self.last_before_fall(&after, few)[0];
            let mean = |forces: &[f64]| forces.iter().sum::<f64>() / forces.len() as f64;
            slip.onset = self.times[onset];
            slip.peak_force = mean(&forces[(level + 1).saturating_sub(few)..=level]);
            slip.drop = slip.peak_force - mean(&forces[end..forces.len().min(end + few)]);
        }
        let sure = slip.peak_force - SURE * self.noise;
        let mut falling = onset + 1..forces.len();
        let falling = falling.find(|place| forces[*place] < sure);
        slip.uncertainty = self.times[falling.unwrap_or(bottom)] - slip.onset;
        self.runs
            .last_mut()
            .into_iter()
            .for_each(|run| run.push(slip));
    }

    /// Places before the fall in which forces end: the last sample near the largest, and the last that reaches the median
    /// level before that.
    fn last_before_fall(&self, forces: &[f64], few: usize) -> [usize; 2] {
        let top = forces.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let last_above = |least: f64| {
            forces
                .iter()
                .rposition(|force| *force >= least)
                .unwrap_or(0)
        };
        let last = last_above(top - LARGEST * self.noise);
        let mut level = forces[(last + 1).saturating_sub(few)..=last].to_vec();
        level.sort_by(f64::total_cmp);
        [last, last_above(level[level.len() / 2])]
    }
}

impl Pass for Finder {
    fn begin(&mut self) {
        self.times.clear();
        self.forces.clear();
        self.runs.push(Vec::new());
        self.before = f64::NEG_INFINITY;
    }

    fn push(&mut self, loading: &TraceDrive, samples: Samples<'_>) {
        if let Some(zigzag) = &self.zigzag
            && self.times.len() > KEPT
        {
            let top = self.times.partition_point(|time| *time < zigzag.top.time);
            let longest = self.times.len().saturating_sub(LONGEST);
            let old = top.saturating_sub(LEVEL).max(longest);
            self.times.drain(..old);
            self.forces.drain(..old);
        }
        self.times.extend(samples.times);
        self.forces.extend(samples.forces);
        let mut ended = Vec::new();
        let mut zigzag = self.zigzag.take();
        loading.turns(samples, self.least, |now| {
            let zigzag = zigzag.get_or_insert(Zigzag::new(self.least, now));
            ended.extend(zigzag.follow(now).map(|fall| (fall, now.time)));
        });
        self.zigzag = zigzag;
        for (fall, end) in ended {
            self.add(fall, end, loading);
        }
    }

    fn end(&mut self, loading: &TraceDrive) {
        let fall = self.zigzag.take().and_then(|zigzag| zigzag.under_way());
        if let Some(fall) = fall {
            self.add(fall, f64::INFINITY, loading);
        }
    }
}
