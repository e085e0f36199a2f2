//! Text for people and JSON for programs.

use crate::results::Results;
use crate::results::rounds::RoundsSoFar;
use crate::run::Reasons;
use crate::sweep::Standing;
use crate::table::shown::{is_plain, shown_text};
use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};
use serde::Serialize;
use std::fmt;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::time::Duration;

/// Reasons of failures that are listed.
const MAX_REASONS: usize = 10;

/// Writes to standard output. That its reader has seen enough, as `head` has, is no error.
pub fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("cannot write to standard output"),
    }
}

/// Writes a line to standard error. That nobody can read it must not end a run.
pub fn report(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

pub fn warn(warnings: &[String]) {
    for warning in warnings {
        report(&format!("warning: {warning}"));
    }
}

/// Prints a value as JSON, with the version of its form.
pub fn json(format: u32, value: &impl Serialize) -> Result<()> {
    #[derive(Serialize)]
    struct Versioned<'a, T> {
        format: u32,
        #[serde(flatten)]
        value: &'a T,
    }
    plain_json(&Versioned { format, value })
}

/// Prints a value as JSON that has its version, or needs none.
pub fn plain_json(value: &impl Serialize) -> Result<()> {
    print(&format!("{}\n", serde_json::to_string_pretty(value)?))
}

/// Prints labels and values in two columns.
pub fn pairs(pairs: &[(&str, String)]) -> Result<()> {
    let width = pairs
        .iter()
        .map(|(label, _)| label.chars().count())
        .max()
        .unwrap_or(0);
    pairs
        .iter()
        .try_for_each(|(label, value)| print(&format!("{label:width$}  {value}\n")))
}

/// Columns of cells side by side, each with whether it is of words, which stand to the left.
#[derive(Default)]
pub struct Columns(Vec<(bool, Vec<String>)>);

impl Columns {
    pub fn add(&mut self, is_worded: bool, cells: Vec<String>) {
        self.0.push((is_worded, cells));
    }
}

impl fmt::Display for Columns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |cells: &[String]| {
            cells
                .iter()
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or(0)
        };
        let widths: Vec<usize> = self.0.iter().map(|(_, cells)| width(cells)).collect();
        let lines = self.0.first().map_or(0, |(_, cells)| cells.len());
        (0..lines).try_for_each(|line| {
            let padded = self
                .0
                .iter()
                .zip(&widths)
                .map(|((is_worded, cells), &width)| {
                    let cell = &cells[line];
                    if *is_worded {
                        format!("{cell:width$}")
                    } else {
                        format!("{cell:>width$}")
                    }
                });
            writeln!(f, "{}", padded.collect::<Vec<_>>().join("  ").trim_end())
        })
    }
}

/// A duration in the unit that suits it.
pub fn duration(seconds: f64) -> String {
    if seconds < 120.0 {
        format!("{seconds:.1} s")
    } else if seconds < 7200.0 {
        format!("{:.1} min", seconds / 60.0)
    } else if seconds < 172_800.0 {
        format!("{:.1} h", seconds / 3600.0)
    } else {
        format!("{:.1} days", seconds / 86_400.0)
    }
}

/// A count with its noun, in the plural where that fits.
/// Jobs that are missing, and those that are kept for later.
pub fn missing(jobs_missing: u64, jobs_spilled: u64) -> String {
    let missing = format!("{} missing", count(jobs_missing, "job"));
    match jobs_spilled {
        0 => missing,
        spilled => format!("{missing}, {spilled} kept for later"),
    }
}

/// What is missing of a directory, and the command that continues; `None` if nothing is.
pub fn unfinished(results: &Results<'_>) -> Result<Option<String>> {
    let overview = results.overview()?;
    let missing = missing(overview.jobs_missing, overview.jobs_spilled);
    let root = quoted_path(results.layout().root());
    let unfinished = format!("{missing}; stickslip run {root} continues with them");
    Ok((overview.jobs_missing > 0).then_some(unfinished))
}

pub fn count(number: u64, noun: &str) -> String {
    if number == 1 {
        format!("1 {noun}")
    } else {
        format!("{number} {noun}s")
    }
}

/// Lines of the most frequent reasons of failures.
pub fn by_reason(reasons: &Reasons) -> String {
    let reasons = reasons.sorted();
    let line = |(reason, jobs): &(&str, u64)| {
        format!(
            "failed  {} in all: {}\n",
            count(*jobs, "job"),
            shown_text(reason)
        )
    };
    let mut lines: String = reasons.iter().take(MAX_REASONS).map(line).collect();
    if reasons.len() > MAX_REASONS {
        lines += "failed  for other reasons, too: see outcome and reason in tables/jobs\n";
    }
    lines
}

/// How far the rounds of a sweep are.
pub fn rounds(rounds: &RoundsSoFar) -> String {
    let Standing {
        sets_done,
        sets_open,
        sets_capped,
        edges_capped,
    } = rounds.standing;
    let over = if rounds.is_over {
        "the last"
    } else {
        "not the last"
    };
    let sets = format!(
        "{} ({over}): {} done, {sets_open} open",
        rounds.round,
        count(sets_done, "set")
    );
    let capped = [
        (sets_capped > 0).then(|| {
            format!(
                "; {} with all seeds allowed, above the target",
                count(sets_capped, "set")
            )
        }),
        (edges_capped > 0).then(|| {
            format!(
                "; {} wider than wanted, at the limit of seeds or jobs",
                count(edges_capped, "edge")
            )
        }),
    ];
    capped
        .into_iter()
        .flatten()
        .fold(sets, |text, more| text + &more)
}

/// A line on a terminal, with the time so far, until it is dropped.
pub fn waiting(what: String) -> ProgressBar {
    let style = ProgressStyle::with_template("{elapsed_precise} {msg}")
        .unwrap_or_else(|_| ProgressStyle::default_spinner());
    let line = ProgressBar::new_spinner()
        .with_style(style)
        .with_message(what)
        .with_finish(ProgressFinish::AndClear);
    line.enable_steady_tick(Duration::from_secs(1));
    line
}

/// A text as a shell reads it.
pub fn quoted(text: &str) -> String {
    if !text.is_empty()
        && text
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || "/._-+=:,@".contains(c))
    {
        text.to_owned()
    } else {
        format!("'{}'", text.replace('\'', r"'\''"))
    }
}

/// A path as a shell reads it; as bash, ksh and zsh do, if a byte of it has to be escaped.
pub fn quoted_path(path: &Path) -> String {
    if let Some(text) = path.to_str().filter(|text| text.chars().all(is_plain)) {
        return quoted(text);
    }
    let bytes = path.as_os_str().as_encoded_bytes().iter();
    let escaped: String = bytes
        .map(|&byte| match byte {
            b' '..=b'~' if !b"'\\".contains(&byte) => char::from(byte).to_string(),
            _ => format!("\\x{byte:02x}"),
        })
        .collect();
    format!("$'{escaped}'")
}
