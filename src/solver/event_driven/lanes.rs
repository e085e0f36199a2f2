//! The chain in lanes: block j lies in row j mod R of lane j div R, with R = ceil(N/8).
//!
//! The neighbours of a block are then the rows above and below in the same lane; beyond the first and the last row they
//! lie in the next lane. Slots beyond the last block keep a coupling, a stiffness and a force of zero and stay at rest.

use std::ops::{Deref, DerefMut};

/// Lanes of a row.
pub(super) const LANES: usize = 8;

/// One row: eight blocks that lie R apart, in one line of the cache.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct Row(pub [f64; LANES]);

impl Row {
    /// The same value in every lane.
    pub const fn filled(value: f64) -> Self {
        Self([value; LANES])
    }
}

impl Deref for Row {
    type Target = [f64; LANES];

    #[inline(always)]
    fn deref(&self) -> &[f64; LANES] {
        &self.0
    }
}

impl DerefMut for Row {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; LANES] {
        &mut self.0
    }
}

/// Where blocks lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub blocks: usize,
    pub rows: usize,
    /// 2^52/rows, rounded up: times a block below 2^24, its lane times 2^52 and a rest.
    lane_per_block: u64,
}

/// A division by the number of rows is a product and a shift by so many bits.
const LANE_SHIFT: u32 = 52;

impl Layout {
    pub fn new(blocks: usize) -> Self {
        let rows = blocks.div_ceil(LANES);
        Self { blocks, rows, lane_per_block: (1 << LANE_SHIFT) / rows as u64 + 1 }
    }

    /// Row and lane of a block.
    #[inline]
    pub fn slot(self, block: usize) -> (usize, usize) {
        let lane = ((block as u64 * self.lane_per_block) >> LANE_SHIFT) as usize;
        (block - lane * self.rows, lane)
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_slot_is_the_remainder_and_the_quotient_by_the_rows(blocks in 1_usize..10_000_000, of in 0.0_f64..1.0) {
            let layout = Layout::new(blocks);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the number of blocks")]
            for block in [0, blocks - 1, (of * blocks as f64) as usize] {
                let (row, lane) = layout.slot(block);
                prop_assert_eq!((row, lane), (block % layout.rows, block / layout.rows));
                prop_assert_eq!(layout.block(row, lane), block);
            }
        }
    }
}
