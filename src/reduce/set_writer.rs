//! What an adaptive sweep adds to the table of sets: in which rounds a set ran, and whether it is as precise as is wanted.

use super::set::SetRow;
use crate::results::{Results, ResultsError};
use crate::sweep::{Precision, Sweep, Target};
use crate::table::columns::{Row, columns, tables};
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
pub(super) struct SetWriter<'a> {
    writer: TableWriter<SetInRounds>,
    sweep: &'a Sweep,
    /// How the sets that the rounds have chosen came about, by their numbers.
    of_sets: HashMap<u64, RoundOfSet>,
}

impl<'a> SetWriter<'a> {
    pub(super) fn new(
        results: &'a Results<'a>,
        file: StoredFile,
        footer: &Footer,
    ) -> Result<Self, ResultsError> {
        let sweep = results.sweep();
        let columns = RoundOfSet::columns().into_iter();
        let mut left_out: Vec<_> = columns.map(|column| column.name).collect();
        if sweep.rounds().is_some() {
            left_out.clear();
        }
        let mut of_sets: HashMap<u64, RoundOfSet> = HashMap::new();
        for (round, extension) in (1..).zip(results.rounds()) {
            let rounds = extension.round.iter();
            let points = rounds.flat_map(|round| round.points.iter().cloned().flatten());
            for set in points.map(|point| sweep.set_of(point)) {
                let of_set = of_sets.entry(set).or_default();
                of_set.first_round.get_or_insert(round);
                of_set.last_round = Some(round);
                *of_set.seeds.get_or_insert(0) += 1;
            }
        }
        Ok(Self {
            writer: TableWriter::without(&left_out, file, footer)?,
            sweep,
            of_sets,
        })
    }

    pub(super) fn push(&mut self, row: &SetRow) -> Result<(), ResultsError> {
        let mut of_set = RoundOfSet::default();
        if let Some(rounds) = self.sweep.rounds() {
            let number = self.sweep.set_with(&row.parameters);
            let known = number.and_then(|set| self.of_sets.get(&set));
            of_set = known.cloned().unwrap_or_default();
            let precision = rounds.precision.as_ref();
            let error = precision.and_then(|precision| error_over_target(row, precision));
            of_set.target_met = error.map(|error| error <= 1.0);
        }
        self.writer.push(&(row.clone(), of_set))
    }

    pub(super) fn finish(self) -> Result<(), ResultsError> {
        self.writer.finish()
    }
}

/// The half-width of the interval of the least precise statistic over its target: 1 or less if all are as precise as is
/// wanted. `None` if none of them has a value.
pub fn error_over_target(row: &SetRow, precision: &Precision) -> Option<f64> {
    let errors = precision.statistics.iter().filter_map(|statistic| {
        let value = row.number(statistic.key)?;
        let ends = ["low", "high"].map(|end| row.number(&format!("{}_{end}", statistic.key)));
        let half = match ends {
            [Some(low), Some(high)] => 0.5 * (high - low),
            _ => f64::INFINITY,
        };
        let target = match precision.target {
            Target::Relative(share) => share * value.abs(),
            Target::Absolute(target) => target,
        };
        // Nothing is known better than exactly.
        Some(if half == 0.0 { 0.0 } else { half / target })
    });
    errors.reduce(f64::max)
}
