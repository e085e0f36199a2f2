//! Parts: consecutive jobs of the plan whose rows are committed together, in the plan's order.
//!
//! A part has one file in each table. The one in `jobs` comes last, so a part is done exactly if that is there, or if its
//! rows were compacted.

use crate::observe::Measurements;
use crate::results::commit::{Commit, create_folder};
use crate::results::layout::{Layout, is_compacted, part_file};
use crate::results::manifest::Directory;
use crate::results::tables::{self, Drive, JobOutcome, JobRecord, JobRow, Label, PrecursorRow, SlipRow, relabel};
use crate::sweep::{Part, Sweep};
use crate::table::columns::{Table, columns};
use crate::table::file::{Batch, DatasetError, Footer, Reader, TableWriter, files, read_rows};
use crate::table::storage::{Storage, StorageError};
use arrow_array::Array;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What a job of a part ended with: its measurements, or why it failed.
pub type Outcome = Result<Measurements, String>;

/// What every row says about job number `position` of a part.
#[must_use]
pub fn label(sweep: &Sweep, part: &Part, position: usize) -> Label<Drive> {
    tables::label(sweep, &part.jobs[position].parameters)
}

/// Positions of the jobs of a part that failed; `None` if the part is not done.
///
/// # Errors
/// When its file in `jobs` cannot be read, or has other jobs than the part.
pub fn failed_jobs(
    storage: &dyn Storage,
    directory: &Directory,
    part: &Part,
) -> Result<Option<Vec<usize>>, DatasetError> {
    Ok(failures(storage, directory, part)?.map(|failed| failed.into_keys().collect()))
}

/// Positions of the jobs of a part that failed, with their reasons; `None` if the part is not done.
///
/// # Errors
/// When its file in `jobs` cannot be read, or has other jobs than the part.
pub fn failures(
    storage: &dyn Storage,
    directory: &Directory,
    part: &Part,
) -> Result<Option<BTreeMap<usize, String>>, DatasetError> {
    let compaction = directory.compaction();
    if compaction.holds(part.epoch, part.index) {
        return Ok(Some(compaction.failures(part.epoch, part.index).cloned().unwrap_or_default()));
    }
    if !is_done(storage, directory, part)? {
        return Ok(None);
    }
    let path = jobs_file(directory.layout(), part);
    let (mut failed, mut rows) = (BTreeMap::new(), 0);
    for batch in read_rows::<OutcomeRow>(storage, vec![path.clone()]) {
        for row in batch? {
            if row.outcome == JobOutcome::Failed {
                failed.insert(rows, row.reason.unwrap_or_default());
            }
            rows += 1;
        }
    }
    if rows == part.jobs.len() {
        Ok(Some(failed))
    } else {
        Err(DatasetError::damaged(&path)(format!("{rows} jobs where the plan has {}", part.jobs.len())))
    }
}

columns! {
    /// How a job ended, as a row of the jobs table says.
    struct OutcomeRow {
        outcome: JobOutcome;
        reason: Option<String>;
    }
}

/// Whether a part is done.
///
/// # Errors
/// When that cannot be looked up.
pub fn is_done(storage: &dyn Storage, directory: &Directory, part: &Part) -> Result<bool, StorageError> {
    if directory.compaction().holds(part.epoch, part.index) {
        return Ok(true);
    }
    let path = jobs_file(directory.layout(), part);
    storage.exists(&path).map_err(StorageError::at("look up", &path))
}

/// Files of a table that count beside these of `jobs`: compacted ones, and those of parts that are done. A run killed in
/// between leaves the slips of a part without its jobs.
///
/// # Errors
/// As [`files`].
pub fn committed_files(
    storage: &dyn Storage,
    layout: &Layout,
    table: &str,
    jobs: &[PathBuf],
) -> Result<Vec<PathBuf>, DatasetError> {
    let done: HashSet<_> = jobs.iter().filter_map(|path| path.file_name()).collect();
    let counts = |path: &PathBuf| {
        path.file_name().is_some_and(|name| done.contains(name) || name.to_str().is_some_and(is_compacted))
    };
    Ok(files(storage, &layout.table(table))?.into_iter().filter(counts).collect())
}

fn jobs_file(layout: &Layout, part: &Part) -> PathBuf {
    layout.table(tables::JOBS).join(part_file(part))
}

/// Commits a part: the outcomes of its jobs by position. Jobs without one keep the rows that they have.
///
/// # Errors
/// When a file cannot be written or put in its place, or rows that are to be kept cannot be read. The part then counts as
/// before, or as done, but never as half done.
pub fn commit(
    storage: &dyn Storage,
    directory: &Directory,
    staging: &Path,
    part: &Part,
    outcomes: &BTreeMap<usize, Outcome>,
) -> Result<(), DatasetError> {
    let sweep = &directory.sweeps()[part.epoch];
    let labels: Vec<Label<Drive>> = (0..part.jobs.len()).map(|position| label(sweep, part, position)).collect();
    let mut stage = Stage {
        storage,
        layout: directory.layout(),
        file: part_file(part),
        footer: Footer::default().with_sweep(sweep),
        jobs: labels.iter().enumerate().map(|(position, job)| (job, outcomes.get(&position))).collect(),
        commit: Commit::begin(storage, staging)?,
    };
    stage.table::<SlipRow<'_>>(|writer, job, outcome| {
        outcome.iter().flat_map(|result| &result.slips).try_for_each(|slip| writer.push(&(job, slip)))
    })?;
    if sweep.recording().precursors {
        stage.table::<PrecursorRow<'_>>(|writer, job, outcome| {
            let mut precursors = outcome.iter().flat_map(|result| &result.precursors);
            precursors.try_for_each(|precursor| writer.push(&(job, precursor)))
        })?;
    }
    stage.table::<JobRow>(|writer, job, outcome| {
        writer.push(&(relabel(job), JobRecord::new(outcome.as_ref().map_err(String::as_str))))
    })?;
    Ok(stage.commit.publish()?)
}

/// The files of a part on their way.
struct Stage<'a> {
    storage: &'a dyn Storage,
    layout: &'a Layout,
    file: String,
    footer: Footer,
    jobs: Vec<(&'a Label<Drive>, Option<&'a Outcome>)>,
    commit: Commit<'a>,
}

impl<'a> Stage<'a> {
    /// Writes the part's file of one table: new rows of jobs with an outcome, the old ones of the others.
    fn table<R: Table>(
        &mut self,
        write: impl Fn(&mut TableWriter<R>, &'a Label<Drive>, &'a Outcome) -> Result<(), DatasetError>,
    ) -> Result<(), DatasetError> {
        let folder = self.layout.table(R::NAME);
        create_folder(self.storage, &folder)?;
        let target = folder.join(&self.file);
        let keeps = self.jobs.iter().any(|(_, outcome)| outcome.is_none());
        let kept = if keeps { KeptRows::read(self.storage, &target)? } else { KeptRows::default() };
        let mut writer = TableWriter::create(self.storage, &self.commit.stage(&target), &self.footer)?;
        for &(job, outcome) in &self.jobs {
            match outcome {
                Some(outcome) => write(&mut writer, job, outcome)?,
                None => kept.copy(&mut writer, &job.0.job_id)?,
            }
        }
        writer.finish()
    }
}

/// The rows of a file by job.
#[derive(Default)]
struct KeptRows {
    batches: Vec<Batch>,
    by_job: HashMap<String, Vec<(usize, Range<usize>)>>,
}

impl KeptRows {
    fn read(storage: &dyn Storage, path: &Path) -> Result<Self, DatasetError> {
        let mut kept = Self::default();
        for batch in Reader::new(storage, vec![path.to_owned()]) {
            let batch = batch?;
            let jobs = batch.texts("job_id")?;
            let mut begin = 0;
            while begin < jobs.len() {
                let job = jobs.value(begin);
                let end = (begin..jobs.len()).find(|&row| jobs.value(row) != job).unwrap_or(jobs.len());
                kept.by_job.entry(job.to_owned()).or_default().push((kept.batches.len(), begin..end));
                begin = end;
            }
            kept.batches.push(batch);
        }
        Ok(kept)
    }

    fn copy<R: Table>(&self, writer: &mut TableWriter<R>, job: &str) -> Result<(), DatasetError> {
        let rows = self.by_job.get(job).into_iter().flatten();
        rows.cloned().try_for_each(|(batch, rows)| writer.copy(&self.batches[batch], rows))
    }
}
