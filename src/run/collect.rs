//! The collector hands jobs to the threads, puts their outcomes together into parts, and commits them. Only it uses the
//! disk.

use crate::results::ResultsError;
use crate::results::layout::shorter_in_tests;
use crate::results::parts::{Outcome, Outcomes};
use crate::results::pending::Pending;
use crate::run::take::{LOOK, Left, PartJob, Taken, Work};
use crate::run::{Events, Joined, Kernel, RunEvent, RunReport, limits};
use crate::solver::SimulationError;
use crate::sweep::{Job, PartName};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const STOP_POLL: Duration = Duration::from_millis(if cfg!(test) { 2 } else { 20 });
/// Time between two ticks for the display.
const TICK: Duration = shorter_in_tests(Duration::from_secs(1), Duration::from_millis(20));
/// How often it counts the parts that others have done.
const LOOK_AT_OTHERS: Duration = Duration::from_secs(10);
/// A job is reported as long once it has run for this time and this multiple of its predicted cost, and again each time
/// that its time has doubled.
const LONG: Duration = shorter_in_tests(Duration::from_secs(5), Duration::from_millis(50));
const LONG_BY_PREDICTION: f64 = 20.0;
/// Predicted time of the jobs that wait for each thread, to be run during a commit, in s; at most [`MAX_AHEAD`] jobs.
const AHEAD: f64 = 0.5;
const MAX_AHEAD: usize = 256;

struct Ended {
    job: PartJob,
    /// `None` if it was interrupted.
    outcome: Option<Outcome>,
    time: JobTime,
}

#[derive(Clone, Copy, Debug, Default)]
struct JobTime {
    cpu: f64,
    wall: f64,
}

struct UnderWay {
    job: PartJob,
    begin: Instant,
    long_after: Duration,
}

type AllUnderWay = Mutex<BTreeMap<(PartName, usize), UnderWay>>;

/// The jobs that were handed out and have not ended.
#[derive(Default)]
struct Out {
    jobs: usize,
    cost: f64,
    memory: f64,
    /// Memory that all jobs together may take, in bytes.
    free: f64,
    /// Whether it has been reported that memory limits the jobs.
    was_short: bool,
}

impl Out {
    fn has_room(&self, threads: usize) -> bool {
        self.jobs < threads
            || (self.jobs < threads * MAX_AHEAD && self.cost < threads as f64 * AHEAD)
    }

    fn add(&mut self, job: &PartJob) {
        self.jobs += 1;
        self.cost += job.job().cost;
        self.memory += job.memory;
    }

    fn remove(&mut self, job: &PartJob) {
        self.jobs -= 1;
        self.cost -= job.job().cost;
        self.memory -= job.memory;
        if self.jobs == 0 {
            // Without rounding errors, or what infinity leaves.
            self.cost = 0.0;
            self.memory = 0.0;
        }
    }
}

/// A part of which some jobs are still out.
pub(super) struct OpenPart {
    of: Arc<Taken>,
    outcomes: Outcomes,
    failed_before: u64,
    predicted_cost: f64,
    measured: JobTime,
}

pub(super) struct Collector<'a, 'e> {
    pub joined: &'a Joined<'a>,
    pub pending: &'a Pending<'a>,
    pub events: &'a mut Events<'e>,
    pub report: &'a mut RunReport,
    pub open: BTreeMap<PartName, OpenPart>,
    /// Number and predicted cost of the jobs of the parts that it has committed, spilled ones included.
    pub own: (u64, f64),
}

impl Collector<'_, '_> {
    /// Runs jobs until this worker has none left, and reports what other workers still run; `None` if it was stopped.
    pub fn run_all(&mut self, kernel: &Kernel<'_>) -> Result<Option<Left>, ResultsError> {
        let has_rounds = self.pending.results.round().is_some();
        while self.run(kernel)? {
            loop {
                let left = self.pending.left(self.joined.member)?;
                if left.has_abandoned {
                    // Their worker has died meanwhile.
                    break;
                }
                if left.jobs == 0 {
                    return Ok(Some(left));
                }
                if self.joined.must_end() {
                    return Ok(None);
                }
                if !has_rounds {
                    return Ok(Some(left));
                }
                // The next round may have jobs for this worker.
                std::thread::sleep(LOOK);
            }
        }
        Ok(None)
    }

    /// Runs pending jobs until none is left for this worker, the flag turns true, the time is over, or something other
    /// than a job fails. Returns whether it took all that it could.
    fn run(&mut self, kernel: &Kernel<'_>) -> Result<bool, ResultsError> {
        let mut threads = self.joined.threads;
        let work = Work::new(self.pending, self.joined)?;
        if work.is_all_alone() {
            // Each thread takes address space.
            threads = 1;
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|error| {
            let problem =
                format!("cannot start {threads} threads: {error}; take fewer with --threads");
            ResultsError::refused(self.pending.results.layout().root(), problem)
        })?;
        // Not the caller's flag, as an error here also ends the threads.
        let interrupt = &AtomicBool::new(false);
        let under_way = &AllUnderWay::default();
        let (sender, receiver) = channel();
        let all_run = pool.in_place_scope(|workers| {
            let hand_out = |job: PartJob| {
                let sender = sender.clone();
                workers.spawn(move |_| {
                    // Without a receiver the run has ended.
                    let _ = sender.send(run_job(job, kernel, interrupt, under_way));
                });
            };
            let collected = self.collect(work, threads, hand_out, &receiver, under_way, interrupt);
            interrupt.store(true, Ordering::Relaxed);
            collected
        })?;
        if !all_run {
            self.spill()?;
        }
        Ok(all_run)
    }

    /// Keeps the finished jobs of unfinished parts.
    fn spill(&mut self) -> Result<(), ResultsError> {
        for open in std::mem::take(&mut self.open).values() {
            if open.of.again {
                self.commit(open)?;
            } else {
                let Taken { part, spilled, .. } = &*open.of;
                self.pending
                    .results
                    .spill(self.joined.member, part, &open.outcomes, spilled)?;
                let jobs = open.outcomes.len() as u64;
                self.report.jobs_spilled += jobs;
                self.report.jobs_left = self.report.jobs_left.saturating_sub(jobs);
            }
        }
        Ok(())
    }

    /// Hands out jobs and takes their outcomes until no more come. Returns whether it took all that it could.
    fn collect(
        &mut self,
        mut work: Work<'_>,
        threads: usize,
        hand_out: impl Fn(PartJob),
        ended: &Receiver<Ended>,
        under_way: &AllUnderWay,
        interrupt: &AtomicBool,
    ) -> Result<bool, ResultsError> {
        let mut out = Out {
            free: self.joined.memory(),
            ..Out::default()
        };
        let mut is_out_of_time = false;
        let [mut last_tick, mut last_look] = [Instant::now(); 2];
        loop {
            if last_look.elapsed() >= LOOK_AT_OTHERS {
                last_look = Instant::now();
                self.report_others()?;
            }
            if last_tick.elapsed() >= TICK {
                last_tick = Instant::now();
                out.free = self.joined.memory();
                self.report_long_jobs(under_way)?;
                self.events.send(&RunEvent::Tick)?;
            }
            if self.joined.must_end() && !interrupt.swap(true, Ordering::Relaxed) {
                self.events.send(&RunEvent::Stopping)?;
            }
            let is_interrupted = interrupt.load(Ordering::Relaxed);
            if !is_interrupted {
                self.fill(&mut out, &mut work, threads, &hand_out)?;
            }
            if !is_out_of_time && self.joined.walltime.has_refused() {
                is_out_of_time = true;
                self.events.send(&RunEvent::OutOfTime)?;
            }
            if out.jobs == 0 && (is_interrupted || work.has_ended) {
                return Ok(!is_interrupted && !is_out_of_time);
            }
            // A sender is kept, so an error means that there is nothing yet.
            if let Ok(Ended { job, outcome, time }) = ended.recv_timeout(STOP_POLL) {
                out.remove(&job);
                if let Some(outcome) = outcome {
                    self.take(&job, outcome, time)?;
                }
            }
        }
    }

    /// Hands out jobs as long as threads wait for them and memory is free.
    fn fill(
        &mut self,
        out: &mut Out,
        work: &mut Work<'_>,
        threads: usize,
        hand_out: &impl Fn(PartJob),
    ) -> Result<(), ResultsError> {
        while !self.joined.must_end()
            && out.has_room(threads)
            && let Some(job) = work.next(out.jobs > 0, out.jobs >= threads)?
        {
            if let Some(reason) = self.pending.refusal(job.job()) {
                self.take(&job, Err(reason), JobTime::default())?;
                continue;
            }
            if out.memory + limits::beside_threads(job.memory, threads) > out.free {
                let is_limit = out.jobs < threads && job.memory.is_finite();
                if is_limit && !std::mem::replace(&mut out.was_short, true) {
                    self.events.send(&RunEvent::ShortOfMemory {
                        allowed: out.free - out.memory,
                        needed: job.memory,
                    })?;
                }
                if out.jobs > 0 {
                    work.put_back(job);
                    break;
                }
            }
            out.add(&job);
            hand_out(job);
        }
        Ok(())
    }

    fn report_long_jobs(&mut self, under_way: &AllUnderWay) -> Result<(), ResultsError> {
        for long in locked(under_way).values_mut() {
            let elapsed = long.begin.elapsed();
            if elapsed >= long.long_after {
                long.long_after = 2 * elapsed;
                let job = long.job.job();
                self.events.send(&RunEvent::JobTakesLong {
                    command: self.pending.results.sweep().command(job),
                    predicted_cost: job.cost,
                    wall: elapsed.as_secs_f64(),
                })?;
            }
        }
        Ok(())
    }

    /// Reports what other workers have done since the run began.
    fn report_others(&mut self) -> Result<(), ResultsError> {
        let (jobs, cost) = self.pending.done_since()?;
        let jobs = jobs.saturating_sub(self.own.0);
        let predicted_cost = (cost - self.own.1).max(0.0);
        Ok(self.events.send(&RunEvent::OthersDone {
            jobs,
            predicted_cost,
        })?)
    }

    fn take(&mut self, of: &PartJob, outcome: Outcome, time: JobTime) -> Result<(), ResultsError> {
        let part = &of.of.part;
        let job = of.job();
        self.joined.member.count_job();
        let predicted_cost = job.cost;
        let event = match &outcome {
            Ok(measured) => RunEvent::JobDone {
                slips: measured.slips.len(),
                predicted_cost,
            },
            Err(reason) => RunEvent::JobFailed {
                job_id: self.pending.results.job_id(part, of.position),
                reason: reason.clone(),
                command: self.pending.results.sweep().command(job),
                predicted_cost,
            },
        };
        self.events.send(&event)?;
        let key = part.name;
        let open = self.open.entry(key).or_insert_with(|| OpenPart {
            of: Arc::clone(&of.of),
            outcomes: Outcomes::new(),
            failed_before: 0,
            predicted_cost: 0.0,
            measured: JobTime::default(),
        });
        open.outcomes.insert(of.position, outcome);
        open.failed_before += u64::from(of.failed_before);
        open.predicted_cost += predicted_cost;
        open.measured.cpu += time.cpu;
        open.measured.wall += time.wall;
        if open.outcomes.len() == of.of.together
            && let Some(whole) = self.open.remove(&key)
        {
            self.commit(&whole)?;
        }
        Ok(())
    }

    fn commit(&mut self, whole: &OpenPart) -> Result<(), ResultsError> {
        let begin = Instant::now();
        let Taken { part, spilled, .. } = &*whole.of;
        self.pending
            .results
            .commit(self.joined.member, part, &whole.outcomes, spilled)?;
        let name = part.name;
        self.joined.member.end_part(name)?;
        let took = whole.of.begin.elapsed();
        self.joined.walltime.committed(took, begin.elapsed());
        if !whole.of.again {
            self.own = (self.own.0 + part.job_count as u64, self.own.1 + part.cost);
        }
        let jobs = whole.outcomes.len();
        let outcomes = whole.outcomes.values();
        let failed = outcomes.filter(|outcome| outcome.is_err()).count();
        let report = &mut *self.report;
        report.parts_committed += 1;
        report.jobs_run += jobs as u64;
        report.jobs_left = report.jobs_left.saturating_sub(jobs as u64);
        report.jobs_failed =
            (report.jobs_failed + failed as u64).saturating_sub(whole.failed_before);
        report.predicted_cost += whole.predicted_cost;
        report.measured_cost += whole.measured.cpu;
        Ok(self.events.send(&RunEvent::PartCommitted {
            part: name.to_string(),
            jobs,
            failed,
            predicted_cost: whole.predicted_cost,
            measured_cost: whole.measured.cpu,
            wall: whole.measured.wall,
        })?)
    }
}

fn locked(under_way: &AllUnderWay) -> MutexGuard<'_, BTreeMap<(PartName, usize), UnderWay>> {
    // Nothing panics while it is held.
    under_way.lock().unwrap_or_else(PoisonError::into_inner)
}

fn run_job(
    job: PartJob,
    kernel: &Kernel<'_>,
    interrupt: &AtomicBool,
    under_way: &AllUnderWay,
) -> Ended {
    if interrupt.load(Ordering::Relaxed) {
        return Ended {
            job,
            outcome: None,
            time: JobTime::default(),
        };
    }
    let begin = Instant::now();
    let task = job.job();
    let long_after = Duration::try_from_secs_f64(LONG_BY_PREDICTION * task.cost);
    let long = UnderWay {
        job: job.clone(),
        begin,
        long_after: long_after.unwrap_or(Duration::MAX).max(LONG),
    };
    let key = (job.of.part.name, job.position);
    locked(under_way).insert(key, long);
    let (cpu, outcome) = limits::timed(|| outcome(task, kernel, interrupt));
    locked(under_way).remove(&key);
    let wall = begin.elapsed().as_secs_f64();
    let time = JobTime { cpu, wall };
    Ended { job, outcome, time }
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
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("without a message")
}
