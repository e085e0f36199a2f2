//! The sweep that a command is about: a file, or a preset, one of the files of the folder `sweeps/`.

use super::{UsageError, layout, output};
use crate::results::Results;
use crate::results::layout::Layout;
use crate::results::tables::RecordedTable;
use crate::single_job;
use crate::sweep::{KeyChange, Sweep, SweepError, varied};
use crate::table::shown::shown;
use anyhow::Result;
use arrow_schema::FieldRef;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use std::path::{Path, PathBuf};

/// A sweep file that the program holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    pub name: &'static str,
    pub text: &'static str,
}

macro_rules! presets {
    ($($name:literal)+) => {
        [$(Preset { name: $name, text: include_str!(concat!("../../sweeps/", $name, ".toml")) }),+]
    };
}

/// By question, as their names sort.
const PRESETS: [Preset; 28] = presets! {
    "choices" "choices-startup" "correlation" "drag" "drag-strong" "energies" "fig2" "fig3" "fig3-precise" "fig4" "friction"
    "friction-drives" "locking-contacts" "locking-disorder" "locking-drive-alone" "locking-edge" "locking-map"
    "locking-size" "locking-staircase" "locking-stiff-drive" "locking-tongue" "sliding-edge" "sliding-regimes"
    "sliding-velocity" "stochasticity" "tide" "triggering" "weakening"
};

/// The names that `--preset` takes.
pub fn preset_parser() -> impl TypedValueParser<Value = Preset> {
    let names = PRESETS
        .iter()
        .map(|preset| PossibleValue::new(preset.name).help(preset.question()));
    PossibleValuesParser::new(names).try_map(|name| Preset::named(&name))
}

impl Preset {
    /// The preset of a name that [`preset_parser`] knows.
    pub fn named(name: &str) -> Result<Self, String> {
        let preset = PRESETS.into_iter().find(|preset| preset.name == name);
        preset.ok_or_else(|| "there is no such preset".to_owned())
    }

    /// The first line of the file.
    fn question(self) -> &'static str {
        let line = self.text.lines().next().unwrap_or_default();
        line.trim_start_matches("# ")
    }

    pub fn sweep(self) -> Result<Sweep, SweepError> {
        Sweep::parse(self.text, Path::new(self.name))
    }
}

/// The flag that stands in place of a sweep file, the argument `sweep`.
#[derive(Clone, Copy, Debug, Args)]
pub struct PresetFlag {
    /// Take a sweep of the paper, or beyond it, in place of a file; `stickslip init --help` lists them
    #[arg(
        long,
        value_name = "NAME",
        value_parser = preset_parser(),
        conflicts_with = "sweep",
        hide_possible_values = true
    )]
    pub preset: Option<Preset>,
}

/// How a sweep is varied.
#[derive(Debug, Default, Args)]
pub struct Variation {
    /// Set a key of the sweep file, such as V0=1e-5 or slips=20; it is no axis then. Repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub settings: Vec<String>,
    /// Give a key several values: V0=1e-5,1e-4 or V0=log:1e-5:1e-3:9, likewise linear, or seed=count:8. Repeatable
    #[arg(long = "axis", value_name = "KEY=VALUES")]
    pub axes: Vec<String>,
}

const IN_THE_FILE: &str =
    "; flags change no zip or sample: edit the file (`stickslip init` writes that of a preset)";

/// What `--set` and `--axis` change.
pub fn changes(Variation { settings, axes }: &Variation) -> Result<Vec<KeyChange>, UsageError> {
    let mut changes: Vec<KeyChange> = Vec::new();
    let of_settings = settings.iter().map(|text| ("--set", text));
    for (flag, text) in of_settings.chain(axes.iter().map(|text| ("--axis", text))) {
        let refused = |problem: String| UsageError(format!("{flag} {text}: {problem}"));
        let (before, value) = text.split_once('=').unwrap_or_default();
        let key = before.trim();
        if changes.iter().any(|earlier| earlier.key == key) {
            return Err(refused(format!("{key} is set before; keep one")));
        }
        if key.is_empty() || !key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            let form = match flag {
                "--set" => "KEY=VALUE, such as --set V0=1e-5",
                _ => "KEY=VALUES, such as --axis V0=1e-5,1e-4",
            };
            return Err(refused(format!("must be {form}")));
        }
        changes.push(match flag {
            "--set" => KeyChange::setting(key, value.trim()),
            _ => KeyChange::axis(key, value.trim())
                .map_err(|form| refused(format!("must be {key}={form}")))?,
        });
    }
    Ok(changes)
}

/// Reads a sweep file or the sweep of a results directory, or takes a preset, with the changes. Without either, it is a
/// sweep of the single point that the changes give.
pub fn read(file: Option<&Path>, flag: PresetFlag, changes: &[KeyChange]) -> Result<Sweep> {
    let sweep = match (file, flag.preset) {
        // A results directory: its current sweep.
        (Some(folder), _) if folder.is_dir() => Ok(Results::read(&layout(folder))?.sweep().clone()),
        (Some(file), _) => Sweep::from_file(file),
        (None, Some(preset)) => preset.sweep(),
        (None, None) => return of_flags(&single_job::sweep_text(changes)),
    };
    vary(sweep?.computed()?, changes)
}

/// The results directory that a sweep runs into without `--out`: the one that was named, or the default of the sweep.
pub fn root(file: Option<&Path>, sweep: &Sweep) -> PathBuf {
    let own = file.filter(|path| path.is_dir());
    own.map_or_else(|| Layout::default_root(sweep), Path::to_owned)
}

/// Warns of a folder in the path of a results directory whose name DuckDB takes for the value of a column in all rows.
pub fn warn_of_partitions(root: &Path, sweep: &Sweep) {
    let is_column = |name: &str| {
        let mut schemas = RecordedTable::of(sweep.recording()).map(|table| table.schema(sweep));
        let is_it = |field: &FieldRef| field.name().eq_ignore_ascii_case(name);
        schemas.any(|schema| schema.fields().iter().any(is_it))
    };
    for folder in &std::path::absolute(root).unwrap_or_default() {
        let name = folder.to_str().and_then(|folder| folder.split_once('='));
        if let Some((name, _)) = name.filter(|(name, _)| is_column(name)) {
            let folder = shown(folder.as_ref());
            output::warn(&[format!(
                "{folder}: is read as a partition by DuckDB, which returns it as {name} of all rows; rename this folder \
                 of the path, or read with hive_partitioning = false"
            )]);
        }
    }
}

pub fn vary(sweep: Sweep, changes: &[KeyChange]) -> Result<Sweep> {
    if changes.is_empty() {
        Ok(sweep)
    } else {
        of_flags(&varied(sweep.text(), changes))
    }
}

/// Reads a text that flags were made into.
fn of_flags(text: &str) -> Result<Sweep> {
    Sweep::parse_made(text, "flags").map_err(|error| {
        let problem = error.to_string();
        if problem.contains("[axes.") {
            UsageError(problem + IN_THE_FILE).into()
        } else {
            error.into()
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_presets_are_the_files_of_the_folder_sweeps() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sweeps");
        let files = std::fs::read_dir(folder)
            .unwrap()
            .map(|file| file.unwrap().file_name().into_string().unwrap());
        let presets: BTreeSet<_> = PRESETS
            .iter()
            .map(|preset| format!("{}.toml", preset.name))
            .collect();
        assert_eq!(presets, files.collect());
        for preset in PRESETS {
            assert_eq!(preset.sweep().unwrap().name(), preset.name);
            let mut lines = preset.text.lines();
            let question = lines.next().unwrap();
            let figure = lines.next().unwrap();
            assert!(
                question.starts_with("# ") && question.ends_with('?'),
                "{question}"
            );
            assert!(figure.starts_with("# Figure"), "{figure}");
        }
        assert!(PRESETS.is_sorted_by_key(|preset| preset.name));
    }
}
