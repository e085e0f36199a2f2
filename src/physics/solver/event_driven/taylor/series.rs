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

    /// The rows of one order, of which there are `rows`.
    #[inline(always)]
    fn order_terms(&self, order: usize, rows: usize) -> &[Row] {
        &self.terms[order * rows..][..rows]
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
    pub fn range(&self, row: usize, lane: usize) -> [f64; 2] {
        let start = self.terms[row][lane];
        let excursion = self.excursion[row][lane];
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

/// State at s in [0, 1] of a step of `length` s: Horner's scheme, nested, Y_0 + s/1 (Y_1 + s/2 (Y_2 + ...)), and the same
/// from Y_1 for the slope.
#[inline(always)]
pub fn evaluate<S: Simd, const R: usize>(
    simd: S,
    series: &Series,
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

/// Row and lane of every block that may reach a break position within the step.
#[inline(always)]
pub fn reachable<S: Simd, const R: usize>(
    simd: S,
    chain: &Chain,
    series: &mut Series,
    blocks: &mut Vec<(usize, usize)>,
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
            blocks.push((r, reached.trailing_zeros() as usize));
            reached &= reached - 1;
        }
    }
}
