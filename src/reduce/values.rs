//! Columns of the sets by name, or formulas of them, as numbers: for figures, and for tables that people read.
//!
//! What was swept is inferred from the sets: the columns in which they differ. The first makes the axis of a figure,
//! the second its colours, the third its panels.

use super::dimension::unit_of_formula;
use crate::model::Symbol;
use crate::sets::{Digits, FREQUENCY, Label, SetRow, is_same, parameter};
use crate::sweep::{Expression, nearest, synonym};
use crate::table::columns::{Column, Interval, Kind, Row, Value};
use crate::table::value::{Shortest, floored};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// A column of the sets, or of other rows, or a formula of such.
#[derive(Clone, Debug)]
pub struct Values {
    pub column: Column,
    pub label: Label,
    /// The columns that it is made of: itself, or those that the formula names.
    pub sources: Vec<Column>,
    /// A number for each row, in SI units; for a word, its place among the words.
    pub numbers: Vec<Option<f64>>,
    /// Their confidence intervals, where there are any.
    pub intervals: Vec<Option<Interval>>,
    /// Each number once, ascending.
    pub distinct: Vec<f64>,
    /// The words that occur, sorted; empty for a column of numbers.
    pub words: Vec<String>,
    /// The largest size of numbers whose unit it shares: its own, and those of what it is compared with.
    pub largest: f64,
}

impl Values {
    /// The values of a column, or of a formula such as `tau_sd / tau_mean`. An error says what is wrong with the name.
    pub fn of<R: Row>(rows: &[R], name: &str) -> Result<Self, String> {
        let columns = R::columns();
        let Some(column) = place(name, &columns) else {
            return if name == FREQUENCY {
                Self::frequencies(rows, &columns)
            } else {
                Self::of_formula(rows, name, &columns)
            };
        };
        let mut numbers = Vec::new();
        let mut intervals = Vec::new();
        let mut given = Vec::new();
        for row in rows {
            let mut cells = Vec::with_capacity(columns.len());
            row.cells(&mut |cell| {
                if cells.len() == column {
                    given.push(word(cell));
                }
                cells.push(cell.number());
            });
            numbers.push(cells[column].filter(|number| number.is_finite()));
            intervals.push(Interval::of(&columns, column, &cells));
        }
        let distinct: BTreeSet<String> = given.iter().flatten().cloned().collect();
        let words: Vec<String> = distinct.into_iter().collect();
        for (number, word) in numbers.iter_mut().zip(given) {
            *number = number.or_else(|| words.binary_search(&word?).ok().map(|index| index as f64));
        }
        Ok(Self::new(
            columns[column].clone(),
            Label::of(&columns, column),
            numbers,
            intervals,
            words,
        ))
    }

    fn new(
        column: Column,
        label: Label,
        numbers: Vec<Option<f64>>,
        intervals: Vec<Option<Interval>>,
        words: Vec<String>,
    ) -> Self {
        Self {
            sources: vec![column.clone()],
            column,
            label,
            distinct: ascending(numbers.iter().copied().flatten()),
            largest: numbers
                .iter()
                .flatten()
                .fold(0.0, |size, number| size.max(number.abs())),
            numbers,
            intervals,
            words,
        }
    }

    fn of_formula<R: Row>(rows: &[R], text: &str, columns: &[Column]) -> Result<Self, String> {
        let expression = formula(text, columns)?;
        let numbers = rows.iter().map(|row| evaluate(&expression, row));
        let found = numbers.map(|number| (number.is_finite().then_some(number), None));
        Ok(Self::of_numbers(text, &expression, columns, found))
    }

    /// Of rows that have a period alone.
    fn frequencies<R: Row>(rows: &[R], columns: &[Column]) -> Result<Self, String> {
        let of_sets = SetRow::columns();
        let place = of_sets.iter().position(|column| column.name == FREQUENCY);
        let place = place.ok_or_else(|| unknown(FREQUENCY, columns))?;
        Ok(Self {
            column: of_sets[place].clone(),
            label: Label::of(&of_sets, place),
            ..Self::of_formula(rows, "1/T", columns)?
        })
    }

    /// The numbers of a formula of columns, with their unit, and their intervals.
    pub(super) fn of_numbers(
        text: &str,
        formula: &Expression<usize>,
        columns: &[Column],
        found: impl Iterator<Item = (Option<f64>, Option<Interval>)>,
    ) -> Self {
        let label = match *formula {
            Expression::Name(place) => Label::of(columns, place),
            _ => Label::of_formula(text, columns, unit_of_formula(formula, columns)),
        };
        let names = formula.names().into_iter();
        Self {
            sources: names.map(|&place| columns[place].clone()).collect(),
            ..Self::computed(text, label, Kind::Real, found)
        }
    }

    /// A column of computed values and their intervals.
    pub fn computed(
        name: &str,
        label: Label,
        kind: Kind,
        found: impl IntoIterator<Item = (Option<f64>, Option<Interval>)>,
    ) -> Self {
        let column = Column {
            name: name.to_owned().into(),
            kind,
            ..Column::default()
        };
        let (numbers, intervals) = found.into_iter().unzip();
        Self::new(column, label, numbers, intervals, Vec::new())
    }

    /// Words that need no symbol.
    pub fn of_words(name: &str, given: &[String]) -> Self {
        let mut words: Vec<String> = Vec::new();
        let place = |word: &String| {
            let known = words.iter().position(|known| known == word);
            let place = known.unwrap_or_else(|| {
                words.push(word.clone());
                words.len() - 1
            });
            (Some(place as f64), None)
        };
        let found: Vec<_> = given.iter().map(place).collect();
        let label = Label {
            symbol: String::new(),
            ..Label::new(name)
        };
        Self {
            words,
            ..Self::computed(name, label, Kind::Text, found)
        }
    }

    /// Whether it is made of this column, or of one that stands for the same parameter.
    pub fn shows(&self, column: &Column) -> bool {
        let is_same = |source: &Column| {
            let symbol = parameter(source);
            source.name == column.name || symbol.is_some() && symbol == parameter(column)
        };
        self.sources.iter().any(is_same)
    }

    /// The same without η = 0, which stands for no modulation: as the period, it has no value there.
    pub fn of_modulated(mut self) -> Self {
        if self.name() == "eta" {
            let is_modulated = |eta: &f64| *eta > 0.0;
            for number in &mut self.numbers {
                *number = number.filter(is_modulated);
            }
            self.distinct.retain(is_modulated);
        }
        self
    }

    pub fn name(&self) -> &str {
        &self.column.name
    }

    /// Whether it holds words, or yes and no.
    pub fn is_worded(&self) -> bool {
        matches!(self.column.kind, Kind::Text | Kind::Flag)
    }

    pub fn word(&self, value: f64) -> Option<&str> {
        self.words.get(floored(value)).map(String::as_str)
    }

    /// The factor to the unit in which they are read best, and that unit.
    pub fn scale(&self) -> (f64, Cow<'static, str>) {
        self.label.scale(self.largest)
    }

    /// The digits that distinguish its values if it is a parameter, or computed from parameters; three for a statistic,
    /// whose interval says how many are certain.
    pub fn digits(&self) -> Digits {
        let numbers = self.numbers.iter().flatten().copied();
        match parameter(&self.column) {
            Some(Symbol::T) => Digits::THREE.distinguishing(&self.distinct),
            Some(_) => Digits::THREE.distinguishing(&numbers.collect::<Vec<_>>()),
            None if self.column.kind == Kind::Count => Digits::ALL,
            None => Digits::THREE,
        }
    }

    /// Its symbol and one of its values or words.
    pub fn setting(&self, value: f64) -> String {
        self.word(value).map_or_else(
            || self.label.setting(value, self.digits()),
            |word| match &*self.label.symbol {
                "" => word.to_owned(),
                symbol => format!("{symbol}: {word}"),
            },
        )
    }

    pub fn is_logarithmic(&self) -> bool {
        let [least, .., largest] = self.distinct[..] else {
            return false;
        };
        let is_even =
            has_even_steps(&self.distinct) && (self.distinct.len() > 2 || largest < WIDE * least);
        !self.is_worded() && is_spread(&self.distinct) && !is_even
    }

    /// Whether each of its values goes with one of another: both have few values, or both ascend.
    fn fixes(&self, other: &Self) -> bool {
        let places = self.places();
        let others = other.places();
        let mut pairs: Vec<_> = places.iter().zip(others).collect();
        pairs.sort();
        pairs.dedup();
        let is_one = pairs.windows(2).all(|pair| pair[0].0 != pair[1].0);
        is_one && (2 * self.distinct.len() <= places.len() || pairs.is_sorted_by_key(|pair| pair.1))
    }

    /// The place of the value of each set among all.
    pub fn places(&self) -> Vec<Option<usize>> {
        let lies_below = |value: f64, number: f64| value < number && !is_same(value, number);
        let place = |number: f64| {
            let distinct = &self.distinct;
            let place = distinct.partition_point(|&value| lies_below(value, number));
            (place < distinct.len()).then_some(place)
        };
        let numbers = self.numbers.iter();
        numbers.map(|number| place((*number)?)).collect()
    }
}

fn word(cell: Value<'_>) -> Option<String> {
    match cell {
        Value::Flag(flag) => Some(if flag { "yes" } else { "no" }.to_owned()),
        Value::Text(text) => Some(text.to_owned()),
        _ => None,
    }
}

/// A condition on the columns of sets, such as `V0 < 1e-4 and resultant_length > 0.5`.
pub struct Condition(Expression<usize>);

impl Condition {
    /// Reads one on these columns.
    pub fn read(text: &str, columns: &[Column]) -> Result<Self, String> {
        let expression = Expression::condition(text, &|name| number_column(name, columns));
        expression.map(Self)
    }

    pub fn holds(&self, row: &impl Row) -> bool {
        evaluate(&self.0, row) == 1.0
    }

    /// That none of some rows, which are called `of`, fulfils it, with the values that are nearest to those that it compares with.
    pub fn unmatched<R: Row>(&self, of: &str, rows: &[R]) -> String {
        let columns = R::columns();
        let nearest = |(&place, wanted): (&usize, f64)| {
            let Column { name, unit, .. } = &columns[place];
            let name_alone = Expression::Name(place);
            let values = rows.iter().map(|row| evaluate(&name_alone, row));
            let finite = values.filter(|value| value.is_finite());
            let distance = |value: &f64| (value - wanted).abs();
            let nearest = finite.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
            let value = format!("{} {unit}", Shortest(nearest));
            Some(format!("{name} nearest to {wanted}: {}", value.trim_end()))
        };
        let nearest: Vec<String> = self.0.compared().into_iter().filter_map(nearest).collect();
        let none = format!("none of {} {of} matches", rows.len());
        [vec![none], nearest].concat().join("; ")
    }
}

/// A formula of columns, or a single one.
pub(super) fn formula(text: &str, columns: &[Column]) -> Result<Expression<usize>, String> {
    let mut letters = text.chars();
    let is_name = letters.all(|letter| letter.is_alphanumeric() || "_⟨⟩".contains(letter));
    if is_name && place(text, columns).is_none() {
        return Err(unknown(text, columns));
    }
    Expression::formula(text, &|name| number_column(name, columns))
}

/// The value of an expression for a row; NaN stands for a missing value.
pub(super) fn evaluate(expression: &Expression<usize>, row: &impl Row) -> f64 {
    let mut cells = Vec::new();
    row.cells(&mut |cell| cells.push(cell.number().unwrap_or(f64::NAN)));
    expression.evaluate(&|&column| cells[column])
}

/// The place of a column by its name, or by its heading in printed tables.
fn place(name: &str, columns: &[Column]) -> Option<usize> {
    let named = columns.iter().position(|column| column.name == name);
    named.or_else(|| (0..columns.len()).find(|&place| Label::of(columns, place).symbol == name))
}

fn number_column(name: &str, columns: &[Column]) -> Result<usize, String> {
    let place = place(name, columns).ok_or_else(|| unknown(name, columns))?;
    match columns[place].kind {
        Kind::Text | Kind::Flag => Err(format!(
            "{name} holds words; a number is needed here, such as slip_share, which is 0.95 or more where sets slide"
        )),
        _ => Ok(place),
    }
}

fn unknown(name: &str, columns: &[Column]) -> String {
    const MAX_NAMES: usize = 8;
    let names: Vec<&str> = columns.iter().map(|column| &*column.name).collect();
    let is_longer = |known: &&str| known.starts_with(name) || known.ends_with(&format!("_{name}"));
    let offered = columns.iter().filter(|column| !column.is_end());
    let offered_names = offered.map(|column| &*column.name);
    let longer: Vec<&str> = offered_names.filter(is_longer).take(MAX_NAMES).collect();
    let meant = match synonym(name, &names) {
        None if !longer.is_empty() => Some(longer.join(", ")),
        synonym => synonym.or_else(|| nearest(name, &names)).map(str::to_owned),
    };
    let hint = meant.map_or_else(String::new, |meant| format!(" did you mean {meant}?"));
    format!("no such column;{hint} `stickslip plot --list` shows all")
}

/// Each value once, in their order.
pub fn ascending(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut distinct: Vec<f64> = values.collect();
    distinct.sort_by(f64::total_cmp);
    distinct.dedup_by(|next, value| is_same(*next, *value));
    distinct
}

/// Steps that differ by less than this share are even: sweep files hold rounded numbers.
const EVEN: f64 = 0.02;
/// Ratio from which two values lie on a logarithmic axis.
const WIDE: f64 = 9.0;
/// Ratio of the ends up to which no axis is logarithmic: values would fall on one place.
const NARROW: f64 = 1.1;

/// The parameters in which sets differ, the seed left out.
pub fn differing<'a>(rows: &(impl Iterator<Item = &'a SetRow> + Clone)) -> Vec<Symbol> {
    let differs = |symbol: &Symbol| {
        let mut values = rows.clone().map(|row| row.parameters.get(*symbol));
        let first = values.next();
        *symbol != Symbol::Seed && values.any(|value| Some(value) != first)
    };
    Symbol::ALL.into_iter().filter(differs).collect()
}

/// What was swept, the column with most values first; the period as 1/T, η or T, whichever was swept. Left out is a
/// column that another one determines, such as the amplitude that is 0 where there is no period, or the second of two
/// parameters that an axis moves together.
pub fn swept(rows: &[SetRow]) -> Vec<Values> {
    let column = |symbol: Symbol| {
        let names: &[&str] = if symbol == Symbol::T {
            &[FREQUENCY, "eta", "T"]
        } else {
            &[symbol.key()]
        };
        let columns = names.iter().filter_map(|name| Values::of(rows, name).ok());
        let modulated = columns.map(Values::of_modulated);
        modulated.min_by_key(|swept| (swept.distinct.len(), !has_even_steps(&swept.distinct)))
    };
    let symbols = differing(&rows.iter()).into_iter();
    let mut all: Vec<Values> = symbols.filter_map(column).collect();
    // A missing period counts as a value.
    let count = |swept: &Values| swept.distinct.len() + usize::from(swept.numbers.contains(&None));
    all.sort_by_key(|swept| std::cmp::Reverse(count(swept)));
    let mut kept: Vec<Values> = Vec::new();
    for swept in all {
        if !kept.iter().any(|other| other.fixes(&swept)) {
            kept.retain(|other| !swept.fixes(other));
            kept.push(swept);
        }
    }
    kept
}

/// Whether values that ascend are > 0 and so far apart that a logarithmic axis shows them.
pub fn is_spread(values: &[f64]) -> bool {
    matches!(values, [least, .., largest] if *least > 0.0 && *largest > NARROW * least)
}

/// Whether values that ascend have even steps.
pub fn has_even_steps(values: &[f64]) -> bool {
    let steps = || values.windows(2).map(|pair| pair[1] - pair[0]);
    let mean = steps().sum::<f64>() / steps().count() as f64;
    steps().all(|step| (step - mean).abs() <= EVEN * mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
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
            tau_interval: Some(Interval::around(2.0, 1.0)),
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
        assert!(tau.intervals == [Some(Interval::around(2.0, 1.0)); 2] && !tau.is_worded());
        assert_eq!(
            Values::of(&rows(), FREQUENCY).unwrap().numbers,
            [Some(50.0), None]
        );
        assert!(
            SetRow::columns()
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
        let left = |condition: &str| {
            let condition = Condition::read(condition, &SetRow::columns())?;
            Ok::<_, String>(rows().iter().filter(|&row| condition.holds(row)).count())
        };
        assert_eq!(
            (
                left("tau_mean > 1"),
                left("mean_friction > 0"),
                left("frequency != 50 or R > 0 or ⟨τ⟩ > 1e9")
            ),
            (Ok(2), Ok(1), Ok(0))
        );
        let unmatched =
            Condition::read("tau_mean > 90 and frequency == 49", &SetRow::columns()).unwrap();
        assert_eq!(
            unmatched.unmatched("sets", &rows()),
            "none of 2 sets matches; tau_mean nearest to 90: 2 s; frequency nearest to 49: 50 Hz"
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
    fn values_that_agree_in_ten_digits_have_one_place() {
        let found = [2.0, 1.0, 1.0 + 5e-11, 1.0 + 2e-10].map(|number| (Some(number), None));
        let values = Values::computed("x", Label::new("x"), Kind::Real, found);
        assert_eq!(values.places(), [2, 0, 0, 1].map(Some));
    }

    #[test]
    fn an_unknown_column_is_named_with_the_nearest() {
        let error = |name: &str| Values::of::<SetRow>(&[], name).unwrap_err();
        assert!(error("tau_men").contains("did you mean tau_mean?"));
        assert!(
            error("resultant")
                .contains("did you mean resultant_length, resultant_drive, resultant_excess?")
        );
        assert!(error("tau").contains("did you mean tau_mean?"));
        assert_eq!(error("tau_").matches("tau_").count(), 8);
        assert!(
            error("colour").contains("plot --list` shows all"),
            "{}",
            error("colour")
        );
    }

    fn row(velocity: f64, amplitude: f64, period: Option<f64>) -> SetRow {
        let parameters = Parameters {
            drive_velocity: velocity,
            modulation_amplitude: amplitude,
            modulation_period: period,
            ..Parameters::default()
        };
        let frequency = period.map(|period| 1.0 / period);
        SetRow {
            frequency,
            eta: parameters.eta(),
            parameters: Selected::new(parameters),
            ..SetRow::default()
        }
    }

    fn names(rows: &[SetRow]) -> Vec<String> {
        swept(rows)
            .iter()
            .map(|swept| swept.name().to_owned())
            .collect()
    }

    #[test]
    fn the_period_is_there_as_what_was_swept_and_the_most_values_come_first() {
        let mut rows = vec![row(1e-4, 0.0, None)];
        rows.extend([29.0, 58.0, 116.0].map(|frequency| row(1e-4, 1e-6, Some(1.0 / frequency))));
        assert_eq!(
            names(&rows),
            ["frequency"],
            "the frequency fixes the amplitude"
        );
        rows.extend((1..6).map(|step| row(1e-4, 1e-7 * f64::from(step), Some(1.0 / 58.0))));
        assert_eq!(names(&rows), ["Delta", "frequency"]);
        let etas = [0.2, 1.0, 5.0, 25.0];
        let period =
            |eta: f64, velocity: f64| Some(std::f64::consts::TAU * 1e-6 / (eta * velocity));
        let at = |velocity: f64| etas.map(|eta| row(velocity, 1e-6, period(eta, velocity)));
        let rows: Vec<SetRow> = [1e-5, 3e-5, 1e-4].into_iter().flat_map(at).collect();
        let found = swept(&rows);
        assert_eq!(names(&rows), ["eta", "V0"]);
        assert!(
            found[0].is_logarithmic() && found[0].distinct.len() == 4 && found[1].is_logarithmic()
        );
        let even: Vec<SetRow> = (1..9)
            .map(|step| row(1e-4, 1e-6, Some(0.01 * f64::from(step))))
            .collect();
        assert_eq!(names(&even), ["T"]);
        assert!(!swept(&even)[0].is_logarithmic());
    }

    #[test]
    fn a_sample_has_all_its_parameters_and_one_axis_of_two_the_first() {
        let velocities = [3e-5, 1e-5, 9e-5, 2e-5, 7e-5];
        let sample: Vec<SetRow> = (1..)
            .zip(velocities)
            .map(|(step, velocity)| row(velocity, 1e-7 * f64::from(step), Some(0.02)))
            .collect();
        assert_eq!(names(&sample), ["V0", "Delta"]);
        let together: Vec<SetRow> = (1..6)
            .map(|step| row(1e-5 * f64::from(step), 1e-7 * f64::from(step), Some(0.02)))
            .collect();
        assert_eq!(names(&together), ["V0"]);
        assert!(swept(&together[..1]).is_empty());
    }
}
