//! `stickslip compact`: the files of many parts become few large sorted ones.

use super::exit::Exit;
use super::output;
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use stickslip::results::compact::Compacted;
use stickslip::table::storage::Disk;

/// Make few large sorted files of the tables of a results directory, the same bytes whatever its history
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  stickslip compact results/fig3

The directory can be run, extended and compacted again afterwards.")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Version of [`Report`] as JSON.
const FORMAT: u32 = 1;

#[derive(Serialize)]
struct Report {
    format: u32,
    #[serde(flatten)]
    compacted: Compacted,
}

pub fn compact(arguments: &Arguments) -> Result<Exit> {
    let compacted = stickslip::run::compact(&Disk, &arguments.directory)?;
    if arguments.json {
        output::json(&Report { format: FORMAT, compacted })?;
    } else {
        output::pairs(&[
            (
                "compacted",
                format!("{} with {}", output::count(compacted.parts, "part"), output::count(compacted.jobs, "job")),
            ),
            ("files", format!("{}, {:.1} MB", compacted.files, compacted.bytes as f64 / 1e6)),
            ("changed", if compacted.changed { "yes" } else { "no, all was compact" }.to_owned()),
        ])?;
    }
    Ok(Exit::Done)
}
