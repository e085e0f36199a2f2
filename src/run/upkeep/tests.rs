//! Upkeep on a disk that dies at each operation in turn, on one that cannot exchange folders, and beside a run.

use super::*;
use crate::observe::Measurements;
use crate::run::{Options, Shard, run};
use crate::solver::{SimulationError, Summary};
use crate::sweep::{Job, Sweep};
use crate::table::file::Reader;
use crate::table::storage::over_disk::{Access, OverDisk};
use crate::table::storage::{Disk, StoredFile};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind, Write};
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// A disk on which nothing can be changed any more after some changes, as if the process had been killed.
struct Dying {
    changes_left: Arc<AtomicU64>,
    exchanges: bool,
}

impl Dying {
    fn after(changes: u64) -> Self {
        Self { changes_left: Arc::new(AtomicU64::new(changes)), exchanges: true }
    }
}

fn change(left: &AtomicU64) -> io::Result<()> {
    let left = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
    left.map(|_| ()).map_err(|_| io::Error::other("the disk died"))
}

struct DyingFile(Box<dyn StoredFile>, Arc<AtomicU64>);

impl Write for DyingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        change(&self.1)?;
        self.0.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl StoredFile for DyingFile {
    fn sync(&mut self) -> io::Result<()> {
        change(&self.1)?;
        self.0.sync()
    }
}

impl OverDisk for Dying {
    fn before(&self, access: Access) -> io::Result<()> {
        if access == Access::Change { change(&self.changes_left) } else { Ok(()) }
    }
    fn create_file(&self, file: &Path) -> io::Result<Box<dyn StoredFile>> {
        Ok(Box::new(DyingFile(Disk.create(file)?, Arc::clone(&self.changes_left))))
    }
    fn exchange_folders(&self, one: &Path, other: &Path) -> io::Result<()> {
        if self.exchanges { Disk.exchange(one, other) } else { Err(ErrorKind::Unsupported.into()) }
    }
}

/// Some parts of several jobs each, by the predicted cost of the slower solver.
fn sweep(seeds: u64) -> Sweep {
    let text = format!(
        "name = \"test\"\n[axes]\nseed = {{ count = {seeds} }}\nV0 = [1e-4, 2e-4]\n[record]\nslips = 3\n\
         [solver]\nmethod = \"fixed-step\"\ndt = 4.68e-7\n"
    );
    Sweep::parse(&text, Path::new("test.toml")).unwrap()
}

const FEWER: u64 = 30;
const SEEDS: u64 = 60;

#[expect(clippy::unnecessary_wraps, reason = "a kernel")]
fn kernel(job: &Job, _: &AtomicBool) -> Result<Measurements, SimulationError> {
    let summary = Summary { end_time: job.parameters.drive_velocity, satisfied: true, ..Summary::default() };
    Ok(Measurements { ruptures: job.parameters.seed, summary, ..Measurements::default() })
}

fn run_all(root: &Path, seeds: u64) -> u64 {
    let stop = AtomicBool::new(false);
    let options = Options {
        threads: NonZeroUsize::new(1),
        stop: &stop,
        retry_failed: false,
        shard: Shard::default(),
        walltime: None,
    };
    run(&Disk, &sweep(seeds), root, options, &kernel, &mut |_| ()).unwrap().jobs_run
}

/// The ids of all jobs in the tables, as a reader finds them.
fn ids(root: &Path) -> Vec<String> {
    let mut ids = Vec::new();
    for batch in Reader::of_folder(&Disk, &Layout::new(root).table("jobs")).unwrap() {
        ids.extend(batch.unwrap().texts("job_id").unwrap().iter().map(|id| id.unwrap().to_owned()));
    }
    ids.sort();
    ids
}

fn tables_of(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for table in ["slips", "jobs"] {
        for entry in fs::read_dir(Layout::new(root).table(table)).unwrap() {
            let path = entry.unwrap().path();
            files.insert(path.strip_prefix(root).unwrap().to_owned(), fs::read(&path).unwrap());
        }
    }
    files
}

/// A directory that was compacted, and extended since.
fn extended() -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), FEWER);
    compact(&Disk, root.path()).unwrap();
    run_all(root.path(), SEEDS);
    root
}

#[test]
fn a_compaction_that_ends_at_any_operation_leaves_every_row_once_and_can_be_done_again() {
    let whole = extended();
    let expected_ids = ids(whole.path());
    assert_eq!(expected_ids.len() as u64, 2 * SEEDS);
    compact(&Disk, whole.path()).unwrap();
    let expected = tables_of(whole.path());
    assert_eq!(expected.len(), 2);
    let mut exchanged = 0;
    for changes in 0.. {
        let root = extended();
        let before = tables_of(root.path());
        let ended = compact(&Dying::after(changes), root.path());
        assert!(ids(root.path()) == expected_ids, "after {changes} changes");
        let after = tables_of(root.path());
        assert!(after == before || after == expected, "after {changes} changes");
        let verification = verify(&Disk, root.path()).unwrap();
        assert!(verification.whole, "after {changes} changes: {:?}", verification.problems);
        assert_eq!(run_all(root.path(), SEEDS), 0, "after {changes} changes");
        exchanged += u64::from(ended.is_err() && after == expected);
        compact(&Disk, root.path()).unwrap();
        assert!(tables_of(root.path()) == expected, "after {changes} changes");
        if ended.is_ok() {
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
    assert!(exchanged > 3, "of the operations after the exchange, {exchanged} were tried");
}

#[test]
fn a_repair_that_ends_at_any_operation_can_be_done_again() {
    let whole = extended();
    let expected = tables_of(whole.path());
    for changes in 0.. {
        let root = extended();
        // One file of each kind.
        for (path, bytes) in &expected {
            let (damaged, name) = (root.path().join(path), path.to_string_lossy());
            if name.contains("slips/compact-") || name.contains("jobs/part-001-000000") {
                fs::write(damaged, &bytes[..bytes.len() / 2]).unwrap();
            }
        }
        let ended = repair(&Dying::after(changes), root.path());
        repair(&Disk, root.path()).unwrap();
        let verification = verify(&Disk, root.path()).unwrap();
        assert!(verification.whole, "after {changes} changes: {:?}", verification.problems);
        run_all(root.path(), SEEDS);
        compact(&Disk, root.path()).unwrap();
        assert_eq!(ids(root.path()).len() as u64, 2 * SEEDS, "after {changes} changes");
        assert!(verify(&Disk, root.path()).unwrap().whole, "after {changes} changes");
        if ended.is_ok() {
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
}

#[test]
fn a_file_system_without_exchange_is_refused_and_nothing_is_changed() {
    let root = extended();
    let before = tables_of(root.path());
    let error = compact(&Dying { exchanges: false, ..Dying::after(1000) }, root.path()).unwrap_err();
    assert!(error.to_string().contains("cannot exchange two folders"), "{error}");
    assert!(tables_of(root.path()) == before);
    assert!(verify(&Disk, root.path()).unwrap().whole);
}

#[test]
fn upkeep_and_runs_keep_each_other_out() {
    let root = extended();
    let layout = Layout::new(root.path());
    let stop = AtomicBool::new(false);
    let options = Options { threads: None, stop: &stop, retry_failed: false, shard: Shard::default(), walltime: None };
    let begin = |seeds| run(&Disk, &sweep(seeds), root.path(), options, &kernel, &mut |_| ());
    let upkeep = Claim::take(&Disk, &layout, NAME, PATIENCE).unwrap();
    assert!(upkeep.is_some());
    let error = begin(SEEDS + 1).unwrap_err();
    assert!(error.to_string().contains("being repaired or compacted"), "{error}");
    drop(upkeep);
    let shard = Claim::take(&Disk, &layout, &Shard::default().writer(), PATIENCE).unwrap();
    for ended in [compact(&Disk, root.path()).map(|_| ()), repair(&Disk, root.path()).map(|_| ())] {
        let error = ended.unwrap_err();
        assert!(error.to_string().contains("is being run (shard-1-of-1)"), "{error}");
    }
    assert!(verify(&Disk, root.path()).unwrap().whole, "looking needs no lock");
    drop(shard);
    assert_eq!(begin(SEEDS + 1).unwrap().jobs_run, 2);
}
