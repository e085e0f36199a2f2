//! Verification: every file whole and in its place, every job there once; what is damaged is named, and can be taken
//! away.
//!
//! ```text
//! manifest.rs    manifest and sweep files, which restore each other
//! files.rs       the files of the plan's parts, each alone or compacted, and what else lies among them
//! rows.rs        the rows of all tables held against each other
//! ```
//!
//! Reading changes nothing. A repair moves what is damaged to `run/quarantine/` and restores what can be restored; the
//! next run does the rest. Memory: the names of the files.

mod files;
mod manifest;
mod rows;

use crate::results::error::ResultsError;
use crate::results::events::RunEvent;
use crate::results::handle::Results;
use crate::results::layout::Layout;
use crate::table::checksum;
use crate::table::file::DatasetError;
use crate::table::shown::serialize_path;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How often to look at a directory whose manifest and sweep files do not fit, and the time in between: together longer
/// than a network file system shows an old file.
const LOOKS: u32 = if cfg!(test) { 20 } else { 5 };
const LOOK: Duration = Duration::from_millis(if cfg!(test) { 1 } else { 1000 });
/// Version of [`Verification`] as JSON.
const FORMAT: u32 = 3;

/// What a verification found. Serialises to a stable form, whose version is `format`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Verification {
    pub format: u32,
    pub whole: bool,
    /// Damage, in the order in which it was found.
    pub problems: Vec<Problem>,
    /// Table files that are whole.
    pub files: u64,
    pub bytes: u64,
    /// Parts that are done and whole.
    pub parts: u64,
    pub jobs: u64,
    /// Parts that are asked for and not yet done, damaged ones aside.
    pub parts_missing: u64,
    pub jobs_missing: u64,
    /// Whether parts are to be run again for what is damaged.
    pub wants_run: bool,
    /// Whether such parts were compacted.
    #[serde(skip)]
    lost_compacted: bool,
}

#[derive(Clone, Debug, Serialize)]
pub struct Problem {
    #[serde(serialize_with = "serialize_path")]
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
    /// Names of the parts that are run again for it.
    pub parts: Vec<String>,
    /// Ids of the jobs concerned.
    pub jobs: Vec<String>,
    pub remedy: Remedy,
    /// Files that a repair moves away, in this order.
    #[serde(skip)]
    moved: Vec<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// Writing the manifest and the copies of the sweep files again.
    Manifest,
    File,
    /// Moving the file away with those of the same parts in other tables, and running these parts.
    Part,
    /// Running the part: there is nothing of it.
    Run,
    Reduce,
}

impl Problem {
    fn of_file(path: PathBuf, problem: impl Into<String>, remedy: Remedy) -> Self {
        let moved = if remedy == Remedy::File { vec![path.clone()] } else { Vec::new() };
        Self { path, problem: problem.into(), parts: Vec::new(), jobs: Vec::new(), remedy, moved }
    }
}

impl Verification {
    /// Whether something is to be moved or written before anything is run.
    pub fn wants_repair(&self) -> bool {
        self.problems.iter().any(|problem| !matches!(problem.remedy, Remedy::Run | Remedy::Reduce))
    }

    /// Whether tables that were compacted are to be compacted again.
    pub const fn wants_compaction(&self) -> bool {
        self.lost_compacted
    }

    /// Whether reduced data are to be made again, and no run does it.
    pub fn wants_reduction(&self) -> bool {
        !self.wants_run && self.problems.iter().any(|problem| problem.remedy == Remedy::Reduce)
    }

    /// Names of the parts that are to be run again.
    fn lost_parts(&self) -> BTreeSet<&str> {
        self.problems.iter().flat_map(|problem| &problem.parts).map(String::as_str).collect()
    }
}

impl<'a> Results<'a> {
    /// Verifies a directory, whatever is damaged. Needs no lock, so runs may be at work.
    pub fn verify(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        Ok(Self::examined(layout)?.1)
    }

    /// A directory as it is restored, and what is wrong with it.
    pub(super) fn examined(layout: &Layout<'a>) -> Result<(Self, Verification), ResultsError> {
        let mut looks = 0;
        loop {
            let has_manifest = layout.storage.exists(&layout.manifest())?;
            let (results, verification) = layout.read_tables(|| Self::examine(layout))??;
            looks += 1;
            // A run is about to add a sweep, or was killed there; or this host does not see the new manifest yet.
            let is_unsettled = !has_manifest || layout.sweeps()?.len() > results.extensions().len();
            if verification.whole || !is_unsettled || looks == LOOKS {
                return Ok((results, verification));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Takes away what is damaged, so that the next run makes it again; returns what was found.
    pub fn repair(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        // Reports what is no results directory before anything is written.
        let (results, _) = layout.read_tables(|| Self::examine(layout))??;
        results.exclusively(|| {
            let (results, verification) = Self::examined(layout)?;
            let [tables, run, quarantine] = [layout.tables(), layout.run(), layout.quarantine()];
            for Problem { moved, .. } in &verification.problems {
                let place = |path: &Path| {
                    quarantine.join(path.strip_prefix(&tables).or_else(|_| path.strip_prefix(&run)).unwrap_or(path))
                };
                match &moved[..] {
                    // It may be a folder.
                    [path] => layout.storage.move_away(path, &place(path))?,
                    files => {
                        let moves: Vec<_> = files.iter().map(|path| (path.as_path(), place(path))).collect();
                        layout.storage.move_away_together(&moves)?;
                    }
                }
            }
            if verification.problems.iter().any(|problem| problem.remedy == Remedy::Manifest) {
                manifest::restore_manifest(&results)?;
            }
            let lost = verification.lost_parts();
            if !lost.is_empty() {
                let mut log = results.begin_log()?;
                let event = |part: &str| RunEvent::PartQuarantined { part: part.to_owned() };
                lost.iter().try_for_each(|part| log.write(&event(part)))?;
            }
            Ok(verification)
        })
    }

    /// Verifies a directory; gives it as it is restored.
    fn examine(layout: &Layout<'a>) -> Result<(Self, Verification), ResultsError> {
        let mut verification = Verification { format: FORMAT, ..Verification::default() };
        let results = manifest::salvage(layout, &mut verification.problems)?;
        // First, so that what the logs say is there was there when the files were listed.
        let committed = results.committed_parts()?;
        files::verify(&results, &committed, &mut verification)?;
        let reduced = layout.reduced();
        for name in layout.storage.list(&reduced)? {
            let path = reduced.join(name);
            let damage = damage_in(checksum::check(layout.storage, &path))?;
            verification.problems.extend(damage.map(|(path, problem)| Problem::of_file(path, problem, Remedy::Reduce)));
        }
        verification.whole = verification.problems.is_empty();
        verification.wants_run = !verification.lost_parts().is_empty();
        Ok((results, verification))
    }
}

/// What a check found of a file that must be there: its path and what is wrong.
fn damage_in<T>(checked: Result<T, DatasetError>) -> Result<Option<(PathBuf, String)>, DatasetError> {
    checked.map_or_else(|error| error.damage().map(Some), |_| Ok(None))
}
