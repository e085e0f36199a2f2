//! Exports, repairs and retries on a disk that dies at each operation in turn, or that cannot be read.

use super::{faulty, fine, run};
use crate::observe::Measurements;
use crate::reduce::reduce;
use crate::results::destination::NewFolder;
use crate::results::layout::Layout;
use crate::results::tables::{Names, RecordedTable};
use crate::results::{ErrorKind, Results};
use crate::run::{Kernel, Options, Shard};
use crate::solver::{SimulationError, Summary};
use crate::sweep::{Job, Sweep};
use crate::table::formats::Format;
use crate::table::storage::over_disk::{Access, OverDisk};
use crate::table::storage::{Disk, Sink, Storage};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::{self, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicU64, Ordering};

/// A disk on which nothing can be changed any more after some changes, as if the process had been killed.
struct Dying {
    changes_left: Arc<AtomicU64>,
}

impl Dying {
    fn after(changes: u64) -> Self {
        Self {
            changes_left: Arc::new(AtomicU64::new(changes)),
        }
    }
}

fn change(left: &AtomicU64) -> io::Result<()> {
    let left = left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
        left.checked_sub(1)
    });
    left.map(|_| ())
        .map_err(|_| io::Error::other("the disk died"))
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
        if access == Access::Change {
            change(&self.changes_left)
        } else {
            Ok(())
        }
    }
    fn wrap(&self, file: File) -> Box<dyn Sink> {
        Box::new(DyingFile(file, Arc::clone(&self.changes_left)))
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
        if fails {
            Err(io::Error::from_raw_os_error(self.error))
        } else {
            Ok(())
        }
    }
}

#[test]
fn a_disk_that_cannot_be_read_is_not_damaged_and_its_repair_moves_nothing() {
    let root = super::schedules::folder();
    run_all(root.path(), FEWER);
    let before = tables_of(root.path());
    for (stays, error) in [
        (false, libc::EIO),
        (true, libc::EMFILE),
        (true, libc::EACCES),
    ] {
        for looks in 0.. {
            let disk = Blind {
                looks_left: AtomicI64::new(looks),
                stays,
                error,
            };
            let layout = Layout::new(&disk, root.path());
            let repaired = Results::repair(&layout);
            let has_failed = disk.looks_left.load(Ordering::Relaxed) < 0;
            let case = format!("{error} at look {looks}");
            match repaired {
                Ok(verification) => {
                    assert!(verification.whole, "{case}: {:?}", verification.problems);
                }
                Err(error) => assert!(matches!(error.kind, ErrorKind::Disk(_)), "{case}: {error}"),
            }
            assert!(
                tables_of(root.path()) == before && !layout.quarantine().exists(),
                "{case}"
            );
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
         [solver]\nmethod = \"fixed-step\"\ndt = 5.59e-7\n"
    );
    Sweep::parse(&text, Path::new("test.toml")).unwrap()
}

const FEWER: u64 = 30;
const SEEDS: u64 = 60;

#[expect(clippy::unnecessary_wraps, reason = "a kernel")]
fn kernel(job: &Job, _: &AtomicBool) -> Result<Measurements, SimulationError> {
    let summary = Summary {
        end_time: job.parameters.drive_velocity,
        satisfied: true,
        ..Summary::default()
    };
    Ok(Measurements {
        ruptures: job.parameters.seed,
        summary,
        ..Measurements::default()
    })
}

fn options(stop: &AtomicBool) -> Options<'_> {
    Options {
        threads: NonZeroUsize::new(1),
        stop,
        retry_failed: false,
        shard: Shard::default(),
        walltime: None,
    }
}

fn run_all(root: &Path, seeds: u64) -> u64 {
    let stop = AtomicBool::new(false);
    run(
        &Layout::new(&Disk, root),
        &sweep(seeds),
        options(&stop),
        &kernel,
        &mut |_| (),
    )
    .unwrap()
    .jobs_run
}

/// The ids of all jobs in the tables, as a reader finds them.
fn ids(root: &Path) -> Vec<String> {
    let mut ids = Vec::new();
    let results = Results::read(&Layout::new(&Disk, root)).unwrap();
    for names in results
        .dataset(RecordedTable::Jobs)
        .unwrap()
        .rows::<Names>()
    {
        ids.push(names.unwrap().job_id);
    }
    ids.sort();
    ids
}

fn tables_of(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for table in ["slips", "jobs"] {
        for entry in fs::read_dir(root.join("tables").join(table)).unwrap() {
            let path = entry.unwrap().path();
            files.insert(
                path.strip_prefix(root).unwrap().to_owned(),
                fs::read(&path).unwrap(),
            );
        }
    }
    files
}

/// A directory that was extended.
fn extended() -> tempfile::TempDir {
    let root = super::schedules::folder();
    run_all(root.path(), FEWER);
    run_all(root.path(), SEEDS);
    root
}

#[test]
fn an_export_that_ends_at_any_operation_leaves_no_half_a_file_and_can_be_done_again() {
    let root = extended();
    let before = tables_of(root.path());
    reduce(&Results::read(&Layout::new(&Disk, root.path())).unwrap()).unwrap();
    let export = |disk: &dyn Storage, to: &Path| {
        Results::read(&Layout::new(disk, root.path()))
            .unwrap()
            .export(
                NewFolder::new(to)?,
                Format::Csv,
                &AtomicBool::new(false),
                &mut |_, _| (),
            )
    };
    let files = |folder: &Path| super::faults::files_below(folder);
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    assert_eq!(export(&Disk, &whole).unwrap().jobs, 2 * SEEDS);
    let expected = files(&whole);
    assert_eq!(
        expected
            .keys()
            .map(|path| path.to_str().unwrap())
            .collect::<Vec<_>>(),
        ["columns.csv", "jobs.csv", "sets.csv", "slips.csv"]
    );
    let error = export(&Disk, &whole).unwrap_err();
    assert!(
        error.kind == ErrorKind::Refused && error.to_string().contains("is there already"),
        "{error}"
    );
    for changes in 0.. {
        let folder = tempfile::tempdir().unwrap();
        let to = folder.path().join("a/b");
        let ended = export(&Dying::after(changes), &to);
        if to.exists() {
            assert!(files(&to) == expected, "after {changes} changes");
        } else {
            export(&Disk, &to).unwrap();
        }
        if ended.is_ok() {
            assert!(changes > 10, "{changes} operations");
            break;
        }
    }
    assert!(tables_of(root.path()) == before);
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
            if name.contains("slips/part-000-000000") || name.contains("jobs/part-001-000000") {
                fs::write(damaged, &bytes[..bytes.len() / 2]).unwrap();
            }
        }
        let ended = Results::repair(&Layout::new(&Dying::after(changes), root.path()));
        Results::repair(&Layout::new(&Disk, root.path())).unwrap();
        let verification = Results::verify(&Layout::new(&Disk, root.path())).unwrap();
        assert!(
            verification.whole,
            "after {changes} changes: {:?}",
            verification.problems
        );
        run_all(root.path(), SEEDS);
        assert!(
            tables_of(root.path()) == expected,
            "after {changes} changes"
        );
        assert_eq!(
            ids(root.path()).len() as u64,
            2 * SEEDS,
            "after {changes} changes"
        );
        assert!(
            Results::verify(&Layout::new(&Disk, root.path()))
                .unwrap()
                .whole,
            "after {changes} changes"
        );
        if ended.is_ok() {
            assert!(changes > 10, "{changes} operations");
            break;
        }
    }
}

#[test]
fn a_retry_that_ends_at_any_operation_keeps_every_good_row() {
    let stop = AtomicBool::new(false);
    let retry = |disk: &dyn Storage, root: &Path| {
        let options = Options {
            retry_failed: true,
            ..options(&stop)
        };
        run(
            &Layout::new(disk, root),
            &super::sweep(FEWER, ""),
            options,
            &fine,
            &mut |_| (),
        )
    };
    let once = || {
        let root = tempfile::tempdir().unwrap();
        let kernel: &Kernel<'_> = &|job, _| faulty(job, true);
        run(
            &Layout::new(&Disk, root.path()),
            &super::sweep(FEWER, ""),
            options(&stop),
            kernel,
            &mut |_| (),
        )
        .unwrap();
        root
    };
    let good = |root: &Path| {
        let outcomes = super::texts(root, RecordedTable::Jobs, "outcome");
        let ids = super::texts(root, RecordedTable::Jobs, "job_id");
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
        assert!(
            good(root.path()).is_superset(&before),
            "after {changes} changes"
        );
        assert!(
            Results::verify(&Layout::new(&Disk, root.path()))
                .unwrap()
                .whole
                || ended.is_err()
        );
        retry(&Disk, root.path()).unwrap();
        assert_eq!(
            good(root.path()).len() as u64,
            2 * FEWER,
            "after {changes} changes"
        );
        if ended.is_ok() {
            assert!(changes > 20, "{changes} operations");
            break;
        }
    }
}
