//! Rounds: what an adaptive sweep runs next.
//!
//! ```text
//! chosen jobs that are committed -> sets, reduced -> more seeds, or sets and seeds at edges
//! ```
//!
//! Contract: a round is a pure function of the sweep and of the committed rows of the jobs that its earlier rounds
//! chose: the same for any threads, workers, kills and order, and for a directory that has had other sweeps.
//!
//! `docs/rounds.md` has the rules. A prediction of seeds is as uncertain as the half-width that it comes from, so a set
//! gets a quarter more at least, and at most twice as many, so that a poor one costs little. All edges share the jobs.
//!
//! Looking again and again until an interval is short prefers those that are short by chance: the more so, the fewer
//! seeds it is when a set may end, and the more skewed its values are. So no set ends with fewer than [`MIN_SEEDS`].

use crate::reduce::{Line, SetOfEdges, error_over_target, lines, reduce_chosen, sets_of_edges};
use crate::results::{Results, ResultsError};
use crate::sets::SetRow;
use crate::sweep::{Goal, MIN_SEEDS, Precision, Refinement, Round, Standing, Sweep};
use crate::table::value::floored;
use std::collections::{BTreeMap, BTreeSet};

#[cfg(test)]
mod coverage;
#[cfg(test)]
mod tests;

/// The round after those that a directory has, all of whose jobs must be done. A round that chooses no new point would
/// repeat for ever, so it is the end.
pub fn next(results: &Results<'_>) -> Result<Round, ResultsError> {
    let sweep = results.sweep();
    let round = match sweep.rounds().map(|rounds| &rounds.goal) {
        None => Round::default(),
        Some(Goal::Precision(precision)) => more_seeds(sweep, precision, &reduce_chosen(results)?),
        Some(Goal::Edges(refinement)) => {
            at_edges(sweep, refinement, &sets_of_edges(results, refinement)?)
        }
    };
    Ok(round.beyond(&results.chosen()))
}

/// The round that makes these sets, by their numbers, more precise.
fn more_seeds(sweep: &Sweep, precision: &Precision, sets: &BTreeMap<u64, SetRow>) -> Round {
    let mut standing = Standing::default();
    let mut points = Vec::new();
    for (&number, row) in sets {
        let jobs = row.finished_jobs + row.failed_jobs;
        match need(precision, jobs, sweep.seed_count(), row) {
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

/// The seeds that a set with `seeds` seeds and these statistics is to have next: the same number if it has the most.
/// `None` if every statistic is known to the target, or if no job has a value.
fn need(precision: &Precision, seeds: u64, most: u64, row: &SetRow) -> Option<u64> {
    seeds_for(seeds, error_over_target(row, precision)?, MIN_SEEDS, most)
}

/// The seeds that a set with `seeds` seeds gets next, if its half-width is `error` times the target; `None` if it needs
/// no more. It ends with `least` at least, and with `most` at most.
fn seeds_for(seeds: u64, error: f64, least: u64, most: u64) -> Option<u64> {
    let fewest = least.min(most);
    if error <= 1.0 && seeds >= fewest {
        return None;
    }
    let now = seeds as f64;
    let predicted = (now * error * error).ceil().max(fewest as f64);
    let next = predicted.clamp((1.25 * now).ceil(), 2.0 * now);
    let next = floored(next) as u64;
    Some(next.max(seeds + 1).min(most))
}

/// The round that looks for edges between these sets, by their numbers.
fn at_edges(sweep: &Sweep, refinement: &Refinement, sets: &BTreeMap<u64, SetOfEdges>) -> Round {
    let rounds = sweep.rounds();
    let from = rounds.map_or(MIN_SEEDS, |rounds| *rounds.seeds.start());
    let had = |set: u64| sets.get(&set).map_or(0, |set| set.seeds);
    let jobs = sets.values().map(|set| set.seeds).sum();
    let mut room = refinement.max_jobs.saturating_sub(jobs);
    let mut wanted: BTreeMap<u64, u64> = BTreeMap::new();
    let mut standing = Standing::default();
    let lines = lines(sweep, refinement, sets);
    let set_of = |line: &Line<'_>, row: u64| {
        let mut rows = line.rows.clone();
        rows[refinement.axis] = row;
        sweep.set_at(&rows)
    };
    // Whether these sets get jobs up to this number of seeds: none of them if there is too little room.
    let mut ask = |sets: Vec<u64>, seeds: u64| {
        let new: Vec<u64> = sets.into_iter().filter(|&set| had(set) < seeds).collect();
        let known = |set: &u64| wanted.get(set).copied().unwrap_or_else(|| had(*set));
        let jobs: u64 = new.iter().map(|set| seeds.saturating_sub(known(set))).sum();
        if new.is_empty() || jobs > room {
            return false;
        }
        room -= jobs;
        for set in new {
            let known = wanted.entry(set).or_default();
            *known = seeds.max(*known);
        }
        true
    };
    for line in &lines {
        for edge in line.edges.iter().filter(|edge| !edge.is_done()) {
            let [fewest, most] = edge.seeds();
            let seeds = match edge.wanted_row {
                Some(_) => from,
                None if fewest < most => most,
                None => seeds_for(most, edge.error, MIN_SEEDS, sweep.seed_count()).unwrap_or(most),
            };
            let at = match edge.wanted_row {
                Some(row) => vec![row],
                None => edge.sets.iter().map(|set| set.row).collect(),
            };
            let sets = at.into_iter().filter_map(|row| set_of(line, row));
            if !ask(sets.collect(), seeds) {
                standing.edges_capped += 1;
            }
        }
    }
    // After the edges, which are there for certain.
    let mut capped = BTreeSet::new();
    for line in &lines {
        for unclear in line.unclear.iter().flat_map(|stretch| &stretch.sets) {
            let most = sweep.seed_count();
            let seeds = seeds_for(unclear.set.seeds, unclear.error(), MIN_SEEDS, most);
            let set = set_of(line, unclear.row);
            if !ask(set.into_iter().collect(), seeds.unwrap_or(most)) {
                capped.extend(set);
            }
        }
    }
    capped.retain(|set| !wanted.contains_key(set));
    standing.sets_capped = capped.len() as u64;
    standing.sets_open = wanted.len() as u64;
    let is_done = |set: &&u64| !wanted.contains_key(set) && !capped.contains(set);
    standing.sets_done = sets.keys().filter(is_done).count() as u64;
    let asked = wanted.iter();
    let points = asked.flat_map(|(&set, &seeds)| sweep.points_of_set(set, had(set)..seeds));
    Round {
        points: sweep.with_controls(points.collect()),
        standing,
    }
}
