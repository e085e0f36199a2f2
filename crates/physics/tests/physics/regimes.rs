//! Beyond the paper's parameters: steady sliding ends a job, what counts as a slip, and what is measured of it.

use std::sync::atomic::AtomicBool;
use stickslip_physics::model::{Change, Parameters};
use stickslip_physics::observe::{
    ContactLog, Measurements, Observers, Recording, Regime, Slip, SlipObserver, measure,
};
use stickslip_physics::solver::{Limits, Resolve, Solver, simulate};

fn measured(parameters: &Parameters, recording: Recording) -> Measurements {
    let parameters = parameters.clone().validated().unwrap();
    measure(
        &parameters,
        &recording,
        Solver::default(),
        &AtomicBool::new(false),
    )
    .unwrap()
}

fn modulated(amplitude: f64, frequency: f64) -> Parameters {
    let period = Some(1.0 / frequency);
    Parameters {
        modulation_amplitude: amplitude,
        modulation_period: period,
        ..Parameters::default()
    }
}

/// 125 N and 5 % attached were found with another program.
#[test]
fn a_fast_drive_slides_and_its_job_ends_with_its_friction() {
    let parameters = Parameters {
        drive_velocity: 1e-3,
        ..Parameters::default()
    };
    let recording = Recording::default();
    let sliding = measured(&parameters, recording);
    assert!(sliding.has_given_up && sliding.slips.is_empty());
    assert_eq!(sliding.regime(), Some(Regime::Sliding));
    let averages = sliding.averages.unwrap();
    assert!((averages.friction - 125.0).abs() < 3.0, "{averages:?}");
    assert!(
        (averages.attached_fraction - 0.05).abs() < 0.01,
        "{averages:?}"
    );
    let end = sliding.summary.end_time;
    assert!(
        (end / recording.give_up_time(&parameters) - 1.0).abs() < 0.01,
        "{end}"
    );
    // A distance of one's own.
    let near = measured(
        &parameters,
        Recording {
            give_up_after: Some(1e-4),
            ..recording
        },
    );
    assert!((near.summary.end_time - 0.1).abs() < 0.002 && near.has_given_up);
}

#[test]
fn stick_slip_is_told_from_intervals_made_of_one_long_slip() {
    let regime = |parameters: &Parameters| {
        let job = measured(
            parameters,
            Recording {
                slips: Some(20),
                ..Recording::default()
            },
        );
        (job.regime(), job.has_given_up)
    };
    assert_eq!(
        regime(&Parameters::default()),
        (Some(Regime::StickSlip), false)
    );
    assert_eq!(
        regime(&modulated(6e-6, 200.0)),
        (Some(Regime::Sliding), true)
    );
    let fast = Parameters {
        drive_velocity: 5.6e-4,
        ..Parameters::default()
    };
    assert_eq!(regime(&fast), (Some(Regime::Mixed), false));
    // Where contacts reattach at once they never let go together; where hardly any holds, breaks cluster by chance.
    for (delay, velocity) in [(1e-6, 1e-4), (0.1, 5e-4)] {
        let parameters = Parameters {
            reattachment_time: delay,
            drive_velocity: velocity,
            ..Parameters::default()
        };
        assert_eq!(
            regime(&parameters),
            (Some(Regime::Sliding), true),
            "{delay}"
        );
    }
}

/// By the extent alone a quarter of these "slips" would break at most 13 % of the contacts.
#[test]
fn slips_of_a_few_blocks_let_go_of_most_contacts() {
    let job = measured(
        &Parameters {
            blocks: 5,
            ..Parameters::default()
        },
        Recording {
            slips: Some(200),
            ..Recording::default()
        },
    );
    assert_eq!(job.slips.len(), 200);
    for slip in &job.slips {
        assert!(
            slip.size >= 50 && slip.drop > 5.0 && slip.least_attached <= 0.5 * slip.attached_before,
            "{slip:?}"
        );
    }
}

/// With Δ = 5 µm and 200 Hz the drive still pulls harder when the rupture reaches the leading edge; without, it never
/// does.
#[test]
fn onsets_that_are_cut_off_are_flagged() {
    let cut = |parameters: &Parameters| {
        let job = measured(
            parameters,
            Recording {
                slips: Some(60),
                ..Recording::default()
            },
        );
        job.slips.iter().filter(|slip| slip.onset_cut).count()
    };
    assert_eq!(cut(&Parameters::default()), 0);
    let strong = cut(&modulated(5e-6, 200.0));
    assert!((15..45).contains(&strong), "{strong}");
}

/// The first slips and every event, from one run.
fn logged(parameters: &Parameters, solver: Solver) -> (Vec<Slip>, ContactLog, f64) {
    let recording = Recording {
        slips: Some(2),
        discard: 0,
        ..Recording::default()
    };
    let mut slips = SlipObserver::new(parameters, &recording);
    let mut log = ContactLog::default();
    let mut observers = Observers(vec![&mut slips, &mut log]);
    let limits = Limits {
        end_time: f64::INFINITY,
        events: u64::MAX,
        interrupt: None,
    };
    let summary = simulate(parameters, solver, limits, &mut observers).unwrap();
    let slips = slips.into_measurements(summary).slips;
    (slips, log, summary.end_time)
}

fn solvers() -> [Solver; 3] {
    let event_driven = |resolve| Solver {
        resolve,
        ..Solver::event_driven(1e-3)
    };
    [
        event_driven(Resolve::Grid),
        event_driven(Resolve::Taylor),
        Solver::fixed_step(1e-6),
    ]
}

#[test]
fn every_event_knows_how_many_contacts_are_attached_and_have_been_on_average() {
    let parameters = Parameters {
        blocks: 12,
        ..Parameters::default()
    };
    let contacts = 240_u64;
    for solver in solvers() {
        let (_, log, _) = logged(&parameters, solver);
        let events = log.events.iter().filter(|event| event.time > 0.0);
        let (mut attached, mut integral, mut last) = (contacts, 0.0, 0.0);
        let mut compared = 0;
        for event in events {
            integral += attached as f64 * (event.time - last);
            last = event.time;
            attached = if event.change == Change::Break {
                attached - 1
            } else {
                attached + 1
            };
            // Within a step of the grid events are counted block by block.
            assert!(
                attached.abs_diff(event.attached) <= 20,
                "{solver:?}: {attached} {event:?}"
            );
            assert!(
                (integral / event.attached_time - 1.0).abs() < 1e-3,
                "{solver:?}: {integral} {event:?}"
            );
            compared += 1;
        }
        assert!(compared > 500, "{compared}");
    }
}

/// Of a single block the mean, the driven edge and the block are the same.
#[test]
fn one_block_is_its_own_mean() {
    let parameters = Parameters {
        blocks: 1,
        contacts_per_block: 40,
        drive_velocity: 1e-4,
        ..Parameters::default()
    };
    let recording = Recording {
        slips: Some(1),
        discard: 0,
        max_time: Some(0.3),
        ..Recording::default()
    };
    for solver in solvers() {
        let mut slips = SlipObserver::new(&parameters, &recording);
        let mut log = ContactLog::default();
        let mut observers = Observers(vec![&mut slips, &mut log]);
        let limits = Limits {
            end_time: 0.3,
            events: u64::MAX,
            interrupt: None,
        };
        simulate(&parameters, solver, limits, &mut observers).unwrap();
        let breaks: Vec<_> = log
            .events
            .iter()
            .filter(|event| event.change == Change::Break)
            .collect();
        assert!(breaks.len() > 500);
        for event in breaks {
            let apart = (event.mean_displacement - event.displacement).abs();
            // The fixed step finds breaks at the ends of its steps; the grid knows means along straight lines.
            assert!(
                apart < 1e-2 * parameters.contact_reach(),
                "{solver:?}: {event:?}"
            );
        }
    }
}

#[test]
fn distances_of_the_first_slips_agree_between_solvers() {
    let [grid, taylor, _] = solvers().map(|solver| logged(&Parameters::default(), solver).0);
    for (grid, taylor) in grid.iter().zip(&taylor).take(1) {
        for (here, there) in [
            (grid.distance, taylor.distance),
            (grid.edge_distance, taylor.edge_distance),
        ] {
            assert!(
                (here / there - 1.0).abs() < 0.02 && (5e-6..2e-5).contains(&there),
                "{here} {there}"
            );
        }
    }
}
