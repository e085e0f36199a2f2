//! Storage: the few file operations that results go through, so that a faulty disk can be put underneath.

#[cfg(test)]
pub(crate) mod over_disk;

use crate::table::shown::shown;
use std::error::Error;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read as _, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Most bytes of a file that is read as a whole: more than a part can have whose jobs fit in memory.
pub const MAX_WHOLE: u64 = 1 << 32;

pub trait Sink: Write + Send {
    /// Returns when all that was written is on the disk.
    fn sync(&mut self) -> io::Result<()>;
}

pub struct StoredFile {
    path: PathBuf,
    sink: Box<dyn Sink>,
}

impl StoredFile {
    /// The file of this path, whose bytes go there.
    pub fn new(path: &Path, sink: impl Sink + 'static) -> Self {
        Self {
            path: path.to_owned(),
            sink: Box::new(sink),
        }
    }

    pub fn write(&mut self, bytes: &[u8]) -> Result<(), StorageError> {
        self.sink
            .write_all(bytes)
            .map_err(StorageError::at("write", &self.path))
    }

    pub fn sync(&mut self) -> Result<(), StorageError> {
        self.sink
            .sync()
            .map_err(StorageError::at("write", &self.path))
    }
}

impl Write for StoredFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.sink.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.sink.flush()
    }
}

impl Sink for StoredFile {
    fn sync(&mut self) -> io::Result<()> {
        self.sink.sync()
    }
}

impl Sink for Vec<u8> {
    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The file operations. Every error names the operation, the path and the operating system's reason.
pub trait Storage: Sync {
    /// Creates a folder within one that is there; nothing happens if it is there itself.
    fn create_folder(&self, folder: &Path) -> Result<(), StorageError>;
    /// Creates a file, of which nothing has the name.
    fn create(&self, file: &Path) -> Result<StoredFile, StorageError>;
    /// Renames a file within the file system, over another if there is one; or a folder.
    fn rename(&self, from: &Path, to: &Path) -> Result<(), StorageError>;
    /// Gives a file a second name that nothing has; false if something has it. Copies it where files have one name
    /// only.
    fn link_new(&self, from: &Path, to: &Path) -> Result<bool, StorageError>;
    /// Returns when the names in a folder are on the disk.
    fn sync_folder(&self, folder: &Path) -> Result<(), StorageError>;
    /// Names in a folder, sorted; empty if there is no such folder.
    fn list(&self, folder: &Path) -> Result<Vec<OsString>, StorageError>;
    /// Opens a regular file for reading. Of anything else that has its name, the error [is no
    /// file](StorageError::is_no_file).
    fn open(&self, file: &Path) -> Result<File, StorageError>;
    fn exists(&self, file: &Path) -> Result<bool, StorageError>;
    fn remove(&self, file: &Path) -> Result<(), StorageError>;
    /// Removes a folder with all that is in it; nothing happens if there is none.
    fn remove_folder(&self, folder: &Path) -> Result<(), StorageError>;

    /// All bytes of a file, up to [`MAX_WHOLE`].
    fn read(&self, file: &Path) -> Result<Vec<u8>, StorageError> {
        let mut opened = self.open(file)?;
        let mut read = || match opened.metadata()?.len() {
            ..=MAX_WHOLE => {
                let mut bytes = Vec::new();
                opened.read_to_end(&mut bytes)?;
                Ok(bytes)
            }
            _ => Err(NoFile::TooLong.into()),
        };
        read().map_err(StorageError::at("read", file))
    }

    /// When a file was written last, by the clock of its file system.
    fn modified(&self, file: &Path) -> Result<SystemTime, StorageError> {
        // A network file system may have stale answers for what is not opened.
        let metadata = self.open(file)?.metadata();
        let modified = metadata.and_then(|metadata| metadata.modified());
        modified.map_err(StorageError::at("look up", file))
    }

    fn length(&self, file: &Path) -> Result<u64, StorageError> {
        let failed = StorageError::at("read", file);
        match self.open(file)?.metadata() {
            Ok(metadata) if metadata.is_file() => Ok(metadata.len()),
            // A folder has a length, too, which must not pass for that of the file.
            Ok(_) => Err(failed(NoFile::Irregular.into())),
            Err(error) => Err(failed(error)),
        }
    }

    /// Creates a folder and its parents as needed, and brings the names of the new ones to the disk.
    fn ensure_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.ensure_folder_below(Path::new(""), folder)
    }

    /// Creates a folder below another, which must be there, and those in between; brings the new names to the disk.
    fn ensure_folder_below(&self, top: &Path, folder: &Path) -> Result<(), StorageError> {
        if folder == "" || self.exists(folder)? {
            return Ok(());
        }
        let Some(parent) = folder.parent().filter(|_| folder != top) else {
            let gone = io::Error::new(io::ErrorKind::NotFound, "it was moved or removed");
            return Err(StorageError::at("create anything in it", folder)(gone));
        };
        self.ensure_folder_below(top, parent)?;
        self.create_folder(folder)?;
        self.sync_folder(parent)
    }
}

/// Ignores that what is to be removed, moved or synced is gone: another process was first.
pub fn gone_is_fine(ended: Result<(), StorageError>) -> Result<(), StorageError> {
    match ended {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        ended => ended,
    }
}

#[derive(Debug, thiserror::Error)]
#[error("{}: cannot {action}: {source}", shown(path))]
pub struct StorageError {
    pub action: &'static str,
    pub path: PathBuf,
    pub source: io::Error,
}

impl StorageError {
    /// For `map_err`: the failed action and its path.
    pub fn at(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self {
            action,
            path: path.to_owned(),
            source,
        }
    }

    pub fn kind(&self) -> io::ErrorKind {
        self.source.kind()
    }

    /// Whether there is no file of this name.
    pub fn is_missing(&self) -> bool {
        matches!(
            self.kind(),
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
        )
    }

    /// Whether something has this name that the program cannot have written, while the disk works.
    pub fn is_no_file(&self) -> bool {
        self.source
            .get_ref()
            .is_some_and(<dyn Error + Send + Sync>::is::<NoFile>)
    }
}

#[derive(Clone, Copy, Debug, thiserror::Error)]
enum NoFile {
    #[error("it is no regular file, but a folder, a device, a FIFO or a socket")]
    Irregular,
    #[error("it has more than {} MiB", MAX_WHOLE >> 20)]
    TooLong,
}

impl From<NoFile> for io::Error {
    fn from(what: NoFile) -> Self {
        Self::new(io::ErrorKind::InvalidInput, what)
    }
}

/// Opens a regular file. A FIFO would make the program wait, and opening a device may have effects.
fn open_regular(path: &Path) -> io::Result<File> {
    match fs::metadata(path) {
        Ok(metadata) if !metadata.is_file() => Err(NoFile::Irregular.into()),
        _ => File::open(path),
    }
}

/// The device of a folder and the mount, if they are known: nothing is moved from one to another.
#[cfg(target_os = "linux")]
pub fn disk(folder: &Path) -> Option<(u32, u32, u64)> {
    use rustix::fs::{AtFlags, CWD, StatxFlags, statx};
    let found = statx(CWD, folder, AtFlags::empty(), StatxFlags::MNT_ID).ok()?;
    Some((found.stx_dev_major, found.stx_dev_minor, found.stx_mnt_id))
}

#[cfg(not(target_os = "linux"))]
pub const fn disk(_: &Path) -> Option<()> {
    None
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Disk;

impl Sink for File {
    fn sync(&mut self) -> io::Result<()> {
        self.sync_all()
    }
}

impl Storage for Disk {
    fn create_folder(&self, folder: &Path) -> Result<(), StorageError> {
        match fs::create_dir(folder) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists && folder.is_dir() => Ok(()),
            Err(_) if folder.is_symlink() => Err(StorageError::at("create", folder)(
                io::Error::other("it is a link that leads nowhere"),
            )),
            created => created.map_err(StorageError::at("create", folder)),
        }
    }

    fn create(&self, file: &Path) -> Result<StoredFile, StorageError> {
        let sink = File::create_new(file).map_err(StorageError::at("create", file))?;
        Ok(StoredFile::new(file, sink))
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<(), StorageError> {
        fs::rename(from, to).map_err(StorageError::at("move a file here", to))
    }

    fn link_new(&self, from: &Path, to: &Path) -> Result<bool, StorageError> {
        let is_there = |error: &io::Error| error.kind() == io::ErrorKind::AlreadyExists;
        let mut made = fs::hard_link(from, to);
        if made.as_ref().is_err_and(|error| !is_there(error)) {
            made = fs::read(from).and_then(|bytes| File::create_new(to)?.write_all(&bytes));
        }
        match made {
            Err(error) if is_there(&error) => Ok(false),
            made => made.map(|()| true).map_err(StorageError::at("create", to)),
        }
    }

    fn sync_folder(&self, folder: &Path) -> Result<(), StorageError> {
        // An empty path is that of the present folder.
        let path = if folder == "" { Path::new(".") } else { folder };
        let mut options = File::options();
        options.read(true).custom_flags(libc::O_DIRECTORY);
        let synced = options.open(path).and_then(|folder| folder.sync_all());
        synced.map_err(StorageError::at("sync", folder))
    }

    fn list(&self, folder: &Path) -> Result<Vec<OsString>, StorageError> {
        let names = || -> io::Result<Vec<OsString>> {
            fs::read_dir(folder)?
                .map(|entry| Ok(entry?.file_name()))
                .collect()
        };
        match names() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
            listed => {
                let mut names = listed.map_err(StorageError::at("list", folder))?;
                names.sort();
                Ok(names)
            }
        }
    }

    fn open(&self, file: &Path) -> Result<File, StorageError> {
        open_regular(file).map_err(StorageError::at("read", file))
    }

    fn exists(&self, file: &Path) -> Result<bool, StorageError> {
        match file.try_exists() {
            // What should be a folder on the way is a file.
            Err(error) if error.kind() == io::ErrorKind::NotADirectory => Ok(false),
            exists => exists.map_err(StorageError::at("look up", file)),
        }
    }

    fn remove(&self, file: &Path) -> Result<(), StorageError> {
        fs::remove_file(file).map_err(StorageError::at("remove", file))
    }

    fn remove_folder(&self, folder: &Path) -> Result<(), StorageError> {
        let removed = fs::remove_dir_all(folder);
        gone_is_fine(removed.map_err(StorageError::at("remove", folder)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_never_created_over_another_or_where_a_link_leads() {
        let folder = tempfile::tempdir().unwrap();
        let [there, link, missing] =
            ["there", "link", "missing"].map(|name| folder.path().join(name));
        fs::write(&there, "mine").unwrap();
        std::os::unix::fs::symlink(&missing, &link).unwrap();
        for planted in [&there, &link] {
            let error = Disk.create(planted).err().unwrap();
            assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        }
        assert_eq!(fs::read_to_string(there).unwrap(), "mine");
        assert!(!missing.exists());
    }

    #[test]
    #[cfg(unix)]
    fn what_is_no_regular_file_is_named_and_never_waited_for() {
        use rustix::fs::{CWD, FileType, Mode, mknodat};
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        mknodat(
            CWD,
            path("fifo"),
            FileType::Fifo,
            Mode::RUSR | Mode::WUSR,
            0,
        )
        .unwrap();
        let _socket = std::os::unix::net::UnixListener::bind(path("socket")).unwrap();
        fs::create_dir(path("folder")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", path("device")).unwrap();
        for name in ["fifo", "socket", "folder", "device"] {
            let looked_at = [
                Disk.read(&path(name)).map(drop),
                Disk.length(&path(name)).map(drop),
            ];
            for error in looked_at.map(Result::unwrap_err) {
                assert!(
                    error.is_no_file() && error.to_string().contains(name),
                    "{error}"
                );
            }
        }
        assert!(Disk.sync_folder(&path("fifo")).unwrap_err().is_missing());
        File::create(path("long"))
            .unwrap()
            .set_len(1 << 40)
            .unwrap();
        assert!(Disk.read(&path("long")).unwrap_err().is_no_file());
        assert!(Disk.read(&path("missing")).unwrap_err().is_missing());
    }
}
