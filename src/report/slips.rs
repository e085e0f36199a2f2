//! Slips for the charts, or a sample of them: columns of numbers of 24 bits, byte by byte, so that they compress well.

use super::tables::described;
use crate::observe::Slip;
use crate::results::Results;
use crate::results::parts::committed_files;
use crate::results::tables::{JOBS, JobOfSlip, SLIPS};
use crate::table::columns::{Row, Value};
use crate::table::file::DatasetError;
use serde::Serialize;
use serde_json::Value as Json;
use std::collections::HashMap;

/// Slips up to which all are shown; of more, every k-th in table order. Each takes some 30 bytes of the page.
const MAX_SLIPS: u64 = 100_000;
/// Their columns that are shown. All of them would be twice as many bytes.
const COLUMNS: [&str; 14] = [
    "slip",
    "onset",
    "interval",
    "T_onset",
    "Delta_onset",
    "periods",
    "phase",
    "peak_force",
    "drop",
    "duration",
    "size",
    "slip_distance",
    "front_speed",
    "precursors",
];
/// Bits of a single-precision number that are dropped: what is left has a relative error of 8e-6.
const DROPPED: u32 = 7;

/// What the page says of its slips.
#[derive(Debug, Serialize)]
pub(super) struct Slips {
    /// Every so many slips one is shown.
    every: u64,
    rows: usize,
    columns: Vec<Json>,
    /// Of each job with a slip that is shown: the place of its set, and its seed.
    jobs: Vec<(usize, u64)>,
    /// The number of the job of each slip, then the columns.
    #[serde(skip)]
    values: Vec<Vec<u32>>,
}

impl Slips {
    /// Every k-th of `total` slips, those of sets with a place.
    pub(super) fn read(
        results: &Results<'_>,
        places: &HashMap<String, usize>,
        total: u64,
    ) -> Result<Self, DatasetError> {
        let layout = results.layout();
        let all = Slip::columns();
        let place_of = |name: &&str| all.iter().position(|column| column.name == **name);
        let shown: Vec<usize> = COLUMNS.iter().filter_map(place_of).collect();
        let mut slips = Self {
            every: total.div_ceil(MAX_SLIPS).max(1),
            rows: 0,
            columns: shown.iter().map(|&place| described(&all[place])).collect(),
            jobs: Vec::new(),
            values: vec![Vec::new(); 1 + shown.len()],
        };
        let mut number = 0_u64;
        let mut last: Option<JobOfSlip> = None;
        let mut cells = Vec::with_capacity(all.len());
        for batch in committed_files(layout, SLIPS, &layout.dataset(JOBS)?)?.rows::<(JobOfSlip, Slip)>() {
            for (job, slip) in batch? {
                let Some(&place) = places.get(&job.set_id) else { continue };
                number += 1;
                if !(number - 1).is_multiple_of(slips.every) {
                    continue;
                }
                if last.as_ref() != Some(&job) {
                    slips.jobs.push((place, job.seed));
                    last = Some(job);
                }
                cells.clear();
                slip.cells(&mut |cell| cells.push(bits(cell)));
                slips.rows += 1;
                #[expect(clippy::cast_possible_truncation, reason = "at most as many as slips")]
                slips.values[0].push(slips.jobs.len() as u32 - 1);
                for (column, &place) in slips.values[1..].iter_mut().zip(&shown) {
                    column.push(cells[place]);
                }
            }
        }
        Ok(slips)
    }

    /// Of each column the highest bytes of all rows, then the next, down to the lowest.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let planes = self
            .values
            .iter()
            .flat_map(|column| (0..4).map(move |byte| column.iter().map(move |bits| bits.to_be_bytes()[byte])));
        planes.flatten().collect()
    }
}

/// A cell in single precision without its last bits; not a number if it is null.
fn bits(cell: Value<'_>) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounded on purpose")]
    let number = match cell {
        Value::Real(real) => real as f32,
        Value::Count(count) => count as f32,
        Value::Flag(flag) => f32::from(u8::from(flag)),
        Value::Null | Value::Text(_) => f32::NAN,
    };
    if number.is_nan() {
        return f32::NAN.to_bits();
    }
    let half = 1 << (DROPPED - 1);
    (number.to_bits() + half) >> DROPPED << DROPPED
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_five_digits_and_what_is_missing_is_not_a_number() {
        let back = |cell| f32::from_bits(bits(cell));
        for real in [0.137_123_456, -3.051_592_65, 1e-9, 5e7, 476.951_234] {
            assert!((f64::from(back(Value::Real(real))) / real - 1.0).abs() < 8e-6, "{real}");
        }
        assert_eq!((back(Value::Count(131_071)), back(Value::Real(0.0))), (131_071.0, 0.0));
        assert!(back(Value::Null).is_nan() && back(Value::Real(f64::NAN)).is_nan());
        assert_eq!(back(Value::Real(f64::INFINITY)), f32::INFINITY);
    }

    #[test]
    fn the_columns_that_are_shown_are_there() {
        let described = Slip::columns();
        assert!(COLUMNS.iter().all(|name| described.iter().any(|column| column.name == *name)));
    }
}
