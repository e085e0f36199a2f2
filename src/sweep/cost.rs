//! What a job will cost, from its parameters alone: CPU seconds for balancing parts and for the time left, and memory.
//!
//! Contact events and steps, each times what one takes. How many follows from what the slider is expected to do: slip,
//! with quiet time in between; slide, until the job gives up; or follow a strong modulation. Contract: a pure function
//! in basic arithmetic and square roots, so that the same file gives the same parts on every machine. Changing a number
//! here changes the parts: raise [`PLAN_VERSION`](super::PLAN_VERSION) with it.
//!
//! `scripts/predicted-cost` measures jobs of all sweeps of this project, their axes wider by a factor of 3 at both ends,
//! and random ones with 1 to 500 blocks of 1 to 160 contacts at 3e-7 to 6e-4 m/s, whose springs, delays and dampings
//! vary by factors of 16 to 40. Of 332, 94 % cost a fifth to five times the prediction; half to twice cost 92 % of those
//! of sweeps and 69 % of random ones. The numbers here were fitted to others, drawn in the same way. What it cannot know
//! is when chance ends a job: with few contacts, and where the slider hardly slips.

use crate::model::Parameters;
use crate::model::theory::{end_stiffness, loading_time, total_strength, typical_interval};
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
const GRID_STEP_OF_A_BLOCK: f64 = 0.29e-9;
const GRID_STEP_OVERHEAD: f64 = 11e-9;
/// How many times as long a ledger makes that.
const GRID_WITH_LEDGER: f64 = 2.4;

/// CPU time of a leap over quiet time, and of a leap of one block, in s.
const LEAP: f64 = 410e-9;
const LEAP_OF_A_BLOCK: f64 = 4e-9;

/// CPU time in Taylor steps, in s.
struct TaylorCosts {
    /// Beside the motion. A ledger sets up a quadrature for each job.
    job: f64,
    /// With its reattachment.
    a_break: f64,
    step: f64,
    step_of_a_block: f64,
}

const TAYLOR: TaylorCosts = TaylorCosts {
    job: 0.0,
    a_break: 400e-9,
    step: 230e-9,
    step_of_a_block: 4.8e-9,
};
const TAYLOR_WITH_LEDGER: TaylorCosts = TaylorCosts {
    job: 4e-4,
    a_break: 1.4e-6,
    step: 100e-9,
    step_of_a_block: 30e-9,
};
/// Taylor steps for each break at a tolerance of 1e-3, and the share of resolved motion that they resolve.
const TAYLOR_STEPS_OF_A_BREAK: f64 = 1.0;
const TAYLOR_SHARE: f64 = 0.3;
/// CPU time of a job beside its motion, in s.
const JOB_OVERHEAD: f64 = 6e-6;

/// Share of the strength that the drive loads between slips, of a slider that moves as one. In a chain the first blocks
/// bear the load, and it is less by the square root of the share of the contacts that they hold. Closer than the typical
/// interval, which must not change: it decides when jobs give up.
const LOADED_BY_ONE: f64 = 0.72;
/// How long motion is resolved after a slip, in s, and how many times that more for a modulation whose amplitude is the
/// way that the drive makes between slips.
const RESOLVED_OF_A_SLIP: f64 = 0.04;
const RESOLVED_WITH_SWING: f64 = 2.0;
/// If the amplitude is more than the first share of that way, each period breaks the second share of the contacts; if it
/// is more than the third, the slider slips to and fro with the modulation.
const SHAKEN: f64 = 0.38;
const BREAKS_OF_A_PERIOD: f64 = 0.25;
const FOLLOWS: f64 = 0.6;
/// Steps in a quiet period of such a modulation.
const STEPS_OF_A_PERIOD: f64 = 40.0;
/// Leaps in an interval, and where motion is hardly ever quiet.
const LEAPS: f64 = 6.0;
const FEW_LEAPS: f64 = 2.0;
/// Steps of the grid that resolve a break of a slider that slides.
const STEPS_OF_A_SLIDING_BREAK: f64 = 80.0;
/// Contacts below which a sliding slider comes to rest by chance, and its mean interval then, in intervals of stick-slip.
const FEW_CONTACTS: f64 = 70.0;
const REST: f64 = 1.3;

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
                + motion.cost_of_leaps(blocks)
        }
        Method::EventDriven => {
            let finer = fourth_root(fourth_root(1e-3 / setting));
            let costs = if recording.energies {
                TAYLOR_WITH_LEDGER
            } else {
                TAYLOR
            };
            let resolved = (TAYLOR_SHARE * finer * finer * motion.resolved).min(motion.time);
            let steps = TAYLOR_STEPS_OF_A_BREAK * finer * motion.breaks
                + motion.steps_of_periods
                + resolved / longest_taylor_step(parameters);
            let of_steps = steps * (costs.step + costs.step_of_a_block * blocks);
            costs.job + motion.breaks * costs.a_break + of_steps + motion.cost_of_leaps(blocks)
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
    leaps: f64,
    /// Steps beside those of the part that is not quiet.
    steps_of_periods: f64,
}

impl ExpectedMotion {
    fn cost_of_leaps(&self, blocks: f64) -> f64 {
        self.leaps * (LEAP + LEAP_OF_A_BLOCK * blocks)
    }

    fn of(parameters: &Parameters, recording: &Recording) -> Self {
        let given_up = || {
            let longest = recording.max_time.unwrap_or(f64::INFINITY);
            recording.give_up_time(parameters).min(longest)
        };
        // A pulse is short.
        let lasting = match parameters.pulse_start {
            Some(_) => &parameters.without_modulation(),
            None => parameters,
        };
        let scales = Scales::of(lasting);
        if parameters.drive_velocity > critical_velocity(parameters) {
            Self::sliding(&scales, parameters, recording, given_up())
        } else if scales.swing > FOLLOWS {
            Self::following(&scales, recording, given_up())
        } else {
            Self::stick_slip(&scales, recording)
        }
    }

    fn stick_slip(scales: &Scales, recording: &Recording) -> Self {
        let time = recording.expected_time(scales.interval);
        let slips = time / scales.interval;
        let shaking = (BREAKS_OF_A_PERIOD / scales.period).min(scales.breaks_of_sliding);
        let of_shaking = if scales.swing > SHAKEN {
            time * shaking
        } else {
            0.0
        };
        Self {
            time,
            resolved: scales.resolved(time, slips),
            breaks: scales.contacts * (slips * scales.breaks_of_a_slip + of_shaking),
            leaps: LEAPS * slips,
            steps_of_periods: STEPS_OF_A_PERIOD * scales.swing * time / scales.period,
        }
    }

    /// With the modulation, to and fro; until the job gives up, if that is too fast to come to rest.
    fn following(scales: &Scales, recording: &Recording, given_up: f64) -> Self {
        let between = scales.interval.min(0.5 * scales.period);
        let comes_to_rest = scales.period > 2.0 * (scales.duration + scales.delay);
        let time = if comes_to_rest {
            recording.expected_time(between)
        } else {
            given_up
        };
        let slips = time / between;
        let rate = (scales.breaks_of_a_slip / between).min(scales.breaks_of_sliding);
        Self {
            time,
            resolved: scales.resolved(time, slips),
            breaks: scales.contacts * (1.0 + time * rate),
            leaps: FEW_LEAPS * slips,
            steps_of_periods: 0.0,
        }
    }

    fn sliding(
        scales: &Scales,
        parameters: &Parameters,
        recording: &Recording,
        given_up: f64,
    ) -> Self {
        let time = if scales.contacts < FEW_CONTACTS {
            given_up.min(recording.expected_time(REST * scales.interval))
        } else {
            given_up
        };
        let breaks = scales.contacts * (1.0 + time * scales.breaks_of_sliding);
        let about_breaks = STEPS_OF_A_SLIDING_BREAK * step_length(parameters) * breaks;
        Self {
            time,
            resolved: time.min(about_breaks),
            breaks,
            leaps: FEW_LEAPS * time / scales.interval,
            steps_of_periods: 0.0,
        }
    }
}

/// Times in s, rates in 1/s, and numbers that motion is expected from.
struct Scales {
    contacts: f64,
    /// Between slips, and of one.
    interval: f64,
    duration: f64,
    /// Of reattachment.
    delay: f64,
    /// Infinite without modulation.
    period: f64,
    /// Amplitude of the modulation over the way that the drive makes between slips.
    swing: f64,
    /// For each contact.
    breaks_of_a_slip: f64,
    breaks_of_sliding: f64,
}

impl Scales {
    fn of(parameters: &Parameters) -> Self {
        let delay = parameters.reattachment_time;
        let velocity = parameters.drive_velocity;
        let reach = parameters.contact_reach();
        let loading = expected_loading(parameters);
        let interval = loading + delay;
        // Half a swing on the springs and the time in which damping slows it.
        let mass = parameters.slider_mass;
        let stiffness =
            1.0 / (1.0 / parameters.drive_stiffness + 1.0 / parameters.slider_stiffness);
        let duration = PI * (mass / stiffness).sqrt() + mass * parameters.damping_rate / stiffness;
        let amplitude = parameters
            .modulation_amplitude
            .max(parameters.turning_amplitude.unwrap_or(0.0));
        let period = TAU / parameters.largest_modulation_frequency();
        let fastest = velocity.max(4.0 * amplitude / period);
        Self {
            contacts: (parameters.blocks * parameters.contacts_per_block) as f64,
            interval,
            duration,
            delay,
            period,
            swing: amplitude / (velocity * loading),
            // Each contact breaks, and again as often as it attaches again on the way.
            breaks_of_a_slip: 1.0 + 1.0 / (delay / duration + reach / (velocity * interval)),
            breaks_of_sliding: 1.0 / (delay + reach / fastest),
        }
    }

    /// How long motion is resolved, in s. What is resolved about one slip overlaps that about the next if they are close.
    fn resolved(&self, time: f64, slips: f64) -> f64 {
        let about_slips = RESOLVED_OF_A_SLIP * (1.0 + RESOLVED_WITH_SWING * self.swing) * slips;
        time * about_slips / (time + about_slips)
    }
}

/// The velocity of the drive above which sliding is stable, in m/s.
///
/// At a velocity v a contact holds for reach/v and is off for the delay, so that friction is half the strength times
/// reach/(reach + v delay). Sliding is stable where damping grows faster with v than this falls.
fn critical_velocity(parameters: &Parameters) -> f64 {
    let reach = parameters.contact_reach();
    let delay = parameters.reattachment_time;
    let damping = parameters.slider_mass * parameters.damping_rate;
    ((0.5 * total_strength(parameters) * reach * delay / damping).sqrt() - reach) / delay
}

/// Time in which the drive loads a slip, in s.
fn expected_loading(parameters: &Parameters) -> f64 {
    let contacts = parameters.blocks as f64 * parameters.block_contact_stiffness();
    let end = end_stiffness(parameters);
    loading_time(parameters, LOADED_BY_ONE * (end / contacts).sqrt(), end)
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
        let interval = expected_loading(&parameters) + parameters.reattachment_time;
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
            let recording = Recording::default();
            let time = ExpectedMotion::of(&parameters, &recording).time;
            time / recording.give_up_time(&parameters)
        };
        assert_eq!(at(1e-2), 1.0);
        assert!(at(1e-4) > 2.0);
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
