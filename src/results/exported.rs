//! Export: the tables of a directory as one file each, elsewhere, for other tools.
//!
//! Rows stand in the order of the plan, extensions one after another, so the bytes depend on what is done alone and not
//! on how it came to that. Every row has all swept parameters, so that no table need be joined; reduced tables have
//! their own columns and order. Nothing of the directory is changed. Memory: one part, and one row group.
//!
//! Exports and the Python module read joined tables, part by part. They have columns that their files lack: those of
//! the jobs of their rows, and whether a row belongs to a control.

use crate::model::Selected;
use crate::results::destination::{NewFolder, refuse_stopped};
use crate::results::directory::Results;
use crate::results::parts::row_count;
use crate::results::tables::{All, JobRow, OptionalTable, RecordedTable};
use crate::sweep::PartName;
use crate::table::arrow::{DESCRIPTION, UNIT, schema, schema_of};
use crate::table::columns::columns;
use crate::table::error::ResultsError;
use crate::table::file::{Batch, Dataset};
use crate::table::formats::{Format, RowWriter};
use arrow_array::cast::AsArray;
use arrow_array::{ArrayRef, BooleanArray, RecordBatch, StringArray, UInt32Array, new_null_array};
use arrow_schema::{ArrowError, FieldRef, SchemaRef};
use arrow_select::concat::concat_batches;
use arrow_select::take::take;
use serde::Serialize;
use std::collections::{HashMap, HashSet};
use std::iter;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

#[derive(Clone, Debug, Default, Serialize)]
pub struct Exported {
    pub files: Vec<ExportedFile>,
    pub parts: u64,
    pub jobs: u64,
    /// Parts that are not done, and their jobs, without and with a result so far; they are left out.
    pub parts_missing: u64,
    pub jobs_missing: u64,
    pub jobs_spilled: u64,
}

#[derive(Clone, Debug, Serialize)]
pub struct ExportedFile {
    pub name: String,
    pub rows: u64,
    pub bytes: u64,
}

impl Results<'_> {
    /// Writes the tables, with reduced sets, edges and triggers, to a new folder, all or none. `progress` gets the number of
    /// finished parts of tables, and of all.
    pub fn export(
        &self,
        to: NewFolder,
        format: Format,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Exported, ResultsError> {
        let storage = self.layout().storage;
        let parts = self.parts_of(RecordedTable::Jobs)?;
        let overview = self.overview()?;
        let mut exported = Exported {
            parts: parts.len() as u64,
            parts_missing: overview.parts_missing,
            jobs_missing: overview.jobs_missing,
            jobs_spilled: overview.jobs_spilled,
            ..Exported::default()
        };
        let total = self.tables().count() as u64 * exported.parts;
        let mut done = 0;
        let mut columns = vec!["table,column,unit,meaning\n".to_owned()];
        let joined = |table| JoinedTable::new(self, table, &self.exported_columns(table));
        let joined = self
            .tables()
            .map(|table| (table.word(), Some(joined(table))));
        let optional = self.optional_tables().map(OptionalTable::word);
        let reduced = iter::once("sets")
            .chain(optional)
            .map(|table| (table, None));
        for (table, joined) in joined.chain(reduced) {
            let name = format!("{table}.{}", format.word());
            let path = to.draft.path().join(&name);
            let reduced = Dataset::new(storage, vec![self.layout().reduced_file(table)]);
            let schema = match &joined {
                Some(joined) => SchemaRef::clone(joined.schema()),
                None => reduced.schema()?,
            };
            for field in schema.fields() {
                let [unit, meaning] = [UNIT, DESCRIPTION].map(|key| &field.metadata()[key]);
                columns.push(format!("{table},{},{unit},\"{meaning}\"\n", field.name()));
            }
            let file = storage.create(&path)?;
            let mut writer =
                RowWriter::new(path.clone(), file, format, &schema, &self.footer_of_all())?;
            let mut rows = 0;
            let mut write = |batch: RecordBatch| {
                rows += batch.num_rows() as u64;
                writer.write(&batch)
            };
            match joined {
                None => reduced.batches().try_for_each(|batch| write(batch?.rows))?,
                Some(joined) => {
                    for &part in &parts {
                        refuse_stopped(stop, &to.place)?;
                        progress(done, total);
                        joined.visit(part, &mut write)?;
                        done += 1;
                    }
                }
            }
            writer.finish()?;
            if table == RecordedTable::Jobs.word() {
                exported.jobs = rows;
            }
            let bytes = storage.length(&path)?;
            exported.files.push(ExportedFile { name, rows, bytes });
        }
        if format == Format::Csv {
            // It has no place for units.
            let mut file = storage.create(&to.draft.path().join("columns.csv"))?;
            file.write(columns.concat().as_bytes())?;
            file.sync()?;
        }
        progress(total, total);
        refuse_stopped(stop, &to.place)?;
        to.publish(storage)?;
        Ok(exported)
    }

    /// The columns of a table, all that were swept, and whether a row belongs to a control.
    fn exported_columns(&self, table: RecordedTable) -> Vec<FieldRef> {
        let own = table.schema(self.sweep());
        let extensions = self.extensions().iter();
        let swept: HashSet<&str> = extensions
            .flat_map(|extension| extension.sweep.swept())
            .collect();
        let mut columns = JoinedTable::columns(self, table);
        columns.retain(|field| {
            let name = field.name();
            name == CONTROL || swept.contains(&**name) || own.field_with_name(name).is_ok()
        });
        columns
    }
}

/// The column by which rows are joined with those of the jobs.
const JOB_ID: &str = "job_id";
/// The column that no file has: it depends on all sweeps of the directory.
pub const CONTROL: &str = "control";

columns! {
    struct OfSet {
        is_control as "control": bool = "", "whether its set was run as a control alone (`control = true`)";
    }
}

/// Columns of a table: its own, and those of the jobs of its rows.
pub struct JoinedTable<'a> {
    results: &'a Results<'a>,
    table: RecordedTable,
    schema: SchemaRef,
    /// Columns of the table that are read.
    own: Vec<String>,
    /// Columns of the jobs that are read.
    of_jobs: Vec<String>,
    /// Whether `control` is wanted and may be true.
    has_controls: bool,
}

impl<'a> JoinedTable<'a> {
    /// All columns that a table can have: its own, those of the jobs, and `control`.
    pub fn columns(results: &Results<'_>, table: RecordedTable) -> Vec<FieldRef> {
        let own = table.schema(results.sweep());
        let joined = [
            RecordedTable::Jobs.schema(results.sweep()),
            schema::<OfSet>(),
        ];
        let fields = joined.iter().flat_map(|schema| schema.fields());
        let others = fields.filter(|field| own.field_with_name(field.name()).is_err());
        own.fields().iter().chain(others).cloned().collect()
    }

    pub fn new(results: &'a Results<'a>, table: RecordedTable, columns: &[FieldRef]) -> Self {
        let recorded = table.schema(results.sweep());
        let names = columns.iter().map(|field| field.name().clone());
        let (mut own, mut of_jobs): (Vec<_>, Vec<_>) =
            names.partition(|name| recorded.field_with_name(name).is_ok());
        let wants_control = of_jobs.iter().any(|name| name == CONTROL);
        of_jobs.retain(|name| name != CONTROL);
        let has_controls =
            wants_control && (results.plan().sweeps()).any(|sweep| sweep.recording().control);
        if has_controls {
            let parameters = schema::<Selected<All>>();
            of_jobs.extend(parameters.fields().iter().map(|field| field.name().clone()));
        }
        own.push(JOB_ID.to_owned());
        Self {
            results,
            table,
            schema: schema_of(columns),
            own,
            of_jobs,
            has_controls,
        }
    }

    pub const fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// Passes the rows of a part on, batch by batch. A part without one of its files is damaged.
    pub fn visit(
        &self,
        part: PartName,
        mut visit: impl FnMut(RecordBatch) -> Result<(), ResultsError>,
    ) -> Result<(), ResultsError> {
        let unread = |error: ResultsError| match error.damage() {
            Ok((path, problem)) => ResultsError::damaged(&path, problem),
            Err(error) => error,
        };
        let layout = self.results.layout();
        let jobs = self.read_jobs(part).map_err(unread)?;
        let mut file = (self.results).file_in(&layout.tables(), self.table, part);
        if self.table != RecordedTable::Jobs {
            let jobs = self.results.dataset_of(RecordedTable::Jobs, part);
            file.rows = row_count(jobs, self.table).map_err(unread)?;
        }
        for batch in Dataset::of(layout.storage, vec![file]).columns(&self.own) {
            let Batch { path, rows } = batch.map_err(unread)?;
            let joined = self.join(&rows, jobs.as_ref());
            visit(joined.map_err(ResultsError::damage_at(&path))?)?;
        }
        Ok(())
    }

    /// The columns of the jobs of a part; `None` if no row needs them.
    fn read_jobs(&self, part: PartName) -> Result<Option<JobRows>, ResultsError> {
        if self.of_jobs.is_empty() {
            return Ok(None);
        }
        let mut names = self.of_jobs.clone();
        names.push(JOB_ID.to_owned());
        let mut batches = Vec::new();
        let mut controls = Vec::new();
        for batch in self
            .results
            .dataset_of(RecordedTable::Jobs, part)
            .columns(&names)
        {
            let batch = batch?;
            if self.has_controls {
                let jobs: Vec<Selected<All>> = batch.rows_of()?;
                let plan = self.results.plan();
                controls.extend(jobs.iter().map(|job| plan.is_control(&job.all)));
            }
            batches.push(batch.rows);
        }
        let columns = batches
            .first()
            .map_or_else(schema::<JobRow>, RecordBatch::schema);
        let jobs = concat_batches(&columns, &batches)
            .and_then(|columns| JobRows::new(columns, controls.into()));
        let path =
            (self.results).file_in(&self.results.layout().tables(), RecordedTable::Jobs, part);
        jobs.map(Some).map_err(ResultsError::damage_at(&path.path))
    }

    fn join(&self, rows: &RecordBatch, jobs: Option<&JobRows>) -> Result<RecordBatch, ArrowError> {
        let places = jobs.map(|jobs| jobs.places(rows)).transpose()?;
        let placed_jobs = jobs.zip(places.as_ref());
        with_columns(rows, &self.schema, |name| {
            if name == CONTROL && !self.has_controls {
                let controls = BooleanArray::from(vec![false; rows.num_rows()]);
                return Some(Ok(Arc::new(controls)));
            }
            let (jobs, places) = placed_jobs?;
            if name == CONTROL {
                return Some(take(&jobs.controls, places, None));
            }
            let column = jobs.columns.column_by_name(name)?;
            Some(take(column, places, None))
        })
    }
}

/// Rows with the columns of a schema: their own, or others by name; null for a column that another version did not
/// have.
pub fn with_columns(
    rows: &RecordBatch,
    schema: &SchemaRef,
    other: impl Fn(&str) -> Option<Result<ArrayRef, ArrowError>>,
) -> Result<RecordBatch, ArrowError> {
    let column = |field: &FieldRef| {
        let name = field.name();
        if let Some(column) = rows.column_by_name(name) {
            return Ok(Arc::clone(column));
        }
        match other(name) {
            Some(column) => column,
            None if field.is_nullable() => Ok(new_null_array(field.data_type(), rows.num_rows())),
            None => Err(missing(name)),
        }
    };
    let columns = schema.fields().iter().map(column);
    RecordBatch::try_new(SchemaRef::clone(schema), columns.collect::<Result<_, _>>()?)
}

struct JobRows {
    columns: RecordBatch,
    /// Whether each is a control; empty if no sweep has controls.
    controls: BooleanArray,
    by_id: HashMap<String, u32>,
}

impl JobRows {
    fn new(columns: RecordBatch, controls: BooleanArray) -> Result<Self, ArrowError> {
        let numbered = ids(&columns)?.iter().zip(0..);
        let by_id = numbered
            .filter_map(|(id, place)| Some((id?.to_owned(), place)))
            .collect();
        Ok(Self {
            columns,
            controls,
            by_id,
        })
    }

    /// Where the job of each row stands.
    fn places(&self, rows: &RecordBatch) -> Result<UInt32Array, ArrowError> {
        let place = |id: Option<&str>| self.by_id.get(id?).copied();
        let places: Option<Vec<u32>> = ids(rows)?.iter().map(place).collect();
        let others = || ArrowError::SchemaError("it has rows of other jobs".to_owned());
        places.map(UInt32Array::from).ok_or_else(others)
    }
}

fn ids(rows: &RecordBatch) -> Result<&StringArray, ArrowError> {
    let ids = rows
        .column_by_name(JOB_ID)
        .and_then(|column| column.as_string_opt());
    ids.ok_or_else(|| missing(JOB_ID))
}

fn missing(column: &str) -> ArrowError {
    ArrowError::SchemaError(format!("there is no column {column}"))
}
