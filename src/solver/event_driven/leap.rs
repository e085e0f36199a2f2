//! Leaps over quiet time along the driven solution.
//!
//! Between events the motion is a driven solution ([`super::driven_solution`]) and a free motion about it, which decays
//! and is bounded for each block ([`super::free_motion`]). A leap may therefore start while the free motion is still
//! large, if the bound shows that meanwhile no block reaches a break position, and that the shear force has been or
//! will be larger than it can be meanwhile. If the free motion has fallen under the tolerance when the next event
//! comes, it is dropped; if not, and no mode is overdamped, it is carried over in one go ([`super::chebyshev`]).
//! Contract: a leap leaves out at most `tolerance` · f_s/k of any block's displacement at its end, no event on the way,
//! and no largest shear force.

use super::chain::{Chain, State};
use super::chebyshev::ChebyshevPropagator;
use super::free_motion::SplitMotion;
use super::kernels::Kernels;
use super::layout::Layout;
use crate::solver::harmonic::Harmonic;
use crate::solver::ledger::Audit;
use crate::solver::segment::Segment;
use std::f64::consts::TAU;

/// How far beyond a leap under modulation a larger shear force is looked for, in units of 1/γ.
const LOOK_AHEAD: f64 = 10.0;

/// Part of the error of a leap that the reattachments passed by it may add up to.
const PASSED_SHARE: f64 = 0.2;

/// Free motion at which a contact may attach on the driven solution, in errors of a leap.
const LOOSE: f64 = 3.0;

/// Part of the error of a leap that each term which the propagator leaves out may have.
const PROPAGATED_SHARE: f64 = 1e-3;

/// Longest time to carry the free motion over, in units of the shortest time scale of the slider: some 20 MB.
const MAX_CARRIED_ANGLE: f64 = 1e6;

/// How an attempt to leap ended.
#[derive(Clone, Copy, Debug)]
pub(super) enum Attempt {
    /// The slider moved on by `elapsed` s; a block reached a break position if one is named. Whether the free
    /// motion was carried over.
    Leapt { elapsed: f64, reached: Option<usize>, is_carried: bool },
    /// Not yet: try again after `seconds` s.
    Wait { seconds: f64 },
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Time to the next reattachment or to the end, in s.
    pub horizon: f64,
    /// Time to the next cycle of a ramped modulation, in s; not before the horizon.
    pub until_cycle_end: f64,
    /// Displacement that may be left out, in m.
    pub error: f64,
    /// Mean contact reach, in m: how far a contact that attaches later moves until it breaks.
    pub reach: f64,
    /// Largest shear force on record since the last break, in N. Every observer has seen it.
    pub largest_force: f64,
}

/// Leaps, and their work space.
#[derive(Clone, Debug)]
pub(super) struct Leap {
    /// The motion at the start of a leap; displacements and velocities are in the end those after it.
    motion: SplitMotion,
    propagator: ChebyshevPropagator,
}

impl Leap {
    pub fn new(layout: Layout) -> Self {
        Self { motion: SplitMotion::new(layout), propagator: ChebyshevPropagator::new(layout) }
    }

    /// Splits a state into driven solution and free motion. Returns the largest bound on the latter, in m; `None` if it
    /// does not decay.
    pub fn split(&mut self, chain: &Chain, kernels: &dyn Kernels, drive: &Harmonic, state: &State) -> Option<f64> {
        chain.layout.unfold(&state.displacement, &mut self.motion.displacement);
        chain.layout.unfold(&state.velocity, &mut self.motion.velocity);
        kernels.split(chain, drive, &mut self.motion)
    }

    /// After how many seconds the free motion, at most `largest` m now, is a small multiple of `error` m.
    pub fn loose_after(&self, largest: f64, error: f64) -> f64 {
        libm::log(largest / (LOOSE * error)) / self.motion.free.decay_rate
    }

    /// Up to when a leap may pass the reattachments that `due` tells one by one, as seconds from now and block, until it
    /// is told to stop: at most `end`, in s. None is passed in the first `loose` s.
    ///
    /// A contact that attaches on the way holds its block back by its stiffness times how far the block has moved since,
    /// which the driven solution leaves out. The sum of what this displaces may be a part of `error` m.
    pub fn pass(
        &self,
        chain: &Chain,
        stiffness: f64,
        reach: f64,
        drive: &Harmonic,
        [loose, error, end]: [f64; 3],
        due: impl FnOnce(&mut dyn FnMut(f64, usize) -> bool),
    ) -> f64 {
        let SplitMotion { driven, free, .. } = &self.motion;
        let allowed = PASSED_SHARE * error;
        let (mut displaced, mut rate, mut last, mut limit) = (0.0, 0.0, 0.0, end);
        due(&mut |seconds, block| {
            let gained = rate * (seconds - last);
            if seconds >= limit || displaced + gained > allowed {
                return false;
            }
            if seconds < loose {
                limit = seconds;
                return false;
            }
            displaced += gained;
            last = seconds;
            let speed = driven.rate[block] + drive.angular_frequency * driven.amplitude(block);
            rate += stiffness / chain.mass * speed * free.compliance[block];
            // Nor may it break.
            limit = limit.min(seconds + 0.5 * reach / speed);
            true
        });
        if rate > 0.0 { limit.min(last + (allowed - displaced) / rate) } else { limit }
    }

    /// Displacement of a block along the driven solution after `elapsed` s, in m.
    pub fn driven_displacement(&self, drive: &Harmonic, block: usize, elapsed: f64) -> f64 {
        self.motion.driven.displacement(drive, block, elapsed)
    }

    /// Tries to leap by at most `horizon` s under a drive that moves as given, leaving out no displacement above
    /// `error` m, and writes the state at its end. The state has been split; its free motion is at most `largest` m. Shear
    /// forces up to `largest_force` N have been seen since the last break. `report` receives the shear force on the way,
    /// `audit` the energies, unless the free motion was carried over.
    #[expect(clippy::too_many_arguments, reason = "what a leap reads and what it reports")]
    pub fn attempt(
        &mut self,
        chain: &Chain,
        kernels: &dyn Kernels,
        drive: &Harmonic,
        largest: f64,
        Bounds { horizon, until_cycle_end, error, reach, largest_force }: Bounds,
        state: &mut State,
        report: impl FnOnce(Segment<'static>),
        audit: Option<&Audit>,
    ) -> Attempt {
        let layout = chain.layout;
        // Worth another try after some e-foldings of the free motion, or after the next event.
        let decay_rate = self.motion.free.decay_rate;
        let max_wait = horizon;
        let wait = |folds: f64| Attempt::Wait { seconds: (folds / decay_rate).min(max_wait) };
        let decay = if largest <= error { 0.0 } else { libm::log(largest / error) / decay_rate };
        let is_short = decay >= horizon;
        if is_short && decay_rate < 0.5 * chain.damping_rate {
            return Attempt::Wait { seconds: horizon };
        }
        let horizon = if is_short { horizon.min(max_carried_time(chain)) } else { horizon };
        let moving = decay.min(horizon);
        let left = if is_short { libm::exp(-decay_rate * horizon) } else { error / largest };
        if decay > 0.0 && !self.stays_clear(chain, drive, moving, left) {
            return wait(0.7);
        }
        let (elapsed, reached) =
            if is_short { (horizon, None) } else { self.first_reached(chain, drive, decay, horizon) };
        if elapsed <= decay && decay > 0.0 && !is_short {
            return wait(0.7);
        }
        if !elapsed.is_finite() {
            return Attempt::Wait { seconds: f64::INFINITY };
        }
        let path = self.motion.driven.force_path(drive, chain.drive_stiffness);
        let segment = Segment { start: 0.0, duration: elapsed, path };
        // No block moves faster than the first. What attaches later breaks beyond, where nothing is known.
        let known = until_cycle_end.min(moving + reach / self.motion.driven.rate[0]);
        if largest > error && !self.hides_no_peak(chain, drive, &segment, [moving, known], left, largest_force) {
            return wait(0.7);
        }
        report(segment);
        let SplitMotion { displacement, velocity, driven, .. } = &mut self.motion;
        if !is_short && let Some(audit) = audit {
            audit.follow_leap(chain, drive, driven, state, elapsed);
        }
        driven.evaluate(drive, elapsed, displacement, velocity);
        if is_short {
            self.carry_free_motion(chain, kernels, elapsed, left, PROPAGATED_SHARE * error / largest);
        }
        layout.fold(&self.motion.displacement, &mut state.displacement);
        layout.fold(&self.motion.velocity, &mut state.velocity);
        Attempt::Leapt { elapsed, reached, is_carried: is_short }
    }

    /// Whether the free motion of the first `moving` s, of which a part `left` remains then, hides no largest shear
    /// force: one as large is on record, or comes later in the segment, or comes after it, within `known` s
    /// and before any break.
    fn hides_no_peak(
        &self,
        chain: &Chain,
        drive: &Harmonic,
        segment: &Segment<'_>,
        [moving, known]: [f64; 2],
        left: f64,
        largest_force: f64,
    ) -> bool {
        let swing = chain.drive_stiffness * self.motion.free.bound[0];
        let driven = |seconds: f64| Segment { duration: seconds, ..*segment };
        let now = segment.force_after(0.0);
        let later = segment.force_after(moving);
        let highest = if drive.amplitude == 0.0 {
            // A rising line and a decaying bound: largest at an end.
            (now + swing).max(later + left * swing)
        } else {
            driven(moving).maximum_above(f64::NEG_INFINITY).map_or(f64::INFINITY, |(_, force)| force) + swing
        };
        if highest <= largest_force || (segment.duration > moving && segment.maximum_above(highest).is_some()) {
            return true;
        }
        let rate = chain.drive_stiffness * (drive.rate - self.motion.driven.rate[0]);
        let further = if drive.amplitude == 0.0 {
            3.0 * (highest - later) / rate
        } else {
            (LOOK_AHEAD / chain.damping_rate).min(TAU / drive.angular_frequency)
        };
        let ahead = (moving + further).min(known);
        driven(ahead).maximum_above(highest + left * swing).is_some() && self.stays_clear(chain, drive, ahead, left)
    }

    /// Carries the free motion over `elapsed` s and adds it, y = u e^{-γt/2} and w = u' e^{-γt/2} - γ y/2, where
    /// `left` is e^{-γt/2}. At the start u = y and u' = w + γ y/2. `error` is the part of it that may be left out.
    fn carry_free_motion(&mut self, chain: &Chain, kernels: &dyn Kernels, elapsed: f64, left: f64, error: f64) {
        let SplitMotion { displacement, velocity, free, .. } = &mut self.motion;
        self.propagator.start(chain.layout, &free.displacement, &free.shifted_velocity);
        kernels.propagate(chain, elapsed, error, &mut self.propagator);
        self.propagator.end(chain.layout, &mut free.displacement, &mut free.shifted_velocity);
        let half = 0.5 * chain.damping_rate;
        for j in 0..chain.layout.blocks {
            displacement[j] += left * free.displacement[j];
            velocity[j] += left * (free.shifted_velocity[j] - half * free.displacement[j]);
        }
    }

    /// Whether no block can reach a break position within `seconds`, at the end of which a part `left` of the free
    /// motion's bound remains.
    fn stays_clear(&self, chain: &Chain, drive: &Harmonic, seconds: f64, left: f64) -> bool {
        let (driven, free) = (&self.motion.driven, &self.motion.free);
        (0..chain.layout.blocks).all(|j| {
            let swing = if drive.amplitude > 0.0 { driven.amplitude(j) } else { 0.0 };
            // Ramp and decaying bound together are convex in time: largest at the ends.
            let late = driven.start[j] + driven.rate[j] * seconds + left * free.bound[j];
            let highest = late.max(driven.start[j] + free.bound[j]) + swing;
            let lowest = driven.start[j] - free.bound[j] - swing;
            highest < chain.per_block.upper[j] && lowest > chain.per_block.lower[j]
        })
    }

    /// The first instant after `decay` at which a block reaches a break position, up to `horizon`, and that block.
    fn first_reached(&self, chain: &Chain, drive: &Harmonic, decay: f64, horizon: f64) -> (f64, Option<usize>) {
        let driven = &self.motion.driven;
        let mut first = (horizon, None);
        for j in 0..chain.layout.blocks {
            let (upper, lower) = (chain.per_block.upper[j], chain.per_block.lower[j]);
            if drive.amplitude == 0.0 {
                // The rate is positive, so the ramp alone only rises.
                let elapsed = ((upper - driven.start[j]) / driven.rate[j]).max(decay);
                if elapsed < first.0 || lower >= driven.start[j] {
                    first = (if lower >= driven.start[j] { decay } else { elapsed }, Some(j));
                }
                continue;
            }
            let swing = driven.amplitude(j);
            let rises_before = driven.start[j] + driven.rate[j] * first.0 + swing >= upper;
            let falls_at_all = driven.start[j] + driven.rate[j] * decay - swing <= lower;
            if !(rises_before || falls_at_all) {
                continue;
            }
            let motion = driven.of_block(j, swing, drive.angular_frequency);
            let rise = if rises_before { motion.first_rise_to(upper, decay) } else { f64::INFINITY };
            let fall = if falls_at_all { motion.first_fall_to(lower, decay) } else { f64::INFINITY };
            if rise.min(fall) < first.0 {
                first = (rise.min(fall), Some(j));
            }
        }
        first
    }
}

/// How long the free motion may be carried over in one leap, in s, so that work and memory are bounded.
fn max_carried_time(chain: &Chain) -> f64 {
    let widest = chain.per_block.diagonal.iter().fold(0.0_f64, |most, diagonal| most.max(*diagonal));
    MAX_CARRIED_ANGLE / (widest + 2.0 * chain.coupling[0][0]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::kernels::fastest;
    use super::*;
    use crate::model::Parameters;

    #[test]
    fn a_leap_carries_an_undamped_oscillation_over_for_a_bounded_time() {
        let parameters = Parameters { blocks: 1, damping_rate: 0.0, ..Parameters::default() };
        let layout = Layout::new(1);
        // Without contacts nothing can be reached; the spring swings the block about where it pulls to.
        let chain = Chain::new(&parameters, layout);
        let kernels = fastest(layout.rows);
        let squared = parameters.drive_stiffness / chain.mass;
        let drive = Harmonic { start: 0.0, rate: 1e-12, amplitude: 0.0, phase: 0.0, angular_frequency: 0.0 };
        let mut state = State { displacement: layout.filled(0.0), velocity: layout.filled(0.0) };
        let amplitude = 1e-6;
        state.displacement[0][0] = amplitude;
        let horizon = 1e9;
        let bounds =
            Bounds { horizon, until_cycle_end: f64::INFINITY, error: 1e-12, reach: 1e-6, largest_force: f64::INFINITY };
        let mut leap = Leap::new(layout);
        let largest = leap.split(&chain, &*kernels, &drive, &state).unwrap();
        let attempt = leap.attempt(&chain, &*kernels, &drive, largest, bounds, &mut state, |_| {}, None);
        let Attempt::Leapt { elapsed, reached: None, is_carried: true } = attempt else { panic!("{attempt:?}") };
        let angle = squared.sqrt() * elapsed;
        assert!(angle > 1e5 && angle <= MAX_CARRIED_ANGLE, "{angle}");
        // A ramp that the block follows, and what is left of its start.
        let ramp = drive.rate * elapsed - drive.rate / squared.sqrt() * libm::sin(angle);
        let expected = ramp + amplitude * libm::cos(angle);
        assert!(
            (state.displacement[0][0] - expected).abs() < 1e-8 * amplitude,
            "{}",
            state.displacement[0][0] - expected
        );
    }
}
