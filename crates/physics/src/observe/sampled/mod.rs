//! Slips in a force that was sampled: those of a measured trace, by the definition of [`drops`](super::drops).
//! Parameters of the model enter only as the drive that loaded it.
//!
//! Three passes over the samples, piece by piece, each in constant memory but for the slips:
//!
//! ```text
//! survey.rs   noise of the force, stiffness of its loading
//! counts.rs   how many slips there are for each of many drop sizes, and where their number is a plateau
//! finder.rs   the slips for one drop size
//! ```

mod counts;
mod finder;
mod survey;

pub use counts::{Count, Counts};
pub use finder::{Finder, SampledSlip};
pub use survey::Survey;

use super::drops::Instant;
use crate::model::Drive;

/// Samples that are followed at once, by their largest and least, where they differ by less than the drop size.
const CHUNK: usize = 32;

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
        self.drive.motion(time - self.maximum).displacement
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

/// What goes over the runs of a trace, piece by piece, each under a drive that loads it.
pub trait Pass {
    /// The next run begins.
    fn begin(&mut self) {}
    /// The next samples, at least one.
    fn push(&mut self, loading: &TraceDrive, samples: Samples<'_>);
    /// The run has ended: a fall under way counts as far as it went.
    fn end(&mut self, _loading: &TraceDrive) {}
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
        let loading = loading(swing);
        pass.begin();
        let pieces = trace.times.chunks(piece).zip(trace.forces.chunks(piece));
        pieces.for_each(|(times, forces)| pass.push(&loading, Samples { times, forces }));
        pass.end(&loading);
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
    fn the_stiffness_of_runs_too_short_for_the_longest_slope_is_that_of_a_shorter_one() {
        let mut trace = renewal(0.0, 4.0, 0.0);
        trace.times.truncate(140);
        trace.forces.truncate(140);
        let mut survey = Survey::default();
        assert_eq!(survey.noise(), 0.0);
        assert_eq!(survey.stiffness(), 0.0);
        let loading = loading(0.0);
        for (times, forces) in trace.times.chunks(14).zip(trace.forces.chunks(14)) {
            survey.begin();
            survey.push(&loading, Samples { times, forces });
        }
        let stiffness = survey.stiffness() / STIFFNESS;
        assert!((stiffness - 1.0).abs() < 0.5, "{stiffness}");
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
