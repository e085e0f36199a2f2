//! Rounds: what a sweep decides by itself, from `[precision]` and `[refine]`.
//!
//! The grid of such a sweep is virtual: its seed axis has as many seeds as a set may get, and a refined axis is as fine
//! as is wanted. A round runs some of its points. The first follows from the sweep; each later one from the rows of those
//! before it, see `rounds/`. A set is named by the number of its point with the first seed.

use super::axes::Axis;
use super::grid::Sweep;
use super::quantity::{Point, Quantity};
use super::set::Statistic;
use crate::model::{Parameters, Symbol};
use crate::table::value::Shortest;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeSet;
use std::ops::{Range, RangeInclusive};

/// Most sets of a sweep with rounds: the points of every round are listed in the manifest.
pub(super) const MAX_SETS: u64 = 100_000;

/// What a sweep decides by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rounds {
    /// How precise statistics are to be.
    pub precision: Option<Precision>,
    /// Where the grid is to be finer.
    pub refinement: Option<Refinement>,
}

/// Sets get seeds until their statistics are known to a target, or they have the most.
#[derive(Clone, Debug, PartialEq)]
pub struct Precision {
    /// At least one, each with an interval.
    pub statistics: Vec<Statistic>,
    /// Largest half-width of their intervals.
    pub target: Target,
    /// Seeds of a set in the first round, and at most.
    pub seeds: RangeInclusive<u64>,
}

/// Largest half-width of an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// As a share of the statistic.
    Relative(f64),
    Absolute(f64),
}

/// Cells of the grid are divided where something happens.
#[derive(Clone, Debug, PartialEq)]
pub struct Refinement {
    /// The axes along which cells are divided.
    pub axes: Vec<RefinedAxis>,
    /// What tells the sets of a cell apart.
    pub by: Statistic,
    pub contrast: Contrast,
    /// Most sets of the sweep.
    pub max_sets: u64,
}

/// An axis along which cells are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RefinedAxis {
    pub axis: usize,
    /// How often a cell of the first round can be halved.
    pub levels: u32,
}

/// When the sets of a cell differ in a statistic.
#[derive(Clone, Debug, PartialEq)]
pub enum Contrast {
    /// They are not all the same.
    Class,
    /// Some have this value, and some have not.
    Value(String),
    /// Some are above this value, and some are not.
    Threshold(f64),
    /// Largest and smallest differ by more than this.
    Step(f64),
}

/// A round: the points that it runs, and how things stood when it began.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Round {
    /// The points, in order; none: the rounds are over.
    #[serde(serialize_with = "write_ranges", deserialize_with = "read_ranges")]
    pub points: Vec<RangeInclusive<u64>>,
    pub standing: Standing,
}

/// How the sets and cells of a sweep stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standing {
    /// Sets that need no more jobs.
    pub sets_done: u64,
    /// Sets that get jobs in this round.
    pub sets_open: u64,
    /// Sets that have the most seeds and miss the target.
    pub sets_capped: u64,
    /// Cells whose sets differ and that are coarser than wanted, but may not be divided: the sweep has the most sets.
    pub cells_capped: u64,
}

/// What all rounds of a sweep may add up to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    pub sets: u64,
    pub jobs: u64,
    /// Predicted CPU time at most, in s; of sets that are not known yet, that of the dearest of the first round.
    pub predicted_cost: f64,
}

impl Refinement {
    /// What makes a set lie on one side of the edge, as the table of cells says it.
    pub fn condition(&self) -> String {
        let key = self.by.key;
        match &self.contrast {
            Contrast::Class | Contrast::Step(_) => key.to_owned(),
            Contrast::Value(value) => format!("{key} = {value}"),
            Contrast::Threshold(threshold) => format!("{key} > {}", Shortest(*threshold)),
        }
    }
}

impl Rounds {
    /// Seeds that a set gets first, if the grid has this many.
    pub fn seeds_at_first(&self, all: u64) -> u64 {
        self.precision.as_ref().map_or(all, |precision| *precision.seeds.start())
    }

    /// How many rows of the grid lie between two of the first round, on this axis.
    pub(super) fn spacing(&self, axis: usize) -> u64 {
        let refined = self.refinement.iter().flat_map(|refinement| &refinement.axes);
        refined.filter(|refined| refined.axis == axis).map(|refined| 1 << refined.levels).next().unwrap_or(1)
    }
}

impl Round {
    /// Whether it has a point.
    pub fn has(&self, point: u64) -> bool {
        contains(&self.points, point)
    }

    /// Whether it says that the rounds are over.
    pub const fn is_end(&self) -> bool {
        self.points.is_empty()
    }
}

/// Whether a point lies in one of these ranges, which are in order.
pub(super) fn contains(ranges: &[RangeInclusive<u64>], point: u64) -> bool {
    let at = ranges.partition_point(|range| *range.end() < point);
    ranges.get(at).is_some_and(|range| range.contains(&point))
}

/// Ranges in order, those that touch as one.
pub fn merged(mut ranges: Vec<RangeInclusive<u64>>) -> Vec<RangeInclusive<u64>> {
    ranges.sort_unstable_by_key(|range| (*range.start(), *range.end()));
    let mut merged: Vec<RangeInclusive<u64>> = Vec::new();
    for range in ranges {
        match merged.last_mut() {
            Some(last) if *range.start() <= *last.end() + 1 => {
                *last = *last.start()..=*range.end().max(last.end());
            }
            _ => merged.push(range),
        }
    }
    merged
}

impl Sweep {
    /// What it decides by itself; none for a sweep that runs its whole grid.
    pub const fn rounds(&self) -> Option<&Rounds> {
        self.rounds.as_ref()
    }

    /// Number of the axis of seeds, if they have one.
    pub fn seed_axis(&self) -> Option<usize> {
        self.axes.iter().position(|axis| axis.quantities() == [Quantity::Parameter(Symbol::Seed)])
    }

    /// Number of seeds of a set in the grid.
    pub fn seed_count(&self) -> u64 {
        self.seed_axis().map_or(1, |axis| self.axes[axis].len())
    }

    /// Distance of the points of a set.
    fn seed_stride(&self) -> u64 {
        self.seed_axis().map_or(1, |axis| self.axes[axis + 1..].iter().map(Axis::len).product())
    }

    /// The rows of a point.
    pub fn rows(&self, mut point: u64) -> Vec<u64> {
        let mut rows: Vec<u64> = Vec::with_capacity(self.axes.len());
        for axis in self.axes.iter().rev() {
            rows.push(point % axis.len());
            point /= axis.len();
        }
        rows.reverse();
        rows
    }

    /// The number of rows of each axis.
    pub fn row_counts(&self) -> Vec<u64> {
        self.axes.iter().map(Axis::len).collect()
    }

    /// Key and value of an axis of one quantity at a row; `None` of a word, or of several quantities.
    pub fn value_at(&self, axis: usize, row: u64) -> Option<(&'static str, f64)> {
        let mut point = Point { parameters: self.base.clone(), fixes_period: None };
        self.axes[axis].apply(row, &mut point);
        let [quantity] = self.axes[axis].quantities()[..] else { return None };
        let value = match (quantity, point.fixes_period) {
            (_, Some((_, value))) => value,
            (Quantity::Parameter(symbol), None) => point.parameters.get(symbol).number()?,
            _ => return None,
        };
        Some((quantity.key(), value))
    }

    /// The set of a point.
    pub fn set_of(&self, point: u64) -> u64 {
        let stride = self.seed_stride();
        point - point / stride % self.seed_count() * stride
    }

    /// The set of a job with these canonical parameters, whatever its seed.
    pub fn set_with(&self, parameters: &Parameters) -> Option<u64> {
        let mut point = Point { parameters: parameters.clone(), fixes_period: None };
        if let Some(axis) = self.seed_axis() {
            self.axes[axis].apply(0, &mut point);
        }
        self.find(&point.parameters).map(|point| self.set_of(point))
    }

    /// The set at these rows, that of the seeds left out; `None` if it is no job. Without modulation, rows that differ in
    /// the period alone are one set.
    pub fn set_at(&self, rows: &[u64]) -> Option<u64> {
        let mut rows = rows.to_vec();
        if let Some(axis) = self.seed_axis() {
            rows[axis] = 0;
        }
        self.find(&self.point(&rows).canonical().parameters).map(|point| self.set_of(point))
    }

    /// The points of a set with these of its seeds.
    pub fn points_of_set(&self, set: u64, seeds: Range<u64>) -> impl Iterator<Item = RangeInclusive<u64>> + use<> {
        let stride = self.seed_stride();
        seeds.map(move |seed| set + seed * stride).map(|point| point..=point)
    }

    /// The sets of the first round, in order: all combinations of the rows that the sweep file has.
    pub(super) fn first_sets(&self) -> BTreeSet<u64> {
        let spacing: Vec<u64> = (0..self.axes.len())
            .map(|axis| match (&self.rounds, self.seed_axis()) {
                (_, Some(seeds)) if seeds == axis => self.axes[axis].len(),
                (Some(rounds), _) => rounds.spacing(axis),
                (None, _) => 1,
            })
            .collect();
        let counts: Vec<u64> =
            self.axes.iter().zip(&spacing).map(|(axis, &spacing)| axis.len().div_ceil(spacing)).collect();
        let mut rows = vec![0; counts.len()];
        let points = 0..counts.iter().product();
        points
            .filter_map(|mut number: u64| {
                for ((row, count), spacing) in rows.iter_mut().zip(&counts).zip(&spacing).rev() {
                    *row = number % count * spacing;
                    number /= count;
                }
                self.set_at(&rows)
            })
            .collect()
    }

    /// What its rounds may add up to; `None` for a sweep without.
    pub fn bounds(&self) -> Option<Bounds> {
        let rounds = self.rounds.as_ref()?;
        let costs: Vec<f64> =
            self.first_sets().into_iter().flat_map(|set| self.jobs_at(set..set + 1)).map(|job| job.cost).collect();
        let sets = rounds.refinement.as_ref().map_or(costs.len() as u64, |refinement| refinement.max_sets);
        let dearest = costs.iter().copied().fold(0.0, f64::max);
        let of_a_seed = costs.iter().sum::<f64>() + (sets - costs.len() as u64) as f64 * dearest;
        let seeds = self.seed_count();
        Some(Bounds { sets, jobs: sets * seeds, predicted_cost: of_a_seed * seeds as f64 })
    }

    /// The first round; `None` for a sweep without.
    pub fn first_round(&self) -> Option<Round> {
        let seeds = self.rounds.as_ref()?.seeds_at_first(self.seed_count());
        let sets = self.first_sets();
        let points = merged(sets.iter().flat_map(|&set| self.points_of_set(set, 0..seeds)).collect());
        Some(Round { points, standing: Standing { sets_open: sets.len() as u64, ..Standing::default() } })
    }
}

/// As `first-last` pairs with spaces between them: hundreds of thousands may stand in a manifest.
fn write_ranges<S: Serializer>(ranges: &[RangeInclusive<u64>], serializer: S) -> Result<S::Ok, S::Error> {
    let words: Vec<String> = ranges.iter().map(|range| format!("{}-{}", range.start(), range.end())).collect();
    serializer.serialize_str(&words.join(" "))
}

fn read_ranges<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<RangeInclusive<u64>>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let range = |word: &str| {
        let (first, last) = word.split_once('-')?;
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    let ranges: Option<Vec<_>> = text.split_whitespace().map(range).collect();
    ranges.ok_or_else(|| serde::de::Error::custom("points of a round must be pairs such as 0-3"))
}
