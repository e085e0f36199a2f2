//! How a column is called before people: its symbol, what it is in a few words, and the unit that suits its values.

use super::set::SetRow;
use crate::model::{Description, Symbol};
use crate::table::columns::Row;
use std::collections::HashSet;

/// Column, symbol, and what it is where its meaning does not say so in a few words.
const LABELS: [(&str, &str, &str); 26] = [
    ("Delta", "Δ", "Amplitude"),
    ("ramp_time", "ramp time", "Duration of the ramp"),
    ("eta", "η", "η = 2πΔ / (T V₀)"),
    ("frequency", "1/T", "Modulation frequency"),
    ("slip_share", "slip share", "Share of time within slips"),
    ("tau_mean", "⟨τ⟩", ""),
    ("tau_mean_bound", "⟨τ⟩, at least", "Least mean interval"),
    ("tau_sd", "σ(τ)", "S.d. of the intervals"),
    ("tau_05", "τ(5 %)", ""),
    ("tau_25", "τ(25 %)", ""),
    ("tau_50", "median τ", ""),
    ("tau_75", "τ(75 %)", ""),
    ("tau_95", "τ(95 %)", "95 % quantile of the intervals"),
    ("periods", "n", "Periods per slip"),
    ("locking_index", "locking", "Locking index of τ"),
    (
        "locking_index_drive",
        "locking, drive",
        "Locking index by the drive alone",
    ),
    (
        "locking_index_excess",
        "locking, excess",
        "Locking index beyond the drive's",
    ),
    ("phase_mean", "⟨φ⟩", "Mean phase"),
    ("resultant_length", "R", "Resultant length of the phase"),
    (
        "resultant_drive",
        "R, drive",
        "Resultant length by the drive alone",
    ),
    (
        "resultant_excess",
        "R, excess",
        "Resultant length beyond the drive's",
    ),
    ("drop_mean", "⟨ΔF⟩", ""),
    ("drop_sd", "σ(ΔF)", "S.d. of the stress drop"),
    ("peak_force_mean", "⟨F⟩ at onsets", "Mean peak force"),
    ("mean_friction", "⟨Fₛ⟩", "Mean friction"),
    ("friction_coefficient", "μ", "Friction coefficient"),
];

/// Digits that distinguish all doubles.
const MAX_DIGITS: usize = 17;

/// Longest meaning, in bytes, that is what a column is in a few words.
const LONGEST: usize = 40;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    pub symbol: String,
    /// What it is, without its symbol, for the axis of a figure.
    pub what: String,
    /// Its SI unit; empty for a pure number or a word.
    pub unit: &'static str,
}

/// What ends the names of columns of intervals and of a comparison.
const COMPARED: [(&str, &str); 5] = [
    ("_low", ", lower end"),
    ("_high", ", upper end"),
    ("_a", ", A"),
    ("_b", ", B"),
    ("_difference", ", B − A"),
];

/// The label of a column of the sets, or of a comparison of such; that of a formula has symbols in place of columns.
pub fn label(column: &str) -> Label {
    for (end, words) in COMPARED {
        if let Some(column) = column.strip_suffix(end) {
            let Label { symbol, what, unit } = label(column);
            return Label {
                symbol: symbol + words,
                what: what + words,
                unit,
            };
        }
    }
    let is_of_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    if !column.chars().all(is_of_name) {
        let words = column
            .split_inclusive(|letter| !is_of_name(letter))
            .map(|part| {
                let name = part.trim_end_matches(|letter| !is_of_name(letter));
                label(name).symbol + &part[name.len()..]
            });
        let symbol: String = words.collect();
        return Label {
            what: symbol.clone(),
            symbol,
            unit: "",
        };
    }
    let known = LABELS.iter().find(|(key, ..)| *key == column);
    if let Some(symbol) = Symbol::from_key(column) {
        let Description { meaning, unit, .. } = symbol.description();
        let what = known.map_or_else(
            || meaning.split([',', ';']).next().unwrap_or_default(),
            |(.., what)| what,
        );
        return Label {
            symbol: symbol_of(symbol),
            what: capitalised(what),
            unit,
        };
    }
    let described = SetRow::columns()
        .into_iter()
        .find(|known| known.name == column);
    let plain = column
        .strip_suffix("_mean")
        .unwrap_or(column)
        .replace('_', " ");
    let symbol = known.map_or_else(|| plain.clone(), |(_, symbol, _)| (*symbol).to_owned());
    let meaning = described
        .as_ref()
        .map(|column| column.meaning)
        .filter(|meaning| meaning.len() <= LONGEST);
    let what = match (known, meaning) {
        (Some((.., what)), _) if !what.is_empty() => (*what).to_owned(),
        (_, Some(meaning)) => capitalised(meaning),
        _ => capitalised(&plain),
    };
    let unit = described.map_or("", |column| column.unit);
    Label { symbol, what, unit }
}

impl Label {
    /// The factor to the unit in which values up to this are read best, and that unit: times and lengths below 1 in
    /// thousandths or millionths, all else as it is.
    pub fn scale(&self, largest: f64) -> (f64, &'static str) {
        match self.unit {
            "s" if largest < 1e-3 => (1e6, "µs"),
            "s" if largest < 1.0 => (1e3, "ms"),
            "m" if largest < 1e-3 => (1e6, "µm"),
            "m" if largest < 1.0 => (1e3, "mm"),
            unit => (1.0, unit),
        }
    }

    /// For an axis in this unit: what it is, its symbol unless that is a word or stands there already, and the unit.
    pub fn axis(&self, unit: &str) -> String {
        let Self { symbol, what, .. } = self;
        let mut words = symbol.split(|letter: char| !letter.is_ascii_lowercase());
        let is_word =
            words.any(|word| word.len() > 2) || what.split(' ').any(|word| word == symbol);
        with_unit(
            &if is_word {
                what.clone()
            } else {
                format!("{what} {symbol}")
            },
            unit,
        )
    }

    /// The same with the symbol alone.
    pub fn short(&self, unit: &str) -> String {
        with_unit(&self.symbol, unit)
    }

    /// The symbol and a value, in the unit in which it is read best.
    pub fn setting(&self, value: f64, digits: Digits) -> String {
        let (factor, unit) = if value == 0.0 {
            (1.0, "")
        } else {
            self.scale(value.abs())
        };
        format!(
            "{} = {} {unit}",
            self.symbol,
            digits.typeset(factor * value)
        )
        .trim_end()
        .to_owned()
    }
}

fn with_unit(label: &str, unit: &str) -> String {
    if unit.is_empty() {
        label.to_owned()
    } else {
        format!("{label} ({unit})")
    }
}

/// The symbol of a parameter in the paper, or its key, with the subscripts that there are letters for.
pub fn symbol_of(symbol: Symbol) -> String {
    let description = symbol.description();
    let name = if description.symbol.is_empty() {
        description.key
    } else {
        description.symbol
    };
    match name.split_once('_') {
        Some((letter, "s")) => format!("{letter}ₛ"),
        Some((letter, "r")) => format!("{letter}ᵣ"),
        Some((letter, "to")) => format!("{letter}ₜₒ"),
        Some(_) if description.symbol.is_empty() => name.replace('_', " "),
        // There is no letter for other subscripts: figures set them lower.
        _ => name.replace("V0", "V₀"),
    }
}

pub fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().chain(letters).collect()
    })
}

/// The significant digits with which people read the values of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digits(usize);

impl Digits {
    pub const THREE: Self = Self(3);
    pub const FOUR: Self = Self(4);

    /// At least as many, and enough that no two of these values look alike unless they are the same.
    pub fn distinguishing(self, values: &[f64]) -> Self {
        let distinct = |digits| {
            let shown = values
                .iter()
                .map(|value| Self(digits).rounded(*value).to_bits());
            shown.collect::<HashSet<_>>().len()
        };
        let all = distinct(MAX_DIGITS);
        let enough = (self.0..MAX_DIGITS).find(|digits| distinct(*digits) == all);
        Self(enough.unwrap_or(MAX_DIGITS))
    }

    /// Through the decimal form, so that 29.000000000000004 is 29.
    fn rounded(self, value: f64) -> f64 {
        format!("{value:.*e}", self.0 - 1).parse().unwrap_or(value)
    }

    /// A value without digits that say nothing.
    pub fn number(self, value: f64) -> String {
        let rounded = self.rounded(value);
        if rounded == 0.0 || (1e-3..1e5).contains(&rounded.abs()) {
            (rounded + 0.0).to_string()
        } else {
            format!("{rounded:e}")
        }
    }

    /// The same as in print: with a power of ten that is one, and a minus that is no hyphen.
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

pub fn power_of_ten(mantissa: f64, power: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |character: char| {
        character
            .to_digit(10)
            .map_or('⁻', |digit| RAISED[digit as usize])
    };
    let power: String = power.to_string().chars().map(raised).collect();
    if mantissa == 1.0 {
        format!("10{power}")
    } else {
        format!("{mantissa}·10{power}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_labelled_is_a_column_and_every_number_has_words() {
        let columns = SetRow::columns();
        for (key, ..) in LABELS {
            assert!(columns.iter().any(|column| column.name == key), "{key}");
        }
        for column in columns {
            let Label { symbol, what, unit } = label(&column.name);
            let is_plain = !what.contains('_') || Symbol::from_key(&column.name).is_some();
            let has_key = symbol.contains('_') && !matches!(&*symbol, "K_d" | "F_N");
            assert!(!has_key && is_plain, "{}: {symbol}, {what}", column.name);
            assert_eq!(unit, column.unit);
        }
    }

    #[test]
    fn times_and_lengths_are_told_in_the_unit_that_suits_the_largest() {
        let scaled = |column: &str, largest| label(column).scale(largest);
        assert_eq!(
            (scaled("tau_mean", 0.1), scaled("tau_mean", 13.0)),
            ((1e3, "ms"), (1.0, "s"))
        );
        assert_eq!(
            (scaled("Delta", 1e-6), scaled("V0", 1e-6)),
            ((1e6, "µm"), (1.0, "m/s"))
        );
        assert_eq!(label("tau_sd / (2 * tau_mean)").symbol, "σ(τ) / (2 * ⟨τ⟩)");
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
        let neighbours = [0.3, 0.3_f64.next_up()];
        assert_eq!(shown(&neighbours)[1][0], "0.30000000000000004");
        assert_eq!(shown(&[-0.0])[0][0], "0");
    }

    #[test]
    fn axes_have_words_a_symbol_and_a_unit_each_once() {
        let axis = |column: &str, largest| label(column).axis(label(column).scale(largest).1);
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
        assert_eq!(axis("mean_friction", 300.0), "Mean friction ⟨Fₛ⟩ (N)");
        assert_eq!(label("Delta").short("µm"), "Δ (µm)");
    }
}
