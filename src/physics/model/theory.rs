//! Closed forms of the paper: η, Φ_max, Eq. 2 and its asymptote; what slips at random loads show; a typical interval.

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

/// Φ_max = asin(1/η), in rad: the phase of the largest load in each period, for η >= 1; `None` below, where the load only
/// grows.
pub fn load_maximum_phase(eta: f64) -> Option<f64> {
    (eta >= 1.0).then(|| libm::asin(1.0 / eta))
}

/// φ_min, in rad: where the load first exceeds its preceding maximum, Eq. 2 with equality. `None` for η < 1.
///
/// Solves φ + η cos φ = (Φ_max - 2π) + η cos Φ_max on the rising branch, between the load's minimum at -π - Φ_max and its
/// maximum at Φ_max, in the form that loses no digits at large η.
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
        if middle + eta * libm::cos(middle) < target {
            low = middle;
        } else {
            high = middle;
        }
    }
}

/// Asymptote of φ_min for η >> 1, -2 sqrt(π/η), in rad: the red curve of Fig. 3e.
pub fn minimum_phase_asymptote(eta: f64) -> f64 {
    -2.0 * (PI / eta).sqrt()
}

/// Mean of exp(iφ), as its real and imaginary part, of slips that come at a random load among those that exceed all before:
/// the null model of locking. The load φ + η cos φ grows with the rate 1 - η sin φ, which so is the density of φ: for
/// η >= 1 from φ_min to `Φ_max`, where the load exceeds its preceding maximum, and else on the whole circle.
pub fn random_load_mean(eta: f64) -> [f64; 2] {
    let Some((low, high)) = minimum_phase(eta).zip(load_maximum_phase(eta)) else {
        return [0.0, -0.5 * eta];
    };
    let between = |integral: &dyn Fn(f64) -> f64| integral(high) - integral(low);
    let load = between(&|phase| phase + eta * libm::cos(phase));
    let real = between(&|phase| libm::sin(phase) * (1.0 - 0.5 * eta * libm::sin(phase)));
    let imaginary =
        between(&|phase| -libm::cos(phase) - 0.25 * eta * (2.0 * phase - libm::sin(2.0 * phase)));
    [real / load, imaginary / load]
}

/// Mean resultant length of `count` independent directions, of which the mean of many has this length: it is longer, as chance
/// has no direction. That of a vector with a normal error, the same in both directions (Rice, Bell Syst. Tech. J. 24, 46 (1945)).
pub fn finite_resultant(length: f64, count: u64) -> f64 {
    /// Where the next term of the expansion is 1/16 of its inverse: some 1e-4 of the difference.
    const LARGE: f64 = 500.0;
    const ANGLES: u32 = 128;
    let variance = (1.0 - length * length).max(0.0) / (2.0 * count as f64);
    let half = length * length / (4.0 * variance);
    if half > LARGE || variance == 0.0 {
        return length + variance / (2.0 * length);
    }
    // exp(-half) times the modified Bessel functions I0 and I1.
    let (mut zeroth, mut first) = (0.0, 0.0);
    for index in 0..ANGLES {
        let cosine = libm::cos(TAU * f64::from(index) / f64::from(ANGLES));
        let weight = libm::exp(half * (cosine - 1.0)) / f64::from(ANGLES);
        zeroth += weight;
        first += weight * cosine;
    }
    (0.5 * PI * variance).sqrt() * ((1.0 + 2.0 * half) * zeroth + 2.0 * half * first)
}

/// Total strength `N N_s f_s` of the interface, in N.
pub fn total_strength(parameters: &Parameters) -> f64 {
    (parameters.blocks * parameters.contacts_per_block) as f64 * parameters.mean_threshold
}

/// Share of the total strength `N N_s f_s` that the drive loads from one slip to the next. At the defaults slips are
/// 0.1115 s apart, of which 0.005 s are reattachment, and the shear force grows at 3827 N/s: 0.1065 · 3827/1918.
const LOADED_SHARE: f64 = 0.2125;

/// Typical interval between slips, in s: the time to load `LOADED_SHARE` of the strength, and one reattachment.
pub fn typical_interval(parameters: &Parameters) -> f64 {
    let contacts = parameters.block_contact_stiffness();
    // Stiffness at the end of an endless chain, exact also for one block; a short chain moves as one.
    let endless =
        0.5 * contacts + (contacts * (parameters.coupling_stiffness() + 0.25 * contacts)).sqrt();
    let slider = endless.min(contacts * parameters.blocks as f64);
    let stiffness = 1.0 / (1.0 / parameters.drive_stiffness + 1.0 / slider);
    let loading =
        LOADED_SHARE * total_strength(parameters) / (stiffness * parameters.drive_velocity);
    loading + parameters.reattachment_time
}

#[cfg(test)]
mod tests {
    use super::super::equation::StiffnessMatrix;
    use super::*;

    #[test]
    fn slips_at_random_loads_have_the_mean_of_their_density() {
        // Known: 0.581, 0.816 and 0.918.
        for eta in [0.3, 0.9, 1.18, 2.4, 4.9, 60.0] {
            let (low, high) = minimum_phase(eta)
                .zip(load_maximum_phase(eta))
                .unwrap_or((-PI, PI));
            let steps = 100_000;
            let (mut weight, mut sum) = (0.0, [0.0; 2]);
            for step in 0..steps {
                let phase = low + (f64::from(step) + 0.5) / f64::from(steps) * (high - low);
                let density = 1.0 - eta * libm::sin(phase);
                weight += density;
                sum = [
                    sum[0] + density * libm::cos(phase),
                    sum[1] + density * libm::sin(phase),
                ];
            }
            let [real, imaginary] = random_load_mean(eta);
            let apart = (real - sum[0] / weight).hypot(imaginary - sum[1] / weight);
            assert!(apart < 1e-6, "{eta}: {apart:e}");
        }
        let length = |eta| {
            let [real, imaginary] = random_load_mean(eta);
            real.hypot(imaginary)
        };
        for (eta, known) in [(1.18, 0.581), (2.4, 0.816), (4.9, 0.918)] {
            assert!((length(eta) - known).abs() < 1e-3, "{}", length(eta));
        }
    }

    #[test]
    fn few_directions_have_a_longer_resultant_than_many() {
        // Without a direction, sqrt(pi/4n).
        assert!((finite_resultant(0.0, 100) - 0.088_623).abs() < 1e-6);
        // Known: n = 10, 15, 30 at eta = 0.2.
        for (count, excess) in [(10, 0.19), (15, 0.14), (30, 0.08)] {
            assert!(
                (finite_resultant(0.1, count) - 0.1 - excess).abs() < 0.006,
                "{count}"
            );
        }
        assert_eq!(
            (finite_resultant(1.0, 7), finite_resultant(0.5, u64::MAX)),
            (1.0, 0.5)
        );
        // The two forms meet.
        let [below, above] =
            [2999, 3001].map(|count: u64| count as f64 * (finite_resultant(0.5, count) - 0.5));
        assert!((below / above - 1.0).abs() < 2e-3, "{below} {above}");
    }

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
