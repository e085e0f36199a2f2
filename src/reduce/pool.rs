//! Large pools of jobs of the model, of which repetitions of a measurement take some.

use super::backbone::{Backbone, BackboneBin};
use super::drive_alone::{Controls, Explained};
use super::gather::Gathered;
use super::set::FinishedSet;
use super::set::{JobFacts, SetJobs};
use crate::model::{Parameters, Selected};
use crate::observe::Slip;
use crate::results::layout::Layout;
use crate::results::tables::{All, JobOfSlip, RecordedTable};
use crate::results::{Results, ResultsError};
use crate::sets::SetRow;
use std::collections::BTreeMap;
use std::ops::Range;

/// A job: what its row says, and its slips.
#[derive(Clone, Debug)]
pub(crate) struct PooledJob {
    seed: u64,
    facts: JobFacts,
    slips: Vec<Slip>,
}

/// All jobs of a directory by their sets, in the order of amplitude, then η, and seeds; and their controls.
pub(crate) struct Pool {
    pub sets: Vec<(Parameters, Vec<PooledJob>)>,
    /// What the drive alone explains of each set.
    explained: Vec<Explained>,
}

impl Pool {
    pub(crate) fn of(layout: &Layout<'_>) -> Result<Self, ResultsError> {
        let results = Results::read(layout)?;
        let plan = results.plan();
        let jobs = results.dataset(RecordedTable::Jobs)?;
        let slips = results.committed_files(RecordedTable::Slips, &jobs)?;
        let mut sets: BTreeMap<String, (Parameters, BTreeMap<u64, PooledJob>)> = BTreeMap::new();
        for row in jobs.rows::<(JobFacts, Selected<All>)>() {
            let (
                facts,
                Selected {
                    all: parameters, ..
                },
            ) = row?;
            if plan.is_control(&parameters) {
                continue;
            }
            let seed = parameters.seed;
            let (_, set) = sets
                .entry(facts.set_id.clone())
                .or_insert_with(|| (parameters, BTreeMap::new()));
            let job = PooledJob {
                seed,
                facts,
                slips: Vec::new(),
            };
            set.insert(seed, job);
        }
        for row in slips.clone().rows::<(JobOfSlip, Slip)>() {
            let (job, slip) = row?;
            if let Some((_, set)) = sets.get_mut(&job.set_id) {
                set.get_mut(&job.seed)
                    .expect("slips of a job")
                    .slips
                    .push(slip);
            }
        }
        let controls = Controls::read(slips, plan, sets.values().map(|(set, _)| set))?;
        let mut sets: Vec<_> = sets
            .into_values()
            .map(|(set, jobs)| (set, jobs.into_values().collect()))
            .collect();
        sets.sort_by(|(left, _): &(Parameters, Vec<_>), (right, _)| {
            let key = |set: &Parameters| (set.modulation_amplitude, set.eta());
            key(left).partial_cmp(&key(right)).expect("numbers")
        });
        let explained = sets
            .iter()
            .map(|(set, _)| controls.explain(plan, set))
            .collect();
        Ok(Self { sets, explained })
    }

    fn finish<'a>(
        &self,
        set: usize,
        jobs: impl IntoIterator<Item = &'a PooledJob>,
        most: usize,
    ) -> FinishedSet {
        let parameters = self.sets[set].0.clone();
        let mut gathered = Gathered::new(SetJobs {
            parameters,
            ..SetJobs::default()
        });
        for PooledJob { seed, facts, slips } in jobs {
            gathered.jobs.push(*seed, facts);
            for slip in slips.iter().take(most) {
                gathered.slips.push(*seed, slip);
            }
        }
        gathered.finish_with(&self.explained[set]).0
    }

    /// The row of a set of these of its jobs, and of so many of the slips of each.
    pub(crate) fn row<'a>(
        &self,
        set: usize,
        jobs: impl IntoIterator<Item = &'a PooledJob>,
        most: usize,
    ) -> SetRow {
        self.finish(set, jobs, most).row
    }

    /// The bin of all sets with these of their jobs; all of them lie within one.
    pub(crate) fn bin(&self, jobs: Range<usize>) -> BackboneBin {
        let mut backbone = Backbone::default();
        for (set, (_, all)) in self.sets.iter().enumerate() {
            backbone.push(&self.finish(set, &all[jobs.clone()], usize::MAX));
        }
        backbone.finish()[0]
    }
}
