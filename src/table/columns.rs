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

use crate::model::{BreakOn, Symbol};
use std::borrow::Cow;

/// What the cells of a column hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Real,
    Count,
    Flag,
    Text,
}

impl Kind {
    pub const fn word(self) -> &'static str {
        match self {
            Self::Real => "real",
            Self::Count => "count",
            Self::Flag => "flag",
            Self::Text => "text",
        }
    }
}

/// The value of a column in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// A value that is missing.
    Null,
    Real(f64),
    Count(u64),
    Flag(bool),
    Text(&'a str),
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    pub name: Cow<'static, str>,
    /// SI unit; empty for a pure number or a text.
    pub unit: &'static str,
    /// One line, without a full stop.
    pub meaning: &'static str,
    pub kind: Kind,
    /// Whether cells may be null.
    pub nullable: bool,
}

/// A type that a cell can hold.
pub trait Field: Sized {
    const KIND: Kind;
    /// Whether it may be null.
    const NULLABLE: bool = false;

    /// The value as a cell.
    fn cell(&self) -> Cell<'_>;

    /// The value of a cell; `None` if the cell cannot be one.
    fn from_cell(cell: Cell<'_>) -> Option<Self>;
}

/// A type whose values are rows, or parts of rows.
pub trait Row {
    /// Its columns, in order.
    fn columns() -> Vec<Column>;

    /// Gives the cells of a row, in the order of the columns.
    fn cells(&self, give: &mut dyn FnMut(Cell<'_>));
}

/// A row that can be read back.
pub trait FromRow: Row + Sized {
    /// The row with these cells, in the order of the columns.
    fn from_cells<'a>(next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String>;
}

/// A table whose rows are of this type.
pub trait Table: Row {
    /// Name, which is also that of its folder or file.
    const NAME: &'static str;
    /// What a row is; one line, without a full stop.
    const MEANING: &'static str;
}

/// A field of a row type: one cell, several that belong together, or all the cells of another row. What the macro `columns` is built on.
pub trait Part: Sized {
    /// The columns of a field with this name, unit and meaning.
    fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column>;

    fn give(&self, give: &mut dyn FnMut(Cell<'_>));

    /// Reads the cells of a field with this name.
    fn take<'a>(name: &str, next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String>;
}

impl<T: Field> Part for T {
    fn columns_as(name: &'static str, unit: &'static str, meaning: &'static str) -> Vec<Column> {
        vec![Column { name: name.into(), unit, meaning, kind: T::KIND, nullable: T::NULLABLE }]
    }

    fn give(&self, give: &mut dyn FnMut(Cell<'_>)) {
        give(self.cell());
    }

    fn take<'a>(name: &str, next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String> {
        let cell = next();
        T::from_cell(cell).ok_or_else(|| format!("column {name} cannot hold {cell:?}"))
    }
}

/// Row types as fields of other row types.
macro_rules! part {
    ($row:ty $(where $($parameter:ident: $bound:path),*)?) => {
        impl $(<$($parameter: $bound),*>)? $crate::table::columns::Part for $row {
            fn columns_as(_: &'static str, _: &'static str, _: &'static str) -> Vec<$crate::table::columns::Column> {
                <Self as $crate::table::columns::Row>::columns()
            }

            fn give(&self, give: &mut dyn FnMut($crate::table::columns::Cell<'_>)) {
                $crate::table::columns::Row::cells(self, give);
            }

            fn take<'a>(
                _: &str,
                next: &mut dyn FnMut() -> $crate::table::columns::Cell<'a>,
            ) -> Result<Self, String> {
                $crate::table::columns::FromRow::from_cells(next)
            }
        }
    };
}
pub(crate) use part;

/// The section of a table in the documentation, in Markdown. Parameters of the model, described on a page of their own,
/// share a line, and so do the ends of an interval; a unit with `?` is that of a column that may be null.
pub fn markdown<T: Table>() -> String {
    let is_parameter = |column: &Column| {
        Symbol::from_key(&column.name).is_some_and(|symbol| symbol.description().meaning == column.meaning)
    };
    let share_a_line = |one: &Column, next: &Column| {
        let is_pair = one.name.strip_suffix("_low").is_some_and(|name| next.name.strip_suffix("_high") == Some(name));
        (is_parameter(one) && is_parameter(next)) || (is_pair && one.meaning.starts_with(LOWER_END))
    };
    let line = |columns: &[Column]| {
        let names: Vec<String> = columns.iter().map(|column| format!("`{}`", column.name)).collect();
        let names = names.join(" ");
        let Column { unit, meaning, kind, nullable, .. } = &columns[0];
        if is_parameter(&columns[0]) {
            return format!("| {names} | | [parameters](model.md#parameters) |\n");
        }
        let unit = match kind {
            Kind::Real if unit.is_empty() => "1",
            Kind::Real => unit,
            kind => kind.word(),
        };
        let nullable = if *nullable { "?" } else { "" };
        let meaning = meaning.replace(LOWER_END, "ends of").replace('|', "\\|").replace('<', "\\<");
        format!("| {names} | {unit}{nullable} | {meaning} |\n")
    };
    let rows: String = T::columns().chunk_by(share_a_line).map(line).collect();
    format!("## {}\n\n{}.\n\n| column | unit | meaning |\n|---|---|---|\n{rows}", T::NAME, T::MEANING)
}

/// How the meaning of the lower end of an interval begins.
const LOWER_END: &str = "lower end of";

/// How the pages of tables show units and kinds.
#[cfg(all(test, feature = "sweeps"))]
pub(crate) const UNITS: &str = "Quantities are SI reals in the unit given (1: a pure number), `count` (a signed 64-bit integer), `flag` or `text`.\n\
    A `?` marks columns that may be null.\n";

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

            fn cells(&self, give: &mut dyn FnMut($crate::table::columns::Cell<'_>)) {
                $($crate::table::columns::Part::give(&self.$field, give);)*
            }
        }

        impl $crate::table::columns::FromRow for $row {
            fn from_cells<'a>(
                next: &mut dyn FnMut() -> $crate::table::columns::Cell<'a>,
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

/// Fields of one kind of cell.
macro_rules! fields {
    ($($type:ty: $kind:ident, |$value:ident| $cell:expr, |$read:ident| $back:expr;)*) => {
        $(impl Field for $type {
            const KIND: Kind = Kind::$kind;

            fn cell(&self) -> Cell<'_> {
                let $value = self;
                Cell::$kind($cell)
            }

            fn from_cell(cell: Cell<'_>) -> Option<Self> {
                if let Cell::$kind($read) = cell { $back } else { None }
            }
        })*
    };
}

fields! {
    f64: Real, |value| *value, |real| Some(real);
    u64: Count, |value| *value, |count| Some(count);
    bool: Flag, |value| *value, |flag| Some(flag);
    String: Text, |value| value, |text| Some(text.to_owned());
    Symbol: Text, |value| value.key(), |text| Symbol::from_key(text);
    BreakOn: Text, |value| value.word(), |text| text.parse().ok();
}
pub(crate) use fields;

impl<T: Field> Field for Option<T> {
    const KIND: Kind = T::KIND;
    const NULLABLE: bool = true;

    fn cell(&self) -> Cell<'_> {
        self.as_ref().map_or(Cell::Null, T::cell)
    }

    fn from_cell(cell: Cell<'_>) -> Option<Self> {
        if cell == Cell::Null { Some(None) } else { T::from_cell(cell).map(Some) }
    }
}

impl<T: Row> Row for &T {
    fn columns() -> Vec<Column> {
        T::columns()
    }

    fn cells(&self, give: &mut dyn FnMut(Cell<'_>)) {
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
            fn cells(&self, give: &mut dyn FnMut(Cell<'_>)) {
                let ($($part,)*) = self;
                $($part.cells(give);)*
            }
        }

        impl<$($part: FromRow),*> FromRow for ($($part,)*) {
            fn from_cells<'a>(next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String> {
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
    use crate::table::selected::{Selected, Selection};

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

    impl Table for Readings {
        const NAME: &'static str = "readings";
        const MEANING: &'static str = "One row per reading";
    }

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
        let error = Reading::from_cells(&mut || Cell::Null).unwrap_err();
        assert!(error.contains("column force cannot hold Null"), "{error}");
        let period = |value: f64| {
            let mut cells = [Cell::Real(1e-6), Cell::Real(value), Cell::Text("magnitude")].into_iter();
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
