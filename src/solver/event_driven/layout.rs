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
}
