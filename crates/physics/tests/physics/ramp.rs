//! A ramp of the modulation within a run: the same in both solvers, exact, and balanced, also where it is steep.

use std::collections::HashMap;
use stickslip_physics::model::{Change, Parameters};
use stickslip_physics::observe::{ContactLog, Observers, Trace};
use stickslip_physics::solver::{Limits, Resolve, Solver, simulate, simulate_audited};

/// Period and amplitude change a lot before the first break, near 0.06 s.
fn ramped() -> Parameters {
    let parameters = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(0.01),
        turning_period: Some(0.004),
        turning_amplitude: Some(3e-7),
        ramp_time: 0.05,
        ..Parameters::default()
    };
    parameters.validated().expect("a whole ramp")
}

/// Times of the first breaks, by block, contact and generation.
fn first_breaks(
    parameters: &Parameters,
    solver: Solver,
    breaks: usize,
) -> HashMap<(usize, usize, u32), f64> {
    let mut log = ContactLog::default();
    let limits = Limits {
        end_time: 0.09,
        events: 1_000_000,
        interrupt: None,
    };
    simulate(parameters, solver, limits, &mut log).expect("the simulation must not fail");
    let broken = log
        .events
        .iter()
        .filter(|event| event.change == Change::Break);
    broken
        .take(breaks)
        .map(|event| ((event.block, event.contact, event.generation), event.time))
        .collect()
}

/// Largest difference between break times, in s; infinite if other contacts break.
fn difference(
    of: &HashMap<(usize, usize, u32), f64>,
    from: &HashMap<(usize, usize, u32), f64>,
) -> f64 {
    of.iter()
        .map(|(key, time)| {
            from.get(key)
                .map_or(f64::INFINITY, |other| (time - other).abs())
        })
        .fold(0.0, f64::max)
}

const EXACT: Solver = Solver::event_driven(1e-10);

#[test]
fn both_solvers_break_the_same_contacts_at_the_same_times() {
    let exact = first_breaks(&ramped(), EXACT, 60);
    assert_eq!(exact.len(), 60);
    // Breaks come up to a step late, and a late one meets another phase of the fast motion.
    let stepped = first_breaks(&ramped(), Solver::fixed_step(1e-7), 80);
    assert!(
        difference(&exact, &stepped) < 2e-6,
        "{:e}",
        difference(&exact, &stepped)
    );
    // At 1e-6 of the contact reach, the drive covers the tolerance in 3e-9 s: some ten times that.
    let coarser = first_breaks(&ramped(), Solver::event_driven(1e-6), 80);
    assert!(
        difference(&exact, &coarser) < 5e-8,
        "{:e}",
        difference(&exact, &coarser)
    );
    // A ramp that were not followed would show.
    let steady = Parameters {
        turning_period: None,
        turning_amplitude: None,
        ramp_time: 0.0,
        ..ramped()
    };
    assert!(difference(&exact, &first_breaks(&steady, EXACT, 200)) > 1e-4);
}

#[test]
fn both_solvers_show_the_same_trace() {
    let parameters = ramped();
    let traced = |solver| {
        let (mut lead, mut trace) = (ContactLog::default(), Trace::new(&parameters, 1e-4));
        let limits = Limits {
            end_time: 0.05,
            events: 1_000_000,
            interrupt: None,
        };
        simulate(
            &parameters,
            solver,
            limits,
            &mut Observers(vec![&mut lead, &mut trace]),
        )
        .unwrap();
        trace.rows
    };
    let exact = traced(EXACT);
    let stepped = traced(Solver::fixed_step(1e-7));
    assert!(exact.len() >= 500 && stepped.len() >= 500);
    // A leap does not show the free motion that it carries over: 4e-4 N after the jolt of the start, the largest here.
    // A ramp that were not followed would be off by up to K_d (Δ - Δ_to) = 28 N.
    let allowed = 1e-3;
    for (exact, stepped) in exact.iter().zip(&stepped) {
        let moved = (exact.displacement - stepped.displacement).abs();
        assert!(
            (exact.force - stepped.force).abs() < allowed,
            "{exact:?} and {stepped:?}"
        );
        assert!(
            moved < allowed / parameters.drive_stiffness,
            "{exact:?} and {stepped:?}"
        );
    }
}

#[test]
fn steep_ramps_balance_their_energy() {
    let ends = |period, amplitude, ramp_time| Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(0.02),
        turning_period: period,
        turning_amplitude: amplitude,
        ramp_time,
        ..Parameters::default()
    };
    let cases = [
        ends(Some(1e-4), None, 0.1),
        ends(None, Some(0.0), 0.1),
        ends(Some(1e-4), Some(0.0), 0.05),
        ends(Some(10.0), Some(1e-5), 0.1),
        // The turning point comes and goes within the first cycle.
        ends(Some(1e-4), Some(0.0), 1e-3),
    ];
    let taylor = |tolerance| Solver {
        resolve: Resolve::Taylor,
        ..Solver::event_driven(tolerance)
    };
    for parameters in cases {
        let limits = Limits {
            end_time: 0.25,
            events: 1_000_000,
            interrupt: None,
        };
        for (solver, allowed) in [
            // As without a ramp.
            (Solver::event_driven(1e-4), 1e-5),
            (taylor(1e-4), 1e-6),
            (taylor(1e-8), 1e-11),
            (Solver::fixed_step(1e-6), 2.5e-3),
        ] {
            let parameters = parameters.clone().validated().unwrap();
            let (summary, ledger) =
                simulate_audited(&parameters, solver, limits, &mut ContactLog::default()).unwrap();
            assert!(summary.breaks > 1000, "{summary:?}");
            let residual = ledger.residual().abs();
            assert!(
                residual < allowed,
                "{residual:e} with {solver:?}, {parameters:?}"
            );
        }
    }
}

#[test]
fn a_ramp_within_the_first_cycle_has_no_effect() {
    let hasty = Parameters {
        ramp_time: 0.004,
        ..ramped()
    };
    let steady = Parameters {
        turning_period: None,
        turning_amplitude: None,
        ramp_time: 0.0,
        ..ramped()
    };
    let [hasty, steady] = [hasty, steady].map(|parameters| first_breaks(&parameters, EXACT, 60));
    assert!(
        difference(&hasty, &steady) < 1e-11,
        "{:e}",
        difference(&hasty, &steady)
    );
}
