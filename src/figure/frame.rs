//! Frames: a rectangle with two axes, the data in it, and a legend.

use super::axis::Axis;
use super::picture::{Anchor, BLACK, Dot, Ink, Sheet, Stroke, snapped};

/// Size of numbers at ticks. All sizes stay readable when a figure is printed at half its size.
pub(super) const TICK_TEXT: u32 = 16;
/// Size of the axes' labels.
pub(super) const LABEL_TEXT: u32 = 19;
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
pub(super) const UNDER: f64 = 64.0;

/// A rectangle with two axes.
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: Axis,
    pub(super) y: Axis,
}

/// What a legend shows beside a text.
#[derive(Clone, Copy)]
pub(super) enum Mark {
    Dot(Dot),
    Line(Stroke),
    Patch(Ink, f64),
}

/// Where a legend goes: over a corner of the frame that is known to be free, beside it, or, with one entry, above it.
#[derive(Clone, Copy)]
pub(super) enum LegendPlace {
    UpperRight,
    LowerRight,
    Beside,
    Above,
}

impl Frame {
    /// The frame of a sheet of this size that leaves some space to its right.
    pub(super) fn filling((width, height): (f64, f64), right: f64, x: Axis, y: Axis) -> Self {
        Self { left: LEFT, top: ABOVE, width: width - LEFT - right, height: height - ABOVE - UNDER, x, y }
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

    /// x, y, width and height of a rectangle of data, on whole pixels.
    pub(super) fn box_of(&self, x: (f64, f64), y: (f64, f64)) -> [f64; 4] {
        let [left, right] = [x.0, x.1].map(|value| snapped(self.x_of(value)));
        let [top, bottom] = [y.1, y.0].map(|value| snapped(self.y_of(value)));
        [left, top, right - left, bottom - top]
    }

    /// What `draw` draws appears inside the frame only.
    pub(super) fn clipped(&self, sheet: &mut Sheet, draw: impl FnOnce(&mut Sheet)) {
        sheet.clipped((self.left, self.top), (self.width, self.height), draw);
    }

    /// A curve through data points.
    pub(super) fn curve(&self, sheet: &mut Sheet, points: impl IntoIterator<Item = (f64, f64)>, stroke: Stroke) {
        sheet.line(points.into_iter().map(|point| self.place(point)).collect(), stroke);
    }

    /// A confidence interval, if there is one.
    pub(super) fn error_bar(&self, sheet: &mut Sheet, x: f64, interval: Option<(f64, f64)>, ink: Ink) {
        if let Some((low, high)) = interval {
            self.curve(sheet, [(x, low), (x, high)], Stroke::solid(ink, 1.6));
        }
    }

    /// Those data points that lie inside.
    pub(super) fn points(&self, sheet: &mut Sheet, points: impl IntoIterator<Item = (f64, f64)>, dot: Dot) {
        let inside = points.into_iter().filter(|&(x, y)| self.x.holds(x) && self.y.holds(y));
        sheet.discs(inside.map(|point| self.place(point)), dot);
    }

    /// A vertical stripe between two values of x.
    pub(super) fn stripe(&self, sheet: &mut Sheet, low: f64, high: f64, ink: Ink, opacity: f64) {
        let (left, right) = (self.x_of(low.max(self.x.low)), self.x_of(high.min(self.x.high)));
        if right > left {
            sheet.rectangle((left, self.top), (right - left, self.height), ink, opacity);
        }
    }

    /// Border, ticks and their numbers, over the data; numbers under the frame only if asked for.
    pub(super) fn axes(&self, sheet: &mut Sheet, numbers_under: bool) {
        let (right, bottom) = (self.left + self.width, self.top + self.height);
        for (values, length) in [(&self.x.minor, MINOR_TICK_LENGTH), (&major(&self.x), TICK_LENGTH)] {
            for x in values.iter().map(|&value| self.x_of(value)) {
                sheet.line(vec![(x, bottom), (x, bottom - length)], AXIS);
                sheet.line(vec![(x, self.top), (x, self.top + length)], AXIS);
            }
        }
        for (values, length) in [(&self.y.minor, MINOR_TICK_LENGTH), (&major(&self.y), TICK_LENGTH)] {
            for y in values.iter().map(|&value| self.y_of(value)) {
                sheet.line(vec![(self.left, y), (self.left + length, y)], AXIS);
                sheet.line(vec![(right, y), (right - length, y)], AXIS);
            }
        }
        let corners = [(self.left, self.top), (right, self.top), (right, bottom), (self.left, bottom)];
        for corner in 0..4 {
            sheet.line(vec![corners[corner], corners[(corner + 1) % 4]], AXIS);
        }
        let size = f64::from(TICK_TEXT);
        for (value, number) in &self.y.ticks {
            sheet.text((self.left - 8.0, self.y_of(*value) + 0.36 * size), number, TICK_TEXT, Anchor::End);
        }
        if numbers_under {
            for (value, number) in &self.x.ticks {
                sheet.text((self.x_of(*value), bottom + 1.3 * size), number, TICK_TEXT, Anchor::Middle);
            }
        }
    }

    /// Label of the x axis, under its numbers.
    pub(super) fn x_label(&self, sheet: &mut Sheet) {
        let place = (self.left + 0.5 * self.width, self.top + self.height + UNDER - 15.0);
        sheet.text(place, &self.x.label, LABEL_TEXT, Anchor::Middle);
    }

    /// Label of the y axis, above its numbers.
    pub(super) fn y_label(&self, sheet: &mut Sheet) {
        sheet.text((self.left - LEFT + LABEL_LEFT, self.top - 13.0), &self.y.label, LABEL_TEXT, Anchor::Start);
    }

    /// A legend.
    pub(super) fn legend(&self, sheet: &mut Sheet, place: LegendPlace, entries: &[(Mark, String)]) {
        const MARK: f64 = 34.0;
        let size = f64::from(LEGEND_TEXT);
        let letters = entries.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(0) as f64;
        let (width, height) =
            (MARK + letters * LETTER * size + 2.0 * PADDING, entries.len() as f64 * LEGEND_ROW + PADDING);
        let (right, bottom) = (self.left + self.width, self.top + self.height);
        let (left, top) = match place {
            LegendPlace::UpperRight => (right - INSET - width, self.top + INSET),
            LegendPlace::LowerRight => (right - INSET - width, bottom - INSET - height),
            LegendPlace::Beside => (right + PADDING, self.top),
            LegendPlace::Above => (self.left + 0.5 * (self.width - width), self.top - height - AXIS.width),
        };
        sheet.rectangle((left, top), (width, height), "#ffffff", 0.85);
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
                Mark::Patch(ink, opacity) => {
                    sheet.rectangle((start, middle - 6.0), (end - start, 12.0), ink, opacity);
                }
            }
            sheet.text((left + MARK + PADDING, middle + 0.36 * size), text, LEGEND_TEXT, Anchor::Start);
        }
    }
}

/// Space that a legend of so many entries takes at the top or bottom of a frame.
pub(super) fn legend_space(entries: usize) -> f64 {
    INSET + entries as f64 * LEGEND_ROW + PADDING
}

fn major(axis: &Axis) -> Vec<f64> {
    axis.ticks.iter().map(|(value, _)| *value).collect()
}
