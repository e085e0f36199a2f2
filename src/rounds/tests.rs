//! Rounds of sweeps that look for edges, from the first to the end, with responses whose edges are known.

use super::edges::decide;
use crate::reduce::{GROUPS, Line, Sample, SetOfEdges, lines};
use crate::sweep::{Round, Sweep};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

fn sweep(axes: &str, refine: &str) -> Sweep {
    let text = format!(
        "name = \"a\"\n[model]\nT = 0.03\n[axes]\n{axes}\n[refine]\naxis = \"Delta\"\nby = \"mean_friction\"\n\
         threshold = 0\n{refine}"
    );
    Sweep::parse(&text, Path::new("test.toml")).unwrap()
}

/// A mean response with noise of the standard deviation 1, of which a share is common to all sets of a seed.
struct Noisy<F: Fn(f64, f64) -> Option<f64>> {
    mean: F,
    deviation: f64,
    common: f64,
    repetition: u64,
}

impl<F: Fn(f64, f64) -> Option<f64>> Noisy<F> {
    /// What a set would have with seeds: amplitude and velocity are those of its parameters.
    fn set(&self, number: u64, seeds: u64, amplitude: f64, velocity: f64) -> SetOfEdges {
        let normal = |stream: u64, seed: u64| {
            let mut generator = ChaCha8Rng::seed_from_u64(self.repetition ^ (seed << 32));
            generator.set_stream(stream);
            let mut uniform = || ((generator.next_u64() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
            (-2.0 * libm::log(uniform())).sqrt() * libm::cos(TAU * uniform())
        };
        let (mut counts, mut sums) = ([0; GROUPS], [0.0; GROUPS]);
        let mean = (self.mean)(amplitude, velocity);
        for seed in 0..seeds {
            let group = usize::try_from(seed).unwrap() % GROUPS;
            let noise = self.common.sqrt() * normal(0, seed) + (1.0 - self.common).sqrt() * normal(1 + number, seed);
            counts[group] += 1;
            sums[group] += mean.unwrap_or(0.0) + self.deviation * noise;
        }
        let (count, total): (u64, f64) = (counts.iter().sum(), sums.iter().sum());
        let less = |group: Option<usize>| {
            let (of_group, sum) = group.map_or((0, 0.0), |group| (counts[group], sums[group]));
            mean.filter(|_| count > of_group).map(|_| (total - sum) / (count - of_group) as f64)
        };
        SetOfEdges { seeds, samples: vec![Sample::new(&counts, 0.0, less)], ..SetOfEdges::default() }
    }

    /// Runs the rounds to their end.
    fn rounds(&self, sweep: &Sweep) -> (Vec<Round>, BTreeMap<u64, SetOfEdges>) {
        let mut sets: BTreeMap<u64, SetOfEdges> = BTreeMap::new();
        let mut rounds = vec![sweep.first_round().unwrap()];
        while !rounds.last().unwrap().is_end() {
            let mut seeds: BTreeMap<u64, u64> = BTreeMap::new();
            for point in rounds.last().unwrap().points.iter().cloned().flatten() {
                *seeds.entry(sweep.set_of(point)).or_default() += 1;
            }
            for (number, more) in seeds {
                let rows = sweep.rows(number);
                let value = |key: &str| {
                    (0..rows.len()).filter_map(|axis| sweep.value_at(axis, rows[axis])).find(|found| found.0 == key)
                };
                let had = sets.get(&number).map_or(0, |set| set.seeds);
                let [amplitude, velocity] = ["Delta", "V0"].map(|key| value(key).map_or(0.0, |found| found.1));
                sets.insert(number, self.set(number, had + more, amplitude, velocity));
            }
            rounds.push(decide(sweep, sweep.refinement().unwrap(), &sets));
            assert!(rounds.len() < 100, "no end");
        }
        (rounds, sets)
    }
}

/// Where the edges of each row lie, with their intervals, and whether these are as narrow as is wanted.
fn found(sweep: &Sweep, sets: &BTreeMap<u64, SetOfEdges>) -> Vec<Vec<([f64; 3], bool)>> {
    let of_edge = |edge: &crate::reduce::Edge<'_>| {
        let [low, high] = edge.interval.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        ([low, edge.place, high], edge.is_done())
    };
    let lines = lines(sweep, sweep.refinement().unwrap(), sets);
    lines.iter().map(|Line { edges, .. }| edges.iter().map(of_edge).collect()).collect()
}

/// What repetitions came to, of an edge at a place that the grid does not know.
#[derive(Debug)]
struct Coverage {
    /// Share of intervals that hold the edge, and that are as narrow as is wanted, in %.
    held: f64,
    reached: f64,
    jobs: f64,
    rounds: f64,
}

/// Of a response that rises from -1 to 1 over a width, in units of the width that is wanted.
fn coverage(repetitions: u64, steepness: f64, deviation: f64, common: f64, response: fn(f64) -> f64) -> Coverage {
    let sweep = sweep(
        "Delta = { linear = [0, 1e-6], points = 5 }",
        "to = 1e-8\nseeds = { from = 24, to = 2000 }\njobs = 100000",
    );
    let (mut held, mut reached, mut jobs, mut rounds_run) = (0, 0, 0, 0);
    for repetition in 0..repetitions {
        // Anywhere between two of the first sets.
        let edge = 1e-6 * (0.3 + 0.15 * ((repetition * 89 % 144) as f64 / 144.0));
        let mean = |amplitude: f64, _: f64| Some(response((amplitude - edge) / (steepness * 1e-8)));
        let (rounds, sets) = Noisy { mean, deviation, common, repetition }.rounds(&sweep);
        let [of_row] = &found(&sweep, &sets)[..] else { panic!("one row") };
        if let [([low, _, high], is_done)] = of_row[..] {
            held += u64::from(low <= edge && edge <= high);
            reached += u64::from(is_done);
        }
        jobs += sets.values().map(|set| set.seeds).sum::<u64>();
        rounds_run += rounds.len() - 1;
    }
    let share = |count: u64| 100.0 * count as f64 / repetitions as f64;
    let mean = |sum: f64| sum / repetitions as f64;
    Coverage { held: share(held), reached: share(reached), jobs: mean(jobs as f64), rounds: mean(rounds_run as f64) }
}

fn tanh(place: f64) -> f64 {
    libm::tanh(place)
}

/// Rises slowly at first.
fn skewed(place: f64) -> f64 {
    2.0 * libm::exp(-libm::exp(-place) * std::f64::consts::LN_2) - 1.0
}

#[test]
#[ignore = "a measurement"]
fn coverage_of_edges_is_measured() {
    for (name, response) in [("tanh", tanh as fn(f64) -> f64), ("skewed", skewed)] {
        for steepness in [0.01, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0] {
            for (deviation, common) in [(0.3, 0.0), (1.0, 0.0), (1.0, 0.5)] {
                if steepness * deviation < 21.0 {
                    println!(
                        "{name} {steepness} {deviation} {common}: {:.1?}",
                        coverage(300, steepness, deviation, common, response)
                    );
                }
            }
        }
    }
}
