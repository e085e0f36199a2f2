//! Columns of the sets by name, or formulas of them, as numbers: for figures, and for tables that people read.

use super::SetRow;
use super::swept::ascending;
use crate::model::Symbol;
use crate::sweep::{Digits, Expression, Label, label, nearest};
use crate::table::columns::{Column, Kind, Row, Value};
use crate::table::value::floored;

pub const FREQUENCY: &str = "frequency";

/// A column of the sets, or a formula of such.
#[derive(Clone, Debug)]
pub struct Values {
    pub column: Column,
    /// A number for each set, in SI; of a word its place among the words.
    pub numbers: Vec<Option<f64>>,
    /// Ends of the confidence intervals, where there are any.
    pub intervals: Vec<Option<(f64, f64)>>,
    /// The words that occur, sorted; none of a column of numbers.
    pub words: Vec<String>,
}

/// The columns of the sets that can be shown.
pub fn set_columns() -> Vec<Column> {
    SetRow::columns()
}

impl Values {
    /// The values of a column, or of a formula such as `tau_sd / tau_mean`. An error says what is wrong with the name.
    pub fn of(rows: &[SetRow], name: &str) -> Result<Self, String> {
        let columns = set_columns();
        let index = |name: &str| columns.iter().position(|column| column.name == name);
        let Some(column) = index(name) else {
            return Self::of_formula(rows, name, &columns);
        };
        let ends = index(&format!("{name}_low")).zip(index(&format!("{name}_high")));
        let (mut numbers, mut intervals, mut given) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            let (mut cells, mut word) = (Vec::new(), None);
            row.cells(&mut |cell| {
                if cells.len() == column {
                    word = match cell {
                        Value::Flag(flag) => Some(if flag { "yes" } else { "no" }.to_owned()),
                        Value::Text(text) => Some(text.to_owned()),
                        _ => None,
                    };
                }
                cells.push(cell.number());
            });
            intervals.push(ends.and_then(|(low, high)| cells[low].zip(cells[high])));
            numbers.push(cells[column].filter(|number| number.is_finite()));
            given.push(word);
        }
        let mut words: Vec<String> = given.iter().flatten().cloned().collect();
        words.sort();
        words.dedup();
        for (number, word) in numbers.iter_mut().zip(given) {
            *number = number.or_else(|| words.binary_search(&word?).ok().map(|index| index as f64));
        }
        Ok(Self {
            column: columns[column].clone(),
            numbers,
            intervals,
            words,
        })
    }

    fn of_formula(rows: &[SetRow], text: &str, columns: &[Column]) -> Result<Self, String> {
        let is_name = text
            .chars()
            .all(|letter| letter.is_alphanumeric() || letter == '_');
        if is_name {
            return Err(unknown(text, columns));
        }
        let formula = Expression::formula(text, &|name| number_column(name, columns))
            .map_err(|error| error.to_string())?;
        let numbers = rows
            .iter()
            .map(|row| evaluate(&formula, row))
            .map(|number| Some(number).filter(|n| n.is_finite()));
        let column = Column {
            name: text.to_owned().into(),
            unit: "",
            meaning: "",
            kind: Kind::Real,
            nullable: true,
        };
        Ok(Self {
            column,
            numbers: numbers.collect(),
            intervals: vec![None; rows.len()],
            words: Vec::new(),
        })
    }

    /// Whether it holds words, or yes and no.
    pub fn is_worded(&self) -> bool {
        matches!(self.column.kind, Kind::Text | Kind::Flag)
    }

    /// The word of a value.
    pub fn word(&self, value: f64) -> Option<&str> {
        self.words.get(floored(value)).map(String::as_str)
    }

    pub fn label(&self) -> Label {
        label(&self.column.name)
    }

    /// The factor to the unit in which they are read best, and that unit.
    pub fn scale(&self) -> (f64, &'static str) {
        self.label().scale(
            self.numbers
                .iter()
                .flatten()
                .fold(0.0, |largest, value| value.abs().max(largest)),
        )
    }

    /// Those that distinguish its values if it is a parameter, or computed from such: of others, intervals say how many count.
    pub fn digits(&self) -> Digits {
        let name = &*self.column.name;
        let numbers = self.numbers.iter().flatten().copied();
        match name {
            "T" | "eta" | FREQUENCY => Digits::THREE.distinguishing(&ascending(numbers)),
            _ if Symbol::from_key(name).is_some() => {
                Digits::THREE.distinguishing(&numbers.collect::<Vec<_>>())
            }
            _ => Digits::THREE,
        }
    }

    /// Its symbol and one of its values or words.
    pub fn setting(&self, value: f64) -> String {
        let label = self.label();
        self.word(value).map_or_else(
            || label.setting(value, self.digits()),
            |word| format!("{}: {word}", label.symbol),
        )
    }
}

/// The sets for which a condition on their columns holds, such as `V0 < 1e-4 and resultant_length > 0.5`.
pub fn sets_where(rows: Vec<SetRow>, condition: &str) -> Result<Vec<SetRow>, String> {
    let columns = set_columns();
    let condition = Expression::condition(condition, &|name| number_column(name, &columns))
        .map_err(|error| error.to_string())?;
    Ok(rows
        .into_iter()
        .filter(|row| evaluate(&condition, row) == 1.0)
        .collect())
}

/// A value over the columns of a row; what has none is no number.
fn evaluate(expression: &Expression<usize>, row: &SetRow) -> f64 {
    let mut cells = Vec::new();
    row.cells(&mut |cell| cells.push(cell.number().unwrap_or(f64::NAN)));
    expression.evaluate(&|&column| cells[column])
}

/// The place of a column of numbers.
fn number_column(name: &str, columns: &[Column]) -> Result<usize, String> {
    let place = columns
        .iter()
        .position(|column| column.name == name)
        .ok_or_else(|| unknown(name, columns))?;
    match columns[place].kind {
        Kind::Text | Kind::Flag => Err(format!(
            "{name} holds words; a number is needed here, such as slip_share, which is 0.95 or more where sets slide"
        )),
        _ => Ok(place),
    }
}

fn unknown(name: &str, columns: &[Column]) -> String {
    let names: Vec<&str> = columns.iter().map(|column| &*column.name).collect();
    let is_longer = |known: &&str| {
        known.starts_with(name) && !known.ends_with("_low") && !known.ends_with("_high")
    };
    let longer: Vec<&str> = names.iter().copied().filter(is_longer).collect();
    let meant = if longer.is_empty() {
        nearest(name, &names).map(str::to_owned)
    } else {
        Some(longer.join(", "))
    };
    match meant {
        Some(meant) => {
            format!("no such column; did you mean {meant}? `stickslip plot --list` shows all")
        }
        None => "no such column; `stickslip plot --list` shows all".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::selected::Selected;
    use crate::table::columns::Interval;

    fn rows() -> Vec<SetRow> {
        let row = |period: Option<f64>| SetRow {
            frequency: period.map(|period| 1.0 / period),
            parameters: Selected::new(Parameters {
                modulation_period: period,
                ..Parameters::default()
            }),
            is_control: period.is_some(),
            tau_mean: Some(2.0),
            tau_interval: Some(Interval {
                low: 1.0,
                high: 3.0,
            }),
            tau_deviation: Some(1.0),
            mean_friction: period.map(|_| 400.0),
            ..SetRow::default()
        };
        [Some(0.02), None].map(row).to_vec()
    }

    #[test]
    fn a_column_of_words_becomes_places_and_one_with_an_interval_has_its_ends() {
        let control = Values::of(&rows(), "control").unwrap();
        assert_eq!(
            (control.numbers, control.words),
            (vec![Some(1.0), Some(0.0)], vec!["no".into(), "yes".into()])
        );
        let tau = Values::of(&rows(), "tau_mean").unwrap();
        assert!(tau.intervals == [Some((1.0, 3.0)); 2] && !tau.is_worded());
        assert_eq!(
            Values::of(&rows(), FREQUENCY).unwrap().numbers,
            [Some(50.0), None]
        );
        assert!(
            set_columns()
                .iter()
                .any(|column| column.name == FREQUENCY && column.unit == "Hz")
        );
    }

    #[test]
    fn formulas_and_conditions_name_columns_and_what_has_no_value_fulfils_none() {
        assert_eq!(
            Values::of(&rows(), "tau_sd / tau_mean").unwrap().numbers,
            [Some(0.5); 2]
        );
        assert_eq!(
            Values::of(&rows(), "1 / (tau_mean - 2)").unwrap().numbers,
            [None; 2]
        );
        let left = |condition: &str| sets_where(rows(), condition).map(|rows| rows.len());
        assert_eq!(
            (
                left("tau_mean > 1"),
                left("mean_friction > 0"),
                left("frequency != 50")
            ),
            (Ok(2), Ok(1), Ok(0))
        );
        for (condition, words) in [
            ("tau_men > 1", "did you mean tau_mean?"),
            ("regime > 1", "regime holds words"),
            ("tau_mean", "a comparison is needed"),
        ] {
            assert!(left(condition).unwrap_err().contains(words), "{condition}");
        }
    }

    #[test]
    fn an_unknown_column_is_named_with_the_nearest() {
        let error = |name: &str| Values::of(&[], name).unwrap_err();
        assert!(error("tau_men").contains("did you mean tau_mean?"));
        assert!(
            error("resultant")
                .contains("did you mean resultant_length, resultant_drive, resultant_excess?")
        );
        assert!(
            error("colour").contains("plot --list` shows all"),
            "{}",
            error("colour")
        );
    }
}
