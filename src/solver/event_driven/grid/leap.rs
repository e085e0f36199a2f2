//! Leaps from the grid, in lanes, over many reattachments at once; see [`super::super::leap`] for what a leap may leave out.
//!
//! The last row, a block of every lane, cuts the chain into pieces, which are eliminated side by side, each from its first
//! block on. With the diagonal d, the coupling c to the block before and pivots p,
//!
//! ```text
//! p_r = d_r - c_r k_{r-1},   k_r = c_{r+1}/p_r,   y_{r+1} = k_r y_r,   y_0 = 1,
//! H_r = 1/p_r + k_r² H_{r+1},   b_r = k_r b_{r+1},   H = 0 and b = 1 in the last row.
//! ```
//!
//! H is the diagonal of the inverse of a piece alone. If w solves it alone, the blocks are at x_r = w_r + y_r H_r c_0 x_L +
//! b_r x_R, with the cuts before and after it. These are left with couplings F = c_0 y and diagonals p_R - c_0² H_0, with
//! c_0 and H_0 of the next lane, and are reduced cyclically: three times, each takes in the two beside it, which leaves
//! diagonals 1/G_R. Since F is also what two neighbours are left with of all others, the inverse has
//!
//! ```text
//! G_LR = 2 F G_L G_R/(1 + sqrt(1 + 4 F² G_L G_R)),   G_r = H_r + (y_r H_r c_0)² G_L + 2 y_r H_r c_0 b_r G_LR + b_r² G_R.
//! ```
//!
//! All pivots are positive if the matrix is positive definite, and only then. None grows with the length of the chain.

use super::super::chain::{Chain, State};
use super::super::free_motion::{MIN_PIVOT, find_decay};
use super::super::leap::{Split, SplitRow};
use super::step::FIRST_LANE;
use crate::model::simd::{Simd, Vector};
use crate::model::{Interface, LANES, Row};
use crate::solver::harmonic::Harmonic;

/// Part of the error of a leap that the reattachments passed by it may add up to.
const PASSED_SHARE: f64 = 0.2;
/// Free motion at which a contact may attach on the driven solution, in errors of a leap.
const LOOSE: f64 = 3.0;
/// How far a passed contact may be astray, in errors of a leap: by free motion where it attaches and later, and by what the
/// others displace.
const ASTRAY: f64 = 2.0 * LOOSE + PASSED_SHARE;
/// Diagonal in padding, so large that nothing moves there.
const FIXED: f64 = 1e150;

/// A real (C = 1) or complex (C = 2) number in every lane.
#[derive(Clone, Copy)]
struct Number<S: Simd, const C: usize>(S, [S::Vector; C]);

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
            let (across, minus) = (right.1[C - 1], self.0.splat(0.0).minus(left.1[C - 1]));
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
        let (one, [real, imaginary]) = (self.0.splat(1.0), [self.1[0], self.1[C - 1]]);
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
struct Eliminated<const C: usize> {
    inverse: [Row; C],
    ratio: [Row; C],
    own: [Row; C],
    after: [Row; C],
    before: [Row; C],
}

/// The chain with a diagonal of real or complex numbers, eliminated.
#[derive(Clone, Debug)]
struct Elimination<const C: usize> {
    rows: Vec<Eliminated<C>>,
    /// y in the last row, and F.
    carried: [Row; C],
    coupling: [Row; C],
    /// What a cut takes from those before and after it in each reduction, and G of the cuts.
    reductions: [[[Row; C]; 2]; 3],
    gain: [Row; C],
}

impl<const C: usize> Elimination<C> {
    fn new(rows: usize) -> Self {
        let zero = [Row::filled(0.0); C];
        let row = Eliminated { inverse: zero, ratio: zero, own: zero, after: zero, before: zero };
        Self { rows: vec![row; rows], carried: zero, coupling: zero, reductions: [[zero; 2]; 3], gain: zero }
    }

    /// Eliminates S/m plus `shift`, in 1/s². False if a real matrix is not positive definite.
    #[inline(always)]
    fn eliminate<S: Simd>(&mut self, simd: S, chain: &Chain, fixed: &[Row], shift: [f64; C]) -> bool {
        let rows = chain.layout.rows;
        let (entries, couplings) = (&mut self.rows[..rows], &chain.coupling[..rows]);
        let (zero, shift) = (Number::splat(simd, [0.0; C]), Number::splat(simd, shift));
        let mut one = zero;
        one.1[0] = simd.splat(1.0);
        let (mut ratio, mut along, mut pivot) = (zero, one, zero);
        let (mut least, mut positive) = (simd.splat(0.0), u8::MAX);
        for r in 0..rows {
            let mut entry = shift;
            entry.1[0] = entry.1[0].plus(simd.load(&chain.diagonal[r])).plus(simd.load(&fixed[r]));
            pivot = entry.plus_scaled(ratio, simd.splat(0.0).minus(simd.load(&couplings[r])));
            least = entry.1[0].abs().mul_add(simd.splat(MIN_PIVOT), simd.splat(f64::MIN_POSITIVE));
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
        let (mut own, mut before) = (zero, one);
        for (r, entry) in entries.iter_mut().enumerate().rev() {
            if r + 1 < rows {
                let ratio = Number::load(simd, &entry.ratio);
                own = Number::load(simd, &entry.inverse).plus_product(own, ratio.times(ratio));
                before = before.times(ratio);
            }
            own.store(&mut entry.own);
            own.times(Number::load(simd, &entry.after)).store(&mut entry.after);
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
            let [before, after] = [coupling.times(inverse.on(lanes)), coupling.times(inverse).back(lanes)];
            let taken = before.times(coupling).plus_product(after, coupling.back(lanes));
            (diagonal, coupling) = (diagonal.plus_scaled(taken, minus), before.times(coupling.on(lanes)));
            before.store(from_before);
            after.store(from_after);
        }
        diagonal.inverse().store(&mut self.gain);
        positive & diagonal.1[0].reaches(least) == u8::MAX
    }

    /// Where the cuts are with these forces on them.
    #[inline(always)]
    fn join<S: Simd>(&self, simd: S, mut force: Number<S, C>) -> Number<S, C> {
        for (step, [before, after]) in self.reductions.iter().enumerate() {
            let beside = force.plus_product(Number::load(simd, after), force.back(1 << step));
            force = beside.plus_product(Number::load(simd, before), force.on(1 << step));
        }
        force.times(Number::load(simd, &self.gain))
    }

    /// Where the blocks are with a force on block 1 alone.
    #[inline(always)]
    fn pull_first<'a, S: Simd>(
        &self,
        simd: S,
        chain: &Chain,
        force: [f64; C],
        solution: impl Iterator<Item = &'a mut [Row; C]>,
    ) {
        let force = Number::splat(simd, force).scaled(simd.load(&FIRST_LANE));
        let cut = self.join(simd, force.times(Number::load(simd, &self.carried)));
        let before = force.plus_scaled(cut.on(1), outer(simd, chain));
        for (entry, solution) in self.rows.iter().zip(solution) {
            let from_before = before.times(Number::load(simd, &entry.after));
            from_before.plus_product(cut, Number::load(simd, &entry.before)).store(solution);
        }
    }
}

/// Coupling of the first row to the block before, which lies in the last row of the lane before.
#[inline(always)]
fn outer<S: Simd>(simd: S, chain: &Chain) -> S::Vector {
    simd.load(&chain.coupling[0]).to_lane_before().to_next_lane()
}

/// The eliminations of S/m, of S'/m and of S/m - ω² + iγω.
#[derive(Clone, Debug)]
pub(in super::super) struct Reduction {
    /// The diagonal that padding has in addition.
    fixed: Vec<Row>,
    stiffness: Elimination<1>,
    shifted: Elimination<1>,
    complex: Elimination<2>,
}

impl Reduction {
    pub fn new(chain: &Chain) -> Self {
        let (layout, mut fixed) = (chain.layout, chain.layout.filled(0.0));
        for (row, lane) in (layout.blocks..LANES * layout.rows).map(|block| layout.slot(block)) {
            fixed[row][lane] = FIXED;
        }
        let [stiffness, shifted] = [(); 2].map(|()| Elimination::new(layout.rows));
        Self { fixed, stiffness, shifted, complex: Elimination::new(layout.rows) }
    }

    /// Solves for p1, q and what p0 is in each piece alone. Returns where the cuts are in p0.
    #[inline(always)]
    fn solve<S: Simd>(&mut self, simd: S, chain: &Chain, drive: &Harmonic, rows: &mut [SplitRow]) -> S::Vector {
        let Self { fixed, stiffness, complex, .. } = self;
        let pulling = chain.drive_stiffness / chain.mass;
        stiffness.eliminate(simd, chain, fixed, [0.0]);
        stiffness.pull_first(simd, chain, [pulling * drive.rate], rows.iter_mut().map(|row| &mut row.rate));
        if drive.amplitude > 0.0 {
            let (sine, cosine) = libm::sincos(drive.phase);
            let (frequency, force) = (drive.angular_frequency, pulling * drive.amplitude);
            complex.eliminate(simd, chain, fixed, [-frequency * frequency, chain.damping_rate * frequency]);
            let waves = rows.iter_mut().map(|row| &mut row.wave);
            complex.pull_first(simd, chain, [force * cosine, force * sine], waves);
            for row in &mut *rows {
                let (real, imaginary) = (simd.load(&row.wave[0]), simd.load(&row.wave[1]));
                real.mul_add(real, imaginary.times(imaginary)).root().store(&mut row.swing);
            }
        } else if rows[0].swing[0] != 0.0 {
            // A ramp has switched the modulation off.
            for row in &mut *rows {
                (row.wave, row.swing) = ([Row::filled(0.0); 2], Row::filled(0.0));
            }
        }
        let damping = simd.splat(-chain.damping_rate);
        let mut force = simd.splat(pulling * drive.start).times(simd.load(&FIRST_LANE));
        let last = rows.len() - 1;
        for ((r, row), entry) in rows.iter_mut().enumerate().zip(&stiffness.rows) {
            let own = simd.load(&row.rate[0]).mul_add(damping, simd.load(&chain.pull[r]));
            force = force.plus(own);
            force.store(&mut row.start);
            force = if r < last { force.times(simd.load(&entry.ratio[0])) } else { force };
        }
        let mut alone = simd.splat(0.0);
        for (row, entry) in rows[..last].iter_mut().zip(&stiffness.rows).rev() {
            let own = simd.load(&row.start).times(simd.load(&entry.inverse[0]));
            alone = alone.mul_add(simd.load(&entry.ratio[0]), own);
            alone.store(&mut row.start);
        }
        simd.splat(0.0).store(&mut rows[last].start);
        let on_cuts = alone.times(outer(simd, chain)).to_lane_before().plus(force);
        stiffness.join(simd, Number(simd, [on_cuts])).1[0]
    }

    /// The diagonal of the inverse of S'/m, and the bounds for this energy, twice E/m. Returns the largest bound.
    #[inline(always)]
    fn bound<S: Simd>(&self, simd: S, chain: &Chain, twice_energy: f64, rows: &mut [SplitRow]) -> f64 {
        let Elimination { rows: entries, coupling: [coupling], gain: [gain], .. } = &self.shifted;
        let (outer, coupling, after) = (outer(simd, chain), simd.load(coupling), simd.load(gain));
        let before = after.to_next_lane();
        let product = coupling.times(before).times(after);
        let root = product.times(coupling).mul_add(simd.splat(4.0), simd.splat(1.0)).root();
        let twice_mixed = product.times(simd.splat(4.0)).over(root.plus(simd.splat(1.0)));
        let mut largest = simd.splat(0.0);
        for (row, entry) in rows.iter_mut().zip(entries) {
            let (along, back) = (simd.load(&entry.after[0]).times(outer), simd.load(&entry.before[0]));
            let mixed = along.mul_add(before, back.times(twice_mixed));
            let own = back.times(after).mul_add(back, along.mul_add(mixed, simd.load(&entry.own[0])));
            let bound = own.times(simd.splat(twice_energy)).root();
            own.store(&mut row.compliance);
            bound.store(&mut row.bound);
            largest = largest.larger(bound);
        }
        let mut lanes = Row::filled(0.0);
        largest.store(&mut lanes);
        lanes.reduce(f64::max)
    }
}

/// Splits the motion into driven solution and free motion, and bounds the latter. Returns the largest bound on a
/// displacement, in m; `None` if the free motion does not decay.
#[inline(always)]
pub(in super::super) fn split_in_lanes<S: Simd>(
    simd: S,
    chain: &Chain,
    drive: &Harmonic,
    state: &State,
    reduction: &mut Reduction,
    Split { rows, decay_rate, propagator }: &mut Split,
) -> Option<f64> {
    let Reduction { shifted, fixed, .. } = &mut *reduction;
    let shift = |decay_rate: f64| decay_rate * (chain.damping_rate - decay_rate);
    let decays = find_decay(
        decay_rate,
        chain,
        #[inline(always)]
        |decay_rate| shifted.eliminate(simd, chain, fixed, [-shift(decay_rate)]),
    );
    if !decays {
        return None;
    }
    let shift = simd.splat(shift(*decay_rate));
    let cut = reduction.solve(simd, chain, drive, rows);
    let (outer, minus_two) = (outer(simd, chain), simd.splat(-2.0));
    let before = cut.to_next_lane().times(outer);
    let [displaced, moved] = &mut propagator.here;
    let (mut energy, mut y_before, mut y_first) = (simd.splat(0.0), simd.splat(0.0), simd.splat(0.0));
    for ((r, row), entry) in rows.iter_mut().enumerate().zip(&reduction.stiffness.rows) {
        let alone = before.mul_add(simd.load(&entry.after[0]), simd.load(&row.start));
        let start = cut.mul_add(simd.load(&entry.before[0]), alone);
        let (real, imaginary) = (simd.load(&row.wave[0]), simd.load(&row.wave[1]));
        start.store(&mut row.start);
        let y = simd.load(&state.displacement[r]).minus(start).minus(real);
        // d/dt Re(q e^{iωt}) = -ω Im q at the start.
        let velocity = simd.load(&state.velocity[r]).minus(simd.load(&row.rate[0]));
        let w = imaginary.mul_add(simd.splat(drive.angular_frequency), velocity);
        let shifted = y.mul_add(simd.splat(*decay_rate), w);
        y.store(&mut displaced[r]);
        shifted.store(&mut moved[r]);
        let own = simd.load(&chain.diagonal[r]).minus(shift).times(y);
        let stretched = y_before.times(minus_two).mul_add(simd.load(&chain.coupling[r]), own);
        energy = shifted.mul_add(shifted, y.mul_add(stretched, energy));
        y_first = if r == 0 { y } else { y_first };
        y_before = y;
    }
    let across = y_before.to_next_lane().times(outer).times(y_first);
    let mut sums = Row::filled(0.0);
    across.mul_add(minus_two, energy).store(&mut sums);
    Some(reduction.bound(simd, chain, sums.reduce(|a, b| a + b).max(0.0), rows))
}

/// A leap over reattachments. A contact that attaches on the way holds its block back by its stiffness times how far the
/// block has moved since, which the driven solution leaves out; what all displace may be a part of the error of a leap.
pub(in super::super) struct Passing {
    /// When it starts, in the frame, how long it must be and may be, in s.
    pub start: f64,
    pub least: f64,
    pub most: f64,
}

impl Passing {
    /// How long the leap may be, in s, if it is allowed to leave out `error` m, with free motion of at most `largest` m now;
    /// if that is too short, after how many seconds to look again.
    pub fn horizon(
        &self,
        split: &Split,
        chain: &Chain,
        interface: &mut Interface,
        drive: &Harmonic,
        [largest, error]: [f64; 2],
    ) -> Result<f64, f64> {
        let loose = libm::log(largest / (LOOSE * error)) / split.decay_rate;
        let (allowed, per_mass) = (PASSED_SHARE * error, 1.0 / chain.mass);
        let (mut displaced, mut rate, mut last, mut limit) = (0.0, 0.0, 0.0, self.most);
        interface.look_ahead_to_lives(|due, block, [stiffness, reach]| {
            let seconds = due - self.start;
            let by_then = displaced + rate * (seconds - last);
            if seconds >= limit || by_then > allowed {
                return false;
            }
            if seconds < loose {
                limit = seconds;
                return false;
            }
            (displaced, last) = (by_then, seconds);
            let (r, lane) = chain.layout.slot(block);
            let SplitRow { rate: [speeds], swing, compliance, .. } = &split.rows[r];
            let speed = speeds[lane] + drive.angular_frequency * swing[lane];
            rate += per_mass * stiffness * speed * compliance[lane];
            // Nor may it break.
            limit = limit.min(seconds + (reach - ASTRAY * error).max(0.0) / speed);
            true
        });
        let horizon = if rate > 0.0 { limit.min(last + (allowed - displaced) / rate) } else { limit };
        if horizon < self.least { Err(loose.clamp(0.5 * self.least, 4.0 * self.least)) } else { Ok(horizon) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::free_motion::SplitMotion;
    use super::super::super::kernels::available;
    use super::super::super::leap::Leap;
    use super::super::super::slider::Slider;
    use super::*;
    use crate::model::Parameters;

    /// Pseudo-random numbers in [0, 1).
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// A slider in motion, with some of its contacts, and break positions around it.
    fn slider(parameters: &Parameters) -> Slider {
        let mut next = numbers();
        let mut slider = Slider::new(parameters);
        let reach = parameters.contact_reach();
        let frequency = (parameters.block_contact_stiffness() / parameters.block_mass()).sqrt();
        let Slider { chain, state, .. } = &mut slider;
        for block in 0..parameters.blocks {
            let (row, lane) = chain.layout.slot(block);
            let stiffness = next().powi(3) * parameters.block_contact_stiffness() / chain.mass;
            chain.diagonal[row][lane] = chain.bare[row][lane] / chain.mass + stiffness;
            chain.pull[row][lane] = stiffness * reach * (next() - 0.5);
            state.displacement[row][lane] = reach * (next() - 0.5);
            state.velocity[row][lane] = frequency * reach * (next() - 0.5);
        }
        slider
    }

    const PLAIN: Harmonic = Harmonic { start: 3e-6, rate: 1e-4, amplitude: 0.0, phase: 0.0, angular_frequency: 0.0 };
    const MODULATED: Harmonic = Harmonic { amplitude: 1e-6, phase: 0.7, angular_frequency: 364.0, ..PLAIN };

    #[test]
    fn a_split_in_lanes_is_that_from_block_to_block() {
        let plain = Parameters::default();
        for blocks in [1, 2, 7, 8, 9, 15, 70, 140, 560, 1000] {
            for exponent in [-8, -4, -1, 0, 2, 4, 8] {
                for damping_rate in [0.0, 1.0, 1e4, 1e7] {
                    let stiff = libm::exp10(f64::from(exponent));
                    let slider_stiffness = stiff * plain.block_contact_stiffness() / (blocks.max(2) - 1) as f64;
                    let parameters = Parameters { blocks, slider_stiffness, damping_rate, ..plain.clone() };
                    // Both lose digits where the chain is stiff against its contacts.
                    compare(&parameters, &MODULATED, 1e-12 * stiff.max(1.0));
                    compare(&parameters, &PLAIN, 1e-12 * stiff.max(1.0));
                }
            }
        }
    }

    fn compare(parameters: &Parameters, drive: &Harmonic, allowed: f64) {
        let what = (parameters.blocks, parameters.slider_stiffness, parameters.damping_rate, drive.amplitude);
        let Slider { chain, state, .. } = slider(parameters);
        let (_, kernels) = available(chain.layout.rows).pop().unwrap();
        let [mut expected, mut split] = [(); 2].map(|()| Leap::new(&chain).split);
        let largest = SplitMotion::new(chain.layout).split(&chain, &*kernels, drive, &state, &mut expected);
        let found = kernels.split_in_lanes(&chain, drive, &state, &mut Reduction::new(&chain), &mut split);
        let (Some(largest), Some(found)) = (largest, found) else {
            assert_eq!(found, largest, "{what:?}");
            return;
        };
        assert!((found / largest - 1.0).abs() < allowed, "{what:?}: bound {found}, not {largest}");
        assert_eq!(split.decay_rate, expected.decay_rate, "{what:?}");
        let blocks = || (0..parameters.blocks).map(|block| (block, chain.layout.slot(block)));
        let widest = blocks().fold(0.0_f64, |most, (block, _)| most.max(expected.driven(&chain, block).start.abs()));
        for (block, (row, lane)) in blocks() {
            let [was, is] = [&expected, &split].map(|split| split.driven(&chain, block));
            let free = |split: &Split| {
                let [displaced, moved] = split.propagator.here.each_ref().map(|rows| rows[row][lane]);
                [displaced, moved, split.rows[row].bound[lane]]
            };
            let ([y, shifted, bound], of_lanes) = (free(&expected), free(&split));
            let speed = shifted.abs() + expected.decay_rate * widest;
            for (is, was, scale) in [
                (is.start, was.start, widest),
                (is.rate, was.rate, was.rate),
                (is.wave[0], was.wave[0], was.swing),
                (is.wave[1], was.wave[1], was.swing),
                (is.swing, was.swing, was.swing),
                (of_lanes[0], y, widest),
                (of_lanes[1], shifted, speed),
                (of_lanes[2], bound, bound),
            ] {
                // Squares of less than 1e-150 are rounded away.
                assert!((is - was).abs() < allowed * scale + 1e-150, "{what:?}: {is}, not {was} at block {block}");
            }
        }
    }
}
