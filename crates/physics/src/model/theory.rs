//! Closed forms of the paper: η, Φ_max, Eq. 2 and its asymptote, the resultant of slips at random loads, and a typical
//! interval. Eq. 1 and the friction of a rigid block are tests: `crates/physics/tests/physics/deterministic_rows.rs`.

use super::Parameters;
use std::f64::consts::{PI, TAU};

/// A number that follows from others, to the twelve digits that people write: so 1/T is the frequency that T came from.
pub fn to_twelve_digits(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

/// η = 2πΔ/(T V0), the ratio of the harmonic to the uniform loading rate, from the angular frequency 2π/T in rad/s, the
/// amplitude Δ in m and the velocity V0 in m/s, to twelve digits; 0 without modulation.
pub fn eta(angular_frequency: f64, amplitude: f64, drive_velocity: f64) -> f64 {
    to_twelve_digits(angular_frequency * amplitude / drive_velocity)
}

/// Φ_max = asin(1/η), in rad: the phase of the largest load in each period, for η >= 1; `None` below, where the load
/// only grows.
pub fn load_maximum_phase(eta: f64) -> Option<f64> {
    (eta >= 1.0).then(|| libm::asin(1.0 / eta))
}

/// φ_min, in rad: where the load first exceeds its preceding maximum, Eq. 2 with equality. `None` for η < 1.
///
/// Solves φ + η cos φ = (Φ_max - 2π) + η cos Φ_max on the rising branch, between the load's minimum at -π - Φ_max and
/// its maximum at Φ_max, in the form that loses no digits at large η.
pub fn minimum_phase(eta: f64) -> Option<f64> {
    let maximum = load_maximum_phase(eta)?;
    // Both in the period of the slip: the preceding maximum lies at Φ_max - 2π and the load, in units of V0 T/2π, is
    // φ + η cos φ.
    let target = maximum - TAU + eta * libm::cos(maximum);
    let reaches = |phase: f64| phase + eta * libm::cos(phase) >= target;
    Some(bisected(-PI - maximum, maximum, reaches))
}

/// Resultant of slips at random loads: of the density 1 - η sin φ, for η >= 1 from φ_min to Φ_max.
pub fn resultant_at_random(eta: f64) -> f64 {
    let Some((low, high)) = minimum_phase(eta).zip(load_maximum_phase(eta)) else {
        return 0.5 * eta;
    };
    let integral = |phase: f64| {
        let (sine, cosine) = libm::sincos(phase);
        [
            sine - 0.5 * eta * sine * sine,
            -cosine - 0.5 * eta * (phase - sine * cosine),
        ]
    };
    let [x, y] = [0, 1].map(|part| integral(high)[part] - integral(low)[part]);
    libm::hypot(x, y) / TAU
}

/// The least number at which a condition holds, up to the last bit: it does not at `low`, and from there on at `high`.
pub(super) fn bisected(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return high;
        }
        if holds(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
}

/// Asymptote of φ_min for η >> 1, -2 sqrt(π/η), in rad: the red curve of Fig. 3e.
pub fn minimum_phase_asymptote(eta: f64) -> f64 {
    -2.0 * (PI / eta).sqrt()
}

/// Total strength `N N_s f_s` of the interface, in N.
pub fn total_strength(parameters: &Parameters) -> f64 {
    (parameters.blocks * parameters.contacts_per_block) as f64 * parameters.mean_threshold
}

/// Share of the total strength `N N_s f_s` that the drive loads from one slip to the next. At the defaults slips are
/// 0.1115 s apart, of which 0.005 s are reattachment, and the shear force grows at 3827 N/s: 0.1065 · 3827/1918.
const LOADED_SHARE: f64 = 0.2125;

/// Stiffness at the driven end of a slider with all contacts attached, in N/m: that of an endless chain, exact also for
/// one block; a short chain moves as one.
pub fn end_stiffness(parameters: &Parameters) -> f64 {
    let contacts = parameters.block_contact_stiffness();
    let endless =
        0.5 * contacts + (contacts * (parameters.coupling_stiffness() + 0.25 * contacts)).sqrt();
    endless.min(contacts * parameters.blocks as f64)
}

/// Time in which the drive loads a share of the total strength, in s, against the stiffness at the end of the slider.
pub fn loading_time(parameters: &Parameters, share: f64, end_stiffness: f64) -> f64 {
    let stiffness = 1.0 / (1.0 / parameters.drive_stiffness + 1.0 / end_stiffness);
    share * total_strength(parameters) / (stiffness * parameters.drive_velocity)
}

/// Typical interval between slips, in s: the time to load `LOADED_SHARE` of the strength, and one reattachment.
pub fn typical_interval(parameters: &Parameters) -> f64 {
    let loading = loading_time(parameters, LOADED_SHARE, end_stiffness(parameters));
    loading + parameters.reattachment_time
}

#[cfg(test)]
mod tests {
    use super::super::equation::StiffnessMatrix;
    use super::*;

    #[test]
    fn the_eta_of_a_period_that_an_eta_gave_is_that_eta() {
        for value in [0.5, 1.0, 3.0, 7.0] {
            for amplitude in [3e-7, 7e-7, 1e-6, 4.77e-7] {
                for velocity in [3e-5, 1e-4, 7e-3] {
                    let period = TAU * amplitude / (value * velocity);
                    assert_eq!(eta(TAU / period, amplitude, velocity), value);
                }
            }
        }
        assert_eq!(eta(0.0, 1e-6, 1e-4), 0.0);
    }

    #[test]
    fn intervals_at_the_defaults_are_those_seen() {
        let interval = typical_interval(&Parameters::default());
        assert!((interval - 0.1115).abs() < 0.0005, "{interval}");
    }

    #[test]
    fn the_stiffness_behind_the_interval_is_that_of_the_chain() {
        for (blocks, tolerance) in [(1, 1e-12), (70, 1e-6)] {
            let parameters = Parameters {
                blocks,
                reattachment_time: 1e-300,
                ..Parameters::default()
            };
            let rate = LOADED_SHARE * total_strength(&parameters) / typical_interval(&parameters);
            let predicted = rate / parameters.drive_velocity;
            let StiffnessMatrix {
                diagonal, coupling, ..
            } = StiffnessMatrix::intact(&parameters);
            let end = diagonal.iter().rev().fold(f64::INFINITY, |pivot, entry| {
                entry - coupling * coupling / pivot
            });
            let chain = end - parameters.drive_stiffness;
            let exact = 1.0 / (1.0 / chain + 1.0 / parameters.drive_stiffness);
            assert!(
                (predicted / exact - 1.0).abs() < tolerance,
                "{blocks} blocks: {predicted} against {exact}"
            );
        }
    }
}
