//! The files of each part, alone or compacted with its neighbours: in all tables or in none, as they were written, with
//! the rows of its jobs. And what else lies among them.

use super::rows::{Files, check_rows};
use super::{Problem, Remedy, Verification, damage_in};
use crate::results::error::ResultsError;
use crate::results::events::{CommittedParts, Kept};
use crate::results::handle::Results;
use crate::results::layout::{TableFile, part_name};
use crate::results::tables::{self, JobRow, PrecursorRow, SlipRow};
use crate::sweep::Part;
use crate::table::arrow::schema;
use crate::table::file::{DatasetError, FILE_EXTENSION, footer, has_columns};
use crate::table::storage::StorageError;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::{Path, PathBuf};

/// Files that do not belong where they lie, with what is wrong.
type Unexpected = Vec<(PathBuf, &'static str)>;

/// How the files with the rows of the same parts are.
enum State {
    Whole,
    /// Not committed, with files of which readers need know nothing.
    Missing,
    Damaged(Damage),
}

/// Files that are not right, with what is wrong.
type Damage = Vec<(PathBuf, String)>;

/// Compacted files, by extension and first part: the last part, and the file of each table.
type Compacted = BTreeMap<(usize, u64), (u64, BTreeMap<&'static str, PathBuf>)>;

/// Verifies all files of the tables. `committed` has the parts that were committed, as far as that is known.
pub(super) fn verify(
    results: &Results<'_>,
    committed: &CommittedParts,
    verification: &mut Verification,
) -> Result<(), ResultsError> {
    let (mut compacted, mut unexpected) = compacted_files(results)?;
    let mut check = FilesCheck { results, committed, verification };
    // Extensions and numbers of all parts.
    let mut planned = HashSet::new();
    for extension in 0..results.extensions().len() {
        let mut parts = results.plan().parts_of(extension);
        loop {
            let here = parts.clone();
            let Some(part) = parts.next() else { break };
            planned.insert((extension, part.index));
            let Some((last, files)) = compacted.remove(&(extension, part.index)) else {
                check.part(&part)?;
                continue;
            };
            let members = usize::try_from(last - part.index).map_or(usize::MAX, |others| others.saturating_add(1));
            planned.extend(parts.by_ref().take(members - 1).map(|part| (extension, part.index)));
            check.compacted(&TableFile::compacted(extension, &(part.index..=last), "*"), &files, || {
                here.clone().take(members)
            })?;
        }
    }
    unexpected.extend(
        compacted
            .into_values()
            .flat_map(|(_, files)| files.into_values())
            .map(|path| (path, "the plan has no such part")),
    );
    unexpected.extend(unexpected_files(results, &planned)?);
    let problems = unexpected.into_iter().map(|(path, problem)| Problem::of_file(path, problem, Remedy::File));
    verification.problems.extend(problems);
    Ok(())
}

/// A verification of the files of the tables.
struct FilesCheck<'a> {
    results: &'a Results<'a>,
    committed: &'a CommittedParts,
    verification: &'a mut Verification,
}

impl FilesCheck<'_> {
    /// A part with files of its own, or without any.
    fn part(&mut self, part: &Part) -> Result<(), ResultsError> {
        let results = self.results;
        let files: Files = results.tables().map(|table| (table, results.part_file(table, part))).collect();
        let jobs_file = results.part_file(tables::JOBS, part);
        let state = || -> Result<State, DatasetError> {
            let is_done = results.layout().storage.exists(&jobs_file)?;
            state(results, part.extension, &files, is_done, ids(results, part))
        };
        let mut found = state()?;
        if matches!(found, State::Damaged(_)) {
            // A retry of failed jobs may have been replacing its files.
            found = state()?;
        }
        let name = part_name(part);
        match found {
            State::Whole => self.whole(&files, [part.jobs.len()].into_iter())?,
            State::Damaged(damage) => self.damaged(damage, &files, &[name], ids(results, part).collect()),
            State::Missing if let Some(kept) = self.committed.get(part) => {
                self.verification.lost_compacted |= kept == Kept::Compacted;
                let problem = Problem::of_file(jobs_file, "it is missing, though it was committed", Remedy::Run);
                let jobs = ids(results, part).collect();
                self.verification.problems.push(Problem { parts: vec![name], jobs, ..problem });
            }
            State::Missing => {
                self.verification.parts_missing += 1;
                self.verification.jobs_missing += part.jobs.len() as u64;
            }
        }
        Ok(())
    }

    /// Compacted parts. `pattern` is the name of their files but for the checksums.
    fn compacted<P: Iterator<Item = Part>>(
        &mut self,
        pattern: &TableFile,
        found: &BTreeMap<&'static str, PathBuf>,
        parts: impl Fn() -> P,
    ) -> Result<(), ResultsError> {
        let results = self.results;
        let missing = |table| results.layout().table(table).join(pattern.to_string());
        let path = |table| found.get(table).cloned().unwrap_or_else(|| missing(table));
        let files: Files = results.tables().map(|table| (table, path(table))).collect();
        let planned = parts().flat_map(|part| ids(results, &part).collect::<Vec<_>>());
        let damage = match state(results, pattern.extension, &files, true, planned)? {
            State::Damaged(damage) => damage,
            State::Whole | State::Missing => {
                self.whole(&files, parts().map(|part| part.jobs.len()))?;
                for part in parts() {
                    for path in results.tables().map(|table| results.part_file(table, &part)) {
                        if results.layout().storage.exists(&path)? {
                            let problem = "its rows are in a compacted file as well";
                            self.verification.problems.push(Problem::of_file(path, problem, Remedy::File));
                        }
                    }
                }
                return Ok(());
            }
        };
        let (mut lost, mut jobs) = (Vec::new(), Vec::new());
        for part in parts() {
            if results.layout().storage.exists(&results.part_file(tables::JOBS, &part))? {
                self.part(&part)?;
            } else {
                lost.push(part_name(&part));
                jobs.extend(ids(results, &part));
            }
        }
        self.verification.lost_compacted |= !lost.is_empty();
        self.damaged(damage, &files, &lost, jobs);
        Ok(())
    }

    /// Counts parts with these numbers of jobs.
    fn whole(&mut self, files: &Files, jobs: impl Iterator<Item = usize>) -> Result<(), StorageError> {
        for jobs in jobs {
            self.verification.parts += 1;
            self.verification.jobs += jobs as u64;
        }
        for (_, path) in files {
            self.verification.bytes += self.results.layout().storage.length(path)?;
            self.verification.files += 1;
        }
        Ok(())
    }

    /// Reports damaged files of parts that are to be run again. The first problem has their jobs and all their files.
    fn damaged(&mut self, damage: Damage, files: &Files, parts: &[String], mut jobs: Vec<String>) {
        // Jobs first: a part without them is not done.
        let mut moved: Vec<PathBuf> = files.iter().rev().map(|(_, path)| path.clone()).collect();
        for (path, problem) in damage {
            let problem = Problem::of_file(path, problem, Remedy::Part);
            let (jobs, moved) = (std::mem::take(&mut jobs), std::mem::take(&mut moved));
            self.verification.problems.push(Problem { parts: parts.to_vec(), jobs, moved, ..problem });
        }
    }
}

/// The ids of the jobs of a part, in order.
fn ids(results: &Results<'_>, part: &Part) -> impl Iterator<Item = String> {
    (0..part.jobs.len()).map(|position| results.job_id(part, position))
}

/// Looks at the files with the rows of these planned jobs.
fn state(
    results: &Results<'_>,
    extension: usize,
    files: &Files,
    is_done: bool,
    planned: impl Iterator<Item = String>,
) -> Result<State, DatasetError> {
    let mut damage = Damage::new();
    for (table, path) in files {
        // What a killed run left is whole, too, and is read by those who read the folder.
        if is_done || results.layout().storage.exists(path)? {
            damage.extend(damage_in(check_file(results, extension, table, path))?);
        }
    }
    if damage.is_empty() && !is_done {
        return Ok(State::Missing);
    }
    if damage.is_empty() {
        damage.extend(damage_in(check_rows(results, files, planned))?);
    }
    Ok(if damage.is_empty() { State::Whole } else { State::Damaged(damage) })
}

/// Whether a file is as it was written, and has the checksum, the sweep and the columns of its place.
fn check_file(results: &Results<'_>, extension: usize, table: &str, path: &Path) -> Result<(), DatasetError> {
    let damaged = |problem| Err(DatasetError::damaged(path)(problem));
    let (checksum, footer) = footer(results.layout().storage, path)?;
    let named = TableFile::of_path(path).and_then(|file| file.checksum);
    if named.is_some_and(|named| !checksum.starts_with(&named)) {
        return damaged("it is another file than its name says");
    }
    let sweep = results.extensions().get(extension).map(|extension| extension.sweep.text());
    if sweep.is_none() || footer.get("sweep").map(String::as_str) != sweep {
        return damaged("it is of another sweep");
    }
    let schemas = [
        (tables::SLIPS, schema::<SlipRow<'_>>()),
        (tables::PRECURSORS, schema::<PrecursorRow<'_>>()),
        (tables::JOBS, schema::<JobRow>()),
    ];
    if !schemas.iter().any(|(name, schema)| table == *name && has_columns(&footer, schema)) {
        return damaged("it is of another table");
    }
    Ok(())
}

/// The compacted files of all tables; and those that hold parts which are in another one as well.
fn compacted_files(results: &Results<'_>) -> Result<(Compacted, Unexpected), ResultsError> {
    let mut all = Vec::new();
    for table in results.tables() {
        for file in results.layout().table_files(table)?.filter(TableFile::is_compacted) {
            let path = results.layout().table(table).join(file.to_string());
            all.push((file, table, path));
        }
    }
    let goes_with =
        |one: &TableFile, other: &TableFile| (one.extension, one.parts()) == (other.extension, other.parts());
    all.sort_by_key(|(file, table, _)| (file.extension, file.first, file.last, *table));
    let overlaps = all.windows(2).any(|pair| match pair {
        [(one, table, _), (next, next_table, _)] if goes_with(one, next) => table == next_table,
        [(one, ..), (next, ..)] => one.extension == next.extension && next.first <= one.last,
        _ => false,
    });
    if overlaps {
        // Those that are right come first, so that others are the unexpected ones.
        let mut judged = Vec::new();
        for (file, table, path) in all {
            let is_damaged = damage_in(check_file(results, file.extension, table, &path))?.is_some();
            judged.push((is_damaged, file, table, path));
        }
        judged.sort_by_key(|(is_damaged, ..)| *is_damaged);
        all = judged.into_iter().map(|(_, file, table, path)| (file, table, path)).collect();
    }
    let (mut compacted, mut unexpected) = (Compacted::new(), Unexpected::new());
    for (file, table, path) in all {
        let (extension, first, last) = (file.extension, file.first, file.last);
        let before = compacted.range(..=(extension, last)).next_back();
        let neighbour = before.filter(|((of, _), (end, _))| *of == extension && *end >= first);
        let is_free = neighbour
            .is_none_or(|((_, begin), (end, files))| (*begin, *end) == (first, last) && !files.contains_key(table));
        if is_free {
            compacted.entry((extension, first)).or_insert_with(|| (last, BTreeMap::new())).1.insert(table, path);
        } else {
            unexpected.push((path, "its parts are in another file as well"));
        }
    }
    Ok((compacted, unexpected))
}

/// What lies in the folders of the tables and is no table, no part of the plan and no compacted file.
fn unexpected_files(results: &Results<'_>, planned: &HashSet<(usize, u64)>) -> Result<Unexpected, StorageError> {
    let layout = results.layout();
    let tables: BTreeSet<&str> = results.tables().collect();
    let mut unexpected = Unexpected::new();
    for name in layout.storage.list(&layout.tables())? {
        if !tables.iter().any(|table| name == *table) {
            unexpected.push((layout.tables().join(name), "it is no table of this sweep"));
        }
    }
    for table in results.tables() {
        let folder = layout.table(table);
        for name in layout.storage.list(&folder)? {
            let path = folder.join(name);
            let is_table_file = path.extension().is_some_and(|extension| extension == FILE_EXTENSION);
            let problem = match TableFile::of_path(&path) {
                Some(file) if file.is_compacted() => continue,
                Some(file) if planned.contains(&(file.extension, file.first)) => continue,
                Some(_) => "the plan has no such part",
                None if is_table_file => "no part has this name: its rows are there twice, or belong elsewhere",
                None => "it is no table file, which breaks readers of the folder",
            };
            unexpected.push((path, problem));
        }
    }
    Ok(unexpected)
}
