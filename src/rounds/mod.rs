//! Rounds: what a sweep that decides for itself runs next.
//!
//! ```text
//! chosen jobs that are committed -> sets, reduced -> more seeds (precision.rs), else finer cells (refinement.rs)
//! ```
//!
//! Sets get seeds first; cells are divided when every set is as precise as it will be. Contract: a round is a pure
//! function of the sweep and of the committed rows of the jobs that its earlier rounds chose: the same for any threads,
//! workers, kills and order, and for a directory that has had other sweeps.

mod precision;
mod refinement;

pub use precision::MIN_SEEDS;

use crate::reduce::{ChosenSet, SetRow, reduce_chosen};
use crate::results::{Results, ResultsError};
use crate::sweep::{Round, Standing, Sweep, merged};
use crate::table::columns::{Cell, Row};
use precision::Need;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The round after those that a directory has. All their jobs must be done.
///
/// # Errors
/// When a table is damaged or cannot be read.
pub fn next(results: &Results<'_>) -> Result<Round, ResultsError> {
    let sweep = results.sweep();
    let chosen = Chosen::of(results);
    let sets = reduce_chosen(results, |parameters| {
        let point = sweep.find(parameters)?;
        chosen.has(point).then(|| sweep.set_of(point))
    })?;
    Ok(decide(sweep, &sets))
}

/// The points that the rounds of the present sweep have chosen.
struct Chosen(Vec<RangeInclusive<u64>>);

impl Chosen {
    fn of(results: &Results<'_>) -> Self {
        let rounds = results.rounds().iter().filter_map(|extension| extension.round.as_ref());
        Self(merged(rounds.flat_map(|round| round.points.iter().cloned()).collect()))
    }

    fn has(&self, point: u64) -> bool {
        let at = self.0.partition_point(|range| *range.end() < point);
        self.0.get(at).is_some_and(|range| range.contains(&point))
    }
}

/// The round after these sets, which are in order.
fn decide(sweep: &Sweep, sets: &[ChosenSet]) -> Round {
    let Some(rounds) = sweep.rounds() else { return Round::default() };
    let mut standing = Standing::default();
    let mut points = Vec::new();
    for set in sets {
        match rounds
            .precision
            .as_ref()
            .map_or(Need::Nothing, |precision| precision::need(precision, set.jobs, &set.row))
        {
            Need::Nothing => standing.sets_done += 1,
            Need::TooMuch => standing.sets_capped += 1,
            Need::Seeds(seeds) => {
                standing.sets_open += 1;
                points.extend(sweep.points_of_set(set.number, set.jobs..seeds));
            }
        }
    }
    if points.is_empty()
        && let Some(refinement) = &rounds.refinement
    {
        let known: BTreeMap<u64, &SetRow> = sets.iter().map(|set| (set.number, &set.row)).collect();
        let division = refinement::divide(sweep, refinement, &known);
        standing.sets_open = division.sets.len() as u64;
        standing.cells_capped = division.cells_left;
        let seeds = rounds.seeds_at_first(sweep.seed_count());
        points.extend(division.sets.into_iter().flat_map(|set| sweep.points_of_set(set, 0..seeds)));
    }
    Round { points: merged(points), standing }
}

/// What a column of a set holds.
#[derive(Clone, Debug, PartialEq)]
enum Value {
    Number(f64),
    Class(String),
    Nothing,
}

impl Value {
    /// Of a column of the table of sets.
    fn of(row: &SetRow, column: &str) -> Self {
        let wanted = SetRow::columns().iter().position(|known| known.name == column);
        let (mut position, mut value) = (0, Self::Nothing);
        row.cells(&mut |cell| {
            if Some(position) == wanted {
                value = match cell {
                    Cell::Null => Self::Nothing,
                    Cell::Real(number) => Self::Number(number),
                    Cell::Count(count) => Self::Number(count as f64),
                    Cell::Flag(flag) => Self::Class(flag.to_string()),
                    Cell::Text(text) => Self::Class(text.to_owned()),
                };
            }
            position += 1;
        });
        value
    }

    const fn number(&self) -> Option<f64> {
        if let Self::Number(number) = self { Some(*number) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::{STATISTICS, StatisticKind};
    use crate::table::columns::Kind;

    #[test]
    fn the_statistics_that_a_sweep_file_may_name_are_the_columns_of_a_set() {
        let columns = SetRow::columns();
        let is_end = |name: &str| name.ends_with("_low") || name.ends_with("_high");
        for column in &columns {
            let has_interval = columns.iter().any(|other| other.name == format!("{}_low", column.name));
            let known = STATISTICS.iter().find(|statistic| statistic.key == column.name);
            // Parameters, and what is expected whatever happens, tell nothing of a set.
            let is_given = column.name.starts_with("expected_") || column.name == "eta";
            let is_parameter = crate::model::Symbol::from_key(&column.name).is_some();
            let is_statistic = match column.kind {
                Kind::Real => !is_end(&column.name) && !is_given && !is_parameter,
                Kind::Flag => true,
                Kind::Text => column.name == "regime",
                Kind::Count => false,
            };
            assert_eq!(known.is_some(), is_statistic, "{}", column.name);
            let Some(known) = known else { continue };
            assert_eq!(known.has_interval(), has_interval, "{}", column.name);
            assert_eq!(known.unit, column.unit, "{}", column.name);
            assert_eq!(known.kind == StatisticKind::Class, column.kind != Kind::Real, "{}", column.name);
        }
        assert!(STATISTICS.iter().all(|known| columns.iter().any(|column| column.name == known.key)));
    }
}
