//! The driven solution, x_p(t) = p0 + p1 t + Re(q e^{iωt}), which the motion decays to between events: one real and,
//! with modulation, one complex tridiagonal solve.

use super::chain::Chain;
use crate::solver::harmonic::Harmonic;
use crate::solver::segment::ForcePath;

/// The driven solution of one block: p0 in m, p1 in m/s, q in m and, with modulation, |q|.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockMotion {
    pub start: f64,
    pub rate: f64,
    pub wave: [f64; 2],
    pub swing: f64,
}

/// The driven solution from some instant on, one entry a block.
#[derive(Clone, Debug)]
pub(super) struct DrivenSolution {
    /// p0, in m.
    pub start: Vec<f64>,
    /// p1, in m/s.
    pub rate: Vec<f64>,
    /// q, in m; zero without modulation.
    pub wave: Vec<[f64; 2]>,
    /// Inverse pivots of S/m, eliminated from the leading edge, in s².
    pub inverse_pivot: Vec<f64>,
    /// Inverse complex pivots of (S - mω² + imγω)/m, in s².
    inverse_complex: Vec<[f64; 2]>,
}

impl DrivenSolution {
    pub fn new(blocks: usize) -> Self {
        Self {
            start: vec![0.0; blocks],
            rate: vec![0.0; blocks],
            wave: vec![[0.0; 2]; blocks],
            inverse_pivot: vec![0.0; blocks],
            inverse_complex: vec![[0.0; 2]; blocks],
        }
    }

    /// Solves for p0, p1 and q with the inverse pivots and the motion of the drive from now on.
    #[inline(always)]
    pub fn solve(&mut self, chain: &Chain, diagonal: &[f64], pull: &[f64], drive: &Harmonic) {
        let coupling = chain.coupling[0][0];
        let pulling = chain.drive_stiffness / chain.mass;
        // What is carried from block to block waits for one product and one sum only.
        let mut carried = pulling * drive.rate * self.inverse_pivot[0];
        self.rate[0] = carried;
        for (rate, inverse) in self.rate[1..].iter_mut().zip(&self.inverse_pivot[1..]) {
            carried *= coupling * inverse;
            *rate = carried;
        }
        // Forward from the leading edge, the right-hand side over the pivot kept in `start`, then back.
        let mut carried = 0.0;
        let sources = pull.iter().zip(&self.rate).map(|(pull, rate)| pull - chain.damping_rate * rate);
        for ((start, inverse), own) in self.start.iter_mut().zip(&self.inverse_pivot).zip(sources).rev() {
            carried = (coupling * inverse).mul_add(carried, own * inverse);
            *start = carried;
        }
        self.start[0] += pulling * drive.start * self.inverse_pivot[0];
        let mut carried = self.start[0];
        for (start, inverse) in self.start[1..].iter_mut().zip(&self.inverse_pivot[1..]) {
            carried = (coupling * inverse).mul_add(carried, *start);
            *start = carried;
        }
        if drive.amplitude > 0.0 {
            self.solve_wave(chain, diagonal, drive, pulling * drive.amplitude);
        } else if self.wave[0] != [0.0; 2] {
            // A ramp has switched the modulation off.
            self.wave.fill([0.0; 2]);
        }
    }

    /// q, with the drive's present phase in it.
    #[inline(always)]
    fn solve_wave(&mut self, chain: &Chain, diagonal: &[f64], drive: &Harmonic, acceleration: f64) {
        let blocks = chain.layout.blocks;
        let coupling = chain.coupling[0][0];
        let frequency = drive.angular_frequency;
        let (shift, loss) = (frequency * frequency, chain.damping_rate * frequency);
        let mut ahead = [0.0, 0.0];
        for j in (0..blocks).rev() {
            let squared = coupling * coupling;
            let pivot = [diagonal[j] - shift - squared * ahead[0], loss - squared * ahead[1]];
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
}

impl BlockMotion {
    /// First instant in [`from`, `until`], in s, at which the block is at or beyond a break position; if none, one that is
    /// later or infinite.
    pub fn reaches(&self, drive: &Harmonic, [lower, upper]: [f64; 2], [from, until]: [f64; 2]) -> f64 {
        if drive.amplitude == 0.0 {
            // The rate is positive, so the ramp alone only rises.
            return if lower >= self.start { from } else { ((upper - self.start) / self.rate).max(from) };
        }
        let rises_before = self.start + self.rate * until + self.swing >= upper;
        let falls_at_all = self.start + self.rate * from - self.swing <= lower;
        if !(rises_before || falls_at_all) {
            return f64::INFINITY;
        }
        let phase = libm::atan2(self.wave[1], self.wave[0]);
        let Self { start, rate, swing: amplitude, .. } = *self;
        let motion = Harmonic { start, rate, amplitude, phase, angular_frequency: drive.angular_frequency };
        let rise = if rises_before { motion.first_rise_to(upper, from) } else { f64::INFINITY };
        let fall = if falls_at_all { motion.first_fall_to(lower, from) } else { f64::INFINITY };
        rise.min(fall)
    }

    /// Displacement after `elapsed` s, in m.
    pub fn displacement(&self, drive: &Harmonic, elapsed: f64) -> f64 {
        let ramp = self.start + self.rate * elapsed;
        if drive.amplitude == 0.0 {
            return ramp;
        }
        let (sine, cosine) = libm::sincos(drive.turn(elapsed));
        ramp + product(self.wave, [cosine, sine])[0]
    }

    /// F_S if this is the motion of block 1, in N.
    pub fn force_path(&self, drive: &Harmonic, stiffness: f64) -> ForcePath<'static> {
        let (sine, cosine) = libm::sincos(drive.phase);
        let real = drive.amplitude * cosine - self.wave[0];
        let imaginary = drive.amplitude * sine - self.wave[1];
        ForcePath::Harmonic(Harmonic {
            start: stiffness * (drive.start - self.start),
            rate: stiffness * (drive.rate - self.rate),
            amplitude: stiffness * libm::hypot(real, imaginary),
            phase: libm::atan2(imaginary, real),
            angular_frequency: drive.angular_frequency,
        })
    }
}

#[inline(always)]
fn product(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}
