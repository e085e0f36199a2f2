//! Export: the tables of a directory as one file each, elsewhere, for other tools.
//!
//! Rows stand in the order of the plan, extensions one after another, so the bytes depend on what is done alone and not on
//! how it came to that. Every row has all swept parameters, so that no table need be joined. Nothing of the directory is
//! changed. Memory: one part, and one row group.

use crate::results::destination::{NewFolder, refuse_stopped};
use crate::results::directory::Results;
use crate::results::joined::{CONTROL, JoinedTable};
use crate::results::tables::{self, recorded_schema};
use crate::table::error::ResultsError;
use crate::table::formats::{Format, RowWriter};
use arrow_schema::FieldRef;
use serde::Serialize;
use std::collections::HashSet;
use std::path::Path;
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
    /// Writes the tables to a new folder, all or none. `progress` gets the number of finished parts of tables, and of all.
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
        let parts = self.parts_of(tables::JOBS)?;
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
        for table in self.tables() {
            let name = format!("{table}.{}", format.word());
            let path = to.draft.path().join(&name);
            let joined = JoinedTable::new(self, table, &self.exported_columns(table));
            let file = storage.create(&path)?;
            let mut writer = RowWriter::new(file, format, joined.schema(), &self.footer_of_all())?;
            let mut rows = 0;
            for &part in &parts {
                refuse_stopped(stop, &to.place)?;
                progress(done, total);
                joined.visit(part, |batch| {
                    rows += batch.num_rows() as u64;
                    writer.write(&batch)
                })?;
                done += 1;
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

    /// The columns of a table, all that were swept, and whether a row belongs to a control.
    fn exported_columns(&self, table: &str) -> Vec<FieldRef> {
        let own = recorded_schema(table, self.sweep().recording());
        let extensions = self.extensions().iter();
        let swept: HashSet<String> = extensions
            .flat_map(|extension| extension.sweep.swept())
            .collect();
        let mut columns = JoinedTable::columns(self, table);
        columns.retain(|field| {
            let name = field.name();
            name == CONTROL || swept.contains(name) || own.field_with_name(name).is_ok()
        });
        columns
    }
}
