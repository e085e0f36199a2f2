//! Intervals that still ran when their jobs ended: the product limit (Kaplan and Meier, J. Am. Stat. Assoc. 53, 457
//! (1958)).
//!
//! A job that ends at a time cuts its last interval, the rather the longer that is. To leave these out makes the mean too
//! short, by about cv²/n for n intervals a job. All that is known of them is what they are longer than.
//!
//! A statistic is the mean of a value over the intervals. Its estimate is the mean of *pseudo-values*, one for each
//! interval, ended or not: the estimate plus the influence of the interval on it (infinitesimal jackknife). Errors follow
//! from them as from values; without running intervals, they are the values.

use crate::table::value::floored;

/// An interval; they are in order of length.
#[derive(Clone, Copy, Debug)]
struct Step {
    place: usize,
    /// What was seen of it.
    length: f64,
    has_ended: bool,
    /// Estimated share of all intervals that are at least as long.
    share: f64,
    /// One over the number of those that were seen to be at least as long.
    hazard: f64,
}

/// The distribution of intervals, of which some still ran.
#[derive(Clone, Debug)]
pub(super) struct ProductLimit {
    steps: Vec<Step>,
    /// Share of the intervals that are longer than all that was seen; 0 if the longest has ended.
    rest: f64,
}

impl ProductLimit {
    /// Of these intervals, and whether they have ended.
    pub(super) fn new(intervals: impl Iterator<Item = (f64, bool)>) -> Self {
        let step = |(place, (length, has_ended))| Step {
            place,
            length,
            has_ended,
            share: 1.0,
            hazard: 1.0,
        };
        let mut steps: Vec<Step> = intervals.enumerate().map(step).collect();
        steps.sort_by(|one, other| {
            one.length
                .total_cmp(&other.length)
                .then(other.has_ended.cmp(&one.has_ended))
        });
        let (count, mut rest) = (steps.len(), 1.0);
        for (rank, step) in steps.iter_mut().enumerate() {
            (step.share, step.hazard) = (rest, 1.0 / (count - rank) as f64);
            rest *= if step.has_ended {
                1.0 - step.hazard
            } else {
                1.0
            };
        }
        Self { steps, rest }
    }

    pub(super) fn has_mean(&self) -> bool {
        self.rest == 0.0
    }

    /// The mean, if every interval counts up to the longest that was seen: the least that it can be.
    pub(super) fn least_mean(&self) -> f64 {
        let ended = self.steps.iter().filter(|step| step.has_ended);
        let longest = self.steps.last().map_or(0.0, |step| step.length);
        ended
            .map(|step| step.share * step.hazard * step.length)
            .sum::<f64>()
            + self.rest * longest
    }

    /// The least interval that a share does not exceed; `None` if it is longer than all that was seen.
    pub(super) fn quantile(&self, share: f64) -> Option<f64> {
        let is_there =
            |step: &&Step| step.has_ended && 1.0 - step.share * (1.0 - step.hazard) >= share;
        self.steps.iter().find(is_there).map(|step| step.length)
    }

    /// The pseudo-values, where intervals have these values, in the order in which they were given; those that still ran
    /// have any.
    pub(super) fn pseudo_values<const D: usize>(&self, mut values: Vec<[f64; D]>) -> Vec<[f64; D]> {
        for component in 0..D {
            // The mean value of longer intervals times their share, from the longest on.
            let mut longer = 0.0;
            let gains = self
                .steps
                .iter()
                .rev()
                .filter(|step| step.has_ended)
                .map(|step| {
                    let (value, left) = (
                        values[step.place][component],
                        step.share * (1.0 - step.hazard),
                    );
                    let later = if left > 0.0 { longer / left } else { value };
                    longer += step.share * step.hazard * value;
                    (value - later) * step.share * step.hazard * self.steps.len() as f64
                });
            let mut gains: Vec<f64> = gains.collect();
            let mut passed = longer;
            for step in &self.steps {
                let gain = if step.has_ended {
                    gains.pop().unwrap_or_default()
                } else {
                    0.0
                };
                passed -= gain * step.hazard;
                values[step.place][component] = passed + gain;
            }
        }
        values
    }
}

/// Quantile of sorted values, interpolated linearly (NumPy's default); `None` without values.
pub fn quantile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = floored(place);
    let above = (below + 1).min(last);
    Some(sorted[below] + (place - below as f64) * (sorted[above] - sorted[below]))
}

#[cfg(test)]
mod tests {
    use super::super::confidence::tests::Draws;
    use super::*;

    #[test]
    fn without_running_intervals_pseudo_values_are_the_values() {
        let lengths = [3.0, 1.0, 2.0, 2.0, 7.0];
        let limit = ProductLimit::new(lengths.into_iter().map(|length| (length, true)));
        let values = lengths.map(|length| [length, length * length]).to_vec();
        for (pseudo, value) in limit.pseudo_values(values.clone()).iter().zip(&values) {
            assert!(
                (pseudo[0] - value[0]).abs() < 1e-12 && (pseudo[1] - value[1]).abs() < 1e-12,
                "{pseudo:?}"
            );
        }
        assert!(limit.has_mean() && (limit.least_mean() - 3.0).abs() < 1e-12);
        assert_eq!(
            [0.1, 0.5, 1.0].map(|share| limit.quantile(share)),
            [Some(1.0), Some(2.0), Some(7.0)]
        );
    }

    #[test]
    fn a_running_interval_hands_its_weight_to_longer_ones() {
        // By hand: 1 has 1/4, then 3/4 of the rest are shared by 3 and 5, as of two that are at risk.
        let limit =
            ProductLimit::new([(1.0, true), (2.0, false), (3.0, true), (5.0, true)].into_iter());
        let mean = 0.25 + 0.375 * (3.0 + 5.0);
        let pseudo = limit.pseudo_values(vec![[1.0], [f64::NAN], [3.0], [5.0]]);
        assert!((limit.least_mean() - mean).abs() < 1e-12);
        assert!(
            (pseudo.iter().map(|[value]| value).sum::<f64>() / 4.0 - mean).abs() < 1e-12,
            "{pseudo:?}"
        );
        // The longest still ran.
        let open = ProductLimit::new([(1.0, true), (3.0, true), (4.0, false)].into_iter());
        assert!(!open.has_mean() && (open.least_mean() - 8.0 / 3.0).abs() < 1e-12);
        assert_eq!(
            [0.5, 0.7].map(|share| open.quantile(share)),
            [Some(3.0), None]
        );
    }

    /// Means of renewal processes that are seen for a time, relative to the true one: product limit, and whole intervals.
    #[test]
    fn where_a_job_ends_biases_the_product_limit_by_less_than_a_tenth_of_what_it_biases_whole_intervals()
     {
        const REPETITIONS: u64 = 400;
        let (mut limit_mean, mut whole_mean) = (0.0, 0.0);
        for repetition in 0..REPETITIONS {
            let mut draws = Draws::new(repetition);
            let mut seen = Vec::new();
            for _ in 0..50 {
                let mut left = 8.0;
                loop {
                    let interval = (1.0 + 0.3 * draws.normal()).max(0.01);
                    seen.push((interval.min(left), interval <= left));
                    if interval > left {
                        break;
                    }
                    left -= interval;
                }
            }
            limit_mean += ProductLimit::new(seen.iter().copied()).least_mean() / REPETITIONS as f64;
            let whole: Vec<f64> = seen
                .iter()
                .filter(|(_, has_ended)| *has_ended)
                .map(|(length, _)| *length)
                .collect();
            whole_mean += whole.iter().sum::<f64>() / whole.len() as f64 / REPETITIONS as f64;
        }
        assert!(
            whole_mean < 0.99 && (limit_mean - 1.0).abs() < 0.1 * (1.0 - whole_mean),
            "{limit_mean} {whole_mean}"
        );
    }

    #[test]
    fn quantiles_lie_between_neighbours() {
        let values = [0.0, 1.0, 2.0, 10.0];
        assert_eq!(quantile(&values, 0.0), Some(0.0));
        assert_eq!(quantile(&values, 0.5), Some(1.5));
        assert_eq!(quantile(&values, 1.0), Some(10.0));
        assert_eq!(quantile(&[7.0], 0.3), Some(7.0));
        assert_eq!(quantile(&[], 0.3), None);
    }
}
