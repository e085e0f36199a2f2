//! What a sweep that decides for itself adds to the table of sets: in which rounds a set ran, and whether it is as precise
//! as is wanted.

use super::set::SetRow;
use crate::results::{Results, ResultsError};
use crate::sweep::{Precision, Sweep};
use crate::table::columns::{columns, tables};
use crate::table::file::{Footer, TableWriter};
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

tables! {
    RoundOfSet = "sets of a sweep in rounds", "Further columns of `sets`, if the sweep has `[precision]` or `[refine]`";
}

/// A set of a sweep in rounds.
pub type SetInRounds = (SetRow, RoundOfSet);

tables! { SetInRounds = SetRow::NAME, SetRow::MEANING; }

/// Writes the table of sets, with the columns that the sweep asks for.
pub(super) enum SetWriter<'a> {
    Plain(TableWriter<SetRow>),
    InRounds(TableWriter<SetInRounds>, Rounds<'a>),
}

/// What the rounds of a sweep have chosen.
pub(super) struct Rounds<'a> {
    sweep: &'a Sweep,
    precision: Option<&'a Precision>,
    of_sets: HashMap<u64, RoundOfSet>,
}

impl<'a> SetWriter<'a> {
    pub(super) fn new(results: &'a Results<'a>, file: StoredFile, footer: &Footer) -> Result<Self, ResultsError> {
        let sweep = results.sweep();
        let Some(rounds) = sweep.rounds() else { return Ok(Self::Plain(TableWriter::new(file, footer)?)) };
        let mut of_sets: HashMap<u64, RoundOfSet> = HashMap::new();
        for (round, extension) in (1..).zip(results.rounds()) {
            let points = extension.round.iter().flat_map(|round| round.points.iter().cloned().flatten());
            for set in points.map(|point| sweep.set_of(point)) {
                let of_set = of_sets.entry(set).or_default();
                of_set.first_round.get_or_insert(round);
                of_set.last_round = Some(round);
                *of_set.seeds.get_or_insert(0) += 1;
            }
        }
        let rounds = Rounds { sweep, precision: rounds.precision.as_ref(), of_sets };
        Ok(Self::InRounds(TableWriter::new(file, footer)?, rounds))
    }

    pub(super) fn push(&mut self, row: &SetRow) -> Result<(), ResultsError> {
        match self {
            Self::Plain(writer) => writer.push(row),
            Self::InRounds(writer, Rounds { sweep, precision, of_sets }) => {
                let number = sweep.set_with(&row.parameters.parameters);
                let error = precision.and_then(|precision| row.error_over_target(precision));
                let round = number.and_then(|set| of_sets.get(&set)).cloned().unwrap_or_default();
                writer.push(&(row.clone(), RoundOfSet { target_met: error.map(|error| error <= 1.0), ..round }))
            }
        }
    }

    pub(super) fn finish(self) -> Result<(), ResultsError> {
        match self {
            Self::Plain(writer) => writer.finish().map(drop),
            Self::InRounds(writer, _) => writer.finish().map(drop),
        }
    }
}
