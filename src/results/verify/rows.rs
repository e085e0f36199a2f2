//! Rows of all tables held against each other: the planned jobs in their order, each with as many slips and precursors
//! as the jobs table says.

use crate::results::Results;
use crate::results::tables::{self, JobOutcome, RowOfJob};
use crate::table::columns::columns;
use crate::table::file::{Dataset, DatasetError};
use std::path::{Path, PathBuf};

/// The file of each table, that of the jobs last.
pub(super) type Files = Vec<(&'static str, PathBuf)>;

/// Goes through all rows, and compares them with the ids of the planned jobs. A job that may run again, as it failed or was
/// ended by a shorter limit, may have further rows than it says, numbered on: a run that was killed while it replaced them
/// left them, and the same command puts that right.
pub(super) fn check_rows(
    results: &Results<'_>,
    files: &Files,
    mut planned: impl Iterator<Item = String>,
) -> Result<(), DatasetError> {
    let Some(((_, jobs_file), others)) = files.split_last() else { return Ok(()) };
    let dataset = |path: &PathBuf| Dataset::new(results.layout().storage, vec![path.clone()]);
    let rows_of = |path, table| rows(dataset(path), table).peekable();
    let mut others: Vec<_> = others.iter().map(|(table, path)| (*table, path, rows_of(path, table))).collect();
    for batch in dataset(jobs_file).rows::<JobCounts>() {
        for job in batch? {
            let expected = planned.next();
            if expected.as_deref() != Some(&job.job_id) {
                let expected = expected.as_deref().unwrap_or("none");
                return damaged(jobs_file, format!("it has job {} where the plan has {expected}", job.job_id));
            }
            for (table, path, rows) in &mut others {
                let count = if *table == tables::SLIPS { job.slips } else { job.precursors };
                let mut number = count.unwrap_or(0);
                expect(rows, path, table, &job.job_id, number)?;
                let may_run_again = match job.outcome {
                    JobOutcome::Failed => true,
                    JobOutcome::TimeLimit => results.is_cut(job.simulated_time),
                    _ => false,
                };
                let is_next = |row: &Result<Row, DatasetError>, number| matches!(row, Ok((id, found)) if *id == job.job_id && found.is_none_or(|found| found == number));
                while may_run_again && rows.next_if(|row| is_next(row, number)).is_some() {
                    number += 1;
                }
            }
        }
    }
    if let Some(id) = planned.next() {
        return damaged(jobs_file, format!("it ends where the plan has job {id}"));
    }
    for (_, path, mut rows) in others {
        if let Some((id, _)) = rows.next().transpose()? {
            return damaged(path, format!("it has rows of job {id} in excess"));
        }
    }
    Ok(())
}

columns! {
    /// What the jobs table says about the rows of a job in other tables.
    struct JobCounts {
        job_id: String;
        outcome: JobOutcome;
        simulated_time: Option<f64>;
        slips: Option<u64>;
        precursors: Option<u64>;
    }
}

columns! {
    /// A slip of a job.
    struct SlipOfJob {
        job_id: String;
        number as "slip": u64;
    }
}

/// A row: the id of its job, and its number within it if the table has one.
type Row = (String, Option<u64>);

/// The rows of a table.
fn rows<'a>(dataset: Dataset<'a>, table: &str) -> Box<dyn Iterator<Item = Result<Row, DatasetError>> + 'a> {
    if table == tables::SLIPS {
        Box::new(flat(dataset.rows(), |row: SlipOfJob| (row.job_id, Some(row.number))))
    } else {
        Box::new(flat(dataset.rows(), |row: RowOfJob| (row.job_id, None)))
    }
}

/// Rows one by one, as ids and numbers.
fn flat<R>(
    batches: impl Iterator<Item = Result<Vec<R>, DatasetError>>,
    row: fn(R) -> Row,
) -> impl Iterator<Item = Result<Row, DatasetError>> {
    batches.flat_map(move |batch| match batch {
        Ok(rows) => rows.into_iter().map(row).map(Ok).collect(),
        Err(error) => vec![Err(error)],
    })
}

/// Expects `count` rows of a job next.
fn expect(
    rows: &mut impl Iterator<Item = Result<Row, DatasetError>>,
    path: &Path,
    table: &str,
    id: &str,
    count: u64,
) -> Result<(), DatasetError> {
    for expected in 0..count {
        match rows.next().transpose()? {
            Some((job, number)) if job == id && number.is_none_or(|number| number == expected) => (),
            Some((job, _)) if job == id => {
                return damaged(path, format!("row {} of job {id} has another number", expected + 1));
            }
            Some((job, _)) => {
                return damaged(path, format!("it has job {job} where {count} {table} of job {id} are expected"));
            }
            None => return damaged(path, format!("it ends where {count} {table} of job {id} are expected")),
        }
    }
    Ok(())
}

fn damaged<T>(path: &Path, problem: String) -> Result<T, DatasetError> {
    Err(DatasetError::damaged(path)(problem))
}
