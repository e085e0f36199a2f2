//! Parts: consecutive jobs of the plan whose rows are committed together, in the plan's order.
//!
//! A part has one file in each table. The one in `jobs` comes last, so a part is done exactly if that is there, or if a
//! compacted file of `jobs` holds it. What a stopped run had finished of other parts is *spilled*: the same files, with the
//! rows of these jobs alone, aside from the tables until the part is committed.

use crate::observe::Measurements;
use crate::results::commit::Commit;
use crate::results::error::ResultsError;
use crate::results::handle::Results;
use crate::results::layout::{Layout, TableFile};
use crate::results::tables::{
    self, DriveAndSeed, JobOutcome, JobRecord, JobRow, Label, PrecursorRow, RowOfJob, SlipRow, label, relabel,
};
use crate::sweep::{Outline, Part};
use crate::table::columns::{Table, columns};
use crate::table::file::{Batch, Dataset, DatasetError, TableWriter};
use crate::table::storage::StorageError;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What a job of a part ended with: its measurements, or why it failed.
pub type Outcome = Result<Measurements, String>;

/// The parts that are done, as the names in `tables/jobs` said at one instant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DoneParts {
    /// Parts with files of their own, by extension and number.
    own: HashSet<(usize, u64)>,
    /// First and last parts of compacted files, by extension and first part.
    compacted: BTreeMap<(usize, u64), u64>,
}

impl DoneParts {
    /// Whether a part is done.
    pub fn has(&self, part: &Outline) -> bool {
        self.is_compacted(part) || self.own.contains(&(part.extension, part.index))
    }

    /// Whether any part is in a compacted file.
    pub fn any_is_compacted(&self) -> bool {
        !self.compacted.is_empty()
    }

    /// Whether the rows of a part are in a compacted file.
    pub fn is_compacted(&self, part: &Outline) -> bool {
        let before = self.compacted.range((part.extension, 0)..=(part.extension, part.index)).next_back();
        before.is_some_and(|(_, &last)| part.index <= last)
    }
}

/// Why a job of a part that is done may run again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unfinished {
    /// It failed, for this reason.
    Failed(String),
    /// It was ended by a shorter `max_time` than the present one.
    Cut,
}

/// Times within this share of each other are the same bound.
const SAME_TIME: f64 = 1e-9;

impl Results<'_> {
    /// Looks up which parts are done.
    pub fn done_parts(&self) -> Result<DoneParts, StorageError> {
        let mut done = DoneParts::default();
        for file in self.layout().table_files(tables::JOBS)? {
            if file.is_compacted() {
                done.compacted.insert((file.extension, file.first), file.last);
            } else {
                done.own.insert((file.extension, file.first));
            }
        }
        Ok(done)
    }

    /// The file of a part in a table.
    pub fn part_file(&self, table: &str, part: &Outline) -> PathBuf {
        self.layout().table(table).join(TableFile::of_part(part.extension, part.index).to_string())
    }

    /// Positions of the jobs of a part that may run again; `None` if the part is not done. Such parts are never compacted.
    pub fn unfinished(
        &self,
        done: &DoneParts,
        part: &Outline,
    ) -> Result<Option<BTreeMap<usize, Unfinished>>, ResultsError> {
        if !done.has(part) {
            return Ok(None);
        }
        let (mut unfinished, mut rows) = (BTreeMap::new(), 0);
        if done.is_compacted(part) {
            return Ok(Some(unfinished));
        }
        let path = self.part_file(tables::JOBS, part);
        for batch in Dataset::new(self.layout().storage, vec![path.clone()]).rows::<OutcomeRow>() {
            for row in batch? {
                let why = match row.outcome {
                    JobOutcome::Failed => Some(Unfinished::Failed(row.reason.unwrap_or_default())),
                    JobOutcome::TimeLimit if self.is_cut(row.simulated_time) => Some(Unfinished::Cut),
                    _ => None,
                };
                unfinished.extend(why.map(|why| (rows, why)));
                rows += 1;
            }
        }
        if rows == part.job_count {
            Ok(Some(unfinished))
        } else {
            Err(ResultsError::damaged(&path, format!("{rows} jobs where the plan has {}", part.job_count)))
        }
    }

    /// Whether a job that a time limit ended after this time, in s, may run for longer now.
    pub(super) fn is_cut(&self, time: Option<f64>) -> bool {
        let max_time = self.sweep().recording().max_time.unwrap_or(f64::INFINITY);
        time.is_some_and(|time| time < max_time * (1.0 - SAME_TIME))
    }

    /// The parts of which something is spilled.
    pub fn spilled_parts(&self) -> Result<HashSet<(usize, u64)>, StorageError> {
        self.spilled_in(tables::JOBS)
    }

    fn spilled_in(&self, table: &str) -> Result<HashSet<(usize, u64)>, StorageError> {
        let names = self.layout().storage.list(&self.layout().spill().join(table))?;
        let files = names.iter().filter_map(|name| TableFile::of_path(name.as_ref()));
        Ok(files.map(|file| (file.extension, file.first)).collect())
    }

    /// Positions of the jobs of a part that are spilled: none if a file is damaged or gone, and they then run again; `None` if
    /// this host does not see a file yet that the folder lists, as on a network disk.
    pub fn spilled(&self, part: &Part) -> Result<Option<BTreeSet<usize>>, ResultsError> {
        let mut ids = HashSet::new();
        for table in self.tables() {
            let file = self.spilled_file(table, part);
            let files = Dataset::new(self.layout().storage, vec![file.clone()]);
            for batch in files.rows::<RowOfJob>() {
                match batch {
                    Ok(rows) if table == tables::JOBS => ids.extend(rows.into_iter().map(|row| row.job_id)),
                    Ok(_) => (),
                    Err(DatasetError::Damaged { .. }) => return Ok(Some(BTreeSet::new())),
                    Err(DatasetError::Storage(error)) if error.kind() == ErrorKind::NotFound => {
                        // Not listed: another worker has just committed the part. A link may lead nowhere.
                        let is_listed = self.spilled_in(table)?.contains(&(part.extension, part.index));
                        let will_be_seen = is_listed && !self.layout().storage.is_link(&file)?;
                        return Ok((!will_be_seen).then(BTreeSet::new));
                    }
                    Err(error) => return Err(error.into()),
                }
            }
        }
        Ok(Some((0..part.jobs.len()).filter(|&position| ids.contains(&self.job_id(part, position))).collect()))
    }

    fn spilled_file(&self, table: &str, part: &Outline) -> PathBuf {
        self.layout().spill().join(table).join(TableFile::of_part(part.extension, part.index).to_string())
    }

    /// Spills the outcomes of some jobs of a part, beside those that are spilled already.
    pub fn spill(
        &self,
        staging: &Path,
        part: &Part,
        outcomes: &BTreeMap<usize, Outcome>,
        spilled: &BTreeSet<usize>,
    ) -> Result<(), ResultsError> {
        let is_finished = |position: &usize| outcomes.contains_key(position) || spilled.contains(position);
        let from = (!spilled.is_empty()).then_some(Place::Spill);
        self.write(staging, part, outcomes, is_finished, from, Place::Spill)
    }

    /// Commits a part: the outcomes of its jobs by position. Jobs without one keep the rows that they have, in the tables
    /// or `spilled`.
    /// On an error the part counts as before, or as done, but never as half done.
    pub fn commit(
        &self,
        staging: &Path,
        part: &Part,
        outcomes: &BTreeMap<usize, Outcome>,
        spilled: &BTreeSet<usize>,
    ) -> Result<(), ResultsError> {
        if !spilled.is_empty() && self.done_parts()?.has(part) {
            // This worker was taken for dead, and its heir has used up what was spilled.
            return Ok(());
        }
        let keeps = outcomes.len() < part.jobs.len();
        let from = if spilled.is_empty() { Place::Tables } else { Place::Spill };
        self.write(staging, part, outcomes, |_| true, keeps.then_some(from), Place::Tables)?;
        if spilled.is_empty() { Ok(()) } else { Ok(self.remove_spilled(part)?) }
    }

    /// Removes what is spilled of those of these parts that are done, as who committed them may have died at that.
    pub fn tidy_spill(&self, parts: &[Outline]) -> Result<(), StorageError> {
        // All tables: who removed them may have been killed at that, too.
        let tables = self.tables().map(|table| self.spilled_in(table)).collect::<Result<Vec<_>, _>>()?;
        let spilled: HashSet<_> = tables.into_iter().flatten().collect();
        if spilled.is_empty() {
            return Ok(());
        }
        let done = self.done_parts()?;
        let is_over = |part: &&Outline| spilled.contains(&(part.extension, part.index)) && done.has(part);
        parts.iter().filter(is_over).try_for_each(|part| self.remove_spilled(part))
    }

    fn remove_spilled(&self, part: &Outline) -> Result<(), StorageError> {
        // Jobs first: what is spilled without them is nothing.
        for table in self.tables().collect::<Vec<_>>().into_iter().rev() {
            match self.layout().storage.remove(&self.spilled_file(table, part)) {
                // Another worker was first.
                Err(error) if error.kind() == ErrorKind::NotFound => (),
                removed => removed?,
            }
        }
        Ok(())
    }

    /// Writes files of a part with some of its jobs: new rows of those with an outcome, the old ones of the others.
    fn write(
        &self,
        staging: &Path,
        part: &Part,
        outcomes: &BTreeMap<usize, Outcome>,
        is_written: impl Fn(&usize) -> bool,
        from: Option<Place>,
        to: Place,
    ) -> Result<(), ResultsError> {
        let sweep = &self.extensions()[part.extension].sweep;
        let label = |position: usize| label(sweep, &part.jobs[position].parameters);
        let positions = (0..part.jobs.len()).filter(is_written);
        let jobs: Jobs<'_> = positions.map(|position| (label(position), outcomes.get(&position))).collect();
        let places = (from, to);
        let mut commit = Commit::begin(self.layout(), staging)?;
        self.stage::<SlipRow<'_>>(&mut commit, part, places, &jobs, |writer, job, outcome| {
            outcome.iter().flat_map(|result| &result.slips).try_for_each(|slip| writer.push(&(job, slip)))
        })?;
        if sweep.recording().precursors {
            self.stage::<PrecursorRow<'_>>(&mut commit, part, places, &jobs, |writer, job, outcome| {
                let mut precursors = outcome.iter().flat_map(|result| &result.precursors);
                precursors.try_for_each(|precursor| writer.push(&(job, precursor)))
            })?;
        }
        self.stage::<JobRow>(&mut commit, part, places, &jobs, |writer, job, outcome| {
            writer.push(&(relabel(job), JobRecord::new(outcome.as_ref().map_err(String::as_str))))
        })?;
        self.publish(commit)
    }

    /// Writes a part's file of one table: new rows of jobs with an outcome, the old ones of the others.
    fn stage<'j, R: Table>(
        &self,
        commit: &mut Commit<'_>,
        part: &Part,
        (from, to): (Option<Place>, Place),
        jobs: &'j Jobs<'_>,
        write: impl Fn(&mut TableWriter<R>, &'j Label<DriveAndSeed>, &'j Outcome) -> Result<(), DatasetError>,
    ) -> Result<(), ResultsError> {
        let storage = self.layout().storage;
        let place = |place| match place {
            Place::Tables => self.part_file(R::NAME, part),
            Place::Spill => self.spilled_file(R::NAME, part),
        };
        let target = place(to);
        let above = match to {
            Place::Tables => self.layout().tables(),
            Place::Spill => self.layout().run(),
        };
        if let Some(folder) = target.parent() {
            storage.ensure_folder_below(&above, folder)?;
        }
        let kept = KeptRows::read(Dataset::new(storage, from.map(place).into_iter().collect()))?;
        let mut writer = TableWriter::new(commit.stage(&target)?, &self.footer(part.extension))?;
        for (job, outcome) in jobs {
            match outcome {
                Some(outcome) => write(&mut writer, job, outcome)?,
                None => kept.copy(&mut writer, &job.0.job_id)?,
            }
        }
        writer.finish()?;
        Ok(())
    }
}

/// Where files of a part lie.
#[derive(Clone, Copy)]
enum Place {
    Tables,
    Spill,
}

/// The jobs of a part, those that were run with their outcomes.
type Jobs<'a> = Vec<(Label<DriveAndSeed>, Option<&'a Outcome>)>;

columns! {
    /// How a job ended, as a row of the jobs table says.
    struct OutcomeRow {
        outcome: JobOutcome;
        reason: Option<String>;
        simulated_time: Option<f64>;
    }
}

/// Files of a table that count beside these of `jobs`: those with the rows of the same parts. A run killed in between
/// leaves the slips of a part without its jobs.
pub fn committed_files<'a>(layout: &Layout<'a>, table: &str, jobs: &Dataset<'_>) -> Result<Dataset<'a>, DatasetError> {
    let parts = |path: &PathBuf| {
        TableFile::of_path(path).map(|file| (file.extension, file.first, file.last, file.is_compacted()))
    };
    let done: HashSet<_> = jobs.files().iter().filter_map(parts).collect();
    Ok(layout.dataset(table)?.filter(|path| parts(path).is_some_and(|parts| done.contains(&parts))))
}

/// The rows of a file by job.
#[derive(Default)]
struct KeptRows {
    batches: Vec<Batch>,
    by_job: HashMap<String, Vec<(usize, Range<usize>)>>,
}

impl KeptRows {
    fn read(before: Dataset<'_>) -> Result<Self, DatasetError> {
        let mut kept = Self::default();
        for batch in before.batches() {
            let batch = batch?;
            let mut begin = 0;
            for rows in batch.rows_of::<RowOfJob>()?.chunk_by(|row, next| row.job_id == next.job_id) {
                let end = begin + rows.len();
                kept.by_job.entry(rows[0].job_id.clone()).or_default().push((kept.batches.len(), begin..end));
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
