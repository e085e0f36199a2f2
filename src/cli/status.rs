//! `stickslip status`: how far a results directory is.

use super::{Exit, layout, output};
use crate::results::Results;
use crate::run::{MAX_FAILURES, Present, Status};
use crate::table::shown::shown_text;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Show the state of a results directory: jobs done, failed and missing, workers, predicted time left
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip status results/fig3
  stickslip status results/fig3 --check     in a script: exit code 3 while jobs are missing")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// End with exit code 3 while jobs are missing
    #[arg(long)]
    check: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

const JSON_FORMAT: u32 = 3;

pub fn status(arguments: &Arguments) -> Result<Exit> {
    let results = Results::read_plan(&layout(&arguments.directory))?;
    let status = crate::run::status(&results, MAX_FAILURES)?;
    let overview = status.overview;
    if arguments.json {
        output::json(JSON_FORMAT, &status)?;
    } else {
        output::pairs(&pairs(&status))?;
        output::lines(status.workers.iter().map(worker_in_words))?;
        for failure in &status.failures {
            let job = &failure.job_id;
            let reason = shown_text(&failure.reason);
            let command = &failure.command;
            output::print(&format!("failed  {job}: {reason}\n  alone: {command}\n"))?;
        }
        if overview.jobs_failed > status.failures.len() as u64 {
            output::print(&output::by_reason(&status.failure_reasons))?;
        }
        let marked = status.marked.iter();
        output::lines(marked.map(|marked| format!("deaths  {marked}")))?;
    }
    Ok(if arguments.check && overview.jobs_missing > 0 {
        Exit::Stopped
    } else if overview.jobs_failed > 0 {
        Exit::Failed
    } else {
        Exit::Done
    })
}

fn pairs(status: &Status) -> Vec<(&'static str, String)> {
    let overview = &status.overview;
    let mut done = overview.jobs_done.to_string();
    if overview.jobs_kept > 0 {
        let kept = overview.jobs_kept;
        done = format!("{done}, {kept} of them of values that the sweep no longer has");
    }
    let parts_done = overview.parts_done;
    let parts = format!("{parts_done} done, {} missing", overview.parts_missing);
    let mut pairs = vec![
        ("sweep", status.name.clone()),
        ("jobs done", done),
        ("in unfinished parts", overview.jobs_spilled.to_string()),
        ("jobs failed", overview.jobs_failed.to_string()),
        ("jobs missing", overview.jobs_missing.to_string()),
        ("parts", parts),
        ("time left", time_left(status)),
    ];
    if status.parts_with_deaths > 0 {
        let parts = output::count(status.parts_with_deaths as u64, "missing part");
        let deaths = format!("of workers at {parts}: kills, unless the same part comes again");
        pairs.push(("deaths", deaths));
    }
    if let Some(rounds) = &status.rounds {
        pairs.push(("round", output::rounds(rounds)));
    }
    pairs
}

fn time_left(status: &Status) -> String {
    if status.overview.jobs_missing == 0 {
        return "nothing left to run".to_owned();
    }
    let cost = status.overview.predicted_cost_missing;
    let left = match status.time_left {
        Some(seconds) => format!("{} at the pace so far", output::duration(seconds)),
        None => format!("{} of CPU time predicted", output::duration(cost)),
    };
    match &status.rounds {
        Some(rounds) if !rounds.is_over => left + ", of this round",
        _ => left,
    }
}

fn worker_in_words(worker: &Present) -> String {
    let host = shown_text(&worker.host);
    let threads = output::count(worker.threads as u64, "thread");
    format!(
        "worker  process {} on {host}: {threads}, {:.2} jobs/s, last beat {:.0} s ago",
        worker.process, worker.jobs_per_second, worker.last_beat
    )
}
