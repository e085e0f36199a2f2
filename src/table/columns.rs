//! Columns: name, unit, meaning and value of each written once, in the row type that holds them.
//!
//! ```ignore
//! columns! {
//!     /// What one row is.
//!     #[derive(Clone, Copy, Debug)]
//!     pub struct Reading {
//!         /// (docs of a field follow from its unit and meaning)
//!         force: f64 = "N", "shear force";
//!         phase: Option<f64> = "rad", "phase of the onset, null without modulation";
//!         number as "slip": u64 = "", "number of the slip";
//!     }
//! }
//! ```
//!
//! From this follow the struct and its documentation, the columns with their types, a writer and a reader. `name as "key"` is
//! for a field that is called otherwise than its column. A field without unit and meaning holds the columns of another row
//! type, or is a projection: it reads a column that another row type describes. Rows side by side are tuples. Nothing here
//! knows Arrow, files or JSON. No derive that exists fits: serde_arrow 0.15 has no place for units and meanings beside a
//! field, typed-arrow 0.8 ends at Arrow 59 and would bind the physics to it, parquet_derive 60 writes no Arrow schema.

pub use super::value::{Field, Kind, Value};
use std::borrow::Cow;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    pub name: Cow<'static, str>,
    /// SI unit; empty for a pure number or a text.
    pub unit: &'static str,
    /// One line, without a full stop.
    pub meaning: &'static str,
    pub kind: Kind,
    pub nullable: bool,
}

/// A type whose values are rows, or parts of rows.
pub trait Row {
    /// Its columns, in order.
    fn columns() -> Vec<Column>;

    /// Gives the cells of a row, in the order of the columns.
    fn cells(&self, give: &mut dyn FnMut(Value<'_>));
}

/// A row that can be read back.
pub trait FromRow: Row + Sized {
    /// The row with these cells, in the order of the columns.
    fn from_cells<'a>(next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String>;
}

/// A table whose rows are of this type.
pub trait Table: Row {
    /// Name, which is also that of its folder or file.
    const NAME: &'static str;
    /// What a row is; one line, without a full stop.
    const MEANING: &'static str;
}

/// Row types of tables, each with the name of its table and what a row is.
macro_rules! tables {
    ($($row:ty = $name:expr, $meaning:expr;)*) => {
        $(impl $crate::table::columns::Table for $row {
            const NAME: &'static str = $name;
            const MEANING: &'static str = $meaning;
        })*
    };
}
pub(crate) use tables;

/// A field of a row type: one cell, several that belong together, or all the cells of another row. What the macro `columns` is built on.
pub trait Part: Sized {
    /// The columns of a field with this name, unit and meaning.
    fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column>;

    fn give(&self, give: &mut dyn FnMut(Value<'_>));

    /// Reads the cells of a field with this name.
    fn take<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String>;
}

impl<T: Field> Part for T {
    fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column> {
        vec![Column { name: name.into(), unit, meaning, kind: T::KIND, nullable: T::NULLABLE }]
    }

    fn give(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(self.value());
    }

    fn take<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        let cell = next();
        T::from_value(cell).ok_or_else(|| format!("column {name} cannot hold {cell:?}"))
    }
}

/// A text of a row's own is no [`Field`]: its value does not outlive the row.
impl Part for String {
    fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column> {
        vec![Column { name: name.into(), unit, meaning, kind: Kind::Text, nullable: false }]
    }

    fn give(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(Value::Text(self));
    }

    fn take<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        <Option<Self> as Part>::take(name, next)?.ok_or_else(|| format!("column {name} cannot hold {:?}", Value::Null))
    }
}

impl Part for Option<String> {
    fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column> {
        vec![Column { name: name.into(), unit, meaning, kind: Kind::Text, nullable: true }]
    }

    fn give(&self, give: &mut dyn FnMut(Value<'_>)) {
        give(self.as_deref().map_or(Value::Null, Value::Text));
    }

    fn take<'a>(name: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        match next() {
            Value::Null => Ok(None),
            Value::Text(text) => Ok(Some(text.to_owned())),
            value => Err(format!("column {name} cannot hold {value:?}")),
        }
    }
}

/// Row types as fields of other row types.
macro_rules! part {
    ($row:ty $(where $($parameter:ident: $bound:path),*)?) => {
        impl $(<$($parameter: $bound),*>)? $crate::table::columns::Part for $row {
            fn columns_as(_: &'static str, _: &'static str, _: &'static str) -> Vec<$crate::table::columns::Column> {
                <Self as $crate::table::columns::Row>::columns()
            }

            fn give(&self, give: &mut dyn FnMut($crate::table::columns::Value<'_>)) {
                $crate::table::columns::Row::cells(self, give);
            }

            fn take<'a>(
                _: &str,
                next: &mut dyn FnMut() -> $crate::table::columns::Value<'a>,
            ) -> Result<Self, String> {
                $crate::table::columns::FromRow::from_cells(next)
            }
        }
    };
}
pub(crate) use part;

/// Describes the columns of a row type: see the head of `table/columns.rs`.
macro_rules! columns {
    (@name $field:ident) => { stringify!($field) };
    (@name $field:ident $name:literal) => { $name };
    (@text) => { "" };
    (@text $text:tt) => { $text };
    (@in) => { "" };
    (@in "") => { "" };
    (@in $unit:tt) => { concat!(", in ", $unit) };
    ($(#[$attribute:meta])* $visibility:vis struct $row:ident {
        $($field:ident $(as $name:literal)? : $type:ty $(= $unit:tt, $meaning:tt)?;)*
    }) => {
        $(#[$attribute])*
        #[allow(rustdoc::invalid_html_tags, reason = "meanings are plain text")]
        $visibility struct $row {
            $(
                #[doc = concat!($crate::table::columns::columns!(@text $($meaning)?), $crate::table::columns::columns!(@in $($unit)?), ".")]
                $visibility $field: $type,
            )*
        }

        impl $crate::table::columns::Row for $row {
            fn columns() -> Vec<$crate::table::columns::Column> {
                [$(<$type as $crate::table::columns::Part>::columns_as(
                    $crate::table::columns::columns!(@name $field $($name)?),
                    $crate::table::columns::columns!(@text $($unit)?),
                    $crate::table::columns::columns!(@text $($meaning)?),
                )),*].concat()
            }

            fn cells(&self, give: &mut dyn FnMut($crate::table::columns::Value<'_>)) {
                $($crate::table::columns::Part::give(&self.$field, give);)*
            }
        }

        impl $crate::table::columns::FromRow for $row {
            fn from_cells<'a>(
                next: &mut dyn FnMut() -> $crate::table::columns::Value<'a>,
            ) -> Result<Self, String> {
                $(let $field = $crate::table::columns::Part::take(
                    $crate::table::columns::columns!(@name $field $($name)?),
                    next,
                )?;)*
                Ok(Self { $($field),* })
            }
        }

        $crate::table::columns::part!($row);
    };
}
pub(crate) use columns;

impl<T: Row> Row for &T {
    fn columns() -> Vec<Column> {
        T::columns()
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        (*self).cells(give);
    }
}

/// Rows side by side are a row.
macro_rules! side_by_side {
    ($($part:ident),*) => {
        impl<$($part: Row),*> Row for ($($part,)*) {
            fn columns() -> Vec<Column> {
                [$($part::columns()),*].concat()
            }

            #[allow(non_snake_case, reason = "a part is called as its type")]
            fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
                let ($($part,)*) = self;
                $($part.cells(give);)*
            }
        }

        impl<$($part: FromRow),*> FromRow for ($($part,)*) {
            fn from_cells<'a>(next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
                Ok(($($part::from_cells(next)?,)*))
            }
        }
    };
}

side_by_side!(A, B);
side_by_side!(A, B, C);
side_by_side!(A, B, C, D);

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::documented::markdown;
    use crate::model::selected::{Selected, Selection};
    use crate::model::{BreakOn, Symbol};

    columns! {
        /// One reading.
        #[derive(Clone, Debug, PartialEq)]
        pub struct Reading {
            force: f64 = "N", "shear force";
            phase: Option<f64> = "rad", "phase of the onset";
            position as "number": u64 = "", "number of the reading";
            name: String = "", "its name";
            is_high as "high": bool = "", "above 1 N";
            rule: Option<BreakOn> = "", "when its contacts break";
        }
    }

    /// A period and a rule.
    #[derive(Clone, Debug, PartialEq)]
    pub struct PeriodAndRule;

    impl Selection for PeriodAndRule {
        const SYMBOLS: &'static [Symbol] = &[Symbol::Delta, Symbol::T, Symbol::BreakOn];
    }

    pub(crate) type Readings = (Reading, Selected<PeriodAndRule>);

    tables! { Readings = "readings", "One row per reading"; }

    #[cfg(feature = "sweeps")]
    pub(crate) fn readings() -> [Readings; 2] {
        use crate::model::Parameters;

        let modulated =
            Parameters { modulation_amplitude: 1e-6, modulation_period: Some(0.01), ..Parameters::default() };
        let reading = |force, phase, position, rule| Reading {
            force,
            phase,
            position,
            name: format!("reading {position}"),
            is_high: force > 1.0,
            rule,
        };
        [
            (reading(1.5, None, 1, None), Selected::new(Parameters::default())),
            (reading(-2.5, Some(0.25), 2, Some(BreakOn::Tension)), Selected::new(modulated)),
        ]
    }

    #[test]
    fn a_column_has_its_name_unit_meaning_and_kind() {
        let columns = Readings::columns();
        let described = |name: &str| {
            let column = columns.iter().find(|column| column.name == name).unwrap();
            (column.unit, column.meaning, column.kind, column.nullable)
        };
        assert_eq!(described("phase"), ("rad", "phase of the onset", Kind::Real, true));
        assert_eq!(described("number"), ("", "number of the reading", Kind::Count, false));
        assert_eq!(described("T"), ("s", Symbol::T.description().meaning, Kind::Real, true));
        assert_eq!(described("break_on").2, Kind::Text);
    }

    #[test]
    fn a_cell_that_a_column_cannot_hold_is_named() {
        let error = Reading::from_cells(&mut || Value::Null).unwrap_err();
        assert!(error.contains("column force cannot hold Null"), "{error}");
        let period = |value: f64| {
            let mut cells = [Value::Real(1e-6), Value::Real(value), Value::Text("magnitude")].into_iter();
            Selected::<PeriodAndRule>::from_cells(&mut || cells.next().unwrap())
        };
        assert!(period(-1.0).unwrap_err().contains("T = -1"));
    }

    #[test]
    fn the_documentation_has_a_line_for_each_column() {
        let text = markdown::<Readings>();
        assert!(text.starts_with("## readings\n\nOne row per reading.\n"), "{text}");
        assert!(text.contains("| `phase` | rad? | phase of the onset |\n"), "{text}");
    }
}
