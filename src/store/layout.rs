//! Layout of a results directory: where everything lies, and how parts are called.
//!
//! ```text
//! results/<name>/tables/{slips,precursors,jobs}/part-EEE-IIIIII.parquet   committed files only, at every instant
//!                reduced/  figures/                                      made from the tables
//!                run/manifest.json  sweep-EEE.toml                       what the tables belong to
//!                run/{staging,lock,log}/                                 of no use once nothing runs
//! ```
//!
//! Staging lies on the same file system as the tables, so that a rename moves a whole file at once, but outside their
//! folders: a stray file of any name there breaks some reader.

use crate::store::tables;
use crate::sweep::Part;
use std::path::{Path, PathBuf};

/// Folder of the tables.
const TABLES: &str = "tables";
/// Folder of everything that is no result.
pub const RUN: &str = "run";
/// Name of the manifest within it.
pub const MANIFEST: &str = "manifest.json";
/// Names of its folders.
pub const RUN_FOLDERS: [&str; 3] = ["staging", "lock", "log"];

/// Paths within a results directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    root: PathBuf,
}

impl Layout {
    /// The layout under a directory.
    #[must_use]
    pub fn new(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// The directory.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Folder of a table.
    #[must_use]
    pub fn table(&self, name: &str) -> PathBuf {
        self.root.join(TABLES).join(name)
    }

    /// Folder of reduced data.
    #[must_use]
    pub fn reduced(&self) -> PathBuf {
        self.root.join("reduced")
    }

    /// Folder of figures.
    #[must_use]
    pub fn figures(&self) -> PathBuf {
        self.root.join("figures")
    }

    /// Folder of everything that is no result.
    #[must_use]
    pub fn run(&self) -> PathBuf {
        self.root.join(RUN)
    }

    /// The folders in which names are results.
    #[must_use]
    pub fn result_folders(&self) -> Vec<PathBuf> {
        let tables = [tables::slips().name, tables::precursors().name, tables::jobs().name];
        let folders = [self.root.clone(), self.run(), self.root.join(TABLES)];
        folders.into_iter().chain(tables.map(|table| self.table(table))).collect()
    }

    /// The manifest.
    #[must_use]
    pub fn manifest(&self) -> PathBuf {
        self.run().join(MANIFEST)
    }

    /// Copy of the sweep file of an epoch.
    #[must_use]
    pub fn sweep(&self, epoch: usize) -> PathBuf {
        self.run().join(format!("sweep-{epoch:03}.toml"))
    }

    /// Where one writer, known by a name of its own, prepares files.
    #[must_use]
    pub fn staging(&self, writer: &str) -> PathBuf {
        self.run().join("staging").join(writer)
    }

    /// Folder of the lock files.
    #[must_use]
    pub fn locks(&self) -> PathBuf {
        self.run().join("lock")
    }

    /// Folder of the logs.
    #[must_use]
    pub fn logs(&self) -> PathBuf {
        self.run().join("log")
    }
}

/// Name of a part, which is that of its file in every table.
#[must_use]
pub fn part_name(part: &Part) -> String {
    format!("part-{:03}-{:06}", part.epoch, part.index)
}

/// Name of the file of a part.
#[must_use]
pub fn part_file(part: &Part) -> String {
    format!("{}.parquet", part_name(part))
}
