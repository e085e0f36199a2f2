//! `stickslip man`: manual pages.

use super::Cli;
use super::exit::Exit;
use super::output;
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::{Args, CommandFactory};
use std::path::PathBuf;

/// Write manual pages, one for each command
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  stickslip man ~/.local/share/man/man1      then: man stickslip-run")]
pub struct Arguments {
    /// Folder, made if it is missing
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

pub fn man(arguments: &Arguments) -> Result<Exit> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(Cli::command(), folder))
        .with_context(|| format!("{}: cannot write manual pages", shown(folder)))?;
    output::report(&format!("wrote manual pages to {}", shown(folder)));
    Ok(Exit::Done)
}
