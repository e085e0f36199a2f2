//! Phase φ of an event against the modulation, and the window in which it lies.

use crate::model::theory::load_maximum_phase;
use std::f64::consts::{PI, TAU};

/// How far past Φ_max the window reaches, in rad, for η >= 1: a slip that inertia lets start a hair after the load's
/// maximum stays there and does not jump to the bottom. For η > 1.014 the window so moved still holds φ_min (which lies
/// 1.3 rad above Φ_max - 2π at η = 1.1 and further for larger η), so no slip above it is placed a turn too high.
pub const OVERSHOOT: f64 = 0.5;

/// Shift of a time from the nearest maximum of the modulation, 2π (t - m T)/T, in rad. Wrapped to (Φ_max - 2π, Φ_max]
/// plus [`OVERSHOOT`] for η >= 1, to (-π, π] below.
pub fn phase(time: f64, period: f64, eta: f64) -> f64 {
    let top = load_maximum_phase(eta).map_or(PI, |maximum| maximum + OVERSHOOT);
    let turns = time / period;
    let phase = TAU * (turns - turns.round());
    if phase > top {
        phase - TAU
    } else if phase <= top - TAU {
        phase + TAU
    } else {
        phase
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn slips_just_before_a_peak_have_a_small_negative_phase() {
        assert!((phase(0.99, 1.0, 100.0) + 0.01 * TAU).abs() < 1e-12);
        assert!((phase(7.25, 1.0, 0.5) - PI / 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_slip_a_hair_after_the_largest_load_does_not_jump_down() {
        let maximum = load_maximum_phase(20.0).unwrap();
        assert!((phase((maximum + 0.4) / TAU, 1.0, 20.0) - maximum - 0.4).abs() < 1e-12);
        assert!(phase((maximum + 0.6) / TAU, 1.0, 20.0) < -5.0);
    }

    proptest! {
        #[test]
        fn every_phase_lies_in_its_window(turns in 0.0_f64..1e4, eta in 0.01_f64..1e3) {
            let top = load_maximum_phase(eta).map_or(PI, |maximum| maximum + OVERSHOOT);
            let phase = phase(turns, 1.0, eta);
            prop_assert!(phase <= top && phase > top - TAU);
            let away = (phase / TAU - turns).rem_euclid(1.0);
            prop_assert!(away.min(1.0 - away) < 1e-9);
        }
    }
}
