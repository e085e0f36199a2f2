//! What is left of a directory, and what of it this worker takes.
//!
//! Workers take parts by claims, in two passes. The first goes through the plan, from a place of its own if others are at
//! work, and takes what nobody has. The second takes what those had who live no more, until nothing is left but parts that
//! others are at.

use crate::results::claims::{Claims, Standing};
use crate::results::layout::part_name;
use crate::results::parts::{DoneParts, Unfinished};
use crate::results::tables;
use crate::results::workers::{Living, Member};
use crate::results::{Results, ResultsError};
use crate::run::shard::Shard;
use crate::run::walltime::Walltime;
use crate::sweep::{Extension, Part};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet, VecDeque};
use std::hash::{BuildHasher, RandomState};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime};

/// Lost claims after which all are listed.
const LOSSES: u32 = 3;
/// Time between two looks at workers who may have died.
const LOOK: Duration = Duration::from_millis(500);
/// How often to look whether the run is to stop in between.
const POLL: Duration = Duration::from_millis(20);

/// The parts of a shard, as they were when it was looked up which are done.
pub(super) struct Share<'a> {
    pub results: &'a Results<'a>,
    shard: Shard,
    /// Whether failed jobs are to be run again.
    retry_failed: bool,
    done: DoneParts,
    spilled: HashSet<(usize, u64)>,
}

/// How far the parts of a share are. Costs are predicted CPU times, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Overview {
    /// Jobs that are done, without the failed ones.
    pub jobs_done: u64,
    /// Jobs that failed and are asked for.
    pub jobs_failed: u64,
    /// Of those done, jobs that the sweep which was asked for last does not have, failed or not; their data are kept.
    pub jobs_kept: u64,
    /// Jobs that are missing, or are asked for and were ended by a shorter `max_time`.
    pub jobs_missing: u64,
    /// Parts that are committed.
    pub parts_done: u64,
    /// Parts that are missing.
    pub parts_missing: u64,
    /// Cost of all jobs that are done or failed.
    pub predicted_cost_done: f64,
    /// Cost of the failed jobs.
    pub predicted_cost_failed: f64,
    /// Cost of the missing jobs.
    pub predicted_cost_missing: f64,
}

/// A part that this worker has taken.
#[derive(Debug)]
pub(super) struct Taken {
    pub part: Part,
    /// Positions of its jobs that an earlier run has spilled.
    pub spilled: BTreeSet<usize>,
    /// Whether it was done before, and some of its jobs run again.
    pub again: bool,
    /// How many of its jobs are to be run.
    pub together: usize,
}

/// A job of a part that is to be run.
#[derive(Clone, Debug)]
pub(super) struct PartJob {
    pub of: Arc<Taken>,
    pub position: usize,
    /// Whether it has failed before.
    pub failed_before: bool,
}

/// What a worker leaves when it has nothing to do.
#[derive(Debug, Default)]
pub(super) struct Left {
    /// Jobs of the parts that are not done.
    pub jobs: u64,
    /// Names of the hosts that are at them.
    pub hosts: BTreeSet<String>,
    /// Whether nobody is at some of them.
    pub has_abandoned: bool,
}

impl<'a> Share<'a> {
    /// Looks up which parts are done.
    pub fn look_up(results: &'a Results<'a>, shard: Shard, retry_failed: bool) -> Result<Self, ResultsError> {
        let (done, spilled) = (results.done_parts()?, results.spilled_parts()?);
        Ok(Self { results, shard, retry_failed, done, spilled })
    }

    fn parts(&self) -> impl Iterator<Item = Part> + Send + use<'a> {
        self.shard.parts(self.results.plan().parts())
    }

    /// Looks at every part by its name, and into those of which jobs may run again.
    pub fn overview(&self) -> Result<Overview, ResultsError> {
        self.look_into(self.may_run_again(), |_, _, _| ())
    }

    /// Looks into every part, and visits the jobs that failed, with the reasons.
    pub fn overview_with_failures(&self, visit: impl FnMut(&Part, usize, &str)) -> Result<Overview, ResultsError> {
        self.look_into(true, visit)
    }

    fn look_into(&self, looks: bool, mut visit: impl FnMut(&Part, usize, &str)) -> Result<Overview, ResultsError> {
        let mut overview = Overview::default();
        for part in self.parts() {
            if !self.done.has(&part) {
                let spilled = self.spilled(&part)?;
                let spilled_cost: f64 = spilled.iter().map(|&position| part.jobs[position].cost).sum();
                overview.parts_missing += 1;
                overview.jobs_missing += (part.jobs.len() - spilled.len()) as u64;
                overview.predicted_cost_missing += part.cost - spilled_cost;
                overview.jobs_done += spilled.len() as u64;
                overview.predicted_cost_done += spilled_cost;
                continue;
            }
            overview.parts_done += 1;
            overview.jobs_kept += part.jobs.iter().filter(|job| !self.results.wants(&part, job)).count() as u64;
            overview.jobs_done += part.jobs.len() as u64;
            overview.predicted_cost_done += part.cost;
            for (position, why) in if looks { self.unfinished(&part)? } else { BTreeMap::new() } {
                let cost = part.jobs[position].cost;
                overview.jobs_done -= 1;
                match why {
                    Unfinished::Failed(reason) => {
                        overview.jobs_failed += 1;
                        overview.predicted_cost_failed += cost;
                        visit(&part, position, &reason);
                    }
                    Unfinished::Cut => {
                        overview.jobs_missing += 1;
                        overview.predicted_cost_missing += cost;
                        overview.predicted_cost_done -= cost;
                    }
                }
            }
        }
        Ok(overview)
    }

    /// Whether a part that is done may have jobs to be run.
    fn may_run_again(&self) -> bool {
        let max_time = |extension: &Extension| extension.sweep.recording().max_time;
        self.retry_failed || self.results.extensions().windows(2).any(|pair| max_time(&pair[0]) != max_time(&pair[1]))
    }

    /// The jobs of a part that is done which may run again and are asked for.
    fn unfinished(&self, part: &Part) -> Result<BTreeMap<usize, Unfinished>, ResultsError> {
        let unfinished = self.results.unfinished(&self.done, part)?.unwrap_or_default();
        let is_wanted = |position: usize| self.results.wants(part, &part.jobs[position]);
        Ok(unfinished.into_iter().filter(|&(position, _)| is_wanted(position)).collect())
    }

    /// What is left now, once this worker has committed all that it has taken. The last of all workers to look finds
    /// nothing.
    pub fn left(&self, member: &Member<'_>) -> Result<Left, ResultsError> {
        let (others, claims) = (member.others()?, Claims::list(self.results, member)?);
        let done = self.results.done_parts()?;
        let mut left = Left::default();
        for part in self.parts().filter(|part| !done.has(part)) {
            left.jobs += part.jobs.len() as u64;
            match claims.standing(&part_name(&part), &others)? {
                Standing::Taken(owner) => {
                    left.hosts.insert(others[owner].worker.host.clone());
                }
                Standing::Free(_) => left.has_abandoned = true,
                Standing::Own => {
                    let path = self.results.part_file(tables::JOBS, &part);
                    return Err(ResultsError::damaged(&path, "it was committed and is gone"));
                }
            }
        }
        Ok(left)
    }

    fn spilled(&self, part: &Part) -> Result<BTreeSet<usize>, ResultsError> {
        let is_spilled = self.spilled.contains(&(part.extension, part.index));
        if is_spilled { self.results.spilled(part) } else { Ok(BTreeSet::new()) }
    }
}

/// Takes parts of a share, and gives their jobs one by one.
pub(super) struct Work<'a> {
    share: &'a Share<'a>,
    member: &'a Member<'a>,
    walltime: &'a Walltime,
    interrupt: &'a AtomicBool,
    claims: Claims<'a>,
    others: BTreeMap<String, Living>,
    /// The first pass.
    pass: Box<dyn Iterator<Item = Part> + Send + 'a>,
    losses: u32,
    jobs: VecDeque<PartJob>,
    has_ended: bool,
}

impl<'a> Work<'a> {
    pub fn new(
        share: &'a Share<'a>,
        member: &'a Member<'a>,
        walltime: &'a Walltime,
        interrupt: &'a AtomicBool,
        parts_missing: u64,
    ) -> Result<Self, ResultsError> {
        let others = member.others()?;
        let random = RandomState::new().hash_one(member.name());
        let first = if others.is_empty() { 0 } else { random % parts_missing.max(1) };
        let first = usize::try_from(first).unwrap_or_default();
        let parts = || share.parts().filter(|part| !share.done.has(part) || share.may_run_again());
        let pass = parts().skip(first).chain(parts().take(first));
        Ok(Self {
            share,
            member,
            walltime,
            interrupt,
            claims: Claims::list(share.results, member)?,
            others,
            pass: Box::new(pass),
            losses: 0,
            jobs: VecDeque::new(),
            has_ended: false,
        })
    }

    fn is_interrupted(&self) -> bool {
        self.interrupt.load(Ordering::Relaxed)
    }

    /// Takes the next part with jobs to run; false if there is none for this worker.
    fn take_next(&mut self) -> Result<bool, ResultsError> {
        while !self.is_interrupted()
            && let Some(part) = self.pass.next()
        {
            if self.take_unclaimed(part)? {
                return Ok(true);
            }
        }
        self.take_abandoned()
    }

    /// Takes a part in the first pass: one that nobody has claimed; or one that is done, if its jobs may run again and
    /// nobody is at it.
    fn take_unclaimed(&mut self, part: Part) -> Result<bool, ResultsError> {
        let name = part_name(&part);
        if !self.share.done.has(&part) {
            return Ok(self.claims.is_unclaimed(&name) && self.take(part, 0, Vec::new())?);
        }
        let unfinished = self.share.unfinished(&part)?.into_iter();
        let again = unfinished.map(|(position, why)| (position, why != Unfinished::Cut));
        let again: Vec<_> = again.filter(|&(_, failed)| self.share.retry_failed || !failed).collect();
        if again.is_empty() {
            return Ok(false);
        }
        match self.claims.standing(&name, &self.others)? {
            Standing::Free(generation) => self.take(part, generation, again),
            Standing::Own | Standing::Taken(_) => Ok(false),
        }
    }

    /// Takes a part that is not done and whose claim is a dead worker's; waits until it is clear who lives.
    fn take_abandoned(&mut self) -> Result<bool, ResultsError> {
        let mut beats: HashMap<String, SystemTime> = HashMap::new();
        while !self.is_interrupted() && self.walltime.refused().is_none() {
            // In this order: who has ended has committed before.
            let others = self.member.others()?;
            self.claims.refresh()?;
            let done = self.share.results.done_parts()?;
            let mut is_certain = true;
            for part in self.share.parts().filter(|part| !done.has(part)) {
                match self.claims.standing(&part_name(&part), &others)? {
                    Standing::Own => (),
                    Standing::Taken(owner) => {
                        let Living { beat, is_certain: is_known, .. } = &others[owner];
                        let has_beaten = beats.entry(owner.to_owned()).or_insert(*beat) != beat;
                        is_certain &= *is_known || has_beaten;
                    }
                    Standing::Free(generation) => {
                        if self.take(part, generation, Vec::new())? {
                            return Ok(true);
                        }
                        // It went to another, or does not end in time.
                        is_certain = false;
                    }
                }
            }
            if is_certain {
                break;
            }
            for _ in 0..LOOK.as_millis() / POLL.as_millis() {
                if !self.is_interrupted() {
                    std::thread::sleep(POLL);
                }
            }
        }
        Ok(false)
    }

    /// Claims a part, if its jobs would end in time: all that are not spilled, or these `again`, each with whether it has
    /// failed before.
    fn take(&mut self, part: Part, generation: u64, again: Vec<(usize, bool)>) -> Result<bool, ResultsError> {
        let is_again = !again.is_empty();
        let (spilled, jobs) = if is_again {
            (BTreeSet::new(), again)
        } else {
            let spilled = self.share.spilled(&part)?;
            let left = (0..part.jobs.len()).filter(|position| !spilled.contains(position));
            let jobs = left.map(|position| (position, false)).collect();
            (spilled, jobs)
        };
        let costs = || jobs.iter().map(|&(position, _)| part.jobs[position].cost);
        if !self.walltime.admits(costs()) {
            return Ok(false);
        }
        if !self.claims.take(&part_name(&part), generation)? {
            self.walltime.withdraw(costs().sum());
            self.losses += 1;
            if self.losses == LOSSES {
                self.losses = 0;
                self.claims.refresh()?;
            }
            return Ok(false);
        }
        let taken = Arc::new(Taken { part, spilled, again: is_again, together: jobs.len() });
        let job = |(position, failed_before)| PartJob { of: Arc::clone(&taken), position, failed_before };
        self.jobs.extend(jobs.into_iter().map(job));
        Ok(true)
    }
}

impl Iterator for Work<'_> {
    type Item = Result<PartJob, ResultsError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.is_interrupted() {
            if let Some(job) = self.jobs.pop_front() {
                return Some(Ok(job));
            }
            if self.has_ended {
                break;
            }
            let taken = self.take_next();
            self.has_ended = !matches!(taken, Ok(true));
            if let Err(error) = taken {
                return Some(Err(error));
            }
        }
        None
    }
}
