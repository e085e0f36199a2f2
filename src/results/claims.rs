//! Claims: which worker runs a part, or reduces, so that nothing is done twice.
//!
//! `run/claims/<what>.<generation>` is a link to a file with the worker's name: of several workers that make it, one wins.
//! A worker that finds the winner dead makes the next generation. A claim stays while any worker runs, as a worker that
//! looked earlier may not know yet what became of it. A worker that has lost some claims lists them all again.

use crate::results::layout::claim;
use crate::results::workers::{Living, Member};
use crate::table::error::ResultsError;
use crate::table::storage::StorageError;
use std::collections::{BTreeMap, HashMap, HashSet};

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

    /// How a claim stands among workers that live.
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
