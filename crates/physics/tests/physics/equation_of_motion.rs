//! Both solvers follow the equation of motion, as a plain integration of its plain form shows.

use stickslip_physics::model::{Change, ContactEvent, Drive, Parameters};
use stickslip_physics::solver::{Limits, Observer, Solver, simulate};

/// Shear force `F_S = K_d (u(t) - x_1)` at a time in s, for a trailing edge at `trailing_edge` m, in N.
fn shear_force(drive: &Drive, time: f64, trailing_edge: f64) -> f64 {
    drive.stiffness * (drive.motion(time).displacement - trailing_edge)
}

/// Forces of the attached contacts of one block: Σ `k_i` in N/m and Σ `k_i a_i` in N.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ContactSums {
    /// Σ `k_i`, in N/m.
    stiffness: f64,
    /// Σ `k_i a_i`, in N.
    pull: f64,
}

/// Accelerations x'' of the blocks, in m/s²: the equation of motion, term by term.
///
/// `displacement` in m, `velocity` in m/s and `contacts` have one entry a block; the drive is that of the cycle at
/// `time`.
fn acceleration(
    parameters: &Parameters,
    drive: &Drive,
    time: f64,
    displacement: &[f64],
    velocity: &[f64],
    contacts: &[ContactSums],
) -> Vec<f64> {
    let (x, mass, coupling) = (
        displacement,
        parameters.block_mass(),
        parameters.coupling_stiffness(),
    );
    let of_block = |j: usize| {
        let before = if j > 0 {
            coupling * (x[j - 1] - x[j])
        } else {
            shear_force(drive, time, x[0])
        };
        let after = if j + 1 < x.len() {
            coupling * (x[j + 1] - x[j])
        } else {
            0.0
        };
        let held = contacts[j].stiffness * x[j] - contacts[j].pull;
        (before + after - held) / mass - parameters.damping_rate * velocity[j]
    };
    (0..x.len()).map(of_block).collect()
}

/// Keeps the stiffness of the attached contacts of each block at the start, the number of breaks, and the displacements
/// at the end.
#[derive(Default)]
struct Contacts {
    sums: Vec<ContactSums>,
    breaks: usize,
    displacement: Vec<f64>,
}

impl Observer for Contacts {
    fn contact(&mut self, event: &ContactEvent) {
        self.breaks += usize::from(event.change == Change::Break);
        self.sums[event.block].stiffness += event.stiffness;
    }

    fn end(&mut self, _time: f64, displacement: &[f64]) {
        self.displacement = displacement.to_vec();
    }
}

/// Displacements in m after `steps` classical Runge-Kutta steps of `step` s from rest.
fn integrated(
    parameters: &Parameters,
    contacts: &[ContactSums],
    step: f64,
    steps: u32,
) -> Vec<f64> {
    let (drive, blocks) = (Drive::new(parameters), parameters.blocks);
    // State: displacements, then velocities.
    let rate = |time: f64, state: &[f64]| -> Vec<f64> {
        let (x, v) = state.split_at(blocks);
        [
            v.to_vec(),
            acceleration(parameters, &drive, time, x, v, contacts),
        ]
        .concat()
    };
    let moved = |state: &[f64], rate: &[f64], step: f64| -> Vec<f64> {
        state
            .iter()
            .zip(rate)
            .map(|(value, rate)| value + step * rate)
            .collect()
    };
    let mut state = vec![0.0; 2 * blocks];
    for number in 0..steps {
        let time = f64::from(number) * step;
        let first = rate(time, &state);
        let second = rate(time + 0.5 * step, &moved(&state, &first, 0.5 * step));
        let third = rate(time + 0.5 * step, &moved(&state, &second, 0.5 * step));
        let fourth = rate(time + step, &moved(&state, &third, step));
        for (i, value) in state.iter_mut().enumerate() {
            *value += step / 6.0 * (first[i] + 2.0 * second[i] + 2.0 * third[i] + fourth[i]);
        }
    }
    state.truncate(blocks);
    state
}

#[test]
fn every_method_follows_the_equation_of_motion_up_to_the_first_break() {
    for blocks in [1, 2, 9, 70] {
        // A fast modulation: the slider does not follow it quasi-statically.
        let parameters = Parameters {
            blocks,
            modulation_amplitude: 2e-7,
            modulation_period: Some(4e-4),
            seed: 3,
            ..Parameters::default()
        };
        let (step, steps) = (1e-6, 1500);
        let end_time = step * f64::from(steps);
        let followed = |solver| {
            let mut contacts = Contacts {
                sums: vec![ContactSums::default(); blocks],
                ..Contacts::default()
            };
            let limits = Limits {
                end_time,
                events: 1_000_000,
                interrupt: None,
            };
            let summary = simulate(&parameters, solver, limits, &mut contacts).unwrap();
            assert!(
                contacts.breaks == 0 && (summary.end_time / end_time - 1.0).abs() < 1e-12,
                "{summary:?}"
            );
            contacts
        };
        let exact = followed(Solver::event_driven(1e-12));
        let reference = integrated(&parameters, &exact.sums, step, steps);
        // Runge-Kutta leaves some (ω_max h)^4 of the fastest modes; a fixed step some (ω h)² of the modulation.
        for (solver, tolerance) in [(exact, 1e-6), (followed(Solver::fixed_step(1e-7)), 1e-4)] {
            let scale = reference[0].abs();
            assert!(scale > 1e-9, "the slider hardly moved: {scale} m");
            for (block, (found, expected)) in solver.displacement.iter().zip(&reference).enumerate()
            {
                let error = (found - expected).abs() / scale;
                assert!(error < tolerance, "block {block} of {blocks}: {error:e}");
            }
        }
    }
}
