//! Frames: rectangles with two axes, the data in them, and a legend. A layout places them on a sheet.

use super::axis::Axis;
use super::picture::{Anchor, BLACK, Dot, Fill, Sheet, Stroke, snapped};
use crate::reduce::Statistic;

/// Size of numbers at ticks. All sizes stay readable when a figure is printed at half its size.
pub(super) const TICK_TEXT: u32 = 16;
/// Size of the axes' labels.
const LABEL_TEXT: u32 = 19;
/// Size of legends.
pub(super) const LEGEND_TEXT: u32 = 15;
/// Mean width of a letter over the size of the text.
const LETTER: f64 = 0.6;
/// Distance of the rows of a legend.
const LEGEND_ROW: f64 = 22.0;
/// Between a legend's border and its entries.
const PADDING: f64 = 8.0;
/// Between a frame and a legend in it.
const INSET: f64 = 14.0;
const AXIS: Stroke = Stroke::solid(BLACK, 1.2);
const TICK_LENGTH: f64 = 7.0;
const MINOR_TICK_LENGTH: f64 = 4.0;
/// Where labels of y axes begin, in the space left of a frame.
const LABEL_LEFT: f64 = 14.0;

/// Space left of a frame for numbers.
pub(super) const LEFT: f64 = 76.0;
/// Space right of a frame.
pub(super) const RIGHT: f64 = 26.0;
/// Space right of a frame for a legend beside it.
pub(super) const LEGEND: f64 = 222.0;
/// Space above a frame for the label of its y axis.
pub(super) const ABOVE: f64 = 38.0;
/// Space under a frame for numbers and label.
const UNDER: f64 = 64.0;
/// Between two rows of frames, for a label and some air.
pub(super) const ROW_GAP: f64 = 52.0;

/// Frames of a figure, in rows and columns; numbers and label of the x axes stand under the lowest row only.
#[derive(Clone, Copy)]
pub(super) struct Layout<'a> {
    pub(super) columns: usize,
    /// Width of each column.
    pub(super) width: f64,
    pub(super) column_gap: f64,
    /// Heights of the rows, from above.
    pub(super) heights: &'a [f64],
    pub(super) row_gap: f64,
    /// Space right of the last column.
    pub(super) right: f64,
}

impl<'a> Layout<'a> {
    /// A column of frames with this space between them.
    pub(super) const fn column(width: f64, heights: &'a [f64], row_gap: f64, right: f64) -> Self {
        Self { columns: 1, width, column_gap: 0.0, heights, row_gap, right }
    }

    /// A sheet for all frames.
    pub(super) fn sheet(&self, name: &'static str) -> Sheet {
        let columns = self.columns as f64;
        let width = LEFT + columns * self.width + (columns - 1.0) * self.column_gap + self.right;
        Sheet::new(name, (width, ABOVE + self.rows_height(self.heights) - self.row_gap + UNDER))
    }

    /// The frame in a row and a column, both from 0.
    pub(super) fn frame(&self, row: usize, column: usize, x: Axis, y: Axis) -> Frame {
        Frame {
            left: LEFT + column as f64 * (self.width + self.column_gap),
            top: ABOVE + self.rows_height(&self.heights[..row]),
            width: self.width,
            height: self.heights[row],
            x,
            y,
            is_lowest: row + 1 == self.heights.len(),
        }
    }

    /// Height of some rows, the gap under each included.
    fn rows_height(&self, heights: &[f64]) -> f64 {
        heights.iter().map(|height| height + self.row_gap).sum()
    }
}

/// A rectangle with two axes.
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: Axis,
    pub(super) y: Axis,
    is_lowest: bool,
}

/// What a legend shows beside a text.
#[derive(Clone, Copy)]
pub(super) enum Mark {
    Dot(Dot),
    Line(Stroke),
    Patch(Fill),
}

/// A row of a legend.
pub(super) type Entry = (Mark, String);

/// Where a legend goes: over a corner of the frame that is known to be free, beside it, or, with one entry, above it.
#[derive(Clone, Copy)]
pub(super) enum LegendPlace {
    UpperRight,
    LowerRight,
    Beside,
    Above,
}

impl Frame {
    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub(super) fn x_of(&self, value: f64) -> f64 {
        self.left + self.x.place(value) * self.width
    }

    pub(super) fn y_of(&self, value: f64) -> f64 {
        self.top + (1.0 - self.y.place(value)) * self.height
    }

    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x_of(x), self.y_of(y))
    }

    /// Left edge, upper edge, width and height of a rectangle of data, on whole pixels.
    pub(super) fn box_of(&self, x: (f64, f64), y: (f64, f64)) -> [f64; 4] {
        let [left, right] = [x.0, x.1].map(|value| snapped(self.x_of(value)));
        let [top, bottom] = [y.1, y.0].map(|value| snapped(self.y_of(value)));
        [left, top, right - left, bottom - top]
    }

    /// Shows what `draw` draws inside the frame only.
    pub(super) fn clipped(&self, sheet: &mut Sheet, draw: impl FnOnce(&mut Sheet)) {
        sheet.clipped([self.left, self.top, self.width, self.height], draw);
    }

    /// A curve through data points.
    pub(super) fn curve(&self, sheet: &mut Sheet, points: impl IntoIterator<Item = (f64, f64)>, stroke: Stroke) {
        sheet.line(points.into_iter().map(|point| self.place(point)).collect(), stroke);
    }

    /// A level line from edge to edge.
    pub(super) fn level(&self, sheet: &mut Sheet, y: f64, stroke: Stroke) {
        self.curve(sheet, [(self.x.low, y), (self.x.high, y)], stroke);
    }

    /// The data points that lie inside.
    pub(super) fn points(&self, sheet: &mut Sheet, points: impl IntoIterator<Item = (f64, f64)>, dot: Dot) {
        let inside = points.into_iter().filter(|&(x, y)| self.x.contains(x) && self.y.contains(y));
        sheet.discs(inside.map(|point| self.place(point)), dot);
    }

    /// A line through statistics, with a bar for each confidence interval that is known.
    pub(super) fn statistics(&self, sheet: &mut Sheet, points: &[(f64, Statistic)], stroke: Stroke, radius: f64) {
        let values = || points.iter().map(|&(x, statistic)| (x, statistic.value));
        self.clipped(sheet, |sheet| {
            self.curve(sheet, values(), stroke);
            for &(x, statistic) in points {
                if let Some((low, high)) = statistic.interval {
                    self.curve(sheet, [(x, low), (x, high)], Stroke::solid(stroke.ink, 1.6));
                }
            }
        });
        self.points(sheet, values(), Dot::solid(stroke.ink, radius));
    }

    /// A vertical stripe between two values of x.
    pub(super) fn stripe(&self, sheet: &mut Sheet, low: f64, high: f64, fill: Fill) {
        let (left, right) = (self.x_of(low.max(self.x.low)), self.x_of(high.min(self.x.high)));
        if right > left {
            sheet.rectangle([left, self.top, right - left, self.height], fill);
        }
    }

    /// Border, ticks and their numbers, over the data.
    pub(super) fn axes(&self, sheet: &mut Sheet) {
        let (right, bottom) = (self.right(), self.bottom());
        for (value, length) in ticks(&self.x) {
            let x = self.x_of(value);
            sheet.line(vec![(x, bottom), (x, bottom - length)], AXIS);
            sheet.line(vec![(x, self.top), (x, self.top + length)], AXIS);
        }
        for (value, length) in ticks(&self.y) {
            let y = self.y_of(value);
            sheet.line(vec![(self.left, y), (self.left + length, y)], AXIS);
            sheet.line(vec![(right, y), (right - length, y)], AXIS);
        }
        let corners = [(self.left, self.top), (right, self.top), (right, bottom), (self.left, bottom)];
        for corner in 0..4 {
            sheet.line(vec![corners[corner], corners[(corner + 1) % 4]], AXIS);
        }
        for (value, number) in &self.y.ticks {
            sheet.centred_text((self.left - 8.0, self.y_of(*value)), number, TICK_TEXT, Anchor::End);
        }
        for (value, number) in self.x.ticks.iter().filter(|_| self.is_lowest) {
            let y = bottom + 1.3 * f64::from(TICK_TEXT);
            sheet.text((self.x_of(*value), y), number, TICK_TEXT, Anchor::Middle);
        }
    }

    /// Label of the x axis, under its numbers.
    pub(super) fn x_label(&self, sheet: &mut Sheet) {
        if self.is_lowest {
            let place = (self.left + 0.5 * self.width, self.bottom() + UNDER - 15.0);
            sheet.text(place, &self.x.label, LABEL_TEXT, Anchor::Middle);
        }
    }

    /// Label of the y axis, above its numbers.
    pub(super) fn y_label(&self, sheet: &mut Sheet) {
        if !self.y.label.is_empty() {
            sheet.text((self.left - LEFT + LABEL_LEFT, self.top - 13.0), &self.y.label, LABEL_TEXT, Anchor::Start);
        }
    }

    /// A legend.
    pub(super) fn legend(&self, sheet: &mut Sheet, place: LegendPlace, entries: &[Entry]) {
        const MARK: f64 = 34.0;
        let letters = entries.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(0) as f64;
        let width = MARK + letters * LETTER * f64::from(LEGEND_TEXT) + 2.0 * PADDING;
        let height = entries.len() as f64 * LEGEND_ROW + PADDING;
        let (left, top) = match place {
            LegendPlace::UpperRight => (self.right() - INSET - width, self.top + INSET),
            LegendPlace::LowerRight => (self.right() - INSET - width, self.bottom() - INSET - height),
            LegendPlace::Beside => (self.right() + PADDING, self.top),
            LegendPlace::Above => (self.left + 0.5 * (self.width - width), self.top - height - AXIS.width),
        };
        sheet.rectangle([left, top, width, height], Fill { ink: "#ffffff", opacity: 0.85 });
        for (index, (mark, text)) in entries.iter().enumerate() {
            let middle = top + 0.5 * PADDING + (index as f64 + 0.5) * LEGEND_ROW;
            let (start, end) = (left + PADDING, left + MARK);
            match *mark {
                Mark::Dot(dot) => {
                    // A single faint dot could not be seen.
                    let dot = Dot { radius: dot.radius.max(3.0), opacity: dot.opacity.max(0.7), ..dot };
                    sheet.discs([(0.5 * (start + end), middle)], dot);
                }
                Mark::Line(stroke) => sheet.line(vec![(start, middle), (end, middle)], stroke),
                Mark::Patch(fill) => sheet.rectangle([start, middle - 6.0, end - start, 12.0], fill),
            }
            sheet.centred_text((left + MARK + PADDING, middle), text, LEGEND_TEXT, Anchor::Start);
        }
    }
}

/// A row of a legend with a mark and a text.
pub(super) fn entry(mark: Mark, text: impl Into<String>) -> Entry {
    (mark, text.into())
}

/// Space that a legend takes at the top or bottom of a frame.
pub(super) fn legend_space(entries: usize) -> f64 {
    INSET + entries as f64 * LEGEND_ROW + PADDING
}

/// Values at the ticks of an axis, and their lengths.
fn ticks(axis: &Axis) -> impl Iterator<Item = (f64, f64)> {
    let minor = axis.minor.iter().map(|&value| (value, MINOR_TICK_LENGTH));
    minor.chain(axis.ticks.iter().map(|&(value, _)| (value, TICK_LENGTH)))
}
