//! Rows of the tables as a reduction reads them: by column name, batch by batch.

use super::{Moments, SetJobs, SlipSample};
use crate::model::{BreakOn, Parameters, Symbol, Value};
use crate::results::tables::FAILED;
use crate::table::file::{Batch, DatasetError};
use arrow_array::{Array, Float64Array, Int64Array, StringArray};
use std::collections::BTreeMap;

/// Columns of the slips table that a reduction needs.
pub(super) const SLIP_COLUMNS: [&str; 14] = [
    "set_id",
    "slip",
    "onset",
    "interval",
    "T_onset",
    "Delta_onset",
    "n",
    "phase",
    "peak_force",
    "drop",
    "duration",
    "precursors",
    "front_speed",
    "slow_front_speed",
];

pub(super) fn real(array: &Float64Array, row: usize) -> Option<f64> {
    array.is_valid(row).then(|| array.value(row))
}

pub(super) fn count(array: &Int64Array, row: usize) -> Option<u64> {
    array.is_valid(row).then(|| array.value(row).cast_unsigned())
}

/// The slips of a batch, each with the id of its set, in order.
pub(super) fn for_each_slip(batch: &Batch, mut visit: impl FnMut(&str, &SlipSample)) -> Result<(), DatasetError> {
    let (set_id, number) = (batch.texts("set_id")?, batch.counts("slip")?);
    let (onset, period, amplitude) = (batch.reals("onset")?, batch.reals("T_onset")?, batch.reals("Delta_onset")?);
    let (interval, periods, phase) = (batch.reals("interval")?, batch.counts("n")?, batch.reals("phase")?);
    let (peak_force, drop, duration) = (batch.reals("peak_force")?, batch.reals("drop")?, batch.reals("duration")?);
    let precursors = batch.counts("precursors")?;
    let (front_speed, slow_front_speed) = (batch.reals("front_speed")?, batch.reals("slow_front_speed")?);
    for row in 0..batch.rows.num_rows() {
        let slip = SlipSample {
            number: number.value(row).cast_unsigned(),
            onset: onset.value(row),
            interval: real(interval, row),
            period: real(period, row),
            amplitude: amplitude.value(row),
            periods: count(periods, row),
            phase: real(phase, row),
            peak_force: peak_force.value(row),
            drop: drop.value(row),
            duration: duration.value(row),
            precursors: precursors.value(row) as f64,
            front_speed: real(front_speed, row),
            slow_front_speed: real(slow_front_speed, row),
        };
        visit(set_id.value(row), &slip);
    }
    Ok(())
}

/// Adds the jobs of a batch of the jobs table to their sets.
pub(super) fn gather_jobs(batch: &Batch, sets: &mut BTreeMap<String, SetJobs>) -> Result<(), DatasetError> {
    let (set_id, outcome) = (batch.texts("set_id")?, batch.texts("outcome")?);
    let (slips, friction) = (batch.counts("slips")?, batch.reals("mean_friction")?);
    let parameters = ParameterColumns::of(batch)?;
    for row in 0..batch.rows.num_rows() {
        let id = set_id.value(row);
        if !sets.contains_key(id) {
            let set = SetJobs {
                set_id: id.to_owned(),
                parameters: parameters.row(row)?,
                finished: 0,
                failed: 0,
                slips: 0,
                friction: Moments::default(),
            };
            sets.insert(id.to_owned(), set);
        }
        let Some(set) = sets.get_mut(id) else { continue };
        if outcome.value(row) == FAILED {
            set.failed += 1;
        } else {
            set.finished += 1;
            set.slips += count(slips, row).unwrap_or(0);
            set.friction.extend(real(friction, row));
        }
    }
    Ok(())
}

/// The columns of a batch that hold parameters.
pub(super) struct ParameterColumns<'a> {
    batch: &'a Batch,
    columns: Vec<(Symbol, ParameterColumn<'a>)>,
}

enum ParameterColumn<'a> {
    Real(&'a Float64Array),
    Count(&'a Int64Array),
    Word(&'a StringArray),
}

impl<'a> ParameterColumns<'a> {
    /// Those of every symbol that the table has; the others keep their defaults.
    pub(super) fn of(batch: &'a Batch) -> Result<Self, DatasetError> {
        let present = |symbol: &Symbol| batch.rows.column_by_name(symbol.key()).is_some();
        let column = |symbol: Symbol| {
            let column = match Parameters::default().get(symbol) {
                Value::Real(_) | Value::Absent => ParameterColumn::Real(batch.reals(symbol.key())?),
                Value::Count(_) => ParameterColumn::Count(batch.counts(symbol.key())?),
                Value::BreakOn(_) | Value::Flag(_) => ParameterColumn::Word(batch.texts(symbol.key())?),
            };
            Ok((symbol, column))
        };
        let columns = Symbol::ALL.into_iter().filter(present).map(column).collect::<Result<_, DatasetError>>()?;
        Ok(Self { batch, columns })
    }

    /// The parameters of a row.
    pub(super) fn row(&self, row: usize) -> Result<Parameters, DatasetError> {
        let mut parameters = Parameters::default();
        for (symbol, column) in &self.columns {
            let value = match column {
                ParameterColumn::Real(array) => real(array, row).map_or(Value::Absent, Value::Real),
                ParameterColumn::Count(array) => Value::Count(array.value(row).cast_unsigned()),
                ParameterColumn::Word(array) => {
                    array.value(row).parse::<BreakOn>().map_or(Value::Absent, Value::BreakOn)
                }
            };
            parameters.set(*symbol, value).map_err(DatasetError::damaged(&self.batch.path))?;
        }
        parameters.validated().map_err(DatasetError::damaged(&self.batch.path))
    }
}
