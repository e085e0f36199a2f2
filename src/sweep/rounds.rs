//! Rounds: what `[precision]` and `[refine]` ask for, and the points that one round runs.

use crate::sets::Statistic;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::ops::RangeInclusive;

/// Most sets of a sweep with rounds: the points of every round are listed in the file of its extension.
pub(super) const MAX_SETS: u64 = 100_000;
/// Most jobs of a sweep that looks for edges.
pub(super) const MAX_JOBS: u64 = 1_000_000;

/// Seeds of a set below which its interval is not trusted, unless it may have no more: see `rounds/`.
pub const MIN_SEEDS: u64 = 24;

/// What makes a sweep adaptive.
#[derive(Clone, Debug, PartialEq)]
pub struct Rounds {
    /// Seeds of a set in the first round, and at most.
    pub seeds: RangeInclusive<u64>,
    /// Seeds in the first round as the sweep file has them, which may be fewer.
    pub asked: u64,
    pub goal: Goal,
}

/// What the rounds of a sweep are for.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    Precision(Precision),
    Edges(Refinement),
}

impl Rounds {
    /// The statistics that the sweep file names.
    pub fn statistics(&self) -> &[Statistic] {
        match &self.goal {
            Goal::Precision(precision) => &precision.statistics,
            Goal::Edges(refinement) => &refinement.by,
        }
    }
}

/// Sets get seeds until their statistics are known to a target, or they have the most.
#[derive(Clone, Debug, PartialEq)]
pub struct Precision {
    /// At least one, each with an interval.
    pub statistics: Vec<Statistic>,
    pub target: Target,
}

/// Largest half-width of an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// As a share of the statistic.
    Relative(f64),
    Absolute(f64),
}

/// Sets and seeds are added where a statistic crosses a threshold along an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Refinement {
    pub axis: usize,
    /// How often the distance of two sets of the first round can be halved on it.
    pub levels: u32,
    pub is_log: bool,
    /// What crosses the threshold; at least one.
    pub by: Vec<Statistic>,
    /// The statistic is the share of the intervals that are nearest to this number of periods.
    pub periods: Option<u64>,
    pub threshold: f64,
    /// Largest width of the interval of an edge: on a logarithmic axis as a share of the value.
    pub to: f64,
    /// Most jobs of the sweep, controls left out.
    pub max_jobs: u64,
}

/// A round: the points that it runs, and how things stood when it began.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Round {
    /// The points, in order; empty if the rounds are over.
    #[serde(serialize_with = "write_ranges", deserialize_with = "read_ranges")]
    pub points: Vec<RangeInclusive<u64>>,
    pub standing: Standing,
}

/// How the sets and edges of a sweep stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standing {
    /// Sets that need no more jobs.
    pub sets_done: u64,
    /// Sets that get jobs in this round.
    pub sets_open: u64,
    /// Sets that miss the target, or are not clear, but get no more jobs: they or the sweep have the most.
    pub sets_capped: u64,
    /// Edges that are less precise than wanted, but get no more jobs: their sets or the sweep have the most.
    pub edges_capped: u64,
}

/// What all rounds of a sweep may add up to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    pub sets: u64,
    pub jobs: u64,
    /// Predicted CPU time of these jobs, in s; sets that are not known yet count as the most expensive of the first
    /// round.
    pub predicted_cost: f64,
}

impl Round {
    pub fn has(&self, point: u64) -> bool {
        contains(&self.points, point)
    }

    /// The same, or the end if all its points are among those that were chosen before.
    pub fn beyond(mut self, chosen: &Self) -> Self {
        let mut points = self.points.iter().cloned().flatten();
        if points.all(|point| chosen.has(point)) {
            self.points.clear();
            self.standing.sets_capped += std::mem::take(&mut self.standing.sets_open);
        }
        self
    }

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
fn write_ranges<S: Serializer>(
    ranges: &[RangeInclusive<u64>],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let word = |range: &RangeInclusive<u64>| format!("{}-{}", range.start(), range.end());
    let words: Vec<String> = ranges.iter().map(word).collect();
    serializer.serialize_str(&words.join(" "))
}

fn read_ranges<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<RangeInclusive<u64>>, D::Error> {
    let text = String::deserialize(deserializer)?;
    let range = |word: &str| {
        let (first, last) = word.split_once('-')?;
        Some(first.parse().ok()?..=last.parse().ok()?)
    };
    let ranges: Option<Vec<_>> = text.split_whitespace().map(range).collect();
    ranges.ok_or_else(|| serde::de::Error::custom("points of a round must be pairs such as 0-3"))
}
