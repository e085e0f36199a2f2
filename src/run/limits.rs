//! What a run may take of its machine: threads, memory and time.
//!
//! The number of threads is as asked for, as a batch system grants, or one for each core.
//!
//! Walltime: no part is taken when less time is left than the longest part took so far, until it was committed. A part
//! that takes longer is interrupted at the end, and its finished jobs are kept.

use crate::sweep::LARGE;
use crate::table::shown::{shown, shown_bytes};
use std::cell::Cell;
use std::ffi::OsString;
use std::fs;
use std::num::NonZeroUsize;
use std::path::Path;
use std::time::{Duration, Instant};

/// Variables that hold the cores of a job, the most specific first: Slurm, OpenMP and HyperQueue, PBS, Grid Engine,
/// LSF. `HQ_CPUS` is not among them: it lists the cores by their ids.
const VARIABLES: [&str; 5] = [
    "SLURM_CPUS_PER_TASK",
    "OMP_NUM_THREADS",
    "NCPUS",
    "NSLOTS",
    "LSB_DJOB_NUMPROC",
];

/// Most threads of one process. Starting more would take minutes, in which no signal stops a run.
pub const MAX_THREADS: usize = 1024;

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ThreadsError(String);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Threads {
    /// `None`: one for each core.
    pub count: Option<NonZeroUsize>,
    /// The environment variable that it is from.
    pub variable: Option<&'static str>,
}

impl Threads {
    /// As many as `asked`, else as the first variable that is set says, else one for each core.
    pub fn choose(
        asked: Option<NonZeroUsize>,
        environment: impl Fn(&str) -> Option<OsString>,
    ) -> Result<Self, ThreadsError> {
        if let Some(asked) = asked {
            let count = parse_threads(&asked.to_string())
                .map_err(|must| ThreadsError(format!("{asked} threads: {must}")))?;
            return Ok(Self {
                count: Some(count),
                variable: None,
            });
        }
        for variable in VARIABLES {
            let Some(value) = environment(variable).filter(|value| !value.is_empty()) else {
                continue;
            };
            // OpenMP's may be a list, with one number for each level of nesting.
            let first = value.to_str().and_then(|value| value.split(',').next());
            let count = parse_threads(first.unwrap_or_default().trim()).map_err(|must| {
                let value = shown(value.as_ref());
                ThreadsError(format!(
                    "{variable}={value}: {must}; unset it, or give --threads"
                ))
            })?;
            return Ok(Self {
                count: Some(count),
                variable: Some(variable),
            });
        }
        Ok(Self::default())
    }
}

/// So many threads, or one for each core.
pub fn or_all_cores(count: Option<NonZeroUsize>) -> usize {
    count
        .or_else(|| std::thread::available_parallelism().ok())
        .map_or(1, NonZeroUsize::get)
}

pub fn parse_threads(text: &str) -> Result<NonZeroUsize, String> {
    match text.parse::<NonZeroUsize>() {
        Ok(count) if count.get() <= MAX_THREADS => Ok(count),
        _ => Err(format!("must be a whole number from 1 to {MAX_THREADS}")),
    }
}

/// CPU seconds of the calling thread that a computation takes, and its result.
pub fn timed<T>(compute: impl FnOnce() -> T) -> (f64, T) {
    let used = || {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
    };
    let start = used();
    let result = compute();
    (used() - start, result)
}

const KILOBYTE: f64 = 1024.0;
/// Bytes that a worker takes beside its jobs, for the program, commits and the reduction: measured, rounded up.
pub const OF_A_WORKER: f64 = 80e6;
/// What the program has of these when a run begins.
const AT_FIRST: f64 = 30e6;
/// Address space of a thread: its stack, and the arena of 64 MiB that the C library reserves for it.
const OF_A_THREAD: f64 = 68e6;
/// Of this, what counts as data.
const DATA_OF_A_THREAD: f64 = 8e6;

/// Most address space that a worker takes beside large jobs, in bytes. The thread of its beats has an arena, too.
pub fn address_space(threads: usize) -> f64 {
    OF_A_WORKER + OF_A_THREAD * (threads + 1) as f64
}

/// Refuses threads for which hard limits leave too little. The C library ends a program whose allocation fails, so this
/// is asked before.
pub fn check_threads(threads: usize) -> Result<(), ThreadsError> {
    let [address_space_left, data_left] = left();
    let data = OF_A_WORKER + DATA_OF_A_THREAD * threads as f64;
    for (what, flag, most, left) in [
        (
            "address space",
            "-v",
            address_space(threads),
            address_space_left,
        ),
        ("data", "-d", data, data_left),
    ] {
        if left < most - AT_FIRST {
            return Err(ThreadsError(format!(
                "too little memory: --threads {threads} may take {} more of {what}, `ulimit {flag}` leaves {}; take \
                 fewer threads, or raise the limit",
                shown_bytes(most - AT_FIRST),
                shown_bytes(left)
            )));
        }
    }
    Ok(())
}

/// Bytes that hard limits leave of the address space, and of data; infinite if unknown.
fn left() -> [f64; 2] {
    let limits = text_of("/proc/self/limits");
    let status = text_of("/proc/self/status");
    [
        ("Max address space", "VmSize:"),
        ("Max data size", "VmData:"),
    ]
    .map(|(limit, taken)| {
        let taken = KILOBYTE * number_after(&status, taken).unwrap_or(0.0);
        number_after(&limits, limit).map_or(f64::INFINITY, |limit| (limit - taken).max(0.0))
    })
}

/// Bytes that hard limits leave for jobs: of control groups, of the address space and of data; infinite if unknown.
pub(super) fn allowed_memory() -> f64 {
    let in_groups = of_groups(&text_of("/proc/self/cgroup"), Path::new("/sys/fs/cgroup"));
    left().into_iter().fold(in_groups, f64::min)
}

/// Bytes that this process has or could get now without taking them from others; infinite if unknown.
pub(super) fn available_memory() -> f64 {
    let free = number_after(&text_of("/proc/meminfo"), "MemAvailable:");
    let own = number_after(&text_of("/proc/self/status"), "VmRSS:");
    free.zip(own)
        .map_or(f64::INFINITY, |(free, own)| KILOBYTE * (free + own))
}

/// Memory of a job beside its threads. A small job fits into what is reserved for its thread.
pub(super) fn beside_threads(job: f64, threads: usize) -> f64 {
    if job < LARGE {
        job
    } else {
        job + OF_A_THREAD * threads as f64
    }
}

fn text_of(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

fn number_after(text: &str, key: &str) -> Option<f64> {
    let value = text.lines().find_map(|line| line.strip_prefix(key))?;
    value.split_whitespace().next()?.parse().ok()
}

/// The least limit of the control groups and of all above them. A container may show its own group as the topmost.
fn of_groups(groups: &str, mount: &Path) -> f64 {
    let mut least = f64::INFINITY;
    for group in groups.lines() {
        let mut fields = group.splitn(3, ':').skip(1);
        let controllers = fields.next().unwrap_or_default();
        let path = fields.next().unwrap_or_default().trim_start_matches('/');
        let (top, file) = if controllers.is_empty() {
            (mount.to_owned(), "memory.max")
        } else if controllers.split(',').any(|name| name == "memory") {
            (mount.join("memory"), "memory.limit_in_bytes")
        } else {
            continue;
        };
        let limits = Path::new(path).ancestors().filter_map(|above| {
            let text = fs::read_to_string(top.join(above).join(file)).ok()?;
            text.trim().parse::<f64>().ok()
        });
        least = limits.fold(least, f64::min);
    }
    least
}

/// Least time set aside for the last commits and for the end of the program.
const MIN_RESERVE: Duration = Duration::from_millis(500);
/// More is set aside where commits are slow: this many times the slowest.
const COMMITS_IN_RESERVE: u32 = 3;

pub(super) struct Walltime {
    /// When the run must have ended; `None`: at any time.
    end: Option<Instant>,
    longest_part: Cell<Duration>,
    slowest_commit: Cell<Duration>,
    has_refused: Cell<bool>,
}

impl Walltime {
    /// Of a run that began at `begin` and may last `longest`.
    pub fn new(begin: Instant, longest: Option<Duration>) -> Self {
        // A time beyond what the clock holds never comes.
        let end = longest.and_then(|longest| begin.checked_add(longest));
        Self {
            end,
            longest_part: Cell::default(),
            slowest_commit: Cell::default(),
            has_refused: Cell::default(),
        }
    }

    /// Whether another part may be taken. Once it may not, none may.
    pub fn admits_part(&self) -> bool {
        let is_short = |left: Duration| left.is_zero() || left < self.longest_part.get();
        self.has_refused
            .update(|has_refused| has_refused || self.left().is_some_and(is_short));
        !self.has_refused.get()
    }

    /// Whether a part was left for lack of time.
    pub fn has_refused(&self) -> bool {
        self.has_refused.get()
    }

    /// A part was committed: how long it took, and its commit alone.
    pub fn committed(&self, part: Duration, commit: Duration) {
        self.longest_part.update(|longest| longest.max(part));
        self.slowest_commit.update(|slowest| slowest.max(commit));
    }

    /// Whether running jobs must be interrupted.
    pub fn is_over(&self) -> bool {
        self.left().is_some_and(|left| left.is_zero())
    }

    /// Time left, without the reserve.
    fn left(&self) -> Option<Duration> {
        let reserve = MIN_RESERVE.max(COMMITS_IN_RESERVE * self.slowest_commit.get());
        let left = self.end?.saturating_duration_since(Instant::now());
        Some(left.saturating_sub(reserve))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choose(asked: Option<usize>, environment: &[(&str, &str)]) -> Result<Threads, ThreadsError> {
        let value = |name: &str| {
            environment
                .iter()
                .find(|(key, _)| *key == name)
                .map(|(_, value)| value.into())
        };
        Threads::choose(asked.map(|count| NonZeroUsize::new(count).unwrap()), value)
    }

    fn threads(count: usize, variable: Option<&'static str>) -> Threads {
        Threads {
            count: NonZeroUsize::new(count),
            variable,
        }
    }

    #[test]
    fn what_is_asked_for_comes_before_the_environment_and_that_before_all_cores() {
        let slurm = ("SLURM_CPUS_PER_TASK", "16");
        let openmp = ("OMP_NUM_THREADS", "4,2");
        assert_eq!(choose(Some(3), &[slurm]).unwrap(), threads(3, None));
        assert_eq!(
            choose(Some(3), &[("NCPUS", "many")]).unwrap(),
            threads(3, None)
        );
        assert_eq!(
            choose(None, &[openmp, slurm]).unwrap(),
            threads(16, Some("SLURM_CPUS_PER_TASK"))
        );
        assert_eq!(
            choose(None, &[("NSLOTS", "8"), openmp]).unwrap(),
            threads(4, Some("OMP_NUM_THREADS"))
        );
        assert_eq!(
            choose(None, &[("OMP_NUM_THREADS", ""), ("NCPUS", "2")]).unwrap(),
            threads(2, Some("NCPUS"))
        );
        assert_eq!(
            choose(None, &[("HQ_CPUS", "0,1,7")]).unwrap(),
            threads(0, None)
        );
    }

    #[test]
    fn too_many_threads_are_refused_from_flags_and_from_python() {
        assert_eq!(choose(Some(1024), &[]).unwrap(), threads(1024, None));
        for count in [1025, 1 << 62] {
            let error = choose(Some(count), &[]).unwrap_err().to_string();
            assert_eq!(
                error,
                format!("{count} threads: must be a whole number from 1 to 1024")
            );
            assert!(parse_threads(&count.to_string()).is_err());
        }
    }

    #[test]
    fn a_bad_variable_is_named_with_its_value() {
        for value in ["0", "-1", "many", "1.5", "2(x3)", "1025", "99999999"] {
            let error = choose(None, &[("LSB_DJOB_NUMPROC", value)])
                .unwrap_err()
                .to_string();
            assert!(
                error.starts_with(&format!(
                    "LSB_DJOB_NUMPROC={value}: must be a whole number from 1 to 1024"
                )),
                "{error}"
            );
        }
    }

    #[test]
    fn a_thread_that_sleeps_uses_no_processor_time() {
        let (asleep, ()) = timed(|| std::thread::sleep(std::time::Duration::from_millis(30)));
        let (busy, sum) =
            timed(|| (0..3_000_000).fold(0.0_f64, |sum, i| (sum + f64::from(i)).sqrt()));
        assert!(asleep < 0.02, "{asleep}");
        assert!(busy > 0.0 && sum > 0.0);
    }

    #[test]
    fn the_least_limit_of_all_control_groups_counts_and_none_is_no_limit() {
        let mount = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = mount.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let limit = |groups: &str| of_groups(groups, mount.path());
        let second = "0::/slurm/job_7/step_0\n";
        assert_eq!(limit(second), f64::INFINITY);
        write("slurm/job_7/step_0/memory.max", "max\n");
        assert_eq!(limit(second), f64::INFINITY);
        write("slurm/job_7/memory.max", "2000000000\n");
        assert_eq!(limit(second), 2e9);
        write("memory.max", "1500000000\n");
        assert_eq!(limit(second), 1.5e9);
        let first = "3:cpuset:/other\n4:memory,hugetlb:/job/7\n";
        assert_eq!(limit(first), f64::INFINITY);
        write("memory/job/memory.limit_in_bytes", "9223372036854771712\n");
        assert_eq!(limit(first), 9_223_372_036_854_771_712.0);
        write("memory/memory.limit_in_bytes", "1000000000\n");
        assert_eq!(limit(&format!("{first}{second}")), 1e9);
    }

    #[test]
    fn limits_and_fields_are_read_and_unlimited_is_no_number() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
              Max data size             unlimited            unlimited            bytes     \n\
              Max address space         1536000000           unlimited            bytes     \n";
        assert_eq!(number_after(limits, "Max address space"), Some(1.536e9));
        assert_eq!(number_after(limits, "Max data size"), None);
        assert_eq!(
            number_after("MemAvailable:   23506 kB\n", "MemAvailable:"),
            Some(23_506.0)
        );
        assert!(allowed_memory() > 0.0 && available_memory() > 0.0);
    }

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn no_part_is_taken_when_less_time_is_left_than_the_longest_took() {
        let walltime = Walltime::new(Instant::now(), Some(100 * SECOND));
        walltime.committed(90 * SECOND, SECOND);
        walltime.committed(2 * SECOND, SECOND);
        assert!(walltime.admits_part() && !walltime.has_refused());
        walltime.committed(98 * SECOND, SECOND);
        assert!(!walltime.admits_part() && walltime.has_refused() && !walltime.is_over());
    }

    #[test]
    fn time_is_set_aside_for_commits() {
        let walltime = Walltime::new(Instant::now(), Some(100 * SECOND));
        walltime.committed(SECOND, 33 * SECOND);
        assert!(!walltime.is_over());
        walltime.committed(SECOND, 34 * SECOND);
        assert!(walltime.is_over() && !walltime.admits_part());
    }

    #[test]
    fn without_a_walltime_every_part_is_taken() {
        for longest in [None, Some(Duration::MAX)] {
            let walltime = Walltime::new(Instant::now(), longest);
            walltime.committed(1000 * SECOND, 1000 * SECOND);
            assert!(walltime.admits_part() && !walltime.is_over());
        }
    }
}
