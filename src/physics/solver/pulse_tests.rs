//! A pulse of the modulation: the same in all solvers, exact, balanced, and without effect before it begins.

use super::{Limits, Resolve, Solver, simulate, simulate_audited};
use crate::model::{Change, ContactEvent, Drive, Parameters};
use crate::observe::ContactLog;

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
fn a_run_and_its_control_agree_until_the_pulse_begins() {
    for solver in [GRID, taylor(), Solver::fixed_step(1e-6)] {
        for start in [0.0, 0.0413, 0.17, 0.2213] {
            let parameters = pulsed(start);
            let control = events(&parameters.without_modulation(), solver, 0.3);
            let run = events(&parameters, solver, 0.3);
            let before = control.iter().filter(|event| event.time < start).count();
            assert!(before > 0 || start == 0.0);
            for (event, other) in run.iter().zip(&control[..before]) {
                assert_eq!(which(event), which(other), "{solver:?} {start}");
                // The last leap before the pulse ends with it, and leaves out free motion of a part of the tolerance.
                let allowed = if other.time < start - 0.02 { 0.0 } else { 1e-7 };
                let late = (event.time - other.time).abs();
                assert!(
                    late <= allowed,
                    "{solver:?} {start}: {late:e} at {}",
                    other.time
                );
            }
            let after = control.iter().zip(&run).skip(before);
            let first = after.into_iter().find(|(event, _)| event.time > start);
            let (free, moved) = first.expect("events after the pulse began");
            assert!(free.time - moved.time > -1e-7, "{solver:?} {start}");
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
            (Solver::event_driven(1e-4), 1e-6),
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
