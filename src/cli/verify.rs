//! `stickslip verify`: whether a results directory is whole, and what to do if not.

use super::exit::Exit;
use super::output;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::results::verify::{Problem, Verification};
use crate::table::shown::{shown, shown_text};
use crate::table::storage::Disk;
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

Nothing is changed without --repair. Exit codes: 3 parts are missing, 4 something is damaged.")]
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

/// Version of [`Report`] as JSON.
const FORMAT: u32 = 5;

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    verification: &'a Verification,
    /// Whether what is damaged was taken away.
    repaired: bool,
    /// Commands that are to be run, in this order.
    commands: Vec<String>,
}

pub fn verify(arguments: &Arguments) -> Result<Exit> {
    let layout = &Layout::new(&Disk, &arguments.directory);
    let verification = if arguments.repair {
        Results::repair(layout)?
    } else {
        Results::verify(layout)?
    };
    let repaired = arguments.repair && !verification.whole;
    let commands = commands(layout, &verification, repaired);
    if arguments.json {
        output::json(
            FORMAT,
            &Report {
                verification: &verification,
                repaired,
                commands,
            },
        )?;
    } else {
        print_summary(&verification, &commands, repaired)?;
    }
    Ok(
        match (
            verification.whole || arguments.repair,
            verification.missing.is_empty(),
        ) {
            (false, _) => Exit::Damaged,
            (true, false) => Exit::Stopped,
            (true, true) => Exit::Done,
        },
    )
}

fn commands(layout: &Layout<'_>, verification: &Verification, repaired: bool) -> Vec<String> {
    let root = output::quoted_path(layout.root());
    let mut commands = Vec::new();
    if !verification.whole && !repaired {
        commands.push(format!("stickslip verify {root} --repair"));
    }
    if !verification.whole || !verification.missing.is_empty() {
        commands.push(format!("stickslip run {root}"));
    }
    commands
}

fn print_summary(verification: &Verification, commands: &[String], repaired: bool) -> Result<()> {
    for problem in &verification.problems {
        output::print(&format!(
            "{}: {}{}\n",
            shown(&problem.path),
            shown_text(&problem.problem),
            jobs_of(problem)
        ))?;
    }
    let megabytes = verification.bytes as f64 / 1e6;
    let missing = match verification.missing.len() as u64 {
        0 => "nothing".to_owned(),
        parts => {
            let jobs = output::missing(verification.jobs_missing, verification.jobs_spilled);
            let names = first_of(&verification.missing);
            format!("{}, {jobs}: {names}", output::count(parts, "part"))
        }
    };
    let damaged = match verification.problems.len() as u64 {
        0 => "nothing".to_owned(),
        problems => {
            output::count(problems, "problem")
                + if repaired {
                    ", moved to run/quarantine"
                } else {
                    ""
                }
        }
    };
    output::pairs(&[
        (
            "whole",
            format!(
                "{} with {}",
                output::count(verification.parts, "part"),
                output::count(verification.jobs, "job")
            ),
        ),
        (
            "files",
            format!("{}, {megabytes:.1} MB", verification.files),
        ),
        ("not done", missing),
        ("damaged", damaged),
    ])?;
    for path in &verification.passed_over {
        output::print(&format!("passed over: {path}\n"))?;
    }
    if !commands.is_empty() {
        output::print("to go on:\n")?;
        commands
            .iter()
            .try_for_each(|command| output::print(&format!("  {command}\n")))?;
    }
    Ok(())
}

fn jobs_of(Problem { jobs, .. }: &Problem) -> String {
    match jobs.len() as u64 {
        0 => String::new(),
        count => format!(
            "; concerns {}: {}",
            output::count(count, "job"),
            first_of(jobs)
        ),
    }
}

fn first_of(names: &[String]) -> String {
    names[..names.len().min(SHOWN)].join(", ") + if names.len() > SHOWN { ", ..." } else { "" }
}
