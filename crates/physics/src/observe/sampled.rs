//! Slips in a force that was sampled: those of a trace, by the definition of [`drops`](super::drops).
//!
//! Three passes, each in constant memory but for the slips: a [`Survey`] of noise and stiffness, [`Counts`] of slips for
//! many drop sizes, and a [`Finder`] of onsets and drops. Where the noise is seen, maxima of the force are maxima of the
//! noise: an onset is then the last sample that reaches the median level before the fall (half the error of a sample within
//! two noises of it), and a drop lies between means.

use super::drops::{Fall, Instant, Zigzag};
use crate::model::Drive;
use crate::value::floored;
use std::f64::consts::TAU;

/// Samples that are followed at once, by their largest and least, where they differ by less than the drop size.
const CHUNK: usize = 32;
/// Samples over which the slope of the force is taken: the fewest over which it rises by `RISE` times the noise.
const SLOPES: [usize; 3] = [1, 4, 16];
const RISE: f64 = 2.0;
const LONGEST_SLOPE: usize = SLOPES[2];
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
/// Samples at the largest force from which on they are cut off there, if no others stay equal for half as long.
const CLIPPED: u64 = 3;

/// A plateau: a range of drop sizes by this factor over which the number of slips changes by at most this part.
const PLATEAU: f64 = 1.75;
const CHANGE: f64 = 0.1;

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

/// The drive of a trace.
#[derive(Clone, Copy, Debug)]
pub struct TraceDrive {
    pub drive: Drive,
    /// A time at which the modulation has a maximum, in s.
    pub maximum: f64,
}

impl TraceDrive {
    /// The displacement of the driven end at a time, in m.
    pub fn driven(&self, time: f64) -> f64 {
        self.drive.motion(time - self.maximum).0
    }

    fn instant(&self, samples: Samples<'_>, place: usize) -> Instant {
        let time = samples.times[place];
        Instant {
            time,
            force: samples.forces[place],
            driven: self.driven(time),
        }
    }

    /// What a zigzag of this drop size must follow.
    fn turns(&self, samples: Samples<'_>, least: f64, mut follow: impl FnMut(Instant)) {
        for begin in (0..samples.times.len()).step_by(CHUNK) {
            let end = samples.times.len().min(begin + CHUNK);
            let [mut low, mut high] = [begin; 2];
            for place in begin..end {
                if samples.forces[place] < samples.forces[low] {
                    low = place;
                }
                if samples.forces[place] > samples.forces[high] {
                    high = place;
                }
            }
            if samples.forces[high] - samples.forces[low] < least {
                follow(self.instant(samples, low.min(high)));
                follow(self.instant(samples, low.max(high)));
            } else {
                (begin..end).for_each(|place| follow(self.instant(samples, place)));
            }
        }
    }
}

/// Times in s and forces in N, or in another unit throughout.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    pub times: &'a [f64],
    pub forces: &'a [f64],
}

/// What goes over the runs of a trace, piece by piece.
pub trait Pass {
    /// The next run begins.
    fn begin(&mut self, loading: TraceDrive);
    /// The next samples, at least one.
    fn push(&mut self, samples: Samples<'_>);
    /// The run has ended: a fall under way counts as far as it went.
    fn end(&mut self) {}
}

/// The noise of a trace and the stiffness of its loading.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    loading: Option<TraceDrive>,
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
        let velocity = self.loading.map_or(0.0, |loading| loading.drive.velocity);
        let step = velocity * self.seconds / self.samples as f64;
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
    fn begin(&mut self, loading: TraceDrive) {
        if self.samples == 0 {
            [self.low, self.high] = [f64::INFINITY, f64::NEG_INFINITY];
        }
        self.loading = Some(loading);
        self.times.clear();
        self.driven.clear();
        self.forces.clear();
    }

    fn push(&mut self, samples: Samples<'_>) {
        let Some(loading) = self.loading else { return };
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

/// The slips for one drop size.
#[derive(Clone, Debug)]
pub struct Count {
    pub least: f64,
    pub slips: u64,
    /// Between slips of one run, and their sum in s.
    pub intervals: u64,
    pub seconds: f64,
    zigzag: Option<Zigzag>,
    before: Option<f64>,
}

impl Count {
    fn add(&mut self, fall: Fall, stiffness: f64) {
        if fall.size(stiffness) < self.least {
            return;
        }
        self.slips += 1;
        if let Some(before) = self.before.replace(fall.top.time) {
            self.intervals += 1;
            self.seconds += fall.top.time - before;
        }
    }
}

/// How many slips there are for each of many drop sizes.
#[derive(Clone, Debug)]
pub struct Counts {
    loading: Option<TraceDrive>,
    /// Rising.
    pub of_sizes: Vec<Count>,
}

impl Counts {
    pub fn new(sizes: impl IntoIterator<Item = f64>) -> Self {
        let count = |least| Count {
            least,
            slips: 0,
            intervals: 0,
            seconds: 0.0,
            zigzag: None,
            before: None,
        };
        Self {
            loading: None,
            of_sizes: sizes.into_iter().map(count).collect(),
        }
    }

    /// The widest plateau, with some slips at least: of those that hold a drop size, if one is given.
    pub fn plateau(&self, size: Option<f64>, slips: u64) -> Option<[f64; 2]> {
        let counts = &self.of_sizes;
        let plateau = |(low, first): (usize, &Count)| {
            let least = ((1.0 - CHANGE) * first.slips as f64).max(slips as f64);
            let last = counts[low..]
                .iter()
                .take_while(|count| count.slips as f64 >= least);
            Some([first.least, last.last()?.least])
        };
        let holds = |[low, high]: &[f64; 2]| size.is_none_or(|size| *low <= size && size <= *high);
        let all = counts.iter().enumerate().filter_map(plateau).filter(holds);
        let widest =
            all.max_by(|left, right| (left[1] / left[0]).total_cmp(&(right[1] / right[0])));
        widest.filter(|[low, high]| *high >= PLATEAU * low)
    }
}

impl Count {
    /// Follows turning points; returns those that larger drop sizes must follow.
    fn follow(&mut self, turns: &[Instant], stiffness: f64) -> Vec<Instant> {
        let mut coarser = Vec::new();
        for &now in turns {
            let zigzag = Zigzag::new(self.least, now);
            if let Some(fall) = self.zigzag.get_or_insert(zigzag).follow(now) {
                self.add(fall, stiffness);
                coarser.extend([fall.top, fall.bottom]);
            }
        }
        coarser
    }
}

impl Pass for Counts {
    fn begin(&mut self, loading: TraceDrive) {
        self.loading = Some(loading);
    }

    fn push(&mut self, samples: Samples<'_>) {
        let Some(loading) = self.loading else { return };
        let least = self.of_sizes.first().map_or(0.0, |count| count.least);
        let mut turns = Vec::new();
        loading.turns(samples, least, |now| turns.push(now));
        for count in &mut self.of_sizes {
            turns = count.follow(&turns, loading.drive.stiffness);
        }
    }

    fn end(&mut self) {
        let stiffness = self.loading.map_or(0.0, |loading| loading.drive.stiffness);
        let mut turns = Vec::new();
        for count in &mut self.of_sizes {
            turns = count.follow(&turns, stiffness);
            if let Some(fall) = count.zigzag.take().and_then(|zigzag| zigzag.under_way()) {
                count.add(fall, stiffness);
                turns.extend([fall.top, fall.bottom]);
            }
            count.before = None;
        }
    }
}

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
    loading: Option<TraceDrive>,
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
            loading: None,
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
    fn begin(&mut self, loading: TraceDrive) {
        self.loading = Some(loading);
        self.times.clear();
        self.forces.clear();
        self.runs.push(Vec::new());
        self.before = f64::NEG_INFINITY;
    }

    fn push(&mut self, samples: Samples<'_>) {
        let Some(loading) = self.loading else { return };
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
            self.add(fall, end, &loading);
        }
    }

    fn end(&mut self) {
        let fall = self.zigzag.take().and_then(|zigzag| zigzag.under_way());
        if let Some((fall, loading)) = fall.zip(self.loading) {
            self.add(fall, f64::INFINITY, &loading);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;

    const STEP: f64 = 1e-3;
    const STIFFNESS: f64 = 1e7;

    /// A drive that loads by 1 N a millisecond, and swings by this many newtons with a period of 20 ms.
    fn loading(swing: f64) -> TraceDrive {
        let drive = Drive::new(&Parameters {
            drive_velocity: 1e-4,
            drive_stiffness: STIFFNESS,
            modulation_amplitude: swing / STIFFNESS,
            modulation_period: (swing > 0.0).then_some(0.02),
            ..Parameters::default()
        });
        TraceDrive {
            drive,
            maximum: 0.0,
        }
    }

    /// Uniform numbers from 0 to 1, the same in each run.
    fn uniform(state: &mut u64) -> f64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The sum of twelve uniform numbers is nearly Gaussian, of standard deviation 1.
    fn gaussian(state: &mut u64) -> f64 {
        (0..12).map(|_| uniform(state)).sum::<f64>() - 6.0
    }

    struct Trace {
        times: Vec<f64>,
        forces: Vec<f64>,
        onsets: Vec<f64>,
        drops: Vec<f64>,
    }

    /// A slider that slips by a random distance at random intervals, 2 ms a slip, under noise.
    fn renewal(swing: f64, noise: f64, jitter: f64) -> Trace {
        let loading = loading(swing);
        let mut state = 1;
        let mut trace = Trace {
            times: Vec::new(),
            forces: Vec::new(),
            onsets: Vec::new(),
            drops: Vec::new(),
        };
        let mut slid = 0.0;
        let mut next = 0.15;
        let mut drop = 100.0;
        for sample in 0..60_000 {
            let time = STEP * (f64::from(sample) + jitter * uniform(&mut state));
            let partly = ((time - next) / 0.002).clamp(0.0, 1.0);
            let force = STIFFNESS * loading.driven(time) - slid - partly * drop;
            if partly >= 1.0 {
                trace.onsets.push(next);
                trace.drops.push(drop);
                slid += drop;
                drop = 80.0 + 40.0 * uniform(&mut state);
                next += 1e-3 * (80.0 + 40.0 * uniform(&mut state));
            }
            trace.times.push(time);
            trace.forces.push(force + noise * gaussian(&mut state));
        }
        trace
    }

    fn pass(pass: &mut dyn Pass, trace: &Trace, swing: f64, piece: usize) {
        pass.begin(loading(swing));
        let pieces = trace.times.chunks(piece).zip(trace.forces.chunks(piece));
        pieces.for_each(|(times, forces)| pass.push(Samples { times, forces }));
        pass.end();
    }

    fn found(trace: &Trace, swing: f64, least: f64, noise: f64, piece: usize) -> Vec<SampledSlip> {
        let mut finder = Finder::new(least, noise);
        pass(&mut finder, trace, swing, piece);
        finder.runs.remove(0)
    }

    #[test]
    fn slips_of_a_renewal_process_are_found_with_and_without_noise_and_modulation() {
        for swing in [0.0, 6.0, 30.0] {
            for noise in [0.0, 1.0, 4.0] {
                for jitter in [0.0, 0.9] {
                    let trace = renewal(swing, noise, jitter);
                    let slips = found(&trace, swing, 50.0, noise, 1000);
                    assert_eq!(slips.len(), trace.onsets.len(), "{swing}, {noise}");
                    let mean_drop = slips.iter().map(|slip| slip.drop).sum::<f64>();
                    let expected = trace.drops.iter().sum::<f64>();
                    // Noise is that of as many milliseconds of loading. A swing has its maximum before the slip.
                    let early = if swing > 3.0 {
                        0.02
                    } else {
                        (2.0 + noise) * STEP
                    };
                    let late = (2.5 + 0.5 * noise) * STEP;
                    for (slip, onset) in slips.iter().zip(&trace.onsets) {
                        let off = slip.onset - onset;
                        assert!(off < late && off > -early, "{swing}, {noise}: {off}");
                        assert!(slip.uncertainty > 0.0);
                    }
                    // Under modulation the force falls by the drive's part, too.
                    let off = mean_drop / expected - 1.0;
                    assert!(
                        off > -0.07 && (swing > 0.0 || off < 0.01),
                        "{swing}, {noise}: {off}"
                    );
                }
            }
        }
    }

    #[test]
    fn pieces_of_any_length_give_the_same_slips_and_counts() {
        let trace = renewal(60.0, 1.0, 0.0);
        let all = |piece| {
            let mut counts = Counts::new([20.0, 40.0, 80.0, 160.0]);
            pass(&mut counts, &trace, 60.0, piece);
            let counts: Vec<(u64, f64)> = counts
                .of_sizes
                .iter()
                .map(|count| (count.slips, count.seconds))
                .collect();
            let slips = found(&trace, 60.0, 40.0, 1.0, piece);
            let slips: Vec<[f64; 3]> = slips
                .iter()
                .map(|slip| [slip.onset, slip.drop, slip.uncertainty])
                .collect();
            (counts, slips)
        };
        let whole = all(100_000);
        assert_eq!(whole.0[1].0, whole.1.len() as u64);
        for piece in [1, 31, 4096] {
            assert!(all(piece) == whole, "{piece}");
        }
    }

    #[test]
    fn noise_and_stiffness_are_those_of_the_trace() {
        for swing in [0.0, 60.0] {
            for noise in [0.1, 1.0, 4.0] {
                let trace = renewal(swing, noise, 0.0);
                let mut survey = Survey::default();
                pass(&mut survey, &trace, swing, 1000);
                // Two samples in a hundred lie in slips.
                assert!(
                    (survey.noise() / noise - 1.0).abs() < 0.12,
                    "{swing}: {}",
                    survey.noise()
                );
                let stiffness = survey.stiffness() / STIFFNESS;
                assert!(
                    (stiffness - 1.0).abs() < 0.15,
                    "{swing}, {noise}: {stiffness}"
                );
                assert_eq!(survey.clipped(), None);
            }
        }
    }

    #[test]
    fn a_plateau_holds_the_size_of_slips_and_none_is_in_a_scale_free_trace() {
        let mut trace = renewal(0.0, 1.0, 0.0);
        let sizes = || (0..60).map(|step| 5.0 * 1.06_f64.powi(step));
        let mut counts = Counts::new(sizes());
        pass(&mut counts, &trace, 0.0, 1000);
        let [low, high] = counts.plateau(None, 5).unwrap();
        assert!(low < 20.0 && high > 70.0 && high < 120.0, "{low}, {high}");
        assert!(
            counts.plateau(Some(40.0), 1).is_some() && counts.plateau(Some(150.0), 1).is_none()
        );
        // Steps of all sizes, one as often as another.
        let mut state = 5;
        let mut force = 0.0;
        let mut forces = Vec::new();
        for _ in 0..60_000 {
            force += 3.0 * gaussian(&mut state);
            forces.push(force);
        }
        trace.forces = forces;
        let mut counts = Counts::new(sizes());
        pass(&mut counts, &trace, 0.0, 1000);
        assert_eq!(counts.plateau(None, 5), None);
    }

    #[test]
    fn a_force_that_was_cut_off_is_noticed_and_a_coarse_one_is_not() {
        let clipped = |forces: Vec<f64>| {
            let mut survey = Survey::default();
            let trace = Trace {
                forces,
                ..renewal(0.0, 0.5, 0.0)
            };
            pass(&mut survey, &trace, 0.0, 1000);
            survey.clipped()
        };
        let forces = renewal(0.0, 0.5, 0.0).forces;
        let most = forces.iter().copied().fold(0.0, f64::max);
        assert!(clipped(forces.iter().map(|force| force.min(most - 10.0)).collect()).is_some());
        assert_eq!(
            clipped(forces.iter().map(|force| (0.2 * force).round()).collect()),
            None
        );
    }
}
