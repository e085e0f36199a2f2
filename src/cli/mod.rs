//! Flags, text and JSON output, progress, exit codes: the only code that prints. Below: the commands, the exit codes,
//! and the signals that end a run early.

mod accuracy;
mod batch;
mod export;
mod generate;
mod init;
mod measured;
mod output;
mod plan;
mod plot;
mod progress;
mod reduce;
mod report;
mod run;
mod show;
mod simulate;
mod status;
mod sweep;
mod verify;

use crate::figure::BadOption;
use crate::model::Symbol;
use crate::observe::RecordingKey;
use crate::reduce::NoJobs;
use crate::results::layout::Layout;
use crate::results::{ErrorKind, ResultsError};
use crate::run::limits::ThreadsError;
use crate::solver::SimulationError;
use crate::sweep::SweepError;
use crate::table::storage::Disk;
use anyhow::{Context, Result};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind as CliErrorKind};
use clap::{Parser, Subcommand};
use signal_hook::consts::signal::{SIGINT, SIGTERM, SIGUSR1, SIGUSR2, SIGXCPU, SIGXFSZ};
use signal_hook::flag::{register, register_conditional_shutdown};
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Parameter sweeps of stick-slip friction: a slider held by breakable contacts (Capozza et al., PRL 107, 024301,
/// 2011).
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
    Measured(measured::Arguments),
    #[command(hide = true)]
    Generate(generate::Arguments),
}

/// Parses a command line, does what it asks, and returns the exit code. `program` is what starts this program again, by
/// default the executable itself; the first of the arguments is its name.
pub fn main(program: Option<&Path>, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let command = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli.command,
        Err(error) => with_way_out(error).exit(),
    };
    // So the write of a file that passes the limit on its size fails, where the signal would end the program.
    let caught = register(SIGXFSZ, &FILE_TOO_LARGE).context("cannot catch signals");
    let ended = caught.and_then(|_| match command {
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
        Command::Measured(arguments) => measured::measured(&arguments),
        Command::Generate(arguments) => generate::generate(&arguments),
    });
    let exit = ended.unwrap_or_else(|error| {
        output::report(&format!("error: {}", message(&error)));
        Exit::of(&error)
    });
    exit as u8
}

/// An error of the command line; a key of sweep files in place of a flag gets the flag that sets it.
fn with_way_out(mut error: clap::Error) -> clap::Error {
    let key = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(flag)) => flag.trim_start_matches('-').to_owned(),
        _ => return error,
    };
    let is_key = Symbol::from_key(&key).is_some() || RecordingKey::from_key(&key).is_some();
    if error.kind() == CliErrorKind::UnknownArgument && is_key {
        let tip = format!("`--set {key}=VALUE` sets it");
        error.insert(
            ContextKind::Suggested,
            ContextValue::StyledStrs(vec![tip.into()]),
        );
    }
    error
}

/// Reads one of some values by its word; the help describes them.
fn choice<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    word: fn(T) -> &'static str,
    description: fn(T) -> Option<&'static str>,
) -> impl TypedValueParser<Value = T> {
    let described = |&value| PossibleValue::new(word(value)).help(description(value));
    let words = PossibleValuesParser::new(all.iter().map(described));
    words.try_map(move |given| {
        let mut values = all.iter().copied();
        values.find(|value| word(*value) == given).ok_or(given)
    })
}

/// The layout of a results directory on the disk.
fn layout(root: &Path) -> Layout<'_> {
    Layout::new(&Disk, root)
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Done = 0,
    Failed = 1,
    /// The command line, a sweep file or a directory does not fit.
    Usage = 2,
    /// Stopped early; the same command resumes.
    Stopped = 3,
    Damaged = 4,
}

/// A mistake on the command line that the flags' own parser cannot see.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

impl Exit {
    /// The code for an error: by the first cause that says whose fault it is; a disk that fails can be resumed from.
    pub fn of(error: &anyhow::Error) -> Self {
        error
            .chain()
            .find_map(Self::of_cause)
            .unwrap_or(Self::Stopped)
    }

    fn of_cause(cause: &(dyn std::error::Error + 'static)) -> Option<Self> {
        let is_usage =
            cause.is::<UsageError>() || cause.is::<BadOption>() || cause.is::<ThreadsError>();
        if is_usage || cause.is::<SweepError>() || cause.is::<NoJobs>() {
            return Some(Self::Usage);
        }
        if let Some(error) = cause.downcast_ref::<SimulationError>() {
            return Some(match error {
                SimulationError::BadSetting { .. } => Self::Usage,
                SimulationError::Interrupted { .. } => Self::Stopped,
                _ => Self::Failed,
            });
        }
        match cause.downcast_ref::<ResultsError>()?.kind {
            ErrorKind::Refused | ErrorKind::Busy => Some(Self::Usage),
            ErrorKind::Damaged => Some(Self::Damaged),
            ErrorKind::Disk(_) | ErrorKind::Stopped => None,
        }
    }
}

// Signals. Batch systems warn with one signal and follow with others, and some send the same one twice. So only a
// second SIGINT, which is Ctrl-C, exits at once. SIGINT and SIGTERM cancel a run; the others warn that its time is
// over. SIGHUP keeps its usual effect: it ends the program unless `nohup` started it.

const WARNING: &[i32] = &[SIGUSR1, SIGUSR2, SIGXCPU];
const CANCELLING: &[i32] = &[SIGINT, SIGTERM];

/// Set by the first signal that stops.
static STOP: AtomicBool = AtomicBool::new(false);
/// Set by the first signal that cancels.
static CANCELLED: AtomicBool = AtomicBool::new(false);
/// Set by the first SIGINT.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Set when a file would pass the limit on its size.
static FILE_TOO_LARGE: AtomicBool = AtomicBool::new(false);

/// Whether the signals are caught.
static CAUGHT: AtomicBool = AtomicBool::new(false);

/// Catches the signals; the flag turns true with the first.
pub fn catch_signals() -> Result<&'static AtomicBool> {
    if !CAUGHT.swap(true, Ordering::Relaxed) {
        register_all().context("cannot catch signals")?;
    }
    Ok(&STOP)
}

/// Whether a signal came that cancels, alone or with others.
pub fn is_cancelled() -> bool {
    CANCELLED.load(Ordering::Relaxed)
}

fn register_all() -> io::Result<()> {
    // Before the flag that it looks at, so that the first SIGINT does not exit.
    register_conditional_shutdown(SIGINT, Exit::Stopped as i32, &INTERRUPTED)?;
    register(SIGINT, &INTERRUPTED)?;
    // Before the flag that stops: what stops a run finds it set.
    CANCELLING
        .iter()
        .try_for_each(|&signal| register(signal, &CANCELLED).map(drop))?;
    CANCELLING
        .iter()
        .chain(WARNING)
        .try_for_each(|&signal| register(signal, &STOP).map(drop))
}
