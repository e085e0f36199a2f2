//! The model's deterministic numbers: strength, stiffness, frequencies, first break, Eq. 1 and Eq. 2.
//!
//! Reference values were computed independently of this program; each test allows the rounding of their last digit.

use stickslip_physics::model::equation::{StiffnessMatrix, largest_frequency};
use stickslip_physics::model::theory::{
    load_maximum_phase, minimum_phase, minimum_phase_asymptote, total_strength,
};
use stickslip_physics::model::{Change, Parameters};
use stickslip_physics::observe::{ContactLog, Profile};
use stickslip_physics::solver::{Limits, Solver, simulate};

/// Decay rate of the displacement per block in Eq. 1, `sqrt(K_s/K_int)`; infinite for a single block.
fn decay_per_block(parameters: &Parameters) -> f64 {
    (parameters.block_contact_stiffness() / parameters.coupling_stiffness()).sqrt()
}

/// Decay rate per block of the discrete chain, 2 asinh(½ `sqrt(K_s/K_int)`), of which Eq. 1 is the continuum limit.
pub fn exact_decay_per_block(parameters: &Parameters) -> f64 {
    2.0 * libm::asinh(0.5 * decay_per_block(parameters))
}

/// Mean friction of a rigid block at a constant velocity in m/s, identical contacts, in N:
/// `½ N N_s f_s t_a/(t_a + τ_r)` with the time attached `t_a = f_s/(k V)`.
fn rigid_block_friction(parameters: &Parameters, velocity: f64) -> f64 {
    let attached = parameters.contact_reach() / velocity;
    0.5 * total_strength(parameters) * attached / (attached + parameters.reattachment_time)
}

/// Asserts agreement to half a unit of the reference's last digit.
#[track_caller]
fn agrees(value: f64, reference: f64, last_digit: f64) {
    assert!(
        (value - reference).abs() <= 0.5001 * last_digit,
        "{value} against {reference}"
    );
}

#[test]
fn total_strength_is_that_of_fig_1() {
    let parameters = Parameters::default();
    agrees(total_strength(&parameters), 1918.0, 1.0);
    agrees(
        total_strength(&parameters) / parameters.normal_force,
        0.4795,
        1e-4,
    );
}

#[test]
fn displacement_decays_as_eq_1_and_its_discrete_form() {
    let parameters = Parameters::default();
    agrees(decay_per_block(&parameters), 0.120_386, 1e-6);
    agrees(exact_decay_per_block(&parameters), 0.120_313, 1e-6);
}

#[test]
fn end_stiffness_of_the_intact_chain() {
    let parameters = Parameters::default();
    let StiffnessMatrix {
        diagonal, coupling, ..
    } = StiffnessMatrix::intact(&parameters);
    let end = diagonal.iter().rev().fold(f64::INFINITY, |pivot, entry| {
        entry - coupling * coupling / pivot
    });
    agrees(end - parameters.drive_stiffness, 8.821_66e8, 1e3);
}

#[test]
fn frequencies_of_the_intact_and_of_the_free_slider() {
    let parameters = Parameters::default();
    let mass = parameters.block_mass();
    let intact = StiffnessMatrix::intact(&parameters);
    agrees((intact.eigenvalue(0) / mass).sqrt(), 2.473_37e4, 0.1);
    agrees(largest_frequency(&parameters), 4.105_17e5, 1.0);
    let free = StiffnessMatrix::new(&parameters, &vec![0.0; parameters.blocks]);
    agrees((free.eigenvalue(0) / mass).sqrt(), 1750.03, 0.01);
}

#[test]
fn rigid_block_friction_with_identical_contacts() {
    agrees(
        rigid_block_friction(&Parameters::default(), 1e-4),
        339.5,
        0.1,
    );
}

#[test]
fn minimum_phase_solves_eq_2_and_tends_to_its_asymptote() {
    // (η, φ_min, asymptote)
    let rows = [
        (1.1, -3.8447, -3.3799),
        (1.38, -3.1417, -3.0176),
        (1.82, -2.6110, -2.6277),
        (2.0, -2.4664, -2.5066),
        (3.64, -1.7732, -1.8580),
        (5.0, -1.5061, -1.5853),
        (10.0, -1.0664, -1.1210),
        (30.0, -0.62340, -0.64721),
        (100.0, -0.34617, -0.35449),
        (1000.0, -0.11116, -0.11210),
    ];
    for (eta, exact, asymptote) in rows {
        let digit = if eta < 20.0 { 1e-4 } else { 1e-5 };
        agrees(minimum_phase(eta).unwrap(), exact, digit);
        agrees(minimum_phase_asymptote(eta), asymptote, digit);
    }
    assert_eq!(minimum_phase(0.99), None);
    assert_eq!(load_maximum_phase(0.99), None);
    agrees(
        load_maximum_phase(2.0).unwrap(),
        std::f64::consts::FRAC_PI_6,
        1e-12,
    );
}

#[test]
fn identical_contacts_first_break_together_at_the_quasi_static_load() {
    let parameters = Parameters {
        threshold_deviation: 0.0,
        ..Parameters::default()
    };
    let mut log = ContactLog::default();
    let limits = Limits {
        end_time: 0.0632,
        events: u64::MAX,
        interrupt: None,
    };
    simulate(&parameters, Solver::default(), limits, &mut log).unwrap();
    let breaks: Vec<_> = log
        .events
        .iter()
        .filter(|event| event.change == Change::Break)
        .collect();
    let first = breaks[0];
    // Quasi-static reference: 241.713 N at 0.0631684 s; inertia delays it by less than a step of 1e-6 s.
    agrees(first.time, 0.063_17, 1e-5);
    let force =
        parameters.drive_stiffness * (parameters.drive_velocity * first.time - first.displacement);
    agrees(force, 241.7, 0.1);
    let together = breaks
        .iter()
        .filter(|event| event.time == first.time && event.block == 0)
        .count();
    assert_eq!(together, parameters.contacts_per_block);
}

#[test]
fn displacements_before_the_first_break_decay_as_eq_1_in_both_solvers() {
    let parameters = Parameters {
        threshold_deviation: 0.0,
        ..Parameters::default()
    }
    .validated()
    .unwrap();
    let exact = 2.0 * libm::asinh(0.5 * (1e8_f64 / 6.9e9).sqrt());
    for solver in [Solver::event_driven(1e-8), Solver::fixed_step(1e-6)] {
        let mut profile = Profile::new(&parameters);
        let limits = Limits {
            end_time: 0.063,
            events: 1_000_000,
            interrupt: None,
        };
        let summary = simulate(&parameters, solver, limits, &mut profile).unwrap();
        assert!(summary.breaks == 0 && profile.rows.len() == 70);
        let (first, x): (_, Vec<f64>) = (
            profile.rows[0],
            profile.rows.iter().map(|row| row.displacement).collect(),
        );
        assert!(
            first.block == 1
                && (first.time - 0.063).abs() < 2e-6
                && (first.position - 0.15 / 70.0).abs() < 1e-15
        );
        // Up to block 40, what the free end reflects is e^(-60 κ) = 7e-4 of the displacement, and 2e-5 of the exponent.
        let decay = libm::log(x[0] / x[39]) / 39.0;
        assert!(
            (decay / exact - 1.0).abs() < 1e-3,
            "{decay} against {exact} with {solver:?}"
        );
        // The free end mirrors the rest. Damping m γ v against K_s x holds the slider back by 2e-4 a decay length.
        for (j, x_j) in x.iter().enumerate() {
            let mirrored = |j: usize| libm::cosh(exact * (69.5 - j as f64));
            let expected = x[0] * mirrored(j) / mirrored(0);
            assert!(
                (x_j / expected - 1.0).abs() < 3e-3,
                "block {}: {x_j} against {expected}",
                j + 1
            );
        }
    }
}
