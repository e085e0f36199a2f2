//! Commit: whole files appear under their names at once, in a given order, and survive a power cut.
//!
//! Stage, fsync, rename, fsync the folder. Contract: at every instant a target is absent, or the old file, or the whole
//! new file; a file is there only if all files staged before it are. Each commit has staged names of its own, so that
//! two commits of the same files at once never write into the same file.

use crate::results::layout::Layout;
use crate::table::storage::{Storage, StorageError, StoredFile};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// A draft that nothing was written to for so long is that of a killed process.
const OLD: Duration = Duration::from_hours(24);

/// Files that are being prepared for their places. Dropped before [`Commit::publish`], it removes what it can.
pub struct Commit<'a> {
    storage: &'a dyn Storage,
    staging: PathBuf,
    /// What staged names begin with.
    token: String,
    staged: Vec<(PathBuf, PathBuf)>,
}

impl<'a> Commit<'a> {
    /// Begins in the staging folder of this worker, which must be there, or in the one above, as other commands do.
    pub fn begin(layout: &Layout<'a>) -> Result<Self, StorageError> {
        let staging = layout.drafts();
        if !layout.is_of_worker() {
            layout.ensure_folder(&staging)?;
            remove_old_drafts(layout, &staging)?;
        }
        Ok(Self::within(layout.storage, &staging))
    }

    /// Begins in a staging folder that must be there.
    pub(super) fn within(storage: &'a dyn Storage, staging: &Path) -> Self {
        let token = format!("{:016x}", own_number());
        Self {
            storage,
            staging: staging.to_owned(),
            token,
            staged: Vec::new(),
        }
    }

    /// Creates the next file, which is to be written, and synced, before it goes to its target.
    pub fn stage(&mut self, target: &Path) -> Result<StoredFile, StorageError> {
        let mut name = OsString::from(format!("{}-{}-", self.token, self.staged.len()));
        name.push(target.file_name().unwrap_or_default());
        let staged = self.staging.join(name);
        let file = self.storage.create(&staged)?;
        self.staged.push((staged, target.to_owned()));
        Ok(file)
    }

    /// Stages a small file of which all bytes are known.
    pub fn stage_bytes(&mut self, target: &Path, bytes: &[u8]) -> Result<(), StorageError> {
        let mut file = self.stage(target)?;
        file.write(bytes)?;
        file.sync()
    }

    /// Moves the staged files to their targets, in order. If a move fails, the files before it are in their places.
    pub fn publish(mut self) -> Result<(), StorageError> {
        for (staged, target) in &self.staged {
            self.storage.rename(staged, target)?;
            self.sync_folder_of(target)?;
        }
        self.staged.clear();
        Ok(())
    }

    /// Creates a file with these bytes; false if there is one of this name.
    pub(super) fn create_new(mut self, target: &Path, bytes: &[u8]) -> Result<bool, StorageError> {
        self.stage_bytes(target, bytes)?;
        let (staged, _) = &self.staged[self.staged.len() - 1];
        let is_new = self.storage.link_new(staged, target)?;
        if is_new {
            self.sync_folder_of(target)?;
        }
        Ok(is_new)
    }

    fn sync_folder_of(&self, target: &Path) -> Result<(), StorageError> {
        let folder = target.parent().unwrap_or(Path::new("."));
        self.storage.sync_folder(folder)
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

/// A number that no other process or commit has.
#[cfg(not(test))]
pub(crate) fn own_number() -> u64 {
    use std::hash::{BuildHasher, RandomState};
    RandomState::new().hash_one(std::process::id())
}

/// Whether a name is one that a commit gives: others may leave theirs in the folder.
fn is_staged(name: &OsStr) -> bool {
    let token = name.as_encoded_bytes().split(|byte| *byte == b'-').next();
    token.is_some_and(|token| token.len() == 16 && token.iter().all(u8::is_ascii_hexdigit))
}

/// Removes what killed processes that were no workers left in the staging folder.
fn remove_old_drafts(layout: &Layout<'_>, staging: &Path) -> Result<(), StorageError> {
    let storage = layout.storage;
    let names = storage.list(staging)?;
    for draft in names.iter().filter(|name| is_staged(name)) {
        let draft = staging.join(draft);
        // One that is gone has taken its place.
        let written = storage.modified(&draft).ok();
        let age = written.and_then(|written| SystemTime::now().duration_since(written).ok());
        if age.is_some_and(|age| age > OLD) {
            layout.remove(&draft)?;
        }
    }
    Ok(())
}

#[cfg(test)]
pub(crate) use tests::own_number;

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::table::storage::Disk;
    use std::cell::Cell;
    use std::fs;
    use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher, RandomState};

    thread_local! {
        /// The last number that this thread was given, if its numbers are to be known beforehand.
        pub static KNOWN_NUMBER: Cell<Option<u64>> = const { Cell::new(None) };
    }

    pub fn own_number() -> u64 {
        let known = KNOWN_NUMBER
            .get()
            .map(|last| BuildHasherDefault::<DefaultHasher>::default().hash_one(last));
        KNOWN_NUMBER.set(known);
        known.unwrap_or_else(|| RandomState::new().hash_one(std::process::id()))
    }

    #[test]
    fn published_files_are_whole_and_staging_is_empty() {
        let root = tempfile::tempdir().unwrap();
        let (staging, target) = (root.path().join("run/staging"), root.path().join("target"));
        fs::write(&target, "old").unwrap();
        let mut commit = Commit::begin(&Layout::new(&Disk, root.path())).unwrap();
        commit.stage_bytes(&target, b"new").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"old");
        commit.publish().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert!(Disk.list(&staging).unwrap().is_empty());
    }

    #[test]
    fn an_abandoned_commit_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let (staging, target) = (root.path().join("run/staging"), root.path().join("target"));
        let mut commit = Commit::begin(&Layout::new(&Disk, root.path())).unwrap();
        commit.stage_bytes(&target, b"new").unwrap();
        drop(commit);
        assert!(!target.exists());
        assert!(Disk.list(&staging).unwrap().is_empty());
    }

    #[test]
    fn a_file_that_cannot_take_its_place_holds_back_those_after_it() {
        let root = tempfile::tempdir().unwrap();
        let (missing, last) = (
            root.path().join("no folder/first"),
            root.path().join("last"),
        );
        let mut commit = Commit::begin(&Layout::new(&Disk, root.path())).unwrap();
        commit.stage_bytes(&missing, b"1").unwrap();
        commit.stage_bytes(&last, b"2").unwrap();
        let error = commit.publish().unwrap_err();
        assert!(error.to_string().contains("no folder/first"), "{error}");
        assert!(!last.exists());
    }

    #[test]
    fn what_a_killed_process_left_goes_after_a_day_and_what_is_being_written_or_is_of_others_stays()
    {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        let staging = layout.drafts();
        drop(Commit::begin(&layout).unwrap());
        let draft = |number: u64| format!("{number:016x}-0-sets.parquet");
        let old = SystemTime::now() - OLD - Duration::from_secs(9);
        for (name, is_old) in [(draft(1), true), (draft(2), false), ("mine".into(), true)] {
            let file = fs::File::create(staging.join(name)).unwrap();
            if is_old {
                file.set_modified(old).unwrap();
            }
        }
        drop(Commit::begin(&layout).unwrap());
        let left = Disk.list(&staging).unwrap();
        assert_eq!(left, [&*draft(2), "mine"]);
    }
}
