//! What a job will cost, from its parameters alone: CPU seconds for balancing parts and for the time left.
//!
//! The number of slips times the time to load the interface, in steps of the solver. Contract: a pure function in basic
//! arithmetic and square roots, so that the same file gives the same parts on every machine. Changing a number here
//! changes the parts: raise [`PLAN_VERSION`](super::PLAN_VERSION) with it.

use crate::model::Parameters;
use crate::model::theory::typical_interval;
use crate::observe::Recording;
use crate::solver::Solver;

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

/// Predicted CPU time of a job, in s.
#[must_use]
pub fn predicted_cost(parameters: &Parameters, recording: &Recording, solver: Solver) -> f64 {
    let slips = recording.slips as f64 + recording.discard as f64;
    let time = (slips * typical_interval(parameters)).min(recording.max_time.unwrap_or(f64::INFINITY));
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
            share * time / typical_interval(parameters) * contacts * of_a_contact
        }
        Solver::FixedStep { time_step } => {
            time / time_step * (STEP_OVERHEAD + STEP_OF_A_BLOCK * parameters.blocks as f64)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
