//! Upkeep: verify, repair and compact a directory. What changes committed files happens while no shard runs.
//!
//! Upkeep makes a claim of its own and then looks that no shard is claimed; a run claims its shard and then looks that upkeep
//! is not claimed. So at least one of two that begin at once sees the other, and leaves.

#[cfg(test)]
mod tests;

use crate::results::compact::{CompactError, Compacted, Without};
use crate::results::layout::Layout;
use crate::results::manifest::{Directory, DirectoryError};
use crate::results::verify::{Remedy, RepairError, Repaired, Verification};
use crate::run::claim::{Claim, PATIENCE, is_claimed};
use crate::run::log::{self, Entry, Log};
use crate::table::storage::{Storage, StorageError};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Name of the claim.
const NAME: &str = "upkeep";
/// What the names of the claims of shards begin with.
const SHARD: &str = "shard-";
/// How long to look for a claim to go: who looks at it holds its lock for an instant.
const LONGEST_WAIT: Duration = Duration::from_millis(500);
/// How often to look.
const POLL: Duration = Duration::from_millis(20);

/// Why a directory cannot be taken care of.
#[derive(Debug, thiserror::Error)]
pub enum UpkeepError {
    /// The directory is refused.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// A file operation failed.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// It cannot be repaired.
    #[error(transparent)]
    Repair(#[from] RepairError),
    /// It cannot be compacted.
    #[error(transparent)]
    Compact(#[from] CompactError),
    /// A shard runs.
    #[error("{}: is being run ({shard}); wait for it or stop it, then try again", .directory.display())]
    Running {
        /// The directory.
        directory: PathBuf,
        /// Name of the claim.
        shard: String,
    },
    /// Another process takes care of it.
    #[error("{}: is being repaired or compacted by another process; try again when it has ended", .0.display())]
    Busy(PathBuf),
    /// Only whole data can be compacted.
    #[error("{}: damaged: {problem}; `stickslip verify` on the results directory tells how to repair it", .path.display())]
    Damaged {
        /// The first damaged file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

/// Verifies a directory: see [`crate::results::verify::verify`].
///
/// # Errors
/// When it is no results directory, belongs to another version of the program, or cannot be restored at all.
pub fn verify(storage: &dyn Storage, root: &Path) -> Result<Verification, UpkeepError> {
    let committed = committed(storage, &Layout::new(root))?;
    Ok(crate::results::verify::verify(storage, root, &committed)?)
}

/// Takes away what is damaged, so that the next run makes it anew: see [`crate::results::verify::repair`].
///
/// # Errors
/// When a shard runs, or something cannot be moved or written.
pub fn repair(storage: &dyn Storage, root: &Path) -> Result<Repaired, UpkeepError> {
    let layout = Layout::new(root);
    // Tells what is no results directory before anything is written.
    verify(storage, root)?;
    alone(storage, &layout, || -> Result<_, UpkeepError> {
        let repaired = crate::results::verify::repair(storage, root, &committed(storage, &layout)?)?;
        withdrawn(storage, &layout, &repaired.parts)?;
        Ok(repaired)
    })
}

/// Compacts a directory: see [`crate::results::compact::compact`].
///
/// # Errors
/// When a shard runs, something is damaged, or the file system cannot do it.
pub fn compact(storage: &dyn Storage, root: &Path) -> Result<Compacted, UpkeepError> {
    let layout = Directory::read(storage, root)?.layout().clone();
    alone(storage, &layout, || {
        let problems = verify(storage, root)?.problems;
        if let Some(problem) = problems.into_iter().find(|problem| problem.remedy != Remedy::Reduce) {
            return Err(UpkeepError::Damaged { path: problem.path, problem: problem.problem });
        }
        let directory = Directory::read(storage, root)?;
        Ok(crate::results::compact::compact(storage, &directory, &Without::default(), None)?)
    })
}

/// Takes parts with failed jobs out of the compacted files, so that they are run again.
///
/// # Errors
/// As [`compact`].
pub(super) fn withdraw_failed(storage: &dyn Storage, directory: &Directory) -> Result<(), UpkeepError> {
    let failed = |directory: &Directory| directory.compaction().failed_parts().map(str::to_owned).collect();
    let parts: BTreeSet<String> = failed(directory);
    if parts.is_empty() {
        return Ok(());
    }
    let layout = directory.layout();
    alone(storage, layout, || -> Result<_, UpkeepError> {
        let directory = directory.clone().with_compaction(storage)?;
        let without = Without { parts: failed(&directory), ..Without::default() };
        withdrawn(storage, layout, &without.parts)?;
        crate::results::compact::compact(storage, &directory, &without, None)?;
        Ok(())
    })
}

/// Makes sure that nobody takes care of a directory whose shard is ours.
///
/// # Errors
/// When somebody does.
pub(super) fn absent(storage: &dyn Storage, layout: &Layout) -> Result<(), UpkeepError> {
    if stays_claimed(storage, layout, NAME)? { Err(UpkeepError::Busy(layout.root().to_owned())) } else { Ok(()) }
}

/// Does something while no shard runs.
fn alone<T, E>(storage: &dyn Storage, layout: &Layout, body: impl FnOnce() -> Result<T, E>) -> Result<T, UpkeepError>
where
    UpkeepError: From<E>,
{
    let claim = Claim::take(storage, layout, NAME, PATIENCE)?;
    let claim = claim.ok_or_else(|| UpkeepError::Busy(layout.root().to_owned()))?;
    let locks = layout.locks();
    for name in storage.list(&locks).map_err(StorageError::at("list", &locks))? {
        let shard = name.to_string_lossy().into_owned();
        if shard.starts_with(SHARD) && stays_claimed(storage, layout, &shard)? {
            return Err(UpkeepError::Running { directory: layout.root().to_owned(), shard });
        }
    }
    Ok(claim.while_held(body)?)
}

fn stays_claimed(storage: &dyn Storage, layout: &Layout, name: &str) -> Result<bool, StorageError> {
    let begin = Instant::now();
    while is_claimed(storage, layout, name)? {
        if begin.elapsed() >= LONGEST_WAIT {
            return Ok(true);
        }
        std::thread::sleep(POLL);
    }
    Ok(false)
}

/// Names of the parts that were committed, by the logs, and not taken away since.
fn committed(storage: &dyn Storage, layout: &Layout) -> Result<BTreeSet<String>, StorageError> {
    let mut parts = BTreeSet::new();
    log::read(storage, layout, |line| match line.entry {
        Entry::Part { part, .. } => {
            parts.insert(part);
        }
        Entry::Withdrawn { part } => {
            parts.remove(&part);
        }
        _ => (),
    })?;
    Ok(parts)
}

/// Logs that parts are taken away.
fn withdrawn(storage: &dyn Storage, layout: &Layout, parts: &BTreeSet<String>) -> Result<(), StorageError> {
    if parts.is_empty() {
        return Ok(());
    }
    let mut log = Log::create(storage, layout)?;
    parts.iter().try_for_each(|part| log.write(Entry::Withdrawn { part: part.clone() }))
}
