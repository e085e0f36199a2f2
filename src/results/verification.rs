//! Verification: every file intact and in its place, every job there once; damage is listed, with what to do.
//!
//! `run` makes every table file again with the same bytes, so a repair only moves damaged files to `run/quarantine/`.
//! Memory: one part, and the names of all.

use crate::results::commit::Commit;
use crate::results::directory::{Results, STRANGER};
use crate::results::extension_file;
use crate::results::layout::{Layout, is_table_file};
use crate::results::parts::RowsOfJob;
use crate::results::pending::{Pending, Retry};
use crate::results::tables::{RecordedTable, RowOfJob};
use crate::sweep::{Outline, Part, PartName};
use crate::table::error::ResultsError;
use crate::table::file::{DataFile, Footer, check_count};
use crate::table::shown::{serialize_path, shown};
use crate::table::storage::StorageError;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

#[derive(Clone, Debug, Default, Serialize)]
pub struct Verification {
    /// Whether nothing is damaged; parts may be missing.
    pub whole: bool,
    /// Damage, in the order in which it was found.
    pub problems: Vec<Problem>,
    /// Other files among tables and reduced data, which no command reads: paths, as messages show them.
    pub passed_over: Vec<String>,
    pub files: u64,
    pub bytes: u64,
    /// Parts that are done and intact.
    pub parts: u64,
    pub jobs: u64,
    /// Names of the missing parts, without damaged ones.
    pub missing: Vec<String>,
    /// Their jobs, without those that are spilled.
    pub jobs_missing: u64,
    pub jobs_spilled: u64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Problem {
    #[serde(serialize_with = "serialize_path")]
    pub path: PathBuf,
    pub problem: String,
    /// The part that a repair moves away as a whole.
    pub part: Option<String>,
    /// Ids of its jobs, with its first problem.
    pub jobs: Vec<String>,
}

impl Problem {
    fn new(path: PathBuf, problem: impl Into<String>) -> Self {
        Self {
            path,
            problem: problem.into(),
            part: None,
            jobs: Vec::new(),
        }
    }
}

impl<'a> Results<'a> {
    /// Verifies a directory. Runs may be at work.
    pub fn verify(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        Ok(examine(layout)?.1)
    }

    /// Moves damaged files away, so that the next run makes them again; returns what was found.
    pub fn repair(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        let (results, verification) = examine(layout)?;
        for problem in &verification.problems {
            match problem.part.as_deref().and_then(PartName::parse) {
                None => move_away(layout, &problem.path)?,
                // Its first problem has moved the whole part.
                Some(_) if problem.jobs.is_empty() => (),
                // Jobs first: a part without them is not done.
                Some(part) => results.tables().rev().try_for_each(|table| {
                    move_away(layout, &layout.table(table).join(part.file()))
                })?,
            }
        }
        results.write_copies(|| Commit::begin(layout))?;
        Ok(verification)
    }
}

/// Moves a file, if it is there, to the quarantine, under a name that is free.
fn move_away(layout: &Layout<'_>, path: &Path) -> Result<(), StorageError> {
    let storage = layout.storage;
    if !storage.exists(path)? {
        return Ok(());
    }
    let places = [layout.tables(), layout.run(), layout.root().to_owned()];
    let below = places
        .iter()
        .find_map(|folder| path.strip_prefix(folder).ok());
    let target = layout.quarantine().join(below.unwrap_or(path));
    let folder = target.parent().unwrap_or(&target);
    storage.ensure_folder(folder)?;
    let mut free = target.clone();
    let mut number = 0;
    while storage.exists(&free)? {
        number += 1;
        free = target.with_added_extension(number.to_string());
    }
    storage.rename(path, &free)?;
    let mut folders = [Some(folder), path.parent()].into_iter().flatten();
    folders.try_for_each(|folder| storage.sync_folder(folder))
}

fn examine<'a>(layout: &Layout<'a>) -> Result<(Results<'a>, Verification), ResultsError> {
    loop {
        let mut verification = Verification::default();
        let found = extension_file::read(layout)?;
        if found.records.is_empty() {
            return Err(layout.no_results());
        }
        let problems = found.unsound.into_iter();
        verification
            .problems
            .extend(problems.map(|(path, problem)| Problem::new(path, problem)));
        let results = Results::new(layout, found.records)?;
        results.refuse(
            &results.version_differences(),
            "use the program that wrote it",
        )?;
        verify_parts(&results, &mut verification)?;
        for path in table_files(layout, &layout.reduced(), &mut verification)? {
            let file = DataFile::with_footer(path, Footer::empty());
            let damage = damage_in(file.check(layout.storage))?;
            verification.problems.extend(damage);
        }
        verification.whole = verification.problems.is_empty();
        // A run may have added a sweep meanwhile, whose parts are then taken for strangers.
        let is_settled = layout.listed_extensions()?.len() <= results.extensions().len();
        if verification.whole || is_settled {
            return Ok((results, verification));
        }
    }
}

/// The table files in a folder; what else lies there is noted as passed over.
fn table_files(
    layout: &Layout<'_>,
    folder: &Path,
    found: &mut Verification,
) -> Result<Vec<PathBuf>, StorageError> {
    let mut files = Vec::new();
    for name in layout.storage.list(folder)? {
        let path = folder.join(&name);
        if is_table_file(&name) {
            files.push(path);
        } else {
            found.passed_over.push(shown(&path).to_string());
        }
    }
    Ok(files)
}

fn verify_parts(results: &Results<'_>, found: &mut Verification) -> Result<(), ResultsError> {
    let layout = results.layout();
    for name in layout.storage.list(&layout.tables())? {
        if !results.tables().any(|table| name == table.word()) {
            let path = layout.tables().join(name);
            found.passed_over.push(shown(&path).to_string());
        }
    }
    // In this order: a part that has its jobs had its other files before.
    let mut there: BTreeSet<PathBuf> = BTreeSet::new();
    for table in results.tables().rev() {
        there.extend(table_files(layout, &layout.table(table), found)?);
    }
    let mut sound: Vec<Outline> = Vec::new();
    let mut done = BTreeSet::new();
    for part in results.plan().parts() {
        let is_there = |table: &RecordedTable| there.remove(&results.part_file(*table, &part));
        let tables: Vec<RecordedTable> = results.tables().filter(is_there).collect();
        if verify_part(results, &part, &tables, found)? {
            sound.push((*part).clone());
            if tables.contains(&RecordedTable::Jobs) {
                done.insert(part.name);
            }
        }
    }
    let pending = Pending::with(results, &sound, Retry::default(), done)?;
    let overview = pending.overview(false, |_, _, _| ())?;
    found.jobs_missing = overview.jobs_missing;
    found.jobs_spilled = overview.jobs_spilled;
    // What is left belongs to no part.
    let strangers = there.into_iter();
    found
        .problems
        .extend(strangers.map(|path| Problem::new(path, STRANGER)));
    Ok(())
}

/// Verifies a part that has files in these tables; returns whether it is sound.
fn verify_part(
    results: &Results<'_>,
    part: &Part,
    tables: &[RecordedTable],
    found: &mut Verification,
) -> Result<bool, ResultsError> {
    let name = part.name.to_string();
    let mut damage = damage_of(results, part, tables)?;
    if !damage.is_empty() {
        // A retry of failed jobs may have been replacing its files.
        damage = damage_of(results, part, tables)?;
    }
    if let Some(first) = damage.first_mut() {
        first.jobs = ids(results, part).collect();
        for problem in &mut damage {
            problem.part = Some(name.clone());
        }
        found.problems.extend(damage);
        return Ok(false);
    }
    if !tables.contains(&RecordedTable::Jobs) {
        found.missing.push(name);
        return Ok(true);
    }
    found.parts += 1;
    found.jobs += part.jobs.len() as u64;
    found.files += tables.len() as u64;
    for table in tables {
        let file = results.part_file(*table, part);
        found.bytes += results.layout().storage.length(&file)?;
    }
    Ok(true)
}

fn ids(results: &Results<'_>, part: &Part) -> impl Iterator<Item = String> {
    (0..part.jobs.len()).map(|position| results.job_id(part, position))
}

/// What is wrong with the files of a part, which it has in these tables.
fn damage_of(
    results: &Results<'_>,
    part: &Part,
    tables: &[RecordedTable],
) -> Result<Vec<Problem>, ResultsError> {
    let layout = results.layout();
    let has_jobs = tables.contains(&RecordedTable::Jobs);
    let mut damage = Vec::new();
    for table in results.tables() {
        let file = results.file_in(&layout.tables(), table, part.name);
        if tables.contains(&table) {
            // Files that a killed run left are intact, too, as other programs read them.
            damage.extend(damage_in(file.check(layout.storage))?);
        } else if has_jobs {
            let problem = "it is missing, though the jobs of its part are there";
            damage.push(Problem::new(file.path, problem));
        }
    }
    if damage.is_empty() && has_jobs {
        damage.extend(damage_in(check_rows(results, part))?);
    }
    Ok(damage)
}

/// Compares the rows of all tables of a part with each other, and with the plan.
fn check_rows(results: &Results<'_>, part: &Part) -> Result<(), ResultsError> {
    let path = results.part_file(RecordedTable::Jobs, part);
    let damaged = |problem: String| Err(ResultsError::damaged(&path, problem));
    let rows = results.dataset_of(RecordedTable::Jobs, part.name).rows();
    let jobs: Vec<RowsOfJob> = rows.collect::<Result<_, _>>()?;
    for (expected, job) in ids(results, part).zip(&jobs) {
        if job.job_id != expected {
            let found = &job.job_id;
            return damaged(format!("it has job {found} where the plan has {expected}"));
        }
    }
    if jobs.len() != part.jobs.len() {
        let found = jobs.len();
        let planned = part.jobs.len();
        return damaged(format!("it has {found} jobs, and its part {planned}"));
    }
    let mut others = results
        .tables()
        .filter(|table| *table != RecordedTable::Jobs);
    others.try_for_each(|table| check_counts(results, part, &jobs, table))
}

/// Compares the rows of a table of a part with what its jobs say.
fn check_counts(
    results: &Results<'_>,
    part: &Part,
    jobs: &[RowsOfJob],
    table: RecordedTable,
) -> Result<(), ResultsError> {
    let path = results.part_file(table, part);
    let mut counts = vec![0; jobs.len()];
    let mut at = 0;
    for row in results.dataset_of(table, part.name).rows() {
        let RowOfJob { job_id } = row?;
        // Rows stand in the order of the jobs.
        let passed = jobs[at..].iter().take_while(|job| job.job_id != job_id);
        at += passed.count();
        let Some(count) = counts.get_mut(at) else {
            let problem = format!("it has rows of job {job_id}, which its part does not have");
            return Err(ResultsError::damaged(&path, problem));
        };
        *count += 1;
    }
    for (job, rows) in jobs.iter().zip(counts) {
        let problem =
            |problem| ResultsError::damaged(&path, format!("of job {} {problem}", job.job_id));
        check_count(rows, &job.count(table)).map_err(problem)?;
    }
    Ok(())
}

/// What a check found of a file that must be there.
fn damage_in(checked: Result<(), ResultsError>) -> Result<Option<Problem>, ResultsError> {
    let damage = checked.err().map(ResultsError::damage).transpose()?;
    Ok(damage.map(|(path, problem)| Problem::new(path, problem)))
}
