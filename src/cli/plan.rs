//! `stickslip plan`: what would run. Nothing is written.

use super::exit::Exit;
use super::output;
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use stickslip::sweep::{Plan, Sweep};

/// Show what a sweep would run: jobs, parts, predicted cost. Nothing is written
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  stickslip plan sweeps/fig3.toml --json")]
pub struct Arguments {
    /// Sweep file
    #[arg(value_name = "SWEEP.toml")]
    sweep: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Version of [`Report`] as JSON.
const FORMAT: u32 = 1;

#[derive(Serialize)]
struct Report {
    format: u32,
    name: String,
    axes: Vec<Axis>,
    points: u64,
    jobs: u64,
    parts: u64,
    slips: u64,
    predicted_cpu_seconds: f64,
    predicted_wall_seconds: f64,
    threads: usize,
}

#[derive(Serialize)]
struct Axis {
    keys: String,
    points: u64,
}

pub fn plan(arguments: &Arguments) -> Result<Exit> {
    let sweep = Sweep::from_file(&arguments.sweep)?;
    output::warn(&sweep.warnings());
    let totals = Plan::new(std::slice::from_ref(&sweep)).totals();
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let report = Report {
        format: FORMAT,
        name: sweep.name().to_owned(),
        axes: sweep.axes().map(|(keys, points)| Axis { keys, points }).collect(),
        points: sweep.point_count(),
        jobs: totals.jobs,
        parts: totals.parts,
        slips: totals.jobs.saturating_mul(sweep.recording().slips),
        predicted_cpu_seconds: totals.cost,
        predicted_wall_seconds: totals.cost / threads as f64,
        threads,
    };
    if arguments.json {
        output::json(&report)?;
    } else {
        let axes: Vec<String> = report.axes.iter().map(|axis| format!("{} ({})", axis.keys, axis.points)).collect();
        output::pairs(&[
            ("sweep", report.name),
            ("axes", if axes.is_empty() { "none: a single point".to_owned() } else { axes.join(" x ") }),
            ("grid points", report.points.to_string()),
            ("jobs", format!("{} after conditions and duplicates", report.jobs)),
            ("parts", report.parts.to_string()),
            ("slips to record", report.slips.to_string()),
            ("predicted CPU time", output::duration(totals.cost)),
            ("predicted wall time", format!("{} on {threads} cores", output::duration(report.predicted_wall_seconds))),
        ])?;
    }
    Ok(Exit::Done)
}
