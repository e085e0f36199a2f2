//! Storage: the few file operations that results go through, so that a faulty disk can be put underneath.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

/// A file that is being written.
pub trait StoredFile: Write + Send {
    /// Returns when all that was written is on the disk.
    ///
    /// # Errors
    /// When it cannot be brought there.
    fn sync(&mut self) -> io::Result<()>;
}

/// The file operations. Every error is that of the operating system.
#[allow(clippy::missing_errors_doc, reason = "said once for all")]
pub trait Storage: Sync {
    /// Creates a folder and its parents; nothing happens if it is there.
    fn create_folder(&self, folder: &Path) -> io::Result<()>;
    /// Creates a file, or empties it.
    fn create(&self, file: &Path) -> io::Result<Box<dyn StoredFile>>;
    /// Renames a file within the file system, over another if there is one.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;
    /// Returns when the names in a folder are on the disk.
    fn sync_folder(&self, folder: &Path) -> io::Result<()>;
    /// Names in a folder, sorted; none if there is no such folder.
    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>>;
    /// Opens a file for reading.
    fn open(&self, file: &Path) -> io::Result<File>;
    /// Whether a file is there.
    fn exists(&self, file: &Path) -> io::Result<bool>;
    /// Removes a file.
    fn remove(&self, file: &Path) -> io::Result<()>;
}

/// The file system of the operating system.
#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl StoredFile for File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_all()
    }
}

impl Storage for Disk {
    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        fs::create_dir_all(folder)
    }

    fn create(&self, file: &Path) -> io::Result<Box<dyn StoredFile>> {
        Ok(Box::new(File::create(file)?))
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        File::open(folder)?.sync_all()
    }

    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>> {
        let entries = match fs::read_dir(folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries?,
        };
        let mut names = entries.map(|entry| Ok(entry?.file_name())).collect::<io::Result<Vec<_>>>()?;
        names.sort();
        Ok(names)
    }

    fn open(&self, file: &Path) -> io::Result<File> {
        File::open(file)
    }

    fn exists(&self, file: &Path) -> io::Result<bool> {
        file.try_exists()
    }

    fn remove(&self, file: &Path) -> io::Result<()> {
        fs::remove_file(file)
    }
}
