//! Axes: rows of values that move together, and the look-up of a row by the parameters that it leads to.
//!
//! A grid axis has one column, a zip or a sample several. The points of a sweep are all combinations of one row of each
//! axis. Contract: no two rows of an axis are equal, and the values of a column that differ are no twins (`checks.rs`),
//! so that two points lead to the same parameters only where both are without modulation and differ in nothing but what
//! fixes the period. Of such points the first counts: the row that [`Axis::is_first`].
//!
//! The values of a range are evenly spaced, or fill it together with the ranges of other quantities: Sobol points,
//! Owen-scrambled (B. Burley, JCGT 9(4), 2020; crate `sobol_burley`). The first points of a longer sample are those of
//! a shorter one. Logarithms and exponentials come from `libm`: the same bits on every machine.

use super::quantity::{GridPoint, Quantity};
use crate::model::theory::to_twelve_digits;
use crate::model::{Parameters, Symbol, Value};
use crate::table::value::Field as _;
use std::cmp::Ordering;

/// Most rows of an axis whose rows are held in memory.
pub(super) const MAX_ROWS: u64 = 1_000_000;

/// A column of an axis. Values are checked and canonical.
#[derive(Clone, Debug)]
pub(super) struct AxisColumn {
    pub quantity: Quantity,
    pub values: Vec<Value>,
}

/// An axis of a sweep. Has at least one row.
#[derive(Clone, Debug)]
pub(super) enum Axis {
    /// Whole numbers, one after the other.
    Counted {
        symbol: Symbol,
        values: std::ops::Range<u64>,
    },
    ListedRows(ListedRows),
}

/// Listed rows and their order for look-up.
#[derive(Clone, Debug)]
pub(super) struct ListedRows {
    pub columns: Vec<AxisColumn>,
    /// Rows in the order of the parameters that they lead to, the seed and then the period last.
    sorted: Vec<u32>,
    /// For each row, whether no earlier one equals it in all but what fixes the period.
    is_first: Vec<bool>,
}

/// Two rows of an axis that are the same. Counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Repeated {
    pub earlier: usize,
    pub later: usize,
}

impl Axis {
    /// An axis of columns of equal length, 1 to [`MAX_ROWS`].
    pub fn table(columns: Vec<AxisColumn>) -> Result<Self, Repeated> {
        let period = columns.iter().find(|column| column.quantity.is_period());
        let ranks = |row: u32| {
            let others = but_seed(&columns).chain(columns.iter().filter(|column| column.is_seed()));
            let values: Vec<Value> = others.map(|column| column.values[row as usize]).collect();
            (values, period.map(|period| period.rank(row)), row)
        };
        let mut ranked: Vec<_> = (0..).take(columns[0].values.len()).map(ranks).collect();
        ranked.sort_unstable_by(|left, right| left.partial_cmp(right).unwrap_or(Ordering::Equal));
        let mut is_first = vec![false; ranked.len()];
        let mut repeated: Vec<(usize, usize)> = Vec::new();
        for group in ranked.chunk_by(|(left, ..), (right, ..)| left == right) {
            let rows = group.iter().map(|&(.., row)| row);
            is_first[rows.clone().min().unwrap_or_default() as usize] = true;
            let value = |row: u32| period.map(|period| period.values[row as usize]);
            let neighbours = rows.clone().zip(rows.skip(1));
            let same = neighbours.filter(|&(a, b)| value(a) == value(b));
            repeated.extend(same.map(|(a, b)| (a.max(b) as usize, a.min(b) as usize)));
        }
        if let Some((later, earlier)) = repeated.into_iter().min() {
            return Err(Repeated { earlier, later });
        }
        Ok(Self::ListedRows(ListedRows {
            columns,
            sorted: ranked.into_iter().map(|(.., row)| row).collect(),
            is_first,
        }))
    }

    pub fn quantities(&self) -> Vec<Quantity> {
        match self {
            Self::Counted { symbol, .. } => vec![Quantity::Parameter(*symbol)],
            Self::ListedRows(table) => table.columns.iter().map(|column| column.quantity).collect(),
        }
    }

    pub fn len(&self) -> u64 {
        match self {
            Self::Counted { values, .. } => values.end - values.start,
            Self::ListedRows(table) => table.sorted.len() as u64,
        }
    }

    pub fn apply(&self, row: u64, point: &mut GridPoint) {
        match self {
            Self::Counted { symbol, values } => {
                let value = Value::Count(values.start + row);
                point.set(Quantity::Parameter(*symbol), value);
            }
            Self::ListedRows(table) => {
                for column in &table.columns {
                    point.set(column.quantity, column.values[index(row)]);
                }
            }
        }
    }

    /// Whether no earlier row equals this one in all but the column that fixes the period.
    pub fn is_first(&self, row: u64) -> bool {
        match self {
            Self::Counted { .. } => true,
            Self::ListedRows(table) => table.is_first[index(row)],
        }
    }

    /// The values of a quantity that it moves by a list.
    pub fn values_of(&self, quantity: Quantity) -> Option<&[Value]> {
        let Self::ListedRows(table) = self else {
            return None;
        };
        let mut columns = table.columns.iter();
        let column = columns.find(|column| column.quantity == quantity)?;
        Some(&column.values)
    }

    /// The first seeds, `most` at most, of the rows that can lead to these parameters but for the seed; `None` if it
    /// does not move the seed.
    pub fn seeds(&self, wanted: &Parameters, most: usize) -> Option<Vec<u64>> {
        let table = match self {
            Self::Counted { symbol, values } => {
                return (*symbol == Symbol::Seed).then(|| values.clone().take(most).collect());
            }
            Self::ListedRows(table) => table,
        };
        let seeds = table.columns.iter().find(|column| column.is_seed())?;
        let order = |row: &u32| table.compare_but_seed(*row, wanted);
        let begin = table.sorted.partition_point(|row| order(row).is_lt());
        let rest = table.sorted[begin..].iter();
        let found = rest.take_while(|row| order(row).is_eq());
        let mut columns = table.columns.iter();
        let period = columns.find(|column| column.quantity.is_period());
        let of_period =
            found.filter(|row| period.is_none_or(|of| of.compare(**row, wanted).is_eq()));
        let seed = |row: &u32| u64::from_value(seeds.values[*row as usize]);
        Some(of_period.filter_map(seed).take(most).collect())
    }

    /// The only row that can lead to these parameters; without modulation the first of those that differ in the period
    /// alone.
    pub fn find(&self, wanted: &Parameters) -> Option<u64> {
        match self {
            Self::Counted { symbol, values } => match wanted.get(*symbol) {
                Value::Count(value) if values.contains(&value) => Some(value - values.start),
                _ => None,
            },
            Self::ListedRows(table) => {
                let order = |row: &u32| table.compare(*row, wanted);
                let begin = table.sorted.partition_point(|row| order(row).is_lt());
                let rest = table.sorted[begin..].iter();
                let mut found = rest.take_while(|row| order(row).is_eq());
                let is_modulated = wanted.modulation_period.is_some();
                let row = found.find(|row| is_modulated || table.is_first[**row as usize]);
                row.map(|&row| u64::from(row))
            }
        }
    }
}

/// The columns that fix neither the seed nor the period.
fn but_seed(columns: &[AxisColumn]) -> impl Iterator<Item = &AxisColumn> {
    columns
        .iter()
        .filter(|column| !column.is_seed() && !column.quantity.is_period())
}

impl ListedRows {
    /// Where a row stands among the sorted rows, compared with a row that leads to these parameters.
    fn compare(&self, row: u32, wanted: &Parameters) -> Ordering {
        let seed = self.columns.iter().find(|column| column.is_seed());
        let mut columns = self.columns.iter();
        let period = columns.find(|column| column.quantity.is_period());
        let of = |column: &AxisColumn| column.compare(row, wanted);
        self.compare_but_seed(row, wanted)
            .then_with(|| seed.map_or(Ordering::Equal, of))
            .then_with(|| period.map_or(Ordering::Equal, of))
    }

    /// The same without seed and period.
    fn compare_but_seed(&self, row: u32, wanted: &Parameters) -> Ordering {
        let mut orders = but_seed(&self.columns).map(|column| column.compare(row, wanted));
        let order = orders.find(|order| order.is_ne());
        order.unwrap_or(Ordering::Equal)
    }
}

impl AxisColumn {
    /// Orders the rows as [`AxisColumn::compare`] does: a larger η or frequency is a shorter period.
    fn rank(&self, row: u32) -> Value {
        match (self.quantity, self.values[row as usize]) {
            (Quantity::Eta | Quantity::Frequency, Value::Real(real)) => Value::Real(-real),
            (_, value) => value,
        }
    }

    /// Compares what a row leads to with these parameters; without modulation every period will do.
    fn compare(&self, row: u32, wanted: &Parameters) -> Ordering {
        let value = self.values[row as usize];
        match self.quantity {
            Quantity::Parameter(symbol) if symbol != Symbol::T => value
                .partial_cmp(&wanted.get(symbol))
                .unwrap_or(Ordering::Equal),
            quantity => match (value.number(), wanted.modulation_period) {
                (Some(number), Some(period)) => quantity.period(number, wanted).total_cmp(&period),
                _ => Ordering::Equal,
            },
        }
    }

    fn is_seed(&self) -> bool {
        self.quantity == Quantity::SEED
    }
}

/// Rows of a table fit in 32 bits, so in an index.
#[expect(clippy::cast_possible_truncation, reason = "at most MAX_ROWS")]
const fn index(row: u64) -> usize {
    row as usize
}

/// Length of the Sobol sequence.
pub(super) const MAX_SAMPLE: u64 = 1 << 16;

/// A range of a quantity, low < high.
#[derive(Clone, Copy, Debug)]
pub(super) struct AxisRange {
    pub low: f64,
    pub high: f64,
    /// Even in the logarithm; both ends are > 0.
    pub logarithmic: bool,
    /// Whether the quantity takes whole numbers only.
    pub whole: bool,
}

impl AxisRange {
    /// The value at a fraction of the way, 0 to 1, rounded: 1e-4 as people write it, not what a logarithm makes of it.
    /// The ends are exact.
    pub fn at(&self, fraction: f64) -> f64 {
        if fraction <= 0.0 {
            return self.low;
        }
        if fraction >= 1.0 {
            return self.high;
        }
        let value = if self.logarithmic {
            let low = libm::log(self.low);
            let high = libm::log(self.high);
            libm::exp(low + (high - low) * fraction)
        } else {
            // Two terms: the difference of the ends may overflow.
            self.low * (1.0 - fraction) + self.high * fraction
        };
        let rounded = if self.whole {
            value.round()
        } else {
            to_twelve_digits(value)
        };
        rounded.clamp(self.low, self.high)
    }

    /// Evenly spaced values, ends included. At least two.
    pub fn spaced(&self, points: u64) -> impl Iterator<Item = f64> {
        let last = (points - 1) as f64;
        (0..points).map(move |point| self.at(point as f64 / last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(key: &str, values: &[f64]) -> AxisColumn {
        let quantity = Quantity::from_key(key).unwrap();
        let checked = |&value: &f64| quantity.checked(Value::Real(value)).unwrap();
        AxisColumn {
            quantity,
            values: values.iter().map(checked).collect(),
        }
    }

    #[test]
    fn equal_rows_are_found_and_named_in_order() {
        let repeated = Axis::table(vec![column("V0", &[3.0, 1.0, 2.0, 1.0])]).unwrap_err();
        assert_eq!(
            repeated,
            Repeated {
                earlier: 1,
                later: 3
            }
        );
        let zip = |periods: &[f64]| {
            Axis::table(vec![
                column("Delta", &[0.0, 0.0, 1.0]),
                column("T", periods),
            ])
        };
        assert!(zip(&[1.0, 1.0, 1.0]).is_err());
        assert!(zip(&[1.0, 2.0, 1.0]).is_ok());
    }

    #[test]
    fn without_modulation_the_first_row_of_a_group_counts() {
        let axis = Axis::table(vec![
            column("dfs", &[0.0, 0.1, 0.0, 0.1]),
            column("T", &[4.0, 3.0, 2.0, 1.0]),
        ])
        .unwrap();
        assert_eq!(
            (0..4).map(|row| axis.is_first(row)).collect::<Vec<_>>(),
            [true, true, false, false]
        );
        let wanted = Parameters {
            threshold_deviation: 0.1,
            ..Parameters::default()
        };
        assert_eq!(axis.find(&wanted), Some(1));
    }

    #[test]
    fn the_seeds_of_a_row_are_those_of_its_period() {
        let axis = Axis::table(vec![
            column("seed", &[0.0, 1.0, 2.0, 3.0]),
            column("Delta", &[1e-6; 4]),
            column("T", &[0.1, 0.1, 0.2, 0.2]),
        ]);
        let wanted = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.2),
            ..Parameters::default()
        };
        assert_eq!(axis.unwrap().seeds(&wanted, 9), Some(vec![2, 3]));
    }

    #[test]
    fn the_ends_of_a_range_are_exact_and_its_steps_even() {
        for logarithmic in [false, true] {
            let range = AxisRange {
                low: 3e-7,
                high: 1e-4,
                logarithmic,
                whole: false,
            };
            let values: Vec<f64> = range.spaced(7).collect();
            assert_eq!((values[0], values[6]), (3e-7, 1e-4));
            for pair in values.windows(3) {
                let even = if logarithmic {
                    pair[1] * pair[1] / (pair[0] * pair[2])
                } else {
                    2.0 * pair[1] / (pair[0] + pair[2])
                };
                // Each value is rounded by 5e-12 of itself at most.
                assert!((even - 1.0).abs() < 2e-11, "{values:?}");
            }
        }
        let ends = (1.234_567_890_123_456_7, 9.876_543_210_987_654);
        let long = AxisRange {
            low: ends.0,
            high: ends.1,
            logarithmic: true,
            whole: false,
        };
        assert_eq!(
            (long.at(0.0), long.at(1.0), long.at(1e-15)),
            (ends.0, ends.1, ends.0)
        );
        let widest = AxisRange {
            low: -f64::MAX,
            high: f64::MAX,
            logarithmic: false,
            whole: false,
        };
        assert_eq!(widest.at(0.5), 0.0);
    }
}
