//! What the event-driven solver enters into the energy ledger along the way: damping along series and leaps.

use super::kernels::Kernels;
use super::leap::Split;
use super::slider::{Chain, State};
use super::taylor::Series;
use crate::solver::harmonic::Harmonic;
use crate::solver::ledger::Audit;

impl Audit {
    /// Enters the damping loss over a part of a step of `length` s: ∫ mγ Σ v² dt, exact for the polynomial.
    pub(super) fn follow_series(
        &self,
        kernels: &dyn Kernels,
        chain: &Chain,
        series: &Series,
        [first, last]: [f64; 2],
        length: f64,
    ) {
        let mut probe = State {
            displacement: chain.layout.filled(0.0),
            velocity: chain.layout.filled(0.0),
        };
        let nodes = self.quadrature.nodes(series.order);
        let mean_square: f64 = nodes
            .iter()
            .map(|&(s, weight)| {
                kernels.evaluate(series, first + s * (last - first), length, &mut probe);
                weight
                    * probe
                        .velocity
                        .iter()
                        .flat_map(|row| row.iter())
                        .map(|v| v * v)
                        .sum::<f64>()
            })
            .sum();
        Self::add(
            &self.damping,
            chain.mass * chain.damping_rate * (last - first) * length * mean_square,
        );
    }

    /// Enters a leap of `elapsed` s from `state`: the damping loss along the driven solution, in closed form, and
    /// the energy of the free motion that is dropped at its start.
    pub(super) fn follow_leap(
        &self,
        chain: &Chain,
        drive: &Harmonic,
        split: &Split,
        state: &State,
        elapsed: f64,
    ) {
        let frequency = drive.angular_frequency;
        let coupling = chain.coupling[0][0];
        // Σ p1², Σ p1 q, Σ |q|² and Σ q²: the velocity is p1 - ω Im(q e^{iωt}).
        let mut ramp = 0.0;
        let mut mixed = [0.0; 2];
        let mut size = 0.0;
        let mut square = [0.0; 2];
        let mut dropped = 0.0;
        let mut before = [0.0; 2];
        for j in 0..chain.layout.blocks {
            let driven = split.driven(chain, j);
            let rate = driven.rate;
            let [real, imaginary] = driven.wave;
            ramp += rate * rate;
            mixed = [mixed[0] + rate * real, mixed[1] + rate * imaginary];
            size += real * real + imaginary * imaginary;
            square = [
                square[0] + real * real - imaginary * imaginary,
                square[1] + 2.0 * real * imaginary,
            ];
            // E(x_p + y) - E(x_p) = yᵀ (S (x_p + y/2) - b - drive) + m w (v_p + w/2), with the forces per mass.
            let x = driven.start + real;
            let v = rate - frequency * imaginary;
            let y = chain.at(&state.displacement, j) - x;
            let w = chain.at(&state.velocity, j) - v;
            let middle = x + 0.5 * y;
            let mut force = chain.at(&chain.diagonal, j) * middle - chain.at(&chain.pull, j);
            if j == 0 {
                force -= chain.drive_stiffness / chain.mass * drive.value(0.0);
            }
            dropped += y * force + w * (v + 0.5 * w);
            if j > 0 {
                // The two off-diagonal terms of the pair, y_j m_{j-1} + y_{j-1} m_j.
                dropped -= coupling * (y * before[1] + before[0] * middle);
            }
            before = [y, middle];
        }
        Self::add(&self.left_out, chain.mass * dropped);
        let mut integral = ramp * elapsed;
        if drive.amplitude > 0.0 {
            let (sine, versine) = sine_and_versine(frequency, elapsed);
            let (sine_twice, versine_twice) = sine_and_versine(2.0 * frequency, elapsed);
            integral -= 2.0 * (mixed[0] * versine + mixed[1] * sine);
            let swing = 0.5 * (square[0] * sine_twice - square[1] * versine_twice);
            integral += 0.5 * frequency * (size * frequency * elapsed - swing);
        }
        Self::add(&self.damping, chain.mass * chain.damping_rate * integral);
    }
}

/// sin ωt and 1 - cos ωt; whole turns are taken off first.
fn sine_and_versine(frequency: f64, elapsed: f64) -> (f64, f64) {
    let angle = std::f64::consts::TAU * (frequency * elapsed / std::f64::consts::TAU).fract();
    let half = libm::sin(0.5 * angle);
    (libm::sin(angle), 2.0 * half * half)
}
