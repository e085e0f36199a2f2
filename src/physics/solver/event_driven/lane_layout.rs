//! Where blocks lie in rows: block j in row j mod R of lane j div R, with R = ceil(N/8).
//!
//! The neighbours of a block are then the rows above and below in the same lane; beyond the first and the last row they
//! lie in the next lane. Slots beyond the last block keep a coupling, a stiffness and a force of zero and stay at rest.

use crate::model::{LANES, Row};

/// Block 1, at which the drive pulls, in the first row.
pub(super) const FIRST_BLOCK: Row = {
    let mut row = Row::filled(0.0);
    row.0[0] = 1.0;
    row
};

#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub blocks: usize,
    pub rows: usize,
}

impl Layout {
    pub fn new(blocks: usize) -> Self {
        Self {
            blocks,
            rows: blocks.div_ceil(LANES),
        }
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
}
