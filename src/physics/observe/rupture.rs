//! Ruptures: maximal runs of contact breaks in which no gap exceeds the wave crossing time, and their fronts.

use crate::model::{ContactEvent, Parameters};

/// A rupture in progress or just ended.
#[derive(Clone, Debug)]
pub struct Rupture {
    /// Block of the first break, from 0.
    pub first_block: usize,
    pub size: u64,
    /// The furthest block with a break, from 0.
    pub reach: usize,
    /// Blocks with a break, in the order of their first break, and its time in s.
    pub fronts: Vec<(usize, f64)>,
    broken: Vec<bool>,
    pub attached_before: u64,
    /// Fewest contacts attached so far.
    pub least_attached: u64,
}

impl Rupture {
    /// The rupture that begins with this break, on a slider of `blocks` blocks.
    pub fn new(first: &ContactEvent, blocks: usize) -> Self {
        let mut rupture = Self {
            first_block: first.block,
            size: 0,
            reach: first.block,
            fronts: Vec::new(),
            broken: vec![false; blocks],
            attached_before: first.attached + 1,
            least_attached: first.attached,
        };
        rupture.include(first);
        rupture
    }

    pub fn include(&mut self, event: &ContactEvent) {
        self.size += 1;
        self.least_attached = self.least_attached.min(event.attached);
        self.reach = self.reach.max(event.block);
        if !std::mem::replace(&mut self.broken[event.block], true) {
            self.fronts.push((event.block, event.time));
        }
    }

    /// Number of distinct blocks with a break.
    pub fn extent(&self) -> usize {
        self.fronts.len()
    }

    /// Whether it is a slip: it breaks contacts at every block, and lets go of at least half of those that were attached
    /// before and a tenth of all.
    pub fn is_slip(&self, contacts: u64) -> bool {
        let let_go = self.attached_before - self.least_attached;
        self.extent() == self.broken.len()
            && 2 * let_go >= self.attached_before
            && 10 * let_go >= contacts
    }

    /// Speed of the front in m/s: slope of the distance from the nucleation against the time of the first break, block by
    /// block, by least squares. `None` below three blocks or without an advance.
    pub fn front_speed(&self, parameters: &Parameters) -> Option<f64> {
        let spacing = parameters.slider_length / parameters.blocks as f64;
        let points = self
            .fronts
            .iter()
            .map(|&(block, time)| (time, spacing * block.abs_diff(self.first_block) as f64));
        (self.extent() >= 3)
            .then(|| advance_speed(points))
            .flatten()
    }
}

/// Slope of position against time by least squares; `None` unless it is positive and finite.
pub fn advance_speed(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<f64> {
    let count = points.clone().count() as f64;
    let (time, position) = points
        .clone()
        .fold((0.0, 0.0), |(t, p), point| (t + point.0, p + point.1));
    let time = time / count;
    let position = position / count;
    let (covariance, variance) = points.fold((0.0, 0.0), |(covariance, variance), point| {
        let late = point.0 - time;
        (
            covariance + late * (point.1 - position),
            variance + late * late,
        )
    });
    let speed = covariance / variance;
    (speed.is_finite() && speed > 0.0).then_some(speed)
}
