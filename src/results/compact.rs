//! Compaction: the files of many parts become few large sorted ones, the same bytes whatever the history.
//!
//! New table folders are built aside and take the place of the old ones by one exchange of two folder names, for all tables
//! at once: who lists a table sees all rows once, before and after. Names hold the seals of the files, so a reader that has
//! listed the old folder and opens the new one finds the same bytes or no file, never a mixture. A kill at any step
//! leaves the tables of before or of after.

use crate::results::commit::{Commit, create_folder};
use crate::results::compaction::Compaction;
use crate::results::layout::{Layout, part_file, part_name};
use crate::results::manifest::Directory;
use crate::results::merge::Merge;
use crate::results::part::{failures, label};
use crate::results::tables::{self, JobRow, PrecursorRow, SlipRow};
use crate::sweep::Plan;
use crate::table::columns::Table;
use crate::table::file::{DatasetError, Footer, footer};
use crate::table::storage::{Storage, StorageError};
use serde::Serialize;
use std::collections::{BTreeSet, HashSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Name of the staging folder, which only one process uses at a time.
const WRITER: &str = "compact";

/// Tables that cannot be compacted. Nothing was changed.
#[derive(Debug, thiserror::Error)]
pub enum CompactError {
    /// A file operation failed.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A table cannot be read or written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The file system cannot exchange folders.
    #[error(
        "{}: this file system cannot exchange two folders in one step, so readers would see an unfinished table; nothing \
         was changed. Copy the directory to a local disk and compact it there",
        .0.display()
    )]
    NoExchange(PathBuf),
}

/// What a compaction made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Compacted {
    /// Whether anything was changed.
    pub changed: bool,
    /// Parts in the compacted files.
    pub parts: u64,
    /// Jobs in them.
    pub jobs: u64,
    /// Files of all tables.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// What is left out of the old compacted files.
#[derive(Clone, Debug, Default)]
pub struct Without {
    /// Names of parts.
    pub parts: BTreeSet<String>,
    /// Ids of jobs that belong to no part.
    pub jobs: HashSet<String>,
    /// Files that cannot be read.
    pub files: BTreeSet<PathBuf>,
}

impl Without {
    /// Whether all is kept.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty() && self.jobs.is_empty() && self.files.is_empty()
    }
}

/// Compacts the parts that are done. Parts that are left out count as missing then, unless they have files of their own. The
/// caller sees to it that the tables are
/// whole and that nobody else writes. Files that are left out go to `quarantine`, if it is given.
///
/// # Errors
/// When a file cannot be read or written, or the file system cannot do it. The tables are then as before.
pub fn compact(
    storage: &dyn Storage,
    directory: &Directory,
    without: &Without,
    quarantine: Option<&Path>,
) -> Result<Compacted, CompactError> {
    let directory = &directory.clone().compacted_as(directory.compaction().without(&without.parts));
    let layout = directory.layout();
    let staging = layout.staging(WRITER);
    storage.remove_folder(&staging).map_err(StorageError::at("remove", &staging))?;
    let sources = Sources::of(storage, directory, without)?;
    if without.is_empty() && sources.is_compact(storage, directory)? {
        if Compaction::records(storage, layout).ok().flatten().unwrap_or_default() != [directory.compaction().clone()] {
            publish(storage, layout, &staging, vec![directory.compaction().clone()])?;
            storage.remove_folder(&staging).map_err(StorageError::at("remove", &staging))?;
        }
        return Ok(described(storage, directory.compaction(), layout, sources.jobs, false)?);
    }
    create_folder(storage, &staging)?;
    probe(storage, &staging)?;
    let new = Layout::new(&staging);
    let mut compaction = sources.compaction.clone();
    if compaction.part_count() > 0 {
        let mut build =
            Build { storage, directory, sources: &sources, without, new: &new, compaction: &mut compaction };
        build.table::<SlipRow<'_>>()?;
        if directory.records_precursors() {
            build.table::<PrecursorRow<'_>>()?;
        }
        let rows = build.table::<JobRow>()?;
        if rows != sources.jobs {
            let problem = format!("{rows} jobs were read where the plan has {}", sources.jobs);
            return Err(DatasetError::damaged(&layout.table(tables::JOBS))(problem).into());
        }
    }
    for table in directory.tables() {
        let folder = new.table(table);
        create_folder(storage, &folder)?;
        storage.sync_folder(&folder).map_err(StorageError::at("sync", &folder))?;
    }
    exchange(storage, layout, &staging, &compaction)?;
    if let Some(quarantine) = quarantine {
        for file in &without.files {
            if let Ok(inside) = file.strip_prefix(layout.tables()) {
                move_away(storage, &new.tables().join(inside), &quarantine.join(inside))?;
            }
        }
    }
    storage.remove_folder(&staging).map_err(StorageError::at("remove", &staging))?;
    Ok(described(storage, &compaction, layout, sources.jobs, true)?)
}

/// Moves a file, if it is there, under a name that is free.
///
/// # Errors
/// When that fails.
pub fn move_away(storage: &dyn Storage, from: &Path, to: &Path) -> Result<(), StorageError> {
    let exists = |path: &Path| storage.exists(path).map_err(StorageError::at("look up", path));
    if !exists(from)? {
        return Ok(());
    }
    let mut free = to.to_owned();
    let mut number = 0;
    while exists(&free)? {
        number += 1;
        free = to.with_added_extension(number.to_string());
    }
    for folder in [free.parent(), from.parent()].into_iter().flatten() {
        create_folder(storage, folder)?;
    }
    storage.rename(from, &free).map_err(StorageError::at("move a file here", &free))?;
    for folder in [free.parent(), from.parent()].into_iter().flatten() {
        storage.sync_folder(folder).map_err(StorageError::at("sync", folder))?;
    }
    Ok(())
}

/// What goes into the compacted files.
struct Sources {
    /// The parts that have files of their own.
    parts: Vec<String>,
    /// All parts, with no files yet.
    compaction: Compaction,
    /// Their jobs.
    jobs: u64,
    /// Ids of the jobs of parts that are left out.
    dropped: HashSet<String>,
}

impl Sources {
    fn of(storage: &dyn Storage, directory: &Directory, without: &Without) -> Result<Self, DatasetError> {
        let mut sources =
            Self { parts: Vec::new(), compaction: Compaction::default(), jobs: 0, dropped: without.jobs.clone() };
        for part in Plan::new(directory.sweeps()).parts() {
            if without.parts.contains(&part_name(&part)) {
                let sweep = &directory.sweeps()[part.epoch];
                sources.dropped.extend((0..part.jobs.len()).map(|job| label(sweep, &part, job).0.job_id));
            }
            if let Some(failed) = failures(storage, directory, &part)? {
                sources.jobs += part.jobs.len() as u64;
                sources.compaction.add(part.epoch, part.index, failed);
                if !directory.compaction().holds(part.epoch, part.index) {
                    sources.parts.push(part_file(&part));
                }
            }
        }
        Ok(sources)
    }

    /// Whether nothing is left to be done: every part is compacted, under the sweep that was asked for last.
    fn is_compact(&self, storage: &dyn Storage, directory: &Directory) -> Result<bool, DatasetError> {
        let Some(file) = directory.compaction().of_table(tables::JOBS).first() else {
            return Ok(self.parts.is_empty());
        };
        let path = directory.layout().table(tables::JOBS).join(file);
        let sweep = &directory.sweeps()[directory.current()];
        Ok(self.parts.is_empty() && footer(storage, &path)?.get("sweep").is_some_and(|text| text == sweep.text()))
    }
}

/// New tables on their way.
struct Build<'a> {
    storage: &'a dyn Storage,
    directory: &'a Directory,
    sources: &'a Sources,
    without: &'a Without,
    new: &'a Layout,
    compaction: &'a mut Compaction,
}

impl Build<'_> {
    /// Writes one table; gives the number of its rows.
    fn table<R: Table>(&mut self) -> Result<u64, CompactError> {
        let (layout, name) = (self.directory.layout(), R::NAME);
        let folder = self.new.table(name);
        create_folder(self.storage, &folder)?;
        let old = |file: &String| layout.table(name).join(file);
        let sorted = self.directory.compaction().of_table(name).iter().map(old);
        let merge = Merge {
            storage: self.storage,
            table: std::marker::PhantomData::<fn(&R)>,
            footer: &Footer::default().with_sweep(&self.directory.sweeps()[self.directory.current()]),
            scratch: self.new.root(),
            takes: &|job| !self.sources.dropped.contains(job),
        };
        let merged = merge.write(
            self.sources.parts.iter().map(old).collect(),
            sorted.filter(|path| !self.without.files.contains(path)).collect(),
            &folder,
        )?;
        self.compaction.files.insert(name.to_owned(), merged.names);
        Ok(merged.rows)
    }
}

/// Tries the exchange on two empty folders before anything is built.
fn probe(storage: &dyn Storage, staging: &Path) -> Result<(), CompactError> {
    let [one, other] = ["one", "other"].map(|name| staging.join(name));
    for folder in [&one, &other] {
        create_folder(storage, folder)?;
    }
    match storage.exchange(&one, &other) {
        Err(error) if error.kind() == ErrorKind::Unsupported => Err(CompactError::NoExchange(staging.to_owned())),
        exchanged => Ok(exchanged.map_err(StorageError::at("exchange folders with", &other))?),
    }
}

/// Puts the new tables in the place of the old ones, which then lie in the staging folder.
fn exchange(
    storage: &dyn Storage,
    layout: &Layout,
    staging: &Path,
    compaction: &Compaction,
) -> Result<(), DatasetError> {
    let (old, new) = (layout.tables(), Layout::new(staging).tables());
    create_folder(storage, &old)?;
    for folder in [&new, staging] {
        storage.sync_folder(folder).map_err(StorageError::at("sync", folder))?;
    }
    // Both, so that whichever tables are there after a kill, there is a record that fits. A damaged one fits none.
    let before = match Compaction::records(storage, layout) {
        Ok(records) => records.unwrap_or_else(|| vec![Compaction::default()]),
        Err(_) => Vec::new(),
    };
    let both = before.into_iter().filter(|before| before != compaction).chain([compaction.clone()]).collect();
    publish(storage, layout, staging, both)?;
    storage.exchange(&old, &new).map_err(StorageError::at("exchange folders with", &old))?;
    for folder in [layout.root(), staging] {
        storage.sync_folder(folder).map_err(StorageError::at("sync", folder))?;
    }
    publish(storage, layout, staging, vec![compaction.clone()])
}

fn publish(
    storage: &dyn Storage,
    layout: &Layout,
    staging: &Path,
    records: Vec<Compaction>,
) -> Result<(), DatasetError> {
    let mut commit = Commit::begin(storage, staging)?;
    Compaction::stage(&mut commit, layout, records)?;
    Ok(commit.publish()?)
}

fn described(
    storage: &dyn Storage,
    compaction: &Compaction,
    layout: &Layout,
    jobs: u64,
    changed: bool,
) -> Result<Compacted, StorageError> {
    let mut compacted = Compacted { changed, parts: compaction.part_count(), jobs, ..Compacted::default() };
    for (table, files) in &compaction.files {
        for file in files {
            let path = layout.table(table).join(file);
            let length = storage.open(&path).and_then(|file| file.metadata()).map(|metadata| metadata.len());
            compacted.bytes += length.map_err(StorageError::at("read", &path))?;
            compacted.files += 1;
        }
    }
    Ok(compacted)
}
