//! Leaps over quiet time along the driven solution.
//!
//! Between events the driven solution x_p(t) = p0 + p1 t + Re(q e^{iωt}) needs one real and, with modulation, one complex
//! tridiagonal solve. The rest y = x - x_p is a free damped motion. With w = y', a rate a <= γ/2 and S' = S - m a (γ - a),
//!
//! ```text
//! E = ½ m |w + a y|² + ½ yᵀ S' y,    E' = -(γ - a) m |w + a y|² - a yᵀ S' y <= -2 a E,
//! |y_j(t)| <= sqrt(2 E (S'⁻¹)_jj) e^{-a t}
//! ```
//!
//! hold if S' is positive definite: a bound for each block, and its decay. With a = γ/2 it is sharp unless a mode is
//! overdamped; then a is halved until S' is positive definite. A leap may therefore start while y is still large, if the bound
//! shows that meanwhile no block reaches a break position, and that the shear force has been or will be larger than it
//! can be meanwhile. If y has fallen under the tolerance when the next event comes, it is dropped; if not, and no mode is
//! overdamped, it is carried over in one go ([`super::glide`]). Contract: a leap leaves out at most `tolerance` · f_s/k of
//! any block's displacement at its end, no event on its way, and no largest shear force.

use super::chain::Chain;
use super::crossing::Driven;
use super::glide::Glide;
use super::kernels::Kernels;
use super::lanes::Layout;
use super::taylor::State;
use crate::solver::ledger::Audit;
use crate::solver::segment::{ForcePath, Segment};
use std::f64::consts::TAU;

/// Halvings of the decay rate after which free motion counts as undamped.
const MOST_HALVINGS: i32 = 40;

/// The drive as it is at the start of a leap.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveNow {
    /// Stiffness `K_d`, in N/m.
    pub stiffness: f64,
    /// Block mass, in kg.
    pub mass: f64,
    /// Displacement of the ramp alone, without the cosine, in m.
    pub ramp: f64,
    /// Its velocity `V_0`, in m/s.
    pub velocity: f64,
    /// Amplitude of the cosine, in m, its phase now, in rad, and its angular frequency, in rad/s.
    pub amplitude: f64,
    pub phase: f64,
    pub angular_frequency: f64,
}

/// How far ahead of a modulated glide a larger shear force is looked for, in units of 1/γ.
const LOOK_AHEAD: f64 = 10.0;

/// Part of the displacement that may be left out that the terms of a glide may leave out each.
const GLIDE_SHARE: f64 = 1e-3;

/// Longest glide in units of the shortest time scale of the slider: some 20 MB.
const MOST_GLIDE_ANGLE: f64 = 1e6;

/// Minors of S/m that are taken before they are scaled again. Products of two series of them stay finite up to squared frequencies
/// of 1e38 1/s².
const MINORS_PER_SCALE: usize = 4;

/// Part of its diagonal entry that a pivot must exceed: less is rounding, and S' not surely positive definite.
const LEAST_PIVOT: f64 = 1e-12;

/// How an attempt to leap ended.
#[derive(Clone, Copy, Debug)]
pub(super) enum Attempt {
    /// The slider moved on by so many seconds; a block reached a break position if one is named. Whether the free motion was
    /// carried over.
    Leapt { elapsed: f64, reached: Option<usize>, glided: bool },
    /// Not yet: try again after so many seconds.
    Wait { seconds: f64 },
}

/// The driven solution from the start of a leap, x_p(t) = p0 + p1 t + Re(q e^{iωt}): one entry a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driving<'a> {
    /// p0, in m.
    pub start: &'a [f64],
    /// p1, in m/s.
    pub rate: &'a [f64],
    /// q, in m; zero without modulation.
    pub wave: &'a [[f64; 2]],
}

/// Work space of leaps: one entry a block.
#[derive(Clone, Debug)]
pub(super) struct Leap {
    /// The rate a at which the free motion surely decays, in 1/s.
    decay_rate: f64,
    /// Inverse pivots of S/m, eliminated from the leading edge.
    inverse_pivot: Vec<f64>,
    /// Minors of S'/m from the leading and from the trailing edge: that which a block begins, and that which begins beyond it.
    /// A pivot is the first over the second.
    ahead: [Vec<f64>; 2],
    behind: [Vec<f64>; 2],
    /// Inverse complex pivots of (S - mω² + imγω)/m.
    inverse_complex: Vec<[f64; 2]>,
    /// The state at the start, in the end that after the leap.
    displacement: Vec<f64>,
    velocity: Vec<f64>,
    start: Vec<f64>,
    rate: Vec<f64>,
    wave: Vec<[f64; 2]>,
    /// The free motion: y, w + a y, and the bound on |y|.
    free: Vec<f64>,
    turned: Vec<f64>,
    residue: Vec<f64>,
    glide: Glide,
}

/// What bounds a leap.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Time to the next reattachment or to the end, in s.
    pub horizon: f64,
    /// Time to the next cycle of a ramped modulation, in s; not before the horizon.
    pub until_turn: f64,
    /// Displacement that may be left out, in m.
    pub error: f64,
    /// Largest shear force on record since the last break, in N. Every observer has seen it.
    pub passed: f64,
}

impl Leap {
    pub fn new(layout: Layout) -> Self {
        let blocks = layout.blocks;
        let zeros = vec![0.0; blocks];
        Self {
            decay_rate: f64::INFINITY,
            inverse_pivot: zeros.clone(),
            ahead: [zeros.clone(), zeros.clone()],
            behind: [zeros.clone(), zeros.clone()],
            inverse_complex: vec![[0.0; 2]; blocks],
            displacement: zeros.clone(),
            velocity: zeros.clone(),
            start: zeros.clone(),
            rate: zeros.clone(),
            wave: vec![[0.0; 2]; blocks],
            free: zeros.clone(),
            turned: zeros.clone(),
            residue: zeros,
            glide: Glide::new(layout),
        }
    }

    /// Tries to leap by at most `horizon` s, leaving out no displacement above `error` m, and writes the state at its end.
    /// Shear forces up to `passed` N have been seen since the last break. `emit` receives the shear force on the way,
    /// `audit` the energies, unless the free motion was carried over.
    #[expect(clippy::too_many_arguments, reason = "what a leap reads and what it tells")]
    pub fn attempt(
        &mut self,
        chain: &Chain,
        kernels: Kernels,
        drive: &DriveNow,
        Bounds { horizon, until_turn, error, passed }: Bounds,
        state: &mut State,
        emit: impl FnOnce(Segment<'static>),
        audit: Option<&mut Audit>,
    ) -> Attempt {
        let layout = chain.layout;
        layout.unfold(&state.displacement, &mut self.displacement);
        layout.unfold(&state.velocity, &mut self.velocity);
        // Worth another try after so many e-foldings of the free motion, or after the next event.
        let Some(largest) = kernels.split(chain, drive, self) else {
            return Attempt::Wait { seconds: (2.0 / chain.damping_rate).min(horizon) };
        };
        let decay_rate = self.decay_rate;
        let longest_wait = horizon;
        let wait = |folds: f64| Attempt::Wait { seconds: (folds / decay_rate).min(longest_wait) };
        let decay = if largest <= error { 0.0 } else { libm::log(largest / error) / decay_rate };
        let is_short = decay >= horizon;
        if is_short && decay_rate < 0.5 * chain.damping_rate {
            return Attempt::Wait { seconds: horizon };
        }
        let horizon = if is_short { horizon.min(Self::longest_glide(chain)) } else { horizon };
        let moving = decay.min(horizon);
        let left = if is_short { libm::exp(-decay_rate * horizon) } else { error / largest };
        if decay > 0.0 && !self.stays_clear(chain, drive, moving, left) {
            return wait(0.7);
        }
        let (elapsed, reached) =
            if is_short { (horizon, None) } else { self.first_reached(chain, drive, decay, horizon) };
        if elapsed <= decay && decay > 0.0 && !is_short {
            return wait(0.7);
        }
        if !elapsed.is_finite() {
            return Attempt::Wait { seconds: f64::INFINITY };
        }
        let path = self.force_path(drive);
        let segment = Segment { start: 0.0, duration: elapsed, path };
        if largest > error && !self.hides_no_peak(chain, drive, &segment, [moving, until_turn], left, passed) {
            return wait(0.7);
        }
        emit(segment);
        if !is_short && let Some(audit) = audit {
            let driven = Driving { start: &self.start, rate: &self.rate, wave: &self.wave };
            audit.follow_leap(chain, drive, driven, state, elapsed);
        }
        self.follow(drive, elapsed);
        if is_short {
            self.carry_free_motion(chain, kernels, elapsed, left, GLIDE_SHARE * error / largest);
        }
        layout.fold(&self.displacement, &mut state.displacement);
        layout.fold(&self.velocity, &mut state.velocity);
        Attempt::Leapt { elapsed, reached, glided: is_short }
    }

    /// Whether the free motion of the first `moving` s, of which a part `left` remains then, hides no largest shear force:
    /// one as large is on record, or comes later in the segment, or comes after it, within `until_turn` s and before any break.
    fn hides_no_peak(
        &self,
        chain: &Chain,
        drive: &DriveNow,
        segment: &Segment<'_>,
        [moving, until_turn]: [f64; 2],
        left: f64,
        passed: f64,
    ) -> bool {
        let swing = drive.stiffness * self.residue[0];
        let driven = |seconds: f64| Segment { duration: seconds, ..*segment };
        let now = segment.force_after(0.0);
        let later = segment.force_after(moving);
        let highest = if drive.amplitude == 0.0 {
            // A rising line and a decaying bound: largest at an end.
            (now + swing).max(later + left * swing)
        } else {
            driven(moving).maximum_above(f64::NEG_INFINITY).map_or(f64::INFINITY, |(_, force)| force) + swing
        };
        if highest <= passed || (segment.duration > moving && segment.maximum_above(highest).is_some()) {
            return true;
        }
        let rate = drive.stiffness * (drive.velocity - self.rate[0]);
        let further = if drive.amplitude == 0.0 {
            3.0 * (highest - later) / rate
        } else {
            (LOOK_AHEAD / chain.damping_rate).min(TAU / drive.angular_frequency)
        };
        let ahead = (moving + further).min(until_turn);
        driven(ahead).maximum_above(highest + left * swing).is_some() && self.stays_clear(chain, drive, ahead, left)
    }

    /// How long a glide may last, in s, so that its work and memory are bounded. The motion goes on in the next one.
    fn longest_glide(chain: &Chain) -> f64 {
        let widest = chain.in_line.diagonal.iter().fold(0.0_f64, |most, diagonal| most.max(*diagonal));
        MOST_GLIDE_ANGLE / (widest + 2.0 * chain.coupling[0][0]).sqrt()
    }

    /// Carries the free motion over so many seconds and adds it, y = u e^{-γt/2} and w = u' e^{-γt/2} - γ y/2, where `left`
    /// is e^{-γt/2}. At the start u = y and u' = w + γ y/2. `error` is the part of it that may be left out.
    fn carry_free_motion(&mut self, chain: &Chain, kernels: Kernels, elapsed: f64, left: f64, error: f64) {
        self.glide.start(chain.layout, &self.free, &self.turned);
        kernels.glide(chain, elapsed, error, &mut self.glide);
        self.glide.end(chain.layout, &mut self.free, &mut self.turned);
        let half = 0.5 * chain.damping_rate;
        for j in 0..chain.layout.blocks {
            self.displacement[j] += left * self.free[j];
            self.velocity[j] += left * (self.turned[j] - half * self.free[j]);
        }
    }

    /// Splits off the free motion: y and w + a y of each block.
    #[inline(always)]
    fn split_free_motion(&mut self, frequency: f64) {
        for j in 0..self.free.len() {
            let y = self.displacement[j] - self.start[j] - self.wave[j][0];
            // d/dt Re(q e^{iωt}) = -ω Im q at the start.
            let w = self.velocity[j] - self.rate[j] + frequency * self.wave[j][1];
            self.free[j] = y;
            self.turned[j] = w + self.decay_rate * y;
        }
    }

    /// Finds the decay rate, from that of the last time, and eliminates; false if there is none.
    #[inline(always)]
    fn find_decay(&mut self, chain: &Chain) -> bool {
        let fastest = 0.5 * chain.damping_rate;
        self.decay_rate = fastest.min(4.0 * self.decay_rate);
        for _ in 0..MOST_HALVINGS {
            if self.eliminate(chain) {
                return true;
            }
            self.decay_rate *= 0.5;
        }
        self.decay_rate = fastest;
        false
    }

    /// a (γ - a), by which S/m is shifted, in 1/s².
    #[inline(always)]
    fn shift(&self, chain: &Chain) -> f64 {
        self.decay_rate * (chain.damping_rate - self.decay_rate)
    }

    /// Pivots of S/m and minors of S'/m from both ends; false if S' is not positive definite. A minor follows from the two before
    /// it, u_j = d_j u_{j+1} - c² u_{j+2}, so that few blocks wait for a division.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "without branches the loop runs in vectors")]
    fn eliminate(&mut self, chain: &Chain) -> bool {
        let blocks = chain.layout.blocks;
        let shift = self.shift(chain);
        let squared = chain.coupling[0][0] * chain.coupling[0][0];
        let diagonal = &chain.in_line.diagonal[..blocks];
        let inverse = &mut self.inverse_pivot[..blocks];
        let [ahead, ahead_beyond] = self.ahead.each_mut().map(|minors| &mut minors[..blocks]);
        let [behind, behind_beyond] = self.behind.each_mut().map(|minors| &mut minors[..blocks]);
        // The last minor and the one before it: of S, of S' ahead and of S' behind.
        let mut minors = [[1.0, 0.0]; 3];
        for count in 0..blocks {
            let (far, near) = (blocks - 1 - count, count);
            let entries = [diagonal[far], diagonal[far] - shift, diagonal[near] - shift];
            if count % MINORS_PER_SCALE == 0 {
                for [last, before] in &mut minors {
                    *before /= *last;
                    *last = 1.0;
                }
            }
            let [last, last_ahead, last_behind] = minors.map(|[last, _]| last);
            for ([last, before], entry) in minors.iter_mut().zip(entries) {
                (*last, *before) = (entry.mul_add(*last, -squared * *before), *last);
            }
            inverse[far] = last / minors[0][0];
            (ahead[far], ahead_beyond[far]) = (minors[1][0], last_ahead);
            (behind[near], behind_beyond[near]) = (minors[2][0], last_behind);
        }
        (0..blocks).fold(true, |is_definite, j| {
            let least = LEAST_PIVOT * (diagonal[j] - shift).abs();
            is_definite & (ahead[j] > least * ahead_beyond[j]) & (behind[j] > least * behind_beyond[j])
        })
    }

    /// p0, p1 and q of the driven solution.
    #[inline(always)]
    fn solve_driven(&mut self, chain: &Chain, drive: &DriveNow) {
        let coupling = chain.coupling[0][0];
        let pulling = drive.stiffness / drive.mass;
        // What is carried from block to block waits for one product and one sum only.
        let mut carried = pulling * drive.velocity * self.inverse_pivot[0];
        self.rate[0] = carried;
        for (rate, inverse) in self.rate.iter_mut().zip(&self.inverse_pivot).skip(1) {
            carried *= coupling * inverse;
            *rate = carried;
        }
        // Forward from the leading edge, the right-hand side over the pivot kept in `start`, then back.
        let mut carried = 0.0;
        let sources = chain.in_line.pull.iter().zip(&self.rate).map(|(pull, rate)| pull - chain.damping_rate * rate);
        for ((start, inverse), own) in self.start.iter_mut().zip(&self.inverse_pivot).zip(sources).rev() {
            carried = (coupling * inverse).mul_add(carried, own * inverse);
            *start = carried;
        }
        self.start[0] += pulling * drive.ramp * self.inverse_pivot[0];
        let mut carried = self.start[0];
        for (start, inverse) in self.start.iter_mut().zip(&self.inverse_pivot).skip(1) {
            carried = (coupling * inverse).mul_add(carried, *start);
            *start = carried;
        }
        if drive.amplitude > 0.0 {
            self.solve_wave(chain, drive, pulling * drive.amplitude);
        } else if self.wave[0] != [0.0; 2] {
            // A ramp has switched the modulation off.
            self.wave.fill([0.0; 2]);
        }
    }

    /// q, with the drive's phase of now in it.
    #[inline(always)]
    fn solve_wave(&mut self, chain: &Chain, drive: &DriveNow, acceleration: f64) {
        let blocks = chain.layout.blocks;
        let coupling = chain.coupling[0][0];
        let frequency = drive.angular_frequency;
        let (shift, loss) = (frequency * frequency, chain.damping_rate * frequency);
        let mut ahead = [0.0, 0.0];
        for j in (0..blocks).rev() {
            let squared = coupling * coupling;
            let pivot = [chain.in_line.diagonal[j] - shift - squared * ahead[0], loss - squared * ahead[1]];
            let scale = 1.0 / (pivot[0] * pivot[0] + pivot[1] * pivot[1]);
            ahead = [pivot[0] * scale, -pivot[1] * scale];
            self.inverse_complex[j] = ahead;
        }
        let (sine, cosine) = libm::sincos(drive.phase);
        let mut wave = product([acceleration * cosine, acceleration * sine], self.inverse_complex[0]);
        self.wave[0] = wave;
        for j in 1..blocks {
            wave = product([coupling * wave[0], coupling * wave[1]], self.inverse_complex[j]);
            self.wave[j] = wave;
        }
    }

    /// E/m of the free motion, in m²/s².
    #[inline(always)]
    fn free_energy(&self, chain: &Chain) -> f64 {
        let twice_coupling = 2.0 * chain.coupling[0][0];
        let shift = self.shift(chain);
        let (mut energy, mut before) = (0.0, 0.0);
        for ((y, turned), diagonal) in self.free.iter().zip(&self.turned).zip(&chain.in_line.diagonal) {
            energy += turned * turned + y * ((diagonal - shift) * y - twice_coupling * before);
            before = *y;
        }
        0.5 * energy.max(0.0)
    }

    /// Bounds |y_j| now into `residue`; returns the largest.
    #[inline(always)]
    fn bound_free_motion(&mut self, chain: &Chain, energy: f64) -> f64 {
        let blocks = chain.layout.blocks;
        let shift = self.shift(chain);
        let [ahead, ahead_beyond] = self.ahead.each_ref().map(|minors| &minors[..blocks]);
        let [behind, behind_beyond] = self.behind.each_ref().map(|minors| &minors[..blocks]);
        let (diagonal, residue) = (&chain.in_line.diagonal[..blocks], &mut self.residue[..blocks]);
        for j in 0..blocks {
            // 1/(ahead/beyond + behind/beyond - diagonal), with one division.
            let beyond = ahead_beyond[j] * behind_beyond[j];
            let own = ahead[j] * behind_beyond[j] + behind[j] * ahead_beyond[j] - (diagonal[j] - shift) * beyond;
            residue[j] = (2.0 * energy * beyond / own).sqrt();
        }
        residue.iter().fold(0.0, |largest, residue| if *residue > largest { *residue } else { largest })
    }

    /// Whether no block can reach a break position within `seconds`, at the end of which a part `left` of the free motion's
    /// bound remains.
    fn stays_clear(&self, chain: &Chain, drive: &DriveNow, seconds: f64, left: f64) -> bool {
        let turns = drive.amplitude > 0.0;
        (0..chain.layout.blocks).all(|j| {
            let swing = if turns { libm::hypot(self.wave[j][0], self.wave[j][1]) } else { 0.0 };
            // Ramp and decaying bound together are convex in time: largest at the ends.
            let late = self.start[j] + self.rate[j] * seconds + left * self.residue[j];
            let highest = late.max(self.start[j] + self.residue[j]) + swing;
            let lowest = self.start[j] - self.residue[j] - swing;
            highest < chain.in_line.upper[j] && lowest > chain.in_line.lower[j]
        })
    }

    /// The first instant after `decay` at which a block reaches a break position, up to `horizon`, and that block.
    fn first_reached(&self, chain: &Chain, drive: &DriveNow, decay: f64, horizon: f64) -> (f64, Option<usize>) {
        let mut first = (horizon, None);
        for j in 0..chain.layout.blocks {
            let [real, imaginary] = self.wave[j];
            let (upper, lower) = (chain.in_line.upper[j], chain.in_line.lower[j]);
            if drive.amplitude == 0.0 {
                // The rate is positive, so the ramp alone only rises.
                let elapsed = ((upper - self.start[j]) / self.rate[j]).max(decay);
                if elapsed < first.0 || lower >= self.start[j] {
                    first = (if lower >= self.start[j] { decay } else { elapsed }, Some(j));
                }
                continue;
            }
            let swing = libm::hypot(real, imaginary);
            let rises_before = self.start[j] + self.rate[j] * first.0 + swing >= upper;
            let falls_at_all = self.start[j] + self.rate[j] * decay - swing <= lower;
            if !(rises_before || falls_at_all) {
                continue;
            }
            let driven = Driven {
                start: self.start[j],
                rate: self.rate[j],
                amplitude: swing,
                phase: libm::atan2(imaginary, real),
                angular_frequency: drive.angular_frequency,
            };
            let rise = if rises_before { driven.first_rise_to(upper, decay) } else { f64::INFINITY };
            let fall = if falls_at_all { driven.first_fall_to(lower, decay) } else { f64::INFINITY };
            if rise.min(fall) < first.0 {
                first = (rise.min(fall), Some(j));
            }
        }
        first
    }

    /// The shear force along the driven solution.
    fn force_path(&self, drive: &DriveNow) -> ForcePath<'static> {
        let (sine, cosine) = libm::sincos(drive.phase);
        let real = drive.amplitude * cosine - self.wave[0][0];
        let imaginary = drive.amplitude * sine - self.wave[0][1];
        ForcePath::Harmonic {
            start: drive.stiffness * (drive.ramp - self.start[0]),
            rate: drive.stiffness * (drive.velocity - self.rate[0]),
            amplitude: drive.stiffness * libm::hypot(real, imaginary),
            phase: libm::atan2(imaginary, real),
            angular_frequency: drive.angular_frequency,
        }
    }

    /// Puts the driven solution after so many seconds in place of the state.
    fn follow(&mut self, drive: &DriveNow, elapsed: f64) {
        let turn = TAU * (elapsed * drive.angular_frequency / TAU).fract();
        let (sine, cosine) = if drive.amplitude > 0.0 { libm::sincos(turn) } else { (0.0, 1.0) };
        for j in 0..self.start.len() {
            let [real, imaginary] = product(self.wave[j], [cosine, sine]);
            self.displacement[j] = self.start[j] + self.rate[j] * elapsed + real;
            self.velocity[j] = self.rate[j] - drive.angular_frequency * imaginary;
        }
    }
}

/// Splits the state that was unfolded into driven solution and free motion, and bounds the latter: the largest bound on a
/// displacement, in m; `None` if it does not decay.
#[inline(always)]
pub(super) fn split(chain: &Chain, drive: &DriveNow, leap: &mut Leap) -> Option<f64> {
    if !leap.find_decay(chain) {
        return None;
    }
    leap.solve_driven(chain, drive);
    leap.split_free_motion(drive.angular_frequency);
    let energy = leap.free_energy(chain);
    Some(leap.bound_free_motion(chain, energy))
}

#[inline(always)]
fn product(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;

    #[test]
    fn a_glide_follows_an_undamped_oscillation_for_a_bounded_time() {
        let parameters = Parameters { blocks: 1, damping_rate: 0.0, ..Parameters::default() };
        let layout = Layout::new(1);
        // Without contacts nothing can be reached; the spring swings the block about where it pulls to.
        let chain = Chain::new(&parameters, layout);
        let kernels = Kernels::available(layout.rows).pop().unwrap();
        let squared = parameters.drive_stiffness / chain.mass;
        let drive = DriveNow {
            stiffness: parameters.drive_stiffness,
            mass: chain.mass,
            ramp: 0.0,
            velocity: 1e-12,
            amplitude: 0.0,
            phase: 0.0,
            angular_frequency: 0.0,
        };
        let mut state = State { displacement: layout.filled(0.0), velocity: layout.filled(0.0) };
        let amplitude = 1e-6;
        state.displacement[0][0] = amplitude;
        let horizon = 1e9;
        let bounds = Bounds { horizon, until_turn: f64::INFINITY, error: 1e-12, passed: f64::INFINITY };
        let attempt = Leap::new(layout).attempt(&chain, kernels, &drive, bounds, &mut state, |_| {}, None);
        let Attempt::Leapt { elapsed, reached: None, glided: true } = attempt else { panic!("{attempt:?}") };
        let angle = squared.sqrt() * elapsed;
        assert!(angle > 1e5 && angle <= MOST_GLIDE_ANGLE, "{angle}");
        // A ramp that the block follows, and what is left of its start.
        let ramp = drive.velocity * elapsed - drive.velocity / squared.sqrt() * libm::sin(angle);
        let expected = ramp + amplitude * libm::cos(angle);
        assert!(
            (state.displacement[0][0] - expected).abs() < 1e-8 * amplitude,
            "{}",
            state.displacement[0][0] - expected
        );
    }
}
