//! The paper's equations: parameters, drive, slider, interface, disorder, theory. Knows no solver and no file.

mod disorder;
mod drive;
mod interface;
mod lanes;
mod parameters;
pub mod slider;
pub mod theory;

pub use disorder::{Contact, Disorder, RNG_SCHEME};
pub use drive::Drive;
pub use interface::{Change, ContactEvent, Interface};
pub(crate) use lanes::{LANES, Row};
pub(crate) use parameters::Shortest;
pub use parameters::{BreakOn, Description, ParameterError, Parameters, Symbol, Value};

/// Version of the equations and definitions; part of every job id. Raised when the same parameters give other results.
pub const MODEL_VERSION: u32 = 2;
