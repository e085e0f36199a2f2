//! Slips for the charts, or a sample of them.

use super::reduced_columns::Columns;
use crate::observe::Slip;
use crate::results::tables::{JOBS, JobOfSlip, SLIPS};
use crate::results::{Results, ResultsError};
use crate::sets::{Label, capitalised, first_clause};
use serde::Serialize;
use std::collections::HashMap;

/// Slips up to which all are shown; of more, every k-th in table order. Each takes some 30 bytes of the page.
const MAX_SLIPS: u64 = 100_000;
/// Their columns that are shown, with their symbols. All of them would be twice as many bytes.
const COLUMNS: [(&str, &str); 14] = [
    ("slip", "slip"),
    ("onset", "t"),
    ("interval", "τ"),
    ("T_onset", "T"),
    ("Delta_onset", "Δ"),
    ("periods", "n"),
    ("phase", "φ"),
    ("peak_force", "F"),
    ("drop", "ΔF"),
    ("duration", "duration"),
    ("size", "size"),
    ("slip_distance", "distance"),
    ("front_speed", "speed"),
    ("precursors", "precursors"),
];

/// What the page says of its slips.
#[derive(Debug, Serialize)]
pub(super) struct Slips {
    /// One of this many slips is shown.
    every: u64,
    #[serde(flatten)]
    columns: Columns,
    /// Of each slip, the number of its job.
    job: Vec<usize>,
    /// Of each job with a slip that is shown: the place of its set, and its seed.
    jobs: Vec<(usize, u64)>,
}

impl Slips {
    /// Every k-th of `total` slips, those of sets with a place.
    pub(super) fn read(
        results: &Results<'_>,
        places: &HashMap<String, usize>,
        total: u64,
    ) -> Result<Self, ResultsError> {
        let symbol = |name: &str| {
            let found = COLUMNS.iter().find(|(known, _)| *known == name);
            found.map(|found| found.1)
        };
        let mut slips = Self {
            every: total.div_ceil(MAX_SLIPS).max(1),
            columns: Columns::of::<Slip>(|name| symbol(name).is_some()),
            job: Vec::new(),
            jobs: Vec::new(),
        };
        let mut number = 0_u64;
        let mut last: Option<JobOfSlip> = None;
        let files = results.committed_files(SLIPS, &results.dataset(JOBS)?)?;
        for batch in files.rows::<(JobOfSlip, Slip)>() {
            for (job, slip) in batch? {
                let Some(&place) = places.get(&job.set_id) else {
                    continue;
                };
                number += 1;
                if !(number - 1).is_multiple_of(slips.every) {
                    continue;
                }
                if last.as_ref() != Some(&job) {
                    slips.jobs.push((place, job.seed));
                    last = Some(job);
                }
                slips.job.push(slips.jobs.len() - 1);
                slips.columns.push(&slip);
            }
        }
        slips.columns.label(|column| Label {
            symbol: symbol(&column.name).unwrap_or_default().to_owned(),
            what: capitalised(first_clause(column.meaning)),
            unit: column.unit,
        });
        Ok(slips)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::columns::Row;

    #[test]
    fn the_columns_that_are_shown_are_there() {
        let described = Slip::columns();
        assert!(
            COLUMNS
                .iter()
                .all(|(name, _)| described.iter().any(|column| column.name == *name))
        );
    }
}
