//! What can be set: the keys of a sweep file, from the descriptions that the library has of them.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use stickslip::model::{Description, Parameters, Symbol, Value};
use stickslip::observe::{Recording, RecordingKey};

/// Sections of a sweep file.
pub const MODEL: &str = "model";
pub const RECORD: &str = "record";
pub const SOLVER: &str = "solver";

/// Keys that stand for others, and those of the solver: section, key, unit, meaning, what is allowed.
const OTHERS: [(&str, &str, &str, &str, &str); 6] = [
    (MODEL, "eta", "", "2 pi Delta / (T V0), in place of T", "a number > 0"),
    (MODEL, "frequency", "Hz", "1/T, in place of T", "a number > 0, in Hz"),
    (SOLVER, "method", "", "solver", "\"event-driven\" or \"fixed-step\""),
    (SOLVER, "tolerance", "", "tolerance of the event-driven solver, relative to fs/k", "a number"),
    (SOLVER, "resolve", "", "how the event-driven solver resolves motion", "\"auto\", \"grid\" or \"taylor\""),
    (SOLVER, "dt", "s", "step of the fixed-step solver", "a number > 0, in s"),
];

/// The section of a key; that of the key which was probably meant, or the model, for an unknown one.
pub fn section(key: &str) -> &'static str {
    let sections: Vec<(&str, &'static str)> = (Symbol::ALL.into_iter().map(|symbol| (symbol.key(), MODEL)))
        .chain(RecordingKey::ALL.into_iter().map(|record| (record.key(), RECORD)))
        .chain(OTHERS.map(|(section, other, ..)| (other, section)))
        .collect();
    let known: Vec<&str> = sections.iter().map(|(key, _)| *key).collect();
    let exact = known.contains(&key).then_some(key);
    let meant = exact.or_else(|| stickslip::sweep::nearest(key, &known));
    sections.iter().find(|(key, _)| Some(*key) == meant).map_or(MODEL, |(_, section)| section)
}

/// Every key of a simulation: section, unit, meaning, what is allowed, and default (`None`: not set).
#[pyfunction]
pub fn keys(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let keys = PyDict::new(py);
    let (parameters, recording) = (Parameters::default(), Recording::default());
    let model = Symbol::ALL.map(|symbol| (MODEL, symbol.description(), parameters.get(symbol)));
    let record = RecordingKey::ALL.map(|key| (RECORD, key.description(), recording.get(key)));
    for (section, field, default) in model.into_iter().chain(record) {
        let Description { key, unit, meaning, .. } = field;
        keys.set_item(key, (section, unit, meaning, field.requirement(), object(py, default)?))?;
    }
    for (section, key, unit, meaning, allowed) in OTHERS {
        keys.set_item(key, (section, unit, meaning, allowed, py.None()))?;
    }
    Ok(keys)
}

/// A value as Python has it.
pub fn object(py: Python<'_>, value: Value) -> PyResult<Bound<'_, PyAny>> {
    match value {
        Value::Count(count) => Ok(count.into_pyobject(py)?.into_any()),
        Value::Real(real) => Ok(real.into_pyobject(py)?.into_any()),
        Value::Flag(flag) => Ok(flag.into_pyobject(py)?.to_owned().into_any()),
        Value::BreakOn(rule) => Ok(rule.word().into_pyobject(py)?.into_any()),
        Value::Absent => Ok(py.None().into_bound(py)),
    }
}
