//! The data of a page.

use super::ADVICE;
use super::reduced_columns::{Census, Sets, backbone};
use super::slips::Slips;
use crate::figure::{INKS, SCALE};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::model::{MODEL_VERSION, RNG_SCHEME, Symbol};
use crate::reduce::advise;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::run::{RunEvent, status};
use crate::sweep::{PLAN_VERSION, Rounds, Sweep};
use crate::table::file::PROGRAM;
use crate::table::shown::shown;
use crate::table::storage::StorageError;
use anyhow::Result;
use serde_json::{Value as Json, json};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Failed jobs that are listed.
const MAX_FAILURES: u64 = 200;
/// Parts that the chart of cost shows; of more, every k-th.
const MAX_PARTS: usize = 4_000;
/// Runs that are listed: the last ones.
const MAX_RUNS: usize = 50;
/// Names of figures that are shown, in order.
const STANDING: [&str; 7] = [
    "overview",
    "locking-map",
    "regime-map",
    "edges",
    "phi-eta",
    "tau-T",
    "tau-histograms",
];
/// η of the curves of the back-bone: from 1, in steps of 1/30 of a decade, over five decades.
const CURVE_STEPS: u32 = 150;
const CURVE_STEPS_PER_DECADE: f64 = 30.0;

/// The data of a directory for the scripts of the page, which reloads itself about every `refresh`.
pub(super) fn content(results: &Results<'_>, refresh: Option<Duration>) -> Result<Json> {
    let layout = results.layout();
    let sweep = results.sweep();
    let (cost, runs) = logs(results)?;
    let damaged = advise(ADVICE);
    let census = Census::read(layout).map_err(&damaged)?;
    let sets_every = census.spacing();
    let sets = Sets::read(layout, sweep, sets_every).map_err(&damaged)?;
    let slips =
        Slips::read(results, &sets.places, census.slips.div_ceil(sets_every)).map_err(&damaged)?;
    let written = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0.0, |time| time.as_secs_f64());
    let parameters = Symbol::ALL
        .into_iter()
        .filter(|&symbol| symbol != Symbol::Seed)
        .map(Symbol::key);
    Ok(json!({
        "program": PROGRAM,
        "model_version": MODEL_VERSION,
        "rng_scheme": RNG_SCHEME,
        "plan_version": PLAN_VERSION,
        "directory": shown(layout.root()).to_string(),
        // Set during a run; times in s, `written` since 1970 UTC.
        "live": refresh.map(|refresh| json!({ "refresh": refresh.as_secs_f64(), "written": written })),
        "status": status(results, MAX_FAILURES)?,
        "asked": asked(sweep),
        // Keys that each axis moves, and its number of values.
        "axes": sweep.axes().collect::<Vec<_>>(),
        "sweeps": results.extensions().iter().map(|extension| extension.sweep.text()).collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
        "census": census,
        "sets_every": sets_every,
        "sets": sets,
        "slips": slips,
        "figures": figures(layout)?,
        "backbone": backbone(layout).map_err(&damaged)?,
        "curves": curves(),
        // Colours of the figures.
        "inks": INKS.map(|ink| ink.to_string()),
        "scale": SCALE.map(|ink| ink.to_string()),
        "cost": cost,
        "runs": runs,
    }))
}

/// The statistics by which an adaptive sweep chooses its next round.
fn asked(sweep: &Sweep) -> Vec<&'static str> {
    let rounds = sweep.rounds().into_iter();
    let statistics = rounds.flat_map(Rounds::statistics);
    statistics.map(|statistic| statistic.key).collect()
}

/// The standing figures as SVG, by name: those that are small.
fn figures(layout: &Layout<'_>) -> Result<Vec<(String, String)>, StorageError> {
    const LARGEST: usize = 500_000;
    let mut figures = Vec::new();
    for name in STANDING {
        let file = layout.figures().join(format!("{name}.svg"));
        if layout.storage.exists(&file)? {
            let text = String::from_utf8(layout.storage.read(&file)?).unwrap_or_default();
            if (1..LARGEST).contains(&text.len()) {
                figures.push((name.to_owned(), text));
            }
        }
    }
    Ok(figures)
}

/// η, φ_min and its asymptote.
fn curves() -> Vec<[Option<f64>; 3]> {
    let curves = (0..=CURVE_STEPS).map(|step| {
        let eta = libm::exp10(f64::from(step) / CURVE_STEPS_PER_DECADE);
        let asymptote = minimum_phase_asymptote(eta);
        [Some(eta), minimum_phase(eta), Some(asymptote)]
    });
    curves.collect()
}

/// What the logs say of cost, in s of CPU time, and of runs.
fn logs(results: &Results<'_>) -> Result<(Json, Vec<Json>), StorageError> {
    let mut parts = Vec::new();
    let mut runs: Vec<Json> = Vec::new();
    results.events(|event| match event {
        RunEvent::PartCommitted { part, jobs, predicted_cost, measured_cost, .. } => {
            parts.push((part, jobs, predicted_cost, measured_cost));
        }
        RunEvent::Started { host, program, threads, jobs, .. } => {
            // Null stays if the run was killed, or still runs.
            runs.push(json!({ "program": program, "host": host, "threads": threads, "jobs": jobs, "ended": null }));
        }
        // A log holds one run.
        RunEvent::Finished(report) => {
            if let Some(run) = runs.last_mut() {
                // Its jobs, and its wall time in s.
                run["ended"] = json!([report.jobs_run, report.wall]);
            }
        }
        _ => (),
    })?;
    let every = parts.len().div_ceil(MAX_PARTS).max(1);
    let cost = json!({
        "jobs": parts.iter().map(|part| part.1).sum::<usize>(),
        "parts": parts.len(),
        "predicted": parts.iter().fold(0.0, |sum, part| sum + part.2),
        "measured": parts.iter().fold(0.0, |sum, part| sum + part.3),
        "shown": parts.iter().step_by(every).collect::<Vec<_>>(),
    });
    let first = runs.len().saturating_sub(MAX_RUNS);
    runs.drain(..first);
    Ok((cost, runs))
}
