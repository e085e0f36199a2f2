//! How many seeds a set gets: until every statistic is known to the target, or the set has the most.
//!
//! The half-width h of an interval of n seeds falls as 1/√n, so n (h/target)² seeds are predicted to do. A set gets these,
//! but a quarter more than it has at least, since the prediction is as uncertain as h, and at most twice as many, so that a
//! poor one costs little.
//!
//! Looking again and again until an interval is short prefers those that are short by chance, and their sets hold the true
//! value less often than 95 of 100 times: the more so, the fewer seeds it is when a set may end, and the more skewed its
//! values are. No set ends with fewer than [`MIN_SEEDS`] seeds. What that does to coverage is measured in
//! `docs/rounds.md`.

use crate::reduce::{SetRow, error_over_target};
use crate::sweep::{MIN_SEEDS, Precision};
use crate::table::value::floored;

/// The seeds that a set with `seeds` seeds and these statistics is to have next: the same number if it has the most. `None` if
/// every statistic is known to the target, or if no job has a value.
pub(super) fn need(precision: &Precision, seeds: u64, most: u64, row: &SetRow) -> Option<u64> {
    seeds_for(seeds, error_over_target(row, precision)?, MIN_SEEDS, most)
}

/// The seeds that a set with `seeds` seeds gets next, if its half-width is `error` times the target; `None` if it needs no more.
/// It ends with `least` at least, and with `most` at most.
pub(super) fn seeds_for(seeds: u64, error: f64, least: u64, most: u64) -> Option<u64> {
    let least = least.min(most);
    if error <= 1.0 && seeds >= least {
        return None;
    }
    let now = seeds as f64;
    // NaN is no prediction, and gets the most.
    let predicted = (now * error * error).ceil().max(least as f64);
    let few = (1.25 * now).ceil();
    let many = 2.0 * now;
    let next = if predicted <= few {
        few
    } else if predicted <= many {
        predicted
    } else {
        many
    };
    let next = floored(next) as u64;
    Some(next.max(seeds + 1).min(most))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reduce::Interval;
    use crate::sets::Statistic;
    use crate::sweep::Target;
    use proptest::prelude::*;

    fn statistic(key: &str) -> Statistic {
        Statistic::from_key(key).unwrap()
    }

    fn precision(keys: &[&str], target: Target) -> Precision {
        Precision {
            statistics: keys.iter().map(|key| statistic(key)).collect(),
            target,
        }
    }

    fn row(mean: f64, half: f64) -> SetRow {
        let interval = Some(Interval {
            low: mean - half,
            high: mean + half,
        });
        SetRow {
            tau_mean: Some(mean),
            tau_interval: interval,
            ..SetRow::default()
        }
    }

    #[test]
    fn a_set_gets_the_predicted_seeds_within_bounds_until_its_target_is_met() {
        let relative = precision(&["tau_mean"], Target::Relative(0.01));
        let seeds = |seeds, half| need(&relative, seeds, 256, &row(2.0, half));
        // The target is 0.02.
        assert_eq!(seeds(40, 0.0199), None);
        assert_eq!(seeds(40, 0.024), Some(58));
        assert_eq!(seeds(40, 0.0201), Some(50));
        assert_eq!(seeds(40, 0.2), Some(80));
        assert_eq!(seeds(200, 0.2), Some(256));
        assert_eq!(seeds(256, 0.2), Some(256));
        assert_eq!(seeds(256, 0.0199), None);
        // However good it looks.
        assert_eq!(seeds(4, 1e-6), Some(8));
        assert_eq!(seeds(20, 1e-6), Some(25));
        assert_eq!(seeds(16, 1e-6), Some(MIN_SEEDS));
        assert_eq!(seeds(MIN_SEEDS, 1e-6), None);
        let absolute = precision(&["tau_mean"], Target::Absolute(0.05));
        assert_eq!(need(&absolute, 40, 256, &row(2.0, 0.0499)), None);
        assert_eq!(need(&absolute, 40, 256, &row(1e-3, 0.06)), Some(58));
    }

    #[test]
    fn the_worst_of_several_statistics_counts_and_one_without_value_does_not() {
        let both = precision(&["tau_mean", "drop_mean"], Target::Relative(0.01));
        let row = SetRow {
            drop_mean: Some(1.0),
            ..row(2.0, 0.01)
        };
        assert_eq!(
            need(&both, 40, 256, &row),
            Some(80),
            "a value without interval"
        );
        let interval = Some(Interval {
            low: 0.995,
            high: 1.005,
        });
        assert_eq!(
            need(
                &both,
                40,
                256,
                &SetRow {
                    drop_interval: interval,
                    ..row
                }
            ),
            None
        );
        // A slider that slides has no intervals between slips, and never will.
        assert_eq!(need(&both, 4, 256, &SetRow::default()), None);
    }

    proptest! {
        #[test]
        fn seeds_grow_by_a_quarter_at_least_and_double_at_most(
            seeds in 2_u64..1000, error in prop_oneof![0.0..4.0, Just(f64::INFINITY), Just(f64::NAN)], most in 2_u64..2000
        ) {
            let seeds = seeds.min(most);
            match seeds_for(seeds, error, MIN_SEEDS, most) {
                None => prop_assert!(error <= 1.0 && seeds >= MIN_SEEDS.min(most)),
                Some(next) if seeds == most => prop_assert_eq!(next, most),
                Some(next) => {
                    prop_assert!(next > seeds && next <= (2 * seeds).min(most));
                    prop_assert!(next == most || 4 * next >= 5 * seeds);
                }
            }
        }
    }
}
