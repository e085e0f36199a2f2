//! `stickslip plan`: what would run. Nothing is written.

use super::sweep::{self, PresetFlag, Variation};
use super::{Exit, output};
use crate::results::layout::Layout;
use crate::results::next_round::RoundsSoFar;
use crate::results::{ErrorKind, Results};
use crate::run::limits::{self, Threads};
use crate::run::{MAX_FAILURES, Overview, status};
use crate::sweep::{Bounds, Extension, LARGE, Plan, Sweep};
use crate::table::shown::{serialize_path, shown, shown_bytes};
use crate::table::storage::{Disk, Storage};
use crate::table::value::floored;
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use std::num::NonZeroUsize;
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
    #[arg(value_name = "SWEEP.toml|DIR", required_unless_present = "preset")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    #[command(flatten)]
    variation: Variation,
    /// Results directory to compare with, if it is there [default: the one named, or results/<name of the sweep>; none
    /// with --set or --axis]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads [default: those that the batch system grants, else all cores]
    #[arg(long, value_name = "N", value_parser = limits::parse_threads)]
    threads: Option<NonZeroUsize>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

const JSON_FORMAT: u32 = 2;

/// What a sweep would run.
#[derive(Serialize)]
struct Forecast<'a> {
    name: &'a str,
    axes: Vec<AxisInBrief>,
    points: u64,
    jobs: u64,
    parts: u64,
    slips: usize,
    predicted_cpu_seconds: f64,
    predicted_wall_seconds: f64,
    threads: usize,
    longest_job_cpu_seconds: f64,
    /// Its command; `None` without jobs.
    longest_job: Option<String>,
    worker_memory_bytes: f64,
    thread_memory_bytes: f64,
    /// Of all threads.
    address_space_bytes: f64,
    directory: Option<DirectoryState>,
    /// What all rounds of an adaptive sweep may add up to; the other numbers are those of the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    at_most: Option<Bounds>,
}

#[derive(Serialize)]
struct AxisInBrief {
    keys: String,
    points: u64,
}

/// How much of the sweep is in its results directory, or why it cannot be run there.
#[derive(Serialize)]
struct DirectoryState {
    #[serde(serialize_with = "serialize_path")]
    path: PathBuf,
    refused: Option<String>,
    #[serde(flatten)]
    overview: Option<Overview>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rounds: Option<RoundsSoFar>,
}

pub fn plan(arguments: &Arguments) -> Result<Exit> {
    let changes = sweep::changes(&arguments.variation)?;
    let sweep = sweep::read(arguments.sweep.as_deref(), arguments.preset, &changes)?;
    output::warn(&sweep.warnings());
    let default = || sweep::root(arguments.sweep.as_deref(), &sweep);
    let given = arguments.out.clone();
    let root = given.or_else(|| changes.is_empty().then(default));
    if let Some(root) = &root {
        sweep::warn_of_partitions(root, &sweep);
    }
    let threads = Threads::choose(arguments.threads, |variable| std::env::var_os(variable))?;
    let threads = limits::or_all_cores(threads.count);
    let directory = root.map_or(Ok(None), |root| DirectoryState::of(&sweep, root))?;
    let forecast = Forecast::new(&sweep, threads, directory);
    if arguments.json {
        output::json(JSON_FORMAT, &forecast)?;
    } else {
        output::pairs(&forecast.pairs(&sweep))?;
    }
    // As `run` would.
    let directory = forecast.directory.as_ref();
    let is_refused = directory.is_some_and(|directory| directory.refused.is_some());
    Ok(if is_refused { Exit::Usage } else { Exit::Done })
}

impl<'a> Forecast<'a> {
    fn new(sweep: &'a Sweep, threads: usize, directory: Option<DirectoryState>) -> Self {
        let totals = Plan::new(&[Extension::new(sweep, &[])]).totals();
        let axes = sweep.axes();
        let longest = totals.longest.as_ref();
        let longest_cost = longest.map_or(0.0, |job| job.cost);
        let thread_memory = totals.memory + totals.memory_of_slips;
        let of_large_jobs = match totals.memory {
            small if small < LARGE => 0.0,
            _ => thread_memory * threads as f64,
        };
        Self {
            name: sweep.name(),
            axes: axes
                .map(|(keys, points)| AxisInBrief { keys, points })
                .collect(),
            points: sweep.point_count(),
            jobs: totals.jobs,
            parts: totals.parts,
            slips: floored(totals.slips.round()),
            predicted_cpu_seconds: totals.cost,
            predicted_wall_seconds: (totals.cost / threads as f64).max(longest_cost),
            threads,
            longest_job_cpu_seconds: longest_cost,
            longest_job: longest.map(|job| sweep.command(job)),
            worker_memory_bytes: limits::OF_A_WORKER,
            thread_memory_bytes: thread_memory,
            address_space_bytes: limits::address_space(threads) + of_large_jobs,
            directory,
            at_most: sweep.bounds(),
        }
    }

    fn pairs(&self, sweep: &Sweep) -> Vec<(&'static str, String)> {
        let briefs = self.axes.iter();
        let with_points = briefs.map(|axis| format!("{} ({})", axis.keys, axis.points));
        let axes = match &*with_points.collect::<Vec<_>>() {
            [] => "none: a single point".to_owned(),
            axes => axes.join(" x "),
        };
        let (choice, which) = match self.at_most {
            Some(_) => (
                ", from which the rounds choose",
                "in the first round, to which the numbers below refer",
            ),
            None if sweep.recording().control => {
                ("", "after conditions and duplicates, and their controls")
            }
            None => ("", "after conditions and duplicates"),
        };
        let cpu_time = self.predicted_cpu_seconds;
        let core_hours = cpu_time / 3600.0;
        let core_hours = if core_hours < 0.1 {
            String::new()
        } else {
            format!(", {core_hours:.1} core-hours")
        };
        let cpu_time = output::duration(cpu_time) + &core_hours;
        let wall_time = output::duration(self.predicted_wall_seconds);
        let threads = output::count(self.threads as u64, "thread");
        let of_worker = shown_bytes(self.worker_memory_bytes);
        let of_thread = shown_bytes(self.thread_memory_bytes);
        let memory = format!("{of_worker} and {of_thread} for each thread");
        let address_space = shown_bytes(self.address_space_bytes);
        let address_space = format!("{address_space} on {threads}, where ulimit -v limits it");
        let mut pairs = vec![
            ("sweep", self.name.to_owned()),
            ("axes", axes),
            ("grid points", format!("{}{choice}", self.points)),
            ("jobs", format!("{} {which}", self.jobs)),
            ("parts", self.parts.to_string()),
            ("slips to record", self.slips.to_string()),
            ("predicted CPU time", cpu_time),
            ("predicted wall time", format!("{wall_time} on {threads}")),
            ("resident memory", memory),
            ("address space", address_space),
        ];
        if let Some(command) = &self.longest_job {
            let time = output::duration(self.longest_job_cpu_seconds);
            pairs.push(("longest job", format!("{time}: {command}")));
        }
        if let Some(bounds) = &self.at_most {
            let sets = bounds.sets;
            let jobs = bounds.jobs;
            let cost = output::duration(bounds.predicted_cost);
            let at_most = format!("at most {sets} sets, {jobs} jobs; estimated CPU time {cost}");
            pairs.push(("all rounds", at_most));
        }
        let directory = match &self.directory {
            Some(directory) => directory.in_words(),
            None => "none yet: all jobs are to run".to_owned(),
        };
        pairs.push(("directory", directory));
        pairs
    }
}

impl DirectoryState {
    /// `None` if the directory does not exist yet.
    fn of(sweep: &Sweep, root: PathBuf) -> Result<Option<Self>> {
        if !Disk.exists(&root)? {
            return Ok(None);
        }
        let layout = Layout::new(&Disk, &root);
        let found =
            Results::preview(&layout, sweep).and_then(|results| status(&results, MAX_FAILURES));
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
        let Some(overview) = &self.overview else {
            return format!("refused: {}", self.refused.as_deref().unwrap_or_default());
        };
        let mut text = format!(
            "{}: {} done, {} in unfinished parts, {} failed, {} to run",
            shown(&self.path),
            overview.jobs_done - overview.jobs_kept,
            overview.jobs_spilled,
            overview.jobs_failed,
            overview.jobs_missing
        );
        if overview.jobs_kept > 0 {
            let kept = overview.jobs_kept;
            text = format!("{text}; {kept} more done that the sweep no longer has");
        }
        if let Some(rounds) = &self.rounds {
            text = format!("{text}; round {}", output::rounds(rounds));
        }
        text
    }
}
