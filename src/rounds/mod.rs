//! Rounds: what a sweep that decides for itself runs next.
//!
//! ```text
//! chosen jobs that are committed -> sets, reduced -> more seeds (precision.rs), else finer cells (reduce/cells.rs)
//! ```
//!
//! Sets get seeds first; cells are divided when every set is as precise as it will be. Contract: a round is a pure
//! function of the sweep and of the committed rows of the jobs that its earlier rounds chose: the same for any threads,
//! workers, kills and order, and for a directory that has had other sweeps.

#[cfg(test)]
mod coverage;
mod precision;
#[cfg(test)]
mod tests;

pub use precision::MIN_SEEDS;

use crate::model::Parameters;
use crate::reduce::{SetRow, divide, reduce_jobs};
use crate::results::{Results, ResultsError};
use crate::sweep::{Round, Standing, Sweep, merged};
use std::collections::BTreeMap;

/// The round after those that a directory has. All their jobs must be done.
pub fn next(results: &Results<'_>) -> Result<Round, ResultsError> {
    let sweep = results.sweep();
    let rounds = results.rounds().iter().filter_map(|extension| extension.round.as_ref());
    let points = merged(rounds.flat_map(|round| round.points.iter().cloned()).collect());
    let chosen = Round { points, ..Round::default() };
    let is_chosen = |parameters: &Parameters| sweep.find(parameters).is_some_and(|point| chosen.has(point));
    let numbered =
        |row: SetRow| Some((sweep.set_with(&row.parameters.parameters)?, row)).filter(|(_, row)| !row.is_control);
    Ok(decide(sweep, &reduce_jobs(results, is_chosen)?.into_iter().filter_map(numbered).collect()))
}

/// The round after these sets, by their numbers.
fn decide(sweep: &Sweep, sets: &BTreeMap<u64, SetRow>) -> Round {
    let Some(rounds) = sweep.rounds() else { return Round::default() };
    let mut standing = Standing::default();
    let mut points = Vec::new();
    for (&number, row) in sets {
        let jobs = row.finished_jobs + row.failed_jobs;
        match rounds.precision.as_ref().and_then(|precision| precision::need(precision, jobs, row)) {
            None => standing.sets_done += 1,
            Some(seeds) if seeds <= jobs => standing.sets_capped += 1,
            Some(seeds) => {
                standing.sets_open += 1;
                points.extend(sweep.points_of_set(number, jobs..seeds));
            }
        }
    }
    if points.is_empty()
        && let Some(refinement) = &rounds.refinement
    {
        let (new, cells_capped) = divide(sweep, refinement, sets);
        (standing.sets_open, standing.cells_capped) = (new.len() as u64, cells_capped);
        let seeds = rounds.seeds_at_first(sweep.seed_count());
        points.extend(new.into_iter().flat_map(|set| sweep.points_of_set(set, 0..seeds)));
    }
    Round { points: sweep.with_controls(points), standing }
}
