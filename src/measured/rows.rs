//! Rows of slips or samples, column by column in SI: the same of CSV and of Arrow's columns, by their types.

use super::keys::{Given, Key, PURE, Sources};
use crate::observe::SampledSlip;
use anyhow::{Context, Result, bail, ensure};
use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Decimal32Type, Decimal64Type, Decimal128Type, Decimal256Type,
    DurationMicrosecondType, DurationMillisecondType, DurationNanosecondType, DurationSecondType,
    Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, TimeUnit};
use std::collections::{BTreeSet, HashMap};
use std::fmt::Display;

/// The rows of a table.
#[derive(Debug)]
pub struct Rows {
    /// Those that give a key, then the values for all rows.
    pub columns: Vec<KeyColumn>,
    /// Names of the other columns.
    pub unused: Vec<String>,
    /// The run of each row, by its place among the names; empty without runs.
    runs: Vec<u32>,
    run_names: HashMap<String, u32>,
    /// The line of each row of a text, counted from 1.
    lines: Vec<u64>,
    pub count: usize,
    /// Rows that were there and are forgotten.
    earlier: usize,
    /// Of the onsets that were found in a trace, in s; else empty.
    pub uncertainties: Vec<f64>,
}

/// The slips of a run of samples.
#[derive(Debug)]
pub struct RunOfSlips {
    pub name: Option<String>,
    /// Of all columns of the samples.
    pub values: Vec<f64>,
    /// When the record ended, in s.
    pub end: f64,
    pub slips: Vec<SampledSlip>,
}

/// A key of all rows.
#[derive(Debug)]
pub struct KeyColumn {
    pub given: Given,
    /// Its place in the table; `None` of one value for all rows.
    pub place: Option<usize>,
    /// In SI, NaN where one is missing; empty for runs.
    pub numbers: Vec<f64>,
}

impl Rows {
    /// No rows yet, of a table with columns of these names.
    pub fn new(names: &[String], sources: &Sources) -> Result<Self> {
        let chosen = sources.choose(names)?.into_iter();
        let chosen = chosen.map(|(given, place)| (given, Some(place)));
        let settings = sources.settings.iter().map(|set| (set.clone(), None));
        let columns = chosen.chain(settings).map(|(given, place)| KeyColumn {
            given,
            place,
            numbers: Vec::new(),
        });
        let columns: Vec<KeyColumn> = columns.collect();
        let is_unused = |place: &usize| columns.iter().all(|column| column.place != Some(*place));
        let unused = (0..names.len()).filter(is_unused);
        Ok(Self {
            unused: unused.map(|place| names[place].clone()).collect(),
            columns,
            runs: Vec::new(),
            run_names: HashMap::new(),
            lines: Vec::new(),
            count: 0,
            earlier: 0,
            uncertainties: Vec::new(),
        })
    }

    /// Forgets its rows, so that others can follow.
    pub fn clear(&mut self) {
        let columns = self.columns.iter_mut();
        columns.for_each(|column| column.numbers.clear());
        self.runs.clear();
        self.lines.clear();
        self.earlier += self.count;
        self.count = 0;
    }

    /// The slips of runs of these samples, which are forgotten: with drops in N, or in what the samples have.
    pub fn with_slips(
        mut self,
        runs: impl Iterator<Item = RunOfSlips>,
        is_force: bool,
    ) -> Result<Self> {
        self.clear();
        self.earlier = 0;
        let unit = if is_force { Key::Drop.unit() } else { PURE };
        let mut found = Vec::new();
        for (key, unit) in [
            (Key::Onset, None),
            (Key::End, None),
            (Key::Drop, Some(unit)),
            (Key::PeakForce, None),
        ] {
            found.push(KeyColumn {
                given: Given::new(key.word(), key.word(), unit)?,
                place: None,
                numbers: Vec::new(),
            });
        }
        for run in runs {
            for slip in run.slips {
                let peak_force = if is_force { slip.peak_force } else { f64::NAN };
                let numbers = [slip.onset, run.end, slip.drop, peak_force];
                let all = found.iter_mut().zip(numbers);
                let others = self.columns.iter_mut().zip(run.values.iter().copied());
                for (column, number) in all.chain(others) {
                    column.numbers.push(number);
                }
                run.name.iter().for_each(|name| self.push_run(name));
                self.uncertainties.push(slip.uncertainty);
                self.count += 1;
            }
        }
        self.columns
            .retain(|column| !column.given.key.is_of_trace());
        let is_run = |column: &&mut KeyColumn| column.given.key == Key::Run;
        self.columns
            .iter_mut()
            .filter(is_run)
            .for_each(|column| column.numbers.clear());
        self.columns.extend(found);
        Ok(self)
    }

    /// What a row says of its run in each column, NaN in others.
    pub fn values(&self, row: usize) -> Vec<f64> {
        let number = |column: &KeyColumn| {
            let number = column.numbers.get(row).copied();
            number
                .filter(|_| !column.given.key.is_of_row())
                .unwrap_or(f64::NAN)
        };
        self.columns.iter().map(number).collect()
    }

    /// The first row, and those of another run than that above them, or with other parameters; ascending.
    pub fn begins(&self) -> BTreeSet<usize> {
        let can_vary =
            |column: &&KeyColumn| column.place.is_some() && column.given.key.is_parameter();
        let columns = self.columns.iter().filter(can_vary);
        let columns = columns.map(|column| &*column.numbers);
        let of_numbers = columns.flat_map(|numbers| changes(numbers, |number| number.to_bits()));
        let of_runs = changes(&self.runs, |run| *run);
        let first = (0..self.count).take(1);
        first.chain(of_runs).chain(of_numbers).collect()
    }

    pub fn run_name(&self, row: usize) -> Option<String> {
        self.has_runs()
            .then(|| self.name_of(self.run(row)).to_owned())
    }

    /// Places of the columns that are read, in order.
    pub fn places(&self) -> Vec<usize> {
        let mut places: Vec<usize> = self
            .columns
            .iter()
            .filter_map(|column| column.place)
            .collect();
        places.sort_unstable();
        places
    }

    /// The numbers of a key; `None` if nothing gives it.
    pub fn of(&self, key: Key) -> Option<&[f64]> {
        let column = self.columns.iter().find(|column| column.given.key == key);
        column.map(|column| &*column.numbers)
    }

    /// The run of a row: equal numbers are one run.
    pub fn run(&self, row: usize) -> u32 {
        self.runs.get(row).copied().unwrap_or(0)
    }

    pub const fn has_runs(&self) -> bool {
        !self.runs.is_empty()
    }

    pub fn name_of(&self, run: u32) -> &str {
        let mut names = self.run_names.iter();
        let name = names.find_map(|(name, number)| (*number == run).then_some(&**name));
        name.unwrap_or_default()
    }

    /// Where a row stands, as messages say it.
    pub fn place(&self, row: usize) -> String {
        let line = self.lines.get(row);
        let row = self.earlier + row + 1;
        if self.uncertainties.is_empty() {
            line.map_or_else(|| format!("row {row}"), |line| format!("line {line}"))
        } else {
            format!("slip {row}")
        }
    }

    fn push_run(&mut self, name: &str) {
        let number = self.run_names.get(name).copied().unwrap_or_else(|| {
            let next = u32::try_from(self.run_names.len()).unwrap_or(u32::MAX);
            self.run_names.insert(name.to_owned(), next);
            next
        });
        self.runs.push(number);
    }

    /// Adds a row of a text.
    pub fn push_texts<'a>(
        &mut self,
        line: u64,
        text: impl Fn(usize) -> &'a str,
        number: impl Fn(&str) -> Result<f64>,
    ) -> Result<()> {
        let mut run = None;
        for KeyColumn {
            given,
            place,
            numbers,
        } in &mut self.columns
        {
            let Some(text) = place.map(&text) else {
                continue;
            };
            let key = given.key.word();
            if given.key == Key::Run {
                ensure!(!is_missing(text), "{key} is missing");
                run = Some(text);
            } else {
                let number = number(text).with_context(|| format!("{key} = {text}"))?;
                numbers.push(number * given.factor);
            }
        }
        if let Some(run) = run {
            self.push_run(run);
        }
        self.lines.push(line);
        self.count += 1;
        Ok(())
    }

    /// Adds the rows of a batch, which has the columns at [`Rows::places`] alone.
    pub fn push_batch(&mut self, batch: &RecordBatch) -> Result<()> {
        let mut runs = Vec::new();
        for (array, place) in batch.columns().iter().zip(self.places()) {
            let mut columns = self.columns.iter_mut();
            let column = columns.find(|column| column.place == Some(place));
            let KeyColumn { given, numbers, .. } = column.context("a batch has another column")?;
            let name = &given.from;
            let in_column = || format!("column {name} ({})", array.data_type());
            if given.key == Key::Run {
                runs = texts(array).with_context(in_column)?;
                continue;
            }
            let is_duration = matches!(array.data_type(), DataType::Duration(_));
            ensure!(
                !is_duration || given.unit == given.key.unit(),
                "column {name} is a duration, which knows its unit: leave {} out",
                given.unit
            );
            let found = reals(array, given.key).with_context(in_column)?;
            if let Some(row) = found.iter().position(|number| number.is_infinite()) {
                let row = self.earlier + self.count + row + 1;
                bail!("row {row}: column {name}: must be finite");
            }
            numbers.extend(found.into_iter().map(|number| number * given.factor));
        }
        for run in runs {
            self.push_run(&run);
        }
        self.count += batch.num_rows();
        Ok(())
    }

    /// All rows are there: values for all of them become columns.
    pub fn finish(&mut self) -> Result<()> {
        let rows = self.earlier + self.count;
        ensure!(
            rows > 0,
            "has no slips or samples below its names of columns"
        );
        for KeyColumn {
            given,
            place,
            numbers,
        } in &mut self.columns
        {
            if place.is_none() && given.key != Key::Run {
                let text = &given.from;
                let number = text.trim().parse().ok();
                let number = number.filter(|number: &f64| number.is_finite());
                let number = number
                    .with_context(|| format!("{} = {text}: must be a number", given.key.word()))?;
                numbers.resize(self.count, number * given.factor);
            }
        }
        Ok(())
    }
}

/// Places of values that differ from those before them.
fn changes<V, K: PartialEq>(values: &[V], key: impl Fn(&V) -> K) -> impl Iterator<Item = usize> {
    let pairs = values.windows(2).enumerate();
    let changed = pairs.filter(move |(_, pair)| key(&pair[0]) != key(&pair[1]));
    changed.map(|(before, _)| before + 1)
}

/// Whether a text says that there is no value: empty, or as pandas, R and people write it.
pub fn is_missing(text: &str) -> bool {
    ["", "-", "NA"].contains(&text) || text.eq_ignore_ascii_case("nan")
}

/// The numbers of an array, NaN where one is missing; durations in s.
fn reals(array: &dyn Array, key: Key) -> Result<Vec<f64>> {
    let was_set = !key.is_of_row();
    Ok(match array.data_type() {
        DataType::Int8 => converted::<Int8Type>(array, f64::from),
        DataType::Int16 => converted::<Int16Type>(array, f64::from),
        DataType::Int32 => converted::<Int32Type>(array, f64::from),
        DataType::Int64 => converted::<Int64Type>(array, |number| number as f64),
        DataType::UInt8 => converted::<UInt8Type>(array, f64::from),
        DataType::UInt16 => converted::<UInt16Type>(array, f64::from),
        DataType::UInt32 => converted::<UInt32Type>(array, f64::from),
        DataType::UInt64 => converted::<UInt64Type>(array, |number| number as f64),
        DataType::Float16 if was_set => converted::<Float16Type>(array, |half| {
            as_written(half.to_f64(), |real| Half::from_f64(real) == half)
        }),
        DataType::Float16 => converted::<Float16Type>(array, Half::to_f64),
        DataType::Float32 if was_set => converted::<Float32Type>(array, |single| {
            #[expect(clippy::cast_possible_truncation, reason = "that is the question")]
            as_written(f64::from(single), |real| real as f32 == single)
        }),
        DataType::Float32 => converted::<Float32Type>(array, f64::from),
        DataType::Float64 => converted::<Float64Type>(array, |number| number),
        DataType::Decimal32(_, scale) => decimals::<Decimal32Type>(array, *scale),
        DataType::Decimal64(_, scale) => decimals::<Decimal64Type>(array, *scale),
        DataType::Decimal128(_, scale) => decimals::<Decimal128Type>(array, *scale),
        DataType::Decimal256(_, scale) => decimals::<Decimal256Type>(array, *scale),
        DataType::Duration(unit) if key.unit() == Key::Onset.unit() => match unit {
            TimeUnit::Second => converted::<DurationSecondType>(array, |ticks| ticks as f64),
            TimeUnit::Millisecond => {
                converted::<DurationMillisecondType>(array, |ticks| ticks as f64 / 1e3)
            }
            TimeUnit::Microsecond => {
                converted::<DurationMicrosecondType>(array, |ticks| ticks as f64 / 1e6)
            }
            TimeUnit::Nanosecond => {
                converted::<DurationNanosecondType>(array, |ticks| ticks as f64 / 1e9)
            }
        },
        _ => bail!("must be integers, floats or decimals, or durations for times"),
    })
}

type Half = <Float16Type as ArrowPrimitiveType>::Native;

fn converted<T: ArrowPrimitiveType>(
    array: &dyn Array,
    real: impl Fn(T::Native) -> f64,
) -> Vec<f64> {
    let array = array.as_primitive::<T>();
    if array.null_count() == 0 {
        return array.values().iter().copied().map(real).collect();
    }
    let values = array.iter();
    values.map(|value| value.map_or(f64::NAN, &real)).collect()
}

fn decimals<T: ArrowPrimitiveType<Native: Display>>(array: &dyn Array, scale: i8) -> Vec<f64> {
    let exponent = -i32::from(scale);
    converted::<T>(array, |digits| {
        format!("{digits}e{exponent}").parse().unwrap_or(f64::NAN)
    })
}

/// The number of fewest digits that is the same in fewer bits: what somebody wrote before it was rounded to them.
fn as_written(exact: f64, is_same: impl Fn(f64) -> bool) -> f64 {
    let mut shorter = (0..9).filter_map(|digits| format!("{exact:.digits$e}").parse().ok());
    shorter.find(|real| is_same(*real)).unwrap_or(exact)
}

/// The names of runs.
fn texts(array: &dyn Array) -> Result<Vec<String>> {
    let own = |text: Option<&str>| text.map(str::to_owned);
    let names: Vec<Option<String>> = match array.data_type() {
        DataType::Utf8 => array.as_string::<i32>().iter().map(own).collect(),
        DataType::LargeUtf8 => array.as_string::<i64>().iter().map(own).collect(),
        DataType::Utf8View => array.as_string_view().iter().map(own).collect(),
        DataType::Dictionary(..) => {
            let dictionary = array.as_any_dictionary();
            let names = texts(dictionary.values())?;
            let keys = dictionary.normalized_keys().into_iter().enumerate();
            let name =
                |(row, key): (usize, usize)| dictionary.is_valid(row).then(|| names[key].clone());
            keys.map(name).collect()
        }
        DataType::Int64 => {
            let numbers = array.as_primitive::<Int64Type>().iter();
            numbers
                .map(|number| number.map(|number| number.to_string()))
                .collect()
        }
        _ => {
            let numbers = reals(array, Key::Run).context("must be texts or numbers")?;
            let name = |number: &f64| (!number.is_nan()).then(|| number.to_string());
            numbers.iter().map(name).collect()
        }
    };
    let known = |name: Option<String>| {
        name.filter(|name| !name.is_empty())
            .context("run is missing")
    };
    names.into_iter().map(known).collect()
}
