//! Parts: consecutive jobs of the plan whose rows are committed together, in the plan's order.
//!
//! A part has one file in each table. The one in `jobs` comes last, and a part is done if all are there. What a stopped
//! run had finished of other parts is *spilled*: the same files, with the rows of these jobs alone, aside from the
//! tables until the part is committed.

use crate::observe::Measurements;
use crate::results::directory::Results;
use crate::results::tables::{
    DriveAndSeed, JobLabel, JobOutcome, JobRecord, JobRow, RecordedTable, RowOfJob, gaps, label,
    relabel,
};
use crate::results::workers::Member;
use crate::sweep::{Job, Outline, Part, PartName};
use crate::table::Table;
use crate::table::arrow::Gaps;
use crate::table::columns::columns;
use crate::table::error::ResultsError;
use crate::table::file::{Batch, DataFile, Dataset, Footer, TableWriter};
use crate::table::storage::StorageError;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};

/// What a job of a part ended with: its measurements, or why it failed.
pub type Outcome = Result<Measurements, String>;

/// What jobs of a part that were run ended with, by their positions.
pub type Outcomes = BTreeMap<usize, Outcome>;

impl<'a> Results<'a> {
    /// The files of a table that count beside these of `jobs`: those of the same parts, with as many rows as these say.
    /// A run killed in between leaves the slips of a part without its jobs. A part without its slips is damaged.
    pub fn committed_files(
        &self,
        table: RecordedTable,
        jobs: &Dataset<'_>,
    ) -> Result<Dataset<'a>, ResultsError> {
        let there = self.layout().parts_in(&self.layout().table(table))?;
        let mut files = Vec::new();
        for part in jobs.files().filter_map(|path| PartName::of_path(path)) {
            let mut file = self.file_in(&self.layout().tables(), table, part);
            if !there.contains(&part) {
                let problem = "it is missing, though the jobs of its part are there";
                return Err(ResultsError::damaged(&file.path, problem));
            }
            file.rows = row_count(self.dataset_of(RecordedTable::Jobs, part), table)?;
            files.push(file);
        }
        Ok(Dataset::of(self.layout().storage, files))
    }

    pub fn part_file(&self, table: RecordedTable, part: &Outline) -> PathBuf {
        self.layout().table(table).join(part.name.file())
    }

    /// The rows of a part that are there, in the tables or spilled.
    pub fn earlier_rows(
        &self,
        part: &Part,
        place: Option<&Path>,
    ) -> Result<EarlierRows, ResultsError> {
        let read = |table| {
            let file = place.map(|place| self.file_in(place, table, part.name));
            let before = Dataset::of(self.layout().storage, file.into_iter().collect());
            Ok((table, RowsByJob::read(before)?))
        };
        self.tables().map(read).collect()
    }

    /// The files of a part in the tables or the spill: new rows of jobs with an outcome, the earlier ones of others. Uses no
    /// disk.
    pub fn encode(
        &self,
        part: &Part,
        outcomes: &Outcomes,
        earlier: &EarlierRows,
        place: &Path,
    ) -> Result<PartFiles, ResultsError> {
        let sweep = &self.extensions()[part.name.extension].sweep;
        let label = |job: &Job| label(sweep, &job.parameters);
        let labels: Vec<JobLabel<DriveAndSeed>> = part.jobs.iter().map(label).collect();
        let outcomes = (0..).map(|position| outcomes.get(&position));
        let jobs: Jobs<'_> = labels.iter().zip(outcomes).collect();
        let gaps = gaps(sweep);
        let encoded = |table| {
            let file = self.file_in(place, table, part.name);
            let rows = &earlier[&table];
            match table {
                RecordedTable::Slips => encoded(file, &gaps, &jobs, rows, |job, outcome| {
                    let slips = outcome.iter().flat_map(Measurements::all_slips);
                    slips.map(move |slip| (Cow::Borrowed(job), slip))
                }),
                RecordedTable::Precursors => encoded(file, &gaps, &jobs, rows, |job, outcome| {
                    let precursors = outcome.iter().flat_map(|measured| &measured.precursors);
                    precursors.map(move |precursor| (Cow::Borrowed(job), Cow::Borrowed(precursor)))
                }),
                RecordedTable::Jobs => encoded(file, &gaps, &jobs, rows, |job, outcome| {
                    let record = JobRecord::new(outcome.as_ref().map_err(String::as_str));
                    let row: JobRow = (relabel(job), record);
                    [row]
                }),
            }
        };
        self.tables().map(encoded).collect()
    }

    /// Puts files of a part into their places below a folder. On an error the part counts as before, or as done, but
    /// never as half done.
    pub fn put(
        &self,
        member: &Member<'_>,
        files: &PartFiles,
        top: &Path,
    ) -> Result<(), ResultsError> {
        let mut commit = member.commit();
        for (path, bytes) in files {
            let folder = path.parent().unwrap_or(top);
            self.layout().storage.ensure_folder_below(top, folder)?;
            commit.stage_bytes(path, bytes)?;
        }
        self.publish(commit)
    }

    /// Removes spilled jobs of those of these parts that are done: the worker that committed them may have died before.
    pub fn tidy_spill(&self, parts: &[Outline]) -> Result<(), ResultsError> {
        // All tables: a worker may also have died while it removed them.
        let mut spilled = HashSet::new();
        for table in self.tables() {
            spilled.extend(self.spilled_parts(table)?);
        }
        if spilled.is_empty() {
            return Ok(());
        }
        let done = self.done_parts()?;
        for part in parts {
            if spilled.contains(&part.name) && done.contains(&part.name) {
                self.remove_spilled(part)?;
            }
        }
        Ok(())
    }

    pub fn remove_spilled(&self, part: &Outline) -> Result<(), StorageError> {
        // Jobs first: without them the other files do not count.
        self.tables().rev().try_for_each(|table| {
            let file = self.file_in(&self.layout().spill(), table, part.name);
            self.layout().remove(&file.path)
        })
    }
}

/// Files of a part with their bytes, that of the jobs last.
pub type PartFiles = Vec<(PathBuf, Vec<u8>)>;

/// Rows of jobs that are there already, by table.
pub type EarlierRows = HashMap<RecordedTable, RowsByJob>;

/// The jobs of a part, those that were run with their outcomes.
type Jobs<'a> = Vec<(&'a JobLabel<DriveAndSeed>, Option<&'a Outcome>)>;

/// The bytes of a file of one table.
fn encoded<'j, R: Table, Rows: IntoIterator<Item = R>>(
    file: DataFile,
    gaps: &Gaps,
    jobs: &Jobs<'j>,
    earlier: &RowsByJob,
    rows: impl Fn(&'j JobLabel<DriveAndSeed>, &'j Outcome) -> Rows,
) -> Result<(PathBuf, Vec<u8>), ResultsError> {
    let footer = Footer::default().and(&file.footer).at(&file.path);
    let mut writer = TableWriter::new(gaps, &file.path, Vec::new(), &footer)?;
    for (job, outcome) in jobs {
        match outcome {
            Some(outcome) => {
                rows(job, outcome)
                    .into_iter()
                    .try_for_each(|row| writer.push(&row))?;
            }
            None => earlier.copy(&mut writer, &job.0.job_id)?,
        }
    }
    Ok((file.path, writer.finish()?))
}

columns! {
    /// What the jobs table says about the rows of a job in other tables.
    pub(super) struct RowsOfJob {
        job_id: String;
        outcome: JobOutcome;
        slips: Option<u64>;
        precursors: Option<u64>;
    }
}

impl RowsOfJob {
    /// The fewest and the most rows of the job in a table. One that may run again may have more, which a killed run
    /// wrote.
    pub(super) fn count(&self, table: RecordedTable) -> RangeInclusive<u64> {
        let rows = match table {
            RecordedTable::Slips => self.slips,
            RecordedTable::Precursors => self.precursors,
            RecordedTable::Jobs => return 1..=1,
        };
        let least = rows.unwrap_or(0);
        match self.outcome {
            JobOutcome::Failed | JobOutcome::TimeLimit => least..=u64::MAX,
            JobOutcome::Done | JobOutcome::NoSlips => least..=least,
        }
    }
}

/// The fewest and the most rows of the jobs of a part in a table, as its jobs file says.
pub(super) fn row_count(
    jobs: Dataset<'_>,
    table: RecordedTable,
) -> Result<RangeInclusive<u64>, ResultsError> {
    let mut least = 0_u64;
    let mut most = 0_u64;
    for job in jobs.rows::<RowsOfJob>() {
        let of_job = job?.count(table);
        least = least.saturating_add(*of_job.start());
        most = most.saturating_add(*of_job.end());
    }
    Ok(least..=most)
}

/// The rows of a file by job.
#[derive(Default)]
pub struct RowsByJob {
    batches: Vec<Batch>,
    by_job: HashMap<String, Vec<(usize, Range<usize>)>>,
}

impl RowsByJob {
    fn read(before: Dataset<'_>) -> Result<Self, ResultsError> {
        let mut read = Self::default();
        for batch in before.batches() {
            let batch = batch?;
            let number = read.batches.len();
            let mut begin = 0;
            let ids: Vec<RowOfJob> = batch.rows_of()?;
            for rows in ids.chunk_by(|row, next| row.job_id == next.job_id) {
                let end = begin + rows.len();
                let stretches = read.by_job.entry(rows[0].job_id.clone()).or_default();
                stretches.push((number, begin..end));
                begin = end;
            }
            read.batches.push(batch);
        }
        Ok(read)
    }

    fn copy<R: Table>(
        &self,
        writer: &mut TableWriter<R, Vec<u8>>,
        job: &str,
    ) -> Result<(), ResultsError> {
        let rows = self.by_job.get(job).into_iter().flatten();
        rows.cloned()
            .try_for_each(|(batch, rows)| writer.copy(&self.batches[batch], rows))
    }
}
