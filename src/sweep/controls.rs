//! Controls: the same jobs without modulation, from which follows what the drive alone explains (`control = true`).
//!
//! They are points of the sweep, after those of its grid: its axes but for those of the modulation, and the conditions that
//! name none of them. What is a job of the grid anyway is no control.

use super::axes::{Axis, Column};
use super::grid::Sweep;
use super::quantity::Quantity;
use super::rounds::merged;
use crate::model::{Parameters, Symbol};
use std::collections::HashSet;
use std::ops::RangeInclusive;

impl Quantity {
    /// Whether it means nothing without modulation, or is the amplitude.
    pub(super) fn is_of_modulation(self) -> bool {
        use Symbol::{Delta, DeltaTo, RampTime, TTo};
        self.is_period() || matches!(self, Self::Parameter(Delta | DeltaTo | TTo | RampTime))
    }
}

impl Axis {
    /// What is left of it without modulation; `None` if nothing is.
    fn unmodulated(&self) -> Option<Self> {
        let Self::Table(table) = self else {
            return Some(self.clone());
        };
        let kept = table
            .columns
            .iter()
            .filter(|column| !column.quantity.is_of_modulation());
        let kept: Vec<&Column> = kept.collect();
        let rows = kept.first()?.values.len();
        let mut seen = HashSet::new();
        let row = |row: usize| {
            kept.iter()
                .map(|column| column.values[row].to_string())
                .collect::<Vec<_>>()
        };
        let rows: Vec<usize> = (0..rows).filter(|&index| seen.insert(row(index))).collect();
        let values = |column: &Column| rows.iter().map(|&row| column.values[row]).collect();
        let columns = kept.into_iter().map(|column| Column {
            quantity: column.quantity,
            values: values(column),
        });
        Self::table(columns.collect()).ok()
    }
}

impl Sweep {
    /// The sweep of its controls.
    pub(super) fn unmodulated(&self) -> Self {
        let conditions = self.conditions.iter();
        let conditions = conditions.filter(|condition| {
            !condition
                .names()
                .into_iter()
                .any(|name| name.is_of_modulation())
        });
        Self {
            base: self.base.without_modulation(),
            axes: self.axes.iter().filter_map(Axis::unmodulated).collect(),
            conditions: conditions.cloned().collect(),
            rounds: None,
            controls: None,
            ..self.clone()
        }
    }

    /// Whether these canonical parameters are a job as a control alone.
    pub fn is_control(&self, parameters: &Parameters) -> bool {
        self.controls.is_some()
            && self
                .find(parameters)
                .is_some_and(|point| point >= self.point_count())
    }

    /// Id of the set that is the control of a modulated job; `None` if the sweep has no controls.
    pub fn control_of(&self, parameters: &Parameters) -> Option<String> {
        let is_wanted = self.controls.is_some() && parameters.modulation_amplitude > 0.0;
        is_wanted.then(|| self.set_id(&parameters.without_modulation()))
    }

    /// These points of the grid, and the controls of their jobs.
    pub fn with_controls(&self, points: Vec<RangeInclusive<u64>>) -> Vec<RangeInclusive<u64>> {
        if self.controls.is_none() {
            return merged(points);
        }
        let control = |point| {
            self.find(
                &self
                    .point(&self.rows(point))
                    .canonical()
                    .parameters
                    .without_modulation(),
            )
        };
        let controls: Vec<u64> = points
            .iter()
            .cloned()
            .flatten()
            .filter_map(control)
            .collect();
        merged(
            points
                .into_iter()
                .chain(controls.into_iter().map(|point| point..=point))
                .collect(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::Job;
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
    fn each_combination_of_other_values_has_one_control_for_each_seed() {
        let axes = "[axes]\nV0 = [1e-5, 1e-4]\nDelta = [3e-7, 6e-7]\neta = [0.5, 2, 7]\nseed = { count = 4 }\n";
        let sweep = sweep(axes);
        let jobs = controls(&sweep);
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
            assert!(sweep.is_control(&job.parameters) && sweep.contains(&job.parameters));
        }
        let first = sweep.jobs().next().unwrap().parameters;
        let own = sweep
            .jobs()
            .find(|job| job.parameters == first.without_modulation())
            .unwrap();
        assert_eq!(
            sweep.control_of(&first),
            Some(sweep.set_id(&own.parameters))
        );
        assert_eq!(sweep.control_of(&own.parameters), None);
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
