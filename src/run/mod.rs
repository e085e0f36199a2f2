//! Run: the missing jobs of a sweep, on all cores, committed part by part.
//!
//! ```text
//! shard.rs    the parts of a plan, or a share of them
//! take.rs     outlines of missing parts, claimed -> their jobs while there is time (limits.rs)
//! collect.rs  jobs -> rayon -> kernel -> outcomes -> whole parts -> rayon -> their files -> Results::put, and events for
//!             the log and a display
//! ```
//!
//! Only the calling thread touches results on the disk. A killed run resumes by looking which part files are
//! missing. The same command, started several times, shares the parts. An adaptive sweep runs in rounds: the worker
//! that first finds all parts done adds those of the next round (`rounds/`), and no worker ends before the last round.
//! Contract: the bytes of the tables depend on neither threads nor workers nor interruptions. Memory: the parts with a
//! job in flight, and those whose files are being encoded, with these files.

mod collect;
pub mod limits;
mod shard;
mod state;
mod take;
#[cfg(test)]
mod tests;

pub use crate::results::log::{RunEvent, RunReport};
pub use crate::results::pending::Overview;
pub use shard::Shard;
pub use state::{Failure, MAX_FAILURES, Present, Reasons, Status, Tally, status};

use crate::observe::Measurements;
use crate::results::claims::{ClaimState, Claims};
use crate::results::layout::Layout;
use crate::results::log::Log;
use crate::results::pending::{Pending, Retry};
use crate::results::workers::{Member, host};
use crate::results::{Results, ResultsError};
use crate::rounds;
use crate::run::collect::Collector;
use crate::run::limits::Walltime;
use crate::run::take::Done;
use crate::solver::SimulationError;
use crate::sweep::{Job, Outline, Sweep};
use crate::table::file::PROGRAM;
use crate::table::storage::StorageError;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Runs a job until it is done, cannot continue, or the flag turns true, which is [`SimulationError::Interrupted`].
pub type Kernel<'a> =
    dyn Fn(&Job, &AtomicBool) -> Result<Measurements, SimulationError> + Sync + 'a;

/// Name of the claim of the reduction, and of the mark of a finished reduction, which has the generation of its claim.
const REDUCTION: &str = "reduce";
const REDUCED: &str = "reduced";

#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Threads; by default all cores.
    pub threads: Option<NonZeroUsize>,
    /// Ends the run when it turns true: jobs in flight are interrupted, whole parts are kept.
    pub stop: &'a AtomicBool,
    pub retry_failed: bool,
    pub shard: Shard,
    /// Ends within this time after the run's beginning, and takes no part for which it is too short.
    pub walltime: Option<Duration>,
}

/// Receivers of events: the log, once there is one, and a display.
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

/// A worker that has joined the others on the directory of a sweep.
pub struct Joined<'a> {
    results: &'a Results<'a>,
    parts: &'a [Outline],
    member: &'a Member<'a>,
    begin: Instant,
    walltime: Walltime,
    threads: usize,
    /// Memory that hard limits allow, in bytes.
    allowed_memory: f64,
    options: Options<'a>,
}

/// Joins the workers on the directory of a sweep, while `body` runs.
pub fn join<T, E: From<ResultsError>>(
    layout: &Layout<'_>,
    sweep: &Sweep,
    options: Options<'_>,
    body: impl FnOnce(&Joined<'_>) -> Result<T, E>,
) -> Result<T, E> {
    let begin = Instant::now();
    let threads = limits::or_all_cores(options.threads);
    limits::check_threads(threads)
        .map_err(|error| ResultsError::refused(layout.root(), error.to_string()))?;
    if sweep.rounds().is_some() && options.shard != Shard::default() {
        let problem = "a sweep with [precision] or [refine] has no shards: each round needs all results of the one before; \
                       run it on a common disk, started as often as you like";
        return Err(ResultsError::refused(layout.root(), problem).into());
    }
    Results::join(layout, sweep, threads, |member, results| {
        let parts: Vec<Outline> = options.shard.parts(results.plan().outlines()).collect();
        let tables = layout.ensure_folder(&layout.tables());
        tables.map_err(ResultsError::from)?;
        results.check_disks()?;
        let ended = body(&Joined {
            results,
            parts: &parts,
            member,
            begin,
            walltime: Walltime::new(begin, options.walltime),
            threads,
            allowed_memory: limits::allowed_memory(),
            options,
        })?;
        member.tidy(true).map_err(ResultsError::from)?;
        Ok(ended)
    })
}

impl Joined<'_> {
    /// Runs missing jobs of the sweep, beside other workers, until none is left for this worker.
    ///
    /// A job that fails or panics becomes a row with its reason. Events come on the calling thread.
    /// On an error, what was committed is kept, and the same command resumes.
    pub fn run(
        &self,
        kernel: &Kernel<'_>,
        display: &mut dyn FnMut(&RunEvent),
    ) -> Result<RunReport, ResultsError> {
        self.results.sync_names()?;
        self.member.tidy(false)?;
        let mut events = Events { log: None, display };
        let mut report = RunReport::default();
        let mut retry_failed = self.options.retry_failed;
        let mut results = Cow::Borrowed(self.results);
        let mut parts = Cow::Borrowed(self.parts);
        loop {
            let retry = Retry {
                all: retry_failed,
                memory: self.allowed_memory,
            };
            let pending = Pending::look_up(&results, &parts, retry)?;
            self.run_parts(&pending, kernel, &mut events, &mut report)?;
            results.tidy_spill(&parts)?;
            // Jobs that failed in this run would fail again.
            retry_failed = false;
            if report.jobs_left > 0 {
                break;
            }
            if self.must_end() && results.round().is_some_and(|round| !round.is_end()) {
                report.stopped = true;
                break;
            }
            let Some(next) = results.next_round(self.member, rounds::next)? else {
                break;
            };
            parts = Cow::Owned(next.plan().outlines().collect());
            results = Cow::Owned(next);
        }
        report.rounds = results.rounds_so_far();
        if report.jobs_left > 0 {
            let pending = Pending::look_up(&results, &parts, Retry::default())?;
            pending.look_at_deaths()?;
            report.marked = pending.marked();
        } else if self.member.others()?.is_empty() {
            let pending = Pending::look_up(&results, &parts, Retry::default())?;
            report.jobs_failed = pending.overview(true, |_, _, _| ())?.jobs_failed;
        }
        events.send(&RunEvent::Finished(report.clone()))?;
        Ok(report)
    }

    /// The directory, in which this worker stages what it writes.
    pub fn layout(&self) -> &Layout<'_> {
        self.member.layout()
    }

    /// Whether a signal came, or the time is over.
    fn must_end(&self) -> bool {
        self.options.stop.load(Ordering::Relaxed) || self.walltime.is_over()
    }

    /// Memory that all jobs together may take now, in bytes.
    fn memory(&self) -> f64 {
        self.allowed_memory.min(limits::available_memory())
    }

    fn run_parts(
        &self,
        pending: &Pending<'_>,
        kernel: &Kernel<'_>,
        events: &mut Events<'_>,
        report: &mut RunReport,
    ) -> Result<(), ResultsError> {
        let mut jobs_again = 0;
        let mut cost_again = 0.0;
        let overview = pending.overview(false, |part, position, why| {
            let job = &part.jobs[position];
            if pending.runs_again(job, why) {
                jobs_again += 1;
                cost_again += job.cost;
            }
        })?;
        report.jobs_left = overview.jobs_missing + jobs_again;
        if jobs_again > 0 {
            // What another worker reduces meanwhile, or has reduced, lacks these jobs.
            let mut claims = Claims::list(self.member)?;
            while !claims.take(REDUCTION, claims.last(REDUCTION).map_or(0, |last| last + 1))? {}
        }
        if report.jobs_left == 0 {
            return Ok(());
        }
        let jobs_there =
            overview.jobs_done + overview.jobs_spilled + overview.jobs_failed - jobs_again;
        let predicted_cost = overview.predicted_cost_missing + cost_again;
        if let (Some(_), Some(rounds)) = (&events.log, pending.results.rounds_so_far()) {
            events.send(&RunEvent::RoundBegun {
                jobs: report.jobs_left,
                predicted_cost,
                rounds,
            })?;
        } else {
            events.log = Some(pending.results.begin_log()?);
            events.send(&RunEvent::Started {
                host: host(),
                process: std::process::id(),
                program: PROGRAM.to_owned(),
                shard: self.options.shard.to_string(),
                others: self.member.others()?.len(),
                threads: self.threads,
                jobs: report.jobs_left,
                jobs_there,
                predicted_cost,
            })?;
        }
        let mut collector = Collector {
            joined: self,
            pending,
            events,
            report,
            open: BTreeMap::new(),
            own: Done::default(),
        };
        let ended = collector.run_all(kernel);
        report.wall = self.begin.elapsed().as_secs_f64();
        let left = ended.inspect_err(|error| {
            // The disk may be what failed: the first error counts.
            let _ = events.send(&RunEvent::Error {
                error: error.to_string(),
            });
        })?;
        match left {
            None => report.stopped = report.jobs_left > 0,
            Some(left) => {
                report.stopped = false;
                report.jobs_left = left.jobs;
                report.hosts = left.hosts.into_iter().collect();
            }
        }
        Ok(())
    }

    /// Reduces with `body`, once every job is done; `None` if another worker does so, or has.
    pub fn reduce<T, E: From<ResultsError>>(
        &self,
        body: impl FnOnce() -> Result<T, E>,
    ) -> Result<Option<T>, E> {
        let Some((mut claims, generation)) = self.take_reduction()? else {
            return Ok(None);
        };
        let reduced = body()?;
        claims.take(REDUCED, generation)?;
        Ok(Some(reduced))
    }

    /// Claims the reduction; `None` if another worker has it, or has ended it.
    fn take_reduction(&self) -> Result<Option<(Claims<'_>, u64)>, ResultsError> {
        // In this order: a worker that has ended left its mark before.
        let others = self.member.others()?;
        let mut claims = Claims::list(self.member)?;
        let last = claims.last(REDUCTION);
        let is_taken = match claims.standing(REDUCTION, &others)? {
            ClaimState::Own => true,
            ClaimState::Taken(_) => false,
            ClaimState::Free(_) if last.is_some() && claims.last(REDUCED) == last => false,
            ClaimState::Free(generation) => claims.take(REDUCTION, generation)?,
        };
        let generation = claims.last(REDUCTION).unwrap_or_default();
        Ok(is_taken.then_some((claims, generation)))
    }
}
