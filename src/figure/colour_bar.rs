//! Colour bars: what the colours of a map mean, beside its frame.

use super::axis::Axis;
use super::frame::{Frame, OVERLAP, fitting};
use super::ink::Ink;
use super::picture::{Anchor, Picture};
use super::style::{AXIS, LEGEND_TEXT, NOTE_TEXT, TICK_TEXT};

/// Space right of a frame for the bar and its numbers.
pub(super) const COLOUR_BAR: f64 = 96.0;
const GAP: f64 = 18.0;
const WIDTH: f64 = 18.0;
/// Between the label's end and that of the bar's space.
const INSET: f64 = 14.0;

pub(super) struct ColourBar {
    pub(super) label: String,
    /// Colours of equal height, from below.
    pub(super) colours: Vec<Ink>,
    /// Places, 0 at the lower end and 1 at the upper, and their numbers.
    pub(super) ticks: Vec<(f64, String)>,
}

impl ColourBar {
    /// A bar of all colours of a scale, with the numbers of an axis.
    pub(super) fn of_axis(axis: &Axis, colour: fn(f64) -> Ink) -> Self {
        const STEPS: u32 = 64;
        let colours = (0..STEPS)
            .map(|step| colour(f64::from(step) / f64::from(STEPS - 1)))
            .collect();
        let ticks = axis
            .ticks
            .iter()
            .map(|(value, number)| (axis.place(*value), number.clone()))
            .collect();
        Self {
            label: axis.label.clone(),
            colours,
            ticks,
        }
    }

    /// Draws the bar right of a frame, and the label above it.
    pub(super) fn draw(&self, sheet: &mut Picture, frame: &Frame) {
        let left = frame.right() + GAP;
        let top = frame.top;
        let bottom = frame.bottom();
        let height = frame.height / self.colours.len() as f64;
        let boxes = self.colours.iter().enumerate().map(|(step, colour)| {
            let top = bottom - (step + 1) as f64 * height;
            let overlap = if step == 0 { 0.0 } else { OVERLAP };
            ([left, top, WIDTH, height + overlap], *colour)
        });
        sheet.clipped([left, top, WIDTH, frame.height], |sheet| {
            sheet.rectangles(boxes);
        });
        let right = left + WIDTH;
        sheet.line(
            vec![
                (left, top),
                (right, top),
                (right, bottom),
                (left, bottom),
                (left, top),
            ],
            AXIS,
        );
        let mut free = f64::INFINITY;
        for (place, number) in &self.ticks {
            let y = bottom - place * frame.height;
            sheet.line(vec![(right, y), (right + 5.0, y)], AXIS);
            if y <= free {
                sheet.centred_text((right + 9.0, y), number, TICK_TEXT, Anchor::Start);
                free = y - 1.1 * f64::from(TICK_TEXT);
            }
        }
        let end = frame.right() + COLOUR_BAR - INSET;
        let size =
            fitting(&self.label, LEGEND_TEXT, end - frame.y_label_end() - GAP).unwrap_or(NOTE_TEXT);
        sheet.text((end, top - 12.0), &self.label, size, Anchor::End);
    }
}
