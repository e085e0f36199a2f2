//! Exit codes, and which error ends with which.

use stickslip::reduce::ReduceError;
use stickslip::results::compact::CompactError;
use stickslip::results::manifest::DirectoryError;
use stickslip::results::verify::RepairError;
use stickslip::run::{RunError, UpkeepError};
use stickslip::solver::SimulationError;
use stickslip::sweep::SweepError;
use stickslip::table::file::DatasetError;

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All is done.
    Done = 0,
    /// Jobs failed.
    Failed = 1,
    /// The command line, a sweep file or a directory does not fit.
    Usage = 2,
    /// Stopped early; the same command goes on.
    Stopped = 3,
    /// Data are damaged.
    Damaged = 4,
}

/// A mistake on the command line that the flags' own parser cannot see.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct UsageError(pub String);

impl Exit {
    /// The code for an error: by the first cause that says whose fault it is; a disk that fails can be resumed from.
    pub fn of(error: &anyhow::Error) -> Self {
        error.chain().find_map(Self::of_cause).unwrap_or(Self::Stopped)
    }

    fn of_cause(cause: &(dyn std::error::Error + 'static)) -> Option<Self> {
        if cause.is::<UsageError>() || cause.is::<SweepError>() {
            return Some(Self::Usage);
        }
        if let Some(error) = cause.downcast_ref::<SimulationError>() {
            return Some(match error {
                SimulationError::UnstableStep { .. } | SimulationError::BadTolerance { .. } => Self::Usage,
                SimulationError::Interrupted { .. } => Self::Stopped,
                _ => Self::Failed,
            });
        }
        if let Some(error) = cause.downcast_ref::<RunError>() {
            return match error {
                RunError::Directory(error) => Self::of_cause(error),
                RunError::Dataset(error) => Self::of_cause(error),
                RunError::Upkeep(error) => Self::of_cause(error),
                RunError::Locked { .. } | RunError::Threads { .. } => Some(Self::Usage),
                RunError::Storage(_) => None,
            };
        }
        if let Some(error) = cause.downcast_ref::<UpkeepError>() {
            return match error {
                UpkeepError::Directory(error) | UpkeepError::Repair(RepairError::Directory(error)) => {
                    Self::of_cause(error)
                }
                UpkeepError::Compact(error) | UpkeepError::Repair(RepairError::Compact(error)) => Self::of_cause(error),
                UpkeepError::Repair(RepairError::Storage(_)) | UpkeepError::Storage(_) => None,
                UpkeepError::Running { .. } | UpkeepError::Busy(_) => Some(Self::Usage),
                UpkeepError::Damaged { .. } => Some(Self::Damaged),
            };
        }
        if let Some(error) = cause.downcast_ref::<CompactError>() {
            return match error {
                CompactError::Dataset(error) => Self::of_cause(error),
                CompactError::NoExchange(_) => Some(Self::Usage),
                CompactError::Storage(_) => None,
            };
        }
        if let Some(error) = cause.downcast_ref::<ReduceError>() {
            return match error {
                ReduceError::Dataset(error) => Self::of_cause(error),
                ReduceError::NoJobs { .. } => Some(Self::Usage),
                ReduceError::Storage(_) => None,
            };
        }
        if let Some(error) = cause.downcast_ref::<DirectoryError>() {
            return match error {
                DirectoryError::Damaged { .. } | DirectoryError::Sweep(_) => Some(Self::Damaged),
                DirectoryError::Dataset(error) => Self::of_cause(error),
                DirectoryError::Storage(_) | DirectoryError::Busy(_) => None,
                _ => Some(Self::Usage),
            };
        }
        match cause.downcast_ref::<DatasetError>() {
            Some(DatasetError::Damaged { .. } | DatasetError::Stray { .. }) => Some(Self::Damaged),
            _ => None,
        }
    }
}
