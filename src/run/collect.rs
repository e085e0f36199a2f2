//! The collector: hands jobs to the workers, puts their outcomes together into parts, and commits them.

use crate::results::layout::part_name;
use crate::results::part::{self, Outcome};
use crate::run::log::{Entry, Log};
use crate::run::survey::{Scope, Task};
use crate::run::walltime::Walltime;
use crate::run::{Kernel, RunError, RunEvent, RunReport};
use crate::solver::SimulationError;
use crate::sweep::{Job, Part};
use crate::table::file::DatasetError;
use rayon::iter::{ParallelBridge, ParallelIterator};
use std::any::Any;
use std::collections::{BTreeMap, HashMap};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// How often the collector looks at the stop flag.
const STOP_POLL: Duration = Duration::from_millis(20);
/// Outcomes that may wait for the collector, for each thread.
const WAITING_PER_THREAD: usize = 4;

/// What the workers send.
enum Message {
    Ended {
        task: Task,
        outcome: Outcome,
        wall: f64,
    },
    /// The plan could not be continued, since a part could not be looked up.
    Broken(DatasetError),
}

/// A part of which some jobs are still out.
struct OpenPart {
    part: Arc<Part>,
    outcomes: BTreeMap<usize, Outcome>,
    again: bool,
    predicted: f64,
    measured: f64,
}

pub(super) struct Collector<'a> {
    scope: Scope<'a>,
    staging: &'a Path,
    walltime: &'a Walltime,
    log: &'a mut Log,
    report: &'a mut RunReport,
    progress: &'a mut dyn FnMut(RunEvent<'_>),
    open: HashMap<(usize, u64), OpenPart>,
}

impl<'a> Collector<'a> {
    pub fn new(
        scope: Scope<'a>,
        staging: &'a Path,
        walltime: &'a Walltime,
        log: &'a mut Log,
        report: &'a mut RunReport,
        progress: &'a mut dyn FnMut(RunEvent<'_>),
    ) -> Self {
        Self { scope, staging, walltime, log, report, progress, open: HashMap::new() }
    }

    /// Runs the tasks of the scope, until they are done, the flag turns true, the time is over, or something fails that is
    /// not a job. Tells whether all were run.
    pub fn run(&mut self, threads: usize, stop: &AtomicBool, kernel: &Kernel<'_>) -> Result<bool, RunError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|source| RunError::Threads { threads, source })?;
        // Apart from the caller's flag, since an error here also ends the workers.
        let interrupt = &AtomicBool::new(false);
        let (sender, receiver) = sync_channel(threads * WAITING_PER_THREAD);
        let tasks = self.scope.tasks(self.walltime).take_while(|_| !interrupt.load(Ordering::Relaxed));
        pool.in_place_scope(|workers| {
            workers.spawn(move |_| tasks.par_bridge().for_each(|task| work(task, kernel, interrupt, &sender)));
            let collected = self.collect(&receiver, stop, interrupt);
            interrupt.store(true, Ordering::Relaxed);
            // Frees workers that wait to send.
            drop(receiver);
            collected
        })
    }

    fn collect(
        &mut self,
        receiver: &Receiver<Message>,
        stop: &AtomicBool,
        interrupt: &AtomicBool,
    ) -> Result<bool, RunError> {
        let mut is_told = false;
        loop {
            let must_end = stop.load(Ordering::Relaxed) || self.walltime.is_over();
            if must_end && !interrupt.swap(true, Ordering::Relaxed) {
                (self.progress)(RunEvent::Stopping);
            }
            if !is_told && self.walltime.refused().is_some() {
                is_told = true;
                (self.progress)(RunEvent::OutOfTime);
            }
            match receiver.recv_timeout(STOP_POLL) {
                Ok(Message::Ended { task, outcome, wall }) => self.take(&task, outcome, wall)?,
                Ok(Message::Broken(error)) => return Err(error.into()),
                Err(RecvTimeoutError::Timeout) => (),
                Err(RecvTimeoutError::Disconnected) => {
                    return Ok(!interrupt.load(Ordering::Relaxed) && self.walltime.refused().is_none());
                }
            }
        }
    }

    fn take(&mut self, task: &Task, outcome: Outcome, wall: f64) -> Result<(), RunError> {
        let job = &task.part.jobs[task.position];
        let predicted_cost = job.cost;
        self.walltime.ended(predicted_cost, wall);
        match &outcome {
            Ok(result) => (self.progress)(RunEvent::JobDone { slips: result.slips.len(), predicted_cost, wall }),
            Err(reason) => {
                let sweep = &self.scope.directory.sweeps()[task.part.epoch];
                let (job_id, command) = (sweep.job_id(&job.parameters).to_string(), sweep.command(job));
                let failed = RunEvent::JobFailed { job_id: &job_id, reason, command: &command, predicted_cost, wall };
                (self.progress)(failed);
                self.log.write(Entry::Failed { job_id, reason: reason.clone(), command })?;
            }
        }
        let key = (task.part.epoch, task.part.index);
        let open = self.open.entry(key).or_insert_with(|| OpenPart {
            part: Arc::clone(&task.part),
            outcomes: BTreeMap::new(),
            again: task.again,
            predicted: 0.0,
            measured: 0.0,
        });
        open.outcomes.insert(task.position, outcome);
        open.predicted += predicted_cost;
        open.measured += wall;
        if open.outcomes.len() == task.together
            && let Some(whole) = self.open.remove(&key)
        {
            self.commit(&whole)?;
        }
        Ok(())
    }

    fn commit(&mut self, whole: &OpenPart) -> Result<(), RunError> {
        let begin = Instant::now();
        part::commit(self.scope.storage, self.scope.directory, self.staging, &whole.part, &whole.outcomes)?;
        self.walltime.committed(begin.elapsed().as_secs_f64());
        let (name, jobs) = (part_name(&whole.part), whole.outcomes.len());
        let failed = whole.outcomes.values().filter(|outcome| outcome.is_err()).count();
        let (predicted, measured) = (whole.predicted, whole.measured);
        let report = &mut *self.report;
        report.parts_committed += 1;
        report.jobs_run += jobs as u64;
        // A part that others committed since the survey is not in the count.
        report.jobs_left = report.jobs_left.saturating_sub(jobs as u64);
        if whole.again {
            report.jobs_failed = report.jobs_failed.saturating_sub(jobs as u64);
        }
        report.jobs_failed += failed as u64;
        report.predicted_cost += predicted;
        report.measured_cost += measured;
        (self.progress)(RunEvent::PartCommitted { part: &name, jobs, failed });
        Ok(self.log.write(Entry::Part { part: name, jobs, failed, predicted, measured })?)
    }
}

/// Runs one job and sends its outcome. That nobody listens any more means that the run has ended.
fn work(task: Result<Task, DatasetError>, kernel: &Kernel<'_>, interrupt: &AtomicBool, sender: &SyncSender<Message>) {
    let message = match task {
        Err(error) => Message::Broken(error),
        Ok(task) => {
            let begin = Instant::now();
            let Some(outcome) = outcome(&task.part.jobs[task.position], kernel, interrupt) else { return };
            Message::Ended { task, outcome, wall: begin.elapsed().as_secs_f64() }
        }
    };
    let _ = sender.send(message);
}

/// `None` for a job that was interrupted.
fn outcome(job: &Job, kernel: &Kernel<'_>, interrupt: &AtomicBool) -> Option<Outcome> {
    match catch_unwind(AssertUnwindSafe(|| kernel(job, interrupt))) {
        Ok(Ok(result)) => Some(Ok(result)),
        Ok(Err(SimulationError::Interrupted { .. })) if interrupt.load(Ordering::Relaxed) => None,
        Ok(Err(error)) => Some(Err(error.to_string())),
        Err(panic) => Some(Err(format!("panic: {}", message_of(&*panic)))),
    }
}

fn message_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a message")
}
