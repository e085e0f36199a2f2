//! Reduced tables back as rows, for figures.

use super::rows::{ParameterColumns, count, real};
use super::{BackboneBin, HistogramBin, Point, Way, reduced_file};
use crate::model::Parameters;
use crate::results::layout::Layout;
use crate::table::file::{Batch, DatasetError, Reader};
use crate::table::storage::Storage;
use arrow_array::Float64Array;

/// A set as figures need it. Quantities are SI; `None` where there is nothing to average.
#[derive(Clone, Debug, Default, PartialEq)]
#[allow(missing_docs, reason = "those without a word are described in `sets`, the table of these rows")]
pub struct SetSummary {
    pub set_id: String,
    /// The seed is the default.
    pub parameters: Parameters,
    pub tau_mean: Option<Statistic>,
    pub tau_deviation: Option<f64>,
    /// Quantiles of τ at 25, 50 and 75 %.
    pub tau_quartiles: Option<[f64; 3]>,
    pub is_locked: bool,
    pub locking_index: Option<Statistic>,
    pub resultant_length: Option<Statistic>,
    pub peak_force: Option<f64>,
    pub mean_friction: Option<Statistic>,
}

/// A statistic and, where it is known, its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistic {
    /// The statistic.
    pub value: f64,
    /// Lower and upper end of the interval.
    pub interval: Option<(f64, f64)>,
}

impl Statistic {
    /// Scaled by a factor > 0, as into another unit.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        let interval = self.interval.map(|(low, high)| (factor * low, factor * high));
        Self { value: factor * self.value, interval }
    }

    /// Lower and upper end of what is known to belong to it: the interval, or the value alone.
    #[must_use]
    pub fn ends(self) -> [f64; 2] {
        self.interval.map_or([self.value; 2], |(low, high)| [low.min(self.value), high.max(self.value)])
    }
}

fn rows<Row>(
    storage: &dyn Storage,
    layout: &Layout,
    table: &str,
    read: impl Fn(&Batch, &mut Vec<Row>) -> Result<(), DatasetError>,
) -> Result<Vec<Row>, DatasetError> {
    let mut rows = Vec::new();
    for batch in Reader::new(storage, vec![reduced_file(layout, table)], None) {
        read(&batch?, &mut rows)?;
    }
    Ok(rows)
}

/// The sample of slips.
///
/// # Errors
/// When the file is not there or is damaged.
pub fn read_points(storage: &dyn Storage, layout: &Layout) -> Result<Vec<Point>, DatasetError> {
    rows(storage, layout, super::points().name, |batch, points| {
        let (drive_velocity, amplitude) = (batch.reals("V0")?, batch.reals("Delta")?);
        let (period, eta, interval) = (batch.reals("T")?, batch.reals("eta")?, batch.reals("interval")?);
        let (periods, phase, locked) = (batch.counts("n")?, batch.reals("phase")?, batch.flags("locked")?);
        let (way, onset) = (batch.texts("way")?, batch.reals("onset")?);
        points.extend((0..batch.rows.num_rows()).map(|row| Point {
            drive_velocity: drive_velocity.value(row),
            amplitude: amplitude.value(row),
            period: real(period, row),
            eta: eta.value(row),
            way: Way::from_word(way.value(row)),
            onset: onset.value(row),
            interval: real(interval, row),
            periods: count(periods, row),
            phase: real(phase, row),
            is_locked: locked.value(row),
        }));
        Ok(())
    })
}

/// The bins of η.
///
/// # Errors
/// When the file is not there or is damaged.
pub fn read_backbone(storage: &dyn Storage, layout: &Layout) -> Result<Vec<BackboneBin>, DatasetError> {
    rows(storage, layout, super::backbone().name, |batch, bins| {
        let reals = |name| batch.reals(name);
        let (eta_low, eta_high, eta_centre) = (reals("eta_low")?, reals("eta_high")?, reals("eta_centre")?);
        let (phase_mean, resultant_length) = (reals("phase_mean")?, reals("resultant_length")?);
        let (rayleigh_p, share_below) = (reals("rayleigh_p")?, reals("share_below")?);
        let (locked_phase_mean, phi_min) = (reals("locked_phase_mean")?, reals("phi_min")?);
        let (load_rayleigh_p, asymptote) = (reals("load_rayleigh_p")?, reals("asymptote")?);
        let (phase_mean_low, phase_mean_high) = (reals("phase_mean_low")?, reals("phase_mean_high")?);
        let (locked_low, locked_high) = (reals("locked_phase_mean_low")?, reals("locked_phase_mean_high")?);
        let (effective_slips, expected) = (reals("effective_slips")?, reals("expected_resultant")?);
        let (sets, locked_sets, slips) = (batch.counts("sets")?, batch.counts("locked_sets")?, batch.counts("slips")?);
        bins.extend((0..batch.rows.num_rows()).map(|row| BackboneBin {
            eta_low: eta_low.value(row),
            eta_high: eta_high.value(row),
            eta_centre: eta_centre.value(row),
            sets: sets.value(row).cast_unsigned(),
            locked_sets: locked_sets.value(row).cast_unsigned(),
            slips: slips.value(row).cast_unsigned(),
            effective_slips: real(effective_slips, row),
            phase_mean: real(phase_mean, row),
            phase_mean_low: real(phase_mean_low, row),
            phase_mean_high: real(phase_mean_high, row),
            resultant_length: real(resultant_length, row),
            expected_resultant: real(expected, row),
            rayleigh_p: real(rayleigh_p, row),
            load_rayleigh_p: real(load_rayleigh_p, row),
            share_below: real(share_below, row),
            locked_phase_mean: real(locked_phase_mean, row),
            locked_phase_mean_low: real(locked_low, row),
            locked_phase_mean_high: real(locked_high, row),
            phase_minimum: real(phi_min, row),
            asymptote: asymptote.value(row),
        }));
        Ok(())
    })
}

/// The sets with at least one interval, in order, if there are at most so many; else none.
///
/// # Errors
/// When the file is not there or is damaged.
pub fn read_sets(storage: &dyn Storage, layout: &Layout, most: usize) -> Result<Vec<SetSummary>, DatasetError> {
    let mut sets = Vec::new();
    for batch in Reader::new(storage, vec![reduced_file(layout, super::sets().name)], None) {
        let batch = batch?;
        let (set_id, intervals) = (batch.texts("set_id")?, batch.counts("intervals")?);
        let parameters = ParameterColumns::of(&batch)?;
        let (tau_mean, tau_deviation) = (StatisticColumns::of(&batch, "tau_mean")?, batch.reals("tau_sd")?);
        let quartiles = [batch.reals("tau_25")?, batch.reals("tau_50")?, batch.reals("tau_75")?];
        let (locked, locking_index) = (batch.flags("locked")?, StatisticColumns::of(&batch, "locking_index")?);
        let resultant_length = StatisticColumns::of(&batch, "resultant_length")?;
        let (peak_force, mean_friction) =
            (batch.reals("peak_force_mean")?, StatisticColumns::of(&batch, "mean_friction")?);
        for row in (0..batch.rows.num_rows()).filter(|&row| intervals.value(row) > 0) {
            if sets.len() == most {
                return Ok(Vec::new());
            }
            let [low, median, high] = quartiles.map(|column| real(column, row));
            sets.push(SetSummary {
                set_id: set_id.value(row).to_owned(),
                parameters: parameters.row(row)?,
                tau_mean: tau_mean.row(row),
                tau_deviation: real(tau_deviation, row),
                tau_quartiles: low.zip(median).zip(high).map(|((low, median), high)| [low, median, high]),
                is_locked: locked.value(row),
                locking_index: locking_index.row(row),
                resultant_length: resultant_length.row(row),
                peak_force: real(peak_force, row),
                mean_friction: mean_friction.row(row),
            });
        }
    }
    Ok(sets)
}

/// The columns of a statistic: `NAME` and, if the table has them, `NAME_low` and `NAME_high`.
struct StatisticColumns<'a> {
    values: &'a Float64Array,
    ends: Option<(&'a Float64Array, &'a Float64Array)>,
}

impl<'a> StatisticColumns<'a> {
    fn of(batch: &'a Batch, name: &str) -> Result<Self, DatasetError> {
        let (low, high) = (format!("{name}_low"), format!("{name}_high"));
        let has_ends = batch.rows.column_by_name(&low).is_some();
        let ends = if has_ends { Some((batch.reals(&low)?, batch.reals(&high)?)) } else { None };
        Ok(Self { values: batch.reals(name)?, ends })
    }

    fn row(&self, row: usize) -> Option<Statistic> {
        let interval = self.ends.and_then(|(low, high)| real(low, row).zip(real(high, row)));
        real(self.values, row).map(|value| Statistic { value, interval })
    }
}

/// The histograms of all sets, one after the other.
///
/// # Errors
/// When the file is not there or is damaged.
pub fn read_histograms(storage: &dyn Storage, layout: &Layout) -> Result<Vec<HistogramBin>, DatasetError> {
    rows(storage, layout, super::histograms().name, |batch, bins| {
        let (set_id, counts) = (batch.texts("set_id")?, batch.counts("count")?);
        let (low, high, density) = (batch.reals("low")?, batch.reals("high")?, batch.reals("density")?);
        bins.extend((0..batch.rows.num_rows()).map(|row| HistogramBin {
            set_id: set_id.value(row).to_owned(),
            low: low.value(row),
            high: high.value(row),
            count: counts.value(row).cast_unsigned(),
            density: density.value(row),
        }));
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use arrow_array::{ArrayRef, RecordBatch};
    use std::path::Path;
    use std::sync::Arc;

    fn batch(columns: &[(&str, [Option<f64>; 2])]) -> Batch {
        let column = |(name, cells): &(&str, [Option<f64>; 2])| {
            let array: ArrayRef = Arc::new(Float64Array::from(cells.to_vec()));
            ((*name).to_owned(), array, true)
        };
        let rows = RecordBatch::try_from_iter_with_nullable(columns.iter().map(column)).unwrap();
        Batch { path: Path::new("sets.parquet").into(), rows }
    }

    #[test]
    fn a_statistic_has_an_interval_only_where_the_table_tells_both_ends() {
        let values = ("tau_mean", [Some(0.1), Some(0.2)]);
        let without = batch(&[values]);
        let row = StatisticColumns::of(&without, "tau_mean").unwrap().row(1);
        assert_eq!(row, Some(Statistic { value: 0.2, interval: None }));
        let with = batch(&[values, ("tau_mean_low", [Some(0.09), None]), ("tau_mean_high", [Some(0.12), Some(0.3)])]);
        let columns = StatisticColumns::of(&with, "tau_mean").unwrap();
        assert_eq!(columns.row(0), Some(Statistic { value: 0.1, interval: Some((0.09, 0.12)) }));
        assert_eq!(columns.row(1), Some(Statistic { value: 0.2, interval: None }));
        let half = batch(&[values, ("tau_mean_low", [None, None])]);
        assert!(StatisticColumns::of(&half, "tau_mean").is_err());
    }
}
