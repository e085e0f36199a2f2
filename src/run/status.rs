//! The status of a directory: what is done, what is missing, and how long that will take.

use crate::results::events::RunEvent;
use crate::results::workers::{Living, Worker};
use crate::results::{Results, ResultsError};
use crate::run::shard::Shard;
use crate::run::share::{Overview, Share};
use serde::Serialize;
use std::time::SystemTime;

/// Version of [`Status`] as JSON.
const FORMAT: u32 = 2;
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
    /// Workers that are there now.
    pub workers: Vec<Present>,
    /// Measured over predicted CPU time so far, by the logs; null before the first part.
    pub pace: Option<f64>,
    /// Predicted wall time for the missing jobs, in s, at this pace and with the threads that are there now or ran last; null
    /// before the first part.
    pub time_left: Option<f64>,
    /// The first failed jobs, [`MAX_FAILURES`] at most.
    pub failures: Vec<Failure>,
}

/// A worker that is there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Present {
    /// Who.
    #[serde(flatten)]
    pub worker: Worker,
    /// Time since its last beat, in s; beside the clock of the file system, that of this host is read.
    pub last_beat: f64,
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
    let overview =
        Share::look_up(results, Shard::default(), false)?.overview_with_failures(|part, position, reason| {
            if failures.len() < MAX_FAILURES {
                failures.push(Failure {
                    job_id: results.job_id(part, position),
                    reason: reason.to_owned(),
                    command: results.sweep().command(&part.jobs[position]),
                });
            }
        })?;
    let mut last_threads = None;
    results.events(|event| {
        if let RunEvent::Started { threads, .. } = event {
            last_threads = Some(threads);
        }
    })?;
    let now = SystemTime::now();
    let present = |Living { worker, beat, .. }| {
        let last_beat = now.duration_since(beat).unwrap_or_default().as_secs_f64();
        Present { worker, last_beat }
    };
    let workers: Vec<Present> = results.layout().living(now)?.into_values().map(present).collect();
    let threads = if workers.is_empty() {
        last_threads
    } else {
        Some(workers.iter().map(|present| present.worker.threads).fold(0, usize::saturating_add))
    };
    let pace = results.pace()?;
    Ok(Status {
        format: FORMAT,
        name: results.sweep().name().to_owned(),
        overview,
        workers,
        pace,
        time_left: pace
            .zip(threads)
            .map(|(pace, threads)| overview.predicted_cost_missing * pace / threads.max(1) as f64),
        failures,
    })
}
