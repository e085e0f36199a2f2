//! What the jobs table says about a set: outcomes, and averages over the time of each job.

use super::sequence::{Estimate, Sequences};
use crate::model::Parameters;
use crate::model::Selected;
use crate::observe::Regime;
use crate::results::tables::JobOutcome;
use crate::sets::SetRow;
use crate::table::columns::{Interval, columns};
use std::collections::BTreeMap;

columns! {
    /// What a reduction takes from the jobs table beside set and parameters.
    #[derive(Clone, Debug)]
    pub(super) struct JobFacts {
        outcome: JobOutcome;
        slips: Option<u64>;
        averaged_time: Option<f64>;
        mean_friction: Option<f64>;
        slip_share: Option<f64>;
        regime: Option<Regime>;
        running_interval: Option<f64>;
    }
}

impl JobFacts {
    fn averages(&self) -> Option<JobAverages> {
        Some(JobAverages {
            time: self.averaged_time?,
            friction: self.mean_friction?,
            slip_share: self.slip_share?,
        })
    }
}

/// What the jobs table says about a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SetJobs {
    /// Id of the set, 32 hexadecimal characters.
    pub set_id: String,
    /// Its parameters; the seed is that of any of its jobs.
    pub parameters: Parameters,
    /// Jobs that were run to an end.
    pub finished: u64,
    pub failed: u64,
    /// Slips that the jobs recorded.
    pub slips: u64,
    /// Jobs that gave up, since no slip came.
    pub without_slips: u64,
    /// Averages over the time of each job, by its seed.
    pub averages: BTreeMap<u64, JobAverages>,
    /// Jobs that `max_time` ended.
    pub cut: u64,
    /// Seeds of jobs that gave up after a slip, and the time since it, in s.
    pub running: Vec<(u64, f64)>,
    /// How the slider moved in the jobs; mixed if they differ.
    pub regime: Option<Regime>,
}

/// Averages over the time of a job, in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JobAverages {
    pub time: f64,
    /// In N.
    pub friction: f64,
    pub slip_share: f64,
}

impl SetJobs {
    /// A job of the set has ended.
    pub(super) fn push(&mut self, seed: u64, job: &JobFacts) {
        if job.outcome == JobOutcome::Failed {
            self.failed += 1;
            return;
        }
        self.finished += 1;
        self.slips = self.slips.saturating_add(job.slips.unwrap_or(0));
        self.without_slips += u64::from(job.outcome == JobOutcome::NoSlips);
        self.cut += u64::from(job.outcome == JobOutcome::TimeLimit);
        self.averages
            .extend(job.averages().map(|of_job| (seed, of_job)));
        // Earlier versions also wrote one for jobs that `max_time` ended.
        if job.outcome == JobOutcome::NoSlips {
            let running = job.running_interval.map(|interval| (seed, interval));
            self.running.extend(running);
        }
        self.regime = match (self.regime, job.regime) {
            (Some(regime), Some(other)) if regime != other => Some(Regime::Mixed),
            (regime, other) => other.or(regime),
        };
    }

    /// The row of the set with all that does not need its slips.
    pub(super) fn row(&self) -> SetRow {
        let slip_share = self.over_time(|job| job.slip_share);
        let friction = self.over_time(|job| job.friction);
        let coefficient = self.over_time(|job| job.friction / self.parameters.normal_force);
        SetRow {
            set_id: self.set_id.clone(),
            parameters: Selected::new(self.parameters.clone()),
            frequency: self.parameters.frequency(),
            eta: self.parameters.eta(),
            finished_jobs: self.finished,
            failed_jobs: self.failed,
            jobs_without_slips: self.without_slips,
            jobs_cut: Some(self.cut),
            regime: self.regime,
            slip_share: slip_share.value(),
            slip_share_interval: slip_share.interval().map(|ends| Interval {
                low: ends.low.max(0.0),
                high: ends.high.min(1.0),
            }),
            mean_friction: friction.value(),
            mean_friction_interval: friction.interval(),
            friction_coefficient: coefficient.value(),
            friction_coefficient_interval: coefficient.interval(),
            ..SetRow::default()
        }
    }

    /// An average over the time of all jobs: by pseudo-values, one for each job, which weigh it by its time.
    pub(super) fn over_time(&self, of: impl Fn(&JobAverages) -> f64) -> Estimate<1> {
        let sum = |of: &dyn Fn(&JobAverages) -> f64| self.averages.values().map(of).sum::<f64>();
        let time = sum(&|job| job.time);
        let average = sum(&|job| job.time * of(job)) / time;
        let weight = self.averages.len() as f64 / time;
        let jobs = self.averages.values();
        let pseudo = jobs.map(|job| [average + (of(job) - average) * job.time * weight]);
        Sequences::independent(pseudo.collect()).estimate()
    }
}
