//! Pictures: what is drawn, as SVG, PNG and PDF. The same data give the same bytes.

use super::options::BadOption;
use super::pdf::{pdf, single};
use super::style::{
    BLACK, Dot, FACE, Fill, HALF_DIGIT, Ink, Look, POINTS_PER_INCH, Size, Stroke, outline_of,
    text_width,
};
use crate::table::shown::shown_text;
use crate::table::value::words;
use anyhow::{Result, anyhow};
use kuva::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::render::color::Color;
pub(super) use kuva::render::render::TextAnchor as Anchor;
use kuva::render::render::{PathData, Primitive, Scene};
use std::collections::BTreeSet;

/// Fonts with the Greek letters and superscripts of the labels first. The PNG has DejaVu Sans built in.
const FONTS: &str = "DejaVu Sans, Verdana, Liberation Sans, Arial, sans-serif";

/// Symbols whose subscripts are not letters of the font; their size, in tenths, and how far below the line they stand.
const SUBSCRIPTED: [&str; 3] = ["K_d", "F_N", "F_S"];
const SMALL: u32 = 7;
const LOWER: f64 = 0.2;

/// Most pixels of a PNG, of 4 bytes each in memory: those of 420 mm x 420 mm in print.
const MAX_PIXELS: f64 = 1e8;

pub struct Picture {
    pub(super) name: String,
    pub(super) look: Look,
    /// Names of directories of which it shows nothing.
    pub(super) absent: Vec<String>,
    pub(super) scene: Scene,
}

words! {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum PictureFormat {
        Svg = "svg",
        Png = "png",
        Pdf = "pdf",
    }
}

impl PictureFormat {
    /// Those that figures get if none is asked for.
    pub const DEFAULT: [Self; 2] = [Self::Svg, Self::Png];

    /// What the help says of it.
    pub const fn description(self) -> Option<&'static str> {
        match self {
            Self::Svg => Some("Vectors, for the browser and for changes by hand"),
            Self::Png | Self::Pdf => None,
        }
    }
}

impl Picture {
    /// Its files have the same.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its small print, if that is left to the caption.
    pub fn caption(&self) -> Option<String> {
        (!self.look.has_caption()).then(|| self.note())
    }

    fn note(&self) -> String {
        let lines = std::iter::once(&self.look.note).chain(&self.look.directories);
        // Lines may be broken anywhere there.
        lines
            .map(|line| line.replace('\u{a0}', " "))
            .collect::<Vec<_>>()
            .join("\n")
    }

    /// Letters in its texts that its font lacks.
    pub(super) fn boxes(&self) -> BTreeSet<char> {
        let texts = self
            .scene
            .elements
            .iter()
            .filter_map(|primitive| match primitive {
                Primitive::Text { content, .. } => Some(content),
                _ => None,
            });
        let letters = texts.flat_map(|text| text.chars());
        letters
            .filter(|letter| FACE.glyph_index(*letter).is_none())
            .collect()
    }

    pub fn size(&self) -> Size {
        let unit = self.look.unit();
        let [width, height] =
            [self.scene.width, self.scene.height].map(|side| unit.millimetres(side));
        Size { width, height }
    }

    /// It is larger than asked if its frames would be too small to read.
    pub fn check_size(&self) -> Result<(), BadOption> {
        const SLACK: f64 = 1.001;
        let size = self.size();
        match self.look.size {
            Some(asked)
                if size.width > SLACK * asked.width || size.height > SLACK * asked.height =>
            {
                let problem = format!(
                    "--size: figure {} needs at least {:.0}mmx{:.0}mm with its legend and small print, and less in the style print",
                    self.name,
                    size.width.ceil(),
                    size.height.ceil()
                );
                Err(BadOption(problem))
            }
            _ => Ok(()),
        }
    }

    pub fn encoded(&self, format: PictureFormat) -> Result<Vec<u8>> {
        match format {
            PictureFormat::Svg => Ok(self.svg().into_bytes()),
            PictureFormat::Png => self.png(),
            PictureFormat::Pdf => Ok(pdf(&self.scene, self.look.unit().0)),
        }
    }

    pub fn svg(&self) -> String {
        let svg = SvgBackend::new().render_scene(&self.scene);
        if self.look.unit() == Look::default().unit() {
            return svg;
        }
        // The library gives sizes in pixels only, so a picture of this size holds it.
        let Size { width, height } = self.size();
        let sides = format!(r#"width="{width:.2}mm" height="{height:.2}mm""#);
        let units = format!("0 0 {:.2} {:.2}", self.scene.width, self.scene.height);
        format!(r#"<svg xmlns="http://www.w3.org/2000/svg" {sides} viewBox="{units}">{svg}</svg>"#)
    }

    pub fn png(&self) -> Result<Vec<u8>> {
        let scale = self.look.style.resolution() * self.look.unit().0 / POINTS_PER_INCH;
        let pixels = self.scene.width * self.scene.height * scale * scale;
        if pixels > MAX_PIXELS {
            return Err(BadOption(format!(
                "figure {}: a PNG of {:.0} million pixels is too large, the most is {:.0} million; take a smaller --size, \
                 or --format svg or pdf",
                self.name,
                1e-6 * pixels,
                1e-6 * MAX_PIXELS
            ))
            .into());
        }
        RasterBackend::new()
            .with_scale(single(scale))
            .render_scene(&self.scene)
            .map_err(|reason| anyhow!("figure {}: cannot be turned into PNG: {reason}", self.name))
    }
}

/// The nearest half of a unit, on a whole pixel of the PNG for screens: edges of cells that lie there show no seams.
pub(super) fn snapped(place: f64) -> f64 {
    (2.0 * place).round() / 2.0
}

/// Drawing. Lengths are units of the SVG, from the upper left corner.
impl Picture {
    pub(super) fn new(name: &str, look: &Look, (width, height): (f64, f64)) -> Self {
        let mut scene = Scene::new(width, height);
        scene.font_family = Some(FONTS.to_owned());
        scene.text_color = Some(BLACK.to_string());
        Self {
            name: name.to_owned(),
            look: look.clone(),
            absent: Vec::new(),
            scene,
        }
    }

    /// Where each text starts and ends, and what it says.
    #[cfg(test)]
    pub(super) fn texts(&self) -> Vec<(f64, f64, String)> {
        let text = |primitive: &Primitive| {
            let Primitive::Text {
                x,
                content,
                size,
                anchor,
                ..
            } = primitive
            else {
                return None;
            };
            let width = text_width(content, *size);
            let start = match anchor {
                Anchor::Start => *x,
                Anchor::Middle => x - 0.5 * width,
                Anchor::End => x - width,
            };
            Some((start, start + width, content.clone()))
        };
        self.scene.elements.iter().filter_map(text).collect()
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
                stroke: color(stroke.ink),
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
            fill: color(fill.ink),
            stroke: None,
            stroke_width: None,
            opacity: (fill.opacity < 1.0).then_some(fill.opacity),
        });
    }

    /// Rectangles x, y, width, height, each in its own colour.
    pub(super) fn rectangles(&mut self, cells: impl IntoIterator<Item = ([f64; 4], Ink)>) {
        let (sides, inks): (Vec<[f64; 4]>, Vec<Ink>) = cells.into_iter().unzip();
        let fills = inks.into_iter().map(color).collect();
        let [x, y, w, h] = [0, 1, 2, 3].map(|side| sides.iter().map(|sides| sides[side]).collect());
        self.scene.add(Primitive::RectBatch { x, y, w, h, fills });
    }

    pub(super) fn dots(&mut self, centres: impl IntoIterator<Item = (f64, f64)>, dot: Dot) {
        if let Some(polygon) = dot.shape {
            for centre in centres {
                self.polygon(&outline_of(polygon, dot.radius, centre), dot);
            }
            return;
        }
        let (cx, cy) = centres.into_iter().unzip();
        self.scene.add(Primitive::CircleBatch {
            cx,
            cy,
            r: dot.radius,
            fill: color(dot.ink),
            fill_opacity: (dot.opacity < 1.0).then_some(dot.opacity),
            stroke: None,
            stroke_width: None,
        });
    }

    /// A filled polygon, from corner to corner, in the look of a dot.
    fn polygon(&mut self, corners: &[(f64, f64)], dot: Dot) {
        let points = corners.iter().map(|(x, y)| format!("{x:.2} {y:.2}"));
        let path = points.collect::<Vec<_>>().join(" L ");
        self.scene.add(Primitive::Path(Box::new(PathData {
            d: format!("M {path} Z"),
            fill: Some(color(dot.ink)),
            stroke: Color::None,
            stroke_width: 0.0,
            opacity: (dot.opacity < 1.0).then_some(dot.opacity),
            stroke_dasharray: None,
        })));
    }

    /// A text on its base line, always upright: the raster makes turned text bold.
    pub(super) fn text(&mut self, place: (f64, f64), text: &str, size: u32, anchor: Anchor) {
        self.coloured_text(place, text, size, anchor, None);
    }

    pub(super) fn coloured_text(
        &mut self,
        (x, y): (f64, f64),
        text: &str,
        size: u32,
        anchor: Anchor,
        ink: Option<Ink>,
    ) {
        // XML has no way to write control characters, nor these two.
        let shown = shown_text(text).to_string();
        let content = shown.replace(['\u{fffe}', '\u{ffff}'], "\u{fffd}");
        let Some((before, (lower, after))) = subscript(&content) else {
            self.scene.add(Primitive::Text {
                x,
                y,
                content,
                size,
                anchor,
                rotate: None,
                bold: false,
                color: ink.map(color),
            });
            return;
        };
        let small = SMALL * size / 10;
        let parts = [
            (before, size, y),
            (lower, small, y + LOWER * f64::from(size)),
            (after, size, y),
        ];
        let width: f64 = parts
            .iter()
            .map(|(part, size, _)| text_width(part, *size))
            .sum();
        let mut start = match anchor {
            Anchor::Start => x,
            Anchor::Middle => x - 0.5 * width,
            Anchor::End => x - width,
        };
        for (part, size, y) in parts {
            self.coloured_text((start, y), part, size, Anchor::Start, ink);
            start += text_width(part, size);
        }
    }

    /// A text with the middle of its digits at this height.
    pub(super) fn centred_text(
        &mut self,
        (x, y): (f64, f64),
        text: &str,
        size: u32,
        anchor: Anchor,
    ) {
        self.text((x, y + HALF_DIGIT * f64::from(size)), text, size, anchor);
    }

    /// Shows what `draw` draws inside the rectangle only.
    pub(super) fn clipped(
        &mut self,
        [x, y, width, height]: [f64; 4],
        draw: impl FnOnce(&mut Self),
    ) {
        let id = format!("frame-{}", self.scene.defs.len());
        let inside = format!(r#"x="{x}" y="{y}" width="{width}" height="{height}""#);
        let clip = format!(r#"<clipPath id="{id}"><rect {inside}/></clipPath>"#);
        self.scene.defs.push(clip);
        self.scene.add(Primitive::ClipStart {
            x,
            y,
            width,
            height,
            id,
        });
        draw(self);
        self.scene.add(Primitive::ClipEnd);
    }
}

fn color(ink: Ink) -> Color {
    let Ink([red, green, blue]) = ink;
    Color::Rgb(red, green, blue)
}

/// What stands before the first symbol with a subscript such as `K_d`, that subscript, and what follows it.
fn subscript(text: &str) -> Option<(&str, (&str, &str))> {
    let place = SUBSCRIPTED
        .into_iter()
        .filter_map(|symbol| text.find(symbol))
        .min()?;
    let (before, rest) = text.split_at_checked(place + 1)?;
    Some((before, rest.get(1..)?.split_at_checked(1)?))
}

/// Cuts a line into dashes.
fn dashed(points: &[(f64, f64)], dash: f64, gap: f64) -> Vec<Vec<(f64, f64)>> {
    let mut dashes = Vec::new();
    let mut current = Vec::new();
    let mut draws = true;
    let mut left = dash;
    for pair in points.windows(2) {
        let [(x, y), (end_x, end_y)] = [pair[0], pair[1]];
        let length = libm::hypot(end_x - x, end_y - y);
        let mut done = 0.0;
        while done < length {
            let at = |done: f64| {
                (
                    x + (end_x - x) * done / length,
                    y + (end_y - y) * done / length,
                )
            };
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
    fn symbols_are_split_before_their_subscripts_and_names_are_not() {
        assert_eq!(
            subscript("K = 1, K_d = 2, F_N"),
            Some(("K = 1, K", ("d", " = 2, F_N")))
        );
        assert_eq!(subscript("my_sweep, T_to, K"), None);
    }

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
