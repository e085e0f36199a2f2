//! Rows of eight doubles: the width in which loops over contacts and over blocks run, whatever the registers of the
//! processor hold. It is fixed, so that the rounding of sums does not depend on the processor.

use std::array;
use std::ops::{Deref, DerefMut};

pub(crate) const LANES: usize = 8;

/// Eight doubles in one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Row(pub [f64; LANES]);

impl Row {
    /// The same value in every lane.
    pub const fn filled(value: f64) -> Self {
        Self([value; LANES])
    }

    /// Combines all lanes into one value, in pairs.
    #[inline(always)]
    pub fn reduce(self, combine: impl Fn(f64, f64) -> f64) -> f64 {
        let halves: [f64; LANES / 2] = array::from_fn(|i| combine(self[i], self[i + LANES / 2]));
        combine(combine(halves[0], halves[2]), combine(halves[1], halves[3]))
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
