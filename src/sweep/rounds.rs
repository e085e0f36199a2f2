//! Rounds: what `[precision]` and `[refine]` ask for, and the points that one round runs.

use super::set::Statistic;
use crate::table::value::Shortest;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::ops::RangeInclusive;

/// Most sets of a sweep with rounds: the points of every round are listed in the file of its extension.
pub(super) const MAX_SETS: u64 = 100_000;

/// What a sweep decides by itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rounds {
    pub precision: Option<Precision>,
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

/// As `first-last` pairs with spaces between them: hundreds of thousands may stand in the file of an extension.
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
