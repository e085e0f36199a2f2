//! Taylor steps of the chain: x(t + s h) = Σ Y_p s^p/p! for s in [0, 1], with Y_p = h^p x^(p).
//!
//! The equation of motion gives each order from the two before,
//! Y_{p+2} = h² (A Y_p + forces) - γ h Y_{p+1}, one sweep of a tridiagonal stencil. Orders are added until two successive
//! terms, times their order, fall under the wanted error. The sum of the terms' magnitudes bounds how far each block
//! strays within the step.

use super::chain::Chain;
use super::layout::Layout;
use super::simd::{Simd, Vector};
use crate::model::Row;
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

/// The drive's displacement U over a step: h^p U^(p), order after order, in m.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveDerivatives {
    /// Ramp at the start, and its rise over the step.
    pub ramp: [f64; 2],
    /// Δ cos θ and -Δ sin θ at the phase θ of the start.
    pub swing: [f64; 2],
    /// ω h, in rad.
    pub angle: f64,
}

impl DriveDerivatives {
    /// The term of this order; the next call gives the next.
    #[inline(always)]
    pub fn next_order(&mut self) -> f64 {
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
    pub min_order: usize,
    /// `K_d/m`, in 1/s².
    pub pulling: f64,
    /// The drive's displacement.
    pub drive: DriveDerivatives,
}

/// The series of one step.
#[derive(Clone, Debug)]
pub(super) struct Series {
    rows: usize,
    /// Rows of Y_0, then of Y_1, and so on, in m.
    terms: Vec<Row>,
    /// `Σ_{p>=1} |Y_p|/p!`: how far each block strays within the step, in m.
    excursion: Vec<Row>,
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

    /// The coefficients Y_p/p! of one block, in m, written over what is there.
    pub fn block(&self, row: usize, lane: usize, coefficients: &mut Vec<f64>) {
        coefficients.resize(self.order + 1, 0.0);
        let mut at = row;
        for (coefficient, inverse) in coefficients.iter_mut().zip(&INVERSE_FACTORIAL) {
            *coefficient = inverse * self.terms[at][lane];
            at += self.rows;
        }
    }

    /// Adds to the first coefficients Y_p/p! of one block, in m. The order is at least that of the last.
    pub fn add(&mut self, row: usize, lane: usize, coefficients: &[f64]) {
        let (mut at, mut factorial, mut order) = (row, 1.0, 0.0);
        for coefficient in coefficients {
            self.terms[at][lane] += factorial * coefficient;
            self.excursion[row][lane] += coefficient.abs();
            at += self.rows;
            order += 1.0;
            factorial *= order;
        }
    }

    /// Bounds on the displacement of one block within the step, in m.
    pub fn range(&self, row: usize, lane: usize) -> [f64; 2] {
        let (start, excursion) = (self.terms[row][lane], self.excursion[row][lane]);
        [start - excursion, start + excursion]
    }

    /// The coefficients of F_S under a drive of so many N/m, in N, written over what is there.
    pub fn shear_force(&self, mut drive: DriveDerivatives, stiffness: f64, coefficients: &mut Vec<f64>) {
        coefficients.resize(self.order + 1, 0.0);
        let mut at = 0;
        for (coefficient, inverse) in coefficients.iter_mut().zip(&INVERSE_FACTORIAL) {
            *coefficient = stiffness * inverse * (drive.next_order() - self.terms[at][0]);
            at += self.rows;
        }
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

/// Expands the state into a series; false if it does not converge within [`MOST_ORDER`]. Compiled for `R` rows, or for any
/// number if that is 0; so are the loops below.
#[inline(always)]
pub(super) fn expand<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    state: &State,
    input: &StepInput,
    series: &mut Series,
) -> bool {
    let rows = series.rows_in::<R>();
    let Series { terms, coupling, diagonal, .. } = series;
    let (coupling, diagonal) = (&mut coupling[..rows], &mut diagonal[..rows]);
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
    let recurrence = Recurrence {
        simd,
        coupling,
        diagonal,
        pull: &chain.pull[..rows],
        square,
        damping: simd.splat(-chain.damping_rate * input.length),
        pulling: input.length * input.length * input.pulling,
        drive: input.drive,
    };
    let order = if R > 0 && S::HAS_MANY_REGISTERS {
        converge_in_registers::<S, R>(recurrence, input, terms)
    } else {
        converge_in_memory(recurrence, input, terms, rows)
    };
    series.order = order.unwrap_or(series.order);
    order.is_some()
}

/// What makes the next order of the last two.
struct Recurrence<'a, S: Simd> {
    simd: S,
    /// h² times the coupling and minus the diagonal.
    coupling: &'a [Row],
    diagonal: &'a [Row],
    /// The contact force at displacement zero, by mass, and h².
    pull: &'a [Row],
    square: S::Vector,
    damping: S::Vector,
    /// h² `K_d/m`, and what the drive's displacement has left.
    pulling: f64,
    drive: DriveDerivatives,
}

impl<S: Simd> Recurrence<'_, S> {
    /// Adds pull and drive to Y_{p+2}; order after order.
    #[inline(always)]
    fn add_forces(&mut self, p: usize, next: &mut [Row]) {
        if p == 0 {
            for (row, pull) in next.iter_mut().zip(self.pull) {
                self.simd.load(pull).fused(self.square, self.simd.load(row)).store(row);
            }
        }
        let push = self.pulling * self.drive.next_order();
        if push != 0.0 {
            self.simd.load(&FIRST_LANE).fused(self.simd.splat(push), self.simd.load(&next[0])).store(&mut next[0]);
        }
    }

    /// Y_{p+2} of Y_p and Y_{p+1}, also written to `rows`. [`sweep`] and [`Self::add_forces`] in arrays: one form for rows in
    /// memory and in registers is slower than either.
    #[inline(always)]
    fn next_order<const R: usize>(
        &mut self,
        p: usize,
        y: [S::Vector; R],
        rate: [S::Vector; R],
        rows: &mut [Row],
    ) -> [S::Vector; R] {
        let (coupling, diagonal) = (&self.coupling[..R], &self.diagonal[..R]);
        let mut next = y;
        for r in 0..R {
            let before = if r > 0 { y[r - 1] } else { y[R - 1].to_next_lane() };
            let after = if r + 1 < R { y[r + 1] } else { y[0].to_lane_before() };
            let coupled = before.plus(after).times(self.simd.load(&coupling[r]));
            let forced = y[r].fused(self.simd.load(&diagonal[r]), coupled);
            next[r] = rate[r].fused(self.damping, forced);
        }
        if p == 0 {
            let pull = &self.pull[..R];
            for r in 0..R {
                next[r] = self.simd.load(&pull[r]).fused(self.square, next[r]);
            }
        }
        let push = self.pulling * self.drive.next_order();
        if push != 0.0 {
            next[0] = self.simd.load(&FIRST_LANE).fused(self.simd.splat(push), next[0]);
        }
        let rows = &mut rows[..R];
        for r in 0..R {
            next[r].store(&mut rows[r]);
        }
        next
    }
}

/// Adds orders to Y_0 and Y_1 until the series converges; the last one, if it does.
#[inline(always)]
fn converge_in_memory<S: Simd>(
    mut recurrence: Recurrence<'_, S>,
    input: &StepInput,
    terms: &mut [Row],
    rows: usize,
) -> Option<usize> {
    for p in 0..MOST_ORDER - 1 {
        let terms = &mut terms[p * rows..(p + 3) * rows];
        sweep(recurrence.simd, recurrence.coupling, recurrence.diagonal, recurrence.damping, terms, rows);
        recurrence.add_forces(p, &mut terms[2 * rows..]);
        // Two orders at a time: every second one may vanish by symmetry.
        let order = p + 2;
        if p % 2 == 1
            && order >= input.min_order
            && are_small(recurrence.simd, &terms[rows..], rows, order, input.error)
        {
            return Some(order);
        }
    }
    None
}

/// The same with the last two orders in registers, where no sum waits for the memory.
#[inline(always)]
fn converge_in_registers<S: Simd, const R: usize>(
    mut recurrence: Recurrence<'_, S>,
    input: &StepInput,
    terms: &mut [Row],
) -> Option<usize> {
    let simd = recurrence.simd;
    let (mut even, mut odd) = ([simd.splat(0.0); R], [simd.splat(0.0); R]);
    for r in 0..R {
        (even[r], odd[r]) = (simd.load(&terms[r]), simd.load(&terms[R + r]));
    }
    for (pair, rows) in terms[2 * R..].chunks_exact_mut(2 * R).enumerate() {
        let p = 2 * pair;
        let (lower, higher) = rows.split_at_mut(R);
        even = recurrence.next_order(p, even, odd, lower);
        odd = recurrence.next_order(p + 1, odd, even, higher);
        let order = p + 3;
        if order >= input.min_order && are_small(simd, rows, R, order, input.error) {
            return Some(order);
        }
    }
    None
}

/// Y_{p+2} without pull and drive: `terms` holds Y_p, Y_{p+1} and room for it.
#[inline(always)]
fn sweep<S: Simd>(simd: S, coupling: &[Row], diagonal: &[Row], damping: S::Vector, terms: &mut [Row], rows: usize) {
    let (y, rest) = terms.split_at_mut(rows);
    let (rate, next) = rest.split_at_mut(rows);
    let next = &mut next[..rows];
    let mut before = simd.load(&y[rows - 1]).to_next_lane();
    let mut here = simd.load(&y[0]);
    let last_after = here.to_lane_before();
    let last = rows - 1;
    for ((((next, rate), coupling), diagonal), after) in
        next[..last].iter_mut().zip(&rate[..last]).zip(&coupling[..last]).zip(&diagonal[..last]).zip(&y[1..])
    {
        let after = simd.load(after);
        let coupled = before.plus(after).times(simd.load(coupling));
        let forced = here.fused(simd.load(diagonal), coupled);
        simd.load(rate).fused(damping, forced).store(next);
        (before, here) = (here, after);
    }
    let coupled = before.plus(last_after).times(simd.load(&coupling[last]));
    let forced = here.fused(simd.load(&diagonal[last]), coupled);
    simd.load(&rate[last]).fused(damping, forced).store(&mut next[last]);
}

/// Block 1, at which the drive pulls.
const FIRST_LANE: Row = {
    let mut row = Row::filled(0.0);
    row.0[0] = 1.0;
    row
};

/// Whether the rows of the last two orders, weighted as terms and taken times the last order, are within the wanted error.
#[inline(always)]
fn are_small<S: Simd>(simd: S, terms: &[Row], rows: usize, order: usize, error: f64) -> bool {
    let (mut in_lower, mut in_higher) = (simd.splat(0.0), simd.splat(0.0));
    for (lower, higher) in terms[..rows].iter().zip(&terms[rows..]) {
        in_lower = simd.load(lower).magnitude().larger(in_lower);
        in_higher = simd.load(higher).magnitude().larger(in_higher);
    }
    let [for_lower, for_higher] = [order - 1, order].map(|p| simd.splat(order as f64 * INVERSE_FACTORIAL[p]));
    in_lower.times(for_lower).larger(in_higher.times(for_higher)).within(simd.splat(error))
}

/// Rows that are taken through all orders together, since their sums need not wait for each other: many with many registers.
const MANY: usize = 9;
const FEW: usize = 3;

/// State at s in [0, 1] of a step of so many seconds.
#[inline(always)]
pub(super) fn evaluate<S: Simd, const R: usize>(simd: S, series: &Series, s: f64, length: f64, state: &mut State) {
    let rows = series.rows_in::<R>();
    let mut r = 0;
    while S::HAS_MANY_REGISTERS && r + MANY <= rows {
        evaluate_rows::<S, MANY>(simd, series, rows, r, s, length, state);
        r += MANY;
    }
    while r + FEW <= rows {
        evaluate_rows::<S, FEW>(simd, series, rows, r, s, length, state);
        r += FEW;
    }
    while r < rows {
        evaluate_rows::<S, 1>(simd, series, rows, r, s, length, state);
        r += 1;
    }
}

/// Horner's scheme, nested: Y_0 + s/1 (Y_1 + s/2 (Y_2 + ...)), and the same from Y_1 for the slope.
#[inline(always)]
fn evaluate_rows<S: Simd, const G: usize>(
    simd: S,
    series: &Series,
    rows: usize,
    first: usize,
    s: f64,
    length: f64,
    state: &mut State,
) {
    let order = series.order;
    let inverse_length = simd.splat(1.0 / length);
    let mut at = order * rows + first;
    let mut value = [simd.splat(0.0); G];
    for (value, term) in value.iter_mut().zip(&series.terms[at..at + G]) {
        *value = simd.load(term);
    }
    let mut slope = value;
    let mut for_value = simd.splat(s * INVERSE[order]);
    for inverse in INVERSE[1..order].iter().rev() {
        at -= rows;
        let for_slope = simd.splat(s * inverse);
        for ((value, slope), term) in value.iter_mut().zip(&mut slope).zip(&series.terms[at..at + G]) {
            let term = simd.load(term);
            *value = value.fused(for_value, term);
            *slope = slope.fused(for_slope, term);
        }
        for_value = for_slope;
    }
    for ((value, term), x) in
        value.iter().zip(&series.terms[first..first + G]).zip(&mut state.displacement[first..first + G])
    {
        value.fused(for_value, simd.load(term)).store(x);
    }
    for (slope, v) in slope.iter().zip(&mut state.velocity[first..first + G]) {
        slope.times(inverse_length).store(v);
    }
}

/// Row and lane of every block that may reach a break position within the step.
#[inline(always)]
pub(super) fn reachable<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    series: &mut Series,
    blocks: &mut Vec<(usize, usize)>,
) {
    let rows = series.rows_in::<R>();
    blocks.clear();
    let mut r = 0;
    while S::HAS_MANY_REGISTERS && r + MANY <= rows {
        reachable_rows::<S, MANY>(simd, chain, series, rows, r, blocks);
        r += MANY;
    }
    while r + FEW <= rows {
        reachable_rows::<S, FEW>(simd, chain, series, rows, r, blocks);
        r += FEW;
    }
    while r < rows {
        reachable_rows::<S, 1>(simd, chain, series, rows, r, blocks);
        r += 1;
    }
}

#[inline(always)]
fn reachable_rows<S: Simd, const G: usize>(
    simd: S,
    chain: &Chain,
    series: &mut Series,
    rows: usize,
    first: usize,
    blocks: &mut Vec<(usize, usize)>,
) {
    let order = series.order;
    let mut excursion = [simd.splat(0.0); G];
    let mut at = first;
    for inverse in &INVERSE_FACTORIAL[1..=order] {
        at += rows;
        let weight = simd.splat(*inverse);
        for (excursion, term) in excursion.iter_mut().zip(&series.terms[at..at + G]) {
            *excursion = simd.load(term).magnitude().fused(weight, *excursion);
        }
    }
    let own = first..first + G;
    let (strays, starts) = (&mut series.excursion[own.clone()], &series.terms[own.clone()]);
    let (upper, lower) = (&chain.upper[own.clone()], &chain.lower[own]);
    let mut reached = [0; G];
    for g in 0..G {
        excursion[g].store(&mut strays[g]);
        let x = simd.load(&starts[g]);
        let above = x.plus(excursion[g]).reaches(simd.load(&upper[g]));
        let below = simd.load(&lower[g]).reaches(x.minus(excursion[g]));
        reached[g] = above | below;
    }
    for (g, mut reached) in reached.into_iter().enumerate() {
        while reached != 0 {
            blocks.push((first + g, reached.trailing_zeros() as usize));
            reached &= reached - 1;
        }
    }
}
