//! From parameters to measurements: one job, simulated and observed.

use super::{Precursor, Recording, Slip, SlipObserver};
use crate::model::Parameters;
use crate::solver::{Limits, SimulationError, Solver, Summary, simulate};
use std::sync::atomic::AtomicBool;

/// What a job measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Slips past start-up, in order.
    pub slips: Vec<Slip>,
    /// Their precursors, in order; empty if not recorded.
    pub precursors: Vec<Precursor>,
    /// Ruptures of any size, start-up included.
    pub ruptures: u64,
    /// Time average of the shear force `F_S` past start-up, in N; `None` if start-up did not end.
    pub mean_friction: Option<f64>,
    /// How the solver ended and what it did.
    pub summary: Summary,
}

impl Measurements {
    /// What an observer has measured in a simulation that ended with this summary.
    pub fn new(observer: SlipObserver, summary: Summary) -> Self {
        let (ruptures, mean_friction) = (observer.ruptures(), observer.mean_friction());
        let (slips, precursors) = observer.into_rows();
        Self { slips, precursors, ruptures, mean_friction, summary }
    }
}

/// Simulates one realisation and measures what is to be recorded. The result is a function of the first three arguments.
///
/// # Errors
/// When the simulation cannot continue, or is interrupted.
pub fn measure(
    parameters: &Parameters,
    recording: &Recording,
    solver: Solver,
    interrupt: &AtomicBool,
) -> Result<Measurements, SimulationError> {
    let mut observer = SlipObserver::new(parameters, recording);
    let summary = simulate(parameters, solver, recording.limits(interrupt), &mut observer)?;
    Ok(Measurements::new(observer, summary))
}

impl Recording {
    /// The bounds that a recording sets on a simulation.
    pub fn limits<'a>(&self, interrupt: &'a AtomicBool) -> Limits<'a> {
        Limits { end_time: self.max_time.unwrap_or(f64::INFINITY), events: self.max_events, interrupt: Some(interrupt) }
    }
}
