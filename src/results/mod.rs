//! A results directory: which sweeps it belongs to, and tables that hold whole files only, whatever happens.
//!
//! ```text
//! tables.rs                   what is written: slips, precursors, jobs
//! commit.rs                   files that appear whole or not at all
//! layout.rs                   where everything lies, and what names say
//! extension_file.rs           which sweeps the tables belong to
//! directory.rs                a directory as it was found
//!   parts.rs                  the rows of a part, in all tables at once
//!   pending.rs                what runs again
//!   rounds.rs                 what a sweep that decides for itself runs next
//!   workers.rs, claims.rs     who is at work, and at what
//!   deaths.rs                 at what workers died
//!   events.rs                 what happens, and its log
//!   verify.rs                 what is damaged, and its repair
//!   joined.rs                 tables with columns of their jobs
//!   export.rs                 a few large files for other tools
//! destination.rs              files and folders outside of it, which a command writes
//! ```

pub mod claims;
pub mod commit;
pub mod deaths;
pub mod destination;
pub mod directory;
pub mod events;
pub mod export;
mod extension_file;
pub mod joined;
pub mod layout;
pub mod parts;
pub mod pending;
pub mod rounds;
pub mod tables;
pub mod verify;
pub mod workers;

pub use crate::table::error::{ErrorKind, ResultsError};
pub use directory::Results;
#[cfg(test)]
pub(crate) use extension_file::tests::of_other_versions;
