//! Report: a results directory as one HTML page to explore in a browser, which loads nothing else.
//!
//! ```text
//! page_columns.rs    tables, column by column: the sets, their histograms, a sample of slips
//! below              the content: these, with the sweep, how far it is, its cost and its runs
//!                    content and page.html, style.css, *.js -> one file
//! ```
//!
//! No chart library: the crate `plotly` 0.14 would bring 7.6 MB of scripts into the program, and 1.9 MB into each page,
//! compressed. `chart.js` draws 100,000 points on a canvas, and no more is needed.

mod page_columns;

use self::page_columns::{Census, Sets, Slips, backbone};
use crate::figure::{INKS, SCALE, standing};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::model::{MODEL_VERSION, RNG_SCHEME, Selection as _, Symbol};
use crate::reduce::{advise, renew};
use crate::results::Results;
use crate::results::commit::Commit;
use crate::results::layout::Layout;
use crate::results::log::now;
use crate::run::{RunEvent, status};
use crate::sets::{AllButSeed, FOUND};
use crate::sweep::{PLAN_VERSION, Rounds, SYNONYMS, Sweep};
use crate::table::file::PROGRAM;
use crate::table::shown::shown;
use crate::table::storage::StorageError;
use anyhow::{Context, Result};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value as Json, json};
use sha2::{Digest, Sha256};
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

/// What to do about a table that cannot be read.
const ADVICE: &str = "`stickslip verify` says what to do about damage";

/// The report of a directory as HTML. Reduces the tables first if the reduced data are out of date.
///
/// With `refresh`, the page says that a run is in progress, and reloads itself after about this time.
pub fn page(results: &Results<'_>, refresh: Option<Duration>) -> Result<String> {
    let results = renew(results)?;
    html(&content(&results, refresh)?).context("the report cannot be encoded")
}

/// Writes the report of a directory to `report.html` in it, over an earlier one, and returns its path.
pub fn write(results: &Results<'_>, refresh: Option<Duration>) -> Result<PathBuf> {
    let layout = results.layout();
    let page = page(results, refresh)?;
    let mut commit = Commit::begin(layout)?;
    commit.stage_bytes(&layout.report(), page.as_bytes())?;
    results.publish(commit)?;
    Ok(layout.report())
}

/// Failed jobs that are listed.
const MAX_FAILURES: u64 = 200;
/// Parts that the chart of cost shows; of more, every k-th.
const MAX_PARTS: usize = 4_000;
/// Runs that are listed: the last ones.
const MAX_RUNS: usize = 50;
/// η of the curves of the backbone: from 1, in steps of 1/30 of a decade, over five decades.
const CURVE_STEPS: u32 = 150;
const CURVE_STEPS_PER_DECADE: f64 = 30.0;

/// The data of a directory for the scripts of the page, which reloads itself about every `refresh`.
fn content(results: &Results<'_>, refresh: Option<Duration>) -> Result<Json> {
    let layout = results.layout();
    let sweep = results.sweep();
    let (cost, runs) = logs(results)?;
    let damaged = advise(ADVICE);
    let census = Census::read(layout).map_err(&damaged)?;
    let sets_every = census.spacing();
    let sets = Sets::read(layout, sweep, sets_every).map_err(&damaged)?;
    let slips =
        Slips::read(results, &sets.places, census.slips.div_ceil(sets_every)).map_err(&damaged)?;
    let written = now();
    let parameters = AllButSeed::SYMBOLS.iter().copied().map(Symbol::key);
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
        "found": FOUND,
        "synonyms": SYNONYMS,
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
fn figures(layout: &Layout<'_>) -> Result<Vec<(&'static str, String)>, StorageError> {
    const LARGEST: usize = 500_000;
    let mut figures = Vec::new();
    for name in standing() {
        let file = layout.figures().join(format!("{name}.svg"));
        if layout.storage.exists(&file)? {
            let text = String::from_utf8(layout.storage.read(&file)?).unwrap_or_default();
            if (1..LARGEST).contains(&text.len()) {
                figures.push((name, text));
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

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
/// Each script needs only those before it.
const SCRIPTS: [&str; 10] = [
    include_str!("data.js"),
    include_str!("axis.js"),
    include_str!("chart.js"),
    include_str!("colours.js"),
    include_str!("filter.js"),
    include_str!("table.js"),
    include_str!("set.js"),
    include_str!("explore.js"),
    include_str!("sections.js"),
    include_str!("main.js"),
];

/// The page of this content: its files put together, with the content compressed, so that no text of it can be taken
/// for HTML.
fn html(content: &Json) -> Result<String> {
    let data = data(content)?;
    let script = format!("\"use strict\";\n{}", SCRIPTS.concat());
    // Scripts and styles other than these do not count, and nothing is loaded.
    let policy = format!(
        "default-src 'none'; script-src '{}'; style-src '{}'; base-uri 'none'; form-action 'none'",
        digest(&script),
        digest(STYLE)
    );
    Ok(PAGE
        .replacen("{{policy}}", &policy, 1)
        .replacen("{{style}}", STYLE, 1)
        .replacen("{{script}}", &script, 1)
        .replacen("{{data}}", &data, 1))
}

/// The content, compressed, in characters that mean nothing in HTML.
fn data(content: &Json) -> Result<String, io::Error> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content.to_string().as_bytes())?;
    Ok(BASE64_STANDARD.encode(encoder.finish()?))
}

/// A text as a policy names it.
fn digest(text: &str) -> String {
    format!("sha256-{}", BASE64_STANDARD.encode(Sha256::digest(text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_of_the_content_is_html() {
        let data = data(&"</script><script>alert(1)</script>\u{2028}<!--".into()).unwrap();
        assert!(
            data.chars()
                .all(|c| c.is_ascii_alphanumeric() || "+/=".contains(c)),
            "{data}"
        );
    }

    #[test]
    fn the_files_of_the_page_fit_into_it() {
        for name in ["policy", "style", "script", "data"] {
            assert_eq!(
                PAGE.matches(&format!("{{{{{name}}}}}")).count(),
                1,
                "{name}"
            );
        }
        let inserted = [STYLE].into_iter().chain(SCRIPTS);
        for text in inserted {
            // Either would end its element, or be taken for a place to fill.
            assert!(!text.contains("</") && !text.contains("{{"), "{text}");
            assert!(!text.contains("http"), "a page loads nothing");
        }
    }
}
