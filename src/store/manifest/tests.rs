//! Directories that are begun, changed, damaged, somebody else's, or begun by two runs at once.

use super::*;
use crate::store::storage::{Disk, StoredFile};
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::sync::Mutex;

/// A disk on which another run does something just before the n-th operation of this one, unless this one has the lock.
struct Shared<F> {
    /// What the other run does, until it is done.
    other: Mutex<Option<F>>,
    operations_left: Mutex<usize>,
}

impl<F: FnOnce() + Send> Shared<F> {
    fn new(n: usize, other: F) -> Self {
        Self { other: Mutex::new(Some(other)), operations_left: Mutex::new(n) }
    }

    fn is_done(&self) -> bool {
        self.other.lock().unwrap().is_none()
    }

    fn operate(&self) -> Disk {
        let mut left = self.operations_left.lock().unwrap();
        if *left == 0
            && let Some(other) = self.other.lock().unwrap().take()
        {
            other();
        }
        *left = left.wrapping_sub(1);
        Disk
    }
}

impl<F: FnOnce() + Send> Storage for Shared<F> {
    fn create_folder(&self, folder: &Path) -> io::Result<()> {
        self.operate().create_folder(folder)
    }
    fn create(&self, file: &Path) -> io::Result<Box<dyn StoredFile>> {
        self.operate().create(file)
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.operate().rename(from, to)
    }
    fn sync_folder(&self, folder: &Path) -> io::Result<()> {
        self.operate().sync_folder(folder)
    }
    fn list(&self, folder: &Path) -> io::Result<Vec<OsString>> {
        self.operate().list(folder)
    }
    fn open(&self, file: &Path) -> io::Result<File> {
        self.operate().open(file)
    }
    fn exists(&self, file: &Path) -> io::Result<bool> {
        self.operate().exists(file)
    }
    fn remove(&self, file: &Path) -> io::Result<()> {
        self.operate().remove(file)
    }
    fn remove_folder(&self, folder: &Path) -> io::Result<()> {
        self.operate().remove_folder(folder)
    }
    fn exchange(&self, one: &Path, other: &Path) -> io::Result<()> {
        self.operate().exchange(one, other)
    }
    fn lock(&self, file: &Path) -> io::Result<Lock> {
        let lock = self.operate().lock(file);
        // From here on the other would wait.
        *self.operations_left.lock().unwrap() = usize::MAX;
        lock
    }
}

fn sweep(text: &str) -> Sweep {
    Sweep::parse(&format!("name = \"test\"\n{text}"), Path::new("test.toml")).unwrap()
}

/// Every file below a folder with its bytes.
fn contents(folder: &Path) -> BTreeSet<(PathBuf, Vec<u8>)> {
    let mut all = BTreeSet::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(contents(&path));
        } else {
            all.insert((path.clone(), fs::read(&path).unwrap()));
        }
    }
    all
}

const TWO_SEEDS: &str = "[axes]\nseed = [0, 1]\n";
const THREE_SEEDS: &str = "[axes]\nseed = [0, 1, 2]\n";

#[test]
fn a_directory_is_begun_resumed_extended_and_narrowed() {
    let root = tempfile::tempdir().unwrap();
    let open = |text| Directory::open(&Disk, root.path(), &sweep(text)).unwrap();
    assert_eq!((open(TWO_SEEDS).sweeps().len(), open(TWO_SEEDS).current()), (1, 0));
    let before = contents(root.path());
    open(TWO_SEEDS);
    assert_eq!(contents(root.path()), before);
    assert_eq!((open(THREE_SEEDS).sweeps().len(), open(THREE_SEEDS).current()), (2, 1));
    assert_eq!((open(TWO_SEEDS).sweeps().len(), open(TWO_SEEDS).current()), (2, 0));
    let read = Directory::read(&Disk, root.path()).unwrap();
    assert_eq!((read.sweeps()[1].text(), read.current()), (sweep(THREE_SEEDS).text(), 0));
}

#[test]
fn another_model_recording_or_version_is_refused_with_the_difference_and_nothing_is_written() {
    let root = tempfile::tempdir().unwrap();
    Directory::open(&Disk, root.path(), &sweep("[model]\nK = 1e8\n[record]\nslips = 3")).unwrap();
    let refused = |text: &str, differences: &[&str]| {
        let before = contents(root.path());
        let error = Directory::open(&Disk, root.path(), &sweep(text)).unwrap_err().to_string();
        assert!(differences.iter().all(|difference| error.contains(difference)), "{error}");
        assert!(error.contains("--out"), "{error}");
        assert_eq!(contents(root.path()), before);
    };
    refused("[model]\nK = 2e8\n[record]\nslips = 4", &["model.K", "record.slips: 3 -> 4"]);
    let path = root.path().join("run/manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let mut other: Manifest = seal::from_json(&text).unwrap();
    other.rng_scheme = "dice".to_owned();
    other.tables.get_mut("slips").unwrap().iter_mut().filter(|column| *column == "onset").for_each(|column| {
        *column = "start".to_owned();
    });
    fs::write(&path, seal::to_json(&other).unwrap()).unwrap();
    refused("[model]\nK = 1e8\n[record]\nslips = 3", &["random numbers: dice -> ", "without [\"start\"]"]);
    let mut other: Manifest = seal::from_json(&text).unwrap();
    other.identity = "0".repeat(32);
    fs::write(&path, seal::to_json(&other).unwrap()).unwrap();
    refused("[model]\nK = 1e8\n[record]\nslips = 3", &["defaults: those of stickslip"]);
    fs::write(&path, text.replace("\"format\": 3", "\"format\": 4, \"new\": 0")).unwrap();
    let error = Directory::read(&Disk, root.path()).unwrap_err().to_string();
    assert!(error.contains("has format 4"), "{error}");
}

#[test]
fn a_directory_of_something_else_is_refused_and_an_unfinished_beginning_is_not() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir_all(root.path().join("run/staging/manifest")).unwrap();
    fs::write(root.path().join("run/sweep-000.toml"), "half a sw").unwrap();
    fs::write(root.path().join("thesis.tex"), "").unwrap();
    let before = contents(root.path());
    let error = Directory::open(&Disk, root.path(), &sweep(TWO_SEEDS)).unwrap_err();
    assert!(matches!(error, DirectoryError::NotOurs(_)), "{error}");
    assert_eq!(contents(root.path()), before);
    fs::remove_file(root.path().join("thesis.tex")).unwrap();
    Directory::open(&Disk, root.path(), &sweep(TWO_SEEDS)).unwrap();
}

#[test]
fn two_runs_may_begin_a_directory_at_once_whichever_is_first() {
    let mut n = 0;
    loop {
        let root = tempfile::tempdir().unwrap();
        let open = |storage: &dyn Storage| Directory::open(storage, root.path(), &sweep(TWO_SEEDS)).map(drop);
        let shared = Shared::new(n, || open(&Disk).unwrap());
        open(&shared).unwrap_or_else(|error| panic!("before operation {n}: {error}"));
        if !shared.is_done() {
            break;
        }
        n += 1;
    }
    assert!(n > 5, "the other run never came in between");
}

#[test]
fn a_changed_or_cut_file_of_the_directory_is_named() {
    let root = tempfile::tempdir().unwrap();
    Directory::open(&Disk, root.path(), &sweep(TWO_SEEDS)).unwrap();
    for name in ["run/sweep-000.toml", "run/manifest.json"] {
        let path = root.path().join(name);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let error = Directory::open(&Disk, root.path(), &sweep(TWO_SEEDS)).unwrap_err();
        assert!(error.to_string().contains(&format!("{name}: damaged")), "{error}");
        fs::write(&path, bytes).unwrap();
    }
}

#[test]
fn a_missing_directory_is_no_results() {
    let root = tempfile::tempdir().unwrap();
    let error = Directory::read(&Disk, &root.path().join("missing")).unwrap_err();
    assert!(matches!(error, DirectoryError::NoResults(_)), "{error}");
}
