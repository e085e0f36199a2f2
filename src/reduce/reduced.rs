//! Reduced data: what they follow from, so that those of other tables are known as such, by content, as a copied folder has
//! other times; and their tables back as rows.

use super::{BackboneBin, HistogramBin, Point, SetRow, reduce};
use crate::results::layout::Layout;
use crate::results::tables::JOBS;
use crate::results::{ErrorKind, Results, ResultsError};
use crate::table::checksum::hexadecimal;
use crate::table::columns::{FromRow, Table};
use crate::table::file::{DataFile, Dataset, Footer};
use crate::table::storage::StorageError;
use anyhow::Result;
use sha2::{Digest, Sha256};
use std::io;
use std::ops::Deref;
use tempfile::TempDir;

/// The footer's key of the source.
pub(super) const SOURCE: &str = "reduced_from";

/// A checksum of the sweep that was asked for last, and of names and sizes of the committed files of jobs.
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

/// A directory whose reduced data are of its tables. They lie elsewhere, as long as this lives, where nothing can be written.
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

/// Reduces the tables unless the reduced data are of the tables as they are, or there are no tables any more.
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
    let is_of_it = |table: &&str| {
        let file = DataFile::with_footer(layout.reduced_file(table), source.clone());
        file.check(layout.storage).is_ok()
    };
    if [
        SetRow::NAME,
        HistogramBin::NAME,
        BackboneBin::NAME,
        Point::NAME,
    ]
    .iter()
    .all(is_of_it)
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

/// Whether something failed as nothing may be written.
fn is_read_only(error: &anyhow::Error) -> bool {
    let of_storage = error
        .downcast_ref()
        .map(StorageError::kind)
        .map(ErrorKind::Disk);
    let kind = of_storage.or_else(|| Some(error.downcast_ref::<ResultsError>()?.kind));
    matches!(
        kind,
        Some(ErrorKind::Disk(
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem
        ))
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
pub fn read_reduced<R: FromRow + Table>(layout: &Layout<'_>) -> Result<Vec<R>, ResultsError> {
    let batches = Dataset::new(layout.storage, vec![layout.reduced_file(R::NAME)]).rows();
    Ok(batches
        .collect::<Result<Vec<Vec<R>>, _>>()?
        .into_iter()
        .flatten()
        .collect())
}

/// The sets with at least one interval or a regime, controls left out, in order, if there are at most `max` of them; else none.
pub fn read_sets(layout: &Layout<'_>, max: usize) -> Result<Vec<SetRow>, ResultsError> {
    let mut sets = Vec::new();
    for batch in
        Dataset::new(layout.storage, vec![layout.reduced_file(SetRow::NAME)]).rows::<SetRow>()
    {
        let rows = batch?.into_iter().filter(|row| !row.is_control);
        sets.extend(rows.filter(|row| row.intervals > 0 || row.regime.is_some()));
        if sets.len() > max {
            return Ok(Vec::new());
        }
    }
    Ok(sets)
}
