//! Observation: turns contact events and segments into measurements, as the model's definitions say.
//!
//! Knows no solver's inside and no file. Each observer computes one thing; a run holds those that its sweep asks for.

mod drops;
mod phase;
mod rupture;
mod sample;
mod slip;

pub use drops::Drops;
pub use phase::{OVERSHOOT, phase};
pub use rupture::{Rupture, advance_speed};
pub use sample::{AttachedMap, ContactLog, MapRow, Observers, Profile, ProfileRow, Trace, TraceRow};
pub use slip::{Modulation, Precursor, Slip, SlipObserver};

/// What a job records: how many slips, from where, and which tables.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recording {
    /// Slips to record past start-up. >= 1.
    pub slips: u64,
    /// Slips discarded as start-up. Default 5.
    pub discard: u64,
    /// Model time at which a job ends even without its slips, in s. Default: none.
    pub max_time: Option<f64>,
    /// Contact events after which a job counts as failed. Default 1e9.
    pub max_events: u64,
    /// Least size of a precursor, in breaks. Default `N_s` of the job.
    pub precursor_size: Option<u64>,
    /// Whether each precursor becomes a row of its own.
    pub precursors: bool,
    /// Least drop of the shear force that is told, in N; > 0. Default: drops are not looked for.
    pub drop_size: Option<f64>,
}

impl Default for Recording {
    fn default() -> Self {
        Self {
            slips: 40,
            discard: 5,
            max_time: None,
            max_events: 1_000_000_000,
            precursor_size: None,
            precursors: false,
            drop_size: None,
        }
    }
}
