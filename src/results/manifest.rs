//! The manifest: what the tables of a directory belong to, and which sweeps were run in it.
//!
//! Opening a directory with a sweep is where mismatches are refused, before anything is written: a directory of
//! something else, another model, solver or recording, other versions. A sweep that differs in its axes or conditions
//! alone is added as a further *extension*; results of values that it no longer has are kept, and what of them is missing is
//! not run.

#[cfg(test)]
mod tests;

use crate::model::{MODEL_VERSION, Parameters, RNG_SCHEME};
use crate::results::commit::Commit;
use crate::results::error::ResultsError;
use crate::results::layout::Layout;
use crate::results::tables::{JobRow, PrecursorRow, SlipRow};
use crate::sweep::{Extension, PLAN_VERSION, Round, Sweep};
use crate::table::checksum;
use crate::table::columns::Table;
use crate::table::file::PROGRAM;
use crate::table::shown::shown_text;
use crate::table::storage::StorageError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Version of the manifest and of the layout around it. 6: it has rounds.
const FORMAT: u32 = 6;
/// Name of the folder in which a manifest is staged; only the holder of the lock of the same name writes there.
pub(super) const WRITER: &str = "manifest";
/// How often other hosts may clear that folder while a manifest is staged.
const MAX_CLEARINGS: u32 = 100;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    format: u32,
    /// The program that began the directory; any with the same versions below may continue.
    program: String,
    name: String,
    model_version: u32,
    rng_scheme: String,
    plan_version: u32,
    /// The id of a job with the model's defaults under this solver and recording: another once other things enter an id.
    identity: String,
    /// Names of the columns of each table that is recorded.
    tables: BTreeMap<String, Vec<String>>,
    /// The extensions; the last is that of the sweep that was asked for last.
    pub(super) extensions: Vec<Record>,
}

/// What the manifest says of an [`Extension`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Record {
    /// The text of the sweep file.
    pub sweep: String,
    part_cost: f64,
    kept: Option<Vec<RangeInclusive<u64>>>,
    /// Of a sweep that decides for itself.
    round: Option<Round>,
}

/// The format alone, read first: a newer manifest may have keys that are not known here.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

impl Manifest {
    /// That of this program for these extensions, one at least.
    pub(super) fn new(extensions: &[Extension]) -> Self {
        fn columns<T: Table>() -> (String, Vec<String>) {
            (T::NAME.to_owned(), T::columns().into_iter().map(|column| column.name.into_owned()).collect())
        }
        let sweep = &extensions[extensions.len() - 1].sweep;
        let mut tables = BTreeMap::from([columns::<SlipRow<'_>>(), columns::<JobRow>()]);
        if sweep.recording().precursors {
            tables.extend([columns::<PrecursorRow<'_>>()]);
        }
        Self {
            format: FORMAT,
            program: PROGRAM.to_owned(),
            name: sweep.name().to_owned(),
            model_version: MODEL_VERSION,
            rng_scheme: RNG_SCHEME.to_owned(),
            plan_version: PLAN_VERSION,
            identity: sweep.job_id(&Parameters::default()).to_string(),
            tables,
            extensions: extensions.iter().map(Record::new).collect(),
        }
    }

    /// In what it differs from `ours`, that of this program for one of its sweeps.
    pub(super) fn difference(&self, ours: &Self) -> Vec<String> {
        let versions = |manifest: &Self| {
            [
                ("model version", manifest.model_version.to_string()),
                ("random numbers", manifest.rng_scheme.clone()),
                ("plan version", manifest.plan_version.to_string()),
            ]
        };
        let mut differences: Vec<String> = versions(self)
            .into_iter()
            .zip(versions(ours))
            .filter(|(before, after)| before != after)
            .map(|((key, before), (_, after))| format!("{key}: {} -> {after}", shown_text(&before)))
            .collect();
        // Versions enter it.
        if differences.is_empty() && self.identity != ours.identity {
            differences.push(format!("ids of jobs: those of {} -> others of this program", shown_text(&self.program)));
        }
        for (name, after) in &ours.tables {
            let Some(before) = self.tables.get(name) else { continue };
            let missing = |of: &[String], from: &[String]| -> Vec<String> {
                of.iter().filter(|column| !from.contains(column)).cloned().collect()
            };
            let (gone, new) = (missing(before, after), missing(after, before));
            if before != after {
                differences.push(format!("columns of {name}: without {gone:?}, with {new:?}, or in another order"));
            }
        }
        differences
    }

    /// Writes the manifest, and copies of the sweep files beside it.
    pub(super) fn write(&self, layout: &Layout<'_>) -> Result<(), ResultsError> {
        let mut files = Vec::new();
        for (extension, record) in self.extensions.iter().enumerate() {
            if let Some(text) = record.round_text(layout, extension)? {
                files.push((layout.round(extension), text));
            }
            files.push((layout.sweep(extension), record.sweep.clone()));
        }
        let path = layout.manifest();
        let text = checksum::to_json(self).map_err(|error| ResultsError::damaged(&path, error.to_string()))?;
        // Last, so that a manifest never names a sweep that is not there.
        files.push((path, text));
        // Where each host has locks of its own, others that begin clear the staging folder, each of them once.
        let mut clearings = 0;
        loop {
            match publish(layout, &files) {
                Err(error) if error.is_missing() && clearings < MAX_CLEARINGS => clearings += 1,
                ended => return Ok(ended?),
            }
        }
    }

    /// Whether the parts of both have the same jobs and the same bytes.
    pub(super) fn is_of_same_plan(&self, other: &Self) -> bool {
        self.difference(other).is_empty() && self.extensions == other.extensions
    }

    /// Its extensions, with their sweeps parsed.
    pub(super) fn extensions(&self, layout: &Layout<'_>) -> Result<Vec<Extension>, ResultsError> {
        let mut extensions: Vec<Extension> = Vec::with_capacity(self.extensions.len());
        for (number, Record { sweep: text, part_cost, kept, round }) in self.extensions.iter().enumerate() {
            // Rounds of one sweep follow each other.
            let sweep = match extensions.last() {
                Some(Extension { sweep, .. }) if sweep.text() == text => sweep.clone(),
                _ => parse(layout, number, text)?,
            };
            if sweep.rounds().is_some() != round.is_some() {
                let problem = format!("its sweep {number} has rounds where it decides nothing, or none where it does");
                return Err(ResultsError::damaged(&layout.manifest(), problem));
            }
            extensions.push(Extension { sweep, part_cost: *part_cost, kept: kept.clone(), round: round.clone() });
        }
        Ok(extensions)
    }

    /// Looks whether a program can have written this.
    fn check(&self) -> Result<(), &'static str> {
        let Some((last, earlier)) = self.extensions.split_last() else { return Err("there is no sweep") };
        if last.kept.is_some() || earlier.iter().any(|record| record.kept.is_none()) {
            return Err("it keeps points of other sweeps than the earlier ones");
        }
        if !self.extensions.iter().all(|record| record.part_cost.is_finite() && record.part_cost >= 0.0) {
            return Err("the cost of a part makes no sense");
        }
        let is_ordered = |kept: &Vec<RangeInclusive<u64>>| {
            kept.iter().all(|range| range.start() <= range.end())
                && kept.windows(2).all(|pair| pair[0].end() < pair[1].start())
        };
        let kept = earlier.iter().filter_map(|record| record.kept.as_ref());
        let rounds = self.extensions.iter().filter_map(|record| Some(&record.round.as_ref()?.points));
        if kept.chain(rounds).all(is_ordered) {
            Ok(())
        } else {
            Err("the points that it keeps, or those of a round, are not in order")
        }
    }

    /// Reads the manifest alone; `None` if there is none.
    pub(super) fn read(layout: &Layout<'_>) -> Result<Option<Self>, ResultsError> {
        let path = layout.manifest();
        if !layout.storage.exists(&path)? {
            return Ok(None);
        }
        let text = read_text(layout, &path)?;
        let damaged = |problem: String| ResultsError::damaged(&path, problem);
        let Format { format } = serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        if format != FORMAT {
            let problem = format!(
                "has format {format}, this program knows {FORMAT}; use the program that wrote it, or choose another \
                 directory with --out"
            );
            return Err(ResultsError::refused(&path, problem));
        }
        let manifest: Self = checksum::from_json(&text).map_err(damaged)?;
        manifest.check().map_err(|problem| damaged(problem.to_owned()))?;
        Ok(Some(manifest))
    }
}

impl Record {
    /// Whether it is that of an extension, whatever of it is kept since.
    pub(super) fn is_of(&self, extension: &Extension) -> bool {
        (self.sweep.as_str(), self.part_cost, &self.round)
            == (extension.sweep.text(), extension.part_cost, &extension.round)
    }

    /// The copy of its round; the first of a directory follows from the sweep.
    pub(super) fn round_text(&self, layout: &Layout<'_>, extension: usize) -> Result<Option<String>, ResultsError> {
        let round = self.round.as_ref().filter(|_| extension > 0).map(checksum::to_json).transpose();
        round.map_err(|error| ResultsError::damaged(&layout.round(extension), error.to_string()))
    }

    pub(super) fn new(Extension { sweep, part_cost, kept, round }: &Extension) -> Self {
        Self { sweep: sweep.text().to_owned(), part_cost: *part_cost, kept: kept.clone(), round: round.clone() }
    }
}

/// The manifest and its extensions, verified; `None` if there is no manifest.
pub(super) fn read_with_sweeps(layout: &Layout<'_>) -> Result<Option<(Manifest, Vec<Extension>)>, ResultsError> {
    let Some(manifest) = Manifest::read(layout)? else { return Ok(None) };
    for (extension, record) in manifest.extensions.iter().enumerate() {
        let path = layout.sweep(extension);
        if read_text(layout, &path)? != record.sweep {
            return Err(ResultsError::damaged(&path, "it was changed; edit the original sweep file instead"));
        }
    }
    let extensions = manifest.extensions(layout)?;
    Ok(Some((manifest, extensions)))
}

/// Parses the text of a sweep file of a directory.
pub(super) fn parse(layout: &Layout<'_>, extension: usize, text: &str) -> Result<Sweep, ResultsError> {
    let path = layout.sweep(extension);
    Sweep::parse(text, &path).map_err(|error| ResultsError::damaged(&path, error.to_string()))
}

/// Refuses a directory that differs in something, with the way out.
pub(super) fn refuse(layout: &Layout<'_>, differences: &[String], way_out: &str) -> Result<(), ResultsError> {
    if differences.is_empty() {
        return Ok(());
    }
    let differences = differences.join("\n  ");
    let problem = format!("holds other results, nothing was changed:\n  {differences}\n{way_out}");
    Err(ResultsError::refused(layout.root(), problem))
}

/// The text of a file that must be there.
pub(super) fn read_text(layout: &Layout<'_>, path: &Path) -> Result<String, ResultsError> {
    match layout.storage.read(path) {
        Err(error) if error.is_missing() => Err(ResultsError::damaged(path, "it is missing")),
        Err(error) if error.is_no_file() => Err(ResultsError::damaged(path, error.source.to_string())),
        bytes => String::from_utf8(bytes?).map_err(|error| ResultsError::damaged(path, error.to_string())),
    }
}

/// Puts files with these texts in their places, in this order.
fn publish(layout: &Layout<'_>, files: &[(PathBuf, String)]) -> Result<(), StorageError> {
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
    for (path, text) in files {
        commit.stage_bytes(path, text.as_bytes())?;
    }
    commit.publish()
}
