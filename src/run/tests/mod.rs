//! Whole runs with a fake kernel: quick, and a function of the parameters alone, as the real one.

mod deaths;
mod fault;
mod faults;
mod faulty_disk;
mod host;
mod maintenance;
mod rounds;
mod schedule;
mod schedules;
mod versions;

use super::*;
use crate::model::Parameters;
use crate::observe::{Measurements, Precursor, Slip};
use crate::results::ErrorKind;
use crate::results::tables::{JobRow, PrecursorRow, RecordedTable, SlipRow};
use crate::results::workers::SILENCE;
use crate::results::workers::tests::{leave, open};
use crate::sets::SetRow;
use crate::solver::{SimulationError, Summary};
use crate::sweep::{Job, PartName};
use crate::table::columns::Row;
use crate::table::storage::{Disk, Storage};
use arrow_array::cast::AsArray;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

const SEEDS: u64 = 60;

/// Some parts of several jobs each, by the predicted cost of the slower solver.
/// Runs the jobs of a sweep that are not yet in a directory.
pub(crate) fn run(
    layout: &Layout<'_>,
    sweep: &Sweep,
    options: Options<'_>,
    kernel: &Kernel<'_>,
    display: &mut dyn FnMut(&RunEvent),
) -> Result<RunReport, ResultsError> {
    join(layout, sweep, options, |joined| joined.run(kernel, display))
}

fn sweep(seeds: u64, model: &str) -> Sweep {
    let text = format!(
        "name = \"test\"\n[model]\n{model}\n[axes]\nV0 = [1e-4, 2e-4]\nseed = {{ count = {seeds} }}\n\
         [record]\nslips = 3\nprecursors = true\n[solver]\nmethod = \"fixed-step\"\ndt = 5.59e-7\n"
    );
    Sweep::parse(&text, Path::new("test.toml")).unwrap()
}

fn measure(parameters: &Parameters) -> Measurements {
    let count = parameters.seed % 4;
    let onset = |number: u64| parameters.seed as f64 + parameters.drive_velocity + number as f64;
    let slips = (0..count).map(|number| Slip {
        number,
        onset: onset(number),
        interval: (number > 0).then_some(1.0),
        peak_force: 477.0,
        drop: 100.0,
        nucleation: onset(number),
        nucleation_block: 1,
        duration: 0.005,
        size: 1400,
        precursors: 1,
        ..Slip::default()
    });
    let precursors = (0..count).map(|slip| Precursor {
        slip,
        precursor: 0,
        onset: onset(slip) - 0.1,
        nucleation: onset(slip),
        nucleation_block: 1,
        duration: 0.001,
        size: 30,
        extent: 5,
        reach: 6,
        ..Precursor::default()
    });
    let summary = Summary {
        end_time: onset(count),
        satisfied: true,
        ..Summary::default()
    };
    Measurements {
        slips: slips.collect(),
        precursors: precursors.collect(),
        ruptures: 9,
        summary,
        ..Measurements::default()
    }
}

#[expect(clippy::unnecessary_wraps, reason = "a kernel")]
fn fine(job: &Job, _: &AtomicBool) -> Result<Measurements, SimulationError> {
    Ok(measure(&job.parameters))
}

fn options(stop: &AtomicBool, threads: usize) -> Options<'_> {
    Options {
        threads: NonZeroUsize::new(threads),
        stop,
        retry_failed: false,
        shard: Shard::default(),
        walltime: None,
    }
}

fn run_all(root: &Path, sweep: &Sweep, kernel: &Kernel<'_>) -> RunReport {
    run(
        &Layout::new(&Disk, root),
        sweep,
        options(&AtomicBool::new(false), 2),
        kernel,
        &mut |_| (),
    )
    .unwrap()
}

fn retry(root: &Path, sweep: &Sweep, kernel: &Kernel<'_>) -> RunReport {
    let stop = AtomicBool::new(false);
    let options = Options {
        retry_failed: true,
        ..options(&stop, 2)
    };
    run(
        &Layout::new(&Disk, root),
        sweep,
        options,
        kernel,
        &mut |_| (),
    )
    .unwrap()
}

/// All files of the tables with their bytes.
fn tables_of(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    for table in ["slips", "precursors", "jobs"] {
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

fn texts(root: &Path, table: RecordedTable, column: &str) -> Vec<String> {
    let mut texts = Vec::new();
    let results = Results::read(&Layout::new(&Disk, root)).unwrap();
    for batch in results.dataset(table).unwrap().batches() {
        let batch = batch.unwrap();
        let column = batch
            .rows
            .column_by_name(column)
            .unwrap()
            .as_string::<i32>();
        texts.extend(
            column
                .iter()
                .map(|text| text.unwrap_or_default().to_owned()),
        );
    }
    texts
}

fn expected_tables() -> BTreeMap<PathBuf, Vec<u8>> {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(SEEDS, ""), &fine);
    tables_of(root.path())
}

#[test]
fn bytes_do_not_depend_on_threads_or_shards() {
    let expected = expected_tables();
    assert!(
        expected.len() >= 9,
        "several parts are needed to see anything, not {}",
        expected.len() / 3
    );
    let (one, sharded) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let stop = AtomicBool::new(false);
    run(
        &Layout::new(&Disk, one.path()),
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &fine,
        &mut |_| (),
    )
    .unwrap();
    assert!(tables_of(one.path()) == expected);
    for shard in ["2/2", "1/2"] {
        let options = Options {
            shard: shard.parse().unwrap(),
            ..options(&stop, 2)
        };
        run(
            &Layout::new(&Disk, sharded.path()),
            &sweep(SEEDS, ""),
            options,
            &fine,
            &mut |_| (),
        )
        .unwrap();
    }
    assert!(tables_of(sharded.path()) == expected);
}

#[test]
fn a_stopped_run_resumes_byte_identical_and_runs_no_committed_job_again() {
    let root = tempfile::tempdir().unwrap();
    let (runs, stop) = (AtomicU64::new(0), AtomicBool::new(false));
    let kernel = |job: &Job, interrupt: &AtomicBool| {
        if runs.fetch_add(1, Ordering::Relaxed) >= SEEDS {
            stop.store(true, Ordering::Relaxed);
            while !interrupt.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            return Err(SimulationError::Interrupted { time: 0.0 });
        }
        Ok(measure(&job.parameters))
    };
    let mut stopping = 0;
    let report = run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 2),
        &kernel,
        &mut |event| {
            stopping += u32::from(*event == RunEvent::Stopping);
        },
    )
    .unwrap();
    assert!(report.stopped && stopping == 1);
    assert!(
        report.jobs_spilled > 0 && report.jobs_failed == 0,
        "{report:?}"
    );
    assert_eq!(
        report.jobs_run + report.jobs_spilled + report.jobs_left,
        2 * SEEDS
    );
    let again = AtomicU64::new(0);
    let resumed = run_all(root.path(), &sweep(SEEDS, ""), &|job, interrupt| {
        again.fetch_add(1, Ordering::Relaxed);
        fine(job, interrupt)
    });
    assert!(!resumed.stopped);
    assert_eq!(again.into_inner(), report.jobs_left);
    assert!(tables_of(root.path()) == expected_tables());
}

#[test]
fn a_second_run_does_nothing() {
    let root = tempfile::tempdir().unwrap();
    let first = run_all(root.path(), &sweep(SEEDS, ""), &fine);
    assert_eq!(
        (first.jobs_run, first.jobs_left, first.stopped),
        (2 * SEEDS, 0, false)
    );
    let (before, logs) = (
        tables_of(root.path()),
        fs::read_dir(root.path().join("run/log")).unwrap().count(),
    );
    let second = run_all(root.path(), &sweep(SEEDS, ""), &|_, _| {
        panic!("nothing is to be run")
    });
    assert_eq!(
        (second.jobs_run, second.jobs_left, second.jobs_failed),
        (0, 0, 0)
    );
    assert!(tables_of(root.path()) == before);
    assert_eq!(
        fs::read_dir(root.path().join("run/log")).unwrap().count(),
        logs
    );
}

/// Fails for one seed and panics for another, while `faults` is true.
fn faulty(job: &Job, faults: bool) -> Result<Measurements, SimulationError> {
    match job.parameters.seed {
        7 if faults => Err(SimulationError::EventBudget {
            time: 0.5,
            events: 10,
        }),
        11 if faults => panic!("index {} out of bounds", 99),
        _ => Ok(measure(&job.parameters)),
    }
}

#[test]
fn a_retry_that_is_killed_before_its_last_rename_leaves_nothing_that_looks_damaged() {
    let (root, kept) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    run_all(root.path(), &sweep(SEEDS, ""), &|job, _| faulty(job, true));
    let jobs = root.path().join("tables/jobs");
    let copy = |from: &Path, to: &Path| {
        for file in fs::read_dir(from).unwrap().map(|file| file.unwrap().path()) {
            fs::copy(&file, to.join(file.file_name().unwrap())).unwrap();
        }
    };
    copy(&jobs, kept.path());
    retry(root.path(), &sweep(SEEDS, ""), &fine);
    // The jobs come last.
    copy(kept.path(), &jobs);
    let verification = Results::verify(&Layout::new(&Disk, root.path())).unwrap();
    assert!(
        verification.problems.is_empty(),
        "{:?}",
        verification.problems
    );
    retry(root.path(), &sweep(SEEDS, ""), &fine);
    assert!(tables_of(root.path()) == expected_tables());
}

#[test]
fn failing_and_panicking_jobs_become_rows_others_continue_and_a_retry_mends_them() {
    let root = tempfile::tempdir().unwrap();
    let report = run_all(root.path(), &sweep(SEEDS, ""), &|job, _| faulty(job, true));
    assert_eq!(
        (report.jobs_run, report.jobs_failed, report.jobs_left),
        (2 * SEEDS, 4, 0)
    );
    let reasons: BTreeSet<String> = texts(root.path(), RecordedTable::Jobs, "reason")
        .into_iter()
        .collect();
    assert!(
        reasons.contains("panic: index 99 out of bounds"),
        "{reasons:?}"
    );
    assert!(
        reasons
            .iter()
            .any(|reason| reason.contains("record.max_events")),
        "{reasons:?}"
    );
    assert_eq!(
        run_all(root.path(), &sweep(SEEDS, ""), &fine).jobs_failed,
        4
    );

    let before = tables_of(root.path());
    let runs = AtomicU64::new(0);
    let still = retry(root.path(), &sweep(SEEDS, ""), &|job, _| {
        runs.fetch_add(1, Ordering::Relaxed);
        faulty(job, true)
    });
    assert_eq!(
        (runs.into_inner(), still.jobs_failed, still.jobs_left),
        (4, 4, 0)
    );
    assert!(tables_of(root.path()) == before);

    // A retry that comes to none of them leaves them to others, and counts none.
    let stop = AtomicBool::new(true);
    let options = Options {
        retry_failed: true,
        ..options(&stop, 2)
    };
    let layout = Layout::new(&Disk, root.path());
    let stopped = run(&layout, &sweep(SEEDS, ""), options, &fine, &mut |_| ()).unwrap();
    assert_eq!((stopped.jobs_failed, stopped.jobs_left), (0, 4));

    let mended = retry(root.path(), &sweep(SEEDS, ""), &fine);
    assert_eq!((mended.jobs_run, mended.jobs_failed), (4, 0));
    assert!(tables_of(root.path()) == expected_tables());
}

#[test]
fn an_extension_runs_the_new_jobs_alone_and_every_job_is_there_once() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(SEEDS, ""), &fine);
    let before = tables_of(root.path());
    let report = run_all(root.path(), &sweep(SEEDS + 5, ""), &|job, interrupt| {
        assert!(job.parameters.seed >= SEEDS, "{job:?}");
        fine(job, interrupt)
    });
    assert_eq!(report.jobs_run, 10);
    assert_eq!(report.jobs_failed, 0);
    let after = tables_of(root.path());
    assert!(before.iter().all(|(path, bytes)| after[path] == *bytes));
    let ids = texts(root.path(), RecordedTable::Jobs, "job_id");
    assert_eq!(
        (
            ids.len() as u64,
            ids.iter().collect::<BTreeSet<_>>().len() as u64
        ),
        (2 * SEEDS + 10, 2 * SEEDS + 10)
    );
    let narrowed = run_all(root.path(), &sweep(2, ""), &|_, _| {
        panic!("nothing is to be run")
    });
    assert_eq!(narrowed.jobs_run, 0);
    assert!(tables_of(root.path()) == after);
}

#[test]
fn what_is_taken_out_of_the_sweep_is_kept_if_done_and_else_not_run() {
    let root = tempfile::tempdir().unwrap();
    let (runs, stop) = (AtomicU64::new(0), AtomicBool::new(false));
    let stopping = |job: &Job, _: &AtomicBool| {
        stop.store(
            runs.fetch_add(1, Ordering::Relaxed) >= SEEDS,
            Ordering::Relaxed,
        );
        Ok(measure(&job.parameters))
    };
    let begun = run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &stopping,
        &mut |_| (),
    )
    .unwrap();
    assert!(begun.jobs_run > 0 && begun.jobs_left > 0, "{begun:?}");
    let before = tables_of(root.path());
    let narrowed = run_all(root.path(), &sweep(SEEDS - 9, ""), &|job, interrupt| {
        assert!(job.parameters.seed < SEEDS - 9, "{job:?}");
        fine(job, interrupt)
    });
    assert!(narrowed.jobs_run > 0);
    let after = tables_of(root.path());
    assert!(before.iter().all(|(path, bytes)| after[path] == *bytes));
    let overview = status(
        &Results::read(&Layout::new(&Disk, root.path())).unwrap(),
        MAX_FAILURES,
    )
    .unwrap()
    .overview;
    assert_eq!(
        (overview.jobs_missing, overview.jobs_done),
        (0, begun.jobs_run + narrowed.jobs_run)
    );
    assert_eq!(overview.jobs_kept, overview.jobs_done - 2 * (SEEDS - 9));
    let whole = run_all(root.path(), &sweep(SEEDS, ""), &fine);
    assert_eq!(
        begun.jobs_run + narrowed.jobs_run + whole.jobs_run,
        2 * SEEDS
    );
    let ids = texts(root.path(), RecordedTable::Jobs, "job_id");
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len() as u64, 2 * SEEDS);
    assert_eq!(ids.len() as u64, 2 * SEEDS);
    assert!(
        Results::verify(&Layout::new(&Disk, root.path()))
            .unwrap()
            .whole
    );
}

#[test]
fn a_longer_time_runs_the_jobs_again_that_the_shorter_one_ended_and_no_others() {
    let root = tempfile::tempdir().unwrap();
    let bounded = |max_time: &str| {
        let text = sweep(SEEDS, "")
            .text()
            .replace("slips = 3", &format!("slips = 3\n{max_time}"));
        Sweep::parse(&text, Path::new("test.toml")).unwrap()
    };
    let until = |max_time: f64| {
        move |job: &Job, _: &AtomicBool| {
            let mut measured = measure(&job.parameters);
            if measured.summary.end_time > max_time {
                measured.summary = Summary {
                    end_time: max_time,
                    satisfied: false,
                    ..measured.summary
                };
            }
            Ok(measured)
        }
    };
    run_all(root.path(), &bounded("max_time = 40"), &until(40.0));
    let cut = texts(root.path(), RecordedTable::Jobs, "outcome")
        .iter()
        .filter(|outcome| *outcome == "time limit")
        .count() as u64;
    assert!((10..SEEDS).contains(&cut), "{cut}");
    assert_eq!(
        run_all(root.path(), &bounded("max_time = 30"), &|_, _| panic!(
            "nothing is to be run"
        ))
        .jobs_run,
        0
    );
    let longer = run_all(root.path(), &bounded(""), &fine);
    assert_eq!((longer.jobs_run, longer.jobs_left), (cut, 0));
    assert!(!texts(root.path(), RecordedTable::Jobs, "outcome").contains(&"time limit".to_owned()));
    assert_eq!(
        texts(root.path(), RecordedTable::Jobs, "job_id").len() as u64,
        2 * SEEDS
    );
    assert!(
        Results::verify(&Layout::new(&Disk, root.path()))
            .unwrap()
            .whole
    );
}

#[test]
fn a_changed_model_is_refused_and_nothing_is_written() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(2, ""), &fine);
    let all = |folder: &Path| {
        let mut names = vec![];
        let mut folders = vec![folder.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let (path, metadata) = entry
                    .map(|entry| (entry.path(), entry.metadata().unwrap()))
                    .unwrap();
                names.push((path.clone(), metadata.modified().unwrap()));
                folders.extend(metadata.is_dir().then_some(path));
            }
        }
        names.sort();
        names
    };
    let before = all(root.path());
    let stop = AtomicBool::new(false);
    let changed = run(
        &Layout::new(&Disk, root.path()),
        &sweep(2, "K = 2e8"),
        options(&stop, 1),
        &fine,
        &mut |_| (),
    );
    assert!(changed.unwrap_err().to_string().contains("model.K"));
    assert_eq!(all(root.path()), before);
}

#[test]
fn a_damaged_part_is_named_with_the_way_out_which_works() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(SEEDS, ""), &fine);
    let name = "part-000-000001.parquet";
    let path = root.path().join("tables/jobs").join(name);
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 9]).unwrap();
    let stop = AtomicBool::new(false);
    let error = run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &fine,
        &mut |_| (),
    )
    .unwrap_err();
    assert!(
        error
            .to_string()
            .contains("jobs/part-000-000001.parquet: damaged"),
        "{error}"
    );
    for table in ["slips", "precursors", "jobs"] {
        fs::remove_file(root.path().join("tables").join(table).join(name)).unwrap();
    }
    run_all(root.path(), &sweep(SEEDS, ""), &fine);
    assert!(tables_of(root.path()) == expected_tables());
}

#[test]
fn a_second_worker_takes_what_the_first_has_not_and_ends_before_it() {
    let root = tempfile::tempdir().unwrap();
    let second = Mutex::new(None);
    let stop = AtomicBool::new(false);
    let again = |seeds| {
        run(
            &Layout::new(&Disk, root.path()),
            &sweep(seeds, ""),
            options(&stop, 1),
            &fine,
            &mut |_| (),
        )
    };
    // A thread that waits for the pool of the second runs other jobs of its own meanwhile: no lock may be held.
    let has_begun = AtomicBool::new(false);
    let kernel = |job: &Job, interrupt: &AtomicBool| {
        if !has_begun.swap(true, Ordering::Relaxed) {
            let other_sweep = again(SEEDS + 1).unwrap_err();
            assert!(other_sweep.kind == ErrorKind::Busy, "{other_sweep}");
            assert!(
                other_sweep.to_string().contains("for another sweep file"),
                "{other_sweep}"
            );
            let done = again(SEEDS).unwrap();
            *second.lock().unwrap() = Some(done);
        }
        fine(job, interrupt)
    };
    let first = run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &kernel,
        &mut |_| (),
    )
    .unwrap();
    let second = second.into_inner().unwrap().unwrap();
    assert_eq!(first.jobs_run + second.jobs_run, 2 * SEEDS);
    assert_eq!(
        (second.jobs_left, second.hosts.len(), second.stopped),
        (first.jobs_run, 1, false)
    );
    assert!(first.jobs_run > 0 && second.jobs_run > first.jobs_run && first.jobs_left == 0);
    assert!(tables_of(root.path()) == expected_tables());
    assert!(
        fs::read_dir(root.path().join("run/claims"))
            .unwrap()
            .next()
            .is_none()
    );
    assert!(
        fs::read_dir(root.path().join("run/workers"))
            .unwrap()
            .next()
            .is_none()
    );
}

/// Many threads of this process, each a worker of its own.
#[test]
fn workers_that_begin_at_once_run_every_part_exactly_once() {
    for round in 0..5 {
        let root = tempfile::tempdir().unwrap();
        let runs = Mutex::new(BTreeMap::new());
        let kernel = |job: &Job, interrupt: &AtomicBool| {
            let id = (job.parameters.seed, job.parameters.drive_velocity.to_bits());
            *runs.lock().unwrap().entry(id).or_insert(0) += 1;
            std::thread::yield_now();
            fine(job, interrupt)
        };
        let reports: Vec<RunReport> = std::thread::scope(|scope| {
            let workers: Vec<_> = (0..8)
                .map(|_| scope.spawn(|| run_all(root.path(), &sweep(SEEDS, ""), &kernel)))
                .collect();
            workers
                .into_iter()
                .map(|worker| worker.join().unwrap())
                .collect()
        });
        assert!(
            runs.into_inner().unwrap().values().all(|&count| count == 1),
            "round {round}"
        );
        assert_eq!(
            reports.iter().map(|report| report.jobs_run).sum::<u64>(),
            2 * SEEDS
        );
        assert!(tables_of(root.path()) == expected_tables());
    }
}

#[test]
fn what_is_done_is_reduced_once_and_again_only_after_a_failure_or_a_retry() {
    let root = tempfile::tempdir().unwrap();
    let (sweep, layout, stop) = (
        sweep(SEEDS, ""),
        Layout::new(&Disk, root.path()),
        AtomicBool::new(false),
    );
    // Runs beside the others that are there, then looks whether it is to reduce.
    let work = |retry_failed, reduce: &dyn Fn() -> Result<(), ResultsError>| {
        join(
            &layout,
            &sweep,
            Options {
                retry_failed,
                ..options(&stop, 1)
            },
            |joined| {
                joined.run(&|job, _| faulty(job, true), &mut |_| ())?;
                joined.reduce(reduce).map(|reduced| reduced.is_some())
            },
        )
    };
    let fails = || Err(ResultsError::refused(root.path(), "no"));
    let fine = || Ok(());
    join(
        &layout,
        &sweep,
        options(&stop, 1),
        |last| -> Result<(), ResultsError> {
            last.run(&|job, _| faulty(job, true), &mut |_| ())?;
            assert!(work(false, &fails).is_err());
            assert!(work(false, &fine)?, "the reduction before it failed");
            assert!(
                !work(false, &fine)? && last.reduce(fine)?.is_none(),
                "it was reduced by one that has ended"
            );
            assert!(
                work(true, &fine)?,
                "what was reduced lacks the jobs that ran again"
            );
            assert!(last.reduce(fine)?.is_none());
            assert!(work(true, &fails).is_err());
            assert!(
                last.reduce(fine)?.is_some(),
                "the one that ran jobs again has not reduced them"
            );
            Ok(())
        },
    )
    .unwrap();
    assert!(work(false, &fine).unwrap(), "nobody else was there");
}

#[test]
fn finished_jobs_of_an_unfinished_part_are_kept_by_a_stop_and_none_is_run_again() {
    let root = tempfile::tempdir().unwrap();
    let all = Mutex::new(BTreeSet::new());
    let mut stops = 0;
    loop {
        let (runs, stop) = (AtomicU64::new(0), AtomicBool::new(false));
        let kernel = |job: &Job, interrupt: &AtomicBool| {
            // Seven jobs and no more.
            if runs.fetch_add(1, Ordering::Relaxed) == 7 {
                stop.store(true, Ordering::Relaxed);
                while !interrupt.load(Ordering::Relaxed) {
                    std::thread::yield_now();
                }
                return Err(SimulationError::Interrupted { time: 0.0 });
            }
            let is_new = all
                .lock()
                .unwrap()
                .insert((job.parameters.seed, job.parameters.drive_velocity.to_bits()));
            assert!(is_new, "{job:?} is run again");
            Ok(measure(&job.parameters))
        };
        let report = run(
            &Layout::new(&Disk, root.path()),
            &sweep(SEEDS, ""),
            options(&stop, 1),
            &kernel,
            &mut |_| (),
        )
        .unwrap();
        let (done, overview) = (all.lock().unwrap().len() as u64, {
            status(
                &Results::read(&Layout::new(&Disk, root.path())).unwrap(),
                MAX_FAILURES,
            )
            .unwrap()
            .overview
        });
        assert_eq!(
            (
                overview.jobs_done + overview.jobs_spilled,
                overview.jobs_missing
            ),
            (done, 2 * SEEDS - done)
        );
        assert_eq!(report.jobs_left, 2 * SEEDS - done);
        if !report.stopped {
            break;
        }
        stops += 1;
    }
    assert!(stops > 10, "{stops}");
    assert!(tables_of(root.path()) == expected_tables());
    for table in ["slips", "precursors", "jobs"] {
        assert!(
            fs::read_dir(root.path().join("run/spill").join(table))
                .unwrap()
                .next()
                .is_none()
        );
    }
}

/// Another host has claimed two parts: it beats, was silent for long, or is silent from now on.
#[test]
fn parts_of_a_dead_worker_elsewhere_are_taken_over_and_those_of_a_living_one_left() {
    for (silent, beats, is_taken) in [
        (Duration::ZERO, true, false),
        (2 * SILENCE, false, true),
        (Duration::ZERO, false, true),
    ] {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        let results = open(&layout, &sweep(SEEDS, "")).unwrap();
        leave(
            &layout,
            &sweep(SEEDS, ""),
            "worker-elsewhere",
            false,
            silent,
        );
        fs::create_dir_all(layout.claims()).unwrap();
        for part in results.plan().parts().skip(1).take(2) {
            fs::write(
                layout.claims().join(format!("{}.0", part.name)),
                "worker-elsewhere",
            )
            .unwrap();
        }
        let done = AtomicBool::new(false);
        let report = std::thread::scope(|scope| {
            scope.spawn(|| {
                while beats && !done.load(Ordering::Relaxed) {
                    leave(
                        &layout,
                        &sweep(SEEDS, ""),
                        "worker-elsewhere",
                        false,
                        Duration::ZERO,
                    );
                    std::thread::sleep(SILENCE / 20);
                }
            });
            let begin = Instant::now();
            let report = run_all(root.path(), &sweep(SEEDS, ""), &fine);
            done.store(true, Ordering::Relaxed);
            // A worker that beats is known after a beat, and one that does not after the silence.
            assert!(begin.elapsed() < 2 * SILENCE, "{:?}", begin.elapsed());
            report
        });
        assert_eq!(
            (report.jobs_left == 0, report.hosts.is_empty()),
            (is_taken, is_taken),
            "{report:?}"
        );
        assert_eq!(report.jobs_run == 2 * SEEDS, is_taken);
        assert_eq!(tables_of(root.path()) == expected_tables(), is_taken);
    }
}

#[test]
fn a_damaged_spill_is_run_again() {
    assert_damage_is_run_again(|file| fs::write(file, "half a file").unwrap());
}

#[test]
fn a_spill_that_leads_nowhere_is_run_again() {
    assert_damage_is_run_again(|file| {
        fs::remove_file(file).unwrap();
        std::os::unix::fs::symlink("nowhere", file).unwrap();
    });
}

/// Damages what a stopped run has spilled, and expects the next one to end all the same.
fn assert_damage_is_run_again(damage: impl Fn(&Path)) {
    let root = tempfile::tempdir().unwrap();
    let (runs, stop) = (AtomicU64::new(0), AtomicBool::new(false));
    let kernel = |job: &Job, _: &AtomicBool| {
        stop.fetch_or(runs.fetch_add(1, Ordering::Relaxed) == 1, Ordering::Relaxed);
        Ok(measure(&job.parameters))
    };
    let stopped = run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &kernel,
        &mut |_| (),
    )
    .unwrap();
    assert!(stopped.jobs_spilled > 0, "{stopped:?}");
    for entry in fs::read_dir(root.path().join("run/spill/slips")).unwrap() {
        damage(&entry.unwrap().path());
    }
    run_all(root.path(), &sweep(SEEDS, ""), &fine);
    assert!(tables_of(root.path()) == expected_tables());
}

#[test]
fn a_spill_whose_part_is_done_goes_with_the_next_run() {
    let (root, kept) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (runs, stop) = (AtomicU64::new(0), AtomicBool::new(false));
    let kernel = |job: &Job, _: &AtomicBool| {
        stop.fetch_or(runs.fetch_add(1, Ordering::Relaxed) == 1, Ordering::Relaxed);
        Ok(measure(&job.parameters))
    };
    run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &kernel,
        &mut |_| (),
    )
    .unwrap();
    let spill = |table| root.path().join("run/spill").join(table);
    let files = |table| {
        fs::read_dir(spill(table))
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect::<Vec<_>>()
    };
    let names = files("slips");
    assert!(!names.is_empty());
    for name in &names {
        fs::copy(spill("slips").join(name), kept.path().join(name)).unwrap();
    }
    for _ in 0..2 {
        run_all(root.path(), &sweep(SEEDS, ""), &fine);
        assert!(
            files("slips").is_empty()
                && files("jobs").is_empty()
                && tables_of(root.path()) == expected_tables()
        );
        // As a worker leaves it that dies while it removes it: jobs go first.
        for name in &names {
            fs::copy(kept.path().join(name), spill("slips").join(name)).unwrap();
        }
    }
}

#[test]
fn the_status_reports_what_is_there_and_what_is_missing() {
    let root = tempfile::tempdir().unwrap();
    let stop = AtomicBool::new(false);
    let half = Options {
        shard: "1/2".parse().unwrap(),
        ..options(&stop, 2)
    };
    run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        half,
        &|job, _| faulty(job, true),
        &mut |_| (),
    )
    .unwrap();
    let status = status(
        &Results::read(&Layout::new(&Disk, root.path())).unwrap(),
        MAX_FAILURES,
    )
    .unwrap();
    let overview = status.overview;
    let rows = texts(root.path(), RecordedTable::Jobs, "outcome");
    let failed = rows.iter().filter(|outcome| *outcome == "failed").count() as u64;
    assert_eq!(
        (overview.jobs_failed, overview.jobs_done),
        (failed, rows.len() as u64 - failed)
    );
    assert_eq!(overview.jobs_missing, 2 * SEEDS - rows.len() as u64);
    assert!(overview.parts_done > 0 && overview.parts_missing > 0 && status.workers.is_empty());
    assert!(status.pace.is_some_and(|pace| pace > 0.0) && status.time_left.is_some());
}

#[test]
fn events_account_for_every_job() {
    let root = tempfile::tempdir().unwrap();
    let stop = AtomicBool::new(false);
    let (mut started, mut done, mut failed, mut committed, mut finished) = (0, 0, 0, 0, 0);
    let kernel = |job: &Job, _: &AtomicBool| faulty(job, true);
    run(
        &Layout::new(&Disk, root.path()),
        &sweep(SEEDS, ""),
        options(&stop, 2),
        &kernel,
        &mut |event| match event {
            RunEvent::Started { jobs, .. } => started += jobs,
            RunEvent::JobDone { .. } => done += 1,
            RunEvent::JobFailed { job_id, .. } => {
                assert_eq!(job_id.len(), 32);
                failed += 1;
            }
            RunEvent::PartCommitted { jobs, .. } => committed += *jobs as u64,
            RunEvent::Finished(report) => finished += report.jobs_run,
            RunEvent::Tick => {}
            event => panic!("nobody asked for {event:?}"),
        },
    )
    .unwrap();
    assert_eq!((started, done, failed), (2 * SEEDS, 2 * SEEDS - 4, 4));
    assert_eq!((committed, finished), (2 * SEEDS, 2 * SEEDS));
}

#[test]
fn parts_done_since_the_last_look_are_counted_whichever_worker_did_them() {
    let root = tempfile::tempdir().unwrap();
    let (layout, stop) = (Layout::new(&Disk, root.path()), AtomicBool::new(false));
    let results = open(&layout, &sweep(SEEDS, "")).unwrap();
    let parts: Vec<Outline> = results.plan().outlines().collect();
    let pending = Pending::look_up(&results, &parts, Retry::default()).unwrap();
    assert_eq!(pending.done_since().unwrap(), Done::default());
    let report = run(
        &layout,
        &sweep(SEEDS, ""),
        options(&stop, 1),
        &|job, _| Ok(measure(&job.parameters)),
        &mut |_| (),
    );
    let done = pending.done_since().unwrap();
    assert_eq!(done.jobs, 2 * SEEDS);
    assert!((done.cost / report.unwrap().predicted_cost - 1.0).abs() < 1e-9);
}

#[test]
fn a_job_that_takes_long_is_reported_while_it_runs() {
    let root = tempfile::tempdir().unwrap();
    let text = "name = \"test\"\n[axes]\nseed = [7]\n[record]\nslips = 1\ndiscard = 0\n";
    let sweep = Sweep::parse(text, Path::new("test.toml")).unwrap();
    let done = AtomicBool::new(false);
    let slow = |job: &Job, _: &AtomicBool| {
        while !done.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        Ok(measure(&job.parameters))
    };
    let (mut ticks, mut told) = (0, Vec::new());
    let stop = AtomicBool::new(false);
    run(
        &Layout::new(&Disk, root.path()),
        &sweep,
        options(&stop, 1),
        &slow,
        &mut |event| match event {
            RunEvent::Tick => ticks += 1,
            RunEvent::JobTakesLong {
                command,
                predicted_cost,
                wall,
            } => {
                assert!(*wall > 20.0 * predicted_cost, "{event:?}");
                told.push(command.clone());
                done.store(told.len() == 2, Ordering::Relaxed);
            }
            _ => {}
        },
    )
    .unwrap();
    assert!(ticks >= 2, "{ticks}");
    assert_eq!(
        told,
        vec!["stickslip simulate --set seed=7 --slips 1 --record discard=0"; 2],
        "again when it has doubled"
    );
}

#[test]
fn all_tables_have_the_described_columns() {
    fn columns<R: Row>() -> Vec<String> {
        R::columns()
            .into_iter()
            .map(|column| column.name.into_owned())
            .collect()
    }
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(3, ""), &fine);
    let mut slips = columns::<SlipRow<'_>>();
    slips.retain(|column| !["drive_work", "damping_loss", "break_loss"].contains(&column.as_str()));
    slips.retain(|column| {
        !["drops_before", "largest_drop_before", "drop_during"].contains(&column.as_str())
    });
    let expected = [slips, columns::<PrecursorRow<'_>>(), columns::<JobRow>()];
    let mut all: BTreeSet<String> = columns::<SetRow>().into_iter().collect();
    for (table, expected) in RecordedTable::ALL.into_iter().zip(expected) {
        let results = Results::read(&Layout::new(&Disk, root.path())).unwrap();
        let dataset = results.dataset(table).unwrap();
        let batch = dataset.batches().next().unwrap().unwrap();
        let names: Vec<_> = batch
            .rows
            .schema()
            .fields()
            .iter()
            .map(|field| field.name().clone())
            .collect();
        assert_eq!(names, expected);
        all.extend(names);
    }
    // Joined in DuckDB, which ignores case, one would be taken for another.
    let ignoring_case: BTreeSet<_> = all.iter().map(|name| name.to_lowercase()).collect();
    assert_eq!(ignoring_case.len(), all.len(), "{all:?}");
}

#[test]
fn a_walltime_ends_a_run_in_time_with_all_that_it_finished_kept() {
    /// Time over predicted cost: each of four parts takes half a second on two threads.
    const PACE: f64 = 0.2;
    const WALLTIME: Duration = Duration::from_millis(1500);
    let slow = |job: &Job, interrupt: &AtomicBool| {
        std::thread::sleep(Duration::from_secs_f64(PACE * job.cost));
        fine(job, interrupt)
    };
    let root = tempfile::tempdir().unwrap();
    let stop = AtomicBool::new(false);
    for round in 0.. {
        let options = Options {
            walltime: Some(WALLTIME),
            ..options(&stop, 2)
        };
        let (mut jobs_ended, mut out_of_time) = (0, 0);
        let report = run(
            &Layout::new(&Disk, root.path()),
            &sweep(SEEDS, ""),
            options,
            &slow,
            &mut |event| match event {
                RunEvent::JobDone { .. } => jobs_ended += 1,
                RunEvent::OutOfTime => out_of_time += 1,
                _ => {}
            },
        )
        .unwrap();
        assert!(report.wall < WALLTIME.as_secs_f64(), "{report:?}");
        assert!(
            report.jobs_run + report.jobs_spilled == jobs_ended && jobs_ended > 0,
            "{report:?}"
        );
        assert!(out_of_time <= 1, "it is said once");
        assert_eq!(report.stopped, report.jobs_left > 0, "{report:?}");
        assert!(report.stopped || round > 0, "four parts take 2 s");
        if !report.stopped {
            break;
        }
        assert!(round < 10, "{report:?}");
    }
    assert!(tables_of(root.path()) == expected_tables());
}
