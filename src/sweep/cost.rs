//! What a job will cost, from its parameters alone: CPU seconds for balancing parts and for the time left, and memory.
//!
//! Contact events and steps, each times what one takes. How many follows from what the slider is expected to do: slip,
//! with quiet time in between; slide, until the job gives up; or follow a strong modulation. Contract: a pure function
//! in basic arithmetic and square roots, so that the same file gives the same parts on every machine. Changing a number
//! here changes the parts: raise [`PLAN_VERSION`](super::PLAN_VERSION) with it.
//!
//! `scripts/predicted-cost` measures jobs of all sweeps of this project, their axes wider by a factor of 3 at both ends,
//! and random ones with 1 to 500 blocks of 1 to 160 contacts at 3e-7 to 6e-4 m/s: of 196, 84 % cost half to twice the
//! prediction, and all a fifth to five times. What it cannot know is when chance ends a job: with few contacts, and
//! where the slider hardly slips.

use crate::model::Parameters;
use crate::model::theory::{total_strength, typical_interval};
use crate::observe::Recording;
use crate::solver::{Method, Solver};
use std::f64::consts::{PI, TAU};

/// CPU time of one fixed step on one block, in s: a few multiplications and the test of the next contact.
const STEP_OF_A_BLOCK: f64 = 0.9e-9;
/// CPU time of one fixed step beside its blocks, in s: the drive, the observer, the queue of reattachments.
const STEP_OVERHEAD: f64 = 45e-9;

/// CPU time of a break with its reattachment on the grid, of a step on one block, and of a step beside its blocks, in
/// s.
const GRID_EVENT: f64 = 250e-9;
const GRID_STEP_OF_A_BLOCK: f64 = 0.22e-9;
const GRID_STEP_OVERHEAD: f64 = 10e-9;
/// How many times as long a ledger makes that.
const GRID_WITH_LEDGER: f64 = 2.0;

/// CPU time in Taylor steps, in s: of a job beside its motion, a break with its reattachment, a step, and a step on one
/// block. A ledger sets up a quadrature for each job.
const TAYLOR: [f64; 4] = [0.0, 650e-9, 170e-9, 3.3e-9];
const TAYLOR_WITH_LEDGER: [f64; 4] = [4e-4, 1.4e-6, 100e-9, 30e-9];
/// Taylor steps for each break at a tolerance of 1e-3; for each step of the grid that follows the modulation; and the
/// share of resolved motion that they resolve.
const TAYLOR_STEPS_OF_A_BREAK: f64 = 0.9;
const TAYLOR_STEPS_OF_A_GRID_STEP: f64 = 0.3;
const TAYLOR_SHARE: f64 = 0.6;
/// CPU time of a job beside its motion, in s.
const JOB_OVERHEAD: f64 = 2e-5;

/// How long motion is resolved about a slip: in reattachment times, or durations of the slip if these are shorter, and
/// in times in which damping slows it.
const RESOLVED_REATTACHMENTS: f64 = 3.0;
const RESOLVED_DAMPINGS: f64 = 100.0;
/// Steps of the grid in a period of the modulation, if its amplitude were the way that the drive makes between slips.
const STEPS_OF_A_PERIOD: f64 = 250.0;
/// If the amplitude is more than the first share of that way, each period breaks the second share of the contacts, and
/// motion is never quiet; if it is more than the third, the slider slips to and fro with the modulation.
const SHAKEN: f64 = 0.4;
const BREAKS_OF_A_PERIOD: f64 = 0.2;
const FOLLOWS: f64 = 0.6;
/// A slider that slides, or slips to and fro too fast to come to rest, does so by chance: after two reattachment times
/// with few blocks, and much later with more than this.
const RESTLESS_BLOCKS: f64 = 12.0;

/// Predicted CPU time of a job, in s.
pub fn predicted_cost(parameters: &Parameters, recording: &Recording, solver: Solver) -> f64 {
    let blocks = parameters.blocks as f64;
    let motion = ExpectedMotion::of(parameters, recording);
    let fourth_root = |ratio: f64| ratio.sqrt().sqrt();
    let setting = solver.setting();
    let of_motion = match solver.method {
        Method::EventDriven if solver.resolve.takes_grid(setting) => {
            let step = step_length(parameters) * fourth_root(setting / 1e-3);
            let steps = (motion.resolved / step + motion.steps_of_periods).min(motion.time / step);
            let of_a_step = GRID_STEP_OVERHEAD + GRID_STEP_OF_A_BLOCK * blocks;
            let with_ledger = if recording.energies {
                GRID_WITH_LEDGER
            } else {
                1.0
            };
            with_ledger * (motion.breaks * GRID_EVENT + steps * of_a_step)
        }
        Method::EventDriven => {
            let finer = fourth_root(fourth_root(1e-3 / setting));
            let [of_a_job, of_a_break, of_a_step, of_a_block] = if recording.energies {
                TAYLOR_WITH_LEDGER
            } else {
                TAYLOR
            };
            let resolved = (TAYLOR_SHARE * finer * finer * motion.resolved).min(motion.time);
            let steps = TAYLOR_STEPS_OF_A_BREAK * finer * motion.breaks
                + TAYLOR_STEPS_OF_A_GRID_STEP * motion.steps_of_periods
                + resolved / longest_taylor_step(parameters);
            of_a_job + motion.breaks * of_a_break + steps * (of_a_step + of_a_block * blocks)
        }
        Method::FixedStep => motion.time / setting * (STEP_OVERHEAD + STEP_OF_A_BLOCK * blocks),
    };
    JOB_OVERHEAD + of_motion
}

/// What a slider is expected to do in a job.
struct ExpectedMotion {
    /// Model time to its end, and the part of it that is not quiet, in s.
    time: f64,
    resolved: f64,
    breaks: f64,
    /// Steps beside those of the part that is not quiet.
    steps_of_periods: f64,
}

impl ExpectedMotion {
    /// Motion with no steps beside those that resolve it.
    const fn resolved(time: f64, resolved: f64, breaks: f64) -> Self {
        Self {
            time,
            resolved,
            breaks,
            steps_of_periods: 0.0,
        }
    }

    fn of(parameters: &Parameters, recording: &Recording) -> Self {
        if parameters.pulse_start.is_some() {
            // It is short.
            return Self::of(&parameters.without_modulation(), recording);
        }
        let interval = typical_interval(parameters);
        let delay = parameters.reattachment_time;
        let velocity = parameters.drive_velocity;
        let reach = parameters.contact_reach();
        let contacts = (parameters.blocks * parameters.contacts_per_block) as f64;
        let longest = recording.max_time.unwrap_or(f64::INFINITY);
        // A slip takes half a swing on the springs and the time in which damping slows it.
        let mass = parameters.slider_mass;
        let damping = parameters.slider_mass * parameters.damping_rate;
        let stiffness =
            1.0 / (1.0 / parameters.drive_stiffness + 1.0 / parameters.slider_stiffness);
        let duration = PI * (mass / stiffness).sqrt() + damping / stiffness;
        // At a velocity v a contact holds for reach/v and is off for the delay, so that friction is half the strength
        // times reach/(reach + v delay). Sliding is stable where damping grows faster with v than this falls.
        let critical =
            ((0.5 * total_strength(parameters) * reach * delay / damping).sqrt() - reach) / delay;

        let amplitude = parameters
            .modulation_amplitude
            .max(parameters.turning_amplitude.unwrap_or(0.0));
        let period = TAU / parameters.largest_modulation_frequency();
        let swing = amplitude / (velocity * (interval - delay));
        let follows = swing > FOLLOWS;
        let about_a_slip = RESOLVED_REATTACHMENTS * delay.min(duration)
            + RESOLVED_DAMPINGS / parameters.damping_rate;
        // In a slip each contact breaks, and again as often as it attaches again on the way.
        let breaks_of_a_slip = 1.0 + 1.0 / (delay / duration + reach / (velocity * interval));
        if velocity > critical || follows {
            let is_restless = velocity > critical || period < 2.0 * duration + delay;
            let crowd = parameters.blocks as f64 / RESTLESS_BLOCKS;
            let rest = 2.0 * delay * (1.0 + crowd * crowd * crowd * crowd);
            let given_up = recording.give_up_time(parameters);
            let time = if !is_restless {
                recording.expected_time(interval.min(0.5 * period))
            } else if rest < given_up {
                recording.expected_time(rest)
            } else {
                given_up.min(longest)
            };
            let fastest = velocity.max(4.0 * amplitude / period);
            let sliding = 1.0 / (delay + reach / fastest);
            // Without rest, each break is followed by motion.
            let slips = if is_restless {
                contacts * sliding
            } else {
                fastest / (velocity * (interval - delay))
            };
            let breaks = contacts * (1.0 + time * sliding.min(breaks_of_a_slip * slips));
            return Self::resolved(time, time * (about_a_slip * slips).min(1.0), breaks);
        }
        let time = recording.expected_time(interval);
        let slips = time / interval;
        let periods = time / period;
        let breaks = contacts * slips * breaks_of_a_slip;
        if swing > SHAKEN {
            let breaks_of_periods = contacts * periods * BREAKS_OF_A_PERIOD;
            return Self::resolved(time, time, breaks + breaks_of_periods);
        }
        let resolved = time * (about_a_slip / interval).min(1.0);
        Self {
            time,
            resolved,
            breaks,
            steps_of_periods: STEPS_OF_A_PERIOD * swing * periods,
        }
    }
}

/// About the largest frequency of the blocks, in rad/s.
fn frequency_of_blocks(parameters: &Parameters) -> f64 {
    let contacts = parameters.block_contact_stiffness();
    let stiffest = 4.0 * parameters.coupling_stiffness() + contacts + parameters.drive_stiffness;
    (stiffest / parameters.block_mass()).sqrt()
}

/// The longest Taylor step, in s.
fn longest_taylor_step(parameters: &Parameters) -> f64 {
    let of_modulation = parameters.largest_modulation_frequency();
    let others = of_modulation.max(parameters.damping_rate);
    4.0 / frequency_of_blocks(parameters).max(others)
}

/// About the step of the grid at a tolerance of 1e-3, in s.
fn step_length(parameters: &Parameters) -> f64 {
    let of_blocks = frequency_of_blocks(parameters);
    let contacts = parameters.block_contact_stiffness();
    let of_contacts = 17.0 * (contacts / parameters.block_mass()).sqrt();
    let of_damping = 4.0 * parameters.damping_rate;
    let of_modulation = 8.0 * parameters.largest_modulation_frequency();
    2.0 / of_blocks
        .max(of_contacts)
        .max(of_damping)
        .max(of_modulation)
}

/// Bytes of memory. Measured with all methods on 100 to 100,000 blocks with 2 to 10,000 contacts each: 150 a contact
/// and 1170 a block from the beginning of a job on, and 320 a slip.
const MEMORY_OF_A_CONTACT: f64 = 155.0;
const MEMORY_OF_A_BLOCK: f64 = 1250.0;
/// Until its part is committed, which takes the same again.
pub(super) const MEMORY_OF_A_SLIP: f64 = 600.0;
/// Share of the prediction for contacts and blocks that a job takes in any case.
const CERTAIN_SHARE: f64 = 0.7;
/// Smaller jobs are always started: the program itself takes as much memory.
pub const LARGE: f64 = 64e6;

/// Memory that a job takes in bytes, rounded up.
pub fn predicted_memory(parameters: &Parameters, recording: &Recording) -> f64 {
    let slips = recording.expected_slips(typical_interval(parameters));
    memory_of_interface(parameters) + MEMORY_OF_A_SLIP * slips
}

/// Memory that a large job takes at least, in bytes; 0 for a smaller one.
pub fn certain_memory(parameters: &Parameters) -> f64 {
    let predicted = memory_of_interface(parameters);
    if predicted < LARGE {
        0.0
    } else {
        CERTAIN_SHARE * predicted
    }
}

fn memory_of_interface(parameters: &Parameters) -> f64 {
    let blocks = parameters.blocks as f64;
    blocks * (MEMORY_OF_A_BLOCK + MEMORY_OF_A_CONTACT * parameters.contacts_per_block as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Symbol, Value};
    use crate::solver::Resolve;

    #[test]
    fn cost_grows_with_slips_up_to_the_longest_time() {
        let parameters = Parameters::default();
        let cost = |slips, max_time| {
            let recording = Recording {
                slips: Some(slips),
                discard: 0,
                max_time,
                ..Recording::default()
            };
            predicted_cost(&parameters, &recording, Solver::fixed_step(1e-6))
        };
        let of_slips = |slips| cost(slips, None) - JOB_OVERHEAD;
        assert!((of_slips(20) / of_slips(10) - 2.0).abs() < 1e-9);
        assert!((cost(1_000_000, Some(2.0)) - JOB_OVERHEAD - 2e6 * 108e-9).abs() < 1e-9);
    }

    #[test]
    fn a_job_that_ends_at_a_time_costs_one_interval_more() {
        let parameters = Parameters::default();
        let cost = |slips, time, max_time| {
            let recording = Recording {
                slips,
                time,
                max_time,
                ..Recording::default()
            };
            predicted_cost(&parameters, &recording, Solver::default())
        };
        let interval = typical_interval(&parameters);
        let of_time = cost(None, Some(3.0), None);
        let cut = cost(Some(1_000_000), None, Some(3.0 + interval));
        assert!((of_time / cut - 1.0).abs() < 1e-12, "{of_time} {cut}");
        assert!(cost(Some(2), Some(3.0), None) < of_time);
    }

    /// Measured on one core of a server in 2026, of 15 slips after 5, in ms.
    #[test]
    fn what_was_measured_is_predicted_within_a_factor_of_two() {
        let grid = Solver::default();
        let taylor = Solver {
            resolve: Resolve::Taylor,
            ..Solver::event_driven(1e-8)
        };
        for (settings, solver, measured) in [
            ("", grid, 18.3),
            ("", taylor, 95.6),
            ("", Solver::fixed_step(4e-6), 62.7),
            ("N=2", grid, 0.54),
            ("N=20", grid, 6.2),
            ("N=560", grid, 253.0),
            ("Ns=200", grid, 281.0),
            ("V0=1e-6", grid, 13.4),
            ("V0=1e-3", grid, 20.5),
            ("V0=1e-2", grid, 8.7),
            ("N=200 V0=1.5e-3", grid, 213.0),
            ("tau_r=1e-4", grid, 137.0),
            ("tau_r=0.02", grid, 13.0),
            ("gamma=30000", grid, 31.1),
            ("Kd=1e6", grid, 150.0),
            ("Kd=1e6 V0=1e-3", grid, 940.0),
            ("K=1e7", grid, 34.1),
            ("M=100", grid, 36.8),
            ("Delta=1e-6 T=0.001 V0=1e-5", grid, 43.3),
            ("Delta=5e-6 T=0.002 V0=1e-5", grid, 1444.0),
            ("Delta=1e-5 T=0.005", grid, 148.7),
            ("Delta=1e-5 T=0.0333", grid, 16.9),
            ("Delta=1.2e-5 T=0.5", grid, 17.0),
            ("tau_r=0.3 V0=1e-5", grid, 11.9),
            ("N=1 Ns=1", grid, 0.05),
            ("N=2 Ns=2 V0=1e-3", grid, 0.096),
            ("N=10 Ns=5", grid, 0.9),
            ("N=200 Ns=3 V0=1e-5", taylor, 690.0),
            ("N=20 Ns=3 V0=1e-6", taylor, 8.5),
        ] {
            let mut parameters = Parameters::default();
            for setting in settings.split_whitespace() {
                let (key, value) = setting.split_once('=').unwrap();
                let value = value
                    .parse()
                    .map_or_else(|_| Value::Real(value.parse().unwrap()), Value::Count);
                parameters
                    .put(Symbol::from_key(key).unwrap(), value)
                    .unwrap();
            }
            let recording = Recording {
                slips: Some(15),
                ..Recording::default()
            };
            let predicted = 1e3 * predicted_cost(&parameters, &recording, solver);
            assert!(
                (0.5..2.0).contains(&(predicted / measured)),
                "{settings}: {predicted} ms against {measured}"
            );
        }
    }

    #[test]
    fn sliding_costs_until_the_job_gives_up() {
        let at = |drive_velocity| {
            let parameters = Parameters {
                drive_velocity,
                ..Parameters::default()
            };
            ExpectedMotion::of(&parameters, &Recording::default()).time
                / typical_interval(&parameters)
        };
        assert_eq!((at(1e-4).round(), at(1e-2).round()), (45.0, 20.0));
    }

    fn sized(blocks: usize, contacts_per_block: usize) -> Parameters {
        Parameters {
            blocks,
            contacts_per_block,
            ..Parameters::default()
        }
    }

    /// Peaks of runs in bytes, less those of a job of one contact.
    #[test]
    fn measured_jobs_take_what_is_predicted_and_more_than_is_certain() {
        let measured = [
            (sized(10_000, 100), 165e6),
            (sized(1000, 100), 15.1e6),
            (sized(100, 10_000), 154.7e6),
            (sized(100_000, 10), 274e6),
            (sized(100_000, 2), 149e6),
        ];
        let recording = Recording::default();
        for (parameters, peak) in measured {
            let predicted = predicted_memory(&parameters, &recording);
            assert!((1.0..1.15).contains(&(predicted / peak)), "{predicted}");
            assert!(certain_memory(&parameters) < 0.85 * peak, "{parameters:?}");
        }
    }

    #[test]
    fn slips_count_as_far_as_the_longest_time_allows() {
        let parameters = Parameters::default();
        let predicted = |max_time| {
            let recording = Recording {
                slips: Some(1_000_000),
                discard: 0,
                max_time,
                ..Recording::default()
            };
            predicted_memory(&parameters, &recording) - memory_of_interface(&parameters)
        };
        assert_eq!(predicted(None), 6e8);
        let ten = Some(10.0 * typical_interval(&parameters));
        assert!((predicted(ten) - 6e3).abs() < 1e-6);
    }
}
