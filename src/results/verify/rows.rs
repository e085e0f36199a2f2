//! Rows of all tables held against each other: the planned jobs in their order, each with as many slips and precursors
//! as the jobs table says.

use crate::results::tables;
use crate::table::file::{Batch, DatasetError, Reader};
use crate::table::storage::Storage;
use arrow_array::Array;
use std::path::{Path, PathBuf};

/// The file of each table, that of the jobs last.
pub(super) type Files = Vec<(&'static str, PathBuf)>;

/// Goes through all rows, and compares them with the ids of the planned jobs.
///
/// # Errors
/// When rows are missing, in excess, or in another order than the jobs.
pub(super) fn check_rows(
    storage: &dyn Storage,
    files: &Files,
    mut planned: impl Iterator<Item = String>,
) -> Result<(), DatasetError> {
    let Some(((_, jobs_file), others)) = files.split_last() else { return Ok(()) };
    let number = |table| (table == tables::slips().name).then_some("slip");
    let mut others: Vec<_> =
        others.iter().map(|(table, path)| (*table, path, rows(storage, path, number(*table)))).collect();
    for batch in Reader::new(storage, vec![jobs_file.clone()], None) {
        let batch = batch?;
        let ids = batch.texts("job_id")?;
        for row in 0..ids.len() {
            let (id, expected) = (ids.value(row), planned.next());
            if expected.as_deref() != Some(id) {
                let expected = expected.as_deref().unwrap_or("none");
                return damaged(jobs_file, format!("it has job {id} where the plan has {expected}"));
            }
            for (table, path, rows) in &mut others {
                let counts = batch.counts(table)?;
                let count = if counts.is_valid(row) { counts.value(row) } else { 0 };
                expect(rows, path, table, id, count)?;
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

/// A row: the id of its job, and its number within it if the table has one.
type Row = (String, Option<i64>);

/// The rows of a file. `number` is the column of their numbers.
fn rows(
    storage: &dyn Storage,
    path: &Path,
    number: Option<&'static str>,
) -> impl Iterator<Item = Result<Row, DatasetError>> {
    let batches = Reader::new(storage, vec![path.to_owned()], None);
    batches.flat_map(move |batch| match batch.and_then(|batch| rows_of(&batch, number)) {
        Ok(rows) => rows.into_iter().map(Ok).collect(),
        Err(error) => vec![Err(error)],
    })
}

fn rows_of(batch: &Batch, number: Option<&str>) -> Result<Vec<Row>, DatasetError> {
    let (ids, numbers) = (batch.texts("job_id")?, number.map(|number| batch.counts(number)).transpose()?);
    let row = |row: usize| (ids.value(row).to_owned(), numbers.map(|numbers| numbers.value(row)));
    Ok((0..ids.len()).map(row).collect())
}

/// Expects so many rows of a job next.
fn expect(
    rows: &mut impl Iterator<Item = Result<Row, DatasetError>>,
    path: &Path,
    table: &str,
    id: &str,
    count: i64,
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
