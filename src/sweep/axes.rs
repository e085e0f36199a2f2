//! Axes: rows of values that move together, and the look-up of a row by the parameters that it leads to.
//!
//! A grid axis has one column, a zip or a sample several. The points of a sweep are all combinations of one row of each
//! axis. Contract: no two rows of an axis are equal, and rows that differ in η or the frequency alone differ by more
//! than [`LEAST_GAP`], so that two points lead to the same parameters only where both are without modulation and differ
//! in nothing but what fixes the period. Of such points the first counts: the row that [`Axis::is_first`].

use super::quantity::{Point, Quantity, period_quantity};
use crate::model::{BreakOn, Parameters, Symbol, Value};
use std::cmp::Ordering;

/// Most rows of an axis whose rows are held in memory.
pub(super) const MOST_ROWS: u64 = 1_000_000;
/// Least relative distance of two values of η or of the frequency: a thousand roundings, so that the periods differ.
const LEAST_GAP: f64 = 1e-12;
/// Relative error of a value of η or of the frequency that is computed back from the period: some ten roundings.
const LOOK_UP_TOLERANCE: f64 = 1e-14;

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
    Counted { symbol: Symbol, first: u64, count: u64 },
    /// Listed rows.
    Table(Table),
}

/// Listed rows and their order for look-up.
#[derive(Clone, Debug)]
pub(super) struct Table {
    columns: Vec<Column>,
    /// The column that fixes the period.
    period: Option<usize>,
    /// Rows ordered by the bits of the other columns, then by the period's.
    sorted: Vec<u32>,
    /// For each row the first that differs in the period's column alone; empty without such a column.
    first: Vec<u32>,
}

/// Two rows of an axis that are the same, or too close to lead to different periods. Counted from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Repeated {
    pub earlier: usize,
    pub later: usize,
}

impl Axis {
    /// An axis of columns of equal length, 1 to [`MOST_ROWS`].
    pub fn table(columns: Vec<Column>) -> Result<Self, Repeated> {
        Table::new(columns).map(Self::Table)
    }

    pub fn quantities(&self) -> Vec<Quantity> {
        match self {
            Self::Counted { symbol, .. } => vec![Quantity::Parameter(*symbol)],
            Self::Table(table) => table.columns.iter().map(|column| column.quantity).collect(),
        }
    }

    /// Number of rows.
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
            Self::Table(table) if table.period.is_some() => u64::from(table.first[index(row)]) == row,
            _ => true,
        }
    }

    /// The only row that can lead to these parameters.
    pub fn find(&self, wanted: &Parameters) -> Option<u64> {
        match self {
            Self::Counted { symbol, first, count } => match wanted.get(*symbol) {
                Value::Count(value) => value.checked_sub(*first).filter(|row| row < count),
                _ => None,
            },
            Self::Table(table) => table.find(wanted).map(u64::from),
        }
    }

    /// The values of a quantity on this axis, as numbers; empty if it is not there or a word.
    pub fn numbers(&self, quantity: Quantity) -> Vec<f64> {
        match self {
            Self::Counted { symbol, first, count } if Quantity::Parameter(*symbol) == quantity => {
                vec![*first as f64, (first + count - 1) as f64]
            }
            Self::Counted { .. } => Vec::new(),
            Self::Table(table) => {
                let column = table.columns.iter().find(|column| column.quantity == quantity);
                column.map_or_else(Vec::new, |column| column.values.iter().filter_map(number).collect())
            }
        }
    }
}

impl Table {
    fn new(columns: Vec<Column>) -> Result<Self, Repeated> {
        let rows = columns[0].values.len();
        let period = columns.iter().position(|column| column.quantity.is_period());
        let mut table = Self { columns, period, sorted: Vec::new(), first: Vec::new() };
        let mut sorted: Vec<u32> = (0..).take(rows).collect();
        sorted.sort_unstable_by(|&a, &b| {
            let period = |row| table.period_value(row).unwrap_or(0.0);
            table.compare_others(a, b).then(period(a).total_cmp(&period(b))).then(a.cmp(&b))
        });
        let repeated = sorted.windows(2).filter(|pair| table.coincide(pair[0], pair[1]));
        let repeated = repeated.map(|pair| (pair[0].max(pair[1]), pair[0].min(pair[1])));
        if let Some((later, earlier)) = repeated.min() {
            return Err(Repeated { earlier: earlier as usize, later: later as usize });
        }
        if period.is_some() {
            let mut first = vec![0; rows];
            for group in sorted.chunk_by(|&a, &b| table.compare_others(a, b).is_eq()) {
                let least = group.iter().copied().min().unwrap_or_default();
                for &row in group {
                    first[row as usize] = least;
                }
            }
            table.first = first;
        }
        table.sorted = sorted;
        Ok(table)
    }

    /// The columns that do not fix the period.
    fn others(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().filter(|column| !column.quantity.is_period())
    }

    fn compare_others(&self, a: u32, b: u32) -> Ordering {
        self.others()
            .map(|column| bits(column.values[a as usize]).cmp(&bits(column.values[b as usize])))
            .find(|ordering| ordering.is_ne())
            .unwrap_or(Ordering::Equal)
    }

    fn compare_others_to(&self, row: u32, wanted: &Parameters) -> Ordering {
        self.others()
            .map(|column| match column.quantity {
                Quantity::Parameter(symbol) => bits(column.values[row as usize]).cmp(&bits(wanted.get(symbol))),
                Quantity::Eta | Quantity::Frequency => Ordering::Equal,
            })
            .find(|ordering| ordering.is_ne())
            .unwrap_or(Ordering::Equal)
    }

    fn period_value(&self, row: u32) -> Option<f64> {
        self.period.and_then(|column| number(&self.columns[column].values[row as usize]))
    }

    /// Whether two neighbours in order are too close.
    fn coincide(&self, a: u32, b: u32) -> bool {
        if self.compare_others(a, b).is_ne() {
            return false;
        }
        match (self.period_value(a), self.period_value(b)) {
            (Some(low), Some(high)) => {
                let gap = if self.period_is_derived() { LEAST_GAP } else { 0.0 };
                high <= low * (1.0 + gap)
            }
            _ => true,
        }
    }

    fn period_is_derived(&self) -> bool {
        self.columns.iter().any(|column| matches!(column.quantity, Quantity::Eta | Quantity::Frequency))
    }

    fn find(&self, wanted: &Parameters) -> Option<u32> {
        let start = self.sorted.partition_point(|&row| self.compare_others_to(row, wanted).is_lt());
        let found = *self.sorted.get(start).filter(|&&row| self.compare_others_to(row, wanted).is_eq())?;
        let Some(column) = self.period else { return Some(found) };
        let Some(period) = wanted.modulation_period else { return Some(self.first[found as usize]) };
        let value = period_quantity(self.columns[column].quantity, wanted, period);
        let tolerance = if self.period_is_derived() { LOOK_UP_TOLERANCE } else { 0.0 };
        let [low, high] = [value * (1.0 - tolerance), value * (1.0 + tolerance)];
        let position = self.sorted.partition_point(|&row| {
            let below = self.period_value(row).is_some_and(|value| value < low);
            self.compare_others_to(row, wanted).is_lt() || (self.compare_others_to(row, wanted).is_eq() && below)
        });
        let row = *self.sorted.get(position)?;
        let near = self.period_value(row).is_some_and(|value| value <= high);
        (near && self.compare_others_to(row, wanted).is_eq()).then_some(row)
    }
}

/// Rows of a table fit in 32 bits, so in an index.
#[expect(clippy::cast_possible_truncation, reason = "at most MOST_ROWS")]
const fn index(row: u64) -> usize {
    row as usize
}

/// Bits by which canonical values of one quantity are told apart.
fn bits(value: Value) -> u64 {
    match value {
        Value::Count(count) => count,
        Value::Real(real) => real.to_bits(),
        Value::BreakOn(rule) => u64::from(rule == BreakOn::Tension),
        Value::Absent => u64::MAX,
    }
}

fn number(value: &Value) -> Option<f64> {
    match *value {
        Value::Count(count) => Some(count as f64),
        Value::Real(real) => Some(real),
        Value::BreakOn(_) | Value::Absent => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(key: &str, values: &[f64]) -> Column {
        let quantity = Quantity::from_key(key).unwrap();
        let checked = |&value: &f64| quantity.checked(Value::Real(value)).unwrap();
        Column { quantity, values: values.iter().map(checked).collect() }
    }

    #[test]
    fn equal_rows_are_found_and_named_in_order() {
        let repeated = Axis::table(vec![column("V0", &[3.0, 1.0, 2.0, 1.0])]).unwrap_err();
        assert_eq!(repeated, Repeated { earlier: 1, later: 3 });
        let zip = |periods: &[f64]| Axis::table(vec![column("Delta", &[0.0, 0.0, 1.0]), column("T", periods)]);
        assert!(zip(&[1.0, 1.0, 1.0]).is_err());
        assert!(zip(&[1.0, 2.0, 1.0]).is_ok());
    }

    #[test]
    fn values_of_eta_that_could_give_one_period_are_refused() {
        assert!(Axis::table(vec![column("eta", &[1.0, 1.0 + 1e-13])]).is_err());
        assert!(Axis::table(vec![column("eta", &[1.0, 1.0 + 1e-11])]).is_ok());
        assert!(Axis::table(vec![column("T", &[1.0, 1.0 + f64::EPSILON])]).is_ok());
    }

    #[test]
    fn without_modulation_the_first_row_of_a_group_counts() {
        let axis = Axis::table(vec![column("dfs", &[0.0, 0.1, 0.0, 0.1]), column("T", &[4.0, 3.0, 2.0, 1.0])]).unwrap();
        assert_eq!((0..4).map(|row| axis.is_first(row)).collect::<Vec<_>>(), [true, true, false, false]);
        let wanted = Parameters { threshold_deviation: 0.1, ..Parameters::default() };
        assert_eq!(axis.find(&wanted), Some(1));
    }
}
