//! Panels as data: axes and what lies between them, layer by layer. One engine draws the panels of every figure.

use super::axis::Axis;
use super::frame::{Cell, Ends, Frame, HEADING, Layout, NUMBERS};
use super::hues::{COLOUR_BAR, ColourBar};
use super::legend::{LegendEntry, Mark};
use super::picture::Picture;
use super::style::{
    BAR_WIDTH, Dot, Fill, HOLLOW, Ink, Look, Place, RADIUS, Stroke, WHITE, outline_of,
};

pub(super) type Drawing<'a> = Box<dyn FnOnce(&mut Picture, &Frame) + 'a>;

/// What is drawn in a panel, in units of its axes.
pub(super) enum Layer<'a> {
    /// What lies inside the frame of other layers.
    Inside(Vec<Self>),
    Curve(Vec<Place>, Stroke),
    /// A level line from edge to edge.
    Level(f64, Stroke),
    /// A vertical line from edge to edge.
    Upright(f64, Stroke),
    /// A vertical stripe between two values of x.
    Stripe(Ends, Fill),
    /// The points that lie inside the frame.
    Dots(Vec<Place>, Dot),
    /// The hollow marks of another directory, by its number, where they lie inside the frame.
    Hollow(Vec<Place>, usize, Ink),
    /// An upright bar between two values at each x; what lies under a logarithmic axis runs out of the frame.
    Bars(Vec<(f64, Ends)>, Stroke),
    /// Cells, each in its own colour, and by how much they reach under their neighbours.
    Cells(Vec<(Cell, Ink)>, f64),
    /// What depends on the size of the frame.
    Drawn(Drawing<'a>),
}

impl Layer<'_> {
    fn draw(self, sheet: &mut Picture, frame: &Frame) {
        match self {
            Self::Inside(layers) => {
                let inside = [frame.left, frame.top, frame.width, frame.height];
                sheet.clipped(inside, |sheet| {
                    for layer in layers {
                        layer.draw(sheet, frame);
                    }
                });
            }
            Self::Curve(points, stroke) => {
                let places = points.into_iter().map(|point| frame.place(point));
                sheet.line(places.collect(), stroke);
            }
            Self::Level(y, stroke) => {
                Self::Curve(vec![(frame.x.low, y), (frame.x.high, y)], stroke).draw(sheet, frame);
            }
            Self::Upright(x, stroke) => {
                Self::Curve(vec![(x, frame.y.low), (x, frame.y.high)], stroke).draw(sheet, frame);
            }
            Self::Stripe((low, high), fill) => {
                let left = frame.x_of(low.max(frame.x.low));
                let right = frame.x_of(high.min(frame.x.high));
                if right > left {
                    sheet.rectangle([left, frame.top, right - left, frame.height], fill);
                }
            }
            Self::Dots(points, dot) => {
                let inside = points
                    .into_iter()
                    .filter(|&(x, y)| frame.x.contains(x) && frame.y.contains(y));
                let centres: Vec<Place> = inside.map(|point| frame.place(point)).collect();
                if !centres.is_empty() {
                    sheet.dots(centres, dot);
                }
            }
            Self::Hollow(points, other, ink) => {
                for point in points {
                    if frame.x.contains(point.0) && frame.y.contains(point.1) {
                        let outline = outline_of(HOLLOW[other], RADIUS, frame.place(point));
                        // It is seen on any ground.
                        sheet.line(outline.clone(), Stroke::solid(WHITE, 2.5 * BAR_WIDTH));
                        sheet.line(outline, Stroke::solid(ink, BAR_WIDTH));
                    }
                }
            }
            Self::Bars(bars, stroke) => {
                for (x, (low, high)) in bars {
                    let x = frame.x_of(x);
                    let is_finite = frame.y.place(low).is_finite();
                    let bottom = if is_finite {
                        frame.y_of(low).min(2.0 * frame.bottom())
                    } else {
                        frame.bottom()
                    };
                    sheet.line(vec![(x, bottom), (x, frame.y_of(high))], stroke);
                }
            }
            Self::Cells(cells, overlap) => {
                sheet.rectangles(cells.into_iter().map(|(cell, colour)| {
                    let [left, top, width, height] = frame.box_of(cell);
                    ([left, top, width + overlap, height + overlap], colour)
                }));
            }
            Self::Drawn(draw) => draw(sheet, frame),
        }
    }
}

pub(super) struct Panel<'a> {
    pub(super) height: f64,
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// From below.
    pub(super) layers: Vec<Layer<'a>>,
    /// What it shows.
    pub(super) heading: Option<String>,
    pub(super) bar: Option<ColourBar>,
}

impl<'a> Panel<'a> {
    pub(super) const fn new(height: f64, x: Axis, y: Axis, layers: Vec<Layer<'a>>) -> Self {
        Self {
            height,
            x,
            y,
            layers,
            heading: None,
            bar: None,
        }
    }

    /// With all layers inside the frame.
    pub(super) fn inside(
        height: f64,
        x: Axis,
        y: Axis,
        layers: impl IntoIterator<Item = Layer<'a>>,
    ) -> Self {
        let layers = Layer::Inside(layers.into_iter().collect());
        Self::new(height, x, y, vec![layers])
    }
}

/// Draws panels row by row, under a legend.
pub(super) fn draw(
    name: &str,
    look: &Look,
    mut layout: Layout,
    legend: &[LegendEntry],
    panels: Vec<Panel<'_>>,
) -> Picture {
    let is_absent = |(mark, _): &LegendEntry| matches!(mark, Mark::Absent);
    let (absent, legend): (Vec<LegendEntry>, Vec<LegendEntry>) =
        legend.iter().cloned().partition(is_absent);
    if panels.iter().any(|panel| panel.bar.is_some()) {
        layout.right = COLOUR_BAR;
    }
    if panels.iter().any(|panel| panel.heading.is_some()) {
        layout.heading = HEADING;
    }
    let columns = layout.columns;
    let is_over_same = |number: usize| {
        let below = panels.get(number + columns);
        below.map(|below| below.x.label == panels[number].x.label)
    };
    let has_numbers: Vec<bool> = (0..panels.len())
        .map(|number| is_over_same(number) != Some(true))
        .collect();
    if (0..panels.len()).any(|number| is_over_same(number) == Some(false)) {
        layout.row_gap += NUMBERS;
    }
    let heights: Vec<f64> = panels.iter().map(|panel| panel.height).collect();
    let (page, mut sheet) = layout.page(name, look, &legend, &heights);
    sheet.absent = absent.into_iter().map(|(_, name)| name).collect();
    for (number, panel) in panels.into_iter().enumerate() {
        let frame = page.frame(number, panel.x, panel.y, has_numbers[number]);
        for layer in panel.layers {
            layer.draw(&mut sheet, &frame);
        }
        frame.axes(&mut sheet);
        if let Some(text) = panel.heading {
            frame.heading(&mut sheet, &text);
        }
        if let Some(bar) = panel.bar {
            bar.draw(&mut sheet, &frame);
        }
    }
    sheet
}
