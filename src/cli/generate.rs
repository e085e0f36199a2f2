//! `stickslip generate`: what a package or an editor takes beside the program.

use super::{Cli, Exit, output};
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::{Args, CommandFactory, Subcommand};
use clap_complete::Shell;
use std::path::PathBuf;

/// Generate completions, manual pages, or the schema of sweep files
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip generate completions bash > ~/.local/share/bash-completion/completions/stickslip
  stickslip generate man ~/.local/share/man/man1      then: man stickslip-run
  stickslip generate schema > sweep.schema.json

The first line of a sweep file then names the schema for Even Better TOML (VS Code), Taplo and others:
  #:schema ./sweep.schema.json")]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// Print completions for a shell
    Completions {
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Write manual pages, one for each command
    Man {
        /// Folder, made if it is missing
        #[arg(value_name = "FOLDER")]
        folder: PathBuf,
    },
    /// Print the JSON Schema of sweep files, for editors that complete and check TOML
    Schema,
}

pub fn generate(arguments: &Arguments) -> Result<Exit> {
    match &arguments.what {
        What::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "stickslip", &mut script);
            output::print(&String::from_utf8_lossy(&script))?;
        }
        What::Man { folder } => {
            std::fs::create_dir_all(folder)
                .and_then(|()| clap_mangen::generate_to(Cli::command(), folder))
                .with_context(|| format!("{}: cannot write manual pages", shown(folder)))?;
            output::report(&format!("wrote manual pages to {}", shown(folder)));
        }
        What::Schema => output::print(crate::sweep::SCHEMA)?,
    }
    Ok(Exit::Done)
}
