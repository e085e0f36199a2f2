//! `stickslip merge`: shards that were run into directories of their own become one directory.

use super::exit::Exit;
use super::output;
use crate::results::layout::Layout;
use crate::results::merge::merge as merge_all;
use crate::table::storage::Disk;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Put together the directories of shards that were run without a common disk
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  stickslip run fig3.toml --out first --shard 1/2      on one computer
  stickslip run fig3.toml --out second --shard 2/2     on another
  stickslip merge first second -o results/fig3         with both directories in one place
  stickslip run results/fig3                           runs what is missing, reduces and draws

The sources are not changed. After an interruption, the same command continues.")]
pub struct Arguments {
    /// Results directories of one sweep
    #[arg(value_name = "DIR", required = true)]
    sources: Vec<PathBuf>,
    /// Directory to put them into; it may hold some of the parts
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Version of the JSON.
const FORMAT: u32 = 1;

pub fn merge(arguments: &Arguments) -> Result<Exit> {
    let sources: Vec<Layout<'_>> = arguments.sources.iter().map(|source| Layout::new(&Disk, source)).collect();
    let merged = merge_all(&sources, &Layout::new(&Disk, &arguments.out))?;
    if arguments.json {
        output::json(FORMAT, &merged)?;
    } else {
        let parts_and_jobs =
            |parts, jobs| format!("{} with {}", output::count(parts, "part"), output::count(jobs, "job"));
        output::pairs(&[
            ("merged", parts_and_jobs(merged.parts, merged.jobs)),
            ("there already", output::count(merged.parts_there, "part")),
            ("missing", parts_and_jobs(merged.parts_missing, merged.jobs_missing)),
        ])?;
    }
    Ok(Exit::Done)
}
