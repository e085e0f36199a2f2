//! The compacted files: all there, each as it was written, with the rows of exactly the parts that they are to hold.

use super::rows::{TableFiles, check};
use super::survivors::{Survivors, survivors};
use super::{Problem, Remedy, Verification, problem_of};
use crate::results::compact::Without;
use crate::results::compaction::{Compaction, compacted_files};
use crate::results::layout::{Layout, compacted_file};
use crate::results::manifest::{Directory, DirectoryError};
use crate::results::tables;
use crate::sweep::Plan;
use crate::table::checksum;
use crate::table::file::DatasetError;
use crate::table::storage::Storage;
use std::path::PathBuf;

/// Verifies the compacted files. Gives the directory with what of them can be kept, and what cannot.
pub(super) fn verify(
    storage: &dyn Storage,
    directory: Directory,
    verification: &mut Verification,
) -> Result<(Directory, Without), DirectoryError> {
    let layout = directory.layout().clone();
    let (record, problem) = match Compaction::records(storage, &layout) {
        Ok(Some(records)) => match fitting(storage, &layout, records)? {
            Some(record) => (Some(record), None),
            None => (None, Some("it does not belong to these tables".to_owned())),
        },
        Ok(None) if all_files(storage, &layout)?.is_empty() => return Ok((directory, Without::default())),
        Ok(None) => (None, Some("it is missing, though there are compacted files".to_owned())),
        Err(error @ DatasetError::Damaged { .. }) => (None, Some(problem_of(&error))),
        Err(error) => return Err(error.into()),
    };
    let whole = record.as_ref().map(|record| is_whole(storage, &directory, record));
    if let (Some(record), Some(Ok(()))) = (&record, &whole) {
        for (table, files) in &record.files {
            for file in files {
                verification.count(storage, &layout.table(table).join(file))?;
            }
        }
        return Ok((directory.compacted_as(record.clone()), Without::default()));
    }
    let found = survivors(storage, &directory, record.as_ref())?;
    let inconsistent = whole.and_then(Result::err).map(|error| problem_of(&error));
    report(&layout, &found, problem.or(inconsistent.filter(|_| found.files.is_empty())), verification);
    let files = found.files.into_keys().collect();
    let without = Without { parts: found.broken, jobs: found.excess, files };
    Ok((directory.compacted_as(found.compaction), without))
}

/// One problem for the record, if it has any, and one for each file. The first tells the jobs that are lost.
fn report(layout: &Layout, found: &Survivors, record: Option<String>, verification: &mut Verification) {
    let record = record.map(|problem| (layout.compacted(), problem));
    let files = found.files.iter().map(|(path, problem)| (path.clone(), problem.clone()));
    let mut problems: Vec<Problem> = record
        .into_iter()
        .chain(files)
        .map(|(path, problem)| Problem::of_file(path, problem, Remedy::Compacted))
        .collect();
    if let Some(first) = problems.first_mut() {
        first.parts = found.lost.iter().cloned().collect();
        first.jobs.clone_from(&found.jobs);
    }
    verification.problems.append(&mut problems);
}

/// The record that fits the tables, or else the one of which most files are there.
fn fitting(
    storage: &dyn Storage,
    layout: &Layout,
    records: Vec<Compaction>,
) -> Result<Option<Compaction>, DatasetError> {
    let there = all_files(storage, layout)?;
    let present = |record: &Compaction| paths(layout, record).filter(|path| there.contains(path)).count();
    let missing = |record: &Compaction| paths(layout, record).count() - present(record);
    // The last of equals. If no file is left at all, that was the last state, too.
    let best = records.into_iter().max_by_key(|record| (missing(record) == 0, present(record)));
    Ok(best.filter(|record| present(record) > 0 || there.is_empty() || record.is_empty()))
}

fn paths(layout: &Layout, record: &Compaction) -> impl Iterator<Item = PathBuf> {
    record.files.iter().flat_map(|(table, files)| files.iter().map(|file| layout.table(table).join(file)))
}

/// The compacted files that are there.
fn all_files(storage: &dyn Storage, layout: &Layout) -> Result<Vec<PathBuf>, DatasetError> {
    let mut all = Vec::new();
    for table in [tables::SLIPS, tables::PRECURSORS, tables::JOBS] {
        all.extend(compacted_files(storage, layout, table)?.into_iter().map(|file| layout.table(table).join(file)));
    }
    Ok(all)
}

/// Whether the files are as they were written and hold the rows of the parts, each once.
fn is_whole(storage: &dyn Storage, directory: &Directory, record: &Compaction) -> Result<(), DatasetError> {
    let layout = directory.layout();
    for (table, files) in &record.files {
        for (number, file) in files.iter().enumerate() {
            let path = layout.table(table).join(file);
            if *file != compacted_file(number, &checksum::check(storage, &path)?) {
                return Err(DatasetError::damaged(&path)("it is another file than its name tells"));
            }
        }
    }
    // Files and plan have the jobs in different orders: their numbers and the sums of their ids are compared.
    let (mut jobs, mut sum) = (0_u64, 0_u128);
    for part in Plan::new(directory.sweeps()).parts().filter(|part| record.holds(part.epoch, part.index)) {
        let sweep = &directory.sweeps()[part.epoch];
        jobs += part.jobs.len() as u64;
        for job in &part.jobs {
            sum = sum.wrapping_add(u128::from_be_bytes(*sweep.job_id(&job.parameters).as_bytes()));
        }
    }
    let of_table = |table: &str| record.of_table(table).iter().map(|file| layout.table(table).join(file)).collect();
    let files = TableFiles {
        jobs: of_table(tables::JOBS),
        slips: of_table(tables::SLIPS),
        precursors: directory.records_precursors().then(|| of_table(tables::PRECURSORS)),
    };
    check(storage, files, |job| {
        jobs = jobs.wrapping_sub(1);
        let id = u128::from_str_radix(&job.id, 16).map_err(DatasetError::damaged(&job.path))?;
        sum = sum.wrapping_sub(id);
        Ok(())
    })?;
    if (jobs, sum) == (0, 0) {
        Ok(())
    } else {
        Err(DatasetError::damaged(&layout.compacted())("the compacted files have other jobs than it tells of"))
    }
}
