//! Compaction and repair on a disk that dies at each operation in turn, on one that cannot exchange folders, and beside
//! a run.

use super::{faulty, fine};
use crate::observe::Measurements;
use crate::results::compact::Compacted;
use crate::results::layout::Layout;
use crate::results::tables::Names;
use crate::results::workers::Task;
use crate::results::{ErrorKind, Results, ResultsError};
use crate::run::{Kernel, Options, Shard, run};
use crate::solver::{SimulationError, Summary};
use crate::sweep::{Job, Sweep};
use crate::table::storage::over_disk::{Access, OverDisk};
use crate::table::storage::{Disk, Sink, Storage, StorageError};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

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

struct DyingFile(File, Arc<AtomicU64>);

impl Write for DyingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        change(&self.1)?;
        self.0.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Sink for DyingFile {
    fn sync(&mut self) -> io::Result<()> {
        change(&self.1)?;
        self.0.sync()
    }
}

impl OverDisk for Dying {
    fn before(&self, access: Access) -> io::Result<()> {
        if access == Access::Change { change(&self.changes_left) } else { Ok(()) }
    }
    fn wrap(&self, file: File) -> Box<dyn Sink> {
        Box::new(DyingFile(file, Arc::clone(&self.changes_left)))
    }
    fn exchange_folders(&self, one: &Path, other: &Path) -> Result<(), StorageError> {
        if self.exchanges {
            return Disk.exchange(one, other);
        }
        Err(StorageError::at("exchange folders with", one)(io::ErrorKind::Unsupported.into()))
    }
}

/// A disk that fails at one look, or from then on.
struct Blind {
    looks_left: AtomicI64,
    stays: bool,
    error: i32,
}

impl OverDisk for Blind {
    fn before(&self, access: Access) -> io::Result<()> {
        if access == Access::Change {
            return Ok(());
        }
        let left = self.looks_left.fetch_sub(1, Ordering::Relaxed);
        let fails = left == 0 || (self.stays && left < 0);
        if fails { Err(io::Error::from_raw_os_error(self.error)) } else { Ok(()) }
    }
}

#[test]
fn a_disk_that_cannot_be_read_is_not_damaged_and_its_repair_moves_nothing() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), SEEDS);
    let before = tables_of(root.path());
    for (stays, error) in [(false, libc::EIO), (true, libc::EMFILE), (true, libc::EACCES)] {
        for looks in 0.. {
            let disk = Blind { looks_left: AtomicI64::new(looks), stays, error };
            let layout = Layout::new(&disk, root.path());
            let repaired = Results::repair(&layout);
            let has_failed = disk.looks_left.load(Ordering::Relaxed) < 0;
            let case = format!("{error} at look {looks}");
            match repaired {
                Ok(verification) => assert!(verification.whole, "{case}: {:?}", verification.problems),
                Err(error) => assert!(error.kind == ErrorKind::Disk, "{case}: {error}"),
            }
            assert!(tables_of(root.path()) == before && !layout.quarantine().exists(), "{case}");
            if !has_failed {
                break;
            }
        }
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

fn options(stop: &AtomicBool) -> Options<'_> {
    Options { threads: NonZeroUsize::new(1), stop, retry_failed: false, shard: Shard::default(), walltime: None }
}

fn run_all(root: &Path, seeds: u64) -> u64 {
    let stop = AtomicBool::new(false);
    run(&Layout::new(&Disk, root), &sweep(seeds), options(&stop), &kernel, &mut |_| ()).unwrap().jobs_run
}

fn compact(layout: &Layout<'_>) -> Result<Compacted, ResultsError> {
    Results::read(layout)?.compact()
}

/// The ids of all jobs in the tables, as a reader finds them.
fn ids(root: &Path) -> Vec<String> {
    let mut ids = Vec::new();
    for batch in Layout::new(&Disk, root).dataset("jobs").unwrap().rows() {
        ids.extend(batch.unwrap().into_iter().map(|names: Names| names.job_id));
    }
    ids.sort();
    ids
}

fn tables_of(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for table in ["slips", "jobs"] {
        for entry in fs::read_dir(root.join("tables").join(table)).unwrap() {
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
    compact(&Layout::new(&Disk, root.path())).unwrap();
    run_all(root.path(), SEEDS);
    root
}

#[test]
fn a_compaction_that_ends_at_any_operation_leaves_every_row_once_and_can_be_done_again() {
    let whole = extended();
    let expected_ids = ids(whole.path());
    assert_eq!(expected_ids.len() as u64, 2 * SEEDS);
    compact(&Layout::new(&Disk, whole.path())).unwrap();
    let expected = tables_of(whole.path());
    // One file of each table for the beginning, one for the extension.
    assert_eq!(expected.len(), 4);
    let mut exchanged = 0;
    for changes in 0.. {
        let root = extended();
        let before = tables_of(root.path());
        let ended = compact(&Layout::new(&Dying::after(changes), root.path()));
        assert!(ids(root.path()) == expected_ids, "after {changes} changes");
        let after = tables_of(root.path());
        assert!(after == before || after == expected, "after {changes} changes");
        let verification = Results::verify(&Layout::new(&Disk, root.path())).unwrap();
        assert!(verification.whole, "after {changes} changes: {:?}", verification.problems);
        assert_eq!(run_all(root.path(), SEEDS), 0, "after {changes} changes");
        exchanged += u64::from(ended.is_err() && after == expected);
        compact(&Layout::new(&Disk, root.path())).unwrap();
        assert!(tables_of(root.path()) == expected, "after {changes} changes");
        if ended.is_ok() {
            println!("{changes} operations");
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
    assert!(exchanged > 3, "of the operations after the exchange, {exchanged} were tried");
}

#[test]
fn what_was_run_after_a_directory_was_opened_is_compacted_too() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), FEWER);
    let opened = Results::read(&Layout::new(&Disk, root.path())).unwrap();
    run_all(root.path(), SEEDS);
    assert_eq!(opened.compact().unwrap().jobs, 2 * SEEDS);
    assert_eq!(ids(root.path()).len() as u64, 2 * SEEDS);
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
        let ended = Results::repair(&Layout::new(&Dying::after(changes), root.path()));
        Results::repair(&Layout::new(&Disk, root.path())).unwrap();
        let verification = Results::verify(&Layout::new(&Disk, root.path())).unwrap();
        assert!(verification.whole, "after {changes} changes: {:?}", verification.problems);
        run_all(root.path(), SEEDS);
        compact(&Layout::new(&Disk, root.path())).unwrap();
        assert_eq!(ids(root.path()).len() as u64, 2 * SEEDS, "after {changes} changes");
        assert!(Results::verify(&Layout::new(&Disk, root.path())).unwrap().whole, "after {changes} changes");
        if ended.is_ok() {
            println!("{changes} operations");
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
}

#[test]
fn a_file_system_without_exchange_is_refused_and_nothing_is_changed() {
    let root = extended();
    let before = tables_of(root.path());
    let disk = Dying { exchanges: false, ..Dying::after(1000) };
    let error = compact(&Layout::new(&disk, root.path())).unwrap_err();
    assert!(error.to_string().contains("cannot exchange two folders"), "{error}");
    assert!(tables_of(root.path()) == before);
    assert!(Results::verify(&Layout::new(&Disk, root.path())).unwrap().whole);
}

#[test]
fn who_changes_what_is_committed_and_runs_keep_each_other_out() {
    let root = extended();
    let stop = AtomicBool::new(false);
    let begin = |seeds| run(&Layout::new(&Disk, root.path()), &sweep(seeds), options(&stop), &kernel, &mut |_| ());
    let results = Results::read(&Layout::new(&Disk, root.path())).unwrap();
    let error = results.exclusively(|| Ok(begin(SEEDS + 1).unwrap_err())).unwrap();
    assert!(error.to_string().contains("being repaired, compacted or merged"), "{error}");
    let beside_a_run = || {
        for ended in [
            compact(&Layout::new(&Disk, root.path())).map(|_| ()),
            Results::repair(&Layout::new(&Disk, root.path())).map(|_| ()),
        ] {
            let error = ended.unwrap_err();
            assert!(error.to_string().contains("is being run by process"), "{error}");
        }
        assert!(Results::verify(&Layout::new(&Disk, root.path())).unwrap().whole, "looking needs nobody's leave");
        Ok::<_, ResultsError>(())
    };
    results.join(Task::Run, 1, |_| beside_a_run()).unwrap();
    assert_eq!(begin(SEEDS + 1).unwrap().jobs_run, 2);
}

#[test]
fn compacted_files_depend_on_the_parts_that_are_done_alone_and_hold_them_in_plan_order() {
    /// So that small sweeps have several files.
    const PARTS_PER_FILE: u64 = 2;
    let stop = AtomicBool::new(false);
    let run_with = |root: &Path, options, kernel: &Kernel<'_>| {
        run(&Layout::new(&Disk, root), &super::sweep(SEEDS, ""), options, kernel, &mut |_| ()).unwrap()
    };
    let compacted = |root: &Path| {
        let compacted = Results::read(&Layout::new(&Disk, root)).unwrap().compact_by(PARTS_PER_FILE).unwrap();
        assert!(Results::verify(&Layout::new(&Disk, root)).unwrap().whole);
        assert!(!Results::read(&Layout::new(&Disk, root)).unwrap().compact_by(PARTS_PER_FILE).unwrap().changed);
        (compacted, super::tables_of(root))
    };
    let [once, retried, sharded] = [(); 3].map(|()| tempfile::tempdir().unwrap());
    run_with(once.path(), options(&stop), &fine);
    let in_plan_order = super::texts(once.path(), "jobs", "job_id");
    let parts = super::tables_of(once.path()).len() / 3;
    let (all, expected) = compacted(once.path());
    assert_eq!((all.parts, all.jobs, all.failed_parts), (parts as u64, 2 * SEEDS, 0));
    assert!(expected.len() / 3 == parts.div_ceil(2) && parts > 3, "{:?}", expected.keys());
    assert!(super::texts(once.path(), "jobs", "job_id") == in_plan_order);

    run_with(retried.path(), options(&stop), &|job, _| faulty(job, true));
    let (some, with_failures) = compacted(retried.path());
    assert!(some.failed_parts > 0 && some.parts + some.failed_parts == all.parts, "{some:?}");
    let own = with_failures.keys().filter(|path| path.to_string_lossy().contains("part-")).count() as u64;
    assert_eq!(own, 3 * some.failed_parts);
    let retry = Options { retry_failed: true, ..options(&stop) };
    assert_eq!(run_with(retried.path(), retry, &fine).jobs_run, 4);
    let is_kept = |path: &PathBuf| path.to_string_lossy().contains("compact-");
    let after = super::tables_of(retried.path());
    assert!(with_failures.iter().filter(|(path, _)| is_kept(path)).all(|(path, bytes)| after[path] == *bytes));
    assert!(compacted(retried.path()).1 == expected);

    for shard in ["2/3", "1/3", "3/3"] {
        run_with(sharded.path(), Options { shard: shard.parse().unwrap(), ..options(&stop) }, &fine);
        let tables = compacted(sharded.path()).1;
        assert!(shard != "3/3" || tables == expected);
    }
}
