//! Reduced data: whether they are up to date, by the content of the tables they were made from, as a copied folder has other
//! times; and their tables read back as rows.

use super::{BackboneBin, HistogramBin, Point, SetRow, reduce};
use crate::results::layout::Layout;
use crate::results::tables::JOBS;
use crate::results::{ErrorKind, Results, ResultsError};
use crate::table::checksum::hexadecimal;
use crate::table::columns::Table;
use crate::table::file::{DataFile, Dataset, Footer};
use crate::table::storage::StorageError;
use anyhow::Result;
use sha2::{Digest, Sha256};
use std::io;
use std::ops::Deref;
use tempfile::TempDir;

/// The footer's key of the source.
pub(super) const SOURCE: &str = "reduced_from";

/// A checksum of all sweeps of a directory, and of names and sizes of the committed files of jobs.
pub(super) fn source(results: &Results<'_>) -> Result<String, ResultsError> {
    let mut digest = Sha256::new();
    // All: which sets are controls follows from them.
    for sweep in results.plan().sweeps() {
        digest.update(sweep.text());
    }
    for path in results.dataset(JOBS)?.files() {
        digest.update(path.file_name().unwrap_or_default().as_encoded_bytes());
        digest.update(results.layout().storage.length(path)?.to_le_bytes());
    }
    Ok(hexadecimal(&digest.finalize()))
}

/// A directory whose reduced data are up to date. If nothing can be written there, they lie elsewhere as long as this lives.
pub struct Renewed<'a> {
    results: Results<'a>,
    _elsewhere: Option<TempDir>,
}

impl<'a> Deref for Renewed<'a> {
    type Target = Results<'a>;

    fn deref(&self) -> &Self::Target {
        &self.results
    }
}

/// Reduces the tables if the reduced data are out of date, and there are tables.
pub fn renew<'a>(results: &Results<'a>) -> Result<Renewed<'a>> {
    let renewed = Renewed {
        results: results.clone(),
        _elsewhere: None,
    };
    let layout = results.layout();
    let is_there = layout.storage.exists(&layout.reduced_file(SetRow::NAME))?;
    if is_there && !layout.storage.exists(&layout.table(JOBS))? {
        return Ok(renewed);
    }
    let source = Footer::empty().with(SOURCE, &source(results)?);
    let is_current = |table| {
        let file = DataFile::with_footer(layout.reduced_file(table), source.clone());
        file.check(layout.storage).is_ok()
    };
    if is_current(SetRow::NAME)
        && is_current(HistogramBin::NAME)
        && is_current(BackboneBin::NAME)
        && is_current(Point::NAME)
    {
        return Ok(renewed);
    }
    match reduce(results) {
        Ok(_) => Ok(renewed),
        Err(error) if is_read_only(&error) => {
            let elsewhere = tempfile::tempdir()?;
            let results = results.reduced_to(elsewhere.path());
            reduce(&results)?;
            Ok(Renewed {
                results,
                _elsewhere: Some(elsewhere),
            })
        }
        Err(error) if is_there => Err(error.context("the reduced data are out of date")),
        Err(error) => Err(error),
    }
}

/// Whether something failed because writing is not permitted.
fn is_read_only(error: &anyhow::Error) -> bool {
    let of_storage = error.downcast_ref().map(StorageError::kind);
    let of_results = error.downcast_ref().map(|error: &ResultsError| error.kind);
    let kind = of_storage.map(ErrorKind::Disk).or(of_results);
    let Some(ErrorKind::Disk(kind)) = kind else {
        return false;
    };
    matches!(
        kind,
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem
    )
}

/// An error of a table, with what to do.
pub fn advise(advice: &'static str) -> impl Fn(ResultsError) -> anyhow::Error {
    move |error| {
        let advised = format!("{error}; {advice}");
        anyhow::Error::new(error).context(advised)
    }
}

/// The rows of a reduced table, such as [`Point`](super::Point).
pub fn read_reduced<R: Table>(layout: &Layout<'_>) -> Result<Vec<R>, ResultsError> {
    let file = layout.reduced_file(R::NAME);
    let batches = Dataset::new(layout.storage, vec![file]).rows();
    let batches: Vec<Vec<R>> = batches.collect::<Result<_, _>>()?;
    Ok(batches.into_iter().flatten().collect())
}

/// The rows of the reduced sets, controls left out, in order.
pub fn read_sets<'a>(
    layout: &Layout<'a>,
) -> impl Iterator<Item = Result<SetRow, ResultsError>> + use<'a> {
    let file = layout.reduced_file(SetRow::NAME);
    let batches = Dataset::new(layout.storage, vec![file]).rows::<SetRow>();
    let rows = batches.flat_map(|batch| match batch {
        Ok(rows) => rows.into_iter().map(Ok).collect(),
        Err(error) => vec![Err(error)],
    });
    rows.filter(|row| !matches!(row, Ok(row) if row.is_control))
}
