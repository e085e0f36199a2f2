//! Flags of `stickslip plot`: what a custom figure shows, and the look of figures.

use crate::figure::{CustomFigure, Format, Limits, Size, Style};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};

pub const CUSTOM_FIGURE: &str = "Custom figure";

#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = CUSTOM_FIGURE)]
pub struct CustomFlags {
    /// Column, or formula of columns such as 'Kd*Delta', on the x axis of a custom figure
    #[arg(long, value_name = "COLUMN", requires = "y")]
    x: Option<String>,
    /// Column on the y axis, with error bars if it has an interval; or a formula, without
    #[arg(long, value_name = "COLUMN", requires = "x")]
    y: Option<String>,
    /// Column that colours show, up to six values in the legend, more on a scale [default: what else was swept]
    #[arg(long, value_name = "COLUMN", requires = "x")]
    colour: Option<String>,
    /// Column whose values get a panel each, up to nine
    #[arg(long, value_name = "COLUMN", requires = "x")]
    panels: Option<String>,
    /// Logarithmic axes [default: where it was swept so, or values lie decades apart]
    #[arg(long, value_name = "AXES", requires = "x", value_parser = ["x", "y", "xy", "none"])]
    log: Option<String>,
    /// Ends of the x axis, in SI; either may be left out
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    xlim: Option<Limits>,
    /// Ends of the y axis, in SI
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    ylim: Option<Limits>,
    /// Label of the x axis [default: meaning, name and unit of the column]
    #[arg(long, value_name = "TEXT", requires = "x")]
    xlabel: Option<String>,
    /// Label of the y axis
    #[arg(long, value_name = "TEXT", requires = "x")]
    ylabel: Option<String>,
}

impl CustomFlags {
    /// The figure, if one is asked for.
    pub fn figure(&self) -> Option<CustomFigure> {
        let flags = self.clone();
        Some(CustomFigure {
            x: flags.x?,
            y: flags.y?,
            colour: flags.colour,
            panels: flags.panels,
            log: flags.log,
            xlim: flags.xlim.unwrap_or_default(),
            ylim: flags.ylim.unwrap_or_default(),
            xlabel: flags.xlabel,
            ylabel: flags.ylabel,
        })
    }
}

fn limits(text: &str) -> Result<Limits, &'static str> {
    const WANTED: &str = "must be LOW:HIGH with finite numbers, such as 1e-6:1e-3, 0: or :5";
    let end = |text: &str| match text.trim() {
        "" => Ok(None),
        number => number
            .parse()
            .ok()
            .filter(|end: &f64| end.is_finite())
            .map(Some)
            .ok_or(WANTED),
    };
    match text.split_once(':') {
        Some((low, high)) if text.trim() != ":" => Ok((end(low)?, end(high)?)),
        _ => Err(WANTED),
    }
}

/// `86mmx60mm`; lengths in mm, cm, in, pt or px, a pixel being 1/96 inch.
pub fn size(text: &str) -> Result<Size, &'static str> {
    // The x of px does not stand between sides.
    let between = text
        .match_indices('x')
        .map(|(at, _)| at)
        .find(|&at| !text[..at].ends_with('p'));
    let sides = between.and_then(|at| Some((length(&text[..at])?, length(&text[at + 1..])?)));
    let (width, height) = sides
        .ok_or("must be WIDTHxHEIGHT in mm, cm, in, pt or px, up to 2 m, such as 86mmx60mm")?;
    Ok(Size { width, height })
}

/// A length in mm.
fn length(text: &str) -> Option<f64> {
    /// Longest side in mm: a poster.
    const LONGEST: f64 = 2000.0;
    const INCH: f64 = 25.4;
    let (number, unit) = text.split_at(text.find(|c: char| c.is_ascii_alphabetic())?);
    let millimetres = match unit {
        "mm" => 1.0,
        "cm" => 10.0,
        "in" => INCH,
        "pt" => INCH / 72.0,
        "px" => INCH / 96.0,
        _ => return None,
    };
    let number: f64 = number.parse().ok()?;
    Some(number * millimetres).filter(|side| *side > 0.0 && *side <= LONGEST)
}

impl ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let value = PossibleValue::new(self.word());
        Some(match self {
            Self::Svg => value.help("Vectors, for the browser and for changes by hand"),
            Self::Png | Self::Pdf => value,
        })
    }
}

impl ValueEnum for Style {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Screen => "Pages and slides: 192 pixels per inch, as large as the data need",
            Self::Print => {
                "Journals: labels of 8 pt, lines from 0.5 pt, one or two columns wide, 600 pixels per inch; no small print"
            }
        };
        Some(PossibleValue::new(self.word()).help(help))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_end_of_an_axis_may_be_left_out() {
        assert_eq!(limits("1e-6:1e-3"), Ok((Some(1e-6), Some(1e-3))));
        assert_eq!(limits("-1:"), Ok((Some(-1.0), None)));
        assert_eq!(limits(":5"), Ok((None, Some(5.0))));
        for wrong in ["", ":", "1", "a:b", "1:nan", "1:2:3", "inf:"] {
            assert!(limits(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_are_read_in_their_units() {
        let mm = |text: &str| size(text).unwrap();
        assert_eq!(
            mm("86mmx60mm"),
            Size {
                width: 86.0,
                height: 60.0
            }
        );
        assert_eq!(
            mm("8.6cmx6cm"),
            Size {
                width: 86.0,
                height: 60.0
            }
        );
        assert!((mm("96pxx192px").height - 50.8).abs() < 1e-9);
        assert!((mm("72ptx1in").width - 25.4).abs() < 1e-9);
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
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
