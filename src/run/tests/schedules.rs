//! Several processes on one directory, whose operations on the disk are interleaved as a seed decides, with caches as
//! of a network file system or without. Whatever the order, and whichever worker is killed, or suspended until others
//! have taken over its work: nothing is lost, done twice, moved or reported as damaged, and the end is the same bytes.

use super::faults::{files_below, results, small_sweep, small_sweep_in_rounds};
use super::host::Host;
use super::schedule::{Schedule, random_index};
use super::*;
use crate::reduce::{NoJobs, reduce, renew};
use crate::results::commit::tests::{KNOWN_NUMBER, own_number};
use crate::results::destination::NewFolder;
use crate::results::tables::{Names, RecordedTable};
use crate::results::verification::Verification;
use crate::table::formats::Format;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::LazyLock;

/// Jobs of 2 V0 each, a few to a part.
const SEEDS: u64 = 8;
/// Fewer, for what was there before.
const FEWER: u64 = 5;
/// Seeds of the first round, of sweeps that decide for themselves: more follow in two further ones.
const AT_FIRST: u64 = 3;
/// Schedules in the usual tests.
const SCHEDULES: u64 = 150;
/// Environment variable with another number of them, and the first seed.
const WANTED: &str = "STICKSLIP_SCHEDULES";
/// Operations of a process within which it is killed.
const KILL_BEFORE: u64 = 250;
/// Operations of a process within which it is suspended.
const FREEZE_BEFORE: u64 = 150;

/// What is in the directory before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum There {
    Nothing,
    /// A run was stopped in the middle of a part.
    StoppedRun,
    /// All jobs of the sweep with fewer seeds.
    FewerJobs,
    AllJobs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Process {
    Run,
    /// A run that is stopped after some jobs.
    StoppedRun,
    /// A run of the sweep with fewer seeds.
    RunFewer,
    Export,
    Repair,
    Verify,
    Reduce,
    Read,
}

/// How often each job was run, by seed and velocity.
type Runs = Mutex<BTreeMap<(u64, u64), usize>>;

/// Jobs after which a run is stopped: in the middle of a part.
const STOP_AFTER: u64 = 3;

impl Process {
    const ALL: [Self; 8] = [
        Self::Run,
        Self::StoppedRun,
        Self::RunFewer,
        Self::Export,
        Self::Repair,
        Self::Verify,
        Self::Reduce,
        Self::Read,
    ];

    fn act(self, layout: &Layout<'_>, in_rounds: bool, runs: &Runs) -> anyhow::Result<()> {
        match self {
            Self::Run => run_some(layout, (SEEDS, in_rounds), None, runs).map(|_| ()),
            Self::StoppedRun => {
                run_some(layout, (SEEDS, in_rounds), Some(STOP_AFTER), runs).map(|_| ())
            }
            Self::RunFewer => run_some(layout, (FEWER, in_rounds), None, runs).map(|_| ()),
            Self::Export => {
                let folder = layout
                    .root()
                    .with_file_name(format!("export-{:016x}", own_number()));
                Ok(renew(&Results::read(layout)?)?
                    .export(
                        NewFolder::new(&folder)?,
                        Format::Arrow,
                        &AtomicBool::new(false),
                        &mut |_, _| (),
                    )
                    .map(|_| ())?)
            }
            Self::Repair => assert_sound(&Results::repair(layout)?),
            Self::Verify => assert_sound(&Results::verify(layout)?),
            Self::Reduce => Ok(reduce(&Results::read(layout)?).map(|_| ())?),
            Self::Read => Ok(Results::read(layout)?
                .dataset(RecordedTable::Jobs)?
                .rows::<Names>()
                .try_for_each(|names| names.map(drop))?),
        }
    }
}

/// Nothing is damaged; at worst, what was reduced is to be reduced again.
fn assert_sound(verification: &Verification) -> anyhow::Result<()> {
    let mut problems = verification.problems.iter().filter(|problem| {
        !problem
            .path
            .components()
            .any(|name| name.as_os_str() == "reduced")
    });
    problems
        .next()
        .map_or(Ok(()), |problem| Err(anyhow::anyhow!("{problem:?}")))
}

/// Runs the sweep with this number of seeds, in rounds or not.
fn run_some(
    layout: &Layout<'_>,
    (seeds, in_rounds): (u64, bool),
    stop_after: Option<u64>,
    runs: &Runs,
) -> anyhow::Result<RunReport> {
    let sweep = if in_rounds {
        small_sweep_in_rounds(AT_FIRST, seeds)
    } else {
        small_sweep(seeds)
    };
    let (stop, begun) = (AtomicBool::new(false), AtomicU64::new(0));
    let kernel = |job: &Job, interrupt: &AtomicBool| {
        if stop_after.is_some_and(|most| begun.fetch_add(1, Ordering::Relaxed) >= most) {
            while !interrupt.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            return Err(SimulationError::Interrupted { time: 0.0 });
        }
        let key = (job.parameters.seed, job.parameters.drive_velocity.to_bits());
        *runs.lock().unwrap().entry(key).or_default() += 1;
        Ok(measure(&job.parameters))
    };
    let mut done = 0;
    let report = run(layout, &sweep, options(&stop, 1), &kernel, &mut |event| {
        done += u64::from(matches!(event, RunEvent::JobDone { .. }));
        stop.store(
            stop_after.is_some_and(|most| done >= most),
            Ordering::Relaxed,
        );
    })?;
    Ok(report)
}

impl There {
    const ALL: [Self; 4] = [
        Self::Nothing,
        Self::StoppedRun,
        Self::FewerJobs,
        Self::AllJobs,
    ];

    fn prepare(self, layout: &Layout<'_>, in_rounds: bool) -> anyhow::Result<()> {
        let runs = Runs::default();
        match self {
            Self::Nothing => (),
            Self::StoppedRun => {
                assert!(
                    run_some(layout, (SEEDS, in_rounds), Some(STOP_AFTER), &runs)?.jobs_spilled > 0
                );
            }
            Self::FewerJobs => {
                run_some(layout, (FEWER, in_rounds), None, &runs)?;
            }
            Self::AllJobs => {
                run_some(layout, (SEEDS, in_rounds), None, &runs)?;
            }
        }
        Ok(())
    }
}

/// A folder where syncs cost nothing, if there is such a place.
pub(super) fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in("/dev/shm")
        .or_else(|_| tempfile::tempdir())
        .unwrap()
}

fn write_files(root: &Path, files: &BTreeMap<PathBuf, Vec<u8>>) {
    for (path, bytes) in files {
        fs::create_dir_all(root.join(path).parent().unwrap()).unwrap();
        fs::write(root.join(path), bytes).unwrap();
    }
}

/// Completes a directory alone: runs, reduces; its files, and the jobs that were missing.
fn complete(
    root: &Path,
    in_rounds: bool,
    runs: &Runs,
) -> anyhow::Result<BTreeMap<PathBuf, Vec<u8>>> {
    let layout = Layout::new(&Disk, root);
    let report = run_some(&layout, (SEEDS, in_rounds), None, runs)?;
    anyhow::ensure!(
        (report.jobs_failed, report.jobs_left) == (0, 0),
        "{report:?}"
    );
    let results = Results::read(&layout)?;
    reduce(&results)?;
    anyhow::ensure!(Results::verify(&layout)?.whole, "it is not whole");
    Ok(files_below(root))
}

/// A directory before, and how it must end.
struct Trial {
    before: BTreeMap<PathBuf, Vec<u8>>,
    after: BTreeMap<PathBuf, Vec<u8>>,
    /// The jobs that were missing, each once.
    missing: BTreeMap<(u64, u64), usize>,
}

static TRIALS: LazyLock<BTreeMap<(There, bool), Trial>> = LazyLock::new(|| {
    let trial = |(there, in_rounds): (There, bool)| {
        let (folder, runs) = (folder(), Runs::default());
        let root = folder.path().join("small");
        fs::create_dir(&root).unwrap();
        there
            .prepare(&Layout::new(&Disk, &root), in_rounds)
            .unwrap();
        let before = files_below(&root);
        let after = complete(&root, in_rounds, &runs).unwrap();
        (
            (there, in_rounds),
            Trial {
                before,
                after,
                missing: runs.into_inner().unwrap(),
            },
        )
    };
    There::ALL
        .into_iter()
        .flat_map(|there| [(there, false), (there, true)])
        .map(trial)
        .collect()
});

/// Whether a process of these may end with this error, though nothing has befallen it.
fn is_allowed(
    error: &anyhow::Error,
    process: Process,
    processes: &[Process],
    there: There,
    is_frozen: bool,
) -> bool {
    let is_run = matches!(
        process,
        Process::Run | Process::StoppedRun | Process::RunFewer
    );
    if let Some(error) = error.downcast_ref::<ResultsError>() {
        let has_other_sweep = processes.contains(&Process::RunFewer);
        return match error.kind {
            ErrorKind::Busy => is_run && has_other_sweep,
            ErrorKind::Refused => {
                (there == There::Nothing && !is_run)
                    || (is_run && has_other_sweep && error.problem.contains("meanwhile"))
            }
            ErrorKind::Stopped => is_frozen,
            _ => false,
        };
    }
    error.is::<NoJobs>()
}

/// Goes through one schedule; which worker did what.
fn go_through(seed: u64) -> Vec<(usize, &'static str)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut below = |count| random_index(&mut random, count);
    let there = There::ALL[below(There::ALL.len())];
    let mut processes = vec![Process::Run];
    processes.extend((0..=below(2)).map(|_| Process::ALL[below(Process::ALL.len())]));
    let (has_caches, is_killing, in_rounds, is_freezing) =
        (below(2) == 0, below(3) == 0, below(3) == 0, below(3) == 0);
    let case = format!(
        "{WANTED}=1:{seed}: {processes:?} on {there:?}{}{}{}{}",
        if has_caches { ", with caches" } else { "" },
        if is_killing { ", one is killed" } else { "" },
        if is_freezing {
            ", the first is suspended"
        } else {
            ""
        },
        if in_rounds { ", in rounds" } else { "" }
    );
    let trial = &TRIALS[&(there, in_rounds)];
    let (folder, runs) = (folder(), Runs::default());
    let root = folder.path().join("small");
    write_files(&root, &trial.before);
    let schedule = Schedule::new(
        seed,
        processes.len(),
        is_killing.then_some(KILL_BEFORE),
        is_freezing.then_some(FREEZE_BEFORE),
    );
    let is_any_killed = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..processes.len())
            .map(|number| {
                let (schedule, runs, root, process) = (&schedule, &runs, &root, processes[number]);
                scope.spawn(move || {
                    KNOWN_NUMBER.set(Some(seed.wrapping_mul(31) + number as u64));
                    let host = Host::new(schedule, number, has_caches);
                    let acted = catch_unwind(AssertUnwindSafe(|| {
                        process.act(&Layout::new(&host, root), in_rounds, runs)
                    }));
                    (acted, schedule.end(number))
                })
            })
            .collect();
        let mut is_any_killed = false;
        for (number, (thread, process)) in threads.into_iter().zip(&processes).enumerate() {
            let (acted, is_killed) = thread.join().unwrap();
            is_any_killed |= is_killed;
            let acted = acted.unwrap_or_else(|_| panic!("{case}: {process:?} panicked"));
            if let Err(error) = acted
                && !is_killed
            {
                let is_frozen = is_freezing && number == 0;
                let is_allowed = is_allowed(&error, *process, &processes, there, is_frozen);
                assert!(is_allowed, "{case}: {process:?} ends with: {error:#}");
            }
        }
        is_any_killed
    });
    let completed = complete(&root, in_rounds, &runs)
        .unwrap_or_else(|error| panic!("{case}: cannot be completed: {error:#}"));
    let ids = |of: &BTreeMap<PathBuf, Vec<u8>>| {
        let folder = self::folder();
        write_files(folder.path(), of);
        let mut ids = texts(folder.path(), RecordedTable::Jobs, "job_id");
        ids.sort();
        (
            ids,
            texts(folder.path(), RecordedTable::Slips, "job_id").len(),
        )
    };
    let runs = runs.into_inner().unwrap();
    if processes.contains(&Process::RunFewer) {
        // Extensions are others, but every job is there once.
        assert!(ids(&completed) == ids(&trial.after), "{case}");
    } else {
        let differing = completed
            .iter()
            .filter(|(path, bytes)| trial.after.get(*path) != Some(bytes));
        let differing: Vec<_> = differing.map(|(path, _)| path).collect();
        assert!(
            results(&completed) == results(&trial.after),
            "{case}: {differing:?}"
        );
        if !is_any_killed && !is_freezing {
            assert_eq!(runs, trial.missing, "{case}");
        }
    }
    // Where one is suspended, and another killed that has taken over its part, a third runs it.
    let most = 2 + usize::from(is_any_killed && is_freezing);
    assert!(
        runs.values().all(|&times| times <= most),
        "{case}: {runs:?}"
    );
    schedule.log()
}

/// How many schedules are wanted, and the first seed: `COUNT` or `COUNT:FIRST`.
fn wanted() -> (u64, u64) {
    let wanted = std::env::var(WANTED).unwrap_or_else(|_| SCHEDULES.to_string());
    let (count, first) = wanted.split_once(':').unwrap_or((&wanted, "0"));
    (count.parse().unwrap(), first.parse().unwrap())
}

#[test]
fn whatever_the_order_of_operations_of_several_processes_nothing_is_lost_or_done_twice() {
    let (count, first) = wanted();
    let next = AtomicU64::new(first);
    let failures = AtomicU64::new(0);
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first + count {
                        break;
                    }
                    // Says what is wrong as it panics.
                    failures.fetch_add(
                        u64::from(catch_unwind(|| go_through(seed)).is_err()),
                        Ordering::Relaxed,
                    );
                }
            });
        }
    });
    assert_eq!(failures.into_inner(), 0, "failures in {count} schedules");
}

#[test]
fn a_schedule_is_reproduced_from_its_seed() {
    for seed in [1, 2, 3] {
        let once = go_through(seed);
        assert!(once.len() > 50, "{}", once.len());
        assert_eq!(once, go_through(seed), "seed {seed}");
    }
}
