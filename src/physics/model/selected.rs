//! Parameters as columns of a row.

use super::{Parameters, Symbol};
use crate::columns::{Column, FromRow, Row, Value, part};
use std::marker::PhantomData;
use std::ops::Deref;

/// Which parameters stand in a row.
pub trait Selection {
    /// Their symbols, in order.
    const SYMBOLS: &'static [Symbol];
}

/// Some of the parameters as columns, under their keys and with their units and meanings. Read back, the others have their
/// defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selected<S> {
    pub parameters: Parameters,
    selection: PhantomData<S>,
}

impl<S> Selected<S> {
    /// The columns of these parameters.
    pub const fn new(parameters: Parameters) -> Self {
        Self {
            parameters,
            selection: PhantomData,
        }
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
        let columns = S::SYMBOLS.iter();
        columns
            .map(|symbol| symbol.description().column())
            .collect()
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        for &symbol in S::SYMBOLS {
            give(self.parameters.get(symbol));
        }
    }
}

part!(Selected<S> where S: Selection);

impl<S: Selection> FromRow for Selected<S> {
    fn from_cells<'a>(next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        let mut parameters = Parameters::default();
        for &symbol in S::SYMBOLS {
            parameters
                .set(symbol, next())
                .map_err(|error| error.to_string())?;
        }
        parameters
            .validated()
            .map(Self::new)
            .map_err(|error| error.to_string())
    }
}
