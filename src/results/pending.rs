//! What runs again, and what does not: the only place that decides it, for `run`, `status` and `plan`.
//!
//! | layer | what is decided | where | the test that fails if it goes wrong |
//! |---|---|---|---|
//! | directory | whether what is there may count at all: the same versions, model, recording | `directory.rs`, `extension_file.rs` | `another_model_recording_or_version_is_refused_with_the_difference_and_nothing_is_written` |
//! | extensions | which extension has a job: the first that keeps it, else the last | `sweep/plan.rs` | `what_is_taken_out_of_the_sweep_is_kept_if_done_and_else_not_run` |
//! | parts | a part is done if all its files are there | [`Results::done_parts`] | `a_missing_slips_file_ends_every_command_that_reads_it_with_code_4_and_run_makes_it_again` |
//! | retries | of a part that is done, jobs that failed, that needed more memory than was allowed, or that a shorter `max_time` cut off | [`Pending::runs_again`] | `failing_and_panicking_jobs_become_rows_others_go_on_and_a_retry_mends_them`, `a_longer_time_runs_the_jobs_again_that_the_shorter_one_ended_and_no_others` |
//! | spill | of one that is not, all jobs but those that a stopped run has finished | [`Pending::spilled`] | `finished_jobs_of_an_unfinished_part_are_kept_by_a_stop_and_none_is_run_again` |
//!
//! Who runs it is another question: see `claims.rs`, and `run/take.rs`.

use crate::results::deaths::Deaths;
use crate::results::directory::Results;
use crate::results::layout::{DoneParts, PartName, settled};
use crate::results::tables::{self, JobOutcome, RowOfJob};
use crate::sweep::{Extension, Job, LARGE, Outline, Part, certain_memory};
use crate::table::columns::columns;
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::file::Dataset;
use crate::table::shown::shown_bytes;
use serde::Serialize;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::io;

/// Times within this share of each other are the same bound.
const SAME_TIME: f64 = 1e-9;

/// How far the parts of a share are. Costs are predicted CPU times, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Overview {
    /// Jobs of parts that are done, without the failed ones.
    pub jobs_done: u64,
    /// Finished jobs that are kept for later, until the rest of their part is done.
    pub jobs_spilled: u64,
    /// Jobs that failed and are asked for.
    pub jobs_failed: u64,
    /// Of those done, jobs that the sweep which was asked for last does not have, failed or not; their data are kept.
    pub jobs_kept: u64,
    /// Jobs that are missing, or are asked for and were ended by a shorter `max_time`.
    pub jobs_missing: u64,
    pub parts_done: u64,
    pub parts_missing: u64,
    /// Cost of all jobs that are done, spilled or failed.
    pub predicted_cost_done: f64,
    pub predicted_cost_failed: f64,
    pub predicted_cost_missing: f64,
}

/// Why a job of a part that is done may run again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Again {
    /// It failed, for this reason.
    Failed(String),
    /// A shorter `max_time` than the present one ended it.
    CutOff,
}

/// Which failed jobs are to be run again.
#[derive(Clone, Copy, Debug, Default)]
pub struct Retry {
    pub all: bool,
    /// Memory that a job may take, in bytes: those that failed where less was allowed.
    pub memory: f64,
}

/// What the reason of a job that failed for lack of memory begins with, and no other.
const MEMORY: &str = "memory: ";

/// Parts that are a worker's to take, and what of them is done and spilled, as the names in a directory said at one instant.
#[derive(Debug)]
pub struct Pending<'a> {
    pub results: &'a Results<'a>,
    /// In plan order.
    pub parts: &'a [Outline],
    pub retry: Retry,
    pub done: DoneParts,
    /// Looked up again, since workers die.
    deaths: RefCell<Deaths>,
    /// Looked up again, since workers that end spill.
    spilled: RefCell<BTreeSet<PartName>>,
}

impl<'a> Pending<'a> {
    pub fn look_up(
        results: &'a Results<'a>,
        parts: &'a [Outline],
        retry: Retry,
    ) -> Result<Self, ResultsError> {
        let done = results.done_parts()?;
        Self::with(results, parts, retry, done)
    }

    /// The same where it is known which parts are done.
    pub(super) fn with(
        results: &'a Results<'a>,
        parts: &'a [Outline],
        retry: Retry,
        done: DoneParts,
    ) -> Result<Self, ResultsError> {
        let pending = Self {
            results,
            parts,
            retry,
            done,
            deaths: RefCell::default(),
            spilled: RefCell::default(),
        };
        pending.look_at_spill()?;
        pending.look_at_deaths()?;
        Ok(pending)
    }

    /// Looks up again what is spilled.
    pub fn look_at_spill(&self) -> Result<(), ResultsError> {
        *self.spilled.borrow_mut() = self.results.spilled_parts(tables::JOBS)?;
        Ok(())
    }

    /// Looks up again at which parts workers died.
    pub fn look_at_deaths(&self) -> Result<(), ResultsError> {
        *self.deaths.borrow_mut() = self.results.layout().marks()?;
        Ok(())
    }

    /// The same, for a command that makes no marks.
    pub fn look_at_all_deaths(&self) -> Result<(), ResultsError> {
        *self.deaths.borrow_mut() = self.results.layout().marks_and_notes()?;
        Ok(())
    }

    /// How many workers died at a part.
    pub fn deaths(&self, part: &Outline) -> usize {
        let deaths = self.deaths.borrow();
        deaths.get(&part.into()).map_or(0, Vec::len)
    }

    pub fn part(&self, outline: &Outline) -> Part {
        self.results.plan().part(outline)
    }

    /// Whether a part that is done may have jobs to be run: failed ones, or such as a shorter time has cut off.
    pub fn may_run_again(&self, part: &Outline) -> bool {
        let max_time = |extension: &Extension| extension.sweep.recording().max_time;
        self.retry.all
            || part.memory >= LARGE
            || self
                .results
                .extensions()
                .windows(2)
                .any(|pair| max_time(&pair[0]) != max_time(&pair[1]))
    }

    /// Whether a job of a part that is done runs again.
    pub fn runs_again(&self, job: &Job, why: &Again) -> bool {
        match why {
            Again::CutOff => true,
            Again::Failed(reason) => {
                let was_too_large = reason.starts_with(MEMORY);
                self.retry.all || (was_too_large && self.refusal(job).is_none())
            }
        }
    }

    /// Why a job cannot be run here: hard limits allow less memory than it takes in any case.
    pub fn refusal(&self, job: &Job) -> Option<String> {
        let needed = certain_memory(&job.parameters);
        let allowed = self.retry.memory;
        (needed > allowed).then(|| {
            format!(
                "{MEMORY}needs at least {}, {} allowed here; run it again where more is allowed",
                shown_bytes(needed),
                shown_bytes(allowed)
            )
        })
    }

    /// Positions of the jobs of a part that is not done which are finished.
    pub fn spilled(&self, part: &Outline) -> Result<BTreeSet<usize>, ResultsError> {
        if self.spilled.borrow().contains(&part.into()) {
            self.results.spilled(part)
        } else {
            Ok(BTreeSet::new())
        }
    }

    /// How far the parts are, by their names alone unless jobs of them may run again. With `looks`, looks into every part;
    /// visits jobs that failed, each with its part, its position and why.
    pub fn overview(
        &self,
        looks: bool,
        mut visit: impl FnMut(&Part, usize, &Again),
    ) -> Result<Overview, ResultsError> {
        let mut overview = Overview::default();
        for outline in self.parts {
            if !self.done.has(outline) {
                let spilled = self.spilled(outline)?;
                let jobs = if spilled.is_empty() {
                    Vec::new()
                } else {
                    self.part(outline).jobs
                };
                let spilled_cost: f64 = spilled.iter().map(|&position| jobs[position].cost).sum();
                overview.parts_missing += 1;
                overview.jobs_missing += (outline.job_count - spilled.len()) as u64;
                overview.predicted_cost_missing += outline.cost - spilled_cost;
                overview.jobs_spilled += spilled.len() as u64;
                overview.predicted_cost_done += spilled_cost;
                continue;
            }
            overview.parts_done += 1;
            overview.jobs_done += outline.job_count as u64;
            overview.predicted_cost_done += outline.cost;
            let again = if looks || self.may_run_again(outline) {
                self.results.again(outline)?
            } else {
                BTreeMap::new()
            };
            if again.is_empty() {
                continue;
            }
            let part = self.part(outline);
            for (position, why) in again {
                let cost = part.jobs[position].cost;
                overview.jobs_done -= 1;
                match &why {
                    Again::Failed(_) => {
                        overview.jobs_failed += 1;
                        overview.predicted_cost_failed += cost;
                        visit(&part, position, &why);
                    }
                    Again::CutOff => {
                        overview.jobs_missing += 1;
                        overview.predicted_cost_missing += cost;
                        overview.predicted_cost_done -= cost;
                    }
                }
            }
        }
        Ok(overview)
    }
}

columns! {
    /// How a job ended, as a row of the jobs table says.
    struct OutcomeRow {
        outcome: JobOutcome;
        reason: Option<String>;
        simulated_time: Option<f64>;
    }
}

impl Results<'_> {
    /// How far all parts are. In a directory of another version, which had other parts, nothing is known to be missing.
    pub fn overview(&self) -> Result<Overview, ResultsError> {
        if !self.version_differences().is_empty() {
            return Ok(Overview::default());
        }
        let parts: Vec<Outline> = self.plan().outlines().collect();
        Pending::look_up(self, &parts, Retry::default())?.overview(false, |_, _, _| ())
    }

    /// The jobs of a part that is done which failed or were cut off. Those of values that the sweep no longer has stay as they are.
    pub fn again(&self, part: &Outline) -> Result<BTreeMap<usize, Again>, ResultsError> {
        let max_time = self.sweep().recording().max_time.unwrap_or(f64::INFINITY);
        let is_cut_off = |time: f64| time < max_time * (1.0 - SAME_TIME);
        let (mut again, mut rows) = (BTreeMap::new(), 0);
        for batch in self
            .dataset_of(tables::JOBS, part.into())
            .rows::<OutcomeRow>()
        {
            for row in batch? {
                let why = match row.outcome {
                    JobOutcome::Failed => Some(Again::Failed(row.reason.unwrap_or_default())),
                    JobOutcome::TimeLimit if row.simulated_time.is_some_and(is_cut_off) => {
                        Some(Again::CutOff)
                    }
                    _ => None,
                };
                again.extend(why.map(|why| (rows, why)));
                rows += 1;
            }
        }
        if rows != part.job_count {
            let problem = format!("{rows} jobs where the plan has {}", part.job_count);
            return Err(ResultsError::damaged(
                &self.part_file(tables::JOBS, part),
                problem,
            ));
        }
        if !again.is_empty() && part.extension + 1 < self.extensions().len() {
            let jobs = self.plan().part(part).jobs;
            again.retain(|&position, _| self.sweep().contains(&jobs[position].parameters));
        }
        Ok(again)
    }

    /// The parts of which something is spilled in this table.
    pub(super) fn spilled_parts(&self, table: &str) -> Result<BTreeSet<PartName>, ResultsError> {
        Ok(self.layout().parts_in(&self.layout().spill().join(table))?)
    }

    /// Positions of the jobs of a part that are spilled: none if a file is damaged or gone, and they then run again.
    fn spilled(&self, outline: &Outline) -> Result<BTreeSet<usize>, ResultsError> {
        let mut ids: HashSet<String> = HashSet::new();
        for table in self.tables() {
            // Nothing yet if this host does not see a file that the folder lists, and no ids in one that is damaged.
            let read = || {
                let file = self.file_in(&self.layout().spill(), table, outline.into());
                let rows = Dataset::of(self.layout().storage, vec![file]).rows::<RowOfJob>();
                match rows.collect::<Result<Vec<_>, _>>() {
                    Ok(rows) => Ok(Some(Some(
                        rows.into_iter().flatten().map(|row| row.job_id).collect(),
                    ))),
                    Err(ResultsError {
                        kind: ErrorKind::Damaged,
                        ..
                    }) => Ok(Some(None)),
                    Err(ResultsError {
                        kind: ErrorKind::Disk(io::ErrorKind::NotFound),
                        ..
                    }) => {
                        // Not listed: another worker has just committed the part.
                        let is_listed = self.spilled_parts(table)?.contains(&outline.into());
                        Ok((!is_listed).then_some(None))
                    }
                    Err(error) => Err(error),
                }
            };
            let Some(of_table) = settled(read)?.flatten() else {
                return Ok(BTreeSet::new());
            };
            ids = of_table;
        }
        let part = self.plan().part(outline);
        Ok((0..part.jobs.len())
            .filter(|&position| ids.contains(&self.job_id(&part, position)))
            .collect())
    }
}
