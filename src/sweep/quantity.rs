//! What an axis moves and a condition compares: any parameter, and η and the frequency, which fix the period T.
//!
//! T = 2πΔ/(η V0) and T = 1/f. Contract: a value that passed [`Quantity::checked`] is canonical, so that equal values
//! have equal bits. For an unknown name, [`hint`] says what was probably meant.

use crate::model::{Parameters, Symbol, Value};
use crate::table::value::Kind;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// A parameter, or one of the two quantities that stand for the period T.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    Parameter(Symbol),
    /// η = 2πΔ/(T V0).
    Eta,
    /// 1/T, in Hz.
    Frequency,
}

/// Range of η and f, and of a T that is derived from η.
pub(super) const DERIVABLE: RangeInclusive<f64> = 1e-100..=1e100;

impl Quantity {
    pub const BREAK_ON: Self = Self::Parameter(Symbol::BreakOn);
    pub const SEED: Self = Self::Parameter(Symbol::Seed);

    pub const fn key(self) -> &'static str {
        match self {
            Self::Parameter(symbol) => symbol.key(),
            Self::Eta => "eta",
            Self::Frequency => "frequency",
        }
    }

    pub fn all() -> impl Iterator<Item = Self> {
        let parameters = Symbol::ALL.into_iter().map(Self::Parameter);
        parameters.chain([Self::Eta, Self::Frequency])
    }

    pub fn from_key(key: &str) -> Option<Self> {
        Self::all().find(|quantity| quantity.key() == key)
    }

    pub fn comparable(name: &str) -> Result<Self, String> {
        match Self::from_key(name) {
            Some(Self::BREAK_ON) => Err(
                "break_on is a word and cannot be compared; choose its values on an axis".into(),
            ),
            Some(quantity) => Ok(quantity),
            None => {
                let numbers = Self::all().filter(|quantity| *quantity != Self::BREAK_ON);
                let keys: Vec<&str> = numbers.map(Self::key).collect();
                let suggestion = hint(name, &keys);
                Err(format!("\"{name}\" is not a known quantity; {suggestion}"))
            }
        }
    }

    /// Whether it fixes the period T, and so means nothing without modulation.
    pub const fn is_period(self) -> bool {
        matches!(
            self,
            Self::Parameter(Symbol::T) | Self::Eta | Self::Frequency
        )
    }

    pub const fn is_of_modulation(self) -> bool {
        match self {
            Self::Parameter(symbol) => symbol.is_of_modulation(),
            Self::Eta | Self::Frequency => true,
        }
    }

    /// The period T in s that a value of a quantity that fixes it leads to. Monotonic in the value.
    pub fn period(self, value: f64, parameters: &Parameters) -> f64 {
        match self {
            Self::Eta => {
                TAU * parameters.modulation_amplitude / (value * parameters.drive_velocity)
            }
            Self::Frequency => 1.0 / value,
            Self::Parameter(_) => value,
        }
    }

    pub fn is_count(self) -> bool {
        matches!(self, Self::Parameter(symbol) if symbol.description().kind == Kind::Count)
    }

    pub fn allowed(self) -> String {
        match self {
            Self::Parameter(symbol) => symbol.description().allowed(),
            Self::Eta | Self::Frequency => "a number > 0, from 1e-100 to 1e100".to_owned(),
        }
    }

    /// The canonical form of a value that this quantity can take by itself; rules between parameters are checked on the
    /// points.
    pub fn checked(self, value: crate::table::value::Value<'_>) -> Option<Value> {
        match self {
            Self::Parameter(symbol) => symbol.checked(value),
            Self::Eta | Self::Frequency => {
                let number = value.number()?;
                DERIVABLE.contains(&number).then_some(Value::Real(number))
            }
        }
    }
}

/// A point of a sweep: parameters under construction, and η or the frequency where it fixes their period.
#[derive(Clone, Debug, Default)]
pub(super) struct GridPoint {
    pub parameters: Parameters,
    pub fixes_period: Option<(Quantity, f64)>,
}

impl GridPoint {
    /// Sets a quantity to a checked value.
    pub fn set(&mut self, quantity: Quantity, value: Value) {
        let fits = match quantity {
            Quantity::Parameter(symbol) => self.parameters.put(symbol, value),
            Quantity::Eta | Quantity::Frequency => {
                self.fixes_period = value.number().map(|number| (quantity, number));
                self.fixes_period.map(|_| ())
            }
        };
        fits.expect("values are checked when the file is read");
    }

    pub fn is_modulated(&self) -> bool {
        self.parameters.is_modulated()
    }

    /// Brings the period into canonical form: derived where it is, absent without modulation.
    pub fn canonical(mut self) -> Self {
        if !self.is_modulated() {
            self.parameters.modulation_period = None;
        } else if let Some((quantity, value)) = self.fixes_period {
            self.parameters.modulation_period = Some(quantity.period(value, &self.parameters));
        }
        self
    }

    /// A quantity of a canonical point as a number; NaN for a word. Without modulation η and the frequency are 0 and T
    /// is infinite. What an axis has set is returned unchanged.
    pub fn number(&self, quantity: Quantity) -> f64 {
        let parameters = &self.parameters;
        match (quantity, self.fixes_period) {
            (_, Some((fixing, value))) if fixing == quantity && self.is_modulated() => value,
            (Quantity::Eta, _) => {
                parameters.modulation_frequency() * parameters.modulation_amplitude
                    / parameters.drive_velocity
            }
            (Quantity::Frequency, _) => parameters
                .modulation_period
                .map_or(0.0, |period| 1.0 / period),
            (Quantity::Parameter(Symbol::T), _) => {
                parameters.modulation_period.unwrap_or(f64::INFINITY)
            }
            (Quantity::Parameter(symbol), _) => parameters.get(symbol).number().unwrap_or(f64::NAN),
        }
    }
}

/// What papers and other programs call some keys and columns.
pub const SYNONYMS: &[(&str, &str)] = &[
    ("k", "ki"),
    ("mass", "M"),
    ("velocity", "V0"),
    ("amplitude", "Delta"),
    ("damping", "gamma"),
    ("interval", "tau_mean"),
    ("tau", "tau_mean"),
    ("friction", "mean_friction"),
    ("stress drop", "drop_mean"),
];

/// More than any section has keys; a table of measured slips may have more columns.
const MAX_NAMES: usize = 40;

/// The hint for an unknown word: the known one that was probably meant, else all.
pub fn hint(word: &str, known: &[&str]) -> String {
    if let Some(meant) = nearest(word, known) {
        return format!("did you mean {meant}?");
    }
    let more = if known.len() > MAX_NAMES { ", .." } else { "" };
    let names = &known[..known.len().min(MAX_NAMES)];
    format!("allowed are {}{more}", names.join(", "))
}

fn distance(word: &str, candidate: &str) -> usize {
    strsim::levenshtein(&word.to_lowercase(), &candidate.to_lowercase())
}

/// The known word that was probably meant by an unknown one.
pub fn nearest<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    // Half of a short word, two letters of a long one.
    let max = (word.chars().count() / 2).min(2);
    let candidates = known.iter().copied();
    let near = candidates.filter(|candidate| distance(word, candidate) <= max);
    synonym(word, known).or_else(|| near.min_by_key(|candidate| distance(word, candidate)))
}

/// The known word that means the same.
pub fn synonym<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    let spaced = word.replace('_', " ");
    let meant = |candidate: &&str| SYNONYMS.contains(&(&spaced, *candidate));
    known.iter().copied().find(meant)
}
