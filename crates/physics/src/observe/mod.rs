//! Observation: turns contact events and segments into measurements, as the model's definitions say.
//!
//! Knows neither the solvers nor files. Each observer measures one thing; a run has the observers that its sweep asks
//! for.
//!
//! ```text
//! measure.rs                     one job: parameters -> measurements; recording.rs: what a sweep asks for
//! slip_observer.rs, rupture.rs   contact events -> slips and precursors (slip.rs), fronts
//! drops.rs, sampled/             shear force alone -> slips: of the model, of a trace
//! records.rs                     traces, maps, profiles and contact events of a single job
//! ```

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
