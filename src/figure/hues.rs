//! Hues: a quantity as colours. Few values have an ink each and stand in the legend; many are a scale, explained by a
//! colour bar beside the frame.

use super::axis::Axis;
use super::frame::{Frame, OVERLAP, fitting, outline};
use super::legend::{LegendEntry, Mark, entry};
use super::picture::{Anchor, Picture};
use super::style::{
    AXIS, BLACK, Dot, INKS, Ink, LEGEND_TEXT, NOTE_TEXT, PENTAGON, Polygon, SCALE, SHAPES,
    TICK_TEXT, shade,
};
use crate::reduce::ascending;
use crate::sets::is_same;
use crate::table::value::floored;

/// How the values of a quantity become colours.
pub(super) enum Hues {
    /// Each value and what it is called, in the order of inks.
    Inks(Vec<(f64, String)>),
    Scale(Axis),
}

impl Hues {
    /// For these values of a quantity with this label, each called as `word` says.
    pub(super) fn of(
        label: &str,
        values: impl Iterator<Item = f64>,
        word: impl Fn(f64) -> String,
    ) -> Self {
        let values = ascending(values.filter(|value| value.is_finite()));
        match values[..] {
            [low, .., high] if values.len() > INKS.len() => {
                Self::Scale(Axis::spanning(label, (low, high)))
            }
            _ => {
                let named = values.into_iter().map(|value| (value, word(value)));
                Self::Inks(named.collect())
            }
        }
    }

    pub(super) fn ink(&self, value: f64) -> Ink {
        match self {
            Self::Inks(values) => {
                // What is off is black, so that others have the colours that they have without it.
                let first = usize::from(values.first().is_some_and(|(least, _)| *least == 0.0));
                let index = values
                    .iter()
                    .position(|(known, _)| is_same(*known, value))
                    .unwrap_or(0);
                if index < first {
                    BLACK
                } else {
                    INKS[(index - first) % INKS.len()]
                }
            }
            Self::Scale(axis) => {
                let steps = SCALE.len() as f64;
                let step = floored((axis.place(value) * steps).min(steps - 1.0));
                SCALE[step]
            }
        }
    }

    /// Each ink has its own, which distinguishes them in grey, and so has what is off or has no value.
    pub(super) fn shape(&self, value: Option<f64>) -> Option<Polygon> {
        let own = value.map(|value| self.ink(value));
        let shape = match INKS.iter().position(|ink| Some(*ink) == own) {
            Some(place) => SHAPES[place],
            None => Some(PENTAGON),
        };
        shape.filter(|_| matches!(self, Self::Inks(_)))
    }

    /// Entries of the legend of values that are shown.
    pub(super) fn entries(
        &self,
        dot: impl Fn(f64) -> Dot,
        is_shown: impl Fn(f64) -> bool,
    ) -> Vec<LegendEntry> {
        let Self::Inks(values) = self else {
            return Vec::new();
        };
        let shown = values.iter().filter(|(value, _)| is_shown(*value));
        shown
            .map(|(value, name)| entry(Mark::Dot(dot(*value)), name))
            .collect()
    }

    /// The colour bar, if there is a scale.
    pub(super) fn bar(&self) -> Option<ColourBar> {
        let Self::Scale(axis) = self else { return None };
        Some(ColourBar {
            colours: SCALE.to_vec(),
            ..ColourBar::of_axis(axis, shade)
        })
    }
}

/// Space right of a frame for the bar and its numbers.
pub(super) const COLOUR_BAR: f64 = 96.0;
const BAR_GAP: f64 = 18.0;
const BAR_WIDTH: f64 = 18.0;
/// Between the label's end and that of the bar's space.
const BAR_INSET: f64 = 14.0;

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
        let left = frame.right() + BAR_GAP;
        let top = frame.top;
        let bottom = frame.bottom();
        let height = frame.height / self.colours.len() as f64;
        let boxes = self.colours.iter().enumerate().map(|(step, colour)| {
            let top = bottom - (step + 1) as f64 * height;
            let overlap = if step == 0 { 0.0 } else { OVERLAP };
            ([left, top, BAR_WIDTH, height + overlap], *colour)
        });
        sheet.clipped([left, top, BAR_WIDTH, frame.height], |sheet| {
            sheet.rectangles(boxes);
        });
        let right = left + BAR_WIDTH;
        sheet.line(outline((left, top), (right, bottom)), AXIS);
        let mut free = f64::INFINITY;
        for (place, number) in &self.ticks {
            let y = bottom - place * frame.height;
            sheet.line(vec![(right, y), (right + 5.0, y)], AXIS);
            if y <= free {
                sheet.centred_text((right + 9.0, y), number, TICK_TEXT, Anchor::Start);
                free = y - 1.1 * f64::from(TICK_TEXT);
            }
        }
        let end = frame.right() + COLOUR_BAR - BAR_INSET;
        let room = end - frame.y_label_end() - BAR_GAP;
        let size = fitting(&self.label, LEGEND_TEXT, room).unwrap_or(NOTE_TEXT);
        sheet.text((end, top - 12.0), &self.label, size, Anchor::End);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_have_inks_and_many_a_scale() {
        let hues = |count: u32| {
            Hues::of("", (0..count).map(|step| f64::from(1 << step)), |value| {
                value.to_string()
            })
        };
        let few = hues(3);
        let dot = |_| Dot::solid(BLACK, 1.0);
        assert_eq!(
            [1.0, 2.0, 4.0].map(|value| few.ink(value)),
            [INKS[0], INKS[1], INKS[2]]
        );
        assert!(few.entries(dot, |_| true).len() == 3 && few.bar().is_none());
        let many = hues(7);
        assert!(many.entries(dot, |_| true).is_empty() && many.bar().is_some());
        assert_eq!(
            (many.ink(1.0), many.ink(8.0), many.ink(64.0)),
            (SCALE[0], SCALE[5], SCALE[9])
        );
        assert!(SCALE.contains(&many.ink(f64::NAN)), "no panic");
    }
}
