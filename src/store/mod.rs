//! Store: tables as Parquet files, committed so that a folder holds whole files only, whatever happens.
//!
//! ```text
//! columns.rs -> tables.rs     what is written: each column described once
//!               records.rs    what one simulation writes on request
//! dataset.rs                  one table as files: same rows, same bytes
//! storage.rs -> commit.rs     files that appear whole or not at all
//! seal.rs                     files that tell their own hash
//! layout.rs, manifest.rs      a directory, and which sweeps it belongs to
//! part.rs                     the rows of some jobs, in all tables at once
//! merge.rs -> compact.rs      all of them, sorted; compaction.rs tells which parts they are
//! verify/                     what is damaged, and its repair
//! ```

pub mod columns;
pub mod commit;
pub mod compact;
pub mod compaction;
pub mod dataset;
pub mod layout;
pub mod manifest;
pub mod merge;
pub mod part;
pub mod records;
pub mod seal;
pub mod storage;
pub mod tables;
pub mod verify;
