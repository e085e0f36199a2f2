//! Solvers: advance a model and report to an observer what happens.
//!
//! The entry point is [`simulate`]. An [`Observer`] sees contact events and, between them, [`Segment`]s: the shear
//! force as a closed-form function of time. It does not know which solver runs.
//!
//! ```text
//! event_driven/      exact times of events: leap to leap, on a grid in time, or by Taylor series
//! fixed_step.rs      the baseline
//! segment.rs         F_S between events, from polynomial.rs or harmonic.rs
//! ledger.rs          energies, and the balance that certifies a run
//! ```

mod event_driven;
mod fixed_step;
mod harmonic;
mod ledger;
mod polynomial;
#[cfg(test)]
mod pulse_tests;
mod segment;

pub use event_driven::{GRID_TOLERANCE, Resolve};
pub use harmonic::Harmonic;
pub use ledger::{Ledger, Spent};
pub use polynomial::Extreme;
pub use segment::{CubicStep, Extremes, ForcePath, GridPath, PolynomialPath, Segment};

use self::ledger::Audit;
use crate::model::fields::fields;
use crate::model::{ContactEvent, Parameters};
use crate::value::words;
use pulp::Arch;
use std::sync::atomic::AtomicBool;

words! {
    /// A method of solving.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Method {
        /// From contact event to contact event, exact within the tolerance.
        EventDriven = "event-driven",
        /// Explicit velocity-Verlet with damping, contacts tested after each step.
        FixedStep = "fixed-step",
    }
}

impl Method {
    /// The settings that it has, the main one first. Those of other methods stay at their defaults.
    pub const fn settings(self) -> &'static [SolverKey] {
        match self {
            Self::EventDriven => event_driven::SETTINGS,
            Self::FixedStep => fixed_step::SETTINGS,
        }
    }
}

fields! {
    /// A method of solving with its settings.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Solver by SolverKey {
        Method("method") method: Method = Method::EventDriven, "", WORD, "method of solving";
        Tolerance("tolerance") tolerance: f64 = 1e-3, "", TOLERANCE,
            "target error of displacement; of `event-driven`, as is `resolve`";
        Resolve("resolve") resolve: Resolve = Resolve::Auto, "", WORD,
            "how motion between leaps is resolved; `auto` takes the grid for tolerances of 1e-7 and above";
        TimeStep("dt") time_step: Option<f64> = None, "s",
            POSITIVE and "less than 2/omega_max, the limit of stability",
            "step of `fixed-step`, which needs one, such as dt = 1e-6";
    }
}

impl Solver {
    /// From contact event to contact event with this tolerance, resolved in the way that is cheapest.
    pub const fn event_driven(tolerance: f64) -> Self {
        Self {
            method: Method::EventDriven,
            tolerance,
            resolve: Resolve::Auto,
            time_step: None,
        }
    }

    /// In steps of this length, in s.
    pub const fn fixed_step(time_step: f64) -> Self {
        Self {
            method: Method::FixedStep,
            time_step: Some(time_step),
            ..Self::event_driven(1e-3)
        }
    }

    /// The main setting of its method; not a number if it is missing.
    pub fn setting(self) -> f64 {
        self.get(self.method.settings()[0])
            .number()
            .unwrap_or(f64::NAN)
    }

    /// Checks that the main setting fits the parameters.
    pub fn check(self, parameters: &Parameters) -> Result<(), SimulationError> {
        match self.method {
            Method::EventDriven => event_driven::check(self.tolerance),
            Method::FixedStep => fixed_step::check(self.setting(), parameters),
        }
    }
}

/// Follows a simulation and says when it has seen enough.
pub trait Observer {
    /// Time passes without a contact event. Segments come in order and without gaps.
    fn advance(&mut self, _segment: &Segment<'_>) {}

    /// A contact breaks or attaches, at the end of the segment before.
    fn contact(&mut self, _event: &ContactEvent) {}

    /// What is spent up to the break that comes next, if a ledger is kept.
    fn spent(&mut self, _spent: Spent) {}

    /// Whether it needs attachments. If not, a solver may leave them out, and end no segment at one.
    fn follows_attachments(&self) -> bool {
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

/// Why a simulation could not continue. Times and steps are in s.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SimulationError {
    #[error("{setting}: must be {allowed}")]
    BadSetting { setting: String, allowed: String },
    #[error("at t = {time} s: the state is not finite; a smaller dt or tolerance may help")]
    NotFinite { time: f64 },
    #[error(
        "at t = {time} s: a step of {step:e} s is lost in the resolution of the time; the shortest time scale of these \
         parameters, 1/omega_max, 1/gamma, T or that of the load, is too short"
    )]
    StepTooShort { time: f64, step: f64 },
    #[error(
        "at t = {time} s: {events} contact events, the most allowed; raise the budget (record.max_events) if they are \
         wanted"
    )]
    EventBudget { time: f64, events: u64 },
    #[error("at t = {time} s: interrupted")]
    Interrupted { time: f64 },
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

/// The same with an energy ledger, at some twice the cost; the simulation itself is the same to the last bit.
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
    match solver.method {
        Method::EventDriven => event_driven::run(solver, parameters, limits, observer, audit),
        Method::FixedStep => Arch::new().dispatch(fixed_step::FixedStepRun {
            parameters,
            time_step: solver.setting(),
            limits,
            observer,
            audit,
        }),
    }
}
