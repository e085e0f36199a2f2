//! A run's share of a directory: the parts of its shard, which of them are done, and which of their jobs are left.

use crate::results::parts::{DoneParts, Unfinished};
use crate::results::{Results, ResultsError};
use crate::run::shard::Shard;
use crate::run::walltime::Walltime;
use crate::sweep::Part;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The parts of a shard, as they were when it was looked up which are done.
pub(super) struct Share<'a> {
    pub results: &'a Results<'a>,
    shard: Shard,
    /// Whether failed jobs are to be run again.
    retry_failed: bool,
    done: DoneParts,
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

/// A job of a part that is to be run.
#[derive(Clone, Debug)]
pub(super) struct PartJob {
    pub part: Arc<Part>,
    pub position: usize,
    /// How many jobs of the part are to be run.
    pub together: usize,
    /// Whether it has failed before.
    pub failed_before: bool,
}

impl<'a> Share<'a> {
    /// Looks up which parts are done.
    pub fn look_up(results: &'a Results<'a>, shard: Shard, retry_failed: bool) -> Result<Self, ResultsError> {
        Ok(Self { results, shard, retry_failed, done: results.done_parts()? })
    }

    fn parts(&self) -> impl Iterator<Item = Part> + Send + use<'a> {
        self.shard.parts(self.results.plan().parts())
    }

    /// Looks at every part, and visits the jobs that failed, with the reasons.
    pub fn overview(&self, mut visit: impl FnMut(&Part, usize, &str)) -> Result<Overview, ResultsError> {
        let mut overview = Overview::default();
        for part in self.parts() {
            let Some(unfinished) = self.unfinished(&part)? else {
                overview.parts_missing += 1;
                overview.jobs_missing += part.jobs.len() as u64;
                overview.predicted_cost_missing += part.cost;
                continue;
            };
            overview.parts_done += 1;
            overview.jobs_done += (part.jobs.len() - unfinished.len()) as u64;
            overview.jobs_kept += part.jobs.iter().filter(|job| !self.results.wants(&part, job)).count() as u64;
            overview.predicted_cost_done += part.cost;
            for (position, why) in unfinished {
                let cost = part.jobs[position].cost;
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

    /// The jobs of a part that may run again and are asked for; `None` if the part is not done.
    fn unfinished(&self, part: &Part) -> Result<Option<BTreeMap<usize, Unfinished>>, ResultsError> {
        let unfinished = self.results.unfinished(&self.done, part)?;
        let is_wanted = |position: usize| self.results.wants(part, &part.jobs[position]);
        Ok(unfinished.map(|jobs| jobs.into_iter().filter(|&(position, _)| is_wanted(position)).collect()))
    }

    /// The jobs to be run, in the order of the plan, looked up part by part; without the parts that would not end in
    /// time.
    pub fn jobs(
        &'a self,
        walltime: &'a Walltime,
    ) -> impl Iterator<Item = Result<PartJob, ResultsError>> + Send + use<'a> {
        self.parts().flat_map(move |part| match self.left(&part) {
            Err(error) => vec![Err(error)],
            Ok(left) if left.is_empty() => Vec::new(),
            Ok(left) if !walltime.admits(left.iter().map(|&(job, _)| part.jobs[job].cost)) => Vec::new(),
            Ok(left) => {
                let (part, together) = (Arc::new(part), left.len());
                let job = |(position, failed_before)| {
                    Ok(PartJob { part: Arc::clone(&part), position, together, failed_before })
                };
                left.into_iter().map(job).collect()
            }
        })
    }

    /// Positions of the jobs of a part that are to be run, and whether they have failed before.
    fn left(&self, part: &Part) -> Result<Vec<(usize, bool)>, ResultsError> {
        let Some(unfinished) = self.unfinished(part)? else {
            return Ok((0..part.jobs.len()).map(|position| (position, false)).collect());
        };
        let again = unfinished.into_iter().map(|(position, why)| (position, why != Unfinished::Cut));
        Ok(again.filter(|&(_, failed)| self.retry_failed || !failed).collect())
    }
}
