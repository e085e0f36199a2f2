//! Verification: every file whole and in its place, every job there once; what is damaged is named, and can be taken away.
//!
//! ```text
//! beginning.rs   manifest and sweep files
//! parts.rs       the files of each part of the plan, and what else lies among them
//! compacted.rs   the compacted files  ->  survivors.rs  what of damaged ones can be kept
//! rows.rs        the rows of all tables held against each other
//! repair.rs      moves what is damaged away, so that the next run makes it anew
//! ```
//!
//! Reading changes nothing. Memory: one part; for damaged compacted files an entry for each of their jobs.

mod beginning;
mod compacted;
mod parts;
mod repair;
mod rows;
mod survivors;

pub use repair::{RepairError, Repaired, repair};

use crate::results::compact::Without;
use crate::results::layout::part_name;
use crate::results::manifest::{Directory, DirectoryError};
use crate::sweep::Plan;
use crate::table::checksum;
use crate::table::file::DatasetError;
use crate::table::storage::{Storage, StorageError};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Version of [`Verification`] as JSON.
const FORMAT: u32 = 1;

/// What a verification found. Serialises to a stable form, told by `format`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Verification {
    /// Version of this form.
    pub format: u32,
    /// Whether nothing is damaged.
    pub whole: bool,
    /// Damage, in the order in which it was found.
    pub problems: Vec<Problem>,
    /// Table files that are whole.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Parts that are done and whole.
    pub parts: u64,
    /// Jobs in them.
    pub jobs: u64,
    /// Parts that are asked for and not yet done, damaged ones aside.
    pub parts_missing: u64,
    /// Jobs in them.
    pub jobs_missing: u64,
    /// Epochs whose sweeps are to be run to make damaged parts anew, in this order.
    pub epochs: Vec<usize>,
}

/// Something that is damaged.
#[derive(Clone, Debug, Serialize)]
pub struct Problem {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
    /// Names of the parts that are run again for it.
    pub parts: Vec<String>,
    /// Ids of the jobs concerned.
    pub jobs: Vec<String>,
    /// What mends it.
    pub remedy: Remedy,
}

/// What mends a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// Writing the manifest and the copies of the sweep files anew.
    Beginning,
    /// Moving the file away.
    File,
    /// Moving the files of its part away, and running it.
    Part,
    /// Making the compacted files anew without the parts concerned, and running these.
    Compacted,
    /// Running the part: there is nothing of it.
    Run,
    /// Reducing anew.
    Reduce,
}

impl Problem {
    fn of_file(path: PathBuf, problem: impl Into<String>, remedy: Remedy) -> Self {
        Self { path, problem: problem.into(), parts: Vec::new(), jobs: Vec::new(), remedy }
    }
}

impl Verification {
    /// Whether something is to be moved or written before anything is run.
    #[must_use]
    pub fn wants_repair(&self) -> bool {
        self.problems.iter().any(|problem| !matches!(problem.remedy, Remedy::Run | Remedy::Reduce))
    }

    /// Whether tables that were compacted are to be compacted again.
    #[must_use]
    pub fn wants_compaction(&self) -> bool {
        !self.epochs.is_empty() && self.problems.iter().any(|problem| problem.remedy == Remedy::Compacted)
    }

    /// Whether reduced data are to be made anew, and no run does it.
    #[must_use]
    pub fn wants_reduction(&self) -> bool {
        self.epochs.is_empty() && self.problems.iter().any(|problem| problem.remedy == Remedy::Reduce)
    }

    fn count(&mut self, storage: &dyn Storage, path: &Path) -> Result<(), StorageError> {
        let length = storage.open(path).and_then(|file| file.metadata()).map(|metadata| metadata.len());
        self.bytes += length.map_err(StorageError::at("read", path))?;
        self.files += 1;
        Ok(())
    }
}

/// Verifies a directory. `committed` holds the names of the parts that are known to have been committed.
///
/// # Errors
/// When it is no results directory, belongs to another version of the program, or cannot be restored at all.
pub fn verify(
    storage: &dyn Storage,
    root: &Path,
    committed: &BTreeSet<String>,
) -> Result<Verification, DirectoryError> {
    Ok(examine(storage, root, committed)?.0)
}

/// Verifies a directory; gives it with what of its compacted files can be kept, and what cannot.
fn examine(
    storage: &dyn Storage,
    root: &Path,
    committed: &BTreeSet<String>,
) -> Result<(Verification, Directory, Without), DirectoryError> {
    let mut verification = Verification { format: FORMAT, ..Verification::default() };
    let directory = beginning::read(storage, root, &mut verification.problems)?;
    let (directory, without) = compacted::verify(storage, directory, &mut verification)?;
    parts::verify(storage, &directory, &without, committed, &mut verification)?;
    let reduced = directory.layout().reduced();
    for name in storage.list(&reduced).map_err(StorageError::at("list", &reduced))? {
        let path = reduced.join(name);
        if let Err(error) = checksum::check(storage, &path) {
            verification.problems.push(Problem::of_file(path, problem_of(&error), Remedy::Reduce));
        }
    }
    verification.whole = verification.problems.is_empty();
    verification.epochs = epochs(&directory, &verification.problems);
    Ok((verification, directory, without))
}

/// The sweeps to be run for the parts of these problems, that which was asked for last at the end.
fn epochs(directory: &Directory, problems: &[Problem]) -> Vec<usize> {
    let names: BTreeSet<&str> = problems.iter().flat_map(|problem| &problem.parts).map(String::as_str).collect();
    if names.is_empty() {
        return Vec::new();
    }
    let mut epochs = BTreeSet::new();
    for part in Plan::new(directory.sweeps()).parts() {
        if names.contains(part_name(&part).as_str()) && !directory.wants(&part) {
            epochs.insert(part.epoch);
        }
    }
    epochs.remove(&directory.current());
    epochs.into_iter().chain([directory.current()]).collect()
}

/// What an error says is wrong with a file.
fn problem_of(error: &DatasetError) -> String {
    match error {
        DatasetError::Damaged { problem, .. } => problem.clone(),
        DatasetError::Storage(StorageError { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => {
            "it is missing".to_owned()
        }
        DatasetError::Storage(StorageError { source, .. }) => format!("it cannot be read: {source}"),
        error => error.to_string(),
    }
}
