//! The status of a directory: what is done, what is missing, and how long that will take.

use crate::results::events::RunEvent;
use crate::results::{Results, ResultsError};
use crate::run::shard::Shard;
use crate::run::share::{Overview, Share};
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of [`Status`] as JSON.
const FORMAT: u32 = 1;
/// Failed jobs that are listed one by one, at most.
pub const MAX_FAILURES: usize = 10;

/// The state of a results directory. Serialises to a stable form, whose version is `format`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Status {
    /// Version of this form.
    pub format: u32,
    /// Name of the sweep.
    pub name: String,
    /// How far all parts are.
    #[serde(flatten)]
    pub overview: Overview,
    /// Shards that are being run now, as `K/N`.
    pub running: Vec<String>,
    /// Measured over predicted CPU time so far, by the logs; null before the first part.
    pub pace: Option<f64>,
    /// Predicted wall time for the missing jobs, in s, at this pace and with the threads that run now or ran last; null
    /// before the first part.
    pub time_left: Option<f64>,
    /// The first failed jobs, [`MAX_FAILURES`] at most.
    pub failures: Vec<Failure>,
}

/// A job that failed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Failure {
    /// Its id.
    pub job_id: String,
    /// Why.
    pub reason: String,
    /// The command that does the same, to look at it alone.
    pub command: String,
}

/// Looks through a directory.
///
/// # Errors
/// When a log or a part cannot be read.
pub fn status(results: &Results<'_>) -> Result<Status, ResultsError> {
    let mut failures = Vec::new();
    let overview = Share::look_up(results, Shard::default(), false)?.overview(|part, position, reason| {
        if failures.len() < MAX_FAILURES {
            failures.push(Failure {
                job_id: results.job_id(part, position),
                reason: reason.to_owned(),
                command: results.sweep().command(&part.jobs[position]),
            });
        }
    })?;
    let mut threads = BTreeMap::new();
    let mut last_threads = None;
    results.events(|event| {
        if let RunEvent::Started { shard, threads: started, .. } = event {
            threads.insert(shard, started);
            last_threads = Some(started);
        }
    })?;
    let mut running = Vec::new();
    for name in threads.keys() {
        let Ok(shard) = name.parse::<Shard>() else { continue };
        if results.layout().is_locked(&shard.writer())? {
            running.push(name.clone());
        }
    }
    let threads =
        if running.is_empty() { last_threads } else { Some(running.iter().map(|shard| threads[shard]).sum()) };
    let pace = results.pace()?;
    Ok(Status {
        format: FORMAT,
        name: results.sweep().name().to_owned(),
        overview,
        running,
        pace,
        time_left: pace
            .zip(threads)
            .map(|(pace, threads)| overview.predicted_cost_missing * pace / threads.max(1) as f64),
        failures,
    })
}
