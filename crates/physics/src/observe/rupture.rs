//! Ruptures: maximal runs of contact breaks in which no gap exceeds the wave crossing time; their fronts, what is
//! measured on the force meanwhile, and what makes them slips.

use crate::model::{ContactEvent, Parameters};
use crate::solver::Spent;

#[derive(Clone, Copy, Debug)]
struct FirstBreak {
    /// From 0.
    block: usize,
    /// In s.
    time: f64,
}

/// A rupture in progress or just ended, with what is measured on its force.
#[derive(Clone, Debug)]
pub(super) struct Rupture {
    /// Block of the first break, from 0.
    pub first_block: usize,
    pub size: u64,
    /// The furthest block with a break, from 0.
    pub reach: usize,
    /// The first break at each block, in order of time.
    first_breaks: Vec<FirstBreak>,
    broken: Vec<bool>,
    pub attached_before: u64,
    /// Fewest contacts attached so far.
    pub least_attached: u64,
    /// Peak since the last slip, when the rupture reached the leading edge.
    pub onset: Option<Peak>,
    /// Peak since the last precursor, when the rupture began.
    pub precursor_onset: Peak,
    /// Least force so far, and up to the last break, in N.
    pub least: f64,
    pub least_at_last_break: f64,
    pub first: RunningTotals,
    pub last: RunningTotals,
    /// Whether the shear force still rose when the rupture reached the leading edge.
    pub onset_cut: bool,
}

impl Rupture {
    /// The rupture that begins with this break, not included yet, on a slider of `blocks` blocks.
    pub fn new(
        event: &ContactEvent,
        first: RunningTotals,
        precursor_onset: Peak,
        blocks: usize,
    ) -> Self {
        Self {
            first_block: event.block,
            size: 0,
            reach: event.block,
            first_breaks: Vec::new(),
            broken: vec![false; blocks],
            attached_before: event.attached + 1,
            least_attached: event.attached,
            onset: None,
            precursor_onset,
            least: first.force,
            least_at_last_break: first.force,
            first,
            last: first,
            onset_cut: false,
        }
    }

    pub fn include(&mut self, event: &ContactEvent) {
        self.size += 1;
        self.least_attached = self.least_attached.min(event.attached);
        self.reach = self.reach.max(event.block);
        if !std::mem::replace(&mut self.broken[event.block], true) {
            self.first_breaks.push(FirstBreak {
                block: event.block,
                time: event.time,
            });
        }
    }

    /// Number of distinct blocks with a break.
    pub fn extent(&self) -> usize {
        self.first_breaks.len()
    }

    /// Whether it is a slip: it breaks contacts at every block, and lets go of at least half of those that were
    /// attached before and a tenth of all.
    pub fn is_slip(&self, contacts: u64) -> bool {
        let let_go = self.attached_before - self.least_attached;
        self.extent() == self.broken.len()
            && 2 * let_go >= self.attached_before
            && 10 * let_go >= contacts
    }

    /// Speed of the front in m/s: slope of the distance from the nucleation against the time of the first break, block
    /// by block, by least squares. `None` below three blocks or without an advance.
    pub fn front_speed(&self, parameters: &Parameters) -> Option<f64> {
        let spacing = parameters.slider_length / parameters.blocks as f64;
        let point = |first: &FirstBreak| FrontPoint {
            time: first.time,
            position: spacing * first.block.abs_diff(self.first_block) as f64,
        };
        let points: Vec<FrontPoint> = self.first_breaks.iter().map(point).collect();
        advance_speed(&points).filter(|_| self.extent() >= 3)
    }
}

/// A largest shear force, in N, and its time, in s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Peak {
    pub time: f64,
    pub force: f64,
}

impl Peak {
    pub fn raise(&mut self, other: Peak) {
        if other.force > self.force {
            *self = other;
        }
    }
}

/// An instant, and what has been counted up to it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RunningTotals {
    pub time: f64,
    /// Shear force, in N.
    pub force: f64,
    /// Its integral over time, in N s.
    pub impulse: f64,
    /// Integral of the number of attached contacts, in s.
    pub attached_time: f64,
    /// Time within slips, in s.
    pub slipping: f64,
    /// Mean displacement of the blocks, in m.
    pub mean_displacement: f64,
    /// Zero unless energies are recorded.
    pub spent: Spent,
}

/// Where a front is, in m, and when, in s.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrontPoint {
    pub time: f64,
    pub position: f64,
}

/// Slope of position against time by least squares; `None` unless it is positive and finite.
pub(super) fn advance_speed(points: &[FrontPoint]) -> Option<f64> {
    let sum = |of: &dyn Fn(&FrontPoint) -> f64| points.iter().map(of).sum::<f64>();
    let count = points.len() as f64;
    let mean_time = sum(&|point| point.time) / count;
    let mean_position = sum(&|point| point.position) / count;
    let since_mean = |point: &FrontPoint| point.time - mean_time;
    let covariance = sum(&|point| since_mean(point) * (point.position - mean_position));
    let variance = sum(&|point| since_mean(point) * since_mean(point));
    let speed = covariance / variance;
    (speed.is_finite() && speed > 0.0).then_some(speed)
}
