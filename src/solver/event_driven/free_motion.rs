//! The free motion about the driven solution, y = x - x_p, and a bound on it for each block.
//!
//! It is damped and undriven. With w = y', a rate a <= γ/2 and S' = S - m a (γ - a),
//!
//! ```text
//! E = ½ m |w + a y|² + ½ yᵀ S' y,    E' = -(γ - a) m |w + a y|² - a yᵀ S' y <= -2 a E,
//! |y_j(t)| <= sqrt(2 E (S'⁻¹)_jj) e^{-a t}
//! ```
//!
//! hold if S' is positive definite: a bound for each block, and its decay. With a = γ/2 it is sharp unless a mode is
//! overdamped; then a is halved until S' is positive definite.

use super::chain::{Chain, State};
use super::driven_solution::DrivenSolution;
use super::kernels::Kernels;
use super::layout::Layout;
use super::leap::Split;
use crate::solver::harmonic::Harmonic;

/// Halvings of the decay rate after which free motion counts as undamped.
const MAX_HALVINGS: i32 = 40;

/// Minors of S/m that are taken before they are scaled again. Products of two series of them stay finite up to squared
/// frequencies of 1e38 1/s².
const MINORS_PER_SCALE: usize = 4;

/// Part of its diagonal entry that a pivot must exceed: less is rounding, and S' not surely positive definite.
pub(super) const MIN_PIVOT: f64 = 1e-12;

/// The free motion at some instant, one entry a block.
#[derive(Clone, Debug)]
struct FreeMotion {
    /// The rate a at which it surely decays, in 1/s.
    decay_rate: f64,
    /// Minors of S'/m from the leading and from the trailing edge: that which a block begins, and that which begins
    /// beyond it. A pivot is the first over the second.
    ahead: [Vec<f64>; 2],
    behind: [Vec<f64>; 2],
    /// y, in m.
    displacement: Vec<f64>,
    /// w + a y, in m/s.
    shifted_velocity: Vec<f64>,
    /// Bound on |y| from now on, before its decay, in m.
    bound: Vec<f64>,
}

/// The motion of the blocks, and what it is split into; one entry a block.
#[derive(Clone, Debug)]
pub(super) struct SplitMotion {
    displacement: Vec<f64>,
    velocity: Vec<f64>,
    /// Those of the chain; see [`Chain`].
    diagonal: Vec<f64>,
    pull: Vec<f64>,
    driven: DrivenSolution,
    free: FreeMotion,
}

impl SplitMotion {
    pub fn new(layout: Layout) -> Self {
        let zeros = vec![0.0; layout.blocks];
        let two = || [zeros.clone(), zeros.clone()];
        let free = FreeMotion {
            decay_rate: f64::INFINITY,
            ahead: two(),
            behind: two(),
            displacement: zeros.clone(),
            shifted_velocity: zeros.clone(),
            bound: zeros.clone(),
        };
        let driven = DrivenSolution::new(layout.blocks);
        let [diagonal, pull, displacement] = [(); 3].map(|()| zeros.clone());
        Self { displacement, velocity: zeros, diagonal, pull, driven, free }
    }

    /// Splits a state, and writes rows of what a leap needs. Returns the same as [`split`].
    pub fn split(
        &mut self,
        chain: &Chain,
        kernels: &dyn Kernels,
        drive: &Harmonic,
        state: &State,
        into: &mut Split,
    ) -> Option<f64> {
        chain.layout.unfold(&state.displacement, &mut self.displacement);
        chain.layout.unfold(&state.velocity, &mut self.velocity);
        chain.layout.unfold(&chain.diagonal, &mut self.diagonal);
        chain.layout.unfold(&chain.pull, &mut self.pull);
        let largest = kernels.split(chain, drive, self)?;
        let (driven, free) = (&self.driven, &self.free);
        into.decay_rate = free.decay_rate;
        for block in 0..chain.layout.blocks {
            let (r, lane) = chain.layout.slot(block);
            let (row, [displaced, moved]) = (&mut into.rows[r], &mut into.propagator.here);
            let [real, imaginary] = driven.wave[block];
            (row.start[lane], row.rate[0][lane]) = (driven.start[block], driven.rate[block]);
            (row.wave[0][lane], row.wave[1][lane]) = (real, imaginary);
            row.swing[lane] = if drive.amplitude > 0.0 { libm::hypot(real, imaginary) } else { 0.0 };
            row.bound[lane] = free.bound[block];
            (displaced[r][lane], moved[r][lane]) = (free.displacement[block], free.shifted_velocity[block]);
        }
        Some(largest)
    }
}

/// Splits displacements and velocities into driven solution and free motion, and bounds the latter. Returns the largest
/// bound on a displacement, in m; `None` if the free motion does not decay.
#[inline(always)]
pub(super) fn split(chain: &Chain, drive: &Harmonic, motion: &mut SplitMotion) -> Option<f64> {
    let SplitMotion { displacement, velocity, diagonal, pull, driven, free } = motion;
    let mut decay_rate = free.decay_rate;
    let decays = find_decay(
        &mut decay_rate,
        chain,
        #[inline(always)]
        |decay_rate| {
            free.decay_rate = decay_rate;
            free.eliminate(chain, diagonal, &mut driven.inverse_pivot)
        },
    );
    free.decay_rate = decay_rate;
    if !decays {
        return None;
    }
    driven.solve(chain, diagonal, pull, drive);
    free.take(displacement, velocity, driven, drive.angular_frequency);
    let energy = free.energy(chain, diagonal);
    Some(free.update_bound(chain, diagonal, energy))
}

/// Finds the decay rate, from that of the last time, with which S' can be eliminated; false if there is none.
#[inline(always)]
pub(super) fn find_decay(decay_rate: &mut f64, chain: &Chain, mut eliminate: impl FnMut(f64) -> bool) -> bool {
    let fastest = 0.5 * chain.damping_rate;
    *decay_rate = fastest.min(4.0 * *decay_rate);
    for _ in 0..MAX_HALVINGS {
        if eliminate(*decay_rate) {
            return true;
        }
        *decay_rate *= 0.5;
    }
    *decay_rate = fastest;
    false
}

impl FreeMotion {
    /// a (γ - a), by which S/m is shifted, in 1/s².
    #[inline(always)]
    fn shift(&self, chain: &Chain) -> f64 {
        self.decay_rate * (chain.damping_rate - self.decay_rate)
    }

    /// Pivots of S/m and minors of S'/m from both ends; false if S' is not positive definite. A minor follows from the
    /// two before it, u_j = d_j u_{j+1} - c² u_{j+2}, so that few blocks wait for a division.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "without branches the loop runs in vectors")]
    fn eliminate(&mut self, chain: &Chain, diagonal: &[f64], inverse_pivot: &mut [f64]) -> bool {
        let blocks = chain.layout.blocks;
        let shift = self.shift(chain);
        let squared = chain.coupling[0][0] * chain.coupling[0][0];
        let diagonal = &diagonal[..blocks];
        let inverse = &mut inverse_pivot[..blocks];
        let [ahead, ahead_beyond] = self.ahead.each_mut().map(|minors| &mut minors[..blocks]);
        let [behind, behind_beyond] = self.behind.each_mut().map(|minors| &mut minors[..blocks]);
        // The last minor and the one before it: of S, of S' ahead and of S' behind.
        let mut minors = [[1.0, 0.0]; 3];
        for count in 0..blocks {
            let (far, near) = (blocks - 1 - count, count);
            let entries = [diagonal[far], diagonal[far] - shift, diagonal[near] - shift];
            if count % MINORS_PER_SCALE == 0 {
                for [last, before] in &mut minors {
                    *before /= *last;
                    *last = 1.0;
                }
            }
            let [last, last_ahead, last_behind] = minors.map(|[last, _]| last);
            for ([last, before], entry) in minors.iter_mut().zip(entries) {
                (*last, *before) = (entry.mul_add(*last, -squared * *before), *last);
            }
            inverse[far] = last / minors[0][0];
            (ahead[far], ahead_beyond[far]) = (minors[1][0], last_ahead);
            (behind[near], behind_beyond[near]) = (minors[2][0], last_behind);
        }
        (0..blocks).fold(true, |is_definite, j| {
            let least = MIN_PIVOT * (diagonal[j] - shift).abs();
            is_definite & (ahead[j] > least * ahead_beyond[j]) & (behind[j] > least * behind_beyond[j])
        })
    }

    /// Takes y and w + a y from displacements and velocities, in m and m/s.
    #[inline(always)]
    fn take(&mut self, displacement: &[f64], velocity: &[f64], driven: &DrivenSolution, frequency: f64) {
        let blocks = driven.start.len();
        let (start, rate, wave) = (&driven.start[..blocks], &driven.rate[..blocks], &driven.wave[..blocks]);
        let (displacement, velocity) = (&displacement[..blocks], &velocity[..blocks]);
        let (free, shifted) = (&mut self.displacement[..blocks], &mut self.shifted_velocity[..blocks]);
        for j in 0..blocks {
            let y = displacement[j] - start[j] - wave[j][0];
            // d/dt Re(q e^{iωt}) = -ω Im q at the start.
            let w = velocity[j] - rate[j] + frequency * wave[j][1];
            free[j] = y;
            shifted[j] = w + self.decay_rate * y;
        }
    }

    /// E/m, in m²/s².
    #[inline(always)]
    fn energy(&self, chain: &Chain, diagonal: &[f64]) -> f64 {
        let twice_coupling = 2.0 * chain.coupling[0][0];
        let shift = self.shift(chain);
        let (mut energy, mut before) = (0.0, 0.0);
        for ((y, velocity), diagonal) in self.displacement.iter().zip(&self.shifted_velocity).zip(diagonal) {
            energy += velocity * velocity + y * ((diagonal - shift) * y - twice_coupling * before);
            before = *y;
        }
        0.5 * energy.max(0.0)
    }

    /// Bounds |y| for an E/m of `energy` m²/s²; returns the largest bound.
    #[inline(always)]
    fn update_bound(&mut self, chain: &Chain, diagonal: &[f64], energy: f64) -> f64 {
        let blocks = chain.layout.blocks;
        let shift = self.shift(chain);
        let [ahead, ahead_beyond] = self.ahead.each_ref().map(|minors| &minors[..blocks]);
        let [behind, behind_beyond] = self.behind.each_ref().map(|minors| &minors[..blocks]);
        let diagonal = &diagonal[..blocks];
        let bound = &mut self.bound[..blocks];
        for j in 0..blocks {
            // 1/(ahead/beyond + behind/beyond - diagonal), with one division.
            let beyond = ahead_beyond[j] * behind_beyond[j];
            let own = ahead[j] * behind_beyond[j] + behind[j] * ahead_beyond[j] - (diagonal[j] - shift) * beyond;
            bound[j] = (2.0 * energy * beyond / own).sqrt();
        }
        bound.iter().fold(0.0, |largest, bound| if *bound > largest { *bound } else { largest })
    }
}
