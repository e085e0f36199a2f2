//! The motion of the chain, split into the driven solution, to which it decays between events, and the free motion
//! about it, with a bound for each block.
//!
//! The driven solution is x_p(t) = p0 + p1 t + Re(q e^{iωt}): two real solves and, with modulation, a complex one. The
//! free motion y = x - x_p is damped and undriven. With w = y', a rate a <= γ/2 and S' = S - m a (γ - a),
//!
//! ```text
//! E = ½ m |w + a y|² + ½ yᵀ S' y,    E' = -(γ - a) m |w + a y|² - a yᵀ S' y <= -2 a E,
//! |y_j(t)| <= sqrt(2 E (S'⁻¹)_jj) e^{-a t}
//! ```
//!
//! hold if S' is positive definite: a bound for each block, and its decay. With a = γ/2 it is sharp unless a mode is
//! overdamped; then a is halved until S' is positive definite.

use super::elimination::{Elimination, Number, outer};
use crate::model::simd::{Simd, Vector};
use crate::model::{LANES, Row};
use crate::solver::event_driven::slider::{Chain, FIRST_BLOCK, Slot, State};
use crate::solver::harmonic::Harmonic;

/// Halvings of the decay rate after which free motion counts as undamped.
const MAX_HALVINGS: i32 = 40;
/// Diagonal in padding, so large that nothing moves there.
const FIXED: f64 = 1e150;

/// The driven solution of one block: p0 in m, p1 in m/s, q in m, and |q|.
#[derive(Clone, Copy, Debug)]
pub struct BlockMotion {
    pub start: f64,
    pub rate: f64,
    pub wave: [f64; 2],
    pub swing: f64,
}

/// The motion at the start of a leap, split: driven solution and free motion of a row of blocks.
#[derive(Clone, Debug, Default)]
pub struct SplitRow {
    /// p0 in m, p1 in m/s, q in m, and |q|.
    pub start: Row,
    pub rate: [Row; 1],
    pub wave: [Row; 2],
    pub swing: Row,
    /// Bound on |y|, in m.
    pub bound: Row,
    /// m (S'⁻¹)_jj, in s².
    compliance: Row,
}

#[derive(Clone, Debug)]
pub struct Split {
    pub rows: Vec<SplitRow>,
    /// The rate a at which the bound on the free motion decays, in 1/s.
    pub decay_rate: f64,
    /// The diagonal that padding has in addition, and the eliminations of S/m, of S'/m and of S/m - ω² + iγω.
    fixed: Vec<Row>,
    stiffness: Elimination<1>,
    shifted: Elimination<1>,
    complex: Elimination<2>,
}

impl Split {
    pub fn new(chain: &Chain) -> Self {
        let layout = chain.layout;
        let mut fixed = chain.layout.filled(0.0);
        for Slot { row, lane } in
            (layout.blocks..LANES * layout.rows).map(|block| layout.slot(block))
        {
            fixed[row][lane] = FIXED;
        }
        let [stiffness, shifted] = [(); 2].map(|()| Elimination::new(layout.rows));
        Self {
            rows: vec![SplitRow::default(); layout.rows],
            decay_rate: f64::INFINITY,
            fixed,
            stiffness,
            shifted,
            complex: Elimination::new(layout.rows),
        }
    }

    /// The driven solution of a block.
    pub fn driven(&self, chain: &Chain, block: usize) -> BlockMotion {
        let Slot { row, lane } = chain.layout.slot(block);
        let row = &self.rows[row];
        BlockMotion {
            start: row.start[lane],
            rate: row.rate[0][lane],
            wave: [row.wave[0][lane], row.wave[1][lane]],
            swing: row.swing[lane],
        }
    }

    /// Largest speed of a block on the driven solution, in m/s.
    #[inline(always)]
    pub fn largest_speed(&self, drive: &Harmonic, Slot { row, lane }: Slot) -> f64 {
        let row = &self.rows[row];
        row.rate[0][lane] + drive.angular_frequency * row.swing[lane]
    }

    /// How far a force on a block displaces it at most, per mass, in s².
    #[inline(always)]
    pub fn compliance(&self, Slot { row, lane }: Slot) -> f64 {
        self.rows[row].compliance[lane]
    }

    /// Splits a state, and bounds the free motion. Returns the largest bound on a displacement, in m; `None` if the
    /// free motion does not decay.
    #[inline(always)]
    pub fn update<S: Simd>(
        &mut self,
        simd: S,
        chain: &Chain,
        drive: &Harmonic,
        state: &State,
    ) -> Option<f64> {
        let shift = simd.splat(self.find_decay(simd, chain)?);
        let cut = self.solve(simd, chain, drive);
        let outer = outer(simd, chain);
        let minus_two = simd.splat(-2.0);
        let before = cut.to_next_lane().times(outer);
        let mut energy = simd.splat(0.0);
        let mut y_before = simd.splat(0.0);
        let mut y_first = simd.splat(0.0);
        for ((r, row), entry) in self.rows.iter_mut().enumerate().zip(&self.stiffness.rows) {
            let alone = before.mul_add(simd.load(&entry.after[0]), simd.load(&row.start));
            let start = cut.mul_add(simd.load(&entry.before[0]), alone);
            let real = simd.load(&row.wave[0]);
            let imaginary = simd.load(&row.wave[1]);
            start.store(&mut row.start);
            let y = simd.load(&state.displacement[r]).minus(start).minus(real);
            // d/dt Re(q e^{iωt}) = -ω Im q at the start.
            let velocity = simd.load(&state.velocity[r]).minus(simd.load(&row.rate[0]));
            let w = imaginary.mul_add(simd.splat(drive.angular_frequency), velocity);
            let shifted = y.mul_add(simd.splat(self.decay_rate), w);
            let own = simd.load(&chain.diagonal[r]).minus(shift).times(y);
            let stretched = y_before
                .times(minus_two)
                .mul_add(simd.load(&chain.coupling[r]), own);
            energy = shifted.mul_add(shifted, y.mul_add(stretched, energy));
            y_first = if r == 0 { y } else { y_first };
            y_before = y;
        }
        let across = y_before.to_next_lane().times(outer).times(y_first);
        let twice_energy = across
            .mul_add(minus_two, energy)
            .reduce(|a, b| a + b)
            .max(0.0);
        Some(self.bound(simd, chain, twice_energy))
    }

    /// Finds the decay rate a, from that of the last time, with which S' can be eliminated. Returns a (γ - a), by which
    /// S/m is shifted, in 1/s².
    #[inline(always)]
    fn find_decay<S: Simd>(&mut self, simd: S, chain: &Chain) -> Option<f64> {
        let fastest = 0.5 * chain.damping_rate;
        self.decay_rate = fastest.min(4.0 * self.decay_rate);
        for _ in 0..MAX_HALVINGS {
            let shift = self.decay_rate * (chain.damping_rate - self.decay_rate);
            if self.shifted.eliminate(simd, chain, &self.fixed, [-shift]) {
                return Some(shift);
            }
            self.decay_rate *= 0.5;
        }
        self.decay_rate = fastest;
        None
    }

    /// Solves for p1, q and what p0 is in each piece alone. Returns where the cuts are in p0.
    #[inline(always)]
    fn solve<S: Simd>(&mut self, simd: S, chain: &Chain, drive: &Harmonic) -> S::Vector {
        let Self {
            rows,
            fixed,
            stiffness,
            complex,
            ..
        } = self;
        let pulling = chain.drive_stiffness / chain.mass;
        stiffness.eliminate(simd, chain, fixed, [0.0]);
        stiffness.pull_first(
            simd,
            chain,
            [pulling * drive.rate],
            rows.iter_mut().map(|row| &mut row.rate),
        );
        if drive.amplitude > 0.0 {
            let (sine, cosine) = libm::sincos(drive.phase);
            let frequency = drive.angular_frequency;
            let force = pulling * drive.amplitude;
            complex.eliminate(
                simd,
                chain,
                fixed,
                [-frequency * frequency, chain.damping_rate * frequency],
            );
            let waves = rows.iter_mut().map(|row| &mut row.wave);
            complex.pull_first(simd, chain, [force * cosine, force * sine], waves);
            for row in rows.iter_mut() {
                let real = simd.load(&row.wave[0]);
                let imaginary = simd.load(&row.wave[1]);
                real.mul_add(real, imaginary.times(imaginary))
                    .root()
                    .store(&mut row.swing);
            }
        } else if rows[0].swing[0] != 0.0 {
            // A ramp has switched the modulation off.
            for row in rows.iter_mut() {
                (row.wave, row.swing) = ([Row::filled(0.0); 2], Row::filled(0.0));
            }
        }
        let damping = simd.splat(-chain.damping_rate);
        let mut force = simd
            .splat(pulling * drive.start)
            .times(simd.load(&FIRST_BLOCK));
        let last = rows.len() - 1;
        for ((r, row), entry) in rows.iter_mut().enumerate().zip(&stiffness.rows) {
            let own = simd
                .load(&row.rate[0])
                .mul_add(damping, simd.load(&chain.pull[r]));
            force = force.plus(own);
            force.store(&mut row.start);
            force = if r < last {
                force.times(simd.load(&entry.ratio[0]))
            } else {
                force
            };
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
    fn bound<S: Simd>(&mut self, simd: S, chain: &Chain, twice_energy: f64) -> f64 {
        let Elimination {
            rows: entries,
            coupling: [coupling],
            gain: [gain],
            ..
        } = &self.shifted;
        let outer = outer(simd, chain);
        let coupling = simd.load(coupling);
        let after = simd.load(gain);
        let before = after.to_next_lane();
        let product = coupling.times(before).times(after);
        let root = product
            .times(coupling)
            .mul_add(simd.splat(4.0), simd.splat(1.0))
            .root();
        let twice_mixed = product
            .times(simd.splat(4.0))
            .over(root.plus(simd.splat(1.0)));
        let mut largest = simd.splat(0.0);
        for (row, entry) in self.rows.iter_mut().zip(entries) {
            let along = simd.load(&entry.after[0]).times(outer);
            let back = simd.load(&entry.before[0]);
            let mixed = along.mul_add(before, back.times(twice_mixed));
            let own = back
                .times(after)
                .mul_add(back, along.mul_add(mixed, simd.load(&entry.own[0])));
            let bound = own.times(simd.splat(twice_energy)).root();
            own.store(&mut row.compliance);
            bound.store(&mut row.bound);
            largest = largest.larger(bound);
        }
        largest.reduce(f64::max)
    }
}

impl BlockMotion {
    /// First instant in [`from`, `until`], in s, at which the block is at or beyond a break position; if none, one that
    /// is later or infinite.
    pub fn reaches(
        &self,
        drive: &Harmonic,
        [lower, upper]: [f64; 2],
        [from, until]: [f64; 2],
    ) -> f64 {
        if drive.amplitude == 0.0 {
            // The rate is positive, so the ramp alone only rises.
            return if lower >= self.start {
                from
            } else {
                ((upper - self.start) / self.rate).max(from)
            };
        }
        let rises_before = self.start + self.rate * until + self.swing >= upper;
        let falls_at_all = self.start + self.rate * from - self.swing <= lower;
        if !(rises_before || falls_at_all) {
            return f64::INFINITY;
        }
        let phase = libm::atan2(self.wave[1], self.wave[0]);
        let motion = Harmonic {
            start: self.start,
            rate: self.rate,
            amplitude: self.swing,
            phase,
            angular_frequency: drive.angular_frequency,
        };
        let rise = if rises_before {
            motion.first_rise_to(upper, from)
        } else {
            f64::INFINITY
        };
        let fall = if falls_at_all {
            motion.first_fall_to(lower, from)
        } else {
            f64::INFINITY
        };
        rise.min(fall)
    }

    /// Displacement after `elapsed` s, in m.
    pub fn displacement(&self, drive: &Harmonic, elapsed: f64) -> f64 {
        let ramp = self.start + self.rate * elapsed;
        if drive.amplitude == 0.0 {
            return ramp;
        }
        let (sine, cosine) = libm::sincos(drive.turn(elapsed));
        ramp + self.wave[0] * cosine - self.wave[1] * sine
    }

    /// F_S if this is the motion of block 1, in N.
    pub fn force(&self, drive: &Harmonic, stiffness: f64) -> Harmonic {
        let (sine, cosine) = libm::sincos(drive.phase);
        let real = drive.amplitude * cosine - self.wave[0];
        let imaginary = drive.amplitude * sine - self.wave[1];
        Harmonic {
            start: stiffness * (drive.start - self.start),
            rate: stiffness * (drive.rate - self.rate),
            amplitude: stiffness * libm::hypot(real, imaginary),
            phase: libm::atan2(imaginary, real),
            angular_frequency: drive.angular_frequency,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::solver::event_driven::slider::Slider;
    use pulp::Scalar512b as Baseline;

    /// Pseudo-random numbers in [0, 1).
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
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
            let Slot { row, lane } = chain.layout.slot(block);
            let stiffness = next().powi(3) * parameters.block_contact_stiffness() / chain.mass;
            chain.diagonal[row][lane] = chain.bare[row][lane] / chain.mass + stiffness;
            chain.pull[row][lane] = stiffness * reach * (next() - 0.5);
            state.displacement[row][lane] = reach * (next() - 0.5);
            state.velocity[row][lane] = frequency * reach * (next() - 0.5);
        }
        slider
    }

    const PLAIN: Harmonic = Harmonic {
        start: 3e-6,
        rate: 1e-4,
        amplitude: 0.0,
        phase: 0.0,
        angular_frequency: 0.0,
    };
    const MODULATED: Harmonic = Harmonic {
        amplitude: 1e-6,
        phase: 0.7,
        angular_frequency: 364.0,
        ..PLAIN
    };

    /// Diagonal and right-hand side of a block, and the coupling to those beside: real and imaginary parts.
    type Equation = ([f64; 2], [f64; 2]);

    /// By how much a solution misses the equations of the chain, as a part of the terms that cancel.
    fn miss(
        chain: &Chain,
        equation: impl Fn(usize) -> Equation,
        solution: impl Fn(usize) -> [f64; 2],
    ) -> f64 {
        let blocks = chain.layout.blocks;
        let coupling = chain.coupling[0][0];
        let mut worst = 0.0_f64;
        for block in 0..blocks {
            let ([real, imaginary], right) = equation(block);
            let x = solution(block);
            let mut sum = [
                real * x[0] - imaginary * x[1] - right[0],
                real * x[1] + imaginary * x[0] - right[1],
            ];
            let mut size =
                (real.abs() + imaginary.abs()) * x[0].hypot(x[1]) + right[0].hypot(right[1]);
            for beside in [block.wrapping_sub(1), block + 1]
                .into_iter()
                .filter(|beside| *beside < blocks)
            {
                let x = solution(beside);
                sum = [sum[0] - coupling * x[0], sum[1] - coupling * x[1]];
                size += coupling * x[0].hypot(x[1]);
            }
            // Where nothing arrives numbers lose digits as they vanish.
            worst = worst.max(sum[0].hypot(sum[1]) / size.max(1e-250));
        }
        worst
    }

    /// The diagonal of the inverse of S/m - `shift`, from pivots of both ends; `None` if it is not positive definite.
    fn inverse_diagonal(chain: &Chain, shift: f64) -> Option<Vec<f64>> {
        let squared = chain.coupling[0][0] * chain.coupling[0][0];
        let entries: Vec<f64> = (0..chain.layout.blocks)
            .map(|block| chain.at(&chain.diagonal, block) - shift)
            .collect();
        let pivots = |entries: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
            entries
                .scan(f64::INFINITY, |pivot, entry| {
                    *pivot = entry - squared / *pivot;
                    Some(*pivot)
                })
                .collect()
        };
        let behind = pivots(&mut entries.iter().copied());
        let ahead = pivots(&mut entries.iter().rev().copied());
        let is_definite = behind
            .iter()
            .zip(&entries)
            .all(|(pivot, entry)| *pivot > 1e-12 * entry.abs());
        let all = behind.iter().zip(ahead.iter().rev()).zip(&entries);
        is_definite.then(|| {
            all.map(|((behind, ahead), entry)| 1.0 / (behind + ahead - entry))
                .collect()
        })
    }

    #[test]
    fn a_split_solves_its_equations_and_bounds_by_the_inverse() {
        let plain = Parameters::default();
        for blocks in [1, 2, 7, 8, 9, 15, 70, 140, 560, 1000] {
            for exponent in [-8, -4, -1, 0, 2, 4, 8] {
                for damping_rate in [0.0, 1.0, 1e4, 1e7] {
                    let stiff = libm::exp10(f64::from(exponent));
                    let slider_stiffness =
                        stiff * plain.block_contact_stiffness() / (blocks.max(2) - 1) as f64;
                    let parameters = Parameters {
                        blocks,
                        slider_stiffness,
                        damping_rate,
                        ..plain.clone()
                    };
                    // Digits are lost where the chain is stiff against its contacts.
                    check(&parameters, &MODULATED, 1e-12 * stiff.max(1.0));
                    check(&parameters, &PLAIN, 1e-12 * stiff.max(1.0));
                }
            }
        }
    }

    fn check(parameters: &Parameters, drive: &Harmonic, allowed: f64) {
        let what = (
            parameters.blocks,
            parameters.slider_stiffness,
            parameters.damping_rate,
            drive.amplitude,
        );
        let Slider { chain, state, .. } = slider(parameters);
        let mut split = Split::new(&chain);
        let largest = split.update(Baseline, &chain, drive, &state);
        let shift = |rate: f64| rate * (chain.damping_rate - rate);
        let Some(largest) = largest else {
            let slowest = 0.5 * chain.damping_rate * libm::exp2(f64::from(1 - MAX_HALVINGS));
            assert_eq!(inverse_diagonal(&chain, shift(slowest)), None, "{what:?}");
            return;
        };
        let rate = split.decay_rate;
        if rate < 0.5 * chain.damping_rate {
            assert_eq!(
                inverse_diagonal(&chain, shift(2.0 * rate)),
                None,
                "{what:?}"
            );
        }
        let driven = |block: usize| split.driven(&chain, block);
        let pulling = chain.drive_stiffness / chain.mass;
        let frequency = drive.angular_frequency;
        let first = |block: usize, force: f64| if block == 0 { pulling * force } else { 0.0 };
        let stiffness = |block: usize| chain.at(&chain.diagonal, block);
        let missed = [
            miss(
                &chain,
                |j| ([stiffness(j), 0.0], [first(j, drive.rate), 0.0]),
                |j| [driven(j).rate, 0.0],
            ),
            miss(
                &chain,
                |j| {
                    let drag = chain.damping_rate * driven(j).rate;
                    (
                        [stiffness(j), 0.0],
                        [first(j, drive.start) + chain.at(&chain.pull, j) - drag, 0.0],
                    )
                },
                |j| [driven(j).start, 0.0],
            ),
            miss(
                &chain,
                |j| {
                    let (sine, cosine) = libm::sincos(drive.phase);
                    let force = first(j, drive.amplitude);
                    let diagonal = [
                        stiffness(j) - frequency * frequency,
                        chain.damping_rate * frequency,
                    ];
                    (diagonal, [force * cosine, force * sine])
                },
                |j| driven(j).wave,
            ),
        ];
        assert!(
            missed
                .iter()
                .all(|missed| *missed < 1e-3 * allowed.max(1e-10)),
            "{what:?}: {missed:?}"
        );
        let inverse = inverse_diagonal(&chain, shift(rate)).unwrap();
        let mut twice_energy = 0.0;
        let mut before = 0.0;
        let mut widest = 0.0_f64;
        for block in 0..parameters.blocks {
            let Slot { row, lane } = chain.layout.slot(block);
            let BlockMotion {
                start,
                rate: speed,
                wave: [real, imaginary],
                swing,
            } = driven(block);
            let y = state.displacement[row][lane] - start - real;
            let shifted = state.velocity[row][lane] - speed + frequency * imaginary + rate * y;
            assert!(
                (swing - real.hypot(imaginary)).abs() <= 1e-14 * swing + 1e-150,
                "{what:?}"
            );
            twice_energy += shifted * shifted
                + y * ((stiffness(block) - shift(rate)) * y - 2.0 * chain.coupling[0][0] * before);
            before = y;
        }
        for (block, inverse) in inverse.into_iter().enumerate() {
            let Slot { row, lane } = chain.layout.slot(block);
            let SplitRow {
                bound, compliance, ..
            } = &split.rows[row];
            assert!(
                (compliance[lane] / inverse - 1.0).abs() < allowed,
                "{what:?}: block {block}"
            );
            let expected = (twice_energy * inverse).sqrt();
            assert!(
                (bound[lane] / expected - 1.0).abs() < allowed,
                "{what:?}: block {block}"
            );
            widest = widest.max(bound[lane]);
        }
        assert_eq!(largest, widest, "{what:?}");
    }
}
