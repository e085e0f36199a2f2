//! Observation: turns contact events and segments into measurements, as the model's definitions say.
//!
//! Knows neither the solvers nor files. Each observer measures one thing; a run has the observers that its sweep asks
//! for.

mod drops;
mod measure;
mod recording;
mod records;
mod rupture;
mod sampled;
mod slip;
mod slip_observer;

pub use drops::Drops;
pub use measure::{Averages, MakesSlips, Measurements, Regime, measure};
pub use recording::{Recording, RecordingKey};
pub use records::{
    AttachedMap, ContactLog, ContactRow, MapRow, Observers, Profile, ProfileRow, Trace, TraceRow,
};
pub use sampled::{Count, Counts, Finder, Pass, SampledSlip, Samples, Survey, TraceDrive};
pub use slip::{Energies, Modulation, OVERSHOOT, Precursor, Slip, phase};
pub use slip_observer::SlipObserver;
