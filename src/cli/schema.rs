//! `stickslip schema`: the keys of a sweep file, for editors.

use super::exit::Exit;
use super::output;
use anyhow::Result;
use clap::Args;

/// Print the JSON Schema of sweep files, for editors that complete and check TOML
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  stickslip schema > sweep.schema.json

The first line of a sweep file then names it for Even Better TOML (VS Code), Taplo and others:
  #:schema ./sweep.schema.json")]
pub struct Arguments {}

pub fn schema() -> Result<Exit> {
    output::print(crate::sweep::SCHEMA)?;
    Ok(Exit::Done)
}
