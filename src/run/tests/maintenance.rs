//! Compaction and repair on a disk that dies at each operation in turn, on one that cannot exchange folders, and beside
//! a run.

use super::{faulty, fine};
use crate::observe::Measurements;
use crate::reduce::reduce;
use crate::results::compact::{Compacted, GRACE};
use crate::results::layout::Layout;
use crate::results::tables::Names;
use crate::results::workers::Task;
use crate::results::{ErrorKind, Results, ResultsError};
use crate::run::{Kernel, Options, Shard, run, status};
use crate::solver::{SimulationError, Summary};
use crate::sweep::{Job, Sweep};
use crate::table::storage::over_disk::{Access, OverDisk};
use crate::table::storage::{Disk, Sink, Storage, StorageError};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};
use std::time::SystemTime;

/// A disk on which nothing can be changed any more after some changes, as if the process had been killed.
struct Dying {
    changes_left: Arc<AtomicU64>,
    /// Why it does not exchange tables.
    refusal: Option<io::ErrorKind>,
}

impl Dying {
    fn after(changes: u64) -> Self {
        Self { changes_left: Arc::new(AtomicU64::new(changes)), refusal: None }
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
        match self.refusal {
            // Folders of an overlay's upper layer can be exchanged, so that a trial with others shows nothing.
            Some(io::ErrorKind::CrossesDevices) if !one.ends_with("tables") => Disk.exchange(one, other),
            Some(refusal) => Err(StorageError::at("exchange folders with", one)(refusal.into())),
            None => Disk.exchange(one, other),
        }
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
        assert!(!root.path().join("run/staging/compact").exists(), "after {changes} changes: it fills the disk");
        exchanged += u64::from(ended.is_err() && after == expected);
        compact(&Layout::new(&Disk, root.path())).unwrap();
        assert!(tables_of(root.path()) == expected, "after {changes} changes");
        if ended.is_ok() {
            println!("{changes} operations");
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
    assert!(exchanged > 2, "of the operations after the exchange, {exchanged} were tried");
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
    for (refusal, reason) in [
        (io::ErrorKind::Unsupported, "this file system cannot exchange two folders"),
        (io::ErrorKind::CrossesDevices, "lower layer of an overlay"),
        (io::ErrorKind::ResourceBusy, "it is a mount point"),
    ] {
        let root = extended();
        let before = tables_of(root.path());
        let disk = Dying { refusal: Some(refusal), ..Dying::after(1000) };
        let error = compact(&Layout::new(&disk, root.path())).unwrap_err();
        assert!(error.kind == ErrorKind::Refused && error.to_string().contains(reason), "{error}");
        assert!(error.to_string().contains("compact the copy"), "{error}");
        assert!(tables_of(root.path()) == before);
        assert!(Results::verify(&Layout::new(&Disk, root.path())).unwrap().whole);
        for left in ["compact", "replaced"] {
            assert!(!root.path().join("run/staging").join(left).exists(), "{refusal}: {left} fills the disk");
        }
    }
}

#[test]
#[cfg(unix)]
fn linked_folders_of_tables_are_refused_and_stay_links() {
    for folder in ["tables", "tables/slips"] {
        let (root, elsewhere) = (extended(), tempfile::tempdir().unwrap());
        let (link, moved) = (root.path().join(folder), elsewhere.path().join("moved"));
        fs::rename(&link, &moved).unwrap();
        std::os::unix::fs::symlink(&moved, &link).unwrap();
        let before = tables_of(root.path());
        let error = compact(&Layout::new(&Disk, root.path())).unwrap_err();
        assert!(error.kind == ErrorKind::Refused && error.to_string().contains("is a symbolic link"), "{error}");
        assert!(link.is_symlink() && tables_of(root.path()) == before, "{folder}");
    }
}

/// A disk on which no byte can be written to a file.
struct Full;

impl OverDisk for Full {
    fn wrap(&self, file: File) -> Box<dyn Sink> {
        Box::new(DyingFile(file, Arc::default()))
    }
}

#[test]
fn a_compaction_that_fails_removes_what_it_has_staged() {
    let root = extended();
    let before = tables_of(root.path());
    // The worker's own files do not matter here.
    let results = Results::read(&Layout::new(&Disk, root.path())).unwrap();
    let full = Results::read(&Layout::new(&Full, root.path())).unwrap();
    let error = results.exclusively(|| full.compact_alone(512)).unwrap_err();
    assert!(error.to_string().contains("the disk died"), "{error}");
    assert!(tables_of(root.path()) == before);
    assert!(!root.path().join("run/staging/compact").exists());
}

#[test]
fn replaced_tables_stay_for_a_while_and_never_more_than_those_of_one_compaction() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    run_all(root.path(), FEWER);
    let replaced = root.path().join("run/staging/replaced");
    let names = |folder: &Path| layout.storage.list(&folder.join("tables/jobs")).unwrap();
    for seeds in [FEWER, SEEDS, 2 * SEEDS] {
        run_all(root.path(), seeds);
        let before = names(root.path());
        // A reader that has opened the folder and lists it only now.
        let open = fs::read_dir(root.path().join("tables/jobs")).unwrap();
        assert!(compact(&layout).unwrap().changed);
        let found = open.map(|entry| entry.unwrap().file_name()).collect::<BTreeSet<_>>();
        assert!(!before.is_empty() && found == before.iter().cloned().collect());
        assert_eq!(names(&replaced), before);
        run_all(root.path(), seeds);
        assert!(!compact(&layout).unwrap().changed);
        assert_eq!(names(&replaced), before, "they have not been there for long");
    }
    let long_ago = SystemTime::now() - 2 * GRACE;
    File::open(&replaced).unwrap().set_modified(long_ago).unwrap();
    run_all(root.path(), 2 * SEEDS);
    assert!(!replaced.exists());
}

/// A disk on which the tables are compacted before one of the looks at it.
struct Compacting {
    root: PathBuf,
    looks_left: AtomicU64,
}

impl OverDisk for Compacting {
    fn before(&self, access: Access) -> io::Result<()> {
        if access == Access::Look && self.looks_left.fetch_sub(1, Ordering::Relaxed) == 0 {
            compact(&Layout::new(&Disk, &self.root)).unwrap();
        }
        Ok(())
    }
}

#[test]
fn tables_that_are_compacted_while_they_are_read_are_read_again() {
    type Read = fn(&Layout<'_>) -> String;
    // With the looks between two places: those that look more often are tried at fewer of them.
    let readers: [(&str, usize, Read); 3] = [
        ("verify", 11, |layout| {
            let found = Results::verify(layout).unwrap();
            format!("{:?} {}", found.problems, found.jobs)
        }),
        ("status", 3, |layout| format!("{:?}", status(&Results::read(layout).unwrap()).unwrap().overview)),
        ("reduce", 5, |layout| format!("{:?}", reduce(&Results::read(layout).unwrap()).unwrap())),
    ];
    for (name, step, read) in readers {
        let mut compacted = 0;
        for looks in (5..).step_by(step) {
            let root = extended();
            let expected = read(&Layout::new(&Disk, root.path()));
            let disk = Compacting { root: root.path().to_owned(), looks_left: AtomicU64::new(looks) };
            assert_eq!(read(&Layout::new(&disk, root.path())), expected, "{name}: compacted after {looks} looks");
            if disk.looks_left.into_inner() < u64::MAX / 2 {
                break;
            }
            compacted += 1;
        }
        assert!(compacted > 3, "{name}: compacted at {compacted} places");
    }
}

#[test]
fn a_repair_that_ends_at_any_operation_and_is_followed_by_a_run_keeps_the_damaged_files() {
    for changes in 0.. {
        let root = extended();
        let path = root.path().join("tables/slips/part-001-000000.parquet");
        fs::write(&path, "damaged").unwrap();
        let ended = Results::repair(&Layout::new(&Dying::after(changes), root.path()));
        run_all(root.path(), SEEDS);
        let aside = root.path().join("run/quarantine/slips/part-001-000000.parquet");
        let is_kept = |path: &Path| fs::read(path).is_ok_and(|bytes| bytes == b"damaged");
        assert!(is_kept(&path) || is_kept(&aside), "after {changes} changes");
        if ended.is_ok() {
            assert!(is_kept(&aside) && changes > 10, "{changes} operations");
            break;
        }
    }
}

#[test]
fn a_retry_in_a_compacted_directory_that_ends_at_any_operation_keeps_every_good_row() {
    let stop = AtomicBool::new(false);
    let retry = |disk: &dyn Storage, root: &Path| {
        let options = Options { retry_failed: true, ..options(&stop) };
        run(&Layout::new(disk, root), &super::sweep(FEWER, ""), options, &fine, &mut |_| ())
    };
    let once = || {
        let root = tempfile::tempdir().unwrap();
        let kernel: &Kernel<'_> = &|job, _| faulty(job, true);
        run(&Layout::new(&Disk, root.path()), &super::sweep(FEWER, ""), options(&stop), kernel, &mut |_| ()).unwrap();
        assert!(compact(&Layout::new(&Disk, root.path())).unwrap().failed_parts > 0);
        root
    };
    let good = |root: &Path| {
        let outcomes = super::texts(root, "jobs", "outcome");
        let ids = super::texts(root, "jobs", "job_id");
        ids.into_iter()
            .zip(outcomes)
            .filter(|(_, outcome)| outcome == "done")
            .map(|(id, _)| id)
            .collect::<BTreeSet<_>>()
    };
    for changes in (0..).step_by(3) {
        let root = once();
        let before = good(root.path());
        let ended = retry(&Dying::after(changes), root.path());
        assert!(good(root.path()).is_superset(&before), "after {changes} changes");
        assert!(Results::verify(&Layout::new(&Disk, root.path())).unwrap().whole || ended.is_err());
        retry(&Disk, root.path()).unwrap();
        assert_eq!(good(root.path()).len() as u64, 2 * FEWER, "after {changes} changes");
        if ended.is_ok() {
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
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
