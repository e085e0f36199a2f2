//! A pulse of the modulation: the same in all solvers, exact, balanced, and without effect before it begins.

use super::{Limits, Resolve, Solver, simulate, simulate_audited};
use crate::model::{Change, ContactEvent, Drive, Parameters};
use crate::observe::{ContactLog, Recording, Slip, measure};
use std::sync::atomic::AtomicBool;

const GRID: Solver = Solver::event_driven(1e-3);
const EXACT: Solver = Solver::event_driven(1e-10);

fn taylor() -> Solver {
    Solver {
        resolve: Resolve::Taylor,
        ..Solver::event_driven(1e-6)
    }
}

fn pulsed(start: f64) -> Parameters {
    let parameters = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(0.008),
        pulse_start: Some(start),
        pulse_cycles: Some(2),
        ..Parameters::default()
    };
    parameters.validated().expect("a pulse")
}

fn events(parameters: &Parameters, solver: Solver, end_time: f64) -> Vec<ContactEvent> {
    let mut log = ContactLog::default();
    let limits = Limits {
        end_time,
        events: 1_000_000,
        interrupt: None,
    };
    simulate(parameters, solver, limits, &mut log).expect("the simulation must not fail");
    log.events
}

fn which(event: &ContactEvent) -> (usize, usize, u32, bool) {
    let is_break = event.change == Change::Break;
    (event.block, event.contact, event.generation, is_break)
}

#[test]
fn events_before_a_pulse_are_those_of_the_control_at_every_period() {
    for blocks in [5, 70] {
        let of = |start: f64, period: f64, cycles: u64| Parameters {
            blocks,
            modulation_period: Some(period),
            pulse_cycles: Some(cycles),
            ..pulsed(start)
        };
        for solver in [GRID, taylor(), Solver::fixed_step(1e-6)] {
            let control = events(&of(0.0, 1.0, 1).without_modulation(), solver, 0.3);
            let slip = control.iter().find(|event| event.generation > 3);
            let slip = slip.expect("a slip").time;
            // The last of these starts between two events of a step of the grid.
            for start in [0.0, 0.0413, 0.17, slip, slip + 7e-7] {
                for (frequency, cycles) in [
                    (1.0, 1),
                    (29.0, 1),
                    (2.5e3, 1),
                    (1e4, 2),
                    (1e5, 11),
                    (1e6, 101),
                ] {
                    let parameters = of(start, 1.0 / frequency, cycles);
                    let run = events(&parameters, solver, start + 1e-3);
                    let before = |events: &[ContactEvent]| {
                        let before = events.iter().filter(|event| event.time < start);
                        before.copied().collect::<Vec<_>>()
                    };
                    let expected = before(&control);
                    assert!(!expected.is_empty() || start < 0.05);
                    assert!(
                        before(&run) == expected,
                        "N = {blocks}, {solver:?}, from {start} s on at {frequency} Hz"
                    );
                }
            }
        }
    }
}

#[test]
fn a_job_that_is_done_is_the_same_whatever_its_longest_time() {
    for (blocks, amplitude) in [(1, 6e-7), (5, 0.0), (5, 1e-6), (12, 6e-7)] {
        for solver in [GRID, taylor(), Solver::fixed_step(1e-6)] {
            let parameters = Parameters {
                blocks,
                contacts_per_block: 5,
                modulation_amplitude: amplitude,
                modulation_period: Some(1.0 / 58.0),
                seed: 289,
                ..Parameters::default()
            };
            let parameters = parameters.validated().unwrap();
            let measured = |max_time: Option<f64>| {
                let recording = Recording {
                    slips: Some(3),
                    discard: 1,
                    precursors: true,
                    drop_size: Some(2.0),
                    max_time,
                    ..Recording::default()
                };
                measure(&parameters, &recording, solver, &AtomicBool::new(false)).unwrap()
            };
            let free = measured(None);
            let last = free.slips[2];
            let begin = last.onset - 1e-3;
            let done = (0..60).filter(|&step| {
                let max_time =
                    begin + (free.summary.end_time + 1e-3 - begin) * f64::from(step) / 59.0;
                let found = measured(Some(max_time));
                assert!(found.summary.end_time <= max_time + 1.1e-6);
                assert!(
                    !found.summary.satisfied || found == free,
                    "{blocks} {solver:?} {max_time}"
                );
                for (one, other) in found.slips.iter().zip(&free.slips) {
                    // The end may cut a drop.
                    let drops = other.drops;
                    assert_eq!(Slip { drops, ..*one }, *other);
                }
                found.summary.satisfied
            });
            assert!((1..60).contains(&done.count()), "{blocks} {solver:?}");
        }
    }
}

/// The first breaks, of so many contacts.
fn first_breaks(parameters: &Parameters, solver: Solver, count: usize) -> Vec<ContactEvent> {
    let mut events = events(parameters, solver, 0.09);
    events.retain(|event| event.change == Change::Break);
    events.truncate(count);
    events
}

#[test]
fn all_solvers_break_the_same_contacts_at_the_same_times() {
    // The first contacts break near 0.06 s.
    let parameters = pulsed(0.045);
    let exact = first_breaks(&parameters, EXACT, 60);
    let free = first_breaks(&parameters.without_modulation(), EXACT, 60);
    assert!(exact[0].time < free[0].time - 1e-4);
    for (solver, allowed) in [
        // Breaks come up to a step late.
        (Solver::fixed_step(1e-7), 2e-6),
        (Solver::event_driven(1e-6), 5e-8),
        (taylor(), 5e-8),
        (GRID, 1e-5),
    ] {
        let others = first_breaks(&parameters, solver, 80);
        for event in &exact {
            let other = others.iter().find(|other| which(other) == which(event));
            let late = other.map_or(f64::INFINITY, |other| (event.time - other.time).abs());
            assert!(late < allowed, "{solver:?}: {late:e}");
        }
    }
}

#[test]
fn pulses_balance_their_energy() {
    for start in [0.0, 0.0413, 0.17] {
        for (solver, allowed) in [
            // On the grid.
            (Solver::event_driven(1e-4), 1e-5),
            (Solver::event_driven(1e-8), 1e-11),
            (Solver::fixed_step(1e-6), 2.5e-3),
        ] {
            let limits = Limits {
                end_time: 0.3,
                events: 1_000_000,
                interrupt: None,
            };
            let mut log = ContactLog::default();
            let (summary, ledger) =
                simulate_audited(&pulsed(start), solver, limits, &mut log).unwrap();
            assert!(summary.breaks > 1000, "{summary:?}");
            let residual = ledger.residual().abs();
            assert!(residual < allowed, "{residual:e} with {solver:?}, {start}");
        }
    }
}

#[test]
fn a_rigid_block_on_identical_contacts_breaks_earlier_as_the_closed_form_says() {
    let parameters = |start: Option<f64>, amplitude: f64| {
        let parameters = Parameters {
            blocks: 1,
            threshold_deviation: 0.0,
            drive_velocity: 1e-6,
            modulation_amplitude: amplitude,
            modulation_period: Some(0.05),
            pulse_start: start,
            ..Parameters::default()
        };
        parameters.validated().unwrap()
    };
    let first_break = |parameters: &Parameters| {
        let events = events(parameters, EXACT, 1.2);
        let mut breaks = events.iter().filter(|event| event.change == Change::Break);
        breaks.next().expect("a break").time
    };
    let free = first_break(&parameters(None, 0.0));
    let mut advances = 0;
    for start in [0.7, 0.82, 0.87, 0.91, 0.94, 1.1] {
        for amplitude in [2e-9, 2e-8, 5e-8] {
            let parameters = parameters(Some(start), amplitude);
            let advance = free - first_break(&parameters);
            // Without inertia the contacts break at one displacement of the driven end.
            let expected = free - Drive::new(&parameters).first_passage(free);
            advances += usize::from(expected > 1e-3);
            // The block follows γ m/(K_s + K_d) = 0.5 ms late.
            assert!(
                (advance - expected).abs() < 6e-4,
                "{start} {amplitude}: {advance} {expected}"
            );
        }
    }
    assert!(advances > 4, "{advances}");
}
