//! The sweep that a command is about: a file, or a preset, one of the files of the folder `sweeps/`.

use crate::sweep::{Sweep, SweepError};
use clap::ValueEnum;
use clap::builder::PossibleValue;
use std::path::Path;

/// A sweep file that the program holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Preset {
    pub name: &'static str,
    pub text: &'static str,
}

const PRESETS: [Preset; 27] = [
    Preset::new("choices", include_str!("../../sweeps/choices.toml")),
    Preset::new("contacts", include_str!("../../sweeps/contacts.toml")),
    Preset::new("disorder", include_str!("../../sweeps/disorder.toml")),
    Preset::new("drag", include_str!("../../sweeps/drag.toml")),
    Preset::new("drag-strong", include_str!("../../sweeps/drag-strong.toml")),
    Preset::new("energies", include_str!("../../sweeps/energies.toml")),
    Preset::new("eq1", include_str!("../../sweeps/eq1.toml")),
    Preset::new("fig1d", include_str!("../../sweeps/fig1d.toml")),
    Preset::new("fig2", include_str!("../../sweeps/fig2.toml")),
    Preset::new("fig3", include_str!("../../sweeps/fig3.toml")),
    Preset::new("fig3-full", include_str!("../../sweeps/fig3-full.toml")),
    Preset::new("fig4b", include_str!("../../sweeps/fig4b.toml")),
    Preset::new("fig4d", include_str!("../../sweeps/fig4d.toml")),
    Preset::new("friction", include_str!("../../sweeps/friction.toml")),
    Preset::new("friction-drives", include_str!("../../sweeps/friction-drives.toml")),
    Preset::new("friction-precise", include_str!("../../sweeps/friction-precise.toml")),
    Preset::new("fronts", include_str!("../../sweeps/fronts.toml")),
    Preset::new("locking-edge", include_str!("../../sweeps/locking-edge.toml")),
    Preset::new("locking-map", include_str!("../../sweeps/locking-map.toml")),
    Preset::new("regimes", include_str!("../../sweeps/regimes.toml")),
    Preset::new("size", include_str!("../../sweeps/size.toml")),
    Preset::new("staircase", include_str!("../../sweeps/staircase.toml")),
    Preset::new("startup", include_str!("../../sweeps/startup.toml")),
    Preset::new("stiff-drive", include_str!("../../sweeps/stiff-drive.toml")),
    Preset::new("stochasticity", include_str!("../../sweeps/stochasticity.toml")),
    Preset::new("tongues", include_str!("../../sweeps/tongues.toml")),
    Preset::new("velocity", include_str!("../../sweeps/velocity.toml")),
];

impl Preset {
    const fn new(name: &'static str, text: &'static str) -> Self {
        Self { name, text }
    }

    /// The first line of the file.
    fn about(self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_matches(['#', ' ', '.', ',', ':'])
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

/// Reads a sweep file, or takes a preset; the command line asks for one of them.
pub fn read(file: Option<&Path>, preset: Option<Preset>) -> Result<Sweep, SweepError> {
    match (file, preset) {
        (Some(file), _) => Sweep::from_file(file),
        (None, Some(preset)) => preset.sweep(),
        (None, None) => unreachable!("the command line asks for one of them"),
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
    }
}
