//! Sweep files: strict TOML in, a [`Sweep`] that can run out.
//!
//! Whatever is unknown, impossible, contradictory or without effect is refused with file, line, key, value and the way
//! out. Contract: every job of a sweep that was read has valid parameters (see `check.rs`), and there is at least one.

use super::check::{self, Places};
use super::filter::Condition;
use super::job::Identity;
use super::plan::Sweep;
use super::quantity::Quantity;
use super::read_axes;
use super::source::{Entry, Section, Source, SweepError, nearest};
use crate::model::{Parameters, Symbol};
use crate::observe::Recording;
use crate::solver::{Solver, TOLERANCES};
use std::path::Path;

/// Longest name of a sweep, in characters: it becomes a folder.
const LONGEST_NAME: usize = 100;
/// Largest count in `[record]`: what a double, and so every reader of a table, holds exactly.
const MOST_COUNT: u64 = (1 << 53) - 1;
/// Solvers by name; the first is meant where none is named.
const METHODS: [(&str, SolverReader); 2] = [("event-driven", read_event_driven), ("fixed-step", read_fixed_step)];

type SolverReader = fn(&Section<'_>) -> Result<Solver, SweepError>;

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
        let base = read_section(&file, "model", "[model]", |model| read_model(model, &mut places))?;
        let axes = read_section(&file, "axes", "[axes]", read_axes::read)?;
        let axes = check::without_conflicts(axes, &mut places)?;
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
        (1..=LONGEST_NAME).contains(&name.len()) && name.chars().all(characters) && !name.starts_with('-')
    };
    let name = entry.word().filter(allowed).map(str::to_owned);
    name.ok_or_else(|| {
        entry.must_be(&format!("1 to {LONGEST_NAME} letters, digits, _ and - in quotes, not with - in front"))
    })
}

fn read_model(model: &Section<'_>, places: &mut Places<'_>) -> Result<Parameters, SweepError> {
    let keys = Symbol::ALL.map(Symbol::key);
    let mut parameters = Parameters::default();
    for entry in model.entries() {
        let symbol = Symbol::from_key(entry.key).ok_or_else(|| entry.unknown(model.title, &keys))?;
        let value = read_axes::read_value(&entry, Quantity::Parameter(symbol))?;
        parameters.set(symbol, value).map_err(|_| entry.must_be(symbol.description().allowed))?;
        places.model(symbol, entry.at);
    }
    Ok(parameters)
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
    record.only(&["slips", "discard", "max_time", "max_events", "precursor_size", "precursors", "drop_size"])?;
    let default = Recording::default();
    let count = |key: &str, least| record.entry(key).map(|entry| entry.count(least, MOST_COUNT)).transpose();
    let positive = |key: &str, unit| record.entry(key).map(|entry| entry.positive(unit)).transpose();
    Ok(Recording {
        slips: count("slips", 1)?.unwrap_or(default.slips),
        discard: count("discard", 0)?.unwrap_or(default.discard),
        max_time: positive("max_time", "s")?.or(default.max_time),
        max_events: count("max_events", 1)?.unwrap_or(default.max_events),
        precursor_size: count("precursor_size", 1)?.or(default.precursor_size),
        precursors: record.entry("precursors").map_or(Ok(default.precursors), |entry| entry.flag())?,
        drop_size: positive("drop_size", "N")?.or(default.drop_size),
    })
}

fn read_solver(solver: &Section<'_>) -> Result<Solver, SweepError> {
    let Some(entry) = solver.entry("method") else {
        return METHODS[0].1(solver);
    };
    let names = METHODS.map(|(name, _)| name);
    let method = entry.word().ok_or_else(|| entry.must_be(&format!("one of \"{}\"", names.join("\", \""))))?;
    match METHODS.into_iter().find(|(name, _)| *name == method) {
        Some((_, read)) => read(solver),
        None => Err(entry.refuse(format!("unknown method; {}", nearest(method, &names)))),
    }
}

fn read_event_driven(solver: &Section<'_>) -> Result<Solver, SweepError> {
    solver.only(&["method", "tolerance"])?;
    let tolerance = match solver.entry("tolerance") {
        None => return Ok(Solver::default()),
        Some(entry) => match entry.number() {
            Some(crate::model::Value::Real(tolerance)) if TOLERANCES.contains(&tolerance) => tolerance,
            _ => {
                let (least, most) = (TOLERANCES.start(), TOLERANCES.end());
                return Err(entry.must_be(&format!("a number from {least:e} to {most:e}, relative to fs/k")));
            }
        },
    };
    Ok(Solver::EventDriven { tolerance })
}

fn read_fixed_step(solver: &Section<'_>) -> Result<Solver, SweepError> {
    solver.only(&["method", "dt"])?;
    let time_step = solver.required("dt", "the fixed step in s, such as dt = 1e-6")?.positive("s")?;
    Ok(Solver::FixedStep { time_step })
}
