//! The paper's equations: parameters, equation of motion, drive, interface, disorder, theory. Knows no solver and no
//! file.

mod disorder;
mod drive;
pub mod equation;
pub mod fields;
mod interface;
mod parameters;
mod reattachments;
pub(crate) mod simd;
pub mod theory;

pub use disorder::{Contact, Disorder, RNG_SCHEME, standard_normal_quantile};
pub use drive::Drive;
pub use fields::Description;
pub(crate) use interface::{AttachedContacts, ReachedContact};
pub use interface::{Change, ContactChange, ContactEvent, Interface};
pub use parameters::{BreakOn, ParameterError, Parameters, Selected, Selection, Symbol};
pub(crate) use simd::{LANES, Row};

/// The value of a parameter, in a file, on an axis or in a table.
pub type Value = crate::value::Value<'static>;

/// Version of equations, definitions and defaults; part of every job id. Raised when the same parameters, or a file
/// that leaves them out, give other results.
pub const MODEL_VERSION: u32 = 8;
