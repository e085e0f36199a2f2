//! An adaptive sweep: its virtual grid, its sets, and its first round.
//!
//! The seed axis of the grid has as many seeds as a set may get, and a refined axis is as fine as is wanted. A round
//! runs some of its points. The first round follows from the sweep; each later one from the rows of earlier rounds, see
//! `rounds/`. A set is named by the number of its point with the first seed.

use super::axes::Axis;
use super::grid::{Sweep, find_rows};
use super::quantity::{GridPoint, Quantity};
use super::rounds::{Bounds, Goal, Refinement, Round, Rounds, Standing};
use crate::model::Parameters;
use std::collections::BTreeSet;
use std::ops::Range;

impl Sweep {
    /// How it runs in rounds; `None` for a sweep that runs its whole grid.
    pub const fn rounds(&self) -> Option<&Rounds> {
        self.rounds.as_ref()
    }

    pub fn refinement(&self) -> Option<&Refinement> {
        match &self.rounds.as_ref()?.goal {
            Goal::Edges(refinement) => Some(refinement),
            Goal::Precision(_) => None,
        }
    }

    pub fn seed_axis(&self) -> Option<usize> {
        let mut axes = self.axes.iter();
        axes.position(|axis| axis.quantities() == [Quantity::SEED])
    }

    pub fn seed_count(&self) -> u64 {
        self.seed_axis().map_or(1, |axis| self.axes[axis].len())
    }

    /// Distance of the points of a set.
    fn seed_stride(&self) -> u64 {
        self.seed_axis().map_or(1, |axis| {
            self.axes[axis + 1..].iter().map(Axis::len).product()
        })
    }

    pub fn rows(&self, point: u64) -> Vec<u64> {
        let mut rows = vec![0; self.axes.len()];
        find_rows(point, &self.row_counts(), &mut rows);
        rows
    }

    pub fn row_counts(&self) -> Vec<u64> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// Key and value of the first quantity of an axis at a row; NaN for a word.
    pub fn value_at(&self, axis: usize, row: u64) -> (&'static str, f64) {
        let mut point = GridPoint::default();
        self.axes[axis].apply(row, &mut point);
        let quantity = self.axes[axis].quantities()[0];
        let period = point.fixes_period.map(|(_, value)| value);
        let value = period.unwrap_or_else(|| point.number(quantity));
        (quantity.key(), value)
    }

    pub fn set_of(&self, point: u64) -> u64 {
        let count = self.point_count();
        if let (Some(controls), Some(control)) = (&self.controls, point.checked_sub(count)) {
            return count + controls.set_of(control);
        }
        let stride = self.seed_stride();
        point - point / stride % self.seed_count() * stride
    }

    /// The set of a job with these canonical parameters, whatever its seed.
    pub fn set_with(&self, parameters: &Parameters) -> Option<u64> {
        let control =
            || Some(self.point_count() + self.controls.as_ref()?.find_set_in_grid(parameters)?);
        let point = self.find_set_in_grid(parameters).or_else(control)?;
        Some(self.set_of(point))
    }

    /// The set at these rows, that of the seeds left out; `None` if it is no job. Without modulation, rows that differ
    /// in the period alone are one set.
    pub fn set_at(&self, rows: &[u64]) -> Option<u64> {
        self.set_with(&self.point(rows).canonical().parameters)
    }

    /// The points of a set with these of its seeds.
    pub fn points_of_set(&self, set: u64, seeds: Range<u64>) -> impl Iterator<Item = u64> + use<> {
        let stride = self.seed_stride();
        seeds.map(move |seed| set + seed * stride)
    }

    /// The sets of the first round, in order: all combinations of the rows that the sweep file has.
    pub(super) fn first_sets(&self) -> BTreeSet<u64> {
        // How many rows of the grid lie between two of the first round, on each axis.
        let mut spacing = vec![1; self.axes.len()];
        if let Some(refinement) = self.refinement() {
            spacing[refinement.axis] = 1 << refinement.levels;
        }
        if let Some(axis) = self.seed_axis() {
            spacing[axis] = self.axes[axis].len();
        }
        let spaced_axes = self.axes.iter().zip(&spacing);
        let counts: Vec<u64> = spaced_axes
            .map(|(axis, spacing)| axis.len().div_ceil(*spacing))
            .collect();
        let mut rows = vec![0; counts.len()];
        let set = |number| {
            find_rows(number, &counts, &mut rows);
            rows.iter_mut()
                .zip(&spacing)
                .for_each(|(row, spacing)| *row *= spacing);
            self.set_at(&rows)
        };
        (0..counts.iter().product()).filter_map(set).collect()
    }

    pub fn bounds(&self) -> Option<Bounds> {
        let rounds = self.rounds.as_ref()?;
        let sets = self.first_sets().into_iter();
        let jobs = sets.flat_map(|set| self.jobs_at(set..set + 1));
        let costs: Vec<f64> = jobs.map(|job| job.cost).collect();
        let largest = costs.iter().copied().fold(0.0, f64::max);
        let known = costs.len() as u64;
        let (seeds, jobs) = match &rounds.goal {
            Goal::Precision(_) => (self.seed_count(), known * self.seed_count()),
            Goal::Edges(refinement) => (*rounds.seeds.start(), refinement.max_jobs),
        };
        let sets = jobs / seeds;
        let predicted_cost =
            costs.iter().sum::<f64>() * seeds as f64 + (jobs - known * seeds) as f64 * largest;
        let controls = self.controls.as_ref();
        let control_jobs = controls.map_or(0, |controls| controls.point_count().min(jobs));
        Some(Bounds {
            sets,
            jobs: jobs + control_jobs,
            predicted_cost: predicted_cost + control_jobs as f64 * largest,
        })
    }

    pub fn first_round(&self) -> Option<Round> {
        let seeds = *self.rounds.as_ref()?.seeds.start();
        let sets = self.first_sets();
        let points = sets
            .iter()
            .flat_map(|&set| self.points_of_set(set, 0..seeds));
        Some(Round {
            points: self.with_controls(points.collect()),
            standing: Standing {
                sets_open: sets.len() as u64,
                ..Standing::default()
            },
        })
    }
}
