//! The look of all figures: paper, sizes of text, strokes, colours. Lengths on a sheet are units, of which a style says how
//! long they are: text has the same size in every figure, whatever the size of the sheet.

use super::picture::{Dot, Fill, Ink, Stroke};
use crate::table::value::floored;
use clap::ValueEnum;
use kuva::render::color::Color;
use std::str::FromStr;

/// What a figure is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Style {
    /// Pages and slides: 192 pixels per inch, as large as the data need.
    #[default]
    Screen,
    /// Journals: labels of 8 pt, lines from 0.5 pt, one or two columns wide, 600 pixels per inch; no small print.
    Print,
}

/// Points, of 1/72 inch, per millimetre.
const POINTS_PER_MILLIMETRE: f64 = 72.0 / 25.4;
/// Widths of one and of two columns of a journal, in mm.
const COLUMNS: [f64; 2] = [86.0, 178.0];
/// Widest figure, in units, that goes into one column.
const MAX_ONE_COLUMN: f64 = 800.0;

impl Style {
    pub(super) const fn points(self) -> f64 {
        match self {
            Self::Screen => 0.75,
            Self::Print => 0.42,
        }
    }

    /// Pixels of a PNG per unit.
    pub(super) const fn pixels(self) -> f32 {
        match self {
            Self::Screen => 2.0,
            Self::Print => 3.5,
        }
    }

    /// Width of a sheet of which no size is asked and that is this wide in units.
    pub(super) fn width(self, natural: f64) -> f64 {
        match self {
            Self::Screen => natural,
            Self::Print => {
                COLUMNS[usize::from(natural > MAX_ONE_COLUMN)] * POINTS_PER_MILLIMETRE
                    / self.points()
            }
        }
    }

    /// A length of a sheet in mm.
    pub(super) fn millimetres(self, units: f64) -> f64 {
        units * self.points() / POINTS_PER_MILLIMETRE
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Width in mm.
    pub width: f64,
    /// Height in mm.
    pub height: f64,
}

impl Size {
    /// Width and height in units of a style.
    pub(super) fn units(self, style: Style) -> (f64, f64) {
        let units = |millimetres: f64| millimetres * POINTS_PER_MILLIMETRE / style.points();
        (units(self.width), units(self.height))
    }
}

/// `86mmx60mm`; lengths in mm, cm, in, pt or px, a pixel being 1/96 inch.
impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        /// Longest side in mm: a poster.
        const LONGEST: f64 = 2000.0;
        let length = |side: &str| {
            let (number, unit) = side.split_at(side.find(|c: char| c.is_ascii_alphabetic())?);
            let millimetres = match unit {
                "mm" => 1.0,
                "cm" => 10.0,
                "in" => 25.4,
                "pt" => 1.0 / POINTS_PER_MILLIMETRE,
                "px" => 25.4 / 96.0,
                _ => return None,
            };
            number
                .parse::<f64>()
                .ok()
                .map(|number| number * millimetres)
                .filter(|side| *side > 0.0 && *side <= LONGEST)
        };
        // The x of px is none between sides.
        let between = text
            .match_indices('x')
            .map(|(at, _)| at)
            .find(|&at| !text[..at].ends_with('p'));
        let sides = between.and_then(|at| Some((length(&text[..at])?, length(&text[at + 1..])?)));
        let (width, height) = sides
            .ok_or("must be WIDTHxHEIGHT in mm, cm, in, pt or px, up to 2 m, such as 86mmx60mm")?;
        Ok(Self { width, height })
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Look {
    pub style: Style,
    /// Their size; as the data need if it is not given.
    pub size: Option<Size>,
    /// Small print under them, or in the caption.
    pub note: String,
}

impl Look {
    /// The usual look of the figures of a sweep with this name.
    pub fn of_sweep(name: &str) -> Self {
        Self {
            note: format!("Sweep {name}"),
            ..Self::default()
        }
    }

    /// The same look with more small print.
    pub fn with_note(&self, more: &str) -> Self {
        let between = if self.note.is_empty() || more.is_empty() {
            ""
        } else {
            "; "
        };
        Self {
            note: format!("{}{between}{more}", self.note),
            ..self.clone()
        }
    }
}

/// Size of numbers at ticks.
pub(super) const TICK_TEXT: u32 = 16;
/// Size of the labels of axes.
pub(super) const LABEL_TEXT: u32 = 18;
/// Size of legends, and of labels in frames.
pub(super) const LEGEND_TEXT: u32 = 15;
pub(super) const NOTE_TEXT: u32 = 12;
/// The digits' middle over their base line, over the size of the text.
pub(super) const HALF_DIGIT: f64 = 0.36;

/// Black for axes and text.
pub(super) const BLACK: Ink = "#000000";
pub(super) const DARK_GREY: Ink = "#555555";
/// For data in the background.
pub(super) const GREY: Ink = "#8c8c8c";
pub(super) const LIGHT_GREY: Ink = "#b8b8b8";
pub(super) const WHITE: Ink = "#ffffff";
pub(super) const RED: Ink = "#d62020";
pub(super) const BLUE: Ink = "#1f55c4";
/// For lines side by side: colours that colour-blind readers can distinguish (Okabe and Ito).
pub const INKS: [Ink; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

/// For dots on a scale: the darker of the shades, which are seen on white.
pub const SCALE: [Ink; 10] = [
    "#abd4ce", "#8fc7c7", "#74b9c1", "#5ba9ba", "#4598b2", "#3586a8", "#2a749c", "#22618e",
    "#1e4e7c", "#1b3a68",
];

/// Border and ticks of a frame.
pub(super) const AXIS: Stroke = Stroke::solid(BLACK, 1.2);
/// Marks of whole numbers, zero, and the like, behind the data.
pub(super) const GRID: Stroke = Stroke::solid(LIGHT_GREY, 1.0);
/// What the data are compared with.
pub(super) const REFERENCE: Stroke = Stroke::dashed(GREY, 1.4, (6.0, 4.0));
pub(super) const BAR_WIDTH: f64 = 1.6;
/// A range that is pointed out.
pub(super) const STRIPE: Fill = Fill {
    ink: LIGHT_GREY,
    opacity: 0.35,
};
/// Radius of the dots of statistics.
pub(super) const RADIUS: f64 = 4.2;

/// The part of the drive alone of data in this ink.
pub(super) const fn drive_alone(ink: Ink) -> Stroke {
    Stroke::dashed(ink, 1.6, (3.0, 3.0))
}

pub(super) const fn dot(ink: Ink) -> Dot {
    Dot::solid(ink, RADIUS)
}

/// From pale, where nothing happens, to dark, in even steps of lightness: also for the colour-blind and in grey.
const SHADES: [[f64; 3]; 8] = [
    [250.0, 249.0, 244.0],
    [220.0, 233.0, 221.0],
    [176.0, 214.0, 207.0],
    [125.0, 190.0, 195.0],
    [78.0, 161.0, 183.0],
    [47.0, 128.0, 165.0],
    [33.0, 94.0, 140.0],
    [27.0, 58.0, 104.0],
];

/// From blue, below, by nearly white to red, above: also for the colour-blind (ends of RdBu, ColorBrewer).
const DIVERGING: [[f64; 3]; 3] = [
    [33.0, 102.0, 172.0],
    [247.0, 247.0, 247.0],
    [178.0, 24.0, 43.0],
];

/// A share from 0 to 1 as a colour on a light ground, pale at 0.
pub(super) fn shade(share: f64) -> Color {
    colour(mixed(&SHADES, share))
}

/// A share from 0 to 1 as a colour, pale at 1/2.
pub(super) fn diverging(share: f64) -> Color {
    colour(mixed(&DIVERGING, share))
}

fn colour([red, green, blue]: [f64; 3]) -> Color {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 255"
    )]
    let part = |part: f64| part.round() as u8;
    Color::Rgb(part(red), part(green), part(blue))
}

/// Black or white, whichever is read on this shade.
pub(super) fn ink_on(share: f64) -> Color {
    Color::from(if lightness(mixed(&SHADES, share)) < 0.55 {
        WHITE
    } else {
        BLACK
    })
}

fn mixed(colours: &[[f64; 3]], share: f64) -> [f64; 3] {
    let place = share.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let index = floored(place).min(colours.len() - 2);
    let part = place - index as f64;
    std::array::from_fn(|channel| {
        (1.0 - part) * colours[index][channel] + part * colours[index + 1][channel]
    })
}

/// Lightness from 0 to 1, of the parts of a colour as they are stored.
fn lightness([red, green, blue]: [f64; 3]) -> f64 {
    (0.299 * red + 0.587 * green + 0.114 * blue) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;

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
    }

    #[test]
    fn sizes_are_read_in_their_units() {
        let size = |text: &str| text.parse::<Size>().unwrap();
        assert_eq!(
            size("86mmx60mm"),
            Size {
                width: 86.0,
                height: 60.0
            }
        );
        assert_eq!(
            size("8.6cmx6cm"),
            Size {
                width: 86.0,
                height: 60.0
            }
        );
        assert!((size("96pxx192px").height - 50.8).abs() < 1e-9);
        assert!((size("72ptx1in").width - 25.4).abs() < 1e-9);
        for wrong in [
            "",
            "86mm",
            "86x60",
            "0mmx60mm",
            "-1mmx5mm",
            "nanmmx5mm",
            "9e9mmx5mm",
            "86mmx60furlong",
            "mmxmm",
            "µmxµm",
        ] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn print_is_one_or_two_columns_wide() {
        let width = |natural| Style::Print.millimetres(Style::Print.width(natural));
        assert!((width(660.0) - 86.0).abs() < 1e-9 && (width(1000.0) - 178.0).abs() < 1e-9);
    }
}
