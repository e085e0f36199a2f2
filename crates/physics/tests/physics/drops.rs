//! Slips as the drops of the shear force show them, against those of the contacts (Fig. 1d).

use rayon::prelude::*;
use std::sync::atomic::AtomicBool;
use stickslip_physics::model::Parameters;
use stickslip_physics::observe::{Drops, Recording, Slip, measure};
use stickslip_physics::solver::Solver;

/// Slips of four seeds.
fn slips(parameters: &Parameters, slips: u64, drop_size: Option<f64>) -> Vec<Slip> {
    let recording = Recording {
        slips: Some(slips),
        drop_size,
        ..Recording::default()
    };
    let of_seed = |seed| {
        let parameters = Parameters {
            seed,
            ..parameters.clone()
        };
        measure(
            &parameters,
            &recording,
            Solver::default(),
            &AtomicBool::new(false),
        )
        .unwrap()
        .slips
    };
    (0..4_u64).into_par_iter().flat_map_iter(of_seed).collect()
}

fn drops(slips: &[Slip]) -> impl Iterator<Item = Drops> {
    slips.iter().map(|slip| slip.drops)
}

/// Seen over 1,000 slips: the least drop of a slip is 321 N, the largest between slips 39 N.
#[test]
fn without_modulation_every_slip_is_a_drop_of_50_newtons_and_nothing_else_is() {
    let slips = slips(&Parameters::default(), 50, Some(50.0));
    assert_eq!(slips.len(), 200);
    let seen = drops(&slips).filter(|drops| drops.during.is_some()).count();
    let false_alarms: u64 = drops(&slips).map(|drops| drops.before.unwrap()).sum();
    assert_eq!(
        (seen, false_alarms),
        (200, 0),
        "recall and precision must be 1"
    );
    for slip in &slips {
        // Without modulation a slip's fall begins at its onset; the force may go on falling after the last break.
        assert!(
            slip.drops.during.unwrap() >= slip.drop * (1.0 - 1e-12),
            "{slip:?}"
        );
    }
}

#[test]
fn smaller_drops_show_precursors_and_those_under_modulation_are_not_its_swings() {
    let still = slips(&Parameters::default(), 20, Some(2.0));
    let of_precursors: u64 = drops(&still).map(|drops| drops.before.unwrap()).sum();
    // Seen over 1,000 slips: 0.69 a slip.
    assert!((25..=90).contains(&of_precursors), "{of_precursors}");
    let modulated = Parameters {
        modulation_amplitude: 1e-6,
        modulation_period: Some(1.0 / 58.0),
        ..Parameters::default()
    };
    let swung = slips(&modulated, 20, Some(2.0));
    let drops_of_force: u64 = drops(&swung).map(|drops| drops.before.unwrap()).sum();
    // Seen over 1,000 slips: 0.72 a slip, where F_S swings down seven times by 80 N.
    assert!((25..=90).contains(&drops_of_force), "{drops_of_force}");
    assert!(drops(&swung).all(|drops| drops.during.is_some_and(|size| size > 100.0)));
}

#[test]
fn looking_for_drops_changes_nothing_else() {
    let (without, with) = (
        slips(&Parameters::default(), 5, None),
        slips(&Parameters::default(), 5, Some(5.0)),
    );
    let stripped: Vec<Slip> = with
        .iter()
        .map(|slip| Slip {
            drops: Drops::default(),
            ..*slip
        })
        .collect();
    assert_eq!(without, stripped);
}
