//! Run: the missing jobs of a sweep, on all cores, committed part by part.
//!
//! ```text
//! share.rs   parts that are not there -> their jobs, lazily
//!            -> rayon -> kernel -> bounded channel ->
//!            walltime.rs: those that end in time
//! collect.rs on the calling thread: outcomes -> whole parts -> Results::commit, and events for the log and a display
//! ```
//!
//! What is done is what is committed, so a killed run resumes by looking which part files are missing.
//! Contract: the bytes of the tables depend on neither threads nor shards nor interruptions. Memory: the parts with a
//! job in flight.

mod collect;
pub mod cpu;
mod shard;
mod share;
mod status;
#[cfg(test)]
mod tests;
mod walltime;

pub use crate::results::events::{RunEvent, RunReport};
pub use shard::{Shard, ShardError};
pub use share::Overview;
pub use status::{Failure, MAX_FAILURES, Status, status};

use crate::observe::Measurements;
use crate::results::events::Log;
use crate::results::layout::Layout;
use crate::results::{Results, ResultsError};
use crate::run::collect::Collector;
use crate::run::share::Share;
use crate::run::walltime::Walltime;
use crate::solver::SimulationError;
use crate::sweep::{Job, Sweep};
use crate::table::storage::StorageError;
use std::num::NonZeroUsize;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// What runs a job: until it is done, cannot continue, or the flag turns true, which is [`SimulationError::Interrupted`].
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

/// Who hears of events: the log, once there is one, and a display.
struct Events<'a> {
    log: Option<Log>,
    display: &'a mut dyn FnMut(&RunEvent),
}

impl Events<'_> {
    fn send(&mut self, event: &RunEvent) -> Result<(), StorageError> {
        (self.display)(event);
        self.log.as_mut().map_or(Ok(()), |log| log.write(event))
    }
}

/// Runs the jobs of a sweep that are not yet in a directory.
///
/// A job that fails or panics becomes a row with its reason. Events come on the calling thread.
///
/// # Errors
/// When the directory belongs to something else or another process has it, or the disk fails. What was committed is
/// kept, and the same command resumes from there.
pub fn run(
    layout: &Layout<'_>,
    sweep: &Sweep,
    options: Options<'_>,
    kernel: &Kernel<'_>,
    display: &mut dyn FnMut(&RunEvent),
) -> Result<RunReport, ResultsError> {
    let begin = Instant::now();
    let results = Results::open(layout, sweep)?;
    let lock = results.lock_shard(&options.shard.writer())?.ok_or_else(|| {
        let shard = options.shard;
        let problem =
            format!("shard {shard} is being run by another process; wait for it, stop it, or take another --shard");
        ResultsError::busy(layout.root(), problem)
    })?;
    lock.while_held(|| run_locked(&results, begin, options, kernel, display))
}

/// Runs a shard that no other process has.
fn run_locked(
    results: &Results<'_>,
    begin: Instant,
    options: Options<'_>,
    kernel: &Kernel<'_>,
    display: &mut dyn FnMut(&RunEvent),
) -> Result<RunReport, ResultsError> {
    results.sync_names()?;
    let staging = results.layout().staging(&options.shard.writer());
    results.layout().storage.clear_folder(&staging)?;
    results.clear_abandoned_staging()?;
    let share = Share::look_up(results, options.shard, options.retry_failed)?;
    let overview = share.overview(|_, _, _| ())?;
    let (jobs_again, cost_again) =
        if options.retry_failed { (overview.jobs_failed, overview.predicted_cost_failed) } else { (0, 0.0) };
    let jobs_left = overview.jobs_missing + jobs_again;
    let mut report = RunReport { jobs_failed: overview.jobs_failed, jobs_left, ..RunReport::default() };
    let mut events = Events { log: None, display };
    if jobs_left > 0 {
        let threads =
            options.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
        let walltime = Walltime::new(begin, options.walltime, threads, results.pace()?);
        events.log = Some(results.begin_log()?);
        let (shard, predicted_cost) = (options.shard.to_string(), overview.predicted_cost_missing + cost_again);
        let jobs_there = overview.jobs_done + overview.jobs_failed;
        events.send(&RunEvent::started(shard, threads, jobs_left, jobs_there, predicted_cost))?;
        let mut collector = Collector::new(&share, &staging, &walltime, &mut events, &mut report);
        let ended = collector.run(threads, options.stop, kernel);
        report.wall = begin.elapsed().as_secs_f64();
        let all_run = ended.inspect_err(|error| {
            // The disk may be what failed: the first error counts.
            let _ = events.send(&RunEvent::Error { error: error.to_string() });
        })?;
        if all_run {
            report.jobs_left = 0;
        }
        report.time_wanted = walltime.refused();
        report.stopped = report.jobs_left > 0;
    }
    events.send(&RunEvent::Finished(report))?;
    Ok(report)
}
