//! Why a table file cannot be written or read.

use crate::table::shown::{shown, shown_text};
use crate::table::storage::StorageError;
use parquet::errors::ParquetError;
use std::path::{Path, PathBuf};

/// A table file that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// A file operation failed, which says nothing about what the file holds.
    #[error(transparent)]
    Storage(StorageError),
    #[error("{}: cannot be written: {source}", shown(path))]
    Write { path: PathBuf, source: ParquetError },
    /// A file is cut off, changed or no table.
    #[error(
        "{}: damaged: {}; `stickslip verify` on its results directory reports how to repair it",
        shown(path),
        shown_text(problem)
    )]
    Damaged { path: PathBuf, problem: String },
    /// Something else lies among the files of a table.
    #[error("{}: is no table file, and a table folder may hold nothing else; move it away", shown(path))]
    Stray { path: PathBuf },
}

impl From<StorageError> for DatasetError {
    fn from(error: StorageError) -> Self {
        if error.is_no_file() {
            Self::Damaged { path: error.path, problem: error.source.to_string() }
        } else {
            Self::Storage(error)
        }
    }
}

impl DatasetError {
    /// Of a file that must be there: what is wrong with it, as far as that is known.
    /// An error of the disk stays one: what cannot be read is not damaged.
    pub fn damage(self) -> Result<(PathBuf, String), Self> {
        match self {
            Self::Damaged { path, problem } => Ok((path, problem)),
            Self::Storage(error) if error.is_missing() => Ok((error.path, "it is missing".to_owned())),
            error => Err(error),
        }
    }

    /// For `map_err`: why a file cannot be written.
    pub(super) fn unwritten(path: &Path) -> impl FnOnce(ParquetError) -> Self {
        move |source| Self::Write { path: path.to_owned(), source }
    }

    /// For `map_err`: what was found in a file.
    pub fn damaged<E: std::fmt::Display>(path: &Path) -> impl FnOnce(E) -> Self {
        move |problem| Self::Damaged { path: path.to_owned(), problem: problem.to_string() }
    }
}
