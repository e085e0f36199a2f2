//! Taylor steps of the chain: x(t + s h) = Σ Y_p s^p/p! for s in [0, 1], with Y_p = h^p x^(p).
//!
//! The equation of motion gives each order from the two before,
//! Y_{p+2} = h² (A Y_p + forces) - γ h Y_{p+1}, one sweep of a tridiagonal stencil. Orders are added until two successive
//! terms, times their order, fall under the wanted error. The sum of the terms' magnitudes bounds how far each block
//! strays within the step.

use super::lanes::{LANES, Layout, Row};
use super::vector::Vector;
use crate::model::slider::StiffnessMatrix;
use crate::model::{Interface, Parameters};
use crate::solver::polynomial::{INVERSE, MOST_COEFFICIENTS};

/// Largest order of a step.
const MOST_ORDER: usize = MOST_COEFFICIENTS - 1;

/// 1/p!.
const INVERSE_FACTORIAL: [f64; MOST_COEFFICIENTS] = {
    let mut inverse = [1.0; MOST_COEFFICIENTS];
    let mut p = 1;
    while p < MOST_COEFFICIENTS {
        inverse[p] = inverse[p - 1] / p as f64;
        p += 1;
    }
    inverse
};

/// The chain's coefficients in lanes, all divided by the block mass.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub layout: Layout,
    /// Block mass m, in kg.
    pub mass: f64,
    /// Diagonal of S without contacts, in N/m.
    bare: Vec<Row>,
    /// K_int/m, in 1/s²; 0 in padding.
    pub coupling: Vec<Row>,
    /// Diagonal of S/m, in 1/s².
    pub diagonal: Vec<Row>,
    /// Contact force at displacement zero, Σ k_i a_i/m, in m/s².
    pub pull: Vec<Row>,
    /// Nearest break positions, in m.
    pub upper: Vec<Row>,
    pub lower: Vec<Row>,
    /// Damping rate γ, in 1/s.
    pub damping_rate: f64,
}

impl Chain {
    /// The chain without contacts, driven at block 1.
    pub fn new(parameters: &Parameters, layout: Layout) -> Self {
        let mut chain = Self {
            layout,
            mass: parameters.block_mass(),
            bare: layout.filled(0.0),
            coupling: layout.filled(0.0),
            diagonal: layout.filled(0.0),
            pull: layout.filled(0.0),
            upper: layout.filled(f64::INFINITY),
            lower: layout.filled(f64::NEG_INFINITY),
            damping_rate: parameters.damping_rate,
        };
        let bare = StiffnessMatrix::new(parameters, &vec![0.0; layout.blocks]);
        for (block, diagonal) in bare.diagonal.iter().enumerate() {
            let (row, lane) = layout.slot(block);
            chain.coupling[row][lane] = parameters.coupling_stiffness() / chain.mass;
            chain.bare[row][lane] = *diagonal;
        }
        chain
    }

    /// Takes over what the contacts of a block have become.
    pub fn update(&mut self, block: usize, interface: &Interface) {
        let (row, lane) = self.layout.slot(block);
        self.diagonal[row][lane] = (self.bare[row][lane] + interface.block_stiffness[block]) / self.mass;
        self.pull[row][lane] = interface.block_pull[block] / self.mass;
        self.upper[row][lane] = interface.block_upper[block];
        self.lower[row][lane] = interface.block_lower[block];
    }

    /// The entry of a block.
    #[inline]
    pub fn at(&self, rows: &[Row], block: usize) -> f64 {
        let (row, lane) = self.layout.slot(block);
        rows[row][lane]
    }
}

/// The drive's displacement U over a step: h^p U^(p), order after order, in m.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveTerms {
    /// Ramp now, and its rise over the step.
    pub ramp: [f64; 2],
    /// Δ cos θ and -Δ sin θ at the phase of now.
    pub swing: [f64; 2],
    /// ω h, in rad.
    pub angle: f64,
}

impl DriveTerms {
    /// The term of this order; the next call gives the next.
    #[inline(always)]
    pub fn take(&mut self) -> f64 {
        let term = self.ramp[0] + self.swing[0];
        self.ramp = [self.ramp[1], 0.0];
        self.swing = [self.angle * self.swing[1], -self.angle * self.swing[0]];
        term
    }
}

/// What a step needs to know about its length and the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepInput {
    /// Length h, in s.
    pub length: f64,
    /// Wanted bound on the last terms, in m.
    pub error: f64,
    /// Order from which on the terms are compared with it.
    pub least_order: usize,
    /// `K_d/m`, in 1/s².
    pub pulling: f64,
    /// The drive's displacement.
    pub drive: DriveTerms,
}

/// The series of one step.
#[derive(Clone, Debug)]
pub(super) struct Series {
    rows: usize,
    /// Rows of Y_0, then of Y_1, and so on, in m.
    terms: Vec<Row>,
    /// h² times the coupling and minus the diagonal.
    coupling: Vec<Row>,
    diagonal: Vec<Row>,
    /// Order of the last step.
    pub order: usize,
}

impl Series {
    pub fn new(layout: Layout) -> Self {
        Self {
            rows: layout.rows,
            terms: vec![Row::filled(0.0); layout.rows * MOST_COEFFICIENTS],
            coupling: layout.filled(0.0),
            diagonal: layout.filled(0.0),
            order: 0,
        }
    }

    /// The coefficients Y_p/p! of one block, in m, written over what is there.
    pub fn block(&self, row: usize, lane: usize, coefficients: &mut Vec<f64>) {
        let terms = self.terms[row..].iter().step_by(self.rows);
        coefficients.clear();
        coefficients.extend(terms.zip(&INVERSE_FACTORIAL[..=self.order]).map(|(term, inverse)| inverse * term[lane]));
    }

    /// The coefficients of the drive's stretch U - x_1, in m, written over what is there.
    pub fn stretch(&self, mut drive: DriveTerms, coefficients: &mut Vec<f64>) {
        let terms = self.terms.iter().step_by(self.rows);
        coefficients.clear();
        coefficients.extend(
            terms.zip(&INVERSE_FACTORIAL[..=self.order]).map(|(term, inverse)| inverse * (drive.take() - term[0])),
        );
    }
}

/// Displacements and velocities in lanes.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// In m.
    pub displacement: Vec<Row>,
    /// In m/s.
    pub velocity: Vec<Row>,
}

/// Expands the state into a series; false if it does not converge within [`MOST_ORDER`].
#[inline(always)]
pub(super) fn expand<V: Vector>(chain: &Chain, state: &State, input: &StepInput, series: &mut Series) -> bool {
    let rows = series.rows;
    let length = V::splat(input.length);
    let square = input.length * input.length;
    let damping = V::splat(-chain.damping_rate * input.length);
    for r in 0..rows {
        V::load(&chain.coupling[r]).times(V::splat(square)).store(&mut series.coupling[r]);
        V::load(&chain.diagonal[r]).times(V::splat(-square)).store(&mut series.diagonal[r]);
        series.terms[r] = state.displacement[r];
        V::load(&state.velocity[r]).times(length).store(&mut series.terms[rows + r]);
    }
    let mut drive = input.drive;
    for p in 0..MOST_ORDER - 1 {
        let terms = &mut series.terms[p * rows..(p + 3) * rows];
        sweep::<V>(&series.coupling, &series.diagonal, damping, terms);
        let added = &mut terms[2 * rows..];
        if p == 0 {
            for (row, pull) in added.iter_mut().zip(&chain.pull) {
                V::load(pull).fused(V::splat(square), V::load(row)).store(row);
            }
        }
        let push = square * input.pulling * drive.take();
        if push != 0.0 {
            V::load(&FIRST_LANE).fused(V::splat(push), V::load(&added[0])).store(&mut added[0]);
        }
        // Two orders at a time: every second one may vanish by symmetry.
        let order = p + 2;
        if p % 2 == 1 && order >= input.least_order {
            let before = INVERSE_FACTORIAL[order - 1] * largest::<V>(&terms[rows..2 * rows]);
            let last = INVERSE_FACTORIAL[order] * largest::<V>(&terms[2 * rows..]);
            if order as f64 * before.max(last) <= input.error {
                series.order = order;
                return true;
            }
        }
    }
    false
}

/// Y_{p+2} without pull and drive: `terms` holds Y_p, Y_{p+1} and room for it.
#[inline(always)]
fn sweep<V: Vector>(coupling: &[Row], diagonal: &[Row], damping: V, terms: &mut [Row]) {
    let rows = terms.len() / 3;
    let (y, rest) = terms.split_at_mut(rows);
    let (rate, next) = rest.split_at_mut(rows);
    let (coupling, diagonal) = (&coupling[..rows], &diagonal[..rows]);
    let (rate, next) = (&rate[..rows], &mut next[..rows]);
    let mut before = V::load(&y[rows - 1]).to_next_lane();
    let mut here = V::load(&y[0]);
    let last_after = here.to_lane_before();
    let last = rows - 1;
    for ((((next, rate), coupling), diagonal), after) in
        next[..last].iter_mut().zip(&rate[..last]).zip(&coupling[..last]).zip(&diagonal[..last]).zip(&y[1..])
    {
        let after = V::load(after);
        let coupled = before.plus(after).times(V::load(coupling));
        let forced = here.fused(V::load(diagonal), coupled);
        V::load(rate).fused(damping, forced).store(next);
        (before, here) = (here, after);
    }
    let coupled = before.plus(last_after).times(V::load(&coupling[last]));
    let forced = here.fused(V::load(&diagonal[last]), coupled);
    V::load(&rate[last]).fused(damping, forced).store(&mut next[last]);
}

/// Block 1, at which the drive pulls.
const FIRST_LANE: Row = {
    let mut row = Row::filled(0.0);
    row.0[0] = 1.0;
    row
};

/// The largest magnitude.
#[inline(always)]
fn largest<V: Vector>(rows: &[Row]) -> f64 {
    let mut largest = V::splat(0.0);
    for row in rows {
        largest = V::load(row).magnitude().larger(largest);
    }
    let mut lanes = Row::filled(0.0);
    largest.store(&mut lanes);
    lanes.iter().copied().fold(0.0, f64::max)
}

/// State at s in [0, 1] of a step of so many seconds.
#[inline(always)]
pub(super) fn evaluate<V: Vector>(series: &Series, s: f64, length: f64, state: &mut State) {
    let (rows, order) = (series.rows, series.order);
    let inverse_length = V::splat(1.0 / length);
    let terms = &series.terms[..(order + 1) * rows];
    for r in 0..rows {
        // Horner's scheme, nested: Y_0 + s/1 (Y_1 + s/2 (Y_2 + ...)), and the same from Y_1 for the slope.
        let mut at = order * rows + r;
        let mut value = V::load(&terms[at]);
        let mut slope = value;
        for pair in INVERSE[1..=order].windows(2).rev() {
            at -= rows;
            let term = V::load(&terms[at]);
            value = value.fused(V::splat(s * pair[1]), term);
            slope = slope.fused(V::splat(s * pair[0]), term);
        }
        value.fused(V::splat(s), V::load(&terms[r])).store(&mut state.displacement[r]);
        slope.times(inverse_length).store(&mut state.velocity[r]);
    }
}

/// Row and lane of every block that may reach a break position within the step.
#[inline(always)]
pub(super) fn reachable<V: Vector>(chain: &Chain, series: &Series, blocks: &mut Vec<(usize, usize)>) {
    let (rows, order) = (series.rows, series.order);
    let terms = &series.terms[..(order + 1) * rows];
    blocks.clear();
    for r in 0..rows {
        let mut excursion = V::splat(0.0);
        for (term, inverse) in terms[rows + r..].iter().step_by(rows).zip(&INVERSE_FACTORIAL[1..]) {
            excursion = V::load(term).magnitude().fused(V::splat(*inverse), excursion);
        }
        let x = V::load(&terms[r]);
        let above = x.plus(excursion).reaches(V::load(&chain.upper[r]));
        let below = V::load(&chain.lower[r]).reaches(x.minus(excursion));
        let reached = above | below;
        if reached != 0 {
            blocks.extend((0..LANES).filter(|lane| reached >> lane & 1 == 1).map(|lane| (r, lane)));
        }
    }
}
