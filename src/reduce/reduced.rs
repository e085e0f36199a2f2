//! Reduced tables back as rows, for figures.

use super::SetRow;
use crate::results::ResultsError;
use crate::results::layout::Layout;
use crate::table::columns::{FromRow, Table};
use crate::table::file::Dataset;

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
    Ok(batches.collect::<Result<Vec<Vec<R>>, _>>()?.into_iter().flatten().collect())
}

/// The sets with at least one interval or a regime, controls left out, in order, if there are at most `max` of them; else none.
pub fn read_sets(layout: &Layout<'_>, max: usize) -> Result<Vec<SetRow>, ResultsError> {
    let mut sets = Vec::new();
    for batch in Dataset::new(layout.storage, vec![layout.reduced_file(SetRow::NAME)]).rows::<SetRow>() {
        let rows = batch?.into_iter().filter(|row| !row.is_control);
        sets.extend(rows.filter(|row| row.intervals > 0 || row.regime.is_some()));
        if sets.len() > max {
            return Ok(Vec::new());
        }
    }
    Ok(sets)
}
