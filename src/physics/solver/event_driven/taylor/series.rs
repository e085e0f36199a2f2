//! The Taylor series of a step: x(t + s h) = Σ Y_p s^p/p! for s in [0, 1], with Y_p = h^p x^(p); its values, and
//! which blocks may break. [`super::recurrence`] computes it.

use crate::model::Row;
use crate::model::simd::{Simd, Vector};
use crate::solver::event_driven::chain::{Chain, State};
use crate::solver::event_driven::lane_layout::Layout;
use crate::solver::polynomial::{INVERSE, MAX_COEFFICIENTS};
use pulp::Scalar512b;

/// 1/p!.
pub const INVERSE_FACTORIAL: [f64; MAX_COEFFICIENTS] = {
    let mut inverse = [1.0; MAX_COEFFICIENTS];
    let mut p = 1;
    while p < MAX_COEFFICIENTS {
        inverse[p] = inverse[p - 1] / p as f64;
        p += 1;
    }
    inverse
};

/// The drive's displacement U over a step: h^p U^(p), order after order, in m.
#[derive(Clone, Copy, Debug)]
pub struct DriveDerivatives {
    /// Ramp at the start, and its rise over the step.
    pub ramp: [f64; 2],
    /// Δ cos θ and -Δ sin θ at the phase θ of the start.
    pub swing: [f64; 2],
    /// ω h, in rad.
    pub angle: f64,
}

impl DriveDerivatives {
    /// The term of one order; each call returns that of the next order.
    #[inline(always)]
    pub fn next_order(&mut self) -> f64 {
        let term = self.ramp[0] + self.swing[0];
        self.ramp = [self.ramp[1], 0.0];
        self.swing = [self.angle * self.swing[1], -self.angle * self.swing[0]];
        term
    }
}

/// The series of one step.
#[derive(Clone, Debug)]
pub struct Series {
    pub rows: usize,
    /// Rows of Y_0, then of Y_1, and so on, in m.
    pub terms: Vec<Row>,
    /// `Σ_{p>=1} |Y_p|/p!`: a bound on how far each block moves within the step, in m.
    excursion: Vec<Row>,
    /// h² times the coupling and minus the diagonal.
    pub coupling: Vec<Row>,
    pub diagonal: Vec<Row>,
    /// Order of the last step.
    pub order: usize,
}

impl Series {
    pub fn new(layout: Layout) -> Self {
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
    pub fn rows_in<const R: usize>(&self) -> usize {
        if R == 0 { self.rows } else { R }
    }

    /// Writes the coefficients Y_p/p! of one block, in m.
    pub fn block(&self, row: usize, lane: usize, coefficients: &mut Vec<f64>) {
        coefficients.resize(self.order + 1, 0.0);
        let mut at = row;
        for (coefficient, inverse) in coefficients.iter_mut().zip(&INVERSE_FACTORIAL) {
            *coefficient = inverse * self.terms[at][lane];
            at += self.rows;
        }
    }

    /// Mean displacement of the blocks at s, in m, to third order: the slider as a whole moves far more slowly than its blocks.
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

    /// Lower and upper bound on the displacement of one block within the step, in m.
    pub fn range(&self, row: usize, lane: usize) -> [f64; 2] {
        let (start, excursion) = (self.terms[row][lane], self.excursion[row][lane]);
        [start - excursion, start + excursion]
    }

    /// Writes the coefficients of F_S, in N, for a drive of `stiffness` N/m.
    pub fn shear_force(
        &self,
        mut drive: DriveDerivatives,
        stiffness: f64,
        coefficients: &mut Vec<f64>,
    ) {
        coefficients.resize(self.order + 1, 0.0);
        let mut at = 0;
        for (coefficient, inverse) in coefficients.iter_mut().zip(&INVERSE_FACTORIAL) {
            *coefficient = stiffness * inverse * (drive.next_order() - self.terms[at][0]);
            at += self.rows;
        }
    }
}

/// Rows that are taken through all orders together, since their sums need not wait for each other.
const ROWS: usize = 3;

/// State at s in [0, 1] of a step of `length` s.
#[inline(always)]
pub fn evaluate<S: Simd, const R: usize>(
    simd: S,
    series: &Series,
    s: f64,
    length: f64,
    state: &mut State,
) {
    let rows = series.rows_in::<R>();
    let mut r = 0;
    while r + ROWS <= rows {
        evaluate_rows::<S, ROWS>(simd, series, rows, r, s, length, state);
        r += ROWS;
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
        for ((value, slope), term) in value
            .iter_mut()
            .zip(&mut slope)
            .zip(&series.terms[at..at + G])
        {
            let term = simd.load(term);
            *value = value.mul_add(for_value, term);
            *slope = slope.mul_add(for_slope, term);
        }
        for_value = for_slope;
    }
    for ((value, term), x) in value
        .iter()
        .zip(&series.terms[first..first + G])
        .zip(&mut state.displacement[first..first + G])
    {
        value.mul_add(for_value, simd.load(term)).store(x);
    }
    for (slope, v) in slope.iter().zip(&mut state.velocity[first..first + G]) {
        slope.times(inverse_length).store(v);
    }
}

/// Row and lane of every block that may reach a break position within the step.
#[inline(always)]
pub fn reachable<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    series: &mut Series,
    blocks: &mut Vec<(usize, usize)>,
) {
    let rows = series.rows_in::<R>();
    blocks.clear();
    let mut r = 0;
    while r + ROWS <= rows {
        reachable_rows::<S, ROWS>(simd, chain, series, rows, r, blocks);
        r += ROWS;
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
            *excursion = simd.load(term).abs().mul_add(weight, *excursion);
        }
    }
    let own = first..first + G;
    let (bounds, starts) = (
        &mut series.excursion[own.clone()],
        &series.terms[own.clone()],
    );
    let (upper, lower) = (&chain.upper[own.clone()], &chain.lower[own]);
    let mut reached = [0; G];
    for g in 0..G {
        excursion[g].store(&mut bounds[g]);
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
