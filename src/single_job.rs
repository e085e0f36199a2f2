//! One job with records on request: the job of a sweep with one point.

use crate::model::theory::typical_interval;
use crate::model::{ContactEvent, Parameters};
use crate::observe::{
    AttachedMap, ContactLog, ContactRow, MapRow, Measurements, Observers, Profile, ProfileRow,
    Recording, SlipObserver, Trace, TraceRow,
};
use crate::solver::{Observer, SimulationError};
use crate::sweep::{Job, KeyChange, Sweep};
use crate::table::tables;
use std::sync::atomic::AtomicBool;

// The tables that one simulation writes on request.
tables! {
    TraceRow = "trace", "One row per sample of a simulation";
    MapRow = "map", "One row per sample and block";
    ProfileRow = "profile", "One row per block, at the end of a simulation";
    ContactRow = "contacts", "One row per contact event, in order; with the initial attachment";
}

/// More samples than this, of 24 bytes each, are a mistake.
const MAX_SAMPLES: f64 = 1e8;

/// A request for other than one job, or for too many records.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RequestError {
    #[error(
        "sweep {name}: has {jobs} jobs, and one can be simulated; give each axis one value, or use `stickslip run`"
    )]
    NotOneJob { name: String, jobs: usize },
    #[error("sample {0}: must be a finite number > 0, in s")]
    BadSample(f64),
    #[error(
        "sample {sample}: more than {MAX_SAMPLES:e} samples in about {time:.3} s; take a longer one"
    )]
    TooManySamples { sample: f64, time: f64 },
}

/// The text of a sweep with one point. Without a number of slips it records 20, or with a time all slips until then.
pub fn sweep_text(changes: &[KeyChange]) -> String {
    let is_given = |key: &str| changes.iter().any(|change| change.key == key);
    let slips = if is_given("slips") || is_given("time") {
        ""
    } else if is_given("max_time") {
        // With a time alone, slips do not end the job.
        "slips = 10000000\n"
    } else {
        "slips = 20\n"
    };
    let of = |section: &str| {
        let own = changes.iter().filter(|change| change.section == section);
        own.flat_map(|KeyChange { key, value, .. }| [key, " = ", value, "\n"])
            .collect::<String>()
    };
    let [model, record, solver] = ["model", "record", "solver"].map(of);
    format!("name = \"simulate\"\n[model]\n{model}[record]\n{slips}{record}[solver]\n{solver}")
}

pub fn only_job(sweep: &Sweep) -> Result<Job, RequestError> {
    let mut jobs = sweep.jobs_of_grid();
    match (jobs.next(), jobs.count()) {
        (Some(job), 0) => Ok(job),
        (_, others) => Err(RequestError::NotOneJob {
            name: sweep.name().to_owned(),
            jobs: others + 1,
        }),
    }
}

/// What to record beside slips.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "one for each table that may be recorded"
)]
pub struct RecordRequest {
    /// Time between samples of trace and map, in s.
    pub sample: f64,
    /// Shear force, displacement and attached fraction over time.
    pub trace: bool,
    /// Attached fraction of every block over time.
    pub map: bool,
    /// Displacement of every block at the end.
    pub profile: bool,
    pub contacts: bool,
}

impl RecordRequest {
    /// Makes sure that what is recorded fits into memory.
    pub fn check(
        &self,
        parameters: &Parameters,
        recording: &Recording,
    ) -> Result<(), RequestError> {
        let sample = self.sample;
        if !(sample > 0.0 && sample.is_finite()) {
            return Err(RequestError::BadSample(sample));
        }
        let cells = if self.map {
            parameters.blocks
        } else {
            usize::from(self.trace)
        };
        let time = recording.expected_time(typical_interval(parameters));
        if time / sample * cells as f64 > MAX_SAMPLES {
            return Err(RequestError::TooManySamples { sample, time });
        }
        Ok(())
    }
}

/// Records beside slips; empty unless requested.
#[derive(Clone, Debug, Default)]
pub struct JobRecords {
    pub trace: Vec<TraceRow>,
    /// Cells of the map, instant by instant.
    pub map: Vec<MapRow>,
    pub profile: Vec<ProfileRow>,
    pub contacts: Vec<ContactEvent>,
}

/// Simulates a job, with records on request. The slips are those of a run of the sweep, to the bit.
pub fn simulate(
    sweep: &Sweep,
    parameters: &Parameters,
    request: RecordRequest,
    interrupt: &AtomicBool,
) -> Result<(Measurements, JobRecords), SimulationError> {
    let recording = sweep.recording();
    let mut slips = SlipObserver::new(parameters, recording);
    let mut trace = Trace::new(parameters, request.sample);
    let mut map = AttachedMap::new(parameters, request.sample);
    let mut profile = Profile::new(parameters);
    let mut log = ContactLog::default();
    let mut observers: Vec<&mut dyn Observer> = vec![&mut slips];
    let others: [(bool, &mut dyn Observer); 4] = [
        (request.trace, &mut trace),
        (request.map, &mut map),
        (request.profile, &mut profile),
        (request.contacts, &mut log),
    ];
    let requested = others.into_iter().filter(|(wanted, _)| *wanted);
    observers.extend(requested.map(|(_, observer)| observer));
    let solver = sweep.solver();
    let observer = &mut Observers(observers);
    let summary = recording.simulate(parameters, solver, interrupt, observer)?;
    let records = JobRecords {
        trace: trace.rows,
        map: map.rows,
        profile: profile.rows,
        contacts: log.events,
    };
    Ok((slips.into_measurements(summary), records))
}
