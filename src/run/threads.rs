//! Threads: their number, as asked for, as a batch system grants, or all cores; and their CPU time.

use crate::table::shown::shown;
use std::ffi::OsString;
use std::num::NonZeroUsize;

/// Variables that hold the cores of a job, the most specific first: Slurm, OpenMP and HyperQueue, PBS, Grid Engine, LSF.
/// `HQ_CPUS` is not among them: it lists the cores by their ids.
const VARIABLES: [&str; 5] = [
    "SLURM_CPUS_PER_TASK",
    "OMP_NUM_THREADS",
    "NCPUS",
    "NSLOTS",
    "LSB_DJOB_NUMPROC",
];

/// Most threads of one process. Starting more would take minutes, in which no signal stops a run.
pub const MAX_THREADS: usize = 1024;

/// A bad number of threads.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ThreadsError(String);

/// A number of threads, and where it is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
            let count = parse(&asked.to_string());
            let count = count.map_err(|must| ThreadsError(format!("{asked} threads: {must}")))?;
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
            let count = parse(first.unwrap_or_default().trim()).map_err(|must| {
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
        Ok(Self {
            count: None,
            variable: None,
        })
    }
}

/// So many threads, or one for each core.
pub fn or_all_cores(count: Option<NonZeroUsize>) -> usize {
    count
        .or_else(|| std::thread::available_parallelism().ok())
        .map_or(1, NonZeroUsize::get)
}

/// A number of threads, as a flag has it.
pub fn parse(text: &str) -> Result<NonZeroUsize, String> {
    let count = text
        .parse()
        .ok()
        .filter(|count: &NonZeroUsize| count.get() <= MAX_THREADS);
    count.ok_or_else(|| format!("must be a whole number from 1 to {MAX_THREADS}"))
}

/// CPU time that the calling thread has used since some instant, in s.
pub fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// CPU seconds of the calling thread that a computation takes, and its result.
pub fn timed<T>(compute: impl FnOnce() -> T) -> (f64, T) {
    let start = thread_seconds();
    let result = compute();
    (thread_seconds() - start, result)
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
            assert!(parse(&count.to_string()).is_err());
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
}
