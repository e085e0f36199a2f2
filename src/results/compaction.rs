//! The record of a compaction, `run/compacted.json`: which parts the compacted files of a directory hold.
//!
//! The names of compacted files hold their seals, so a record fits one state of the tables alone. While tables are
//! exchanged the file has the records before and after: which of them holds is told by the files that are there.

use crate::results::commit::Commit;
use crate::results::layout::{Layout, is_compacted, name_of};
use crate::results::tables;
use crate::table::checksum;
use crate::table::file::DatasetError;
use crate::table::storage::{Storage, StorageError};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{ErrorKind, Read as _};

/// How often to read again if the tables were exchanged in between.
const ATTEMPTS: usize = 3;

/// What the compacted files hold. Empty without any.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compaction {
    /// Names of the files of each table, in order.
    pub files: BTreeMap<String, Vec<String>>,
    /// Numbers of the first and the last part of each range of parts, for each epoch.
    parts: Vec<Vec<(u64, u64)>>,
    /// Reasons of failed jobs, by the name of the part and the position within it.
    failed: BTreeMap<String, BTreeMap<usize, String>>,
}

/// The file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    format: u32,
    compactions: Vec<Compaction>,
}

/// Version of the file.
const FORMAT: u32 = 1;

impl Compaction {
    /// Reads which compaction holds now.
    ///
    /// # Errors
    /// When the record is damaged or does not fit the files.
    pub fn read(storage: &dyn Storage, layout: &Layout) -> Result<Self, DatasetError> {
        for _ in 1..ATTEMPTS {
            if let Ok(compaction) = Self::read_once(storage, layout) {
                return Ok(compaction);
            }
        }
        Self::read_once(storage, layout)
    }

    fn read_once(storage: &dyn Storage, layout: &Layout) -> Result<Self, DatasetError> {
        let there = compacted_files(storage, layout, tables::JOBS)?;
        let Some(records) = Self::records(storage, layout)? else {
            return if there.is_empty() {
                Ok(Self::default())
            } else {
                Err(DatasetError::damaged(&layout.compacted())("it is missing, though there are compacted files"))
            };
        };
        let fits = |compaction: &Self| compaction.of_table(tables::JOBS) == there;
        records.into_iter().find(fits).ok_or_else(|| {
            DatasetError::damaged(&layout.compacted())("the files in tables/jobs are not those that it tells of")
        })
    }

    /// The records of what may hold; `None` if nothing was ever compacted.
    ///
    /// # Errors
    /// When the file is damaged.
    pub fn records(storage: &dyn Storage, layout: &Layout) -> Result<Option<Vec<Self>>, DatasetError> {
        let path = layout.compacted();
        if !storage.exists(&path).map_err(StorageError::at("look up", &path))? {
            return Ok(None);
        }
        let mut text = String::new();
        let read = storage.open(&path).and_then(|mut file| file.read_to_string(&mut text));
        match read {
            Err(error) if error.kind() == ErrorKind::InvalidData => return Err(DatasetError::damaged(&path)(error)),
            read => read.map_err(StorageError::at("read", &path))?,
        };
        let record: Record = checksum::from_json(&text).map_err(DatasetError::damaged(&path))?;
        if record.format != FORMAT {
            return Err(DatasetError::damaged(&path)(format!("it has format {}, not {FORMAT}", record.format)));
        }
        Ok(Some(record.compactions))
    }

    /// Stages the record of what may hold next.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn stage(commit: &mut Commit<'_>, layout: &Layout, compactions: Vec<Self>) -> Result<(), DatasetError> {
        let path = layout.compacted();
        let text = checksum::to_json(&Record { format: FORMAT, compactions }).map_err(DatasetError::damaged(&path))?;
        Ok(commit.stage_bytes(&path, text.as_bytes())?)
    }

    /// Whether there are compacted files.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Names of the files of a table.
    #[must_use]
    pub fn of_table(&self, table: &str) -> &[String] {
        self.files.get(table).map_or(&[], Vec::as_slice)
    }

    /// Whether the rows of a part are in the compacted files.
    #[must_use]
    pub fn holds(&self, epoch: usize, index: u64) -> bool {
        self.parts.get(epoch).is_some_and(|ranges| ranges.iter().any(|&(first, last)| (first..=last).contains(&index)))
    }

    /// Number of parts whose rows are in the compacted files.
    #[must_use]
    pub fn part_count(&self) -> u64 {
        self.parts.iter().flatten().map(|(first, last)| last.saturating_sub(*first) + 1).sum()
    }

    /// Positions of the failed jobs of a part, with their reasons.
    #[must_use]
    pub fn failures(&self, epoch: usize, index: u64) -> Option<&BTreeMap<usize, String>> {
        self.failed.get(&name_of(epoch, index))
    }

    /// Parts with failed jobs, by their names.
    pub fn failed_parts(&self) -> impl Iterator<Item = &str> {
        self.failed.keys().map(String::as_str)
    }

    /// The same without some parts, by their names.
    #[must_use]
    pub fn without(&self, parts: &BTreeSet<String>) -> Self {
        let mut rest = Self { files: self.files.clone(), ..Self::default() };
        for (epoch, ranges) in self.parts.iter().enumerate() {
            for index in ranges.iter().flat_map(|&(first, last)| first..=last) {
                if !parts.contains(&name_of(epoch, index)) {
                    rest.add(epoch, index, self.failures(epoch, index).cloned().unwrap_or_default());
                }
            }
        }
        rest
    }

    /// Adds a part with its failed jobs. Parts are added in the order of the plan.
    pub fn add(&mut self, epoch: usize, index: u64, failed: BTreeMap<usize, String>) {
        self.parts.resize(self.parts.len().max(epoch + 1), Vec::new());
        match self.parts[epoch].last_mut() {
            Some((_, last)) if *last + 1 == index => *last = index,
            _ => self.parts[epoch].push((index, index)),
        }
        if !failed.is_empty() {
            self.failed.insert(name_of(epoch, index), failed);
        }
    }
}

/// Names of the compacted files in the folder of a table, in order.
///
/// # Errors
/// When the folder cannot be listed.
pub fn compacted_files(storage: &dyn Storage, layout: &Layout, table: &str) -> Result<Vec<String>, StorageError> {
    let folder = layout.table(table);
    let names = storage.list(&folder).map_err(StorageError::at("list", &folder))?;
    Ok(names.into_iter().filter_map(|name| name.into_string().ok()).filter(|name| is_compacted(name)).collect())
}
