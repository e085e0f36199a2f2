//! The tables of a sweep: slips, precursors, jobs. What is measured is described in [`crate::observe`], what labels it
//! here.
//!
//! Quantities are SI. Nothing in a table says when, where or how fast it was computed.

use crate::model::{Parameters, Selected, Selection, Symbol};
use crate::observe::{Measurements, Precursor, Recording, Regime, Slip};
use crate::sets::SetRow;
use crate::sweep::Sweep;
use crate::table::arrow::{Gaps, RowBuffer};
use crate::table::columns::{Class, Row as _, columns, whose_end};
use crate::table::tables;
use crate::table::value::words;
use arrow_schema::SchemaRef;
use std::borrow::Cow;

words! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum JobOutcome {
        /// It recorded its last slip: of `slips`, or at `time`.
        Done = "done",
        TimeLimit = "time limit",
        /// It gave up, since no slip came within `give_up_after`.
        NoSlips = "no slips",
        Failed = "failed",
    }
}

impl JobOutcome {
    /// The outcome of a job that did not fail.
    pub fn of(measured: &Measurements) -> Self {
        match measured.summary.satisfied {
            false => Self::TimeLimit,
            true if measured.has_given_up => Self::NoSlips,
            true => Self::Done,
        }
    }
}

columns! {
    /// The names by which results know a job.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Names {
        job_id: String = "", "hash of all that defines the job";
        set_id: String = "", "hash of the same but the seed: common to all realisations";
    }
}

columns! {
    /// What the modulation amounts to.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Loading {
        frequency: Option<f64> = "Hz", "1/T; null without modulation", "1/T" "Modulation frequency", Class::Period;
        eta: f64 = "", "2 pi Delta / (T V0), harmonic against uniform loading rate; 0 without modulation",
            "η" "η = 2πΔ / (T V₀)", Class::Period;
    }
}

impl Loading {
    pub fn of(parameters: &Parameters) -> Self {
        Self {
            frequency: parameters.frequency(),
            eta: parameters.eta(),
        }
    }
}

/// The parameters that label every slip and precursor; the others stand in the jobs table.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveAndSeed;

impl Selection for DriveAndSeed {
    const SYMBOLS: &'static [Symbol] = &[Symbol::V0, Symbol::Delta, Symbol::T, Symbol::Seed];
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct All;

impl Selection for All {
    const SYMBOLS: &'static [Symbol] = &Symbol::ALL;
}

/// What every row says about its job: names, parameters, η.
pub type JobLabel<S> = (Names, Selected<S>, Loading);

words! {
    /// A table that jobs write, that of the jobs last. Its word is also the name of its folder.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum RecordedTable {
        Slips = "slips",
        Precursors = "precursors",
        Jobs = "jobs",
    }
}

words! {
    /// A reduced table that not all directories have.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum OptionalTable {
        Edges = "edges",
        Triggers = "triggers",
        Pulses = "pulses",
    }
}

impl OptionalTable {
    /// What a sweep file has if there is one.
    pub const fn needs(self) -> &'static str {
        match self {
            Self::Edges => "[refine]",
            Self::Triggers | Self::Pulses => "pulse_start",
        }
    }
}

impl RecordedTable {
    const fn is_recorded(self, recording: &Recording) -> bool {
        match self {
            Self::Precursors => recording.precursors,
            Self::Slips | Self::Jobs => true,
        }
    }

    /// Those of a recording.
    pub fn of(recording: &Recording) -> impl DoubleEndedIterator<Item = Self> {
        let all = Self::ALL.into_iter();
        all.filter(|table| table.is_recorded(recording))
    }

    /// The columns, with units and meanings, as a sweep has them.
    pub fn schema(self, sweep: &Sweep) -> SchemaRef {
        let buffer = match self {
            Self::Slips => RowBuffer::new::<SlipRow<'_>>(),
            Self::Precursors => RowBuffer::new::<PrecursorRow<'_>>(),
            Self::Jobs => RowBuffer::new::<JobRow>(),
        };
        SchemaRef::clone(buffer.with(&gaps(sweep)).schema())
    }
}

/// What sets say of drops in N; their intervals have it, too.
const DROPS_IN_NEWTONS: [&str; 2] = ["drop_mean", "drop_sd"];

/// In what the tables of a sweep have not all that their row types describe.
pub fn gaps(sweep: &Sweep) -> Gaps {
    let parameters = sweep.unknown().iter();
    let mut unknown: Vec<_> = parameters.map(|symbol| symbol.key().into()).collect();
    let measured = sweep.measured();
    if let Some(measured) = measured {
        let mut others = [Slip::names(), JobRecord::names()].concat();
        others.retain(|name| !measured.has(name));
        unknown.extend(others);
        if sweep.unknown().contains(&Symbol::Delta) {
            unknown.extend(["eta", "Delta_onset"].map(Cow::from));
        }
        if !measured.pure.is_empty() {
            let columns = SetRow::columns();
            let of_drops = |place: &usize| {
                let column = whose_end(&columns, *place).unwrap_or(&columns[*place]);
                DROPS_IN_NEWTONS.contains(&&*column.name)
            };
            let places = (0..columns.len()).filter(of_drops);
            unknown.extend(places.map(|place| columns[place].name.clone()));
        }
    }
    Gaps {
        left_out: sweep.recording().left_out(),
        unknown,
        pure: measured.map_or_else(Vec::new, |measured| measured.pure.clone()),
    }
}

pub fn label<S>(sweep: &Sweep, parameters: &Parameters) -> JobLabel<S> {
    (
        Names {
            job_id: sweep.job_id(parameters),
            set_id: sweep.set_id(parameters),
        },
        Selected::new(parameters.clone()),
        Loading::of(parameters),
    )
}

/// The same label with other parameters; its ids, which are hashes, are not computed again.
pub fn relabel<S, T>(label: &JobLabel<S>) -> JobLabel<T> {
    let (names, selected, loading) = label;
    (names.clone(), Selected::new(selected.all.clone()), *loading)
}

pub type SlipRow<'a> = (Cow<'a, JobLabel<DriveAndSeed>>, Cow<'a, Slip>);
pub type PrecursorRow<'a> = (Cow<'a, JobLabel<DriveAndSeed>>, Cow<'a, Precursor>);
pub type JobRow = (JobLabel<All>, JobRecord);

tables! {
    SlipRow<'_> = RecordedTable::Slips.word(), "One row per slip past start-up";
    PrecursorRow<'_> = RecordedTable::Precursors.word(), "One row per precursor of a recorded slip; only if the sweep records precursors";
    JobRow = RecordedTable::Jobs.word(), "One row per job";
}

columns! {
    /// What a job measured as a whole, or why it failed.
    #[derive(Clone, Debug, PartialEq)]
    pub struct JobRecord {
        outcome: JobOutcome = "", "`done`; `time limit`: `max_time` came before the end of the last slip; `no slips`: none came within `give_up_after`; or `failed`";
        reason: Option<String> = "", "why it failed; null unless failed";
        slips: Option<u64> = "", "slips recorded; null if failed, as all that follows";
        precursors: Option<u64> = "", "their precursors";
        ruptures: Option<u64> = "", "ruptures of any size, start-up included";
        breaks: Option<u64> = "", "contacts broken";
        reattachments: Option<u64> = "", "contacts reattached";
        averaged_time: Option<f64> = "s", "time that the three averages which follow are over";
        mean_friction: Option<f64> = "N", "time average of the shear force: from the last slip of start-up to the last slip, and over what was slid after it";
        attached_fraction: Option<f64> = "", "time average of the fraction of contacts that are attached, over the same time";
        slip_share: Option<f64> = "", "share of that time within slips, or sliding without one";
        regime: Option<Regime> = "", "`stick-slip`, `mixed` or `sliding`, by that share";
        simulated_time: Option<f64> = "s", "model time reached";
        running_interval: Option<f64> = "s",
            "time since the last onset of a job that gave up: its interval is at least as long; null of others, and without a slip";
        steps: Option<u64> = "", "steps of the solver";
        leaps: Option<u64> = "", "of these, leaps over quiet time";
        grid_steps: Option<u64> = "", "of these, steps of the grid; 0 if motion was resolved in Taylor steps";
    }
}

impl JobRecord {
    /// The record of a job that ended with these measurements, or failed for this reason.
    pub fn new(outcome: Result<&Measurements, &str>) -> Self {
        let measured = outcome.ok();
        let summary = measured.map(|measured| measured.summary);
        let averages = measured.and_then(|measured| measured.averages);
        Self {
            outcome: measured.map_or(JobOutcome::Failed, JobOutcome::of),
            reason: outcome.err().map(str::to_owned),
            slips: measured.map(Measurements::slip_count),
            precursors: measured
                .map(|measured| measured.slips.iter().map(|slip| slip.precursors).sum()),
            ruptures: measured.map(|measured| measured.ruptures),
            breaks: summary.map(|summary| summary.breaks),
            reattachments: summary.map(|summary| summary.reattachments),
            averaged_time: averages.map(|averages| averages.time),
            mean_friction: averages.map(|averages| averages.friction),
            attached_fraction: averages.map(|averages| averages.attached_fraction),
            slip_share: averages.map(|averages| averages.slip_share),
            regime: measured.and_then(Measurements::regime),
            running_interval: measured.and_then(|measured| measured.running_interval),
            simulated_time: summary.map(|summary| summary.end_time),
            steps: summary.map(|summary| summary.steps),
            leaps: summary.map(|summary| summary.leaps),
            grid_steps: summary.map(|summary| summary.grid_steps),
        }
    }
}

columns! {
    #[derive(PartialEq)]
    pub struct JobOfSlip {
        set_id: String = "", "hash of all that defines the job but the seed";
        seed: u64 = "", "seed of the job";
    }
}

columns! {
    /// Any row of a job, in any table.
    pub(super) struct RowOfJob {
        job_id: String;
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::table::columns::Row;
    use std::collections::HashSet;

    pub(crate) fn slip(number: u64) -> Slip {
        Slip {
            number,
            onset: 1.0,
            interval: Some(0.137),
            peak_force: 477.0,
            drop: 100.0,
            nucleation: 1.001,
            nucleation_block: 3,
            duration: 0.005,
            size: 1400,
            front_speed: Some(300.0),
            precursors: 2,
            ..Slip::default()
        }
    }

    #[test]
    fn columns_of_a_table_have_distinct_names() {
        for columns in [
            SlipRow::columns(),
            PrecursorRow::columns(),
            JobRow::columns(),
        ] {
            let names: HashSet<&str> = columns.iter().map(|column| column.name.as_ref()).collect();
            assert_eq!(names.len(), columns.len(), "{columns:?}");
        }
    }
}
