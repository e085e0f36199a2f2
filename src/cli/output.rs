//! Text for people and JSON for programs.

use crate::results::rounds::RoundsSoFar;
use crate::sweep::Standing;
use crate::table::shown::{is_plain, shown};
use anyhow::{Context, Result};
use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

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

/// Writes warnings to standard error.
pub fn warn(warnings: &[String]) {
    for warning in warnings {
        report(&format!("warning: {warning}"));
    }
}

/// Prints a value as JSON.
pub fn json(value: &impl Serialize) -> Result<()> {
    print(&format!("{}\n", serde_json::to_string_pretty(value)?))
}

/// Prints labels and values in two columns.
pub fn pairs(pairs: &[(&str, String)]) -> Result<()> {
    let width = pairs.iter().map(|(label, _)| label.chars().count()).max().unwrap_or(0);
    pairs.iter().try_for_each(|(label, value)| print(&format!("{label:width$}  {value}\n")))
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
pub fn count(number: u64, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

/// How far the rounds of a sweep are.
pub fn rounds(rounds: &RoundsSoFar) -> String {
    let Standing { sets_done, sets_open, sets_capped, cells_capped } = rounds.standing;
    let over = if rounds.is_over { "the last" } else { "not the last" };
    let sets = format!("{} ({over}): {} done, {sets_open} open", rounds.round, count(sets_done, "set"));
    let capped = [
        (sets_capped > 0).then(|| format!("; {} with all seeds allowed, above the target", count(sets_capped, "set"))),
        (cells_capped > 0).then(|| format!("; {} left undivided, at the limit of sets", count(cells_capped, "cell"))),
    ];
    capped.into_iter().flatten().fold(sets, |text, more| text + &more)
}

/// Writes a file beside its place and moves it there, so that no half of it looks whole.
pub fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(".draft");
    let draft = PathBuf::from(draft);
    write(&draft)
        .and_then(|()| Ok(std::fs::rename(&draft, path)?))
        .inspect_err(|_| {
            // What remains of a draft is of no use; the first error is the one to report.
            let _ = std::fs::remove_file(&draft);
        })
        .with_context(|| format!("cannot write {}", shown(path)))
}

/// A text as a shell reads it.
pub fn quoted(text: &str) -> String {
    if !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || "/._-+=:,@".contains(c)) {
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
