//! Parts: consecutive jobs of the plan whose rows are committed together, in the plan's order.
//!
//! A part has one file in each table. The one in `jobs` comes last, and a part is done if all are there. What a stopped
//! run had finished of other parts is *spilled*: the same files, with the rows of these jobs alone, aside from the
//! tables until the part is committed.

use crate::observe::Measurements;
use crate::results::commit::Commit;
use crate::results::directory::Results;
use crate::results::tables::{
    self, DriveAndSeed, JobLabel, JobOutcome, JobRecord, JobRow, RowOfJob, label, relabel,
};
use crate::results::workers::Member;
use crate::sweep::{Outline, Part, PartName};
use crate::table::Table;
use crate::table::columns::columns;
use crate::table::error::ResultsError;
use crate::table::file::{Batch, Dataset, Footer, TableWriter};
use crate::table::storage::StorageError;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::ops::{Range, RangeInclusive};
use std::path::PathBuf;

/// What a job of a part ended with: its measurements, or why it failed.
pub type Outcome = Result<Measurements, String>;

/// What jobs of a part that were run ended with, by their positions.
pub type Outcomes = BTreeMap<usize, Outcome>;

impl<'a> Results<'a> {
    /// The files of a table that count beside these of `jobs`: those of the same parts, with as many rows as these say.
    /// A run killed in between leaves the slips of a part without its jobs. A part without its slips is damaged.
    pub fn committed_files(
        &self,
        table: &str,
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
            file.rows = row_count(self.dataset_of(tables::JOBS, part), table)?;
            files.push(file);
        }
        Ok(Dataset::of(self.layout().storage, files))
    }

    pub fn part_file(&self, table: &str, part: &Outline) -> PathBuf {
        self.layout().table(table).join(part.name.file())
    }

    /// Spills the outcomes of some jobs of a part, beside those at the positions that are spilled already.
    pub fn spill(
        &self,
        member: &Member<'_>,
        part: &Part,
        outcomes: &Outcomes,
        spilled: &BTreeSet<usize>,
    ) -> Result<(), ResultsError> {
        let is_finished =
            |position: &usize| outcomes.contains_key(position) || spilled.contains(position);
        let spill = self.layout().spill();
        let from = (!spilled.is_empty()).then_some(&spill);
        self.write(member, part, outcomes, is_finished, (from, &spill))
    }

    /// Commits a part. Jobs without an outcome keep the rows that they have, in the tables or, at these positions,
    /// spilled. On an error the part counts as before, or as done, but never as half done.
    pub fn commit(
        &self,
        member: &Member<'_>,
        part: &Part,
        outcomes: &Outcomes,
        spilled: &BTreeSet<usize>,
    ) -> Result<(), ResultsError> {
        let tables = self.layout().tables();
        let spill = self.layout().spill();
        let from = if spilled.is_empty() { &tables } else { &spill };
        let from = (outcomes.len() < part.jobs.len()).then_some(from);
        self.write(member, part, outcomes, |_| true, (from, &tables))?;
        if !spilled.is_empty() {
            self.remove_spilled(part)?;
        }
        Ok(())
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

    fn remove_spilled(&self, part: &Outline) -> Result<(), StorageError> {
        // Jobs first: without them the other files do not count.
        self.tables().rev().try_for_each(|table| {
            let file = self.file_in(&self.layout().spill(), table, part.name);
            self.layout().remove(&file.path)
        })
    }

    /// Writes files of a part, from and to the tables or the spill: new rows of jobs with an outcome, old ones of
    /// others.
    fn write(
        &self,
        member: &Member<'_>,
        part: &Part,
        outcomes: &Outcomes,
        is_written: impl Fn(&usize) -> bool,
        places: (Option<&PathBuf>, &PathBuf),
    ) -> Result<(), ResultsError> {
        let sweep = &self.extensions()[part.name.extension].sweep;
        let positions = (0..part.jobs.len()).filter(is_written);
        let job = |position: usize| {
            let parameters = &part.jobs[position].parameters;
            (label(sweep, parameters), outcomes.get(&position))
        };
        let jobs: Jobs<'_> = positions.map(job).collect();
        let mut commit = member.commit();
        self.stage(&mut commit, part, places, &jobs, |job, outcome| {
            let slips = outcome.iter().flat_map(|measured| &measured.slips);
            slips.map(move |slip| (Cow::Borrowed(job), Cow::Borrowed(slip)))
        })?;
        if sweep.recording().precursors {
            self.stage(&mut commit, part, places, &jobs, |job, outcome| {
                let precursors = outcome.iter().flat_map(|measured| &measured.precursors);
                precursors.map(move |precursor| (Cow::Borrowed(job), Cow::Borrowed(precursor)))
            })?;
        }
        self.stage(&mut commit, part, places, &jobs, |job, outcome| {
            let record = JobRecord::new(outcome.as_ref().map_err(String::as_str));
            let row: JobRow = (relabel(job), record);
            [row]
        })?;
        self.publish(commit)
    }

    /// Writes a part's file of one table: new rows of jobs with an outcome, the old ones of the others.
    fn stage<'j, R: Table, Rows: IntoIterator<Item = R>>(
        &self,
        commit: &mut Commit<'_>,
        part: &Part,
        (from, to): (Option<&PathBuf>, &PathBuf),
        jobs: &'j Jobs<'_>,
        rows: impl Fn(&'j JobLabel<DriveAndSeed>, &'j Outcome) -> Rows,
    ) -> Result<(), ResultsError> {
        let storage = self.layout().storage;
        let file = |place: &PathBuf| self.file_in(place, R::NAME, part.name);
        let target = file(to);
        // A run makes the folder of the tables when it begins.
        let top = if *to == self.layout().spill() {
            &self.layout().run()
        } else {
            to
        };
        storage.ensure_folder_below(top, &to.join(R::NAME))?;
        let kept = KeptRows::read(Dataset::of(storage, from.map(file).into_iter().collect()))?;
        let sweep = &self.extensions()[part.name.extension].sweep;
        let left_out = sweep.recording().left_out();
        let footer = Footer::default().and(&target.footer).at(&target.path);
        let mut writer = TableWriter::new(&left_out, commit.stage(&target.path)?, &footer)?;
        for (job, outcome) in jobs {
            match outcome {
                Some(outcome) => {
                    let mut rows = rows(job, outcome).into_iter();
                    rows.try_for_each(|row| writer.push(&row))?;
                }
                None => kept.copy(&mut writer, &job.0.job_id)?,
            }
        }
        writer.finish()
    }
}

/// The jobs of a part, those that were run with their outcomes.
type Jobs<'a> = Vec<(JobLabel<DriveAndSeed>, Option<&'a Outcome>)>;

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
    pub(super) fn count(&self, table: &str) -> RangeInclusive<u64> {
        let rows = if table == tables::SLIPS {
            self.slips
        } else {
            self.precursors
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
    table: &str,
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
struct KeptRows {
    batches: Vec<Batch>,
    by_job: HashMap<String, Vec<(usize, Range<usize>)>>,
}

impl KeptRows {
    fn read(before: Dataset<'_>) -> Result<Self, ResultsError> {
        let mut kept = Self::default();
        for batch in before.batches() {
            let batch = batch?;
            let number = kept.batches.len();
            let mut begin = 0;
            let ids: Vec<RowOfJob> = batch.rows_of()?;
            for rows in ids.chunk_by(|row, next| row.job_id == next.job_id) {
                let end = begin + rows.len();
                let stretches = kept.by_job.entry(rows[0].job_id.clone()).or_default();
                stretches.push((number, begin..end));
                begin = end;
            }
            kept.batches.push(batch);
        }
        Ok(kept)
    }

    fn copy<R: Table>(&self, writer: &mut TableWriter<R>, job: &str) -> Result<(), ResultsError> {
        let rows = self.by_job.get(job).into_iter().flatten();
        rows.cloned()
            .try_for_each(|(batch, rows)| writer.copy(&self.batches[batch], rows))
    }
}
