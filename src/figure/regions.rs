//! Regions of maps: where their numbers or names can be printed.

use std::collections::{BTreeMap, BTreeSet};

/// Cells across a region that has its number in it.
const MIN_ACROSS: usize = 3;

/// A column and a row of a map.
pub(super) type Cell = (usize, usize);

/// The innermost cell of each region that has room for its number. A region is what hangs together of equal numbers.
pub(super) fn middles(numbers: &BTreeMap<Cell, usize>) -> Vec<(Cell, usize)> {
    let around = |(column, row): Cell| {
        [(column + 1, row), (column.wrapping_sub(1), row), (column, row + 1), (column, row.wrapping_sub(1))]
    };
    let mut left: BTreeSet<Cell> = numbers.keys().copied().collect();
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
            let inner: BTreeSet<Cell> =
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
        let mut numbers: BTreeMap<Cell, usize> = block(0..5, 2).chain(block(5..12, 3)).collect();
        numbers.insert((20, 20), 7);
        numbers.insert((21, 20), 7);
        assert_eq!(middles(&numbers), [((2, 2), 2), ((8, 2), 3)]);
        assert!(middles(&BTreeMap::new()).is_empty());
    }
}
