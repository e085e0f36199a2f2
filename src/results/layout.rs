//! Layout of a results directory: where everything lies, and which parts a file holds, by its name.
//!
//! ```text
//! results/<name>/tables/{slips,precursors,jobs}/part-EEE-FFFFFF.parquet   committed files only, at every instant
//!                tables/{slips,precursors,jobs}/compact-EEE-FFFFFF-LLLLLL-CHECKSUM.parquet  what was compacted
//!                reduced/  figures/  report.html                         made from the tables
//!                run/manifest.json  sweep-EEE.toml  round-EEE.json       what the tables belong to
//!                run/{workers,claims,staging,lock,log}/                  of no use once nothing runs
//!                run/staging/replaced/tables/                            what the last compaction replaced, for a while
//!                run/spill/{slips,precursors,jobs}/                      finished jobs of parts that are not done
//!                run/quarantine/                                         damaged files that a repair took away
//! ```
//!
//! EEE is the number of the extension, FFFFFF that of the first part in the file and LLLLLL that of the last.
//! Staging lies on the same file system as the tables, so that a rename moves a whole file at once, but outside their
//! folders: a stray file of any name there breaks some reader.

use crate::results::error::ResultsError;
use crate::results::tables;
use crate::sweep::{Outline, Sweep};
use crate::table::file::{Dataset, DatasetError, FILE_EXTENSION};
use crate::table::storage::{HeldFolder, Storage, StorageError};
use std::collections::HashSet;
use std::ffi::OsString;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

const TABLES: &str = "tables";
/// Folder of everything that is no result.
pub const RUN: &str = "run";
/// Name of the manifest within it.
const MANIFEST: &str = "manifest.json";
/// Folder of the results directories that nobody placed elsewhere.
const RESULTS: &str = "results";
/// Staging folder of a compaction, which only one process uses at a time.
pub(super) const COMPACTION: &str = "compact";
/// Staging folder of a merger, likewise.
pub(super) const MERGER: &str = "merge";
/// Folder beside them that holds the tables which the last compaction replaced.
pub(super) const REPLACED: &str = "replaced";
pub const RUN_FOLDERS: [&str; 7] = ["staging", "lock", "log", "workers", "claims", "spill", "batch"];

/// Paths within a results directory, and the storage on which it lies.
#[derive(Clone)]
pub struct Layout<'a> {
    pub storage: &'a dyn Storage,
    root: PathBuf,
}

impl fmt::Debug for Layout<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Layout").field("root", &self.root).finish_non_exhaustive()
    }
}

impl<'a> Layout<'a> {
    /// The layout under a directory.
    pub fn new(storage: &'a dyn Storage, root: &Path) -> Self {
        Self { storage, root: root.to_owned() }
    }

    /// The directory of a sweep, unless another is chosen.
    pub fn default_root(sweep: &Sweep) -> PathBuf {
        Path::new(RESULTS).join(sweep.name())
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    /// A directory that is none of ours, for those who look at one.
    pub(super) fn no_results(&self) -> ResultsError {
        let is_there = self.storage.exists(&self.root).unwrap_or(true);
        let problem = if is_there {
            "is no results directory (it has no run/manifest.json)"
        } else {
            "there is no such directory"
        };
        ResultsError::refused(&self.root, format!("{problem}; name one that a run made, such as {RESULTS}/fig3"))
    }

    pub fn tables(&self) -> PathBuf {
        self.root.join(TABLES)
    }

    pub fn table(&self, name: &str) -> PathBuf {
        self.tables().join(name)
    }

    /// The files of a table whose names are those of parts, as they are now.
    pub(super) fn table_files(&self, name: &str) -> Result<impl Iterator<Item = TableFile> + use<>, StorageError> {
        let names = self.storage.list(&self.table(name))?;
        Ok(names.into_iter().filter_map(|name| TableFile::of_path(name.as_ref())))
    }

    /// All files of a table as they are now.
    pub fn dataset(&self, name: &str) -> Result<Dataset<'a>, DatasetError> {
        Dataset::of_folder(self.storage, &self.table(name))
    }

    /// Reads the directory; again as often as a compaction has put others in the place of the tables meanwhile, since files
    /// that were listed before may then not be found, or as a run has added a sweep.
    pub fn read_tables<T>(&self, mut read: impl FnMut() -> T) -> Result<T, StorageError> {
        loop {
            let before = self.generation()?;
            let found = read();
            if self.generation()? == before {
                return Ok(found);
            }
        }
    }

    /// The folder of the tables, and the copies of sweep files.
    fn generation(&self) -> Result<(Option<HeldFolder>, Vec<PathBuf>), StorageError> {
        Ok((self.storage.hold(&self.tables())?, self.sweeps()?))
    }

    /// The copies of the sweep files, in order, as the folder lists them: a network file system may not yet find them by
    /// their names.
    pub fn sweeps(&self) -> Result<Vec<PathBuf>, StorageError> {
        let names: HashSet<OsString> = self.storage.list(&self.run())?.into_iter().collect();
        let is_there = |path: &PathBuf| path.file_name().is_some_and(|name| names.contains(name));
        Ok((0..names.len()).map(|extension| self.sweep(extension)).take_while(is_there).collect())
    }

    /// Creates a folder of the directory. The directory itself must be there: one that was moved away is not begun again.
    pub fn ensure_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.storage.ensure_folder_below(&self.root, folder)
    }

    pub fn reduced(&self) -> PathBuf {
        self.root.join("reduced")
    }

    /// File of a reduced table.
    pub fn reduced_file(&self, table: &str) -> PathBuf {
        self.reduced().join(format!("{table}.{FILE_EXTENSION}"))
    }

    pub fn figures(&self) -> PathBuf {
        self.root.join("figures")
    }

    pub fn report(&self) -> PathBuf {
        self.root.join("report.html")
    }

    /// Folder of everything that is no result.
    pub fn run(&self) -> PathBuf {
        self.root.join(RUN)
    }

    /// The folders in which names are results.
    pub fn result_folders(&self) -> Vec<PathBuf> {
        let tables = [tables::SLIPS, tables::PRECURSORS, tables::JOBS];
        let folders = [self.root.clone(), self.run(), self.root.join(TABLES)];
        folders.into_iter().chain(tables.map(|table| self.table(table))).collect()
    }

    pub fn manifest(&self) -> PathBuf {
        self.run().join(MANIFEST)
    }

    /// Copy of the sweep file of an extension.
    pub fn sweep(&self, extension: usize) -> PathBuf {
        self.run().join(format!("sweep-{extension:03}.toml"))
    }

    /// Copy of the round that an extension is.
    pub fn round(&self, extension: usize) -> PathBuf {
        self.run().join(format!("round-{extension:03}.json"))
    }

    /// Where a repair puts what is damaged.
    pub fn quarantine(&self) -> PathBuf {
        self.run().join("quarantine")
    }

    /// Where one writer, known by a name of its own, prepares files.
    pub fn staging(&self, writer: &str) -> PathBuf {
        self.run().join("staging").join(writer)
    }

    /// Folder of the lock files.
    pub fn locks(&self) -> PathBuf {
        self.run().join("lock")
    }

    /// Folder of the workers' files.
    pub fn workers(&self) -> PathBuf {
        self.run().join("workers")
    }

    pub fn claims(&self) -> PathBuf {
        self.run().join("claims")
    }

    /// Folder of what a stopped run had finished of parts that are not done.
    pub fn spill(&self) -> PathBuf {
        self.run().join("spill")
    }

    pub fn logs(&self) -> PathBuf {
        self.run().join("log")
    }
}

/// Characters of the checksum in the name of a compacted file: other bytes, another name.
const CHECKSUM_CHARACTERS: usize = 16;

/// Name of a part, which is that of its file in every table.
pub fn part_name(part: &Outline) -> String {
    part_name_of(part.extension, part.index)
}

fn part_name_of(extension: usize, index: u64) -> String {
    format!("part-{extension:03}-{index:06}")
}

/// Name of a table file, which says whose rows it holds: those of one part, or of consecutive parts of an extension.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TableFile {
    pub extension: usize,
    /// Number of the first part.
    pub first: u64,
    /// Number of the last part.
    pub last: u64,
    /// How the file's checksum begins, if it is compacted.
    pub checksum: Option<String>,
}

impl TableFile {
    /// The file of a part of its own.
    pub const fn of_part(extension: usize, index: u64) -> Self {
        Self { extension, first: index, last: index, checksum: None }
    }

    /// The compacted file of these parts with this checksum.
    pub fn compacted(extension: usize, parts: &RangeInclusive<u64>, checksum: &str) -> Self {
        let checksum = Some(checksum.chars().take(CHECKSUM_CHARACTERS).collect());
        Self { extension, first: *parts.start(), last: *parts.end(), checksum }
    }

    /// What the name of a file says; `None` if it is not that of a table file.
    pub fn of_path(path: &Path) -> Option<Self> {
        Self::parse(path.file_name()?.to_str()?)
    }

    /// What a name says; `None` if it is not that of a table file.
    pub fn parse(name: &str) -> Option<Self> {
        let stem = name.strip_suffix(FILE_EXTENSION)?.strip_suffix('.')?;
        let file = match *stem.split('-').collect::<Vec<_>>() {
            ["part", extension, index] => Self::of_part(extension.parse().ok()?, index.parse().ok()?),
            ["compact", extension, first, last, checksum] => {
                Self::compacted(extension.parse().ok()?, &(first.parse().ok()?..=last.parse().ok()?), checksum)
            }
            _ => return None,
        };
        (file.to_string() == name && file.first <= file.last).then_some(file)
    }

    /// Whether it holds several parts, or was meant to.
    pub const fn is_compacted(&self) -> bool {
        self.checksum.is_some()
    }

    pub const fn parts(&self) -> RangeInclusive<u64> {
        self.first..=self.last
    }
}

impl fmt::Display for TableFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { extension, first, last, checksum } = self;
        match checksum {
            None => write!(f, "{}.{FILE_EXTENSION}", part_name_of(*extension, *first)),
            Some(checksum) => write!(f, "compact-{extension:03}-{first:06}-{last:06}-{checksum}.{FILE_EXTENSION}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_table_files_read_back_and_others_are_none() {
        for (extension, first, last) in [(0, 0, 0), (7, 123_456, 123_457), (1000, 1_234_567, 1_234_567)] {
            let compacted = TableFile::compacted(extension, &(first..=last), &"0123456789abcdef".repeat(4));
            for file in [TableFile::of_part(extension, first), compacted] {
                assert_eq!(TableFile::parse(&file.to_string()), Some(file));
            }
        }
        for name in [
            "part-0-0.parquet",
            "part-000-000001 (copy).parquet",
            "part-000-+00001.parquet",
            "part-000-000001",
            "compact-000-000000-0123456789abcdef.parquet",
            "compact-000-000002-000001-0123456789abcdef.parquet",
            "compact-000-000000-000001-0123456789abcdef0.parquet",
            "part-000.parquet",
            "",
        ] {
            assert_eq!(TableFile::parse(name), None, "{name}");
        }
    }
}
