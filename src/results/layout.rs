//! Layout of a results directory: where everything lies, and which parts its names say are done. `docs/internals.md`
//! shows it.
//!
//! Staging lies on the same file system as the tables, so that a rename moves a whole file at once, but outside their
//! folders: a stray file there breaks some reader.

use crate::results::tables::RecordedTable;
use crate::sweep::{PartName, Sweep};
use crate::table::error::ResultsError;
use crate::table::file::FILE_EXTENSION;
use crate::table::shown::shown;
use crate::table::storage::{Storage, StorageError, gone_is_fine};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Folder of everything that is no result.
pub const RUN: &str = "run";
/// Of pictures.
pub const FIGURES: &str = "figures";
const RESULTS: &str = "results";
pub const RUN_FOLDERS: [&str; 6] = ["staging", "log", "workers", "claims", "spill", "batch"];
const EXTENSION: &str = "extension-";
/// What the name of a claim begins with if jobs of a finished part run again.
pub(super) const AGAIN: &str = "again-";

#[derive(Clone)]
pub struct Layout<'a> {
    pub storage: &'a dyn Storage,
    root: PathBuf,
    /// Where reduced data lie, if not in the directory.
    pub(super) elsewhere: Option<Arc<TempDir>>,
    /// The worker that works on it, if one does.
    pub(super) worker: Option<Arc<str>>,
}

impl fmt::Debug for Layout<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Layout")
            .field("root", &self.root)
            .finish_non_exhaustive()
    }
}

impl<'a> Layout<'a> {
    pub fn new(storage: &'a dyn Storage, root: &Path) -> Self {
        Self {
            storage,
            root: root.to_owned(),
            elsewhere: None,
            worker: None,
        }
    }

    fn reduced_root(&self) -> &Path {
        let elsewhere = self.elsewhere.as_ref().map(|folder| folder.path());
        elsewhere.unwrap_or(&self.root)
    }

    /// The directory of a sweep, unless another is chosen.
    pub fn default_root(sweep: &Sweep) -> PathBuf {
        Path::new(RESULTS).join(sweep.name())
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The error of a command that reads results where there are none.
    pub(super) fn no_results(&self) -> ResultsError {
        let is_there = self.storage.exists(&self.root).unwrap_or(true);
        let is_sweep = self.root.extension().is_some_and(|ending| ending == "toml");
        let problem = if is_there && is_sweep {
            let name = Path::new(RESULTS).join(self.root.file_stem().unwrap_or_default());
            format!("is a sweep file; did you mean {}?", shown(&name))
        } else if is_there {
            format!(
                "is not a results directory (it has no run/extension-000.json); name one that a run made, such as {RESULTS}/fig3"
            )
        } else {
            format!("there is no such directory; name one that a run made, such as {RESULTS}/fig3")
        };
        ResultsError::refused(&self.root, problem)
    }

    pub fn table(&self, table: RecordedTable) -> PathBuf {
        self.tables().join(table.word())
    }

    /// The names in a folder; none where another program's file stands in its place.
    pub(super) fn names_in(&self, folder: &Path) -> Result<Vec<OsString>, StorageError> {
        match self.storage.list(folder) {
            Err(error) if error.is_missing() => Ok(Vec::new()),
            names => names,
        }
    }

    pub(super) fn parts_in(&self, folder: &Path) -> Result<BTreeSet<PartName>, StorageError> {
        let part = |name: OsString| PartName::of_path(name.as_ref());
        Ok(self
            .names_in(folder)?
            .into_iter()
            .filter_map(part)
            .collect())
    }

    /// Creates a folder of the directory, which must be there: a directory that was moved away is not begun again.
    pub fn ensure_folder(&self, folder: &Path) -> Result<(), StorageError> {
        self.storage
            .ensure_folder_below(self.reduced_root(), folder)
    }

    pub fn reduced(&self) -> PathBuf {
        self.reduced_root().join("reduced")
    }

    pub fn reduced_file(&self, table: &str) -> PathBuf {
        self.reduced().join(format!("{table}.{FILE_EXTENSION}"))
    }

    pub fn extension(&self, number: usize) -> PathBuf {
        self.run().join(extension_name(number))
    }

    /// The same, and its copy.
    pub(crate) fn files_of_extension(&self, number: usize) -> [PathBuf; 2] {
        [self.run(), self.copies()].map(|folder| folder.join(extension_name(number)))
    }

    /// The listed files of extensions, by number, copies last. A network file system may list a file before it finds
    /// it.
    pub(super) fn listed_extensions(&self) -> Result<BTreeMap<usize, Vec<PathBuf>>, StorageError> {
        // In this order: where a copy is listed, its first file was there before.
        let copies = self.names_in(&self.copies())?;
        let first = self.names_in(&self.run())?;
        let mut listed: BTreeMap<usize, Vec<PathBuf>> = BTreeMap::new();
        for (folder, names) in [(self.run(), first), (self.copies(), copies)] {
            for name in names {
                if let Some(number) = extension_number(&name) {
                    listed.entry(number).or_default().push(folder.join(name));
                }
            }
        }
        Ok(listed)
    }

    /// Removes a file, unless a link below the root leads to it, whose target may belong to somebody else.
    pub fn remove(&self, path: &Path) -> Result<(), StorageError> {
        self.refuse_link(path)?;
        gone_is_fine(self.storage.remove(path))
    }

    /// Refuses a path through a link below the root.
    pub fn refuse_link(&self, path: &Path) -> Result<(), StorageError> {
        let roots = [self.root.as_path(), self.reduced_root()];
        let folders = path.ancestors().skip(1);
        let mut below = folders.take_while(|folder| !roots.contains(folder));
        if let Some(link) = below.find(|folder| folder.is_symlink()) {
            let problem = io::Error::other("it is a link; put the folder itself in its place");
            return Err(StorageError::at("remove anything in it", link)(problem));
        }
        Ok(())
    }

    /// The same for a worker, which stages in a folder of its own.
    pub(super) fn of_worker(&self, name: &str) -> Self {
        Self {
            worker: Some(name.into()),
            ..self.clone()
        }
    }

    pub(super) const fn is_of_worker(&self) -> bool {
        self.worker.is_some()
    }

    /// Where a worker prepares files.
    pub(super) fn staging(&self, worker: &str) -> PathBuf {
        self.reduced_root().join("run/staging").join(worker)
    }

    /// Where what is made from tables is prepared: by a worker in its folder, else in the one above.
    pub fn drafts(&self) -> PathBuf {
        self.staging(self.worker.as_deref().unwrap_or_default())
    }
}

/// Whether most programs pass over a file of this name.
pub(super) fn is_hidden(name: &OsStr) -> bool {
    matches!(name.as_encoded_bytes().first(), Some(b'.' | b'_'))
}

/// Whether it is the name of a table file. Hidden names and other endings are left by other programs.
pub(super) fn is_table_file(name: &OsStr) -> bool {
    let extension = Path::new(name).extension();
    !is_hidden(name) && extension.is_some_and(|extension| extension == FILE_EXTENSION)
}

/// What is claimed by a file of this name, and the generation; `None` if it is not a claim.
pub(super) fn claim(name: &OsStr) -> Option<(&str, u64)> {
    let (what, digits) = name.to_str()?.rsplit_once('.')?;
    let generation = digits.parse().ok()?;
    (!is_hidden(name)).then_some((what, generation))
}

/// What is claimed to run a part, or jobs of one that is done again.
pub(super) fn claim_of(part: PartName, is_done: bool) -> String {
    let again = if is_done { AGAIN } else { "" };
    format!("{again}{part}")
}

/// Whether claims of this name stay when nobody else works, as they count deaths.
pub(super) fn stays(what: &str, is_end: bool, done: &BTreeSet<PartName>) -> bool {
    let is_again = what.starts_with(AGAIN) && !is_end;
    is_again || PartName::parse(what).is_some_and(|part| !done.contains(&part))
}

fn extension_name(number: usize) -> String {
    format!("{EXTENSION}{number:03}.json")
}

fn extension_number(name: &OsStr) -> Option<usize> {
    let name = name.to_str()?;
    let digits = name.strip_prefix(EXTENSION)?.strip_suffix(".json")?;
    let number = digits.parse().ok()?;
    (extension_name(number) == name).then_some(number)
}

/// Paths below the root, each a method of its name.
macro_rules! places {
    ($($(#[$about:meta])* $place:ident = $path:expr;)*) => {
        impl Layout<'_> {$(
            $(#[$about])*
            pub fn $place(&self) -> PathBuf {
                self.root.join($path)
            }
        )*}
    };
}

places! {
    tables = "tables";
    figures = FIGURES;
    report = "report.html";
    run = RUN;
    claims = "run/claims";
    /// Second copies of the files of extensions.
    copies = "run/copies";
    logs = "run/log";
    /// What a repair took away, as it was damaged.
    quarantine = "run/quarantine";
    /// What a stopped run had finished of parts that are not done.
    spill = "run/spill";
    workers = "run/workers";
}

impl PartName {
    /// What the name of a file says; `None` if it is not that of a part's.
    pub fn of_path(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        Self::parse(name.strip_suffix(FILE_EXTENSION)?.strip_suffix('.')?)
    }

    /// What a name without the ending of a file says.
    pub fn parse(name: &str) -> Option<Self> {
        let (extension, index) = name.strip_prefix("part-")?.split_once('-')?;
        let part = Self {
            extension: extension.parse().ok()?,
            index: index.parse().ok()?,
        };
        (part.to_string() == name).then_some(part)
    }

    pub fn file(self) -> String {
        format!("{self}.{FILE_EXTENSION}")
    }
}

impl fmt::Display for PartName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "part-{:03}-{:06}", self.extension, self.index)
    }
}

pub const fn shorter_in_tests(usual: Duration, in_tests: Duration) -> Duration {
    if cfg!(test) { in_tests } else { usual }
}

/// How long to wait for a file: longer than a network file system shows an old listing.
const LATE: Duration = shorter_in_tests(Duration::from_mins(1), Duration::from_millis(300));
/// Time between two looks.
const PAUSE: Duration = shorter_in_tests(Duration::from_millis(200), Duration::ZERO);

/// Looks again until something is found, for a minute at most: a host of a network disk may not see yet what a folder
/// lists.
pub(super) fn settled<T>(
    mut look: impl FnMut() -> Result<Option<T>, ResultsError>,
) -> Result<Option<T>, ResultsError> {
    let begin = Instant::now();
    loop {
        let seen = look()?;
        if seen.is_some() || begin.elapsed() >= LATE {
            return Ok(seen);
        }
        std::thread::sleep(PAUSE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_parts_read_back_and_others_are_none() {
        for (extension, index) in [(0, 0), (7, 123_456), (1000, 1_234_567)] {
            let part = PartName { extension, index };
            assert_eq!(PartName::of_path(Path::new(&part.file())), Some(part));
        }
        for name in [
            "part-0-0.parquet",
            "part-000-000001 (copy).parquet",
            "part-000-+00001.parquet",
            "part-000-000001",
            "compact-000-000000-000001-0123456789abcdef.parquet",
            "part-000.parquet",
            "",
        ] {
            assert_eq!(PartName::of_path(Path::new(name)), None, "{name}");
        }
    }
}
