//! `stickslip plan`: what would run. Nothing is written.

use super::exit::Exit;
use super::output;
use super::sweep::{self, PresetFlag, Variation};
use crate::results::layout::Layout;
use crate::results::rounds::RoundsSoFar;
use crate::results::{ErrorKind, Results};
use crate::run::{Overview, status};
use crate::sweep::{Bounds, Extension, Plan, Sweep};
use crate::table::shown::{serialize_path, shown};
use crate::table::storage::{Disk, Storage};
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use serde_json::{Value as Json, json};
use std::path::PathBuf;

/// Show what a sweep would run and what is done: jobs, parts, predicted cost. Nothing is written
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip plan sweeps/fig3.toml --json
  stickslip plan --preset fig3
  stickslip plan sweeps/fig3.toml --out /scratch/fig3
  stickslip plan sweeps/fig3.toml --set slips=100 --axis V0=log:1e-5:1e-3:9")]
pub struct Arguments {
    /// Sweep file
    #[arg(value_name = "SWEEP.toml", required_unless_present = "preset")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    #[command(flatten)]
    variation: Variation,
    /// Results directory to compare with, if it is there [default: results/<name of the sweep>; none with --set or --axis]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Version of [`Report`] as JSON.
const FORMAT: u32 = 1;

/// Bytes of memory that a worker takes beside its jobs, for the program, commits and the reduction; and for each thread, for
/// a contact of its job, and for a slip of a part that is not whole yet. As measured, rounded up.
const MEMORY: f64 = 80e6;
const MEMORY_OF_A_CONTACT: f64 = 350.0;
const MEMORY_OF_A_SLIP: f64 = 600.0;

#[derive(Serialize)]
struct Report {
    name: String,
    /// Keys that each axis moves, and its number of points.
    axes: Vec<Json>,
    points: u64,
    jobs: u64,
    parts: u64,
    slips: u64,
    predicted_cpu_seconds: f64,
    predicted_wall_seconds: f64,
    threads: usize,
    worker_memory_bytes: f64,
    thread_memory_bytes: f64,
    /// What all rounds of a sweep that decides for itself may add up to; the numbers above are those of the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    at_most: Option<Bounds>,
    directory: Option<Directory>,
}

/// What of the sweep is in its results directory, or why it cannot be run there.
#[derive(Serialize)]
struct Directory {
    #[serde(serialize_with = "serialize_path")]
    path: PathBuf,
    refused: Option<String>,
    #[serde(flatten)]
    overview: Option<Overview>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rounds: Option<RoundsSoFar>,
}

impl Directory {
    /// `None` if there is none yet.
    fn of(sweep: &Sweep, root: PathBuf) -> Result<Option<Self>> {
        if !Disk.exists(&root)? {
            return Ok(None);
        }
        let layout = Layout::new(&Disk, &root);
        let found = Results::preview(&layout, sweep).and_then(|results| status(&results));
        let (refused, overview, rounds) = match found {
            Ok(status) => (None, Some(status.overview), status.rounds),
            Err(error) if error.kind == ErrorKind::Refused => (Some(error.to_string()), None, None),
            Err(error) => return Err(error.into()),
        };
        Ok(Some(Self { path: root, refused, overview, rounds }))
    }

    fn in_words(&self) -> String {
        let path = shown(&self.path);
        let round =
            self.rounds.as_ref().map_or_else(String::new, |rounds| format!("; round {}", output::rounds(rounds)));
        match (&self.overview, &self.refused) {
            (Some(overview), _) => format!(
                "{path}: {} done, {} failed, {} to run; {} kept that the sweep no longer has{round}",
                overview.jobs_done, overview.jobs_failed, overview.jobs_missing, overview.jobs_kept
            ),
            (None, refused) => format!("refused: {}", refused.as_deref().unwrap_or_default()),
        }
    }
}

pub fn plan(arguments: &Arguments) -> Result<Exit> {
    let changes = sweep::changes(&arguments.variation)?;
    let sweep = sweep::read(arguments.sweep.as_deref(), arguments.preset.preset, &changes)?;
    output::warn(&sweep.warnings());
    let default = changes.is_empty().then(|| Layout::default_root(&sweep));
    let root = arguments.out.clone().or(default);
    let totals = Plan::new(&[Extension::new(&sweep, &[])]).totals();
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let report = Report {
        name: sweep.name().to_owned(),
        axes: sweep.axes().map(|(keys, points)| json!({ "keys": keys, "points": points })).collect(),
        points: sweep.point_count(),
        jobs: totals.jobs,
        parts: totals.parts,
        slips: totals.jobs.saturating_mul(sweep.recording().slips),
        predicted_cpu_seconds: totals.cost,
        predicted_wall_seconds: totals.cost / threads as f64,
        threads,
        worker_memory_bytes: MEMORY,
        thread_memory_bytes: MEMORY_OF_A_CONTACT * totals.contacts as f64 + MEMORY_OF_A_SLIP * totals.slips_of_part,
        at_most: sweep.bounds(),
        directory: root.map_or(Ok(None), |root| Directory::of(&sweep, root))?,
    };
    if arguments.json {
        output::json(FORMAT, &report)?;
    } else {
        let axes: Vec<String> = sweep.axes().map(|(keys, points)| format!("{keys} ({points})")).collect();
        let directory =
            report.directory.as_ref().map_or("none yet: all jobs are to run".to_owned(), Directory::in_words);
        let (choice, which) = match report.at_most {
            Some(_) => (", from which the rounds choose", "in the first round, to which the numbers below refer"),
            None if sweep.recording().control => ("", "after conditions and duplicates, and their controls"),
            None => ("", "after conditions and duplicates"),
        };
        let mut pairs = vec![
            ("sweep", report.name),
            ("axes", if axes.is_empty() { "none: a single point".to_owned() } else { axes.join(" x ") }),
            ("grid points", format!("{}{choice}", report.points)),
            ("jobs", format!("{} {which}", report.jobs)),
            ("parts", report.parts.to_string()),
            ("slips to record", report.slips.to_string()),
            (
                "predicted CPU time",
                format!("{}, {:.1} core-hours", output::duration(totals.cost), totals.cost / 3600.0),
            ),
            ("predicted wall time", format!("{} on {threads} cores", output::duration(report.predicted_wall_seconds))),
            (
                "worker memory",
                format!(
                    "{} and {} for each thread",
                    output::memory(MEMORY),
                    output::memory(report.thread_memory_bytes)
                ),
            ),
        ];
        if let Some(Bounds { sets, jobs, predicted_cost }) = report.at_most {
            let cost = output::duration(predicted_cost);
            pairs.push(("all rounds", format!("at most {sets} sets, {jobs} jobs, {cost} of CPU time")));
        }
        pairs.push(("directory", directory));
        output::pairs(&pairs)?;
    }
    Ok(Exit::Done)
}
