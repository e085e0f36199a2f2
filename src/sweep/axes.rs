//! Axes: rows of values that move together, and the look-up of a row by the parameters that it leads to.
//!
//! A grid axis has one column, a zip or a sample several. The points of a sweep are all combinations of one row of each
//! axis. Contract: no two rows of an axis are equal, and the values of a column that differ are no twins (`twins.rs`), so
//! that two points lead to the same parameters only where both are without modulation and differ in nothing but what fixes
//! the period. Of such points the first counts: the row that [`Axis::is_first`].

use super::quantity::{Point, Quantity};
use crate::model::{Parameters, Symbol, Value};
use std::cmp::Ordering;

/// Most rows of an axis whose rows are held in memory.
pub(super) const MAX_ROWS: u64 = 1_000_000;

/// A column of an axis. Values are checked and canonical.
#[derive(Clone, Debug)]
pub(super) struct Column {
    pub quantity: Quantity,
    pub values: Vec<Value>,
}

/// An axis of a sweep. Has at least one row.
#[derive(Clone, Debug)]
pub(super) enum Axis {
    /// The whole numbers from `first` on.
    Counted {
        symbol: Symbol,
        first: u64,
        count: u64,
    },
    Table(Table),
}

/// Listed rows and their order for look-up.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub columns: Vec<Column>,
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
    pub fn table(columns: Vec<Column>) -> Result<Self, Repeated> {
        let period = columns.iter().find(|column| column.quantity.is_period());
        let ranks = |row: u32| {
            let others = but_seed(&columns).chain(columns.iter().filter(|column| column.is_seed()));
            let others: Vec<Value> = others.map(|column| column.values[row as usize]).collect();
            (others, period.map(|period| period.rank(row)), row)
        };
        let mut ranked: Vec<_> = (0..).take(columns[0].values.len()).map(ranks).collect();
        ranked.sort_unstable_by(|left, right| left.partial_cmp(right).unwrap_or(Ordering::Equal));
        let mut is_first = vec![false; ranked.len()];
        let mut repeated: Vec<(u32, u32)> = Vec::new();
        for group in ranked.chunk_by(|(left, ..), (right, ..)| left == right) {
            let rows = group.iter().map(|&(.., row)| row);
            is_first[rows.clone().min().unwrap_or_default() as usize] = true;
            let value = |row: u32| period.map(|period| period.values[row as usize]);
            let neighbours = rows.clone().zip(rows.skip(1));
            let same = neighbours.filter(|&(a, b)| value(a) == value(b));
            repeated.extend(same.map(|(a, b)| (a.max(b), a.min(b))));
        }
        if let Some((later, earlier)) = repeated.into_iter().min() {
            return Err(Repeated {
                earlier: earlier as usize,
                later: later as usize,
            });
        }
        Ok(Self::Table(Table {
            columns,
            sorted: ranked.into_iter().map(|(.., row)| row).collect(),
            is_first,
        }))
    }

    pub fn quantities(&self) -> Vec<Quantity> {
        match self {
            Self::Counted { symbol, .. } => vec![Quantity::Parameter(*symbol)],
            Self::Table(table) => table.columns.iter().map(|column| column.quantity).collect(),
        }
    }

    pub fn len(&self) -> u64 {
        match self {
            Self::Counted { count, .. } => *count,
            Self::Table(table) => table.sorted.len() as u64,
        }
    }

    /// Moves a point to a row.
    pub fn apply(&self, row: u64, point: &mut Point) {
        match self {
            Self::Counted { symbol, first, .. } => {
                point.set(Quantity::Parameter(*symbol), Value::Count(first + row));
            }
            Self::Table(table) => {
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
            Self::Table(table) => table.is_first[index(row)],
        }
    }

    /// The values of a quantity that it moves by a list.
    pub fn values_of(&self, quantity: Quantity) -> Option<&[Value]> {
        let Self::Table(table) = self else {
            return None;
        };
        let mut columns = table.columns.iter();
        let column = columns.find(|column| column.quantity == quantity)?;
        Some(&column.values)
    }

    /// The seeds of the rows that can lead to these parameters but for the seed; `None` if it does not move the seed.
    pub fn seeds<'a>(
        &'a self,
        wanted: &'a Parameters,
    ) -> Option<Box<dyn Iterator<Item = u64> + 'a>> {
        let table = match self {
            Self::Counted {
                symbol,
                first,
                count,
            } => {
                let seeds = *first..first + count;
                return (*symbol == Symbol::Seed)
                    .then(|| Box::new(seeds) as Box<dyn Iterator<Item = u64>>);
            }
            Self::Table(table) => table,
        };
        let seeds = table.columns.iter().find(|column| column.is_seed())?;
        let order = move |row: &u32| table.compare_but_seed(*row, wanted);
        let begin = table.sorted.partition_point(|row| order(row).is_lt());
        let found = table.sorted[begin..].iter();
        let found = found.take_while(move |row| order(row).is_eq());
        let seed = |row: &u32| match seeds.values[*row as usize] {
            Value::Count(seed) => Some(seed),
            _ => None,
        };
        Some(Box::new(found.filter_map(seed)))
    }

    /// The only row that can lead to these parameters; without modulation the first of those that differ in the period alone.
    pub fn find(&self, wanted: &Parameters) -> Option<u64> {
        match self {
            Self::Counted {
                symbol,
                first,
                count,
            } => match wanted.get(*symbol) {
                Value::Count(value) => value.checked_sub(*first).filter(|row| row < count),
                _ => None,
            },
            Self::Table(table) => {
                let order = |row: &u32| table.compare(*row, wanted);
                let begin = table.sorted.partition_point(|row| order(row).is_lt());
                let found = table.sorted[begin..].iter();
                let mut found = found.take_while(|row| order(row).is_eq());
                let is_modulated = wanted.modulation_period.is_some();
                let row = found.find(|row| is_modulated || table.is_first[**row as usize]);
                row.map(|&row| u64::from(row))
            }
        }
    }
}

/// The columns that fix neither the seed nor the period.
fn but_seed(columns: &[Column]) -> impl Iterator<Item = &Column> {
    let columns = columns.iter();
    columns.filter(|column| !column.is_seed() && !column.quantity.is_period())
}

impl Table {
    /// Where a row stands among the sorted rows, compared with a row that leads to these parameters.
    fn compare(&self, row: u32, wanted: &Parameters) -> Ordering {
        let seed = self.columns.iter().find(|column| column.is_seed());
        let mut columns = self.columns.iter();
        let period = columns.find(|column| column.quantity.is_period());
        let of = |column: &Column| column.compare(row, wanted);
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

impl Column {
    /// Orders the rows as [`Column::compare`] does: a larger η or frequency is a shorter period.
    fn rank(&self, row: u32) -> Value {
        match self.values[row as usize] {
            Value::Real(real) if self.is_inverse_period() => Value::Real(-real),
            value => value,
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

    fn is_inverse_period(&self) -> bool {
        matches!(self.quantity, Quantity::Eta | Quantity::Frequency)
    }
}

/// Rows of a table fit in 32 bits, so in an index.
#[expect(clippy::cast_possible_truncation, reason = "at most MAX_ROWS")]
const fn index(row: u64) -> usize {
    row as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(key: &str, values: &[f64]) -> Column {
        let quantity = Quantity::from_key(key).unwrap();
        let checked = |&value: &f64| quantity.checked(Value::Real(value)).unwrap();
        Column {
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
}
