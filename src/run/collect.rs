//! The collector hands jobs to the threads, puts their outcomes together into parts, and commits these. The threads
//! also encode the files of whole parts, so that small jobs do not wait for the collector. Only it uses the disk.

use crate::results::layout::shorter_in_tests;
use crate::results::parts::{EarlierRows, Outcome, Outcomes, PartFiles};
use crate::results::pending::Pending;
use crate::results::{Results, ResultsError};
use crate::run::take::{Done, LOOK, Left, PartJob, Taken, Work};
use crate::run::{Events, Joined, Kernel, RunEvent, RunReport, limits};
use crate::solver::SimulationError;
use crate::sweep::{Job, PartName};
use std::any::Any;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

const STOP_POLL: Duration = Duration::from_millis(if cfg!(test) { 2 } else { 20 });
/// How long the collector lets ended jobs gather after it had none.
const GATHER: Duration = shorter_in_tests(Duration::from_micros(500), Duration::ZERO);
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

/// What threads do.
enum Task {
    Run(PartJob),
    Encode(OpenPart, EarlierRows),
}

/// What they have done.
enum Finished {
    Job {
        job: PartJob,
        /// `None` if it was interrupted.
        outcome: Option<Outcome>,
        time: JobTime,
    },
    Part {
        whole: OpenPart,
        begin: Instant,
        /// An error of the outer kind is a panic.
        files: std::thread::Result<Result<PartFiles, ResultsError>>,
    },
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

/// The jobs that were handed out and have not ended, and the whole parts that are being encoded.
#[derive(Default)]
struct Out {
    jobs: usize,
    parts: usize,
    cost: f64,
    memory: f64,
    /// Memory that all jobs together may take, in bytes.
    free: f64,
    /// Whether it has been reported that memory limits the jobs.
    was_short: bool,
}

impl Out {
    const fn is_empty(&self) -> bool {
        self.jobs == 0 && self.parts == 0
    }

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

/// A part of which some jobs are still out, or that is not committed yet.
pub(super) struct OpenPart {
    of: Arc<Taken>,
    outcomes: Outcomes,
    predicted_cost: f64,
    measured: JobTime,
}

pub(super) struct Collector<'a, 'e> {
    pub joined: &'a Joined<'a>,
    pub pending: &'a Pending<'a>,
    pub events: &'a mut Events<'e>,
    pub report: &'a mut RunReport,
    pub open: BTreeMap<PartName, OpenPart>,
    /// Of the parts that it has committed, spilled jobs included.
    pub own: Done,
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
        let built = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = built.map_err(|error| {
            let problem =
                format!("cannot start {threads} threads: {error}; take fewer with --threads");
            ResultsError::refused(self.pending.results.layout().root(), problem)
        })?;
        // Not the caller's flag, as an error here also ends the threads.
        let interrupt = &AtomicBool::new(false);
        let under_way = &AllUnderWay::default();
        let (sender, receiver) = channel();
        let all_run = pool.in_place_scope(|workers| {
            let results = self.pending.results;
            let hand_out = |task: Task| {
                let sender = sender.clone();
                workers.spawn(move |_| {
                    let ended = match task {
                        Task::Run(job) => run_job(job, kernel, interrupt, under_way),
                        Task::Encode(whole, earlier) => {
                            let begin = Instant::now();
                            let encode = || encode(results, &whole, &earlier);
                            let files = catch_unwind(AssertUnwindSafe(encode));
                            Finished::Part {
                                whole,
                                begin,
                                files,
                            }
                        }
                    };
                    // Without a receiver the run has ended.
                    let _ = sender.send(ended);
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
        let results = self.pending.results;
        for open in std::mem::take(&mut self.open).values() {
            let begin = Instant::now();
            let earlier = self.earlier_rows(&open.of)?;
            if open.of.again {
                self.commit(open, begin, &encode(results, open, &earlier)?)?;
            } else {
                let layout = results.layout();
                let files =
                    results.encode(&open.of.part, &open.outcomes, &earlier, &layout.spill())?;
                results.put(self.joined.member, &files, &layout.run())?;
                let jobs = open.outcomes.len() as u64;
                self.report.jobs_spilled += jobs;
                self.report.jobs_left = self.report.jobs_left.saturating_sub(jobs);
            }
        }
        Ok(())
    }

    /// The rows that a part has already.
    fn earlier_rows(&self, of: &Taken) -> Result<EarlierRows, ResultsError> {
        let layout = self.pending.results.layout();
        let place = match (of.again, of.spilled.is_empty()) {
            (true, _) => Some(layout.tables()),
            (false, false) => Some(layout.spill()),
            (false, true) => None,
        };
        self.pending
            .results
            .earlier_rows(&of.part, place.as_deref())
    }

    /// Hands out jobs and takes their outcomes until no more come. Returns whether it took all that it could.
    fn collect(
        &mut self,
        mut work: Work<'_>,
        threads: usize,
        hand_out: impl Fn(Task),
        ended: &Receiver<Finished>,
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
            if out.is_empty() && (is_interrupted || work.has_ended) {
                return Ok(!is_interrupted && !is_out_of_time);
            }
            match next(ended) {
                None => (),
                Some(Finished::Job { job, outcome, time }) => {
                    out.remove(&job);
                    if let Some(outcome) = outcome {
                        self.take(&job, outcome, time, &mut out, &hand_out)?;
                    }
                }
                Some(Finished::Part {
                    whole,
                    begin,
                    files,
                }) => {
                    out.parts -= 1;
                    let files = files.unwrap_or_else(|panic| resume_unwind(panic))?;
                    self.commit(&whole, begin, &files)?;
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
        hand_out: &impl Fn(Task),
    ) -> Result<(), ResultsError> {
        while !self.joined.must_end()
            && out.has_room(threads)
            && let Some(job) = work.next(!out.is_empty(), out.jobs >= threads)?
        {
            if let Some(reason) = self.pending.refusal(job.job()) {
                self.take(&job, Err(reason), JobTime::default(), out, hand_out)?;
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
                // A job that may end this process must not take finished parts with it.
                if !out.is_empty() {
                    work.put_back(job);
                    break;
                }
            }
            out.add(&job);
            hand_out(Task::Run(job));
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
        let done = self.pending.done_since()?;
        let jobs = done.jobs.saturating_sub(self.own.jobs);
        let predicted_cost = (done.cost - self.own.cost).max(0.0);
        Ok(self.events.send(&RunEvent::OthersDone {
            jobs,
            predicted_cost,
        })?)
    }

    /// Puts an outcome to the others of its part, which is encoded when it is whole.
    fn take(
        &mut self,
        of: &PartJob,
        outcome: Outcome,
        time: JobTime,
        out: &mut Out,
        hand_out: &impl Fn(Task),
    ) -> Result<(), ResultsError> {
        let part = &of.of.part;
        let job = of.job();
        self.joined.member.count_job();
        let predicted_cost = job.cost;
        let event = match &outcome {
            Ok(_) => RunEvent::JobDone { predicted_cost },
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
            predicted_cost: 0.0,
            measured: JobTime::default(),
        });
        open.outcomes.insert(of.position, outcome);
        open.predicted_cost += predicted_cost;
        open.measured.cpu += time.cpu;
        open.measured.wall += time.wall;
        if open.outcomes.len() == of.of.together
            && let Some(whole) = self.open.remove(&key)
        {
            let earlier = self.earlier_rows(&whole.of)?;
            out.parts += 1;
            hand_out(Task::Encode(whole, earlier));
        }
        Ok(())
    }

    /// Commits a part whose files began to be encoded then.
    fn commit(
        &mut self,
        whole: &OpenPart,
        begin: Instant,
        files: &PartFiles,
    ) -> Result<(), ResultsError> {
        let Taken { part, spilled, .. } = &*whole.of;
        let results = self.pending.results;
        results.put(self.joined.member, files, &results.layout().tables())?;
        if !spilled.is_empty() {
            results.remove_spilled(part)?;
        }
        self.joined.member.end_part(&whole.of.claim)?;
        let took = whole.of.begin.elapsed();
        self.joined.walltime.committed(took, begin.elapsed());
        if !whole.of.again {
            self.own.add(part);
        }
        let jobs = whole.outcomes.len();
        let outcomes = whole.outcomes.values();
        let failed = outcomes.filter(|outcome| outcome.is_err()).count();
        let report = &mut *self.report;
        report.parts_committed += 1;
        report.jobs_run += jobs as u64;
        report.jobs_left = report.jobs_left.saturating_sub(jobs as u64);
        report.jobs_failed += failed as u64;
        report.predicted_cost += whole.predicted_cost;
        report.measured_cost += whole.measured.cpu;
        Ok(self.events.send(&RunEvent::PartCommitted {
            part: part.name.to_string(),
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

/// What ended next, if anything does soon.
fn next(ended: &Receiver<Finished>) -> Option<Finished> {
    ended.try_recv().ok().or_else(|| {
        // A sender is kept, so an error means that there is nothing yet.
        let next = ended.recv_timeout(STOP_POLL).ok();
        // To be woken for each small job would cost more than to take it.
        std::thread::sleep(GATHER);
        next
    })
}

/// The files of a part in the tables.
fn encode(
    results: &Results<'_>,
    whole: &OpenPart,
    earlier: &EarlierRows,
) -> Result<PartFiles, ResultsError> {
    let tables = results.layout().tables();
    results.encode(&whole.of.part, &whole.outcomes, earlier, &tables)
}

fn run_job(
    job: PartJob,
    kernel: &Kernel<'_>,
    interrupt: &AtomicBool,
    under_way: &AllUnderWay,
) -> Finished {
    if interrupt.load(Ordering::Relaxed) {
        return Finished::Job {
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
    Finished::Job { job, outcome, time }
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
