//! Rows of all tables held against each other: the same jobs in the same order, each with as many slips as it tells of.

use crate::table::file::{Batch, DatasetError, Reader};
use crate::table::storage::Storage;
use arrow_array::Array;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Files of the tables with the rows of the same jobs.
pub(super) struct TableFiles {
    pub jobs: Vec<PathBuf>,
    pub slips: Vec<PathBuf>,
    /// `None` if they are not recorded.
    pub precursors: Option<Vec<PathBuf>>,
}

/// Consecutive rows of one job.
pub(super) struct Group {
    pub path: Arc<Path>,
    pub job_id: String,
    pub rows: u64,
}

/// A row of the jobs table.
pub(super) struct Job {
    pub path: Arc<Path>,
    pub id: String,
    pub slips: u64,
    pub precursors: u64,
    /// Why it failed.
    pub failure: Option<String>,
}

/// The rows of files job by job. `number` names a column that is to count them, if there is one.
pub(super) fn groups<'a>(
    storage: &'a dyn Storage,
    files: Vec<PathBuf>,
    number: Option<&'static str>,
) -> impl Iterator<Item = Result<Group, DatasetError>> + 'a {
    let mut batches = Reader::new(storage, files);
    let mut current: Option<(Batch, usize)> = None;
    let mut group: Option<Group> = None;
    std::iter::from_fn(move || {
        loop {
            let Some((batch, row)) = current.as_mut().filter(|(batch, row)| *row < batch.rows.num_rows()) else {
                match batches.next() {
                    Some(Ok(batch)) => current = Some((batch, 0)),
                    Some(Err(error)) => return Some(Err(error)),
                    None => return group.take().map(Ok),
                }
                continue;
            };
            match step(batch, row, number, &mut group) {
                Ok(None) => (),
                Ok(Some(whole)) => return Some(Ok(whole)),
                Err(error) => return Some(Err(error)),
            }
        }
    })
}

/// Adds a row to the group, or begins the next group and gives the one before.
fn step(
    batch: &Batch,
    row: &mut usize,
    number: Option<&str>,
    group: &mut Option<Group>,
) -> Result<Option<Group>, DatasetError> {
    let job_id = batch.texts("job_id")?.value(*row);
    let mut whole = None;
    if group.as_ref().is_none_or(|group| group.job_id != job_id) {
        let next = Group { path: Arc::clone(&batch.path), job_id: job_id.to_owned(), rows: 0 };
        whole = group.replace(next);
    }
    let Some(group) = group.as_mut() else { return Ok(whole) };
    if let Some(number) = number
        && batch.counts(number)?.value(*row).cast_unsigned() != group.rows
    {
        let problem = format!("row {} of job {} has another number", group.rows + 1, group.job_id);
        return Err(DatasetError::damaged(&batch.path)(problem));
    }
    group.rows += 1;
    *row += 1;
    Ok(whole)
}

/// The rows of jobs files.
pub(super) fn jobs(storage: &dyn Storage, files: Vec<PathBuf>) -> impl Iterator<Item = Result<Job, DatasetError>> {
    Reader::new(storage, files).flat_map(|batch| match batch.and_then(|batch| jobs_of(&batch)) {
        Ok(jobs) => jobs.into_iter().map(Ok).collect::<Vec<_>>(),
        Err(error) => vec![Err(error)],
    })
}

fn jobs_of(batch: &Batch) -> Result<Vec<Job>, DatasetError> {
    let (job_id, reason) = (batch.texts("job_id")?, batch.texts("reason")?);
    let (slips, precursors) = (batch.counts("slips")?, batch.counts("precursors")?);
    let job = |row| Job {
        path: Arc::clone(&batch.path),
        id: job_id.value(row).to_owned(),
        slips: if slips.is_valid(row) { slips.value(row).cast_unsigned() } else { 0 },
        precursors: if precursors.is_valid(row) { precursors.value(row).cast_unsigned() } else { 0 },
        failure: reason.is_valid(row).then(|| reason.value(row).to_owned()),
    };
    Ok((0..batch.rows.num_rows()).map(job).collect())
}

/// Goes through all rows and visits the jobs.
///
/// # Errors
/// When rows are missing, in excess, or in another order than the jobs; and what the visit says.
pub(super) fn check(
    storage: &dyn Storage,
    files: TableFiles,
    mut visit: impl FnMut(&Job) -> Result<(), DatasetError>,
) -> Result<(), DatasetError> {
    let last = |files: &[PathBuf]| files.last().cloned().unwrap_or_default();
    let (last_slips, last_precursors) = (last(&files.slips), files.precursors.as_deref().map(last));
    let mut slips = groups(storage, files.slips, Some("slip"));
    let mut precursors = files.precursors.map(|files| groups(storage, files, None));
    for job in jobs(storage, files.jobs) {
        let job = job?;
        visit(&job)?;
        expect(&mut slips, &job.id, job.slips, "slips", &last_slips)?;
        if let (Some(groups), Some(last)) = (&mut precursors, &last_precursors) {
            expect(groups, &job.id, job.precursors, "precursors", last)?;
        }
    }
    match slips.chain(precursors.into_iter().flatten()).next().transpose()? {
        None => Ok(()),
        Some(group) => {
            let problem = format!("it has rows of job {} in excess", group.job_id);
            Err(DatasetError::damaged(&group.path)(problem))
        }
    }
}

/// Expects so many rows of a job next; none are no group.
fn expect(
    groups: &mut impl Iterator<Item = Result<Group, DatasetError>>,
    job_id: &str,
    rows: u64,
    what: &str,
    last: &Path,
) -> Result<(), DatasetError> {
    if rows == 0 {
        return Ok(());
    }
    let problem = match groups.next().transpose()? {
        Some(group) if group.job_id == job_id && group.rows == rows => return Ok(()),
        Some(group) => {
            let found = format!("{} {what} of job {} where", group.rows, group.job_id);
            (group.path.to_path_buf(), found)
        }
        None => (last.to_owned(), "it ends where".to_owned()),
    };
    Err(DatasetError::damaged(&problem.0)(format!("{} {rows} {what} of job {job_id} are to be", problem.1)))
}
