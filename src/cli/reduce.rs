//! `stickslip reduce`: tables to reduced data.

use super::{Exit, layout, output};
use crate::reduce::ReductionSummary;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::table::shown::shown;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Reduce the tables of a results directory to Fig. 3-style data
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  stickslip reduce results/fig3 --json")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

const JSON_FORMAT: u32 = 2;

pub fn reduce(arguments: &Arguments) -> Result<Exit> {
    let results = Results::read(&layout(&arguments.directory))?;
    let summary = crate::reduce::reduce(&results)?;
    if arguments.json {
        output::json(JSON_FORMAT, &summary)?;
    } else {
        output::pairs(&summary_lines(&summary, results.layout()))?;
    }
    report_missing(&results)?;
    Ok(if summary.failed_jobs > 0 {
        Exit::Failed
    } else {
        Exit::Done
    })
}

pub fn report_missing(results: &Results<'_>) -> Result<()> {
    if let Some(unfinished) = output::unfinished(results)? {
        output::report(&format!("reduced what is there: {unfinished}"));
    }
    Ok(())
}

pub fn summary_lines(
    summary: &ReductionSummary,
    layout: &Layout<'_>,
) -> Vec<(&'static str, String)> {
    let failed = match summary.failed_jobs {
        0 => String::new(),
        failed => format!(", {failed} failed"),
    };
    let jobs = format!("{}{failed}", summary.jobs);
    let sets = if summary.backbone.is_empty() {
        // There is no modulation.
        summary.sets.to_string()
    } else {
        let phased = summary.phased_sets;
        format!("{}, {phased} of them with a preferred phase", summary.sets)
    };
    vec![
        ("jobs reduced", jobs),
        ("parameter sets", sets),
        ("slips", summary.slips.to_string()),
        ("reduced data", shown(&layout.reduced()).to_string()),
    ]
}
