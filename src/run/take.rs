//! Which of the missing parts this worker takes.
//!
//! Workers take parts by claims: those that no living worker has, from a place of their own if others run. Then they look
//! for parts of workers that have died since, until living workers have all that are left.
//! Parts that may not fit in memory come later, and parts at which workers died last; after some deaths they run alone,
//! as a job that ends its process must not end others.
//!
//! `claims.rs` says what a claim and its generation are, `workers.rs` who is dead.

use crate::results::ResultsError;
use crate::results::claims::{ClaimState, Claims};
use crate::results::commit::own_number;
use crate::results::layout::shorter_in_tests;
use crate::results::pending::Pending;
use crate::results::tables::RecordedTable;
use crate::results::workers::{Living, Member};
use crate::run::Joined;
use crate::run::limits::beside_threads;
use crate::sweep::{Job, Outline, Part, predicted_memory};
use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};
use std::vec::IntoIter;

/// Lost claims after which all are listed.
const LOSSES: u32 = 3;
/// Time between two looks for dead workers, by an idle worker and by a busy one.
pub(super) const LOOK: Duration = shorter_in_tests(Duration::from_millis(500), Duration::ZERO);
const LOOK_BUSY: Duration = Duration::from_secs(5);

/// Deaths of workers after which a part runs alone, one job after the other.
const DEATHS: usize = 3;

#[derive(Debug)]
pub(super) struct Taken {
    pub part: Part,
    /// What was claimed to run it.
    pub claim: String,
    /// Positions of its jobs that an earlier run has spilled.
    pub spilled: BTreeSet<usize>,
    /// Whether it was done before, and some of its jobs run again.
    pub again: bool,
    /// How many of its jobs are to be run.
    pub together: usize,
    pub begin: Instant,
}

#[derive(Clone, Debug)]
pub(super) struct PartJob {
    pub of: Arc<Taken>,
    pub position: usize,
    /// Memory that it is predicted to take, in bytes; infinite if it must run alone.
    pub memory: f64,
}

impl PartJob {
    pub fn job(&self) -> &Job {
        &self.of.part.jobs[self.position]
    }
}

/// What is left when a worker has nothing to do.
#[derive(Debug, Default)]
pub(super) struct Left {
    pub jobs: u64,
    /// Hosts of the workers that run them.
    pub hosts: BTreeSet<String>,
    /// Whether no worker runs some of them.
    pub has_abandoned: bool,
}

/// Jobs of finished parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Done {
    pub jobs: u64,
    /// Predicted, in CPU seconds.
    pub cost: f64,
}

impl Done {
    pub(super) fn add(&mut self, part: &Outline) {
        self.jobs += part.job_count as u64;
        self.cost += part.cost;
    }
}

impl Pending<'_> {
    /// Of parts that were finished since they were looked up.
    pub(super) fn done_since(&self) -> Result<Done, ResultsError> {
        let done = self.results.done_parts()?;
        let is_new = |part: &&Outline| done.contains(&part.name) && !self.done.contains(&part.name);
        let mut sum = Done::default();
        self.parts
            .iter()
            .filter(is_new)
            .for_each(|part| sum.add(part));
        Ok(sum)
    }

    /// What is left once this worker has committed all its parts; nothing for the last worker that looks.
    pub(super) fn left(&self, member: &Member<'_>) -> Result<Left, ResultsError> {
        let others = member.others()?;
        let claims = Claims::list(member)?;
        let done = self.results.done_parts()?;
        let mut left = Left::default();
        for part in self.parts.iter().filter(|part| !done.contains(&part.name)) {
            left.jobs += part.job_count as u64;
            match claims.standing(&part.name.to_string(), &others)? {
                ClaimState::Taken(owner) => {
                    left.hosts.insert(others[owner].worker.host.clone());
                }
                ClaimState::Free(_) => left.has_abandoned = true,
                ClaimState::Own => {
                    let path = self.results.part_file(RecordedTable::Jobs, part);
                    return Err(ResultsError::damaged(&path, "it was committed and is gone"));
                }
            }
        }
        Ok(left)
    }
}

/// Takes pending parts, and gives their jobs one by one.
pub(super) struct Work<'a> {
    pending: &'a Pending<'a>,
    joined: &'a Joined<'a>,
    claims: Claims<'a>,
    others: BTreeMap<String, Living>,
    /// Parts to take that no living worker had, each with the generation of its claim.
    free: IntoIter<(&'a Outline, u64)>,
    losses: u32,
    jobs: VecDeque<PartJob>,
    /// When it last looked for parts, or had taken those of the first look, and the beats that it saw first.
    last_look: Option<Instant>,
    beats: HashMap<String, SystemTime>,
    /// Whether there will be no more jobs for this worker.
    pub has_ended: bool,
}

impl<'a> Work<'a> {
    pub fn new(pending: &'a Pending<'a>, joined: &'a Joined<'a>) -> Result<Self, ResultsError> {
        let mut work = Self {
            pending,
            joined,
            claims: Claims::list(joined.member)?,
            others: BTreeMap::new(),
            free: Vec::new().into_iter(),
            losses: 0,
            jobs: VecDeque::new(),
            last_look: None,
            beats: HashMap::new(),
            has_ended: false,
        };
        work.look(true)?;
        Ok(work)
    }

    /// Lists the parts that no living worker has, at first with those that are done and may run again. Returns whether
    /// there is none, and the workers that have the others certainly live.
    fn look(&mut self, is_first: bool) -> Result<bool, ResultsError> {
        let pending = self.pending;
        // In this order: a worker that has ended committed or spilled before.
        self.others = self.joined.member.others()?;
        self.claims.refresh()?;
        pending.look_at_spill()?;
        let done = pending.results.done_parts()?;
        let runs_again =
            |part: &Outline| pending.done.contains(&part.name) && pending.may_run(part);
        let is_left =
            |part: &&Outline| !done.contains(&part.name) || (is_first && runs_again(part));
        let mut is_certain = true;
        let mut free: Vec<(&Outline, u64)> = Vec::new();
        for part in pending.parts.iter().filter(is_left) {
            let claim = pending.claim(part.name);
            match self.claims.standing(&claim, &self.others)? {
                ClaimState::Own => (),
                ClaimState::Taken(owner) => {
                    let living = &self.others[owner];
                    let first = self.beats.entry(owner.to_owned()).or_insert(living.beat);
                    is_certain &= living.is_certain || *first != living.beat;
                }
                ClaimState::Free(generation) => free.push((part, generation)),
            }
        }
        if free.iter().any(|(_, generation)| *generation > 0) {
            // Their owners may be suspended, and must not commit them later.
            self.joined.member.tidy(false)?;
        }
        pending.look_at_deaths()?;
        if !self.others.is_empty() && !free.is_empty() {
            let place = own_number() % free.len() as u64;
            free.rotate_left(usize::try_from(place).unwrap_or_default());
        }
        free.sort_by_key(|(part, _)| {
            let needed = beside_threads(part.memory, self.joined.threads);
            let may_not_fit = needed > pending.retry.memory;
            let is_done = pending.done.contains(&part.name);
            (pending.deaths(part), may_not_fit, is_done)
        });
        let is_none = free.is_empty();
        self.free = free.into_iter();
        Ok(is_none && is_certain)
    }

    /// Whether all that is left runs alone.
    pub fn is_all_alone(&self) -> bool {
        let mut left = self.free.as_slice().iter();
        left.all(|(part, _)| self.pending.deaths(part) >= DEATHS)
    }

    /// Gives back a job for which there is no room yet.
    pub fn put_back(&mut self, job: PartJob) {
        self.jobs.push_front(job);
    }

    /// The next job; `None` while this worker has no job to run. With `is_busy`, other jobs run; with `is_ahead`, the
    /// job would wait for a thread.
    pub fn next(&mut self, is_busy: bool, is_ahead: bool) -> Result<Option<PartJob>, ResultsError> {
        if self.jobs.is_empty() && !self.has_ended {
            self.take_next(is_busy, is_ahead)?;
        }
        Ok(self.jobs.pop_front())
    }

    /// Whether the next part must wait: with a part at which workers died, no job may wait for a thread.
    fn must_wait(&self, is_busy: bool, is_ahead: bool) -> bool {
        let next = self.free.as_slice().first();
        match next.map_or(1, |(part, _)| self.pending.deaths(part)) {
            0 => false,
            1..DEATHS => is_ahead,
            _ => is_busy,
        }
    }

    fn take_next(&mut self, is_busy: bool, is_ahead: bool) -> Result<(), ResultsError> {
        while !self.joined.walltime.has_refused() {
            if self.must_wait(is_busy, is_ahead) {
                return Ok(());
            }
            let Some((part, generation)) = self.free.next() else {
                break;
            };
            let last = self.claims.last(&self.pending.claim(part.name));
            let is_free = last.map_or(0, |last| last + 1) == generation;
            if is_free && self.take_part(part, generation)? {
                return Ok(());
            }
        }
        let last_look = *self.last_look.get_or_insert_with(Instant::now);
        if self.joined.walltime.has_refused() {
            self.has_ended = true;
        } else if last_look.elapsed() >= self.pause(is_busy) {
            self.last_look = Some(Instant::now());
            self.has_ended = self.look(false)?;
        }
        Ok(())
    }

    /// Time between two looks for dead workers; none for an idle worker that was alone and has rounds before it.
    fn pause(&self, is_busy: bool) -> Duration {
        let has_rounds = self.pending.results.round().is_some();
        match (is_busy, self.others.is_empty() && has_rounds) {
            (true, _) => LOOK_BUSY,
            (false, true) => Duration::ZERO,
            (false, false) => LOOK,
        }
    }

    fn take_part(&mut self, outline: &Outline, generation: u64) -> Result<bool, ResultsError> {
        if !self.pending.done.contains(&outline.name) {
            let spilled = self.pending.spilled(outline)?;
            let left = (0..outline.job_count).filter(|position| !spilled.contains(position));
            let jobs = left.collect();
            return self.take(self.pending.part(outline), spilled, jobs, generation);
        }
        let again = self.pending.results.again(outline)?;
        if again.is_empty() {
            return Ok(false);
        }
        let part = self.pending.part(outline);
        let runs = |position: usize, why| self.pending.runs_again(&part.jobs[position], why);
        let runnable = again.iter().filter(|(position, why)| runs(**position, why));
        let jobs: Vec<usize> = runnable.map(|(position, _)| *position).collect();
        Ok(!jobs.is_empty() && self.take(part, BTreeSet::new(), jobs, generation)?)
    }

    /// Claims a part, if there is time for it. `jobs` are those to be run.
    fn take(
        &mut self,
        part: Part,
        spilled: BTreeSet<usize>,
        jobs: Vec<usize>,
        generation: u64,
    ) -> Result<bool, ResultsError> {
        if !self.joined.walltime.admits_part() {
            return Ok(false);
        }
        let claim = self.pending.claim(part.name);
        if !self.claims.take(&claim, generation)? {
            self.losses += 1;
            if self.losses == LOSSES {
                self.losses = 0;
                self.claims.refresh()?;
            }
            return Ok(false);
        }
        self.joined.member.begin_part(&claim, generation);
        let is_alone = self.pending.deaths(&part) >= DEATHS;
        let again = self.pending.done.contains(&part.name);
        let taken = Arc::new(Taken {
            part,
            claim,
            spilled,
            again,
            together: jobs.len(),
            begin: Instant::now(),
        });
        let recording = self.pending.results.sweep().recording();
        for position in jobs {
            let mut memory = predicted_memory(&taken.part.jobs[position].parameters, recording);
            if is_alone {
                memory = f64::INFINITY;
            }
            self.jobs.push_back(PartJob {
                of: Arc::clone(&taken),
                position,
                memory,
            });
        }
        Ok(true)
    }
}
