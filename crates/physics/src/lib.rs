//! The physics, for any program: the slider held by breakable contacts of Capozza et al., "Stabilizing stick-slip
//! friction", PRL 107, 024301 (2011). Knows no sweep and no file.
//!
//! ```text
//! model/       the paper's equations: parameters, drive, slider, interface, disorder, theory
//! solver/      advances a model from event to event
//! observe/     turns events into measurements
//! columns.rs   name, unit, meaning and value of each column -> row types
//! value.rs     the value of a field outside its struct, and the types of fields
//! ```
//!
//! Imports run one way: `value` <- `columns` <- `model` <- `solver` <- `observe`.

pub mod columns;
pub mod model;
pub mod observe;
pub mod solver;
pub mod value;

#[doc = include_str!("../README.md")]
#[cfg(doctest)]
struct Readme;
