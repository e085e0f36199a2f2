//! Tables of a results directory.

use crate::errors::Error;
use crate::table::Table;
use crate::watched::watched;
use arrow_schema::{FieldRef, Fields, Schema, SchemaRef};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use stickslip::figure::Beside;
use stickslip::reduce::{
    BackboneBin, EdgeRow, HistogramBin, Point, PulseRow, SetInRounds, TriggerRow, read_sets, renew,
};
use stickslip::results::exported::{JoinedTable, with_columns};
use stickslip::results::layout::Layout;
use stickslip::results::tables::{OptionalTable, RecordedTable, gaps};
use stickslip::results::{Results, ResultsError};
use stickslip::sets::SetRow;
use stickslip::table::Table as TableRow;
use stickslip::table::arrow::{Gaps, RowBuffer, schema};
use stickslip::table::file::{Batch, Dataset};
use stickslip::table::storage::Disk;

/// Name and text of the sweep that a results directory belongs to.
#[pyfunction]
pub fn sweep_of(py: Python<'_>, directory: PathBuf) -> PyResult<(String, String)> {
    let sweep = py.detach(|| {
        let results = Results::read(&Layout::new(&Disk, &directory))?;
        Ok::<_, Error>((
            results.sweep().name().to_owned(),
            results.sweep().text().to_owned(),
        ))
    });
    Ok(sweep?)
}

/// The names of directories side by side, and in what each differs from others.
#[pyfunction]
pub fn side_by_side(
    py: Python<'_>,
    directories: Vec<PathBuf>,
    names: Vec<String>,
) -> PyResult<Vec<(String, String)>> {
    let described = py.detach(|| {
        let layouts: Vec<Layout<'_>> = directories
            .iter()
            .map(|directory| Layout::new(&Disk, directory))
            .collect();
        let renewed = layouts.iter().map(|layout| renew(&Results::read(layout)?));
        let all: Vec<Results<'_>> = renewed.collect::<anyhow::Result<_>>()?;
        let Some((first, others)) = all.split_first() else {
            return Ok(Vec::new());
        };
        let beside = Beside::read(first, others, &names)?;
        let sets = read_sets(first.layout()).collect::<Result<Vec<_>, _>>()?;
        let described = beside.described(&sets);
        let owned = described.map(|(name, settings)| (name.to_owned(), settings));
        Ok::<_, Error>(owned.collect())
    });
    Ok(described?)
}

/// Reduces the tables of a results directory.
#[pyfunction]
pub fn reduce(py: Python<'_>, directory: PathBuf) -> PyResult<()> {
    let reduced = watched::<_, ()>(
        py,
        |_, _| {
            let results = Results::read(&Layout::new(&Disk, &directory))?;
            stickslip::reduce::reduce(&results)?;
            Ok(())
        },
        |()| (),
        |_| Ok(()),
    );
    Ok(reduced?)
}

/// A table, or its columns of these names. Slips and precursors have those of the jobs, too; `join` adds them all.
#[pyfunction]
pub fn read(
    py: Python<'_>,
    directory: PathBuf,
    table: &str,
    columns: Option<Vec<String>>,
    join: bool,
) -> PyResult<Table> {
    let layout = Layout::new(&Disk, &directory);
    let results = py.detach(|| Results::read(&layout)).map_err(Error::from)?;
    let columns = columns.as_deref();
    let found = if let Some(table) = RecordedTable::from_word(table) {
        let columns = columns_of_table(&results, table, columns, join)?;
        watched::<_, ()>(
            py,
            |stop, _| read_table(&results, table, &columns, stop),
            |()| (),
            |_| Ok(()),
        )
    } else {
        let (table, all) = reduced_columns(&results, table)?;
        let columns = match columns {
            Some(names) => named(table, &all, names)?,
            None => all.to_vec(),
        };
        watched::<_, ()>(
            py,
            |_, _| read_reduced(&results, table, columns),
            |()| (),
            |_| Ok(()),
        )
    };
    Ok(found?)
}

/// The columns with these names.
fn named(table: &str, all: &[FieldRef], names: &[String]) -> PyResult<Vec<FieldRef>> {
    let unknown = |name: &str| {
        let known: Vec<&str> = all.iter().map(|field| field.name().as_str()).collect();
        let hint = match stickslip::sweep::nearest(name, &known) {
            Some(near) => format!("did you mean {near}?"),
            None => format!("there are {}", known.join(", ")),
        };
        PyValueError::new_err(format!("{table}: there is no column {name}; {hint}"))
    };
    let column = |name: &String| {
        let found = all.iter().find(|field| field.name() == name);
        found.cloned().ok_or_else(|| unknown(name))
    };
    names.iter().map(column).collect()
}

/// The columns of slips, precursors or jobs to read: by default its own, and of the jobs whether they are controls.
fn columns_of_table(
    results: &Results<'_>,
    table: RecordedTable,
    names: Option<&[String]>,
    join: bool,
) -> PyResult<Vec<FieldRef>> {
    let recorded = table.schema(results.sweep());
    let is_own = |field: &FieldRef| recorded.field_with_name(field.name()).is_ok();
    let mut all = JoinedTable::columns(results, table);
    if let Some(names) = names {
        let mut chosen = named(table.word(), &all, names)?;
        all.retain(|field| join && !is_own(field) && !chosen.contains(field));
        chosen.append(&mut all);
        return Ok(chosen);
    }
    all.retain(|field| join || is_own(field) || table == RecordedTable::Jobs);
    Ok(all)
}

fn read_table(
    results: &Results<'_>,
    table: RecordedTable,
    columns: &[FieldRef],
    stop: &AtomicBool,
) -> Result<Table, Error> {
    if !results.tables().any(|recorded| recorded == table) {
        let table = table.word();
        let problem = format!("has no {table}; set {table} = true under [record]");
        return Err(ResultsError::refused(results.layout().root(), &problem).into());
    }
    let joined = JoinedTable::new(results, table, columns);
    let mut batches = Vec::new();
    for part in results.parts_of(RecordedTable::Jobs)? {
        if stop.load(Ordering::Relaxed) {
            return Err(Error::Results("interrupted".to_owned()));
        }
        joined.visit(part, |batch| {
            batches.push(batch);
            Ok(())
        })?;
    }
    Ok(Table::new(
        table.word(),
        SchemaRef::clone(joined.schema()),
        batches,
    ))
}

/// Name and columns of a table of reduced data.
fn reduced_columns(results: &Results<'_>, table: &str) -> PyResult<(&'static str, Fields)> {
    fn of<R: TableRow>(gaps: &Gaps) -> (&'static str, Fields) {
        let rows = RowBuffer::new::<R>().with(gaps);
        (R::NAME, rows.schema().fields().clone())
    }
    let gaps = Gaps {
        left_out: Vec::new(),
        ..gaps(results.sweep())
    };
    if table == SetRow::NAME && results.round().is_some() {
        return Ok((SetRow::NAME, schema::<SetInRounds>().fields().clone()));
    }
    if let Some(optional) = OptionalTable::from_word(table) {
        return Ok(match optional {
            OptionalTable::Edges => of::<EdgeRow>(&gaps),
            OptionalTable::Triggers => of::<TriggerRow>(&gaps),
            OptionalTable::Pulses => of::<PulseRow>(&gaps),
        });
    }
    let all = [
        of::<SetRow>(&gaps),
        of::<HistogramBin>(&gaps),
        of::<BackboneBin>(&gaps),
        of::<Point>(&gaps),
    ];
    let found = all.into_iter().find(|(name, _)| *name == table);
    found.ok_or_else(|| PyValueError::new_err(format!("there is no table {table}")))
}

fn read_reduced(
    results: &Results<'_>,
    table: &'static str,
    columns: Vec<FieldRef>,
) -> Result<Table, Error> {
    let optional = OptionalTable::from_word(table);
    if let Some(optional) = optional.filter(|optional| !results.has(*optional)) {
        let needed = optional.needs();
        let problem = format!("has no {table}: its sweep file has no {needed}");
        return Err(ResultsError::refused(results.layout().root(), problem).into());
    }
    let names: Vec<String> = columns.iter().map(|field| field.name().clone()).collect();
    let schema = Arc::new(Schema::new(columns));
    let renewed = renew(results)?;
    let file = renewed.layout().reduced_file(table);
    let mut batches = Vec::new();
    for batch in Dataset::new(&Disk, vec![file]).columns(&names) {
        let Batch { path, rows } = batch?;
        let rows = with_columns(&rows, &schema, |_| None);
        batches.push(rows.map_err(ResultsError::damage_at(&path))?);
    }
    Ok(Table::new(table, schema, batches))
}
