//! A solver as columns, and the documentation of all tables that an accuracy study, scaling and the hard cases write.
//!
//! Unlike the tables of a sweep these hold times, of the machine that they were measured on. Their JSON has the same fields.

use crate::solver::Solver;
use crate::table::columns::{Cell, Column, Kind, Part};

const METHODS: [&str; 2] = ["event-driven", "fixed-step"];

/// Method of a solver, as sweep files name it.
pub(super) const fn method(solver: Solver) -> &'static str {
    match solver {
        Solver::EventDriven { .. } => METHODS[0],
        Solver::FixedStep { .. } => METHODS[1],
    }
}

/// Two columns: the method and its one setting.
impl Part for Solver {
    fn columns_as(_: &'static str, _: &'static str, _: &'static str) -> Vec<Column> {
        let column =
            |name: &'static str, kind, meaning| Column { name: name.into(), unit: "", meaning, kind, nullable: false };
        vec![
            column("method", Kind::Text, "event-driven or fixed-step"),
            column("setting", Kind::Real, "tolerance, or dt in s"),
        ]
    }

    fn give(&self, give: &mut dyn FnMut(Cell<'_>)) {
        give(Cell::Text(method(*self)));
        give(Cell::Real(match *self {
            Self::EventDriven { tolerance } => tolerance,
            Self::FixedStep { time_step } => time_step,
        }));
    }

    fn take<'a>(_: &str, next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String> {
        match (next(), next()) {
            (Cell::Text(word), Cell::Real(tolerance)) if word == METHODS[0] => Ok(Self::EventDriven { tolerance }),
            (Cell::Text(word), Cell::Real(time_step)) if word == METHODS[1] => Ok(Self::FixedStep { time_step }),
            (method, setting) => Err(format!("columns method and setting cannot hold {method:?} and {setting:?}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DistanceRow, Exponents, MethodRow, SizeRow, Stability};
    use crate::documented::assert_documented;
    use crate::table::columns::markdown;

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
            "# Tables of `stickslip accuracy`\n\nUnits are SI.\n\
             Times are CPU times of one thread; the processor is in the footer of each file, under `processor`.\n\
             The JSON has the same rows, see [results.md](results.md#json-output).\n\n{}",
            tables.join("\n")
        );
        assert_documented("accuracy-tables.md", &text);
    }
}
