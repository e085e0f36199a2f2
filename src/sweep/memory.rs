//! What memory a job takes, from its parameters alone, in bytes.
//!
//! Measured with all methods on 100 to 100,000 blocks with 2 to 10,000 contacts each: 340 bytes a contact and 1170 a block
//! from the beginning of a job on, and then 320 a slip.

use crate::model::Parameters;
use crate::model::theory::typical_interval;
use crate::observe::Recording;

/// As measured, rounded up.
const OF_A_CONTACT: f64 = 350.0;
const OF_A_BLOCK: f64 = 1250.0;
/// Until its part is committed, which takes as much again.
pub(super) const OF_A_SLIP: f64 = 600.0;
/// Share of the prediction for contacts and blocks that a job takes in any case.
const CERTAIN: f64 = 0.7;
/// Smaller jobs are not asked whether they fit: of such memory, the program itself takes as much.
pub const LARGE: f64 = 64e6;

/// What a job takes, rather more than less.
pub fn predicted_memory(parameters: &Parameters, recording: &Recording) -> f64 {
    let slips = recording.expected_slips(typical_interval(parameters));
    of_interface(parameters) + OF_A_SLIP * slips
}

/// What a large job takes at least; nothing of a smaller one.
pub fn certain_memory(parameters: &Parameters) -> f64 {
    let predicted = of_interface(parameters);
    if predicted < LARGE {
        0.0
    } else {
        CERTAIN * predicted
    }
}

fn of_interface(parameters: &Parameters) -> f64 {
    let blocks = parameters.blocks as f64;
    blocks * (OF_A_BLOCK + OF_A_CONTACT * parameters.contacts_per_block as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(blocks: usize, contacts_per_block: usize) -> Parameters {
        Parameters {
            blocks,
            contacts_per_block,
            ..Parameters::default()
        }
    }

    /// Peaks of `stickslip simulate` in bytes, 10 MB for the program itself.
    #[test]
    fn measured_jobs_take_what_is_predicted_and_more_than_is_certain() {
        let measured = [
            (job(10_000, 100), 350e6),
            (job(1000, 100), 35e6),
            (job(100, 10_000), 340e6),
            (job(100_000, 10), 456e6),
            (job(100_000, 2), 184e6),
        ];
        let recording = Recording::default();
        for (parameters, peak) in measured {
            let predicted = predicted_memory(&parameters, &recording);
            assert!((1.0..1.15).contains(&(predicted / peak)), "{predicted}");
            assert!(certain_memory(&parameters) < 0.85 * peak, "{parameters:?}");
        }
    }

    #[test]
    fn slips_count_as_far_as_the_longest_time_allows() {
        let parameters = Parameters::default();
        let predicted = |max_time| {
            let recording = Recording {
                slips: Some(1_000_000),
                discard: 0,
                max_time,
                ..Recording::default()
            };
            predicted_memory(&parameters, &recording) - of_interface(&parameters)
        };
        assert_eq!(predicted(None), 6e8);
        let ten = Some(10.0 * typical_interval(&parameters));
        assert!((predicted(ten) - 6e3).abs() < 1e-6);
    }
}
