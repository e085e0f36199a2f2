//! What the drop size decides: the number of slips in a trace, and their mean interval, for many drop sizes.

use super::axis::{Axis, bounds, logarithmic_bounds, widened};
use super::files::write;
use super::frame;
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::{Picture, PictureFormat};
use super::style::{BLUE, Look, Place, RED, REFERENCE, Stroke};
use crate::measured::DropSizes;
use crate::results::layout::Layout;
use anyhow::Result;
use std::path::PathBuf;

/// Draws them into the figures of a directory; returns the files.
pub fn draw_drop_size(layout: &Layout<'_>, sizes: &DropSizes) -> Result<Vec<PathBuf>> {
    layout.storage.ensure_folder(layout.root())?;
    let pictures: Vec<Picture> = drop_size(sizes, &Look::default()).into_iter().collect();
    write(layout, &pictures, &PictureFormat::DEFAULT)
}

/// Draws both against the drop size, with the size that was chosen; `None` without slips.
fn drop_size(sizes: &DropSizes, look: &Look) -> Option<Picture> {
    let counts = || sizes.counts.iter().filter(|count| count.slips > 0);
    let (low, high) = logarithmic_bounds(counts().map(|count| count.least))?;
    let x = Axis::logarithmic(&format!("Drop size ({})", sizes.unit), low, high);
    let chosen = (sizes.chosen, Stroke::solid(RED, 1.6), "the drop size");
    let noise = (Some(10.0 * sizes.noise), REFERENCE, "ten times the noise");
    let lines = [noise, chosen].into_iter();
    let marked: Vec<(f64, Stroke, &str)> = lines
        .filter_map(|(size, stroke, text)| {
            Some((size.filter(|size| x.contains(*size))?, stroke, text))
        })
        .collect();
    let panel = |label: &str, places: Vec<Place>| {
        let (least, most) = widened(bounds(places.iter().map(|place| place.1))?);
        let y = Axis::linear(label, least.max(0.0), most);
        let curve = Layer::Curve(places, Stroke::solid(BLUE, 1.6));
        let lines = marked
            .iter()
            .map(|(size, stroke, _)| Layer::Upright(*size, *stroke));
        let layers = [curve].into_iter().chain(lines);
        Some(Panel::inside(200.0, x.clone(), y, layers))
    };
    let number = counts().map(|count| (count.least, count.slips as f64));
    let with_intervals = counts().filter(|count| count.intervals > 0);
    let mean = with_intervals.map(|count| (count.least, count.seconds / count.intervals as f64));
    let panels = [
        panel("Number of slips", number.collect())?,
        panel("Mean interval (s)", mean.collect())?,
    ];
    let legend: Vec<LegendEntry> = marked
        .iter()
        .map(|(_, stroke, text)| entry(Mark::Line(*stroke), *text))
        .collect();
    Some(panel::draw(
        "drop-size",
        look,
        frame::Layout::column(480.0),
        &legend,
        panels.into(),
    ))
}
