//! Pictures: what is drawn, as SVG and as PNG. The same data give the same bytes.

use super::FigureError;
use kuva::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::render::color::Color;
pub(super) use kuva::render::render::TextAnchor as Anchor;
use kuva::render::render::{Primitive, Scene};

/// Pixels of the PNG per unit of the SVG: 1300 pixels for a figure of a column's width.
const PIXELS_PER_UNIT: f32 = 2.0;
/// Fonts with the Greek letters and superscripts of the labels first. The PNG has DejaVu Sans built in.
const FONTS: &str = "DejaVu Sans, Verdana, Liberation Sans, Arial, sans-serif";

/// A finished figure.
pub struct Picture {
    name: &'static str,
    scene: Scene,
}

impl Picture {
    /// Its name; its files have the same.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// The figure as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        SvgBackend::new().render_scene(&self.scene)
    }

    /// The figure as a PNG file.
    ///
    /// # Errors
    /// When it cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>, FigureError> {
        RasterBackend::new()
            .with_scale(PIXELS_PER_UNIT)
            .render_scene(&self.scene)
            .map_err(|reason| FigureError::Raster { figure: self.name, reason })
    }
}

/// A sheet to draw on. Lengths are units of the SVG, from the upper left corner.
pub(super) struct Sheet {
    name: &'static str,
    scene: Scene,
    clips: usize,
}

/// The nearest whole pixel of the PNG: edges of cells that lie there show no seams.
pub(super) fn snapped(place: f64) -> f64 {
    let scale = f64::from(PIXELS_PER_UNIT);
    (scale * place).round() / scale
}

/// An opaque colour, `#rrggbb`.
pub(super) type Ink = &'static str;

/// Black for axes and text.
pub(super) const BLACK: Ink = "#000000";
/// For grid lines.
pub(super) const LIGHT_GREY: Ink = "#b8b8b8";
/// For data in the background.
pub(super) const GREY: Ink = "#8c8c8c";
/// The paper's theory.
pub(super) const RED: Ink = "#d62020";
/// The paper's averages.
pub(super) const BLUE: Ink = "#1f55c4";

/// For lines side by side: colours that colour-blind readers can distinguish (Okabe and Ito).
pub(super) const INKS: [Ink; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// A line's look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) ink: Ink,
    pub(super) width: f64,
    /// Lengths of dash and gap.
    pub(super) dashes: Option<(f64, f64)>,
}

impl Stroke {
    pub(super) const fn solid(ink: Ink, width: f64) -> Self {
        Self { ink, width, dashes: None }
    }

    pub(super) const fn dashed(ink: Ink, width: f64, dashes: (f64, f64)) -> Self {
        Self { ink, width, dashes: Some(dashes) }
    }
}

/// A disc's look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dot {
    pub(super) ink: Ink,
    pub(super) radius: f64,
    pub(super) opacity: f64,
}

impl Dot {
    pub(super) const fn solid(ink: Ink, radius: f64) -> Self {
        Self { ink, radius, opacity: 1.0 }
    }
}

/// A surface's look.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    pub(super) ink: Ink,
    pub(super) opacity: f64,
}

impl Sheet {
    pub(super) fn new(name: &'static str, (width, height): (f64, f64)) -> Self {
        let mut scene = Scene::new(width, height);
        scene.font_family = Some(FONTS.to_owned());
        scene.text_color = Some(BLACK.to_owned());
        Self { name, scene, clips: 0 }
    }

    pub(super) fn finish(self) -> Picture {
        Picture { name: self.name, scene: self.scene }
    }

    pub(super) fn line(&mut self, points: Vec<(f64, f64)>, stroke: Stroke) {
        // Dashed here: the raster would begin a new dash at every point.
        let lines = match stroke.dashes {
            Some((dash, gap)) => dashed(&points, dash, gap),
            None => vec![points],
        };
        for points in lines {
            self.scene.add(Primitive::PolyLine {
                points,
                stroke: Color::from(stroke.ink),
                stroke_width: stroke.width,
                stroke_dasharray: None,
            });
        }
    }

    /// A rectangle from its upper left corner.
    pub(super) fn rectangle(&mut self, [x, y, width, height]: [f64; 4], fill: Fill) {
        self.scene.add(Primitive::Rect {
            x,
            y,
            width,
            height,
            fill: Color::from(fill.ink),
            stroke: None,
            stroke_width: None,
            opacity: (fill.opacity < 1.0).then_some(fill.opacity),
        });
    }

    /// Rectangles x, y, width, height, each in its own colour.
    pub(super) fn rectangles(&mut self, cells: impl IntoIterator<Item = ([f64; 4], Color)>) {
        let (mut x, mut y, mut w, mut h, mut fills) = (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for ([left, top, width, height], fill) in cells {
            x.push(left);
            y.push(top);
            w.push(width);
            h.push(height);
            fills.push(fill);
        }
        self.scene.add(Primitive::RectBatch { x, y, w, h, fills });
    }

    pub(super) fn discs(&mut self, centres: impl IntoIterator<Item = (f64, f64)>, dot: Dot) {
        let (cx, cy) = centres.into_iter().unzip();
        self.scene.add(Primitive::CircleBatch {
            cx,
            cy,
            r: dot.radius,
            fill: Color::from(dot.ink),
            fill_opacity: (dot.opacity < 1.0).then_some(dot.opacity),
            stroke: None,
            stroke_width: None,
        });
    }

    /// A text on its base line, always upright: the raster makes turned text bold.
    pub(super) fn text(&mut self, (x, y): (f64, f64), text: &str, size: u32, anchor: Anchor) {
        let content = text.to_owned();
        self.scene.add(Primitive::Text { x, y, content, size, anchor, rotate: None, bold: false, color: None });
    }

    /// A text with the middle of its digits at this height.
    pub(super) fn centred_text(&mut self, (x, y): (f64, f64), text: &str, size: u32, anchor: Anchor) {
        self.text((x, y + 0.36 * f64::from(size)), text, size, anchor);
    }

    /// Shows what `draw` draws inside the rectangle only.
    pub(super) fn clipped(&mut self, [x, y, width, height]: [f64; 4], draw: impl FnOnce(&mut Self)) {
        let id = format!("frame-{}", self.clips);
        self.clips += 1;
        self.scene.defs.push(format!(
            r#"<clipPath id="{id}"><rect x="{x}" y="{y}" width="{width}" height="{height}"/></clipPath>"#
        ));
        self.scene.add(Primitive::ClipStart { x, y, width, height, id });
        draw(self);
        self.scene.add(Primitive::ClipEnd);
    }
}

/// Cuts a line into dashes.
fn dashed(points: &[(f64, f64)], dash: f64, gap: f64) -> Vec<Vec<(f64, f64)>> {
    let mut dashes = Vec::new();
    let (mut current, mut draws, mut left) = (Vec::new(), true, dash);
    for pair in points.windows(2) {
        let [(x, y), (end_x, end_y)] = [pair[0], pair[1]];
        let length = libm::hypot(end_x - x, end_y - y);
        let mut done = 0.0;
        while done < length {
            let at = |done: f64| (x + (end_x - x) * done / length, y + (end_y - y) * done / length);
            let step = left.min(length - done);
            if draws {
                if current.is_empty() {
                    current.push(at(done));
                }
                current.push(at(done + step));
            }
            done += step;
            left -= step;
            if left <= 0.0 {
                if draws {
                    dashes.push(std::mem::take(&mut current));
                }
                draws = !draws;
                left = if draws { dash } else { gap };
            }
        }
    }
    if !current.is_empty() {
        dashes.push(current);
    }
    dashes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_run_on_across_the_points_of_a_line() {
        let points: Vec<(f64, f64)> = (0..=100).map(|step| (f64::from(step) * 0.3, 0.0)).collect();
        let dashes = dashed(&points, 4.0, 2.0);
        assert_eq!(dashes.len(), 5);
        for (index, dash) in dashes.iter().enumerate() {
            assert!((dash[0].0 - 6.0 * index as f64).abs() < 1e-9);
            assert!((dash.last().unwrap().0 - dash[0].0 - 4.0).abs() < 1e-9);
        }
        assert!(dashed(&[(0.0, 0.0)], 4.0, 2.0).is_empty());
    }
}
