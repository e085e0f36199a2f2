//! The number of threads: by the flag, by what a batch system grants, or all cores.

use super::exit::UsageError;
use std::ffi::OsString;
use std::num::NonZeroUsize;
use stickslip::table::shown::shown;

/// Variables that hold the cores of a job, the most specific first: Slurm, OpenMP and HyperQueue, PBS, Grid Engine, LSF.
/// `HQ_CPUS` is not among them: it lists the cores by their ids.
const VARIABLES: [&str; 5] = ["SLURM_CPUS_PER_TASK", "OMP_NUM_THREADS", "NCPUS", "NSLOTS", "LSB_DJOB_NUMPROC"];

/// How many threads, and who said so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threads {
    /// `None`: one for each core.
    pub count: Option<NonZeroUsize>,
    /// The variable that they are from.
    pub variable: Option<&'static str>,
}

impl Threads {
    /// Those of the flag, else of the first variable that is set, else all cores.
    pub fn choose(
        flag: Option<NonZeroUsize>,
        environment: impl Fn(&str) -> Option<OsString>,
    ) -> Result<Self, UsageError> {
        let granted = |variable| Some((variable, environment(variable).filter(|value| !value.is_empty())?));
        let Some((variable, value)) = VARIABLES.into_iter().find_map(granted).filter(|_| flag.is_none()) else {
            return Ok(Self { count: flag, variable: None });
        };
        // OpenMP's may be a list, of one number for each level of nesting.
        let count = value.to_str().and_then(|value| value.split(',').next()?.trim().parse().ok());
        let count = count.ok_or_else(|| {
            let value = shown(value.as_ref());
            UsageError(format!("{variable}={value}: must be a whole number >= 1; unset it, or give --threads"))
        })?;
        Ok(Self { count: Some(count), variable: Some(variable) })
    }
}

/// The value of `--threads`.
pub fn parse(text: &str) -> Result<NonZeroUsize, &'static str> {
    text.parse().map_err(|_| "must be a whole number >= 1")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choose(flag: Option<usize>, environment: &[(&str, &str)]) -> Result<Threads, UsageError> {
        let value = |name: &str| environment.iter().find(|(key, _)| *key == name).map(|(_, value)| value.into());
        Threads::choose(flag.map(|count| NonZeroUsize::new(count).unwrap()), value)
    }

    fn threads(count: usize, variable: Option<&'static str>) -> Threads {
        Threads { count: NonZeroUsize::new(count), variable }
    }

    #[test]
    fn the_flag_comes_before_the_environment_and_that_before_all_cores() {
        let slurm = ("SLURM_CPUS_PER_TASK", "16");
        let openmp = ("OMP_NUM_THREADS", "4,2");
        assert_eq!(choose(Some(3), &[slurm]).unwrap(), threads(3, None));
        assert_eq!(choose(Some(3), &[("NCPUS", "many")]).unwrap(), threads(3, None));
        assert_eq!(choose(None, &[openmp, slurm]).unwrap(), threads(16, Some("SLURM_CPUS_PER_TASK")));
        assert_eq!(choose(None, &[("NSLOTS", "8"), openmp]).unwrap(), threads(4, Some("OMP_NUM_THREADS")));
        assert_eq!(choose(None, &[("OMP_NUM_THREADS", ""), ("NCPUS", "2")]).unwrap(), threads(2, Some("NCPUS")));
        assert_eq!(choose(None, &[("HQ_CPUS", "0,1,7")]).unwrap(), threads(0, None));
    }

    #[test]
    fn a_bad_variable_is_named_with_its_value() {
        for value in ["0", "-1", "many", "1.5", "2(x3)"] {
            let error = choose(None, &[("LSB_DJOB_NUMPROC", value)]).unwrap_err().to_string();
            assert!(error.starts_with(&format!("LSB_DJOB_NUMPROC={value}: must be a whole number >= 1")), "{error}");
        }
    }
}
