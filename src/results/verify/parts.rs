//! The files of each part: all or none, as they were written, with the rows of its jobs. And what else lies among them.

use super::rows::{TableFiles, check};
use super::{Problem, Remedy, Verification, problem_of};
use crate::results::compact::Without;
use crate::results::layout::{EXTENSION, file_of, is_compacted, named_part, part_file, part_name};
use crate::results::manifest::{Directory, DirectoryError};
use crate::results::tables::{self, JobRow, PrecursorRow, SlipRow};
use crate::sweep::{Part, Plan};
use crate::table::arrow::schema;
use crate::table::checksum;
use crate::table::file::{DatasetError, footer, has_columns};
use crate::table::storage::{Storage, StorageError};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// How a part is.
enum State {
    Whole,
    /// Not committed, with files of which readers need know nothing.
    Missing,
    /// One error for each file that is not right.
    Damaged(Vec<DatasetError>),
}

/// Verifies all parts that are not compacted, and the folders of the tables.
pub(super) fn verify(
    storage: &dyn Storage,
    directory: &Directory,
    without: &Without,
    committed: &BTreeSet<String>,
    verification: &mut Verification,
) -> Result<(), DirectoryError> {
    // Number of parts of each epoch.
    let mut planned = vec![0; directory.sweeps().len()];
    for part in Plan::new(directory.sweeps()).parts() {
        planned[part.epoch] = part.index + 1;
        let name = part_name(&part);
        if directory.compaction().holds(part.epoch, part.index) {
            verification.parts += 1;
            verification.jobs += part.jobs.len() as u64;
            twice(storage, directory, &part, verification)?;
            continue;
        }
        let mut state = state(storage, directory, &part)?;
        if matches!(state, State::Damaged(_)) {
            // A retry of failed jobs may have been replacing its files.
            state = self::state(storage, directory, &part)?;
        }
        // The first problem of a part tells its jobs.
        let mut jobs: Vec<String> = ids(directory, &part).collect();
        let mut damaged = |path, problem, remedy| {
            verification.problems.push(Problem {
                parts: vec![name.clone()],
                jobs: std::mem::take(&mut jobs),
                ..Problem::of_file(path, problem, remedy)
            });
        };
        match state {
            State::Whole => {
                verification.parts += 1;
                verification.jobs += part.jobs.len() as u64;
                for table in directory.tables() {
                    verification.count(storage, &directory.layout().table(table).join(part_file(&part)))?;
                }
            }
            State::Damaged(errors) => {
                for error in &errors {
                    damaged(error.path().to_owned(), problem_of(error), Remedy::Part);
                }
            }
            State::Missing if without.parts.contains(&name) => (),
            State::Missing if committed.contains(&name) => {
                let path = directory.layout().table(tables::JOBS).join(part_file(&part));
                damaged(path, "it is missing, though it was committed".to_owned(), Remedy::Run);
            }
            State::Missing if directory.wants(&part) => {
                verification.parts_missing += 1;
                verification.jobs_missing += part.jobs.len() as u64;
            }
            State::Missing => (),
        }
    }
    Ok(strangers(storage, directory, without, &planned, verification)?)
}

/// A compacted part that has files as well.
fn twice(
    storage: &dyn Storage,
    directory: &Directory,
    part: &Part,
    verification: &mut Verification,
) -> Result<(), StorageError> {
    for table in directory.tables() {
        let path = directory.layout().table(table).join(part_file(part));
        if storage.exists(&path).map_err(StorageError::at("look up", &path))? {
            let problem = "its rows are in the compacted files as well";
            verification.problems.push(Problem::of_file(path, problem, Remedy::File));
        }
    }
    Ok(())
}

/// The ids of the jobs of a part, in order.
fn ids(directory: &Directory, part: &Part) -> impl Iterator<Item = String> {
    let sweep = &directory.sweeps()[part.epoch];
    part.jobs.iter().map(|job| sweep.job_id(&job.parameters).to_string())
}

fn state(storage: &dyn Storage, directory: &Directory, part: &Part) -> Result<State, StorageError> {
    let path = |table: &str| directory.layout().table(table).join(part_file(part));
    let exists = |path: &Path| storage.exists(path).map_err(StorageError::at("look up", path));
    // First, as it is the last that a run puts in its place.
    let is_done = exists(&path(tables::JOBS))?;
    let mut errors = Vec::new();
    for table in directory.tables() {
        let path = path(table);
        if !is_done && !exists(&path)? {
            continue;
        }
        // What a killed run left is whole, too, and is read by those who read the folder.
        if let Err(error) = checksum::check(storage, &path).and_then(|_| belongs(storage, directory, part, &path)) {
            errors.push(error);
        }
    }
    if !errors.is_empty() {
        return Ok(State::Damaged(errors));
    }
    if !is_done {
        return Ok(State::Missing);
    }
    let files = TableFiles {
        jobs: vec![path(tables::JOBS)],
        slips: vec![path(tables::SLIPS)],
        precursors: directory.records_precursors().then(|| vec![path(tables::PRECURSORS)]),
    };
    let mut ids = ids(directory, part);
    let checked = check(storage, files, |job| {
        let planned = ids.next();
        if planned.as_ref() == Some(&job.id) {
            return Ok(());
        }
        let problem = format!("it has job {} where the plan has {}", job.id, planned.as_deref().unwrap_or("none"));
        Err(DatasetError::damaged(&job.path)(problem))
    });
    Ok(match checked {
        Err(error) => State::Damaged(vec![error]),
        Ok(()) => match ids.next() {
            None => State::Whole,
            Some(id) => {
                let problem = format!("it ends where the plan has job {id}");
                State::Damaged(vec![DatasetError::damaged(&path(tables::JOBS))(problem)])
            }
        },
    })
}

/// Whether a file tells the sweep and the columns of its place.
fn belongs(storage: &dyn Storage, directory: &Directory, part: &Part, path: &Path) -> Result<(), DatasetError> {
    let told = footer(storage, path)?;
    if told.get("sweep").is_none_or(|text| text != directory.sweeps()[part.epoch].text()) {
        return Err(DatasetError::damaged(path)("it is of another sweep"));
    }
    let table = path.parent().and_then(|folder| folder.file_name()).unwrap_or_default();
    let schema = [
        (tables::SLIPS, schema::<SlipRow<'_>>()),
        (tables::PRECURSORS, schema::<PrecursorRow<'_>>()),
        (tables::JOBS, schema::<JobRow>()),
    ];
    if schema.iter().any(|(name, schema)| table == *name && has_columns(&told, schema)) {
        Ok(())
    } else {
        Err(DatasetError::damaged(path)("it is of another table"))
    }
}

/// Names in the folder of the tables that are none of a table, a part or a compacted file.
fn strangers(
    storage: &dyn Storage,
    directory: &Directory,
    without: &Without,
    planned: &[u64],
    verification: &mut Verification,
) -> Result<(), StorageError> {
    let layout = directory.layout();
    let tables: Vec<&str> = directory.tables().collect();
    let mut report = |path: PathBuf, problem: &str| {
        verification.problems.push(Problem::of_file(path, problem, Remedy::File));
    };
    let list = |folder: &Path| storage.list(folder).map_err(StorageError::at("list", folder));
    for name in list(&layout.tables())? {
        if !tables.iter().any(|table| name == *table) {
            report(layout.tables().join(name), "it is no table of this sweep");
        }
    }
    for table in tables {
        let folder = layout.table(table);
        let compacted = directory.compaction().of_table(table);
        for name in list(&folder)? {
            let path = folder.join(&name);
            let name = name.to_string_lossy();
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            match named_part(&stem) {
                Some((epoch, index)) if *name == file_of(&stem) => {
                    if planned.get(epoch).is_none_or(|&parts| index >= parts) {
                        report(path, "the plan has no such part");
                    }
                }
                _ if is_compacted(&name) => {
                    if !compacted.iter().any(|file| *file == name) && !without.files.contains(&path) {
                        report(path, "the record of compacted files does not have it");
                    }
                }
                _ if path.extension().is_some_and(|extension| extension == EXTENSION) => {
                    report(path, "no part is called so: its rows are there twice, or belong elsewhere");
                }
                _ => report(path, "it is no table file, which breaks readers of the folder"),
            }
        }
    }
    Ok(())
}
