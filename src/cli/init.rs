//! `stickslip init`: a commented sweep file to start from.

use super::exit::{Exit, UsageError};
use super::output;
use super::sweep::Preset;
use crate::model::{Description, Parameters, Symbol, Value};
use crate::observe::{Recording, RecordingKey};
use crate::solver::Solver;
use crate::sweep::Sweep;
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::Args;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};

/// Write a commented sweep file to start from
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip init mine.toml                       every key with its unit, meaning and default
  stickslip init mine.toml --preset locking-map  from a sweep of the paper, or beyond it
  stickslip plan mine.toml                       next: what would run")]
pub struct Arguments {
    /// File to write; its name becomes that of the sweep
    #[arg(value_name = "FILE", default_value = "sweep.toml")]
    file: PathBuf,
    /// Start from a sweep of the paper, or beyond it
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,
}

pub fn init(arguments: &Arguments) -> Result<Exit> {
    let file = &arguments.file;
    let name = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let text = match arguments.preset {
        Some(preset) => preset.text.replace(&format!("name = \"{}\"", preset.name), &format!("name = \"{name}\"")),
        None => template(name),
    };
    Sweep::parse(&text, file).with_context(|| format!("{}: the name of the file must suit a sweep", shown(file)))?;
    write_new(file, &text)?;
    let quoted = output::quoted_path(file);
    output::report(&format!("wrote {}. See what it would run: stickslip plan {quoted}", shown(file)));
    Ok(Exit::Done)
}

/// Writes a file that must not be there yet.
fn write_new(path: &Path, text: &str) -> Result<()> {
    let mut file = match OpenOptions::new().write(true).create_new(true).open(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            let problem = format!("{}: is there already and was not changed; choose another name", shown(path));
            return Err(UsageError(problem).into());
        }
        file => file.with_context(|| format!("{}: cannot be written", shown(path)))?,
    };
    let written = file.write_all(text.as_bytes()).and_then(|()| file.sync_all());
    if written.is_err() {
        // What is left is no sweep file.
        let _ = std::fs::remove_file(path);
    }
    written.with_context(|| format!("{}: cannot be written", shown(path)))
}

/// A sweep that runs as it is, with all other keys as comments.
fn template(name: &str) -> String {
    let (parameters, recording) = (Parameters::default(), Recording::default());
    // The axes below set the others.
    let model = Symbol::ALL
        .into_iter()
        .filter(|symbol| !matches!(symbol, Symbol::V0 | Symbol::Delta | Symbol::T | Symbol::Seed));
    let model = commented(model.map(|symbol| (symbol.description(), parameters.get(symbol))));
    let record = RecordingKey::ALL.into_iter().filter(|key| *key != RecordingKey::Slips);
    let record = commented(record.map(|key| (key.description(), recording.get(key))));
    let tolerance = match Solver::default() {
        Solver::EventDriven { tolerance, .. } => tolerance,
        Solver::FixedStep { .. } => unreachable!("the default is event-driven"),
    };
    format!(
        "\
# A sweep of the model of Capozza et al., Phys. Rev. Lett. 107, 024301 (2011). Quantities are in SI units.
# Keys behind a # have the value shown; remove the # to change one. All of [model] can be axes, too.
name = \"{name}\"                   # results go to results/{name}
# where = \"frequency < 500\"   # drops points

[axes]                          # every combination is a job
V0        = {{ log = [5e-5, 2e-4], points = 3 }}   # m/s; also {{ linear = [..], points = n }} or a list
Delta     = [0, 1e-6]           # m; amplitude of the modulation
frequency = [29, 58]            # Hz; or T = 1/frequency in s, or eta = 2 pi Delta / (T V0)
seed      = {{ count = 2 }}       # realisations of the disorder

[model]
{model}
[record]
slips = {slips}                      # slips to record after start-up; then the job ends
{record}
[solver]
# tolerance = {tolerance:e}        # target error of displacement, relative to fs/k

# Seeds until the error bars are short enough, in place of seed in [axes]:
# [precision]
# of       = \"tau_mean\"           # or mean_friction, locking_index, ...; or a list
# relative = 0.01                 # largest half-width of the 95 % interval; or absolute = .., in its unit
# seeds    = {{ from = 8, to = 64 }}

# Further values of V0 between neighbours that differ:
# [refine]
# axes = \"V0\"                     # ranges of [axes], such as V0
# by   = \"locked\"                 # or regime; or a number with threshold = .. or step = ..
# to   = {{ V0 = 0.05 }}            # smallest distance: a share of the value, as V0 is log
# sets = 100                      # at most
",
        slips = recording.slips,
    )
}

/// Keys with their defaults, each a comment.
fn commented(fields: impl IntoIterator<Item = (Description, Value)>) -> String {
    fields.into_iter().fold(String::new(), |mut text, (field, default)| {
        let Description { key, unit, meaning, .. } = field;
        let default = match default {
            Value::BreakOn(rule) => format!("\"{}\"", rule.word()),
            default => default.to_string(),
        };
        let setting = format!("# {key} = {default}");
        let unit = if unit.is_empty() { String::new() } else { format!("{unit}; ") };
        // What comes behind is in the reference of all keys.
        let meaning = meaning.split("; ").next().unwrap_or_default();
        let _ = writeln!(text, "{setting:26} # {unit}{meaning}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_runs_as_it_is_and_every_default_in_it_may_stand() {
        let text = template("mine");
        let sweep = Sweep::parse(&text, Path::new("mine.toml")).unwrap();
        assert_eq!((sweep.name(), sweep.jobs().count()), ("mine", 3 * 3 * 2));
        // What has no default stays a comment.
        let is_setting = |line: &&str| {
            line.starts_with("# ") && line.contains(" = ") && !line.contains("= none") && !line.contains("where")
        };
        // The tables of rounds stand as a whole or not at all.
        let alone = text.split("\n# Seeds until").next().unwrap();
        let settings: Vec<&str> = alone.lines().filter(is_setting).collect();
        assert!(settings.len() > 15, "{settings:?}");
        for line in settings {
            let changed = text.replace(line, &line[2..]);
            assert_eq!(Sweep::parse(&changed, Path::new("mine.toml")).unwrap().jobs().count(), 18, "{line}");
        }
    }

    #[test]
    fn the_tables_of_rounds_in_the_template_may_stand() {
        let text = template("mine");
        for table in ["[precision]", "[refine]"] {
            let start = text.find(&format!("# {table}")).unwrap();
            let end = text[start..].find("\n\n").map_or(text.len(), |length| start + length);
            let table: Vec<&str> = text[start..end].lines().map(|line| line.trim_start_matches("# ")).collect();
            let table = table.join("\n");
            let changed = format!("{}{table}{}", &text[..start], &text[end..]);
            let changed =
                if table.contains("seeds") { changed.replace("seed      =", "# seed      =") } else { changed };
            let sweep = Sweep::parse(&changed, Path::new("mine.toml")).unwrap();
            assert!(sweep.bounds().is_some(), "{table}");
        }
    }

    #[test]
    fn a_file_that_is_there_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        std::fs::write(&file, "mine").unwrap();
        let error = init(&Arguments { file: file.clone(), preset: None }).unwrap_err();
        assert!(error.to_string().contains("is there already"), "{error}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    }
}
