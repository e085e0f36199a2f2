//! All that a page shows.

use super::ADVICE;
use super::slips::Slips;
use super::tables::{Census, Columns, Sets, backbone};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::model::{MODEL_VERSION, RNG_SCHEME, Symbol};
use crate::reduce::advise;
use crate::results::Results;
use crate::run::{RunEvent, Status, status_with};
use crate::sweep::PLAN_VERSION;
use crate::table::file::PROGRAM;
use crate::table::shown::shown;
use crate::table::storage::StorageError;
use anyhow::Result;
use serde::Serialize;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Failed jobs that are listed.
const MAX_FAILURES: usize = 200;
/// Parts that the chart of cost shows; of more, every k-th.
const MAX_PARTS: usize = 4_000;
/// Runs that are listed: the last ones.
const MAX_RUNS: usize = 50;
/// η of the curves of the back-bone: from 1, in steps of 1/30 of a decade, over five decades.
const CURVE_STEPS: u32 = 150;
const CURVE_STEPS_PER_DECADE: f64 = 30.0;

/// Serialised, it is what the scripts of the page read.
#[derive(Debug, Serialize)]
pub(super) struct Content {
    program: &'static str,
    model_version: u32,
    rng_scheme: &'static str,
    plan_version: u32,
    directory: String,
    /// Set while a run goes on.
    live: Option<Live>,
    status: Status,
    /// Keys that each axis moves, and its number of values.
    axes: Vec<(String, u64)>,
    /// Texts of the sweep files, in order.
    sweeps: Vec<String>,
    parameters: Vec<Parameter>,
    census: Census,
    sets_every: u64,
    sets: Sets,
    slips: Slips,
    backbone: Columns,
    /// η, φ_min and its asymptote.
    curves: Vec<[Option<f64>; 3]>,
    cost: Cost,
    runs: Vec<Run>,
}

/// A page that is written again while a run goes on. Times in s.
#[derive(Debug, Serialize)]
struct Live {
    /// Time after which it is worth while to load the page again.
    refresh: f64,
    /// When it was written, since 1970 UTC.
    written: f64,
}

#[derive(Debug, Serialize)]
struct Parameter {
    key: &'static str,
    symbol: &'static str,
    unit: &'static str,
    meaning: &'static str,
}

/// Predicted and measured CPU time, in s, as the logs say.
#[derive(Debug, Default, Serialize)]
struct Cost {
    jobs: u64,
    parts: u64,
    predicted: f64,
    measured: f64,
    /// Of single parts: name, jobs, predicted and measured.
    shown: Vec<(String, usize, f64, f64)>,
}

#[derive(Debug, Serialize)]
struct Run {
    program: String,
    host: String,
    threads: usize,
    jobs: u64,
    /// Jobs that it ran and its wall time in s; null if it was killed, or is at work.
    ended: Option<(u64, f64)>,
}

impl Content {
    /// Reads a directory with reduced data.
    pub(super) fn read(results: &Results<'_>, refresh: Option<Duration>) -> Result<(Self, Vec<u8>)> {
        let layout = results.layout();
        let sweep = results.sweep();
        let (cost, runs) = logs(results)?;
        let damaged = advise(ADVICE);
        let census = Census::read(layout).map_err(&damaged)?;
        let sets_every = census.spacing();
        let sets = Sets::read(layout, sweep, sets_every).map_err(&damaged)?;
        let slips_every = census.slips.div_ceil(sets_every);
        let slips = Slips::read(results, &sets.places, slips_every).map_err(&damaged)?;
        let live = refresh.map(|refresh| Live {
            refresh: refresh.as_secs_f64(),
            written: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64()),
        });
        let bytes = slips.bytes();
        let content = Self {
            program: PROGRAM,
            model_version: MODEL_VERSION,
            rng_scheme: RNG_SCHEME,
            plan_version: PLAN_VERSION,
            directory: shown(layout.root()).to_string(),
            live,
            status: status_with(results, MAX_FAILURES)?,
            axes: sweep.axes().collect(),
            sweeps: results.extensions().iter().map(|extension| extension.sweep.text().to_owned()).collect(),
            parameters: parameters(),
            census,
            sets_every,
            sets,
            slips,
            backbone: backbone(layout).map_err(&damaged)?,
            curves: curves(),
            cost,
            runs,
        };
        Ok((content, bytes))
    }
}

/// The parameters of a set.
fn parameters() -> Vec<Parameter> {
    let parameter = |symbol: Symbol| {
        let description = symbol.description();
        Parameter {
            key: description.key,
            symbol: description.symbol,
            unit: description.unit,
            meaning: description.meaning,
        }
    };
    Symbol::ALL.into_iter().filter(|&symbol| symbol != Symbol::Seed).map(parameter).collect()
}

fn curves() -> Vec<[Option<f64>; 3]> {
    (0..=CURVE_STEPS)
        .map(|step| libm::exp10(f64::from(step) / CURVE_STEPS_PER_DECADE))
        .map(|eta| [Some(eta), minimum_phase(eta), Some(minimum_phase_asymptote(eta))])
        .collect()
}

/// What the logs say of cost and of runs.
fn logs(results: &Results<'_>) -> Result<(Cost, Vec<Run>), StorageError> {
    let (mut cost, mut runs) = (Cost::default(), Vec::new());
    results.events(|event| match event {
        RunEvent::PartCommitted { part, jobs, predicted_cost, measured_cost, .. } => {
            cost.jobs += jobs as u64;
            cost.parts += 1;
            cost.predicted += predicted_cost;
            cost.measured += measured_cost;
            cost.shown.push((part, jobs, predicted_cost, measured_cost));
        }
        RunEvent::Started { host, program, threads, jobs, .. } => {
            runs.push(Run { program, host, threads, jobs, ended: None });
        }
        // A log holds one run, and logs are gone through one after the other.
        RunEvent::Finished(report) => {
            if let Some(run) = runs.last_mut() {
                run.ended = Some((report.jobs_run, report.wall));
            }
        }
        _ => (),
    })?;
    let every = cost.shown.len().div_ceil(MAX_PARTS).max(1);
    cost.shown = cost.shown.into_iter().step_by(every).collect();
    let first = runs.len().saturating_sub(MAX_RUNS);
    runs.drain(..first);
    Ok((cost, runs))
}
