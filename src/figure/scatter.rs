//! Slips as small dots, those of locked sets over the others (Fig. 3c, e).

use super::frame::Frame;
use super::legend::{Entry, Mark, entry};
use super::picture::{Dot, Sheet};
use super::style::{BLACK, GREY};
use crate::reduce::Point;

/// Slips at their places in a frame.
pub(super) struct Scatter {
    /// x, y, and whether the set is locked.
    slips: Vec<(f64, f64, bool)>,
    any: Dot,
    locked: Dot,
}

impl Scatter {
    /// The points that have a place, as dots of this size.
    pub(super) fn new(
        points: &[Point],
        radius: f64,
        opacity: f64,
        place: impl Fn(&Point) -> Option<(f64, f64)>,
    ) -> Self {
        let slips = points.iter().filter_map(|point| place(point).map(|(x, y)| (x, y, point.is_locked))).collect();
        Self { slips, any: Dot { ink: GREY, radius, opacity }, locked: Dot { ink: BLACK, radius, opacity } }
    }

    #[cfg(test)]
    pub(super) fn of(slips: impl Iterator<Item = (f64, f64)>) -> Self {
        let dot = Dot::solid(BLACK, 1.0);
        Self { slips: slips.map(|(x, y)| (x, y, true)).collect(), any: dot, locked: dot }
    }

    pub(super) fn xs(&self) -> impl Iterator<Item = f64> {
        self.slips.iter().map(|slip| slip.0)
    }

    pub(super) fn ys(&self) -> impl Iterator<Item = f64> {
        self.slips.iter().map(|slip| slip.1)
    }

    pub(super) fn draw(&self, sheet: &mut Sheet, frame: &Frame) {
        for (is_locked, dot) in [(false, self.any), (true, self.locked)] {
            let slips = self.slips.iter().filter(|slip| slip.2 == is_locked);
            frame.points(sheet, slips.map(|slip| (slip.0, slip.1)), dot);
        }
    }

    pub(super) fn legend(&self) -> [Entry; 2] {
        [entry(Mark::Dot(self.locked), "slips of locked sets"), entry(Mark::Dot(self.any), "other slips")]
    }
}
