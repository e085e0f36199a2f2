//! The shear force along the grid since the last segment that observers have seen.

use crate::solver::segment::{CubicStep, Extremes, ForcePath, GridPath, Segment};

/// Steps of shear force, from somewhere in the first of them on.
#[derive(Clone, Debug, Default)]
pub(super) struct ForceHistory {
    pub steps: Vec<CubicStep>,
    /// Whether the last step turns or lies beside one that does.
    turns: bool,
    /// Where in the first step it begins.
    first: f64,
    /// The time there, in s in the frame.
    start: f64,
    /// Extremes over all steps but the first and the last, and the integral by steps from the beginning of the first,
    /// in N.
    inner: Extremes,
    integral: f64,
}

impl ForceHistory {
    /// Restarts at a time in s, with the next step.
    pub fn restart(&mut self, start: f64) {
        self.steps.clear();
        *self = Self {
            steps: std::mem::take(&mut self.steps),
            start,
            ..Self::default()
        };
    }

    /// Adds a step. Slopes are continuous, so that the force turns at most in the two steps of which one rises.
    #[inline(always)]
    pub fn push(&mut self, step: CubicStep) {
        self.integral += step.integral();
        if let Some(last) = self.steps.last() {
            let turns = last.rises() != step.rises();
            let before = self.steps.len() - 1;
            if before > 0 && (self.turns || turns) {
                self.inner.include_step(before as f64, last);
            }
            self.turns = turns;
        }
        self.steps.push(step);
    }

    /// F_S at s in the last step, in N.
    pub fn last_force(&self, s: f64) -> f64 {
        self.steps
            .last()
            .map_or(f64::NEG_INFINITY, |step| step.value(s))
    }

    /// The segment up to s in the last step, with `origin` s to add to times in the frame.
    #[inline]
    pub fn segment_to(&self, s: f64, spacing: f64, origin: f64) -> Option<Segment<'_>> {
        let first = self.steps.first()?;
        let last = self.steps.last()?;
        let steps = (self.steps.len() - 1) as f64 + s - self.first;
        let before = if self.first > 0.0 {
            first.integral_to(self.first)
        } else {
            0.0
        };
        let beyond = if s < 1.0 {
            last.integral() - last.integral_to(s)
        } else {
            0.0
        };
        let [low, high] = first.bounds();
        let [lowest, highest] = last.bounds();
        let path = GridPath {
            steps: &self.steps,
            first: self.first,
            spacing,
            inner: self.inner,
            bounds: [
                self.inner.least.value.min(low).min(lowest),
                self.inner.largest.value.max(high).max(highest),
            ],
            end: last.value(s),
            integral: self.integral - before - beyond,
        };
        Some(Segment {
            start: origin + self.start,
            duration: steps * spacing,
            path: ForcePath::Grid(path),
        })
    }

    /// Forgets all before s in the last step, which is at a time in s.
    #[inline]
    pub fn forget_to(&mut self, s: f64, time: f64) {
        let last = self.steps.last().copied();
        self.restart(time);
        if let Some(last) = last.filter(|_| s < 1.0) {
            self.push(last);
            self.first = s;
        }
    }
}
