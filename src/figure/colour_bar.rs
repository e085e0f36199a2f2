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

/// What a bar shows.
pub(super) struct ColourBar {
    pub(super) label: &'static str,
    /// Colours of equal height, from below.
    pub(super) colours: Vec<Color>,
    /// Places, 0 at the lower end and 1 at the upper, and their numbers.
    pub(super) ticks: Vec<(f64, String)>,
}

/// A share from 0 to 1 in colours of even steps to the eye, also of the colour-blind and in grey: dark to bright.
pub(super) fn shade(share: f64) -> Color {
    Color::from(ColorMap::Viridis.map(share.clamp(0.0, 1.0)))
}

/// All of [`shade`], from below.
pub(super) fn shades() -> Vec<Color> {
    const STEPS: u32 = 64;
    (0..STEPS).map(|step| shade(f64::from(step) / f64::from(STEPS - 1))).collect()
}

impl ColourBar {
    /// Draws the bar right of a frame, and the label above it.
    pub(super) fn draw(&self, sheet: &mut Sheet, frame: &Frame) {
        let (left, top, bottom) = (frame.left + frame.width + GAP, frame.top, frame.top + frame.height);
        let height = frame.height / self.colours.len() as f64;
        let boxes = self.colours.iter().enumerate().map(|(step, colour)| {
            // A hair over the box above, which is drawn later: viewers that scale show no seams.
            let (top, overlap) = (bottom - (step + 1) as f64 * height, if step == 0 { 0.0 } else { 0.5 });
            ([left, top, WIDTH, height + overlap], colour.clone())
        });
        sheet.clipped((left, top), (WIDTH, frame.height), |sheet| sheet.rectangles(boxes));
        let right = left + WIDTH;
        sheet.line(vec![(left, top), (right, top), (right, bottom), (left, bottom), (left, top)], BORDER);
        for (place, number) in &self.ticks {
            let y = bottom - place * frame.height;
            sheet.line(vec![(right, y), (right + 5.0, y)], BORDER);
            sheet.text((right + 9.0, y + 0.36 * f64::from(TICK_TEXT)), number, TICK_TEXT, Anchor::Start);
        }
        let end = frame.left + frame.width + COLOUR_BAR - INSET;
        sheet.text((end, top - 13.0), self.label, LEGEND_TEXT, Anchor::End);
    }
}
