//! What a job will cost, from its parameters alone: CPU seconds for balancing parts and for the time left.
//!
//! Contact events and steps, each times what one takes. How many follows from what the slider is expected to do: slip, with
//! quiet time in between, or slide, until the job gives up. Contract: a pure function in basic arithmetic and square roots,
//! so that the same file gives the same parts on every machine. Changing a number here changes the parts: raise
//! [`PLAN_VERSION`](super::PLAN_VERSION) with it.
//!
//! Of 167 jobs with all parameters drawn from three decades around the paper's, it was within a factor of ten for 133; the
//! root mean square of the error was 0.90 decades, the largest a factor of 669. The project's sweeps cost 0.7 to 1.4 times
//! the prediction, but those of strong drives and stiff springs 2.6 to 4.3 times.

use crate::model::Parameters;
use crate::model::theory::typical_interval;
use crate::observe::Recording;
use crate::solver::Solver;

/// CPU time of one fixed step on one block, in s: a few multiplications and the test of the next contact.
const STEP_OF_A_BLOCK: f64 = 1.0e-9;
/// CPU time of one fixed step beside its blocks, in s: the drive, the observer, the queue of reattachments.
const STEP_OVERHEAD: f64 = 40e-9;

/// CPU time of a break with its reattachment on the grid, of a step on one block, and of a step beside its blocks, in s.
const GRID_EVENT: f64 = 400e-9;
const GRID_STEP_OF_A_BLOCK: f64 = 0.6e-9;
const GRID_STEP_OVERHEAD: f64 = 30e-9;

/// Taylor steps for each break; CPU time of one on one block, and beside its blocks, in s.
const TAYLOR_STEPS_OF_A_BREAK: f64 = 2.0;
const TAYLOR_STEP_OF_A_BLOCK: f64 = 6.5e-9;
const TAYLOR_STEP_OVERHEAD: f64 = 290e-9;
/// Cost with an energy ledger, against that without.
const LEDGER_SHARE: f64 = 4.5;

/// Work with modulation, which keeps the slider moving, against work without.
const MODULATED_SHARE: f64 = 1.3;
/// Breaks of each contact in a slip with its precursors.
const BREAKS_IN_A_SLIP: f64 = 2.2;
/// How long motion is resolved about a slip, in reattachment times, and in times in which damping slows it.
const RESOLVED_REATTACHMENTS: f64 = 3.0;
const RESOLVED_DAMPINGS: f64 = 100.0;
/// The slider slides if the time to load it is below this number of reattachment times, or if the ratio of the damping rate
/// to the frequency of a block on its contacts is above this one.
const LOADED_AT_ONCE: f64 = 1.2;
const OVERDAMPED: f64 = 4.0;

/// Predicted CPU time of a job, in s.
pub fn predicted_cost(parameters: &Parameters, recording: &Recording, solver: Solver) -> f64 {
    let blocks = parameters.blocks as f64;
    let Motion { time, resolved, breaks } = Motion::of(parameters, recording);
    let share = if parameters.modulation_amplitude > 0.0 { MODULATED_SHARE } else { 1.0 };
    let ledger = if recording.energies { LEDGER_SHARE } else { 1.0 };
    match solver {
        Solver::EventDriven { tolerance, resolve } if resolve.takes_grid(tolerance) && !recording.energies => {
            let steps = resolved / step_length(parameters) * (1e-3 / tolerance).sqrt().sqrt();
            share * (breaks * GRID_EVENT + steps * (GRID_STEP_OVERHEAD + GRID_STEP_OF_A_BLOCK * blocks))
        }
        Solver::EventDriven { .. } => {
            let steps = breaks * TAYLOR_STEPS_OF_A_BREAK;
            ledger * share * steps * (TAYLOR_STEP_OVERHEAD + TAYLOR_STEP_OF_A_BLOCK * blocks)
        }
        Solver::FixedStep { time_step } => ledger * time / time_step * (STEP_OVERHEAD + STEP_OF_A_BLOCK * blocks),
    }
}

/// What a slider is expected to do in a job.
struct Motion {
    /// Model time to its end, and the part of it that is not quiet, in s.
    time: f64,
    resolved: f64,
    breaks: f64,
}

impl Motion {
    fn of(parameters: &Parameters, recording: &Recording) -> Self {
        let (interval, delay) = (typical_interval(parameters), parameters.reattachment_time);
        let contacts = (parameters.blocks * parameters.contacts_per_block) as f64;
        let swing = (parameters.block_contact_stiffness() / parameters.block_mass()).sqrt();
        let longest = recording.max_time.unwrap_or(f64::INFINITY);
        if interval - delay < LOADED_AT_ONCE * delay || parameters.damping_rate > OVERDAMPED * swing {
            let time = recording.give_up_time(parameters).min(longest);
            let velocity = parameters.drive_velocity;
            let distance_of_a_contact = parameters.contact_reach() + velocity * delay;
            return Self { time, resolved: time, breaks: contacts * (1.0 + velocity * time / distance_of_a_contact) };
        }
        let slips = recording.slips as f64 + recording.discard as f64;
        let time = (slips * interval).min(longest);
        let about_a_slip = RESOLVED_REATTACHMENTS * delay + RESOLVED_DAMPINGS / parameters.damping_rate;
        let resolved = time * (about_a_slip / interval).min(1.0);
        Self { time, resolved, breaks: time / interval * BREAKS_IN_A_SLIP * contacts }
    }
}

/// About the step of the grid at a tolerance of 1e-3, in s.
fn step_length(parameters: &Parameters) -> f64 {
    let contacts = parameters.block_contact_stiffness();
    let stiffest = 4.0 * parameters.coupling_stiffness() + contacts + parameters.drive_stiffness;
    let mass = parameters.block_mass();
    let fastest = (stiffest / mass).sqrt().max(17.0 * (contacts / mass).sqrt());
    2.0 / fastest.max(4.0 * parameters.damping_rate).max(8.0 * parameters.largest_modulation_frequency())
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

    /// Measured on a processor with 256-bit vectors or wider, in ms: 1.7 a slip, 2.2 with modulation, 20 for 560 blocks.
    #[test]
    fn what_was_measured_is_predicted_within_a_factor_of_two() {
        let a_slip =
            |parameters: Parameters| 1e3 / 45.0 * predicted_cost(&parameters, &Recording::default(), Solver::default());
        let modulated = (1e-6, Some(1.0 / 58.0));
        for (blocks, (modulation_amplitude, modulation_period), measured) in
            [(70, (0.0, None), 1.7), (70, modulated, 2.2), (140, (0.0, None), 3.4), (560, (0.0, None), 20.0)]
        {
            let parameters = Parameters { blocks, modulation_amplitude, modulation_period, ..Parameters::default() };
            let predicted = a_slip(parameters);
            assert!((0.5..2.0).contains(&(predicted / measured)), "{blocks}: {predicted} ms against {measured}");
        }
    }

    #[test]
    fn sliding_costs_until_the_job_gives_up() {
        let at = |drive_velocity| {
            let parameters = Parameters { drive_velocity, ..Parameters::default() };
            Motion::of(&parameters, &Recording::default()).time / typical_interval(&parameters)
        };
        assert_eq!((at(1e-4).round(), at(1e-2).round()), (45.0, 20.0));
    }
}
