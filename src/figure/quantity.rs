//! A column of the table of sets as a quantity that a figure shows: on an axis, or as colours.

use super::BadOption;
use super::axis::{Axis, bounds, is_wide, logarithmic_bounds, widened};
use super::frame::Ends;
use super::hues::Hues;
use super::style::INKS;
use crate::model::Symbol;
use crate::reduce::{FREQUENCY, SetRow, Swept, Values};
use crate::sets::Label;

/// Values of a parameter up to which each has its tick.
pub(super) const MAX_TICKS: usize = 6;
const MAX_WORDS: usize = 12;
/// Values of a statistic from which on one alone says nothing of its scale.
const FEW_VALUES: usize = 8;

/// The ends of an axis, in SI.
pub type Limits = (Option<f64>, Option<f64>);

pub(super) struct Quantity<'a> {
    /// The option that named it.
    option: &'static str,
    pub(super) column: Swept,
    /// The parameter that it shows, if it shows one.
    pub(super) symbol: Option<Symbol>,
    /// What the drive alone explains of it.
    pub(super) drive: Option<Values>,
    /// To the unit of the axis.
    pub(super) factor: f64,
    pub(super) unit: &'static str,
    pub(super) is_log: bool,
    pub(super) limits: Limits,
    pub(super) label: Option<&'a str>,
}

/// The parameter that a column shows.
pub(super) fn parameter(column: &str) -> Option<Symbol> {
    if ["eta", FREQUENCY].contains(&column) {
        Some(Symbol::T)
    } else {
        Symbol::from_key(column)
    }
}

impl Quantity<'_> {
    pub(super) fn of(rows: &[SetRow], option: &'static str, name: &str) -> Result<Self, BadOption> {
        let column =
            Swept::of(rows, name).map_err(|problem| BadOption::new(option, name, &problem))?;
        let drive = match name {
            "resultant_length" => Values::of(rows, "resultant_drive").ok(),
            "locking_index" => Values::of(rows, "locking_index_drive").ok(),
            _ => None,
        };
        let drive = drive.filter(|drive| drive.numbers.iter().any(Option::is_some));
        let (factor, unit) = column.values.scale();
        let symbol = parameter(name);
        let is_log = if symbol.is_some() {
            column.is_logarithmic()
        } else {
            lies_decades_apart(&column)
        };
        Ok(Self {
            option,
            column,
            symbol,
            drive,
            factor,
            unit,
            is_log,
            limits: (None, None),
            label: None,
        })
    }

    pub(super) fn name(&self) -> &str {
        self.column.name()
    }

    pub(super) fn typeset(&self) -> Label {
        self.column.values.label()
    }

    pub(super) fn axis_label(&self) -> String {
        self.label
            .map_or_else(|| self.typeset().axis(self.unit), str::to_owned)
    }

    /// Each value once, ascending.
    pub(super) fn distinct(&self) -> impl Iterator<Item = f64> + '_ {
        self.column.distinct.iter().map(|value| self.factor * value)
    }

    /// The period in s at a place on an axis of periods or frequencies.
    pub(super) fn period(&self, place: f64) -> f64 {
        if self.name() == FREQUENCY {
            self.factor / place
        } else {
            place / self.factor
        }
    }

    pub(super) fn number(&self, set: usize) -> Option<f64> {
        self.column.values.numbers[set].map(|number| self.factor * number)
    }

    pub(super) fn interval(&self, set: usize) -> Option<Ends> {
        self.column.values.intervals[set].map(|(low, high)| (self.factor * low, self.factor * high))
    }

    pub(super) fn refuse(&self, problem: &str) -> BadOption {
        BadOption::new(self.option, self.name(), problem)
    }

    fn refuse_limits(&self, problem: &str) -> BadOption {
        let text = |end: Option<f64>| end.map_or_else(String::new, |end| end.to_string());
        let limits = format!("{}:{}", text(self.limits.0), text(self.limits.1));
        BadOption::new(&format!("{}lim", self.option), &limits, problem)
    }

    /// Whether a set has a place on the axis.
    pub(super) fn has(&self, set: usize) -> bool {
        self.number(set)
            .is_some_and(|value| !self.is_log || self.column.values.is_worded() || value > 0.0)
    }

    /// The axis, from one limit or end of the data to the other.
    pub(super) fn axis(&self, sets: &[usize]) -> Result<Axis, BadOption> {
        let label = self.axis_label();
        let short_label = self
            .label
            .is_none()
            .then(|| self.typeset().short(self.unit));
        if self.column.values.is_worded() {
            let axis = self.axis_of_words(&label)?;
            return Ok(axis.with_short_label(short_label));
        }
        let (low, high) = self.ends(sets)?;
        let axis = |label: &str| {
            if self.is_log {
                Axis::logarithmic(label, low, high)
            } else {
                Axis::linear(label, low, high)
            }
        };
        let has_few = (2..=MAX_TICKS).contains(&self.column.distinct.len());
        if self.symbol.is_some() && self.limits == (None, None) && has_few {
            let values: Vec<f64> = self.distinct().collect();
            let axis = axis(&label).with_ticks_at(&label, &values);
            return Ok(axis.with_short_label(short_label));
        }
        let short_label = short_label.map(|label| axis(&label).label);
        Ok(axis(&label)
            .with_short_label(short_label)
            .with_enough_numbers())
    }

    fn axis_of_words(&self, label: &str) -> Result<Axis, BadOption> {
        let name = self.name();
        let words = &self.column.values.words;
        if self.is_log {
            let problem = format!("{name} holds words; a logarithmic axis takes numbers");
            return Err(BadOption::new("log", self.option, &problem));
        }
        if self.limits != (None, None) {
            return Err(self.refuse_limits(&format!("{name} holds words; limits are for numbers")));
        }
        if words.len() > MAX_WORDS {
            let problem = format!(
                "has {} words, and {MAX_WORDS} fit an axis; take another column",
                words.len()
            );
            return Err(self.refuse(&problem));
        }
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        Ok(Axis::categories(label, &words))
    }

    /// Where the axis ends: at the limits, else a little beyond the data.
    fn ends(&self, sets: &[usize]) -> Result<Ends, BadOption> {
        const SLACK: f64 = 1e-9;
        let (lower, upper) = self.limits;
        let is_positive = |end: Option<f64>| end.is_none_or(|end| end > 0.0);
        if self.is_log && !(is_positive(lower) && is_positive(upper)) {
            return Err(self.refuse_limits("must be > 0 on a logarithmic axis"));
        }
        let shown = |&set: &usize| {
            let bar = self.interval(set).map(|(low, high)| [low, high]);
            let drive = self.drive.as_ref().and_then(|drive| drive.numbers[set]);
            self.number(set)
                .into_iter()
                .chain(bar.into_iter().flatten())
                .chain(drive)
        };
        let values = sets.iter().flat_map(shown);
        let natural = if self.is_log {
            logarithmic_bounds(values)
        } else {
            bounds(values).map(widened)
        };
        let (low, high) = natural.ok_or_else(|| self.refuse("has no finite value"))?;
        // Values at a limit are shown, however they are rounded.
        let low = lower.map_or(low, |end| self.factor * (end - SLACK * end.abs()));
        let high = upper.map_or(high, |end| self.factor * (end + SLACK * end.abs()));
        if low >= high {
            return Err(self.refuse_limits(
                "the lower end must be less than the upper; with one end given, than the data's",
            ));
        }
        Ok((low, high))
    }

    /// Its values as colours.
    pub(super) fn hues(&self) -> Result<Hues, BadOption> {
        let values = &self.column.values;
        let words = values.words.len();
        let inks = INKS.len();
        if words > inks {
            return Err(self.refuse(&format!(
                "has {words} words, and there are {inks} colours; take another column"
            )));
        }
        if self.column.distinct.is_empty() {
            return Err(self.refuse("no set has a value of it"));
        }
        let known = values.numbers.iter().flatten();
        let known = known.map(|value| self.factor * value);
        let word = |value: f64| values.setting(value / self.factor);
        Ok(Hues::of(&self.typeset().short(self.unit), known, word))
    }
}

/// Whether the values of a statistic are seen on a logarithmic axis only.
fn lies_decades_apart(column: &Swept) -> bool {
    let [least, .., _] = column.distinct[..] else {
        return false;
    };
    let values = &column.distinct;
    let intervals = column.values.intervals.iter().flatten();
    let low = intervals.map(|(low, _)| *low).fold(least, f64::min);
    // A single set, such as the only one that slides, changes no scale.
    let alone = usize::from(values.len() >= FEW_VALUES);
    let ends = (values[alone], values[values.len() - 1 - alone]);
    !column.values.is_worded() && low > 0.0 && is_wide(ends)
}

/// What sets without a value of a column are called: of a period, that they have no modulation.
pub(super) fn without_value(values: &Values) -> String {
    let is_period = parameter(&values.column.name) == Some(Symbol::T);
    if is_period {
        "Δ = 0".to_owned()
    } else {
        format!("no {}", values.label().symbol)
    }
}
