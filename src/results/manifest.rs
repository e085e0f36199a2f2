//! The manifest: what the tables of a directory belong to, and which sweeps were run in it.
//!
//! Opening a directory with a sweep is where mismatches are refused, before anything is written: a directory of something
//! else, another model, solver or recording, other versions. A sweep that differs in its axes or conditions alone is added
//! as a further *epoch*; results of values that it no longer has are kept.

#[cfg(test)]
mod tests;

use crate::model::{MODEL_VERSION, Parameters, RNG_SCHEME};
use crate::results::commit::{Commit, clear, create_folder};
use crate::results::compaction::Compaction;
use crate::results::layout::{Layout, RUN, RUN_FOLDERS};
use crate::results::tables::{self, JobRow, PrecursorRow, SlipRow};
use crate::sweep::{Job, PLAN_VERSION, Part, Sweep, SweepError};
use crate::table::arrow::schema;
use crate::table::checksum;
use crate::table::file::{DatasetError, PROGRAM};
use crate::table::storage::{Lock, Storage, StorageError, wait_for_lock};
use arrow_schema::Schema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read as _};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Version of the manifest and of the layout around it. 3: the manifest tells by `identity` which defaults its jobs were run with.
const FORMAT: u32 = 3;
/// Name of the folder in which a manifest is staged; only the holder of the lock of the same name writes there.
const WRITER: &str = "manifest";
/// How long to wait for others that write the manifest: shards that begin together do so one after the other.
const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// The file `run/manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    format: u32,
    /// The program that began the directory; any with the same versions below may go on.
    program: String,
    name: String,
    model_version: u32,
    rng_scheme: String,
    plan_version: u32,
    /// The id of a job with the model's defaults under this solver and recording: another once a default has changed that a
    /// sweep file may leave out.
    identity: String,
    /// Names of the columns of each table that is recorded.
    tables: BTreeMap<String, Vec<String>>,
    /// Texts of the sweep files, one for each epoch.
    pub(super) sweeps: Vec<String>,
    /// The epoch whose sweep was asked for last.
    pub(super) current: usize,
}

/// The format alone, read first: a newer manifest may have keys that are not known here.
#[derive(Deserialize)]
struct Format {
    format: u32,
}

impl Manifest {
    pub(super) fn new(sweep: &Sweep) -> Self {
        let columns = |schema: &Schema| schema.fields().iter().map(|field| field.name().clone()).collect();
        let mut recorded =
            vec![(tables::SLIPS, columns(&schema::<SlipRow<'_>>())), (tables::JOBS, columns(&schema::<JobRow>()))];
        if sweep.recording().precursors {
            recorded.push((tables::PRECURSORS, columns(&schema::<PrecursorRow<'_>>())));
        }
        Self {
            format: FORMAT,
            program: PROGRAM.to_owned(),
            name: sweep.name().to_owned(),
            model_version: MODEL_VERSION,
            rng_scheme: RNG_SCHEME.to_owned(),
            plan_version: PLAN_VERSION,
            identity: sweep.job_id(&Parameters::default()).to_string(),
            tables: recorded.into_iter().map(|(name, columns)| (name.to_owned(), columns)).collect(),
            sweeps: vec![sweep.text().to_owned()],
            current: 0,
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
            .map(|((key, before), (_, after))| format!("{key}: {before} -> {after}"))
            .collect();
        // Versions enter it.
        if differences.is_empty() && self.identity != ours.identity {
            differences.push(format!(
                "defaults: those of {} -> others of this program; what its sweep file leaves out would mean something else",
                self.program
            ));
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
}

/// Why a directory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DirectoryError {
    /// A file operation failed.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The record of a compaction is damaged, or does not fit the tables.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A sweep file of the directory is no longer understood.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// There is something, but no results.
    #[error("{}: is not empty and no results directory (there is no run/manifest.json); choose another with --out", .0.display())]
    NotOurs(PathBuf),
    /// There are no results.
    #[error("{}: is no results directory (there is no run/manifest.json); name one that a run made, such as results/fig3", .0.display())]
    NoResults(PathBuf),
    /// The results belong to something else.
    #[error(
        "{}: holds other results, nothing was changed:\n  {}\nchoose another directory with --out, or undo the change",
        .path.display(), .differences.join("\n  ")
    )]
    Changed {
        /// The directory.
        path: PathBuf,
        /// What differs, as `key: before -> after`.
        differences: Vec<String>,
    },
    /// The manifest or a sweep file beside it does not read.
    #[error("{}: damaged: {problem}; `stickslip verify` on the results directory tells how to repair it", .path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// Written by a program with another format.
    #[error("{}: has format {format}, this program knows {FORMAT}; use the program that wrote it", .path.display())]
    Format {
        /// The manifest.
        path: PathBuf,
        /// Its format.
        format: u32,
    },
    /// Another program is opening the same directory.
    #[error("{}: is being opened by another run; try again in a moment", .0.display())]
    Busy(PathBuf),
}

/// A results directory that fits this program.
#[derive(Clone, Debug)]
pub struct Directory {
    layout: Layout,
    sweeps: Vec<Sweep>,
    current: usize,
    compaction: Compaction,
}

impl Directory {
    /// Opens the directory of a sweep: begins it, goes on with it, or adds an epoch.
    ///
    /// # Errors
    /// When the directory holds something else, or cannot be read or written. Nothing is written if it is refused.
    pub fn open(storage: &dyn Storage, root: &Path, sweep: &Sweep) -> Result<Self, DirectoryError> {
        let layout = Layout::new(root);
        if let Opened::Ready(directory) = Self::compare(storage, &layout, sweep)? {
            return directory.with_compaction(storage);
        }
        create_folder(storage, &layout.locks())?;
        let lock = layout.locks().join(WRITER);
        let lock = wait_for_lock(storage, &lock, LONGEST_WAIT)?;
        if matches!(lock, Lock::Taken) {
            return Err(DirectoryError::Busy(root.to_owned()));
        }
        // Another run may have written the manifest before the lock was ours.
        match Self::compare(storage, &layout, sweep)? {
            Opened::Ready(directory) => directory.with_compaction(storage),
            Opened::ToWrite(manifest, sweeps) => {
                let directory = Self::new(layout, sweeps, manifest.current).with_compaction(storage)?;
                directory.write(storage, &manifest)?;
                Ok(directory)
            }
        }
    }

    /// Reads a directory as it is.
    ///
    /// # Errors
    /// When it is no results directory, belongs to other versions, or is damaged.
    pub fn read(storage: &dyn Storage, root: &Path) -> Result<Self, DirectoryError> {
        Self::read_sweeps(storage, root)?.with_compaction(storage)
    }

    /// Reads which sweeps a directory belongs to, without a look at its tables.
    ///
    /// # Errors
    /// As [`Directory::read`].
    pub fn read_sweeps(storage: &dyn Storage, root: &Path) -> Result<Self, DirectoryError> {
        let layout = Layout::new(root);
        let (manifest, sweeps) =
            read_manifest(storage, &layout)?.ok_or_else(|| DirectoryError::NoResults(root.to_owned()))?;
        Ok(Self::new(layout, sweeps, manifest.current))
    }

    pub(super) fn new(layout: Layout, sweeps: Vec<Sweep>, current: usize) -> Self {
        Self { layout, sweeps, current, compaction: Compaction::default() }
    }

    /// The same, with what is compacted now.
    ///
    /// # Errors
    /// When the record of the compaction is damaged or does not fit the tables.
    pub fn with_compaction(mut self, storage: &dyn Storage) -> Result<Self, DirectoryError> {
        self.compaction = Compaction::read(storage, &self.layout)?;
        Ok(self)
    }

    /// Whether precursors have a table.
    #[must_use]
    pub fn records_precursors(&self) -> bool {
        self.sweeps[self.current].recording().precursors
    }

    /// Names of the tables, that of the jobs last.
    pub fn tables(&self) -> impl Iterator<Item = &'static str> + use<> {
        let precursors = self.records_precursors().then_some(tables::PRECURSORS);
        [Some(tables::SLIPS), precursors, Some(tables::JOBS)].into_iter().flatten()
    }

    /// The same, with another notion of what is compacted.
    #[must_use]
    pub(super) fn compacted_as(mut self, compaction: Compaction) -> Self {
        self.compaction = compaction;
        self
    }

    /// What is compacted.
    #[must_use]
    pub const fn compaction(&self) -> &Compaction {
        &self.compaction
    }

    /// Where everything lies.
    #[must_use]
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The sweeps that were run here, one for each epoch.
    #[must_use]
    pub fn sweeps(&self) -> &[Sweep] {
        &self.sweeps
    }

    /// The epoch whose sweep was asked for last.
    #[must_use]
    pub const fn current(&self) -> usize {
        self.current
    }

    /// Whether a part is to be there: it holds a job of the sweep that was asked for last.
    #[must_use]
    pub fn wants(&self, part: &Part) -> bool {
        let current = &self.sweeps[self.current];
        part.epoch == self.current || part.jobs.iter().any(|job| current.contains(&job.parameters))
    }

    /// How many jobs of a part are not of the sweep that was asked for last.
    #[must_use]
    pub fn unwanted_jobs(&self, part: &Part) -> u64 {
        let current = &self.sweeps[self.current];
        let is_wanted = |job: &&Job| part.epoch == self.current || current.contains(&job.parameters);
        (part.jobs.len() - part.jobs.iter().filter(is_wanted).count()) as u64
    }

    fn compare(storage: &dyn Storage, layout: &Layout, sweep: &Sweep) -> Result<Opened, DirectoryError> {
        // In this order: another run may write the manifest in between, and none removes it.
        let is_fresh = is_fresh(storage, layout)?;
        let Some((mut manifest, mut sweeps)) = read_manifest(storage, layout)? else {
            return if is_fresh {
                Ok(Opened::ToWrite(Manifest::new(sweep), vec![sweep.clone()]))
            } else {
                Err(DirectoryError::NotOurs(layout.root().to_owned()))
            };
        };
        let last = &sweeps[manifest.current];
        let mut differences = manifest.difference(&Manifest::new(last));
        differences.extend(last.difference(sweep).iter().map(ToString::to_string));
        if !differences.is_empty() {
            return Err(DirectoryError::Changed { path: layout.root().to_owned(), differences });
        }
        let epoch = sweeps.iter().position(|known| known.text() == sweep.text());
        if epoch == Some(manifest.current) {
            return Ok(Opened::Ready(Self::new(layout.clone(), sweeps, manifest.current)));
        }
        manifest.current = epoch.unwrap_or_else(|| {
            sweeps.push(sweep.clone());
            manifest.sweeps.push(sweep.text().to_owned());
            sweeps.len() - 1
        });
        Ok(Opened::ToWrite(manifest, sweeps))
    }

    pub(super) fn write(&self, storage: &dyn Storage, manifest: &Manifest) -> Result<(), DirectoryError> {
        let staging = self.layout.staging(WRITER);
        clear(storage, &staging)?;
        let mut commit = Commit::begin(storage, &staging)?;
        for (epoch, sweep) in self.sweeps.iter().enumerate() {
            commit.stage_bytes(&self.layout.sweep(epoch), sweep.text().as_bytes())?;
        }
        let path = self.layout.manifest();
        let text = checksum::to_json(manifest)
            .map_err(|error| DirectoryError::Damaged { path: path.clone(), problem: error.to_string() })?;
        // Last, so that a manifest never names a sweep that is not there.
        commit.stage_bytes(&path, text.as_bytes())?;
        Ok(commit.publish()?)
    }
}

/// What comparing a sweep with a directory says.
enum Opened {
    /// The directory is as it should be.
    Ready(Directory),
    /// It will be with this manifest and these sweeps.
    ToWrite(Manifest, Vec<Sweep>),
}

/// Whether a directory holds nothing, or no more than what a run leaves that was killed before it had a manifest.
fn is_fresh(storage: &dyn Storage, layout: &Layout) -> Result<bool, StorageError> {
    let list = |folder: &Path| storage.list(folder).map_err(StorageError::at("list", folder));
    let first_sweep = layout.sweep(0);
    let ours = |name: &std::ffi::OsString| {
        RUN_FOLDERS.iter().any(|folder| name == folder) || Some(name.as_os_str()) == first_sweep.file_name()
    };
    match storage.list(layout.root()) {
        // A file at this place is somebody else's.
        Err(error) if error.kind() == ErrorKind::NotADirectory => Ok(false),
        _ => Ok(list(layout.root())?.iter().all(|name| name == RUN) && list(&layout.run())?.iter().all(ours)),
    }
}

pub(super) fn read_text(storage: &dyn Storage, path: &Path) -> Result<String, DirectoryError> {
    let mut bytes = Vec::new();
    let read = storage.open(path).and_then(|mut file| file.read_to_end(&mut bytes));
    match read {
        Err(error) if error.kind() == ErrorKind::NotFound => return Err(damaged(path, "it is missing".to_owned())),
        read => read.map_err(StorageError::at("read", path))?,
    };
    String::from_utf8(bytes)
        .map_err(|error| DirectoryError::Damaged { path: path.to_owned(), problem: error.to_string() })
}

pub(super) fn damaged(path: &Path, problem: String) -> DirectoryError {
    DirectoryError::Damaged { path: path.to_owned(), problem }
}

/// The manifest alone; `None` if there is none.
pub(super) fn read_alone(storage: &dyn Storage, layout: &Layout) -> Result<Option<Manifest>, DirectoryError> {
    let path = layout.manifest();
    if !storage.exists(&path).map_err(StorageError::at("look up", &path))? {
        return Ok(None);
    }
    let text = read_text(storage, &path)?;
    let Format { format } = serde_json::from_str(&text).map_err(|error| damaged(&path, error.to_string()))?;
    if format != FORMAT {
        return Err(DirectoryError::Format { path, format });
    }
    let manifest: Manifest = checksum::from_json(&text).map_err(|problem| damaged(&path, problem))?;
    if manifest.current >= manifest.sweeps.len() {
        return Err(damaged(&path, format!("there is no sweep {}", manifest.current)));
    }
    Ok(Some(manifest))
}

/// The manifest and its sweeps, verified; `None` if there is no manifest.
fn read_manifest(storage: &dyn Storage, layout: &Layout) -> Result<Option<(Manifest, Vec<Sweep>)>, DirectoryError> {
    let Some(manifest) = read_alone(storage, layout)? else { return Ok(None) };
    let mut sweeps = Vec::with_capacity(manifest.sweeps.len());
    for (epoch, expected) in manifest.sweeps.iter().enumerate() {
        let path = layout.sweep(epoch);
        let text = read_text(storage, &path)?;
        if text != *expected {
            return Err(damaged(&path, "it was changed; edit the original sweep file instead".to_owned()));
        }
        sweeps.push(Sweep::parse(&text, &path)?);
    }
    Ok(Some((manifest, sweeps)))
}
