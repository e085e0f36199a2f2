//! How far a run is, by its events: jobs of all workers since this one began, and their predicted cost.

use crate::run::RunEvent;

#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Jobs that are to be run, those of later rounds as these begin.
    pub jobs: u64,
    pub jobs_done: u64,
    /// Of those done, jobs of other workers.
    pub jobs_of_others: u64,
    predicted: f64,
    predicted_own: f64,
    predicted_others: f64,
}

impl Tally {
    pub fn note(&mut self, event: &RunEvent) {
        match event {
            RunEvent::Started {
                jobs,
                predicted_cost,
                ..
            }
            | RunEvent::RoundBegun {
                jobs,
                predicted_cost,
                ..
            } => {
                self.jobs += jobs;
                self.predicted += predicted_cost;
            }
            RunEvent::JobDone { predicted_cost, .. }
            | RunEvent::JobFailed { predicted_cost, .. } => {
                self.jobs_done += 1;
                self.predicted_own += predicted_cost;
            }
            RunEvent::OthersDone {
                jobs,
                predicted_cost,
            } => {
                self.jobs_done = self.jobs_done + jobs - self.jobs_of_others;
                (self.jobs_of_others, self.predicted_others) = (*jobs, *predicted_cost);
            }
            _ => {}
        }
    }

    /// Share of the predicted cost that is done; exactly 1 at the end, in whatever order costs were summed.
    pub fn share(&self) -> f64 {
        let done = self.predicted_own + self.predicted_others;
        if self.jobs_done < self.jobs && self.predicted > 0.0 {
            (done / self.predicted).min(1.0)
        } else {
            1.0
        }
    }
}
