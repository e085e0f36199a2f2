//! Sweep files: strict TOML in, a valid [`Sweep`] out.
//!
//! Whatever is unknown, impossible, contradictory or without effect is refused with file, line, key, value and the way
//! out. Contract: every job of a sweep that was read has valid parameters (see `check.rs`), and there is at least one.

use super::axes::{Axis, Column};
use super::check::{self, Places};
use super::filter::Condition;
use super::grid::Sweep;
use super::job::Identity;
use super::quantity::Quantity;
use super::read_axes;
use super::source::{Entry, Section, Source, SweepError};
use crate::model::{Parameters, Value};
use crate::observe::{Recording, RecordingKey};
use crate::solver::{Resolve, Solver, TOLERANCES};
use std::path::Path;

/// Longest name of a sweep, in characters: it becomes a folder.
const MAX_NAME: usize = 100;

impl Sweep {
    /// Reads a sweep file.
    ///
    /// # Errors
    /// When the file cannot be read, or as [`Sweep::parse`].
    pub fn from_file(path: &Path) -> Result<Self, SweepError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| SweepError::Unreadable { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads the text of a sweep file; the path is for messages only.
    ///
    /// # Errors
    /// Names the line, key and value of the first thing that is not allowed, and what is.
    pub fn parse(text: &str, path: &Path) -> Result<Self, SweepError> {
        let source = Source { path, text };
        let table = source.table()?;
        let file = Section { source, title: "the file", at: 0, table: &table };
        file.only(&["name", "where", "model", "axes", "record", "solver"])?;
        let name = read_name(&file.required("name", "it becomes a folder, such as name = \"fig3\"")?)?;
        let mut places = Places::new(source);
        let (base, period) = read_section(&file, "model", "[model]", |model| read_model(model, &mut places))?;
        let axes = places.axes(read_section(&file, "axes", "[axes]", read_axes::read)?)?;
        let axes = period.into_iter().chain(axes).collect();
        let conditions = file.entry("where").map_or(Ok(Vec::new()), |entry| read_conditions(&entry))?;
        let recording = read_section(&file, "record", "[record]", read_recording)?;
        let solver = read_section(&file, "solver", "[solver]", read_solver)?;
        let identity = Identity::new(solver, &recording);
        let sweep = Self { name, text: text.to_owned(), base, axes, conditions, recording, solver, identity };
        check::whole(&sweep, &file, &places)?;
        Ok(sweep)
    }
}

/// Reads a table of the file, or takes the default if there is none.
fn read_section<T: Default>(
    file: &Section<'_>,
    key: &str,
    title: &'static str,
    read: impl FnOnce(&Section<'_>) -> Result<T, SweepError>,
) -> Result<T, SweepError> {
    match file.entry(key) {
        None => Ok(T::default()),
        Some(entry) => read(&entry.section(title).ok_or_else(|| entry.must_be(&format!("a table {title}")))?),
    }
}

fn read_name(entry: &Entry<'_>) -> Result<String, SweepError> {
    let allowed = |name: &&str| {
        let characters = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        (1..=MAX_NAME).contains(&name.len()) && name.chars().all(characters) && !name.starts_with('-')
    };
    let name = entry.word().filter(allowed).map(str::to_owned);
    name.ok_or_else(|| {
        entry.must_be(&format!("1 to {MAX_NAME} letters, digits, _ and - in quotes, not with - in front"))
    })
}

/// Reads the parameters, and η or the frequency as an axis of one value.
fn read_model(model: &Section<'_>, places: &mut Places<'_>) -> Result<(Parameters, Option<Axis>), SweepError> {
    let keys: Vec<&str> = Quantity::all().map(Quantity::key).collect();
    let (mut parameters, mut period) = (Parameters::default(), None);
    for entry in model.entries() {
        let quantity = Quantity::from_key(entry.key).ok_or_else(|| entry.unknown(model.title, &keys))?;
        let value = read_axes::read_value(&entry, quantity)?;
        places.model(quantity, entry.at)?;
        match quantity {
            Quantity::Parameter(symbol) => {
                parameters.put(symbol, value).ok_or_else(|| entry.must_be(symbol.description().allowed))?;
            }
            Quantity::Eta | Quantity::Frequency => {
                period = Axis::table(vec![Column { quantity, values: vec![value] }]).ok();
            }
        }
    }
    Ok((parameters, period))
}

fn read_conditions(entry: &Entry<'_>) -> Result<Vec<Condition>, SweepError> {
    entry
        .list()
        .unwrap_or_else(|| vec![*entry])
        .iter()
        .map(|entry| {
            let text = entry.word().ok_or_else(|| {
                entry.must_be("a condition in quotes, or a list of them, such as where = \"frequency < 500\"")
            })?;
            Condition::parse(text).map_err(|error| entry.refuse(error.to_string()))
        })
        .collect()
}

fn read_recording(record: &Section<'_>) -> Result<Recording, SweepError> {
    let keys = RecordingKey::ALL.map(RecordingKey::key);
    let mut recording = Recording::default();
    for entry in record.entries() {
        let key = RecordingKey::from_key(entry.key).ok_or_else(|| entry.unknown(record.title, &keys))?;
        let value = entry.value().and_then(|value| key.checked(value));
        value.and_then(|value| recording.put(key, value)).ok_or_else(|| entry.must_be(key.description().allowed))?;
    }
    Ok(recording)
}

fn read_solver(solver: &Section<'_>) -> Result<Solver, SweepError> {
    let method = solver.entry("method");
    match method.map_or(Some("event-driven"), |method| method.word()) {
        Some("event-driven") => {
            solver.only(&["method", "tolerance", "resolve"])?;
            let Solver::EventDriven { mut tolerance, mut resolve } = Solver::default() else {
                unreachable!("the default is event-driven")
            };
            if let Some(entry) = solver.entry("tolerance") {
                tolerance = match entry.value() {
                    Some(Value::Real(tolerance)) if TOLERANCES.contains(&tolerance) => tolerance,
                    _ => {
                        let (min, max) = (TOLERANCES.start(), TOLERANCES.end());
                        return Err(entry.must_be(&format!("a number from {min:e} to {max:e}, relative to fs/k")));
                    }
                };
            }
            if let Some(entry) = solver.entry("resolve") {
                resolve = entry
                    .word()
                    .and_then(Resolve::from_word)
                    .ok_or_else(|| entry.must_be("\"auto\", \"grid\" or \"taylor\""))?;
            }
            Ok(Solver::EventDriven { tolerance, resolve })
        }
        Some("fixed-step") => {
            solver.only(&["method", "dt"])?;
            let time_step = solver.required("dt", "the fixed step in s, such as dt = 1e-6")?.positive("s")?;
            Ok(Solver::FixedStep { time_step })
        }
        _ => Err(solver.required("method", "")?.must_be("\"event-driven\" or \"fixed-step\"")),
    }
}
