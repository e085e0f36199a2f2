//! Rounds: what an adaptive sweep runs next.
//!
//! ```text
//! chosen jobs that are committed -> sets, reduced -> more seeds (precision.rs), or sets and seeds at edges (refinement.rs)
//! ```
//!
//! Contract: a round is a pure function of the sweep and of the committed rows of the jobs that its earlier rounds chose: the
//! same for any threads, workers, kills and order, and for a directory that has had other sweeps.

#[cfg(test)]
mod coverage;
mod precision;
mod refinement;
#[cfg(test)]
mod tests;

use crate::reduce::{SetRow, reduce_chosen, sets_of_edges};
use crate::results::{Results, ResultsError};
use crate::sweep::{Precision, Round, Standing, Sweep};
use std::collections::BTreeMap;

/// The round after those that a directory has, all of whose jobs must be done. A round that chooses no new point would repeat
/// for ever, so it is the end.
pub fn next(results: &Results<'_>) -> Result<Round, ResultsError> {
    let sweep = results.sweep();
    let mut round = Round::default();
    if let Some(rounds) = sweep.rounds() {
        if let Some(refinement) = &rounds.refinement {
            let sets = sets_of_edges(results, refinement)?;
            round = refinement::decide(sweep, refinement, &sets);
        } else if let Some(precision) = &rounds.precision {
            round = decide(sweep, precision, &reduce_chosen(results)?);
        }
    }
    Ok(round.beyond(&results.chosen()))
}

/// The round after these sets, by their numbers.
fn decide(sweep: &Sweep, precision: &Precision, sets: &BTreeMap<u64, SetRow>) -> Round {
    let mut standing = Standing::default();
    let mut points = Vec::new();
    for (&number, row) in sets {
        let jobs = row.finished_jobs + row.failed_jobs;
        match precision::need(precision, jobs, sweep.seed_count(), row) {
            None => standing.sets_done += 1,
            Some(seeds) if seeds <= jobs => standing.sets_capped += 1,
            Some(seeds) => {
                standing.sets_open += 1;
                points.extend(sweep.points_of_set(number, jobs..seeds));
            }
        }
    }
    Round {
        points: sweep.with_controls(points),
        standing,
    }
}
