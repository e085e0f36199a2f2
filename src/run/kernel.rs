//! The kernel: one job, from parameters to measurements.

use crate::model::Parameters;
use crate::observe::Recording;
use crate::solver::{SimulationError, Solver};
use crate::store::tables::JobResult;
use crate::sweep::Job;
use std::sync::atomic::AtomicBool;

/// What runs a job: until it is done, cannot go on, or the flag turns true, which is [`SimulationError::Interrupted`].
pub type Kernel<'a> = dyn Fn(&Job, &AtomicBool) -> Result<JobResult, SimulationError> + Sync + 'a;

/// Simulates one realisation and measures what is to be recorded. The result is a function of the first three arguments.
///
/// # Errors
/// When the simulation cannot go on, or is interrupted.
pub fn kernel(
    _parameters: &Parameters,
    _recording: &Recording,
    _solver: Solver,
    _interrupt: &AtomicBool,
) -> Result<JobResult, SimulationError> {
    todo!()
}
