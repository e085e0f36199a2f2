//! Verification: every file whole and in its place, every job there once; what is damaged is named, with what to do.
//!
//! Every table file can be made again with the same bytes, so a repair moves what is damaged to `run/quarantine/`, and the
//! next run does the rest. Memory: one part, and the names of all.

use crate::results::commit::Commit;
use crate::results::directory::{Results, STRANGER};
use crate::results::extension_file;
use crate::results::layout::{DoneParts, Layout, PartName, is_table_file};
use crate::results::parts::RowsOfJob;
use crate::results::pending::{Pending, Retry};
use crate::results::tables::{self, RowOfJob};
use crate::sweep::{Outline, Part};
use crate::table::error::ResultsError;
use crate::table::file::{DataFile, Footer};
use crate::table::shown::{serialize_path, shown};
use crate::table::storage::StorageError;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Staging folder of a repair.
const WRITER: &str = "repair";

#[derive(Clone, Debug, Default, Serialize)]
pub struct Verification {
    /// Whether nothing is damaged; parts may be missing.
    pub whole: bool,
    /// Damage, in the order in which it was found.
    pub problems: Vec<Problem>,
    /// What lies among tables and reduced data, is not of them, and is read by no command: paths, as messages show them.
    pub passed_over: Vec<String>,
    /// Table files that are whole.
    pub files: u64,
    pub bytes: u64,
    /// Parts that are done and whole.
    pub parts: u64,
    pub jobs: u64,
    /// Names of the parts that are asked for and not there, damaged ones aside.
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
    /// The part that is run again for it.
    pub part: Option<String>,
    /// Ids of its jobs.
    pub jobs: Vec<String>,
    /// Files that a repair moves away, in this order.
    #[serde(skip)]
    moved: Vec<PathBuf>,
}

impl Problem {
    fn new(path: PathBuf, problem: impl Into<String>) -> Self {
        Self {
            moved: vec![path.clone()],
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

    /// Moves away what is damaged, so that the next run makes it again; returns what was found.
    pub fn repair(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        let (results, verification) = examine(layout)?;
        let quarantine = layout.quarantine();
        for path in verification
            .problems
            .iter()
            .flat_map(|problem| &problem.moved)
        {
            let below = [layout.tables(), layout.run(), layout.root().to_owned()]
                .iter()
                .find_map(|folder| path.strip_prefix(folder).ok())
                .unwrap_or(path);
            layout.storage.move_away(path, &quarantine.join(below))?;
        }
        results.write_copies(|| Commit::begin(layout, &layout.staging(WRITER)))?;
        Ok(verification)
    }
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
        if !results.tables().any(|table| name == table) {
            let path = layout.tables().join(name);
            found.passed_over.push(shown(&path).to_string());
        }
    }
    // In this order: a worker that has its jobs there has had the rest there before.
    let mut there: BTreeMap<&str, BTreeSet<PathBuf>> = BTreeMap::new();
    for table in results.tables().rev() {
        let files = table_files(layout, &layout.table(table), found)?;
        there.insert(table, files.into_iter().collect());
    }
    let mut planned = BTreeSet::new();
    let mut sound: Vec<Outline> = Vec::new();
    let mut done = DoneParts::default();
    for part in results.plan().parts() {
        let name = PartName::from(&*part);
        planned.insert(name);
        let is_there = |table: &&str| there[table].contains(&results.part_file(table, &part));
        let tables: Vec<&'static str> = results.tables().filter(is_there).collect();
        let mut damage = damage_of(results, &part, &tables)?;
        if !damage.is_empty() {
            // A retry of failed jobs may have been replacing its files.
            damage = damage_of(results, &part, &tables)?;
        }
        for problem in &mut damage {
            problem.part = Some(name.to_string());
        }
        if let Some(first) = damage.first_mut() {
            // It stands for the part.
            first.jobs = ids(results, &part).collect();
            // Jobs first: a part without them is not done.
            first.moved = results
                .tables()
                .rev()
                .map(|table| results.part_file(table, &part))
                .collect();
            found.problems.extend(damage);
            continue;
        }
        sound.push((*part).clone());
        if tables.contains(&tables::JOBS) {
            done.0.insert(name);
            found.parts += 1;
            found.jobs += part.jobs.len() as u64;
            for table in tables {
                found.bytes += layout.storage.length(&results.part_file(table, &part))?;
                found.files += 1;
            }
        } else {
            found.missing.push(name.to_string());
        }
    }
    let pending = Pending::with(results, &sound, Retry::default(), done)?;
    let overview = pending.overview(false, |_, _, _| ())?;
    found.jobs_missing = overview.jobs_missing;
    found.jobs_spilled = overview.jobs_spilled;
    let strangers = there
        .into_values()
        .flatten()
        .filter(|path| !PartName::of_path(path).is_some_and(|part| planned.contains(&part)));
    found
        .problems
        .extend(strangers.map(|path| Problem::new(path, STRANGER)));
    Ok(())
}

/// The ids of the jobs of a part, in order.
fn ids(results: &Results<'_>, part: &Part) -> impl Iterator<Item = String> {
    (0..part.jobs.len()).map(|position| results.job_id(part, position))
}

/// What is wrong with the files of a part, which it has in these tables.
fn damage_of(
    results: &Results<'_>,
    part: &Part,
    tables: &[&'static str],
) -> Result<Vec<Problem>, ResultsError> {
    let layout = results.layout();
    let has_jobs = tables.contains(&tables::JOBS);
    let mut damage = Vec::new();
    for table in results.tables() {
        let file = results.file_in(&layout.tables(), table, PartName::from(&**part));
        if tables.contains(&table) {
            // What a killed run left is whole, too, and is read by those who read the folder.
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
    let dataset = |table| results.dataset_of(table, PartName::from(&**part));
    let path = results.part_file(tables::JOBS, part);
    let jobs = dataset(tables::JOBS)
        .rows::<RowsOfJob>()
        .collect::<Result<Vec<_>, _>>()?;
    let jobs: Vec<RowsOfJob> = jobs.into_iter().flatten().collect();
    let mut planned = 0;
    for (expected, job) in ids(results, part).zip(&jobs) {
        if job.job_id != expected {
            return Err(ResultsError::damaged(
                &path,
                format!("it has job {} where the plan has {expected}", job.job_id),
            ));
        }
        planned += 1;
    }
    if jobs.len() != planned || part.jobs.len() != planned {
        let problem = format!(
            "it has {} jobs, and its part {}",
            jobs.len(),
            part.jobs.len()
        );
        return Err(ResultsError::damaged(&path, problem));
    }
    for table in results.tables().filter(|table| *table != tables::JOBS) {
        let path = results.part_file(table, part);
        let (mut rows, mut at) = (vec![0; jobs.len()], 0);
        for batch in dataset(table).rows::<RowOfJob>() {
            for RowOfJob { job_id } in batch? {
                // Rows stand in the order of the jobs.
                at += jobs[at..]
                    .iter()
                    .take_while(|job| job.job_id != job_id)
                    .count();
                *rows.get_mut(at).ok_or_else(|| {
                    let problem = format!(
                        "it has rows of job {job_id} that are not its part's, or not there"
                    );
                    ResultsError::damaged(&path, problem)
                })? += 1;
            }
        }
        for (job, rows) in jobs.iter().zip(rows) {
            let problem =
                |problem| ResultsError::damaged(&path, format!("of job {} {problem}", job.job_id));
            job.count(table).check(rows).map_err(problem)?;
        }
    }
    Ok(())
}

/// What a check found of a file that must be there.
fn damage_in<T>(checked: Result<T, ResultsError>) -> Result<Option<Problem>, ResultsError> {
    checked.map_or_else(
        |error| {
            let (path, problem) = error.damage()?;
            Ok(Some(Problem::new(path, problem)))
        },
        |_| Ok(None),
    )
}
