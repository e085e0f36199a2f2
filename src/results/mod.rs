//! A results directory: which sweeps it belongs to, and tables that hold whole files only, whatever happens.
//!
//! ```text
//! tables.rs                   what is written: slips, precursors, jobs
//! commit.rs                   files that appear whole or not at all
//! layout.rs, manifest.rs      a directory, and which sweeps it belongs to
//! part.rs                     the rows of some jobs, in all tables at once
//! merge.rs -> compact.rs      all of them, sorted; compaction.rs records which parts they are
//! verify/                     what is damaged, and its repair
//! ```

pub mod commit;
pub mod compact;
pub mod compaction;
pub mod layout;
pub mod manifest;
pub mod merge;
pub mod part;
pub mod tables;
pub mod verify;
