//! Reduced tables back as rows, for figures.

use super::{Interval, SetRow};
use crate::results::layout::Layout;
use crate::table::columns::{FromRow, Table};
use crate::table::file::{Dataset, DatasetError};

/// A statistic and, where it is known, its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistic {
    pub value: f64,
    /// Lower and upper end of the interval.
    pub interval: Option<(f64, f64)>,
}

impl Statistic {
    /// `None` without a value.
    pub fn of(value: Option<f64>, interval: Option<Interval>) -> Option<Self> {
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

/// The sets with at least one interval or a regime, controls left out, in order, if there are at most `max` of them; else none.
pub fn read_sets(layout: &Layout<'_>, max: usize) -> Result<Vec<SetRow>, DatasetError> {
    let mut sets = Vec::new();
    for batch in Dataset::new(layout.storage, vec![layout.reduced_file(SetRow::NAME)]).rows::<SetRow>() {
        let rows = batch?.into_iter().filter(|row| !row.is_control);
        sets.extend(rows.filter(|row| row.intervals > 0 || row.regime.is_some()));
        if sets.len() > max {
            return Ok(Vec::new());
        }
    }
    Ok(sets)
}
