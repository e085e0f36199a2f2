//! Closed forms of the paper: Eq. 1, η, Φ_max, Eq. 2 and its asymptote; limits that the solvers are tested against.

use super::Parameters;
use std::f64::consts::{PI, TAU};

/// Decay rate of the displacement per block in Eq. 1, `sqrt(K_s/K_int)`; infinite for a single block.
#[must_use]
pub fn decay_per_block(parameters: &Parameters) -> f64 {
    (parameters.block_contact_stiffness() / parameters.coupling_stiffness()).sqrt()
}

/// Decay rate per block of the discrete chain, 2 asinh(½ `sqrt(K_s/K_int)`), of which Eq. 1 is the continuum limit.
#[must_use]
pub fn exact_decay_per_block(parameters: &Parameters) -> f64 {
    2.0 * libm::asinh(0.5 * decay_per_block(parameters))
}

/// η = 2πΔ/(T V0), the ratio of the harmonic to the uniform loading rate, from the angular frequency 2π/T in rad/s, the
/// amplitude Δ in m and the velocity V0 in m/s; 0 without modulation.
#[must_use]
pub fn eta(angular_frequency: f64, amplitude: f64, drive_velocity: f64) -> f64 {
    angular_frequency * amplitude / drive_velocity
}

/// Φ_max = asin(1/η), in rad: the phase of the largest load in each period, for η >= 1; `None` below, where the load only
/// grows.
#[must_use]
pub fn load_maximum_phase(eta: f64) -> Option<f64> {
    (eta >= 1.0).then(|| libm::asin(1.0 / eta))
}

/// φ_min, in rad: where the load first exceeds its preceding maximum, Eq. 2 with equality. `None` for η < 1.
///
/// Solves φ + η cos φ = (Φ_max - 2π) + η cos Φ_max on the rising branch, between the load's minimum at -π - Φ_max and its
/// maximum at Φ_max, in the form that loses no digits at large η.
#[must_use]
pub fn minimum_phase(eta: f64) -> Option<f64> {
    let maximum = load_maximum_phase(eta)?;
    // Both in the period of the slip: the preceding maximum lies at Φ_max - 2π and the load, in units of V0 T/2π, is
    // φ + η cos φ.
    let target = maximum - TAU + eta * libm::cos(maximum);
    let (mut low, mut high) = (-PI - maximum, maximum);
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Some(high);
        }
        if middle + eta * libm::cos(middle) < target { low = middle } else { high = middle }
    }
}

/// Asymptote of φ_min for η >> 1, -2 sqrt(π/η), in rad: the red curve of Fig. 3e.
#[must_use]
pub fn minimum_phase_asymptote(eta: f64) -> f64 {
    -2.0 * (PI / eta).sqrt()
}

/// Total strength `N N_s f_s` of the interface, in N.
#[must_use]
pub fn total_strength(parameters: &Parameters) -> f64 {
    (parameters.blocks * parameters.contacts_per_block) as f64 * parameters.mean_threshold
}

/// Mean friction of a rigid block at a constant velocity in m/s, identical contacts, in N:
/// `½ N N_s f_s t_a/(t_a + τ_r)` with the time attached `t_a = f_s/(k V)`.
#[must_use]
pub fn rigid_block_friction(parameters: &Parameters, velocity: f64) -> f64 {
    let attached = parameters.contact_reach() / velocity;
    0.5 * total_strength(parameters) * attached / (attached + parameters.reattachment_time)
}
