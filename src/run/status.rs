//! The status of a directory: what is done, what is missing, and how long that will take.

use crate::run::log::{self, Entry};
use crate::run::shard::Shard;
use crate::run::survey::Scope;
use crate::store::dataset::DatasetError;
use crate::store::manifest::Directory;
use crate::store::storage::{Storage, StorageError};
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of [`Status`] as JSON.
const FORMAT: u32 = 1;

/// The state of a results directory. Serialises to a stable form, told by `format`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Status {
    /// Version of this form.
    pub format: u32,
    /// Name of the sweep.
    pub name: String,
    /// Jobs that are done, without the failed ones.
    pub jobs_done: u64,
    /// Jobs that failed.
    pub jobs_failed: u64,
    /// Jobs that are asked for and missing.
    pub jobs_missing: u64,
    /// Parts that are committed.
    pub parts_done: u64,
    /// Parts that are missing.
    pub parts_missing: u64,
    /// Shards that are being run now, as `K/N`.
    pub running: Vec<String>,
    /// Predicted CPU time of all jobs that are done or failed, in s.
    pub predicted_cost_done: f64,
    /// Predicted CPU time of the missing jobs, in s.
    pub predicted_cost_missing: f64,
    /// Measured over predicted CPU time so far, by the logs; null before the first part.
    pub pace: Option<f64>,
    /// Predicted wall time for the missing jobs, in s, at this pace and with the threads that run now or ran last; null
    /// before the first part.
    pub time_left: Option<f64>,
}

/// Looks through a directory.
///
/// # Errors
/// When a log or a part cannot be read.
pub fn status(storage: &dyn Storage, directory: &Directory) -> Result<Status, DatasetError> {
    let survey = Scope { storage, directory, shard: Shard::default(), retry_failed: false }.survey()?;
    let (mut predicted_so_far, mut measured_so_far) = (0.0, 0.0);
    let mut threads = BTreeMap::new();
    let mut last_threads = None;
    log::read(storage, directory.layout(), |line| match line.entry {
        Entry::Started { shard, threads: started, .. } => {
            threads.insert(shard, started);
            last_threads = Some(started);
        }
        Entry::Part { predicted, measured, .. } => {
            predicted_so_far += predicted;
            measured_so_far += measured;
        }
        Entry::Withdrawn { .. } | Entry::Finished { .. } | Entry::Error { .. } => (),
    })?;
    let mut running = Vec::new();
    for shard in threads.keys() {
        if is_running(storage, directory, shard)? {
            running.push(shard.clone());
        }
    }
    let threads =
        if running.is_empty() { last_threads } else { Some(running.iter().map(|shard| threads[shard]).sum()) };
    let pace = (predicted_so_far > 0.0).then(|| measured_so_far / predicted_so_far);
    Ok(Status {
        format: FORMAT,
        name: directory.sweeps()[directory.current()].name().to_owned(),
        jobs_done: survey.jobs_done - survey.jobs_failed,
        jobs_failed: survey.jobs_failed,
        jobs_missing: survey.jobs_missing,
        parts_done: survey.parts_done,
        parts_missing: survey.parts_missing,
        running,
        predicted_cost_done: survey.cost_done,
        predicted_cost_missing: survey.cost_missing,
        pace,
        time_left: pace.zip(threads).map(|(pace, threads)| survey.cost_missing * pace / threads.max(1) as f64),
    })
}

/// Whether a run holds the lock of a shard.
fn is_running(storage: &dyn Storage, directory: &Directory, shard: &str) -> Result<bool, StorageError> {
    let Ok(shard) = shard.parse::<Shard>() else { return Ok(false) };
    let lock = directory.layout().locks().join(shard.writer());
    let exists = storage.exists(&lock).map_err(StorageError::at("look up", &lock))?;
    // A lock that cannot be tried, as in a read-only copy, is nobody's.
    Ok(exists && matches!(storage.lock(&lock), Ok(None)))
}
