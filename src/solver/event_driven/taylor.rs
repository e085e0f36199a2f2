//! Taylor steps of the chain: x(t + s h) = Σ X_p s^p for s in [0, 1].
//!
//! With scaled coefficients X_p = h^p x^(p)/p! the equation of motion gives each order from the two before,
//! X_{p+2} = [ h² (A X_p + forces) - γ h (p+1) X_{p+1} ] / ((p+1)(p+2)), one sweep of a tridiagonal stencil. Orders are
//! added until two successive terms, times their order, fall under the wanted error. The sum of magnitudes bounds how
//! far each block strays within the step.
//!
//! Every path of [`Kernels`] compiles the same plain code for another set of processor features; since nothing is fused
//! or reassociated, all give the same bits.

use super::glide::{Glide, advance};
use super::lanes::{LANES, Layout, Row, flat, flat_mut, ghost_after, ghost_before};
use crate::model::slider::StiffnessMatrix;
use crate::model::{Interface, Parameters};
use crate::solver::polynomial::MOST_COEFFICIENTS;

/// Largest order of a step.
pub(super) const MOST_ORDER: usize = MOST_COEFFICIENTS - 1;

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

/// What a step needs to know about its length and the drive.
#[derive(Clone, Debug)]
pub(super) struct StepInput {
    /// Length h, in s.
    pub length: f64,
    /// Wanted bound on the last terms, in m.
    pub error: f64,
    /// Scaled coefficients of the drive's acceleration at block 1, `K_d/m` U_p, in m/s².
    pub drive: [f64; MOST_COEFFICIENTS],
}

/// The series of one step.
#[derive(Clone, Debug)]
pub(super) struct Series {
    rows: usize,
    /// Rows of X_0, then of X_1, and so on, each with a ghost row before and after.
    terms: Vec<Row>,
    /// `Σ_{p>=1} |X_p|` per block, in m.
    pub excursion: Vec<Row>,
    /// Order of the last step.
    pub order: usize,
}

impl Series {
    pub fn new(layout: Layout) -> Self {
        Self {
            rows: layout.rows,
            terms: vec![Row::filled(0.0); (layout.rows + 2) * MOST_COEFFICIENTS],
            excursion: layout.filled(0.0),
            order: 0,
        }
    }

    #[inline(always)]
    fn term(&self, order: usize, row: usize) -> &Row {
        &self.terms[order * (self.rows + 2) + row + 1]
    }

    /// The coefficients of one block.
    pub fn block(&self, row: usize, lane: usize) -> [f64; MOST_COEFFICIENTS] {
        let mut coefficients = [0.0; MOST_COEFFICIENTS];
        for (p, coefficient) in coefficients.iter_mut().enumerate().take(self.order + 1) {
            *coefficient = self.term(p, row)[lane];
        }
        coefficients
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

/// The hot loops, compiled for the features of one kind of processor.
#[derive(Clone, Copy)]
pub(super) struct Kernels {
    expand: unsafe fn(&Chain, &State, &StepInput, &mut Series) -> bool,
    evaluate: unsafe fn(&Series, f64, f64, &mut State),
    reachable: unsafe fn(&Chain, &Series, &mut Vec<(usize, usize)>),
    glide: unsafe fn(&Chain, f64, &mut Glide),
    /// Name of the processor features, for tests and reports.
    #[cfg_attr(not(test), expect(dead_code, reason = "names the path in tests"))]
    pub name: &'static str,
}

/// Compiles the loops for one set of processor features.
macro_rules! kernels {
    ($module:ident, $name:literal $(, $features:literal)?) => {
        mod $module {
            use super::{Chain, Glide, Kernels, Series, State, StepInput, advance, evaluate, expand, reachable};

            $(#[target_feature(enable = $features)])?
            fn expand_here(chain: &Chain, state: &State, input: &StepInput, series: &mut Series) -> bool {
                expand(chain, state, input, series)
            }

            $(#[target_feature(enable = $features)])?
            fn evaluate_here(series: &Series, s: f64, length: f64, state: &mut State) {
                evaluate(series, s, length, state);
            }

            $(#[target_feature(enable = $features)])?
            fn reachable_here(chain: &Chain, series: &Series, blocks: &mut Vec<(usize, usize)>) {
                reachable(chain, series, blocks);
            }

            $(#[target_feature(enable = $features)])?
            fn glide_here(chain: &Chain, seconds: f64, glide: &mut Glide) {
                advance(chain, seconds, glide);
            }

            pub(super) const KERNELS: Kernels = Kernels {
                expand: expand_here,
                evaluate: evaluate_here,
                reachable: reachable_here,
                glide: glide_here,
                name: $name,
            };
        }
    };
}

kernels!(baseline, "baseline");
#[cfg(target_arch = "x86_64")]
kernels!(avx2, "avx2", "avx2");
#[cfg(target_arch = "x86_64")]
kernels!(avx512, "avx512", "avx512f,avx512vl,avx512dq");

impl Kernels {
    /// Every path that this processor can run, the fastest last.
    pub fn available() -> Vec<Self> {
        let mut paths = vec![baseline::KERNELS];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                paths.push(avx2::KERNELS);
            }
            if is_x86_feature_detected!("avx512f")
                && is_x86_feature_detected!("avx512vl")
                && is_x86_feature_detected!("avx512dq")
            {
                paths.push(avx512::KERNELS);
            }
        }
        paths
    }

    /// Expands the state into a series; false if it does not converge within [`MOST_ORDER`].
    #[inline]
    pub fn expand(self, chain: &Chain, state: &State, input: &StepInput, series: &mut Series) -> bool {
        // SAFETY: `available` yields only paths whose features this processor has.
        unsafe { (self.expand)(chain, state, input, series) }
    }

    /// State at s in [0, 1] of a step of so many seconds.
    #[inline]
    pub fn evaluate(self, series: &Series, s: f64, length: f64, state: &mut State) {
        // SAFETY: as above.
        unsafe { (self.evaluate)(series, s, length, state) }
    }

    /// Row and lane of every block that may reach a break position within the step.
    #[inline]
    pub fn reachable(self, chain: &Chain, series: &Series, blocks: &mut Vec<(usize, usize)>) {
        // SAFETY: as above.
        unsafe { (self.reachable)(chain, series, blocks) }
    }

    /// Carries the free motion over so many seconds.
    #[inline]
    pub fn glide(self, chain: &Chain, seconds: f64, glide: &mut Glide) {
        // SAFETY: as above.
        unsafe { (self.glide)(chain, seconds, glide) }
    }
}

#[inline(always)]
fn expand(chain: &Chain, state: &State, input: &StepInput, series: &mut Series) -> bool {
    let rows = series.rows;
    let stride = rows + 2;
    let h = input.length;
    let (x, rest) = series.terms.split_at_mut(stride);
    x[1..=rows].copy_from_slice(&state.displacement[..rows]);
    close(&mut x[..stride], 0.0);
    let rate = &mut rest[..stride];
    for r in 0..rows {
        rate[r + 1] = Row(state.velocity[r].map(|v| h * v));
    }
    close(rate, 0.0);
    for r in 0..rows {
        series.excursion[r] = Row(rate[r + 1].map(f64::abs));
    }
    for p in 0..MOST_ORDER - 1 {
        let next = (p + 2) as f64;
        let for_force = h * h / ((p + 1) as f64 * next);
        let for_damping = chain.damping_rate * h / next;
        stencil(chain, &mut series.terms[p * stride..(p + 3) * stride], for_force, for_damping);
        let added = &mut series.terms[(p + 2) * stride..(p + 3) * stride];
        if p == 0 {
            for (row, pull) in added[1..=rows].iter_mut().zip(&chain.pull) {
                for l in 0..LANES {
                    row[l] += for_force * pull[l];
                }
            }
        }
        close(added, for_force * input.drive[p]);
        // Two orders at a time: every second one may vanish by symmetry.
        if p % 2 == 1 {
            let added = &series.terms[(p + 1) * stride..(p + 3) * stride];
            let (lower, upper) = added.split_at(stride);
            let largest = stray(&lower[1..=rows], &upper[1..=rows], &mut series.excursion);
            series.order = p + 2;
            if next * largest <= input.error {
                return true;
            }
        }
    }
    false
}

/// X_{p+2} without pull and drive, for every row: `terms` holds X_p, X_{p+1} and room for it.
#[inline(always)]
fn stencil(chain: &Chain, terms: &mut [Row], for_force: f64, for_damping: f64) {
    let stride = terms.len() / 3;
    let rows = stride - 2;
    let (x, rest) = terms.split_at_mut(stride);
    let (rate, next) = rest.split_at_mut(stride);
    let entries = rows * LANES;
    let (coupling, diagonal) = (&flat(&chain.coupling)[..entries], &flat(&chain.diagonal)[..entries]);
    let (before, here, after) = (&flat(x)[..entries], &flat(&x[1..])[..entries], &flat(&x[2..])[..entries]);
    let rate = &flat(&rate[1..])[..entries];
    let next = &mut flat_mut(&mut next[1..])[..entries];
    for i in 0..entries {
        let force = coupling[i] * (before[i] + after[i]) - diagonal[i] * here[i];
        next[i] = for_force * force - for_damping * rate[i];
    }
}

/// Adds the drive's share to block 1 and fills the ghost rows.
#[inline(always)]
fn close(rows: &mut [Row], drive: f64) {
    let last = rows.len() - 2;
    let mut first = rows[1];
    first[0] += drive;
    rows[1] = first;
    rows[0] = ghost_before(&rows[last]);
    rows[last + 1] = ghost_after(&rows[1]);
}

/// Adds the magnitudes of two orders to the excursions and returns the largest.
#[inline(always)]
fn stray(lower: &[Row], upper: &[Row], excursion: &mut [Row]) -> f64 {
    let mut largest = Row::filled(0.0);
    for ((lower, upper), excursion) in lower.iter().zip(upper).zip(excursion) {
        let (one, other, before, most) = (lower.map(f64::abs), upper.map(f64::abs), *excursion, largest);
        let (mut total, mut more) = (before, most);
        for l in 0..LANES {
            total[l] = before[l] + (one[l] + other[l]);
            let size = if one[l] > other[l] { one[l] } else { other[l] };
            more[l] = if size > most[l] { size } else { most[l] };
        }
        (*excursion, largest) = (total, more);
    }
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    let pairs = |l: usize| larger(largest[l], largest[l + 4]);
    larger(larger(pairs(0), pairs(1)), larger(pairs(2), pairs(3)))
}

#[inline(always)]
fn evaluate(series: &Series, s: f64, length: f64, state: &mut State) {
    let rows = series.rows;
    let inverse_length = 1.0 / length;
    for r in 0..rows {
        let mut value = *series.term(series.order, r);
        let mut slope = Row::filled(0.0);
        for p in (0..series.order).rev() {
            let term = series.term(p, r);
            for l in 0..LANES {
                slope[l] = slope[l] * s + value[l];
                value[l] = value[l] * s + term[l];
            }
        }
        state.displacement[r] = value;
        for l in 0..LANES {
            state.velocity[r][l] = slope[l] * inverse_length;
        }
    }
}

#[inline(always)]
fn reachable(chain: &Chain, series: &Series, blocks: &mut Vec<(usize, usize)>) {
    blocks.clear();
    for r in 0..series.rows {
        let (x, excursion) = (series.term(0, r), &series.excursion[r]);
        let (upper, lower) = (&chain.upper[r], &chain.lower[r]);
        let mut any = false;
        for l in 0..LANES {
            any |= x[l] + excursion[l] >= upper[l];
            any |= x[l] - excursion[l] <= lower[l];
        }
        if any {
            for l in 0..LANES {
                if x[l] + excursion[l] >= upper[l] || x[l] - excursion[l] <= lower[l] {
                    blocks.push((r, l));
                }
            }
        }
    }
}
