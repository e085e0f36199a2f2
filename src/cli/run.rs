//! `stickslip run`: the missing jobs of a sweep, then reduced data and figures.

use super::progress::Progress;
use super::report::Reporter;
use super::sweep::{self, PresetFlag, Variation};
use super::{Exit, UsageError, batch, catch_signals, is_cancelled, output, reduce, show};
use crate::figure::{Beside, Look, PictureFormat, draw_all};
use crate::observe::measure;
use crate::reduce::NoJobs;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::results::next_round::RoundsSoFar;
use crate::run::limits::{self, Threads};
use crate::run::{Joined, Options, RunReport, Shard};
use crate::sweep::{Job, Sweep};
use crate::table::shown::shown;
use crate::table::storage::{Disk, Storage};
use anyhow::Result;
use clap::Args;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Run or resume a sweep; then reduce and plot
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip run sweeps/fig3.toml
  stickslip run sweeps/fig3.toml --out /scratch/fig3 --threads 16
  stickslip run --preset fig3                    a sweep of the paper, without a file
  stickslip run sweeps/fig3.toml --set slips=100 --axis V0=1e-5,1e-4 -o finer    another sweep, without an editor
  stickslip run results/fig3                     resume, without the sweep file
  stickslip run sweeps/fig3.toml --shard 2/8 --out part2    without a common disk
  stickslip run sweeps/fig3.toml --report        with results/fig3/report.html, to watch it in a browser
  stickslip run sweeps/fig3.toml --walltime 55m  in a batch queue that ends it after an hour

Start it several times, also on several hosts with a common disk, to share the work.

Ctrl-C, SIGTERM, SIGUSR1, SIGUSR2 and SIGXCPU keep what is done; the same command resumes from there. Further
signals change nothing, except a second Ctrl-C, which exits at once.

Batch systems say how many threads a job has in SLURM_CPUS_PER_TASK, OMP_NUM_THREADS, NCPUS, NSLOTS or
LSB_DJOB_NUMPROC; the first that is set counts. `stickslip batch` prints a script that submits a sweep.")]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub struct Arguments {
    /// Sweep file, or results directory to resume
    #[arg(value_name = "SWEEP.toml|DIR", required_unless_present = "preset")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    #[command(flatten)]
    variation: Variation,
    /// Results directory [default: results/<name of the sweep>, with --set or --axis if it is new; or the one to
    /// resume]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads [default: those that the batch system grants, else all cores]
    #[arg(long, value_name = "N", value_parser = limits::parse_threads)]
    threads: Option<NonZeroUsize>,
    /// Run one share of N into a directory of its own, where there is no common disk
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// End within this time, such as 55m, 1h30m or 1:30:00, and keep what is done; reduction and figures take extra
    /// time
    #[arg(long, value_name = "TIME", value_parser = batch::parse_time)]
    walltime: Option<Duration>,
    /// Run as one of many workers in a batch queue: exit with 0 also when others run the rest, or when the time is over
    /// (--walltime, SIGUSR1, SIGUSR2, SIGXCPU) after some work
    #[arg(long)]
    worker: bool,
    /// Run failed jobs again
    #[arg(long)]
    retry_failed: bool,
    /// Skip reduction and figures
    #[arg(long, conflicts_with = "report")]
    no_reduce: bool,
    /// Write report.html and keep it up to date during the run; a browser that shows it reloads it
    #[arg(long)]
    report: bool,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

const JSON_FORMAT: u32 = 2;

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let stop = catch_signals()?;
    let (sweep, root) = arguments.sweep_and_root()?;
    output::warn(&sweep.warnings());
    sweep::warn_of_partitions(&root, &sweep);
    let threads = Threads::choose(arguments.threads, |variable| std::env::var_os(variable))?;
    let options = Options {
        threads: threads.count,
        stop,
        retry_failed: arguments.retry_failed,
        shard: arguments.shard.unwrap_or_default(),
        walltime: arguments.walltime,
    };
    let layout = Layout::new(&Disk, &root);
    let mut progress = Progress::new(threads, sweep.rounds().is_some());
    let ended = crate::run::join(&layout, &sweep, options, |joined| {
        work(joined, &sweep, arguments, &mut progress)
    });
    let report = ended.map_err(|error| match Exit::of(&error) {
        Exit::Stopped if progress.has_results() => {
            error.context("the run stopped; what was committed is kept")
        }
        _ => error,
    })?;
    Ok(ending(&report, &root, arguments))
}

impl Arguments {
    fn sweep_and_root(&self) -> Result<(Sweep, PathBuf)> {
        let changes = sweep::changes(&self.variation)?;
        let sweep = sweep::read(self.sweep.as_deref(), self.preset, &changes)?;
        let root = sweep::root(self.sweep.as_deref(), &sweep);
        if let Some(out) = &self.out {
            return Ok((sweep, out.clone()));
        }
        if changes.is_empty() || !Disk.exists(&root)? {
            return Ok((sweep, root));
        }
        let layout = Layout::new(&Disk, &root);
        let is_own = |results: Results<'_>| results.sweep().text() == sweep.text();
        if !Results::read(&layout).is_ok_and(is_own) {
            let there = shown(&root);
            let extending = match Results::preview(&layout, &sweep) {
                Ok(_) => format!(", or -o {} to extend that one", output::quoted_path(&root)),
                Err(_) => String::new(),
            };
            let problem = format!(
                "--set, --axis: {there} holds another sweep; give a new directory with -o DIR{extending}"
            );
            return Err(UsageError(problem).into());
        }
        Ok((sweep, root))
    }
}

/// Runs missing jobs, reduces, draws and reports.
fn work(
    joined: &Joined<'_>,
    sweep: &Sweep,
    arguments: &Arguments,
    progress: &mut Progress,
) -> Result<RunReport> {
    let layout = joined.layout();
    let mut reporter = arguments.report.then(|| Reporter::new(layout));
    let recording = *sweep.recording();
    let solver = sweep.solver();
    let kernel =
        |job: &Job, interrupt: &AtomicBool| measure(&job.parameters, &recording, solver, interrupt);
    let mut report = joined.run(&kernel, &mut |event| {
        progress.show(event);
        if let Some(reporter) = &mut reporter {
            reporter.follow(event);
        }
    })?;
    report.stopped |= is_cancelled();
    let is_complete = report.jobs_left == 0 && !report.stopped;
    let reduced = if is_complete && !arguments.no_reduce {
        reduce_once(joined, arguments)
    } else {
        Ok(None)
    };
    // What was run is reported even if it could not be reduced.
    if arguments.json {
        output::json(JSON_FORMAT, &report)?;
    } else {
        let mut lines = summary_lines(&report);
        if let Ok(Some(reduced)) = &reduced {
            lines.extend(reduced.lines.iter().cloned());
        }
        output::pairs(&lines)?;
    }
    if let Some(reduced) = reduced?.filter(|_| !arguments.json) {
        reduced.print()?;
    }
    if is_complete && arguments.shard.is_some() {
        reduce::report_missing(&Results::read(layout)?)?;
    }
    if let Some(reporter) = &reporter
        && let Some(path) = reporter.finish(&report)?
        && !arguments.json
    {
        output::print(&format!("report  {}\n", shown(&path)))?;
    }
    Ok(report)
}

/// Reduces and draws, unless another worker does.
fn reduce_once(joined: &Joined<'_>, arguments: &Arguments) -> Result<Option<Reduced>> {
    let layout = joined.layout();
    if arguments.shard.is_some() {
        return reduce_and_draw(layout);
    }
    let reduced = joined.reduce(|| reduce_and_draw(layout))?;
    if reduced.is_none() {
        output::report("all jobs are done; another worker reduces them");
    }
    Ok(reduced.flatten())
}

/// Says what is left and what to do, and how the command ends.
fn ending(report: &RunReport, root: &Path, arguments: &Arguments) -> Exit {
    for marked in &report.marked {
        output::report(&marked.to_string());
    }
    if report.stopped {
        output::report(&stop_in_words(report, arguments));
        // A run that could start nothing would start nothing the next time, either.
        let has_worked = report.jobs_run + report.jobs_spilled > 0;
        return if arguments.worker && has_worked && !is_cancelled() {
            Exit::Done
        } else {
            Exit::Stopped
        };
    }
    if report.jobs_left > 0 {
        let left = output::count(report.jobs_left, "job");
        let hosts = report.hosts.join(", ");
        let out = output::quoted_path(root);
        output::report(&format!(
            "no work left here: others run the last {left} ({hosts}); see stickslip status {out}"
        ));
    }
    if report.jobs_failed > 0 {
        let failed = output::count(report.jobs_failed, "job");
        let hint = "tables/jobs has the reasons. --retry-failed runs them again.";
        output::report(&format!("{failed} failed; {hint}"));
    }
    if report.jobs_left > 0 && !arguments.worker {
        Exit::Stopped
    } else if report.jobs_failed > 0 {
        Exit::Failed
    } else {
        Exit::Done
    }
}

fn stop_in_words(report: &RunReport, arguments: &Arguments) -> String {
    let hint = if report.jobs_run == 0 && arguments.walltime.is_some() {
        "No part ended in this time: give a longer --walltime."
    } else {
        "The same command resumes."
    };
    let left = output::count(report.jobs_left, "job");
    let place = match (report.jobs_left, report.rounds) {
        (0, Some(RoundsSoFar { is_over: false, .. })) => "between two rounds".to_owned(),
        (0, _) => "before the reduction".to_owned(),
        (_, Some(_)) => format!("with {left} left of this round"),
        (_, None) => format!("with {left} left"),
    };
    format!("stopped {place}; finished jobs are kept. {hint}")
}

/// What is printed of a reduction.
pub struct Reduced {
    pub lines: Vec<(&'static str, String)>,
    /// The sets and their statistics.
    result: String,
    figures: Vec<PathBuf>,
}

impl Reduced {
    /// Prints what comes below its lines.
    pub fn print(&self) -> Result<()> {
        output::print(&format!("\n{}\n", self.result))?;
        let figures = self.figures.iter();
        output::lines(figures.map(|path| format!("figure  {}", shown(path))))
    }
}

/// Reduces and draws what is there, as other shards may still run. `None` if nothing is there.
pub fn reduce_and_draw(layout: &Layout<'_>) -> Result<Option<Reduced>> {
    let results = Results::read(layout)?;
    let summary = match crate::reduce::reduce(&results) {
        Err(error) if error.is::<NoJobs>() => {
            output::report("no part is committed yet, so there is nothing to reduce");
            return Ok(None);
        }
        summary => summary?,
    };
    let look = Look::of_sweep(results.sweep().name());
    let figures = draw_all(layout, &Beside::default(), &look, &PictureFormat::DEFAULT)?.files;
    Ok(Some(Reduced {
        lines: reduce::summary_lines(&summary, layout),
        result: show::summary(&results, summary.sets)?,
        figures,
    }))
}

fn summary_lines(report: &RunReport) -> Vec<(&'static str, String)> {
    let jobs = report.jobs_run + report.jobs_spilled;
    let mut pairs = vec![("jobs run", jobs.to_string())];
    if report.jobs_failed > 0 {
        pairs.push(("jobs failed", report.jobs_failed.to_string()));
    }
    pairs.push(("parts committed", report.parts_committed.to_string()));
    if let Some(rounds) = &report.rounds {
        pairs.push(("round", output::rounds(rounds)));
    }
    if report.jobs_run > 0 {
        let measured = output::duration(report.measured_cost);
        let predicted = output::duration(report.predicted_cost);
        pairs.push(("CPU time", format!("{measured}, predicted {predicted}")));
        pairs.push(("wall time", output::duration(report.wall)));
    }
    pairs
}
