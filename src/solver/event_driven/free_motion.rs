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

use super::chain::Chain;
use super::driven_solution::DrivenSolution;
use super::layout::Layout;
use crate::solver::harmonic::Harmonic;

/// Halvings of the decay rate after which free motion counts as undamped.
const MAX_HALVINGS: i32 = 40;

/// Minors of S/m that are taken before they are scaled again. Products of two series of them stay finite up to squared
/// frequencies of 1e38 1/s².
const MINORS_PER_SCALE: usize = 4;

/// Part of its diagonal entry that a pivot must exceed: less is rounding, and S' not surely positive definite.
const MIN_PIVOT: f64 = 1e-12;

/// The free motion at some instant, one entry a block.
#[derive(Clone, Debug)]
pub(super) struct FreeMotion {
    /// The rate a at which it surely decays, in 1/s.
    pub decay_rate: f64,
    /// Minors of S'/m from the leading and from the trailing edge: that which a block begins, and that which begins
    /// beyond it. A pivot is the first over the second.
    ahead: [Vec<f64>; 2],
    behind: [Vec<f64>; 2],
    /// y, in m.
    pub displacement: Vec<f64>,
    /// w + a y, in m/s.
    pub shifted_velocity: Vec<f64>,
    /// Bound on |y| from now on, before its decay, in m.
    pub bound: Vec<f64>,
    /// m (S'⁻¹)_jj, in s²: how far a force on a block displaces it, per mass.
    pub compliance: Vec<f64>,
}

/// The motion of the blocks, and what it is split into; one entry a block.
#[derive(Clone, Debug)]
pub(super) struct SplitMotion {
    pub displacement: Vec<f64>,
    pub velocity: Vec<f64>,
    pub driven: DrivenSolution,
    pub free: FreeMotion,
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
            compliance: zeros.clone(),
        };
        let driven = DrivenSolution::new(layout.blocks);
        Self { displacement: zeros.clone(), velocity: zeros, driven, free }
    }
}

/// Splits displacements and velocities into driven solution and free motion, and bounds the latter. Returns the largest
/// bound on a displacement, in m; `None` if the free motion does not decay.
#[inline(always)]
pub(super) fn split(chain: &Chain, drive: &Harmonic, motion: &mut SplitMotion) -> Option<f64> {
    let SplitMotion { displacement, velocity, driven, free } = motion;
    if !free.find_decay(chain, &mut driven.inverse_pivot) {
        return None;
    }
    driven.solve(chain, drive);
    free.take(displacement, velocity, driven, drive.angular_frequency);
    let energy = free.energy(chain);
    Some(free.update_bound(chain, energy))
}

impl FreeMotion {
    /// Finds the decay rate, from that of the last time, and eliminates; false if there is none.
    #[inline(always)]
    fn find_decay(&mut self, chain: &Chain, inverse_pivot: &mut [f64]) -> bool {
        let fastest = 0.5 * chain.damping_rate;
        self.decay_rate = fastest.min(4.0 * self.decay_rate);
        for _ in 0..MAX_HALVINGS {
            if self.eliminate(chain, inverse_pivot) {
                return true;
            }
            self.decay_rate *= 0.5;
        }
        self.decay_rate = fastest;
        false
    }

    /// a (γ - a), by which S/m is shifted, in 1/s².
    #[inline(always)]
    fn shift(&self, chain: &Chain) -> f64 {
        self.decay_rate * (chain.damping_rate - self.decay_rate)
    }

    /// Pivots of S/m and minors of S'/m from both ends; false if S' is not positive definite. A minor follows from the
    /// two before it, u_j = d_j u_{j+1} - c² u_{j+2}, so that few blocks wait for a division.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "without branches the loop runs in vectors")]
    fn eliminate(&mut self, chain: &Chain, inverse_pivot: &mut [f64]) -> bool {
        let blocks = chain.layout.blocks;
        let shift = self.shift(chain);
        let squared = chain.coupling[0][0] * chain.coupling[0][0];
        let diagonal = &chain.per_block.diagonal[..blocks];
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
    fn energy(&self, chain: &Chain) -> f64 {
        let twice_coupling = 2.0 * chain.coupling[0][0];
        let shift = self.shift(chain);
        let (mut energy, mut before) = (0.0, 0.0);
        for ((y, velocity), diagonal) in
            self.displacement.iter().zip(&self.shifted_velocity).zip(&chain.per_block.diagonal)
        {
            energy += velocity * velocity + y * ((diagonal - shift) * y - twice_coupling * before);
            before = *y;
        }
        0.5 * energy.max(0.0)
    }

    /// Bounds |y| for an E/m of `energy` m²/s²; returns the largest bound.
    #[inline(always)]
    fn update_bound(&mut self, chain: &Chain, energy: f64) -> f64 {
        let blocks = chain.layout.blocks;
        let shift = self.shift(chain);
        let [ahead, ahead_beyond] = self.ahead.each_ref().map(|minors| &minors[..blocks]);
        let [behind, behind_beyond] = self.behind.each_ref().map(|minors| &minors[..blocks]);
        let diagonal = &chain.per_block.diagonal[..blocks];
        let (bound, compliance) = (&mut self.bound[..blocks], &mut self.compliance[..blocks]);
        for j in 0..blocks {
            // 1/(ahead/beyond + behind/beyond - diagonal), with one division.
            let beyond = ahead_beyond[j] * behind_beyond[j];
            let own = ahead[j] * behind_beyond[j] + behind[j] * ahead_beyond[j] - (diagonal[j] - shift) * beyond;
            compliance[j] = beyond / own;
            bound[j] = (2.0 * energy * beyond / own).sqrt();
        }
        bound.iter().fold(0.0, |largest, bound| if *bound > largest { *bound } else { largest })
    }
}
