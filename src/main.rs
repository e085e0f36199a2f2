//! The command line of `stickslip`.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(stickslip::cli::main(None, std::env::args_os()))
}
