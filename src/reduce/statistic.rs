//! What a sweep file asks of a set: a statistic by its name, and how far its interval is from the target.

use crate::sweep::{Precision, SetRow, Target};
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
