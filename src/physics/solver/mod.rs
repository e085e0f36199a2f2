//! Solvers: advance a model from contact event to contact event and report to an observer what happens.
//!
//! The entry point is [`simulate`]. An [`Observer`] sees contact events and, between them, [`Segment`]s: the shear
//! force as a closed-form function of time. Nothing that it sees depends on which solver runs.

mod event_driven;
mod fixed_step;
mod harmonic;
mod ledger;
mod polynomial;
mod segment;

pub use harmonic::Harmonic;
pub use ledger::{Ledger, Spent};
pub use segment::{CubicStep, Extremes, ForcePath, Segment};

use self::ledger::Audit;
use crate::model::equation::stability_limit;
use crate::model::{ContactEvent, Parameters};
use crate::value::words;
use pulp::Arch;
use std::ops::RangeInclusive;
use std::sync::atomic::AtomicBool;

/// The method and its one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// From contact event to contact event, exact within the tolerance.
    EventDriven {
        /// Target for the error of displacement, relative to the contact reach f_s/k. 1e-12 to 1e-2.
        tolerance: f64,
        /// How the motion between leaps is resolved.
        resolve: Resolve,
    },
    /// Explicit velocity-Verlet with damping, contacts tested after each step.
    FixedStep {
        /// Time step dt, in s. Below the stability limit 2/ω_max.
        time_step: f64,
    },
}

words! {
    /// How the event-driven solver resolves motion.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Resolve {
        /// On the grid from a tolerance of [`GRID_TOLERANCE`] on, if the clock resolves its step and no ledger is kept;
        /// else in Taylor steps.
        #[default]
        Auto = "auto",
        /// On a constant grid of time, corrected for events to fourth order.
        Grid = "grid",
        /// In Taylor series, each up to the next event.
        Taylor = "taylor",
    }
}

impl Resolve {
    /// Whether motion is resolved on the grid at a tolerance, but for the exceptions of [`Self::Auto`].
    pub fn takes_grid(self, tolerance: f64) -> bool {
        match self {
            Self::Auto => tolerance >= GRID_TOLERANCE,
            Self::Grid => true,
            Self::Taylor => false,
        }
    }
}

/// Least tolerance at which [`Resolve::Auto`] takes the grid: it is cheaper down to some 1e-8.
pub const GRID_TOLERANCE: f64 = 1e-7;

impl Default for Solver {
    fn default() -> Self {
        Self::event_driven(1e-3)
    }
}

impl Solver {
    /// From contact event to contact event with this tolerance, resolved in the way that is cheapest.
    pub const fn event_driven(tolerance: f64) -> Self {
        Self::EventDriven {
            tolerance,
            resolve: Resolve::Auto,
        }
    }

    /// Checks that the setting fits the parameters.
    pub fn check(self, parameters: &Parameters) -> Result<(), SimulationError> {
        match self {
            Self::EventDriven { tolerance, .. } if !TOLERANCES.contains(&tolerance) => {
                Err(SimulationError::BadTolerance { tolerance })
            }
            Self::EventDriven { .. } => Ok(()),
            Self::FixedStep { time_step } => {
                let limit = stability_limit(parameters);
                let is_stable = time_step > 0.0 && time_step < limit;
                if is_stable {
                    Ok(())
                } else {
                    Err(SimulationError::UnstableStep { time_step, limit })
                }
            }
        }
    }
}

/// Tolerances of the event-driven solver that make sense: rounding lies below, other physics above.
pub const TOLERANCES: RangeInclusive<f64> = 1e-12..=1e-2;

/// Follows a simulation and says when it has seen enough.
pub trait Observer {
    /// Time passes without a contact event. Segments come in order and without gaps.
    fn advance(&mut self, _segment: &Segment<'_>) {}

    /// A contact breaks or attaches, at the end of the segment before.
    fn contact(&mut self, _event: &ContactEvent) {}

    /// What is spent up to the break that comes next, if a ledger is kept.
    fn spent(&mut self, _spent: Spent) {}

    /// Whether attachments are reported to it. Without them, no segment ends at one.
    fn follows_attachments(&self) -> bool {
        true
    }

    /// Whether it asks segments for the force between their ends or for its turns, and not only for extremes and impulse.
    fn follows_force(&self) -> bool {
        true
    }

    /// Whether the simulation may end. Asked after each segment and its events.
    fn is_satisfied(&self) -> bool {
        false
    }

    /// The simulation has ended, at a time in s, with the blocks at these displacements in m. Called once, and only if
    /// nothing went wrong.
    fn end(&mut self, _time: f64, _displacement: &[f64]) {}
}

/// Bounds on a simulation, whatever its observer wants.
#[derive(Clone, Copy, Debug)]
pub struct Limits<'a> {
    /// Model time at which the simulation ends, in s. Infinite: the observer alone decides.
    pub end_time: f64,
    /// Largest number of contact events.
    pub events: u64,
    /// Ends the simulation when it turns true.
    pub interrupt: Option<&'a AtomicBool>,
}

/// What a simulation cost and how it ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// Model time reached, in s.
    pub end_time: f64,
    /// Whether the observer was satisfied before the end time.
    pub satisfied: bool,
    pub steps: u64,
    /// Of these, leaps over quiet time.
    pub leaps: u64,
    /// Of these, steps of the grid; none if motion was resolved in Taylor steps.
    pub grid_steps: u64,
    pub breaks: u64,
    pub reattachments: u64,
}

/// Why a simulation could not continue.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulationError {
    /// The time step is not stable.
    #[error(
        "dt = {time_step:e} s: must be below the stability limit 2/omega_max = {limit:.4e} s of these parameters"
    )]
    UnstableStep {
        /// The refused step, in s.
        time_step: f64,
        /// The limit, in s.
        limit: f64,
    },
    /// The tolerance is out of range.
    #[error(
        "tolerance = {tolerance:e}: must lie from {:e} to {:e}, relative to fs/k",
        TOLERANCES.start(),
        TOLERANCES.end()
    )]
    BadTolerance { tolerance: f64 },
    /// A ledger is asked for along the grid.
    #[error(
        "resolve = \"grid\": an energy ledger is kept along Taylor steps only; leave resolve out or set it to \"taylor\""
    )]
    LedgerOnGrid,
    /// The state is no longer finite.
    #[error("at t = {time} s: the state is not finite; a smaller dt or tolerance may help")]
    NotFinite {
        /// Model time, in s.
        time: f64,
    },
    /// The steps that the motion needs are too short for the clock.
    #[error(
        "at t = {time} s: a step of {step:e} s is lost in the resolution of the time; the shortest time scale of these \
         parameters, 1/omega_max, 1/gamma or T, is too short"
    )]
    StepTooShort {
        /// Model time, in s.
        time: f64,
        /// The step, in s.
        step: f64,
    },
    /// More contact events than allowed.
    #[error(
        "at t = {time} s: {events} contact events, the most allowed; raise the budget (record.max_events) if they are \
         wanted"
    )]
    EventBudget {
        /// Model time, in s.
        time: f64,
        events: u64,
    },
    #[error("at t = {time} s: interrupted")]
    Interrupted {
        /// Model time, in s.
        time: f64,
    },
}

/// Runs one realisation until the observer is satisfied or the end time is reached.
pub fn simulate(
    parameters: &Parameters,
    solver: Solver,
    limits: Limits<'_>,
    observer: &mut dyn Observer,
) -> Result<Summary, SimulationError> {
    run(parameters, solver, limits, observer, None)
}

/// The same with an energy ledger, which costs several times as much; the simulation itself is the same to the last
/// bit, but that the event-driven solver takes Taylor steps at any tolerance.
pub fn simulate_audited(
    parameters: &Parameters,
    solver: Solver,
    limits: Limits<'_>,
    observer: &mut dyn Observer,
) -> Result<(Summary, Ledger), SimulationError> {
    ledger::audited(parameters, observer, |observer, audit| {
        run(parameters, solver, limits, observer, Some(audit))
    })
}

fn run(
    parameters: &Parameters,
    solver: Solver,
    limits: Limits<'_>,
    observer: &mut dyn Observer,
    audit: Option<&Audit>,
) -> Result<Summary, SimulationError> {
    solver.check(parameters)?;
    match solver {
        Solver::EventDriven { tolerance, resolve } => {
            event_driven::run(parameters, tolerance, resolve, limits, observer, audit)
        }
        Solver::FixedStep { time_step } => {
            fixed_step::run(Arch::new(), parameters, time_step, limits, observer, audit)
        }
    }
}
