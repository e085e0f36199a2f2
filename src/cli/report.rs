//! `stickslip report`, and `--report` of `run`: a results directory as one HTML page.

use super::{Exit, layout, message, output};
use crate::reduce::NoJobs;
use crate::results::Results;
use crate::results::destination::Destination;
use crate::results::layout::Layout;
use crate::run::{RunEvent, RunReport};
use crate::table::shown::shown;
use crate::table::storage::{StorageError, StoredFile};
use anyhow::Result;
use clap::Args;
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Write one HTML page to explore a results directory in a browser
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip report results/fig3                    writes results/fig3/report.html
  stickslip report results/fig3 -o /tmp/fig3.html  writes it elsewhere
  stickslip run sweeps/fig3.toml --report          keeps it up to date during the run

The page needs no network and no other file. It shows the swept parameters, regimes, failed jobs with
their commands, charts, the table of parameter sets, predicted and measured cost, and versions. Reduced data that are
out of date are made again first.")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// File to write, as .html, or a device such as /dev/stdout [default: report.html in DIR]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub fn report(arguments: &Arguments) -> Result<Exit> {
    let results = Results::read(&layout(&arguments.directory))?;
    let path = match &arguments.out {
        None => crate::report::write(&results, None)?,
        Some(device) if is_device(device) => {
            let opened = OpenOptions::new().append(true).open(device);
            let file = opened.map_err(StorageError::at("write", device))?;
            let page = crate::report::page(&results, None)?;
            // Nothing follows the page there.
            StoredFile::new(device, file).write(page.as_bytes())?;
            return Ok(Exit::Done);
        }
        Some(path) => {
            let destination = Destination::new(path, "html")?;
            let page = crate::report::page(&results, None)?;
            output::write(&destination, page.as_bytes())?;
            path.clone()
        }
    };
    output::print(&format!("{}\n", shown(&path)))?;
    Ok(Exit::Done)
}

/// Whether a place is written to as it is. Memory has files like those of a disk.
fn is_device(place: &Path) -> bool {
    place.starts_with("/dev") && !place.starts_with("/dev/shm")
}

/// Least time between two reports of a run.
const MIN_SPACING: Duration = Duration::from_secs(5);
/// The time between two reports over the time that one takes: they take less than one percent of the run.
const SPACING: u32 = 100;
/// When a browser loads the page again while other workers still run.
const OTHERS_SPACING: Duration = Duration::from_secs(30);

/// Writes the report of a run during the run.
pub struct Reporter<'a> {
    layout: &'a Layout<'a>,
    /// Whether something was committed since the last one.
    is_due: bool,
    last: Option<Instant>,
    spacing: Duration,
    has_failed: bool,
}

impl<'a> Reporter<'a> {
    pub fn new(layout: &'a Layout<'a>) -> Self {
        Self {
            layout,
            is_due: false,
            last: None,
            spacing: MIN_SPACING,
            has_failed: false,
        }
    }

    /// Writes a report if there is something new and the last is long enough ago. A failure does not end the run.
    pub fn follow(&mut self, event: &RunEvent) {
        self.is_due |= matches!(
            event,
            RunEvent::PartCommitted { .. } | RunEvent::OthersDone { jobs: 1.., .. }
        );
        if !self.is_due || self.last.is_some_and(|last| last.elapsed() < self.spacing) {
            return;
        }
        let begin = Instant::now();
        if let Err(error) = self.write(Some(self.spacing))
            && !std::mem::replace(&mut self.has_failed, true)
        {
            output::report(&format!(
                "warning: no report is written: {}",
                message(&error)
            ));
        }
        self.is_due = false;
        self.last = Some(Instant::now());
        self.spacing = MIN_SPACING.max(SPACING * begin.elapsed());
    }

    /// Writes the last report; none if no job is committed.
    pub fn finish(&self, report: &RunReport) -> Result<Option<PathBuf>> {
        let others_run = report.jobs_left > 0 && !report.stopped;
        self.write(others_run.then_some(OTHERS_SPACING))
    }

    fn write(&self, refresh: Option<Duration>) -> Result<Option<PathBuf>> {
        match crate::report::write(&Results::read(self.layout)?, refresh) {
            Err(error) if error.is::<NoJobs>() => Ok(None),
            written => Ok(Some(written?)),
        }
    }
}
