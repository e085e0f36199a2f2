//! The command line of `stickslip`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::main()
}
