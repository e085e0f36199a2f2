//! The keys of a sweep file, from their descriptions in the library.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use stickslip::model::{Parameters, Symbol, Value};
use stickslip::observe::{Recording, RecordingKey};
use stickslip::solver::SolverKey;

/// Sections of a sweep file.
const MODEL: &str = "model";
const RECORD: &str = "record";
const SOLVER: &str = "solver";

/// Keys in place of others: key, meaning, what is allowed.
const OTHERS: [(&str, &str, &str); 2] = [
    ("eta", "2 pi Delta / (T V0), in place of T", "a number > 0"),
    ("frequency", "1/T, in place of T", "a number > 0, in Hz"),
];

/// Every key, with its section.
fn sections() -> impl Iterator<Item = (&'static str, &'static str)> {
    (Symbol::ALL.into_iter().map(|symbol| (symbol.key(), MODEL)))
        .chain(
            RecordingKey::ALL
                .into_iter()
                .map(|record| (record.key(), RECORD)),
        )
        .chain(OTHERS.map(|(key, ..)| (key, MODEL)))
        .chain(SolverKey::ALL.map(|key| (key.key(), SOLVER)))
}

/// The section of a key.
pub fn section(key: &str) -> Option<&'static str> {
    sections()
        .find(|(known, _)| *known == key)
        .map(|(_, section)| section)
}

/// The known key that is nearest to an unknown key, or all.
pub fn hint(key: &str) -> String {
    let known: Vec<&str> = sections().map(|(key, _)| key).collect();
    stickslip::sweep::hint(key, &known)
}

/// Every key of a simulation: its meaning, what is allowed, and its default (`None`: not set).
#[pyfunction]
pub fn keys(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let keys = PyDict::new(py);
    let parameters = Parameters::default();
    let recording = Recording::default();
    let model = Symbol::ALL.map(|symbol| (symbol.description(), parameters.get(symbol)));
    let record = RecordingKey::ALL.map(|key| (key.description(), recording.get(key)));
    for (field, default) in model.into_iter().chain(record) {
        keys.set_item(
            &field.name,
            (field.meaning, field.requirement(), object(py, default)?),
        )?;
    }
    for (key, meaning, allowed) in OTHERS {
        keys.set_item(key, (meaning, allowed, py.None()))?;
    }
    for key in SolverKey::ALL {
        let field = key.description();
        keys.set_item(&field.name, (field.meaning, field.requirement(), py.None()))?;
    }
    Ok(keys)
}

/// A value as Python has it.
fn object(py: Python<'_>, value: Value) -> PyResult<Bound<'_, PyAny>> {
    match value {
        Value::Count(count) => Ok(count.into_pyobject(py)?.into_any()),
        Value::Real(real) => Ok(real.into_pyobject(py)?.into_any()),
        Value::Flag(flag) => Ok(flag.into_pyobject(py)?.to_owned().into_any()),
        Value::Text(word) => Ok(word.into_pyobject(py)?.into_any()),
        Value::Null => Ok(py.None().into_bound(py)),
    }
}
