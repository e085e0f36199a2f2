//! The paper's equations: parameters, equation of motion, drive, interface, disorder, theory. Knows no solver and no file.

mod disorder;
mod drive;
pub mod equation;
pub(crate) mod fields;
mod interface;
mod lanes;
mod parameters;
mod reattachments;
pub mod theory;
pub(crate) mod value;

pub use disorder::{Contact, Disorder, RNG_SCHEME};
pub use drive::Drive;
pub use fields::Description;
pub use interface::{Change, ContactEvent, Interface};
pub(crate) use lanes::{LANES, Row};
pub use parameters::{ParameterError, Parameters, Symbol};
#[cfg(feature = "sweeps")]
pub(crate) use value::Shortest;
pub use value::{BreakOn, Value};

/// Version of equations, definitions and defaults; part of every job id. Raised when the same parameters, or a file that leaves
/// them out, give other results.
pub const MODEL_VERSION: u32 = 3;
