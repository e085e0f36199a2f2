//! Accuracy: speed against error of every solver in one run, and what happens in hard cases.
//!
//! ```text
//! breaks.rs     before chaos: break times, contact by contact
//! distance.rs   after chaos: distances of distributions and biases, with intervals
//! study.rs      every solver at every set of parameters, timed on one thread
//! hard_cases.*  parameters that break a naive code, each audited
//! cost.rs       what a computation costs
//! report.rs     tables as Parquet and JSON, figures
//! ```

pub mod breaks;
pub mod cost;
pub mod distance;
mod hard_cases;
mod report;
mod study;

pub use cost::Cost;
pub use distance::Distances;
pub use hard_cases::{HardCase, Stability, hard_cases};
pub use report::{Report, stability_report, study_report};
pub use study::{DistanceRow, Findings, MethodRow, QUANTITIES, Study};

use crate::model::{Parameters, Symbol, Value};
use crate::observe::{Measurements, Recording, measure};
use crate::run::cpu;
use crate::solver::{Ledger, Limits, Observer, Resolve, Solver, simulate, simulate_audited};
use crate::table::columns::columns;
use anyhow::{Context, Result};
use std::fmt;
use std::sync::atomic::AtomicBool;

const FIXED_STEP: &str = "fixed-step";

columns! {
    /// A solver, with its one setting.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Method {
        method: String = "", "event-driven, or how it resolves motion: grid or taylor; or fixed-step";
        setting: f64 = "", "tolerance, or dt in s";
    }
}

impl From<Solver> for Method {
    fn from(solver: Solver) -> Self {
        let (method, setting) = match solver {
            Solver::EventDriven { resolve: Resolve::Auto, tolerance } => ("event-driven", tolerance),
            Solver::EventDriven { resolve, tolerance } => (resolve.word(), tolerance),
            Solver::FixedStep { time_step } => (FIXED_STEP, time_step),
        };
        Self { method: method.to_owned(), setting }
    }
}

impl Method {
    /// The method without its setting, in words.
    pub fn name(&self) -> &str {
        match self.method.as_str() {
            "taylor" => "Taylor steps",
            FIXED_STEP => "fixed step",
            name => name,
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (setting, unit) = if self.method == FIXED_STEP { ("dt", " s") } else { ("tolerance", "") };
        write!(f, "{}, {setting} {:e}{unit}", self.name(), self.setting)
    }
}

/// The drive of a set in words, and what else differs from the defaults.
pub fn set_in_words(parameters: &Parameters) -> String {
    let modulation = parameters.modulation_period.map_or_else(
        || "Delta = 0".to_owned(),
        |period| {
            let frequency = (1e4 / period).round() / 1e4;
            format!("Delta = {:e} m, 1/T = {frequency} Hz", parameters.modulation_amplitude)
        },
    );
    let others = other_settings(parameters).map(|(key, value)| format!(", {key} = {value}"));
    format!("V0 = {:e} m/s, {modulation}{}", parameters.drive_velocity, others.collect::<String>())
}

/// Keys and values of what differs from the defaults, but for the drive and the seed.
fn other_settings(parameters: &Parameters) -> impl Iterator<Item = (&'static str, Value)> {
    let of_drive = |symbol: &Symbol| matches!(symbol, Symbol::V0 | Symbol::Delta | Symbol::T | Symbol::Seed);
    let defaults = Parameters::default();
    let settings = Symbol::ALL.into_iter().filter(move |symbol| !of_drive(symbol)).map(move |symbol| {
        let value = parameters.get(symbol);
        (value != defaults.get(symbol)).then(|| (symbol.key(), value))
    });
    settings.flatten()
}

/// One realisation of a study with one solver.
struct Realisation<'a> {
    parameters: &'a Parameters,
    solver: Solver,
}

impl Realisation<'_> {
    /// Observers end these simulations; none comes near this number of events.
    const LIMITS: Limits<'static> = Limits { end_time: f64::INFINITY, events: 1_000_000_000, interrupt: None };

    fn simulate(&self, observer: &mut dyn Observer) -> Result<()> {
        simulate(self.parameters, self.solver, Self::LIMITS, observer).with_context(|| self.name())?;
        Ok(())
    }

    fn audit(&self, observer: &mut dyn Observer) -> Result<Ledger> {
        let audited = simulate_audited(self.parameters, self.solver, Self::LIMITS, observer);
        Ok(audited.with_context(|| self.name())?.1)
    }

    /// CPU time in s, and what a sweep would measure.
    fn measure(&self, recording: &Recording) -> Result<(f64, Measurements)> {
        let never = AtomicBool::new(false);
        let (cpu_seconds, measured) = cpu::timed(|| measure(self.parameters, recording, self.solver, &never));
        Ok((cpu_seconds, measured.with_context(|| self.name())?))
    }

    fn name(&self) -> String {
        let Self { parameters, solver } = *self;
        format!("{}, seed {}, {}", set_in_words(parameters), parameters.seed, Method::from(solver))
    }
}
