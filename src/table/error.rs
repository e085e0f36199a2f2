//! Why a results directory, or a file of it, cannot be used, written or changed: where, what, and the way out.

use crate::table::shown::{shown, shown_text};
use crate::table::storage::StorageError;
use parquet::errors::ParquetError;
use std::error::Error;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// What was asked for does not fit the directory. Nothing was changed.
    Refused,
    /// Another process has the directory, or a share of it. Nothing was changed.
    Busy,
    /// A signal stopped this process, or others have taken over its work.
    Stopped,
    /// A file is not as it was written: cut off, changed or no table.
    Damaged,
    /// A file operation failed, which says nothing about what the file holds; what was committed is kept, and the same
    /// can be tried again.
    Disk(io::ErrorKind),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResultsError {
    pub kind: ErrorKind,
    pub path: PathBuf,
    /// What is wrong with it, and the way out where the kind does not say it.
    pub problem: String,
}

impl ResultsError {
    pub(crate) fn new(kind: ErrorKind, path: &Path, problem: impl fmt::Display) -> Self {
        Self {
            kind,
            path: path.to_owned(),
            problem: problem.to_string(),
        }
    }

    pub fn refused(path: &Path, problem: impl fmt::Display) -> Self {
        Self::new(ErrorKind::Refused, path, problem)
    }

    pub fn damaged(path: &Path, problem: impl fmt::Display) -> Self {
        Self::new(ErrorKind::Damaged, path, problem)
    }

    /// For `map_err`: what was found in a file.
    pub fn damage_at<E: fmt::Display>(path: &Path) -> impl FnOnce(E) -> Self {
        move |problem| Self::damaged(path, problem)
    }

    /// For `map_err`: why a file of the directory cannot be read. If it is not a regular file, it is damaged.
    pub fn of_reading(error: StorageError) -> Self {
        if error.is_no_file() {
            Self::damaged(&error.path, error.source)
        } else {
            error.into()
        }
    }

    /// For `map_err`: why a file cannot be written.
    pub(super) fn unwritten(path: &Path) -> impl FnOnce(ParquetError) -> Self {
        move |error| {
            let kind = ErrorKind::Disk(io::ErrorKind::Other);
            Self::new(kind, path, format!("cannot be written: {error}"))
        }
    }

    /// Of a file that must be there: its path and what is wrong with it, as far as that is known.
    /// An error of the disk stays one: what cannot be read is not damaged.
    pub fn damage(self) -> Result<(PathBuf, String), Self> {
        match self.kind {
            ErrorKind::Damaged => Ok((self.path, self.problem)),
            ErrorKind::Disk(io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                Ok((self.path, "it is missing".to_owned()))
            }
            _ => Err(self),
        }
    }
}

impl fmt::Display for ResultsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = shown(&self.path);
        match self.kind {
            ErrorKind::Damaged => write!(
                f,
                "{path}: damaged: {}; `stickslip verify` on the results directory reports how to repair it",
                shown_text(&self.problem)
            ),
            _ => write!(f, "{path}: {}", self.problem),
        }
    }
}

impl Error for ResultsError {}

impl From<StorageError> for ResultsError {
    fn from(error: StorageError) -> Self {
        let problem = format!("cannot {}: {}", error.action, error.source);
        Self::new(ErrorKind::Disk(error.kind()), &error.path, problem)
    }
}
