//! Labels of columns in figures and printed tables: symbol, a few words, the unit that suits the values, and their
//! digits.

use super::SetRow;
use crate::model::Symbol;
use crate::table::columns::{Class, Column, Row, Value};
use std::borrow::Cow;
use std::collections::HashSet;

/// Digits that distinguish all doubles.
const MAX_DIGITS: usize = 17;
/// Most digits of a value that a person has probably written, such as K_d = 10025 N/m, and no computation.
const WRITTEN_DIGITS: usize = 6;
/// Numbers that differ by less than this share count as equal: they were computed from numbers with twelve digits.
const SAME: f64 = 1e-10;

/// Longest meaning, in bytes, that is what a column is in a few words.
const LONGEST: usize = 40;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    pub symbol: String,
    /// What it is, without its symbol, for the axis of a figure.
    pub what: String,
    /// Its SI unit; empty for a pure number or a word.
    pub unit: Cow<'static, str>,
}

/// The label of a column of the sets.
pub fn label(column: &str) -> Label {
    let columns = SetRow::columns();
    let place = columns.iter().position(|known| known.name == column);
    place.map_or_else(|| Label::new(column), |place| Label::of(&columns, place))
}

/// What a meaning says before it goes into details.
fn first_clause(meaning: &str) -> &str {
    meaning.split([',', ';']).next().unwrap_or_default()
}

impl Label {
    /// Of a pure number without a description.
    pub fn new(symbol: &str) -> Self {
        Self {
            symbol: symbol.to_owned(),
            what: capitalised(symbol),
            unit: "".into(),
        }
    }

    /// Of a column among those of its rows.
    pub fn of(columns: &[Column], place: usize) -> Self {
        let column = &columns[place];
        if column.class == Class::Low {
            return Self::of(columns, place - 1).with(", lower end");
        }
        if column.class == Class::High {
            return Self::of(columns, place - 2).with(", upper end");
        }
        let plain = column.name.replace('_', " ");
        let parameter = Symbol::from_key(&column.name);
        let meaning = match parameter {
            Some(_) => first_clause(column.meaning),
            None if column.meaning.len() <= LONGEST => column.meaning,
            None => &plain,
        };
        Self {
            what: if column.words.is_empty() {
                capitalised(meaning)
            } else {
                column.words.to_owned()
            },
            symbol: match parameter {
                Some(parameter) => symbol_of(parameter),
                None if column.symbol.is_empty() => plain,
                None => column.symbol.to_owned(),
            },
            unit: column.unit.into(),
        }
    }

    /// Of a formula in this unit: with symbols in place of its columns.
    pub fn of_formula(text: &str, columns: &[Column], unit: String) -> Self {
        let is_sign = |letter: char| !letter.is_alphanumeric() && letter != '_';
        let parts = text.split_inclusive(is_sign).map(|part| {
            let name = part.trim_end_matches(is_sign);
            let place = columns.iter().position(|known| known.name == name);
            let symbol = place.map(|place| Self::of(columns, place).symbol);
            symbol.unwrap_or_else(|| name.to_owned()) + &part[name.len()..]
        });
        let symbols: String = parts.collect();
        let symbol = symbols.replace('*', "·").replace("sqrt", "√");
        Self {
            what: symbol.clone(),
            symbol,
            unit: unit.into(),
        }
    }

    /// With further words.
    pub fn with(mut self, words: &str) -> Self {
        self.symbol += words;
        self.what += words;
        self
    }

    /// The factor to the unit in which values up to this are read best, and that unit: times and lengths below 1 in
    /// thousandths or millionths, all others in SI units.
    pub fn scale(&self, largest: f64) -> (f64, Cow<'static, str>) {
        match &*self.unit {
            "s" if largest < 1e-3 => (1e6, "µs".into()),
            "s" if largest < 1.0 => (1e3, "ms".into()),
            "m" if largest < 1e-3 => (1e6, "µm".into()),
            "m" if largest < 1.0 => (1e3, "mm".into()),
            _ => (1.0, self.unit.clone()),
        }
    }

    /// For an axis in this unit: what it is, its symbol unless that is a word or stands there already, and the unit.
    pub fn axis(&self, unit: &str) -> String {
        let Self { symbol, what, .. } = self;
        let mut words = symbol.split(|letter: char| !letter.is_ascii_lowercase());
        let is_word = words.any(|word| word.len() > 2);
        if is_word || what.split(' ').any(|word| word == symbol) {
            with_unit(what, unit)
        } else {
            with_unit(&format!("{what} {symbol}"), unit)
        }
    }

    /// The same with the symbol alone.
    pub fn short(&self, unit: &str) -> String {
        with_unit(&self.symbol, unit)
    }

    /// The symbol and a value, in the unit in which it is read best.
    pub fn setting(&self, value: f64, digits: Digits) -> String {
        let (factor, unit) = match value {
            0.0 => (1.0, "".into()),
            _ => self.scale(value.abs()),
        };
        let typeset = digits.typeset(factor * value);
        let setting = format!("{} = {typeset} {unit}", self.symbol);
        setting.trim_end().to_owned()
    }
}

fn with_unit(label: &str, unit: &str) -> String {
    if unit.is_empty() {
        label.to_owned()
    } else {
        format!("{label} ({unit})")
    }
}

/// A parameter and its value with digits that distinguish these, without a space at which a line may be broken. `None`
/// if it has no value, such as the period of no modulation.
pub fn setting(symbol: Symbol, value: Value<'_>, beside: &[f64]) -> Option<String> {
    let digits = Digits::THREE.distinguishing(beside);
    let setting = match value {
        Value::Null => return None,
        Value::Real(real) => label(symbol.key()).setting(real, digits),
        value => format!("{} = {value}", symbol_of(symbol)),
    };
    Some(setting.replace(' ', "\u{a0}"))
}

/// The symbol of a parameter in the paper, or its key, with the subscripts that there are letters for.
pub fn symbol_of(symbol: Symbol) -> String {
    let description = symbol.description();
    let name = if description.symbol.is_empty() {
        symbol.key()
    } else {
        description.symbol
    };
    match name.split_once('_') {
        Some((letter, "s")) => format!("{letter}ₛ"),
        Some((letter, "r")) => format!("{letter}ᵣ"),
        Some((letter, "p")) => format!("{letter}ₚ"),
        Some((letter, "to")) => format!("{letter}ₜₒ"),
        Some(_) if description.symbol.is_empty() => name.replace('_', " "),
        // There is no letter for other subscripts: figures set them lower.
        _ => name.replace("V0", "V₀"),
    }
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// The number of significant digits that readers see of the values of a column, and the number up to which a value is
/// shown whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digits {
    usual: usize,
    whole: usize,
}

impl Digits {
    pub const THREE: Self = Self::new(3);
    pub const FOUR: Self = Self::new(4);
    pub const ALL: Self = Self::new(MAX_DIGITS);

    const fn new(usual: usize) -> Self {
        Self {
            usual,
            whole: usual,
        }
    }

    /// Those of given values, such as parameters: at least as many, and enough that no two of them look alike unless
    /// they are the same. A value that a person can have written is shown as such.
    pub fn distinguishing(self, values: &[f64]) -> Self {
        let distinct = |digits| {
            let shown = values.iter().map(|value| rounded(*value, digits));
            shown.map(f64::to_bits).collect::<HashSet<_>>().len()
        };
        let all = distinct(MAX_DIGITS);
        let enough = (self.usual..MAX_DIGITS).find(|digits| distinct(*digits) == all);
        let usual = enough.unwrap_or(MAX_DIGITS);
        Self {
            usual,
            whole: usual.max(WRITTEN_DIGITS),
        }
    }

    /// A value without digits that say nothing.
    pub fn number(self, value: f64) -> String {
        let whole = rounded(value, self.whole);
        let rounded = if is_same(whole, value) {
            whole
        } else {
            rounded(value, self.usual)
        };
        if rounded == 0.0 || (1e-3..1e5).contains(&rounded.abs()) {
            (rounded + 0.0).to_string()
        } else {
            format!("{rounded:e}")
        }
    }

    /// The same as in print: with a raised power of ten, and a minus sign instead of a hyphen.
    pub fn typeset(self, value: f64) -> String {
        let number = self.number(value);
        let typeset = match number.split_once('e') {
            Some((mantissa, power)) => {
                power_of_ten(mantissa.parse().unwrap_or(1.0), power.parse().unwrap_or(0))
            }
            None => number,
        };
        typeset.replace('-', "−")
    }
}

/// Through the decimal form, so that 29.000000000000004 is 29.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits - 1).parse().unwrap_or(value)
}

/// With this many decimals, and no sign before zero.
pub fn with_decimals(value: f64, decimals: usize) -> String {
    let rounded: f64 = format!("{value:.decimals$}").parse().unwrap_or(value);
    format!("{:.decimals$}", rounded + 0.0)
}

pub fn is_same(value: f64, other: f64) -> bool {
    (value - other).abs() <= SAME * value.abs()
}

pub fn power_of_ten(mantissa: f64, power: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |character: char| {
        let digit = character.to_digit(10);
        digit.map_or('⁻', |digit| RAISED[digit as usize])
    };
    let exponent: String = power.to_string().chars().map(raised).collect();
    if mantissa == 1.0 {
        format!("10{exponent}")
    } else {
        format!("{mantissa}·10{exponent}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_has_a_symbol_and_words_for_readers() {
        for column in SetRow::columns() {
            let Label { symbol, what, unit } = label(&column.name);
            let is_plain = !what.contains('_') || Symbol::from_key(&column.name).is_some();
            // Figures set these lower.
            let set_lower = ["K_d", "F_N", "F_S"];
            let plain = set_lower
                .iter()
                .fold(symbol.clone(), |text, lower| text.replace(lower, ""));
            let has_key = plain.contains('_');
            assert!(!has_key && is_plain, "{}: {symbol}, {what}", column.name);
            assert_eq!(unit, column.unit);
        }
    }

    #[test]
    fn times_and_lengths_have_the_unit_that_suits_the_largest() {
        let scaled = |column: &str, largest| {
            let (factor, unit) = label(column).scale(largest);
            (factor, unit.into_owned())
        };
        assert_eq!(
            (scaled("tau_mean", 0.1), scaled("tau_mean", 13.0)),
            ((1e3, "ms".into()), (1.0, "s".into()))
        );
        assert_eq!(
            (scaled("Delta", 1e-6), scaled("V0", 1e-6)),
            ((1e6, "µm".into()), (1.0, "m/s".into()))
        );
        let formula =
            Label::of_formula("tau_sd / (2 * tau_mean)", &SetRow::columns(), String::new());
        assert_eq!(formula.symbol, "σ(τ) / (2 · ⟨τ⟩)");
        let settings = [
            ("Delta", 1e-6),
            ("Delta", 0.0),
            ("T", 0.034),
            ("V0", 1e-4),
            ("T_to", 0.01),
        ];
        let settings = settings.map(|(column, value)| label(column).setting(value, Digits::THREE));
        assert_eq!(
            settings,
            [
                "Δ = 1 µm",
                "Δ = 0",
                "T = 34 ms",
                "V₀ = 10⁻⁴ m/s",
                "Tₜₒ = 10 ms"
            ]
        );
    }

    #[test]
    fn values_have_three_digits_or_as_many_as_distinguish_them() {
        let shown = |values: &[f64]| {
            let digits = Digits::THREE.distinguishing(values);
            let number = |value: &f64| [digits.number(*value), digits.typeset(*value)];
            values.iter().map(number).collect::<Vec<_>>()
        };
        assert_eq!(
            shown(&[29.000_000_000_000_004, 0.0]),
            [["29", "29"], ["0", "0"]]
        );
        assert_eq!(
            shown(&[1e-4, 1.0002e-4, -2e-4]),
            [
                ["1e-4", "10⁻⁴"],
                ["1.0002e-4", "1.0002·10⁻⁴"],
                ["-2e-4", "−2·10⁻⁴"]
            ]
        );
        assert_eq!(shown(&[4e7, 4.0004e7])[1], ["4.0004e7", "4.0004·10⁷"]);
        // What a person can have written is whole, what is computed is not.
        assert_eq!(shown(&[1002.0, 2254.0]), [["1002"; 2], ["2254"; 2]]);
        assert_eq!(shown(&[100.0 / 3.0, 45.25])[0][0], "33.3");
        assert_eq!(
            shown(&[1.0 / 58.0 * 1e3, 45.25]),
            [["17.2"; 2], ["45.25"; 2]]
        );
        let neighbours = [0.3, 0.3_f64.next_up()];
        assert_eq!(shown(&neighbours)[1][0], "0.30000000000000004");
        assert_eq!(shown(&[-0.0])[0][0], "0");
    }

    #[test]
    fn axes_have_words_a_symbol_and_a_unit_each_once() {
        let axis = |column: &str, largest| label(column).axis(&label(column).scale(largest).1);
        let found = [
            ("tau_mean", 0.1),
            ("Delta", 1e-6),
            ("eta", 9.0),
            ("V0", 1e-4),
            ("slip_share", 1.0),
        ]
        .map(|(column, largest)| axis(column, largest));
        let expected = [
            "Mean interval ⟨τ⟩ (ms)",
            "Amplitude Δ (µm)",
            "η = 2πΔ / (T V₀)",
            "Drive velocity V₀ (m/s)",
        ];
        assert_eq!(found[..4], expected);
        assert_eq!(
            axis("resultant_length", 1.0),
            "Resultant length of the phase R"
        );
        assert_eq!(found[4], "Share of time within slips");
        assert_eq!(axis("mean_friction", 300.0), "Mean friction ⟨F_S⟩ (N)");
        assert_eq!(label("Delta").short("µm"), "Δ (µm)");
    }
}
