//! Commit: whole files appear under their names at once, in a given order, and survive a power cut.
//!
//! Stage, fsync, rename, fsync the folder. Contract: at every instant a target is absent, or the old file, or the new one
//! as a whole; a file is there only if all those staged before it are. Staged names are a commit's own, so that two which
//! prepare the same files at once never write into each other's.

use crate::results::layout::Layout;
use crate::table::storage::{Lock, Storage, StorageError, wait_for_lock};
use std::ffi::OsString;
use std::hash::{BuildHasher, RandomState};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long to wait for another process that does the same, such as a reduction.
const LONGEST_WAIT: Duration = Duration::from_mins(10);

/// Files that are being prepared for their places. Dropped before [`Commit::publish`], it removes what it can.
pub struct Commit<'a> {
    storage: &'a dyn Storage,
    staging: PathBuf,
    /// What staged names begin with.
    token: String,
    staged: Vec<(PathBuf, PathBuf)>,
}

impl<'a> Commit<'a> {
    /// Begins in a staging folder.
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub fn begin(storage: &'a dyn Storage, staging: &Path) -> Result<Self, StorageError> {
        create_folder(storage, staging)?;
        Ok(Self { storage, staging: staging.to_owned(), token: token(), staged: Vec::new() })
    }

    /// Where the next file is to be written, and synced, before it goes to its target.
    pub fn stage(&mut self, target: &Path) -> PathBuf {
        let mut name = OsString::from(format!("{}-{}-", self.token, self.staged.len()));
        name.push(target.file_name().unwrap_or_default());
        let staged = self.staging.join(name);
        self.staged.push((staged.clone(), target.to_owned()));
        staged
    }

    /// Stages a small file of which all bytes are known.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn stage_bytes(&mut self, target: &Path, bytes: &[u8]) -> Result<(), StorageError> {
        let staged = self.stage(target);
        let mut file = self.storage.create(&staged).map_err(StorageError::at("create", &staged))?;
        file.write_all(bytes).and_then(|()| file.sync()).map_err(StorageError::at("write", &staged))
    }

    /// Moves the staged files to their targets, in the order in which they were staged.
    ///
    /// # Errors
    /// When a move fails; the files before it are in their places.
    pub fn publish(mut self) -> Result<(), StorageError> {
        for (staged, target) in &self.staged {
            self.storage.rename(staged, target).map_err(StorageError::at("move a finished file here", target))?;
            let folder = target.parent().unwrap_or(Path::new("."));
            self.storage.sync_folder(folder).map_err(StorageError::at("sync", folder))?;
        }
        self.staged.clear();
        Ok(())
    }
}

impl Drop for Commit<'_> {
    fn drop(&mut self) {
        for (staged, _) in &self.staged {
            // What stays is removed when the next run begins.
            let _ = self.storage.remove(staged);
        }
    }
}

/// A text that no other process or commit has.
pub(crate) fn token() -> String {
    format!("{:016x}", RandomState::new().hash_one(std::process::id()))
}

/// Waits until no other process does what this writer does, and removes what a killed one left in its staging folder. A
/// file system without locks lets in all: their files are then whole, but may be of one and of the other.
///
/// # Errors
/// When another does not end within minutes, or a file operation fails.
pub fn alone(storage: &dyn Storage, layout: &Layout, writer: &str) -> Result<Lock, StorageError> {
    create_folder(storage, &layout.locks())?;
    let file = layout.locks().join(writer);
    let lock = wait_for_lock(storage, &file, LONGEST_WAIT)?;
    if matches!(lock, Lock::Taken) {
        let held = io::Error::new(ErrorKind::WouldBlock, "another process holds it; try again when it has ended");
        return Err(StorageError::at("lock", &file)(held));
    }
    clear(storage, &layout.staging(writer))?;
    Ok(lock)
}

/// Brings the names of results to the disk: a process that was killed between a rename, or the creation of a folder, and the
/// sync after it leaves names that are seen but would not survive a power cut.
///
/// # Errors
/// When a folder cannot be synced.
pub fn settle(storage: &dyn Storage, layout: &Layout) -> Result<(), StorageError> {
    for above in layout.root().ancestors().skip(1) {
        // Most are not ours, and who made the folders in them synced them if that is possible at all.
        let _ = storage.sync_folder(if above.as_os_str().is_empty() { Path::new(".") } else { above });
    }
    for folder in layout.result_folders() {
        match storage.sync_folder(&folder) {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            synced => synced.map_err(StorageError::at("sync", &folder))?,
        }
    }
    Ok(())
}

/// Creates a folder and its parents, and brings the names of the new ones to the disk.
///
/// # Errors
/// When that fails.
pub fn create_folder(storage: &dyn Storage, folder: &Path) -> Result<(), StorageError> {
    if storage.exists(folder).map_err(StorageError::at("look up", folder))? {
        return Ok(());
    }
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty());
    if let Some(parent) = parent {
        create_folder(storage, parent)?;
    }
    storage.create_folder(folder).map_err(StorageError::at("create", folder))?;
    let parent = parent.unwrap_or(Path::new("."));
    storage.sync_folder(parent).map_err(StorageError::at("sync", parent))
}

/// Removes whatever a killed run left in a staging folder.
///
/// # Errors
/// When something cannot be removed.
pub fn clear(storage: &dyn Storage, staging: &Path) -> Result<(), StorageError> {
    for name in storage.list(staging).map_err(StorageError::at("list", staging))? {
        let left = staging.join(name);
        storage.remove(&left).map_err(StorageError::at("remove", &left))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::storage::Disk;
    use std::fs;

    #[test]
    fn published_files_are_whole_and_staging_is_empty() {
        let root = tempfile::tempdir().unwrap();
        let (staging, target) = (root.path().join("run/staging/x"), root.path().join("target"));
        fs::write(&target, "old").unwrap();
        let mut commit = Commit::begin(&Disk, &staging).unwrap();
        commit.stage_bytes(&target, b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"old");
        commit.publish().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert!(Disk.list(&staging).unwrap().is_empty());
    }

    #[test]
    fn an_abandoned_commit_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (staging, target) = (root.path().join("staging"), root.path().join("target"));
        let mut commit = Commit::begin(&Disk, &staging).unwrap();
        commit.stage_bytes(&target, b"new").unwrap();
        drop(commit);
        assert!(!target.exists());
        assert!(Disk.list(&staging).unwrap().is_empty());
    }

    #[test]
    fn a_file_that_cannot_take_its_place_holds_back_those_after_it() {
        let root = tempfile::tempdir().unwrap();
        let (missing, last) = (root.path().join("no folder/first"), root.path().join("last"));
        let mut commit = Commit::begin(&Disk, &root.path().join("staging")).unwrap();
        commit.stage_bytes(&missing, b"1").unwrap();
        commit.stage_bytes(&last, b"2").unwrap();
        let error = commit.publish().unwrap_err();
        assert!(error.to_string().contains("no folder/first"), "{error}");
        assert!(!last.exists());
    }
}
