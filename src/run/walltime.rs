//! Walltime: a run ends in time, and keeps all finished jobs.
//!
//! No part is taken when less time is left than the longest part took so far, until it was committed. A part that takes
//! longer is interrupted at the end, and its finished jobs are kept.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// Least time set aside for the last commits and for the end of the program.
const MIN_RESERVE: Duration = Duration::from_millis(500);
/// More is set aside where commits are slow: this many times the slowest.
const COMMITS_IN_RESERVE: u32 = 3;

/// The time that a run has.
pub(super) struct Walltime {
    /// When the run must have ended; `None`: at any time.
    end: Option<Instant>,
    longest_part: Cell<Duration>,
    slowest_commit: Cell<Duration>,
    has_refused: Cell<bool>,
}

impl Walltime {
    /// Of a run that began at `begin` and may last `longest`.
    pub fn new(begin: Instant, longest: Option<Duration>) -> Self {
        // A time beyond what the clock holds never comes.
        let end = longest.and_then(|longest| begin.checked_add(longest));
        Self {
            end,
            longest_part: Cell::default(),
            slowest_commit: Cell::default(),
            has_refused: Cell::default(),
        }
    }

    /// Whether another part may be taken. Once it may not, none may.
    pub fn admits_part(&self) -> bool {
        let is_short = |left: Duration| left.is_zero() || left < self.longest_part.get();
        self.has_refused
            .update(|has_refused| has_refused || self.left().is_some_and(is_short));
        !self.has_refused.get()
    }

    /// Whether a part was left for lack of time.
    pub fn has_refused(&self) -> bool {
        self.has_refused.get()
    }

    /// A part was committed: how long it took, and its commit alone.
    pub fn committed(&self, part: Duration, commit: Duration) {
        self.longest_part.update(|longest| longest.max(part));
        self.slowest_commit.update(|slowest| slowest.max(commit));
    }

    /// Whether running jobs must be interrupted.
    pub fn is_over(&self) -> bool {
        self.left().is_some_and(|left| left.is_zero())
    }

    /// Time left, without the reserve.
    fn left(&self) -> Option<Duration> {
        let reserve = MIN_RESERVE.max(COMMITS_IN_RESERVE * self.slowest_commit.get());
        let left = self.end?.saturating_duration_since(Instant::now());
        Some(left.saturating_sub(reserve))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn no_part_is_taken_when_less_time_is_left_than_the_longest_took() {
        let walltime = Walltime::new(Instant::now(), Some(100 * SECOND));
        walltime.committed(90 * SECOND, SECOND);
        walltime.committed(2 * SECOND, SECOND);
        assert!(walltime.admits_part() && !walltime.has_refused());
        walltime.committed(98 * SECOND, SECOND);
        assert!(!walltime.admits_part() && walltime.has_refused() && !walltime.is_over());
    }

    #[test]
    fn time_is_set_aside_for_commits() {
        let walltime = Walltime::new(Instant::now(), Some(100 * SECOND));
        walltime.committed(SECOND, 33 * SECOND);
        assert!(!walltime.is_over());
        walltime.committed(SECOND, 34 * SECOND);
        assert!(walltime.is_over() && !walltime.admits_part());
    }

    #[test]
    fn without_a_walltime_every_part_is_taken() {
        for longest in [None, Some(Duration::MAX)] {
            let walltime = Walltime::new(Instant::now(), longest);
            walltime.committed(1000 * SECOND, 1000 * SECOND);
            assert!(walltime.admits_part() && !walltime.is_over());
        }
    }
}
