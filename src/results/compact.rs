//! Compaction: the files of many parts become few large ones, by putting them one after the other in plan order.
//!
//! `PARTS_PER_FILE` consecutive parts of an extension go into one file of each table, which is named after them.
//! Parts that are missing, or have failed jobs that may be run again, are left out, so the file ends before them and
//! the next begins after them. Contract: names and bytes are a function of which parts are done and whole, not of how
//! it came to that: threads, shards, kills, or earlier compactions. Memory: one row group.
//!
//! New table folders are built aside and take the place of the old ones by one exchange of two folder names, for all
//! tables at once: who lists a table sees all rows once, before and after. Names hold checksums, so a reader that has
//! listed the old folder and opens the new one finds the same bytes or no file, never a mixture. The old folders stay as
//! they are until the next compaction, or for `GRACE` at least: a reader may have one open, and would find it empty. A
//! kill at any step leaves the old tables or the new ones.

use crate::results::error::ResultsError;
use crate::results::events::RunEvent;
use crate::results::handle::Results;
use crate::results::layout::{COMPACTION, Layout, REPLACED, TableFile};
use crate::results::tables::{self, JobRow, PrecursorRow, SlipRow};
use crate::results::verify::Remedy;
use crate::sweep::Part;
use crate::table::columns::Table;
use crate::table::file::{Dataset, TableWriter};
use crate::table::storage::StorageError;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Duration;

/// Parts of a compacted file at most: some 2 million rows of slips or jobs, 16 row groups.
const PARTS_PER_FILE: u64 = 512;
/// How long the tables that were replaced stay, unless the next compaction comes first.
pub(crate) const GRACE: Duration = Duration::from_mins(1);

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Compacted {
    pub changed: bool,
    /// Parts in the compacted files.
    pub parts: u64,
    pub jobs: u64,
    pub files: u64,
    pub bytes: u64,
    /// Parts with failed jobs, which keep their own files.
    pub failed_parts: u64,
}

/// Consecutive parts that make one file of each table.
struct Chunk {
    extension: usize,
    parts: RangeInclusive<u64>,
    jobs: u64,
}

impl Chunk {
    const fn begin(&self) -> (usize, u64) {
        (self.extension, *self.parts.start())
    }

    fn goes_on_with(&self, part: &Part) -> bool {
        (self.extension, self.parts.end() + 1) == (part.extension, part.index)
    }

    /// Whether a file holds these parts, compacted.
    fn is(&self, file: &TableFile) -> bool {
        file.is_compacted() && (file.extension, file.parts()) == (self.extension, self.parts.clone())
    }
}

/// Files of a table, by extension and first part.
type TableFiles = BTreeMap<(usize, u64), TableFile>;

/// Which files a compaction makes, and which it leaves alone.
#[derive(Default)]
struct CompactionPlan {
    chunks: Vec<Chunk>,
    /// Parts with failed jobs, by extension and number.
    failed: Vec<(usize, u64)>,
}

impl Results<'_> {
    /// Compacts the parts that are done and have no failed jobs.
    pub fn compact(&self) -> Result<Compacted, ResultsError> {
        self.compact_by(PARTS_PER_FILE)
    }

    pub(crate) fn compact_by(&self, parts_per_file: u64) -> Result<Compacted, ResultsError> {
        self.exclusively(|| self.compact_alone(parts_per_file))
    }

    /// Compacts a directory that nobody else changes.
    pub(crate) fn compact_alone(&self, parts_per_file: u64) -> Result<Compacted, ResultsError> {
        // It may have been extended before it was ours alone.
        let (results, verification) = Self::examined(self.layout())?;
        results.refuse_links()?;
        if let Some(problem) = verification.problems.into_iter().find(|problem| problem.remedy != Remedy::Reduce) {
            return Err(ResultsError::damaged(&problem.path, problem.problem));
        }
        let plan = results.plan_compaction(parts_per_file)?;
        let mut there = results.files_by_part(tables::JOBS)?;
        there.retain(|_, file| file.is_compacted());
        let is_there = |chunk: &Chunk| there.get(&chunk.begin()).is_some_and(|file| chunk.is(file));
        let changed = there.len() != plan.chunks.len() || !plan.chunks.iter().all(is_there);
        if changed {
            let staging = self.layout().staging(COMPACTION);
            results.replace_tables(&plan, &staging).inspect_err(|_| {
                // What stays is removed by the next who has the directory alone.
                let _ = self.layout().storage.remove_folder(&staging);
            })?;
        }
        Ok(results.report_compaction(&plan, changed)?)
    }

    /// Goes through the plan for runs of parts that can be compacted.
    fn plan_compaction(&self, parts_per_file: u64) -> Result<CompactionPlan, ResultsError> {
        let done = self.done_parts()?;
        let mut plan = CompactionPlan::default();
        for part in self.plan().parts() {
            let Some(unfinished) = self.unfinished(&done, &part)? else { continue };
            let jobs = part.jobs.len() as u64;
            match plan.chunks.last_mut() {
                _ if !unfinished.is_empty() => plan.failed.push((part.extension, part.index)),
                Some(chunk) if chunk.goes_on_with(&part) && !part.index.is_multiple_of(parts_per_file) => {
                    chunk.parts = *chunk.parts.start()..=part.index;
                    chunk.jobs += jobs;
                }
                _ => plan.chunks.push(Chunk { extension: part.extension, parts: part.index..=part.index, jobs }),
            }
        }
        Ok(plan)
    }

    fn files_by_part(&self, table: &str) -> Result<TableFiles, StorageError> {
        Ok(self.layout().table_files(table)?.map(|file| ((file.extension, file.first), file)).collect())
    }

    /// Refuses folders that are elsewhere: the exchange would put one that is here in the place of the link.
    fn refuse_links(&self) -> Result<(), ResultsError> {
        let folders = self.tables().map(|table| self.layout().table(table));
        for folder in std::iter::once(self.layout().tables()).chain(folders) {
            if self.layout().storage.is_link(&folder)? {
                let problem = "is a symbolic link, which a compaction would replace; put the folder itself here, or link \
                               the whole results directory instead";
                return Err(ResultsError::refused(&folder, problem));
            }
        }
        Ok(())
    }

    /// Builds the new tables, and puts them in the place of the old ones.
    fn replace_tables(&self, plan: &CompactionPlan, staging: &Path) -> Result<(), ResultsError> {
        let (layout, storage) = (self.layout(), self.layout().storage);
        let replaced = layout.staging(REPLACED);
        // The tables before the last ones: no more than one generation stays.
        storage.remove_folder(&replaced)?;
        layout.ensure_folder(staging)?;
        self.probe_exchange(staging)?;
        let files = self.build(plan, staging)?;
        self.check_place()?;
        // Under this name already, so that a kill after the exchange leaves the old tables under it.
        storage.rename(staging, &replaced)?;
        self.exchange(&layout.tables(), &Layout::new(storage, &replaced).tables()).inspect_err(|_| {
            let _ = storage.rename(&replaced, staging);
        })?;
        for folder in [layout.root(), &replaced, &layout.staging("")] {
            storage.sync_folder(folder)?;
        }
        Ok(self.begin_log()?.write(&RunEvent::Compacted { files })?)
    }

    /// Builds the new tables in a staging folder; returns the names of the files of the jobs table that are compacted.
    fn build(&self, plan: &CompactionPlan, staging: &Path) -> Result<Vec<String>, ResultsError> {
        let storage = self.layout().storage;
        let new = Layout::new(storage, staging);
        self.concatenate::<SlipRow<'_>>(plan, &new)?;
        if self.sweep().recording().precursors {
            self.concatenate::<PrecursorRow<'_>>(plan, &new)?;
        }
        let files = self.concatenate::<JobRow>(plan, &new)?;
        for folder in [&new.tables(), staging] {
            storage.sync_folder(folder)?;
        }
        Ok(files)
    }

    /// Tries the exchange on two empty folders before anything is built.
    fn probe_exchange(&self, staging: &Path) -> Result<(), ResultsError> {
        let ([one, other], storage) = (["one", "other"].map(|name| staging.join(name)), self.layout().storage);
        for folder in [&one, &other] {
            storage.create_folder(folder)?;
        }
        self.exchange(&one, &other)
    }

    /// Exchanges two folders, or says what to do where that is impossible.
    fn exchange(&self, one: &Path, other: &Path) -> Result<(), ResultsError> {
        let why = match self.layout().storage.exchange(one, other) {
            Err(error) if error.kind() == ErrorKind::Unsupported => {
                "this file system cannot exchange two folders in one step"
            }
            Err(error) if matches!(error.kind(), ErrorKind::CrossesDevices | ErrorKind::ResourceBusy) => {
                "it cannot be exchanged with a folder in run/staging in one step: it is a mount point, or in a lower \
                 layer of an overlay"
            }
            exchanged => return Ok(exchanged?),
        };
        let problem = format!(
            "{why}. Readers would see unfinished tables, so nothing was changed. Copy the whole results directory, for \
             instance to a local disk, and compact the copy"
        );
        Err(ResultsError::refused(one, problem))
    }

    /// Makes the files of one table; returns the names of those that are compacted.
    fn concatenate<R: Table>(&self, plan: &CompactionPlan, new: &Layout<'_>) -> Result<Vec<String>, ResultsError> {
        let (storage, name) = (self.layout().storage, R::NAME);
        let (old_folder, new_folder) = (self.layout().table(name), new.table(name));
        let old = self.files_by_part(name)?;
        storage.ensure_folder_below(new.root(), &new_folder)?;
        let keep = |file: &TableFile| {
            let file = file.to_string();
            storage.link(&old_folder.join(&file), &new_folder.join(&file)).map(|()| file)
        };
        for file in plan.failed.iter().filter_map(|part| old.get(part)) {
            keep(file)?;
        }
        let mut names = Vec::new();
        for chunk in &plan.chunks {
            // Files of earlier compactions lie within one chunk, as parts never leave them one by one.
            let sources = old.range(chunk.begin()..=(chunk.extension, *chunk.parts.end()));
            let sources: Vec<&TableFile> = sources.map(|(_, file)| file).collect();
            if let [file] = sources[..]
                && chunk.is(file)
            {
                names.push(keep(file)?);
                continue;
            }
            let staged = new_folder.join("new");
            let mut writer = TableWriter::<R>::new(storage.create(&staged)?, &self.footer(chunk.extension))?;
            let mut rows = 0;
            let paths = sources.iter().map(|file| old_folder.join(file.to_string())).collect();
            for batch in Dataset::new(storage, paths).batches() {
                let batch = batch?;
                rows += batch.rows.num_rows() as u64;
                writer.copy(&batch, 0..batch.rows.num_rows())?;
            }
            if name == tables::JOBS && rows != chunk.jobs {
                let problem = format!("{rows} jobs were read where the plan has {}", chunk.jobs);
                return Err(ResultsError::damaged(&old_folder, problem));
            }
            let file = TableFile::compacted(chunk.extension, &chunk.parts, &writer.finish()?).to_string();
            storage.rename(&staged, &new_folder.join(&file))?;
            names.push(file);
        }
        storage.sync_folder(&new_folder)?;
        Ok(names)
    }

    fn report_compaction(&self, plan: &CompactionPlan, changed: bool) -> Result<Compacted, StorageError> {
        let mut compacted = Compacted { changed, failed_parts: plan.failed.len() as u64, ..Compacted::default() };
        for chunk in &plan.chunks {
            compacted.parts += chunk.parts.end() - chunk.parts.start() + 1;
            compacted.jobs += chunk.jobs;
        }
        for table in self.tables() {
            for file in self.layout().table_files(table)?.filter(TableFile::is_compacted) {
                let path = self.layout().table(table).join(file.to_string());
                compacted.bytes += self.layout().storage.length(&path)?;
                compacted.files += 1;
            }
        }
        Ok(compacted)
    }
}
