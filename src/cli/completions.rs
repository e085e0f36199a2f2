//! `stickslip completions`: completions for a shell.

use super::Cli;
use super::exit::Exit;
use super::output;
use anyhow::Result;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  stickslip completions bash > ~/.local/share/bash-completion/completions/stickslip")]
pub struct Arguments {
    /// Shell
    #[arg(value_enum)]
    shell: Shell,
}

pub fn completions(arguments: &Arguments) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "stickslip", &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Done)
}
