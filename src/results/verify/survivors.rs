//! What of damaged compacted files can be kept: the parts all of whose rows are in files that are whole.
//!
//! Memory: an entry for every job in the compacted files, which nothing else here needs.

use super::problem_of;
use super::rows::{groups, jobs};
use crate::results::compaction::{Compaction, compacted_files};
use crate::results::layout::{compacted_file, part_file, part_name};
use crate::results::manifest::Directory;
use crate::results::part::label;
use crate::results::tables;
use crate::sweep::Plan;
use crate::table::checksum;
use crate::table::file::DatasetError;
use crate::table::storage::{Storage, StorageError};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::path::PathBuf;

/// What can be kept, and what not.
#[derive(Default)]
pub(super) struct Survivors {
    /// The parts that can be kept.
    pub compaction: Compaction,
    /// Names of the parts of which rows are missing.
    pub broken: BTreeSet<String>,
    /// Those of them that have no files of their own.
    pub lost: BTreeSet<String>,
    /// Ids of the jobs in them of which rows are missing.
    pub jobs: Vec<String>,
    /// Ids of jobs whose rows belong to no part.
    pub excess: HashSet<String>,
    /// Files that are damaged, with what is wrong.
    pub files: BTreeMap<PathBuf, String>,
}

/// What is known of a job.
#[derive(Default)]
struct Known {
    is_there: bool,
    slips: u64,
    precursors: u64,
    failure: Option<String>,
}

/// Looks for what can be kept. `record`: what the compacted files are to hold, if that is known.
pub(super) fn survivors(
    storage: &dyn Storage,
    directory: &Directory,
    record: Option<&Compaction>,
) -> Result<Survivors, DatasetError> {
    let mut survivors = Survivors::default();
    let mut whole = BTreeMap::new();
    for table in directory.tables() {
        let folder = directory.layout().table(table);
        let mut names = match record {
            Some(record) => record.of_table(table).to_vec(),
            None => compacted_files(storage, directory.layout(), table)?,
        };
        names.retain(|name| {
            let path = folder.join(name);
            let number = name.split('-').nth(1).and_then(|number| number.parse().ok()).unwrap_or(usize::MAX);
            let problem = match checksum::check(storage, &path) {
                Ok(seal) if *name == compacted_file(number, &seal) => return true,
                Ok(_) => "it is another file than its name tells".to_owned(),
                Err(error) => problem_of(&error),
            };
            survivors.files.insert(path, problem);
            false
        });
        whole.insert(table, names.iter().map(|name| folder.join(name)).collect::<Vec<_>>());
        survivors.compaction.files.insert(table.to_owned(), names);
    }
    let mut known = known(storage, whole)?;
    for part in Plan::new(directory.sweeps()).parts() {
        let sweep = &directory.sweeps()[part.epoch];
        let ids: Vec<String> = (0..part.jobs.len()).map(|job| label(sweep, &part, job).0.job_id).collect();
        let is_held = match record {
            Some(record) => record.holds(part.epoch, part.index),
            None => ids.iter().any(|id| known.contains_key(id)),
        };
        if !is_held {
            continue;
        }
        let mut failed = BTreeMap::new();
        let mut wanting = Vec::new();
        for (position, id) in ids.into_iter().enumerate() {
            match known.remove(&id) {
                Some(Known { is_there: true, slips: 0, precursors: 0, failure }) => {
                    failed.extend(failure.map(|reason| (position, reason)));
                }
                _ => wanting.push(id),
            }
        }
        if wanting.is_empty() {
            survivors.compaction.add(part.epoch, part.index, failed);
            continue;
        }
        survivors.broken.insert(part_name(&part));
        let own = directory.layout().table(tables::JOBS).join(part_file(&part));
        if !storage.exists(&own).map_err(StorageError::at("look up", &own))? {
            survivors.lost.insert(part_name(&part));
            survivors.jobs.extend(wanting);
        }
    }
    survivors.excess = known.into_keys().collect();
    Ok(survivors)
}

/// All jobs of which there is a row, with the slips and precursors that are wanting or in excess.
fn known(
    storage: &dyn Storage,
    mut whole: BTreeMap<&str, Vec<PathBuf>>,
) -> Result<HashMap<String, Known>, DatasetError> {
    let mut of_table = |name| whole.remove(name);
    let mut known: HashMap<String, Known> = HashMap::new();
    let (slips, precursors) = (of_table(tables::SLIPS), of_table(tables::PRECURSORS));
    let records_precursors = precursors.is_some();
    for job in jobs(storage, of_table(tables::JOBS).unwrap_or_default()) {
        let job = job?;
        let precursors = if records_precursors { job.precursors } else { 0 };
        known.insert(job.id, Known { is_there: true, slips: job.slips, precursors, failure: job.failure });
    }
    for group in groups(storage, slips.unwrap_or_default(), None) {
        let group = group?;
        let job = known.entry(group.job_id).or_default();
        job.slips = job.slips.wrapping_sub(group.rows);
    }
    for group in groups(storage, precursors.unwrap_or_default(), None) {
        let group = group?;
        let job = known.entry(group.job_id).or_default();
        job.precursors = job.precursors.wrapping_sub(group.rows);
    }
    Ok(known)
}
