//! Rounds of a grid that is refined, from the first to the end.

use super::decide;
use crate::reduce::{CellOfGrid, Cells, SetRow};
use crate::sweep::{Round, Sweep};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

fn sweep(axes: &str, refine: &str) -> Sweep {
    let text = format!("name = \"a\"\n[model]\nT = 0.03\n[axes]\n{axes}\n[refine]\nby = \"has_phase\"\n{refine}");
    Sweep::parse(&text, Path::new("test.toml")).unwrap()
}

/// Runs the rounds to their end, where a set has a phase as this says of its parameters.
fn rounds(sweep: &Sweep, has_phase: impl Fn(f64, f64) -> bool) -> (Vec<Round>, BTreeMap<u64, SetRow>) {
    rounds_of(sweep, |amplitude, velocity| SetRow { has_phase: has_phase(amplitude, velocity), ..SetRow::default() })
}

/// Runs the rounds to their end, where sets of these parameters have such rows.
fn rounds_of(sweep: &Sweep, row: impl Fn(f64, f64) -> SetRow) -> (Vec<Round>, BTreeMap<u64, SetRow>) {
    let mut sets: BTreeMap<u64, SetRow> = BTreeMap::new();
    let mut rounds = vec![sweep.first_round().unwrap()];
    while !rounds.last().unwrap().is_end() {
        for job in sweep.jobs().filter(|job| rounds.last().unwrap().has(job.point)) {
            let new = || row(job.parameters.modulation_amplitude, job.parameters.drive_velocity);
            sets.entry(sweep.set_of(job.point)).or_insert_with(new).finished_jobs += 1;
        }
        rounds.push(decide(sweep, &sets));
        assert!(rounds.len() < 50, "no end");
    }
    (rounds, sets)
}

/// Leaves of the grid after these sets.
fn leaves(sweep: &Sweep, sets: &BTreeMap<u64, SetRow>) -> Vec<CellOfGrid> {
    let refinement = sweep.rounds().unwrap().refinement.as_ref().unwrap();
    Cells { sweep, refinement, known: sets }.leaves().0
}

#[test]
fn along_one_axis_an_edge_is_bisected() {
    let sweep = sweep(
        "Delta = { linear = [0.5e-6, 4.5e-6], points = 5 }\nseed = { count = 3 }",
        "axes = \"Delta\"\nto = { Delta = 1e-9 }\nsets = 100",
    );
    let edge = 2.345_678e-6;
    let (rounds, sets) = rounds(&sweep, |amplitude, _| amplitude > edge);
    // 1e-6 halved ten times; one set a round.
    let sizes: Vec<u64> = rounds.iter().map(|round| round.standing.sets_open).collect();
    assert_eq!(sizes, [5, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0]);
    let seeds = |round: &Round| round.points.iter().map(|range| range.end() - range.start() + 1).sum::<u64>();
    assert!(rounds.iter().all(|round| seeds(round) == 3 * round.standing.sets_open));
    let amplitude = |set: &u64| sweep.jobs().find(|job| job.point == *set).unwrap().parameters.modulation_amplitude;
    let below = sets.iter().filter(|(_, row)| !row.has_phase).map(|(set, _)| amplitude(set)).fold(0.0, f64::max);
    let above = sets.iter().filter(|(_, row)| row.has_phase).map(|(set, _)| amplitude(set)).fold(1.0, f64::min);
    assert!(below <= edge && edge < above && above - below < 1e-9, "{below} {above}");
}

#[test]
fn the_edges_of_one_value_are_bisected_and_no_others() {
    let at_first = |value: &str| {
        let text = format!(
            "name = \"a\"\n[model]\nT = 0.03\n[axes]\nDelta = {{ linear = [0.5e-6, 8.5e-6], points = 9 }}\n\
             [refine]\nby = \"periods\"\n{value}\naxes = \"Delta\"\nto = {{ Delta = 1e-8 }}\nsets = 500"
        );
        Sweep::parse(&text, Path::new("test.toml")).unwrap()
    };
    // n = 2, 3, 4, 5, 6: four edges, of which n = 4 has two. Each takes seven halvings.
    let of_amplitude = |amplitude: f64, _: f64| {
        let periods = (2..).zip([2.2e-6, 3.7e-6, 5.1e-6, 7.3e-6, 1.0]).find(|(_, end)| amplitude < *end).unwrap().0;
        SetRow { periods: Some(periods), ..SetRow::default() }
    };
    let sets = |value| rounds_of(&at_first(value), of_amplitude).1.len();
    assert_eq!([sets(""), sets("value = 4"), sets("value = 7")], [9 + 4 * 7, 9 + 2 * 7, 9]);
}

#[test]
fn without_a_difference_or_room_the_rounds_are_over_and_the_cap_is_reported() {
    let axes = "Delta = { linear = [0.5e-6, 4.5e-6], points = 5 }\nV0 = { log = [1e-5, 1e-4], points = 3 }";
    let refine =
        |sets| sweep(axes, &format!("axes = [\"Delta\", \"V0\"]\nto = {{ Delta = 1e-7, V0 = 0.3 }}\nsets = {sets}"));
    let (none, _) = rounds(&refine(100), |_, _| true);
    assert_eq!(none.len(), 2);
    let slope = |amplitude: f64, velocity: f64| amplitude > 0.04 * velocity;
    let (capped, sets) = rounds(&refine(22), slope);
    let end = capped.last().unwrap().standing;
    assert!(end.cells_capped > 0 && sets.len() <= 22 && sets.len() > 15, "{end:?} {}", sets.len());
    let (free, _) = rounds(&refine(1000), slope);
    assert_eq!(free.last().unwrap().standing.cells_capped, 0);
}

#[test]
fn conditions_and_points_without_modulation_are_passed_over() {
    let text = "name = \"a\"\nwhere = \"Delta < 2e-6 or V0 < 5e-5\"\n[model]\nfrequency = 29\n[axes]\n\
                Delta = { linear = [0, 4e-6], points = 3 }\nV0 = { linear = [1e-5, 1e-4], points = 3 }\n\
                [refine]\nby = \"has_phase\"\naxes = [\"Delta\", \"V0\"]\nto = { Delta = 5e-7, V0 = 1e-5 }\nsets = 1000";
    let sweep = Sweep::parse(text, Path::new("test.toml")).unwrap();
    let (_, sets) = rounds(&sweep, |amplitude, velocity| amplitude > 0.02 * velocity);
    let jobs: BTreeSet<u64> = sweep.jobs().map(|job| job.point).collect();
    assert!(sets.len() > 12 && sets.keys().all(|set| jobs.contains(set)), "{}", sets.len());
}

proptest! {
    /// An edge across the plane, wherever it lies.
    #[test]
    fn every_cell_at_the_edge_is_as_fine_as_is_wanted_and_few_others_are(slope in 0.005..0.2_f64, offset in -1e-6..3e-6_f64) {
        let sweep = sweep(
            "Delta = { linear = [0.5e-6, 4.5e-6], points = 5 }\nV0 = { linear = [1e-5, 9e-5], points = 5 }\nseed = { count = 2 }",
            "axes = [\"Delta\", \"V0\"]\nto = { Delta = 1.3e-7, V0 = 2.6e-6 }\nsets = 3000",
        );
        let has_phase = |amplitude: f64, velocity: f64| amplitude > slope * (velocity - 1e-5) + offset;
        let (_, sets) = rounds(&sweep, has_phase);
        let found = leaves(&sweep, &sets);
        // They cover the grid once: 4 by 4 cells, each of 8 by 8 of the finest.
        let area: u64 = found.iter().map(|cell| 1 << (2 * (3 - cell.level))).sum();
        prop_assert_eq!(area, 4 * 4 * 64);
        for cell in &found {
            let length = 8 >> cell.level;
            let corner = |right: u64, up: u64| {
                let at = |row: u64, low: f64, step: f64| low + step * (row as f64);
                has_phase(
                    at(cell.origin[0] + right * length, 0.5e-6, 1.25e-7),
                    at(cell.origin[1] + up * length, 1e-5, 2.5e-6),
                )
            };
            let corners = [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)];
            let differ = corners.iter().any(|corner| *corner != corners[0]);
            prop_assert!(!differ || cell.level == 3, "{:?}", cell);
        }
        // A line crosses some 64 of the 1024 finest cells; their neighbours are half as fine.
        prop_assert!(sets.len() < 25 + 260, "{} sets", sets.len());
    }
}
