//! `stickslip status`: how far a results directory is.

use super::exit::Exit;
use super::output;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::run::{Failure, Overview, Present};
use crate::table::shown::shown_text;
use crate::table::storage::Disk;
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

/// Version of [`Status`](crate::run::Status) as JSON.
const FORMAT: u32 = 3;

pub fn status(arguments: &Arguments) -> Result<Exit> {
    let results = Results::read_plan(&Layout::new(&Disk, &arguments.directory))?;
    let status = crate::run::status(&results)?;
    let overview = status.overview;
    if arguments.json {
        output::json(FORMAT, &status)?;
    } else {
        let left = match (overview.jobs_missing, status.time_left) {
            (0, _) => "nothing left to run".to_owned(),
            (_, Some(seconds)) => format!("{} at the pace so far", output::duration(seconds)),
            (_, None) => format!(
                "{} of CPU time predicted",
                output::duration(overview.predicted_cost_missing)
            ),
        };
        let goes_on = status.rounds.as_ref().is_some_and(|rounds| !rounds.is_over)
            && overview.jobs_missing > 0;
        let left = if goes_on {
            format!("{left}, of this round")
        } else {
            left
        };
        let kept = match overview.jobs_kept {
            0 => String::new(),
            kept => format!(", {kept} of them kept of values that the sweep no longer has"),
        };
        let mut pairs = vec![
            ("sweep", status.name.clone()),
            ("jobs done", format!("{}{kept}", overview.jobs_done)),
            ("kept for later", overview.jobs_spilled.to_string()),
            ("jobs failed", overview.jobs_failed.to_string()),
            ("jobs missing", overview.jobs_missing.to_string()),
            (
                "parts",
                format!(
                    "{} done, {} missing",
                    overview.parts_done, overview.parts_missing
                ),
            ),
            ("time left", left),
        ];
        if status.cut.jobs > 0 {
            let each = status.cut.slips as f64 / status.cut.jobs as f64;
            let off = format!(
                "{}, with {each:.1} slips each: tau_mean is too short by about cv^2/{each:.1}, as stickslip show says",
                status.cut.jobs
            );
            pairs.push(("cut by max_time", off));
        }
        pairs.extend(
            status
                .rounds
                .as_ref()
                .map(|rounds| ("round", output::rounds(rounds))),
        );
        output::pairs(&pairs)?;
        for Present { worker, last_beat } in &status.workers {
            output::print(&format!(
                "worker  process {} on {}: {}, {:.2} jobs/s, last beat {last_beat:.0} s ago\n",
                worker.process,
                shown_text(&worker.host),
                output::count(worker.threads as u64, "thread"),
                worker.jobs_per_second
            ))?;
        }
        for Failure {
            job_id,
            reason,
            command,
        } in &status.failures
        {
            output::print(&format!(
                "failed  {job_id}: {}\n  alone: {command}\n",
                shown_text(reason)
            ))?;
        }
        if overview.jobs_failed > status.failures.len() as u64 {
            output::print(&output::by_reason(&status.failure_reasons))?;
        }
        for marked in &status.marked {
            output::print(&format!("deaths  {marked}\n"))?;
        }
    }
    Ok(match overview {
        Overview {
            jobs_missing: 1.., ..
        } if arguments.check => Exit::Stopped,
        Overview {
            jobs_failed: 1.., ..
        } => Exit::Failed,
        _ => Exit::Done,
    })
}
