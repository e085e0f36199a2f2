//! Directories that are begun, changed, damaged, somebody else's, or begun by two runs at once.

use super::*;
use crate::results::Results;
use crate::table::storage::over_disk::{Access, OverDisk};
use crate::table::storage::{Disk, Lock, Storage, StorageError};
use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A disk on which another run does something just before the n-th operation of this one, unless this one has the lock.
struct Shared<F> {
    /// What the other run does, until it is done.
    other: Mutex<Option<F>>,
    operations_left: AtomicUsize,
}

impl<F: FnOnce() + Send> OverDisk for Shared<F> {
    fn before(&self, _: Access) -> io::Result<()> {
        if self.operations_left.fetch_sub(1, Ordering::Relaxed) == 0
            && let Some(other) = self.other.lock().unwrap().take()
        {
            other();
        }
        Ok(())
    }
    fn try_lock(&self, file: &Path) -> Result<Lock, StorageError> {
        // From here on the other would wait.
        self.operations_left.store(usize::MAX, Ordering::Relaxed);
        Disk.lock(file)
    }
}

/// The same where each run has locks of its own, as on hosts that mount a disk without locks.
struct SharedWithoutLocks<F>(Shared<F>);

impl<F: FnOnce() + Send> OverDisk for SharedWithoutLocks<F> {
    fn before(&self, access: Access) -> io::Result<()> {
        self.0.before(access)
    }
    fn try_lock(&self, file: &Path) -> Result<Lock, StorageError> {
        Disk.lock(&file.with_extension("own"))
    }
}

#[test]
fn runs_with_locks_of_their_own_that_begin_at_once_both_begin() {
    for operation in 0..60 {
        let root = tempfile::tempdir().unwrap();
        let open = |disk: &dyn Storage| Results::open(&Layout::new(disk, root.path()), &sweep(TWO_SEEDS)).map(drop);
        let other = Mutex::new(Some(|| open(&Disk).unwrap()));
        let shared = SharedWithoutLocks(Shared { other, operations_left: AtomicUsize::new(operation) });
        open(&shared).unwrap_or_else(|error| panic!("operation {operation}: {error}"));
        open(&Disk).unwrap();
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
    let open = |text| Results::open(&Layout::new(&Disk, root.path()), &sweep(text)).unwrap();
    let extensions = |text| {
        let extensions = open(text).extensions().to_vec();
        extensions.into_iter().map(|extension| (extension.sweep.text().to_owned(), extension.kept)).collect::<Vec<_>>()
    };
    let text = |axes| sweep(axes).text().to_owned();
    let finish = |results: &Results<'_>| {
        for part in results.plan().parts() {
            fs::create_dir_all(root.path().join("tables/jobs")).unwrap();
            fs::write(results.part_file("jobs", &part), "").unwrap();
        }
    };
    assert_eq!(extensions(TWO_SEEDS), [(text(TWO_SEEDS), None)]);
    let before = contents(root.path());
    open(TWO_SEEDS);
    assert_eq!(contents(root.path()), before);
    finish(&open(TWO_SEEDS));
    let mut expected = vec![(text(TWO_SEEDS), Some(vec![0..=1])), (text(THREE_SEEDS), None)];
    assert_eq!(extensions(THREE_SEEDS), expected);
    assert_eq!(extensions(THREE_SEEDS), expected);
    // Nothing was done of it, so nothing is kept.
    expected[1].1 = Some(vec![]);
    expected.push((text(TWO_SEEDS), None));
    assert_eq!(extensions(TWO_SEEDS), expected);
    let read = Results::read(&Layout::new(&Disk, root.path())).unwrap();
    assert_eq!(read.plan().totals().jobs, 2);
}

#[test]
fn another_model_recording_or_version_is_refused_with_the_difference_and_nothing_is_written() {
    let root = tempfile::tempdir().unwrap();
    Results::open(&Layout::new(&Disk, root.path()), &sweep("[model]\nK = 1e8\n[record]\nslips = 3")).unwrap();
    let refused = |text: &str, differences: &[&str]| {
        let before = contents(root.path());
        let error = Results::open(&Layout::new(&Disk, root.path()), &sweep(text)).unwrap_err().to_string();
        assert!(differences.iter().all(|difference| error.contains(difference)), "{error}");
        assert!(error.contains("--out"), "{error}");
        assert_eq!(contents(root.path()), before);
    };
    refused("[model]\nK = 2e8\n[record]\nslips = 4", &["model.K", "record.slips: 3 -> 4"]);
    let path = root.path().join("run/manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let mut other: Manifest = checksum::from_json(&text).unwrap();
    other.rng_scheme = "dice".to_owned();
    other.tables.get_mut("slips").unwrap().iter_mut().filter(|column| *column == "onset").for_each(|column| {
        *column = "start".to_owned();
    });
    fs::write(&path, checksum::to_json(&other).unwrap()).unwrap();
    refused("[model]\nK = 1e8\n[record]\nslips = 3", &["random numbers: dice -> ", "without [\"start\"]"]);
    let mut other: Manifest = checksum::from_json(&text).unwrap();
    other.identity = "0".repeat(32);
    fs::write(&path, checksum::to_json(&other).unwrap()).unwrap();
    refused("[model]\nK = 1e8\n[record]\nslips = 3", &["ids of jobs: those of stickslip"]);
    fs::write(&path, text.replace("\"format\": 6", "\"format\": 7, \"new\": 0")).unwrap();
    let error = Results::read(&Layout::new(&Disk, root.path())).unwrap_err().to_string();
    assert!(error.contains("has format 7"), "{error}");
}

#[test]
fn a_directory_of_something_else_is_refused_and_an_unfinished_beginning_is_not() {
    let root = tempfile::tempdir().unwrap();
    fs::create_dir_all(root.path().join("run/staging/manifest")).unwrap();
    fs::write(root.path().join("run/sweep-000.toml"), "half a sw").unwrap();
    fs::write(root.path().join("thesis.tex"), "").unwrap();
    let before = contents(root.path());
    let error = Results::open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap_err();
    assert!(error.to_string().contains("is neither empty nor a results directory"), "{error}");
    assert_eq!(contents(root.path()), before);
    fs::remove_file(root.path().join("thesis.tex")).unwrap();
    Results::open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap();
}

#[test]
fn two_runs_may_begin_a_directory_at_once_whichever_is_first() {
    let mut n = 0;
    loop {
        let root = tempfile::tempdir().unwrap();
        let open = |layout: Layout<'_>| Results::open(&layout, &sweep(TWO_SEEDS)).map(drop);
        let other = Mutex::new(Some(|| open(Layout::new(&Disk, root.path())).unwrap()));
        let shared = Shared { other, operations_left: AtomicUsize::new(n) };
        open(Layout::new(&shared, root.path())).unwrap_or_else(|error| panic!("before operation {n}: {error}"));
        if shared.other.lock().unwrap().is_some() {
            break;
        }
        n += 1;
    }
    assert!(n > 5, "the other run never came in between");
}

#[test]
fn a_manifest_that_goes_back_to_an_earlier_round_is_still_ours_and_that_of_another_sweep_is_not() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    let rounds = sweep("[precision]\nof = \"tau_mean\"\nrelative = 0.1\nseeds = { from = 2, to = 3 }");
    let first = Results::open(&layout, &rounds).unwrap();
    let earlier = fs::read(layout.manifest()).unwrap();
    let mut extensions = first.extensions().to_vec();
    extensions[0].kept = Some(vec![0..=1]);
    extensions.push(Extension::next_round(&rounds, &extensions, Round { points: vec![2..=2], ..Round::default() }));
    Manifest::new(&extensions).write(&layout).unwrap();
    let second = Results::new(&layout, extensions);
    assert!(first.check_place().is_ok() && second.check_place().is_ok());
    // One that was late to write the first round.
    fs::write(layout.manifest(), earlier).unwrap();
    assert!(second.check_place().is_ok());
    let other = tempfile::tempdir().unwrap();
    Results::open(&Layout::new(&Disk, other.path()), &sweep(TWO_SEEDS)).unwrap();
    fs::copy(other.path().join("run/manifest.json"), layout.manifest()).unwrap();
    assert!(first.check_place().is_err() && second.check_place().is_err());
}

#[test]
fn a_changed_or_cut_file_of_the_directory_is_named() {
    let root = tempfile::tempdir().unwrap();
    Results::open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap();
    for name in ["run/sweep-000.toml", "run/manifest.json"] {
        let path = root.path().join(name);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let error = Results::open(&Layout::new(&Disk, root.path()), &sweep(TWO_SEEDS)).unwrap_err();
        assert!(error.to_string().contains(&format!("{name}: damaged")), "{error}");
        fs::write(&path, bytes).unwrap();
    }
}
