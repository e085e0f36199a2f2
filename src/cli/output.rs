//! Text for people and JSON for programs.

use super::catch_signals;
use crate::results::Results;
use crate::results::destination::Destination;
use crate::results::next_round::RoundsSoFar;
use crate::run::Reasons;
use crate::sets::Digits;
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

/// Writes to standard output. A reader that has seen enough, such as `head`, is no error.
pub fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("cannot write to standard output"),
    }
}

/// Writes lines to standard output.
pub fn lines(lines: impl IntoIterator<Item = String>) -> Result<()> {
    lines.into_iter().try_for_each(|line| print(&(line + "\n")))
}

/// Writes a line to standard error. A failed write must not end the run.
pub fn report(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

pub fn warn(warnings: &[String]) {
    for warning in warnings {
        report(&format!("warning: {warning}"));
    }
}

pub fn write(file: &Destination, bytes: &[u8]) -> Result<()> {
    file.write(catch_signals()?, |mut file| Ok(file.write(bytes)?))
}

/// Prints a value as JSON, with the version of its form.
pub fn json(format: u32, value: &impl Serialize) -> Result<()> {
    #[derive(Serialize)]
    struct Versioned<'a, T> {
        format: u32,
        #[serde(flatten)]
        value: &'a T,
    }
    let versioned = Versioned { format, value };
    print(&format!("{}\n", serde_json::to_string_pretty(&versioned)?))
}

/// Prints labels and values in two columns.
pub fn pairs(pairs: &[(&str, String)]) -> Result<()> {
    let mut columns = TextTable::default();
    columns.words("", pairs, |(label, _)| (*label).to_owned());
    columns.words("", pairs, |(_, value)| value.clone());
    print(&columns.to_string())
}

/// A table for people: columns of cells, each below its head. Without any head, there is no line for heads.
/// Columns of words stand to the left, others to the right.
#[derive(Default)]
pub struct TextTable(Vec<(bool, Vec<String>)>);

impl TextTable {
    pub fn words<R>(&mut self, head: impl Into<String>, rows: &[R], cell: impl Fn(&R) -> String) {
        self.add(true, head.into(), rows.iter().map(cell));
    }

    pub fn numbers<R>(&mut self, head: impl Into<String>, rows: &[R], cell: impl Fn(&R) -> String) {
        self.add(false, head.into(), rows.iter().map(cell));
    }

    pub fn add(&mut self, is_worded: bool, head: String, cells: impl Iterator<Item = String>) {
        let cells = std::iter::once(head).chain(cells).collect();
        self.0.push((is_worded, cells));
    }
}

impl fmt::Display for TextTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |cell: &String| cell.chars().count();
        let columns = self.0.iter().map(|(_, cells)| cells);
        let widest = columns.clone().map(|cells| cells.iter().map(width).max());
        let widths: Vec<usize> = widest.map(Option::unwrap_or_default).collect();
        let lines = columns.clone().next().map_or(0, Vec::len);
        let has_heads = columns.clone().any(|cells| !cells[0].is_empty());
        for line in usize::from(!has_heads)..lines {
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
            writeln!(f, "{}", padded.collect::<Vec<_>>().join("  ").trim_end())?;
        }
        Ok(())
    }
}

/// A duration in the unit that suits it.
pub fn duration(seconds: f64) -> String {
    if seconds < 1.0 {
        format!("{} ms", Digits::THREE.number(1e3 * seconds))
    } else if seconds < 120.0 {
        format!("{seconds:.1} s")
    } else if seconds < 7200.0 {
        format!("{:.1} min", seconds / 60.0)
    } else if seconds < 172_800.0 {
        format!("{:.1} h", seconds / 3600.0)
    } else {
        format!("{:.1} days", seconds / 86_400.0)
    }
}

/// Jobs that are missing, and finished jobs of unfinished parts.
pub fn missing(jobs_missing: u64, jobs_spilled: u64) -> String {
    let missing = format!("{} missing", count(jobs_missing, "job"));
    match jobs_spilled {
        0 => missing,
        spilled => format!("{missing}, {spilled} in unfinished parts"),
    }
}

/// What is missing of a directory, and the command that continues; `None` if nothing is.
pub fn unfinished(results: &Results<'_>) -> Result<Option<String>> {
    let overview = results.overview()?;
    let missing_jobs = missing(overview.jobs_missing, overview.jobs_spilled);
    let unfinished = format!("{missing_jobs}; {} continues with them", command(results));
    Ok((overview.jobs_missing > 0).then_some(unfinished))
}

/// The command that continues with a directory.
pub fn command(results: &Results<'_>) -> String {
    let root = quoted_path(results.layout().root());
    let Some(measured) = results.sweep().measured() else {
        return format!("stickslip run {root}");
    };
    if measured.files.is_empty() {
        return format!("stickslip.measured(TABLE, \"{root}\", ...) in Python, with its table");
    }
    let sources = measured.files.iter();
    // Not to be taken for a flag.
    let quoted = sources.map(|file| quoted_path(&Path::new(".").join(&file.name)));
    let files = quoted.collect::<Vec<String>>().join(" ");
    format!("stickslip measured {files} {} -o {root}", measured.options)
}

/// A count with its noun, in the plural where that fits.
pub fn count(number: u64, noun: &str) -> String {
    if number == 1 {
        format!("1 {noun}")
    } else {
        format!("{number} {noun}s")
    }
}

/// Lines of the most frequent reasons of failures.
pub fn by_reason(reasons: &Reasons) -> String {
    let sorted = reasons.sorted();
    let mut lines = String::new();
    for (reason, jobs) in sorted.iter().take(MAX_REASONS) {
        let jobs = count(*jobs, "job");
        lines = format!("{lines}failed  {jobs} in all: {}\n", shown_text(reason));
    }
    if sorted.len() > MAX_REASONS {
        lines += "failed  for other reasons, too: see outcome and reason in tables/jobs\n";
    }
    lines
}

/// How far the rounds of a sweep are.
pub fn rounds(rounds: &RoundsSoFar) -> String {
    let standing = &rounds.standing;
    let over = if rounds.is_over {
        "the last"
    } else {
        "not the last"
    };
    let round = rounds.round;
    let done = count(standing.sets_done, "set");
    let open = standing.sets_open;
    let mut text = format!("{round} ({over}): {done} done, {open} open");
    if standing.sets_capped > 0 {
        let sets = count(standing.sets_capped, "set");
        text = format!("{text}; {sets} too uncertain, at the limit of seeds or jobs");
    }
    if standing.edges_capped > 0 {
        let edges = count(standing.edges_capped, "edge");
        text = format!("{text}; {edges} wider than wanted, at the limit of seeds or jobs");
    }
    text
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
    let is_safe = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@".contains(c);
    if !text.is_empty() && text.chars().all(is_safe) {
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
