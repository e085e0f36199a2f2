//! Report: a results directory as one HTML page to explore in a browser, which loads nothing else.
//!
//! ```text
//! reduced_columns.rs    reduced tables, column by column: the sets, their histograms
//! slips.rs              slips, or a sample of them
//! content.rs            both, with the sweep, how far it is, its cost and its runs
//! page.rs               content and page.html, style.css, *.js -> one file
//! ```
//!
//! No chart library: the crate `plotly` 0.14 would bring 7.6 MB of scripts into the program, and 1.9 MB into each page,
//! compressed. `chart.js` draws 100,000 points on a canvas, and no more is needed.

mod content;
mod page;
mod reduced_columns;
mod slips;

use crate::reduce::{WRITER, renew};
use crate::results::Results;
use crate::results::commit::{Commit, exclusive_lock};
use anyhow::{Context, Result};
use std::path::PathBuf;
use std::time::Duration;

/// What to do about a table that cannot be read.
const ADVICE: &str = "`stickslip verify` says what to do about damage";

/// The report of a directory as HTML. Reduces the tables first if the reduced data are out of date.
///
/// With `refresh`, the page says that a run is in progress, and reloads itself after about this time.
pub fn page(results: &Results<'_>, refresh: Option<Duration>) -> Result<String> {
    let results = renew(results)?;
    page::html(&content::content(&results, refresh)?).context("the report cannot be encoded")
}

/// Writes the report of a directory to `report.html` in it, over an earlier one, and returns its path.
pub fn write(results: &Results<'_>, refresh: Option<Duration>) -> Result<PathBuf> {
    let layout = results.layout();
    let page = page(results, refresh)?;
    let _alone = exclusive_lock(layout, WRITER)?;
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
    commit.stage_bytes(&layout.report(), page.as_bytes())?;
    results.publish(commit)?;
    Ok(layout.report())
}
