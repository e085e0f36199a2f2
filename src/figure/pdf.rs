//! A scene as a PDF of one page: vectors, and text in the letters of one embedded font, so that it can be searched and
//! looks the same everywhere. The same scene gives the same bytes on every machine.

use super::style::FACE;
use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, SystemInfo, UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str};
use std::collections::BTreeMap;
use subsetter::GlyphRemapper;
use ttf_parser::GlyphId;

const FONT: Name = Name(b"F");
/// Six letters and a plus mark a subset of a font.
const FONT_NAME: Name = Name(b"STICKS+DejaVuSans");
const SYSTEM: SystemInfo = SystemInfo {
    registry: Str(b"Adobe"),
    ordering: Str(b"Identity"),
    supplement: 0,
};
/// Units of widths and heights per em, in a PDF.
const EM: f32 = 1000.0;
const COMPRESSION: u8 = 8;

/// The scene, with this many points per unit.
pub(super) fn pdf(scene: &Scene, points: f64) -> Vec<u8> {
    let mut page = PdfPage {
        content: Content::new(),
        glyphs: GlyphRemapper::new(),
        letters: BTreeMap::new(),
        opacities: Vec::new(),
    };
    // From the upper left corner, downwards.
    let scale = single(points);
    let height = single(points * scene.height);
    page.content
        .transform([scale, 0.0, 0.0, -scale, 0.0, height]);
    page.content.set_line_join(LineJoinStyle::RoundJoin);
    for element in &scene.elements {
        page.draw(element);
    }
    page.write(single(points * scene.width), height)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a PDF has single precision"
)]
pub(super) const fn single(value: f64) -> f32 {
    value as f32
}

/// Red, green and blue from 0 to 1.
fn parts(color: &Color) -> [f32; 3] {
    match color {
        Color::Rgb(red, green, blue) => [*red, *green, *blue].map(|part| f32::from(part) / 255.0),
        _ => [0.0; 3],
    }
}

struct Letter {
    letter: char,
    /// In units of 1/1000 em.
    width: f32,
}

struct PdfPage {
    content: Content,
    /// Numbers of the letters in the embedded font.
    glyphs: GlyphRemapper,
    /// By number.
    letters: BTreeMap<u16, Letter>,
    /// One graphics state for each.
    opacities: Vec<f64>,
}

impl PdfPage {
    fn draw(&mut self, element: &Primitive) {
        match element {
            Primitive::PolyLine {
                points,
                stroke,
                stroke_width,
                ..
            } => self.line(points, parts(stroke), *stroke_width),
            Primitive::Rect {
                x,
                y,
                width,
                height,
                fill,
                opacity,
                ..
            } => {
                self.with_opacity(*opacity, |page| {
                    page.rectangle([*x, *y, *width, *height], parts(fill));
                });
            }
            Primitive::RectBatch { x, y, w, h, fills } => {
                for ((((&x, &y), &w), &h), fill) in x.iter().zip(y).zip(w).zip(h).zip(fills) {
                    self.rectangle([x, y, w, h], parts(fill));
                }
            }
            Primitive::CircleBatch {
                cx,
                cy,
                r,
                fill,
                fill_opacity,
                ..
            } => {
                self.with_opacity(*fill_opacity, |page| page.circles(cx, cy, *r, parts(fill)));
            }
            Primitive::Path(path) => {
                let fill = path.fill.as_ref().map_or([0.0; 3], parts);
                self.with_opacity(path.opacity, |page| page.polygon(&path.d, fill));
            }
            Primitive::Text {
                x,
                y,
                content,
                size,
                anchor,
                color,
                ..
            } => {
                let rgb = color.as_ref().map_or([0.0; 3], parts);
                self.text((*x, *y), content, *size, *anchor, rgb);
            }
            Primitive::ClipStart {
                x,
                y,
                width,
                height,
                ..
            } => {
                self.content.save_state();
                let [x, y, width, height] = [*x, *y, *width, *height].map(single);
                self.content
                    .rect(x, y, width, height)
                    .clip_nonzero()
                    .end_path();
            }
            Primitive::ClipEnd => {
                self.content.restore_state();
            }
            other => unreachable!("no picture has {other:?}"),
        }
    }

    fn line(&mut self, points: &[(f64, f64)], [red, green, blue]: [f32; 3], width: f64) {
        self.content
            .set_stroke_rgb(red, green, blue)
            .set_line_width(single(width));
        for (index, &(x, y)) in points.iter().enumerate() {
            let x = single(x);
            let y = single(y);
            let _ = if index == 0 {
                self.content.move_to(x, y)
            } else {
                self.content.line_to(x, y)
            };
        }
        self.content.stroke();
    }

    /// Of a path from corner to corner, as pictures write it.
    fn polygon(&mut self, path: &str, fill: [f32; 3]) {
        self.fill(fill);
        let numbers: Vec<f32> = path
            .split(' ')
            .filter_map(|part| part.parse().ok())
            .collect();
        for (index, corner) in numbers.chunks_exact(2).enumerate() {
            let _ = if index == 0 {
                self.content.move_to(corner[0], corner[1])
            } else {
                self.content.line_to(corner[0], corner[1])
            };
        }
        self.content.close_path().fill_nonzero();
    }

    fn fill(&mut self, [red, green, blue]: [f32; 3]) {
        self.content.set_fill_rgb(red, green, blue);
    }

    fn rectangle(&mut self, sides: [f64; 4], fill: [f32; 3]) {
        self.fill(fill);
        let [x, y, width, height] = sides.map(single);
        self.content.rect(x, y, width, height).fill_nonzero();
    }

    /// Points of a round pen: far shorter than curves. One by one: where dots overlap, faint ones add up.
    fn circles(&mut self, xs: &[f64], ys: &[f64], radius: f64, [red, green, blue]: [f32; 3]) {
        self.content.save_state();
        self.content
            .set_stroke_rgb(red, green, blue)
            .set_line_cap(LineCapStyle::RoundCap);
        self.content.set_line_width(single(2.0 * radius));
        for (&x, &y) in xs.iter().zip(ys) {
            let x = single(x);
            let y = single(y);
            self.content.move_to(x, y).line_to(x, y).stroke();
        }
        self.content.restore_state();
    }

    fn with_opacity(&mut self, opacity: Option<f64>, draw: impl FnOnce(&mut Self)) {
        let Some(opacity) = opacity else {
            return draw(self);
        };
        let known = self.opacities.iter().position(|known| *known == opacity);
        let index = known.unwrap_or_else(|| {
            self.opacities.push(opacity);
            self.opacities.len() - 1
        });
        self.content.save_state();
        self.content
            .set_parameters(Name(state_name(index).as_bytes()));
        draw(self);
        self.content.restore_state();
    }

    fn text(
        &mut self,
        (x, y): (f64, f64),
        text: &str,
        size: u32,
        anchor: TextAnchor,
        fill: [f32; 3],
    ) {
        let em = f32::from(FACE.units_per_em());
        let mut codes = Vec::new();
        let mut width = 0.0;
        for letter in text.chars() {
            let glyph = FACE.glyph_index(letter).unwrap_or(GlyphId(0));
            let advance = EM * f32::from(FACE.glyph_hor_advance(glyph).unwrap_or(0)) / em;
            let code = self.glyphs.remap(glyph.0);
            self.letters.entry(code).or_insert(Letter {
                letter,
                width: advance,
            });
            codes.extend(code.to_be_bytes());
            width += advance;
        }
        let size = single(f64::from(size));
        let shift = match anchor {
            TextAnchor::Start => 0.0,
            TextAnchor::Middle => 0.5,
            TextAnchor::End => 1.0,
        };
        self.fill(fill);
        let left = single(x) - shift * width * size / EM;
        self.content.begin_text().set_font(FONT, size);
        self.content
            .set_text_matrix([1.0, 0.0, 0.0, -1.0, left, single(y)]);
        self.content.show(Str(&codes)).end_text();
    }

    fn write(mut self, width: f32, height: f32) -> Vec<u8> {
        let mut next = Ref::new(1);
        let catalog = next.bump();
        let pages = next.bump();
        let page = next.bump();
        let content = next.bump();
        let font = next.bump();
        let states: Vec<Ref> = self.opacities.iter().map(|_| next.bump()).collect();
        let mut pdf = Pdf::new();
        pdf.catalog(catalog).pages(pages);
        pdf.pages(pages).kids([page]).count(1);
        let mut written = pdf.page(page);
        written
            .media_box(Rect::new(0.0, 0.0, width, height))
            .parent(pages)
            .contents(content);
        let mut resources = written.resources();
        resources.fonts().pair(FONT, font);
        let mut named = resources.ext_g_states();
        for (index, state) in states.iter().enumerate() {
            named.pair(Name(state_name(index).as_bytes()), *state);
        }
        named.finish();
        resources.finish();
        written.finish();
        for (&opacity, &state) in self.opacities.iter().zip(&states) {
            pdf.ext_graphics(state)
                .non_stroking_alpha(single(opacity))
                .stroking_alpha(single(opacity));
        }
        let drawn = std::mem::replace(&mut self.content, Content::new());
        pdf.stream(content, &compressed(&drawn.finish()))
            .filter(Filter::FlateDecode);
        self.write_font(&mut pdf, font, next);
        pdf.finish()
    }

    /// Writes the letters in use: their shapes, their widths, and the text that they stand for.
    fn write_font(&self, pdf: &mut Pdf, font: Ref, mut next: Ref) {
        let descendant = next.bump();
        let descriptor = next.bump();
        let file = next.bump();
        let to_unicode = next.bump();
        let mut whole = pdf.type0_font(font);
        whole
            .base_font(FONT_NAME)
            .encoding_predefined(Name(b"Identity-H"));
        whole.descendant_font(descendant).to_unicode(to_unicode);
        whole.finish();
        let mut cid = pdf.cid_font(descendant);
        cid.subtype(CidFontType::Type2)
            .base_font(FONT_NAME)
            .system_info(SYSTEM)
            .font_descriptor(descriptor);
        cid.cid_to_gid_map_predefined(Name(b"Identity"))
            .default_width(0.0);
        let mut widths = cid.widths();
        for (&code, &Letter { width, .. }) in &self.letters {
            widths.same(code, code, width);
        }
        widths.finish();
        cid.finish();
        let em = f32::from(FACE.units_per_em());
        let ems = |units: i16| EM * f32::from(units) / em;
        let bounds = FACE.global_bounding_box();
        let mut described = pdf.font_descriptor(descriptor);
        described
            .name(FONT_NAME)
            .flags(FontFlags::SYMBOLIC)
            .italic_angle(0.0)
            .stem_v(80.0)
            .font_file2(file);
        let sides = [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max];
        let [left, bottom, right, top] = sides.map(ems);
        described.bbox(Rect::new(left, bottom, right, top));
        described
            .ascent(ems(FACE.ascender()))
            .descent(ems(FACE.descender()));
        described.cap_height(ems(FACE.capital_height().unwrap_or(FACE.ascender())));
        described.finish();
        let mut cmap: UnicodeCmap = UnicodeCmap::new(Name(b"Letters"), SYSTEM);
        for (&code, &Letter { letter, .. }) in &self.letters {
            cmap.pair(code, letter);
        }
        pdf.cmap(to_unicode, &cmap.finish());
        let letters = subsetter::subset(FACE.raw_face().data, 0, &self.glyphs)
            .expect("the font of the program has its letters");
        pdf.stream(file, &compressed(&letters))
            .filter(Filter::FlateDecode);
    }
}

fn state_name(index: usize) -> String {
    format!("G{index}")
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    miniz_oxide::deflate::compress_to_vec_zlib(bytes, COMPRESSION)
}
