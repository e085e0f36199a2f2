//! Repair: what is damaged is moved to `run/quarantine/`, what can be restored is restored; the next run does the rest.

use super::{Remedy, Verification, beginning, examine};
use crate::results::compact::{CompactError, compact, move_away};
use crate::results::layout::file_of;
use crate::results::manifest::DirectoryError;
use crate::results::tables;
use crate::table::storage::{Storage, StorageError};
use std::collections::BTreeSet;
use std::path::Path;

/// What a repair did.
#[derive(Clone, Debug)]
pub struct Repaired {
    /// What was found.
    pub verification: Verification,
    /// Names of the parts that are now missing, and were not before.
    pub parts: BTreeSet<String>,
}

/// A directory that cannot be repaired.
#[derive(Debug, thiserror::Error)]
pub enum RepairError {
    /// It is no results directory, belongs to another version of the program, or cannot be restored at all.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
    /// A file cannot be moved.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The compacted files cannot be made anew.
    #[error(transparent)]
    Compact(#[from] CompactError),
}

/// Takes away what is damaged. The caller sees to it that nobody else writes.
///
/// # Errors
/// When something cannot be written or moved; nothing that is whole is lost then, and the same can be tried again.
pub fn repair(storage: &dyn Storage, root: &Path, committed: &BTreeSet<String>) -> Result<Repaired, RepairError> {
    let (verification, directory, without) = examine(storage, root, committed)?;
    let (layout, quarantine) = (directory.layout(), directory.layout().quarantine());
    let has = |remedy| verification.problems.iter().any(|problem| problem.remedy == remedy);
    if has(Remedy::Beginning) {
        beginning::restore(storage, &directory)?;
    }
    for problem in &verification.problems {
        match problem.remedy {
            Remedy::File => {
                let inside = problem.path.strip_prefix(layout.tables()).unwrap_or(&problem.path);
                move_away(storage, &problem.path, &quarantine.join(inside))?;
            }
            Remedy::Part => {
                // Jobs first: a part without them is not done.
                for table in [tables::JOBS, tables::PRECURSORS, tables::SLIPS] {
                    for part in &problem.parts {
                        let file = layout.table(table).join(file_of(part));
                        move_away(storage, &file, &quarantine.join(table).join(file_of(part)))?;
                    }
                }
            }
            Remedy::Beginning | Remedy::Compacted | Remedy::Run | Remedy::Reduce => (),
        }
    }
    if has(Remedy::Compacted) {
        let record = layout.compacted();
        if compact(storage, &directory, &without, Some(&quarantine))?.parts == 0 && without.is_empty() {
            // It told of nothing.
            move_away(storage, &record, &quarantine.join("compacted.json"))?;
        }
    }
    let parts = verification.problems.iter().flat_map(|problem| &problem.parts).cloned().collect();
    Ok(Repaired { verification, parts })
}
