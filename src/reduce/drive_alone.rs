//! What the drive alone explains: slips at the very loads of an unmodulated slider, under the modulation.
//!
//! The control of a job has its parameters and seed, and no modulation. Its onset at t comes when the driven end has moved
//! V0 t; under the modulation it first gets there at the [first passage](Drive::first_passage), through start-up as in the run.
//! Phases and intervals of these passages go through the estimators of the slips. What is seen beyond them is the slider's:
//! the excess, whose interval takes in both errors by those of the two (MOVER: G. Zou and A. Donner, Stat. Med. 27, 1693
//! (2008)).

use super::circular::unit;
use super::sequence::{Estimate, Sequences};
use super::set::Cycles;
use crate::model::{Drive, Parameters};
use crate::observe::phase;
use crate::results::ResultsError;
use crate::results::tables::JobOfSlip;
use crate::sweep::{Plan, SetRow};
use crate::table::columns::{Interval, columns};
use crate::table::file::Dataset;
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
    /// Those of these sets, from the table of slips.
    pub(super) fn read<'a>(
        slips: Dataset<'_>,
        plan: Plan<'_>,
        sets: impl Iterator<Item = &'a Parameters>,
    ) -> Result<Self, ResultsError> {
        let mut controls: HashMap<String, BTreeMap<u64, Vec<Onset>>> = sets
            .filter_map(|set| Some((plan.control_of(set)?, BTreeMap::new())))
            .collect();
        if controls.is_empty() {
            return Ok(Self::default());
        }
        for batch in slips.rows::<(JobOfSlip, Onset)>() {
            for (job, onset) in batch? {
                if let Some(set) = controls.get_mut(&job.set_id) {
                    set.entry(job.seed).or_default().push(onset);
                }
            }
        }
        Ok(Self(controls))
    }

    /// What the drive alone explains of a set with these parameters.
    pub(super) fn explain(&self, plan: Plan<'_>, parameters: &Parameters) -> Explained {
        let control = plan
            .control_of(parameters)
            .and_then(|control| self.0.get(&control));
        let passage = |(&seed, slips): (&u64, &Vec<Onset>)| (seed, Passage::of(parameters, slips));
        let passages = control.map(|control| control.iter().map(passage).collect());
        Explained {
            is_control: plan.is_control(parameters),
            passages,
        }
    }
}

/// What the drive alone explains of a set: the passages by their seeds; none without a control.
#[derive(Debug, Default)]
pub(super) struct Explained {
    is_control: bool,
    passages: Option<BTreeMap<u64, Passage>>,
}

impl Explained {
    /// Adds to a set what is explained of its jobs with these seeds, which are in order.
    pub(super) fn add_to(&self, row: &mut SetRow, seeds: &[u64], cycles: Option<Cycles>) {
        row.is_control = self.is_control;
        let Some(passages) = &self.passages else {
            return;
        };
        let passages: Vec<&Passage> = passages
            .iter()
            .filter(|(seed, _)| seeds.binary_search(seed).is_ok())
            .map(|(_, passage)| passage)
            .collect();
        let of_jobs: Vec<&[(f64, [f64; 2])]> = passages.iter().map(|job| &*job.phases).collect();
        let of_jobs = match cycles {
            None => of_jobs,
            Some(cycles) => cycles.within(&of_jobs, |(time, _)| *time),
        };
        let phases =
            Sequences::of(of_jobs.iter().map(|job| job.iter().map(|(_, unit)| *unit))).estimate();
        let intervals =
            Sequences::of(passages.iter().map(|job| job.periods.iter().copied())).estimate();
        let seen = (row.resultant_length, row.length_interval);
        (
            row.resultant_drive,
            row.resultant_excess,
            row.resultant_excess_interval,
        ) = beyond(seen, &phases);
        if row.periods == Some(0) {
            return;
        }
        let seen = (row.locking_index, row.locking_interval);
        (
            row.locking_index_drive,
            row.locking_index_excess,
            row.locking_excess_interval,
        ) = beyond(seen, &intervals);
    }
}

/// The resultant length by the drive alone, the excess of what is seen, and its interval.
fn beyond(
    (seen, interval): (Option<f64>, Option<Interval>),
    drive: &Estimate<2>,
) -> (Option<f64>, Option<f64>, Option<Interval>) {
    let Some(alone) = drive.resultant_length() else {
        return (None, None, None);
    };
    let excess = seen.map(|seen| seen - alone);
    let ends = || {
        let (seen, own, of_drive) = (seen?, interval?, drive.length_interval()?);
        Some(Interval {
            low: excess? - libm::hypot(seen - own.low, of_drive.high - alone),
            high: excess? + libm::hypot(own.high - seen, alone - of_drive.low),
        })
    };
    (Some(alone), excess, ends())
}

/// The passages of a job: their times in s and the unit vectors of their phases, and those of their intervals in periods as
/// angles.
#[derive(Debug)]
struct Passage {
    phases: Vec<(f64, [f64; 2])>,
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
        let mut last = slips
            .first()
            .and_then(|slip| Some(passage(slip.onset - slip.interval?).0));
        for slip in slips {
            let (time, cycle) = passage(slip.onset);
            let phase = phase(time - cycle.cycle_start, cycle.period, cycle.eta);
            phases.push((time, unit(phase)));
            periods.extend(last.map(|last| unit(TAU * ((time - last) / cycle.period).fract())));
            last = Some(time);
        }
        Self { phases, periods }
    }
}

#[cfg(test)]
mod tests {
    use super::super::confidence::tests::Draws;
    use super::*;
    use crate::model::selected::Selected;
    use crate::model::theory::random_load_mean;
    use crate::sweep::{Extension, Sweep};
    use std::path::Path;

    const FREQUENCY: f64 = 29.0;

    /// What is found of a set with this amplitude, of which the control has these onsets; nothing is seen of it but `row`.
    fn explained(amplitude: f64, onsets: &[Vec<f64>], seeds: &[u64], row: SetRow) -> SetRow {
        let text = format!(
            "name = \"a\"\n[model]\nDelta = {amplitude:?}\nfrequency = {FREQUENCY:?}\n[axes]\nseed = {{ count = 9 }}\n\
             [record]\ncontrol = true\n"
        );
        let sweep = Sweep::parse(&text, Path::new("test.toml")).unwrap();
        let parameters = sweep.jobs().next().unwrap().parameters;
        let slips = |onsets: &Vec<f64>| {
            let lasts = std::iter::once(None).chain(onsets.iter().map(Some));
            let slip = |(onset, last): (&f64, Option<&f64>)| Onset {
                onset: *onset,
                interval: last.map(|last| onset - last),
            };
            onsets.iter().zip(lasts).map(slip).collect::<Vec<_>>()
        };
        let control = (0..).zip(onsets.iter().map(slips)).collect();
        let extensions = [Extension::new(&sweep, &[])];
        let plan = Plan::new(&extensions);
        let controls = Controls(HashMap::from([(
            plan.control_of(&parameters).unwrap(),
            control,
        )]));
        let explained = controls.explain(plan, &parameters);
        let mut row = SetRow {
            parameters: Selected::new(parameters),
            ..row
        };
        explained.add_to(&mut row, seeds, None);
        row
    }

    #[test]
    fn random_loads_give_the_resultant_of_the_closed_form() {
        let mut draws = Draws::new(7);
        let onsets = vec![
            (0..20_000)
                .map(|number| f64::from(number) + draws.uniform())
                .collect::<Vec<_>>(),
        ];
        for eta in [0.5, 1.2, 5.0] {
            let amplitude = eta * 1e-4 / (TAU * FREQUENCY);
            let [real, imaginary] = random_load_mean(eta);
            let found = explained(amplitude, &onsets, &[0], SetRow::default())
                .resultant_drive
                .unwrap();
            // A standard error is 0.005 at most.
            assert!(
                (found - real.hypot(imaginary)).abs() < 0.02,
                "{eta}: {found}"
            );
        }
    }

    #[test]
    fn onsets_of_common_seeds_whole_periods_apart_have_passages_at_one_phase_whatever_the_others() {
        let apart = |step: f64| {
            (1..40)
                .map(|number| 0.01 + step * f64::from(number))
                .collect::<Vec<f64>>()
        };
        let (whole, free) = (apart(3.0 / FREQUENCY), apart(0.1234));
        let of = |seeds: &[u64]| {
            explained(
                1e-6,
                &[whole.clone(), free.clone()],
                seeds,
                SetRow::default(),
            )
        };
        let row = of(&[0, 5]);
        for length in [row.resultant_drive, row.locking_index_drive] {
            assert!((length.unwrap() - 1.0).abs() < 1e-9, "{length:?}");
        }
        assert!(of(&[0, 1]).resultant_drive.unwrap() < 0.99);
        let none = of(&[5]);
        assert_eq!(
            (none.resultant_drive, none.locking_index_excess),
            (None, None)
        );
    }

    #[test]
    fn the_interval_of_an_excess_takes_in_both_errors() {
        let mut draws = Draws::new(3);
        let mut job = || {
            (0..30)
                .map(|number| 0.11 * f64::from(number) + 0.05 * draws.uniform())
                .collect::<Vec<_>>()
        };
        let onsets: Vec<Vec<f64>> = (0..9).map(|_| job()).collect();
        let of = |half: f64| {
            let interval = Some(Interval {
                low: 0.9 - half,
                high: 0.9 + half,
            });
            let seen = SetRow {
                resultant_length: Some(0.9),
                length_interval: interval,
                ..SetRow::default()
            };
            explained(1e-6, &onsets, &[0, 1, 2, 3, 4, 5, 6, 7, 8], seen)
        };
        let row = of(0.05);
        let (excess, wide, narrow) = (
            row.resultant_excess.unwrap(),
            row.resultant_excess_interval,
            of(0.0),
        );
        assert!((excess - (0.9 - row.resultant_drive.unwrap())).abs() < 1e-15);
        let halves = |interval: Option<Interval>| {
            interval
                .map(|Interval { low, high }| [excess - low, high - excess])
                .unwrap()
        };
        for (wide, alone) in halves(wide)
            .into_iter()
            .zip(halves(narrow.resultant_excess_interval))
        {
            assert!(
                alone > 0.0 && (wide - alone.hypot(0.05)).abs() < 1e-12,
                "{wide} {alone}"
            );
        }
        assert_eq!(
            (row.locking_index_excess, row.locking_excess_interval),
            (None, None),
            "none is seen"
        );
    }
}
