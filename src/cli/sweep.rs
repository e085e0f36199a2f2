//! The sweep that a command is about: a file, or a preset, one of the files of the folder `sweeps/`.

use super::exit::UsageError;
use crate::simulate as single;
use crate::sweep::{Sweep, SweepError};
use anyhow::Result;
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

const PRESETS: [Preset; 29] = presets! {
    "choices" "contacts" "disorder" "drag" "drag-strong" "energies" "eq1" "fig1d" "fig2" "fig3" "fig3-full"
    "fig3-precise" "fig4b" "fig4d" "friction" "friction-drives" "friction-precise" "fronts" "locking-edge"
    "locking-map" "regimes" "size" "sliding-edge" "staircase" "startup" "stiff-drive" "stochasticity" "tongue-4"
    "velocity"
};

impl Preset {
    /// What the first line of the file says, without a sentence that goes on in the next line.
    fn about(self) -> &'static str {
        let line = self.text.lines().next().unwrap_or_default().trim_start_matches(['#', ' ']);
        let whole =
            if line.ends_with('.') { line } else { line.rsplit_once([':', '.', ',']).map_or(line, |(whole, _)| whole) };
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
    #[arg(long, value_name = "NAME", conflicts_with = "sweep", hide_possible_values = true)]
    pub preset: Option<Preset>,
}

/// Reads a sweep file, or takes a preset; the command line asks for one of them.
pub fn read(file: Option<&Path>, preset: Option<Preset>) -> Result<Sweep, SweepError> {
    match (file, preset) {
        (Some(file), _) => Sweep::from_file(file),
        (None, Some(preset)) => preset.sweep(),
        (None, None) => unreachable!("the command line asks for one of them"),
    }
}

/// The values of a flag that sets keys, such as `--set V0=1e-5`, as a sweep file has them.
pub fn written(flag: &str, example: &str, settings: &[String]) -> Result<single::Written, UsageError> {
    let mut written = single::Written::new();
    for setting in settings {
        let no_setting = || UsageError(format!("{flag} {setting}: must be KEY=VALUE, such as {flag} {example}"));
        let (key, value) = setting.split_once('=').ok_or_else(no_setting)?;
        let (key, value) = (key.trim(), value.trim());
        if written.iter().any(|(earlier, _)| earlier == key) {
            return Err(UsageError(format!("{flag} {setting}: {key} is set before; keep one")));
        }
        if key.is_empty() || !key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            return Err(no_setting());
        }
        // A word such as tension needs quotes in a sweep file.
        let value = match value {
            "true" | "false" => value.to_owned(),
            value => number(value).unwrap_or_else(|_| format!("{value:?}")),
        };
        written.push((key.to_owned(), value));
    }
    Ok(written)
}

/// The values of `--set`.
pub fn written_settings(settings: &[String]) -> Result<single::Written, UsageError> {
    written("--set", "V0=1e-5", settings)
}

/// A number in the form that a sweep file takes.
pub fn number(text: &str) -> Result<String, &'static str> {
    if let Ok(whole) = text.parse::<i128>() {
        return Ok(whole.to_string());
    }
    real(text).map(|real| if real.is_nan() { "nan".to_owned() } else { format!("{real:?}") })
}

pub fn real(text: &str) -> Result<f64, &'static str> {
    text.parse().map_err(|_| "must be a number")
}

/// A sweep with one set, of the values of `--set`.
pub fn settings_as_sweep(settings: &[String]) -> Result<Sweep> {
    let text = single::sweep_text(&written_settings(settings)?, &single::Written::new(), &single::Written::new());
    Sweep::parse(&text, Path::new("flags")).map_err(as_flags)
}

/// A message about the text that flags were made into, as one about the flags.
pub fn as_flags(error: SweepError) -> anyhow::Error {
    match error {
        SweepError::Invalid { mistakes, .. } => UsageError(single::mistakes_in("flags", &mistakes)).into(),
        unreadable @ SweepError::Unreadable { .. } => unreadable.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_presets_are_the_files_of_the_folder_sweeps() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("sweeps");
        let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
        let presets: BTreeSet<_> = PRESETS.iter().map(|preset| format!("{}.toml", preset.name)).collect();
        assert_eq!(presets, files.collect());
        for preset in PRESETS {
            assert_eq!(preset.sweep().unwrap().name(), preset.name);
            assert!((10..130).contains(&preset.about().len()), "{}: {}", preset.name, preset.about());
        }
        let about = |name: &str| PRESETS.iter().find(|preset| preset.name == name).unwrap().about();
        assert_eq!(about("size"), "Locking against the number of blocks N");
        assert!(about("friction-drives").ends_with("eight frequencies"), "the next line says how far");
    }
}
