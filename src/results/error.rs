//! Why a results directory cannot be used or changed: where, what, and the way out.

use crate::table::file::DatasetError;
use crate::table::shown::{shown, shown_text};
use crate::table::storage::StorageError;
use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

/// Whose fault an error is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// What was asked for does not fit the directory. Nothing was changed.
    Refused,
    /// Another process has the directory, or a share of it. Nothing was changed.
    Busy,
    /// Others have taken over the work of this process.
    Stopped,
    /// A file is not as it was written.
    Damaged,
    /// A file operation failed; what was committed is kept, and the same can be tried again.
    Disk,
}

/// A results directory that cannot be used or changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResultsError {
    pub kind: ErrorKind,
    /// The file or the directory.
    pub path: PathBuf,
    /// What is wrong with it, and the way out where the kind does not say it.
    pub problem: String,
}

impl ResultsError {
    pub(super) fn new(kind: ErrorKind, path: &Path, problem: impl Into<String>) -> Self {
        Self { kind, path: path.to_owned(), problem: problem.into() }
    }

    /// What was asked for does not fit.
    pub fn refused(path: &Path, problem: impl Into<String>) -> Self {
        Self::new(ErrorKind::Refused, path, problem)
    }

    /// It is not as it was written.
    pub fn damaged(path: &Path, problem: impl Into<String>) -> Self {
        Self::new(ErrorKind::Damaged, path, problem)
    }
}

impl fmt::Display for ResultsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, path, problem } = self;
        let path = shown(path);
        match kind {
            ErrorKind::Damaged => write!(
                f,
                "{path}: damaged: {}; `stickslip verify` on the results directory reports how to repair it",
                shown_text(problem)
            ),
            _ => write!(f, "{path}: {problem}"),
        }
    }
}

impl Error for ResultsError {}

impl From<StorageError> for ResultsError {
    fn from(error: StorageError) -> Self {
        Self::new(ErrorKind::Disk, &error.path, format!("cannot {}: {}", error.action, error.source))
    }
}

impl From<DatasetError> for ResultsError {
    fn from(error: DatasetError) -> Self {
        match error {
            DatasetError::Storage(error) => error.into(),
            DatasetError::Write { path, source } => {
                Self::new(ErrorKind::Disk, &path, format!("cannot be written: {source}"))
            }
            DatasetError::Damaged { path, problem } => Self::damaged(&path, problem),
            DatasetError::Stray { path } => {
                Self::damaged(&path, "it is no table file, and a table folder may hold nothing else; move it away")
            }
        }
    }
}
