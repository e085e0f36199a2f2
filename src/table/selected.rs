//! Parameters as columns of a row.

use crate::model::{Parameters, Symbol, Value};
use crate::table::columns::{Cell, Column, FromRow, Kind, Row, part};
use std::marker::PhantomData;
use std::ops::Deref;

/// Which parameters stand in a row.
pub trait Selection {
    /// Their symbols, in order.
    const SYMBOLS: &'static [Symbol];
}

/// Some of the parameters as columns, under their keys and with their units and meanings. Read back, the others have their
/// defaults.
#[derive(Clone, Debug, PartialEq)]
pub struct Selected<S> {
    pub parameters: Parameters,
    selection: PhantomData<S>,
}

impl<S> Selected<S> {
    /// The columns of these parameters.
    pub const fn new(parameters: Parameters) -> Self {
        Self { parameters, selection: PhantomData }
    }
}

impl<S> Default for Selected<S> {
    fn default() -> Self {
        Self::new(Parameters::default())
    }
}

impl<S> Deref for Selected<S> {
    type Target = Parameters;

    fn deref(&self) -> &Parameters {
        &self.parameters
    }
}

impl<S: Selection> Row for Selected<S> {
    fn columns() -> Vec<Column> {
        let defaults = Parameters::default();
        let column = |&symbol: &Symbol| {
            let described = symbol.description();
            let (kind, nullable) = match defaults.get(symbol) {
                Value::Count(_) => (Kind::Count, false),
                Value::Real(_) => (Kind::Real, false),
                Value::BreakOn(_) => (Kind::Text, false),
                Value::Flag(_) => (Kind::Flag, false),
                Value::Absent => (Kind::Real, true),
            };
            Column { name: described.key.into(), unit: described.unit, meaning: described.meaning, kind, nullable }
        };
        S::SYMBOLS.iter().map(column).collect()
    }

    fn cells(&self, give: &mut dyn FnMut(Cell<'_>)) {
        for &symbol in S::SYMBOLS {
            give(match self.parameters.get(symbol) {
                Value::Count(count) => Cell::Count(count),
                Value::Real(real) => Cell::Real(real),
                Value::BreakOn(rule) => Cell::Text(rule.word()),
                Value::Flag(flag) => Cell::Flag(flag),
                Value::Absent => Cell::Null,
            });
        }
    }
}

part!(Selected<S> where S: Selection);

impl<S: Selection> FromRow for Selected<S> {
    fn from_cells<'a>(next: &mut dyn FnMut() -> Cell<'a>) -> Result<Self, String> {
        let mut parameters = Parameters::default();
        for &symbol in S::SYMBOLS {
            let value = match next() {
                Cell::Count(count) => Value::Count(count),
                Cell::Real(real) => Value::Real(real),
                Cell::Text(word) => word.parse().map_or(Value::Absent, Value::BreakOn),
                Cell::Flag(flag) => Value::Flag(flag),
                Cell::Null => Value::Absent,
            };
            parameters.set(symbol, value).map_err(|error| error.to_string())?;
        }
        parameters.validated().map(Self::new).map_err(|error| error.to_string())
    }
}
