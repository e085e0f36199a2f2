//! Inks, and what is drawn with them: strokes, dots, fills. Alone in knowing the colours of kuva.

use kuva::render::color::Color;
use std::fmt;

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

pub(super) fn color(ink: Ink) -> Color {
    let Ink([red, green, blue]) = ink;
    Color::Rgb(red, green, blue)
}

/// Red, green and blue from 0 to 1.
pub(super) fn parts(color: &Color) -> [f32; 3] {
    match color {
        Color::Rgb(red, green, blue) => [*red, *green, *blue].map(|part| f32::from(part) / 255.0),
        _ => [0.0; 3],
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
}

impl Dot {
    pub(super) const fn solid(ink: Ink, radius: f64) -> Self {
        Self {
            ink,
            radius,
            opacity: 1.0,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Fill {
    pub(super) ink: Ink,
    pub(super) opacity: f64,
}
