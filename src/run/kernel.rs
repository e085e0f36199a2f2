//! The kernel: one job, from parameters to measurements.

use crate::model::Parameters;
use crate::observe::{Recording, SlipObserver};
use crate::solver::{Limits, SimulationError, Solver, Summary, simulate};
use crate::store::tables::{JobRecord, JobResult};
use crate::sweep::Job;
use std::sync::atomic::AtomicBool;

/// What runs a job: until it is done, cannot go on, or the flag turns true, which is [`SimulationError::Interrupted`].
pub type Kernel<'a> = dyn Fn(&Job, &AtomicBool) -> Result<JobResult, SimulationError> + Sync + 'a;

/// Simulates one realisation and measures what is to be recorded. The result is a function of the first three arguments.
///
/// # Errors
/// When the simulation cannot go on, or is interrupted.
pub fn kernel(
    parameters: &Parameters,
    recording: &Recording,
    solver: Solver,
    interrupt: &AtomicBool,
) -> Result<JobResult, SimulationError> {
    let mut observer = SlipObserver::new(parameters, recording);
    let summary = simulate(parameters, solver, limits(recording, interrupt), &mut observer)?;
    Ok(measured(observer, summary))
}

/// What an observer has measured in a simulation that ended so.
pub fn measured(observer: SlipObserver, summary: Summary) -> JobResult {
    let record = JobRecord { ruptures: observer.ruptures(), mean_friction: observer.mean_friction(), summary };
    let (slips, precursors) = observer.into_rows();
    JobResult { slips, precursors, record }
}

/// The bounds that a recording sets.
pub fn limits<'a>(recording: &Recording, interrupt: &'a AtomicBool) -> Limits<'a> {
    Limits {
        end_time: recording.max_time.unwrap_or(f64::INFINITY),
        events: recording.max_events,
        interrupt: Some(interrupt),
    }
}
