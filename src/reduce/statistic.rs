//! What a sweep file asks of a set: a statistic by its name, and how far its interval is from the target.

use super::set::SetRow;
use crate::sweep::{Precision, Target};
use crate::table::columns::{Row, Value};

/// What a column of a set holds.
#[derive(Clone, Debug, PartialEq)]
pub enum StatisticValue {
    /// A quantity or a count.
    Number(f64),
    /// A flag or a word.
    Class(String),
    Nothing,
}

impl StatisticValue {
    const fn number(&self) -> Option<f64> {
        if let Self::Number(number) = self { Some(*number) } else { None }
    }
}

impl SetRow {
    /// What a column holds, by its name; nothing if there is no such column.
    pub fn statistic(&self, column: &str) -> StatisticValue {
        let wanted = Self::columns().iter().position(|known| known.name == column);
        let (mut position, mut value) = (0, StatisticValue::Nothing);
        self.cells(&mut |cell| {
            if Some(position) == wanted {
                value = match cell {
                    Value::Null => StatisticValue::Nothing,
                    Value::Real(number) => StatisticValue::Number(number),
                    Value::Count(count) => StatisticValue::Number(count as f64),
                    Value::Flag(flag) => StatisticValue::Class(flag.to_string()),
                    Value::Text(text) => StatisticValue::Class(text.to_owned()),
                };
            }
            position += 1;
        });
        value
    }

    /// The half-width of the interval of the least precise statistic over its target: 1 or less if all are as precise as
    /// is wanted. `None` if none of them has a value.
    pub fn error_over_target(&self, precision: &Precision) -> Option<f64> {
        let errors = precision.statistics.iter().filter_map(|statistic| {
            let value = self.statistic(statistic.key).number()?;
            let ends = ["low", "high"].map(|end| self.statistic(&format!("{}_{end}", statistic.key)).number());
            let half = match ends {
                [Some(low), Some(high)] => 0.5 * (high - low),
                _ => f64::INFINITY,
            };
            let target = match precision.target {
                Target::Relative(share) => share * value.abs(),
                Target::Absolute(target) => target,
            };
            // Nothing is known better than exactly.
            Some(if half == 0.0 { 0.0 } else { half / target })
        });
        errors.reduce(f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Symbol;
    use crate::sweep::{STATISTICS, StatisticKind};
    use crate::table::columns::Kind;

    #[test]
    fn the_statistics_that_a_sweep_file_may_name_are_the_columns_of_a_set() {
        let columns = SetRow::columns();
        let is_end = |name: &str| name.ends_with("_low") || name.ends_with("_high");
        for column in &columns {
            let has_interval = columns.iter().any(|other| other.name == format!("{}_low", column.name));
            let known = STATISTICS.iter().find(|statistic| statistic.key == column.name);
            // Parameters, and what is expected whatever happens, tell nothing of a set.
            let is_given = column.name.starts_with("expected_") || column.name == "eta";
            let is_parameter = Symbol::from_key(&column.name).is_some();
            let is_statistic = match column.kind {
                Kind::Real => !is_end(&column.name) && !is_given && !is_parameter,
                Kind::Flag => true,
                Kind::Text => column.name == "regime",
                Kind::Count => column.name == "periods",
            };
            assert_eq!(known.is_some(), is_statistic, "{}", column.name);
            let Some(known) = known else { continue };
            assert_eq!(known.has_interval(), has_interval, "{}", column.name);
            assert_eq!(known.unit, column.unit, "{}", column.name);
            assert_eq!(known.kind == StatisticKind::Class, column.kind != Kind::Real, "{}", column.name);
        }
        assert!(STATISTICS.iter().all(|known| columns.iter().any(|column| column.name == known.key)));
    }
}
