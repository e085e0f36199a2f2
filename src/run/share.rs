//! A run's share of a directory: the parts of its shard, which of them are done, and which of their jobs are left.

use crate::results::parts::DoneParts;
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
    /// Whether they have failed before.
    pub again: bool,
}

impl<'a> Share<'a> {
    /// Looks up which parts are done.
    pub fn look_up(results: &'a Results<'a>, shard: Shard, retry_failed: bool) -> Result<Self, ResultsError> {
        Ok(Self { results, shard, retry_failed, done: results.done_parts()? })
    }

    fn parts(&self) -> impl Iterator<Item = Part> + Send + use<'a> {
        self.shard.parts(self.results.plan().parts())
    }

    /// Looks at every part, and visits those that are done with their failed jobs and the reasons. Parts that are
    /// missing and no longer asked for are left out.
    pub fn overview(&self, mut visit: impl FnMut(&Part, BTreeMap<usize, String>)) -> Result<Overview, ResultsError> {
        let mut overview = Overview::default();
        for part in self.parts() {
            if let Some(failed) = self.results.failures(&self.done, &part)? {
                overview.parts_done += 1;
                overview.jobs_done += (part.jobs.len() - failed.len()) as u64;
                overview.jobs_failed += failed.len() as u64;
                overview.jobs_kept += self.results.unwanted_jobs(&part);
                overview.predicted_cost_done += part.cost;
                let costs = failed.keys().map(|&position| part.jobs[position].cost);
                overview.predicted_cost_failed += costs.sum::<f64>();
                visit(&part, failed);
            } else if self.results.wants(&part) {
                overview.parts_missing += 1;
                overview.jobs_missing += part.jobs.len() as u64;
                overview.predicted_cost_missing += part.cost;
            }
        }
        Ok(overview)
    }

    /// The jobs to be run, in the order of the plan, looked up part by part; without the parts that would not end in
    /// time.
    pub fn jobs(
        &'a self,
        walltime: &'a Walltime,
    ) -> impl Iterator<Item = Result<PartJob, ResultsError>> + Send + use<'a> {
        self.parts().flat_map(move |part| match self.left(&part) {
            Err(error) => vec![Err(error)],
            Ok((left, _)) if left.is_empty() => Vec::new(),
            Ok((left, _)) if !walltime.admits(left.iter().map(|&job| part.jobs[job].cost)) => Vec::new(),
            Ok((left, again)) => {
                let (part, together) = (Arc::new(part), left.len());
                let job = |position| Ok(PartJob { part: Arc::clone(&part), position, together, again });
                left.into_iter().map(job).collect()
            }
        })
    }

    /// Positions of the jobs of a part that are to be run, and whether they have failed before.
    fn left(&self, part: &Part) -> Result<(Vec<usize>, bool), ResultsError> {
        if !self.done.has(part) {
            let wanted = if self.results.wants(part) { part.jobs.len() } else { 0 };
            return Ok(((0..wanted).collect(), false));
        }
        let failed = if self.retry_failed { self.results.failures(&self.done, part)? } else { None };
        Ok((failed.into_iter().flatten().map(|(position, _)| position).collect(), true))
    }
}
