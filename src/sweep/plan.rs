//! The plan of a results directory: the sweeps that were run in it, one after the other, and their jobs in parts.
//!
//! Each sweep that is run in a directory opens an *extension*, which owns its jobs except those that earlier extensions
//! keep: what they had done by then. Each round of an adaptive sweep is one, too. A *part* is a run of consecutive jobs
//! of an extension, committed together. Parts are small, so that many workers can share them and little is lost with
//! one, but not many: see [`Extension::new`]. Contract: parts are a function of the texts of the sweeps, of what was
//! done when each began, and of [`PLAN_VERSION`]. Memory: one part. The outlines of all parts, from which single parts
//! are built again, take some 60 bytes each.

use super::cost::{MEMORY_OF_A_SLIP, predicted_memory};
use super::grid::Sweep;
use super::job::Job;
use super::rounds::{Round, contains};
use crate::model::theory::typical_interval;
use std::ops::{Deref, Range, RangeInclusive};

/// Predicted CPU time of a part, in s, unless parts would be too few or too many: little is lost with one.
pub const PART_COST: f64 = 5.0;
/// Least number of parts of a sweep with jobs of equal cost, if it has as many jobs: enough for some dozens of workers.
const MIN_PARTS: f64 = if cfg!(test) { 2.0 } else { 64.0 };
/// Least predicted CPU time of a part of a round, in s: of many rounds, most have few jobs, and a commit takes some 20
/// ms.
const ROUND_PART_COST: f64 = if cfg!(test) { 0.0 } else { 0.25 };
/// A sweep has hardly more parts than twice this: names in a folder stay few.
const MANY_PARTS: f64 = 20_000.0;
/// What rounding may add to the sum of costs.
const ROUNDING: f64 = 1e-9;
/// Most jobs of a part, so that a part of cheap jobs fits in memory.
pub const PART_JOBS: usize = 4096;
/// Version of how sweeps become parts: values of axes, order, cost and limits. A directory keeps the one that it was
/// started with.
pub const PLAN_VERSION: u32 = 9;

/// A sweep of a directory, and what of it counts there.
#[derive(Clone, Debug)]
pub struct Extension {
    pub sweep: Sweep,
    /// Most predicted CPU time of a part with more than one job, in s.
    pub part_cost: f64,
    /// Where in the grid the jobs lie that it keeps, as first and last points of its parts; `None` for the last
    /// extension, which owns all that no earlier one keeps.
    pub kept: Option<Vec<RangeInclusive<u64>>>,
    /// Its round in an adaptive sweep; in any other sweep, all points are jobs.
    pub round: Option<Round>,
}

/// The extensions of a directory in the order in which they began.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    extensions: &'a [Extension],
}

/// The name of a part, which is that of its file in every table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartName {
    /// Number of the extension, from 0.
    pub extension: usize,
    /// Number of the part within its extension, from 0.
    pub index: u64,
}

/// A part without its jobs: where they lie, and their sums.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    pub name: PartName,
    /// Points of the grid from its first job to its last.
    pub points: RangeInclusive<u64>,
    /// Number of its jobs. At least one.
    pub job_count: usize,
    /// Sum of their predicted CPU times, in s.
    pub cost: f64,
    /// Most memory that one of them is predicted to take, in bytes.
    pub memory: f64,
}

/// Consecutive jobs of an extension.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    pub outline: Outline,
    /// Its jobs, in plan order. At least one.
    pub jobs: Vec<Job>,
}

impl Deref for Part {
    type Target = Outline;

    fn deref(&self) -> &Outline {
        &self.outline
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Totals {
    pub jobs: u64,
    pub parts: u64,
    /// Slips that the jobs are expected to record.
    pub slips: f64,
    /// Predicted CPU time, in s.
    pub cost: f64,
    /// Most memory that a job is predicted to take, in bytes, and the slips of the jobs of a part.
    pub memory: f64,
    pub memory_of_slips: f64,
    /// The first of the jobs with the longest predicted CPU time.
    pub longest: Option<Job>,
}

impl Extension {
    /// Begins an extension. Its parts have a 64th of its predicted cost at most, and mostly 5 s; where that would be
    /// too many, a 20,000th. An expensive job is a separate part.
    pub fn new(sweep: &Sweep, earlier: &[Self]) -> Self {
        Self::in_round(sweep, earlier, sweep.first_round())
    }

    pub fn in_round(sweep: &Sweep, earlier: &[Self], round: Option<Round>) -> Self {
        let mut own = Self {
            sweep: sweep.clone(),
            part_cost: 0.0,
            kept: None,
            round,
        };
        let jobs = own_jobs(&own, earlier, &sweep.points());
        let total: f64 = jobs.map(|job| job.cost).sum();
        let min = own.round.as_ref().map_or(0.0, |_| ROUND_PART_COST);
        let max = min.max(total / MIN_PARTS);
        own.part_cost = PART_COST.max(total / MANY_PARTS).min(max) * (1.0 + ROUNDING);
        own
    }

    fn points(&self, among: &Range<u64>) -> Vec<Range<u64>> {
        let Some(round) = &self.round else {
            return vec![among.clone()];
        };
        let points = &round.points;
        let from = points.partition_point(|range| *range.end() < among.start);
        let rest = points[from..].iter();
        let ranges = rest.take_while(|range| *range.start() < among.end);
        ranges
            .map(|range| among.start.max(*range.start())..among.end.min(range.end() + 1))
            .collect()
    }

    fn keeps(&self, point: u64) -> bool {
        self.kept.as_ref().is_none_or(|kept| contains(kept, point))
            && self.round.as_ref().is_none_or(|round| round.has(point))
    }
}

/// The jobs of an extension among these points that no earlier one keeps, in grid order.
fn own_jobs<'a>(
    own: &'a Extension,
    earlier: &'a [Extension],
    among: &Range<u64>,
) -> impl Iterator<Item = Job> + Clone + Send + use<'a> {
    let is_kept = |extension: &Extension, job: &Job| {
        let point = extension.sweep.find(&job.parameters);
        point.is_some_and(|point| extension.keeps(point))
    };
    let points = own.points(among).into_iter();
    let jobs = points.flat_map(|points| own.sweep.jobs_at(points));
    jobs.filter(move |job| !earlier.iter().any(|extension| is_kept(extension, job)))
}

impl<'a> Plan<'a> {
    /// The plan of these extensions. Their sweeps differ in axes, conditions and bounds only, see
    /// [`Sweep::differences`].
    pub const fn new(extensions: &'a [Extension]) -> Self {
        Self { extensions }
    }

    /// The sweeps, those of rounds once.
    pub fn sweeps(self) -> impl Iterator<Item = &'a Sweep> + use<'a> {
        let is_same = |left: &Extension, right: &Extension| left.sweep.text() == right.sweep.text();
        let sweeps = self.extensions.chunk_by(is_same);
        sweeps.filter_map(|rounds| Some(&rounds.first()?.sweep))
    }

    pub fn parts_of(self, extension: usize) -> impl Iterator<Item = Part> + Clone + Send + use<'a> {
        let own = &self.extensions[extension];
        let earlier = &self.extensions[..extension];
        let mut source = own_jobs(own, earlier, &own.sweep.points()).peekable();
        let parts = (0..).map_while(move |index| {
            let mut jobs = Vec::new();
            let mut cost = 0.0;
            let fits = |jobs: &[Job], cost: f64| {
                jobs.is_empty() || (jobs.len() < PART_JOBS && cost <= own.part_cost)
            };
            while let Some(job) = source.next_if(|job| fits(&jobs, cost + job.cost)) {
                cost += job.cost;
                jobs.push(job);
            }
            let points = jobs.first()?.point..=jobs.last()?.point;
            let memory = jobs
                .iter()
                .map(|job| predicted_memory(&job.parameters, own.sweep.recording()));
            Some(Part {
                outline: Outline {
                    name: PartName { extension, index },
                    points,
                    job_count: jobs.len(),
                    cost,
                    memory: memory.fold(0.0, f64::max),
                },
                jobs,
            })
        });
        parts.filter(|part| own.keeps(*part.points.start()))
    }

    pub fn parts(self) -> impl Iterator<Item = Part> + Send + use<'a> {
        (0..self.extensions.len()).flat_map(move |extension| self.parts_of(extension))
    }

    /// The outlines of all parts, in order. The caller keeps them: computing them again takes as long.
    pub fn outlines(self) -> impl Iterator<Item = Outline> + Send + use<'a> {
        self.parts().map(|part| part.outline)
    }

    /// The part of an outline, whose points alone are walked through.
    pub fn part(self, outline: &Outline) -> Part {
        let own = &self.extensions[outline.name.extension];
        let earlier = &self.extensions[..outline.name.extension];
        let points = *outline.points.start()..outline.points.end() + 1;
        Part {
            outline: outline.clone(),
            jobs: own_jobs(own, earlier, &points).collect(),
        }
    }

    /// Where in the grid the parts of an extension lie that are to be kept.
    pub fn ranges(
        self,
        extension: usize,
        is_kept: impl Fn(&Part) -> bool,
    ) -> Vec<RangeInclusive<u64>> {
        let mut ranges: Vec<RangeInclusive<u64>> = Vec::new();
        let mut next = None;
        for part in self.parts_of(extension).filter(is_kept) {
            match ranges.last_mut() {
                Some(range) if next == Some(part.name.index) => {
                    *range = *range.start()..=*part.points.end();
                }
                _ => ranges.push(part.points.clone()),
            }
            next = Some(part.name.index + 1);
        }
        ranges
    }

    /// Walks through the plan and sums it up.
    pub fn totals(self) -> Totals {
        let mut totals = Totals::default();
        for part in self.parts() {
            let recording = self.extensions[part.name.extension].sweep.recording();
            let slips = |job: &Job| recording.expected_slips(typical_interval(&job.parameters));
            let slips: f64 = part.jobs.iter().map(slips).sum();
            totals.jobs += part.outline.job_count as u64;
            totals.parts += 1;
            totals.slips += slips;
            totals.cost += part.outline.cost;
            totals.memory = totals.memory.max(part.outline.memory);
            totals.memory_of_slips = totals.memory_of_slips.max(MEMORY_OF_A_SLIP * slips);
            let jobs = totals.longest.into_iter().chain(part.jobs);
            totals.longest = jobs.min_by(|left, right| right.cost.total_cmp(&left.cost));
        }
        totals
    }
}
