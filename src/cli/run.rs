//! `stickslip run`: the missing jobs of a sweep, then reduced data and figures.

use super::exit::Exit;
use super::progress::Progress;
use super::{output, reduce};
use anyhow::{Context, Result};
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use stickslip::figure::draw_all;
use stickslip::run::{Options, RunReport, Shard, kernel};
use stickslip::store::manifest::Directory;
use stickslip::store::storage::Disk;
use stickslip::sweep::Sweep;

/// Run a sweep, or go on with it; then reduce and plot
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip run sweeps/fig3.toml
  stickslip run sweeps/fig3.toml --out /scratch/fig3 --threads 16
  stickslip run sweeps/fig3.toml --shard 2/8     the second of eight processes on one directory

Ctrl-C and SIGTERM keep what is done; the same command goes on from there.")]
pub struct Arguments {
    /// Sweep file
    #[arg(value_name = "SWEEP.toml")]
    sweep: PathBuf,
    /// Results directory [default: results/<name of the sweep>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<NonZeroUsize>,
    /// Run one share of N, beside other processes that run the others
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Run failed jobs again
    #[arg(long)]
    retry_failed: bool,
    /// Leave it at the tables
    #[arg(long)]
    no_reduce: bool,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

fn threads(text: &str) -> Result<NonZeroUsize, &'static str> {
    text.parse().map_err(|_| "must be a whole number >= 1")
}

/// Set by the first Ctrl-C or SIGTERM.
static STOP: AtomicBool = AtomicBool::new(false);

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let sweep = Sweep::from_file(&arguments.sweep)?;
    let root = arguments.out.clone().unwrap_or_else(|| PathBuf::from("results").join(sweep.name()));
    ctrlc::set_handler(|| {
        if STOP.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(Exit::Stopped as u8));
        }
    })
    .context("cannot catch Ctrl-C")?;
    let options = Options {
        threads: arguments.threads,
        stop: &STOP,
        retry_failed: arguments.retry_failed,
        shard: arguments.shard.unwrap_or_default(),
    };
    let (recording, solver) = (*sweep.recording(), sweep.solver());
    let mut progress = Progress::new();
    let report = stickslip::run::run(
        &Disk,
        &sweep,
        &root,
        options,
        &|job, interrupt| kernel(&job.parameters, &recording, solver, interrupt),
        &mut |event| progress.show(event),
    )?;
    if arguments.json {
        output::json(&report)?;
    } else {
        output::pairs(&described(&report))?;
    }
    if report.stopped {
        let left = output::count(report.jobs_left, "job");
        output::tell(&format!("stopped with {left} left; finished parts are kept. The same command goes on."));
        return Ok(Exit::Stopped);
    }
    if !arguments.no_reduce {
        let directory = Directory::read(&Disk, &root)?;
        let summary = reduce::reduce_directory(&directory)?;
        let figures = draw_all(&Disk, directory.layout())?;
        if !arguments.json {
            output::pairs(&reduce::described(&summary, directory.layout()))?;
            for path in figures {
                output::print(&format!("figure  {}\n", path.display()))?;
            }
        }
    }
    if report.jobs_failed > 0 {
        let failed = output::count(report.jobs_failed, "job");
        output::tell(&format!("{failed} failed; their reasons stand in tables/jobs. --retry-failed runs them again."));
        return Ok(Exit::Failed);
    }
    Ok(Exit::Done)
}

fn described(report: &RunReport) -> Vec<(&'static str, String)> {
    let mut pairs = vec![
        ("jobs run", format!("{}, {} failed", report.jobs_run, report.jobs_failed)),
        ("parts committed", report.parts_committed.to_string()),
    ];
    if report.jobs_run > 0 {
        let measured = output::duration(report.measured_cost);
        pairs.push(("CPU time", format!("{measured}, predicted {}", output::duration(report.predicted_cost))));
        pairs.push(("wall time", output::duration(report.wall)));
    }
    pairs
}
