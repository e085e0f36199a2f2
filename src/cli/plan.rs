//! `stickslip plan`: what would run. Nothing is written.

use super::exit::Exit;
use super::output;
use super::sweep::{self, PresetFlag, Variation};
use crate::results::layout::Layout;
use crate::results::rounds::RoundsSoFar;
use crate::results::{ErrorKind, Results};
use crate::run::threads::{self, Threads};
use crate::run::{Overview, status};
use crate::sweep::{Bounds, Extension, Plan, Sweep};
use crate::table::shown::{serialize_path, shown, shown_bytes};
use crate::table::storage::{Disk, Storage};
use crate::table::value::floored;
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
    /// Sweep file, or results directory
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

/// Version of the JSON.
const FORMAT: u32 = 2;

/// Bytes of memory that a worker takes beside its jobs, for the program, commits and the reduction. As measured, rounded up.
const MEMORY: f64 = 80e6;

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
        Ok(Some(Self {
            path: root,
            refused,
            overview,
            rounds,
        }))
    }

    fn in_words(&self) -> String {
        let Some(Overview {
            jobs_done,
            jobs_spilled,
            jobs_failed,
            jobs_kept,
            jobs_missing,
            ..
        }) = &self.overview
        else {
            return format!("refused: {}", self.refused.as_deref().unwrap_or_default());
        };
        let (path, own) = (shown(&self.path), jobs_done - jobs_kept);
        let kept = format!("; {jobs_kept} more done that the sweep no longer has");
        let kept = if *jobs_kept == 0 { "" } else { &kept };
        let round = self.rounds.as_ref().map_or_else(String::new, |rounds| {
            format!("; round {}", output::rounds(rounds))
        });
        format!(
            "{path}: {own} done, {jobs_spilled} kept for later, {jobs_failed} failed, {jobs_missing} to run{kept}{round}"
        )
    }
}

pub fn plan(arguments: &Arguments) -> Result<Exit> {
    let changes = sweep::changes(&arguments.variation)?;
    let sweep = sweep::read(
        arguments.sweep.as_deref(),
        arguments.preset.preset,
        &changes,
    )?;
    output::warn(&sweep.warnings());
    let default = changes.is_empty().then(|| Layout::default_root(&sweep));
    let root = arguments.out.clone().or(default);
    if let Some(root) = &root {
        sweep::warn_of_partitions(root, &sweep);
    }
    let totals = Plan::new(&[Extension::new(&sweep, &[])]).totals();
    let threads = Threads::choose(None, |variable| std::env::var_os(variable))?;
    let threads = threads::or_all_cores(threads.count);
    let wall_time = totals.cost / threads as f64;
    let thread_memory = totals.memory + totals.memory_of_slips;
    let slips = floored(totals.slips.round());
    // What all rounds of a sweep that decides for itself may add up to; the other numbers are those of the first.
    let at_most = sweep.bounds();
    let directory = root.map_or(Ok(None), |root| Directory::of(&sweep, root))?;
    if arguments.json {
        let axes: Vec<Json> = sweep
            .axes()
            .map(|(keys, points)| json!({ "keys": keys, "points": points }))
            .collect();
        let mut report = json!({
            "name": sweep.name(),
            "axes": axes,
            "points": sweep.point_count(),
            "jobs": totals.jobs,
            "parts": totals.parts,
            "slips": slips,
            "predicted_cpu_seconds": totals.cost,
            "predicted_wall_seconds": wall_time,
            "threads": threads,
            "worker_memory_bytes": MEMORY,
            "thread_memory_bytes": thread_memory,
            "directory": directory,
        });
        if let Some(at_most) = at_most {
            report["at_most"] = json!(at_most);
        }
        output::json(FORMAT, &report)?;
    } else {
        let axes: Vec<String> = sweep
            .axes()
            .map(|(keys, points)| format!("{keys} ({points})"))
            .collect();
        let directory = directory.map_or("none yet: all jobs are to run".to_owned(), |directory| {
            directory.in_words()
        });
        let (choice, which) = match at_most {
            Some(_) => (
                ", from which the rounds choose",
                "in the first round, to which the numbers below refer",
            ),
            None if sweep.recording().control => {
                ("", "after conditions and duplicates, and their controls")
            }
            None => ("", "after conditions and duplicates"),
        };
        let mut pairs = vec![
            ("sweep", sweep.name().to_owned()),
            (
                "axes",
                if axes.is_empty() {
                    "none: a single point".to_owned()
                } else {
                    axes.join(" x ")
                },
            ),
            ("grid points", format!("{}{choice}", sweep.point_count())),
            ("jobs", format!("{} {which}", totals.jobs)),
            ("parts", totals.parts.to_string()),
            ("slips to record", slips.to_string()),
            (
                "predicted CPU time",
                format!(
                    "{}, {:.1} core-hours",
                    output::duration(totals.cost),
                    totals.cost / 3600.0
                ),
            ),
            (
                "predicted wall time",
                format!(
                    "{} on {}",
                    output::duration(wall_time),
                    output::count(threads as u64, "thread")
                ),
            ),
            (
                "worker memory",
                format!(
                    "{} and {} for each thread",
                    shown_bytes(MEMORY),
                    shown_bytes(thread_memory)
                ),
            ),
        ];
        if let Some(Bounds {
            sets,
            jobs,
            predicted_cost,
        }) = at_most
        {
            let cost = output::duration(predicted_cost);
            pairs.push((
                "all rounds",
                format!("at most {sets} sets, {jobs} jobs; estimated CPU time {cost}"),
            ));
        }
        pairs.push(("directory", directory));
        output::pairs(&pairs)?;
    }
    Ok(Exit::Done)
}
