//! Verification: every file whole and in its place, every job there once; what is damaged is named, with what to do.
//!
//! Every file can be made again with the same bytes, so a repair moves what is damaged to `run/quarantine/`, and the next
//! run does the rest. A file of an extension that is lost is made again from the footer of any of its parts: what the
//! parts of an extension are follows from it alone. Memory: one part, and the names of all.

use crate::results::commit::Commit;
use crate::results::directory::Results;
use crate::results::extension_file::{Record, refuse_old};
use crate::results::layout::{Layout, PartName};
use crate::results::parts::RowsOfJob;
use crate::results::tables::{self, RowOfJob};
use crate::sweep::Part;
use crate::table::error::{ErrorKind, ResultsError};
use crate::table::file::{Dataset, footer, has_columns};
use crate::table::shown::serialize_path;
use crate::table::storage::StorageError;
use serde::Serialize;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::PathBuf;

/// Staging folder of a repair.
const WRITER: &str = "repair";
/// Keys of a footer that say which program wrote a file, as far as its numbers depend on it.
const VERSIONS: [&str; 2] = ["model_version", "rng_scheme"];

#[derive(Clone, Debug, Default, Serialize)]
pub struct Verification {
    /// Whether nothing is damaged; parts may be missing.
    pub whole: bool,
    /// Damage, in the order in which it was found.
    pub problems: Vec<Problem>,
    /// Table files that are whole.
    pub files: u64,
    pub bytes: u64,
    /// Parts that are done and whole.
    pub parts: u64,
    pub jobs: u64,
    /// Names of the parts that are asked for and not there, damaged ones aside.
    pub missing: Vec<String>,
    pub jobs_missing: u64,
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
    pub remedy: Remedy,
    /// Files that a repair moves away, in this order.
    #[serde(skip)]
    moved: Vec<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Remedy {
    /// Making the file of an extension again.
    Extension,
    /// Moving the file away.
    File,
    /// Moving the files of the part away, and running it.
    Part,
    /// Running the part.
    Run,
    /// Moving the file away by hand: another version of the model made it, and this one cannot make it again.
    Hand,
    Reduce,
}

impl Problem {
    fn new(path: PathBuf, problem: impl Into<String>, remedy: Remedy) -> Self {
        let moved = if matches!(remedy, Remedy::File | Remedy::Extension) {
            vec![path.clone()]
        } else {
            Vec::new()
        };
        Self {
            path,
            problem: problem.into(),
            part: None,
            jobs: Vec::new(),
            remedy,
            moved,
        }
    }
}

impl Verification {
    pub fn wants(&self, remedies: &[Remedy]) -> bool {
        self.problems
            .iter()
            .any(|problem| remedies.contains(&problem.remedy))
    }

    /// Whether a repair has something to do.
    pub fn wants_repair(&self) -> bool {
        self.wants(&[Remedy::Extension, Remedy::File, Remedy::Part])
    }

    /// Whether parts are to be run, damaged or missing.
    pub fn wants_run(&self) -> bool {
        !self.missing.is_empty() || self.wants(&[Remedy::Part, Remedy::Run])
    }
}

/// A directory as its files and footers say that it was, and which of its extensions are to be written again.
type Salvaged<'a> = (Results<'a>, Vec<usize>);

impl<'a> Results<'a> {
    /// Verifies a directory, whatever is damaged. Runs may be at work.
    pub fn verify(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        Ok(examine(layout)?.1)
    }

    /// Moves away what is damaged, so that the next run makes it again; returns what was found.
    pub fn repair(layout: &Layout<'a>) -> Result<Verification, ResultsError> {
        let ((results, lost), verification) = examine(layout)?;
        let [tables, run, quarantine] = [layout.tables(), layout.run(), layout.quarantine()];
        for path in verification
            .problems
            .iter()
            .flat_map(|problem| &problem.moved)
        {
            let below = path
                .strip_prefix(&tables)
                .or_else(|_| path.strip_prefix(&run))
                .unwrap_or(path);
            layout.storage.move_away(path, &quarantine.join(below))?;
        }
        for number in lost {
            let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
            commit.stage_bytes(
                &layout.extension(number),
                results.record(number).text().as_bytes(),
            )?;
            commit.publish()?;
        }
        Ok(verification)
    }
}

fn examine<'a>(layout: &Layout<'a>) -> Result<(Salvaged<'a>, Verification), ResultsError> {
    loop {
        let mut verification = Verification::default();
        let salvaged = salvage(layout, &mut verification.problems)?;
        verify_parts(&salvaged.0, &mut verification)?;
        for name in layout.storage.list(&layout.reduced())? {
            let path = layout.reduced().join(name);
            let damage = damage_in(footer(layout.storage, &path))?;
            verification
                .problems
                .extend(damage.map(|(path, problem)| Problem::new(path, problem, Remedy::Reduce)));
        }
        verification.whole = verification.problems.is_empty();
        // A run may have added a sweep meanwhile, whose parts are then taken for strangers.
        let is_settled = layout.listed_extensions()?.len() <= salvaged.0.extensions().len();
        if verification.whole || is_settled {
            return Ok((salvaged, verification));
        }
    }
}

/// Opens a directory from the files of its extensions, and from footers where these are lost.
fn salvage<'a>(
    layout: &Layout<'a>,
    problems: &mut Vec<Problem>,
) -> Result<Salvaged<'a>, ResultsError> {
    // In this order: whoever has parts there has had its extension there before.
    let mut parts: Vec<(PartName, &str)> = Vec::new();
    for table in [tables::JOBS, tables::SLIPS] {
        parts.extend(
            layout
                .parts_in(&layout.table(table))?
                .into_iter()
                .map(|part| (part, table)),
        );
    }
    parts.sort_unstable();
    let listed = layout.listed_extensions()?;
    if listed.is_empty() {
        refuse_old(layout)?;
        if parts.is_empty() {
            return Err(layout.no_results());
        }
    }
    let (mut records, mut lost) = (Vec::new(), Vec::new());
    for number in 0.. {
        let path = layout.extension(number);
        let is_listed = listed.contains(&number);
        let read = if is_listed {
            Record::read(layout, number)
        } else {
            Err(ResultsError::damaged(&path, "it is missing"))
        };
        let of_file = match read {
            Ok(record) if record.follows(&records) => Ok(record),
            Ok(_) => Err("it does not follow the file before it".to_owned()),
            Err(error) if error.kind == ErrorKind::Damaged => Err(error.problem),
            Err(error) => return Err(error),
        };
        let own = parts.iter().filter(|(part, _)| part.extension == number);
        let files = own.map(|(part, table)| layout.table(table).join(part.file()));
        let of_footers = record_of_footers(layout, files, &records, of_file.as_ref().ok())?;
        let record = match (of_file, of_footers) {
            (Ok(record), None) => record,
            (Err(_), None) if listed.range(number..).next().is_none() => break,
            (Err(problem), None) => {
                let problem = format!(
                    "{problem}, and no part has it in its footer; restore it from a backup"
                );
                return Err(ResultsError::damaged(&path, problem));
            }
            (of_file, Some(record)) => {
                let problem = of_file
                    .err()
                    .unwrap_or_else(|| "it does not belong to these tables".to_owned());
                problems.push(Problem::new(path, problem, Remedy::Extension));
                lost.push(number);
                record
            }
        };
        records.push(record);
    }
    if records.is_empty() {
        let problem = "holds tables, but nothing says of which sweep they are: the files run/extension-*.json are gone, and \
                       no table file is whole";
        return Err(ResultsError::damaged(layout.root(), problem));
    }
    let results = Results::new(layout, records)?;
    results.refuse(
        &results.version_differences(),
        "use the program that wrote it",
    )?;
    Ok((results, lost))
}

/// What the footers of an extension's parts say of it, after these records, if the file of the extension does not say the
/// same: it is believed if one part agrees with it, or if there is one alone.
fn record_of_footers(
    layout: &Layout<'_>,
    files: impl Iterator<Item = PathBuf>,
    before: &[Record],
    of_file: Option<&Record>,
) -> Result<Option<Record>, ResultsError> {
    let mut others: Vec<Record> = Vec::new();
    for file in files {
        let texts = match footer(layout.storage, &file) {
            Ok(texts) => texts,
            Err(error) => {
                error.damage()?;
                continue;
            }
        };
        match Record::of_footer(&texts).filter(|record| record.follows(before)) {
            Some(record) if of_file.is_none_or(|of_file| *of_file == record) => {
                return Ok(of_file.is_none().then_some(record));
            }
            Some(record) if others.last() == Some(&record) => return Ok(Some(record)),
            Some(record) => others.push(record),
            None => (),
        }
    }
    Ok(None)
}

fn verify_parts(results: &Results<'_>, found: &mut Verification) -> Result<(), ResultsError> {
    let layout = results.layout();
    // In this order: whoever has its jobs there has had the rest there before.
    let mut there: HashMap<&str, HashSet<PartName>> = HashMap::new();
    for table in results.tables().rev() {
        there.insert(table, layout.parts_in(&layout.table(table))?);
    }
    let mut planned = HashSet::new();
    for part in results.plan().parts() {
        let name = PartName::from(&*part);
        planned.insert(name);
        let tables = results
            .tables()
            .filter(|table| there[table].contains(&name));
        let tables: Vec<&'static str> = tables.collect();
        let mut damage = damage_of(results, &part, &tables)?;
        if !damage.is_empty() {
            // A retry of failed jobs may have been replacing its files.
            damage = damage_of(results, &part, &tables)?;
        }
        if damage.is_empty() && tables.contains(&tables::JOBS) {
            found.parts += 1;
            found.jobs += part.jobs.len() as u64;
            for table in tables {
                found.bytes += layout.storage.length(&results.part_file(table, &part))?;
                found.files += 1;
            }
        } else if damage.is_empty() {
            found.missing.push(name.to_string());
            found.jobs_missing += part.jobs.len() as u64;
        }
        for problem in &mut damage {
            problem.part = Some(name.to_string());
        }
        if let Some(first) = damage.first_mut() {
            // It stands for the part.
            first.jobs = ids(results, &part).collect();
            if first.remedy == Remedy::Part {
                // Jobs first: a part without them is not done.
                first.moved = results
                    .tables()
                    .rev()
                    .map(|table| results.part_file(table, &part))
                    .collect();
            }
        }
        found.problems.extend(damage);
    }
    found.problems.extend(strangers(results, &planned)?);
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
    let mut damage = Vec::new();
    for table in results.tables() {
        let path = results.part_file(table, part);
        if tables.contains(&table) {
            // What a killed run left is whole, too, and is read by those who read the folder.
            match footer(results.layout().storage, &path) {
                Ok(texts) => {
                    let found = misplacement(results, part, table, &texts);
                    damage
                        .extend(found.map(|(problem, remedy)| Problem::new(path, problem, remedy)));
                }
                Err(error) => {
                    let (path, problem) = error.damage()?;
                    damage.push(Problem::new(path, problem, Remedy::Part));
                }
            }
        } else if tables.contains(&tables::JOBS) {
            let problem = "it is missing, though the jobs of its part are there";
            damage.push(Problem::new(path, problem, Remedy::Run));
        }
    }
    if damage.is_empty() && tables.contains(&tables::JOBS) {
        let found = damage_in(check_rows(results, part))?;
        damage.extend(found.map(|(path, problem)| Problem::new(path, problem, Remedy::Part)));
    }
    // What is moved away is moved as a whole.
    damage.sort_by_key(|problem| problem.remedy != Remedy::Part);
    Ok(damage)
}

/// Why a whole file with these texts in its footer does not belong where it lies.
fn misplacement(
    results: &Results<'_>,
    part: &Part,
    table: &str,
    texts: &BTreeMap<String, String>,
) -> Option<(String, Remedy)> {
    let expected = results.footer(part.extension);
    let differs = |key: &str| texts.get(key).map(String::as_str) != expected.get(key);
    if let Some(key) = VERSIONS.into_iter().find(|key| differs(key)) {
        let [found, own] = [
            texts.get(key).map_or("none", String::as_str),
            expected.get(key).unwrap_or_default(),
        ];
        return Some((
            format!("it has {key} {found}, and this program {own}: keep it elsewhere"),
            Remedy::Hand,
        ));
    }
    if ["sweep", "extension"].into_iter().any(differs) {
        return Some(("it is of another sweep".to_owned(), Remedy::Part));
    }
    let schema = tables::recorded_schema(
        table,
        results.extensions()[part.extension].sweep.recording(),
    );
    (!has_columns(texts, &schema)).then(|| ("it is of another table".to_owned(), Remedy::Part))
}

/// Holds the rows of all tables of a part against each other, and against the plan.
fn check_rows(results: &Results<'_>, part: &Part) -> Result<(), ResultsError> {
    let dataset = |table| {
        Dataset::new(
            results.layout().storage,
            vec![results.part_file(table, part)],
        )
    };
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

/// What lies in the folders of the tables and is no table or no part of the plan.
fn strangers(
    results: &Results<'_>,
    planned: &HashSet<PartName>,
) -> Result<Vec<Problem>, StorageError> {
    let layout = results.layout();
    let mut strangers = Vec::new();
    for name in layout.storage.list(&layout.tables())? {
        if !results.tables().any(|table| name == table) {
            strangers.push((layout.tables().join(name), "it is no table of this sweep"));
        }
    }
    for table in results.tables() {
        let folder = layout.table(table);
        for path in layout
            .storage
            .list(&folder)?
            .into_iter()
            .map(|name| folder.join(name))
        {
            match PartName::of_path(&path) {
                Some(part) if planned.contains(&part) => (),
                Some(_) => strangers.push((
                    path,
                    "the plan has no such part, so its rows are there twice",
                )),
                None => strangers.push((
                    path,
                    "no part has this name, and readers of the folder would read it",
                )),
            }
        }
    }
    Ok(strangers
        .into_iter()
        .map(|(path, problem)| Problem::new(path, problem, Remedy::File))
        .collect())
}

/// What a check found of a file that must be there: its path and what is wrong.
fn damage_in<T>(
    checked: Result<T, ResultsError>,
) -> Result<Option<(PathBuf, String)>, ResultsError> {
    checked.map_or_else(|error| error.damage().map(Some), |_| Ok(None))
}
