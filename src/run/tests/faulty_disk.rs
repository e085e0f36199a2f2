//! A disk in memory that fails at the n-th operation of a kind, and knows what a power cut would leave.
//!
//! Names and bytes are kept twice: as processes see them, and as they lie on the disk. A file's bytes get there when it
//! is synced, the names in a folder when the folder is.

use super::fault::{Fault, Operation};
use crate::results::workers::BEAT_THREAD;
use crate::table::storage::{Sink, Storage, StorageError, StoredFile};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

#[derive(Debug, Default)]
struct Bytes {
    seen: Vec<u8>,
    on_disk: Vec<u8>,
}

#[derive(Clone, Debug)]
enum Node {
    Folder,
    File(Arc<Mutex<Bytes>>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Fine,
    Full,
    Dead,
}

struct State {
    seen: BTreeMap<PathBuf, Node>,
    on_disk: BTreeMap<PathBuf, Node>,
    mode: Mode,
    armed: Option<(Operation, usize, Fault)>,
    /// How often the armed operation may still be done before it fails.
    left: usize,
    fired: Option<Fault>,
}

/// What is to be done with an operation.
enum Verdict {
    Done,
    HalfDone,
    Refused(i32),
    DoneButRefused(i32),
}

/// The disk. Clones are the same disk.
#[derive(Clone)]
pub struct FaultyDisk(Arc<Mutex<State>>);

/// The folder that is there from the beginning.
pub const MOUNT: &str = "/disk";

impl FaultyDisk {
    pub fn new() -> Self {
        let names = BTreeMap::from([(PathBuf::from(MOUNT), Node::Folder)]);
        Self(Arc::new(Mutex::new(State {
            seen: names.clone(),
            on_disk: names,
            mode: Mode::Fine,
            armed: None,
            left: 0,
            fired: None,
        })))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// A disk of its own with the same names and bytes, all of them synced.
    pub fn copy(&self) -> Self {
        let copy = Self::new();
        let synced = |node: &Node| match node {
            Node::Folder => Node::Folder,
            Node::File(bytes) => {
                let bytes = bytes.lock().unwrap().seen.clone();
                Node::File(Arc::new(Mutex::new(Bytes {
                    on_disk: bytes.clone(),
                    seen: bytes,
                })))
            }
        };
        let names: BTreeMap<_, _> = self
            .state()
            .seen
            .iter()
            .map(|(path, node)| (path.clone(), synced(node)))
            .collect();
        copy.state().on_disk.clone_from(&names);
        copy.state().seen = names;
        copy
    }

    /// Lets the n-th such operation from now, counted from 0, fail.
    pub fn arm(&self, operation: Operation, n: usize, fault: Fault) {
        let mut state = self.state();
        state.armed = Some((operation, n, fault));
        state.left = n;
    }

    /// After the fault, whatever it was, a machine with a disk that works again. Returns whether there was a fault.
    pub fn reboot(&self) -> bool {
        let fired = self.state().fired.take();
        match fired {
            Some(Fault::PowerCut) => self.cut_power(),
            Some(Fault::PowerCutTorn) => self.tear(),
            _ => {}
        }
        let mut state = self.state();
        state.mode = Mode::Fine;
        state.armed = None;
        fired.is_some()
    }

    /// Loses all that is not synced.
    pub fn cut_power(&self) {
        let mut state = self.state();
        let is_reached = |path: &Path| {
            path.ancestors()
                .all(|above| !above.starts_with(MOUNT) || state.on_disk.contains_key(above))
        };
        let left: BTreeMap<_, _> = state
            .on_disk
            .iter()
            .filter(|(path, _)| is_reached(path))
            .map(|(path, node)| (path.clone(), node.clone()))
            .collect();
        for node in left.values() {
            if let Node::File(bytes) = node {
                let mut bytes = bytes.lock().unwrap();
                bytes.seen = bytes.on_disk.clone();
            }
        }
        state.on_disk.clone_from(&left);
        state.seen = left;
    }

    fn tear(&self) {
        let mut state = self.state();
        for node in state.seen.values() {
            if let Node::File(bytes) = node {
                let mut bytes = bytes.lock().unwrap();
                if bytes.seen != bytes.on_disk {
                    let half = bytes.seen.len() / 2;
                    bytes.seen.truncate(half);
                    bytes.on_disk = bytes.seen.clone();
                }
            }
        }
        state.on_disk = state.seen.clone();
    }

    /// All files below a folder with their bytes, by their paths within it.
    pub fn files(&self, folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
        let state = self.state();
        let files = state.seen.iter().filter_map(|(path, node)| match node {
            Node::File(bytes) => Some((
                path.strip_prefix(folder).ok()?.to_owned(),
                bytes.lock().unwrap().seen.clone(),
            )),
            Node::Folder => None,
        });
        files.collect()
    }

    /// All folders below a folder, by their paths within it.
    pub fn folders(&self, folder: &Path) -> Vec<PathBuf> {
        let state = self.state();
        let folders = state
            .seen
            .iter()
            .filter(|(_, node)| matches!(node, Node::Folder));
        folders
            .filter_map(|(path, _)| Some(path.strip_prefix(folder).ok()?.to_owned()))
            .collect()
    }

    /// An operation on a path.
    fn on<T>(
        &self,
        operation: Operation,
        path: &Path,
        act: impl FnOnce(&mut State) -> io::Result<T>,
    ) -> Result<T, StorageError> {
        self.act(operation, act)
            .map_err(StorageError::at(operation.name(), path))
    }

    fn act<T>(
        &self,
        operation: Operation,
        act: impl FnOnce(&mut State) -> io::Result<T>,
    ) -> io::Result<T> {
        let mut state = self.state();
        match state.meet(operation) {
            Verdict::Done => act(&mut state),
            Verdict::Refused(error) => Err(io::Error::from_raw_os_error(error)),
            Verdict::DoneButRefused(error) => {
                let done = act(&mut state);
                done.and(Err(io::Error::from_raw_os_error(error)))
            }
            Verdict::HalfDone => unreachable!("only writes are half done"),
        }
    }
}

impl State {
    fn meet(&mut self, operation: Operation) -> Verdict {
        // How many beats there are depends on the machine; none is counted, nor fails while the disk works.
        let is_beat = std::thread::current().name() == Some(BEAT_THREAD);
        match self.mode {
            Mode::Dead => return Verdict::Refused(libc::EIO),
            Mode::Full if operation.needs_space() => return Verdict::Refused(libc::ENOSPC),
            _ => {}
        }
        let Some((_, _, fault)) = self
            .armed
            .filter(|(armed, _, _)| *armed == operation && !is_beat)
        else {
            return Verdict::Done;
        };
        if self.left > 0 {
            self.left -= 1;
            return Verdict::Done;
        }
        self.armed = None;
        self.fired = Some(fault);
        self.mode = match fault {
            Fault::Refused | Fault::DoneButRefused | Fault::ShortWrite => Mode::Fine,
            Fault::Full => Mode::Full,
            Fault::Killed | Fault::PowerCut | Fault::PowerCutTorn => Mode::Dead,
        };
        match fault {
            Fault::DoneButRefused => Verdict::DoneButRefused(libc::EIO),
            Fault::ShortWrite => Verdict::HalfDone,
            // The other half meets the full disk, or nobody any more.
            Fault::Full | Fault::Killed if operation == Operation::Write => Verdict::HalfDone,
            Fault::Full => Verdict::Refused(libc::ENOSPC),
            _ => Verdict::Refused(libc::EIO),
        }
    }

    fn is_folder(&self, path: &Path) -> io::Result<()> {
        match self.seen.get(path) {
            Some(Node::Folder) => Ok(()),
            Some(Node::File(_)) => Err(io::ErrorKind::NotADirectory.into()),
            None => Err(io::ErrorKind::NotFound.into()),
        }
    }

    fn file(&self, path: &Path) -> io::Result<&Arc<Mutex<Bytes>>> {
        match self.seen.get(path) {
            Some(Node::File(bytes)) => Ok(bytes),
            Some(Node::Folder) => Err(io::ErrorKind::IsADirectory.into()),
            None => Err(io::ErrorKind::NotFound.into()),
        }
    }

    /// A file, created if needed.
    fn touch(&mut self, path: &Path) -> io::Result<Arc<Mutex<Bytes>>> {
        self.is_folder(path.parent().unwrap())?;
        let node = self
            .seen
            .entry(path.to_owned())
            .or_insert_with(|| Node::File(Arc::default()));
        match node {
            Node::File(bytes) => Ok(Arc::clone(bytes)),
            Node::Folder => Err(io::ErrorKind::IsADirectory.into()),
        }
    }
}

struct FaultyFile {
    disk: FaultyDisk,
    bytes: Arc<Mutex<Bytes>>,
}

impl Write for FaultyFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let verdict = self.disk.state().meet(Operation::Write);
        let (taken, refused) = match verdict {
            Verdict::Done => (bytes.len(), None),
            // A byte must be taken, since none at all means an end.
            Verdict::HalfDone => (bytes.len().div_ceil(2), None),
            Verdict::Refused(error) => (0, Some(error)),
            Verdict::DoneButRefused(error) => (bytes.len(), Some(error)),
        };
        self.bytes.lock().unwrap().seen.extend(&bytes[..taken]);
        refused.map_or(Ok(taken), |error| Err(io::Error::from_raw_os_error(error)))
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Sink for FaultyFile {
    fn sync(&mut self) -> io::Result<()> {
        self.disk.act(Operation::Sync, |_| {
            let mut bytes = self.bytes.lock().unwrap();
            bytes.on_disk = bytes.seen.clone();
            Ok(())
        })
    }
}

impl Storage for FaultyDisk {
    fn create_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.on(Operation::CreateFolder, folder, |state| {
            state.is_folder(folder.parent().unwrap())?;
            state.seen.entry(folder.to_owned()).or_insert(Node::Folder);
            state.is_folder(folder)
        })
    }

    fn create(&self, file: &Path) -> Result<StoredFile, StorageError> {
        self.on(Operation::Create, file, |state| {
            if state.seen.contains_key(file) {
                return Err(io::ErrorKind::AlreadyExists.into());
            }
            let bytes = state.touch(file)?;
            Ok(StoredFile::new(
                file,
                FaultyFile {
                    disk: self.clone(),
                    bytes,
                },
            ))
        })
    }

    fn rename(&self, from: &Path, to: &Path) -> Result<(), StorageError> {
        self.on(Operation::Rename, to, |state| {
            state.file(from)?;
            state.is_folder(to.parent().unwrap())?;
            let node = state.seen.remove(from).unwrap();
            state.seen.insert(to.to_owned(), node);
            Ok(())
        })
    }

    fn link_new(&self, from: &Path, to: &Path) -> Result<bool, StorageError> {
        self.on(Operation::Create, to, |state| {
            let bytes = Arc::clone(state.file(from)?);
            state.is_folder(to.parent().unwrap())?;
            let is_new = !state.seen.contains_key(to);
            state.seen.entry(to.to_owned()).or_insert(Node::File(bytes));
            Ok(is_new)
        })
    }

    fn sync_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.on(Operation::SyncFolder, folder, |state| {
            state.is_folder(folder)?;
            let is_in = |path: &Path| path.parent() == Some(folder);
            state.on_disk.retain(|path, _| !is_in(path));
            let seen = state.seen.iter().filter(|(path, _)| is_in(path));
            state
                .on_disk
                .extend(seen.map(|(path, node)| (path.clone(), node.clone())));
            Ok(())
        })
    }

    fn list(&self, folder: &Path) -> Result<Vec<OsString>, StorageError> {
        self.on(Operation::List, folder, |state| {
            let names = state
                .seen
                .keys()
                .filter(|path| path.parent() == Some(folder));
            Ok(names
                .filter_map(|path| path.file_name())
                .map(ToOwned::to_owned)
                .collect())
        })
    }

    fn open(&self, file: &Path) -> Result<File, StorageError> {
        let verdict = self.state().meet(Operation::Read);
        let opened = match verdict {
            Verdict::Refused(error) => Err(io::Error::from_raw_os_error(error)),
            // A folder opens like a file and does not read like one.
            Verdict::DoneButRefused(_) => File::open(std::env::temp_dir()),
            Verdict::Done | Verdict::HalfDone => tempfile::tempfile().and_then(|mut handle| {
                handle.write_all(&self.state().file(file)?.lock().unwrap().seen)?;
                handle.rewind()?;
                Ok(handle)
            }),
        };
        opened.map_err(StorageError::at("read", file))
    }

    fn exists(&self, file: &Path) -> Result<bool, StorageError> {
        self.on(Operation::LookUp, file, |state| {
            Ok(state.seen.contains_key(file))
        })
    }

    fn remove(&self, file: &Path) -> Result<(), StorageError> {
        self.on(Operation::Remove, file, |state| {
            state.file(file)?;
            state.seen.remove(file);
            Ok(())
        })
    }

    fn remove_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.on(Operation::Remove, folder, |state| {
            state.seen.retain(|path, _| !path.starts_with(folder));
            Ok(())
        })
    }
}
