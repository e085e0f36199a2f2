//! Reduced tables back as rows, for figures.

use super::rows::{ParameterColumns, count, real};
use super::{BackboneBin, HistogramBin, Point, Way, reduced_file};
use crate::model::Parameters;
use crate::store::dataset::{Batch, DatasetError, Reader};
use crate::store::layout::Layout;
use crate::store::storage::Storage;

/// A set as a figure needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct SetLabel {
    /// Id of the set.
    pub set_id: String,
    /// Its parameters; the seed is the default.
    pub parameters: Parameters,
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
pub fn read_few_sets(storage: &dyn Storage, layout: &Layout, most: usize) -> Result<Vec<SetLabel>, DatasetError> {
    let mut sets = Vec::new();
    for batch in Reader::new(storage, vec![reduced_file(layout, super::sets().name)], None) {
        let batch = batch?;
        let (set_id, intervals) = (batch.texts("set_id")?, batch.counts("intervals")?);
        let parameters = ParameterColumns::of(&batch)?;
        for row in (0..batch.rows.num_rows()).filter(|&row| intervals.value(row) > 0) {
            if sets.len() == most {
                return Ok(Vec::new());
            }
            sets.push(SetLabel { set_id: set_id.value(row).to_owned(), parameters: parameters.row(row)? });
        }
    }
    Ok(sets)
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
