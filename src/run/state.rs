//! How far a directory is, and how far a run is: jobs done and missing, failures by reason, time left.

use crate::results::claims::Marked;
use crate::results::log::RunEvent;
use crate::results::next_round::RoundsSoFar;
use crate::results::pending::{Again, Overview, Pending, Retry};
use crate::results::workers::Living;
use crate::results::{Results, ResultsError};
use crate::sweep::Outline;
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::time::SystemTime;

/// Failed jobs that people are shown one by one, at most.
pub const MAX_FAILURES: u64 = 10;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Status {
    pub name: String,
    #[serde(flatten)]
    pub overview: Overview,
    pub workers: Vec<Present>,
    /// Wall time of finished parts over their predicted CPU time, by the logs; null before the first.
    pub pace: Option<f64>,
    /// Predicted wall time for the missing jobs, in s, at this pace on the present or last threads; null like the pace.
    pub time_left: Option<f64>,
    pub failures: Vec<Failure>,
    pub failure_reasons: Reasons,
    /// Missing parts at which workers died.
    pub parts_with_deaths: usize,
    pub marked: Vec<Marked>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rounds: Option<RoundsSoFar>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Present {
    pub host: String,
    pub process: u32,
    pub threads: usize,
    pub jobs_per_second: f64,
    /// Time since its last beat, in s, by the clocks of the file system and of this host.
    pub last_beat: f64,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Failure {
    pub job_id: String,
    pub reason: String,
    pub command: String,
}

/// Jobs of finished parts that the current sweep does not have.
fn jobs_kept(pending: &Pending<'_>) -> u64 {
    let last = pending.results.extensions().len() - 1;
    let is_earlier =
        |part: &&Outline| part.name.extension < last && pending.done.contains(&part.name);
    let parts = pending.parts.iter().filter(is_earlier);
    let jobs = parts.flat_map(|part| pending.part(part).jobs);
    let kept = jobs.filter(|job| pending.results.sweep().find(&job.parameters).is_none());
    kept.count() as u64
}

/// What is done and what is missing, with at most this many of the failed jobs.
pub fn status(results: &Results<'_>, max_failures: u64) -> Result<Status, ResultsError> {
    let mut failures = Vec::new();
    let mut failure_reasons = Reasons::default();
    let parts: Vec<Outline> = results.plan().outlines().collect();
    let pending = Pending::look_up(results, &parts, Retry::default())?;
    pending.look_at_deaths()?;
    let mut overview = pending.overview(true, |part, position, why| {
        if let Again::Failed(reason) = why
            && failure_reasons.add(reason) <= max_failures
        {
            failures.push(Failure {
                job_id: results.job_id(part, position),
                reason: reason.clone(),
                command: results.sweep().command(&part.jobs[position]),
            });
        }
    })?;
    overview.jobs_kept = jobs_kept(&pending);
    let mut last_threads = None;
    let mut predicted = 0.0;
    let mut measured = 0.0;
    results.events(|event| match event {
        RunEvent::Started { threads, .. } => last_threads = Some(threads),
        RunEvent::PartCommitted {
            predicted_cost,
            wall,
            ..
        } => {
            predicted += predicted_cost;
            measured += wall;
        }
        _ => (),
    })?;
    let now = SystemTime::now();
    let present = |Living { worker, beat, .. }| Present {
        host: worker.host,
        process: worker.process,
        threads: worker.threads,
        jobs_per_second: worker.jobs_per_second,
        last_beat: now.duration_since(beat).unwrap_or_default().as_secs_f64(),
    };
    let living = results.layout().living(now)?;
    let workers: Vec<Present> = living.into_values().map(present).collect();
    let of_workers = workers.iter().map(|worker| worker.threads);
    let threads = of_workers.reduce(usize::saturating_add).or(last_threads);
    let pace = (predicted > 0.0).then(|| measured / predicted);
    Ok(Status {
        name: results.sweep().name().to_owned(),
        overview,
        workers,
        pace,
        time_left: pace
            .zip(threads)
            .map(|(pace, threads)| overview.predicted_cost_missing * pace / threads.max(1) as f64),
        failures,
        failure_reasons,
        parts_with_deaths: pending.with_deaths(1).count(),
        marked: pending.marked(),
        rounds: results.rounds_so_far(),
    })
}

/// Numbers of failed jobs by reason. The numbers in a reason, which differ from job to job, are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Reasons(BTreeMap<String, u64>);

impl Reasons {
    /// Counts a job; returns how many there are now.
    pub fn add(&mut self, reason: &str) -> u64 {
        *self.0.entry(without_numbers(reason)).or_default() += 1;
        self.0.values().sum()
    }

    /// The most frequent first.
    pub fn sorted(&self) -> Vec<(&str, u64)> {
        let all = self.0.iter().map(|(reason, jobs)| (reason.as_str(), *jobs));
        let mut reasons: Vec<(&str, u64)> = all.collect();
        reasons.sort_by_key(|(_, jobs)| Reverse(*jobs));
        reasons
    }
}

fn without_numbers(reason: &str) -> String {
    let words = reason.split(' ').map(|word| {
        let number = word.trim_matches([',', ';', ':', '.', '(', ')']);
        if number.parse::<f64>().is_ok() {
            word.replace(number, "…")
        } else {
            word.to_owned()
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

/// How far a run is, by its events: jobs of all workers since it began, and their predicted cost.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Jobs that are to be run, those of later rounds as these begin.
    pub jobs: u64,
    pub jobs_done: u64,
    /// Of those done, jobs of other workers.
    pub jobs_of_others: u64,
    /// Of these, jobs of earlier rounds.
    others_before: u64,
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
                // All earlier jobs are done, and those of others are counted from 0 again.
                self.jobs_of_others += self.jobs.saturating_sub(self.jobs_done);
                self.jobs_done = self.jobs;
                self.others_before = self.jobs_of_others;
                self.predicted_own = self.predicted;
                self.predicted_others = 0.0;
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
                // Fewer than before if this worker ran a part of theirs again, or a network's listing is old.
                let more = (self.others_before + jobs).saturating_sub(self.jobs_of_others);
                self.jobs_done += more;
                self.jobs_of_others += more;
                self.predicted_others = self.predicted_others.max(*predicted_cost);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tally_of_two_workers_over_two_rounds_never_falls() {
        let others_done = |jobs: u64| RunEvent::OthersDone {
            jobs,
            predicted_cost: jobs as f64,
        };
        let mut tally = Tally {
            jobs: 6,
            predicted: 6.0,
            ..Tally::default()
        };
        let next_round = RunEvent::RoundBegun {
            jobs: 4,
            predicted_cost: 4.0,
            rounds: RoundsSoFar::default(),
        };
        let mut before = 0;
        for (event, done) in [
            (others_done(2), 2),
            (others_done(1), 2),
            (others_done(3), 3),
            (next_round, 6),
            (others_done(0), 6),
            (others_done(4), 10),
        ] {
            tally.note(&event);
            assert!(
                tally.jobs_done >= before && tally.jobs_done == done,
                "{event:?}"
            );
            before = tally.jobs_done;
        }
        assert_eq!((tally.jobs_of_others, tally.share()), (10, 1.0));
    }

    #[test]
    fn jobs_are_counted_by_reason_without_its_numbers_and_the_most_frequent_comes_first() {
        let mut reasons = Reasons::default();
        assert_eq!(reasons.sorted(), []);
        assert_eq!(reasons.add("index 99 out of bounds"), 1);
        for events in 10..14 {
            reasons.add(&format!(
                "at t = {events}.5e-3 s: {events} events, the shortest of 1/omega_max (s.d. {events})"
            ));
        }
        assert_eq!(reasons.add("index 7 out of bounds"), 6);
        assert_eq!(
            reasons.sorted(),
            [
                (
                    "at t = … s: … events, the shortest of 1/omega_max (s.d. …)",
                    4
                ),
                ("index … out of bounds", 2)
            ]
        );
    }
}
