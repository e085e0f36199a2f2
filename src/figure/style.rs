//! The look of all figures: paper, font, sizes of text, strokes, dots, colours. Lengths on a sheet are units; a style
//! says how long a unit is. Text has the same size in every figure, whatever the size of the sheet.

use crate::table::value::{floored, words};
use std::f64::consts::TAU;
use std::fmt;
use std::sync::LazyLock;
use ttf_parser::{Face, GlyphId};

/// A point of data, or of a sheet.
pub(super) type Place = (f64, f64);

words! {
    /// What a figure is for.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Style {
        #[default]
        Screen = "screen",
        Print = "print",
    }
}

pub(super) const POINTS_PER_INCH: f64 = 72.0;
const POINTS_PER_MILLIMETRE: f64 = POINTS_PER_INCH / 25.4;
/// Widths of one and of two columns of a journal, in mm.
const COLUMNS: [f64; 2] = [86.0, 178.0];
/// Widest figure, in units, that goes into one column.
const MAX_ONE_COLUMN: f64 = 800.0;

impl Style {
    /// What the help says of it.
    pub const fn description(self) -> Option<&'static str> {
        Some(match self {
            Self::Screen => "Pages and slides: 192 pixels per inch, as large as the data need",
            Self::Print => {
                "Journals: labels of 8 pt, lines from 0.5 pt, one or two columns wide, 600 pixels per inch; no small print"
            }
        })
    }

    /// Of a PNG, in pixels per inch.
    pub(super) const fn resolution(self) -> f64 {
        match self {
            Self::Screen => 192.0,
            Self::Print => 600.0,
        }
    }
}

/// The length of a unit, in points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit(pub(super) f64);

impl Unit {
    pub(super) fn of_millimetres(self, millimetres: f64) -> f64 {
        millimetres * POINTS_PER_MILLIMETRE / self.0
    }

    pub(super) fn millimetres(self, units: f64) -> f64 {
        units * self.0 / POINTS_PER_MILLIMETRE
    }
}

/// In mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    pub width: f64,
    pub height: f64,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    pub style: Style,
    /// Their size; as the data need if it is not given.
    pub size: Option<Size>,
    /// Size of the labels of axes, in points; that of the style if it is not given. All else is in proportion.
    pub font: Option<f64>,
    /// Whether the small print is left to the caption, as it always is in print.
    pub no_caption: bool,
    /// Small print under them, or in the caption.
    pub note: String,
    /// A line of small print for each of several directories: in what it differs from others.
    pub directories: Vec<String>,
}

impl Look {
    /// The usual look of the figures of a sweep with this name.
    pub fn of_sweep(name: &str) -> Self {
        Self {
            note: format!("Sweep {name}"),
            ..Self::default()
        }
    }

    pub(super) fn unit(&self) -> Unit {
        let of_style = match self.style {
            Style::Screen => 0.75,
            Style::Print => 0.42,
        };
        let of_font = self.font.map(|points| points / f64::from(LABEL_TEXT));
        Unit(of_font.unwrap_or(of_style))
    }

    /// Width and height that are asked for, in units.
    pub(super) fn asked(&self) -> Option<(f64, f64)> {
        let units = |millimetres| self.unit().of_millimetres(millimetres);
        self.size
            .map(|size| (units(size.width), units(size.height)))
    }

    /// Width of a sheet of this natural width, in units, if no size is asked for.
    pub(super) fn width(&self, natural: f64) -> f64 {
        match self.style {
            Style::Screen => natural,
            Style::Print => {
                let columns = usize::from(natural > MAX_ONE_COLUMN);
                self.unit().of_millimetres(COLUMNS[columns])
            }
        }
    }

    /// Whether the small print stands under the figure.
    pub(super) fn has_caption(&self) -> bool {
        self.style == Style::Screen && !self.no_caption
    }

    /// The same look with more small print.
    pub fn with_note(&self, more: &str) -> Self {
        let both = [&*self.note, more].into_iter();
        let notes: Vec<&str> = both.filter(|note| !note.is_empty()).collect();
        Self {
            note: notes.join("; "),
            ..self.clone()
        }
    }
}

pub(super) const TICK_TEXT: u32 = 16;
pub(super) const LABEL_TEXT: u32 = 18;
/// Size of legends, and of labels in frames.
pub(super) const LEGEND_TEXT: u32 = 15;
pub(super) const NOTE_TEXT: u32 = 12;
/// The digits' middle over their base line, over the size of the text.
pub(super) const HALF_DIGIT: f64 = 0.36;

/// The font of all figures.
pub(super) static FACE: LazyLock<Face<'static>> = LazyLock::new(|| {
    let file = dejavu::sans::regular();
    Face::parse(file, 0).expect("the font of the program can be read")
});

/// Width of a text of this size.
pub(super) fn text_width(text: &str, size: u32) -> f64 {
    let advance = |letter: char| {
        let glyph = FACE.glyph_index(letter).unwrap_or(GlyphId(0));
        f64::from(FACE.glyph_hor_advance(glyph).unwrap_or(0)) / f64::from(FACE.units_per_em())
    };
    f64::from(size) * text.chars().map(advance).sum::<f64>()
}

/// An opaque colour: red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ink(pub [u8; 3]);

impl Ink {
    /// From `0xrrggbb`.
    pub(super) const fn new(code: u32) -> Self {
        let [_, red, green, blue] = code.to_be_bytes();
        Self([red, green, blue])
    }
}

/// `#rrggbb`.
impl fmt::Display for Ink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [red, green, blue] = self.0;
        write!(f, "#{red:02x}{green:02x}{blue:02x}")
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Stroke {
    pub(super) ink: Ink,
    pub(super) width: f64,
    /// Lengths of dash and gap.
    pub(super) dashes: Option<(f64, f64)>,
}

impl Stroke {
    pub(super) const fn solid(ink: Ink, width: f64) -> Self {
        Self {
            ink,
            width,
            dashes: None,
        }
    }

    pub(super) const fn dashed(ink: Ink, width: f64, dashes: (f64, f64)) -> Self {
        Self {
            ink,
            width,
            dashes: Some(dashes),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Dot {
    pub(super) ink: Ink,
    pub(super) radius: f64,
    pub(super) opacity: f64,
    /// None of a disc.
    pub(super) shape: Option<Polygon>,
}

impl Dot {
    pub(super) const fn solid(ink: Ink, radius: f64) -> Self {
        Self {
            ink,
            radius,
            opacity: 1.0,
            shape: None,
        }
    }

    pub(super) const fn with_shape(self, shape: Option<Polygon>) -> Self {
        Self { shape, ..self }
    }

    pub(super) const fn with_opacity(self, opacity: f64) -> Self {
        Self { opacity, ..self }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    pub(super) ink: Ink,
    pub(super) opacity: f64,
}

/// Black for axes and text.
pub(super) const BLACK: Ink = Ink::new(0x00_00_00);
pub(super) const DARK_GREY: Ink = Ink::new(0x55_55_55);
/// For data in the background.
pub(super) const GREY: Ink = Ink::new(0x8c_8c_8c);
pub(super) const LIGHT_GREY: Ink = Ink::new(0xb8_b8_b8);
pub(super) const WHITE: Ink = Ink::new(0xff_ff_ff);
pub(super) const RED: Ink = Ink::new(0xd6_20_20);
pub(super) const BLUE: Ink = Ink::new(0x1f_55_c4);
/// For lines side by side: colours that colour-blind readers can distinguish (Okabe and Ito).
pub const INKS: [Ink; 6] = [
    Ink::new(0x00_72_b2),
    Ink::new(0xd5_5e_00),
    Ink::new(0x00_9e_73),
    Ink::new(0xcc_79_a7),
    Ink::new(0xe6_9f_00),
    Ink::new(0x56_b4_e9),
];

/// For dots on a scale: ten steps that differ in hue and lightness, dark for large values.
pub static SCALE: LazyLock<[Ink; 10]> =
    LazyLock::new(|| std::array::from_fn(|step| ink(mixed(&HUES, step as f64 / 9.0))));

/// Of viridis (matplotlib), from its end, without the yellow that is not seen on white.
const HUES: [u32; 4] = [0xa0_da_39, 0x1f_a1_87, 0x36_5c_8d, 0x44_01_54];

/// Border and ticks of a frame.
pub(super) const AXIS: Stroke = Stroke::solid(BLACK, 1.2);
/// Marks of whole numbers, zero, and the like, behind the data.
pub(super) const GRID: Stroke = Stroke::solid(LIGHT_GREY, 1.0);
/// What the data are compared with.
pub(super) const REFERENCE: Stroke = Stroke::dashed(GREY, 1.4, (6.0, 4.0));
pub(super) const BAR_WIDTH: f64 = 1.6;
/// A highlighted range.
pub(super) const STRIPE: Fill = Fill {
    ink: LIGHT_GREY,
    opacity: 0.35,
};
/// Radius of the dots of statistics.
pub(super) const RADIUS: f64 = 4.2;

/// A regular polygon: its number of corners, and where the first lies, clockwise from the top, in steps from corner to
/// corner.
pub(super) type Polygon = (u32, f64);

pub(super) const SQUARE: Polygon = (4, 0.5);
const DIAMOND: Polygon = (4, 0.0);
const TRIANGLE: Polygon = (3, 0.0);
const TURNED_TRIANGLE: Polygon = (3, 0.5);
pub(super) const PENTAGON: Polygon = (5, 0.0);

/// Of dots: they distinguish series in grey, too.
pub(super) const SHAPES: [Option<Polygon>; INKS.len()] = [
    None,
    Some(SQUARE),
    Some(TRIANGLE),
    Some(DIAMOND),
    Some(TURNED_TRIANGLE),
    Some(PENTAGON),
];

/// Of the hollow marks of other directories.
pub(super) const HOLLOW: [Polygon; 5] = [DIAMOND, TRIANGLE, PENTAGON, TURNED_TRIANGLE, SQUARE];

/// The outline of a polygon around a place of a sheet, about as large as a disc of this radius.
pub(super) fn outline_of((corners, first): Polygon, radius: f64, (x, y): Place) -> Vec<Place> {
    let corner = |number: u32| {
        let turn = TAU * (f64::from(number) + first) / f64::from(corners);
        let radius = 1.3 * radius;
        (x + radius * libm::sin(turn), y - radius * libm::cos(turn))
    };
    (0..=corners).map(corner).collect()
}

/// The part of the drive alone of data in this ink.
pub(super) const fn drive_alone(ink: Ink) -> Stroke {
    Stroke::dashed(ink, 1.6, (3.0, 3.0))
}

/// From pale, where nothing happens, to dark, in even steps of lightness: also for the colour-blind and in grey.
const SHADES: [u32; 8] = [
    0xfa_f9_f4, 0xdc_e9_dd, 0xb0_d6_cf, 0x7d_be_c3, 0x4e_a1_b7, 0x2f_80_a5, 0x21_5e_8c, 0x1b_3a_68,
];

/// From blue, below, by nearly white to red, above: also for the colour-blind (ends of RdBu, ColorBrewer).
const DIVERGING: [u32; 3] = [0x21_66_ac, 0xf7_f7_f7, 0xb2_18_2b];

/// A share from 0 to 1 as a colour on a light ground, pale at 0.
pub(super) fn shade(share: f64) -> Ink {
    ink(mixed(&SHADES, share))
}

/// A share from 0 to 1 as the colour of a cell, which differs from the paper also at 0.
pub(super) fn cell_shade(share: f64) -> Ink {
    shade(0.18 + 0.82 * share)
}

/// A share from 0 to 1 as a colour, pale at 1/2.
pub(super) fn diverging(share: f64) -> Ink {
    ink(mixed(&DIVERGING, share))
}

fn ink([red, green, blue]: [f64; 3]) -> Ink {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 255"
    )]
    let part = |part: f64| part.round() as u8;
    Ink([part(red), part(green), part(blue)])
}

fn mixed(colours: &[u32], share: f64) -> [f64; 3] {
    let place = share.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let index = floored(place).min(colours.len() - 2);
    let part = place - index as f64;
    let [from, to] = [index, index + 1].map(|index| Ink::new(colours[index]).0.map(f64::from));
    std::array::from_fn(|channel| (1.0 - part) * from[channel] + part * to[channel])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From 0 to 1, of the parts of a colour as they are stored.
    fn lightness([red, green, blue]: [f64; 3]) -> f64 {
        (0.299 * red + 0.587 * green + 0.114 * blue) / 255.0
    }

    #[test]
    fn shades_darken_in_even_steps() {
        let steps: Vec<f64> = (0..70)
            .map(|step| {
                lightness(mixed(&SHADES, f64::from(step) / 70.0))
                    - lightness(mixed(&SHADES, f64::from(step + 1) / 70.0))
            })
            .collect();
        let mean = steps.iter().sum::<f64>() / 70.0;
        assert!(
            steps
                .iter()
                .all(|step| (0.6 * mean..1.4 * mean).contains(step)),
            "{steps:?}"
        );
        assert!(lightness(mixed(&SHADES, 0.0)) > 0.95);
        let Ink(faintest) = cell_shade(0.0);
        assert!(
            lightness(faintest.map(f64::from)) < 0.9,
            "a cell is no paper"
        );
    }

    #[test]
    fn print_is_one_or_two_columns_wide() {
        let look = Look {
            style: Style::Print,
            ..Look::default()
        };
        let width = |natural| look.unit().millimetres(look.width(natural));
        assert!((width(660.0) - 86.0).abs() < 1e-9 && (width(1000.0) - 178.0).abs() < 1e-9);
    }

    type Matrix = [[f64; 3]; 3];

    fn times(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
        matrix.map(|row| row.iter().zip(vector).map(|(part, with)| part * with).sum())
    }

    /// CIE L*a*b* at D65 of a colour as it is seen.
    fn perceived(Ink(parts): Ink, seen: &Matrix) -> [f64; 3] {
        const XYZ: Matrix = [
            [0.412_456_4, 0.357_576_1, 0.180_437_5],
            [0.212_672_9, 0.715_152_2, 0.072_175_0],
            [0.019_333_9, 0.119_192_0, 0.950_304_1],
        ];
        let linear = parts.map(|part| match f64::from(part) / 255.0 {
            dark if dark <= 0.040_45 => dark / 12.92,
            part => libm::pow((part + 0.055) / 1.055, 2.4),
        });
        let seen = times(seen, linear).map(|part| part.clamp(0.0, 1.0));
        let [x, y, z] = times(&XYZ, seen);
        let root = |share: f64| match share {
            dark if dark <= 0.008_856 => 7.787 * dark + 16.0 / 116.0,
            share => libm::cbrt(share),
        };
        let [x, y, z] = [x / 0.950_47, y, z / 1.088_83].map(root);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// Of linear red, green and blue, without cones for long, medium and short waves (G. M. Machado et al., IEEE Trans.
    /// Vis. Comput. Graph. 15, 1291 (2009)); and of all.
    const SEEN: [Matrix; 4] = [
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    ];

    #[test]
    fn colour_blind_readers_tell_the_inks_apart_and_scales_darken_for_all() {
        /// A difference of 2.3 is just noticeable.
        const CLEAR: f64 = 15.0;
        for seen in &SEEN {
            for (number, &ink) in INKS.iter().enumerate() {
                for &other in &INKS[..number] {
                    let pair = [ink, other].map(|ink| perceived(ink, seen));
                    let squares = pair[0]
                        .iter()
                        .zip(pair[1])
                        .map(|(own, other)| (own - other).powi(2));
                    let distance = squares.sum::<f64>().sqrt();
                    assert!(distance > CLEAR, "{ink} and {other}: {distance}");
                }
            }
            for (name, scale) in [
                ("dots", SCALE.to_vec()),
                (
                    "cells",
                    (0..10)
                        .map(|step| cell_shade(f64::from(step) / 9.0))
                        .collect(),
                ),
            ] {
                let lightness: Vec<f64> = scale
                    .into_iter()
                    .map(|ink| perceived(ink, seen)[0])
                    .collect();
                let darkens = lightness.windows(2).all(|pair| pair[0] > pair[1] + 2.3);
                assert!(darkens, "{name}: {lightness:?}");
            }
        }
    }

    #[test]
    fn widths_are_those_of_the_letters() {
        assert!((text_width("nn", 10) - 2.0 * text_width("n", 10)).abs() < 1e-12);
        assert!(text_width("m", 10) > 2.0 * text_width("i", 10) && text_width("", 10) == 0.0);
        assert!(text_width("φₘᵢₙ", 10) < text_width("φmin", 10));
    }
}
