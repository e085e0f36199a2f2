//! Tables of a results directory.

use crate::errors::Error;
use crate::table::Table;
use crate::watched::watched;
use arrow_array::cast::AsArray;
use arrow_array::{Array, ArrayRef, RecordBatch, UInt32Array, new_null_array};
use arrow_schema::{Field, FieldRef, Schema, SchemaRef};
use arrow_select::concat::concat_batches;
use arrow_select::take::take;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use stickslip::reduce::{BackboneBin, EdgeRow, HistogramBin, Point, SetInRounds, SetRow, renew};
use stickslip::results::controls::{CONTROL, ControlSets, SET_ID};
use stickslip::results::layout::Layout;
use stickslip::results::tables::{JOBS, JobRow, PRECURSORS, SLIPS, recorded_schema};
use stickslip::results::{Results, ResultsError};
use stickslip::table::arrow::schema;
use stickslip::table::columns::Table as TableRow;
use stickslip::table::file::Dataset;
use stickslip::table::storage::Disk;

/// The column by which tables of jobs are joined.
const JOB_ID: &str = "job_id";

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

/// A table, or its columns of these names. Those that it has not are taken from the jobs; `join` adds all of these.
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
    let known = [SLIPS, PRECURSORS, JOBS]
        .into_iter()
        .find(|known| *known == table);
    let own = match known {
        Some(known) => (known, recorded_schema(known, results.sweep().recording())),
        None if table == SetRow::NAME && results.round().is_some() => {
            (SetRow::NAME, schema::<SetInRounds>())
        }
        None => reduced_schema(table)
            .ok_or_else(|| PyValueError::new_err(format!("there is no table {table}")))?,
    };
    let wanted = Wanted::new(own, columns.as_deref(), join)?;
    let found = watched::<_, ()>(
        py,
        |stop, _| wanted.read(&results, stop),
        |()| (),
        |_| Ok(()),
    );
    Ok(found?)
}

fn reduced_schema(table: &str) -> Option<(&'static str, SchemaRef)> {
    fn of<R: TableRow>() -> (&'static str, SchemaRef) {
        (R::NAME, schema::<R>())
    }
    let all = [
        of::<SetRow>(),
        of::<EdgeRow>(),
        of::<HistogramBin>(),
        of::<BackboneBin>(),
        of::<Point>(),
    ];
    all.into_iter().find(|(name, _)| *name == table)
}

/// Columns to read.
struct Wanted {
    table: &'static str,
    /// Of the result.
    schema: SchemaRef,
    /// Those of the table itself, and those of the jobs.
    own: Vec<String>,
    of_jobs: Vec<String>,
    /// Whether the column of controls is wanted.
    has_control: bool,
}

impl Wanted {
    fn new(
        (table, own): (&'static str, SchemaRef),
        columns: Option<&[String]>,
        join: bool,
    ) -> PyResult<Self> {
        let of_jobs: Vec<FieldRef> = match table {
            SLIPS | PRECURSORS => schema::<JobRow>().fields().to_vec(),
            _ => Vec::new(),
        };
        let of_control = [SLIPS, PRECURSORS, JOBS]
            .contains(&table)
            .then(|| Arc::new(ControlSets::field()));
        let jobs = Schema::new(of_jobs.into_iter().chain(of_control).collect::<Vec<_>>());
        let is_own = |name: &str| own.field_with_name(name).is_ok();
        let others = || {
            jobs.fields()
                .iter()
                .map(|field| field.name())
                .filter(|name| !is_own(name))
        };
        let names: Vec<String> = match columns {
            Some(columns) => columns.to_vec(),
            None => own
                .fields()
                .iter()
                .map(|field| field.name().as_str())
                .chain((table == JOBS).then_some(CONTROL))
                .map(str::to_owned)
                .collect(),
        };
        let joined = others()
            .filter(|name| join && !names.contains(name))
            .cloned()
            .collect();
        let names = [names, joined].concat();
        let mut fields = Vec::new();
        for name in &names {
            let field = own
                .field_with_name(name)
                .or_else(|_| jobs.field_with_name(name));
            let field = field.map_err(|_| {
                let known: Vec<&str> = own
                    .fields()
                    .iter()
                    .map(|field| field.name())
                    .chain(others())
                    .map(String::as_str)
                    .collect();
                PyValueError::new_err(match stickslip::sweep::nearest(name, &known) {
                    Some(near) => {
                        format!("{table}: there is no column {name}; did you mean {near}?")
                    }
                    None => format!(
                        "{table}: there is no column {name}; there are {}",
                        known.join(", ")
                    ),
                })
            })?;
            fields.push(field.clone());
        }
        let (own, others): (Vec<_>, Vec<_>) = names.into_iter().partition(|name| is_own(name));
        let (of_control, of_jobs): (Vec<_>, Vec<_>) =
            others.into_iter().partition(|name| name == CONTROL);
        Ok(Self {
            table,
            schema: Arc::new(Schema::new(fields)),
            own,
            of_jobs,
            has_control: !of_control.is_empty(),
        })
    }

    fn read(&self, results: &Results<'_>, stop: &AtomicBool) -> Result<Table, Error> {
        let layout = results.layout();
        let renewed;
        let files = match self.table {
            JOBS => results.dataset(JOBS)?,
            SLIPS | PRECURSORS => {
                if !results.tables().any(|table| table == self.table) {
                    let problem = "has no precursors; set precursors = true under [record]";
                    return Err(ResultsError::refused(layout.root(), problem).into());
                }
                results.committed_files(self.table, &results.dataset(JOBS)?)?
            }
            EdgeRow::NAME if results.sweep().refinement().is_none() => {
                let problem = "has no edges: its sweep file has no [refine]";
                return Err(ResultsError::refused(layout.root(), problem).into());
            }
            _ => {
                renewed = renew(results)?;
                Dataset::new(&Disk, vec![renewed.layout().reduced_file(self.table)])
            }
        };
        let mut own = self.own.clone();
        if !self.of_jobs.is_empty() || own.is_empty() {
            own.push(JOB_ID.to_owned());
        }
        let mut controls = None;
        if self.has_control {
            controls = Some(ControlSets::of(results)?);
            if !own.iter().any(|name| name == SET_ID) {
                own.push(SET_ID.to_owned());
            }
        }
        let jobs = if self.of_jobs.is_empty() {
            None
        } else {
            Some(Jobs::read(results, &self.of_jobs, stop)?)
        };
        let mut batches = Vec::new();
        for batch in files.columns(&own) {
            interruptible(stop)?;
            let batch = batch?;
            let damaged = |problem: String| ResultsError::damaged(&batch.path, problem);
            let rows = jobs
                .as_ref()
                .map(|jobs| jobs.rows(&batch.rows))
                .transpose()
                .map_err(damaged)?;
            let column = |field: &Field| -> Result<ArrayRef, Error> {
                let name = field.name();
                let of_control = || controls.as_ref()?.column(&batch.rows);
                match (batch.rows.column_by_name(name), &jobs, &rows) {
                    (Some(column), ..) => Ok(Arc::clone(column)),
                    _ if name == CONTROL && self.has_control => of_control()
                        .ok_or_else(|| damaged(format!("there is no column {SET_ID}")).into()),
                    (None, Some(jobs), Some(rows)) if !self.own.contains(name) => {
                        jobs.take(name, rows)
                    }
                    // Programs of other versions had other columns.
                    _ if field.is_nullable() => {
                        Ok(new_null_array(field.data_type(), batch.rows.num_rows()))
                    }
                    _ => Err(damaged(format!("there is no column {name}")).into()),
                }
            };
            let columns = self.schema.fields().iter().map(|field| column(field));
            let columns = columns.collect::<Result<Vec<ArrayRef>, Error>>()?;
            batches.push(RecordBatch::try_new(
                SchemaRef::clone(&self.schema),
                columns,
            )?);
        }
        Ok(Table::new(
            self.table,
            SchemaRef::clone(&self.schema),
            batches,
        ))
    }
}

/// Some columns of the jobs, to be joined by their ids.
struct Jobs {
    columns: RecordBatch,
    rows: HashMap<String, u32>,
}

impl Jobs {
    fn read(results: &Results<'_>, columns: &[String], stop: &AtomicBool) -> Result<Self, Error> {
        let mut names = columns.to_vec();
        names.push(JOB_ID.to_owned());
        let mut batches = Vec::new();
        for batch in results.dataset(JOBS)?.columns(&names) {
            interruptible(stop)?;
            batches.push(batch?.rows);
        }
        let of_first = batches
            .first()
            .map_or_else(|| Arc::new(Schema::empty()), RecordBatch::schema);
        let batches = batches
            .into_iter()
            .map(|batch| batch.with_schema(SchemaRef::clone(&of_first)));
        let columns = concat_batches(&of_first, &batches.collect::<Result<Vec<_>, _>>()?)?;
        let ids = columns
            .column_by_name(JOB_ID)
            .map(AsArray::as_string::<i32>);
        let rows = ids
            .into_iter()
            .flatten()
            .zip(0..)
            .filter_map(|(id, row)| Some((id?.to_owned(), row)))
            .collect();
        Ok(Self { columns, rows })
    }

    /// The row of the job of each row of a batch.
    fn rows(&self, batch: &RecordBatch) -> Result<UInt32Array, String> {
        let ids = batch
            .column_by_name(JOB_ID)
            .ok_or_else(|| format!("there is no column {JOB_ID}"))?;
        let row = |id: Option<&str>| {
            let row = id.and_then(|id| self.rows.get(id)).copied();
            row.ok_or_else(|| {
                format!(
                    "job {} is not in the table of jobs",
                    id.unwrap_or("without an id")
                )
            })
        };
        ids.as_string::<i32>()
            .iter()
            .map(row)
            .collect::<Result<Vec<u32>, String>>()
            .map(UInt32Array::from)
    }

    fn take(&self, column: &str, rows: &UInt32Array) -> Result<ArrayRef, Error> {
        let column = self.columns.column_by_name(column).ok_or_else(|| {
            Error::Results(format!(
                "tables/jobs: there is no column {column}; `stickslip verify` reports what to do"
            ))
        })?;
        Ok(take(column.as_ref() as &dyn Array, rows, None)?)
    }
}

/// Ends what nobody waits for any more.
fn interruptible(stop: &AtomicBool) -> Result<(), Error> {
    if stop.load(Ordering::Relaxed) {
        Err(Error::Results("interrupted".to_owned()))
    } else {
        Ok(())
    }
}
