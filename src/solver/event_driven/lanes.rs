//! The chain in lanes: block j lies in row j mod R of lane j div R, with R = ceil(N/8).
//!
//! The neighbours of a block are then the rows above and below in the same lane, and a loop over rows of eight doubles
//! runs in whatever vectors the processor has. Slots beyond the last block keep a coupling, a stiffness and a force of
//! zero and stay at rest. Contract: no fused and no reassociated operations, so that results do not depend on the width.

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

/// The doubles of some rows, one after the other: the neighbours of entry i are i - 8 and i + 8, and a plain loop over
/// them runs in vectors.
#[inline(always)]
pub(super) fn flat(rows: &[Row]) -> &[f64] {
    // SAFETY: a `Row` is eight doubles and nothing else: 64 bytes, as its alignment asks, laid out as in C.
    unsafe { std::slice::from_raw_parts(rows.as_ptr().cast(), rows.len() * LANES) }
}

/// The same, to be written.
#[inline(always)]
pub(super) fn flat_mut(rows: &mut [Row]) -> &mut [f64] {
    // SAFETY: as above.
    unsafe { std::slice::from_raw_parts_mut(rows.as_mut_ptr().cast(), rows.len() * LANES) }
}

/// Where blocks lie.
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
    pub fn slot(self, block: usize) -> (usize, usize) {
        (block % self.rows, block / self.rows)
    }

    /// Block in a slot; beyond the last one for padding.
    pub fn block(self, row: usize, lane: usize) -> usize {
        lane * self.rows + row
    }

    /// A row for each, filled with one value.
    pub fn filled(self, value: f64) -> Vec<Row> {
        vec![Row::filled(value); self.rows]
    }
}

/// The row before the first: each lane's left neighbour is the last row of the lane before.
#[inline(always)]
pub(super) fn ghost_before(last: &Row) -> Row {
    Row([0.0, last[0], last[1], last[2], last[3], last[4], last[5], last[6]])
}

/// The row after the last: each lane's right neighbour is the first row of the lane after.
#[inline(always)]
pub(super) fn ghost_after(first: &Row) -> Row {
    Row([first[1], first[2], first[3], first[4], first[5], first[6], first[7], 0.0])
}
