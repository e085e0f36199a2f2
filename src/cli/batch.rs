//! `stickslip batch`: a script that submits a sweep to a batch system. It submits nothing itself.
//!
//! The script starts the same command many times; whoever is started shares what is left. Logs lie in `run/batch/`.

use super::exit::{Exit, UsageError};
use super::output::{self, quoted};
use super::time;
use crate::results::layout::Layout;
use crate::run::threads;
use crate::sweep::Sweep;
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
    #[arg(value_name = "SWEEP.toml")]
    sweep: PathBuf,
    /// Results directory [default: results/<name of the sweep>]
    #[arg(long, value_name = "DIR")]
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
    if time < MIN_TIME { Err("must be at least 1m".to_owned()) } else { Ok(time) }
}

struct Submission<'a> {
    name: &'a str,
    workers: u32,
    starts: u32,
    threads: NonZeroUsize,
    time: Duration,
    logs: String,
    /// The command of a worker, as a shell reads it.
    command: String,
    options: &'a [String],
}

pub fn batch(arguments: &Arguments, program: Option<&Path>) -> Result<Exit> {
    let sweep = Sweep::from_file(&arguments.sweep)?;
    output::warn(&sweep.warnings());
    let root = arguments.out.clone().unwrap_or_else(|| Layout::default_root(&sweep));
    let program = match program {
        Some(program) => program.to_owned(),
        None => std::env::current_exe().context("cannot find out where this program lies")?,
    };
    let (program, file, root) = (whole_path(&program)?, whole_path(&arguments.sweep)?, whole_path(&root)?);
    let (workers, starts) = (arguments.workers.get(), arguments.starts.unwrap_or(arguments.workers).get());
    if starts < workers {
        return Err(UsageError(format!("--starts {starts}: must be >= --workers, here {workers}")).into());
    }
    if let Some(option) = arguments.options.iter().find(|option| option.contains(char::is_control)) {
        return Err(UsageError(format!("{option:?}: must hold no control characters")).into());
    }
    let walltime = time::with_units(arguments.time.saturating_sub(margin(arguments.time)));
    let submission = Submission {
        name: sweep.name(),
        workers,
        starts,
        threads: arguments.threads,
        time: arguments.time,
        logs: format!("{root}/run/batch"),
        command: format!(
            "{} run {} --out {} --worker --walltime {walltime}",
            quoted(&program),
            quoted(&file),
            quoted(&root)
        ),
        options: &arguments.options,
    };
    output::print(&match arguments.engine {
        Engine::Slurm => submission.slurm(),
        Engine::Hyperqueue => submission.hyperqueue(),
    })?;
    Ok(Exit::Done)
}

/// How long before the end of its time a worker stops.
fn margin(time: Duration) -> Duration {
    MAX_MARGIN.min(time / MARGIN_SHARE)
}

/// An absolute path; symbolic links stay, since a common disk may be mounted elsewhere on other nodes.
fn whole_path(path: &Path) -> Result<String> {
    let path = absolute(path).with_context(|| format!("{}: cannot be made absolute", shown(path)))?;
    let text = path.to_str().filter(|text| !text.contains(char::is_control));
    Ok(text.map(ToOwned::to_owned).ok_or_else(|| {
        let path = shown(&path);
        UsageError(format!("{path}: must be UTF-8 without control characters; choose another path"))
    })?)
}

impl Submission<'_> {
    /// A job script within a script, as the folder of the logs must be there before Slurm starts a job.
    fn slurm(&self) -> String {
        let Self { name, workers, starts, threads, .. } = self;
        let limit = if starts > workers { format!("%{workers}") } else { String::new() };
        let warning = (margin(self.time) == MAX_MARGIN).then(|| format!("--signal=B:USR1@{WARNING}"));
        let mut directives = vec![
            format!("--job-name={name}"),
            format!("--array=1-{starts}{limit}"),
            format!("--cpus-per-task={threads}"),
            format!("--time={}", time::for_slurm(self.time)),
            "--requeue".to_owned(),
            "--open-mode=append".to_owned(),
            format!("--output={}/%A_%a.log", self.logs.replace('%', "%%")),
        ];
        directives.extend(warning);
        directives.extend_from_slice(self.options);
        let directives: Vec<_> = directives.iter().map(|text| format!("#SBATCH {}\n", directive(text))).collect();
        format!(
            "\
#!/bin/sh
# Submits the sweep {name} to Slurm. Run it with sh; its options go to sbatch.
mkdir -p {logs} && exec sbatch \"$@\" <<'EOF'
#!/bin/sh
{directives}\
# Elements share what is left, whatever their number; any of them may be missing or come twice. More elements than
# workers, such as --array=1-200%40, keep 40 at work until all is done; those that find nothing to do end at once.
# Threads are those of --cpus-per-task. Stops before --time is over, and on USR1 and TERM, with what is done kept.
exec {command}
EOF
",
            logs = quoted(&self.logs),
            directives = directives.concat(),
            command = self.command,
        )
    }

    /// Logs by relative paths, as `hq` reads a colon in one as a separator.
    fn hyperqueue(&self) -> String {
        let Self { name, starts, threads, command, .. } = self;
        let time = time::with_units(self.time);
        let options: Vec<_> = self.options.iter().map(|option| format!("{} ", quoted(option))).collect();
        format!(
            "\
#!/bin/sh
# Submits the sweep {name} to HyperQueue. Run it with sh; its options go to `hq submit`.
# Tasks share what is left, whatever their number, and as many run as have room. More tasks follow those whose time is
# over until all is done; those that find nothing to do end at once.
mkdir -p {logs} && cd {logs} && exec hq submit \\
    --name={name} --array=1-{starts} --cpus={threads} --time-limit={time} \\
    --stdout='%{{JOB_ID}}_%{{TASK_ID}}_%{{INSTANCE_ID}}.out' \\
    --stderr='%{{JOB_ID}}_%{{TASK_ID}}_%{{INSTANCE_ID}}.err' \\
    {options}\"$@\" -- \\
    {command} --threads {threads}
",
            logs = quoted(&self.logs),
            options = options.concat(),
        )
    }
}

/// An option as sbatch reads it from a script: with quotes, and a backslash before what else would mean something.
fn directive(option: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if option.chars().all(plain) {
        option.to_owned()
    } else {
        format!("\"{}\"", option.replace('\\', r"\\").replace('"', "\\\""))
    }
}
