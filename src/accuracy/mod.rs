//! Accuracy: speed against error of every solver in one run, and what happens in hard cases.
//!
//! ```text
//! cpu.rs                      what a computation costs
//! hard_cases.rs               parameters that break a naive code
//! ```

pub mod cpu;
mod hard_cases;

pub use hard_cases::{HardCase, Stability, hard_cases};

use crate::solver::Solver;

/// A solver and its setting in words.
#[must_use]
pub fn described(solver: Solver) -> String {
    match solver {
        Solver::EventDriven { tolerance } => format!("event-driven, tolerance {tolerance:e}"),
        Solver::FixedStep { time_step } => format!("fixed step, dt {time_step:e} s"),
    }
}
