//! `stickslip plot`: reduced data to figures, the standing ones or a custom one.

use super::output::{self, TextTable};
use super::{Exit, UsageError, choice, layout};
use crate::figure::{
    AxisLimits, Beside, CustomFigure, Dots, Drawn, Look, Picture, PictureFormat, Size, Style,
    draw_all, draw_custom, draw_where, measured_trace, remarks, write,
};
use crate::measured::stretch;
use crate::reduce::{SlipOfSet, read_sets, renew, sample_of_slips};
use crate::results::Results;
use crate::results::destination::Destination;
use crate::results::layout::Layout;
use crate::sets::SetRow;
use crate::table::columns::{Column, Row as _};
use crate::table::shown::shown;
use anyhow::Result;
use clap::Args;
use std::path::{Path, PathBuf};

/// Draw the figures of a results directory, or a custom figure; first makes reduced data again that are out of date
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR", required_unless_present = "list")]
    directory: Option<PathBuf>,
    /// List the columns that can be drawn, with units and meanings
    #[arg(long)]
    list: bool,
    /// Formats, separated by commas
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "svg,png",
        value_parser = choice(&PictureFormat::ALL, PictureFormat::word, PictureFormat::description)
    )]
    format: Vec<PictureFormat>,
    /// Size in mm, cm, in, pt or px, such as 86mmx60mm [default: what the data need; in print one or two columns wide]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size)]
    size: Option<Size>,
    /// Style
    #[arg(
        long,
        default_value = "screen",
        value_parser = choice(&Style::ALL, Style::word, Style::description)
    )]
    style: Style,
    /// Size of the labels of axes in points, such as 14 for slides; all else is in proportion [default: 13.5, in print
    /// 7.6]
    #[arg(long, value_name = "POINTS", value_parser = font)]
    font: Option<f64>,
    /// Leave the small print to the caption; that of a custom figure is printed
    #[arg(long)]
    no_caption: bool,
    /// Another results directory, computed or measured, as hollow marks in phi-eta, overview and custom figures
    /// of sets. Repeatable
    #[arg(long = "with", value_name = "DIR")]
    others: Vec<PathBuf>,
    /// Name of a directory in legends, in their order, the first one's first; repeat it for each [default: their last
    /// folders, or the paths of those whose last folders are the same]
    #[arg(long, value_name = "NAME", requires = "others")]
    legend: Vec<String>,
    /// Draw the measured force itself from this time on, in s, with its slips
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["x", "others"])]
    from: Option<f64>,
    /// Draw it until this time, in s
    #[arg(long, value_name = "SECONDS", conflicts_with_all = ["x", "others"])]
    until: Option<f64>,
    #[command(flatten)]
    custom: CustomFlags,
    /// File of the custom figure; its ending is the format [default: DIR/figures/Y-X.svg and .png]
    #[arg(
        short,
        long,
        value_name = "FILE",
        requires = "x",
        conflicts_with = "format",
        help_heading = CUSTOM_FIGURE
    )]
    out: Option<PathBuf>,
}

const EXAMPLES: &str = "\
Examples:
  stickslip plot results/fig3                                          the standing figures, as SVG and PNG
  stickslip plot results/fig3 --format pdf --style print               for a paper
  stickslip plot results/fig3 --where 'V0 < 1e-5' --font 14 --no-caption --size 240mmx135mm  some sets, for a slide
  stickslip plot --list                                                the columns that can be drawn
  stickslip plot results/sliding-velocity --x V0 --y tau_mean --log xy
  stickslip plot results/fig3 --x eta --y phase_mean --colour V0 --panels Delta --log x -o phase.pdf
  stickslip plot results/mine --with results/fig3                      measured slips beside the model
  stickslip plot results/mine --from 12 --until 15                     a stretch of the trace that slips came from
  stickslip plot results/friction --x Delta --y mean_friction --colour T --xlim 0:4e-6 \\
    --size 86mmx60mm --style print --format pdf";

impl Arguments {
    fn look(&self, results: &Results<'_>) -> Look {
        Look {
            style: self.style,
            size: self.size,
            font: self.font,
            no_caption: self.no_caption,
            ..Look::of_sweep(results.sweep().name())
        }
    }
}

pub fn plot(arguments: &Arguments) -> Result<Exit> {
    if arguments.list {
        output::print(&list())?;
    }
    let Some(directory) = &arguments.directory else {
        return Ok(Exit::Done);
    };
    let out = arguments.out.as_deref().map(picture_file).transpose()?;
    let results = renew(&Results::read(&layout(directory))?)?;
    let layout = results.layout();
    let look = arguments.look(&results);
    let layouts: Vec<Layout<'_>> = arguments
        .others
        .iter()
        .map(|other| self::layout(other))
        .collect();
    let renewed = layouts.iter().map(|other| renew(&Results::read(other)?));
    let others = renewed.collect::<Result<Vec<Results<'_>>>>()?;
    if arguments.from.or(arguments.until).is_some() {
        let picture = trace(&results, arguments, &look)?;
        let files = write(layout, &[picture], &arguments.format)?;
        output::lines(files.iter().map(|path| shown(path).to_string()))?;
        return Ok(Exit::Done);
    }
    let beside = Beside::read(&results, &others, &arguments.legend)?;
    if arguments.custom.of == Dots::Slips && !others.is_empty() {
        let problem = "--with: figures of slips show one directory; leave --of slips out";
        return Err(UsageError(problem.to_owned()).into());
    }
    let drawn = if let Some(figure) = arguments.custom.figure() {
        let picture = draw_custom(&results, &beside, &figure, &look)?;
        if let Some(caption) = picture.caption() {
            output::report(&format!("for the caption: {caption}"));
        }
        let remarks = remarks(std::slice::from_ref(&picture));
        let files = match &out {
            None => write(layout, &[picture], &arguments.format)?,
            Some((out, format)) => {
                picture.check_size()?;
                output::write(out, &picture.encoded(*format)?)?;
                arguments.out.iter().cloned().collect()
            }
        };
        Drawn { files, remarks }
    } else if let Some(condition) = &arguments.custom.condition {
        if !others.is_empty() {
            let problem = "--where: standing figures of several directories show all sets; leave --with out, or ask for a custom figure with --x and --y";
            return Err(UsageError(problem.to_owned()).into());
        }
        draw_where(&results, condition, &look, &arguments.format)?
    } else {
        draw_all(layout, &beside, &look, &arguments.format)?
    };
    for remark in &drawn.remarks {
        output::report(remark);
    }
    if drawn.files.is_empty() {
        output::report("there is nothing to draw: no set has a result");
    }
    output::lines(drawn.files.iter().map(|path| shown(path).to_string()))?;
    Ok(Exit::Done)
}

/// A stretch of the trace that slips came from.
fn trace(results: &Results<'_>, arguments: &Arguments, look: &Look) -> Result<Picture> {
    let sweep = results.sweep();
    let measured = sweep.measured().ok_or_else(|| {
        UsageError(
            "--from, --until: slips were computed; `simulate --plot` draws their trace".into(),
        )
    })?;
    let [from, until] = [
        arguments.from.unwrap_or(0.0),
        arguments.until.unwrap_or(f64::INFINITY),
    ];
    let refused = |error: anyhow::Error| UsageError(format!("{error:#}"));
    let trace = stretch(measured, from..=until).map_err(refused)?;
    let sets = read_sets(results.layout()).collect::<Result<Vec<_>, _>>()?;
    let slips = sample_of_slips(results, &sets, None)?.kept;
    let onsets: Vec<f64> = slips.iter().map(|slip| slip.1.1.onset).collect();
    let mut parameters = sweep
        .jobs_of_grid()
        .next()
        .map(|job| job.parameters)
        .unwrap_or_default();
    if trace.has_maximum {
        // The modulation is drawn with a maximum at 0.
        parameters.modulation_period = None;
    }
    Ok(measured_trace(look, &parameters, &trace.samples, &onsets).map_err(refused)?)
}

/// Where a picture goes, and the format that the name ends in.
pub fn picture_file(file: &Path) -> Result<(Destination, PictureFormat)> {
    let extension = file.extension().and_then(|extension| extension.to_str());
    match extension.and_then(PictureFormat::from_word) {
        Some(format) => Ok((Destination::new(file, format.word())?, format)),
        None => Err(UsageError(format!("{}: must end in .svg, .png or .pdf", shown(file))).into()),
    }
}

/// The columns of sets and of slips.
fn list() -> String {
    let sets = described(&SetRow::columns());
    let slips = described(&SlipOfSet::columns());
    format!("{sets}\nwith --of slips:\n{slips}")
}

fn described(described: &[Column]) -> String {
    let mut columns = TextTable::default();
    columns.words("", described, |column| column.name.to_string());
    columns.words("", described, |column| column.unit.to_owned());
    columns.words("", described, |column| column.meaning.to_owned());
    columns.to_string()
}

const CUSTOM_FIGURE: &str = "Custom figure";

#[derive(Clone, Debug, Default, Args)]
#[command(next_help_heading = CUSTOM_FIGURE)]
struct CustomFlags {
    /// What has a dot each; of more than 20,000 slips, a sample
    #[arg(
        long,
        value_name = "ROWS",
        default_value = "sets",
        requires = "x",
        value_parser = choice(&Dots::ALL, Dots::word, |_| None)
    )]
    of: Dots,
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
    /// Only sets, or slips with --of slips, for which a condition on their columns, by name or heading, holds, in SI; the
    /// names of standing figures then end in -where
    #[arg(long = "where", value_name = "CONDITION", allow_hyphen_values = true)]
    condition: Option<String>,
    /// Logarithmic axes [default: where it was swept so, or values lie decades apart]
    #[arg(long, value_name = "AXES", requires = "x", value_parser = ["x", "y", "xy", "none"])]
    log: Option<String>,
    /// Ends of the x axis, in SI; either may be left out
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    xlim: Option<AxisLimits>,
    /// Ends of the y axis, in SI
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    ylim: Option<AxisLimits>,
    /// Label of the x axis [default: meaning, name and unit of the column]
    #[arg(long, value_name = "TEXT", requires = "x")]
    xlabel: Option<String>,
    /// Label of the y axis
    #[arg(long, value_name = "TEXT", requires = "x")]
    ylabel: Option<String>,
}

impl CustomFlags {
    /// The figure, if one is asked for.
    fn figure(&self) -> Option<CustomFigure> {
        let flags = self.clone();
        Some(CustomFigure {
            of: flags.of,
            x: flags.x?,
            y: flags.y?,
            colour: flags.colour,
            panels: flags.panels,
            condition: flags.condition,
            log: flags.log,
            xlim: flags.xlim.unwrap_or_default(),
            ylim: flags.ylim.unwrap_or_default(),
            xlabel: flags.xlabel,
            ylabel: flags.ylabel,
        })
    }
}

fn limits(text: &str) -> Result<AxisLimits, &'static str> {
    const WANTED: &str = "must be LOW:HIGH with finite numbers, such as 1e-6:1e-3, 0: or :5";
    let end = |text: &str| match text.trim() {
        "" => Ok(None),
        number => match number.parse() {
            Ok(end) if f64::is_finite(end) => Ok(Some(end)),
            _ => Err(WANTED),
        },
    };
    match text.split_once(':') {
        Some((low, high)) if text.trim() != ":" => Ok((end(low)?, end(high)?)),
        _ => Err(WANTED),
    }
}

/// Points of a label.
fn font(text: &str) -> Result<f64, &'static str> {
    let points = text.parse().ok();
    let points = points.filter(|points| (4.0..=100.0).contains(points));
    points.ok_or("must be a number of points from 4 to 100, such as 14")
}

/// `86mmx60mm`; lengths in mm, cm, in, pt or px, a pixel being 1/96 inch.
fn size(text: &str) -> Result<Size, &'static str> {
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
