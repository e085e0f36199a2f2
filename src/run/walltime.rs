//! Walltime: which parts a run may still start so that it ends in time, with all that it started committed.
//!
//! A part is started if, at the pace so far (measured over predicted cost), it and all that is under way end in time.
//! Parts that would not are passed over, and cheaper ones after them are taken. The pace is that of the jobs that have
//! ended; of earlier runs in the directory before the first; and 1 before any. Should a job take longer after all, it
//! is interrupted at the end, and whole parts are kept.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// Least time set aside for ending, in s: for the last commits and for those who wait.
const MIN_RESERVE: f64 = 0.5;
/// More is set aside where commits are slow: this many times the slowest.
const COMMITS_IN_RESERVE: f64 = 3.0;

/// The time that a run has.
pub(super) struct Walltime {
    /// When the run must have ended; `None`: whenever it likes.
    end: Option<Instant>,
    threads: f64,
    state: Cell<State>,
}

/// Times in s.
#[derive(Clone, Copy)]
struct State {
    /// Pace of earlier runs, if there were any.
    earlier_pace: Option<f64>,
    /// Predicted and measured costs of the jobs that have ended.
    predicted: f64,
    measured: f64,
    /// Predicted cost of the jobs that were started and have not ended.
    under_way: f64,
    slowest_commit: f64,
    refused: Option<f64>,
}

impl State {
    fn pace(&self) -> Option<f64> {
        if self.predicted > 0.0 { Some(self.measured / self.predicted) } else { self.earlier_pace }
    }
}

impl Walltime {
    /// Of a run that began at `begin` and may last `longest`, with `threads` threads.
    pub fn new(begin: Instant, longest: Option<Duration>, threads: usize, earlier_pace: Option<f64>) -> Self {
        let state =
            State { earlier_pace, predicted: 0.0, measured: 0.0, under_way: 0.0, slowest_commit: 0.0, refused: None };
        // A time beyond what the clock holds never comes.
        let end = longest.and_then(|longest| begin.checked_add(longest));
        Self { end, threads: threads as f64, state: Cell::new(state) }
    }

    /// Whether jobs of these predicted costs may be started together. They then count as under way.
    pub fn admits(&self, costs: impl Iterator<Item = f64>) -> bool {
        let Some(left) = self.left() else { return true };
        let (sum, largest) = costs.fold((0.0, 0.0_f64), |(sum, largest), cost| (sum + cost, largest.max(cost)));
        let mut state = self.state.get();
        let shared = (state.under_way + sum) / self.threads;
        let needed = state.pace().unwrap_or(1.0) * shared.max(largest);
        let is_probe = state.pace().is_none() && state.under_way == 0.0 && left > 0.0;
        let admitted = needed <= left || is_probe;
        if admitted {
            state.under_way += sum;
        } else {
            state.refused = Some(state.refused.map_or(needed, |least| least.min(needed)));
        }
        self.state.set(state);
        admitted
    }

    /// Jobs of these predicted costs are not started after all.
    pub fn withdraw(&self, cost: f64) {
        self.state.update(|state| State { under_way: (state.under_way - cost).max(0.0), ..state });
    }

    pub fn ended(&self, predicted: f64, measured: f64) {
        self.withdraw(predicted);
        self.state.update(|state| State {
            predicted: state.predicted + predicted,
            measured: state.measured + measured,
            ..state
        });
    }

    /// A part was committed, which took so long, in s.
    pub fn committed(&self, seconds: f64) {
        self.state.update(|state| State { slowest_commit: state.slowest_commit.max(seconds), ..state });
    }

    /// Whether what is under way must be given up.
    pub fn is_over(&self) -> bool {
        self.left().is_some_and(|left| left <= 0.0)
    }

    /// Least time that a part would have needed which was not started for want of it, in s.
    pub fn refused(&self) -> Option<f64> {
        self.state.get().refused
    }

    /// Time left but for what is set aside, in s.
    fn left(&self) -> Option<f64> {
        let end = self.end?;
        let reserve = MIN_RESERVE.max(COMMITS_IN_RESERVE * self.state.get().slowest_commit);
        Some(end.saturating_duration_since(Instant::now()).as_secs_f64() - reserve)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walltime(seconds: u64, pace: Option<f64>) -> Walltime {
        Walltime::new(Instant::now(), Some(Duration::from_secs(seconds)), 2, pace)
    }

    #[test]
    fn what_ends_in_time_is_started_and_cheaper_parts_follow_dearer_ones() {
        let walltime = walltime(100, Some(1.0));
        assert!(!walltime.admits([120.0].into_iter()), "one job does not run on two threads");
        assert!(walltime.admits([60.0, 60.0].into_iter()));
        assert!(!walltime.admits([50.0, 50.0].into_iter()), "60 s each are under way");
        assert!(walltime.admits([30.0, 20.0].into_iter()));
        let refused = walltime.refused().unwrap();
        assert!((refused - 110.0).abs() < 1e-9, "{refused}");
        walltime.ended(60.0, 60.0);
        walltime.ended(60.0, 60.0);
        assert!(walltime.admits([50.0, 50.0].into_iter()));
    }

    #[test]
    fn the_pace_is_that_of_earlier_runs_until_jobs_have_ended() {
        let walltime = walltime(100, Some(10.0));
        assert!(!walltime.admits([11.0].into_iter()));
        assert!(walltime.admits([1.0].into_iter()));
        walltime.ended(1.0, 0.1);
        assert!(walltime.admits([900.0, 900.0].into_iter()));
        assert!(!walltime.admits([900.0, 900.0].into_iter()));
    }

    #[test]
    fn one_part_is_started_to_learn_the_pace() {
        let walltime = walltime(100, None);
        assert!(walltime.admits([1000.0].into_iter()));
        assert!(!walltime.admits([1000.0].into_iter()));
        walltime.ended(1000.0, 10.0);
        assert!(walltime.admits([1000.0].into_iter()));
    }

    #[test]
    fn time_is_set_aside_for_commits() {
        let walltime = walltime(100, Some(1.0));
        assert!(!walltime.is_over());
        walltime.committed(33.0);
        assert!(!walltime.admits([2.0].into_iter()));
        walltime.committed(34.0);
        assert!(walltime.is_over());
    }

    #[test]
    fn without_a_walltime_everything_is_started() {
        let walltime = Walltime::new(Instant::now(), None, 1, None);
        assert!(walltime.admits([1e300].into_iter()) && !walltime.is_over() && walltime.refused().is_none());
        let endless = Walltime::new(Instant::now(), Some(Duration::MAX), 1, None);
        assert!(endless.admits([1e300].into_iter()));
    }
}
