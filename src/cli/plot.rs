//! `stickslip plot`: reduced data to figures, the standing ones or a custom one.

use super::exit::{Exit, UsageError};
use super::figure_flags::{CUSTOM_FIGURE, CustomFlags, size};
use super::output::{self, TextTable};
use crate::figure::{Format, Look, Size, Style, draw_all, draw_custom, write_custom};
use crate::reduce::{SetRow, renew};
use crate::results::Results;
use crate::results::destination::{Destination, Kind};
use crate::results::layout::Layout;
use crate::table::columns::Row as _;
use crate::table::shown::shown;
use crate::table::storage::Disk;
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
    /// Formats, separated by commas [default: svg,png]
    #[arg(long, value_enum, value_delimiter = ',')]
    format: Vec<Format>,
    /// Size in mm, cm, in, pt or px, such as 86mmx60mm [default: what the data need; in print one or two columns wide]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size)]
    size: Option<Size>,
    /// Style
    #[arg(long, value_enum, default_value_t = Style::Screen)]
    style: Style,
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
  stickslip plot --list                                                the columns that can be drawn
  stickslip plot results/sliding-velocity --x V0 --y tau_mean --log xy
  stickslip plot results/fig3 --x eta --y phase_mean --colour V0 --panels Delta --log x -o phase.pdf
  stickslip plot results/friction --x Delta --y mean_friction --colour T --xlim 0:4e-6 \\
    --size 86mmx60mm --style print --format pdf";

impl Arguments {
    fn look(&self, results: &Results<'_>) -> Look {
        Look {
            style: self.style,
            size: self.size,
            ..Look::of_sweep(results.sweep().name())
        }
    }

    fn formats(&self) -> &[Format] {
        if self.format.is_empty() {
            &Format::DEFAULT
        } else {
            &self.format
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
    let results = renew(&Results::read(&Layout::new(&Disk, directory))?)?;
    let layout = results.layout();
    let look = arguments.look(&results);
    let files = if let Some(figure) = arguments.custom.figure() {
        let picture = draw_custom(layout, &figure, &look)?;
        if look.style == Style::Print {
            output::report(&format!("for the caption: {}", picture.note()));
        }
        match &out {
            None => write_custom(layout, picture, &look, arguments.formats())?,
            Some((out, format)) => {
                output::write(out, &picture.encoded(*format)?)?;
                arguments.out.iter().cloned().collect()
            }
        }
    } else {
        draw_all(layout, &look, arguments.formats())?
    };
    if files.is_empty() {
        output::report("there is nothing to draw: no set has a result");
    }
    output::lines(files.iter().map(|path| shown(path).to_string()))?;
    Ok(Exit::Done)
}

/// Where a picture goes, and the format that the name ends in.
pub fn picture_file(file: &Path) -> Result<(Destination, Format)> {
    let extension = file.extension().and_then(|extension| extension.to_str());
    let format = Format::ALL
        .into_iter()
        .find(|format| extension == Some(format.word()));
    match format.zip(Kind::of_name(file)) {
        Some((format, kind)) => Ok((Destination::new(file, kind)?, format)),
        None => Err(UsageError(format!("{}: must end in .svg, .png or .pdf", shown(file))).into()),
    }
}

/// The columns of the table of sets.
fn list() -> String {
    let described = SetRow::columns();
    let mut columns = TextTable::default();
    columns.words("", &described, |column| column.name.to_string());
    columns.words("", &described, |column| column.unit.to_owned());
    columns.words("", &described, |column| column.meaning.to_owned());
    columns.to_string()
}
