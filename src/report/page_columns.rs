//! Tables of the page, column by column: a reader of the page needs each column as a whole, and columns compress best.

use crate::observe::{Regime, Slip};
use crate::reduce::{BackboneBin, HistogramBin, read_reduced, read_sets, swept};
use crate::results::layout::Layout;
use crate::results::tables::{JobOfSlip, RecordedTable};
use crate::results::{Results, ResultsError};
use crate::sets::{Label, SetRow, by_frequency};
use crate::sweep::Sweep;
use crate::table::Table;
use crate::table::columns::{Column, Row, Value, whose_end};
use crate::table::file::Dataset;
use crate::table::value::floored;
use serde::Serialize;
use serde_json::{Value as Json, json};
use std::collections::{BTreeMap, HashMap};

/// Sets up to which all are shown; of more, every k-th. Each takes some 700 bytes of the page.
const MAX_SETS: u64 = 5_000;
/// Decimals of a mantissa: five digits are more than any interval of confidence leaves.
const DECIMALS: usize = 4;

#[derive(Debug, Default, Serialize)]
pub(super) struct Columns {
    #[serde(rename = "columns")]
    described: Vec<Json>,
    values: Vec<Vec<Json>>,
    /// The labels of the columns of the rows; none of those that the page leaves out.
    #[serde(skip)]
    labels: Vec<Option<Label>>,
}

impl Columns {
    fn of<R: Row>(is_shown: impl Fn(&Column) -> bool) -> Self {
        let columns = R::columns();
        let label = |place| is_shown(&columns[place]).then(|| Label::of(&columns, place));
        let described = |(place, column): (usize, &Column)| {
            json!({
                "name": column.name,
                "unit": column.unit,
                "meaning": column.meaning,
                "kind": column.kind.word(),
                "end_of": whose_end(&columns, place).map(|of| &of.name),
                "bound_of": column.class.bounded(),
                "by_drive": column.class.explained(),
            })
        };
        let shown = columns.iter().enumerate();
        let shown = shown.filter(|(_, column)| is_shown(column));
        let described: Vec<Json> = shown.map(described).collect();
        Self {
            values: vec![Vec::new(); described.len()],
            described,
            labels: (0..columns.len()).map(label).collect(),
        }
    }

    /// Gives each column its label in the unit in which its values are read best, and the factor to that; no unit to one
    /// without values.
    fn label(&mut self) {
        let labels = self.labels.iter().flatten();
        for ((column, values), label) in self.described.iter_mut().zip(&self.values).zip(labels) {
            let sizes = values.iter().filter_map(Json::as_f64).map(f64::abs);
            let largest = sizes.reduce(f64::max);
            let (factor, unit) = largest.map_or((1.0, "".into()), |largest| label.scale(largest));
            column["label"] = label.axis(&unit).into();
            column["symbol"] = label.symbol.as_str().into();
            column["unit"] = unit.into();
            column["factor"] = factor.into();
        }
    }

    fn push<R: Row>(&mut self, row: &R, json: impl Fn(Value<'_>) -> Json) {
        let mut labels = self.labels.iter();
        let mut values = self.values.iter_mut();
        row.cells(&mut |cell| {
            if let Some(Some(_)) = labels.next()
                && let Some(column) = values.next()
            {
                column.push(json(cell));
            }
        });
    }
}

fn rounded(cell: Value<'_>) -> Json {
    match cell {
        Value::Real(real) => json!(format!("{real:.DECIMALS$e}").parse().unwrap_or(real)),
        other => json!(other),
    }
}

/// How many sets of which kind there are.
#[derive(Debug, Default, Serialize)]
pub(super) struct Census {
    pub sets: u64,
    /// By regime; those without a finished job under an empty name.
    regimes: BTreeMap<&'static str, u64>,
    pub slips: u64,
    jobs_cut: u64,
    /// The largest share of a mean interval that is missing for them.
    tau_off: Option<f64>,
}

impl Census {
    pub(super) fn read(layout: &Layout<'_>) -> Result<Self, ResultsError> {
        let regimes = Regime::ALL.map(|regime| (regime.word(), 0)).into();
        let mut census = Self {
            regimes,
            ..Self::default()
        };
        for set in read_sets(layout) {
            let set = set?;
            census.sets += 1;
            census.slips += set.slips;
            census.jobs_cut += set.jobs_cut;
            let off = census.tau_off.into_iter().chain(set.tau_off);
            census.tau_off = off.reduce(f64::min);
            let regime = set.regime.map_or("", Regime::word);
            *census.regimes.entry(regime).or_default() += 1;
        }
        Ok(census)
    }

    /// One of this many sets is shown.
    pub(super) fn spacing(&self) -> u64 {
        self.sets.div_ceil(MAX_SETS).max(1)
    }
}

/// The sets that are shown.
#[derive(Debug, Default, Serialize)]
pub(super) struct Sets {
    #[serde(flatten)]
    columns: Columns,
    /// How the `simulate` command of a job of each set begins; then come its seed and [`Sets::command_end`]. None of
    /// measured slips.
    commands: Vec<String>,
    command_end: String,
    /// Histogram of τ of each set: numbers of bins of a width of the mean / 60, each followed by its count.
    histograms: Vec<Vec<u64>>,
    /// Swept parameters, that with the most values first, and whether their axes are logarithmic.
    swept: Vec<(String, bool)>,
    /// Places of the sets by their ids.
    #[serde(skip)]
    pub places: HashMap<String, usize>,
}

impl Sets {
    /// Every k-th of the sets in the reduced data, in the order of `show`.
    pub(super) fn read(
        layout: &Layout<'_>,
        sweep: &Sweep,
        spacing: u64,
    ) -> Result<Self, ResultsError> {
        let mut sets = Self {
            columns: Columns::of::<SetRow>(|_| true),
            command_end: sweep.command_end(),
            ..Self::default()
        };
        let mut shown = Vec::new();
        for (row, number) in read_sets(layout).zip(0_u64..) {
            let row = row?;
            if number.is_multiple_of(spacing) {
                shown.push(row);
            }
        }
        by_frequency(&mut shown, |row| &row.parameters);
        for (place, row) in shown.iter().enumerate() {
            let command = || sweep.command_of_set(&row.parameters);
            let is_computed = sweep.measured().is_none();
            sets.commands.extend(is_computed.then(command));
            sets.histograms.push(Vec::new());
            // With all digits, so that a condition holds for the same sets as on the command line.
            sets.columns.push(row, |cell| json!(cell));
            sets.places.insert(row.set_id.clone(), place);
        }
        sets.columns.label();
        for swept in &swept(&shown) {
            let name = swept.name().to_owned();
            sets.swept.push((name, swept.is_logarithmic()));
        }
        let file = layout.reduced_file(HistogramBin::NAME);
        for bin in Dataset::new(layout.storage, vec![file]).rows::<HistogramBin>() {
            let bin = bin?;
            if let Some(&place) = sets.places.get(&bin.set_id) {
                let number = floored((bin.low / (bin.high - bin.low)).round()) as u64;
                sets.histograms[place].extend([number, bin.count]);
            }
        }
        Ok(sets)
    }
}

pub(super) fn backbone(layout: &Layout<'_>) -> Result<Columns, ResultsError> {
    let mut columns = Columns::of::<BackboneBin>(|_| true);
    for bin in read_reduced::<BackboneBin>(layout)? {
        columns.push(&bin, rounded);
    }
    Ok(columns)
}

/// Slips up to which all are shown; of more, every k-th in table order. Each takes some 30 bytes of the page.
const MAX_SLIPS: u64 = 100_000;

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
        let mut slips = Self {
            every: total.div_ceil(MAX_SLIPS).max(1),
            // All columns would be twice as many bytes.
            columns: Columns::of::<Slip>(|column| !column.symbol.is_empty()),
            job: Vec::new(),
            jobs: Vec::new(),
        };
        let mut number = 0_u64;
        let mut last: Option<JobOfSlip> = None;
        let files = results
            .committed_files(RecordedTable::Slips, &results.dataset(RecordedTable::Jobs)?)?;
        for row in files.rows::<(JobOfSlip, Slip)>() {
            let (job, slip) = row?;
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
            slips.columns.push(&slip, rounded);
        }
        slips.columns.label();
        Ok(slips)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_number_has_five_digits_and_a_value_that_is_none_is_null() {
        assert_eq!(rounded(Value::Real(0.000_123_456_789)), 0.000_123_46);
        assert_eq!(rounded(Value::Real(1e-300)), 1e-300);
        assert_eq!(rounded(Value::Real(f64::INFINITY)), Json::Null);
    }

    #[test]
    fn slips_are_shown_by_few_columns() {
        let slips = Columns::of::<Slip>(|column| !column.symbol.is_empty());
        assert_eq!(slips.values.len(), 14);
    }

    #[test]
    fn no_more_sets_are_shown_than_a_page_bears() {
        for sets in [0, 1, MAX_SETS, MAX_SETS + 1, 1_000_003] {
            let census = Census {
                sets,
                ..Census::default()
            };
            assert!(sets.div_ceil(census.spacing()) <= MAX_SETS, "{sets}");
        }
    }
}
