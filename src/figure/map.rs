//! Maps: sets on a grid of two quantities, each a cell, with words in the middle of regions of equal cells.

use super::axis::Axis;
use super::frame::OVERLAP;
use super::panel::{Cell, Layer};
use super::picture::Stroke;
use super::sets::Grid;
use crate::reduce::{SetRow, ascending};
use kuva::render::color::Color;
use std::collections::{BTreeMap, BTreeSet};

/// Cells across a region that has its word in it.
const MIN_ACROSS: usize = 3;

type Quantity<'a> = dyn Fn(&SetRow) -> Option<f64> + 'a;

/// A column and a row of a map.
type Position = (usize, usize);

pub(super) struct Map<'a> {
    columns: Grid,
    rows: Grid,
    sets: Vec<(&'a SetRow, Position)>,
}

impl<'a> Map<'a> {
    /// `None` for fewer values of either quantity than `min_values`, or if less than half of their grid is filled.
    pub(super) fn of(sets: &[&'a SetRow], quantities: [&Quantity<'_>; 2], min_values: usize) -> Option<Self> {
        let values = quantities.map(|quantity| ascending(sets.iter().filter_map(|set| quantity(set))));
        let is_grid = values.iter().all(|values| values.len() >= min_values)
            && 2 * sets.len() >= values[0].len() * values[1].len();
        let [columns, rows] = is_grid.then(|| values.map(Grid::of))?;
        let position = |set| Some((columns.index_of(quantities[0](set)?), rows.index_of(quantities[1](set)?)));
        let sets = sets.iter().filter_map(|set| Some((*set, position(set)?))).collect();
        Some(Self { columns, rows, sets })
    }

    pub(super) fn axes(&self, x_label: &str, y_label: &str) -> (Axis, Axis) {
        (self.columns.axis(x_label), self.rows.axis(y_label))
    }

    fn cell(&self, (column, row): Position) -> Cell {
        (self.columns.cell(column), self.rows.cell(row))
    }

    /// The sets that have a colour.
    pub(super) fn coloured<'l>(&self, colour: impl Fn(&SetRow) -> Option<Color>) -> Layer<'l> {
        let cells = self.sets.iter().filter_map(|&(set, position)| Some((self.cell(position), colour(set)?)));
        Layer::Cells(cells.collect(), OVERLAP)
    }

    /// Lines between neighbours that are of different kinds.
    pub(super) fn borders<'l, K: PartialEq>(&self, kind: impl Fn(&SetRow) -> K, stroke: Stroke) -> Vec<Layer<'l>> {
        let kinds: BTreeMap<Position, K> = self.sets.iter().map(|&(set, position)| (position, kind(set))).collect();
        let differs = |position, next| kinds.get(&next).is_some_and(|other| *other != kinds[&position]);
        let border = |&(_, (column, row)): &(&SetRow, Position)| {
            let ((left, right), (bottom, top)) = self.cell((column, row));
            let upright = differs((column, row), (column + 1, row)).then(|| vec![(right, bottom), (right, top)]);
            let level = differs((column, row), (column, row + 1)).then(|| vec![(left, top), (right, top)]);
            upright.into_iter().chain(level)
        };
        self.sets.iter().flat_map(border).map(|line| Layer::Curve(line, stroke)).collect()
    }

    /// The words of regions with equal numbers, and their shades.
    pub(super) fn words<'l>(
        &self,
        number: impl Fn(&SetRow) -> Option<usize>,
        word: impl Fn(usize) -> (String, f64),
    ) -> Vec<Layer<'l>> {
        let numbers = self.sets.iter().filter_map(|&(set, position)| Some((position, number(set)?))).collect();
        let word = |(position, number)| {
            let (text, share) = word(number);
            Layer::Word(self.cell(position), text, share)
        };
        middles(&numbers).into_iter().map(word).collect()
    }
}

/// The innermost cell of each region that has room for its number. A region is what hangs together of equal numbers.
fn middles(numbers: &BTreeMap<Position, usize>) -> Vec<(Position, usize)> {
    let around = |(column, row): Position| {
        [(column + 1, row), (column.wrapping_sub(1), row), (column, row + 1), (column, row.wrapping_sub(1))]
    };
    let mut left: BTreeSet<Position> = numbers.keys().copied().collect();
    let mut found = Vec::new();
    while let Some(start) = left.pop_first() {
        let (n, mut region, mut edge) = (numbers[&start], BTreeSet::from([start]), vec![start]);
        while let Some(cell) = edge.pop() {
            for next in around(cell) {
                if numbers.get(&next) == Some(&n) && left.remove(&next) {
                    region.insert(next);
                    edge.push(next);
                }
            }
        }
        // Layer by layer, as long as something is left.
        let mut across = 1;
        loop {
            let inner: BTreeSet<Position> =
                region.iter().copied().filter(|&cell| around(cell).iter().all(|next| region.contains(next))).collect();
            if inner.is_empty() {
                break;
            }
            (region, across) = (inner, across + 2);
        }
        let middle = region.iter().nth(region.len() / 2).copied();
        found.extend(middle.filter(|_| across >= MIN_ACROSS).map(|cell| (cell, n)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_innermost_cells_of_regions_are_found_and_thin_ones_left_out() {
        let block = |columns: std::ops::Range<usize>, n| {
            columns.flat_map(move |column| (0..5).map(move |row| ((column, row), n)))
        };
        let mut numbers: BTreeMap<Position, usize> = block(0..5, 2).chain(block(5..12, 3)).collect();
        numbers.insert((20, 20), 7);
        numbers.insert((21, 20), 7);
        assert_eq!(middles(&numbers), [((2, 2), 2), ((8, 2), 3)]);
        assert!(middles(&BTreeMap::new()).is_empty());
    }
}
