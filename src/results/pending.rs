//! What runs again, and what does not: the only place that decides it, for `run`, `status` and `plan`.
//!
//! | layer | what is decided | where | the test that fails if it goes wrong |
//! |---|---|---|---|
//! | directory | whether what is there may count at all: the same versions, model, recording | `directory.rs`, `extension_file.rs` | `another_model_recording_or_version_is_refused_with_the_difference_and_nothing_is_written` |
//! | extensions | which extension has a job: the first that keeps it, else the last | `sweep/plan.rs` | `what_is_taken_out_of_the_sweep_is_kept_if_done_and_else_not_run` |
//! | parts | a part is done if all its files are there | [`Results::done_parts`] | `a_damaged_part_is_named_with_the_way_out_which_works` |
//! | retries | of a part that is done, jobs that failed, that needed more memory than was allowed, or that a shorter `max_time` cut off | [`Pending::runs_again`] | `failing_and_panicking_jobs_become_rows_others_continue_and_a_retry_mends_them`, `a_longer_time_runs_the_jobs_again_that_the_shorter_one_ended_and_no_others` |
//! | spill | of a part that is not done, all jobs except those that a stopped run has finished | [`Pending::spilled`] | `finished_jobs_of_an_unfinished_part_are_kept_by_a_stop_and_none_is_run_again` |
//!
//! Which worker runs it is decided in `claims.rs` and `run/take.rs`.

use crate::results::claims::Marked;
use crate::results::directory::Results;
use crate::results::layout::{claim_of, settled};
use crate::results::tables::{JobOutcome, RecordedTable, RowOfJob};
use crate::sweep::{Extension, Job, LARGE, Outline, Part, PartName, certain_memory};
use crate::table::columns::columns;
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::file::Dataset;
use crate::table::shown::shown_bytes;
use serde::Serialize;
use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io;

/// Times within this share of each other are the same bound.
const SAME_TIME: f64 = 1e-9;

/// How far a set of parts is. Costs are predicted CPU times, in s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Overview {
    /// Jobs of parts that are done, without the failed ones.
    pub jobs_done: u64,
    /// Finished jobs of unfinished parts.
    pub jobs_spilled: u64,
    /// Failed jobs of the current sweep.
    pub jobs_failed: u64,
    /// Jobs of finished parts that the current sweep does not have, failed or not; their data are kept.
    pub jobs_kept: u64,
    /// Jobs of the current sweep that are missing, or that a shorter `max_time` ended.
    pub jobs_missing: u64,
    pub parts_done: u64,
    pub parts_missing: u64,
    /// Cost of all jobs that are done, spilled or failed.
    pub predicted_cost_done: f64,
    pub predicted_cost_failed: f64,
    pub predicted_cost_missing: f64,
}

/// Why a job of a finished part may run again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Again {
    Failed(String),
    /// A shorter `max_time` than the present one ended it.
    CutOff,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Retry {
    pub all: bool,
    /// Memory that a job may take, in bytes. Jobs that failed where less was allowed run again.
    pub memory: f64,
}

/// Deaths from which on [`Pending::marked`] lists a part, as a kill or a power cut leaves one at many.
const MIN_DEATHS: usize = 2;
/// Parts that it lists, at most.
const MAX_MARKED: usize = 10;

/// The beginning of the reason of a job that failed for lack of memory.
const MEMORY: &str = "memory: ";

/// Parts that a worker may take, and which of them are done and spilled, as the directory was listed at one instant.
#[derive(Debug)]
pub struct Pending<'a> {
    pub results: &'a Results<'a>,
    /// In plan order.
    pub parts: &'a [Outline],
    pub retry: Retry,
    pub done: BTreeSet<PartName>,
    /// The deaths of workers at each part, by what they claimed; none until they are looked up.
    deaths: RefCell<HashMap<String, usize>>,
    /// Looked up again, as stopped workers spill.
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
        done: BTreeSet<PartName>,
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
        Ok(pending)
    }

    pub fn look_at_spill(&self) -> Result<(), ResultsError> {
        *self.spilled.borrow_mut() = self.results.spilled_parts(RecordedTable::Jobs)?;
        Ok(())
    }

    pub fn look_at_deaths(&self) -> Result<(), ResultsError> {
        *self.deaths.borrow_mut() = self.results.layout().deaths(&self.done)?;
        Ok(())
    }

    /// What a worker claims to run a part, or jobs of one that is done again.
    pub fn claim(&self, part: PartName) -> String {
        claim_of(part, self.done.contains(&part))
    }

    pub fn deaths(&self, part: &Outline) -> usize {
        let deaths = self.deaths.borrow();
        deaths.get(&self.claim(part.name)).copied().unwrap_or(0)
    }

    pub fn part(&self, outline: &Outline) -> Part {
        self.results.plan().part(outline)
    }

    /// Whether a part may have jobs to run: it is not done, or has failed jobs, or jobs that a shorter time cut off.
    pub fn may_run(&self, part: &Outline) -> bool {
        let max_time = |extension: &Extension| extension.sweep.recording().max_time;
        let mut pairs = self.results.extensions().windows(2);
        !self.done.contains(&part.name)
            || self.retry.all
            || part.memory >= LARGE
            || pairs.any(|pair| max_time(&pair[0]) != max_time(&pair[1]))
    }

    pub fn runs_again(&self, job: &Job, why: &Again) -> bool {
        match why {
            Again::CutOff => true,
            Again::Failed(reason) => {
                let was_too_large = reason.starts_with(MEMORY);
                self.retry.all || (was_too_large && self.refusal(job).is_none())
            }
        }
    }

    /// Why a job cannot run here: hard limits allow less memory than it certainly takes.
    pub fn refusal(&self, job: &Job) -> Option<String> {
        let needed = certain_memory(&job.parameters);
        let allowed = self.retry.memory;
        (needed > allowed).then(|| {
            let needed = shown_bytes(needed);
            let allowed = shown_bytes(allowed);
            format!(
                "{MEMORY}needs at least {needed}, {allowed} allowed here; run it again where more is allowed"
            )
        })
    }

    /// Positions of the finished jobs of an unfinished part: none if a file is damaged or gone, and they then run again.
    pub fn spilled(&self, outline: &Outline) -> Result<BTreeSet<usize>, ResultsError> {
        if !self.spilled.borrow().contains(&outline.name) {
            return Ok(BTreeSet::new());
        }
        let mut ids = HashSet::new();
        for table in self.results.tables() {
            match settled(|| self.results.spilled_ids(outline, table)) {
                Ok(Some(of_table)) => ids = of_table,
                Ok(None) => return Ok(BTreeSet::new()),
                Err(error) => return error.damage().map(|_| BTreeSet::new()),
            }
        }
        let part = self.part(outline);
        let is_spilled = |position: &usize| ids.contains(&self.results.job_id(&part, *position));
        Ok((0..part.jobs.len()).filter(is_spilled).collect())
    }

    /// How far the parts are. Reads finished parts only if jobs of them may run again, or, with `looks`, all of them.
    /// Visits failed jobs, each with its part, its position and the reason.
    pub fn overview(
        &self,
        looks: bool,
        mut visit: impl FnMut(&Part, usize, &Again),
    ) -> Result<Overview, ResultsError> {
        let mut overview = Overview::default();
        for outline in self.parts {
            if self.done.contains(&outline.name) {
                overview.parts_done += 1;
                overview.jobs_done += outline.job_count as u64;
                overview.predicted_cost_done += outline.cost;
                if looks || self.may_run(outline) {
                    self.count_again(outline, &mut overview, &mut visit)?;
                }
            } else {
                self.count_missing(outline, &mut overview)?;
            }
        }
        Ok(overview)
    }

    fn count_missing(&self, part: &Outline, overview: &mut Overview) -> Result<(), ResultsError> {
        let spilled = self.spilled(part)?;
        let mut spilled_cost = 0.0;
        if !spilled.is_empty() {
            let jobs = self.part(part).jobs;
            spilled_cost = spilled.iter().map(|&position| jobs[position].cost).sum();
        }
        overview.parts_missing += 1;
        overview.jobs_missing += (part.job_count - spilled.len()) as u64;
        overview.predicted_cost_missing += part.cost - spilled_cost;
        overview.jobs_spilled += spilled.len() as u64;
        overview.predicted_cost_done += spilled_cost;
        Ok(())
    }

    /// Counts the jobs of a finished part that may run again.
    fn count_again(
        &self,
        outline: &Outline,
        overview: &mut Overview,
        visit: &mut impl FnMut(&Part, usize, &Again),
    ) -> Result<(), ResultsError> {
        let again = self.results.again(outline)?;
        if again.is_empty() {
            return Ok(());
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
        Ok(())
    }

    /// The missing parts with this number of deaths or more.
    pub fn with_deaths(&self, min: usize) -> impl Iterator<Item = &'a Outline> {
        let parts = self.parts.iter();
        parts.filter(move |part| self.deaths(part) >= min)
    }

    /// The missing parts with the most deaths.
    pub fn marked(&self) -> Vec<Marked> {
        let mut parts: Vec<&Outline> = self.with_deaths(MIN_DEATHS).collect();
        parts.sort_by_key(|part| Reverse(self.deaths(part)));
        parts.truncate(MAX_MARKED);
        let marked = parts.into_iter().map(|outline| {
            let jobs = self.part(outline).jobs;
            let ends = [&jobs[0], &jobs[jobs.len() - 1]];
            let mut commands = Vec::from(ends.map(|job| self.results.sweep().command(job)));
            commands.dedup();
            Marked {
                part: outline.name.to_string(),
                deaths: self.deaths(outline),
                jobs: jobs.len(),
                memory: outline.memory,
                commands,
            }
        });
        marked.collect()
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
    /// How far all parts are. Of a directory of another version, whose parts were others, nothing counts as missing.
    pub fn overview(&self) -> Result<Overview, ResultsError> {
        if !self.version_differences().is_empty() {
            return Ok(Overview::default());
        }
        let parts: Vec<Outline> = self.plan().outlines().collect();
        Pending::look_up(self, &parts, Retry::default())?.overview(false, |_, _, _| ())
    }

    /// The failed and cut off jobs of a finished part, without those of values that the sweep no longer has.
    pub fn again(&self, part: &Outline) -> Result<BTreeMap<usize, Again>, ResultsError> {
        let max_time = self.sweep().recording().max_time.unwrap_or(f64::INFINITY);
        let is_cut_off = |time: f64| time < max_time * (1.0 - SAME_TIME);
        let mut again = BTreeMap::new();
        let mut rows = 0;
        let jobs = self.dataset_of(RecordedTable::Jobs, part.name);
        for row in jobs.rows::<OutcomeRow>() {
            let row = row?;
            let is_cut_off = row.simulated_time.is_some_and(is_cut_off);
            let why = match row.outcome {
                JobOutcome::Failed => Some(Again::Failed(row.reason.unwrap_or_default())),
                JobOutcome::TimeLimit if is_cut_off => Some(Again::CutOff),
                _ => None,
            };
            again.extend(why.map(|why| (rows, why)));
            rows += 1;
        }
        if rows != part.job_count {
            let file = self.part_file(RecordedTable::Jobs, part);
            let problem = format!("{rows} jobs where the plan has {}", part.job_count);
            return Err(ResultsError::damaged(&file, problem));
        }
        if !again.is_empty() && part.name.extension + 1 < self.extensions().len() {
            let jobs = self.plan().part(part).jobs;
            again.retain(|&position, _| self.sweep().find(&jobs[position].parameters).is_some());
        }
        Ok(again)
    }

    /// The parts with spilled rows of this table.
    pub(super) fn spilled_parts(
        &self,
        table: RecordedTable,
    ) -> Result<BTreeSet<PartName>, ResultsError> {
        Ok(self
            .layout()
            .parts_in(&self.layout().spill().join(table.word()))?)
    }

    /// The ids in a file of the spill; `None` if this host does not see it yet.
    fn spilled_ids(
        &self,
        outline: &Outline,
        table: RecordedTable,
    ) -> Result<Option<HashSet<String>>, ResultsError> {
        let file = self.file_in(&self.layout().spill(), table, outline.name);
        let rows = Dataset::of(self.layout().storage, vec![file]).rows::<RowOfJob>();
        let ids = rows.map(|row| row.map(|row| row.job_id));
        match ids.collect::<Result<HashSet<String>, ResultsError>>() {
            // If it is listed no more, another worker has committed the part and removed it.
            Err(error)
                if error.kind == ErrorKind::Disk(io::ErrorKind::NotFound)
                    && self.spilled_parts(table)?.contains(&outline.name) =>
            {
                Ok(None)
            }
            ids => ids.map(Some),
        }
    }
}
