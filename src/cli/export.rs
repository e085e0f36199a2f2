//! `stickslip export`: the tables of a results directory as a few large files, for other tools.

use super::{Exit, catch_signals, choice, layout, output};
use crate::reduce::renew;
use crate::results::Results;
use crate::results::destination::NewFolder;
use crate::table::formats::Format;
use crate::table::shown::{shown, shown_bytes};
use anyhow::Result;
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;

/// Write slips, jobs and reduced sets of a results directory to a folder: one file each, with all swept parameters
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip export results/fig3 -o fig3-tables
  stickslip export results/fig3 -o fig3-csv --format csv     for spreadsheets

Rows are in the order of the plan, extensions one after another; sets in that of their parameters. Whatever threads,
shards and interruptions came before, the bytes are the same; equal jobs after other extensions are the same rows in
another order. Beside CSV lies columns.csv with units and meanings. Reduced data that are out of date are made again;
nothing else in the directory is changed. If the export fails or is stopped, FOLDER is as before.")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// Folder to make, outside of results directories; it may be there if it is empty
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,
    /// Format of the files
    #[arg(
        long,
        default_value = "parquet",
        value_parser = choice(&Format::ALL, Format::word, Format::description)
    )]
    format: Format,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

const JSON_FORMAT: u32 = 2;

pub fn export(arguments: &Arguments) -> Result<Exit> {
    let folder = NewFolder::new(&arguments.out)?;
    let results = renew(&Results::read(&layout(&arguments.directory))?)?;
    // Shown on a terminal only.
    let bar = ProgressBar::new(0);
    bar.set_style(ProgressStyle::with_template(
        "{wide_bar} {percent} % of the parts, {eta} left",
    )?);
    let stop = catch_signals()?;
    let exported = results.export(folder, arguments.format, stop, &mut |done, total| {
        bar.set_length(total);
        bar.set_position(done);
    })?;
    bar.finish_and_clear();
    if arguments.json {
        output::json(JSON_FORMAT, &exported)?;
        return Ok(Exit::Done);
    }
    output::lines(exported.files.iter().map(|file| {
        let path = arguments.out.join(&file.name);
        let rows = output::count(file.rows, "row");
        let size = shown_bytes(file.bytes as f64);
        format!("{}  {rows}, {size}", shown(&path))
    }))?;
    if let Some(unfinished) = output::unfinished(&results)? {
        output::report(&format!("exported what is there: {unfinished}"));
    }
    Ok(Exit::Done)
}
