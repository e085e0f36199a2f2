//! A results directory: which sweeps it belongs to, and tables that hold whole files only, whatever happens.
//!
//! ```text
//! tables.rs                   what is written: slips, precursors, jobs
//! commit.rs                   files that appear whole or not at all
//! layout.rs, manifest.rs      where everything lies, and which sweeps it belongs to
//! handle.rs                   a directory that fits this program
//!   parts.rs                  which parts are done, and the rows of one, in all tables at once
//!   rounds.rs                 what a sweep that decides for itself runs next
//!   workers.rs, claims.rs     who is at work, and at what
//!   events.rs                 what happens, and its log
//!   compact.rs, merge.rs      many parts in one file, many directories in one
//!   verify/                   what is damaged, and its repair
//! error.rs                    why a directory cannot be used or changed
//! ```

pub mod claims;
pub mod commit;
pub mod compact;
pub mod error;
pub mod events;
pub mod handle;
pub mod layout;
pub mod manifest;
pub mod merge;
pub mod parts;
pub mod rounds;
pub mod tables;
pub mod verify;
pub mod workers;

pub use error::{ErrorKind, ResultsError};
pub use handle::Results;
