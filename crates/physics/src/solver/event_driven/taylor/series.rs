//! The Taylor series of a step: x(t + s h) = Σ Y_p s^p/p! for s in [0, 1], with Y_p = h^p x^(p); its values, and
//! which blocks may break.
//!
//! The equation of motion gives each order from the two before, Y_{p+2} = h² (A Y_p + forces) - γ h Y_{p+1}, one sweep
//! of a tridiagonal stencil. Orders are added until two successive terms, times their order, and what the drive adds to
//! the next, fall below the error allowed. The sum of the terms' magnitudes bounds how far each block moves within the
//! step.

use crate::model::Row;
use crate::model::simd::{Simd, Vector};
use crate::solver::event_driven::moving_frame::StepDrive;
use crate::solver::event_driven::slider::{BlockLayout, Chain, FIRST_BLOCK, Slot, State};
use crate::solver::polynomial::{INVERSE, MAX_COEFFICIENTS};
use pulp::Scalar512b;

/// Largest order of a step.
const MAX_ORDER: usize = MAX_COEFFICIENTS - 1;

/// Order at which convergence is first looked at.
const MIN_ORDER: usize = 3;

/// 1/p!.
const INVERSE_FACTORIAL: [f64; MAX_COEFFICIENTS] = {
    let mut inverse = [1.0; MAX_COEFFICIENTS];
    let mut p = 1;
    while p < MAX_COEFFICIENTS {
        inverse[p] = inverse[p - 1] / p as f64;
        p += 1;
    }
    inverse
};

/// The series of one step.
#[derive(Clone, Debug, Default)]
pub struct TaylorSeries {
    pub rows: usize,
    /// Rows of Y_0, then of Y_1, and so on, in m.
    pub terms: Vec<Row>,
    /// `Σ_{p>=1} |Y_p|/p!`: a bound on how far each block moves within the step, in m.
    excursion: Vec<Row>,
    /// h² times the coupling and minus the diagonal.
    pub coupling: Vec<Row>,
    pub diagonal: Vec<Row>,
    pub order: usize,
}

impl TaylorSeries {
    pub fn new(layout: BlockLayout) -> Self {
        Self {
            rows: layout.rows,
            terms: vec![Row::filled(0.0); layout.rows * MAX_COEFFICIENTS],
            excursion: layout.filled(0.0),
            coupling: layout.filled(0.0),
            diagonal: layout.filled(0.0),
            order: 0,
        }
    }

    /// Number of rows, which is `R` unless that is 0.
    #[inline(always)]
    fn rows_in<const R: usize>(&self) -> usize {
        if R == 0 { self.rows } else { R }
    }

    /// The rows of one order, of which there are `rows`.
    #[inline(always)]
    fn order_terms(&self, order: usize, rows: usize) -> &[Row] {
        &self.terms[order * rows..][..rows]
    }

    /// Writes the coefficients Y_p/p! of one block, in m.
    pub fn block(&self, Slot { row, lane }: Slot, coefficients: &mut Vec<f64>) {
        coefficients.resize(self.order + 1, 0.0);
        let mut at = row;
        for (coefficient, inverse) in coefficients.iter_mut().zip(&INVERSE_FACTORIAL) {
            *coefficient = inverse * self.terms[at][lane];
            at += self.rows;
        }
    }

    /// Mean displacement of the blocks at s, in m, to third order: the slider as a whole moves far more slowly than its
    /// blocks.
    pub fn mean(&self, chain: &Chain, s: f64) -> f64 {
        let terms = self
            .terms
            .chunks(self.rows)
            .take(self.order.min(3) + 1)
            .zip(&INVERSE_FACTORIAL);
        terms.rev().fold(0.0, |sum, (term, inverse)| {
            sum * s + inverse * chain.mean(Scalar512b, term)
        })
    }

    /// Adds to the first coefficients Y_p/p! of one block, in m. The order is at least that of the last.
    pub fn add(&mut self, Slot { row, lane }: Slot, coefficients: &[f64]) {
        let mut at = row;
        let mut factorial = 1.0;
        let mut order = 0.0;
        for coefficient in coefficients {
            self.terms[at][lane] += factorial * coefficient;
            self.excursion[row][lane] += coefficient.abs();
            at += self.rows;
            order += 1.0;
            factorial *= order;
        }
    }

    /// Lower and upper bound on the displacement of one block within the step, in m.
    pub fn range(&self, Slot { row, lane }: Slot) -> [f64; 2] {
        let start = self.terms[row][lane];
        let excursion = self.excursion[row][lane];
        [start - excursion, start + excursion]
    }

    /// Writes the coefficients of F_S, in N, for a drive of `stiffness` N/m.
    pub fn shear_force(&self, mut drive: StepDrive, stiffness: f64, coefficients: &mut Vec<f64>) {
        coefficients.resize(self.order + 1, 0.0);
        let mut at = 0;
        for (coefficient, inverse) in coefficients.iter_mut().zip(&INVERSE_FACTORIAL) {
            *coefficient = stiffness * inverse * (drive.displacement() - self.terms[at][0]);
            drive = drive.derivative();
            at += self.rows;
        }
    }
}

/// State at s in [0, 1] of a step of `length` s: Horner's scheme, nested, Y_0 + s/1 (Y_1 + s/2 (Y_2 + ...)), and the
/// same from Y_1 for the slope.
#[inline(always)]
pub fn evaluate<S: Simd, const R: usize>(
    simd: S,
    series: &TaylorSeries,
    s: f64,
    length: f64,
    state: &mut State,
) {
    let rows = series.rows_in::<R>();
    let order = series.order;
    let values = &mut state.displacement[..rows];
    let slopes = &mut state.velocity[..rows];
    let last = series.order_terms(order, rows);
    for r in 0..rows {
        let term = simd.load(&last[r]);
        term.store(&mut values[r]);
        term.store(&mut slopes[r]);
    }
    for p in (1..order).rev() {
        let for_value = simd.splat(s * INVERSE[p + 1]);
        let for_slope = simd.splat(s * INVERSE[p]);
        let terms = series.order_terms(p, rows);
        for r in 0..rows {
            let term = simd.load(&terms[r]);
            let value = simd.load(&values[r]).mul_add(for_value, term);
            let slope = simd.load(&slopes[r]).mul_add(for_slope, term);
            value.store(&mut values[r]);
            slope.store(&mut slopes[r]);
        }
    }
    let for_value = simd.splat(s * INVERSE[1]);
    let inverse_length = simd.splat(1.0 / length);
    let first = series.order_terms(0, rows);
    for r in 0..rows {
        let value = simd
            .load(&values[r])
            .mul_add(for_value, simd.load(&first[r]));
        let slope = simd.load(&slopes[r]).times(inverse_length);
        value.store(&mut values[r]);
        slope.store(&mut slopes[r]);
    }
}

/// The blocks that may reach a break position within the step.
#[inline(always)]
pub fn reachable<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    series: &mut TaylorSeries,
    blocks: &mut Vec<Slot>,
) {
    let rows = series.rows_in::<R>();
    let (starts, later) = series.terms.split_at(rows);
    let excursion = &mut series.excursion[..rows];
    excursion.fill(Row::filled(0.0));
    for (terms, inverse) in later
        .chunks_exact(rows)
        .zip(&INVERSE_FACTORIAL[1..=series.order])
    {
        let weight = simd.splat(*inverse);
        for r in 0..rows {
            let sum = simd.load(&excursion[r]);
            let term = simd.load(&terms[r]).abs();
            term.mul_add(weight, sum).store(&mut excursion[r]);
        }
    }
    blocks.clear();
    for r in 0..rows {
        let x = simd.load(&starts[r]);
        let excursion = simd.load(&excursion[r]);
        let above = x.plus(excursion).reaches(simd.load(&chain.upper[r]));
        let below = simd.load(&chain.lower[r]).reaches(x.minus(excursion));
        let mut reached = above | below;
        while reached != 0 {
            let lane = reached.trailing_zeros() as usize;
            blocks.push(Slot { row: r, lane });
            reached &= reached - 1;
        }
    }
}

/// What a step needs to know about its length and the drive.
#[derive(Clone, Copy, Debug)]
pub struct StepInput {
    /// Length h, in s.
    pub length: f64,
    /// Bound that the last terms must meet, in m.
    pub error: f64,
    /// Order from which on the terms are compared with it.
    pub min_order: usize,
    pub drive: StepDrive,
}

/// Expands the state into a series; false if it does not converge within [`MAX_ORDER`]. Compiled for `R` rows, or for
/// any number if that is 0; so are the loops below.
#[inline(always)]
pub fn expand<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    state: &State,
    input: &StepInput,
    series: &mut TaylorSeries,
) -> bool {
    let rows = series.rows_in::<R>();
    let TaylorSeries {
        terms,
        coupling,
        diagonal,
        ..
    } = series;
    let coupling = &mut coupling[..rows];
    let diagonal = &mut diagonal[..rows];
    let square = simd.splat(input.length * input.length);
    let minus_square = simd.splat(-(input.length * input.length));
    for (scaled, coupling) in coupling.iter_mut().zip(&chain.coupling[..rows]) {
        simd.load(coupling).times(square).store(scaled);
    }
    for (scaled, diagonal) in diagonal.iter_mut().zip(&chain.diagonal[..rows]) {
        simd.load(diagonal).times(minus_square).store(scaled);
    }
    let (first, second) = terms[..2 * rows].split_at_mut(rows);
    for (start, displacement) in first.iter_mut().zip(&state.displacement[..rows]) {
        simd.load(displacement).store(start);
    }
    let length = simd.splat(input.length);
    for (rate, velocity) in second.iter_mut().zip(&state.velocity[..rows]) {
        simd.load(velocity).times(length).store(rate);
    }
    let damping = simd.splat(-chain.damping_rate * input.length);
    let pulling = input.length * input.length * (chain.drive_stiffness / chain.mass);
    let mut drive = input.drive;
    let min_order = order_of_drive(drive, pulling, input.error).max(input.min_order);
    for p in 0..MAX_ORDER - 1 {
        let terms = &mut terms[p * rows..(p + 3) * rows];
        sweep(simd, coupling, diagonal, damping, terms, rows);
        let next = &mut terms[2 * rows..];
        if p == 0 {
            for (row, pull) in next.iter_mut().zip(&chain.pull[..rows]) {
                let pull = simd.load(pull);
                pull.mul_add(square, simd.load(row)).store(row);
            }
        }
        let push = pulling * drive.displacement();
        drive = drive.derivative();
        if push != 0.0 {
            let first = simd.load(&FIRST_BLOCK);
            first
                .mul_add(simd.splat(push), simd.load(&next[0]))
                .store(&mut next[0]);
        }
        // Two orders at a time: every second one may vanish by symmetry.
        let order = p + 2;
        if p % 2 == 1
            && order >= min_order
            && are_small(simd, &terms[rows..], rows, order, input.error)
        {
            series.order = order;
            return true;
        }
    }
    false
}

/// Least order from which on what a modulated drive adds to the orders left out, times their order, is within `error`
/// m. Terms may vanish that the drive is still to make: at rest, those of the first four orders do.
#[inline(always)]
fn order_of_drive(drive: StepDrive, pulling: f64, error: f64) -> usize {
    let mut order = MIN_ORDER;
    // Of order + 1, times that; from here on they fall, since a step is at most four radians of the modulation.
    let mut term =
        pulling * (drive.swing[0].abs() + drive.swing[1].abs()) * drive.angle * drive.angle / 6.0;
    while term > error && order < MAX_ORDER {
        order += 1;
        term *= drive.angle / order as f64;
    }
    order
}

/// Y_{p+2} without pull and drive: `terms` holds Y_p, Y_{p+1} and room for it.
#[inline(always)]
fn sweep<S: Simd>(
    simd: S,
    coupling: &[Row],
    diagonal: &[Row],
    damping: S::Vector,
    terms: &mut [Row],
    rows: usize,
) {
    let (y, rest) = terms.split_at_mut(rows);
    let (rate, next) = rest.split_at_mut(rows);
    let next = &mut next[..rows];
    let mut before = simd.load(&y[rows - 1]).to_next_lane();
    let mut here = simd.load(&y[0]);
    let last_after = here.to_lane_before();
    let last = rows - 1;
    for ((((next, rate), coupling), diagonal), after) in next[..last]
        .iter_mut()
        .zip(&rate[..last])
        .zip(&coupling[..last])
        .zip(&diagonal[..last])
        .zip(&y[1..])
    {
        let after = simd.load(after);
        let coupled = before.plus(after).times(simd.load(coupling));
        let forced = here.mul_add(simd.load(diagonal), coupled);
        simd.load(rate).mul_add(damping, forced).store(next);
        (before, here) = (here, after);
    }
    let coupled = before.plus(last_after).times(simd.load(&coupling[last]));
    let forced = here.mul_add(simd.load(&diagonal[last]), coupled);
    simd.load(&rate[last])
        .mul_add(damping, forced)
        .store(&mut next[last]);
}

/// Whether the rows of the last two orders, weighted as terms and taken times the last order, are within the error
/// allowed.
#[inline(always)]
fn are_small<S: Simd>(simd: S, terms: &[Row], rows: usize, order: usize, error: f64) -> bool {
    let mut in_lower = simd.splat(0.0);
    let mut in_higher = simd.splat(0.0);
    for (lower, higher) in terms[..rows].iter().zip(&terms[rows..]) {
        in_lower = simd.load(lower).abs().larger(in_lower);
        in_higher = simd.load(higher).abs().larger(in_higher);
    }
    let [for_lower, for_higher] =
        [order - 1, order].map(|p| simd.splat(order as f64 * INVERSE_FACTORIAL[p]));
    let worst = in_lower
        .times(for_lower)
        .larger(in_higher.times(for_higher));
    simd.splat(error).reaches(worst) == u8::MAX
}
