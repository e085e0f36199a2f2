//! Quantities that figures show: a column of the table of sets on an axis or as colours, and the grid of its values.

use super::axis::{Axis, bounds, is_wide, logarithmic_bounds, widened};
use super::frame::Ends;
use super::hues::Hues;
use super::options::BadOption;
use super::style::INKS;
use crate::model::Symbol;
use crate::reduce::{Values, ascending, has_even_steps, is_spread, quantile};
use crate::sets::FREQUENCY;
use crate::sets::{label, parameter};
use crate::table::columns::{Column, Row};
use std::borrow::Cow;

const MAX_WORDS: usize = 12;
/// Values of a statistic from which on one alone says nothing of its scale.
const FEW_VALUES: usize = 8;

/// From this multiple of the median length on, an error bar does not widen the axis.
const FAR_LONGER: f64 = 3.0;

/// The ends of an axis, in SI.
pub type AxisLimits = (Option<f64>, Option<f64>);

pub(super) struct Quantity<'a> {
    /// The option that named it.
    pub(super) option: &'static str,
    pub(super) column: Values,
    /// The parameter that it shows, if it shows one.
    pub(super) symbol: Option<Symbol>,
    /// What the drive alone explains of it.
    pub(super) drive: Option<Values>,
    /// To the unit of the axis.
    pub(super) factor: f64,
    pub(super) unit: Cow<'static, str>,
    pub(super) is_log: bool,
    pub(super) limits: AxisLimits,
    /// Whether the axis holds all error bars, however much longer they are than others.
    pub(super) holds_bars: bool,
    pub(super) label: Option<&'a str>,
    /// What rows without a value are called.
    pub(super) without: String,
}

/// Whether values show phases. Of mean ones, only those of sets with a phase have a place.
pub(super) fn shows_angle(values: &Values) -> bool {
    values.sources.iter().any(Column::is_angle)
}

impl Quantity<'_> {
    pub(super) fn of<R: Row>(
        rows: &[R],
        option: &'static str,
        name: &str,
    ) -> Result<Self, BadOption> {
        let mut column =
            Values::of(rows, name).map_err(|problem| BadOption::new(option, name, &problem))?;
        if shows_angle(&column)
            && let Ok(phased) = Values::of(rows, "has_phase")
        {
            let has_phase = |word: f64| phased.word(word) == Some("yes");
            for (number, word) in column.numbers.iter_mut().zip(&phased.numbers) {
                *number = number.filter(|_| word.is_some_and(has_phase));
            }
            column.distinct = ascending(column.numbers.iter().copied().flatten());
        }
        let mut columns = R::columns().into_iter();
        let of_drive = columns.find(|other| other.class.explained() == Some(column.name()));
        let values = of_drive.and_then(|drive| Values::of(rows, &drive.name).ok());
        let drive = values.filter(|drive| drive.numbers.iter().any(Option::is_some));
        Ok(Self {
            drive,
            ..Self::of_values(option, column)
        })
    }

    pub(super) fn of_values(option: &'static str, column: Values) -> Self {
        let (factor, unit) = column.scale();
        let symbol = parameter(&column.column);
        let is_log = if symbol.is_some() {
            column.is_logarithmic()
        } else {
            lies_decades_apart(&column)
        };
        Self {
            option,
            without: without_value(&column),
            column,
            symbol,
            drive: None,
            factor,
            unit,
            is_log,
            limits: (None, None),
            holds_bars: false,
            label: None,
        }
    }

    pub(super) fn name(&self) -> &str {
        self.column.name()
    }

    /// The parameters that it is made of; none if anything else enters.
    pub(super) fn parameters(&self) -> Vec<Symbol> {
        let sources = self.column.sources.iter();
        let symbols: Option<Vec<Symbol>> = sources.map(parameter).collect();
        symbols.unwrap_or_default()
    }

    /// The first of the swept parameters that it is made of, if it is made of parameters alone.
    pub(super) fn joined_along(&self, swept: &[Values]) -> Option<Symbol> {
        let own = self.parameters();
        let mut symbols = swept.iter().filter_map(|swept| parameter(&swept.column));
        symbols.find(|symbol| own.contains(symbol))
    }

    pub(super) fn axis_label(&self) -> String {
        self.label
            .map_or_else(|| self.column.label.axis(&self.unit), str::to_owned)
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
        self.column.numbers[set].map(|number| self.factor * number)
    }

    pub(super) fn interval(&self, set: usize) -> Option<Ends> {
        self.column.intervals[set].map(|ends| (self.factor * ends.low, self.factor * ends.high))
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
            .is_some_and(|value| !self.is_log || self.column.is_worded() || value > 0.0)
    }

    /// The axis, from one limit or end of the data to the other.
    pub(super) fn axis(&self, sets: &[usize]) -> Result<Axis, BadOption> {
        let label = self.axis_label();
        let short_label = self
            .label
            .map_or_else(|| self.column.label.short(&self.unit), str::to_owned);
        if self.column.is_worded() {
            let mut axis = self.axis_of_words(&label)?;
            axis.short_label = short_label;
            return Ok(axis);
        }
        let (low, high) = self.ends(sets)?;
        let axis = |label: &str| Axis::of_scale(self.is_log, label, low, high);
        let mut shown = axis(&label);
        shown.short_label = axis(&short_label).label;
        Ok(shown)
    }

    fn axis_of_words(&self, label: &str) -> Result<Axis, BadOption> {
        let name = self.name();
        let words = &self.column.words;
        if self.is_log {
            let problem = format!("{name} holds words; a logarithmic axis takes numbers");
            return Err(BadOption::new("log", self.option, &problem));
        }
        if self.limits != (None, None) {
            return Err(self.refuse_limits(&format!("{name} holds words; limits are for numbers")));
        }
        if words.len() > MAX_WORDS {
            let count = words.len();
            return Err(self.refuse(&format!(
                "has {count} words, and {MAX_WORDS} fit an axis; take another column"
            )));
        }
        Ok(Axis::categories(label, words))
    }

    /// Where the axis ends: at the limits, else a little beyond the data.
    fn ends(&self, sets: &[usize]) -> Result<Ends, BadOption> {
        const SLACK: f64 = 1e-9;
        let (lower, upper) = self.limits;
        let is_positive = |end: Option<f64>| end.is_none_or(|end| end > 0.0);
        if self.is_log && !(is_positive(lower) && is_positive(upper)) {
            return Err(self.refuse_limits("must be > 0 on a logarithmic axis"));
        }
        let scale: fn(f64) -> f64 = if self.is_log {
            libm::log
        } else {
            |value| value
        };
        let length = |(low, high): Ends| scale(high) - scale(low);
        let bars = sets.iter().filter_map(|&set| self.interval(set));
        let mut lengths: Vec<f64> = bars.map(length).collect();
        lengths.sort_by(f64::total_cmp);
        // Bars that are far longer than others run out of the frame.
        let longest = FAR_LONGER * quantile(&lengths, 0.5).unwrap_or(0.0);
        let is_held = |bar: &Ends| self.holds_bars || length(*bar) <= longest;
        let shown = |&set: &usize| {
            let bar = self.interval(set).filter(is_held);
            let ends = bar.map(|(low, high)| [low, high]);
            let drive = self.drive.as_ref().and_then(|drive| drive.numbers[set]);
            self.number(set)
                .into_iter()
                .chain(ends.into_iter().flatten())
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
        let values = &self.column;
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
        let word = |value: f64| values.setting(value / self.factor);
        let label = self.column.label.short(&self.unit);
        Ok(Hues::of(&label, self.distinct(), word))
    }
}

/// Whether the values of a statistic are seen on a logarithmic axis only.
fn lies_decades_apart(column: &Values) -> bool {
    let [least, .., _] = column.distinct[..] else {
        return false;
    };
    let values = &column.distinct;
    // Shares are seen near 0, where their intervals reach it.
    let intervals = column.intervals.iter().flatten();
    let of_shares = intervals.filter(|_| column.label.unit.is_empty());
    let least = of_shares.map(|ends| ends.low).fold(least, f64::min);
    // A single set, such as the only one that slides, changes no scale.
    let alone = usize::from(values.len() >= FEW_VALUES);
    let ends = (values[alone], values[values.len() - 1 - alone]);
    !column.is_worded() && least > 0.0 && is_wide(ends)
}

/// Each name once, in the order of first appearance.
pub(super) fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.fold(Vec::new(), |mut known, name| {
        if !known.contains(&name) {
            known.push(name);
        }
        known
    })
}

/// Whether sets without a value of a column belong to every value: without modulation there is no period.
pub(super) fn belongs_to_all(values: &Values) -> bool {
    parameter(&values.column) == Some(Symbol::T)
}

/// What sets without a value of a column are called: of a period, that they have no modulation.
pub(super) fn without_value(values: &Values) -> String {
    if belongs_to_all(values) {
        "Δ = 0".to_owned()
    } else {
        format!("no {}", values.label.symbol)
    }
}

/// Of a column with these values: the label of its axis, and the factor to its unit.
pub(super) fn axis_of(column: &str, values: impl Iterator<Item = f64>) -> (String, f64) {
    let label = label(column);
    let (factor, unit) = label.scale(values.fold(0.0, f64::max));
    (label.axis(&unit), factor)
}

/// At least two values of a swept quantity, and how they are spaced.
pub(super) struct CellGrid {
    /// Ascending.
    values: Vec<f64>,
    is_linear: bool,
}

impl CellGrid {
    /// Linear if the steps are even, or a value is not > 0, or all are close, else logarithmic. `values` ascend.
    pub(super) fn of(values: Vec<f64>) -> Self {
        let is_linear = has_even_steps(&values) || !is_spread(&values);
        Self { values, is_linear }
    }

    pub(super) fn value(&self, index: usize) -> f64 {
        self.values[index]
    }

    /// An axis for cells: it ends half a step beyond the values.
    pub(super) fn axis(&self, label: &str) -> Axis {
        let low = self.cell(0).0;
        let high = self.cell(self.values.len() - 1).1;
        Axis::of_scale(!self.is_linear, label, low, high)
    }

    /// The ends of the cell around the value with this index: halfway to its neighbours.
    pub(super) fn cell(&self, index: usize) -> (f64, f64) {
        let at = |index: usize| {
            if self.is_linear {
                self.values[index]
            } else {
                libm::log(self.values[index])
            }
        };
        let step = |index: usize| at(index + 1) - at(index);
        let below = step(index.saturating_sub(1));
        let above = step(index.min(self.values.len() - 2));
        let low = at(index) - 0.5 * below;
        let high = at(index) + 0.5 * above;
        if self.is_linear {
            (low, high)
        } else {
            (libm::exp(low), libm::exp(high))
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::observe::Regime;
    use crate::sets::SetRow;
    use crate::table::columns::Interval;

    /// A set at Δ in m and T in s that locks to `periods` of T.
    pub(in crate::figure) fn set(amplitude: f64, period: f64, periods: f64) -> SetRow {
        let tau = periods * period;
        let interval = |value: f64| {
            Some(Interval {
                low: 0.9 * value,
                high: 1.1 * value,
            })
        };
        let of_modulated = |value: f64| (amplitude > 0.0).then_some(value);
        let locking_index = of_modulated(0.8);
        let resultant_length = of_modulated(0.7);
        let mean_friction = 280.0 - 1e7 * amplitude;
        let parameters = Parameters {
            modulation_amplitude: amplitude,
            modulation_period: Some(period),
            ..Parameters::default()
        };
        SetRow {
            set_id: format!("{amplitude:e} {period:e}"),
            frequency: of_modulated(1.0 / period),
            eta: if amplitude > 0.0 {
                parameters.eta()
            } else {
                0.0
            },
            parameters: Selected::new(parameters.validated().unwrap()),
            tau_mean: Some(tau),
            tau_interval: interval(tau),
            tau_deviation: Some(0.1 * tau),
            tau_25: Some(0.98 * tau),
            tau_50: Some(tau),
            tau_75: Some(1.02 * tau),
            periods: (0..100_u32)
                .find(|&n| (f64::from(n) - periods).abs() <= 0.5)
                .map(u64::from),
            has_phase: amplitude > 0.0,
            locking_index,
            locking_interval: locking_index.and_then(interval),
            resultant_length,
            length_interval: resultant_length.and_then(interval),
            peak_force_mean: Some(480.0),
            mean_friction: Some(mean_friction),
            mean_friction_interval: interval(mean_friction),
            regime: Some(Regime::StickSlip),
            slip_share: Some(0.05),
            ..SetRow::default()
        }
    }

    #[test]
    fn a_set_without_a_phase_has_no_place_on_an_axis_of_mean_phases() {
        let mut rows = [set(1e-6, 0.02, 4.0), set(1e-6, 0.03, 4.0)];
        rows[1].has_phase = false;
        for row in &mut rows {
            row.phase_mean = Some(-1.0);
        }
        let phases = Quantity::of(&rows, "y", "phase_mean").unwrap();
        assert!(phases.has(0) && !phases.has(1));
    }

    #[test]
    fn the_longest_bar_sets_no_axis_and_ticks_are_round() {
        let mut rows = [1.0, 2.0, 3.0, 4.0, 5.0].map(|step| set(2.34e-7 * step, 0.02, 4.0));
        rows[2].mean_friction_interval = Some(Interval {
            low: 0.0,
            high: 600.0,
        });
        let axis = |name| {
            Quantity::of(&rows, "y", name)
                .unwrap()
                .axis(&[0, 1, 2, 3, 4])
                .unwrap()
        };
        let friction = axis("mean_friction");
        assert!(
            friction.low > 200.0 && friction.high < 350.0,
            "{friction:?}"
        );
        let ticks = axis("Delta").ticks;
        assert!(
            ticks.len() > 2 && ticks.iter().all(|(_, number)| number.len() < 4),
            "{ticks:?}"
        );
    }

    #[test]
    fn cells_meet_and_lie_around_their_values() {
        for values in [
            vec![1.0, 2.0, 3.0, 4.0],
            vec![0.1, 0.2, 0.4, 3.0],
            vec![0.0, 1.0, 5.0],
        ] {
            let grid = CellGrid::of(values.clone());
            for index in 0..values.len() {
                let (low, high) = grid.cell(index);
                assert!(low < values[index] && values[index] < high, "{values:?}");
                if index > 0 {
                    assert!(
                        (grid.cell(index - 1).1 / low - 1.0).abs() < 1e-12,
                        "{values:?}"
                    );
                }
            }
        }
    }
}
