//! What an edge gets next: a set between its neighbours, until these are close; then seeds of the sets near it, equally many,
//! until its interval is as narrow as is wanted, by the rule of [`precision`](super::precision). All edges share the jobs.

use super::precision::seeds_for;
use crate::reduce::{Line, SetOfEdges, lines};
use crate::sweep::{MIN_SEEDS, Refinement, Round, Standing, Sweep};
use std::collections::BTreeMap;

/// The round after these sets, by their numbers.
pub(super) fn decide(
    sweep: &Sweep,
    refinement: &Refinement,
    sets: &BTreeMap<u64, SetOfEdges>,
) -> Round {
    let rounds = sweep.rounds();
    let from = rounds.map_or(MIN_SEEDS, |rounds| *rounds.seeds.start());
    let had = |set: u64| sets.get(&set).map_or(0, |set| set.seeds);
    let jobs = sets.values().map(|set| set.seeds).sum();
    let mut room = refinement.max_jobs.saturating_sub(jobs);
    let mut wanted = BTreeMap::new();
    let mut standing = Standing::default();
    for line in lines(sweep, refinement, sets) {
        let Line {
            mut rows, edges, ..
        } = line;
        for edge in edges.iter().filter(|edge| !edge.is_done()) {
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
            let set = |row: u64| {
                rows[refinement.axis] = row;
                sweep.set_at(&rows).filter(|&set| had(set) < seeds)
            };
            let new: Vec<u64> = at.into_iter().filter_map(set).collect();
            let more = |set: &u64| {
                let known = wanted.get(set).copied();
                seeds.saturating_sub(known.unwrap_or_else(|| had(*set)))
            };
            let jobs: u64 = new.iter().map(more).sum();
            if new.is_empty() || jobs > room {
                standing.edges_capped += 1;
                continue;
            }
            room -= jobs;
            for set in new {
                let known = wanted.entry(set).or_default();
                *known = seeds.max(*known);
            }
        }
    }
    standing.sets_open = wanted.len() as u64;
    standing.sets_done = sets.keys().filter(|set| !wanted.contains_key(set)).count() as u64;
    let points = wanted.iter();
    let points = points.flat_map(|(&set, &seeds)| sweep.points_of_set(set, had(set)..seeds));
    Round {
        points: sweep.with_controls(points.collect()),
        standing,
    }
}
