//! What a sweep that decides for itself adds to the table of sets: in which rounds a set ran, and whether it is as precise
//! as is wanted.

use super::set::SetRow;
use crate::results::Results;
use crate::sweep::Precision;
use crate::table::columns::{Table, columns};
use crate::table::file::{DatasetError, Footer, TableWriter};
use crate::table::storage::StoredFile;
use std::collections::HashMap;

columns! {
    /// How a set came about.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct RoundOfSet {
        first_round: Option<u64> = "", "round in which the set began, from 1; null if the present sweep has not chosen it";
        last_round: Option<u64> = "", "round that gave it its last seeds";
        seeds: Option<u64> = "", "seeds that the rounds have given it";
        target_met: Option<bool> = "",
            "whether all statistics that are to be precise are so; null without any value of them";
    }
}

impl Table for RoundOfSet {
    const NAME: &'static str = "sets of a sweep in rounds";
    const MEANING: &'static str = "Further columns of `sets`, if the sweep has `[precision]` or `[refine]`";
}

columns! {
    /// A set of a sweep in rounds.
    #[derive(Debug)]
    pub struct SetInRounds {
        set: SetRow;
        round: RoundOfSet;
    }
}

impl Table for SetInRounds {
    const NAME: &'static str = SetRow::NAME;
    const MEANING: &'static str = SetRow::MEANING;
}

/// Writes the table of sets, with the columns that the sweep asks for.
pub(super) enum SetWriter<'a> {
    Plain(TableWriter<SetRow>),
    InRounds(TableWriter<SetInRounds>, Rounds<'a>),
}

/// What the rounds of a sweep have chosen.
pub(super) struct Rounds<'a> {
    results: &'a Results<'a>,
    precision: Option<&'a Precision>,
    /// First and last round of each set, and its seeds.
    of_sets: HashMap<u64, (u64, u64, u64)>,
}

impl<'a> SetWriter<'a> {
    pub(super) fn new(results: &'a Results<'a>, file: StoredFile, footer: &Footer) -> Result<Self, DatasetError> {
        let sweep = results.sweep();
        let Some(rounds) = sweep.rounds() else { return Ok(Self::Plain(TableWriter::new(file, footer)?)) };
        let mut of_sets = HashMap::new();
        for (round, extension) in (1..).zip(results.rounds()) {
            let points = extension.round.iter().flat_map(|round| round.points.iter().cloned().flatten());
            for set in points.map(|point| sweep.set_of(point)) {
                let (_, last, seeds) = of_sets.entry(set).or_insert((round, round, 0));
                (*last, *seeds) = (round, *seeds + 1);
            }
        }
        let rounds = Rounds { results, precision: rounds.precision.as_ref(), of_sets };
        Ok(Self::InRounds(TableWriter::new(file, footer)?, rounds))
    }

    pub(super) fn push(&mut self, row: &SetRow) -> Result<(), DatasetError> {
        match self {
            Self::Plain(writer) => writer.push(row),
            Self::InRounds(writer, rounds) => writer.push(&SetInRounds { set: row.clone(), round: rounds.of(row) }),
        }
    }

    /// The number of a set that the rounds have chosen.
    pub(super) fn chosen(&self, row: &SetRow) -> Option<u64> {
        let Self::InRounds(_, rounds) = self else { return None };
        let set = rounds.results.sweep().set_with(&row.parameters.parameters);
        set.filter(|set| rounds.of_sets.contains_key(set))
    }

    pub(super) fn finish(self) -> Result<(), DatasetError> {
        match self {
            Self::Plain(writer) => writer.finish().map(drop),
            Self::InRounds(writer, _) => writer.finish().map(drop),
        }
    }
}

impl Rounds<'_> {
    fn of(&self, row: &SetRow) -> RoundOfSet {
        let set = self.results.sweep().set_with(&row.parameters.parameters);
        let found = set.and_then(|set| self.of_sets.get(&set)).copied();
        let error = self.precision.and_then(|precision| row.error_over_target(precision));
        RoundOfSet {
            first_round: found.map(|(first, ..)| first),
            last_round: found.map(|(_, last, _)| last),
            seeds: found.map(|(.., seeds)| seeds),
            target_met: error.map(|error| error <= 1.0),
        }
    }
}
