//! Claims: which worker runs a part, or reduces, so that nothing is done twice.
//!
//! `run/claims/<what>.<generation>` is a link to a file with the worker's name: of several workers that make it, one
//! wins. A worker that finds the winner dead makes the next generation. A claim stays while any worker runs, as a
//! worker that looked earlier may not know yet what became of it. A worker that has lost some claims lists them all
//! again.
//!
//! Deaths: a worker keeps a note of each part that it has taken, in its staging folder, until the part is done. The
//! worker that removes the folder of a dead worker moves its notes to `run/deaths/<part>.<worker>`. So a job that ends
//! its process can be named, and does not stop the others. No job fails for a mark: kills, power cuts and queues leave
//! marks, too. A run that ends in order removes the marks of parts that are done.

use crate::results::layout::{Layout, claim};
use crate::results::tables::RecordedTable;
use crate::results::workers::{Living, Member, PREFIX};
use crate::sweep::PartName;
use crate::table::error::ResultsError;
use crate::table::shown::shown_bytes;
use crate::table::storage::{StorageError, gone_is_fine};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap, HashSet};
use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

#[derive(Debug)]
pub struct Claims<'a> {
    member: &'a Member<'a>,
    /// The last generation of each.
    generations: HashMap<String, u64>,
    own: HashSet<String>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClaimState<'a> {
    /// No living worker has it: this generation can be made.
    Free(u64),
    Own,
    /// This living worker has it.
    Taken(&'a str),
}

impl<'a> Claims<'a> {
    pub fn list(member: &'a Member<'a>) -> Result<Self, StorageError> {
        member.layout().ensure_folder(&member.layout().claims())?;
        let mut claims = Self {
            member,
            generations: HashMap::new(),
            own: HashSet::new(),
        };
        claims.refresh()?;
        Ok(claims)
    }

    pub fn refresh(&mut self) -> Result<(), StorageError> {
        let layout = self.member.layout();
        for name in layout.storage.list(&layout.claims())? {
            if let Some((what, generation)) = claim(&name) {
                let last = self.generations.entry(what.to_owned()).or_default();
                *last = generation.max(*last);
            }
        }
        Ok(())
    }

    /// The last generation of a claim, as far as is known; `None` if no worker has claimed it.
    pub fn last(&self, what: &str) -> Option<u64> {
        self.generations.get(what).copied()
    }

    pub fn standing<'l>(
        &self,
        what: &str,
        living: &'l BTreeMap<String, Living>,
    ) -> Result<ClaimState<'l>, StorageError> {
        if self.own.contains(what) {
            return Ok(ClaimState::Own);
        }
        let Some(generation) = self.last(what) else {
            return Ok(ClaimState::Free(0));
        };
        let owner = self.owner(what, generation)?;
        if owner == self.member.name() {
            return Ok(ClaimState::Own);
        }
        let living = living.get_key_value(&owner).map(|(name, _)| name.as_str());
        Ok(living.map_or(ClaimState::Free(generation + 1), ClaimState::Taken))
    }

    /// Makes a claim; false if another worker was first.
    pub fn take(&mut self, what: &str, generation: u64) -> Result<bool, ResultsError> {
        let layout = self.member.layout();
        let path = layout.claims().join(format!("{what}.{generation}"));
        let is_made = layout.storage.link_new(&self.member.claim(), &path)?;
        // A network file system may have made the link, and have been asked again.
        let is_own = is_made || self.owner(what, generation)? == self.member.name();
        self.generations.insert(what.to_owned(), generation);
        if is_own {
            self.own.insert(what.to_owned());
        }
        Ok(is_own)
    }

    /// The worker that has made a claim; empty if it is gone.
    fn owner(&self, what: &str, generation: u64) -> Result<String, StorageError> {
        let layout = self.member.layout();
        let path = layout.claims().join(format!("{what}.{generation}"));
        match layout.storage.read(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
            name => Ok(String::from_utf8_lossy(&name?).into_owned()),
        }
    }
}

/// The deaths at each part, each with a name.
pub(super) type Deaths = HashMap<PartName, Vec<OsString>>;

/// A missing part at which workers died.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Marked {
    pub part: String,
    pub deaths: usize,
    pub jobs: usize,
    /// Most memory that one of its jobs is predicted to take, in bytes.
    pub memory: f64,
    /// Commands that do the same as its first job and its last.
    pub commands: Vec<String>,
}

impl fmt::Display for Marked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: deaths of workers: {}; jobs: {}; predicted memory of a job: {}\n  {}",
            self.part,
            self.deaths,
            self.jobs,
            shown_bytes(self.memory),
            self.commands.join("\n  to ")
        )
    }
}

impl Member<'_> {
    pub fn begin_part(&self, part: PartName) -> Result<(), StorageError> {
        self.layout().storage.create(&self.note(part)).map(drop)
    }

    pub fn end_part(&self, part: PartName) -> Result<(), StorageError> {
        gone_is_fine(self.layout().storage.remove(&self.note(part)))
    }

    fn note(&self, part: PartName) -> PathBuf {
        self.staging().join(part.to_string())
    }
}

impl Layout<'_> {
    /// Makes marks of the notes in the staging folder of a dead worker.
    pub(super) fn mark_deaths(&self, worker: &str) -> Result<(), StorageError> {
        for note in self.notes(worker)? {
            self.ensure_folder(&self.deaths())?;
            let mark = self.deaths().join(format!("{note}.{worker}"));
            let note = self.staging(worker).join(note.to_string());
            gone_is_fine(self.storage.rename(&note, &mark))?;
        }
        Ok(())
    }

    /// The parts that a worker has taken.
    fn notes(&self, worker: &str) -> Result<Vec<PartName>, StorageError> {
        let names = self.storage.list(&self.staging(worker))?;
        let names = names.iter().filter_map(|name| name.to_str());
        Ok(names.filter_map(PartName::parse).collect())
    }

    pub(super) fn marks(&self) -> Result<Deaths, StorageError> {
        let mut marks = Deaths::new();
        for name in self.storage.list(&self.deaths())? {
            let part = Path::new(&name).file_stem().and_then(|part| part.to_str());
            if let Some(part) = part.and_then(PartName::parse) {
                marks.entry(part).or_default().push(name);
            }
        }
        Ok(marks)
    }

    /// The same, with the notes of dead workers that are no marks yet.
    pub(super) fn marks_and_notes(&self) -> Result<Deaths, StorageError> {
        // In this order: a worker that begins in between is not in the list.
        let workers = self.storage.list(&self.staging(""))?;
        let living = self.living(SystemTime::now())?;
        let mut marks = self.marks()?;
        let workers = workers.iter().filter_map(|worker| worker.to_str());
        let is_dead = |worker: &&str| worker.starts_with(PREFIX) && !living.contains_key(*worker);
        for worker in workers.filter(is_dead) {
            for part in self.notes(worker)? {
                marks.entry(part).or_default().push(worker.into());
            }
        }
        Ok(marks)
    }

    pub fn tidy_deaths(&self) -> Result<(), StorageError> {
        let marks = self.marks()?;
        if marks.is_empty() {
            return Ok(());
        }
        let done = self.parts_in(&self.table(RecordedTable::Jobs))?;
        let of_done = marks.into_iter().filter(|(part, _)| done.contains(part));
        for mark in of_done.flat_map(|(_, marks)| marks) {
            self.remove(&self.deaths().join(mark))?;
        }
        Ok(())
    }
}
