//! The status of a directory: what is done, what is missing, and how long that will take.

use crate::results::manifest::Directory;
use crate::results::part;
use crate::run::claim::is_claimed;
use crate::run::log::{self, Entry};
use crate::run::shard::Shard;
use crate::run::survey::Scope;
use crate::table::file::DatasetError;
use crate::table::storage::Storage;
use serde::Serialize;
use std::collections::BTreeMap;

/// Version of [`Status`] as JSON.
const FORMAT: u32 = 1;
/// Most failed jobs that are told one by one.
pub const MOST_FAILURES: usize = 10;

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
    /// Of these two, jobs that the sweep which was asked for last does not have; their data are kept.
    pub jobs_kept: u64,
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
    /// The first failed jobs, [`MOST_FAILURES`] at most.
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
pub fn status(storage: &dyn Storage, directory: &Directory) -> Result<Status, DatasetError> {
    let scope = Scope { storage, directory, shard: Shard::default(), retry_failed: false };
    let mut failures = Vec::new();
    let survey = scope.survey_with(|part, failed| {
        if !failed.is_empty() && failures.len() < MOST_FAILURES {
            let sweep = &directory.sweeps()[part.epoch];
            let told = part::failures(storage, directory, part)?.into_iter().flatten().map(|(position, reason)| {
                let job = &part.jobs[position];
                Failure { job_id: sweep.job_id(&job.parameters).to_string(), reason, command: sweep.command(job) }
            });
            failures.extend(told.take(MOST_FAILURES - failures.len()));
        }
        Ok(())
    })?;
    let mut threads = BTreeMap::new();
    let mut last_threads = None;
    log::read(storage, directory.layout(), |line| {
        if let Entry::Started { shard, threads: started, .. } = line.entry {
            threads.insert(shard, started);
            last_threads = Some(started);
        }
    })?;
    let mut running = Vec::new();
    for name in threads.keys() {
        let Ok(shard) = name.parse::<Shard>() else { continue };
        if is_claimed(storage, directory.layout(), &shard.writer())? {
            running.push(name.clone());
        }
    }
    let threads =
        if running.is_empty() { last_threads } else { Some(running.iter().map(|shard| threads[shard]).sum()) };
    let pace = log::pace(storage, directory.layout())?;
    Ok(Status {
        format: FORMAT,
        name: directory.sweeps()[directory.current()].name().to_owned(),
        jobs_done: survey.jobs_done - survey.jobs_failed,
        jobs_failed: survey.jobs_failed,
        jobs_kept: survey.jobs_kept,
        jobs_missing: survey.jobs_missing,
        parts_done: survey.parts_done,
        parts_missing: survey.parts_missing,
        running,
        predicted_cost_done: survey.cost_done,
        predicted_cost_missing: survey.cost_missing,
        pace,
        time_left: pace.zip(threads).map(|(pace, threads)| survey.cost_missing * pace / threads.max(1) as f64),
        failures,
    })
}
