//! The value of a field outside its struct: in a file, on an axis, in a table.

use std::fmt;
use std::str::FromStr;

/// Largest integer that a double, and so every reader of a table, holds exactly.
const MAX_EXACT: f64 = ((1_u64 << 53) - 1) as f64;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BreakOn {
    /// When the magnitude of its force reaches the threshold, pulled forward or backward.
    #[default]
    Magnitude,
    /// Only when a force against forward motion reaches the threshold.
    Tension,
}

impl BreakOn {
    /// The word used in files and flags.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Magnitude => "magnitude",
            Self::Tension => "tension",
        }
    }
}

impl FromStr for BreakOn {
    type Err = ();

    fn from_str(word: &str) -> Result<Self, ()> {
        [Self::Magnitude, Self::Tension].into_iter().find(|rule| rule.word() == word).ok_or(())
    }
}

/// The value of a field outside its struct: in a file, on an axis, in a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A count or a seed.
    Count(u64),
    /// A quantity in SI units.
    Real(f64),
    Flag(bool),
    BreakOn(BreakOn),
    /// A value that is not there, such as a period while the modulation is off.
    Absent,
}

impl Value {
    /// A count or a quantity as a double.
    pub const fn number(self) -> Option<f64> {
        match self {
            Self::Count(count) => Some(count as f64),
            Self::Real(real) => Some(real),
            Self::Flag(_) | Self::BreakOn(_) | Self::Absent => None,
        }
    }

    /// A letter for the kind, and bits that differ where canonical values of a kind do. Part of every job id.
    pub const fn bits(self) -> (u8, u64) {
        match self {
            Self::Count(count) => (b'n', count),
            Self::Real(real) => (b'r', real.to_bits()),
            Self::Flag(flag) => (b'f', flag as u64),
            Self::BreakOn(rule) => (b'b', rule as u64),
            Self::Absent => (b'-', 0),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            Self::Real(real) => write!(f, "{}", Shortest(*real)),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::BreakOn(rule) => write!(f, "{}", rule.word()),
            Self::Absent => write!(f, "none"),
        }
    }
}

#[cfg(feature = "sweeps")]
impl serde::Serialize for Value {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Count(count) => serializer.serialize_u64(*count),
            Self::Real(real) => serializer.serialize_f64(*real),
            Self::Flag(flag) => serializer.serialize_bool(*flag),
            Self::BreakOn(rule) => serializer.serialize_str(rule.word()),
            Self::Absent => serializer.serialize_none(),
        }
    }
}

/// A double in the shortest decimal form that reads back to the same bits, with an exponent where that is shorter.
pub(crate) struct Shortest(pub f64);

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = self.0.abs();
        if self.0 != 0.0 && (!(1e-3..1e6).contains(&magnitude)) && self.0.is_finite() {
            write!(f, "{:e}", self.0)
        } else {
            write!(f, "{}", self.0)
        }
    }
}

/// A type that fields of [`fields!`](super::fields) can have.
pub(crate) trait FieldType: Sized {
    /// The value of such a field.
    fn to_value(&self) -> Value;

    /// The field from a value in canonical form; none if the kind of value does not fit. Whole reals fit counts, and
    /// counts fit reals.
    fn from_value(value: Value) -> Option<Self>;
}

impl FieldType for f64 {
    fn to_value(&self) -> Value {
        Value::Real(*self)
    }

    fn from_value(value: Value) -> Option<Self> {
        // Adding zero turns -0.0 into 0.0: equal values must have equal bits.
        value.number().map(|number| number + 0.0)
    }
}

impl FieldType for u64 {
    fn to_value(&self) -> Value {
        Value::Count(*self)
    }

    fn from_value(value: Value) -> Option<Self> {
        match value {
            Value::Count(count) => Some(count),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked by the guard")]
            Value::Real(real) if (0.0..=MAX_EXACT).contains(&real) && real.fract() == 0.0 => Some(real as Self),
            _ => None,
        }
    }
}

impl FieldType for usize {
    fn to_value(&self) -> Value {
        Value::Count(*self as u64)
    }

    fn from_value(value: Value) -> Option<Self> {
        u64::from_value(value)?.try_into().ok()
    }
}

impl FieldType for bool {
    fn to_value(&self) -> Value {
        Value::Flag(*self)
    }

    fn from_value(value: Value) -> Option<Self> {
        if let Value::Flag(flag) = value { Some(flag) } else { None }
    }
}

impl FieldType for BreakOn {
    fn to_value(&self) -> Value {
        Value::BreakOn(*self)
    }

    fn from_value(value: Value) -> Option<Self> {
        if let Value::BreakOn(rule) = value { Some(rule) } else { None }
    }
}

impl<T: FieldType> FieldType for Option<T> {
    fn to_value(&self) -> Value {
        self.as_ref().map_or(Value::Absent, T::to_value)
    }

    fn from_value(value: Value) -> Option<Self> {
        if value == Value::Absent { Some(None) } else { T::from_value(value).map(Some) }
    }
}
