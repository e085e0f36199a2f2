//! Claims: which worker runs a part, reduces, or decides a round, so that nothing is done twice.
//!
//! `run/claims/<what>.<generation>` is a link to a file with the worker's name: of several workers that make it, one
//! wins. A worker that finds the winner dead makes the next generation. A claim stays while any worker runs, as a
//! worker that looked earlier may not know yet what became of it. A worker that has lost some claims lists them all
//! again.
//!
//! Deaths: a worker that ends in order says in the claims of parts that it has not finished that it gives them back. So
//! the other claims of dead workers at a missing part are the deaths at it, and they stay until it is done. A job that
//! ends its process can thus be named, and does not stop the others. No job fails for a death: kills, power cuts and
//! queues count, too. A part that is done and has jobs to run again has claims of another name, which stay until a run
//! ends in order.

use crate::results::layout::{Layout, claim, stays};
use crate::results::workers::{GIVEN_BACK, Living, Member};
use crate::sweep::PartName;
use crate::table::error::ResultsError;
use crate::table::shown::shown_bytes;
use crate::table::storage::StorageError;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;
use std::io;
use std::time::SystemTime;

#[derive(Debug)]
pub struct Claims<'a> {
    member: &'a Member<'a>,
    /// The last generation of each.
    generations: HashMap<String, u64>,
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
        let Some(generation) = self.last(what) else {
            return Ok(ClaimState::Free(0));
        };
        let owner = self.owner(what, generation)?;
        if owner == self.member.name() {
            return Ok(ClaimState::Own);
        }
        let living_owner = living.get_key_value(&owner).map(|(name, _)| name.as_str());
        Ok(living_owner.map_or(ClaimState::Free(generation + 1), ClaimState::Taken))
    }

    /// Claims what no living worker has; whether this worker has it.
    pub fn take_free(member: &'a Member<'a>, what: &str) -> Result<bool, ResultsError> {
        // In this order: a worker that has ended did before what it had claimed.
        let others = member.others()?;
        let mut claims = Self::list(member)?;
        match claims.standing(what, &others)? {
            ClaimState::Own => Ok(true),
            ClaimState::Taken(_) => Ok(false),
            ClaimState::Free(generation) => claims.take(what, generation),
        }
    }

    /// Makes a claim; false if another worker was first.
    pub fn take(&mut self, what: &str, generation: u64) -> Result<bool, ResultsError> {
        let layout = self.member.layout();
        let path = layout.claims().join(format!("{what}.{generation}"));
        let is_made = layout.storage.link_new(&self.member.claim(), &path)?;
        // A network file system may have made the link, and have been asked again.
        let is_own = is_made || self.owner(what, generation)? == self.member.name();
        self.generations.insert(what.to_owned(), generation);
        Ok(is_own)
    }

    /// The worker that has made a claim; empty if it is gone.
    fn owner(&self, what: &str, generation: u64) -> Result<String, StorageError> {
        let text = self.member.layout().claim_text(what, generation)?;
        Ok(text.strip_suffix(GIVEN_BACK).unwrap_or(&text).to_owned())
    }
}

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

impl Layout<'_> {
    /// What a claim says; empty if it is gone.
    fn claim_text(&self, what: &str, generation: u64) -> Result<String, StorageError> {
        let path = self.claims().join(format!("{what}.{generation}"));
        match self.storage.read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(String::new()),
            text => Ok(String::from_utf8_lossy(&text?).into_owned()),
        }
    }

    /// How many workers died at each part, by what they claimed.
    pub(super) fn deaths(
        &self,
        done: &BTreeSet<PartName>,
    ) -> Result<HashMap<String, usize>, StorageError> {
        // In this order: the claims of a worker that begins in between are not listed.
        let names = self.storage.list(&self.claims())?;
        let living = self.living(SystemTime::now())?;
        let mut deaths = HashMap::new();
        for (what, generation) in names.iter().filter_map(|name| claim(name)) {
            if stays(what, false, done) {
                let text = self.claim_text(what, generation)?;
                let is_given_back = text.is_empty() || text.ends_with(GIVEN_BACK);
                if !is_given_back && !living.contains_key(&text) {
                    *deaths.entry(what.to_owned()).or_default() += 1;
                }
            }
        }
        Ok(deaths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::workers::tests::{join, results};
    use std::fs;

    #[test]
    fn generations_of_a_claim_rise_as_its_owners_die_and_claims_stay_while_others_are_there() {
        let root = tempfile::tempdir().unwrap();
        let results = results(root.path());
        join(&results, |first| {
            let mut claims = Claims::list(first).unwrap();
            assert!(claims.take("part", 0).unwrap());
            let standing = |claims: &Claims<'_>, member: &Member<'_>| match claims
                .standing("part", &member.others().unwrap())
            {
                Ok(ClaimState::Taken(owner)) => Err(owner.to_owned()),
                Ok(ClaimState::Free(generation)) => Ok(Some(generation)),
                Ok(ClaimState::Own) => Ok(None),
                Err(error) => panic!("{error}"),
            };
            assert_eq!(standing(&claims, first), Ok(None));
            join(&results, |second| {
                let mut others = Claims::list(second).unwrap();
                assert_eq!(standing(&others, second), Err(first.name().to_owned()));
                assert!(!others.take("part", 0).unwrap());
                assert!(others.take("other", 0).unwrap());
                second.tidy(false).unwrap();
            });
            claims.refresh().unwrap();
            assert!(
                claims.last("other").is_some(),
                "its owner has ended, but others are there"
            );
            fs::write(results.layout().claims().join("part.1"), "worker-dead").unwrap();
            join(&results, |third| {
                let mut others = Claims::list(third).unwrap();
                assert_eq!(standing(&others, third), Ok(Some(2)));
                assert!(others.take("part", 2).unwrap());
            });
            first.tidy(false).unwrap();
            assert!(
                fs::read_dir(results.layout().claims())
                    .unwrap()
                    .next()
                    .is_none(),
                "nobody else is there"
            );
        });
    }
}
