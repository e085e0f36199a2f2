//! The plan of a results directory: the sweeps that were run in it, one after the other, and their jobs in parts.
//!
//! Each sweep that is run in a directory opens an *extension*, which owns the jobs that are in no earlier sweep. A *part* is a
//! run of consecutive jobs of an extension, committed together: it ends with the job that brings its predicted cost to
//! [`PART_COST`], or its jobs to [`PART_JOBS`]. Contract: parts are a function of the texts of the sweeps and of
//! [`PLAN_VERSION`] alone. Memory: one part.

use super::grid::Sweep;
use super::job::Job;

/// Predicted CPU time after which a part is full, in s: little is lost with an unfinished part, and files stay few.
pub const PART_COST: f64 = 5.0;
/// Most jobs of a part, so that a part of cheap jobs fits in memory.
pub const PART_JOBS: usize = 4096;
/// Version of how sweeps become parts: order, cost and limits. A directory keeps the one that it was started with.
pub const PLAN_VERSION: u32 = 3;

/// The sweeps of a directory in the order in which they were run.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    extensions: &'a [Sweep],
}

/// Consecutive jobs of an extension.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Number of the extension, from 0.
    pub extension: usize,
    /// Number of the part within its extension, from 0.
    pub index: u64,
    /// Its jobs, in plan order. At least one.
    pub jobs: Vec<Job>,
    /// Sum of their predicted CPU times, in s.
    pub cost: f64,
}

/// What a plan adds up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// Number of jobs.
    pub jobs: u64,
    /// Number of parts.
    pub parts: u64,
    /// Predicted CPU time, in s.
    pub cost: f64,
}

impl<'a> Plan<'a> {
    /// The plan of these sweeps. Sweeps of one directory differ in axes and conditions only, see [`Sweep::difference`].
    #[must_use]
    pub const fn new(extensions: &'a [Sweep]) -> Self {
        Self { extensions }
    }

    /// The jobs that an extension owns, those that are in no earlier sweep, in grid order.
    pub(super) fn jobs(self, extension: usize) -> impl Iterator<Item = Job> + Clone + Send + use<'a> {
        let (earlier, sweep) = (&self.extensions[..extension], &self.extensions[extension]);
        sweep.jobs().filter(move |job| !earlier.iter().any(|sweep| sweep.contains(&job.parameters)))
    }

    /// The parts of an extension, in order.
    pub fn parts_of(self, extension: usize) -> impl Iterator<Item = Part> + Clone + Send + use<'a> {
        let mut source = self.jobs(extension);
        (0..).map_while(move |index| {
            let (mut jobs, mut cost) = (Vec::new(), 0.0);
            while cost < PART_COST
                && jobs.len() < PART_JOBS
                && let Some(job) = source.next()
            {
                cost += job.cost;
                jobs.push(job);
            }
            (!jobs.is_empty()).then_some(Part { extension, index, jobs, cost })
        })
    }

    /// The parts of all extensions, in order.
    pub fn parts(self) -> impl Iterator<Item = Part> + Send + use<'a> {
        (0..self.extensions.len()).flat_map(move |extension| self.parts_of(extension))
    }

    /// Walks through the plan and adds up.
    #[must_use]
    pub fn totals(self) -> Totals {
        self.parts().fold(Totals::default(), |totals, part| Totals {
            jobs: totals.jobs + part.jobs.len() as u64,
            parts: totals.parts + 1,
            cost: totals.cost + part.cost,
        })
    }
}
