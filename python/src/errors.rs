//! Errors as exceptions, with the words of the command line.

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use stickslip::run::limits::ThreadsError;
use stickslip::single_job::RequestError;

create_exception!(
    stickslip,
    SweepError,
    PyValueError,
    "A mistake in a sweep, or in the keys of a simulation."
);
create_exception!(
    stickslip,
    ResultsError,
    PyRuntimeError,
    "A results directory that cannot be used, read or written."
);
create_exception!(
    stickslip,
    SimulationError,
    PyRuntimeError,
    "A simulation that cannot continue."
);

/// Why something ended.
pub enum Error {
    Sweep(String),
    Results(String),
    Simulation(String),
    /// An exception that a callback or Ctrl-C raised.
    Raised(PyErr),
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Sweep(message) => SweepError::new_err(message),
            Error::Results(message) => ResultsError::new_err(message),
            Error::Simulation(message) => SimulationError::new_err(message),
            Error::Raised(raised) => raised,
        }
    }
}

impl From<PyErr> for Error {
    fn from(raised: PyErr) -> Self {
        Self::Raised(raised)
    }
}

impl From<stickslip::sweep::SweepError> for Error {
    fn from(error: stickslip::sweep::SweepError) -> Self {
        Self::Sweep(error.to_string())
    }
}

impl From<RequestError> for Error {
    fn from(error: RequestError) -> Self {
        Self::Sweep(error.to_string())
    }
}

impl From<ThreadsError> for Error {
    fn from(error: ThreadsError) -> Self {
        Self::Results(error.to_string())
    }
}

impl From<stickslip::solver::SimulationError> for Error {
    fn from(error: stickslip::solver::SimulationError) -> Self {
        Self::Simulation(error.to_string())
    }
}

macro_rules! of_results {
    ($($error:ty),*) => {
        $(impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::Results(error.to_string())
            }
        })*
    };
}

of_results!(
    stickslip::results::ResultsError,
    stickslip::table::storage::StorageError,
    arrow_schema::ArrowError,
    anyhow::Error
);
