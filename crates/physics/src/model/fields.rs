//! Structs whose fields are each described once, in a row of `fields!`:
//!
//! ```text
//! fields! {
//!     /// What the struct is.
//!     pub struct Parameters by Symbol {
//!         Dfs("dfs", "Δf_s") threshold_deviation: f64 = 6.9e-3, "N", NOT_NEGATIVE and "dfs <= fs",
//!             "standard deviation of the contact thresholds";
//!         Seed("seed") seed: u64 = 0, "", COUNT_OR_ZERO, "realisation of the disorder";
//!     }
//! }
//! ```
//!
//! `Variant("key", "symbol", "words") field: type = default, "unit", RANGE and "rule", "meaning";`
//!
//! | part | meaning |
//! |---|---|
//! | `Variant` | the field as a value of the enum behind `by` |
//! | `"key"` | its name in files, flags and tables |
//! | `"symbol"` | its symbol in the paper; may be left out, and figures name it in small print only away from its default |
//! | `"words"` | what axes of figures call it; may be left out if the meaning begins so |
//! | `type` | a [`Field`](crate::value::Field); an `Option` where the value may be missing |
//! | `"unit"` | in SI; empty for a pure number, a flag or a word |
//! | `RANGE` | one of [`Range`]: the values that the field can take by itself |
//! | `"rule"` | what else must hold, beside other fields; the struct checks it in code; may be left out |
//! | `"meaning"` | one line, without a full stop; it also heads columns of tables |
//!
//! With `by Symbol but unknown`, a list `unknown` names the fields that are not known: their values are null.
//!
//! Each row yields the field with its documentation, its default, its [`Description`], access by key, and a row of the
//! table in `docs/`, which the tests write with `UPDATE_DOCS=1`. All this is tested with
//! [`Parameters`](super::Parameters), in `parameters.rs`.

use crate::columns::Column;
use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::Deref;

#[derive(Clone, Debug)]
pub struct Description {
    /// The field as a column of a table.
    pub column: Column,
    /// The values that the field can take by itself.
    pub range: Range,
    /// What else must hold, beside other fields; empty for nothing.
    pub rule: &'static str,
    /// The words that it can be, if it is one.
    pub choices: &'static [&'static str],
}

impl Deref for Description {
    type Target = Column;

    fn deref(&self) -> &Column {
        &self.column
    }
}

impl Description {
    /// The values that the field can take by itself, with their unit.
    pub fn allowed(&self) -> String {
        let words = self.range.words;
        match self.choices {
            [others @ .., last] => format!("\"{}\" or \"{last}\"", others.join("\", \"")),
            [] if self.unit.is_empty() => words.to_owned(),
            [] => format!("{words}, in {}", self.unit),
        }
    }

    /// The allowed values with the rule beside other fields.
    pub fn requirement(&self) -> String {
        if self.rule.is_empty() {
            self.allowed()
        } else {
            format!("{}, {}", self.allowed(), self.rule)
        }
    }
}

/// The values that a field can take by itself: the words for them, and the ends of numbers.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    pub words: &'static str,
    pub ends: (Bound<f64>, Bound<f64>),
}

impl Range {
    pub const SIZE: Self = Self::from_to("a whole number from 1 to 100000", 1.0, 1e5);
    pub const HELD: Self = Self::from_to(
        "a whole number from 1 to 10000000: a job holds them in memory, 320 bytes each",
        1.0,
        1e7,
    );
    pub const COUNT: Self = Self::below("a whole number from 1 to 2^53 - 1", 1.0, TOO_LARGE);
    pub const COUNT_OR_ZERO: Self =
        Self::below("a whole number from 0 to 2^53 - 1", 0.0, TOO_LARGE);
    pub const POSITIVE: Self = Self::new(
        "a finite number > 0",
        Excluded(0.0),
        Excluded(f64::INFINITY),
    );
    pub const NOT_NEGATIVE: Self = Self::below("a finite number >= 0", 0.0, f64::INFINITY);
    pub const FLAG: Self = Self::new("true or false", Unbounded, Unbounded);
    pub const TOLERANCE: Self =
        Self::from_to("a number from 1e-12 to 1e-2, relative to fs/k", 1e-12, 1e-2);
    /// Of a field that is one of several words, which its type lists.
    pub const WORD: Self = Self::new("", Unbounded, Unbounded);

    const fn from_to(words: &'static str, low: f64, high: f64) -> Self {
        Self::new(words, Included(low), Included(high))
    }

    const fn below(words: &'static str, low: f64, end: f64) -> Self {
        Self::new(words, Included(low), Excluded(end))
    }

    const fn new(words: &'static str, low: Bound<f64>, high: Bound<f64>) -> Self {
        Self {
            words,
            ends: (low, high),
        }
    }
}

/// Smallest integer that a double cannot tell from the next: 2^53.
const TOO_LARGE: f64 = 9_007_199_254_740_992.0;

/// Defines a struct and the enum of its fields, see the top of this file.
macro_rules! fields {
    (
        $(#[$about:meta])*
        pub struct $Struct:ident by $Key:ident $(but $unknown:ident)? {$(
            $variant:ident($key:literal $(, $symbol:literal $(, $words:literal)?)?) $field:ident: $type:ty = $default:expr,
                $unit:tt, $range:ident $(and $rule:literal)?, $meaning:literal;
        )+}
    ) => {
        $(#[$about])*
        pub struct $Struct {$(
            #[doc = concat!("`", $key, "`: ", $meaning, "; unit: \"", $unit, "\"." $(, " Rule: ", $rule, ".")?)]
            pub $field: $type,
        )+
            $(#[doc = "Fields that are not known, in order: their values are null."] pub $unknown: Vec<$Key>,)?
        }

        impl Default for $Struct {
            fn default() -> Self {
                Self { $($field: $default,)+ $($unknown: Vec::new(),)? }
            }
        }

        $crate::words! {
            #[doc = concat!("A field of [`", stringify!($Struct), "`].")]
            #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
            pub enum $Key {$(
                #[doc = concat!("`", $key, "`: ", $meaning, ".")]
                $variant = $key,
            )+}
        }

        impl $Key {
            pub const fn description(self) -> $crate::model::Description {
                match self {$(
                    Self::$variant => $crate::model::Description {
                        column: $crate::columns::Column {
                            name: std::borrow::Cow::Borrowed($key),
                            unit: $unit,
                            meaning: $meaning,
                            symbol: concat!($($symbol)?),
                            words: concat!($($($words)?)?),
                            class: $crate::columns::Class::Parameter,
                            kind: <$type as $crate::value::Field>::KIND,
                            nullable: <$type as $crate::value::Field>::NULLABLE,
                        },
                        range: $crate::model::fields::Range::$range,
                        rule: concat!($($rule)?),
                        choices: <$type as $crate::value::Field>::WORDS,
                    },
                )+}
            }

            /// Key in files, flags and tables.
            pub const fn key(self) -> &'static str {
                self.word()
            }

            pub fn from_key(key: &str) -> Option<Self> {
                Self::from_word(key)
            }

            /// The canonical form of a value that the field can take by itself: equal values have equal bits.
            pub fn checked(self, value: $crate::value::Value<'_>) -> Option<$crate::model::Value> {
                use $crate::value::{Field, Value};
                use std::ops::RangeBounds;
                let value = match self {$(
                    Self::$variant => <$type as Field>::from_value(value)?.value(),
                )+};
                let ends = self.description().range.ends;
                value.number().is_none_or(|number| ends.contains(&number)).then_some(match value {
                    // Adding zero turns -0.0 into 0.0.
                    Value::Real(real) => Value::Real(real + 0.0),
                    other => other,
                })
            }
        }

        impl $Struct {
            pub fn get(&self, field: $Key) -> $crate::model::Value {
                $(if self.$unknown.contains(&field) {
                    return $crate::value::Value::Null;
                })?
                match field {$(
                    $Key::$variant => $crate::value::Field::value(&self.$field),
                )+}
            }

            /// Sets a field, in or out of its range; `None` if the kind of value does not fit.
            pub fn put(&mut self, field: $Key, value: $crate::value::Value<'_>) -> Option<()> {
                match field {$(
                    $Key::$variant => self.$field = $crate::value::Field::from_value(value)?,
                )+}
                Some(())
            }
        }
    };
}

pub(crate) use fields;
