//! Exit codes, and which error ends with which.

use crate::figure::BadOption;
use crate::reduce::NoJobs;
use crate::results::{ErrorKind, ResultsError};
use crate::run::threads::ThreadsError;
use crate::solver::SimulationError;
use crate::sweep::SweepError;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    Done = 0,
    Failed = 1,
    /// The command line, a sweep file or a directory does not fit.
    Usage = 2,
    /// Stopped early; the same command resumes.
    Stopped = 3,
    Damaged = 4,
}

/// A mistake on the command line that the flags' own parser cannot see.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

impl Exit {
    /// The code for an error: by the first cause that says whose fault it is; a disk that fails can be resumed from.
    pub fn of(error: &anyhow::Error) -> Self {
        error
            .chain()
            .find_map(Self::of_cause)
            .unwrap_or(Self::Stopped)
    }

    fn of_cause(cause: &(dyn std::error::Error + 'static)) -> Option<Self> {
        let is_usage =
            cause.is::<UsageError>() || cause.is::<BadOption>() || cause.is::<ThreadsError>();
        if is_usage || cause.is::<SweepError>() || cause.is::<NoJobs>() {
            return Some(Self::Usage);
        }
        if let Some(error) = cause.downcast_ref::<SimulationError>() {
            return Some(match error {
                SimulationError::BadSetting { .. } => Self::Usage,
                SimulationError::Interrupted { .. } => Self::Stopped,
                _ => Self::Failed,
            });
        }
        match cause.downcast_ref::<ResultsError>()?.kind {
            ErrorKind::Refused | ErrorKind::Busy => Some(Self::Usage),
            ErrorKind::Damaged => Some(Self::Damaged),
            ErrorKind::Disk(_) | ErrorKind::Stopped => None,
        }
    }
}
