//! A results directory: which sweeps it belongs to, and tables that hold whole files only, whatever happens.
//!
//! ```text
//! tables.rs                   what is written: slips, precursors, jobs
//! commit.rs                   files that appear whole or not at all
//! layout.rs                   where everything lies, and what names mean
//! extension_file.rs           which sweeps the tables belong to
//! directory.rs                an opened directory
//!   parts.rs                  the rows of a part, in all tables at once
//!   pending.rs                what runs again
//!   next_round.rs             what an adaptive sweep runs next
//!   workers.rs                running workers
//!   claims.rs                 the parts that they run, and those at which they died
//!   log.rs                    events of runs, and their log
//!   verification.rs           damage, and its repair
//!   exported.rs               tables with columns of their jobs, as a few large files for other tools
//! destination.rs              files and folders outside of the data, which a command writes
//! ```

pub mod claims;
pub mod commit;
pub mod destination;
pub mod directory;
pub mod exported;
mod extension_file;
pub mod layout;
pub mod log;
pub mod next_round;
pub mod parts;
pub mod pending;
pub mod tables;
pub mod verification;
pub mod workers;

pub use crate::table::error::{ErrorKind, ResultsError};
pub use directory::Results;
#[cfg(test)]
pub(crate) use extension_file::tests::of_other_versions;
