//! Progress of a run: a bar with an ETA on a terminal, plain lines otherwise; on standard error.

use super::output;
use crate::run::limits::Threads;
use crate::run::{MAX_FAILURES, Reasons, RunEvent, Tally};
use crate::table::shown::shown_bytes;
use crate::table::value::floored;
use indicatif::{ProgressBar, ProgressStyle};
use std::time::{Duration, Instant};

/// Time between two plain lines.
const PLAIN_SPACING: Duration = Duration::from_secs(10);
/// Steps of the bar: thousandths of the predicted cost.
const RESOLUTION: u32 = 1000;
/// Share of the predicted cost below which the pace so far says little about the rest.
const GUESS: f64 = 0.05;

pub struct Progress {
    /// Hidden unless standard error is a terminal.
    bar: ProgressBar,
    begin: Instant,
    last_line: Instant,
    tally: Tally,
    threads: Threads,
    /// Where more may come, what is to be done now.
    of_round: &'static str,
    has_results: bool,
    /// Of this worker's failed jobs, and how many there are.
    reasons: Reasons,
    failures: u64,
}

impl Progress {
    pub fn new(threads: Threads, has_rounds: bool) -> Self {
        let now = Instant::now();
        Self {
            bar: ProgressBar::hidden(),
            begin: now,
            last_line: now,
            tally: Tally::default(),
            threads,
            of_round: if has_rounds { " of this round" } else { "" },
            has_results: false,
            reasons: Reasons::default(),
            failures: 0,
        }
    }

    /// Whether something was committed, in this run or before.
    pub const fn has_results(&self) -> bool {
        self.has_results
    }

    pub fn show(&mut self, event: &RunEvent) {
        self.tally.note(event);
        match event {
            RunEvent::Started {
                jobs,
                predicted_cost,
                jobs_there,
                threads,
                others,
                ..
            } => {
                self.has_results |= *jobs_there > 0;
                let jobs = output::count(*jobs, "job") + self.of_round;
                let time = output::duration(predicted_cost / *threads as f64);
                let mut place = output::count(*threads as u64, "thread");
                if let Some(variable) = self.threads.variable {
                    place = format!("{place} ({variable})");
                }
                if *others > 0 {
                    let others = output::count(*others as u64, "worker");
                    place = format!("{place}, shared with {others}");
                }
                self.say(&format!(
                    "running {jobs}, {jobs_there} there already; predicted: {time} on {place}"
                ));
                self.begin = Instant::now();
                self.bar = ProgressBar::new(u64::from(RESOLUTION));
                let template = "{elapsed_precise} [{bar:30}] {msg}";
                if let Ok(style) = ProgressStyle::with_template(template) {
                    self.bar.set_style(style.progress_chars("=> "));
                }
            }
            RunEvent::PartCommitted { .. } => self.has_results = true,
            RunEvent::RoundBegun { jobs, rounds, .. } => {
                let jobs = output::count(*jobs, "job");
                self.say(&format!("{jobs} more; round {}", output::rounds(rounds)));
            }
            RunEvent::Tick => self.draw(),
            RunEvent::JobTakesLong {
                command,
                predicted_cost,
                wall,
            } => {
                let time = output::duration(*wall);
                let ratio = wall / predicted_cost;
                self.say(&format!(
                    "1 job has run {time}, {ratio:.0} times its prediction: {command}"
                ));
            }
            RunEvent::JobFailed {
                job_id,
                reason,
                command,
                ..
            } => {
                self.failures = self.reasons.add(reason);
                if self.failures <= MAX_FAILURES {
                    self.say(&format!(
                        "job {job_id} failed: {reason}\n  alone: {command}"
                    ));
                }
                self.draw();
            }
            RunEvent::ShortOfMemory { allowed, needed } => {
                let allowed = shown_bytes(*allowed);
                let needed = shown_bytes(*needed);
                self.say(&format!(
                    "memory limits the jobs at once: {allowed} free, the next is predicted to take {needed}"
                ));
            }
            RunEvent::Stopping => self.say("stopping: jobs in flight end, finished jobs are kept"),
            RunEvent::OutOfTime => self.say("not enough time left to start another part"),
            RunEvent::Finished(_) => {
                self.bar.finish_and_clear();
                if self.failures > MAX_FAILURES {
                    output::report(output::by_reason(&self.reasons).trim_end());
                }
            }
            _ => {}
        }
    }

    fn say(&self, line: &str) {
        self.bar.suspend(|| output::report(line));
    }

    /// Draws the bar, which counts the jobs of all workers since this one began, or now and then prints a line.
    fn draw(&mut self) {
        let share = self.tally.share();
        let elapsed = self.begin.elapsed().as_secs_f64();
        let left = if share > 0.0 {
            let left = output::duration(elapsed * (1.0 - share) / share);
            let guess = if share < GUESS {
                ", a guess so far"
            } else {
                ""
            };
            format!("{left} left{}{guess}", self.of_round)
        } else {
            "time left unknown".to_owned()
        };
        let others = match self.tally.jobs_of_others {
            0 => String::new(),
            jobs => format!(" ({jobs} by others)"),
        };
        let jobs = self.tally.jobs;
        let jobs_done = self.tally.jobs_done;
        let text = format!("{jobs_done} of {jobs} jobs{others}, {left}");
        let position = floored(f64::from(RESOLUTION) * share) as u64;
        self.bar.set_position(position);
        self.bar.set_message(text.clone());
        if self.bar.is_hidden() && self.last_line.elapsed() >= PLAIN_SPACING {
            self.last_line = Instant::now();
            let elapsed = output::duration(elapsed);
            output::report(&format!("{elapsed}, {:.0} %: {text}", 100.0 * share));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_a_round_where_more_may_come() {
        let message = |has_rounds: bool| {
            let mut progress = Progress::new(
                Threads {
                    count: None,
                    variable: None,
                },
                has_rounds,
            );
            progress.tally.note(&RunEvent::OthersDone {
                jobs: 3,
                predicted_cost: 1.0,
            });
            progress.show(&RunEvent::Tick);
            progress.bar.message()
        };
        assert_eq!(message(false), "3 of 0 jobs (3 by others), 0 ms left");
        assert_eq!(
            message(true),
            "3 of 0 jobs (3 by others), 0 ms left of this round"
        );
    }
}
