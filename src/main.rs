//! The command line of `stickslip`.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "the one place that prints")]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
