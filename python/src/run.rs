//! A sweep, run into a results directory.

use crate::errors::Error;
use crate::simulate::read_sweep;
use crate::watched::watched;
use pyo3::prelude::*;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;
use stickslip::figure::{Beside, Look, PictureFormat, draw_all};
use stickslip::observe::measure;
use stickslip::results::Results;
use stickslip::results::layout::Layout;
use stickslip::run::limits::Threads;
use stickslip::run::{Options, RunEvent, RunReport, Shard, Tally};
use stickslip::table::storage::Disk;

/// How far a run is, for the callback.
#[derive(Default)]
struct Progress {
    tally: Tally,
    messages: Vec<String>,
    has_news: bool,
}

impl Progress {
    fn note(&mut self, event: RunEvent) {
        self.has_news = true;
        self.tally.note(&event);
        match event {
            RunEvent::Started {
                jobs,
                predicted_cost,
                jobs_there,
                threads,
                ..
            } => {
                self.messages.push(format!(
                    "{jobs} jobs to run, {jobs_there} there already; about {:.1} s on {threads} threads",
                    predicted_cost / threads as f64
                ));
            }
            RunEvent::JobFailed {
                job_id,
                reason,
                command,
                ..
            } => {
                self.messages
                    .push(format!("job {job_id} failed: {reason}\n  alone: {command}"));
            }
            RunEvent::JobTakesLong {
                command,
                predicted_cost,
                wall,
            } => self.messages.push(format!(
                "1 job has run {wall:.1} s, {:.0} times its prediction: {command}",
                wall / predicted_cost
            )),
            _ => {}
        }
    }

    /// Calls back with jobs done, all jobs, the share of the cost that is done, and messages; if there is anything new.
    fn show(&mut self, py: Python<'_>, callback: &Py<PyAny>) -> PyResult<()> {
        if !std::mem::take(&mut self.has_news) || callback.is_none(py) {
            return Ok(());
        }
        let tally = self.tally;
        let messages = std::mem::take(&mut self.messages);
        let arguments = (tally.jobs_done, tally.jobs, tally.share(), messages);
        callback.call1(py, arguments).map(drop)
    }
}

/// Reduces the tables of a directory and draws its figures.
pub fn reduce_and_draw(layout: &Layout<'_>, name: &str) -> Result<(), Error> {
    stickslip::reduce::reduce(&Results::read(layout)?)?;
    draw_all(
        layout,
        &Beside::default(),
        &Look::of_sweep(name),
        &PictureFormat::DEFAULT,
    )?;
    Ok(())
}

/// Runs or resumes a sweep file, or the text of one. Returns the results directory, and warnings.
#[pyfunction]
#[pyo3(signature = (*, file, text, out, threads, retry_failed, walltime, reduce, callback))]
#[expect(clippy::too_many_arguments, reason = "called by keywords alone")]
pub fn run(
    py: Python<'_>,
    file: Option<PathBuf>,
    text: &str,
    out: Option<PathBuf>,
    threads: Option<NonZeroUsize>,
    retry_failed: bool,
    walltime: Option<Duration>,
    reduce: bool,
    callback: Py<PyAny>,
) -> PyResult<(PathBuf, Vec<String>)> {
    let resumed = file.as_deref().filter(|file| file.is_dir());
    let sweep = match resumed {
        Some(directory) => Results::read(&Layout::new(&Disk, directory))
            .map_err(Error::from)?
            .sweep()
            .clone()
            .computed()
            .map_err(Error::from)?,
        None => read_sweep(file.as_deref(), text, "sweep")?,
    };
    let root = out
        .or(resumed.map(ToOwned::to_owned))
        .unwrap_or_else(|| Layout::default_root(&sweep));
    let threads = Threads::choose(threads, |variable| std::env::var_os(variable))
        .map_err(Error::from)?
        .count;
    let progress = Mutex::new(Progress::default());
    let report = watched(
        py,
        |stop, events| {
            let layout = Layout::new(&Disk, &root);
            let options = Options {
                threads,
                stop,
                retry_failed,
                shard: Shard::default(),
                walltime,
            };
            let recording = *sweep.recording();
            let solver = sweep.solver();
            stickslip::run::join(
                &layout,
                &sweep,
                options,
                |joined| -> Result<RunReport, Error> {
                    let kernel = |job: &stickslip::sweep::Job, interrupt: &_| {
                        measure(&job.parameters, &recording, solver, interrupt)
                    };
                    // A run goes on without a receiver of events.
                    let report =
                        joined.run(&kernel, &mut |event| drop(events.send(event.clone())))?;
                    if reduce && report.jobs_left == 0 && !report.stopped {
                        joined.reduce(|| reduce_and_draw(joined.layout(), sweep.name()))?;
                    }
                    Ok(report)
                },
            )
        },
        |event| {
            if let Ok(mut progress) = progress.lock() {
                progress.note(event);
            }
        },
        |py| {
            progress
                .lock()
                .map_or(Ok(()), |mut progress| progress.show(py, &callback))
        },
    )?;
    let mut warnings = sweep.warnings();
    if report.jobs_failed > 0 {
        warnings.push(format!(
            "jobs failed: {}; jobs() has the reasons, retry_failed=True runs them again",
            report.jobs_failed
        ));
    }
    if report.jobs_left > 0 {
        let why = if report.stopped {
            "the time was over; the same call resumes"
        } else {
            "others run them"
        };
        warnings.push(format!("jobs left: {}; {why}", report.jobs_left));
    }
    Ok((root, warnings))
}
