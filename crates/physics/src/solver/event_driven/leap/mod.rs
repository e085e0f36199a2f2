//! Leaps over quiet time along the driven solution.
//!
//! Setting: `tolerance`. Method: between events the motion is a driven solution and a free motion about it, which
//! decays and is bounded for each block ([`split`], where the bound is derived). So a leap may start while the free
//! motion is still large, if the bound shows that no block reaches a break position meanwhile, and that the shear force
//! has been or will be larger than it can be meanwhile. When the next event comes, the rest of the free motion is below
//! the tolerance and is dropped. Contract: a leap leaves out at most `tolerance` · f_s/k of any block's displacement at
//! its end, no event on the way, and no largest shear force.

mod elimination;
mod split;

pub(super) use self::split::Split;

use self::split::SplitRow;
use super::slider::{Chain, Slider, Slot, State};
use crate::model::Interface;
use crate::model::simd::{Simd, Vector};
use crate::solver::harmonic::Harmonic;
use crate::solver::ledger::Audit;
use crate::solver::segment::{ForcePath, Segment};
use std::f64::consts::TAU;

/// How far beyond a leap under modulation a larger shear force is looked for, in units of 1/γ.
const LOOK_AHEAD: f64 = 10.0;

/// Part of the error of a leap that the reattachments passed by it may add up to.
const PASSED_SHARE: f64 = 0.2;
/// Free motion at which a contact may attach on the driven solution, in errors of a leap.
const LOOSE: f64 = 3.0;
/// How far a passed contact may be astray, in errors of a leap: by free motion where it attaches and later, and by what
/// the others displace.
const ASTRAY: f64 = 2.0 * LOOSE + PASSED_SHARE;

/// A leap that may be taken.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlannedLeap {
    /// The shear force on the way, in N, and how long that is, in s.
    pub force: Harmonic,
    pub duration: f64,
    /// The block that reaches a break position at its end, if any.
    pub reached: Option<usize>,
    /// Whether it ends at the horizon.
    pub is_whole: bool,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct LeapBounds {
    /// When it starts, in s in the frame.
    pub start: f64,
    /// Time to the next reattachment that is not passed or to the end, in s.
    pub horizon: f64,
    /// Time to the next cycle of a ramped modulation, in s; not before the horizon.
    pub until_cycle_end: f64,
    /// Time to where a longer leap is cut, in s.
    pub until_cut: f64,
    /// Displacement that may be left out, in m.
    pub error: f64,
    /// Largest shear force on record since the last break, in N. Every observer has seen it.
    pub largest_force: f64,
    /// How long a leap from the grid, over reattachments, must be, in s.
    pub passing: Option<f64>,
}

/// How long a leap over reattachments may be, in s, with free motion of at most `largest` m now; if that is less than
/// the `least` it must be, after how many seconds to look again. A contact that attaches on the way holds its block back by its
/// stiffness times how far the block has moved since, which the driven solution leaves out; what all displace may be a
/// part of the error.
fn passing_horizon(
    split: &Split,
    (chain, interface): (&Chain, &mut Interface),
    drive: &Harmonic,
    LeapBounds {
        start,
        until_cycle_end,
        error,
        ..
    }: LeapBounds,
    least: f64,
    largest: f64,
) -> Result<f64, f64> {
    let loose = libm::log(largest / (LOOSE * error)) / split.decay_rate;
    let allowed = PASSED_SHARE * error;
    let per_mass = 1.0 / chain.mass;
    let mut displaced = 0.0;
    let mut rate = 0.0;
    let mut last = 0.0;
    let mut limit = until_cycle_end;
    interface.look_ahead(|due, block, life| {
        let seconds = due - start;
        let by_then = displaced + rate * (seconds - last);
        if seconds >= limit || by_then > allowed {
            return false;
        }
        if seconds < loose {
            limit = seconds;
            return false;
        }
        (displaced, last) = (by_then, seconds);
        let slot = chain.layout.slot(block);
        let speed = split.largest_speed(drive, slot);
        rate += per_mass * life.stiffness * speed * split.compliance(slot);
        // Nor may it break.
        limit = limit.min(seconds + (life.reach - ASTRAY * error).max(0.0) / speed);
        true
    });
    let horizon = if rate > 0.0 {
        limit.min(last + (allowed - displaced) / rate)
    } else {
        limit
    };
    if horizon < least {
        Err(loose.clamp(0.5 * least, 4.0 * least))
    } else {
        Ok(horizon)
    }
}

/// Looks for a leap under a drive that moves as given, with free motion of a block of at most `largest` m. Without one,
/// returns after how many seconds to look again.
#[inline(always)]
fn plan<S: Simd>(
    simd: S,
    split: &Split,
    chain: &Chain,
    interface: &mut Interface,
    drive: &Harmonic,
    largest: f64,
    bounds: LeapBounds,
) -> Result<PlannedLeap, f64> {
    let LeapBounds { horizon, error, .. } = bounds;
    // Worth another try after some e-foldings of the free motion, or after the next event.
    let wait = (0.7 / split.decay_rate).min(horizon);
    let decay = if largest <= error {
        0.0
    } else {
        libm::log(largest / error) / split.decay_rate
    };
    if decay >= horizon {
        return Err(horizon);
    }
    let left = error / largest;
    if decay > 0.0 && !stays_clear(simd, chain, split, decay, left) {
        return Err(wait);
    }
    let FirstReached { elapsed, block } =
        first_reached(simd, chain, split, drive, [decay, horizon]);
    if elapsed <= decay && decay > 0.0 {
        return Err(wait);
    }
    if !elapsed.is_finite() {
        return Err(f64::INFINITY);
    }
    let force = split.driven(chain, 0).force(drive, chain.drive_stiffness);
    let segment = Segment {
        start: 0.0,
        duration: elapsed,
        path: ForcePath::Harmonic(force),
    };
    if largest > error
        && !hides_no_peak(
            simd,
            split,
            (chain, interface),
            drive,
            &segment,
            FreeEnd { after: decay, left },
            bounds,
        )
    {
        return Err(wait);
    }
    Ok(PlannedLeap {
        force,
        duration: elapsed,
        reached: block,
        is_whole: elapsed == horizon,
    })
}

/// What counts as the end of free motion.
#[derive(Clone, Copy, Debug)]
struct FreeEnd {
    /// In s after the start of the leap.
    after: f64,
    /// Part of the bound on free motion that remains then.
    left: f64,
}

/// Whether free motion hides no largest shear force: one as large is on record, or comes later in the segment, or comes
/// after it, in this cycle and before any break.
#[inline(always)]
fn hides_no_peak<S: Simd>(
    simd: S,
    split: &Split,
    (chain, interface): (&Chain, &mut Interface),
    drive: &Harmonic,
    segment: &Segment<'static>,
    FreeEnd { after, left }: FreeEnd,
    LeapBounds {
        start,
        horizon,
        until_cycle_end,
        largest_force,
        ..
    }: LeapBounds,
) -> bool {
    let swing = chain.drive_stiffness * split.rows[0].bound[0];
    let driven = |seconds: f64| Segment {
        duration: seconds,
        ..*segment
    };
    let now = segment.force_after(0.0);
    let later = segment.force_after(after);
    let highest = if drive.amplitude == 0.0 {
        // A rising line and a decaying bound: largest at an end.
        (now + swing).max(later + left * swing)
    } else {
        driven(after)
            .maximum_above(f64::NEG_INFINITY)
            .map_or(f64::INFINITY, |largest| largest.value)
            + swing
    };
    if highest <= largest_force
        || (segment.duration > after && segment.maximum_above(highest).is_some())
    {
        return true;
    }
    let rate = chain.drive_stiffness * (drive.rate - split.driven(chain, 0).rate);
    let further = if drive.amplitude == 0.0 {
        3.0 * (highest - later) / rate
    } else {
        (LOOK_AHEAD / chain.damping_rate).min(TAU / drive.angular_frequency)
    };
    let mut ahead = (after + further).min(until_cycle_end);
    if ahead > horizon {
        // Nor does a contact break that attaches on the way.
        interface.look_ahead(|due, block, life| {
            let speed = split.largest_speed(drive, chain.layout.slot(block));
            ahead = ahead.min(due - start + life.reach / speed);
            due - start < ahead
        });
    }
    driven(ahead)
        .maximum_above(highest + left * swing)
        .is_some()
        && stays_clear(simd, chain, split, ahead, left)
}

/// Tries to leap, on the grid over reattachments, and moves the state on; see [`plan`]. `audit` receives the energies.
#[inline(always)]
pub(super) fn leap<S: Simd>(
    simd: S,
    split: &mut Split,
    Slider {
        chain,
        state,
        interface,
    }: &mut Slider,
    drive: &Harmonic,
    mut bounds: LeapBounds,
    audit: Option<&Audit>,
) -> Result<PlannedLeap, f64> {
    let largest = split
        .update(simd, chain, drive, state)
        .ok_or((2.0 / chain.damping_rate).min(bounds.horizon))?;
    if let Some(passing) = bounds.passing {
        bounds.horizon =
            passing_horizon(split, (chain, interface), drive, bounds, passing, largest)?;
    }
    let mut plan = plan(simd, split, chain, interface, drive, largest, bounds)?;
    if bounds.until_cut < plan.duration {
        // As long as more free motion is left, no contact changes, and steps can follow it.
        if largest * libm::exp(-split.decay_rate * bounds.until_cut) > LOOSE * bounds.error {
            return Err(bounds.until_cut);
        }
        plan.duration = bounds.until_cut;
        plan.reached = None;
    }
    if let Some(audit) = audit {
        let left_out = chain.mass * free_energy(chain, drive, split, state);
        audit.left_out.update(|sum| sum + left_out);
        let damping = damping_loss(chain, drive, split, plan.duration);
        audit.damping.update(|sum| sum + damping);
    }
    follow(simd, split, drive, plan.duration, state);
    Ok(plan)
}

/// Energy of the free motion, by mass: E(x_p + y) - E(x_p) = yᵀ (S (x_p + y/2) - b - drive) + m w (v_p + w/2).
fn free_energy(chain: &Chain, drive: &Harmonic, split: &Split, state: &State) -> f64 {
    let coupling = chain.coupling[0][0];
    let mut energy = 0.0;
    let mut before = [0.0; 2];
    for j in 0..chain.layout.blocks {
        let driven = split.driven(chain, j);
        let [real, imaginary] = driven.wave;
        let x = driven.start + real;
        let v = driven.rate - drive.angular_frequency * imaginary;
        let y = chain.at(&state.displacement, j) - x;
        let w = chain.at(&state.velocity, j) - v;
        let middle = x + 0.5 * y;
        let mut force = chain.at(&chain.diagonal, j) * middle - chain.at(&chain.pull, j);
        if j == 0 {
            force -= chain.drive_stiffness / chain.mass * drive.value(0.0);
        }
        energy += y * force + w * (v + 0.5 * w);
        if j > 0 {
            // The two off-diagonal terms of the pair, y_j m_{j-1} + y_{j-1} m_j.
            energy -= coupling * (y * before[1] + before[0] * middle);
        }
        before = [y, middle];
    }
    energy
}

/// Damping loss along the driven solution in `elapsed` s, in J, in closed form: the velocity is p1 - ω Im(q e^{iωt}).
fn damping_loss(chain: &Chain, drive: &Harmonic, split: &Split, elapsed: f64) -> f64 {
    let frequency = drive.angular_frequency;
    // Σ p1², Σ p1 q, Σ |q|² and Σ q².
    let mut ramp = 0.0;
    let mut mixed = [0.0; 2];
    let mut size = 0.0;
    let mut square = [0.0; 2];
    for j in 0..chain.layout.blocks {
        let driven = split.driven(chain, j);
        let rate = driven.rate;
        let [real, imaginary] = driven.wave;
        ramp += rate * rate;
        mixed = [mixed[0] + rate * real, mixed[1] + rate * imaginary];
        size += real * real + imaginary * imaginary;
        square = [
            square[0] + real * real - imaginary * imaginary,
            square[1] + 2.0 * real * imaginary,
        ];
    }
    let mut integral = ramp * elapsed;
    if drive.amplitude > 0.0 {
        let (sine, versine) = sine_and_versine(frequency, elapsed);
        let (sine_twice, versine_twice) = sine_and_versine(2.0 * frequency, elapsed);
        integral -= 2.0 * (mixed[0] * versine + mixed[1] * sine);
        let swing = 0.5 * (square[0] * sine_twice - square[1] * versine_twice);
        integral += 0.5 * frequency * (size * frequency * elapsed - swing);
    }
    chain.mass * chain.damping_rate * integral
}

/// sin ωt and 1 - cos ωt; whole turns are taken off first.
fn sine_and_versine(frequency: f64, elapsed: f64) -> (f64, f64) {
    let angle = TAU * (frequency * elapsed / TAU).fract();
    let half = libm::sin(0.5 * angle);
    (libm::sin(angle), 2.0 * half * half)
}

/// Whether no block can reach a break position within `seconds`, at the end of which a part `left` of the free motion's
/// bound remains.
#[inline(always)]
fn stays_clear<S: Simd>(simd: S, chain: &Chain, split: &Split, seconds: f64, left: f64) -> bool {
    let seconds = simd.splat(seconds);
    let left = simd.splat(left);
    let mut clear = u8::MAX;
    for ((row, upper), lower) in split.rows.iter().zip(&chain.upper).zip(&chain.lower) {
        let start = simd.load(&row.start);
        let bound = simd.load(&row.bound);
        let swing = simd.load(&row.swing);
        // Ramp and decaying bound together are convex in time: largest at the ends.
        let late = start
            .plus(simd.load(&row.rate[0]).times(seconds))
            .plus(left.times(bound));
        let highest = late.larger(start.plus(bound)).plus(swing);
        clear &= simd.load(upper).reaches(highest);
        clear &= start.minus(bound).minus(swing).reaches(simd.load(lower));
    }
    clear == u8::MAX
}

/// Where a leap ends at the latest.
struct FirstReached {
    /// In s after the start of the leap.
    elapsed: f64,
    /// The block that reaches a break position then; `None` if the horizon comes first.
    block: Option<usize>,
}

/// The first instant in [`from`, `horizon`], in s, at which a block reaches a break position.
#[inline(always)]
fn first_reached<S: Simd>(
    simd: S,
    chain: &Chain,
    split: &Split,
    drive: &Harmonic,
    [from, horizon]: [f64; 2],
) -> FirstReached {
    let mut first = FirstReached {
        elapsed: horizon,
        block: None,
    };
    let mut until = f64::NAN;
    let mut ends = [(0.0, 0.0); 2];
    let mut bend = 0.0;
    for (r, row) in split.rows.iter().enumerate() {
        if until != first.elapsed {
            // The cosine exceeds its ends by no more than it bends in between; over long times it is anything up to
            // |q|.
            until = first.elapsed;
            let half = 0.5 * drive.angular_frequency * (until - from);
            let is_short = drive.amplitude > 0.0 && half < 1.0;
            ends = if is_short {
                [from, until].map(|at| libm::sincos(drive.turn(at)))
            } else {
                [(0.0, 0.0); 2]
            };
            bend = if is_short { 0.5 * half * half } else { 1.0 };
        }
        let start = simd.load(&row.start);
        let rate = simd.load(&row.rate[0]);
        let at_start = start
            .plus(rate.times(simd.splat(from)))
            .plus(turned(simd, row, ends[0]));
        let at_end = start
            .plus(rate.times(simd.splat(until)))
            .plus(turned(simd, row, ends[1]));
        let beyond = simd.load(&row.swing).times(simd.splat(bend));
        let highest = at_start.larger(at_end).plus(beyond);
        let lowest = at_start.smaller(at_end).minus(beyond);
        let mut lanes = highest.reaches(simd.load(&chain.upper[r]))
            | simd.load(&chain.lower[r]).reaches(lowest);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            let block = chain.layout.block(Slot { row: r, lane });
            let levels = [chain.lower[r][lane], chain.upper[r][lane]];
            let elapsed = split
                .driven(chain, block)
                .reaches(drive, levels, [from, first.elapsed]);
            if elapsed < first.elapsed {
                first = FirstReached {
                    elapsed,
                    block: Some(block),
                };
            }
            lanes &= lanes - 1;
        }
    }
    first
}

/// Moves a state on along the driven solution, by `elapsed` s.
#[inline(always)]
fn follow<S: Simd>(simd: S, split: &Split, drive: &Harmonic, elapsed: f64, state: &mut State) {
    let (sine, cosine) = libm::sincos(drive.turn(elapsed));
    let elapsed = simd.splat(elapsed);
    let frequency = simd.splat(drive.angular_frequency);
    for ((row, x), v) in split
        .rows
        .iter()
        .zip(&mut state.displacement)
        .zip(&mut state.velocity)
    {
        let start = simd.load(&row.start);
        let rate = simd.load(&row.rate[0]);
        start
            .plus(rate.times(elapsed))
            .plus(turned(simd, row, (sine, cosine)))
            .store(x);
        // -ω Im(q e^{iφ}): ω times the real part a quarter of a turn ahead.
        rate.plus(frequency.times(turned(simd, row, (cosine, -sine))))
            .store(v);
    }
}

/// Re(q e^{iφ}) from sine and cosine of φ, in m.
#[inline(always)]
fn turned<S: Simd>(simd: S, row: &SplitRow, (sine, cosine): (f64, f64)) -> S::Vector {
    let [real, imaginary] = &row.wave;
    simd.load(real)
        .times(simd.splat(cosine))
        .minus(simd.load(imaginary).times(simd.splat(sine)))
}

#[cfg(test)]
mod tests {
    use super::split::BlockMotion;
    use super::*;
    use crate::model::Parameters;
    use pulp::Scalar512b as Baseline;

    #[test]
    fn a_leap_ends_where_the_first_block_reaches_a_break_position() {
        let parameters = Parameters {
            blocks: 21,
            ..Parameters::default()
        };
        let plain = Harmonic {
            start: 3e-6,
            rate: 1e-4,
            amplitude: 0.0,
            phase: 0.0,
            angular_frequency: 0.0,
        };
        let phases = (0..200).map(|i| 0.1 * f64::from(i));
        let modulated = phases.map(|phase| Harmonic {
            amplitude: 1e-6,
            phase,
            angular_frequency: 364.0,
            ..plain
        });
        let mut slider = Slider::new(&parameters);
        let mut split = Split::new(&slider.chain);
        for (case, drive) in std::iter::once(plain).chain(modulated).enumerate() {
            let close = [0.01, 0.5, 0.9, 10.0][case % 4];
            let Slider { chain, state, .. } = &mut slider;
            split.update(Baseline, chain, &drive, state).unwrap();
            let blocks: Vec<BlockMotion> =
                (0..21).map(|block| split.driven(chain, block)).collect();
            for (block, motion) in blocks.iter().enumerate() {
                let Slot { row, lane } = chain.layout.slot(block);
                let away = close * (1.0 + (block * 8 % 21) as f64 / 42.0);
                chain.upper[row][lane] = motion.start + away * (motion.swing + 1e-3 * motion.rate);
                chain.lower[row][lane] = motion.start - away.max(0.999) * motion.swing - 1e-20;
                split.rows[row].bound[lane] = 0.0;
            }
            let is_beyond = |block: usize, seconds: f64| {
                let x = blocks[block].displacement(&drive, seconds);
                let Slot { row, lane } = chain.layout.slot(block);
                x >= chain.upper[row][lane] + 1e-16 || x <= chain.lower[row][lane] - 1e-16
            };
            for horizon in [1e-4, 1e-3, 4e-3, 0.01, 0.1, f64::INFINITY] {
                let FirstReached { elapsed, block } =
                    first_reached(Baseline, chain, &split, &drive, [1e-6, horizon]);
                assert!(block.is_some() || elapsed == horizon);
                let sample = |i: u32| 1e-6 + 0.999 * (elapsed - 1e-6) * f64::from(i) / 100.0;
                let mut samples = (0..21).flat_map(|block| (0..100).map(move |i| (block, i)));
                let early =
                    samples.find(|&(block, i)| elapsed > 1e-6 && is_beyond(block, sample(i)));
                assert_eq!(early, None, "{elapsed} s, at {drive:?}");
                if let Some(block) = block {
                    assert!(
                        (1..100).any(|i| is_beyond(block, elapsed + 1e-7 * f64::from(i))),
                        "{block} is not there"
                    );
                    assert!(!stays_clear(Baseline, chain, &split, elapsed + 1e-5, 0.0));
                }
                if elapsed.is_finite() {
                    follow(Baseline, &split, &drive, elapsed, state);
                    for (block, motion) in blocks.iter().enumerate() {
                        let expected = motion.displacement(&drive, elapsed);
                        assert!(
                            (chain.at(&state.displacement, block) - expected).abs()
                                < 1e-15 * expected.abs().max(1e-6)
                        );
                    }
                }
            }
        }
    }
}
