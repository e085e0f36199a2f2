//! `stickslip completions`: completions for a shell.

use super::Cli;
use super::exit::Exit;
use anyhow::Result;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

/// Print completions for a shell
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  stickslip completions bash > /etc/bash_completion.d/stickslip")]
pub struct Arguments {
    /// Shell
    #[arg(value_enum)]
    shell: Shell,
}

#[expect(clippy::unnecessary_wraps, reason = "one type for all commands")]
pub fn completions(arguments: &Arguments) -> Result<Exit> {
    clap_complete::generate(arguments.shell, &mut Cli::command(), "stickslip", &mut std::io::stdout());
    Ok(Exit::Done)
}
