//! For tests: the disk of the operating system, with operations that a test can watch, change or let fail.

use super::{Disk, Sink, Storage, StorageError, StoredFile};
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::path::Path;

/// What an operation does to the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    Look,
    Change,
}

/// The [`Disk`], but for what is said otherwise.
pub trait OverDisk: Sync {
    /// Comes before each operation, which fails if this does.
    fn before(&self, _: Access) -> io::Result<()> {
        Ok(())
    }

    fn open_file(&self, file: &Path) -> Result<File, StorageError> {
        Disk.open(file)
    }

    /// Puts something between a file and what is written to it.
    fn wrap(&self, file: File) -> Box<dyn Sink> {
        Box::new(file)
    }
}

impl<T: OverDisk> Storage for T {
    fn create_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.before(Access::Change)
            .map_err(StorageError::at("create", folder))?;
        Disk.create_folder(folder)
    }
    fn create(&self, file: &Path) -> Result<StoredFile, StorageError> {
        let created = self
            .before(Access::Change)
            .and_then(|()| File::create_new(file));
        let sink = self.wrap(created.map_err(StorageError::at("create", file))?);
        Ok(StoredFile {
            path: file.to_owned(),
            sink,
        })
    }
    fn rename(&self, from: &Path, to: &Path) -> Result<(), StorageError> {
        self.before(Access::Change)
            .map_err(StorageError::at("move a file here", to))?;
        Disk.rename(from, to)
    }
    fn link_new(&self, from: &Path, to: &Path) -> Result<bool, StorageError> {
        self.before(Access::Change)
            .map_err(StorageError::at("create", to))?;
        Disk.link_new(from, to)
    }
    fn sync_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.before(Access::Change)
            .map_err(StorageError::at("sync", folder))?;
        Disk.sync_folder(folder)
    }
    fn list(&self, folder: &Path) -> Result<Vec<OsString>, StorageError> {
        self.before(Access::Look)
            .map_err(StorageError::at("list", folder))?;
        Disk.list(folder)
    }
    fn open(&self, file: &Path) -> Result<File, StorageError> {
        self.before(Access::Look)
            .map_err(StorageError::at("read", file))?;
        self.open_file(file)
    }
    fn exists(&self, file: &Path) -> Result<bool, StorageError> {
        self.before(Access::Look)
            .map_err(StorageError::at("look up", file))?;
        Disk.exists(file)
    }
    fn remove(&self, file: &Path) -> Result<(), StorageError> {
        self.before(Access::Change)
            .map_err(StorageError::at("remove", file))?;
        Disk.remove(file)
    }
    fn remove_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.before(Access::Change)
            .map_err(StorageError::at("remove", folder))?;
        Disk.remove_folder(folder)
    }
}
