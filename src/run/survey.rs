//! Surveys: which parts of a directory are done, and which of their jobs remain to be run.

use crate::results::manifest::Directory;
use crate::results::part::{failed_jobs, is_done};
use crate::run::shard::Shard;
use crate::run::walltime::Walltime;
use crate::sweep::{Part, Plan};
use crate::table::file::DatasetError;
use crate::table::storage::Storage;
use std::sync::Arc;

/// What of a directory a run looks after.
#[derive(Clone, Copy)]
pub(super) struct Scope<'a> {
    pub storage: &'a dyn Storage,
    pub directory: &'a Directory,
    pub shard: Shard,
    /// Whether failed jobs remain to be run.
    pub retry_failed: bool,
}

/// How far the parts of a scope are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Survey {
    pub parts_done: u64,
    pub parts_missing: u64,
    /// Jobs with a row, failed or not.
    pub jobs_done: u64,
    pub jobs_failed: u64,
    pub jobs_missing: u64,
    /// Of the jobs done, those that the sweep asked for last does not have.
    pub jobs_kept: u64,
    /// Predicted CPU times, in s.
    pub cost_done: f64,
    pub cost_failed: f64,
    pub cost_missing: f64,
}

/// A job to be run.
#[derive(Clone, Debug)]
pub(super) struct Task {
    pub part: Arc<Part>,
    pub position: usize,
    /// How many jobs of the part are to be run.
    pub together: usize,
    /// Whether they have failed before.
    pub again: bool,
}

impl<'a> Scope<'a> {
    fn parts(self) -> impl Iterator<Item = Part> + Send + use<'a> {
        let Self { directory, shard, .. } = self;
        shard.parts(Plan::new(directory.sweeps()).parts())
    }

    /// Looks at every part. Parts that are missing and no longer asked for are left out.
    pub fn survey(self) -> Result<Survey, DatasetError> {
        self.survey_with(|_, _| Ok(()))
    }

    /// The same, and visits each part that is done, with the positions of its failed jobs.
    pub fn survey_with(
        self,
        mut visit: impl FnMut(&Part, &[usize]) -> Result<(), DatasetError>,
    ) -> Result<Survey, DatasetError> {
        let mut survey = Survey::default();
        for part in self.parts() {
            if let Some(failed) = failed_jobs(self.storage, self.directory, &part)? {
                survey.parts_done += 1;
                survey.jobs_done += part.jobs.len() as u64;
                survey.jobs_failed += failed.len() as u64;
                survey.jobs_kept += self.directory.unwanted_jobs(&part);
                survey.cost_done += part.cost;
                survey.cost_failed += failed.iter().map(|&position| part.jobs[position].cost).sum::<f64>();
                visit(&part, &failed)?;
            } else if self.directory.wants(&part) {
                survey.parts_missing += 1;
                survey.jobs_missing += part.jobs.len() as u64;
                survey.cost_missing += part.cost;
            }
        }
        Ok(survey)
    }

    /// The jobs to be run, in the order of the plan, looked up part by part; without the parts that would not end in time.
    pub fn tasks(self, walltime: &'a Walltime) -> impl Iterator<Item = Result<Task, DatasetError>> + Send + use<'a> {
        self.parts().flat_map(move |part| match self.remaining(&part) {
            Ok((positions, _))
                if !positions.is_empty() && !walltime.admits(positions.iter().map(|&job| part.jobs[job].cost)) =>
            {
                Vec::new()
            }
            Ok((positions, again)) => {
                let (part, together) = (Arc::new(part), positions.len());
                positions
                    .into_iter()
                    .map(|position| Ok(Task { part: Arc::clone(&part), position, together, again }))
                    .collect()
            }
            Err(error) => vec![Err(error)],
        })
    }

    /// Positions of the jobs of a part that are to be run, and whether they have failed before.
    fn remaining(self, part: &Part) -> Result<(Vec<usize>, bool), DatasetError> {
        if self.retry_failed {
            if let Some(failed) = failed_jobs(self.storage, self.directory, part)? {
                return Ok((failed, true));
            }
        } else if is_done(self.storage, self.directory, part)? {
            return Ok((Vec::new(), false));
        }
        let wanted = if self.directory.wants(part) { part.jobs.len() } else { 0 };
        Ok(((0..wanted).collect(), false))
    }
}
