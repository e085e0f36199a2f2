//! Accuracy: speed against error of every solver in one run, and what happens in hard cases.
//!
//! ```text
//! breaks.rs     before chaos: break times, contact by contact
//! distance.rs   after chaos: distances of distributions and biases, with intervals
//! study.rs      every solver under every drive, timed on one thread
//! scaling.rs    what a slip costs as the slider grows
//! hard_cases.rs parameters that break a naive code, each audited
//! cpu.rs        what a computation costs
//! tables.rs -> write.rs
//! ```

pub mod breaks;
pub mod cpu;
pub mod distance;
mod hard_cases;
mod scaling;
mod study;
mod tables;
mod write;

pub use cpu::Cost;
pub use distance::{Bias, Distance, Distances};
pub use hard_cases::{HardCase, Stability, hard_cases};
pub use scaling::{Exponents, SIZES, Scaling, ScalingFindings, SizeRow};
pub use study::{DistanceRow, Findings, MethodRow, Quantity, Study};
pub use write::{as_json, scaling_json, stability_json, write, write_scaling, write_stability};

use crate::figure::FigureError;
use crate::model::Parameters;
use crate::solver::{Limits, SimulationError, Solver};
use crate::table::file::DatasetError;
use crate::table::storage::StorageError;

/// A study that cannot be made or written.
#[derive(Debug, thiserror::Error)]
pub enum AccuracyError {
    /// A simulation cannot go on.
    #[error("{case}, seed {seed}, {solver}: {source}")]
    Simulation {
        /// What parameters it had, in words.
        case: String,
        /// Realisation.
        seed: u64,
        /// Method and setting.
        solver: String,
        /// The cause.
        source: SimulationError,
    },
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A table cannot be written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A file cannot be put in its place.
    #[error(transparent)]
    Storage(#[from] StorageError),
}

/// A solver and its setting in words.
#[must_use]
pub fn described(solver: Solver) -> String {
    match solver {
        Solver::EventDriven { tolerance } => format!("event-driven, tolerance {tolerance:e}"),
        Solver::FixedStep { time_step } => format!("fixed step, dt {time_step:e} s"),
    }
}

/// Velocity and modulation of a drive in words.
#[must_use]
pub fn drive_in_words(parameters: &Parameters) -> String {
    let modulation = parameters.modulation_period.map_or_else(
        || "Delta = 0".to_owned(),
        |period| format!("Delta = {:e} m, 1/T = {} Hz", parameters.modulation_amplitude, (1.0 / period).round()),
    );
    format!("V0 = {:e} m/s, {modulation}", parameters.drive_velocity)
}

/// Observers end these simulations; none needs as many events as the default budget of a job.
const NO_LIMITS: Limits<'static> = Limits { end_time: f64::INFINITY, events: 1_000_000_000, interrupt: None };

/// The error of a simulation; `in_words` tells what it had for parameters.
fn failed(
    in_words: fn(&Parameters) -> String,
    parameters: &Parameters,
    solver: Solver,
) -> impl FnOnce(SimulationError) -> AccuracyError + use<> {
    let (case, seed, solver) = (in_words(parameters), parameters.seed, described(solver));
    move |source| AccuracyError::Simulation { case, seed, solver, source }
}
