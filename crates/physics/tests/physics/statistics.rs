//! Statistics of the model with the default solver against those of an independent event-exact implementation, and Eq.
//! 1 against the simulated profile.
//!
//! Reference, at V0 = 1e-4 m/s with about 1,000 slips each (standard error of the mean in brackets):
//!
//! | case | mean τ / s | s.d. / s | quantiles 5, 25, 50, 75, 95 % / s |
//! |---|---|---|---|
//! | Δ = 0 | 0.1115 (5) | 0.0159 | 0.0988 0.1033 0.1074 0.1120 0.1613 |
//! | Δ = 0, identical contacts | 0.1118 (5) | 0.0157 | 0.0989 0.1037 0.1076 0.1129 0.1508 |
//! | Δ = 1 µm, 1/T = 29 Hz | 0.1371 (6) | 0.0164 | 0.1262 0.1343 0.1378 0.1399 0.1447 |
//! | Δ = 1 µm, 1/T = 58 Hz | 0.1273 (12) | 0.0364 | 0.0692 0.0993 0.1376 0.1381 0.2065 |

use crate::deterministic_rows::exact_decay_per_block;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;
use stickslip_physics::model::equation::StiffnessMatrix;
use stickslip_physics::model::{Change, ContactEvent, Parameters};
use stickslip_physics::observe::{Measurements, Recording, measure};
use stickslip_physics::solver::{Limits, Observer, Resolve, Segment, Solver, simulate};
use stickslip_physics::value::floored;

/// Intervals between slips past start-up, in s, sorted.
struct Intervals(Vec<f64>);

impl Intervals {
    /// Interpolated linearly.
    fn quantile(&self, share: f64) -> f64 {
        let rank = share * (self.0.len() - 1) as f64;
        let pair = [rank.floor(), rank.ceil()].map(|place| self.0[floored(place)]);
        pair[0] + rank.fract() * (pair[1] - pair[0])
    }

    /// Of this many slips for each seed, with the default solver.
    fn of(parameters: &Parameters, seeds: u64, slips: u64) -> Self {
        let recording = Recording {
            slips: Some(slips),
            ..Recording::default()
        };
        let of_seed = |seed| {
            let parameters = Parameters {
                seed,
                ..parameters.clone()
            }
            .validated()
            .unwrap();
            let result = measure(
                &parameters,
                &recording,
                Solver::default(),
                &AtomicBool::new(false),
            )
            .unwrap();
            result
                .slips
                .iter()
                .filter_map(|slip| slip.interval)
                .collect::<Vec<_>>()
        };
        let mut intervals: Vec<f64> = (0..seeds).into_par_iter().flat_map_iter(of_seed).collect();
        intervals.sort_by(f64::total_cmp);
        Self(intervals)
    }

    fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / self.0.len() as f64
    }

    fn deviation(&self) -> f64 {
        let mean = self.mean();
        (self.0.iter().map(|tau| (tau - mean).powi(2)).sum::<f64>() / (self.0.len() as f64 - 1.0))
            .sqrt()
    }

    fn standard_error(&self) -> f64 {
        self.deviation() / (self.0.len() as f64).sqrt()
    }

    /// Share of the intervals in [low, high).
    fn share(&self, low: f64, high: f64) -> f64 {
        self.0
            .iter()
            .filter(|tau| (low..high).contains(*tau))
            .count() as f64
            / self.0.len() as f64
    }

    /// |<exp(2πi τ/T)>|: 1 if all intervals leave the same remainder modulo T.
    fn locking_index(&self, period: f64) -> f64 {
        let mean = |part: fn(f64) -> f64| {
            self.0
                .iter()
                .map(|tau| part(std::f64::consts::TAU * tau / period))
                .sum::<f64>()
                / self.0.len() as f64
        };
        mean(f64::cos).hypot(mean(f64::sin))
    }

    fn describe(&self) -> String {
        let quantiles = [0.05, 0.25, 0.5, 0.75, 0.95].map(|share| self.quantile(share));
        let (mean, error, deviation) = (self.mean(), self.standard_error(), self.deviation());
        format!(
            "{} intervals, mean {mean:.4} ({error:.4}) s, s.d. {deviation:.4} s, quantiles {quantiles:.4?} s",
            self.0.len()
        )
    }
}

fn modulated(frequency: f64) -> Parameters {
    Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(1.0 / frequency),
        ..Parameters::default()
    }
}

#[test]
fn without_modulation_intervals_have_the_mean_and_the_two_peaks_of_fig_2d() {
    let intervals = Intervals::of(&Parameters::default(), 8, 75);
    let shown = intervals.describe();
    // 3 % are five standard errors.
    assert!((intervals.mean() / 0.111 - 1.0).abs() < 0.03, "{shown}");
    // The reference's s.d. rests on the few intervals of the second peak: a fifth is two of its standard errors.
    assert!(
        (intervals.deviation() / 0.0159 - 1.0).abs() < 0.2,
        "{shown}"
    );
    // The first peak, the gap behind it, and the second peak near 0.165 s.
    assert!(intervals.share(0.095, 0.125) > 0.8, "{shown}");
    assert!(intervals.share(0.14, 0.15) < 0.01, "{shown}");
    let long: Vec<f64> = intervals
        .0
        .iter()
        .copied()
        .filter(|tau| *tau >= 0.15)
        .collect();
    assert!(
        (0.01..0.15).contains(&intervals.share(0.15, f64::INFINITY)),
        "{shown}"
    );
    assert!(
        (long.iter().sum::<f64>() / long.len() as f64 - 0.165).abs() < 0.005,
        "{long:?}"
    );
}

#[test]
fn identical_contacts_keep_the_distribution_broad() {
    let intervals = Intervals::of(
        &Parameters {
            threshold_deviation: 0.0,
            ..Parameters::default()
        },
        8,
        30,
    );
    let shown = intervals.describe();
    assert!(
        (intervals.mean() - 0.1118).abs() < 0.03 * 0.1118 + 3.0 * intervals.standard_error(),
        "{shown}"
    );
    // Reference: 0.0157 s, and 0.0092 s between the quartiles.
    assert!(intervals.deviation() > 0.01, "{shown}");
    let [lower, upper] = [0.25, 0.75].map(|share| intervals.quantile(share));
    assert!(upper - lower > 0.006, "{shown}");
}

#[test]
fn modulated_intervals_sit_on_multiples_of_the_period_at_29_and_58_hz() {
    // (1/T in Hz, mean of the reference in s, its median in periods: 4/29 s = 8/58 s). A longer run gave locking
    // indices of 0.874 and 0.893.
    for (frequency, mean, periods) in [(29.0, 0.1371, 4), (58.0, 0.1273, 8)] {
        let intervals = Intervals::of(&modulated(frequency), 8, 40);
        let shown = intervals.describe();
        let index = intervals.locking_index(1.0 / frequency);
        assert!(index > 0.8, "{frequency} Hz: {index}, {shown}");
        // A third or more at the median's number, and nowhere as many.
        let share = |n: i32| {
            intervals.share(
                (f64::from(n) - 0.5) / frequency,
                (f64::from(n) + 0.5) / frequency,
            )
        };
        let most = (1..20).max_by(|a, b| share(*a).total_cmp(&share(*b)));
        assert!(
            most == Some(periods) && share(periods) > 1.0 / 3.0,
            "{frequency} Hz: {most:?}, {shown}"
        );
        let difference = (intervals.mean() - mean).abs();
        assert!(
            difference < 0.03 * mean + 3.0 * intervals.standard_error(),
            "{frequency} Hz: {shown}"
        );
    }
}

/// A slider whose slips take a millisecond to compute.
fn small(seed: u64) -> Parameters {
    Parameters {
        blocks: 10,
        contacts_per_block: 5,
        seed,
        ..Parameters::default()
    }
    .validated()
    .unwrap()
}

fn measured(parameters: &Parameters, recording: Recording, solver: Solver) -> Measurements {
    measure(parameters, &recording, solver, &AtomicBool::new(false)).unwrap()
}

#[test]
fn a_job_with_a_time_ends_with_the_first_slip_that_begins_then_or_later() {
    let of = |slips, discard, time| {
        let recording = Recording {
            slips,
            discard,
            time,
            ..Recording::default()
        };
        measured(&small(3), recording, Solver::default())
    };
    for discard in [0, 5] {
        let all = of(Some(20), discard, None).slips;
        let end_at = |time: f64| {
            let found = of(None, discard, Some(time));
            assert!(found.summary.satisfied && found.running_interval.is_none());
            let count = found.slips.len();
            assert_eq!(found.slips, all[..count], "{time}");
            count
        };
        for (last, slip) in all.iter().enumerate().take(12) {
            // An onset counts as reached at its very time.
            assert_eq!(end_at(slip.onset), last + 1);
            assert_eq!(end_at(slip.onset.next_up()), last + 2);
        }
        // Start-up counts to no end: its slips are not recorded.
        assert_eq!(end_at(1e-9), 1);
        assert_eq!(of(Some(4), discard, Some(all[7].onset)).slips, all[..4]);
        assert_eq!(of(Some(9), discard, Some(all[7].onset)).slips, all[..8]);
    }
}

#[test]
fn a_job_that_is_cut_before_the_end_of_its_last_slip_is_not_done_and_whatever_is_done_is_whole() {
    let solvers = [
        Solver::default(),
        Solver {
            resolve: Resolve::Taylor,
            ..Solver::event_driven(1e-6)
        },
        Solver::fixed_step(2e-6),
    ];
    for (seed, solver) in (0..).zip(solvers) {
        let until = |max_time| {
            let recording = Recording {
                slips: Some(2),
                discard: 1,
                max_time,
                ..Recording::default()
            };
            measured(&small(seed), recording, solver)
        };
        let whole = until(None);
        let last = whole.slips.last().unwrap();
        let last_break = last.nucleation + last.duration;
        let mut done = 0;
        for step in 0..=40 {
            let share = f64::from(step) / 32.0;
            let end = last.onset + share * (whole.summary.end_time - last.onset);
            let cut = until(Some(end));
            assert_eq!(cut.running_interval, None);
            if cut.summary.satisfied {
                done += 1;
                assert!(end > last_break);
                assert_eq!(cut, whole);
            } else {
                // Where the end comes with that of the slip, this is whole, too.
                assert!(whole.slips.starts_with(&cut.slips) && !cut.slips.is_empty());
            }
        }
        assert!(done > 0, "{solver:?}");
    }
}

/// By Wald's identity: the number of intervals up to a time is a stopping time. Measured with more jobs: docs/model.md.
#[test]
fn the_mean_interval_has_no_bias_by_where_jobs_end_at_a_time_as_it_has_where_they_are_cut() {
    const JOBS: u64 = 1500;
    let mean = |recording: Recording| {
        let sums = |seed| {
            let slips = measured(&small(seed), recording, Solver::default()).slips;
            let intervals = slips.iter().filter_map(|slip| slip.interval);
            (intervals.sum::<f64>(), slips.len() as f64)
        };
        let (time, count) = (0..JOBS).into_par_iter().map(sums).reduce(
            || (0.0, 0.0),
            |one, other| (one.0 + other.0, one.1 + other.1),
        );
        time / count
    };
    let of_slips = mean(Recording {
        slips: Some(16),
        ..Recording::default()
    });
    let at_time = mean(Recording {
        slips: None,
        time: Some(0.22),
        ..Recording::default()
    });
    let cut = mean(Recording {
        max_time: Some(0.22),
        ..Recording::default()
    });
    // Those of the same seeds share most of their intervals: the difference is known to 0.5 %.
    assert!(
        (at_time / of_slips - 1.0).abs() < 0.02,
        "{at_time} {of_slips}"
    );
    assert!(cut / of_slips < 0.965, "{cut} {of_slips}");
}

#[test]
fn a_job_that_gives_up_knows_how_long_it_waited_since_its_last_slip_if_there_was_any() {
    let gives_up = |drive_velocity| {
        let parameters = Parameters {
            drive_velocity,
            ..small(0)
        };
        let recording = Recording {
            give_up_after: Some(3e-6),
            ..Recording::default()
        };
        measured(&parameters, recording, Solver::default())
    };
    let (some, none) = (gives_up(1e-4), gives_up(2e-4));
    assert!(
        some.has_given_up && some.running_interval.unwrap() >= 3e-6 / 1e-4,
        "{:?}",
        some.running_interval
    );
    assert!(none.has_given_up && none.slips.is_empty() && none.running_interval.is_none());
}

/// Follows a simulation to its first break.
struct FirstBreak {
    /// Stiffness of the contacts of each block, in N/m.
    contacts: Vec<f64>,
    /// Shear force, in N.
    force: f64,
    first: Option<ContactEvent>,
}

impl Observer for FirstBreak {
    fn advance(&mut self, segment: &Segment<'_>) {
        if self.first.is_none() {
            self.force = segment.force_after(segment.duration);
        }
    }

    fn contact(&mut self, event: &ContactEvent) {
        match event.change {
            Change::Attach => self.contacts[event.block] += event.stiffness,
            Change::Break => self.first = self.first.or(Some(*event)),
        }
    }

    fn is_satisfied(&self) -> bool {
        self.first.is_some()
    }
}

/// Displacement over that of the trailing edge, of the block and at the instant of the first break: as simulated, and
/// by the static chain with the very contacts of this realisation.
fn profile_at_the_first_break(parameters: &Parameters) -> (usize, f64, f64) {
    let mut observer = FirstBreak {
        contacts: vec![0.0; parameters.blocks],
        force: 0.0,
        first: None,
    };
    let limits = Limits {
        end_time: f64::INFINITY,
        events: u64::MAX,
        interrupt: None,
    };
    simulate(parameters, Solver::default(), limits, &mut observer).unwrap();
    let first = observer.first.unwrap();
    let trailing =
        parameters.drive_velocity * first.time - observer.force / parameters.drive_stiffness;
    // Elimination from the leading edge: x_(j+1) = K_int x_j / p_(j+1).
    let chain = StiffnessMatrix::new(parameters, &observer.contacts);
    let mut pivots = chain.diagonal;
    for block in (1..pivots.len() - 1).rev() {
        pivots[block] -= chain.coupling * chain.coupling / pivots[block + 1];
    }
    let exact = pivots[1..=first.block]
        .iter()
        .map(|pivot| -chain.coupling / pivot)
        .product();
    (first.block, first.displacement / trailing, exact)
}

#[test]
fn displacement_before_the_first_break_decays_as_eq_1() {
    // A wide spread of thresholds, so that the first contact to break lies now here, now there; slow, so that inertia
    // and damping are below 1e-4 of the forces.
    let of_seed = |seed| Parameters {
        seed,
        threshold_deviation: 0.45,
        drive_velocity: 1e-5,
        ..Parameters::default()
    };
    let profiles: Vec<_> = (0..200)
        .into_par_iter()
        .map(|seed| profile_at_the_first_break(&of_seed(seed)))
        .collect();
    for (block, simulated, exact) in &profiles {
        assert!(
            (simulated / exact - 1.0).abs() < 1e-3,
            "block {}: {simulated} against {exact}",
            block + 1
        );
    }
    // The spread makes contacts softer, k E[sqrt(f/fs)], which takes 0.7 % from the rate, and differs from block to
    // block.
    let rates: Vec<f64> = profiles
        .iter()
        .filter(|(block, ..)| *block >= 3)
        .map(|(block, simulated, _)| -simulated.ln() / *block as f64)
        .collect();
    assert!(
        rates.len() >= 30,
        "{} first breaks away from the edge",
        rates.len()
    );
    let rate = rates.iter().sum::<f64>() / rates.len() as f64;
    let theory = exact_decay_per_block(&Parameters::default());
    assert!(
        (rate / theory - 1.0).abs() < 0.02,
        "{rate} against {theory} a block"
    );
}
