//! The module `stickslip._stickslip`: the part of the Python package `stickslip` that is written in Rust.
//!
//! ```text
//! keys.rs       keys of sweep files, from the descriptions of the library
//! simulate.rs   one job -> tables
//! measured.rs   measured slips -> a results directory
//! run.rs        a sweep -> a results directory, with progress
//! results.rs    a results directory -> tables
//! table.rs      Arrow tables, handed on through the C interface of Arrow
//! watched.rs    work without the interpreter's lock, which Ctrl-C ends
//! errors.rs     errors as exceptions
//! ```
//!
//! Words, defaults and plots are Python's, in `python/stickslip`. Contract: nothing here panics, or crashes the
//! interpreter.

#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments come from Python by value"
)]

mod errors;
mod keys;
mod measured;
mod results;
mod run;
mod simulate;
mod table;
mod watched;

use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Least phase at which slips can begin at some eta, in rad (Eq. 2); `None` for eta < 1.
#[pyfunction]
fn minimum_phase(eta: f64) -> Option<f64> {
    stickslip::model::theory::minimum_phase(eta)
}

/// Does what a command line asks, for the program `stickslip` at a path; returns the exit code.
#[pyfunction]
fn main(program: PathBuf, arguments: Vec<OsString>) -> u8 {
    stickslip::cli::main(Some(&program), arguments)
}

#[pymodule]
mod _stickslip {
    #[pymodule_export]
    use super::errors::{ResultsError, SimulationError, SweepError};
    #[pymodule_export]
    use super::keys::keys;
    #[pymodule_export]
    use super::measured::measured;
    #[pymodule_export]
    use super::results::{read, reduce, side_by_side, sweep_of};
    #[pymodule_export]
    use super::run::run;
    #[pymodule_export]
    use super::simulate::{simulate, sweep_text};
    #[pymodule_export]
    use super::table::Table;
    #[pymodule_export]
    use super::{main, minimum_phase};
    #[pymodule_export]
    const MAX_THREADS: usize = stickslip::run::limits::MAX_THREADS;
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
