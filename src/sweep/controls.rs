//! Controls: the same jobs without modulation, from which follows what the drive alone explains (`control = true`).
//!
//! They are points of the sweep, after those of its grid: its axes but for those of the modulation, and the conditions
//! that name none of them, as far as a modulated job needs them. A job of the grid is no control, nor is a set that the
//! grid of any sweep in the directory has.

use super::axes::{Axis, AxisColumn};
use super::grid::Sweep;
use super::plan::Plan;
use super::quantity::GridPoint;
use super::rounds::merged;
use crate::model::Parameters;
use std::collections::{BTreeSet, HashSet};
use std::ops::RangeInclusive;

impl Axis {
    /// What is left of it without modulation; `None` if nothing is.
    fn unmodulated(&self) -> Option<Self> {
        let Self::ListedRows(table) = self else {
            return Some(self.clone());
        };
        let columns = table.columns.iter();
        let kept: Vec<&AxisColumn> = columns
            .filter(|column| !column.quantity.is_of_modulation())
            .collect();
        let rows = kept.first()?.values.len();
        let mut seen = HashSet::new();
        let row = |row: usize| {
            kept.iter()
                .map(|column| column.values[row].to_string())
                .collect::<Vec<_>>()
        };
        let rows: Vec<usize> = (0..rows).filter(|&index| seen.insert(row(index))).collect();
        let values = |column: &AxisColumn| rows.iter().map(|&row| column.values[row]).collect();
        let columns = kept.into_iter().map(|column| AxisColumn {
            quantity: column.quantity,
            values: values(column),
        });
        Self::table(columns.collect()).ok()
    }
}

impl Sweep {
    pub(super) fn unmodulated(&self) -> Self {
        let conditions = self.conditions.iter().filter(|condition| {
            let mut names = condition.names().into_iter();
            !names.any(|name| name.is_of_modulation())
        });
        let mut controls = Self {
            base: self.base.without_modulation(),
            axes: self.axes.iter().filter_map(Axis::unmodulated).collect(),
            conditions: conditions.cloned().collect(),
            rounds: None,
            controls: None,
            ..self.clone()
        };
        if controls.conditions.len() < self.conditions.len() {
            controls.needed = Some(self.needed_of(&controls));
        }
        controls
    }

    /// The sets of the sweep of its controls that its modulated jobs need, in order.
    fn needed_of(&self, controls: &Self) -> Vec<u64> {
        let set = |point: GridPoint| {
            (point.is_modulated() && self.admits(&point))
                .then(|| controls.set_with(&point.parameters.without_modulation()))
                .flatten()
        };
        let sets: BTreeSet<u64> = if self.reads_seed() {
            let points = self.admitted(0..self.point_count());
            points.filter_map(|(_, point)| set(point)).collect()
        } else {
            self.points_of_one_seed().filter_map(set).collect()
        };
        sets.into_iter().collect()
    }

    /// These points of the grid, and the controls of their jobs.
    pub fn with_controls(&self, mut points: Vec<u64>) -> Vec<RangeInclusive<u64>> {
        if self.controls.is_some() {
            let control = |&point: &u64| {
                let job = self.point(&self.rows(point)).canonical().parameters;
                self.find(&job.without_modulation())
            };
            let controls: Vec<u64> = points.iter().filter_map(control).collect();
            points.extend(controls);
        }
        merged(points.into_iter().map(|point| point..=point).collect())
    }
}

impl Plan<'_> {
    /// Whether a set was run as a control alone: no grid has ever had it.
    pub fn is_control(self, set: &Parameters) -> bool {
        set.modulation_amplitude == 0.0
            && self
                .sweeps()
                .all(|sweep| sweep.find_set_in_grid(set).is_none())
    }

    /// Id of the set that is the control of a modulated one, if it was measured: `None` if no sweep has asked for
    /// controls.
    pub fn control_of(self, set: &Parameters) -> Option<String> {
        let has_controls = |sweep: &&Sweep| sweep.controls.is_some() || sweep.measured.is_some();
        let sweep = self.sweeps().find(has_controls)?;
        (set.modulation_amplitude > 0.0).then(|| sweep.set_id(&set.without_modulation()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::cost::predicted_cost;
    use super::super::{Extension, Job};
    use super::*;
    use std::path::Path;

    fn sweep(rest: &str) -> Sweep {
        let text = format!("name = \"a\"\n[record]\ncontrol = true\n{rest}");
        Sweep::parse(&text, Path::new("test.toml")).unwrap()
    }

    fn controls(sweep: &Sweep) -> Vec<Job> {
        sweep
            .jobs()
            .filter(|job| job.point >= sweep.point_count())
            .collect()
    }

    #[test]
    fn each_job_has_the_cost_of_its_own_parameters() {
        for axes in [
            "V0 = [1e-5, 1e-4]\nDelta = [0, 1e-6]\nfrequency = [29, 58]\nseed = { count = 3 }",
            "seed = { count = 3 }\nV0 = [1e-5, 1e-4]\nDelta = [1e-6, 2e-6]\nT = [0.02]",
        ] {
            let sweep = sweep(&format!("[axes]\n{axes}\n"));
            assert!(sweep.jobs().count() > 8);
            for job in sweep.jobs() {
                let own = predicted_cost(&job.parameters, &sweep.recording, sweep.solver);
                assert_eq!(job.cost, own, "{}", job.point);
            }
        }
    }

    #[test]
    fn each_combination_of_other_values_has_one_control_for_each_seed() {
        let axes = "[axes]\nV0 = [1e-5, 1e-4]\nDelta = [3e-7, 6e-7]\neta = [0.5, 2, 7]\nseed = { count = 4 }\n";
        let sweep = sweep(axes);
        let jobs = controls(&sweep);
        let extensions = [Extension::new(&sweep, &[])];
        let plan = Plan::new(&extensions);
        assert_eq!(
            (sweep.point_count(), sweep.jobs().count(), jobs.len()),
            (48, 56, 8)
        );
        for job in &jobs {
            assert!(
                job.parameters.modulation_amplitude == 0.0
                    && job.parameters.clone().validated().is_ok()
            );
            assert_eq!(sweep.find(&job.parameters), Some(job.point));
            assert!(plan.is_control(&job.parameters) && sweep.find(&job.parameters).is_some());
        }
        let first = sweep.jobs().next().unwrap().parameters;
        let own = sweep
            .jobs()
            .find(|job| job.parameters == first.without_modulation())
            .unwrap();
        assert_eq!(plan.control_of(&first), Some(sweep.set_id(&own.parameters)));
        assert_eq!(plan.control_of(&own.parameters), None);
    }

    #[test]
    fn what_the_grid_has_is_no_control() {
        let sweep = sweep("[model]\nfrequency = 29\n[axes]\nDelta = [0, 3e-7]\nN = [9, 70]\n");
        assert_eq!((sweep.jobs().count(), controls(&sweep).len()), (4, 0));
    }

    #[test]
    fn conditions_on_the_modulation_drop_no_control_and_others_do() {
        let rest = "[axes]\nzip = [{ Delta = [3e-7, 6e-7, 1e-6], N = [9, 70, 9] }]\nfrequency = [29, 58]\nV0 = [1e-5, 1e-4]\n";
        let text = format!(
            "name = \"a\"\nwhere = [\"eta > 1\", \"V0 < 5e-5\"]\n[record]\ncontrol = true\n{rest}"
        );
        let sweep = Sweep::parse(&text, Path::new("test.toml")).unwrap();
        let of: Vec<_> = controls(&sweep)
            .iter()
            .map(|job| (job.parameters.blocks, job.parameters.drive_velocity))
            .collect();
        assert_eq!(of, [(9, 1e-5), (70, 1e-5)]);
    }

    #[test]
    fn only_controls_that_a_job_needs_are_run() {
        let text = |condition: &str| {
            format!(
                "name = \"a\"\nwhere = \"{condition}\"\n[record]\ncontrol = true\n[axes]\nV0 = [1e-5, 1e-4]\n\
                 Delta = [3e-7, 6e-7]\neta = [0.5, 2]\nseed = {{ first = 3, count = 2 }}\n"
            )
        };
        let velocities = |condition: &str| -> Vec<(f64, u64)> {
            let sweep = Sweep::parse(&text(condition), Path::new("test.toml"));
            controls(&sweep.unwrap())
                .iter()
                .map(|job| (job.parameters.drive_velocity, job.parameters.seed))
                .collect()
        };
        let slow = [(1e-5, 3), (1e-5, 4)];
        let fast = [(1e-4, 3), (1e-4, 4)];
        let all = [slow, fast].concat();
        assert_eq!(velocities("V0 * eta < 1.5e-4"), all);
        assert_eq!(velocities("eta < 1 and V0 < 5e-5"), slow);
        assert_eq!(velocities("eta < V0 * 1e4"), fast);
        assert_eq!(velocities("seed > 3 and V0 * eta > 1e-4"), fast);
    }

    #[test]
    fn a_set_is_a_control_if_no_grid_of_the_directory_had_it_whatever_the_seeds() {
        let axes = |delta: &str, seeds: &str| {
            format!("[model]\nfrequency = 29\n[axes]\nDelta = {delta}\nseed = {seeds}\n")
        };
        let plain = |axes: &str| {
            Sweep::parse(&format!("name = \"a\"\n{axes}"), Path::new("test.toml")).unwrap()
        };
        let modulated = axes("[1e-6]", "{ count = 4 }");
        let later = axes("[1e-6]", "{ first = 4, count = 4 }");
        let set = controls(&sweep(&modulated)).remove(0).parameters;
        assert_eq!(set.seed, 0);
        let is_control = |sweeps: &[Sweep]| {
            let extensions: Vec<Extension> = sweeps
                .iter()
                .map(|sweep| Extension::new(sweep, &[]))
                .collect();
            Plan::new(&extensions).is_control(&set)
        };
        assert!(
            is_control(&[sweep(&modulated), sweep(&later)]),
            "other seeds"
        );
        assert!(
            is_control(&[sweep(&modulated), plain(&modulated)]),
            "no longer asked for"
        );
        let both = plain(&axes("[0, 1e-6]", "{ first = 9, count = 1 }"));
        assert!(!is_control(&[both, sweep(&modulated)]), "a set of a grid");
    }

    #[test]
    fn the_key_changes_no_id_and_rounds_take_the_controls_of_their_points() {
        let axes = "[axes]\nDelta = [3e-7, 6e-7]\nfrequency = [29, 58]\n[precision]\nof = \"tau_mean\"\nrelative = 0.1\n\
                    seeds = { from = 24, to = 48 }\n";
        let with = sweep(axes);
        let without =
            Sweep::parse(&format!("name = \"a\"\n{axes}"), Path::new("test.toml")).unwrap();
        assert!(without.differences(&with).is_empty());
        let ids = |sweep: &Sweep| {
            sweep
                .jobs()
                .map(|job| sweep.job_id(&job.parameters))
                .collect::<Vec<_>>()
        };
        assert_eq!(ids(&with)[..192], ids(&without)[..]);
        let points = |sweep: &Sweep| {
            sweep
                .first_round()
                .unwrap()
                .points
                .into_iter()
                .flatten()
                .count()
        };
        assert_eq!((points(&without), points(&with)), (96, 120));
        let round = with.with_controls(with.points_of_set(0, 4..7).collect());
        let seeds = |point: u64| {
            with.jobs_at(point..point + 1)
                .next()
                .unwrap()
                .parameters
                .seed
        };
        assert_eq!(
            round.into_iter().flatten().map(seeds).collect::<Vec<_>>(),
            [4, 5, 6, 4, 5, 6]
        );
    }
}
