//! What a sweep file asks of a set: a statistic by its name, and how far its interval is from the target.

use crate::sweep::{Precision, SetRow, Target};
use crate::table::columns::Row;

impl SetRow {
    /// The number in a column of this name; `None` if it has none.
    pub fn number(&self, column: &str) -> Option<f64> {
        let place = Self::columns().iter().position(|known| known.name == column)?;
        let mut numbers = Vec::new();
        self.cells(&mut |cell| numbers.push(cell.number()));
        numbers.swap_remove(place)
    }

    /// The half-width of the interval of the least precise statistic over its target: 1 or less if all are as precise as
    /// is wanted. `None` if none of them has a value.
    pub fn error_over_target(&self, precision: &Precision) -> Option<f64> {
        let errors = precision.statistics.iter().filter_map(|statistic| {
            let value = self.number(statistic.key)?;
            let ends = ["low", "high"].map(|end| self.number(&format!("{}_{end}", statistic.key)));
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
