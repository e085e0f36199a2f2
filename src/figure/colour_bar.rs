//! Colour bars: what the colours of a map mean, beside its frame.

use super::frame::{Frame, LEGEND_TEXT, TICK_TEXT};
use super::picture::{Anchor, BLACK, Sheet, Stroke};
use kuva::plot::ColorMap;
use kuva::render::color::Color;

/// Space right of a frame for the bar and its numbers.
pub(super) const COLOUR_BAR: f64 = 92.0;
const GAP: f64 = 20.0;
const WIDTH: f64 = 18.0;
const BORDER: Stroke = Stroke::solid(BLACK, 1.2);
/// Between the label's end and that of the bar's space.
const INSET: f64 = 14.0;
/// By how much a cell reaches under a neighbour that is drawn later: viewers that scale would show a seam.
pub(super) const OVERLAP: f64 = 0.5;

/// What a bar shows.
pub(super) struct ColourBar {
    pub(super) label: &'static str,
    /// Colours of equal height, from below.
    pub(super) colours: Vec<Color>,
    /// Places, 0 at the lower end and 1 at the upper, and their numbers.
    pub(super) ticks: Vec<(f64, String)>,
}

/// A share from 0 to 1 as a colour, in perceptually even steps from dark to bright, also to the colour-blind and in
/// grey.
pub(super) fn shade(share: f64) -> Color {
    Color::from(ColorMap::Viridis.map(share.clamp(0.0, 1.0)))
}

impl ColourBar {
    /// A bar of all shades, with numbers at these shares.
    pub(super) fn of_shades(label: &'static str, ticks: impl IntoIterator<Item = (f64, f64)>) -> Self {
        const STEPS: u32 = 64;
        let colours = (0..STEPS).map(|step| shade(f64::from(step) / f64::from(STEPS - 1))).collect();
        Self { label, colours, ticks: ticks.into_iter().map(|(share, number)| (share, number.to_string())).collect() }
    }

    /// A bar of all shades, dark at the upper end, with these ticks.
    pub(super) fn of_reversed_shades(label: &'static str, ticks: Vec<(f64, String)>) -> Self {
        let Self { mut colours, .. } = Self::of_shades(label, []);
        colours.reverse();
        Self { label, colours, ticks }
    }

    /// Draws the bar right of a frame, and the label above it.
    pub(super) fn draw(&self, sheet: &mut Sheet, frame: &Frame) {
        let (left, top, bottom) = (frame.right() + GAP, frame.top, frame.bottom());
        let height = frame.height / self.colours.len() as f64;
        let boxes = self.colours.iter().enumerate().map(|(step, colour)| {
            let (top, overlap) = (bottom - (step + 1) as f64 * height, if step == 0 { 0.0 } else { OVERLAP });
            ([left, top, WIDTH, height + overlap], colour.clone())
        });
        sheet.clipped([left, top, WIDTH, frame.height], |sheet| sheet.rectangles(boxes));
        let right = left + WIDTH;
        sheet.line(vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], BORDER);
        for (place, number) in &self.ticks {
            let y = bottom - place * frame.height;
            sheet.line(vec![(right, y), (right + 5.0, y)], BORDER);
            sheet.centred_text((right + 9.0, y), number, TICK_TEXT, Anchor::Start);
        }
        let end = frame.right() + COLOUR_BAR - INSET;
        sheet.text((end, top - 13.0), self.label, LEGEND_TEXT, Anchor::End);
    }
}
