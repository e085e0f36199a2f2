//! Export: the tables of a directory as one file each, elsewhere, for other tools.
//!
//! Rows stand in the order of the plan, extensions one after another, so the bytes depend on what is done alone and not on
//! how it came to that. Every row has all swept parameters, so that no table need be joined. Nothing of the directory is
//! changed. Memory: one part, and one row group.

use crate::results::controls::{CONTROL, ControlSets, SET_ID};
use crate::results::destination::{NewFolder, refuse_stopped};
use crate::results::directory::Results;
use crate::results::layout::PartName;
use crate::results::parts::row_count;
use crate::results::tables::{self, JobRow};
use crate::table::arrow::{schema, schema_of};
use crate::table::error::ResultsError;
use crate::table::file::{Batch, Dataset};
use crate::table::formats::{Format, RowWriter};
use arrow_array::cast::AsArray;
use arrow_array::{RecordBatch, StringArray, UInt32Array, new_null_array};
use arrow_schema::{ArrowError, Field, SchemaRef};
use arrow_select::concat::concat_batches;
use arrow_select::take::take;
use serde::Serialize;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Column by which rows are joined with those of the jobs.
const JOB_ID: &str = "job_id";

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
    /// Writes the tables to a new folder, which is there as a whole or not at all. `progress` hears how many of how many
    /// parts of all tables are done.
    pub fn export(
        &self,
        path: &Path,
        format: Format,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Exported, ResultsError> {
        let folder = NewFolder::new(path)?;
        let exported = self.write_all(&folder, format, stop, progress)?;
        refuse_stopped(stop, &folder.place)?;
        folder.publish(self.layout().storage)?;
        Ok(exported)
    }

    fn write_all(
        &self,
        to: &NewFolder,
        format: Format,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(u64, u64),
    ) -> Result<Exported, ResultsError> {
        let storage = self.layout().storage;
        let mut parts: Vec<PartName> = self.parts_of(tables::JOBS)?.into_iter().collect();
        parts.sort_unstable();
        let overview = self.overview()?;
        let mut exported = Exported {
            parts: parts.len() as u64,
            parts_missing: overview.parts_missing,
            jobs_missing: overview.jobs_missing,
            jobs_spilled: overview.jobs_spilled,
            ..Exported::default()
        };
        let controls = ControlSets::of(self)?;
        let names: Vec<&str> = self.tables().collect();
        let total = (names.len() * parts.len()) as u64;
        for (number, table) in names.into_iter().enumerate() {
            let name = format!("{table}.{}", format.extension());
            let path = to.draft.path().join(&name);
            let file = storage.create(&path)?;
            let schema =
                schema_of(self.joined(&tables::recorded_schema(table, self.sweep().recording())));
            let mut writer = RowWriter::new(file, format, &schema, &self.footer_of_all())?;
            let mut rows = 0;
            for (done, &part) in parts.iter().enumerate() {
                refuse_stopped(stop, &to.place)?;
                progress((number * parts.len() + done) as u64, total);
                let copied = self.copy_part(table, part, &controls, &schema, &mut writer);
                // A part has lost what is not there.
                rows += copied.map_err(|error| match error.damage() {
                    Ok((path, problem)) => ResultsError::damaged(&path, problem),
                    Err(error) => error,
                })?;
            }
            writer.finish()?;
            if table == tables::JOBS {
                exported.jobs = rows;
            }
            let bytes = storage.length(&path)?;
            exported.files.push(ExportedFile { name, rows, bytes });
        }
        progress(total, total);
        Ok(exported)
    }

    /// The columns of a table, with those that are joined to it.
    fn joined(&self, columns: &SchemaRef) -> Vec<Field> {
        let of_jobs = schema::<JobRow>();
        let swept_keys: HashSet<String> = self
            .extensions()
            .iter()
            .flat_map(|extension| extension.sweep.swept())
            .collect();
        let is_new = |field: &&Arc<Field>| columns.field_with_name(field.name()).is_err();
        let swept = of_jobs.fields().iter().filter(is_new);
        let swept = swept.filter(|field| swept_keys.contains(field.name()));
        let all = columns.fields().iter().chain(swept);
        let all = all.map(|field| Field::clone(field));
        all.chain([ControlSets::field()]).collect()
    }

    /// Copies the rows of a part; returns their number.
    fn copy_part(
        &self,
        table: &str,
        part: PartName,
        controls: &ControlSets,
        schema: &SchemaRef,
        writer: &mut RowWriter,
    ) -> Result<u64, ResultsError> {
        let dataset = || self.dataset_of(tables::JOBS, part);
        let jobs = Jobs::read(
            dataset(),
            &self.layout().table(tables::JOBS).join(part.file()),
        )?;
        let rows = if table == tables::JOBS {
            dataset()
        } else {
            let mut file = self.file_in(&self.layout().tables(), table, part);
            file.rows = Some(row_count(dataset(), table)?);
            Dataset::of(self.layout().storage, vec![file])
        };
        let mut copied = 0;
        for batch in rows.batches() {
            let Batch { path, rows } = batch?;
            let joined = jobs.join(&rows, controls, schema);
            writer.write(&joined.map_err(ResultsError::damage_at(&path))?)?;
            copied += rows.num_rows() as u64;
        }
        Ok(copied)
    }
}

struct Jobs {
    rows: RecordBatch,
    by_id: HashMap<String, u32>,
}

impl Jobs {
    fn read(dataset: Dataset<'_>, path: &Path) -> Result<Self, ResultsError> {
        let batches = dataset
            .batches()
            .map(|batch| Ok(batch?.rows))
            .collect::<Result<Vec<_>, ResultsError>>()?;
        let first = batches.first();
        let columns = first.map_or_else(schema::<JobRow>, RecordBatch::schema);
        let rows = concat_batches(&columns, &batches).map_err(ResultsError::damage_at(path))?;
        let ids = job_ids(&rows).map_err(ResultsError::damage_at(path))?;
        let by_id = ids
            .iter()
            .zip(0..)
            .filter_map(|(id, row)| Some((id?.to_owned(), row)))
            .collect();
        Ok(Self { rows, by_id })
    }

    /// Rows with the columns of a schema: their own, those of their jobs, and whether they belong to controls.
    fn join(
        &self,
        rows: &RecordBatch,
        controls: &ControlSets,
        schema: &SchemaRef,
    ) -> Result<RecordBatch, ArrowError> {
        let job = |id: Option<&str>| id.and_then(|id| self.by_id.get(id)).copied();
        let jobs: Option<Vec<u32>> = job_ids(rows)?.iter().map(job).collect();
        let others = || ArrowError::SchemaError("it has rows of other jobs".to_owned());
        let jobs = UInt32Array::from(jobs.ok_or_else(others)?);
        let column_of = |field: &Arc<Field>| match (
            rows.column_by_name(field.name()),
            self.rows.column_by_name(field.name()),
        ) {
            (Some(column), _) => Ok(Arc::clone(column)),
            (None, None) if field.name() == CONTROL => {
                controls.column(rows).ok_or_else(|| missing(SET_ID))
            }
            (None, Some(column)) => take(column, &jobs, None),
            // Programs of other versions had other columns.
            (None, None) if field.is_nullable() => {
                Ok(new_null_array(field.data_type(), rows.num_rows()))
            }
            (None, None) => Err(missing(field.name())),
        };
        let columns = schema
            .fields()
            .iter()
            .map(column_of)
            .collect::<Result<Vec<_>, _>>()?;
        RecordBatch::try_new(Arc::clone(schema), columns)
    }
}

fn job_ids(rows: &RecordBatch) -> Result<&StringArray, ArrowError> {
    let ids = rows
        .column_by_name(JOB_ID)
        .and_then(|column| column.as_string_opt());
    ids.ok_or_else(|| missing(JOB_ID))
}

fn missing(column: &str) -> ArrowError {
    ArrowError::SchemaError(format!("there is no column {column}"))
}
