//! What the drive alone explains: slips at the very loads of an unmodulated slider, under the modulation.
//!
//! The control of a job has its parameters and seed, and no modulation. Its onset at t comes when the driven end has moved
//! V0 t; under the modulation it first gets there at the [first passage](Drive::first_passage), through start-up as in the run.
//! Phases and intervals of these passages go through the estimators of the slips. What is seen beyond them is the slider's:
//! the excess, whose interval takes in both errors by those of the two (MOVER: G. Zou and A. Donner, Stat. Med. 27, 1693
//! (2008)).

use super::circular::unit;
use super::sequence::{Estimate, Sequences};
use crate::model::{Drive, Parameters};
use crate::observe::phase;
use crate::results::layout::Layout;
use crate::results::parts::committed_files;
use crate::results::tables::{JOBS, JobOfSlip, SLIPS};
use crate::sweep::{Interval, SetRow, Sweep};
use crate::table::columns::columns;
use crate::table::file::DatasetError;
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::TAU;

columns! {
    /// What is taken of a slip of a control.
    #[derive(Clone, Copy, Debug)]
    struct Onset {
        onset: f64;
        interval: Option<f64>;
    }
}

/// The slips of the controls of a directory, by the ids of their sets and by seeds; none without `control = true`.
#[derive(Debug, Default)]
pub(super) struct Controls(HashMap<String, BTreeMap<u64, Vec<Onset>>>);

impl Controls {
    /// Reads those of these jobs.
    pub(super) fn read<'a>(
        layout: &Layout<'_>,
        sweep: &Sweep,
        jobs: impl Iterator<Item = &'a Parameters>,
    ) -> Result<Self, DatasetError> {
        let mut controls: HashMap<String, BTreeMap<u64, Vec<Onset>>> =
            jobs.filter_map(|job| Some((sweep.control_of(job)?, BTreeMap::new()))).collect();
        if controls.is_empty() {
            return Ok(Self::default());
        }
        for batch in committed_files(layout, SLIPS, &layout.dataset(JOBS)?)?.rows::<(JobOfSlip, Onset)>() {
            for (job, onset) in batch? {
                if let Some(set) = controls.get_mut(&job.set_id) {
                    set.entry(job.seed).or_default().push(onset);
                }
            }
        }
        Ok(Self(controls))
    }

    /// Adds to a set what the drive alone explains of its jobs with these seeds, which are in order.
    pub(super) fn explain(&self, sweep: &Sweep, row: &mut SetRow, seeds: &[u64]) {
        let parameters = &row.parameters.parameters;
        row.is_control = sweep.is_control(parameters);
        let control = sweep.control_of(parameters).and_then(|control| self.0.get(&control));
        let Some(control) = control else { return };
        let passages: Vec<Passage> = control
            .iter()
            .filter(|(seed, _)| seeds.binary_search(seed).is_ok())
            .map(|(_, slips)| Passage::of(parameters, slips))
            .collect();
        let phases = Sequences::of(passages.iter().map(|job| job.phases.iter().copied())).estimate();
        let intervals = Sequences::of(passages.iter().map(|job| job.periods.iter().copied())).estimate();
        let seen = (row.resultant_length, row.length_interval);
        (row.resultant_drive, row.resultant_excess, row.resultant_excess_interval) = beyond(seen, &phases);
        let seen = (row.locking_index, row.locking_interval);
        (row.locking_index_drive, row.locking_index_excess, row.locking_excess_interval) = beyond(seen, &intervals);
    }
}

/// The resultant length by the drive alone, the excess of what is seen, and its interval.
fn beyond(
    (seen, interval): (Option<f64>, Option<Interval>),
    drive: &Estimate<2>,
) -> (Option<f64>, Option<f64>, Option<Interval>) {
    let Some(alone) = drive.resultant_length() else { return (None, None, None) };
    let excess = seen.map(|seen| seen - alone);
    let ends = || {
        let (seen, own, of_drive) = (seen?, interval?, drive.length_interval()?);
        let half = |own: f64, of_drive: f64| libm::hypot(own, of_drive);
        let low = excess? - half(seen - own.low, of_drive.high - alone);
        let high = excess? + half(own.high - seen, alone - of_drive.low);
        Some(Interval { low, high })
    };
    (Some(alone), excess, ends())
}

/// The passages of a job: the unit vectors of their phases, and of their intervals in periods as angles.
struct Passage {
    phases: Vec<[f64; 2]>,
    periods: Vec<[f64; 2]>,
}

impl Passage {
    /// Of the slips of a job without modulation, in order, under that of these parameters.
    fn of(parameters: &Parameters, slips: &[Onset]) -> Self {
        let mut drive = Drive::new(parameters);
        let mut passage = |time: f64| {
            drive.advance_to(time);
            (drive.first_passage(time), drive)
        };
        let (mut phases, mut periods) = (Vec::new(), Vec::new());
        let mut last = slips.first().and_then(|slip| Some(passage(slip.onset - slip.interval?).0));
        for slip in slips {
            let (time, cycle) = passage(slip.onset);
            phases.push(unit(phase(time - cycle.cycle_start, cycle.period, cycle.eta())));
            periods.extend(last.map(|last| unit(TAU * ((time - last) / cycle.period).fract())));
            last = Some(time);
        }
        Self { phases, periods }
    }
}
