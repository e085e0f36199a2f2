//! Every operation of small runs fails in every way, and the next run completes them to the same bytes.

use super::fault::{Fault, Operation};
use super::faulty_disk::{FaultyDisk, MOUNT};
use super::*;
use crate::reduce::reduce;
use std::sync::atomic::AtomicUsize;
use std::{iter, thread};

/// Few jobs a part, by the predicted cost: 8 jobs in two parts with the first two seeds.
pub fn small_sweep(seeds: u64) -> Sweep {
    let text = format!(
        "name = \"small\"\n[axes]\nV0 = [1e-4, 2e-4]\nseed = {{ count = {seeds} }}\n\
         [record]\nslips = 90\nprecursors = true\n[solver]\nmethod = \"fixed-step\"\ndt = 5.59e-7\n"
    );
    Sweep::parse(&text, Path::new("small.toml")).unwrap()
}

/// The same jobs, but run in rounds: some seeds first, then the others.
pub fn small_sweep_in_rounds(first: u64, seeds: u64) -> Sweep {
    let precision = format!(
        "[precision]\nof = \"tau_mean\"\nrelative = 0.01\nseeds = {{ from = {first}, to = {seeds} }}\n"
    );
    let text = small_sweep(seeds)
        .text()
        .replace(&format!("seed = {{ count = {seeds} }}\n"), "")
        + &precision;
    Sweep::parse(&text, Path::new("small.toml")).unwrap()
}

/// What was done on a disk before.
#[derive(Clone, Copy)]
enum Before {
    Nothing,
    FirstRun,
    /// Some of its jobs failed.
    FailingRun,
    /// It was killed when it had the first table of a part in place.
    KilledRun,
}

/// Renames of a first run before that of the second table of a part: one of the worker's file, one of the first table.
const RENAMES_BEFORE_THE_KILL: usize = 2;

/// What is done on a disk, after what was done on it before.
#[derive(Clone, Copy)]
struct Scenario {
    name: &'static str,
    before: Before,
    seeds: u64,
    retry_failed: bool,
    /// Whether the tables are reduced.
    reduces: bool,
    /// Whether its sweep is adaptive.
    in_rounds: bool,
}

const FIRST_RUN: Scenario = Scenario {
    name: "first run",
    before: Before::Nothing,
    seeds: 3,
    retry_failed: false,
    reduces: false,
    in_rounds: false,
};
const SCENARIOS: [Scenario; 5] = [
    FIRST_RUN,
    Scenario {
        name: "extension of a killed run",
        before: Before::KilledRun,
        seeds: 5,
        ..FIRST_RUN
    },
    Scenario {
        name: "retry of failed jobs",
        before: Before::FailingRun,
        retry_failed: true,
        ..FIRST_RUN
    },
    Scenario {
        name: "reduction",
        before: Before::FirstRun,
        reduces: true,
        ..FIRST_RUN
    },
    Scenario {
        name: "rounds",
        in_rounds: true,
        ..FIRST_RUN
    },
];

/// Runs with one thread, and reduces.
fn attempt(layout: &Layout<'_>, scenario: &Scenario, faults: bool) -> Result<RunReport, String> {
    let stop = AtomicBool::new(false);
    let options = Options {
        retry_failed: scenario.retry_failed,
        ..options(&stop, 1)
    };
    let kernel = |job: &Job, _: &AtomicBool| match job.parameters.seed {
        1 if faults => Err(SimulationError::EventBudget {
            time: 0.5,
            events: 10,
        }),
        _ => Ok(measure(&job.parameters)),
    };
    let sweep = if scenario.in_rounds {
        small_sweep_in_rounds(2, scenario.seeds)
    } else {
        small_sweep(scenario.seeds)
    };
    let report =
        run(layout, &sweep, options, &kernel, &mut |_| ()).map_err(|error| error.to_string())?;
    if scenario.reduces {
        let results = Results::read(layout).map_err(|error| error.to_string())?;
        reduce(&results).map_err(|error| error.to_string())?;
    }
    Ok(report)
}

/// Tables, reduced data and extensions, without logs and leftovers.
pub fn results(files: &BTreeMap<PathBuf, Vec<u8>>) -> BTreeMap<&Path, &[u8]> {
    let is_result = |path: &Path| {
        !["run/log", "run/staging", "run/workers", "run/claims"]
            .iter()
            .any(|folder| path.starts_with(folder))
    };
    files
        .iter()
        .filter(|(path, _)| is_result(path))
        .map(|(path, bytes)| (path.as_path(), bytes.as_slice()))
        .collect()
}

pub fn files_below(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut files, mut folders) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(below) = folders.pop() {
        for entry in fs::read_dir(below).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(
                    path.strip_prefix(folder).unwrap().to_owned(),
                    fs::read(&path).unwrap(),
                );
            }
        }
    }
    files
}

/// Jobs in the jobs table that are done and did not fail.
fn committed_jobs(root: &Path) -> u64 {
    if !root.join("tables/jobs").exists() {
        return 0;
    }
    texts(root, RecordedTable::Jobs, "outcome")
        .iter()
        .filter(|outcome| *outcome != "failed")
        .count() as u64
}

/// A scenario, ready to begin, and how it ends.
struct Trial {
    scenario: Scenario,
    root: PathBuf,
    prepared: FaultyDisk,
    before: BTreeMap<PathBuf, Vec<u8>>,
    after: BTreeMap<PathBuf, Vec<u8>>,
}

impl Trial {
    fn new(scenario: Scenario) -> Self {
        let root = Path::new(MOUNT).join("results/small");
        let prepared = FaultyDisk::new();
        if let Before::KilledRun = scenario.before {
            prepared.arm(Operation::Rename, RENAMES_BEFORE_THE_KILL, Fault::Killed);
        }
        let ended_before = match scenario.before {
            Before::Nothing => None,
            before => Some(attempt(
                &Layout::new(&prepared, &root),
                &FIRST_RUN,
                matches!(before, Before::FailingRun),
            )),
        };
        assert_eq!(
            prepared.reboot(),
            ended_before.is_some_and(|ended| ended.is_err())
        );
        let good = prepared.copy();
        attempt(&Layout::new(&good, &root), &scenario, false).unwrap();
        let (before, after) = (prepared.files(&root), good.files(&root));
        assert!(
            after
                .keys()
                .filter(|path| path.starts_with("tables/jobs"))
                .count()
                >= 2,
            "{:?}",
            after.keys()
        );
        Self {
            scenario,
            root,
            prepared,
            before,
            after,
        }
    }

    /// Goes through with a fault at the n-th operation of a kind; `false` if there are fewer.
    fn befalls(&self, operation: Operation, n: usize, fault: Fault) -> bool {
        let disk = self.prepared.copy();
        disk.arm(operation, n, fault);
        let ended = attempt(&Layout::new(&disk, &self.root), &self.scenario, false);
        if !disk.reboot() {
            assert!(ended.is_ok(), "{ended:?}");
            return false;
        }
        let case = format!(
            "{}: {fault:?} at {operation:?} {n}, {ended:?}",
            self.scenario.name
        );
        let left = disk.files(&self.root);
        match fault {
            Fault::ShortWrite => assert!(ended.is_ok(), "{case}"),
            Fault::Killed | Fault::PowerCut | Fault::PowerCutTorn => {}
            _ => assert!(
                ended.is_err() || results(&left) == results(&self.after),
                "{case}"
            ),
        }
        // Nothing was damaged, so no message may say to move files away.
        assert!(
            !ended.is_err_and(|error| error.contains("damaged")),
            "{case}"
        );
        self.is_whole(&left, &case);
        self.resumes(&disk, &left, &case);

        // What a run reported as done survives a power cut, whatever happened before it.
        attempt(&Layout::new(&disk, &self.root), &self.scenario, false).expect(&case);
        disk.cut_power();
        assert!(
            results(&disk.files(&self.root)) == results(&self.after),
            "{case}: resumed, then a power cut"
        );
        true
    }

    /// What is there is whole, and no table that was there is lost.
    fn is_whole(&self, left: &BTreeMap<PathBuf, Vec<u8>>, case: &str) {
        let is_data = |path: &Path| path.starts_with("tables") || path.starts_with("reduced");
        for (path, bytes) in left.iter().filter(|(path, _)| is_data(path)) {
            let known = [self.before.get(path), self.after.get(path)];
            assert!(known.contains(&Some(bytes)), "{case}: {}", path.display());
        }
        // What a killed run left of a part that is not done may go.
        let jobs = |path: &Path| Path::new("tables/jobs").join(path.file_name().unwrap());
        let tables = self.before.keys().filter(|path| path.starts_with("tables"));
        let mut done = tables.filter(|path| self.before.contains_key(&jobs(path)));
        assert!(done.all(|path| left.contains_key(path)), "{case}");
    }

    /// The same command with the real storage resumes, runs nothing twice, and ends with the same bytes.
    fn resumes(&self, disk: &FaultyDisk, left: &BTreeMap<PathBuf, Vec<u8>>, case: &str) {
        // Where syncs cost nothing, if there is such a place.
        let folder = tempfile::tempdir_in("/dev/shm")
            .or_else(|_| tempfile::tempdir())
            .unwrap();
        let real = folder.path().join("small");
        for path in disk.folders(&self.root) {
            fs::create_dir_all(real.join(path)).unwrap();
        }
        for (path, bytes) in left {
            fs::write(real.join(path), bytes).unwrap();
        }
        let done = committed_jobs(&real);
        let report = attempt(&Layout::new(&Disk, &real), &self.scenario, false).expect(case);
        let jobs_run = committed_jobs(&real) - done;
        assert_eq!(
            (report.jobs_run, report.jobs_failed, report.jobs_left),
            (jobs_run, 0, 0),
            "{case}"
        );
        assert!(
            results(&files_below(&real)) == results(&self.after),
            "{case}: resumed with the real store"
        );
        assert!(
            Disk.list(&real.join("run/staging/shard-1-of-1"))
                .unwrap()
                .is_empty(),
            "{case}"
        );
    }
}

/// In any order. Not on threads of rayon: while a run waits there for its own, they would begin the next within it.
fn on_all_cores<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let take = || {
        let items = iter::from_fn(|| items.get(next.fetch_add(1, Ordering::Relaxed)));
        items.map(&work).collect::<Vec<R>>()
    };
    thread::scope(|scope| {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(take)).collect();
        let found = threads.into_iter().map(|thread| thread.join().unwrap());
        found.flatten().collect()
    })
}

#[test]
fn every_fault_at_every_operation_leaves_whole_files_and_the_next_run_ends_with_the_same_bytes() {
    let trials: Vec<Trial> = on_all_cores(&SCENARIOS, |scenario| Trial::new(*scenario));
    let mut threats = Vec::new();
    for trial in &trials {
        for operation in Operation::ALL {
            let faults = Fault::ALL.into_iter();
            let faults = faults.filter(|fault| fault.befalls(operation));
            threats.extend(faults.map(|fault| (trial, operation, fault)));
        }
    }
    let count = |&(trial, operation, fault): &(&Trial, Operation, Fault)| {
        let times = (0..).take_while(|n| trial.befalls(operation, *n, fault));
        ((operation, fault), times.count())
    };
    let counts = on_all_cores(&threats, count);
    let mut tried = BTreeMap::new();
    for (pair, count) in counts {
        *tried.entry(pair).or_default() += count;
    }
    assert!(
        tried.values().all(|&count| count > 0),
        "a fault that can befall an operation was not tried: {tried:?}"
    );
    let total: usize = tried.values().sum();
    let page = include_str!("../../../docs/development.md");
    assert!(
        page.contains(&format!(" {total} faults")),
        "docs/development.md has another number: {total}, {tried:?}"
    );
}
