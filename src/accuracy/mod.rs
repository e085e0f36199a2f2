//! Accuracy: speed against error of every solver in one run.
//!
//! ```text
//! comparison.rs break times, contact by contact; biases of mean and standard deviation, with intervals
//! study.rs      every solver at every set of parameters, timed on one thread
//! verdict.rs    what that says of a sweep's solver
//! files.rs      everything as JSON, figures
//! ```

pub mod comparison;
mod files;
mod study;
mod verdict;

pub use files::{check, processor, to_json, write};
pub use study::Study;
pub use verdict::{shows_bias, too_few_slips, verdict};

use self::comparison::{Bias, BreakErrors};
use crate::model::{Parameters, Selected, Selection, Symbol, Value};
use crate::results::tables::DriveAndSeed;
use crate::solver::{Method, Resolve, Solver};
use crate::table::columns::{Column, columns};
use std::fmt;

columns! {
    /// A solver, by the main setting of its method.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SolverColumns {
        method: String = "", "grid or taylor, by which the event-driven method resolves motion; else the method";
        setting: f64 = "", "tolerance, or dt in s";
    }
}

impl From<Solver> for SolverColumns {
    fn from(solver: Solver) -> Self {
        let method = match solver.resolve {
            Resolve::Auto => solver.method.word(),
            resolve => resolve.word(),
        };
        Self {
            method: method.to_owned(),
            setting: solver.setting(),
        }
    }
}

impl SolverColumns {
    /// The method without its setting, in words.
    pub fn name(&self) -> String {
        match self.method.as_str() {
            "taylor" => "Taylor steps".to_owned(),
            word => word.replace('-', " "),
        }
    }
}

impl fmt::Display for SolverColumns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let method = Method::from_word(&self.method).unwrap_or(Method::EventDriven);
        let Column { name, unit, .. } = method.settings()[0].description().column;
        let setting = format!("{}, {name} {:e} {unit}", self.name(), self.setting);
        f.write_str(setting.trim_end())
    }
}

columns! {
    /// What a solver costs, on one thread.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Cost {
        per_simulated_second as "cpu_per_simulated_second": f64 = "",
            "CPU seconds per simulated second, one thread";
        per_slip as "cpu_per_slip": f64 = "s", "CPU time per slip";
        per_step as "cpu_per_step": f64 = "s", "CPU time per step";
        steps_per_slip: f64 = "", "steps per slip";
        timed_slips: u64 = "",
            "slips that were timed; 0 if the cost per slip is extrapolated from that of a step";
    }
}

impl Cost {
    /// Whether the cost per slip follows from that of a step.
    pub const fn is_extrapolated(&self) -> bool {
        self.timed_slips == 0
    }
}

#[derive(Clone, Debug, PartialEq)]
pub struct DriveAlone;

impl Selection for DriveAlone {
    const SYMBOLS: &'static [Symbol] = &[Symbol::V0, Symbol::Delta, Symbol::T];
}

columns! {
    /// One solver at one set of parameters. Costs are those of its cheapest realisation per step: other work on the
    /// machine can only add to them. Errors of break times are left out where they would take too long.
    #[derive(Clone, Debug, PartialEq)]
    pub struct MethodRow {
        parameters: Selected<DriveAlone>;
        case: String = "", "the drive, and what else differs from the defaults";
        solver: SolverColumns;
        cost: Cost;
        break_times: BreakErrors;
        unbalanced: Option<f64> = "",
            "largest share of the work of the drive that does not balance, over a few jobs; of the sweep's solver alone";
    }
}

columns! {
    /// A quantity of the slips of one solver at one set of parameters, beside that of the reference ensemble.
    #[derive(Clone, Debug, PartialEq)]
    pub struct BiasRow {
        parameters: Selected<DriveAlone>;
        case: String = "", "the drive, and what else differs from the defaults";
        solver: SolverColumns;
        quantity: String = "", "interval, phase, drop, peak_force, duration or front_speed";
        slips: u64 = "", "size of the sample";
        reference_slips: u64 = "", "size of the reference sample";
        mean: f64 = "", "mean";
        reference_mean: f64 = "", "mean of the reference";
        deviation: f64 = "", "standard deviation";
        reference_deviation: f64 = "", "standard deviation of the reference";
        bias: Bias;
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Set by set, solver by solver.
    pub methods: Vec<MethodRow>,
    pub biases: Vec<BiasRow>,
}

impl Findings {
    /// The bias of a quantity, for the solver and set of a row.
    pub fn bias_of(&self, row: &MethodRow, quantity: &str) -> Option<&BiasRow> {
        self.biases.iter().find(|other| {
            other.quantity == quantity
                && other.parameters == row.parameters
                && other.solver == row.solver
        })
    }
}

/// The drive of a set in words, and what else differs from the defaults.
pub fn set_in_words(parameters: &Parameters) -> String {
    let velocity = parameters.drive_velocity;
    let amplitude = parameters.modulation_amplitude;
    let modulation = match parameters.frequency() {
        None => "Delta = 0".to_owned(),
        Some(frequency) => format!("Delta = {amplitude:e} m, 1/T = {frequency} Hz"),
    };
    let others = others_in_words(parameters);
    format!("V0 = {velocity:e} m/s, {modulation}{others}")
}

fn others_in_words(parameters: &Parameters) -> String {
    let others = other_settings(parameters).map(|(key, value)| format!(", {key} = {value}"));
    others.collect()
}

/// Keys and values of what differs from the defaults, but for the drive and the seed.
fn other_settings(parameters: &Parameters) -> impl Iterator<Item = (&'static str, Value)> {
    let defaults = Parameters::default();
    let others = |symbol: &Symbol| !DriveAndSeed::SYMBOLS.contains(symbol);
    let symbols = Symbol::ALL.into_iter().filter(others);
    let settings = symbols.map(|symbol| (symbol, parameters.get(symbol)));
    let changed = settings.filter(move |(symbol, value)| *value != defaults.get(*symbol));
    changed.map(|(symbol, value)| (symbol.key(), value))
}
