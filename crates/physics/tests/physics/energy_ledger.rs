//! The energy ledger balances: an error certificate of every solver, on the model of Fig. 1.

use std::sync::atomic::AtomicBool;
use stickslip_physics::model::Parameters;
use stickslip_physics::observe::{ContactLog, Observers, Recording, SlipObserver, measure};
use stickslip_physics::solver::{Limits, Resolve, Solver, simulate, simulate_audited};

const LIMITS: Limits<'static> = Limits {
    end_time: 0.25,
    events: 1_000_000,
    interrupt: None,
};

fn residual(parameters: &Parameters, solver: Solver) -> f64 {
    let (summary, ledger) =
        simulate_audited(parameters, solver, LIMITS, &mut ContactLog::default())
            .expect("the simulation must not fail");
    assert!(summary.breaks > 3000, "no slip to audit");
    assert!(
        ledger.work > 0.0 && ledger.damping > 0.0 && ledger.broken > 0.0 && ledger.elastic > 0.0,
        "{ledger:?}"
    );
    assert!(ledger.left_out.abs() < 1e-4 * ledger.damping, "{ledger:?}");
    ledger.residual().abs()
}

fn drives() -> [Parameters; 3] {
    let modulated = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(1.0 / 58.0),
        ..Parameters::default()
    };
    let ramped = Parameters {
        turning_period: Some(1.0 / 80.0),
        turning_amplitude: Some(5e-7),
        ramp_time: 0.1,
        ..modulated.clone()
    };
    [Parameters::default(), modulated, ramped]
}

const fn taylor(tolerance: f64) -> Solver {
    Solver {
        resolve: Resolve::Taylor,
        ..Solver::event_driven(tolerance)
    }
}

const fn grid(tolerance: f64) -> Solver {
    Solver {
        resolve: Resolve::Grid,
        ..Solver::event_driven(tolerance)
    }
}

#[test]
fn the_ledger_of_taylor_steps_balances_within_their_tolerance() {
    for parameters in drives() {
        // Far better than the tolerance of one displacement: seen 1e-7, 1e-8, 3e-10, 2e-13, 1e-13.
        for (tolerance, allowed) in [
            (1e-3, 1e-5),
            (1e-4, 1e-6),
            (1e-6, 1e-8),
            (1e-8, 1e-11),
            (1e-10, 1e-11),
        ] {
            let residual = residual(&parameters, taylor(tolerance));
            assert!(residual < allowed, "{tolerance:e}: {residual:e}");
        }
    }
}

#[test]
fn the_ledger_of_the_grid_is_of_fourth_order_in_its_step() {
    for parameters in drives() {
        // The step goes with the fourth root of the tolerance. Seen: 0.03 to 0.04 of it.
        for tolerance in [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8] {
            let residual = residual(&parameters, grid(tolerance));
            assert!(
                (0.01..0.1).contains(&(residual / tolerance)),
                "{tolerance:e}: {residual:e}"
            );
        }
    }
}

#[test]
fn the_fixed_step_ledger_balances_in_the_order_of_its_step() {
    for parameters in drives() {
        // Contacts break up to a step late, past their thresholds: seen 6e-3 at 4e-6 s and proportional to the step.
        for time_step in [4e-6, 2e-6, 1e-6] {
            let residual = residual(&parameters, Solver::fixed_step(time_step));
            assert!(
                (500.0..2500.0).contains(&(residual / time_step)),
                "{time_step:e}: {residual:e}"
            );
        }
    }
}

#[test]
fn an_audit_does_not_change_the_simulation() {
    for parameters in drives() {
        for solver in [grid(1e-3), taylor(1e-3), Solver::fixed_step(2e-6)] {
            let (mut plain, mut audited) = (ContactLog::default(), ContactLog::default());
            let summary = simulate(&parameters, solver, LIMITS, &mut plain).unwrap();
            let (audited_summary, _) =
                simulate_audited(&parameters, solver, LIMITS, &mut audited).unwrap();
            assert_eq!(summary, audited_summary);
            assert_eq!(plain.events, audited.events);
        }
    }
}

/// Be it one that follows the force and attachments, or a ledger.
#[test]
fn no_observer_changes_what_another_sees() {
    for parameters in drives() {
        let observer = || {
            let recording = Recording {
                slips: Some(40),
                ..Recording::default()
            };
            SlipObserver::new(&parameters, &recording)
        };
        let limits = Limits {
            end_time: f64::INFINITY,
            ..LIMITS
        };
        let seen = |observer: SlipObserver, summary| observer.into_measurements(summary).slips;
        let mut alone = observer();
        let summary = simulate(&parameters, Solver::default(), limits, &mut alone).unwrap();
        let alone = seen(alone, summary);
        let mut in_company = observer();
        let mut log = ContactLog::default();
        let mut both = Observers(vec![&mut in_company, &mut log]);
        let summary = simulate(&parameters, Solver::default(), limits, &mut both).unwrap();
        let mut audited = observer();
        let (audited_summary, _) =
            simulate_audited(&parameters, Solver::default(), limits, &mut audited).unwrap();
        for others in [seen(in_company, summary), seen(audited, audited_summary)] {
            assert_eq!(others.len(), alone.len());
            for (slip, other) in alone.iter().zip(&others) {
                // Where segments end elsewhere, an onset is rounded otherwise.
                assert!(
                    (slip.onset - other.onset).abs() < 1e-14 * slip.onset,
                    "{slip:?} {other:?}"
                );
                assert_eq!([slip.size, slip.precursors], [other.size, other.precursors]);
            }
        }
    }
}

/// What is stored in the springs varies by a few per cent of the work of ten slips.
#[test]
fn the_work_of_the_drive_over_many_slips_goes_into_damping_and_broken_contacts() {
    let recording = Recording {
        slips: Some(30),
        discard: 3,
        energies: true,
        ..Recording::default()
    };
    for (modulation_amplitude, modulation_period) in [(0.0, None), (1e-6, Some(1.0 / 58.0))] {
        let parameters = Parameters {
            modulation_amplitude,
            modulation_period,
            ..Parameters::default()
        };
        let measured = measure(
            &parameters,
            &recording,
            Solver::default(),
            &AtomicBool::new(false),
        )
        .unwrap();
        let total = |energy: &dyn Fn(&stickslip_physics::observe::Slip) -> Option<f64>| -> f64 {
            measured
                .slips
                .iter()
                .map(|slip| energy(slip).unwrap())
                .sum()
        };
        let work = total(&|slip| slip.energies.work);
        let losses = total(&|slip| slip.energies.damping) + total(&|slip| slip.energies.broken);
        assert!((losses / work - 1.0).abs() < 0.01, "{losses} J of {work} J");
        // The mean friction times the distance of the drive.
        let time: f64 = measured.slips.iter().filter_map(|slip| slip.interval).sum();
        let friction = measured.averages.unwrap().friction;
        let expected = friction * parameters.drive_velocity * time;
        assert!(
            modulation_amplitude > 0.0 || (work / expected - 1.0).abs() < 0.02,
            "{work} J against {expected} J"
        );
    }
    let measured = measure(
        &Parameters::default(),
        &Recording {
            slips: Some(2),
            ..Recording::default()
        },
        Solver::default(),
        &AtomicBool::new(false),
    );
    assert!(
        measured
            .unwrap()
            .slips
            .iter()
            .all(|slip| slip.energies.work.is_none())
    );
}
