//! Columns: name, unit, meaning and value of each written once, in the row type that holds them.
//!
//! ```ignore
//! columns! {
//!     /// What one row is.
//!     #[derive(Clone, Copy, Debug)]
//!     pub struct Reading {
//!         /// (docs of a field follow from its unit and meaning)
//!         force: f64 = "N", "shear force";
//!         phase: Option<f64> = "rad", "phase of the onset, null without modulation", "φ" "Phase";
//!         number as "slip": u64 = "", "number of the slip";
//!     }
//! }
//! ```
//!
//! From this follow the struct and its documentation, the columns with their types, a writer and a reader. `name as
//! "key"` is for a field whose name differs from that of its column. After the meaning may stand the symbol of a
//! quantity in figures, a few words for its axis, and its [`Class`]. A field without unit and meaning holds the columns
//! of another row type, or is a projection: it reads a column that another row type describes. Rows side by side are
//! tuples. Nothing here knows Arrow, files or JSON, and no derive of theirs has a place for units and meanings.

pub use super::value::{Field, Kind, Value};
use std::borrow::Cow;

/// The unit of angles.
pub const ANGLE: &str = "rad";

/// What the values of a column are, for what chooses columns or shows them: nothing is inferred from a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Class {
    /// An id, or a number that is always known.
    #[default]
    Plain,
    Parameter,
    /// What stands for the period of the modulation: η or the frequency.
    Period,
    Mean,
    Spread,
    /// A number from 0 to 1.
    Share,
    /// A quantile, which jumps from value to value.
    Quantile,
    /// What goes with a statistic: a bias, the mean of the control, the p of a test.
    Auxiliary,
    /// A lower bound on the column of this name, where it has no value.
    Bound(&'static str),
    /// A word, flag or count that distinguishes rows.
    Category,
    /// What the drive alone explains of the column of this name.
    ByDrive(&'static str),
    /// What the drive alone does not explain.
    Excess,
    /// The ends of the confidence interval of the column before.
    Low,
    High,
}

impl Class {
    /// The column of which this is the part that the drive alone explains.
    pub const fn explained(self) -> Option<&'static str> {
        match self {
            Self::ByDrive(of) => Some(of),
            _ => None,
        }
    }

    /// The column on which this is a bound.
    pub const fn bounded(self) -> Option<&'static str> {
        match self {
            Self::Bound(of) => Some(of),
            _ => None,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Column {
    pub name: Cow<'static, str>,
    /// SI unit; empty for a pure number or a text.
    pub unit: &'static str,
    /// One line, without a full stop.
    pub meaning: &'static str,
    /// Symbol in figures; empty for a column that no figure names.
    pub symbol: &'static str,
    /// What it is, for the axis of a figure; empty if the meaning says it in a few words.
    pub words: &'static str,
    pub class: Class,
    pub kind: Kind,
    pub nullable: bool,
}

impl Column {
    pub fn is_angle(&self) -> bool {
        self.unit == ANGLE
    }

    pub const fn is_end(&self) -> bool {
        matches!(self.class, Class::Low | Class::High)
    }
}

/// Whether the column at a place has an interval, whose ends are the next two.
pub fn has_interval(columns: &[Column], place: usize) -> bool {
    matches!(columns.get(place + 1), Some(next) if next.class == Class::Low)
}

/// The column whose interval the one at a place ends; `None` if that is no end.
pub fn whose_end(columns: &[Column], place: usize) -> Option<&Column> {
    match columns[place].class {
        Class::Low => columns.get(place - 1),
        Class::High => columns.get(place - 2),
        _ => None,
    }
}

/// A row, or a part of one: a single cell, or several that belong together.
pub trait Row: Sized {
    /// The columns of a field that is described so; its type says of which kind they are. Rows describe their own.
    fn columns_as(described: Column) -> Vec<Column>;

    fn columns() -> Vec<Column> {
        Self::columns_as(Column::default())
    }

    fn names() -> Vec<Cow<'static, str>> {
        let columns = Self::columns().into_iter();
        columns.map(|column| column.name).collect()
    }

    /// Gives its cells, in the order of the columns.
    fn cells(&self, give: &mut dyn FnMut(Value<'_>));

    /// Reads the cells of a field with this name, or those of a row, in the order of the columns.
    fn from_cells<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String>;
}

impl<T: Field> Row for T {
    fn columns_as(described: Column) -> Vec<Column> {
        vec![Column {
            kind: T::KIND,
            nullable: T::NULLABLE,
            ..described
        }]
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(self.value());
    }

    fn from_cells<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        let cell = next();
        let unknown = || T::UNKNOWN.filter(|_| cell == Value::Null);
        T::from_value(cell)
            .or_else(unknown)
            .ok_or_else(|| format!("column {name} cannot hold {cell:?}"))
    }
}

/// A text of a row's own is no [`Field`]: its value does not outlive the row.
impl Row for String {
    fn columns_as(described: Column) -> Vec<Column> {
        vec![Column {
            kind: Kind::Text,
            ..described
        }]
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(Value::Text(self));
    }

    fn from_cells<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        <Option<Self> as Row>::from_cells(name, next)?
            .ok_or_else(|| format!("column {name} cannot hold {:?}", Value::Null))
    }
}

impl Row for Option<String> {
    fn columns_as(described: Column) -> Vec<Column> {
        vec![Column {
            kind: Kind::Text,
            nullable: true,
            ..described
        }]
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(self.as_deref().map_or(Value::Null, Value::Text));
    }

    fn from_cells<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        match next() {
            Value::Null => Ok(None),
            Value::Text(text) => Ok(Some(text.to_owned())),
            value => Err(format!("column {name} cannot hold {value:?}")),
        }
    }
}

/// The ends of a 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub low: f64,
    pub high: f64,
}

impl Interval {
    pub const fn around(middle: f64, half: f64) -> Self {
        let [low, high] = [middle - half, middle + half];
        Self { low, high }
    }

    /// That of the column at a place among the numbers of a row.
    pub fn of(columns: &[Column], place: usize, numbers: &[Option<f64>]) -> Option<Self> {
        if !has_interval(columns, place) {
            return None;
        }
        Some(Self {
            low: numbers[place + 1]?,
            high: numbers[place + 2]?,
        })
    }
}

/// Two columns, `NAME_low` and `NAME_high`; the meaning is that of the first.
impl Row for Option<Interval> {
    fn columns_as(described: Column) -> Vec<Column> {
        let end = |end: &str, class, meaning| Column {
            name: format!("{}_{end}", described.name).into(),
            meaning,
            class,
            nullable: true,
            ..described.clone()
        };
        vec![
            end("low", Class::Low, described.meaning),
            end("high", Class::High, "upper end"),
        ]
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(self.map(|interval| interval.low).value());
        give(self.map(|interval| interval.high).value());
    }

    fn from_cells<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        match (next(), next()) {
            (Value::Real(low), Value::Real(high)) => Ok(Some(Interval { low, high })),
            (Value::Null, Value::Null) => Ok(None),
            _ => Err(format!(
                "column {name}_low or {name}_high: one end of an interval is missing"
            )),
        }
    }
}

/// Describes the columns of a row type: see the head of `columns.rs`.
#[macro_export]
macro_rules! columns {
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $name:literal) => { $name };
    (@text) => { "" };
    (@text $text:tt) => { $text };
    (@class) => { $crate::columns::Class::Plain };
    (@class $class:expr) => { $class };
    (@in) => { "" };
    (@in "") => { "" };
    (@in $unit:tt) => { concat!(", in ", $unit) };
    ($(#[$attribute:meta])* $visibility:vis struct $row:ident {
        $($field:ident $(as $name:literal)? : $type:ty
            $(= $unit:tt, $meaning:tt $(, $symbol:literal $($words:literal)? $(, $class:expr)?)?)?;)*
    }) => {
        $(#[$attribute])*
        #[allow(rustdoc::invalid_html_tags, reason = "meanings are plain text")]
        $visibility struct $row {
            $(
                #[doc = concat!($crate::columns!(@text $($meaning)?), $crate::columns!(@in $($unit)?), ".")]
                $visibility $field: $type,
            )*
        }

        impl $crate::columns::Row for $row {
            fn columns_as(_: $crate::columns::Column) -> Vec<$crate::columns::Column> {
                [$(<$type as $crate::columns::Row>::columns_as($crate::columns::Column {
                    name: $crate::columns!(@name $field $($name)?).into(),
                    unit: $crate::columns!(@text $($unit)?),
                    meaning: $crate::columns!(@text $($meaning)?),
                    symbol: $crate::columns!(@text $($($symbol)?)?),
                    words: $crate::columns!(@text $($($($words)?)?)?),
                    class: $crate::columns!(@class $($($($class)?)?)?),
                    ..$crate::columns::Column::default()
                })),*].concat()
            }

            fn cells(&self, give: &mut dyn FnMut($crate::columns::Value<'_>)) {
                $($crate::columns::Row::cells(&self.$field, give);)*
            }

            fn from_cells<'a>(
                _: &str,
                next: &mut dyn FnMut() -> $crate::columns::Value<'a>,
            ) -> Result<Self, String> {
                $(let $field = $crate::columns::Row::from_cells(
                    $crate::columns!(@name $field $($name)?),
                    next,
                )?;)*
                Ok(Self { $($field),* })
            }
        }
    };
}
pub use columns;

/// Rows that many rows share need not be cloned to be written.
impl<T: Row + Clone> Row for Cow<'_, T> {
    fn columns_as(_: Column) -> Vec<Column> {
        T::columns()
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        self.as_ref().cells(give);
    }

    fn from_cells<'a>(_: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        T::from_cells("", next).map(Cow::Owned)
    }
}

/// Rows side by side are a row.
macro_rules! side_by_side {
    ($($part:ident),*) => {
        impl<$($part: Row),*> Row for ($($part,)*) {
            fn columns_as(_: Column) -> Vec<Column> {
                [$($part::columns()),*].concat()
            }

            #[allow(non_snake_case, reason = "a part is called as its type")]
            fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
                let ($($part,)*) = self;
                $($part.cells(give);)*
            }

            fn from_cells<'a>(_: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
                Ok(($($part::from_cells("", next)?,)*))
            }
        }
    };
}

side_by_side!(A, B);
side_by_side!(A, B, C);
