//! Where blocks lie in rows: block j in row j mod R of lane j div R, with R = ceil(N/8).
//!
//! The neighbours of a block are then the rows above and below in the same lane; beyond the first and the last row they
//! lie in the next lane. Slots beyond the last block keep a coupling, a stiffness and a force of zero and stay at rest.

use crate::model::{LANES, Row};

#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub blocks: usize,
    pub rows: usize,
}

impl Layout {
    pub fn new(blocks: usize) -> Self {
        Self { blocks, rows: blocks.div_ceil(LANES) }
    }

    /// Row and lane of a block.
    #[inline]
    pub fn slot(self, block: usize) -> (usize, usize) {
        (block % self.rows, block / self.rows)
    }

    /// Row and lane of the blocks before and after the one in a slot; after the last one there may be padding.
    #[inline]
    pub fn beside(self, row: usize, lane: usize) -> [Option<(usize, usize)>; 2] {
        let last = self.rows - 1;
        let before = if row > 0 { Some((row - 1, lane)) } else { lane.checked_sub(1).map(|lane| (last, lane)) };
        let after = if row < last { Some((row + 1, lane)) } else { (lane + 1 < LANES).then_some((0, lane + 1)) };
        [before, after]
    }

    /// Block in a slot; beyond the last one for padding.
    pub fn block(self, row: usize, lane: usize) -> usize {
        lane * self.rows + row
    }

    /// Rows for all blocks, filled with one value.
    pub fn filled(self, value: f64) -> Vec<Row> {
        vec![Row::filled(value); self.rows]
    }

    /// Writes the entries of all blocks, one after the other.
    pub fn unfold(self, rows: &[Row], blocks: &mut [f64]) {
        for (lane, run) in blocks.chunks_mut(self.rows).enumerate() {
            for (entry, row) in run.iter_mut().zip(rows) {
                *entry = row[lane];
            }
        }
    }

    /// The reverse of [`Self::unfold`]; padding keeps what it holds.
    pub fn fold(self, blocks: &[f64], rows: &mut [Row]) {
        for (lane, run) in blocks.chunks(self.rows).enumerate() {
            for (entry, row) in run.iter().zip(&mut *rows) {
                row[lane] = *entry;
            }
        }
    }
}
