//! The grid of the event-driven solver: break times of fourth order, the same slips as in Taylor steps, and what
//! chooses it.

use std::collections::HashMap;
use stickslip_physics::model::{Change, ContactEvent, Parameters};
use stickslip_physics::observe::{ContactLog, Recording, SlipObserver};
use stickslip_physics::solver::{GRID_TOLERANCE, Limits, Resolve, Solver, Summary, simulate};

fn modulated() -> Parameters {
    Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(1.0 / 58.0),
        ..Parameters::default()
    }
}

fn contact_log(
    parameters: &Parameters,
    tolerance: f64,
    resolve: Resolve,
    end_time: f64,
) -> (Summary, Vec<ContactEvent>) {
    let limits = Limits {
        end_time,
        events: u64::MAX,
        interrupt: None,
    };
    let mut log = ContactLog::default();
    let summary = simulate(
        parameters,
        Solver {
            resolve,
            ..Solver::event_driven(tolerance)
        },
        limits,
        &mut log,
    )
    .unwrap();
    (summary, log.events)
}

/// Errors of the first 100 break times, in s, in order; infinite for a break that is not found.
fn break_errors(exact: &[ContactEvent], found: &[ContactEvent]) -> Vec<f64> {
    let key = |event: &ContactEvent| (event.block, event.contact, event.generation);
    let breaks = |events: &[ContactEvent]| -> Vec<ContactEvent> {
        events
            .iter()
            .filter(|event| event.change == Change::Break)
            .copied()
            .collect()
    };
    let found: HashMap<_, f64> = breaks(found)
        .iter()
        .map(|event| (key(event), event.time))
        .collect();
    let mut errors: Vec<f64> = breaks(exact)[..100]
        .iter()
        .map(|event| {
            found
                .get(&key(event))
                .map_or(f64::INFINITY, |time| (time - event.time).abs())
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn errors_of_break_times_fall_sixteenfold_when_the_step_is_halved() {
    for parameters in [Parameters::default(), modulated()] {
        let end_time = if parameters.modulation_amplitude > 0.0 {
            0.12
        } else {
            0.07
        };
        let (_, exact) = contact_log(&parameters, 1e-12, Resolve::Taylor, end_time);
        // A sixteenth of the tolerance is half the step.
        let errors = [1e-3, 1e-3 / 16.0, 1e-3 / 256.0, 1e-3 / 4096.0].map(|tolerance| {
            let (_, found) = contact_log(&parameters, tolerance, Resolve::Grid, end_time);
            let errors = break_errors(&exact, &found);
            (errors[50], errors[99])
        });
        // Seen: medians 4e-8, 2e-9, 2e-10, 2e-11 s without modulation; 9e-7, 1e-8, 6e-10, 5e-11 s at worst.
        for pair in errors.windows(2) {
            assert!(pair[1].1 < pair[0].1 / 8.0, "{errors:?}");
        }
        assert!(errors[0].1 < 2e-6 && errors[3].1 < 1e-9, "{errors:?}");
        assert!(errors[3].1 < errors[0].1 / 3000.0, "{errors:?}");
    }
}

#[test]
fn the_tolerance_chooses_the_grid_and_a_ramp_or_an_end_does_not_leave_it() {
    let ramped = Parameters {
        turning_period: Some(1.0 / 80.0),
        turning_amplitude: Some(5e-7),
        ramp_time: 0.1,
        ..modulated()
    };
    for parameters in [Parameters::default(), modulated(), ramped] {
        for (tolerance, resolve, takes_grid) in [
            (1e-3, Resolve::Auto, true),
            (GRID_TOLERANCE, Resolve::Auto, true),
            (0.99 * GRID_TOLERANCE, Resolve::Auto, false),
            (1e-9, Resolve::Grid, true),
            (1e-3, Resolve::Taylor, false),
        ] {
            let (summary, events) = contact_log(&parameters, tolerance, resolve, 0.0815);
            assert_eq!(summary.end_time, 0.0815, "{resolve:?} at {tolerance:e}");
            assert_eq!(
                summary.grid_steps > summary.steps / 2,
                takes_grid,
                "{resolve:?} at {tolerance:e}: {summary:?}"
            );
            assert_eq!(summary.grid_steps == 0, !takes_grid);
            assert!(events.is_sorted_by_key(|event| event.time));
        }
    }
}

#[test]
fn observers_that_ignore_attachments_see_the_same_slips() {
    /// Follows attachments, counts what is attached and passes everything on.
    struct Following(SlipObserver, u64);

    impl stickslip_physics::solver::Observer for Following {
        fn advance(&mut self, segment: &stickslip_physics::solver::Segment<'_>) {
            self.0.advance(segment);
        }

        fn contact(&mut self, event: &ContactEvent) {
            match event.change {
                Change::Attach => self.1 += 1,
                Change::Break => self.1 -= 1,
            }
            assert!(
                event.attached == self.1 || event.time == 0.0,
                "{event:?}, not {}",
                self.1
            );
            self.0.contact(event);
        }

        fn is_satisfied(&self) -> bool {
            self.0.is_satisfied()
        }
    }

    // The slow one moves the frame between slips.
    let slow = Parameters {
        drive_velocity: 1e-6,
        ..Parameters::default()
    };
    for parameters in [Parameters::default(), modulated(), slow] {
        let recording = Recording {
            slips: Some(8),
            discard: 0,
            drop_size: Some(20.0),
            ..Recording::default()
        };
        let limits = Limits {
            end_time: f64::INFINITY,
            events: u64::MAX,
            interrupt: None,
        };
        let mut alone = SlipObserver::new(&parameters, &recording);
        let mut following = Following(alone.clone(), 0);
        let summary = simulate(&parameters, Solver::default(), limits, &mut alone).unwrap();
        let alone = alone.into_measurements(summary).slips;
        let summary = simulate(&parameters, Solver::default(), limits, &mut following).unwrap();
        let following = following.0.into_measurements(summary).slips;
        assert_eq!(alone.len(), 8);
        for (slip, other) in alone.iter().zip(&following) {
            assert_eq!(
                (slip.size, slip.precursors, slip.nucleation),
                (other.size, other.precursors, other.nucleation)
            );
            assert_eq!(
                (slip.attached_before, slip.least_attached),
                (other.attached_before, other.least_attached)
            );
            // Segments are cut elsewhere: rounding.
            assert!(
                (slip.onset - other.onset).abs() < 1e-9,
                "{slip:?} {other:?}"
            );
            assert!(
                (slip.peak_force - other.peak_force).abs() < 1e-6,
                "{slip:?} {other:?}"
            );
            assert!((slip.drop - other.drop).abs() < 1e-6, "{slip:?} {other:?}");
            // From the force at the first and at the last break.
            assert!(
                (slip.edge_distance / other.edge_distance - 1.0).abs() < 1e-8,
                "{slip:?} {other:?}"
            );
        }
    }
}
