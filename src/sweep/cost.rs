//! What a job will cost, from its parameters alone: CPU seconds for balancing parts and for the time left.
//!
//! The number of slips times the time to load the interface, in steps of the solver. Contract: a pure function in basic
//! arithmetic and square roots, so that the same file gives the same parts on every machine. Changing a number here
//! changes the parts: raise [`PLAN_VERSION`](super::PLAN_VERSION) with it.

use crate::model::Parameters;
use crate::model::theory::total_strength;
use crate::observe::Recording;
use crate::solver::Solver;

/// Share of the total strength `N N_s f_s` that the drive loads from one slip to the next. At the defaults slips are
/// 0.1115 s apart, of which 0.005 s are reattachment, and the shear force grows at 3827 N/s: 0.1065 · 3827/1918.
const LOADED_SHARE: f64 = 0.2125;
/// CPU time of one fixed step on one block, in s: a few multiplications and the test of the next contact.
const STEP_OF_A_BLOCK: f64 = 1.0e-9;
/// CPU time of one fixed step beside its blocks, in s: the drive, the observer, the queue of reattachments.
const STEP_OVERHEAD: f64 = 40e-9;

/// Taylor steps for each contact and slip: it breaks and reattaches about twice, and the motion after slips and precursors
/// is resolved.
const TAYLOR_STEPS_OF_A_CONTACT: f64 = 4.5;
/// CPU time of one Taylor step on one block, and beside its blocks, in s.
const TAYLOR_STEP_OF_A_BLOCK: f64 = 6.5e-9;
const TAYLOR_STEP_OVERHEAD: f64 = 290e-9;
/// CPU time on the grid for each contact and slip, in s: for its events, and for the steps on each block.
const GRID_EVENTS_OF_A_CONTACT: f64 = 1.0e-6;
const GRID_STEPS_OF_A_BLOCK: f64 = 1.1e-9;
/// Part of the work on the grid that is in steps at a tolerance of 1e-3, and so grows as steps shrink.
const GRID_STEPS_SHARE: f64 = 0.2;
/// Work with modulation, which keeps the slider moving, against work without.
const MODULATED_SHARE: f64 = 1.4;

/// Predicted interval between slips, in s: the time to load `LOADED_SHARE` of the strength, and one reattachment.
#[must_use]
pub fn predicted_interval(parameters: &Parameters) -> f64 {
    let contacts = parameters.block_contact_stiffness();
    // Stiffness at the end of an endless chain, exact also for one block; a short chain moves as one.
    let endless = 0.5 * contacts + (contacts * (parameters.coupling_stiffness() + 0.25 * contacts)).sqrt();
    let slider = endless.min(contacts * parameters.blocks as f64);
    let stiffness = 1.0 / (1.0 / parameters.drive_stiffness + 1.0 / slider);
    let loading = LOADED_SHARE * total_strength(parameters) / (stiffness * parameters.drive_velocity);
    loading + parameters.reattachment_time
}

/// Predicted CPU time of a job, in s.
#[must_use]
pub fn predicted_cost(parameters: &Parameters, recording: &Recording, solver: Solver) -> f64 {
    let slips = recording.slips as f64 + recording.discard as f64;
    let time = (slips * predicted_interval(parameters)).min(recording.max_time.unwrap_or(f64::INFINITY));
    match solver {
        Solver::EventDriven { tolerance, resolve } => {
            let blocks = parameters.blocks as f64;
            let of_a_contact = if resolve.takes_grid(tolerance) {
                let steps = GRID_STEPS_SHARE * (1e-3 / tolerance).sqrt().sqrt();
                (1.0 - GRID_STEPS_SHARE + steps) * (GRID_EVENTS_OF_A_CONTACT + GRID_STEPS_OF_A_BLOCK * blocks)
            } else {
                TAYLOR_STEPS_OF_A_CONTACT * (TAYLOR_STEP_OVERHEAD + TAYLOR_STEP_OF_A_BLOCK * blocks)
            };
            let share = if parameters.modulation_amplitude > 0.0 { MODULATED_SHARE } else { 1.0 };
            let contacts = blocks * parameters.contacts_per_block as f64;
            share * time / predicted_interval(parameters) * contacts * of_a_contact
        }
        Solver::FixedStep { time_step } => {
            time / time_step * (STEP_OVERHEAD + STEP_OF_A_BLOCK * parameters.blocks as f64)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::equation::StiffnessMatrix;

    #[test]
    fn intervals_at_the_defaults_are_those_seen() {
        let interval = predicted_interval(&Parameters::default());
        assert!((interval - 0.1115).abs() < 0.0005, "{interval}");
    }

    #[test]
    fn the_stiffness_behind_the_interval_is_that_of_the_chain() {
        for (blocks, tolerance) in [(1, 1e-12), (70, 1e-6)] {
            let parameters = Parameters { blocks, reattachment_time: 1e-300, ..Parameters::default() };
            let rate = LOADED_SHARE * total_strength(&parameters) / predicted_interval(&parameters);
            let predicted = rate / parameters.drive_velocity;
            let chain = StiffnessMatrix::intact(&parameters).end_stiffness() - parameters.drive_stiffness;
            let exact = 1.0 / (1.0 / chain + 1.0 / parameters.drive_stiffness);
            assert!((predicted / exact - 1.0).abs() < tolerance, "{blocks} blocks: {predicted} against {exact}");
        }
    }

    #[test]
    fn cost_grows_with_slips_up_to_the_longest_time() {
        let parameters = Parameters::default();
        let cost = |slips, max_time| {
            let recording = Recording { slips, discard: 0, max_time, ..Recording::default() };
            predicted_cost(&parameters, &recording, Solver::FixedStep { time_step: 1e-6 })
        };
        assert_eq!(cost(20, None), 2.0 * cost(10, None));
        assert!((cost(1_000_000, Some(2.0)) - 2e6 * 110e-9).abs() < 1e-9);
    }
}
