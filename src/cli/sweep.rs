//! The sweep that a command is about: a file, or a preset, one of the files of the folder `sweeps/`.

use super::exit::UsageError;
use super::output;
use crate::results::Results;
use crate::results::layout::Layout;
use crate::results::tables::{recorded_schema, tables_of};
use crate::single_job;
use crate::sweep::{Change, Sweep, SweepError, varied};
use crate::table::shown::shown;
use crate::table::storage::Disk;
use anyhow::Result;
use arrow_schema::FieldRef;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use std::path::Path;

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

const PRESETS: [Preset; 31] = presets! {
    "choices" "contacts" "disorder" "drag" "drag-strong" "drive-alone" "energies" "eq1" "excess" "fig1d" "fig2" "fig3"
    "fig3-full" "fig3-precise" "fig4b" "fig4d" "friction" "friction-drives" "friction-precise" "fronts" "locking-edge"
    "locking-map" "regimes" "size" "sliding-edge" "staircase" "startup" "stiff-drive" "stochasticity" "tongue-4"
    "velocity"
};

impl Preset {
    /// What the first line of the file says, without a sentence that continues in the next line.
    fn about(self) -> &'static str {
        let line = self.text.lines().next().unwrap_or_default();
        let line = line.trim_start_matches(['#', ' ']);
        let whole = match line.rsplit_once([':', '.', ',']) {
            Some((whole, _)) if !line.ends_with('.') => whole,
            _ => line,
        };
        whole.trim_end_matches(['.', ',', ':'])
    }

    pub fn sweep(self) -> Result<Sweep, SweepError> {
        Sweep::parse(self.text, Path::new(self.name))
    }
}

impl ValueEnum for Preset {
    fn value_variants<'a>() -> &'a [Self] {
        &PRESETS
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name).help(self.about()))
    }
}

/// The flag that stands in place of a sweep file, the argument `sweep`.
#[derive(Clone, Copy, Debug, Args)]
pub struct PresetFlag {
    /// Take a sweep of the paper, or beyond it, in place of a file; `stickslip init --help` lists them
    #[arg(
        long,
        value_name = "NAME",
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
pub fn changes(Variation { settings, axes }: &Variation) -> Result<Vec<Change>, UsageError> {
    let mut changes: Vec<Change> = Vec::new();
    let settings = settings.iter().map(|text| ("--set", text));
    for (flag, text) in settings.chain(axes.iter().map(|text| ("--axis", text))) {
        let refused = |problem: String| UsageError(format!("{flag} {text}: {problem}"));
        let (key, value) = text.split_once('=').unwrap_or_default();
        let key = key.trim();
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
            "--set" => Change::setting(key, value.trim()),
            _ => Change::axis(key, value.trim())
                .map_err(|form| refused(format!("must be {key}={form}")))?,
        });
    }
    Ok(changes)
}

/// Reads a sweep file or the sweep of a results directory, or takes a preset, as varied; without either, a sweep with one point, of what is set.
pub fn read(file: Option<&Path>, flag: PresetFlag, changes: &[Change]) -> Result<Sweep> {
    let sweep = match (file, flag.preset) {
        // A results directory: its current sweep.
        (Some(folder), _) if folder.is_dir() => {
            Ok(Results::read(&Layout::new(&Disk, folder))?.sweep().clone())
        }
        (Some(file), _) => Sweep::from_file(file),
        (None, Some(preset)) => preset.sweep(),
        (None, None) => return of_flags(&single_job::sweep_text(changes)),
    };
    vary(sweep?, changes)
}

/// Warns of a folder in the path of a results directory whose name DuckDB takes for the value of a column in all rows.
pub fn warn_of_partitions(root: &Path, sweep: &Sweep) {
    let is_column = |name: &str| {
        let mut schemas =
            tables_of(sweep.recording()).map(|table| recorded_schema(table, sweep.recording()));
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

/// A sweep as varied.
pub fn vary(sweep: Sweep, changes: &[Change]) -> Result<Sweep> {
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
            assert!(
                (10..130).contains(&preset.about().len()),
                "{}: {}",
                preset.name,
                preset.about()
            );
        }
        let about = |name: &str| {
            PRESETS
                .iter()
                .find(|preset| preset.name == name)
                .unwrap()
                .about()
        };
        assert_eq!(about("size"), "Locking against the number of blocks N");
        assert!(
            about("friction-drives").ends_with("eight frequencies"),
            "the next line says how far"
        );
    }
}
