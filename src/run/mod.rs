//! Run: the missing jobs of a sweep, on all cores, committed part by part.
//!
//! ```text
//! survey.rs  parts that are not there -> tasks, lazily
//!            -> rayon -> kernel -> bounded channel ->
//!            walltime.rs: those that end in time
//! collect.rs on the calling thread: outcomes -> whole parts -> store::part::commit, and events for a display
//! ```
//!
//! What is done is what is committed, so a run that was killed goes on by looking which part files are missing. Contract:
//! the bytes of the tables depend on neither threads nor shards nor interruptions. Memory: the parts with a job in flight.
//! claim.rs keeps two processes from running the same shard; upkeep.rs verifies, repairs and compacts while no shard runs.

mod claim;
mod collect;
mod log;
mod shard;
mod status;
mod survey;
#[cfg(test)]
mod tests;
mod upkeep;
mod walltime;

pub use log::{Entry, Line, host};
pub use shard::{Shard, ShardError};
pub use status::{Failure, MOST_FAILURES, Status, status};
pub use upkeep::{UpkeepError, compact, repair, verify};

use crate::observe::Measurements;
use crate::results::commit::{clear, settle};
use crate::results::manifest::{Directory, DirectoryError};
use crate::run::claim::{Claim, PATIENCE, clear_leftovers};
use crate::run::collect::Collector;
use crate::run::log::Log;
use crate::run::survey::{Scope, Survey};
use crate::run::walltime::Walltime;
use crate::solver::SimulationError;
use crate::sweep::{Job, Sweep};
use crate::table::file::DatasetError;
use crate::table::storage::{Storage, StorageError};
use serde::Serialize;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// What runs a job: until it is done, cannot go on, or the flag turns true, which is [`SimulationError::Interrupted`].
pub type Kernel<'a> = dyn Fn(&Job, &AtomicBool) -> Result<Measurements, SimulationError> + Sync + 'a;

/// How to run.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Threads; by default all cores.
    pub threads: Option<NonZeroUsize>,
    /// Ends the run when it turns true: jobs in flight are interrupted, whole parts are kept.
    pub stop: &'a AtomicBool,
    /// Whether to run failed jobs again.
    pub retry_failed: bool,
    /// The share of the parts to look after.
    pub shard: Shard,
    /// Starts nothing that would not end within this time after the run's beginning, and ends by then.
    pub walltime: Option<Duration>,
}

/// What happens during a run, for a display.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RunEvent<'a> {
    /// The run knows what is to be done.
    Started {
        /// Jobs to run.
        jobs: u64,
        /// Their predicted CPU time, in s.
        predicted_cost: f64,
        /// Jobs that are there already.
        jobs_there: u64,
        /// Threads.
        threads: usize,
    },
    /// A job is done, though not yet committed.
    JobDone {
        /// Slips recorded.
        slips: usize,
        /// Predicted CPU time, in s.
        predicted_cost: f64,
        /// Its wall time, in s.
        wall: f64,
    },
    /// A job failed; the others go on.
    JobFailed {
        /// Its id.
        job_id: &'a str,
        /// Why.
        reason: &'a str,
        /// The command that does the same, to look at it alone.
        command: &'a str,
        /// Predicted CPU time, in s.
        predicted_cost: f64,
        /// Its wall time, in s.
        wall: f64,
    },
    /// A part is committed.
    PartCommitted {
        /// Its name.
        part: &'a str,
        /// Jobs that were run for it.
        jobs: usize,
        /// Those that failed.
        failed: usize,
    },
    /// The run was told to stop, or its time is over; jobs in flight are interrupted.
    Stopping,
    /// Not all parts would end in time; what is under way does.
    OutOfTime,
    /// The run ends.
    Finished(&'a RunReport),
}

/// What a run did. Jobs count when they are committed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RunReport {
    /// Jobs run, failed ones included.
    pub jobs_run: u64,
    /// Jobs that still count as failed in the parts of this run's shard, earlier ones included.
    pub jobs_failed: u64,
    /// Jobs of this run's shard that are still to be run.
    pub jobs_left: u64,
    /// Parts committed.
    pub parts_committed: u64,
    /// Whether the run was stopped, or its time did not suffice, before all was done.
    pub stopped: bool,
    /// Predicted wall time of the cheapest part that was not started for want of time, in s.
    pub time_wanted: Option<f64>,
    /// Predicted CPU time of the jobs run, in s.
    pub predicted_cost: f64,
    /// Sum of their wall times, in s.
    pub measured_cost: f64,
    /// Wall time of the run, in s.
    pub wall: f64,
}

/// Why a run could not go on. What was committed is kept, and the same command goes on from there.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The directory is refused.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// A file operation failed.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A part cannot be written or read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Somebody else runs the same share.
    #[error("{}: shard {shard} is being run by another process; wait for it, stop it, or take another --shard", .directory.display())]
    Locked {
        /// The directory.
        directory: PathBuf,
        /// The shard.
        shard: Shard,
    },
    /// Compacted or damaged files cannot be taken care of.
    #[error(transparent)]
    Upkeep(#[from] UpkeepError),
    /// The threads cannot be started.
    #[error("cannot start {threads} threads: {source}; take fewer with --threads")]
    Threads {
        /// Threads wanted.
        threads: usize,
        /// The reason.
        source: rayon::ThreadPoolBuildError,
    },
}

/// Runs the jobs of a sweep that are not yet in a directory.
///
/// A job that fails or panics becomes a row with its reason. Events come on the calling thread.
///
/// # Errors
/// When the directory belongs to something else, or the disk fails: see [`RunError`].
pub fn run(
    storage: &dyn Storage,
    sweep: &Sweep,
    root: &Path,
    options: Options<'_>,
    kernel: &Kernel<'_>,
    progress: &mut dyn FnMut(RunEvent<'_>),
) -> Result<RunReport, RunError> {
    let begin = Instant::now();
    let directory = Directory::open(storage, root, sweep)?;
    if options.retry_failed {
        upkeep::withdraw_failed(storage, &directory)?;
    }
    let claim = Claim::take(storage, directory.layout(), &options.shard.writer(), PATIENCE)?
        .ok_or_else(|| RunError::Locked { directory: root.to_owned(), shard: options.shard })?;
    upkeep::absent(storage, directory.layout())?;
    // It may have been compacted before the shard was ours.
    let directory = directory.with_compaction(storage)?;
    claim.while_held(|| run_claimed(storage, &directory, begin, options, kernel, progress))
}

/// Runs a shard that no other process has.
fn run_claimed(
    storage: &dyn Storage,
    directory: &Directory,
    begin: Instant,
    options: Options<'_>,
    kernel: &Kernel<'_>,
    progress: &mut dyn FnMut(RunEvent<'_>),
) -> Result<RunReport, RunError> {
    settle(storage, directory.layout())?;
    let staging = directory.layout().staging(&options.shard.writer());
    clear(storage, &staging)?;
    clear_leftovers(storage, directory.layout())?;
    let scope = Scope { storage, directory, shard: options.shard, retry_failed: options.retry_failed };
    let survey = scope.survey()?;
    let mut report = expected(&survey, options.retry_failed);
    if report.jobs_left > 0 {
        let threads =
            options.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
        let predicted_cost = survey.cost_missing + if options.retry_failed { survey.cost_failed } else { 0.0 };
        let earlier_pace = log::pace(storage, directory.layout())?;
        let walltime = Walltime::new(begin, options.walltime, threads, earlier_pace);
        let mut log = Log::create(storage, directory.layout())?;
        log.write(Entry::started(options.shard.to_string(), threads, report.jobs_left, predicted_cost))?;
        progress(RunEvent::Started { jobs: report.jobs_left, predicted_cost, jobs_there: survey.jobs_done, threads });
        let mut collector = Collector::new(scope, &staging, &walltime, &mut log, &mut report, progress);
        let ended = collector.run(threads, options.stop, kernel);
        report.wall = begin.elapsed().as_secs_f64();
        let all_run = ended.inspect_err(|error| {
            // The disk may be what failed: the first error counts.
            let _ = log.write(Entry::Error { error: error.to_string() });
        })?;
        if all_run {
            report.jobs_left = 0;
        }
        report.time_wanted = walltime.refused();
        report.stopped = report.jobs_left > 0;
        log.write(Entry::Finished { stopped: report.stopped, wall: report.wall })?;
    }
    progress(RunEvent::Finished(&report));
    Ok(report)
}

/// The report before anything is run.
fn expected(survey: &Survey, retry_failed: bool) -> RunReport {
    let again = if retry_failed { survey.jobs_failed } else { 0 };
    RunReport { jobs_failed: survey.jobs_failed, jobs_left: survey.jobs_missing + again, ..RunReport::default() }
}
