//! Error bounds and step lengths that follow from the tolerance: of Taylor steps, of the events that are merged into them,
//! and of leaps.

use crate::model::Parameters;
use crate::model::equation::largest_frequency;

/// Longest step, in units of the shortest time scale: the cheapest per unit of time, and still far from where the
/// series would lose digits.
const MAX_STEP: f64 = 4.0;
/// Part of the tolerance that one step's truncation may take at most.
const TRUNCATION_SHARE: f64 = 0.1;
/// Multiple of the tolerance that the truncations of all steps may add up to within the slider's memory.
const REMEMBERED_MULTIPLE: f64 = 4.0;
/// Number of steps that an undamped slider is assumed to remember.
const MAX_REMEMBERED: f64 = 1e6;
/// Part of a step's error that one merged event may leave out: little, since these errors have one sign.
const MERGED_SHARE: f64 = 2e-3;

/// What a tolerance allows for given parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tolerances {
    /// Longest step, in s.
    pub max_step: f64,
    /// Largest error of displacement left in one step, in m.
    pub step_error: f64,
    /// Largest displacement left out by one leap, in m.
    pub leap_error: f64,
}

impl Tolerances {
    /// The bounds for a tolerance relative to the contact reach.
    pub fn new(parameters: &Parameters, tolerance: f64) -> Self {
        let fastest = largest_frequency(parameters)
            .max(parameters.largest_modulation_frequency())
            .max(parameters.damping_rate);
        let max_step = MAX_STEP / fastest;
        Self {
            max_step,
            step_error: truncation_share(parameters, max_step)
                * tolerance
                * parameters.contact_reach(),
            leap_error: tolerance * parameters.contact_reach(),
        }
    }

    /// The largest fraction ξ of a step of `length` s, h, after an event in which what its merging leaves out stays below
    /// a part of the error of a step: at most (ωh)² (δ3/20 + γh δ2/60) ξ⁵ and (ωh)⁴ δ2/720 ξ⁶ at the fastest frequency ω,
    /// with the coefficients δ2 and δ3 that the event adds, in m.
    #[inline]
    pub fn merged_window(&self, [second, third]: [f64; 2], length: f64, damping_rate: f64) -> f64 {
        let angle = MAX_STEP * length / self.max_step;
        let square = angle * angle;
        let damping = damping_rate * length;
        let fifth = square * (third.abs() / 20.0 + damping * second.abs() / 60.0);
        let sixth = square * square * second.abs() / 720.0;
        let error = MERGED_SHARE * self.step_error;
        root_below::<5>(error / fifth)
            .min(root_below::<6>(error / sixth))
            .min(1.0)
    }
}

/// Part of the tolerance that one step's truncation may take, so that the sum of what the slider remembers stays
/// bounded.
///
/// An error decays at the rate γ/2 if the motion of the attached slider oscillates, else at that of its slowest mode:
/// with very little and with very much damping, a million steps may add up, mostly with one sign.
fn truncation_share(parameters: &Parameters, max_step: f64) -> f64 {
    let half = 0.5 * parameters.damping_rate;
    // The contacts alone bound the lowest squared frequency of the attached slider.
    let squared = parameters.block_contact_stiffness() / parameters.block_mass();
    let overdamped = (half * half - squared).max(0.0);
    let rate = if overdamped > 0.0 {
        squared / (half + overdamped.sqrt())
    } else {
        half
    };
    let remembered = (1.0 / (rate * max_step)).min(MAX_REMEMBERED);
    TRUNCATION_SHARE.min(REMEMBERED_MULTIPLE / remembered)
}

/// A number somewhat below the N-th root of a positive one, by dividing the logarithm that its bits approximate.
fn root_below<const N: u64>(value: f64) -> f64 {
    const ONE: u64 = 1.0_f64.to_bits();
    0.9 * f64::from_bits(value.to_bits() / N + (ONE - ONE / N))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_root_from_the_bits_lies_below_the_root_and_not_far(exponent in -60.0_f64..0.0) {
            let value = libm::pow(10.0, exponent);
            for (root, exact) in
                [(root_below::<5>(value), libm::pow(value, 0.2)), (root_below::<6>(value), libm::pow(value, 1.0 / 6.0))]
            {
                prop_assert!(root <= exact && root > 0.8 * exact, "{} for {}", root, exact);
            }
        }
    }
}
