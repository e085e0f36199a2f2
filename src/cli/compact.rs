//! `stickslip compact`: the files of many parts become few large ones.

use super::exit::Exit;
use super::output;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::table::storage::Disk;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Merge the tables of a results directory into a few large files, with the same bytes whatever its history
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  stickslip compact results/fig3

The directory can be run, extended and compacted again afterwards. Parts with failed jobs keep their own files.")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Version of the JSON.
const FORMAT: u32 = 1;

pub fn compact(arguments: &Arguments) -> Result<Exit> {
    let compacted = Results::read(&Layout::new(&Disk, &arguments.directory))?.compact()?;
    if arguments.json {
        output::json(FORMAT, &compacted)?;
    } else {
        output::pairs(&[
            (
                "compacted",
                format!("{} with {}", output::count(compacted.parts, "part"), output::count(compacted.jobs, "job")),
            ),
            ("left out", format!("{} with failed jobs", output::count(compacted.failed_parts, "part"))),
            ("files", format!("{}, {:.1} MB", compacted.files, compacted.bytes as f64 / 1e6)),
            ("changed", if compacted.changed { "yes" } else { "no, all was compact" }.to_owned()),
        ])?;
    }
    Ok(Exit::Done)
}
