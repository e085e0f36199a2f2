//! Parts at which workers died, and jobs that memory forbids.

use super::*;
use crate::results::claims::{Claims, Marked};
use crate::results::pending::{Pending, Retry};
use crate::results::tables::RecordedTable;
use crate::results::workers::tests::lose;
use crate::sweep::Part;

/// Names of the claims that are there.
fn claims(root: &Path) -> Vec<String> {
    let claims = Disk.list(&root.join("run/claims")).unwrap();
    claims
        .into_iter()
        .map(|name| name.into_string().unwrap())
        .collect()
}

fn deaths(root: &Path) -> usize {
    let results = Results::read(&Layout::new(&Disk, root)).unwrap();
    status(&results, MAX_FAILURES).unwrap().parts_with_deaths
}

fn marked(root: &Path) -> Vec<Marked> {
    status(
        &Results::read(&Layout::new(&Disk, root)).unwrap(),
        MAX_FAILURES,
    )
    .unwrap()
    .marked
}

/// Leaves the claims of this number of dead workers at the parts of these numbers.
fn leave_claims(root: &Path, deaths: &[(u64, usize)]) {
    fs::create_dir_all(root.join("run/claims")).unwrap();
    for &(index, deaths) in deaths {
        let part = PartName {
            extension: 0,
            index,
        };
        for number in 0..deaths {
            fs::write(
                root.join(format!("run/claims/{part}.{number}")),
                format!("worker-{number}"),
            )
            .unwrap();
        }
    }
}

#[test]
fn parts_at_which_workers_died_come_last_and_after_three_deaths_alone_on_one_thread() {
    for threads in [1, 4] {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(&Disk, root.path());
        let results = open(&layout, &sweep(SEEDS, "")).unwrap();
        let parts: Vec<_> = results.plan().parts().collect();
        leave_claims(root.path(), &[(0, 4), (1, 3), (2, 2), (3, 1)]);
        let status = status(&Results::read(&layout).unwrap(), MAX_FAILURES).unwrap();
        assert_eq!(status.parts_with_deaths, 4);
        let found = status.marked;
        let deaths: Vec<_> = found.iter().map(|marked| marked.deaths).collect();
        assert_eq!(deaths, [4, 3, 2]);
        assert_eq!(found[0].commands.len(), 2, "{found:?}");
        assert!(
            found[0].to_string().contains("--set seed=23 "),
            "{}",
            found[0]
        );

        let order = Mutex::new(Vec::new());
        let running = Mutex::new(BTreeMap::<usize, usize>::new());
        let kernel = |job: &Job, interrupt: &AtomicBool| {
            let is_of = |part: &Part| part.jobs.contains(job);
            let part = parts.iter().position(is_of).unwrap();
            order.lock().unwrap().push(part);
            *running.lock().unwrap().entry(part).or_default() += 1;
            std::thread::sleep(Duration::from_millis(2));
            let mut running = running.lock().unwrap();
            let beside: usize = running.values().sum();
            assert!(part > 1 || beside == 1, "{running:?}");
            *running.get_mut(&part).unwrap() -= 1;
            fine(job, interrupt)
        };
        let stop = AtomicBool::new(false);
        let report = run(
            &layout,
            &sweep(SEEDS, ""),
            options(&stop, threads),
            &kernel,
            &mut |_| (),
        )
        .unwrap();
        assert_eq!((report.jobs_failed, report.jobs_left), (0, 0));
        let mut order = order.into_inner().unwrap();
        order.dedup();
        let last = order.len() - 2;
        assert_eq!(order[last..], [1, 0]);
        let plan_order: Vec<usize> = (4..parts.len()).chain([3, 2, 1, 0]).collect();
        assert!(threads > 1 || order == plan_order, "{order:?}");
        assert!(tables_of(root.path()) == expected_tables());
        assert_eq!(claims(root.path()), Vec::<String>::new(), "all are done");
        assert_eq!(marked(root.path()), []);
    }
}

#[test]
fn the_death_of_a_killed_worker_counts_at_each_part_that_it_was_at_and_an_end_in_order_at_none() {
    let root = tempfile::tempdir().unwrap();
    let layout = Layout::new(&Disk, root.path());
    let sweep = sweep(SEEDS, "");
    let stop = AtomicBool::new(false);
    let stopping = |_: &Job, interrupt: &AtomicBool| {
        stop.store(true, Ordering::Relaxed);
        while !interrupt.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        Err(SimulationError::Interrupted { time: 0.0 })
    };
    let stopped = run(&layout, &sweep, options(&stop, 1), &stopping, &mut |_| ()).unwrap();
    assert!(stopped.stopped && stopped.marked.is_empty());
    stop.store(false, Ordering::Relaxed);
    let failed = join(&layout, &sweep, options(&stop, 1), |joined| {
        begin_part(joined, 1)?;
        Err::<(), _>(ResultsError::refused(root.path(), "no"))
    });
    assert!(failed.is_err());
    run_some_parts(&layout, &sweep);
    assert_eq!(deaths(root.path()), 0);

    for times in 1..4 {
        let killed = join(&layout, &sweep, options(&stop, 1), |joined| {
            begin_part(joined, 2)?;
            // As if it were killed here.
            lose(std::thread::current().id());
            join(&layout, &sweep, options(&stop, 1), |heir| {
                heir.member.tidy(false)?;
                Ok::<_, ResultsError>(())
            })
        });
        assert!(killed.is_ok(), "{killed:?}");
        assert_eq!(deaths(root.path()), 1);
        let found = marked(root.path());
        let found = found.first().map(|found| (&*found.part, found.deaths));
        assert_eq!(found, (times > 1).then_some(("part-000-000002", times)));
    }
}

/// Claims a part, as a worker does that runs it.
fn begin_part(joined: &Joined<'_>, index: u64) -> Result<(), ResultsError> {
    let part = PartName {
        extension: 0,
        index,
    };
    let mut claims = Claims::list(joined.member)?;
    let generation = claims.last(&part.to_string()).map_or(0, |last| last + 1);
    assert!(claims.take(&part.to_string(), generation)?);
    joined.member.begin_part(&part.to_string(), generation);
    Ok(())
}

/// Runs the first part alone.
fn run_some_parts(layout: &Layout<'_>, sweep: &Sweep) {
    let stop = AtomicBool::new(false);
    let kernel = |job: &Job, _: &AtomicBool| Ok(measure(&job.parameters));
    run(layout, sweep, options(&stop, 1), &kernel, &mut |event| {
        stop.fetch_or(
            matches!(event, RunEvent::PartCommitted { .. }),
            Ordering::Relaxed,
        );
    })
    .unwrap();
}

/// Runs where so much memory is allowed; the report, and the seeds and blocks that were run.
fn run_within(root: &Path, memory: f64, retry_failed: bool) -> (RunReport, Vec<usize>) {
    let blocks = Mutex::new(Vec::new());
    let report = run_kernel_within(root, memory, retry_failed, &|job, interrupt| {
        blocks.lock().unwrap().push(job.parameters.blocks);
        fine(job, interrupt)
    });
    let mut blocks = blocks.into_inner().unwrap();
    blocks.sort_unstable();
    (report, blocks)
}

fn run_kernel_within(
    root: &Path,
    memory: f64,
    retry_failed: bool,
    kernel: &Kernel<'_>,
) -> RunReport {
    let text = "name = \"big\"\n[model]\nNs = 100\n[axes]\nN = [3, 100000, 4]\nseed = { count = 2 }\n[record]\nslips = 2\n";
    let sweep = Sweep::parse(text, Path::new("big.toml")).unwrap();
    let stop = AtomicBool::new(false);
    let options = Options {
        retry_failed,
        ..options(&stop, 2)
    };
    let report = join(&Layout::new(&Disk, root), &sweep, options, |joined| {
        let limited = Joined {
            allowed_memory: memory,
            walltime: Walltime::new(joined.begin, None),
            ..*joined
        };
        limited.run(kernel, &mut |_| ())
    });
    report.unwrap()
}

#[test]
fn a_job_that_may_take_too_much_memory_begins_when_all_that_is_finished_is_committed() {
    for _ in 0..20 {
        let root = tempfile::tempdir().unwrap();
        let committed = Mutex::new(Vec::new());
        run_kernel_within(root.path(), 1.4e9, false, &|job, interrupt| {
            if job.parameters.blocks == 100_000 {
                let results = Results::read(&Layout::new(&Disk, root.path())).unwrap();
                let jobs = status(&results, MAX_FAILURES).unwrap().overview.jobs_done;
                committed.lock().unwrap().push(jobs);
            }
            fine(job, interrupt)
        });
        assert_eq!(committed.into_inner().unwrap(), [4, 5]);
    }
}

#[test]
fn what_memory_forbids_fails_with_its_reason_and_runs_again_by_itself_where_it_fits() {
    let whole = tempfile::tempdir().unwrap();
    assert_eq!(run_within(whole.path(), f64::INFINITY, false).0.jobs_run, 6);
    let root = tempfile::tempdir().unwrap();
    let (report, blocks) = run_within(root.path(), 0.7e9, false);
    assert_eq!(
        (report.jobs_run, report.jobs_failed, report.jobs_left),
        (6, 2, 0)
    );
    assert_eq!(blocks, [3, 3, 4, 4]);
    let reasons = texts(root.path(), RecordedTable::Jobs, "reason");
    let reason =
        "memory: needs at least 1.2 GB, 700 MB allowed here; run it again where more is allowed";
    assert_eq!(
        reasons.iter().filter(|found| *found == reason).count(),
        2,
        "{reasons:?}"
    );

    // It still does not fit, even if failed jobs are to run again.
    for retry_failed in [false, true] {
        let (report, blocks) = run_within(root.path(), 0.9e9, retry_failed);
        assert_eq!(
            (report.jobs_failed, report.jobs_left, blocks),
            (2, 0, vec![])
        );
    }
    let (report, blocks) = run_within(root.path(), 1.4e9, false);
    assert_eq!(
        (report.jobs_run, report.jobs_failed, report.jobs_left),
        (2, 0, 0)
    );
    assert_eq!(blocks, [100_000; 2]);
    assert!(files_of(root.path(), "tables") == files_of(whole.path(), "tables"));
    let (report, blocks) = run_within(root.path(), 0.5e9, true);
    assert_eq!(
        (report.jobs_run, report.jobs_failed, blocks),
        (0, 0, vec![])
    );
}

fn files_of(root: &Path, folder: &str) -> BTreeMap<PathBuf, Vec<u8>> {
    faults::files_below(&root.join(folder))
}

#[test]
fn other_failures_do_not_run_again_by_themselves_however_much_memory_there_is() {
    let root = tempfile::tempdir().unwrap();
    run_all(root.path(), &sweep(SEEDS, ""), &|job, _| faulty(job, true));
    let layout = Layout::new(&Disk, root.path());
    let results = Results::read(&layout).unwrap();
    let parts: Vec<Outline> = results.plan().outlines().collect();
    let retry = Retry {
        all: false,
        memory: f64::INFINITY,
    };
    let pending = Pending::look_up(&results, &parts, retry).unwrap();
    let mut failed = 0;
    pending
        .overview(true, |part, position, why| {
            failed += 1;
            assert!(!pending.runs_again(&part.jobs[position], why));
        })
        .unwrap();
    assert_eq!(failed, 4);
}

#[test]
fn jobs_that_do_not_fit_beside_each_other_run_one_after_the_other_and_the_log_says_so() {
    let root = tempfile::tempdir().unwrap();
    let text = "name = \"big\"\n[model]\nN = 10000\nNs = 226\n[axes]\nseed = { count = 6 }\n[record]\nslips = 2\n";
    let sweep = Sweep::parse(text, Path::new("big.toml")).unwrap();
    let running = AtomicU64::new(0);
    let most = AtomicU64::new(0);
    let kernel = |job: &Job, interrupt: &AtomicBool| {
        most.fetch_max(
            running.fetch_add(1, Ordering::Relaxed) + 1,
            Ordering::Relaxed,
        );
        std::thread::sleep(Duration::from_millis(5));
        running.fetch_sub(1, Ordering::Relaxed);
        fine(job, interrupt)
    };
    let stop = AtomicBool::new(false);
    // A job takes 0.36 GB.
    for (memory, at_once, reports) in [(1e12, 4, 0), (1.1e9, 2, 1), (0.3e9, 1, 1)] {
        let folder = root.path().join(at_once.to_string());
        most.store(0, Ordering::Relaxed);
        let mut reported = 0;
        let layout = Layout::new(&Disk, &folder);
        let report = join(&layout, &sweep, options(&stop, 4), |joined| {
            let limited = Joined {
                allowed_memory: memory,
                walltime: Walltime::new(joined.begin, None),
                ..*joined
            };
            limited.run(&kernel, &mut |event| {
                reported += u32::from(matches!(event, RunEvent::ShortOfMemory { .. }));
            })
        });
        assert_eq!(report.unwrap().jobs_failed, 0);
        assert!(
            most.load(Ordering::Relaxed) <= at_once,
            "{most:?} of {at_once}"
        );
        assert_eq!(reported, reports, "{memory}");
    }
}
