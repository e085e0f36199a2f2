//! What the drive alone explains: slips at the loads of an unmodulated slider, under the modulation.
//!
//! The control of a job has its parameters and seed, and no modulation. Its onset at t comes when the driven end has
//! moved V0 t; under the modulation it first gets there at the [first passage](Drive::first_passage), through start-up
//! as in the run. Phases and intervals of these passages go through the estimators of the slips. What is seen beyond
//! them is due to the slider: the excess, of pairs of a job and its control.

use super::estimate::{Estimate, Sums, Units, length, unit};
use super::set::{ANY, FinishedSet, SHARE};
use crate::model::{Drive, Parameters};
use crate::observe::phase;
use crate::results::ResultsError;
use crate::results::tables::JobOfSlip;
use crate::sweep::Plan;
use crate::table::columns::columns;
use crate::table::file::Dataset;
use std::collections::{BTreeMap, HashMap};
use std::f64::consts::TAU;

columns! {
    /// When a slip begins, and when its contacts begin to break and for how long.
    #[derive(Clone, Copy, Debug)]
    pub(super) struct Times {
        onset: f64;
        interval: Option<f64>;
        nucleation: f64;
        duration: f64;
    }
}

/// The slips of the controls of a directory, by the ids of their sets and by seeds; empty without `control = true`.
#[derive(Debug, Default)]
pub(super) struct Controls(HashMap<String, BTreeMap<u64, Vec<Times>>>);

impl Controls {
    pub(super) fn read<'a>(
        slips: Dataset<'_>,
        plan: Plan<'_>,
        sets: impl Iterator<Item = &'a Parameters>,
    ) -> Result<Self, ResultsError> {
        let mut controls: HashMap<String, BTreeMap<u64, Vec<Times>>> = sets
            .filter_map(|set| Some((plan.control_of(set)?, BTreeMap::new())))
            .collect();
        if controls.is_empty() {
            return Ok(Self::default());
        }
        for row in slips.rows::<(JobOfSlip, Times)>() {
            let (job, onset) = row?;
            if let Some(set) = controls.get_mut(&job.set_id) {
                set.entry(job.seed).or_default().push(onset);
            }
        }
        Ok(Self(controls))
    }

    /// What the drive alone explains of a set with these parameters.
    pub(super) fn explain(&self, plan: Plan<'_>, parameters: &Parameters) -> Explained {
        let mut explained = Explained {
            is_control: plan.is_control(parameters),
            ..Explained::default()
        };
        let control = plan.control_of(parameters);
        let Some(control) = control.and_then(|control| self.0.get(&control)) else {
            return explained;
        };
        let intervals = control.values().flatten().filter_map(|slip| slip.interval);
        let count = intervals.clone().count();
        explained.tau_control = (count > 0).then(|| intervals.sum::<f64>() / count as f64);
        if parameters.pulse_start.is_some() {
            explained.control.clone_from(control);
        } else {
            let passage =
                |(&seed, slips): (&u64, &Vec<Times>)| (seed, Passage::of(parameters, slips));
            explained.passages = Some(control.iter().map(passage).collect());
        }
        explained
    }
}

#[derive(Debug, Default)]
pub(super) struct Explained {
    is_control: bool,
    /// Mean interval of the control, in s.
    pub(super) tau_control: Option<f64>,
    /// By their seeds; `None` without a control, or if the modulation is a pulse.
    passages: Option<BTreeMap<u64, Passage>>,
    /// The slips of the control of a pulse, by their seeds.
    pub(super) control: BTreeMap<u64, Vec<Times>>,
}

impl Explained {
    pub(super) fn add_to(&self, set: &mut FinishedSet) {
        set.row.is_control = self.is_control;
        set.row.tau_control = self.tau_control;
        let Some(passages) = &self.passages else {
            return;
        };
        let by_seed = passages.iter();
        let jobs = by_seed.map(|(&seed, job)| (seed, &*job.phases)).collect();
        let jobs = match set.cycles {
            None => jobs,
            Some(cycles) => cycles.within(jobs, |(time, _)| *time),
        };
        let vectors = |job: &[(f64, Sums)]| job.iter().map(|(_, vector)| *vector).collect();
        let phases = Units::of(jobs.into_iter().map(|(seed, job)| (seed, vectors(job))));
        let seen = set.length_of_phases(&set.phases.common(&phases));
        let alone = phases.common(&set.phases).estimate(length);
        let excess = less(seen.as_ref(), alone.as_ref());
        (set.row.resultant_drive, _) = set.note("resultant_drive", alone, SHARE);
        (set.row.resultant_excess, set.row.resultant_excess_interval) =
            set.note("resultant_excess", excess, ANY);
        if set.row.periods == Some(0) {
            return;
        }
        let jobs = passages.iter();
        let periods = Units::of(jobs.map(|(&seed, job)| (seed, job.periods.clone())));
        let seen = set.length_of_intervals(&set.locking.common(&periods));
        let alone = periods.common(&set.locking).estimate(length);
        let excess = less(seen.as_ref(), alone.as_ref());
        (set.row.locking_index_drive, _) = set.note("locking_index_drive", alone, SHARE);
        (
            set.row.locking_index_excess,
            set.row.locking_excess_interval,
        ) = set.note("locking_index_excess", excess, ANY);
    }
}

fn less(seen: Option<&Estimate>, alone: Option<&Estimate>) -> Option<Estimate> {
    Some(Estimate::function([seen?, alone?], |[seen, alone]| {
        seen - alone
    }))
}

/// The passages of a job: their times in s and the unit vectors of their phases, and those of their intervals in
/// periods as angles.
#[derive(Debug)]
struct Passage {
    phases: Vec<(f64, Sums)>,
    periods: Vec<Sums>,
}

impl Passage {
    /// Of the slips of a job without modulation, in order, under that of these parameters.
    fn of(parameters: &Parameters, slips: &[Times]) -> Self {
        let mut drive = Drive::new(parameters);
        let mut passage = |time: f64| {
            drive.advance_to(time);
            (drive.first_passage(time), drive)
        };
        let mut phases = Vec::new();
        let mut periods = Vec::new();
        let before = slips
            .first()
            .and_then(|slip| Some(slip.onset - slip.interval?));
        let mut last = before.map(|onset| passage(onset).0);
        for slip in slips {
            let (time, cycle) = passage(slip.onset);
            let vector = unit(phase(time - cycle.cycle_start, cycle.period, cycle.eta));
            phases.push((time, vector));
            periods.extend(last.map(|last| unit(TAU * ((time - last) / cycle.period).fract())));
            last = Some(time);
        }
        Self { phases, periods }
    }
}

#[cfg(test)]
mod tests {
    use super::super::estimate::tests::Draws;
    use super::*;
    use crate::model::Selected;
    use crate::sets::SetRow;
    use crate::sweep::{Extension, Sweep};
    use std::path::Path;

    const FREQUENCY: f64 = 29.0;

    /// What is found of a set with this amplitude, of which the control has these onsets, and of whose jobs with these
    /// seeds the phases and intervals are `seen`.
    fn explained(amplitude: f64, onsets: &[Vec<f64>], seeds: &[u64], seen: &[Vec<Sums>]) -> SetRow {
        let text = format!(
            "name = \"a\"\n[model]\nDelta = {amplitude:?}\nfrequency = {FREQUENCY:?}\n[axes]\nseed = {{ count = 9 }}\n\
             [record]\ncontrol = true\n"
        );
        let sweep = Sweep::parse(&text, Path::new("test.toml")).unwrap();
        let parameters = sweep.jobs().next().unwrap().parameters;
        let slips = |onsets: &Vec<f64>| {
            let lasts = std::iter::once(None).chain(onsets.iter().map(Some));
            let slip = |(onset, last): (&f64, Option<&f64>)| Times {
                onset: *onset,
                interval: last.map(|last| onset - last),
                nucleation: *onset,
                duration: 0.0,
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
        let vectors = || Units::of(seeds.iter().copied().zip(seen.iter().cloned()));
        let mut set = FinishedSet {
            row: SetRow {
                eta: parameters.eta(),
                parameters: Selected::new(parameters),
                ..SetRow::default()
            },
            phases: vectors(),
            locking: vectors(),
            ..FinishedSet::default()
        };
        explained.add_to(&mut set);
        set.row
    }

    /// Vectors of jobs that none of the tests below looks at.
    fn unseen(seeds: &[u64]) -> Vec<Vec<Sums>> {
        vec![vec![[1.0, 1.0, 0.0]; 3]; seeds.len()]
    }

    #[test]
    fn random_loads_give_the_resultant_of_the_closed_form() {
        let mut draws = Draws::new(7);
        let onsets = vec![
            (0..20_000)
                .map(|number| f64::from(number) + draws.uniform())
                .collect::<Vec<_>>(),
        ];
        // The density of φ is 1 - η sin φ, for η > 1 from φ_min to Φ_max.
        for (eta, length) in [(0.5, 0.25), (1.2, 0.590), (5.0, 0.920)] {
            let amplitude = eta * 1e-4 / (TAU * FREQUENCY);
            let found = explained(amplitude, &onsets, &[0], &unseen(&[0]))
                .resultant_drive
                .unwrap();
            // A standard error is 0.005 at most.
            assert!((found - length).abs() < 0.02, "{eta}: {found}");
        }
    }

    #[test]
    fn onsets_of_common_seeds_whole_periods_apart_have_passages_at_one_phase_whatever_the_others() {
        let apart = |step: f64| {
            (1..40)
                .map(|number| 0.01 + step * f64::from(number))
                .collect::<Vec<f64>>()
        };
        let whole = apart(3.0 / FREQUENCY);
        let free = apart(0.1234);
        let of =
            |seeds: &[u64]| explained(1e-6, &[whole.clone(), free.clone()], seeds, &unseen(seeds));
        let row = of(&[0, 5]);
        for length in [row.resultant_drive, row.locking_index_drive] {
            assert!((length.unwrap() - 1.0).abs() < 1e-9, "{length:?}");
        }
        assert!(of(&[0, 1]).resultant_drive.unwrap() < 0.99);
    }

    #[test]
    fn without_common_seeds_the_excess_is_that_of_independent_jobs() {
        let mut draws = Draws::new(5);
        let mut job = || vec![unit(0.2 * draws.normal()), unit(0.2 * draws.normal())];
        let seen: Vec<_> = (0..9).map(|_| job()).collect();
        let seeds: Vec<u64> = (20..29).collect();
        let onsets = [vec![0.1, 0.25, 0.37, 0.52], vec![0.13, 0.24, 0.41, 0.5]];
        let row = explained(1e-6, &onsets, &seeds, &seen);
        let vectors = Units::of(seeds.iter().copied().zip(seen));
        let own = vectors.estimate(length).unwrap();
        let excess = row.resultant_excess.unwrap();
        assert!((excess - (own.value - row.resultant_drive.unwrap())).abs() < 1e-15);
        let interval = row.resultant_excess_interval.unwrap();
        assert!(excess - interval.low > own.half_width().unwrap());
    }

    #[test]
    fn what_is_seen_of_pairs_as_the_drive_gives_it_has_no_excess_and_no_error_but_of_slips_not_seen()
     {
        let mut draws = Draws::new(3);
        let mut job = || {
            (1..30)
                .map(|number| 0.11 * f64::from(number) + 0.05 * draws.uniform())
                .collect::<Vec<_>>()
        };
        let onsets: Vec<Vec<f64>> = (0..9).map(|_| job()).collect();
        let seeds: Vec<u64> = (0..9).collect();
        let parameters = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(1.0 / FREQUENCY),
            ..Parameters::default()
        };
        let slip = |onset: &f64| Times {
            onset: *onset,
            interval: None,
            nucleation: *onset,
            duration: 0.0,
        };
        let passages = onsets.iter().map(|onsets| {
            let slips: Vec<Times> = onsets.iter().map(slip).collect();
            Passage::of(&parameters.clone().validated().unwrap(), &slips)
                .phases
                .into_iter()
                .map(|(_, vector)| vector)
                .collect()
        });
        let row = explained(1e-6, &onsets, &seeds, &passages.collect::<Vec<_>>());
        assert_eq!(row.resultant_excess, Some(0.0));
        // But for slips that were not seen: 3 of 261, each of which takes 0.75 at most.
        let high = row.resultant_excess_interval.unwrap().high;
        assert!(high > 0.0 && high < 3.0 * 0.75 / 261.0, "{high}");
    }

    /// Seen and drive share most of what varies from seed to seed.
    #[test]
    fn intervals_of_excesses_of_pairs_cover() {
        const REPETITIONS: u64 = 1000;
        let holds = |repetition: u64, pairs: u64| {
            let mut draws = Draws::new(repetition);
            let mut seen = Vec::new();
            let mut alone = Vec::new();
            for _ in 0..pairs {
                let common = 0.3 * draws.normal();
                let mut job = |spread: f64| {
                    (0..15)
                        .map(|_| unit(common + spread * draws.normal()))
                        .collect::<Vec<_>>()
                };
                seen.push(job(0.3));
                alone.push(job(0.6));
            }
            let [seen, alone] = [seen, alone].map(|jobs| Units::of((0..).zip(jobs)));
            let [seen, alone] = [seen, alone].map(|units| units.estimate(length));
            let found = less(seen.as_ref(), alone.as_ref()).unwrap();
            let length_of = |spread: f64| libm::exp(-0.5 * (0.09 + spread * spread));
            let excess = length_of(0.3) - length_of(0.6);
            (found.value - excess).abs() <= found.half_width().unwrap()
        };
        for pairs in [2, 8, 30] {
            let held = (0..REPETITIONS).filter(|&repetition| holds(repetition, pairs));
            let share = 100.0 * held.count() as f64 / REPETITIONS as f64;
            assert!((91.0..98.5).contains(&share), "{pairs}: {share}");
        }
    }
}
