//! Layout of a results directory: where everything lies, and how parts are called.
//!
//! ```text
//! results/<name>/tables/{slips,precursors,jobs}/part-EEE-IIIIII.parquet   committed files only, at every instant
//!                tables/{slips,precursors,jobs}/compact-IIIIII-SEAL.parquet  what was compacted
//!                reduced/  figures/                                      made from the tables
//!                run/manifest.json  sweep-EEE.toml                       what the tables belong to
//!                run/compacted.json                                      what the compacted files hold
//!                run/{staging,lock,log}/                                 of no use once nothing runs
//!                run/quarantine/                                         damaged files that a repair took away
//! ```
//!
//! Staging lies on the same file system as the tables, so that a rename moves a whole file at once, but outside their
//! folders: a stray file of any name there breaks some reader.

use crate::results::tables;
use crate::sweep::Part;
use std::path::{Path, PathBuf};

/// Folder of the tables.
const TABLES: &str = "tables";
/// Folder of everything that is no result.
pub const RUN: &str = "run";
/// Name of the manifest within it.
const MANIFEST: &str = "manifest.json";
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

    /// Folder of the tables.
    #[must_use]
    pub fn tables(&self) -> PathBuf {
        self.root.join(TABLES)
    }

    /// Folder of a table.
    #[must_use]
    pub fn table(&self, name: &str) -> PathBuf {
        self.tables().join(name)
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
        let tables = [tables::SLIPS, tables::PRECURSORS, tables::JOBS];
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

    /// Record of what the compacted files hold.
    #[must_use]
    pub fn compacted(&self) -> PathBuf {
        self.run().join("compacted.json")
    }

    /// Where a repair puts what is damaged.
    #[must_use]
    pub fn quarantine(&self) -> PathBuf {
        self.run().join("quarantine")
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

/// What the names of parts begin with.
const PART: &str = "part-";
/// What the names of compacted files begin with.
const COMPACT: &str = "compact-";
/// How the names of table files end.
pub const EXTENSION: &str = "parquet";
/// Characters of the seal in the name of a compacted file: other bytes, another name.
const SEAL_CHARACTERS: usize = 16;

/// Name of a part, which is that of its file in every table.
#[must_use]
pub fn part_name(part: &Part) -> String {
    name_of(part.epoch, part.index)
}

/// Name of a part by epoch and number.
#[must_use]
pub fn name_of(epoch: usize, index: u64) -> String {
    format!("{PART}{epoch:03}-{index:06}")
}

/// Epoch and number of the part of this name; `None` if it names none.
#[must_use]
pub fn named_part(name: &str) -> Option<(usize, u64)> {
    let (epoch, index) = name.strip_prefix(PART)?.split_once('-')?;
    let (epoch, index) = (epoch.parse().ok()?, index.parse().ok()?);
    (name == name_of(epoch, index)).then_some((epoch, index))
}

/// Name of the file of a part.
#[must_use]
pub fn part_file(part: &Part) -> String {
    file_of(&part_name(part))
}

/// Name of the file of the part of this name.
#[must_use]
pub fn file_of(part: &str) -> String {
    format!("{part}.{EXTENSION}")
}

/// Name of a compacted file with this number and [seal](crate::table::checksum).
#[must_use]
pub fn compacted_file(number: usize, seal: &str) -> String {
    format!("{COMPACT}{number:06}-{}.{EXTENSION}", &seal[..SEAL_CHARACTERS])
}

/// Whether a name is that of a compacted file.
#[must_use]
pub fn is_compacted(name: &str) -> bool {
    name.starts_with(COMPACT) && Path::new(name).extension().is_some_and(|extension| extension == EXTENSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_parts_read_back_and_others_are_none() {
        for part in [(0, 0), (7, 123_456), (1000, 1_234_567)] {
            assert_eq!(named_part(&name_of(part.0, part.1)), Some(part));
        }
        for name in ["part-0-0", "part-000-000001 (copy)", "part-000-+00001", "compact-000000-0", "part-000", ""] {
            assert_eq!(named_part(name), None, "{name}");
        }
    }
}
