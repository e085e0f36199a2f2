//! Series: stretches of rows of one run and with the same parameters.

use super::keys::Key;
use super::rows::Rows;
use crate::model::theory::to_twelve_digits;
use crate::model::{Symbol, Value};
use anyhow::{Context as _, Result, ensure};
use std::collections::HashSet;
use std::ops::Range;

/// Rows from which equal distances are those of samples, and the largest deviation of equal ones, by their mean.
const MIN_SAMPLES: usize = 100;
const EQUAL: f64 = 1e-6;

/// Largest uncertainty of onsets that have phases, by the period.
pub const MAX_UNCERTAINTY: f64 = 0.1;

/// Parameters that an experiment can know.
pub const PARAMETERS: [Symbol; 4] = [Symbol::V0, Symbol::Kd, Symbol::Delta, Symbol::T];

#[derive(Clone, Debug)]
pub struct Series {
    pub rows: Range<usize>,
    /// Of [`PARAMETERS`].
    pub parameters: [Option<f64>; 4],
    /// When its record ended, in s.
    pub end: Option<f64>,
    /// Median uncertainty of the onsets in s, if they were found in a trace.
    pub uncertainty: Option<f64>,
    /// Where it begins, in words.
    pub place: String,
}

impl Series {
    /// Of its modulation, in s.
    pub const fn period(&self) -> Option<f64> {
        self.parameters[3]
    }

    /// Whether onsets are known well enough for phases.
    pub fn has_phases(&self) -> bool {
        let both = self.uncertainty.zip(self.period());
        both.is_none_or(|(uncertainty, period)| uncertainty <= MAX_UNCERTAINTY * period)
    }

    fn mean_interval(&self, onsets: &[f64]) -> f64 {
        let intervals = self.rows.len() - 1;
        (onsets[self.rows.end - 1] - onsets[self.rows.start]) / intervals as f64
    }

    /// Whether its intervals are equal.
    pub fn is_regular(&self, onsets: &[f64]) -> bool {
        let mean = self.mean_interval(onsets);
        let pairs = onsets[self.rows.clone()].windows(2);
        let squares = pairs.map(|pair| (pair[1] - pair[0] - mean).powi(2));
        (squares.sum::<f64>() / (self.rows.len() - 1) as f64).sqrt() < EQUAL * mean
    }

    /// Refuses samples of a trace. Slips that lock, read with a coarse clock, are as regular.
    fn refuse_samples(&self, onsets: &[f64]) -> Result<()> {
        let count = self.rows.len();
        if count < MIN_SAMPLES || !self.is_regular(onsets) {
            return Ok(());
        }
        let mean = self.mean_interval(onsets);
        let periods = self.period().map_or(0.0, |period| mean / period);
        let off = (periods - periods.round()).abs();
        ensure!(
            periods.round() >= 1.0 && off < EQUAL * periods,
            "{count} rows at equal distances of {mean} s are samples of a trace; a table of slips has a row for each slip. \
             For a trace write --column time=NAME:UNIT --column force=NAME:UNIT --drop-size auto"
        );
        Ok(())
    }
}

/// The series of a table, in its order.
pub fn series_of(rows: &Rows) -> Result<Vec<Series>> {
    let onsets = rows.of(Key::Onset).unwrap_or_default();
    let ends = rows.of(Key::End);
    let mut all: Vec<Series> = Vec::new();
    let mut seen = HashSet::new();
    let begins = rows.begins();
    for row in 0..rows.count {
        let in_row = || rows.place(row);
        if begins.contains(&row) {
            let run = rows.run(row);
            let parameters = parameters(rows, row).with_context(in_row)?;
            let is_of_last =
                |last: &Series| rows.run(last.rows.start) == run && last.parameters == parameters;
            if !all.last().is_some_and(is_of_last) {
                let bits = parameters.map(|value| value.map(f64::to_bits));
                let is_new = seen.insert((run, bits));
                ensure!(
                    is_new || !rows.has_runs(),
                    "{}: run {} begins again: sort by run and onset, and give it one V0, Kd, Delta and T",
                    in_row(),
                    rows.name_of(run)
                );
                all.push(Series {
                    rows: row..row,
                    parameters,
                    end: ends.map(|ends| ends[row]),
                    uncertainty: None,
                    place: rows.place(row),
                });
            }
        }
        if let Some(series) = all.last_mut() {
            refuse_missing(rows, row, series).with_context(in_row)?;
            let before = onsets[series.rows.clone()].last().copied();
            check_times(onsets[row], before, ends.map(|ends| ends[row]), series)
                .with_context(in_row)?;
            series.rows.end = row + 1;
        }
    }
    for series in &mut all {
        if let Some(uncertainties) = rows.uncertainties.get(series.rows.clone()) {
            let mut sorted = uncertainties.to_vec();
            sorted.sort_by(f64::total_cmp);
            series.uncertainty = sorted.get(sorted.len() / 2).copied();
            continue;
        }
        let checked = series.refuse_samples(onsets);
        checked.with_context(|| series.place.clone())?;
    }
    Ok(all)
}

/// The parameters of a row, in the order of [`PARAMETERS`].
pub fn parameters(rows: &Rows, row: usize) -> Result<[Option<f64>; 4]> {
    let raw = |key: Key| rows.of(key).map(|numbers| numbers[row]);
    let amplitude = raw(Key::Delta);
    let number = |key: Key| {
        let is_needless = amplitude == Some(0.0) && key.is_of_modulation();
        let number = raw(key).filter(|_| !is_needless);
        ensure!(
            !number.is_some_and(f64::is_nan),
            "{} is missing",
            key.word()
        );
        // The factor of a unit leaves a rounding error behind.
        Ok(number.map(to_twelve_digits))
    };
    let mut period = number(Key::T)?;
    if let Some(frequency) = number(Key::Frequency)? {
        ensure!(period.is_none(), "T and frequency are given; keep one");
        ensure!(frequency > 0.0, "frequency = {frequency}: must be > 0");
        period = Some(1.0 / frequency);
    }
    let found = [
        number(Key::V0)?,
        number(Key::Kd)?,
        number(Key::Delta)?,
        period,
    ];
    for (value, symbol) in found.into_iter().zip(PARAMETERS) {
        let is_allowed = value.is_none_or(|value| symbol.checked(Value::Real(value)).is_some());
        let key = symbol.key();
        let allowed = symbol.description().allowed();
        ensure!(
            is_allowed,
            "{key} = {}: must be {allowed}",
            value.unwrap_or_default()
        );
    }
    let is_modulated = amplitude.is_some_and(|amplitude| amplitude > 0.0);
    ensure!(
        period.is_some() || !is_modulated,
        "Delta > 0: needs T or frequency"
    );
    Ok(found)
}

/// Refuses a row without a number that its series needs.
fn refuse_missing(rows: &Rows, row: usize, series: &Series) -> Result<()> {
    for column in rows
        .columns
        .iter()
        .filter(|column| !column.numbers.is_empty())
    {
        let key = column.given.key;
        let is_needless = key.is_of_modulation() && series.period().is_none();
        let may_be_missing = matches!(key, Key::Drop | Key::PeakForce) || is_needless;
        let is_missing = column.numbers[row].is_nan() && !may_be_missing;
        ensure!(!is_missing, "{} is missing", key.word());
    }
    Ok(())
}

/// Refuses an onset that does not follow the one before it, or lies behind the end of the record.
fn check_times(onset: f64, before: Option<f64>, end: Option<f64>, series: &Series) -> Result<()> {
    ensure!(
        onset >= 0.0,
        "onset = {onset} s: must be 0 or later; shift the times"
    );
    let before = before.unwrap_or(f64::NEG_INFINITY);
    ensure!(
        onset > before,
        "onset {onset} s is not after {before} s above it; where series begin, a column must say so: --column run=NAME"
    );
    ensure!(
        end == series.end,
        "end differs within a series; it is when its record ended"
    );
    ensure!(
        end.is_none_or(|end| end >= onset),
        "end is before the onset at {onset} s"
    );
    Ok(())
}
