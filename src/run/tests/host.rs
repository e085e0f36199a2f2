//! A host: the operating system's disk, as one of several processes uses it, whose turns a [`Schedule`] gives, and
//! through the caches of a network file system, if that is wanted.
//!
//! What the caches do was measured on Linux NFS 3 and 4.2: a host that has looked for a file in vain does not see it
//! when another host makes it, although the folder lists it; nor that one which it has seen is gone; and one that it
//! has read may read as before when another host has put a new one in its place. What a host does itself it sees.
//! Exclusive links and listings are true.

use super::schedule::Schedule;
use crate::results::workers::BEAT_THREAD;
use crate::table::storage::{Disk, Storage, StorageError, StoredFile};
use std::collections::HashMap;
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};

/// Operations of all hosts for which a host believes what it has seen, at most.
const STALE: u64 = 60;

/// What a host believes of a path.
enum Belief {
    Absent,
    Present,
    Read(File),
}

/// The disk as one process uses it.
pub struct Host<'a> {
    schedule: &'a Schedule,
    process: usize,
    /// What it believes, and since which operation; `None` on a local disk.
    beliefs: Option<Mutex<HashMap<PathBuf, (u64, Belief)>>>,
}

impl<'a> Host<'a> {
    pub fn new(schedule: &'a Schedule, process: usize, has_caches: bool) -> Self {
        Self {
            schedule,
            process,
            beliefs: has_caches.then(Mutex::default),
        }
    }

    /// Waits for the turn of this process. The beats of a worker come when they like.
    fn turn(&self, action: &'static str, path: &Path) -> Result<(), StorageError> {
        let is_beat = std::thread::current().name() == Some(BEAT_THREAD);
        let turn = if is_beat {
            self.schedule.outside(self.process)
        } else {
            self.schedule.turn(self.process, action)
        };
        turn.map_err(StorageError::at(action, path))
    }

    fn beliefs(&self) -> Option<MutexGuard<'_, HashMap<PathBuf, (u64, Belief)>>> {
        self.beliefs.as_ref().map(|beliefs| beliefs.lock().unwrap())
    }

    fn believe(&self, path: &Path, belief: Belief) {
        if let Some(mut beliefs) = self.beliefs() {
            beliefs.insert(path.to_owned(), (self.schedule.now(), belief));
        }
    }

    /// What it believes of a path and saw lately.
    fn believed<T>(&self, path: &Path, of: impl FnOnce(&Belief) -> Option<T>) -> Option<T> {
        let beliefs = self.beliefs()?;
        let (since, belief) = beliefs.get(path)?;
        if self.schedule.now() - since < STALE {
            of(belief)
        } else {
            None
        }
    }

    fn forget(&self, path: &Path) {
        if let Some(mut beliefs) = self.beliefs() {
            beliefs.retain(|known, _| !known.starts_with(path));
        }
    }

    /// Something that this host does to paths: what it believed of them is gone.
    fn change<T>(
        &self,
        action: &'static str,
        paths: [&Path; 2],
        act: impl FnOnce() -> Result<T, StorageError>,
    ) -> Result<T, StorageError> {
        self.turn(action, paths[1])?;
        for path in paths {
            self.forget(path);
        }
        act()
    }
}

impl Storage for Host<'_> {
    fn create_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.change("create", [folder, folder], || Disk.create_folder(folder))
    }

    /// What is written to a file is not scheduled: nobody else sees it before it has its name.
    fn create(&self, file: &Path) -> Result<StoredFile, StorageError> {
        self.change("create", [file, file], || Disk.create(file))
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<(), StorageError> {
        self.change("rename", [from, to], || Disk.rename(from, to))
    }

    fn link_new(&self, from: &Path, to: &Path) -> Result<bool, StorageError> {
        self.change("link", [from, to], || Disk.link_new(from, to))
    }

    fn sync_folder(&self, folder: &Path) -> Result<(), StorageError> {
        Disk.sync_folder(folder)
    }

    fn list(&self, folder: &Path) -> Result<Vec<OsString>, StorageError> {
        self.turn("list", folder)?;
        Disk.list(folder)
    }

    fn open(&self, file: &Path) -> Result<File, StorageError> {
        self.turn("open", file)?;
        let gone = || {
            Err(StorageError::at("read", file)(
                io::ErrorKind::NotFound.into(),
            ))
        };
        let stale = self.believed(file, |belief| match belief {
            Belief::Absent => Some(gone()),
            Belief::Present => None,
            Belief::Read(handle) => {
                Some(Disk.open(Path::new(&format!("/proc/self/fd/{}", handle.as_raw_fd()))))
            }
        });
        // A server is asked whether what is opened is still there.
        if let Some(stale) = stale.filter(|stale| stale.is_err() || file.exists()) {
            return stale;
        }
        let opened = Disk.open(file);
        match &opened {
            Ok(handle) => {
                let handle = handle.try_clone().map_err(StorageError::at("read", file))?;
                self.believe(file, Belief::Read(handle));
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                self.believe(file, Belief::Absent);
            }
            Err(_) => (),
        }
        opened
    }

    fn exists(&self, file: &Path) -> Result<bool, StorageError> {
        self.turn("look up", file)?;
        if let Some(stale) = self.believed(file, |belief| Some(!matches!(belief, Belief::Absent))) {
            return Ok(stale);
        }
        let exists = Disk.exists(file)?;
        self.believe(
            file,
            if exists {
                Belief::Present
            } else {
                Belief::Absent
            },
        );
        Ok(exists)
    }

    fn remove(&self, file: &Path) -> Result<(), StorageError> {
        self.change("remove", [file, file], || Disk.remove(file))
    }

    fn remove_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.change("remove", [folder, folder], || Disk.remove_folder(folder))
    }
}
