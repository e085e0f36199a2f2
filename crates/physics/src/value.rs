//! The value of a field outside its struct: in a file, on an axis, in a cell of a table.

use std::fmt;

/// Largest integer that a double, and so every reader of a table, holds exactly.
const MAX_EXACT: f64 = ((1_u64 << 53) - 1) as f64;

/// The whole number at or below a real: 0 for a negative one and for NaN, the largest for one beyond it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "this is meant"
)]
#[inline(always)]
pub const fn floored(value: f64) -> usize {
    value as usize
}

/// Defines an enum whose values are words in files and tables, each written once behind its variant.
#[macro_export]
macro_rules! words {
    (
        $(#[$about:meta])*
        $visibility:vis enum $Enum:ident {$(
            $(#[$of_variant:meta])*
            $variant:ident = $word:literal,
        )+}
    ) => {
        $(#[$about])*
        $visibility enum $Enum {$(
            $(#[$of_variant])*
            $variant,
        )+}

        impl $Enum {
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            pub const fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }

            pub fn from_word(word: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|known| known.word() == word)
            }
        }

        impl $crate::value::Field for $Enum {
            const KIND: $crate::value::Kind = $crate::value::Kind::Text;
            const WORDS: &'static [&'static str] = &[$($word),+];

            fn value(&self) -> $crate::value::Value<'static> {
                $crate::value::Value::Text(self.word())
            }

            fn from_value(value: $crate::value::Value<'_>) -> Option<Self> {
                if let $crate::value::Value::Text(word) = value { Self::from_word(word) } else { None }
            }
        }
    };
}
pub use words;

words! {
    /// What a field holds.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Kind {
        #[default]
        Real = "real",
        Count = "count",
        Flag = "flag",
        Text = "text",
    }
}

/// The value of a field. Of one kind, values that are no NaN have an order.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, serde::Serialize)]
#[serde(untagged)]
pub enum Value<'a> {
    /// A value that is not there, such as a period while the modulation is off.
    Null,
    /// A quantity in SI units.
    Real(f64),
    /// A count or a seed.
    Count(u64),
    Flag(bool),
    Text(&'a str),
}

impl Value<'_> {
    /// A count or a quantity as a double.
    pub const fn number(self) -> Option<f64> {
        match self {
            Self::Count(count) => Some(count as f64),
            Self::Real(real) => Some(real),
            Self::Flag(_) | Self::Text(_) | Self::Null => None,
        }
    }
}

impl fmt::Display for Value<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Null => write!(f, "none"),
            Self::Real(real) => write!(f, "{}", Shortest(*real)),
            Self::Count(count) => write!(f, "{count}"),
            Self::Flag(flag) => write!(f, "{flag}"),
            Self::Text(text) => write!(f, "{text}"),
        }
    }
}

/// A double in the shortest decimal form that reads back to the same bits, with an exponent where that is shorter.
pub struct Shortest(pub f64);

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

/// A type that a field can have, of which a value can outlive its struct.
pub trait Field: Sized {
    const KIND: Kind;
    /// Whether it may be null.
    const NULLABLE: bool = false;
    /// The words that it can be, if it is one.
    const WORDS: &'static [&'static str] = &[];
    /// What stands for a value that is not known, if anything does.
    const UNKNOWN: Option<Self> = None;

    fn value(&self) -> Value<'static>;

    /// The field from a value; none if the value does not fit. Whole reals fit counts, and counts fit reals.
    fn from_value(value: Value<'_>) -> Option<Self>;
}

/// Types of fields: their kind, and how they are read from values.
macro_rules! field_types {
    ($($type:ty as $kind:ident, $unknown:expr, ($own:ident => $held:expr) from $value:ident => $read:expr;)*) => {$(
        impl Field for $type {
            const KIND: Kind = Kind::$kind;
            const UNKNOWN: Option<Self> = Some($unknown);

            fn value(&self) -> Value<'static> {
                let $own = *self;
                Value::$kind($held)
            }

            fn from_value($value: Value<'_>) -> Option<Self> {
                $read
            }
        }
    )*};
}

field_types! {
    f64 as Real, Self::NAN, (own => own) from value => value.number();
    u64 as Count, 0, (own => own) from value => match value {
        Value::Count(count) => Some(count),
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked by the guard")]
        Value::Real(real) if (0.0..=MAX_EXACT).contains(&real) && real.fract() == 0.0 => Some(real as Self),
        _ => None,
    };
    usize as Count, 0, (own => own as u64) from value => u64::from_value(value)?.try_into().ok();
    bool as Flag, false, (own => own) from value => if let Value::Flag(flag) = value { Some(flag) } else { None };
}

impl<T: Field> Field for Option<T> {
    const KIND: Kind = T::KIND;
    const NULLABLE: bool = true;
    const WORDS: &'static [&'static str] = T::WORDS;

    fn value(&self) -> Value<'static> {
        self.as_ref().map_or(Value::Null, T::value)
    }

    fn from_value(value: Value<'_>) -> Option<Self> {
        if value == Value::Null {
            Some(None)
        } else {
            T::from_value(value).map(Some)
        }
    }
}
