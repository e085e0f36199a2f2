//! One step of the grid: a recurrence of two stencils, of fourth order in ω_max h.
//!
//! In short: displacements at the next point follow from those at this one, their increments and the forces there
//! ([`march`]). The coefficients lie in a [`GridStep`], and change where a contact does ([`GridStep::update`]). Steps end
//! where a block reaches a break position, for [`contacts`](super::contacts) to go on; where the motion leaves the grid,
//! [`velocity`] says how fast it is.
//!
//! With h constant, S the stiffness matrix of chain, contacts and driving spring, σ = γh/2, e = exp(-σ), Z = h² S/m, and
//! φ_n = h² f_n, where f_n is the force per mass at point n without the damping,
//!
//! ```text
//! x_{n+1} - x_n = e² (x_n - x_{n-1}) + e (g1 φ_n - g2 Z φ_n + g2 h² (h² K_d/m) (u'' + γ u')),
//! g1 = sinh σ/σ,   g2 = (cosh σ - sinh σ/σ)/(4 σ²) = 1/12 + σ²/120 + ...
//! ```
//!
//! The factor 2 e cos(√(Z - σ²)) of the exact recurrence of a damped oscillator is expanded in Z; the last term is what
//! the drive u, through its spring K_d, adds to the second derivative of the force. The recurrence is exact for damping,
//! for equilibrium and for uniform motion. The law of motion is how φ follows from the displacements: a pull, a diagonal
//! and couplings. The state is x_n and the increment q_n = x_n - x̃_{n-1}, where x̃ is the motion continued back under
//! the present law: an event changes these two, and no step is taken again.
//!
//! Steps are written twice: with the motion in registers and in memory. One loop for both costs 3 to 4 % of a run.

use crate::model::simd::{Simd, Vector};
use crate::model::{LANES, Parameters, Row};
use crate::solver::event_driven::moving_frame::StepDrive;
use crate::solver::event_driven::slider::{BlockLayout, Chain, FIRST_BLOCK, Slot, State};

/// Most steps in a call of [`march`].
pub(super) const MAX_RUN: usize = 64;

/// Row and lane of a block and of those beside.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockPlace {
    pub slot: Slot,
    pub before: Slot,
    pub after: Slot,
    /// 1 for each block beside that there is, else 0, and its slot is the block's own.
    pub shares: [f64; 2],
}

impl BlockPlace {
    fn new(layout: BlockLayout, block: usize) -> Self {
        let before = block.checked_sub(1);
        let after = Some(block + 1).filter(|after| *after < layout.blocks);
        let slot = |beside: Option<usize>| layout.slot(beside.unwrap_or(block));
        let share = |beside: Option<usize>| if beside.is_some() { 1.0 } else { 0.0 };
        Self {
            slot: layout.slot(block),
            before: slot(before),
            after: slot(after),
            shares: [share(before), share(after)],
        }
    }

    /// The sum of what both blocks beside have.
    #[inline(always)]
    pub fn beside(&self, rows: &[Row]) -> f64 {
        let Self {
            before,
            after,
            shares,
            ..
        } = self;
        let of = |slot: &Slot| rows[slot.row][slot.lane];
        shares[0].mul_add(of(before), shares[1] * of(after))
    }
}

/// Displacement at the end of a step and increment from its start, or what events add to them, in m.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Correction {
    pub displacement: f64,
    pub increment: f64,
}

/// What a step multiplies with, in units of h².
#[derive(Clone, Debug)]
pub struct GridStep {
    /// Length h, in s, its inverse and its square.
    pub length: f64,
    pub inverse_length: f64,
    pub square: f64,
    /// γh, and γh/6, 1 + γh/3, 1 - γh/3 over 1 - (γh)²/12: the weights of both ends in h² x''.
    pub damping: f64,
    pub damped: [f64; 3],
    /// 1/(1 + γh/3), and 1/K_d in m/N.
    pub inverse_end: f64,
    pub inverse_stiffness: f64,
    /// h²/m, in m/N.
    pub by_mass: f64,
    /// Sine and cosine of ωh, by which the modulation turns in a step.
    pub turn: [f64; 2],
    /// e², e g1 and e g2.
    decay: f64,
    first: f64,
    second: f64,
    /// h² K_int/m and h² K_d/m.
    pub coupling: f64,
    pub pulling: f64,
    /// The law, a lane for each block: h² times its pull; minus h² times the diagonal of S/m; e (g1 - g2 h² diagonal).
    pull: Vec<Row>,
    minus_diagonal: Vec<Row>,
    own_weight: Vec<Row>,
    /// Nearest break positions, in m.
    upper: Vec<Row>,
    lower: Vec<Row>,
    /// h² times the coupling, and e g2 times that; 0 in padding.
    couplings: Vec<Row>,
    second_couplings: Vec<Row>,
    /// Increments q_n, in m.
    pub increment: Vec<Row>,
    /// Room for φ_n, in m; steps in registers leave it alone.
    pub phi: Vec<Row>,
    /// Shear force at the points of the last run but the first, in N.
    pub trail: [f64; MAX_RUN],
    /// φ at the end of a step under its own law, in m; `None` unless the run is audited.
    pub end_phi: Option<Vec<Row>>,
    /// ∫ X'² ds summed over the blocks, in m²: over all steps of the last run, and over its last step; 0
    /// unless the run is audited.
    pub dissipation: f64,
    pub last_dissipation: f64,
    /// The blocks that reached a break position in the last step.
    pub reached: Vec<Slot>,
    pub(super) places: Vec<BlockPlace>,
    saved_displacement: Vec<Row>,
    saved_increment: Vec<Row>,
}

impl GridStep {
    pub fn new(parameters: &Parameters, chain: &Chain, length: f64) -> Self {
        let layout = chain.layout;
        let square = length * length;
        let half = 0.5 * parameters.damping_rate * length;
        let [g1, g2] = weights(half);
        let root_decay = libm::exp(-half);
        let mut step = Self {
            length,
            inverse_length: 1.0 / length,
            square,
            damping: 2.0 * half,
            damped: [half / 3.0, 1.0 + 2.0 / 3.0 * half, 1.0 - 2.0 / 3.0 * half]
                .map(|weight| weight / (1.0 - half * half / 3.0)),
            inverse_end: 1.0 / (1.0 + 2.0 / 3.0 * half),
            inverse_stiffness: 1.0 / chain.drive_stiffness,
            by_mass: square / chain.mass,
            turn: [0.0, 1.0],
            decay: root_decay * root_decay,
            first: root_decay * g1,
            second: root_decay * g2,
            coupling: square * chain.coupling[0][0],
            pulling: square * chain.drive_stiffness / chain.mass,
            pull: layout.filled(0.0),
            minus_diagonal: layout.filled(0.0),
            own_weight: layout.filled(0.0),
            upper: layout.filled(f64::INFINITY),
            lower: layout.filled(f64::NEG_INFINITY),
            couplings: chain.coupling.clone(),
            second_couplings: chain.coupling.clone(),
            increment: layout.filled(0.0),
            phi: layout.filled(0.0),
            trail: [0.0; MAX_RUN],
            end_phi: None,
            dissipation: 0.0,
            last_dissipation: 0.0,
            reached: Vec::new(),
            places: (0..layout.blocks)
                .map(|block| BlockPlace::new(layout, block))
                .collect(),
            saved_displacement: layout.filled(0.0),
            saved_increment: layout.filled(0.0),
        };
        for coupling in step.couplings.iter_mut().flat_map(|row| row.iter_mut()) {
            *coupling *= square;
        }
        for coupling in step
            .second_couplings
            .iter_mut()
            .flat_map(|row| row.iter_mut())
        {
            *coupling *= square * step.second;
        }
        step
    }

    /// Takes over the coefficients of all blocks.
    pub fn update_all(&mut self, chain: &Chain) {
        for row in 0..chain.layout.rows {
            for lane in 0..LANES {
                let diagonal = self.square * chain.diagonal[row][lane];
                self.pull[row][lane] = self.square * chain.pull[row][lane];
                self.minus_diagonal[row][lane] = -diagonal;
                self.own_weight[row][lane] = self.first - self.second * diagonal;
            }
        }
        self.upper.copy_from_slice(&chain.upper);
        self.lower.copy_from_slice(&chain.lower);
    }

    /// Takes over the force of a block's contacts: the diagonal of S in N/m, the pull in N, the nearest break positions
    /// in m.
    #[inline(always)]
    pub(super) fn update<S: Simd>(
        &mut self,
        simd: S,
        Slot { row, lane }: Slot,
        diagonal: f64,
        pull: f64,
        [upper, lower]: [f64; 2],
    ) {
        let diagonal = self.by_mass * diagonal;
        simd.set(&mut self.pull[row], lane, self.by_mass * pull);
        simd.set(&mut self.minus_diagonal[row], lane, -diagonal);
        simd.set(
            &mut self.own_weight[row],
            lane,
            self.first - self.second * diagonal,
        );
        simd.set(&mut self.upper[row], lane, upper);
        simd.set(&mut self.lower[row], lane, lower);
    }

    /// Gives the chain the coefficients of all blocks.
    pub fn hand_back(&self, chain: &mut Chain) {
        let by_square = 1.0 / self.square;
        for row in 0..chain.layout.rows {
            for lane in 0..LANES {
                chain.diagonal[row][lane] = -by_square * self.minus_diagonal[row][lane];
                chain.pull[row][lane] = by_square * self.pull[row][lane];
            }
        }
        chain.upper.copy_from_slice(&self.upper);
        chain.lower.copy_from_slice(&self.lower);
    }

    /// Adds the corrections to the motion of a block and of the blocks beside.
    #[inline(always)]
    pub(super) fn correct<S: Simd>(
        &mut self,
        simd: S,
        block: usize,
        [own, beside]: [Correction; 2],
        displacement: &mut [Row],
    ) {
        let BlockPlace {
            slot,
            before,
            after,
            shares,
        } = self.places[block];
        for (slot, by, share) in [
            (slot, own, 1.0),
            (before, beside, shares[0]),
            (after, beside, shares[1]),
        ] {
            add(simd, displacement, slot, share * by.displacement);
            add(simd, &mut self.increment, slot, share * by.increment);
        }
    }

    /// Adds what events change in the dissipation of the last step, in m².
    #[inline(always)]
    pub(super) fn add_dissipation(&mut self, change: f64) {
        self.dissipation += change;
        self.last_dissipation += change;
    }

    /// What φ of a block gains in a step, from the rises of it and of both blocks beside together, in m.
    #[inline(always)]
    pub(super) fn gain_of_phi(
        &self,
        place: &BlockPlace,
        rise: f64,
        beside: f64,
        drive: &StepDrive,
    ) -> f64 {
        let Slot { row, lane } = place.slot;
        let pulled = if place.slot == Slot::FIRST {
            self.pulling * drive.increment()
        } else {
            0.0
        };
        self.minus_diagonal[row][lane].mul_add(rise, self.coupling.mul_add(beside, pulled))
    }

    /// φ of a block at the displacements of it, of both blocks beside together, and of the drive, in m.
    #[inline(always)]
    pub(super) fn phi_on(&self, place: &BlockPlace, here: f64, beside: f64, driven: f64) -> f64 {
        let Slot { row, lane } = place.slot;
        let own = self.minus_diagonal[row][lane].mul_add(here, self.pull[row][lane]);
        let pulls = if place.slot == Slot::FIRST {
            self.pulling
        } else {
            0.0
        };
        pulls.mul_add(driven, self.coupling.mul_add(beside, own))
    }
}

/// g1 and g2 at σ.
fn weights(half: f64) -> [f64; 2] {
    if half < 0.1 {
        let square = half * half;
        let g1 = 1.0 + square / 6.0 * (1.0 + square / 20.0 * (1.0 + square / 42.0));
        let g2 = (1.0 + square / 10.0 * (1.0 + square / 28.0 * (1.0 + square / 54.0))) / 12.0;
        [g1, g2]
    } else {
        let g1 = libm::sinh(half) / half;
        [g1, (libm::cosh(half) - g1) / (4.0 * half * half)]
    }
}

#[inline(always)]
pub(super) fn add<S: Simd>(simd: S, rows: &mut [Row], Slot { row, lane }: Slot, value: f64) {
    let sum = rows[row][lane] + value;
    simd.set(&mut rows[row], lane, sum);
}

/// Takes at most `steps` steps, and none after one in which a block reaches a break position. Returns how many. `R` is the
/// number of rows, or 0 for any.
#[inline(always)]
pub(super) fn march<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    step: &mut GridStep,
    drive: &mut StepDrive,
    displacement: &mut [Row],
    steps: usize,
) -> usize {
    let steps = steps.min(MAX_RUN);
    step.reached.clear();
    step.dissipation = 0.0;
    step.last_dissipation = 0.0;
    if R > 0 && S::HAS_MANY_REGISTERS && step.end_phi.is_none() {
        march_in_registers::<S, R>(simd, chain, step, drive, displacement, steps)
    } else {
        march_in_memory::<S, R>(simd, chain, step, drive, displacement, steps)
    }
}

/// The steps of [`march`], with the motion in registers.
#[inline(always)]
fn march_in_registers<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    step: &mut GridStep,
    drive: &mut StepDrive,
    displacement: &mut [Row],
    steps: usize,
) -> usize {
    let displacement = &mut displacement[..R];
    let increment = &mut step.increment[..R];
    let pull = &step.pull[..R];
    let minus_diagonal = &step.minus_diagonal[..R];
    let own_weight = &step.own_weight[..R];
    let couplings = &step.couplings[..R];
    let second_couplings = &step.second_couplings[..R];
    let upper = &step.upper[..R];
    let lower = &step.lower[..R];
    let first_lane = simd.load(&FIRST_BLOCK);
    let decay = simd.splat(step.decay);
    let mut x = [first_lane; R];
    let mut q = [first_lane; R];
    let mut f = [first_lane; R];
    for r in 0..R {
        x[r] = simd.load(&displacement[r]);
        q[r] = simd.load(&increment[r]);
    }
    let mut done = 0;
    let mut reached = [0_u8; R];
    let mut is_any = false;
    while done < steps && !is_any {
        let [push, correction] = pushes(step.pulling, step.second, step.damping, drive);
        for r in 0..R {
            let before = if r > 0 {
                x[r - 1]
            } else {
                x[R - 1].to_next_lane()
            };
            let after = if r + 1 < R {
                x[r + 1]
            } else {
                x[0].to_lane_before()
            };
            let mut own = simd.load(&pull[r]);
            if r == 0 {
                own = first_lane.mul_add(simd.splat(push), own);
            }
            let own = x[r].mul_add(simd.load(&minus_diagonal[r]), own);
            f[r] = before.plus(after).mul_add(simd.load(&couplings[r]), own);
        }
        for r in 0..R {
            let before = if r > 0 {
                f[r - 1]
            } else {
                f[R - 1].to_next_lane()
            };
            let after = if r + 1 < R {
                f[r + 1]
            } else {
                f[0].to_lane_before()
            };
            let mut kept = q[r].times(decay);
            if r == 0 {
                kept = first_lane.mul_add(simd.splat(correction), kept);
            }
            let own = f[r].mul_add(simd.load(&own_weight[r]), kept);
            q[r] = before
                .plus(after)
                .mul_add(simd.load(&second_couplings[r]), own);
            x[r] = x[r].plus(q[r]);
            reached[r] = x[r].reaches(simd.load(&upper[r])) | simd.load(&lower[r]).reaches(x[r]);
        }
        is_any = reached.iter().fold(0, |any, lanes| any | lanes) != 0;
        drive.advance(step.turn);
        x[0].store(&mut displacement[0]);
        step.trail[done] = chain.drive_stiffness * (drive.displacement() - displacement[0][0]);
        done += 1;
    }
    for r in 0..R {
        x[r].store(&mut displacement[r]);
        q[r].store(&mut increment[r]);
    }
    if is_any {
        // At most sixteen rows have registers.
        let mut bits = reached
            .iter()
            .rev()
            .fold(0_u128, |bits, lanes| bits << LANES | u128::from(*lanes));
        while bits != 0 {
            let first = bits.trailing_zeros() as usize;
            step.reached.push(Slot {
                row: first / LANES,
                lane: first % LANES,
            });
            bits &= bits - 1;
        }
    }
    done
}

/// The same for any number of rows, with the motion in memory.
#[inline(always)]
fn march_in_memory<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    step: &mut GridStep,
    drive: &mut StepDrive,
    displacement: &mut [Row],
    steps: usize,
) -> usize {
    let rows = if R == 0 { chain.layout.rows } else { R };
    let x = &mut displacement[..rows];
    let last = rows - 1;
    let q = &mut step.increment[..rows];
    let phi = &mut step.phi[..rows];
    let law = [&step.pull, &step.minus_diagonal, &step.couplings].map(|rows_of| &rows_of[..rows]);
    let own_weight = &step.own_weight[..rows];
    let second_couplings = &step.second_couplings[..rows];
    let upper = &step.upper[..rows];
    let lower = &step.lower[..rows];
    let first_lane = simd.load(&FIRST_BLOCK);
    let decay = simd.splat(step.decay);
    for done in 1..=steps {
        let [push, correction] = pushes(step.pulling, step.second, step.damping, drive);
        write_phi(simd, x, law, push, phi);
        // The increments, and where they take the blocks.
        let mut before = simd.load(&phi[last]).to_next_lane();
        let mut here = simd.load(&phi[0]);
        let beyond = here.to_lane_before();
        let mut reached = 0;
        for r in 0..rows {
            let after = if r < last {
                simd.load(&phi[r + 1])
            } else {
                beyond
            };
            let mut kept = simd.load(&q[r]).times(decay);
            if r == 0 {
                kept = first_lane.mul_add(simd.splat(correction), kept);
            }
            let own = here.mul_add(simd.load(&own_weight[r]), kept);
            let next = before
                .plus(after)
                .mul_add(simd.load(&second_couplings[r]), own);
            let moved = simd.load(&x[r]).plus(next);
            next.store(&mut q[r]);
            moved.store(&mut x[r]);
            reached |= moved.reaches(simd.load(&upper[r])) | simd.load(&lower[r]).reaches(moved);
            (before, here) = (here, after);
        }
        drive.advance(step.turn);
        step.trail[done - 1] = chain.drive_stiffness * (drive.displacement() - x[0][0]);
        if let Some(end_phi) = &mut step.end_phi {
            write_phi(simd, x, law, step.pulling * drive.displacement(), end_phi);
            step.last_dissipation = dissipation(simd, step.damping, step.damped, [phi, end_phi], q);
            step.dissipation += step.last_dissipation;
        }
        if reached != 0 {
            note_reached(simd, [&step.upper, &step.lower], x, &mut step.reached);
            return done;
        }
    }
    steps
}

/// φ of every block at these displacements, under a law of pull, diagonal and coupling, with this push of the drive.
#[inline(always)]
fn write_phi<S: Simd>(
    simd: S,
    x: &[Row],
    [pull, minus_diagonal, couplings]: [&[Row]; 3],
    push: f64,
    phi: &mut [Row],
) {
    let last = x.len() - 1;
    let first_lane = simd.load(&FIRST_BLOCK);
    let mut before = simd.load(&x[last]).to_next_lane();
    let mut here = simd.load(&x[0]);
    let beyond = here.to_lane_before();
    for r in 0..x.len() {
        let after = if r < last {
            simd.load(&x[r + 1])
        } else {
            beyond
        };
        let mut own = simd.load(&pull[r]);
        if r == 0 {
            own = first_lane.mul_add(simd.splat(push), own);
        }
        let own = here.mul_add(simd.load(&minus_diagonal[r]), own);
        before
            .plus(after)
            .mul_add(simd.load(&couplings[r]), own)
            .store(&mut phi[r]);
        (before, here) = (here, after);
    }
}

/// ∫ X'² ds over a step, summed over the blocks, in m², from φ at both ends and the increments: with X as in
/// [`contacts`](super::contacts), each adds q² + (4 a0² + 7 a0 a1 + 4 a1²)/180.
#[inline(always)]
fn dissipation<S: Simd>(
    simd: S,
    damping: f64,
    damped: [f64; 3],
    [first_phi, last_phi]: [&[Row]; 2],
    increment: &[Row],
) -> f64 {
    let damping = simd.splat(-damping);
    let [across, along_first, along_last] = damped.map(|weight| simd.splat(weight));
    let mut sum = simd.splat(0.0);
    for (r, increment) in increment.iter().enumerate() {
        let q = simd.load(increment);
        let from = q.mul_add(damping, simd.load(&first_phi[r]));
        let to = q.mul_add(damping, simd.load(&last_phi[r]));
        let first = across.mul_add(to, along_first.times(from));
        let last = along_last.times(to).minus(across.times(from));
        let squares = first.mul_add(first, last.times(last));
        let bends = squares.mul_add(simd.splat(4.0), first.times(last).times(simd.splat(7.0)));
        sum = q.mul_add(q, bends.mul_add(simd.splat(1.0 / 180.0), sum));
    }
    sum.reduce(|a, b| a + b)
}

/// What the drive adds to φ of block 1, and to its increment directly, in m.
#[inline(always)]
fn pushes(pulling: f64, second: f64, damping: f64, drive: &StepDrive) -> [f64; 2] {
    [
        pulling * drive.displacement(),
        second * pulling * (drive.bend() + damping * drive.increment()),
    ]
}

/// Notes every block at or beyond a break position.
#[inline(always)]
fn note_reached<S: Simd>(simd: S, [upper, lower]: [&[Row]; 2], x: &[Row], reached: &mut Vec<Slot>) {
    for (row, ((x, upper), lower)) in x.iter().zip(upper).zip(lower).enumerate() {
        let x = simd.load(x);
        let mut lanes = x.reaches(simd.load(upper)) | simd.load(lower).reaches(x);
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            reached.push(Slot { row, lane });
            lanes &= lanes - 1;
        }
    }
}

/// Writes the velocities at the present point, in m/s, from a step on a copy: the central difference less the part of
/// the third derivative, which follows from the derivative of the law of motion.
#[inline(always)]
pub fn velocity<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    step: &mut GridStep,
    drive: &StepDrive,
    state: &mut State,
) {
    let rows = if R == 0 { chain.layout.rows } else { R };
    step.saved_displacement.copy_from_slice(&state.displacement);
    step.saved_increment.copy_from_slice(&step.increment);
    let mut ahead = *drive;
    march_in_memory::<S, R>(simd, chain, step, &mut ahead, &mut state.displacement, 1);
    state.displacement.copy_from_slice(&step.saved_displacement);
    // Central differences take the room of the saved displacements, and what damping adds to the third derivative that
    // of the increments.
    let central = &mut step.saved_displacement[..rows];
    let damped = &mut step.increment[..rows];
    let damping = simd.splat(-step.damping);
    for r in 0..rows {
        let before = simd.load(&step.saved_increment[r]);
        let sum = before.plus(simd.load(&damped[r]));
        let mean = sum.times(simd.splat(0.5));
        mean.store(&mut central[r]);
        let bend = mean.mul_add(damping, simd.load(&step.phi[r]));
        bend.times(damping).store(&mut damped[r]);
    }
    let law = [
        &*damped,
        &step.minus_diagonal[..rows],
        &step.couplings[..rows],
    ];
    let third = &mut step.phi[..rows];
    write_phi(simd, central, law, step.pulling * drive.increment(), third);
    for r in 0..rows {
        let third = simd.load(&third[r]);
        let increment = third.mul_add(simd.splat(-1.0 / 6.0), simd.load(&central[r]));
        let velocity = increment.times(simd.splat(step.inverse_length));
        velocity.store(&mut state.velocity[r]);
    }
    step.increment.copy_from_slice(&step.saved_increment);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Drive;
    use crate::solver::event_driven::moving_frame::{MovingFrame, SPAN};
    use crate::solver::event_driven::slider::Slider;
    use pulp::Scalar512b as Baseline;

    /// A slider of ten blocks with all its contacts, far from any break position.
    fn parameters() -> Parameters {
        Parameters {
            blocks: 10,
            mean_threshold: 1e6,
            threshold_deviation: 0.0,
            ..Parameters::default()
        }
    }

    /// A slider on the grid, from the present and the displacements one step before.
    fn on_grid(
        parameters: &Parameters,
        length: f64,
        x: &[f64],
        before: &[f64],
    ) -> (Slider, GridStep, StepDrive) {
        let mut slider = Slider::new(parameters);
        let layout = slider.chain.layout;
        let mut step = GridStep::new(parameters, &slider.chain, length);
        step.update_all(&slider.chain);
        for block in 0..layout.blocks {
            let Slot { row, lane } = layout.slot(block);
            slider.state.displacement[row][lane] = x[block];
            step.increment[row][lane] = x[block] - before[block];
        }
        (
            slider,
            step,
            MovingFrame::new(Drive::new(parameters), SPAN).step_drive(length),
        )
    }

    fn take(slider: &mut Slider, step: &mut GridStep, drive: &mut StepDrive, mut steps: usize) {
        while steps > 0 {
            steps -= march::<_, 0>(
                Baseline,
                &slider.chain,
                step,
                drive,
                &mut slider.state.displacement,
                steps,
            );
        }
    }

    #[test]
    fn uniform_motion_is_exact() {
        // Without contacts, with the spring stretched by what damping takes: every block at the velocity of the drive.
        let bare = Parameters {
            contact_stiffness: 1e-30,
            damping_rate: 1e4,
            ..parameters()
        };
        let length = 2e-6;
        let velocity = bare.drive_velocity;
        // The tension between blocks falls by mγV0 from one to the next.
        let drag = bare.block_mass() * bare.damping_rate * velocity;
        let mut start = vec![-drag * bare.blocks as f64 / bare.drive_stiffness; bare.blocks];
        for j in 1..bare.blocks {
            start[j] = start[j - 1] - drag * (bare.blocks - j) as f64 / bare.coupling_stiffness();
        }
        let at = |steps: f64| {
            start
                .iter()
                .map(|x| x + velocity * length * steps)
                .collect::<Vec<_>>()
        };
        let (mut slider, mut step, mut drive) = on_grid(&bare, length, &at(0.0), &at(-1.0));
        take(&mut slider, &mut step, &mut drive, 1000);
        for (x, expected) in slider.displacements().zip(at(1000.0)) {
            assert!(
                (x - expected).abs() < 1e-12 * expected.abs().max(1e-9),
                "{x} instead of {expected}"
            );
        }
    }

    #[test]
    fn the_error_of_a_mode_falls_sixteenfold_when_the_step_is_halved() {
        // One block on its contacts and its spring: x'' + γ x' + ω² x = 0, about an equilibrium that does not move.
        let one = Parameters {
            blocks: 1,
            drive_velocity: 1e-30,
            damping_rate: 500.0,
            ..parameters()
        };
        let squared = (one.drive_stiffness + one.block_contact_stiffness()) / one.block_mass();
        let half = 0.5 * one.damping_rate;
        let frequency = (squared - half * half).sqrt();
        let exact = |t: f64| 1e-6 * libm::exp(-half * t) * libm::cos(frequency * t);
        let time = 20.0 / frequency;
        let error = |steps: usize| {
            let length = time / steps as f64;
            let (mut slider, mut step, mut drive) =
                on_grid(&one, length, &[exact(0.0)], &[exact(-length)]);
            take(&mut slider, &mut step, &mut drive, steps);
            (slider.displacement(0) - exact(time)).abs() / 1e-6
        };
        let errors = [40, 80, 160, 320].map(error);
        for pair in errors.windows(2) {
            assert!((14.0..18.0).contains(&(pair[0] / pair[1])), "{errors:?}");
        }
        // h = 1/(2 ω).
        assert!(errors[0] < 1e-2, "{errors:?}");
    }

    #[test]
    fn velocities_are_of_fourth_order_and_taking_them_moves_nothing() {
        let one = Parameters {
            blocks: 1,
            drive_velocity: 1e-30,
            ..parameters()
        };
        let squared = (one.drive_stiffness + one.block_contact_stiffness()) / one.block_mass();
        let half = 0.5 * one.damping_rate;
        let frequency = (squared - half * half).sqrt();
        let exact = |t: f64| 1e-6 * libm::exp(-half * t) * libm::cos(frequency * t + 0.5);
        let rate = -1e-6 * (half * libm::cos(0.5) + frequency * libm::sin(0.5));
        let error = |length: f64| {
            let (mut slider, mut step, drive) =
                on_grid(&one, length, &[exact(0.0)], &[exact(-length)]);
            let before = (slider.displacement(0), step.increment[0][0]);
            velocity::<_, 0>(
                Baseline,
                &slider.chain,
                &mut step,
                &drive,
                &mut slider.state,
            );
            assert_eq!(before, (slider.displacement(0), step.increment[0][0]));
            (slider.state.velocity[0][0] / rate - 1.0).abs()
        };
        let errors = [0.5, 0.25, 0.125].map(|angle| error(angle / frequency));
        for pair in errors.windows(2) {
            assert!((12.0..20.0).contains(&(pair[0] / pair[1])), "{errors:?}");
        }
    }

    #[test]
    fn padding_stays_at_rest() {
        let (mut slider, mut step, mut drive) =
            on_grid(&parameters(), 4e-6, &[1e-7; 10], &[0.0; 10]);
        take(&mut slider, &mut step, &mut drive, 100);
        let layout = slider.chain.layout;
        for (row, lane) in (0..layout.rows).flat_map(|row| (0..LANES).map(move |lane| (row, lane)))
        {
            let x = slider.state.displacement[row][lane];
            assert_eq!(
                x == 0.0,
                layout.block(Slot { row, lane }) >= layout.blocks,
                "{x} in row {row}, lane {lane}"
            );
        }
    }

    #[test]
    fn weights_join_where_their_formula_changes() {
        for (below, above) in weights(0.1 - 1e-9).into_iter().zip(weights(0.1 + 1e-9)) {
            assert!((below / above - 1.0).abs() < 1e-10, "{below} {above}");
        }
    }
}
