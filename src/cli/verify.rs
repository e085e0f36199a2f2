//! `stickslip verify`: whether a results directory is whole, and what to do if not.

use super::{Exit, layout, output};
use crate::measured::{Compared, compare_files};
use crate::results::Results;
use crate::results::verification::{Problem, Verification};
use crate::table::shown::{shown, shown_bytes, shown_text};
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Check that all files of a results directory are intact and every job is there exactly once; suggest repairs
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip verify results/fig3
  stickslip verify results/fig3 --repair     then `run` computes what was moved away

Nothing is changed without --repair. Exit codes: 3 parts are missing, 4 something is damaged, or a file of measured slips has
changed.")]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// Move what is damaged to run/quarantine
    #[arg(long)]
    repair: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Names of parts, and ids of jobs of each problem, that are shown; `--json` has all.
const SHOWN: usize = 3;

const JSON_FORMAT: u32 = 5;

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    verification: &'a Verification,
    /// Whether what is damaged was taken away.
    repaired: bool,
    /// Commands that are to be run, in this order.
    commands: Vec<String>,
    /// Files that measured slips were read from, compared with what was read.
    sources: Vec<String>,
}

pub fn verify(arguments: &Arguments) -> Result<Exit> {
    let layout = &layout(&arguments.directory);
    let verification = if arguments.repair {
        Results::repair(layout)?
    } else {
        Results::verify(layout)?
    };
    let is_damaged = !verification.whole && !arguments.repair;
    let root = output::quoted_path(layout.root());
    let results = Results::read(layout)?;
    let sources: Vec<(&str, Compared)> = results
        .sweep()
        .measured()
        .into_iter()
        .flat_map(compare_files)
        .collect();
    let has_changed = sources.iter().any(|(_, state)| *state == Compared::Differs);
    let mut commands = Vec::new();
    if is_damaged {
        commands.push(format!("stickslip verify {root} --repair"));
    }
    // A repair may have restored all.
    let is_unfinished = if arguments.repair {
        results.overview()?.jobs_missing > 0
    } else {
        !verification.whole || !verification.missing.is_empty()
    };
    if is_unfinished {
        commands.push(output::command(&results));
    }
    let report = Report {
        verification: &verification,
        repaired: arguments.repair && !verification.whole,
        commands,
        sources: sources
            .iter()
            .map(|(name, state)| format!("{name}: {}", state.word()))
            .collect(),
    };
    if arguments.json {
        output::json(JSON_FORMAT, &report)?;
    } else {
        report.print()?;
    }
    Ok(if is_damaged || has_changed {
        Exit::Damaged
    } else if is_unfinished {
        Exit::Stopped
    } else {
        Exit::Done
    })
}

impl Report<'_> {
    fn print(&self) -> Result<()> {
        let verification = self.verification;
        output::lines(verification.problems.iter().map(problem_in_words))?;
        let parts = output::count(verification.parts, "part");
        let jobs = output::count(verification.jobs, "job");
        let size = shown_bytes(verification.bytes as f64);
        let files = format!("{}, {size}", verification.files);
        output::pairs(&[
            ("intact", format!("{parts} with {jobs}")),
            ("files", files),
            ("missing", self.missing()),
            ("damaged", self.damaged()),
        ])?;
        output::lines(self.sources.iter().cloned())?;
        let passed_over = verification.passed_over.iter();
        output::lines(passed_over.map(|path| format!("passed over: {path}")))?;
        if !self.commands.is_empty() {
            output::print("next:\n")?;
        }
        output::lines(self.commands.iter().map(|command| format!("  {command}")))
    }

    fn missing(&self) -> String {
        let parts = &self.verification.missing;
        if parts.is_empty() {
            return "nothing".to_owned();
        }
        let count = output::count(parts.len() as u64, "part");
        let verification = self.verification;
        let jobs = output::missing(verification.jobs_missing, verification.jobs_spilled);
        format!("{count}, {jobs}: {}", first_of(parts))
    }

    fn damaged(&self) -> String {
        let problems = self.verification.problems.len() as u64;
        if problems == 0 {
            return "nothing".to_owned();
        }
        let problems = output::count(problems, "problem");
        if self.repaired {
            problems + ", repaired: damaged files are in run/quarantine"
        } else {
            problems
        }
    }
}

fn problem_in_words(problem: &Problem) -> String {
    let path = shown(&problem.path);
    let text = shown_text(&problem.problem);
    if problem.jobs.is_empty() {
        return format!("{path}: {text}");
    }
    let jobs = output::count(problem.jobs.len() as u64, "job");
    format!(
        "{path}: {text}; concerns {jobs}: {}",
        first_of(&problem.jobs)
    )
}

fn first_of(names: &[String]) -> String {
    names[..names.len().min(SHOWN)].join(", ") + if names.len() > SHOWN { ", ..." } else { "" }
}
