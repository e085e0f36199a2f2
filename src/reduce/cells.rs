//! The cells of a refined grid: which are divided next, and where the edges lie.
//!
//! A cell is a box of the refined axes, at fixed rows of the others; the first are those between neighbours of the sweep
//! file. A cell is divided into halves along all axes that are not yet as fine as is wanted; along one axis that is
//! bisection. It is divided if the sets that touch it differ: those of its corners, and those that finer neighbours have
//! put on its sides, so that an edge does not end where it leaves a fine cell.
//! Cells are not recorded: those that count as divided are those whose new sets are all there. Coarse cells go first, then
//! grid order, as long as the sweep has room for their sets.

use super::set::SetRow;
use crate::sweep::{Contrast, RefinedAxis, Refinement, Sweep};
use crate::table::columns::{Value, columns, tables};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// A cell: how often it was halved, and the rows of its first corner.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CellOfGrid {
    pub level: u32,
    /// Rows of the corner with the lowest; that of the seeds is the first.
    pub origin: Vec<u64>,
}

columns! {
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct CellRow {
        set_id: Option<String> = "", "set at the corner with the lowest values; null if a condition drops it";
        level: u64 = "", "how often the cell was halved";
        x: String = "", "the first of the refined axes";
        x_low: f64 = "", "its lower end, in the unit of that parameter";
        x_high: f64 = "", "its upper end";
        y: Option<String> = "", "the second, if there is one";
        y_low: Option<f64> = "", "its lower end";
        y_high: Option<f64> = "", "its upper end";
        by: String = "", "the statistic that tells sets apart, such as `has_phase`, `periods = 4` or `mean_friction > 300`";
        differs: bool = "", "whether the sets that touch the cell differ: the edge lies in it";
        share: Option<f64> = "", "share of these sets that are so, have the value or lie above the threshold; null otherwise";
    }
}

tables! { CellRow = "cells", "One row per undivided cell, if the sweep has `[refine]` with one axis or two"; }

/// The undivided cells, coarse ones first; none of grids that are refined along more than two axes.
pub(super) fn cell_rows(sweep: &Sweep, refinement: &Refinement, known: &BTreeMap<u64, SetRow>) -> Vec<CellRow> {
    let (first, second) = match refinement.axes.as_slice() {
        [first] => (first, None),
        [first, second] => (first, Some(second)),
        _ => return Vec::new(),
    };
    let grid = Cells { sweep, refinement, known };
    let ends = |cell: &CellOfGrid, axis: &RefinedAxis| {
        let row = cell.origin[axis.axis];
        let (key, low) = sweep.value_at(axis.axis, row)?;
        let (_, high) = sweep.value_at(axis.axis, row + Cells::length(axis, cell.level))?;
        Some((key.to_owned(), low, high))
    };
    let row = |(cell, seen): (CellOfGrid, Seen)| {
        let (x, x_low, x_high) = ends(&cell, first)?;
        let (y, y_low, y_high) = second
            .and_then(|axis| ends(&cell, axis))
            .map_or((None, None, None), |(key, low, high)| (Some(key), Some(low), Some(high)));
        let set = sweep.set_at(&cell.origin).and_then(|set| known.get(&set));
        Some(CellRow {
            set_id: set.map(|row| row.set_id.clone()),
            level: u64::from(cell.level),
            x,
            x_low,
            x_high,
            y,
            y_low,
            y_high,
            by: refinement.condition(),
            differs: seen.differ(&refinement.contrast),
            share: seen.share(),
        })
    };
    grid.seen().into_iter().filter_map(row).collect()
}

/// Divides the cells whose sets differ, for as long as there is room: the new sets, and the number of cells that would be
/// divided, had the sweep room for their sets.
pub fn divide(sweep: &Sweep, refinement: &Refinement, known: &BTreeMap<u64, SetRow>) -> (BTreeSet<u64>, u64) {
    let grid = Cells { sweep, refinement, known };
    let (mut sets, mut cells_left) = (BTreeSet::new(), 0);
    let mut room = refinement.max_sets.saturating_sub(known.len() as u64);
    for (leaf, seen) in grid.seen() {
        if leaf.level == grid.levels() || !seen.differ(&refinement.contrast) {
            continue;
        }
        let is_new = |set: &u64| !known.contains_key(set) && !sets.contains(set);
        let new: BTreeSet<u64> =
            grid.lattice(&leaf, true).iter().filter_map(|rows| sweep.set_at(rows)).filter(is_new).collect();
        // All that would be new is dropped by a condition.
        if new.is_empty() {
            continue;
        }
        if cells_left > 0 || new.len() as u64 > room {
            cells_left += 1;
            continue;
        }
        room -= new.len() as u64;
        sets.extend(new);
    }
    (sets, cells_left)
}

/// What the sets that touch a cell have.
#[derive(Clone, Debug, Default)]
struct Seen {
    /// How many sets there are of each class.
    classes: BTreeMap<String, u64>,
    range: Option<(f64, f64)>,
}

impl Seen {
    fn add(&mut self, class: &str, number: Option<f64>) {
        match self.classes.get_mut(class) {
            Some(count) => *count += 1,
            None => drop(self.classes.insert(class.to_owned(), 1)),
        }
        if let Some(number) = number {
            let (low, high) = self.range.unwrap_or((number, number));
            self.range = Some((low.min(number), high.max(number)));
        }
    }

    /// The share of sets whose class is `true`, if it is that of a flag or a threshold.
    fn share(&self) -> Option<f64> {
        let count = |class: &str| self.classes.get(class).copied().unwrap_or_default() as f64;
        let (yes, no) = (count("true"), count("false"));
        (yes + no > 0.0).then(|| yes / (yes + no))
    }

    fn differ(&self, contrast: &Contrast) -> bool {
        let is_wide = |step: f64| self.range.is_some_and(|(low, high)| high - low > step);
        self.classes.len() > 1 || matches!(contrast, Contrast::Step(step) if is_wide(*step))
    }
}

/// The class of a value, and the number that may vary within it. A statistic without value is a class of its own.
fn class(value: Value<'_>, contrast: &Contrast) -> (String, Option<f64>) {
    match (value.number(), contrast) {
        _ if value == Value::Null => (String::new(), None),
        (_, Contrast::Value(wanted)) => ((value.to_string() == *wanted).to_string(), None),
        (Some(number), Contrast::Threshold(threshold)) => ((number > *threshold).to_string(), None),
        (Some(number), Contrast::Step(_)) => ("number".to_owned(), Some(number)),
        _ => (value.to_string(), None),
    }
}

pub struct Cells<'a> {
    pub sweep: &'a Sweep,
    pub refinement: &'a Refinement,
    /// The sets that its rounds have run.
    pub known: &'a BTreeMap<u64, SetRow>,
}

/// Points with each of the rows of an axis in place of the one that they have.
fn at_rows(points: &[Vec<u64>], axis: usize, rows: impl Fn(u64) -> Vec<u64>) -> Vec<Vec<u64>> {
    let with = |point: &Vec<u64>, row: u64| {
        let mut point = point.clone();
        point[axis] = row;
        point
    };
    points.iter().flat_map(|point| rows(point[axis]).into_iter().map(move |row| with(point, row))).collect()
}

/// Points of the grid by their rows, each with its set if it is a job.
type Nodes = BTreeMap<Vec<u64>, Option<u64>>;

impl Cells<'_> {
    /// How often cells can be halved.
    pub fn levels(&self) -> u32 {
        self.refinement.axes.iter().map(|axis| axis.levels).max().unwrap_or_default()
    }

    /// The cells that are not divided, in the order of [`Cells::leaves`], with what the sets that touch them have.
    fn seen(&self) -> Vec<(CellOfGrid, Seen)> {
        let (leaves, nodes) = self.leaves();
        let mut seen: HashMap<&CellOfGrid, Seen> = leaves.iter().map(|leaf| (leaf, Seen::default())).collect();
        for (rows, set) in &nodes {
            let Some(row) = set.and_then(|set| self.known.get(&set)) else { continue };
            // Of jobs that all failed, nothing is known.
            if row.finished_jobs == 0 {
                continue;
            }
            let Refinement { by, contrast, .. } = self.refinement;
            let (class, number) = row.column(by.key, |value| class(value, contrast)).unwrap_or_default();
            for cell in self.touching(rows) {
                if let Some(seen) = seen.get_mut(&cell) {
                    seen.add(&class, number);
                }
            }
        }
        let all: Vec<Seen> = leaves.iter().map(|leaf| seen.remove(leaf).unwrap_or_default()).collect();
        leaves.into_iter().zip(all).collect()
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
            origins = at_rows(&origins, axis, |_| rows.clone());
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
            let steps = Self::length(axis, cell.level) / step;
            nodes = at_rows(&nodes, axis.axis, |row| (0..=steps).map(|number| row + number * step).collect());
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
                origins = at_rows(&origins, axis.axis, |row| vec![row, row + step]);
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
                origins = at_rows(&origins, at, |_| begins.clone());
            }
            origins.into_iter().map(move |origin| CellOfGrid { level, origin })
        };
        (0..=self.levels()).flat_map(of_level).collect()
    }
}
