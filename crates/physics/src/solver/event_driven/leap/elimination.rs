//! The matrix of the chain, with any shift of its diagonal, eliminated in lanes: what a split of the motion solves.
//!
//! The last row, a block of every lane, cuts the chain into pieces, which are eliminated side by side, each from its
//! first block on. With the diagonal d, the coupling c to the block before and pivots p,
//!
//! ```text
//! p_r = d_r - c_r k_{r-1},   k_r = c_{r+1}/p_r,   y_{r+1} = k_r y_r,   y_0 = 1,
//! H_r = 1/p_r + k_r² H_{r+1},   b_r = k_r b_{r+1},   H = 0 and b = 1 in the last row.
//! ```
//!
//! H is the diagonal of the inverse of a piece alone. If w solves it alone, the blocks are at x_r = w_r + y_r H_r c_0
//! x_L + b_r x_R, with the cuts before and after it. These are left with couplings F = c_0 y and diagonals p_R - c_0²
//! H_0, with c_0 and H_0 of the next lane, and are reduced cyclically: three times, each takes in the two beside it,
//! which leaves diagonals 1/G_R. Since F is also what two neighbours are left with of all others, the inverse has
//!
//! ```text
//! G_LR = 2 F G_L G_R/(1 + sqrt(1 + 4 F² G_L G_R)),   G_r = H_r + (y_r H_r c_0)² G_L + 2 y_r H_r c_0 b_r G_LR + b_r² G_R.
//! ```
//!
//! All pivots are positive if the matrix is positive definite, and only then. None grows with the length of the chain.

use crate::model::Row;
use crate::model::simd::{Simd, Vector};
use crate::solver::event_driven::slider::{Chain, FIRST_BLOCK};

/// Part of its diagonal entry that a pivot must exceed: less is rounding, and the matrix not surely positive definite.
const MIN_PIVOT: f64 = 1e-12;

/// A real (C = 1) or complex (C = 2) number in every lane.
#[derive(Clone, Copy)]
pub struct Number<S: Simd, const C: usize>(pub S, pub [S::Vector; C]);

/// Loops, since closures may be compiled without the features of the token.
impl<S: Simd, const C: usize> Number<S, C> {
    #[inline(always)]
    fn splat(simd: S, value: [f64; C]) -> Self {
        let mut parts = [simd.splat(value[0]); C];
        for part in 1..C {
            parts[part] = simd.splat(value[part]);
        }
        Self(simd, parts)
    }

    #[inline(always)]
    fn load(simd: S, rows: &[Row; C]) -> Self {
        let mut parts = [simd.load(&rows[0]); C];
        for part in 1..C {
            parts[part] = simd.load(&rows[part]);
        }
        Self(simd, parts)
    }

    #[inline(always)]
    fn store(self, rows: &mut [Row; C]) {
        for part in 0..C {
            self.1[part].store(&mut rows[part]);
        }
    }

    #[inline(always)]
    fn plus_scaled(mut self, other: Self, factor: S::Vector) -> Self {
        for part in 0..C {
            self.1[part] = other.1[part].mul_add(factor, self.1[part]);
        }
        self
    }

    #[inline(always)]
    fn scaled(mut self, factor: S::Vector) -> Self {
        for part in 0..C {
            self.1[part] = self.1[part].times(factor);
        }
        self
    }

    #[inline(always)]
    fn plus_product(self, left: Self, right: Self) -> Self {
        let mut sum = self.plus_scaled(left, right.1[0]);
        if C > 1 {
            let across = right.1[C - 1];
            let minus = self.0.splat(0.0).minus(left.1[C - 1]);
            sum.1[0] = minus.mul_add(across, sum.1[0]);
            sum.1[C - 1] = left.1[0].mul_add(across, sum.1[C - 1]);
        }
        sum
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        Self::splat(self.0, [0.0; C]).plus_product(self, other)
    }

    #[inline(always)]
    fn inverse(mut self) -> Self {
        let one = self.0.splat(1.0);
        let real = self.1[0];
        let imaginary = self.1[C - 1];
        if C == 1 {
            self.1[0] = one.over(real);
            return self;
        }
        self.1[C - 1] = self.0.splat(0.0).minus(imaginary);
        self.scaled(one.over(real.mul_add(real, imaginary.times(imaginary))))
    }

    /// Every lane moved on by `lanes`, and back.
    #[inline(always)]
    fn on(mut self, lanes: usize) -> Self {
        for part in 0..C {
            for _ in 0..lanes {
                self.1[part] = self.1[part].to_next_lane();
            }
        }
        self
    }

    #[inline(always)]
    fn back(mut self, lanes: usize) -> Self {
        for part in 0..C {
            for _ in 0..lanes {
                self.1[part] = self.1[part].to_lane_before();
            }
        }
        self
    }
}

/// What elimination leaves of a row: 1/p, k, H, y H and b.
#[derive(Clone, Debug)]
pub struct Eliminated<const C: usize> {
    pub inverse: [Row; C],
    pub ratio: [Row; C],
    pub own: [Row; C],
    pub after: [Row; C],
    pub before: [Row; C],
}

/// The chain with a diagonal of real or complex numbers, eliminated.
#[derive(Clone, Debug)]
pub struct Elimination<const C: usize> {
    pub rows: Vec<Eliminated<C>>,
    /// y in the last row, and F.
    carried: [Row; C],
    pub coupling: [Row; C],
    /// What a cut takes from those before and after it in each reduction, and G of the cuts.
    reductions: [[[Row; C]; 2]; 3],
    pub gain: [Row; C],
}

impl<const C: usize> Elimination<C> {
    pub fn new(rows: usize) -> Self {
        let zero = [Row::filled(0.0); C];
        let row = Eliminated {
            inverse: zero,
            ratio: zero,
            own: zero,
            after: zero,
            before: zero,
        };
        Self {
            rows: vec![row; rows],
            carried: zero,
            coupling: zero,
            reductions: [[zero; 2]; 3],
            gain: zero,
        }
    }

    /// Eliminates S/m plus `shift`, in 1/s². False if a real matrix is not positive definite.
    #[inline(always)]
    pub fn eliminate<S: Simd>(
        &mut self,
        simd: S,
        chain: &Chain,
        fixed: &[Row],
        shift: [f64; C],
    ) -> bool {
        let rows = chain.layout.rows;
        let entries = &mut self.rows[..rows];
        let couplings = &chain.coupling[..rows];
        let zero = Number::splat(simd, [0.0; C]);
        let shift = Number::splat(simd, shift);
        let mut one = zero;
        one.1[0] = simd.splat(1.0);
        let mut ratio = zero;
        let mut along = one;
        let mut pivot = zero;
        let mut least = simd.splat(0.0);
        let mut positive = u8::MAX;
        for r in 0..rows {
            let mut entry = shift;
            entry.1[0] = entry.1[0]
                .plus(simd.load(&chain.diagonal[r]))
                .plus(simd.load(&fixed[r]));
            pivot = entry.plus_scaled(ratio, simd.splat(0.0).minus(simd.load(&couplings[r])));
            least = entry.1[0]
                .abs()
                .mul_add(simd.splat(MIN_PIVOT), simd.splat(f64::MIN_POSITIVE));
            positive &= pivot.1[0].reaches(least);
            along.store(&mut entries[r].after);
            if r + 1 < rows {
                let inverse = pivot.inverse();
                ratio = inverse.scaled(simd.load(&couplings[r + 1]));
                along = along.times(ratio);
                inverse.store(&mut entries[r].inverse);
                ratio.store(&mut entries[r].ratio);
            }
        }
        along.store(&mut self.carried);
        let mut own = zero;
        let mut before = one;
        for (r, entry) in entries.iter_mut().enumerate().rev() {
            if r + 1 < rows {
                let ratio = Number::load(simd, &entry.ratio);
                own = Number::load(simd, &entry.inverse).plus_product(own, ratio.times(ratio));
                before = before.times(ratio);
            }
            own.store(&mut entry.own);
            own.times(Number::load(simd, &entry.after))
                .store(&mut entry.after);
            before.store(&mut entry.before);
        }
        let outer = outer(simd, chain);
        let minus = simd.splat(-1.0);
        let mut diagonal = pivot.plus_scaled(own.scaled(outer.times(outer)).back(1), minus);
        let mut coupling = along.scaled(outer);
        coupling.store(&mut self.coupling);
        for (step, [from_before, from_after]) in self.reductions.iter_mut().enumerate() {
            let lanes = 1 << step;
            positive &= diagonal.1[0].reaches(least);
            let inverse = diagonal.inverse();
            let [before, after] = [
                coupling.times(inverse.on(lanes)),
                coupling.times(inverse).back(lanes),
            ];
            let taken = before
                .times(coupling)
                .plus_product(after, coupling.back(lanes));
            (diagonal, coupling) = (
                diagonal.plus_scaled(taken, minus),
                before.times(coupling.on(lanes)),
            );
            before.store(from_before);
            after.store(from_after);
        }
        diagonal.inverse().store(&mut self.gain);
        positive & diagonal.1[0].reaches(least) == u8::MAX
    }

    /// Where the cuts are with these forces on them.
    #[inline(always)]
    pub fn join<S: Simd>(&self, simd: S, mut force: Number<S, C>) -> Number<S, C> {
        for (step, [before, after]) in self.reductions.iter().enumerate() {
            let beside = force.plus_product(Number::load(simd, after), force.back(1 << step));
            force = beside.plus_product(Number::load(simd, before), force.on(1 << step));
        }
        force.times(Number::load(simd, &self.gain))
    }

    /// Where the blocks are with a force on block 1 alone.
    #[inline(always)]
    pub fn pull_first<'a, S: Simd>(
        &self,
        simd: S,
        chain: &Chain,
        force: [f64; C],
        solution: impl Iterator<Item = &'a mut [Row; C]>,
    ) {
        let force = Number::splat(simd, force).scaled(simd.load(&FIRST_BLOCK));
        let cut = self.join(simd, force.times(Number::load(simd, &self.carried)));
        let before = force.plus_scaled(cut.on(1), outer(simd, chain));
        for (entry, solution) in self.rows.iter().zip(solution) {
            let from_before = before.times(Number::load(simd, &entry.after));
            from_before
                .plus_product(cut, Number::load(simd, &entry.before))
                .store(solution);
        }
    }
}

/// Coupling of the first row to the block before, which lies in the last row of the lane before.
#[inline(always)]
pub fn outer<S: Simd>(simd: S, chain: &Chain) -> S::Vector {
    simd.load(&chain.coupling[0])
        .to_lane_before()
        .to_next_lane()
}
