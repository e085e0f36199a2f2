//! A solver as columns, and the documentation of all tables that an accuracy study, scaling and the hard cases write.
//!
//! Unlike the tables of a sweep these hold times, of the machine that they were measured on. Their JSON has the same fields.

use crate::solver::{Resolve, Solver};
use crate::table::columns::{Cell, Column, Kind, Part};

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

    fn give(&self, give: &mut dyn FnMut(Cell<'_>)) {
        give(Cell::Text(method(*self)));
        give(Cell::Real(match *self {
            Self::EventDriven { tolerance, .. } => tolerance,
            Self::FixedStep { time_step } => time_step,
        }));
    }

    fn take<'a>(_: &str, next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String> {
        match (next(), next()) {
            (Cell::Text(FIXED_STEP), Cell::Real(time_step)) => Ok(Self::FixedStep { time_step }),
            (Cell::Text("event-driven"), Cell::Real(tolerance)) => Ok(Self::event_driven(tolerance)),
            (Cell::Text(word), Cell::Real(tolerance)) if let Some(resolve) = Resolve::from_word(word) => {
                Ok(Self::EventDriven { tolerance, resolve })
            }
            (method, setting) => Err(format!("columns method and setting cannot hold {method:?} and {setting:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DistanceRow, Exponents, MethodRow, SizeRow, Stability};
    use crate::documented::assert_documented;
    use crate::table::columns::{UNITS, markdown};

    #[test]
    fn documented_tables_of_accuracy_are_those_written() {
        let tables = [
            markdown::<MethodRow>(),
            markdown::<DistanceRow>(),
            markdown::<SizeRow>(),
            markdown::<Exponents>(),
            markdown::<Stability>(),
        ];
        let text = format!(
            "# Tables of `stickslip accuracy`\n\n{UNITS}\
             Times are CPU times of one thread; the processor is in the footer of each file, under `processor`.\n\
             [JSON](commands.md#json) has the same rows.\n\n{}",
            tables.join("\n")
        );
        assert_documented("accuracy-tables.md", &text);
    }
}
