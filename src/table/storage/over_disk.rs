//! Disks of tests: that of the operating system, but for what a test says otherwise.

use super::{Disk, Lock, Storage, StoredFile};
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

    fn create_file(&self, file: &Path) -> io::Result<Box<dyn StoredFile>> {
        Disk.create(file)
    }

    fn exchange_folders(&self, one: &Path, other: &Path) -> io::Result<()> {
        Disk.exchange(one, other)
    }

    fn try_lock(&self, file: &Path) -> io::Result<Lock> {
        Disk.lock(file)
    }
}

impl<T: OverDisk> Storage for T {
    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        self.before(Access::Change)?;
        Disk.create_folder(folder)
    }
    fn create(&self, file: &Path) -> io::Result<Box<dyn StoredFile>> {
        self.before(Access::Change)?;
        self.create_file(file)
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.before(Access::Change)?;
        Disk.rename(from, to)
    }
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.before(Access::Change)?;
        Disk.sync_folder(folder)
    }
    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>> {
        self.before(Access::Look)?;
        Disk.list(folder)
    }
    fn open(&self, file: &Path) -> io::Result<File> {
        self.before(Access::Look)?;
        Disk.open(file)
    }
    fn exists(&self, file: &Path) -> io::Result<bool> {
        self.before(Access::Look)?;
        Disk.exists(file)
    }
    fn remove(&self, file: &Path) -> io::Result<()> {
        self.before(Access::Change)?;
        Disk.remove(file)
    }
    fn remove_folder(&self, folder: &Path) -> io::Result<()> {
        self.before(Access::Change)?;
        Disk.remove_folder(folder)
    }
    fn exchange(&self, one: &Path, other: &Path) -> io::Result<()> {
        self.before(Access::Change)?;
        self.exchange_folders(one, other)
    }
    fn lock(&self, file: &Path) -> io::Result<Lock> {
        self.before(Access::Look)?;
        self.try_lock(file)
    }
}
