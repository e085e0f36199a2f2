//! The grid where it is hard: it ends as Taylor steps do, its contact log is consistent, and it stops when it must.

use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use stickslip_physics::model::equation::StiffnessMatrix;
use stickslip_physics::model::{Change, ContactEvent, Parameters};
use stickslip_physics::observe::{
    AttachedMap, ContactLog, Observers, Recording, SlipObserver, Trace,
};
use stickslip_physics::solver::{Limits, Resolve, SimulationError, Solver, Summary, simulate};

const fn solver(tolerance: f64, resolve: Resolve) -> Solver {
    Solver {
        resolve,
        ..Solver::event_driven(tolerance)
    }
}

const GRID: Solver = solver(1e-3, Resolve::Grid);
const TAYLOR: Solver = solver(1e-3, Resolve::Taylor);

/// A case with what it is and its end, in s.
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn cases() -> Vec<(String, Parameters, f64)> {
    let base = Parameters::default;
    let modulated = |amplitude: f64, period: f64| Parameters {
        modulation_amplitude: amplitude,
        modulation_period: Some(period),
        ..base()
    };
    let resonant = |index: usize| {
        let squared = StiffnessMatrix::intact(&base()).eigenvalue(index) / base().block_mass();
        std::f64::consts::TAU / squared.sqrt()
    };
    let mut cases: Vec<(&str, Parameters, f64)> = vec![
        ("many slips", base(), 4.0),
        (
            "far from the origin",
            Parameters {
                blocks: 2,
                contacts_per_block: 2,
                drive_velocity: 1e-3,
                ..base()
            },
            60.0,
        ),
        (
            "ties",
            Parameters {
                threshold_deviation: 0.0,
                ..base()
            },
            0.5,
        ),
        (
            "ties of one block",
            Parameters {
                threshold_deviation: 0.0,
                blocks: 1,
                ..base()
            },
            1.0,
        ),
        (
            "hasty contacts",
            Parameters {
                reattachment_time: 1e-6,
                ..base()
            },
            0.12,
        ),
        (
            "slow contacts",
            Parameters {
                reattachment_time: 10.0,
                ..base()
            },
            5.0,
        ),
        (
            "wide thresholds",
            Parameters {
                threshold_deviation: 0.411,
                ..base()
            },
            0.5,
        ),
        (
            "half the threshold wide, slow",
            Parameters {
                threshold_deviation: 0.685,
                drive_velocity: 1e-6,
                blocks: 9,
                ..base()
            },
            8.0,
        ),
        (
            "no damping",
            Parameters {
                damping_rate: 0.0,
                ..base()
            },
            0.3,
        ),
        (
            "overdamped",
            Parameters {
                damping_rate: 1e7,
                ..base()
            },
            0.1,
        ),
        (
            "slow drive",
            Parameters {
                drive_velocity: 1e-8,
                ..base()
            },
            8000.0,
        ),
        (
            "fast drive",
            Parameters {
                drive_velocity: 1e-2,
                ..base()
            },
            0.05,
        ),
        ("a trace of modulation", modulated(1e-9, 0.02), 0.5),
        ("strong modulation", modulated(1e-4, 0.02), 0.1),
        ("fast modulation", modulated(1e-6, 1e-5), 0.12),
        ("slow modulation", modulated(1e-6, 100.0), 0.5),
        (
            "fast modulation of one block",
            Parameters {
                blocks: 1,
                drive_velocity: 2e-6,
                ..modulated(1e-6, 2e-4)
            },
            0.7,
        ),
        (
            "resonance of the slowest mode",
            Parameters {
                damping_rate: 10.0,
                ..modulated(1e-8, resonant(0))
            },
            0.2,
        ),
        (
            "resonance of the fastest mode",
            Parameters {
                damping_rate: 10.0,
                ..modulated(1e-8, resonant(69))
            },
            0.1,
        ),
        (
            "many blocks",
            Parameters {
                blocks: 1000,
                ..base()
            },
            0.25,
        ),
        (
            "one contact a block",
            Parameters {
                contacts_per_block: 1,
                ..base()
            },
            0.1,
        ),
        (
            "many contacts a block",
            Parameters {
                contacts_per_block: 1000,
                ..base()
            },
            0.6,
        ),
        (
            "stiff",
            Parameters {
                slider_stiffness: 1e10,
                ..base()
            },
            0.5,
        ),
        (
            "a ramp that ends within a cycle",
            Parameters {
                turning_period: Some(1.0 / 80.0),
                turning_amplitude: Some(0.0),
                ramp_time: 0.21,
                ..modulated(1e-6, 1.0 / 58.0)
            },
            0.3333,
        ),
    ];
    for blocks in [1, 2, 7, 8, 9, 64] {
        cases.push(("size", Parameters { blocks, ..base() }, 0.4));
    }
    let named = |(what, parameters, end): (&str, Parameters, f64)| {
        (
            format!("{what}, N = {}", parameters.blocks),
            parameters.validated().unwrap(),
            end,
        )
    };
    cases.into_iter().map(named).collect()
}

/// What a run leaves behind.
struct Outcome {
    summary: Summary,
    events: Vec<ContactEvent>,
    slips: usize,
    mean_force: f64,
}

fn run(parameters: &Parameters, solver: Solver, end_time: f64) -> Outcome {
    let recording = Recording {
        slips: Some(u64::MAX),
        discard: 0,
        ..Recording::default()
    };
    let (mut log, mut slips) = (
        ContactLog::default(),
        SlipObserver::new(parameters, &recording),
    );
    let mut trace = Trace::new(parameters, end_time / 2000.0);
    let limits = Limits {
        end_time,
        events: 20_000_000,
        interrupt: None,
    };
    let mut all = Observers(vec![&mut log, &mut slips, &mut trace]);
    let summary = simulate(parameters, solver, limits, &mut all).unwrap();
    let mean_force = trace.rows.iter().map(|row| row.force).sum::<f64>() / trace.rows.len() as f64;
    Outcome {
        summary,
        events: log.events,
        slips: slips.into_measurements(summary).slips.len(),
        mean_force,
    }
}

/// Events in order; a contact attaches when it is detached, and breaks in the life in which it attached, at its
/// threshold and with the force of its elongation.
fn assert_consistent(name: &str, parameters: &Parameters, events: &[ContactEvent]) {
    let mut attached: HashMap<(usize, usize), ContactEvent> = HashMap::new();
    let mut lives: HashMap<(usize, usize), u32> = HashMap::new();
    let mut before = 0.0;
    for event in events {
        assert!(event.time >= before, "{name}: {event:?} after {before} s");
        before = event.time;
        let which = (event.block, event.contact);
        match event.change {
            Change::Attach => {
                assert_eq!(event.force, 0.0, "{name}: {event:?}");
                let expected = lives.get(&which).map_or(0, |life| life + 1);
                assert_eq!(event.generation, expected, "{name}: {event:?}");
                assert!(
                    attached.insert(which, *event).is_none(),
                    "{name}: {event:?} is attached"
                );
                lives.insert(which, event.generation);
            }
            Change::Break => {
                let begun = attached
                    .remove(&which)
                    .unwrap_or_else(|| panic!("{name}: {event:?} is detached"));
                assert_eq!(event.generation, begun.generation, "{name}: {event:?}");
                // Displacements are counted from far away, the force is not.
                let force = event.stiffness * (event.displacement - begun.displacement);
                let rounding =
                    1e-12 * event.threshold + event.stiffness * 1e-15 * event.displacement.abs();
                assert!(
                    (event.force - force).abs() <= rounding.max(1e-9),
                    "{name}: {event:?}, {force} N"
                );
                let over = event.force.abs() - event.threshold;
                assert!(
                    over.abs() <= 1e-3 * parameters.mean_threshold,
                    "{name}: {event:?}"
                );
            }
        }
    }
}

/// Mean over seeds of the mean force, in N.
fn mean_force_of_seeds(parameters: &Parameters, solver: Solver, end_time: f64) -> f64 {
    const SEEDS: u64 = 32;
    let of_seed = |seed| {
        let parameters = Parameters {
            seed,
            ..parameters.clone()
        };
        run(&parameters, solver, end_time).mean_force
    };
    let forces = (1..=SEEDS).into_par_iter().map(of_seed);
    forces.sum::<f64>() / SEEDS as f64
}

#[test]
fn hard_cases_end_on_the_grid_as_in_taylor_steps() {
    for (name, parameters, end_time) in cases() {
        let taylor = run(&parameters, TAYLOR, end_time);
        for tolerance in [1e-3, 1e-7] {
            let Outcome {
                summary,
                events,
                slips,
                mean_force,
            } = run(&parameters, solver(tolerance, Resolve::Grid), end_time);
            assert_eq!(summary.end_time, end_time, "{name}");
            assert!(
                summary.grid_steps > 0 || summary.breaks == 0,
                "{name}: {summary:?}"
            );
            let broken = events
                .iter()
                .filter(|event| event.change == Change::Break)
                .count() as u64;
            assert_eq!(broken, summary.breaks, "{name}");
            assert_consistent(&name, &parameters, &events);
            // Trajectories are chaotic: some slips more or less.
            let breaks = taylor.summary.breaks as f64;
            let contacts = (parameters.blocks * parameters.contacts_per_block) as f64;
            let allowed = 0.1 * breaks + 4.0 * contacts;
            assert!(
                (summary.breaks as f64 - breaks).abs() <= allowed,
                "{name}: {summary:?}, {:?}",
                taylor.summary
            );
            let allowed = 0.1 * taylor.slips as f64 + 2.0 * (taylor.slips as f64).sqrt();
            assert!(
                (slips as f64 - taylor.slips as f64).abs() <= allowed,
                "{name}: {slips} slips, {}",
                taylor.slips
            );
            // Without damping the force of a single run spreads by a fifth.
            let forces = if parameters.damping_rate == 0.0 {
                [solver(tolerance, Resolve::Grid), TAYLOR]
                    .map(|solver| mean_force_of_seeds(&parameters, solver, end_time))
            } else {
                [mean_force, taylor.mean_force]
            };
            let scale = forces[1].abs().max(1.0);
            assert!(
                (forces[0] - forces[1]).abs() < 0.1 * scale,
                "{name}: {forces:?} N"
            );
        }
    }
}

#[test]
fn before_chaos_the_grid_shows_the_same_trace_and_map() {
    let modulated = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(1.0 / 58.0),
        ..Parameters::default()
    };
    let ramped = Parameters {
        turning_period: Some(1.0 / 80.0),
        ramp_time: 0.03,
        ..modulated.clone()
    };
    for parameters in [Parameters::default(), modulated, ramped] {
        let sampled = |solver| {
            let (mut log, mut trace) = (ContactLog::default(), Trace::new(&parameters, 2e-5));
            let mut map = AttachedMap::new(&parameters, 2e-5);
            let limits = Limits {
                end_time: 0.09,
                events: 1_000_000,
                interrupt: None,
            };
            let mut all = Observers(vec![&mut log, &mut trace, &mut map]);
            simulate(&parameters, solver, limits, &mut all).unwrap();
            (log.events, trace.rows, map.rows)
        };
        let (events, exact, cells) = sampled(solver(1e-9, Resolve::Taylor));
        assert!(
            events
                .iter()
                .filter(|event| event.change == Change::Break)
                .count()
                > 40
        );
        for tolerance in [1e-5, 1e-6] {
            let (_, rows, mapped) = sampled(solver(tolerance, Resolve::Grid));
            assert_eq!((rows.len(), mapped.len()), (exact.len(), cells.len()));
            // A leap shows the driven motion alone, without the free motion about it, and in ruptures errors grow. A
            // modulation that were not followed would be off by 40 N.
            let (mut off, mut other) = (0, 0);
            for (row, exact) in rows.iter().zip(&exact) {
                assert_eq!(row.time, exact.time);
                let difference = (row.force - exact.force).abs();
                assert!(difference < 5.0, "{tolerance:e}: {row:?}, {exact:?}");
                off += usize::from(difference > 0.05);
                other += usize::from(row.attached_fraction != exact.attached_fraction);
            }
            assert!(50 * off <= rows.len(), "{off} of {} samples", rows.len());
            // A sample between two times of one event, or in a step whose events are told at the last of them.
            assert!(
                50 * other <= rows.len(),
                "{other} of {} samples",
                rows.len()
            );
            let differing = mapped
                .iter()
                .zip(&cells)
                .filter(|(a, b)| a.attached_fraction != b.attached_fraction);
            assert!(differing.count() <= 2 * other);
        }
    }
}

#[test]
fn a_run_on_the_grid_answers_an_interrupt_within_a_second() {
    let slow = Parameters {
        blocks: 1000,
        damping_rate: 0.0,
        ..Parameters::default()
    };
    for parameters in [
        Parameters::default(),
        Parameters {
            drive_velocity: 1e-8,
            ..Parameters::default()
        },
        slow,
    ] {
        let interrupt = AtomicBool::new(false);
        let answered = std::thread::scope(|scope| {
            let run = scope.spawn(|| {
                let limits = Limits {
                    end_time: f64::INFINITY,
                    events: u64::MAX,
                    interrupt: Some(&interrupt),
                };
                let recording = Recording {
                    slips: Some(u64::MAX),
                    ..Recording::default()
                };
                let error = simulate(
                    &parameters,
                    GRID,
                    limits,
                    &mut SlipObserver::new(&parameters, &recording),
                );
                (error.unwrap_err(), Instant::now())
            });
            std::thread::sleep(Duration::from_millis(200));
            let asked = Instant::now();
            interrupt.store(true, Ordering::Relaxed);
            let (error, ended) = run.join().unwrap();
            assert!(
                matches!(error, SimulationError::Interrupted { time } if time > 0.0),
                "{error}"
            );
            ended - asked
        });
        assert!(answered < Duration::from_secs(1), "{answered:?}");
    }
}

#[test]
fn a_grid_too_fine_for_the_clock_is_refused_and_taylor_steps_are_not_taken_instead() {
    // The grid's clock runs to 0.5 s, so it needs longer steps than Taylor series do.
    let parameters = Parameters {
        damping_rate: 5e9,
        ..Parameters::default()
    };
    let ended = |resolve| {
        let limits = Limits {
            end_time: 1e-8,
            events: 1_000_000,
            interrupt: None,
        };
        simulate(
            &parameters,
            solver(1e-3, resolve),
            limits,
            &mut ContactLog::default(),
        )
    };
    let error = ended(Resolve::Grid).unwrap_err();
    assert!(
        matches!(error, SimulationError::StepTooShort { step, .. } if step < 1e-9),
        "{error}"
    );
    assert_eq!(ended(Resolve::Auto).unwrap().grid_steps, 0);
}
