//! Which cells of the grid are divided next.
//!
//! A cell is a box of the refined axes, at fixed rows of the others; the first are those between neighbours of the sweep
//! file. A cell is divided into halves along all axes that are not yet as fine as is wanted; along one axis that is
//! bisection. It is divided if the sets that touch it differ: those of its corners, and those that finer neighbours have
//! put on its sides, so that an edge does not end where it leaves a fine cell.
//! Cells are not recorded: those that count as divided are those whose new sets are all there. Coarse cells go first, then
//! grid order, as long as the sweep has room for their sets.

use crate::reduce::{SetRow, StatisticValue};
use crate::sweep::{Contrast, RefinedAxis, Refinement, Sweep};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// What is to be divided.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Division {
    /// The new sets, in order.
    pub sets: BTreeSet<u64>,
    /// Cells that would be divided, had the sweep room for their sets.
    pub cells_left: u64,
}

/// A cell: how often it was halved, and the rows of its first corner.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct CellOfGrid {
    pub level: u32,
    pub origin: Vec<u64>,
}

/// Divides the cells whose sets differ, for as long as there is room.
pub(super) fn divide(sweep: &Sweep, refinement: &Refinement, known: &BTreeMap<u64, &SetRow>) -> Division {
    let grid = Cells { sweep, refinement, known };
    let (leaves, nodes) = grid.leaves();
    let mut seen: HashMap<&CellOfGrid, Seen> = leaves.iter().map(|leaf| (leaf, Seen::default())).collect();
    for (rows, set) in &nodes {
        let Some(row) = set.and_then(|set| known.get(&set)) else { continue };
        // Of jobs that all failed, nothing is known.
        if row.finished_jobs == 0 {
            continue;
        }
        let (class, number) = class(row.statistic(refinement.by.key), refinement.contrast);
        for cell in grid.touching(rows) {
            if let Some(seen) = seen.get_mut(&cell) {
                seen.add(&class, number);
            }
        }
    }
    let differs = |leaf: &&CellOfGrid| leaf.level < grid.levels() && seen[leaf].differ(refinement.contrast);
    let mut division = Division::default();
    let mut room = refinement.max_sets.saturating_sub(known.len() as u64);
    for leaf in leaves.iter().filter(differs) {
        let is_new = |set: &u64| !known.contains_key(set) && !division.sets.contains(set);
        let new: BTreeSet<u64> =
            grid.lattice(leaf, true).iter().filter_map(|rows| sweep.set_at(rows)).filter(is_new).collect();
        // All that would be new is dropped by a condition.
        if new.is_empty() {
            continue;
        }
        if division.cells_left > 0 || new.len() as u64 > room {
            division.cells_left += 1;
            continue;
        }
        room -= new.len() as u64;
        division.sets.extend(new);
    }
    division
}

/// What the sets that touch a cell have.
#[derive(Clone, Debug, Default)]
struct Seen {
    classes: BTreeSet<String>,
    range: Option<(f64, f64)>,
}

impl Seen {
    fn add(&mut self, class: &str, number: Option<f64>) {
        if !self.classes.contains(class) {
            self.classes.insert(class.to_owned());
        }
        if let Some(number) = number {
            let (low, high) = self.range.unwrap_or((number, number));
            self.range = Some((low.min(number), high.max(number)));
        }
    }

    fn differ(&self, contrast: Contrast) -> bool {
        let is_wide = |step: f64| self.range.is_some_and(|(low, high)| high - low > step);
        self.classes.len() > 1 || matches!(contrast, Contrast::Step(step) if is_wide(step))
    }
}

/// The class of a value, and the number that may vary within it. A statistic without value is a class of its own.
fn class(value: StatisticValue, contrast: Contrast) -> (String, Option<f64>) {
    match (value, contrast) {
        (StatisticValue::Class(class), _) => (class, None),
        (StatisticValue::Nothing, _) => (String::new(), None),
        (StatisticValue::Number(number), Contrast::Threshold(threshold)) => ((number > threshold).to_string(), None),
        (StatisticValue::Number(number), _) => ("number".to_owned(), Some(number)),
    }
}

/// The cells of a sweep.
pub(super) struct Cells<'a> {
    pub sweep: &'a Sweep,
    pub refinement: &'a Refinement,
    pub known: &'a BTreeMap<u64, &'a SetRow>,
}

/// Points of the grid by their rows, each with its set if it is a job.
pub(super) type Nodes = BTreeMap<Vec<u64>, Option<u64>>;

impl Cells<'_> {
    /// How often cells can be halved.
    pub fn levels(&self) -> u32 {
        self.refinement.axes.iter().map(|axis| axis.levels).max().unwrap_or_default()
    }

    /// The cells that are not divided, coarse ones first, then in grid order; and the corners of all that there were.
    pub fn leaves(&self) -> (Vec<CellOfGrid>, Nodes) {
        let (mut leaves, mut nodes) = (Vec::new(), Nodes::new());
        let mut open = self.first();
        while let Some(cell) = open.pop() {
            for rows in self.lattice(&cell, false) {
                nodes.entry(rows).or_insert_with_key(|rows| self.sweep.set_at(rows));
            }
            let children = if cell.level < self.levels() { self.children(&cell) } else { Vec::new() };
            if children.is_empty() {
                leaves.push(cell);
            } else {
                open.extend(children);
            }
        }
        leaves.sort_unstable();
        (leaves, nodes)
    }

    /// The cells between neighbours of the sweep file.
    fn first(&self) -> Vec<CellOfGrid> {
        let counts = self.sweep.row_counts();
        let mut origins = vec![vec![0; counts.len()]];
        for (axis, &count) in counts.iter().enumerate() {
            let rows: Vec<u64> = match self.refined(axis) {
                Some(refined) => (0..(count - 1) >> refined.levels).map(|cell| cell << refined.levels).collect(),
                None if self.sweep.seed_axis() == Some(axis) => vec![0],
                None => (0..count).collect(),
            };
            let with = |origin: &Vec<u64>, row: u64| {
                let mut origin = origin.clone();
                origin[axis] = row;
                origin
            };
            origins = origins.iter().flat_map(|origin| rows.iter().map(move |&row| with(origin, row))).collect();
        }
        origins.into_iter().map(|origin| CellOfGrid { level: 0, origin }).collect()
    }

    fn refined(&self, axis: usize) -> Option<&RefinedAxis> {
        self.refinement.axes.iter().find(|refined| refined.axis == axis)
    }

    /// Length of the cells of a level, in rows of the grid.
    fn length(axis: &RefinedAxis, level: u32) -> u64 {
        1 << axis.levels.saturating_sub(level)
    }

    /// The corners of a cell; or, if it is `halved`, those of its children.
    pub fn lattice(&self, cell: &CellOfGrid, halved: bool) -> Vec<Vec<u64>> {
        let mut nodes = vec![cell.origin.clone()];
        for axis in &self.refinement.axes {
            let step = Self::length(axis, cell.level + u32::from(halved));
            let steps = 1..=Self::length(axis, cell.level) / step;
            for at in 0..nodes.len() {
                for number in steps.clone() {
                    let mut node = nodes[at].clone();
                    node[axis.axis] += number * step;
                    nodes.push(node);
                }
            }
        }
        nodes
    }

    /// The cells that a cell was divided into; none if it was not.
    fn children(&self, cell: &CellOfGrid) -> Vec<CellOfGrid> {
        let corners: BTreeSet<Vec<u64>> = self.lattice(cell, false).into_iter().collect();
        let new = self.lattice(cell, true).into_iter().filter(|rows| !corners.contains(rows));
        let sets: Vec<u64> = new.filter_map(|rows| self.sweep.set_at(&rows)).collect();
        if sets.is_empty() || !sets.iter().all(|set| self.known.contains_key(set)) {
            return Vec::new();
        }
        let level = cell.level + 1;
        let mut origins = vec![cell.origin.clone()];
        for axis in &self.refinement.axes {
            let step = Self::length(axis, level);
            if step < Self::length(axis, cell.level) {
                for at in 0..origins.len() {
                    let mut origin = origins[at].clone();
                    origin[axis.axis] += step;
                    origins.push(origin);
                }
            }
        }
        origins.into_iter().map(|origin| CellOfGrid { level, origin }).collect()
    }

    /// All cells of any level that a point lies in, or on a side of.
    fn touching(&self, rows: &[u64]) -> Vec<CellOfGrid> {
        let counts = self.sweep.row_counts();
        let of_level = |level| {
            let mut origins = vec![rows.to_vec()];
            for axis in &self.refinement.axes {
                let (at, length) = (axis.axis, Self::length(axis, level));
                let (row, last) = (rows[at], counts[at] - 1);
                let lower = row / length * length;
                // The last row is a corner of the last cell alone.
                let inside = (lower < last).then_some(lower);
                let before = (row == lower).then(|| lower.checked_sub(length)).flatten();
                let begins: Vec<u64> = inside.into_iter().chain(before).collect();
                let with = |origin: &Vec<u64>, row: u64| {
                    let mut origin = origin.clone();
                    origin[at] = row;
                    origin
                };
                origins = origins.iter().flat_map(|origin| begins.iter().map(move |&row| with(origin, row))).collect();
            }
            origins.into_iter().map(move |origin| CellOfGrid { level, origin })
        };
        (0..=self.levels()).flat_map(of_level).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::decide;
    use super::*;
    use crate::reduce::ChosenSet;
    use crate::sweep::{Round, Sweep};
    use proptest::prelude::*;
    use std::path::Path;

    fn sweep(axes: &str, refine: &str) -> Sweep {
        let text = format!("name = \"a\"\n[model]\nT = 0.03\n[axes]\n{axes}\n[refine]\nby = \"locked\"\n{refine}");
        Sweep::parse(&text, Path::new("test.toml")).unwrap()
    }

    /// Runs the rounds to their end, where a set is locked as this says of its parameters.
    fn rounds(sweep: &Sweep, is_locked: impl Fn(f64, f64) -> bool) -> (Vec<Round>, BTreeMap<u64, SetRow>) {
        let mut sets: BTreeMap<u64, SetRow> = BTreeMap::new();
        let mut rounds = vec![sweep.first_round().unwrap()];
        while !rounds.last().unwrap().is_end() {
            for job in sweep.jobs().filter(|job| rounds.last().unwrap().has(job.point)) {
                let locked = is_locked(job.parameters.modulation_amplitude, job.parameters.drive_velocity);
                let new = || SetRow { finished_jobs: 0, is_locked: locked, ..SetRow::default() };
                sets.entry(sweep.set_of(job.point)).or_insert_with(new).finished_jobs += 1;
            }
            let of = |(&number, row): (&u64, &SetRow)| ChosenSet { number, jobs: row.finished_jobs, row: row.clone() };
            rounds.push(decide(sweep, &sets.iter().map(of).collect::<Vec<_>>()));
            assert!(rounds.len() < 50, "no end");
        }
        (rounds, sets)
    }

    /// Leaves of the grid after these sets.
    fn leaves(sweep: &Sweep, sets: &BTreeMap<u64, SetRow>) -> Vec<CellOfGrid> {
        let known = sets.iter().map(|(&set, row)| (set, row)).collect();
        let refinement = sweep.rounds().unwrap().refinement.as_ref().unwrap();
        Cells { sweep, refinement, known: &known }.leaves().0
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
        let below = sets.iter().filter(|(_, row)| !row.is_locked).map(|(set, _)| amplitude(set)).fold(0.0, f64::max);
        let above = sets.iter().filter(|(_, row)| row.is_locked).map(|(set, _)| amplitude(set)).fold(1.0, f64::min);
        assert!(below <= edge && edge < above && above - below < 1e-9, "{below} {above}");
    }

    #[test]
    fn without_a_difference_or_room_the_rounds_are_over_and_the_cap_is_reported() {
        let axes = "Delta = { linear = [0.5e-6, 4.5e-6], points = 5 }\nV0 = { log = [1e-5, 1e-4], points = 3 }";
        let refine = |sets| {
            sweep(axes, &format!("axes = [\"Delta\", \"V0\"]\nto = {{ Delta = 1e-7, V0 = 0.3 }}\nsets = {sets}"))
        };
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
                    [refine]\nby = \"locked\"\naxes = [\"Delta\", \"V0\"]\nto = { Delta = 5e-7, V0 = 1e-5 }\nsets = 1000";
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
            let is_locked = |amplitude: f64, velocity: f64| amplitude > slope * (velocity - 1e-5) + offset;
            let (_, sets) = rounds(&sweep, is_locked);
            let found = leaves(&sweep, &sets);
            // They cover the grid once: 4 by 4 cells, each of 8 by 8 of the finest.
            let area: u64 = found.iter().map(|cell| 1 << (2 * (3 - cell.level))).sum();
            prop_assert_eq!(area, 4 * 4 * 64);
            for cell in &found {
                let length = 8 >> cell.level;
                let corner = |right: u64, up: u64| {
                    let at = |row: u64, low: f64, step: f64| low + step * (row as f64);
                    is_locked(
                        at(cell.origin[0] + right * length, 0.5e-6, 1.25e-7),
                        at(cell.origin[1] + up * length, 1e-5, 2.5e-6),
                    )
                };
                let corners = [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)];
                let differ = corners.iter().any(|locked| *locked != corners[0]);
                prop_assert!(!differ || cell.level == 3, "{:?}", cell);
            }
            // A line crosses some 64 of the 1024 finest cells; their neighbours are half as fine.
            prop_assert!(sets.len() < 25 + 260, "{} sets", sets.len());
        }
    }
}
