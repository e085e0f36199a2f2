//! A solver as columns, and the documentation of all tables that an accuracy study and the hard cases write.
//!
//! Unlike the tables of a sweep these hold times, of the machine that they were measured on. Their JSON has the same fields.

use crate::solver::{Resolve, Solver};
use crate::table::columns::{Column, Kind, Part, Value};

const FIXED_STEP: &str = "fixed-step";

/// Method of a solver; the event-driven one by how it resolves motion.
pub(super) const fn method(solver: Solver) -> &'static str {
    match solver {
        Solver::EventDriven { resolve: Resolve::Auto, .. } => "event-driven",
        Solver::EventDriven { resolve, .. } => resolve.word(),
        Solver::FixedStep { .. } => FIXED_STEP,
    }
}

/// Two columns: the method and its one setting.
impl Part for Solver {
    fn columns_as(_: &'static str, _: &'static str, _: &'static str) -> Vec<Column> {
        let column =
            |name: &'static str, kind, meaning| Column { name: name.into(), unit: "", meaning, kind, nullable: false };
        vec![
            column("method", Kind::Text, "event-driven, or how it resolves motion: grid or taylor; or fixed-step"),
            column("setting", Kind::Real, "tolerance, or dt in s"),
        ]
    }

    fn give(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(Value::Text(method(*self)));
        give(Value::Real(match *self {
            Self::EventDriven { tolerance, .. } => tolerance,
            Self::FixedStep { time_step } => time_step,
        }));
    }

    fn take<'a>(_: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        match (next(), next()) {
            (Value::Text(FIXED_STEP), Value::Real(time_step)) => Ok(Self::FixedStep { time_step }),
            (Value::Text("event-driven"), Value::Real(tolerance)) => Ok(Self::event_driven(tolerance)),
            (Value::Text(word), Value::Real(tolerance)) if let Some(resolve) = Resolve::from_word(word) => {
                Ok(Self::EventDriven { tolerance, resolve })
            }
            (method, setting) => Err(format!("columns method and setting cannot hold {method:?} and {setting:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DistanceRow, MethodRow, Stability};
    use crate::table::columns::{Column, Table};

    fn described<T: Table>() -> (&'static str, Vec<Column>) {
        (T::NAME, T::columns())
    }

    #[test]
    fn every_column_is_documented() {
        let page = include_str!("../../docs/commands.md");
        let tables = [described::<MethodRow>(), described::<DistanceRow>(), described::<Stability>()];
        for (table, columns) in tables {
            let row = page.lines().find(|line| line.starts_with(&format!("| `{table}` |"))).unwrap();
            // The ends of all intervals are described together.
            for name in columns.iter().map(|column| column.name.trim_end_matches("_low").trim_end_matches("_high")) {
                assert!(row.contains(&format!("`{name}`")), "{table}.{name}");
            }
        }
    }
}
