//! What an edge gets next: a set between its neighbours, until these are close; then seeds of the sets near it, all as many,
//! until its interval is as narrow as is wanted, by the rule of [`precision`](super::precision). All edges share the jobs.

use super::precision::seeds_for;
use crate::reduce::{Line, SetOfEdges, lines};
use crate::sweep::{MIN_SEEDS, Refinement, Round, Standing, Sweep};
use std::collections::BTreeMap;

/// The round after these sets, by their numbers.
pub(super) fn decide(sweep: &Sweep, refinement: &Refinement, sets: &BTreeMap<u64, SetOfEdges>) -> Round {
    let from = sweep.rounds().map_or(MIN_SEEDS, |rounds| *rounds.seeds.start());
    let mut room = refinement.max_jobs.saturating_sub(sets.values().map(|set| set.seeds).sum());
    let mut seeds: BTreeMap<u64, u64> = sets.iter().map(|(&number, set)| (number, set.seeds)).collect();
    let mut standing = Standing::default();
    for Line { mut rows, edges, .. } in lines(sweep, refinement, sets) {
        let mut at = |row: u64| {
            rows[refinement.axis] = row;
            sweep.set_at(&rows)
        };
        for edge in edges.iter().filter(|edge| !edge.is_done()) {
            let wanted: Vec<(u64, u64)> = if let Some(row) = edge.wanted_row {
                at(row).map(|set| (set, from)).into_iter().collect()
            } else {
                let [fewest, most] = edge.seeds();
                let next = || seeds_for(most, edge.error, MIN_SEEDS, sweep.seed_count()).unwrap_or(most);
                let seeds = if fewest < most { most } else { next() };
                edge.sets.iter().filter_map(|set| Some((at(set.row)?, seeds))).collect()
            };
            let missing = |&(set, number): &(u64, u64)| number.saturating_sub(seeds.get(&set).copied().unwrap_or(0));
            let jobs: u64 = wanted.iter().map(missing).sum();
            // What another edge of this round has asked for comes anyway.
            let is_asked = |(set, _): &(u64, u64)| seeds.get(set) > sets.get(set).map(|set| &set.seeds);
            if jobs > room || (jobs == 0 && !wanted.iter().any(is_asked)) {
                standing.edges_capped += 1;
                continue;
            }
            room -= jobs;
            for (set, number) in wanted {
                let known = seeds.entry(set).or_default();
                *known = number.max(*known);
            }
        }
    }
    let had = |set: &u64| sets.get(set).map_or(0, |set| set.seeds);
    let new: Vec<(u64, u64)> = seeds.into_iter().filter(|(set, number)| *number > had(set)).collect();
    standing.sets_open = new.len() as u64;
    standing.sets_done = sets.keys().filter(|set| !new.iter().any(|(number, _)| number == *set)).count() as u64;
    let points = new.iter().flat_map(|(set, number)| sweep.points_of_set(*set, had(set)..*number)).collect();
    Round { points: sweep.with_controls(points), standing }
}
