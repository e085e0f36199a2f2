//! Rounds of sweeps that look for edges, from the first to the end, with responses whose edges are known.

use super::*;
use crate::reduce::{Edge, Units, mean};
use crate::sets::Statistic;
use crate::sweep::Target;
use crate::table::columns::Interval;
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
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
        let of_set = (self.mean)(amplitude, velocity);
        let value = |seed: u64| {
            let noise = self.common.sqrt() * normal(0, seed)
                + (1.0 - self.common).sqrt() * normal(1 + number, seed);
            of_set.unwrap_or(0.0) + self.deviation * noise
        };
        let values = Units::of((0..seeds).map(|seed| (seed, vec![[1.0, value(seed), 0.0]])));
        SetOfEdges {
            seeds,
            excesses: vec![of_set.and_then(|_| values.estimate(mean))],
            ..SetOfEdges::default()
        }
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
                    (0..rows.len())
                        .map(|axis| sweep.value_at(axis, rows[axis]))
                        .find(|found| found.0 == key)
                };
                let had = sets.get(&number).map_or(0, |set| set.seeds);
                let [amplitude, velocity] =
                    ["Delta", "V0"].map(|key| value(key).map_or(0.0, |found| found.1));
                sets.insert(number, self.set(number, had + more, amplitude, velocity));
            }
            rounds.push(at_edges(sweep, sweep.refinement().unwrap(), &sets));
            assert!(rounds.len() < 100, "no end");
        }
        (rounds, sets)
    }
}

/// Where on a linear axis the edges of each row lie, with their intervals, and whether these are as narrow as is
/// wanted.
fn found(sweep: &Sweep, sets: &BTreeMap<u64, SetOfEdges>) -> Vec<Vec<([f64; 3], bool)>> {
    let axis = sweep.refinement().unwrap().axis;
    let [first, second] = [0, 1].map(|row| sweep.value_at(axis, row).1);
    let of_edge = |edge: &Edge<'_>| {
        let [low, high] = edge.interval;
        (
            [low, edge.place, high].map(|row| first + row * (second - first)),
            edge.is_done(),
        )
    };
    let lines = lines(sweep, sweep.refinement().unwrap(), sets);
    lines
        .iter()
        .map(|line| line.edges.iter().map(of_edge).collect())
        .collect()
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
fn coverage(
    repetitions: u64,
    steepness: f64,
    deviation: f64,
    common: f64,
    response: fn(f64) -> f64,
) -> Coverage {
    let sweep = sweep(
        "Delta = { linear = [0, 1e-6], points = 5 }",
        "to = 1e-8\nseeds = { from = 24, to = 2000 }\njobs = 100000",
    );
    let mut held = 0;
    let mut reached = 0;
    let mut jobs = 0;
    let mut rounds_run = 0;
    for repetition in 0..repetitions {
        // Anywhere between two of the first sets.
        let edge = 1e-6 * (0.3 + 0.15 * ((repetition * 89 % 144) as f64 / 144.0));
        let mean = |amplitude: f64, _: f64| Some(response((amplitude - edge) / (steepness * 1e-8)));
        let (rounds, sets) = Noisy {
            mean,
            deviation,
            common,
            repetition,
        }
        .rounds(&sweep);
        let [of_row] = &found(&sweep, &sets)[..] else {
            panic!("one row")
        };
        if let [([low, _, high], is_done)] = of_row[..] {
            held += u64::from(low <= edge && edge <= high);
            reached += u64::from(is_done);
        }
        jobs += sets.values().map(|set| set.seeds).sum::<u64>();
        rounds_run += rounds.len() - 1;
    }
    let share = |count: u64| 100.0 * count as f64 / repetitions as f64;
    let mean = |sum: f64| sum / repetitions as f64;
    Coverage {
        held: share(held),
        reached: share(reached),
        jobs: mean(jobs as f64),
        rounds: mean(rounds_run as f64),
    }
}

fn tanh(place: f64) -> f64 {
    libm::tanh(place)
}

/// Bends everywhere, its slope being e times as large one width on.
fn bent(place: f64) -> f64 {
    libm::expm1(place)
}

/// Rises slowly at first.
fn skewed(place: f64) -> f64 {
    2.0 * libm::exp(-libm::exp(-place) * std::f64::consts::LN_2) - 1.0
}

/// Jobs of plain bisection to the same width, and the share of brackets that hold the edge, in %: a set gets twice as
/// many seeds until it is clear on which side it lies, and at the cap it counts by its estimate.
fn plain_bisection(
    repetitions: u64,
    steepness: f64,
    deviation: f64,
    response: fn(f64) -> f64,
) -> (f64, f64) {
    let mut jobs = 0;
    let mut held = 0;
    for repetition in 0..repetitions {
        let edge = 0.3 + 0.15 * ((repetition * 89 % 144) as f64 / 144.0);
        let mean = |amplitude: f64, _: f64| Some(response((amplitude - edge) / (steepness * 1e-2)));
        let noisy = Noisy {
            mean,
            deviation,
            common: 0.0,
            repetition,
        };
        let mut low = 0.25_f64;
        let mut high = 0.5;
        jobs += 5 * 24;
        while high - low > 1e-2 {
            let middle = 0.5 * (low + high);
            let mut seeds = 24;
            let side = loop {
                let set = noisy.set(middle.to_bits(), seeds, middle, 0.0);
                let excess = set.excesses[0].as_ref().unwrap();
                if excess.half_width().unwrap() < excess.value.abs() || seeds >= 2000 {
                    break excess.value;
                }
                seeds = (2 * seeds).min(2000);
            };
            jobs += seeds;
            if side > 0.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        held += u64::from(low <= edge && edge <= high);
    }
    (
        jobs as f64 / repetitions as f64,
        100.0 * held as f64 / repetitions as f64,
    )
}

/// Coverage of edges, which `docs/rounds.md` sums up: run with `--ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn coverage_of_edges_is_measured() {
    let bounded = [
        (0.01, 1.0),
        (0.5, 0.3),
        (1.0, 1.0),
        (2.0, 1.0),
        (5.0, 1.0),
        (10.0, 0.6),
        (20.0, 0.3),
    ];
    for (name, response) in [
        ("tanh", tanh as fn(f64) -> f64),
        ("skewed", skewed),
        ("bent", bent),
    ] {
        let cases = if name == "bent" {
            &bounded[2..6]
        } else {
            &bounded[..]
        };
        for &(steepness, deviation) in cases {
            let Coverage {
                held,
                reached,
                jobs,
                rounds,
            } = coverage(300, steepness, deviation, 0.3, response);
            let (plain, plain_held) = plain_bisection(300, steepness, deviation, response);
            println!(
                "| {name} | {steepness} | {deviation} | {held:.1} | {reached:.1} | {rounds:.1} | {jobs:.0} | {plain:.0} | {plain_held:.1} |"
            );
        }
    }
}

#[test]
fn intervals_of_steep_and_of_flat_edges_hold_them_as_often_as_they_say() {
    for (steepness, deviation, at_least) in [(0.01, 1.0, 98.0), (1.0, 1.0, 90.0), (10.0, 0.3, 90.0)]
    {
        let found = coverage(100, steepness, deviation, 0.3, tanh);
        assert!(
            found.held >= at_least && found.reached > 99.9,
            "{steepness} {deviation}: {found:?}"
        );
    }
    // By their number, seeds of a flat response are many: what is common to neighbours is no error of their difference.
    assert!(coverage(50, 10.0, 0.3, 0.0, tanh).jobs > 2.0 * coverage(50, 1.0, 0.3, 0.0, tanh).jobs);
}

fn noisy(mean: impl Fn(f64, f64) -> Option<f64>) -> Noisy<impl Fn(f64, f64) -> Option<f64>> {
    Noisy {
        mean,
        deviation: 0.1,
        common: 0.3,
        repetition: 1,
    }
}

const DELTA: &str = "Delta = { linear = [0.5e-6, 4.5e-6], points = 9 }";

#[test]
fn edges_up_and_down_are_found_and_sets_without_a_value_are_no_side() {
    let sweep = sweep(
        DELTA,
        "to = 1e-8\nseeds = { from = 24, to = 500 }\njobs = 20000",
    );
    // Above 1.23 µm, but between 2.71 and 3.3 µm; there is nothing between 1.6 and 2.1 µm.
    let mean = |amplitude: f64, _: f64| {
        let side = |edge: f64| libm::tanh((1e6 * amplitude - edge) / 0.02);
        (!(1.6e-6..2.1e-6).contains(&amplitude)).then(|| side(1.23) * side(2.71) * side(3.3))
    };
    let (_, sets) = noisy(mean).rounds(&sweep);
    let [of_row] = &found(&sweep, &sets)[..] else {
        panic!()
    };
    let places: Vec<f64> = of_row
        .iter()
        .map(|([_, place, _], _)| 1e6 * place)
        .collect();
    assert!(
        places
            .iter()
            .zip([1.23, 2.71, 3.3])
            .all(|(found, edge)| (found - edge).abs() < 0.02),
        "{places:?}"
    );
    assert!(places.len() == 3 && of_row.iter().all(|(_, is_done)| *is_done));
    let (rounds, _) = noisy(|_, _| Some(1.0)).rounds(&sweep);
    assert_eq!(rounds.len(), 2, "no edge, no further round");
    let (rounds, _) = noisy(|_, _| None).rounds(&sweep);
    assert_eq!(rounds.len(), 2, "no value");
}

#[test]
fn sets_that_are_not_clear_get_seeds_before_a_row_is_said_to_have_no_edge() {
    let sweep = sweep(
        DELTA,
        "to = 1e-7\nseeds = { from = 24, to = 500 }\njobs = 20000",
    );
    // At the first set and at the one in the middle, or anywhere.
    let of_repetition = |mean: fn(f64) -> f64, repetition: u64| {
        let noise = Noisy {
            repetition,
            ..noisy(|amplitude, _| Some(mean(1e6 * amplitude)))
        };
        let (rounds, sets) = noise.rounds(&sweep);
        let lines = lines(&sweep, sweep.refinement().unwrap(), &sets);
        let line = lines[0].clone();
        let seeds = line.unclear.iter().flat_map(|stretch| &stretch.sets);
        let seeds: Vec<u64> = seeds.map(|set| set.set.seeds).collect();
        let edges: Vec<_> = found(&sweep, &sets)[0].clone();
        let most = sets.values().map(|set| set.seeds).max().unwrap();
        (rounds.last().unwrap().standing, edges, seeds, most)
    };
    // A set at the threshold is taken for clear once in twenty times: most repetitions have as many unclear ones as are
    // expected.
    let ended = |mean: fn(f64) -> f64, expected: usize| {
        let mut found: Vec<_> = (1..6)
            .map(|repetition| of_repetition(mean, repetition))
            .collect();
        found.retain(|(_, _, unclear, _)| unclear.len() == expected);
        assert!(found.len() >= 3, "{expected}: {}", found.len());
        found.swap_remove(0)
    };
    // Below the threshold by a fifth of the noise, at one end or at the other: too little for 24 seeds.
    for mean in [|x: f64| x - 0.52, |x: f64| 4.48 - x] {
        let (standing, edges, unclear, _) = ended(mean, 0);
        assert_eq!(
            (edges.len(), unclear.len(), standing.sets_capped),
            (1, 0, 0)
        );
        let place = 1e6 * edges[0].0[1];
        assert!(mean(place).abs() < 0.1, "{place}");
    }
    for mean in [|x: f64| x - 0.5, |x: f64| x - 4.5] {
        let (standing, edges, unclear, _) = ended(mean, 1);
        assert!(edges.is_empty() && unclear == [500], "{unclear:?}");
        assert_eq!((standing.sets_capped, standing.edges_capped), (1, 0));
        assert_eq!(standing.sets_done, 8);
    }
    // In the middle, between sets that are above.
    let touches = |x: f64| (x - 2.5) * (x - 2.5);
    let (standing, edges, unclear, _) = ended(touches, 1);
    assert!(edges.is_empty() && unclear == [500], "{unclear:?}");
    assert_eq!(standing.sets_capped, 1);
    let (_, edges, unclear, most) = ended(|x| (x - 2.5) * (x - 2.5) + 0.02, 0);
    assert!(
        edges.is_empty() && unclear.is_empty() && most > 24,
        "{most}"
    );
    let (_, edges, unclear, _) = ended(|x| (x - 2.5) * (x - 2.5) - 0.02, 0);
    assert!(edges.len() == 2 && unclear.is_empty(), "{edges:?}");
    // All of them: the sets at both ends, and no others.
    let (standing, edges, unclear, _) = ended(|_| 0.0, 2);
    assert!(edges.is_empty() && unclear == [500, 500], "{unclear:?}");
    assert_eq!((standing.sets_capped, standing.sets_done), (2, 7));
}

#[test]
fn what_ends_an_edge_too_early_is_counted_and_no_more_jobs_run_than_are_allowed() {
    let mean = |amplitude: f64, _: f64| Some(1e6 * (amplitude - 2.345e-6));
    let ended = |seeds: u64, jobs: u64| {
        let sweep = sweep(
            DELTA,
            &format!("to = 1e-8\nseeds = {{ from = 24, to = {seeds} }}\njobs = {jobs}"),
        );
        let (rounds, sets) = noisy(mean).rounds(&sweep);
        let total: u64 = sets.values().map(|set| set.seeds).sum();
        assert!(
            total <= jobs && sets.values().all(|set| set.seeds <= seeds),
            "{total}"
        );
        let [(interval, is_done)] = found(&sweep, &sets)[0][..] else {
            panic!("one edge")
        };
        assert!(
            interval[0] < 2.345e-6 && 2.345e-6 < interval[2],
            "{interval:?}"
        );
        (rounds.last().unwrap().standing.edges_capped, is_done)
    };
    assert_eq!(
        [ended(2000, 90_000), ended(50, 90_000), ended(2000, 300)],
        [(0, true), (1, false), (1, false)]
    );
    // So near the edge that a line through few seeds may be level.
    let sweep = sweep(
        DELTA,
        "to = 1e-8\nseeds = { from = 24, to = 24 }\njobs = 90000",
    );
    let (_, sets) = noisy(mean).rounds(&sweep);
    let lines = lines(&sweep, sweep.refinement().unwrap(), &sets);
    let Edge {
        interval: [low, high],
        place,
        error,
        ..
    } = lines[0].edges[0];
    assert!(
        error.is_infinite() && low < place && place < high,
        "the bracket: {low} {place} {high}"
    );
}

#[test]
fn each_row_has_its_edges_and_points_that_are_no_jobs_are_passed_over() {
    let text = "name = \"a\"\nwhere = \"Delta < 3e-6 or V0 < 8e-5\"\n[model]\nfrequency = 29\n[axes]\n\
                Delta = { linear = [0, 4e-6], points = 5 }\nV0 = { linear = [1e-5, 1e-4], points = 3 }\n\
                [refine]\nby = \"mean_friction\"\nthreshold = 0\naxis = \"Delta\"\nto = 5e-8\n\
                seeds = { first = 1000, from = 2, to = 90 }\njobs = 9000";
    let sweep = Sweep::parse(text, Path::new("test.toml")).unwrap();
    assert!(
        sweep.warnings()[0].contains("from = 2 is raised to 24"),
        "{:?}",
        sweep.warnings()
    );
    let mean = |amplitude: f64, velocity: f64| Some(1e6 * (amplitude - 0.03 * velocity - 4e-7));
    let (_, sets) = noisy(mean).rounds(&sweep);
    let places: Vec<Vec<f64>> = found(&sweep, &sets)
        .into_iter()
        .map(|row| row.into_iter().map(|(at, _)| 1e6 * at[1]).collect())
        .collect();
    let expected: [&[f64]; 3] = [&[0.7], &[2.05], &[]];
    for (places, expected) in places.iter().zip(expected) {
        assert_eq!(places.len(), expected.len(), "{places:?}");
        assert!(
            places
                .iter()
                .zip(expected)
                .all(|(place, edge)| (place - edge).abs() < 0.05),
            "{places:?}"
        );
    }
    let jobs: Vec<_> = sweep.jobs().collect();
    assert!(
        sets.keys()
            .all(|set| jobs.iter().any(|job| job.point == *set))
    );
    assert_eq!(jobs.iter().map(|job| job.parameters.seed).min(), Some(1000));
}

fn statistic(key: &str) -> Statistic {
    Statistic::from_key(key).unwrap()
}

fn precision(keys: &[&str], target: Target) -> Precision {
    Precision {
        statistics: keys.iter().map(|key| statistic(key)).collect(),
        target,
    }
}

fn row(mean: f64, half: f64) -> SetRow {
    let interval = Some(Interval::around(mean, half));
    SetRow {
        tau_mean: Some(mean),
        tau_interval: interval,
        ..SetRow::default()
    }
}

#[test]
fn a_set_gets_the_predicted_seeds_within_bounds_until_its_target_is_met() {
    let relative = precision(&["tau_mean"], Target::Relative(0.01));
    let seeds = |seeds, half| need(&relative, seeds, 256, &row(2.0, half));
    // The target is 0.02.
    assert_eq!(seeds(40, 0.0199), None);
    assert_eq!(seeds(40, 0.024), Some(58));
    assert_eq!(seeds(40, 0.0201), Some(50));
    assert_eq!(seeds(40, 0.2), Some(80));
    assert_eq!(seeds(200, 0.2), Some(256));
    assert_eq!(seeds(256, 0.2), Some(256));
    assert_eq!(seeds(256, 0.0199), None);
    // However good it looks.
    assert_eq!(seeds(4, 1e-6), Some(8));
    assert_eq!(seeds(20, 1e-6), Some(25));
    assert_eq!(seeds(16, 1e-6), Some(MIN_SEEDS));
    assert_eq!(seeds(MIN_SEEDS, 1e-6), None);
    let absolute = precision(&["tau_mean"], Target::Absolute(0.05));
    assert_eq!(need(&absolute, 40, 256, &row(2.0, 0.0499)), None);
    assert_eq!(need(&absolute, 40, 256, &row(1e-3, 0.06)), Some(58));
}

#[test]
fn the_worst_of_several_statistics_counts_and_one_without_value_does_not() {
    let both = precision(&["tau_mean", "drop_mean"], Target::Relative(0.01));
    let row = SetRow {
        drop_mean: Some(1.0),
        ..row(2.0, 0.01)
    };
    assert_eq!(
        need(&both, 40, 256, &row),
        Some(80),
        "a value without interval"
    );
    let interval = Some(Interval {
        low: 0.995,
        high: 1.005,
    });
    assert_eq!(
        need(
            &both,
            40,
            256,
            &SetRow {
                drop_interval: interval,
                ..row
            }
        ),
        None
    );
    // A slider that slides has no intervals between slips, and never will.
    assert_eq!(need(&both, 4, 256, &SetRow::default()), None);
}

proptest! {
    #[test]
    fn seeds_grow_by_a_quarter_at_least_and_double_at_most(
        seeds in 2_u64..1000, error in prop_oneof![0.0..4.0, Just(f64::INFINITY), Just(f64::NAN)], most in 2_u64..2000
    ) {
        let seeds = seeds.min(most);
        match seeds_for(seeds, error, MIN_SEEDS, most) {
            None => prop_assert!(error <= 1.0 && seeds >= MIN_SEEDS.min(most)),
            Some(next) if seeds == most => prop_assert_eq!(next, most),
            Some(next) => {
                prop_assert!(next > seeds && next <= (2 * seeds).min(most));
                prop_assert!(next == most || 4 * next >= 5 * seeds);
            }
        }
    }
}
