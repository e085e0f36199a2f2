//! What an axis moves and a condition compares: any parameter, and η and the frequency, which fix the period T.
//!
//! T = 2πΔ/(η V0) and T = 1/f. Contract: a value that passed [`Quantity::checked`] is canonical, so that equal values
//! have equal bits.

use crate::model::{Parameters, Symbol, Value};
use std::f64::consts::TAU;

/// A parameter, or one of the two quantities that stand for the period T.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// A parameter of the model.
    Parameter(Symbol),
    /// η = 2πΔ/(T V0).
    Eta,
    /// 1/T, in Hz.
    Frequency,
}

/// Range of η, f, Δ, V0 and T where one is derived from the others: their products keep all digits.
const DERIVABLE: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

impl Quantity {
    pub const fn key(self) -> &'static str {
        match self {
            Self::Parameter(symbol) => symbol.key(),
            Self::Eta => "eta",
            Self::Frequency => "frequency",
        }
    }

    pub fn all() -> impl Iterator<Item = Self> {
        Symbol::ALL.into_iter().map(Self::Parameter).chain([Self::Eta, Self::Frequency])
    }

    pub fn from_key(key: &str) -> Option<Self> {
        Self::all().find(|quantity| quantity.key() == key)
    }

    /// Whether it fixes the period T, and so means nothing without modulation.
    pub const fn is_period(self) -> bool {
        matches!(self, Self::Parameter(Symbol::T) | Self::Eta | Self::Frequency)
    }

    /// Whether it takes whole numbers only.
    pub const fn is_count(self) -> bool {
        matches!(self, Self::Parameter(Symbol::N | Symbol::Ns | Symbol::Seed))
    }

    /// The allowed values, as an error message names them.
    pub const fn allowed(self) -> &'static str {
        match self {
            Self::Parameter(Symbol::T) => "a finite number > 0",
            Self::Parameter(symbol) => symbol.description().allowed,
            Self::Eta | Self::Frequency => "a number > 0, from 1e-100 to 1e100",
        }
    }

    /// The canonical form of a value that this quantity can take by itself; what it can be beside others is checked on
    /// the points.
    pub fn checked(self, value: Value) -> Option<Value> {
        match (self, value) {
            (Self::Parameter(symbol), _) => {
                // Nothing here limits another parameter: N Ns <= 1e7, dfs <= fs, a period with every amplitude, a ramp that
                // may take as long as it likes.
                let mut probe = Parameters {
                    blocks: 1,
                    contacts_per_block: 1,
                    mean_threshold: f64::MAX,
                    threshold_deviation: 0.0,
                    modulation_amplitude: 1.0,
                    modulation_period: Some(f64::MAX),
                    turning_period: Some(f64::MAX),
                    ramp_time: 1.0,
                    ..Parameters::default()
                };
                probe.set(symbol, value).ok()?;
                let canonical = probe.get(symbol);
                // Without amplitude or duration it is the ramp that is refused.
                if probe.validated().is_err_and(|error| error.symbol == symbol) {
                    return None;
                }
                Some(match canonical {
                    // Adding zero turns -0.0 into 0.0.
                    Value::Real(real) => Value::Real(real + 0.0),
                    other => other,
                })
            }
            (_, Value::Real(real)) => DERIVABLE.contains(&real).then_some(value),
            (_, Value::Count(count)) => self.checked(Value::Real(count as f64)),
            _ => None,
        }
    }
}

/// Where the period of a point comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Period {
    /// From T itself, if at all.
    Given,
    /// From η.
    Eta(f64),
    /// From the frequency, in Hz.
    Frequency(f64),
}

/// A point of a sweep: parameters under construction and what fixes their period.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub parameters: Parameters,
    pub period: Period,
}

impl Point {
    /// Sets a quantity to a checked value.
    pub fn set(&mut self, quantity: Quantity, value: Value) {
        match (quantity, value) {
            (Quantity::Eta, Value::Real(eta)) => self.period = Period::Eta(eta),
            (Quantity::Frequency, Value::Real(frequency)) => self.period = Period::Frequency(frequency),
            (Quantity::Parameter(symbol), _) => {
                self.parameters.set(symbol, value).expect("values are checked when the file is read");
            }
            _ => unreachable!("eta and frequency are checked to be real"),
        }
    }

    /// Whether the modulation is on.
    pub fn is_modulated(&self) -> bool {
        self.parameters.modulation_amplitude > 0.0
    }

    /// Brings the period into canonical form: derived where it is, absent without modulation.
    pub fn canonical(mut self) -> Self {
        let parameters = &mut self.parameters;
        if parameters.modulation_amplitude == 0.0 {
            parameters.modulation_period = None;
        } else {
            match self.period {
                Period::Given => {}
                Period::Eta(eta) => {
                    let rate = eta * parameters.drive_velocity;
                    parameters.modulation_period = Some(TAU * parameters.modulation_amplitude / rate);
                }
                Period::Frequency(frequency) => parameters.modulation_period = Some(1.0 / frequency),
            }
        }
        self
    }

    /// Whether every quantity behind a derived period, and the period, is far from the ends of the doubles.
    pub fn period_is_derivable(&self) -> bool {
        let parameters = &self.parameters;
        let ends = [parameters.modulation_amplitude, parameters.drive_velocity];
        match (self.period, parameters.modulation_period) {
            (Period::Eta(_), Some(period)) => ends.into_iter().chain([period]).all(|value| DERIVABLE.contains(&value)),
            _ => true,
        }
    }

    /// A quantity of a canonical point as a number. Without modulation η and the frequency are 0 and T is infinite. What
    /// an axis set is given back as it was set.
    pub fn number(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Eta => match self.period {
                Period::Eta(eta) if self.is_modulated() => eta,
                _ => self.parameters.eta(),
            },
            Quantity::Frequency => match self.period {
                Period::Frequency(frequency) if self.is_modulated() => frequency,
                _ => self.parameters.modulation_period.map_or(0.0, |period| 1.0 / period),
            },
            Quantity::Parameter(Symbol::T) => self.parameters.modulation_period.unwrap_or(f64::INFINITY),
            Quantity::Parameter(symbol) => match self.parameters.get(symbol) {
                Value::Count(count) => count as f64,
                Value::Real(real) => real,
                Value::BreakOn(_) | Value::Absent => f64::NAN,
            },
        }
    }
}

/// The value of a period's quantity that these modulated parameters would come from, to about 1e-15; exact for T.
pub(super) fn period_quantity(quantity: Quantity, parameters: &Parameters, period: f64) -> f64 {
    match quantity {
        Quantity::Eta => TAU * parameters.modulation_amplitude / (period * parameters.drive_velocity),
        Quantity::Frequency => 1.0 / period,
        Quantity::Parameter(_) => period,
    }
}
