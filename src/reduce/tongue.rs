//! Tongues: sets whose intervals are n periods each, up to a jitter.
//!
//! Few slips are off n there, and a small set may have seen none. Each would change its statistics much, so its intervals allow
//! for some of them (`Unseen`). How much each would change is a choice by which intervals hold the true value as often as
//! they say: docs/coverage.md.

use super::confidence::Unseen;
use super::sequence::Estimate;

/// Standard deviation of intervals about whole numbers of periods, in periods, from which jitter alone puts slips off n.
const MAX_JITTER: f64 = 0.1;

/// What a slip off n takes from the sum of phases as unit vectors.
pub(super) const OF_PHASES: f64 = 0.75;

/// The same of the intervals in periods, as angles: those before and after it.
pub(super) const OF_INTERVALS: f64 = 1.4;

/// Periods that are missing after an interval shorter than n: most are followed by one that is as much longer.
const OF_SHORTER: f64 = 0.4;

/// The intervals of a set in a tongue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tongue {
    /// Mean interval in periods.
    mean: Option<f64>,
    /// Periods beyond n, summed over all intervals.
    beyond: f64,
    has_shorter: bool,
}

impl Tongue {
    /// Of intervals in periods, their median and mean; `None` if they are in no tongue with n >= 1.
    pub(super) fn of(periods: &[f64], n: Option<u64>, mean: Option<f64>) -> Option<Self> {
        let n = n.filter(|&n| n > 0)? as f64;
        let count = periods.len() as f64;
        let rest = periods.iter().map(|periods| periods - periods.round());
        let mean_rest = rest.clone().sum::<f64>() / count;
        let squares: f64 = rest
            .map(|rest| (rest - mean_rest) * (rest - mean_rest))
            .sum();
        ((squares / count).sqrt() < MAX_JITTER).then(|| Self {
            mean,
            beyond: periods.iter().map(|periods| periods.round() - n).sum(),
            has_shorter: periods.iter().any(|periods| periods.round() < n),
        })
    }

    /// By how much a quantity that is proportional to the interval grows with each period.
    fn step(&self, of: &Estimate<1>) -> f64 {
        let means = of.value().zip(self.mean);
        means.map_or(0.0, |(mean, periods)| mean / periods)
    }

    /// What slips off n change in the mean of a quantity that is proportional to the interval.
    pub(super) fn of_mean(&self, of: &Estimate<1>) -> Unseen {
        let step = self.step(of);
        Unseen {
            below: if self.has_shorter && self.beyond >= 0.0 {
                OF_SHORTER * step
            } else {
                0.0
            },
            above: if self.beyond > 0.0 { 0.0 } else { step },
        }
    }

    /// What they change in the squared deviations of such a quantity from its mean.
    pub(super) fn of_squares(&self, of: &Estimate<1>) -> Unseen {
        let step = self.step(of);
        Unseen {
            below: 0.0,
            above: if self.beyond == 0.0 { step * step } else { 0.0 },
        }
    }
}
