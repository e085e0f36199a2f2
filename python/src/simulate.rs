//! One job.

use crate::errors::Error;
use crate::keys::{hint, section};
use crate::table::Table;
use crate::watched::watched;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stickslip::observe::ContactRow;
use stickslip::results::tables::{
    All, DriveAndSeed, JobRecord, JobRow, PrecursorRow, SlipRow, gaps, label,
};
use stickslip::single_job::{self, JobRecords, RecordRequest, only_job};
use stickslip::sweep::{KeyChange, Sweep};
use stickslip::table::columns::{Row, Value};

/// The text of a sweep with one job, from keys and their values as TOML.
#[pyfunction]
pub fn sweep_text(keys: Vec<(String, String)>) -> PyResult<String> {
    let mut changes = Vec::new();
    let mut unknown = Vec::new();
    for (key, value) in keys {
        match section(&key) {
            Some(section) => changes.push(KeyChange {
                section,
                key,
                value,
            }),
            None => unknown.push(format!(
                "in the keys: {key} = {value}: unknown key; {}",
                hint(&key)
            )),
        }
    }
    if unknown.is_empty() {
        Ok(single_job::sweep_text(&changes))
    } else {
        Err(Error::Sweep(unknown.join("\n")).into())
    }
}

/// Reads a sweep: a file, or a text that was made of something.
pub fn read_sweep(file: Option<&Path>, text: &str, source: &str) -> Result<Sweep, Error> {
    let sweep = match file {
        Some(file) => Sweep::from_file(file),
        None => Sweep::parse_made(text, source),
    };
    Ok(sweep?.computed()?)
}

/// A row of the jobs table, the text of the sweep, warnings, and tables by name.
type Simulated<'py> = (
    Bound<'py, PyDict>,
    String,
    Vec<String>,
    BTreeMap<&'static str, Table>,
);

/// Simulates the only job of a sweep.
#[pyfunction]
#[pyo3(signature = (*, file, text, source, sample, trace, map, profile, contacts))]
#[expect(
    clippy::too_many_arguments,
    clippy::fn_params_excessive_bools,
    reason = "called by keywords alone"
)]
pub fn simulate<'py>(
    py: Python<'py>,
    file: Option<PathBuf>,
    text: &str,
    source: &str,
    sample: f64,
    trace: bool,
    map: bool,
    profile: bool,
    contacts: bool,
) -> PyResult<Simulated<'py>> {
    let sweep = read_sweep(file.as_deref(), text, source)?;
    let parameters = only_job(&sweep).map_err(Error::from)?.parameters;
    let request = RecordRequest {
        sample,
        trace,
        map,
        profile,
        contacts,
    };
    request
        .check(&parameters, sweep.recording())
        .map_err(Error::from)?;
    let (row, tables) = watched::<_, ()>(
        py,
        |stop, _| {
            let (measured, records) = single_job::simulate(&sweep, &parameters, request, stop)?;
            let names = label::<DriveAndSeed>(&sweep, &parameters);
            let row: JobRow = (
                label::<All>(&sweep, &parameters),
                JobRecord::new(Ok(&measured)),
            );
            let JobRecords {
                trace: samples,
                map: cells,
                profile: blocks,
                contacts: events,
            } = records;
            let mut tables = BTreeMap::new();
            let slips = measured
                .slips
                .iter()
                .map(|slip| -> SlipRow<'_> { (Cow::Borrowed(&names), Cow::Borrowed(slip)) });
            tables.insert("slips", Table::with(&gaps(&sweep), slips)?);
            if sweep.recording().precursors {
                let rows = measured
                    .precursors
                    .iter()
                    .map(|precursor| -> PrecursorRow<'_> {
                        (Cow::Borrowed(&names), Cow::Borrowed(precursor))
                    });
                tables.insert("precursors", Table::of_rows(rows)?);
            }
            if trace {
                tables.insert("trace", Table::of_rows(samples.into_iter())?);
            }
            if map {
                tables.insert("map", Table::of_rows(cells.into_iter())?);
            }
            if profile {
                tables.insert("profile", Table::of_rows(blocks.into_iter())?);
            }
            if contacts {
                tables.insert(
                    "contacts",
                    Table::of_rows(events.iter().map(ContactRow::from))?,
                );
            }
            Ok((row, tables))
        },
        |()| (),
        |_| Ok(()),
    )?;
    Ok((
        as_dict(py, &row)?,
        sweep.text().to_owned(),
        sweep.warnings(),
        tables,
    ))
}

/// A row as a dict, by the names of the columns; `None` where a value is missing.
fn as_dict<'py, R: Row>(py: Python<'py>, row: &R) -> PyResult<Bound<'py, PyDict>> {
    let columns = R::columns();
    let dict = PyDict::new(py);
    let mut written = Ok(());
    row.cells(&mut |cell| {
        let Some(column) = columns.get(dict.len()) else {
            return;
        };
        let name = column.name.as_ref();
        let set = match cell {
            Value::Null => dict.set_item(name, py.None()),
            Value::Real(real) => dict.set_item(name, real),
            Value::Count(count) => dict.set_item(name, count),
            Value::Flag(flag) => dict.set_item(name, flag),
            Value::Text(text) => dict.set_item(name, text),
        };
        written = std::mem::replace(&mut written, Ok(())).and(set);
    });
    written.map(|()| dict)
}
