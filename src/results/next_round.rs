//! Rounds of a directory: each is an extension with the same sweep file, begun when all parts of the one before are
//! done. The worker that claims it decides what the next round runs, and writes it; the others wait.

use crate::results::claims::Claims;
use crate::results::directory::Results;
use crate::results::layout::shorter_in_tests;
use crate::results::workers::Member;
use crate::sweep::{Extension, Round, Standing, merged};
use crate::table::error::ResultsError;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Time between two looks whether another worker has begun the next round.
const PAUSE: Duration = shorter_in_tests(Duration::from_millis(500), Duration::ZERO);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoundsSoFar {
    /// The round that was begun last, from 1.
    pub round: u64,
    /// Whether it is done, and there will be no more.
    pub is_over: bool,
    /// How sets and edges stood when it began; at the end, when the rounds are over.
    #[serde(flatten)]
    pub standing: Standing,
}

impl Results<'_> {
    /// The rounds so far of the current sweep, in order; the sweep alone if it is not adaptive.
    pub fn rounds(&self) -> &[Extension] {
        let text = self.sweep().text();
        let latest = self.extensions().iter().rev();
        let rounds = latest.take_while(|extension| extension.sweep.text() == text);
        &self.extensions()[self.extensions().len() - rounds.count()..]
    }

    /// All points that these have chosen.
    pub fn chosen(&self) -> Round {
        let extensions = self.rounds().iter();
        let rounds = extensions.filter_map(|extension| extension.round.as_ref());
        let points = rounds.flat_map(|round| round.points.iter().cloned());
        Round {
            points: merged(points.collect()),
            ..Round::default()
        }
    }

    /// The round that was begun last; `None` if the sweep has none.
    pub fn round(&self) -> Option<&Round> {
        self.extensions().last()?.round.as_ref()
    }

    /// How far the rounds are; `None` if the sweep has none.
    pub fn rounds_so_far(&self) -> Option<RoundsSoFar> {
        let round = self.round()?;
        let is_over = round.is_end();
        Some(RoundsSoFar {
            round: self.rounds().len() as u64 - u64::from(is_over),
            is_over,
            standing: round.standing,
        })
    }

    /// The directory with its next round, once all its parts are done: a round that another worker has begun meanwhile,
    /// or the one that `decide` chooses. While another worker decides, the directory as it is. `None` if the rounds are over, or
    /// if there are none.
    pub fn next_round(
        &self,
        member: &Member<'_>,
        decide: impl FnOnce(&Self) -> Result<Round, ResultsError>,
    ) -> Result<Option<Self>, ResultsError> {
        if self.round().is_none_or(Round::is_end) {
            return Ok(None);
        }
        let layout = self.layout();
        self.check_place()?;
        let claim = format!("round-{:03}", self.extensions().len());
        let is_own = Claims::take_free(member, &claim)?;
        let current = Self::read(layout)?;
        if !current.is_of(self.sweep()) {
            let problem =
                "another sweep file was begun here meanwhile; choose another directory with --out";
            return Err(ResultsError::refused(layout.root(), problem));
        }
        let done = current.done_parts()?;
        let is_done = current
            .plan()
            .outlines()
            .all(|part| done.contains(&part.name));
        // Another worker was first, or a repair has moved a part away.
        if current.extensions().len() > self.extensions().len() || !is_done {
            return Ok(Some(current));
        }
        if !is_own {
            std::thread::sleep(PAUSE);
            return Ok(Some(current));
        }
        let round = decide(&current)?;
        let next = current
            .followed_by(current.sweep(), Some(round), None)
            .write_last(member)?;
        // One that took this worker for dead may have been first.
        next.map_or_else(|| Self::read(layout), Ok).map(Some)
    }
}
