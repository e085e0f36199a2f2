//! Flags, text and JSON output, progress, exit codes: the only code that prints.

mod accuracy;
mod batch;
mod exit;
mod export;
mod figure_flags;
mod generate;
mod init;
mod output;
mod plan;
mod plot;
mod progress;
mod reduce;
mod report;
mod run;
mod show;
mod signals;
mod simulate;
mod status;
mod sweep;
mod time;
mod verify;

use self::exit::Exit;
use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::path::Path;

/// Parameter sweeps of stick-slip friction: a slider held by breakable contacts (Capozza et al., PRL 107, 024301, 2011).
#[derive(Debug, Parser)]
#[command(name = "stickslip", version, max_term_width = 100, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  stickslip init mine.toml                   a commented sweep file to start from
  stickslip plan sweeps/fig3.toml            what would run, and what it would cost
  stickslip run sweeps/fig3.toml             run or resume it, down to its result and figures
  stickslip show results/fig3                the result again, a line for each parameter set
  stickslip simulate --slips 10 --plot a.png one realisation, drawn

Exit codes: 0 done, 1 failed jobs remain, 2 bad usage or bad sweep file, 3 stopped early but resumable,
4 damaged data.";

#[derive(Debug, Subcommand)]
enum Command {
    Init(init::Arguments),
    Plan(plan::Arguments),
    Run(run::Arguments),
    Batch(batch::Arguments),
    Status(status::Arguments),
    Show(show::Arguments),
    Reduce(reduce::Arguments),
    Plot(Box<plot::Arguments>),
    Report(report::Arguments),
    Verify(verify::Arguments),
    Export(export::Arguments),
    Simulate(Box<simulate::Arguments>),
    Accuracy(accuracy::Arguments),
    #[command(hide = true)]
    Generate(generate::Arguments),
}

/// Parses a command line, does what it asks, and returns the exit code. `program` is what starts this program again, by
/// default the executable itself; the first of the arguments is its name.
pub fn main(program: Option<&Path>, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let command = Cli::parse_from(arguments).command;
    let ended = signals::outlive_limit_of_files().and_then(|()| match command {
        Command::Init(arguments) => init::init(&arguments),
        Command::Plan(arguments) => plan::plan(&arguments),
        Command::Run(arguments) => run::run(&arguments),
        Command::Batch(arguments) => batch::batch(&arguments, program),
        Command::Status(arguments) => status::status(&arguments),
        Command::Show(arguments) => show::show(&arguments),
        Command::Reduce(arguments) => reduce::reduce(&arguments),
        Command::Plot(arguments) => plot::plot(&arguments),
        Command::Report(arguments) => report::report(&arguments),
        Command::Verify(arguments) => verify::verify(&arguments),
        Command::Export(arguments) => export::export(&arguments),
        Command::Simulate(arguments) => simulate::simulate(&arguments),
        Command::Accuracy(arguments) => accuracy::accuracy(&arguments),
        Command::Generate(arguments) => generate::generate(&arguments),
    });
    let exit = ended.unwrap_or_else(|error| {
        output::report(&format!("error: {}", message(&error)));
        Exit::of(&error)
    });
    exit as u8
}

/// An error and its causes, without those that it already quotes.
fn message(error: &anyhow::Error) -> String {
    error
        .chain()
        .map(ToString::to_string)
        .fold(String::new(), |message, cause| match message.as_str() {
            "" => cause,
            _ if message.contains(&cause) => message,
            _ => format!("{message}: {cause}"),
        })
}
