//! From parameters to measurements: one job, simulated and observed; its averages over time, and the regime that they
//! show.

use super::{Precursor, Recording, Slip, SlipObserver};
use crate::model::Parameters;
use crate::solver::{
    Limits, Observer, SimulationError, Solver, Summary, simulate, simulate_audited,
};
use crate::value::words;
use std::borrow::Cow;
use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What a job measures as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Averages {
    /// The time that they are over, in s.
    pub time: f64,
    /// Time average of the shear force, in N.
    pub friction: f64,
    /// Time average of the fraction of contacts that are attached.
    pub attached_fraction: f64,
    /// Share of the time within slips.
    pub slip_share: f64,
}

words! {
    /// How a slider moves, by the share of time within slips.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Regime {
        /// It sticks for most of the time.
        StickSlip = "stick-slip",
        /// It slips for most of the time.
        Mixed = "mixed",
        Sliding = "sliding",
    }
}

impl Regime {
    /// Least share of time within slips of the mixed regime, and of sliding.
    pub const MIN_SHARES: [f64; 2] = [0.5, 0.95];

    /// The regime at a share of time within slips.
    pub fn at(slip_share: f64) -> Self {
        let [mixed, sliding] = Self::MIN_SHARES;
        if slip_share < mixed {
            Self::StickSlip
        } else if slip_share < sliding {
            Self::Mixed
        } else {
            Self::Sliding
        }
    }
}

/// Slips that need not be held: each is made from what is known of it, in a third of the memory.
pub trait MakesSlips: Debug + Send + Sync {
    fn count(&self) -> usize;

    /// The slip at a place, from 0.
    fn slip(&self, place: usize) -> Slip;
}

impl PartialEq for dyn MakesSlips {
    fn eq(&self, other: &Self) -> bool {
        let mut places = 0..self.count();
        self.count() == other.count() && places.all(|place| self.slip(place) == other.slip(place))
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Onsets of the slips of start-up, in s.
    pub start_up: Vec<f64>,
    /// Slips past start-up, in order.
    pub slips: Vec<Slip>,
    /// Slips that follow them and are made when they are written.
    pub made: Option<Arc<dyn MakesSlips>>,
    /// Their precursors, in order; empty if not recorded.
    pub precursors: Vec<Precursor>,
    /// Ruptures of any size, start-up included.
    pub ruptures: u64,
    /// Averages over time; `None` if there was nothing to average over.
    pub averages: Option<Averages>,
    /// Time since the last onset when the job gave up, in s; `None` if it did not, or before a slip.
    pub running_interval: Option<f64>,
    /// Whether it ended since no slip came for too long.
    pub has_given_up: bool,
    /// How the solver ended and what it did.
    pub summary: Summary,
}

impl Measurements {
    /// How the slider moved; `None` without averages.
    pub fn regime(&self) -> Option<Regime> {
        self.averages
            .map(|averages| Regime::at(averages.slip_share))
    }

    /// All slips past start-up, in order.
    pub fn all_slips(&self) -> impl Iterator<Item = Cow<'_, Slip>> {
        let made = self.made.iter().flat_map(|made| {
            let slip = |place| Cow::Owned(made.slip(place));
            (0..made.count()).map(slip)
        });
        self.slips.iter().map(Cow::Borrowed).chain(made)
    }

    pub fn slip_count(&self) -> u64 {
        let made = self.made.as_ref().map_or(0, |made| made.count());
        (self.slips.len() + made) as u64
    }
}

/// Simulates one realisation and measures what is to be recorded. The result is a function of the first three
/// arguments.
pub fn measure(
    parameters: &Parameters,
    recording: &Recording,
    solver: Solver,
    interrupt: &AtomicBool,
) -> Result<Measurements, SimulationError> {
    let mut observer = SlipObserver::new(parameters, recording);
    let summary = recording.simulate(parameters, solver, interrupt, &mut observer)?;
    Ok(observer.into_measurements(summary))
}

impl Recording {
    /// Simulates one realisation within the bounds of the recording, with a ledger if it asks for energies.
    pub fn simulate(
        &self,
        parameters: &Parameters,
        solver: Solver,
        interrupt: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Result<Summary, SimulationError> {
        let limits = Limits {
            end_time: self.max_time.unwrap_or(f64::INFINITY),
            events: self.max_events,
            interrupt: Some(interrupt),
        };
        if self.energies {
            Ok(simulate_audited(parameters, solver, limits, observer)?.0)
        } else {
            simulate(parameters, solver, limits, observer)
        }
    }
}
