//! `stickslip batch`: a script that submits a sweep to a batch system. It submits nothing itself.
//!
//! The script starts the same command many times; whoever is started shares what is left. Logs lie in `run/batch/`.

use super::exit::{Exit, UsageError};
use super::output::{self, quoted};
use super::sweep::{self, PresetFlag};
use super::time;
use crate::results::layout::Layout;
use crate::run::threads;
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf, absolute};
use std::time::Duration;

/// Print a script that submits a sweep to a batch system
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip batch slurm sweeps/fig3.toml --workers 40 --threads 16 --time 4h | sh
  stickslip batch slurm sweeps/fig3.toml --workers 40 --threads 16 --time 4h -- --account=physics > fig3.sh
  sh fig3.sh --partition=short
  stickslip batch hyperqueue sweeps/fig3.toml --workers 40 --threads 16 --time 4h > fig3.sh

What follows -- goes to sbatch or `hq submit`, and so do options of the script. Program, sweep file and results
directory must have the same paths on all nodes. Logs are in run/batch of the results directory.

If a sweep needs more time, submit the script again, or give --starts 200: then another worker follows each one
whose time is over, until all is done. Workers that find nothing to do end at once.")]
pub struct Arguments {
    /// Batch system
    #[arg(value_enum)]
    engine: Engine,
    /// Sweep file
    #[arg(value_name = "SWEEP.toml", required_unless_present = "preset")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    /// Results directory [default: results/<name of the sweep>]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Workers at the same time
    #[arg(long, value_name = "N")]
    workers: NonZeroU32,
    /// Threads of each worker
    #[arg(long, value_name = "N", value_parser = threads::parse)]
    threads: NonZeroUsize,
    /// Time of each worker in the queue, such as 55m, 1h30m or 1:30:00; it stops a little earlier
    #[arg(long, value_name = "TIME", value_parser = time_in_queue)]
    time: Duration,
    /// Workers in total, one after the other [default: as many as --workers]
    #[arg(long, value_name = "N")]
    starts: Option<NonZeroU32>,
    /// Options of sbatch or `hq submit`
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<String>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Engine {
    Slurm,
    Hyperqueue,
}

/// Least time in a queue: Slurm counts in minutes.
const MIN_TIME: Duration = Duration::from_mins(1);
/// A worker stops this share of its time before its end, and at most so much before: for its start, for commits, and for
/// reduction and figures, which come on top.
const MARGIN_SHARE: u32 = 10;
const MAX_MARGIN: Duration = Duration::from_mins(2);
/// Seconds before the end at which Slurm sends its warning, or up to a minute earlier: after the worker's own stop, if the
/// margin is whole.
const WARNING: u32 = 15;

fn time_in_queue(text: &str) -> Result<Duration, String> {
    let time = time::parse(text)?;
    if time < MIN_TIME {
        Err("must be at least 1m".to_owned())
    } else {
        Ok(time)
    }
}

/// The scripts, with {{names}} where values go. A job script lies within Slurm's, as the folder of the logs must be there
/// before a job starts. HyperQueue gets relative paths of logs, as it reads a colon in one as a separator.
const SLURM: &str = include_str!("batch/slurm.sh");
const HYPERQUEUE: &str = include_str!("batch/hyperqueue.sh");

pub fn batch(arguments: &Arguments, program: Option<&Path>) -> Result<Exit> {
    let Arguments {
        time,
        threads,
        workers,
        options,
        ..
    } = arguments;
    let sweep = sweep::read(arguments.sweep.as_deref(), arguments.preset.preset, &[])?;
    output::warn(&sweep.warnings());
    let root = arguments
        .out
        .clone()
        .unwrap_or_else(|| Layout::default_root(&sweep));
    let program = match program {
        Some(program) => program.to_owned(),
        None => std::env::current_exe().context("cannot find out where this program lies")?,
    };
    let (program, root) = (whole_path(&program)?, whole_path(&root)?);
    let source = match (&arguments.sweep, arguments.preset.preset) {
        (Some(file), _) => quoted(&whole_path(file)?),
        (None, preset) => format!("--preset {}", preset.map_or("", |preset| preset.name)),
    };
    let starts = arguments.starts.unwrap_or(*workers);
    if starts < *workers {
        return Err(UsageError(format!(
            "--starts {starts}: must be >= --workers, here {workers}"
        ))
        .into());
    }
    if let Some(option) = options
        .iter()
        .find(|option| option.contains(char::is_control))
    {
        return Err(UsageError(format!("{option:?}: must hold no control characters")).into());
    }
    let (program, out, logs) = (quoted(&program), quoted(&root), format!("{root}/run/batch"));
    let walltime = time::with_units(time.saturating_sub(margin(*time)));
    let command = format!("{program} run {source} --out {out} --worker --walltime {walltime}");
    let (script, array, time, options) = match arguments.engine {
        Engine::Slurm => {
            let limit = if starts > *workers {
                format!("%{workers}")
            } else {
                String::new()
            };
            let minutes = format!("{}:{:02}", time.as_secs() / 60, time.as_secs() % 60);
            let output = format!("--output={}/%A_%a.log", logs.replace('%', "%%"));
            let warning =
                (margin(*time) == MAX_MARGIN).then(|| format!("--signal=B:USR1@{WARNING}"));
            let options = [output]
                .iter()
                .chain(&warning)
                .chain(options)
                .map(|text| directive(text))
                .collect();
            (SLURM, format!("1-{starts}{limit}"), minutes, options)
        }
        Engine::Hyperqueue => {
            let options: String = options.iter().map(|option| quoted(option) + " ").collect();
            (
                HYPERQUEUE,
                format!("1-{starts}"),
                time::with_units(*time),
                options,
            )
        }
    };
    // Last what may hold braces itself.
    let values = [
        ("{{name}}", sweep.name()),
        ("{{array}}", &array),
        ("{{threads}}", &threads.to_string()),
        ("{{time}}", &time),
        ("{{logs}}", &quoted(&logs)),
        ("{{command}}", &command),
        ("{{options}}", &options),
    ];
    output::print(
        &values
            .iter()
            .fold(script.to_owned(), |script, (name, value)| {
                script.replace(name, value)
            }),
    )?;
    Ok(Exit::Done)
}

/// How long before the end of its time a worker stops.
fn margin(time: Duration) -> Duration {
    MAX_MARGIN.min(time / MARGIN_SHARE)
}

/// An absolute path; symbolic links stay, since a common disk may be mounted elsewhere on other nodes.
fn whole_path(mut path: &Path) -> Result<String> {
    // In the current folder there are none, so that `..` after it needs no look at the disk.
    let mut folder = std::env::current_dir().unwrap_or_default();
    while let Ok(rest) = path.strip_prefix("..") {
        folder.pop();
        path = rest;
    }
    let path = absolute(folder.join(path))
        .with_context(|| format!("{}: cannot be made absolute", shown(path)))?;
    let text = path
        .to_str()
        .filter(|text| !text.contains(char::is_control));
    let problem = || {
        format!(
            "{}: must be UTF-8 without control characters; choose another path",
            shown(&path)
        )
    };
    Ok(text
        .map(ToOwned::to_owned)
        .ok_or_else(|| UsageError(problem()))?)
}

/// The line of an option as sbatch reads it from a script: with quotes, and a backslash before what else would mean
/// something.
fn directive(option: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if option.chars().all(plain) {
        format!("#SBATCH {option}\n")
    } else {
        format!(
            "#SBATCH \"{}\"\n",
            option.replace('\\', r"\\").replace('"', "\\\"")
        )
    }
}
