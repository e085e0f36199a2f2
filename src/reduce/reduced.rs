//! Reduced tables back as rows, for figures.

use super::{Interval, SetRow};
use crate::model::Parameters;
use crate::observe::Regime;
use crate::results::layout::Layout;
use crate::table::columns::{FromRow, Table};
use crate::table::file::{Dataset, DatasetError};

/// A set as figures need it. Quantities are SI; `None` where there is nothing to average.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SetSummary {
    pub set_id: String,
    /// The seed is the default.
    pub parameters: Parameters,
    pub tau_mean: Option<Statistic>,
    pub tau_deviation: Option<f64>,
    /// Quantiles of τ at 25, 50 and 75 %.
    pub tau_quartiles: Option<[f64; 3]>,
    /// The median of τ/T, rounded.
    pub periods: Option<u64>,
    pub is_locked: bool,
    pub locking_index: Option<Statistic>,
    pub resultant_length: Option<Statistic>,
    pub peak_force: Option<f64>,
    pub mean_friction: Option<Statistic>,
    pub regime: Option<Regime>,
    pub slip_share: Option<f64>,
}

/// A statistic and, where it is known, its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistic {
    pub value: f64,
    /// Lower and upper end of the interval.
    pub interval: Option<(f64, f64)>,
}

impl Statistic {
    fn new(value: Option<f64>, interval: Option<Interval>) -> Option<Self> {
        let interval = interval.map(|Interval { low, high }| (low, high));
        value.map(|value| Self { value, interval })
    }

    /// Scaled by a factor > 0, as into another unit.
    pub fn times(self, factor: f64) -> Self {
        let interval = self.interval.map(|(low, high)| (factor * low, factor * high));
        Self { value: factor * self.value, interval }
    }

    /// Lower and upper end of what is known to belong to it: the interval, or the value alone.
    pub fn ends(self) -> [f64; 2] {
        self.interval.map_or([self.value; 2], |(low, high)| [low.min(self.value), high.max(self.value)])
    }
}

impl From<SetRow> for SetSummary {
    fn from(row: SetRow) -> Self {
        Self {
            set_id: row.set_id,
            parameters: row.parameters.parameters,
            tau_mean: Statistic::new(row.tau_mean, row.tau_interval),
            tau_deviation: row.tau_deviation,
            tau_quartiles: row.tau_25.zip(row.tau_50).zip(row.tau_75).map(|((low, median), high)| [low, median, high]),
            periods: row.periods,
            is_locked: row.is_locked,
            locking_index: Statistic::new(row.locking_index, row.locking_interval),
            resultant_length: Statistic::new(row.resultant_length, row.length_interval),
            peak_force: row.peak_force_mean,
            mean_friction: Statistic::new(row.mean_friction, row.mean_friction_interval),
            regime: row.regime,
            slip_share: row.slip_share,
        }
    }
}

/// An error of a table, with what to do.
pub fn advise(advice: &'static str) -> impl Fn(DatasetError) -> anyhow::Error {
    move |error| {
        let advised = format!("{error}; {advice}");
        anyhow::Error::new(error).context(advised)
    }
}

/// The rows of a reduced table, such as [`Point`](super::Point).
pub fn read_reduced<R: FromRow + Table>(layout: &Layout<'_>) -> Result<Vec<R>, DatasetError> {
    let batches = Dataset::new(layout.storage, vec![layout.reduced_file(R::NAME)]).rows();
    Ok(batches.collect::<Result<Vec<Vec<R>>, _>>()?.into_iter().flatten().collect())
}

/// The sets with at least one interval or a regime, in order, if there are at most `max` of them; else none.
pub fn read_sets(layout: &Layout<'_>, max: usize) -> Result<Vec<SetSummary>, DatasetError> {
    let mut sets = Vec::new();
    for batch in Dataset::new(layout.storage, vec![layout.reduced_file(SetRow::NAME)]).rows::<SetRow>() {
        sets.extend(batch?.into_iter().filter(|row| row.intervals > 0 || row.regime.is_some()).map(SetSummary::from));
        if sets.len() > max {
            return Ok(Vec::new());
        }
    }
    Ok(sets)
}
