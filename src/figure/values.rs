//! Columns of the sets as numbers for axes, colours and panels: words become places in their order. Beside those of the
//! table there is the frequency, which follows from a parameter.

use super::BadOption;
use super::sets::{ETA, FREQUENCY, capitalised, parameter, symbol_of, three_digits};
use crate::model::Symbol;
use crate::reduce::SetRow;
use crate::sweep::nearest;
use crate::table::columns::{Column, Kind, Row, Value, columns};

/// Longest meaning that goes into the label of an axis.
const LONGEST: usize = 40;

pub(super) const FREQUENCY_COLUMN: &str = "frequency";

columns! {
    /// What figures show of a set that the table of sets leaves to its parameters.
    #[derive(Clone, Copy, Debug)]
    struct Derived {
        frequency: Option<f64> = "Hz", "modulation frequency 1/T; null without modulation";
    }
}

/// What figures show of a set.
type Shown<'a> = (&'a SetRow, Derived);

/// A column of the sets that an option names.
pub(super) struct Values {
    pub(super) option: &'static str,
    pub(super) column: Column,
    /// A number for each set; of a word its place among the words.
    pub(super) numbers: Vec<Option<f64>>,
    /// Ends of the confidence intervals, where there are any.
    pub(super) intervals: Vec<Option<(f64, f64)>>,
    /// The words that occur, sorted; none of a column of numbers.
    pub(super) words: Vec<String>,
}

/// The columns of the sets that can be drawn.
pub fn columns() -> Vec<Column> {
    Shown::columns()
}

impl Values {
    /// The values of the column with a name that an option gives.
    pub(super) fn of(rows: &[SetRow], option: &'static str, name: &str) -> Result<Self, BadOption> {
        let columns = columns();
        let index = |name: &str| columns.iter().position(|column| column.name == name);
        let column = index(name).ok_or_else(|| unknown(option, name, &columns))?;
        let ends = index(&format!("{name}_low")).zip(index(&format!("{name}_high")));
        let (mut numbers, mut intervals, mut given) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            let frequency = row.parameters.modulation_period.map(|period| 1.0 / period);
            let mut cells = Vec::new();
            (row, Derived { frequency }).cells(&mut |cell| {
                let word = match cell {
                    Value::Flag(flag) => Some(if flag { "yes" } else { "no" }.to_owned()),
                    Value::Text(text) => Some(text.to_owned()),
                    _ => None,
                };
                cells.push((cell.number(), word));
            });
            intervals.push(ends.and_then(|(low, high)| cells[low].0.zip(cells[high].0)));
            let (number, word) = cells.swap_remove(column);
            numbers.push(number.filter(|number| number.is_finite()));
            given.push(word);
        }
        let mut words: Vec<String> = given.iter().flatten().cloned().collect();
        words.sort();
        words.dedup();
        for (number, word) in numbers.iter_mut().zip(given) {
            *number = number.or_else(|| words.binary_search(&word?).ok().map(|index| index as f64));
        }
        Ok(Self { option, column: columns[column].clone(), numbers, intervals, words })
    }

    /// Why the option cannot name it.
    pub(super) fn refuse(&self, problem: &str) -> BadOption {
        BadOption::new(self.option, &self.column.name, problem)
    }

    /// Whether it holds words, or yes and no.
    pub(super) fn is_worded(&self) -> bool {
        matches!(self.column.kind, Kind::Text | Kind::Flag)
    }

    /// Its label on an axis, with the unit.
    pub(super) fn label(&self) -> String {
        let Column { name, meaning, .. } = &self.column;
        match &**name {
            FREQUENCY_COLUMN => return FREQUENCY.to_owned(),
            "eta" => return ETA.to_owned(),
            _ => (),
        }
        if let Some(symbol) = Symbol::from_key(name) {
            return parameter(symbol);
        }
        self.with_unit(if meaning.len() <= LONGEST { capitalised(meaning) } else { name.to_string() })
    }

    /// The same with the symbol or the name alone.
    pub(super) fn short_label(&self) -> String {
        self.with_unit(self.name())
    }

    fn with_unit(&self, label: String) -> String {
        let unit = self.column.unit;
        if unit.is_empty() { label } else { format!("{label} ({unit})") }
    }

    /// Its name and one of its values.
    pub(super) fn setting(&self, value: f64) -> String {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index, if there are words")]
        let word = self.words.get(value as usize).cloned().unwrap_or_else(|| three_digits(value));
        format!("{} = {word} {}", self.name(), self.column.unit).trim_end().to_owned()
    }

    /// Its symbol in the paper, or its name.
    pub(super) fn name(&self) -> String {
        match &*self.column.name {
            FREQUENCY_COLUMN => "1/T".to_owned(),
            "eta" => "η".to_owned(),
            name => Symbol::from_key(name).map_or_else(|| name.to_owned(), symbol_of),
        }
    }
}

fn unknown(option: &'static str, name: &str, columns: &[Column]) -> BadOption {
    let names: Vec<&str> = columns.iter().map(|column| &*column.name).collect();
    let problem = match nearest(name, &names) {
        Some(near) => format!("no such column; did you mean {near}? `stickslip plot --list` shows all"),
        None => format!("no such column; there are {}", names.join(", ")),
    };
    BadOption::new(option, name, &problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_of_words_becomes_places_and_one_with_an_interval_has_bars() {
        let mut rows = super::super::own::tests::rows(3);
        rows[1].has_phase = true;
        let phased = Values::of(&rows, "x", "has_phase").unwrap();
        assert_eq!(
            (phased.numbers, phased.words),
            (vec![Some(0.0), Some(1.0), Some(0.0)], vec!["no".into(), "yes".into()])
        );
        let tau = Values::of(&rows, "y", "tau_mean").unwrap();
        assert!(tau.intervals.iter().all(Option::is_some) && !tau.is_worded());
        assert!(Values::of(&rows, "y", "eta").unwrap().intervals.iter().all(Option::is_none));
    }

    #[test]
    fn the_frequency_is_that_of_the_period_and_absent_without_modulation() {
        let rows = super::super::own::tests::rows(2);
        let frequency = Values::of(&rows, "x", FREQUENCY_COLUMN).unwrap();
        assert_eq!(frequency.numbers, [Some(50.0), None]);
        assert_eq!(frequency.label(), "Modulation frequency 1/T (Hz)");
        assert_eq!(Values::of(&rows, "x", "eta").unwrap().label(), "η = 2πΔ / (T V₀)");
        assert_eq!(frequency.setting(50.0), "1/T = 50 Hz");
        assert!(columns().iter().any(|column| column.name == FREQUENCY_COLUMN && column.unit == "Hz"));
    }

    #[test]
    fn an_unknown_column_is_named_with_the_nearest() {
        let error = |name: &str| Values::of(&[], "y", name).err().unwrap().to_string();
        assert!(error("tau_men").contains("--y tau_men") && error("tau_men").contains("did you mean tau_mean?"));
        assert!(error("colour").contains("there are set_id, N, Ns"), "{}", error("colour"));
    }

    #[test]
    fn labels_have_symbols_and_units() {
        let label = |name: &str| Values::of(&[], "x", name).unwrap().label();
        assert_eq!(label("V0"), "Drive velocity V₀ (m/s)");
        assert_eq!(label("tau_mean"), "Mean interval (s)");
        assert_eq!(label("rayleigh_p"), "rayleigh_p");
        assert_eq!(label("Delta"), "Amplitude of the modulation Δ (m)");
        let short = |name: &str| Values::of(&[], "x", name).unwrap().short_label();
        assert_eq!(["Delta", "tau_mean", "has_phase"].map(short), ["Δ (m)", "tau_mean (s)", "has_phase"]);
    }
}
