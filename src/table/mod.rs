//! Tables: columns described once, and Parquet files that are whole or not there.
//!
//! ```text
//! columns.rs     name, unit, meaning and value of each column -> row types, documentation
//! selected.rs    parameters as columns
//! arrow.rs       rows as record batches and as JSON
//! file.rs        one table as a file: the same rows, the same bytes
//! error.rs       why a file cannot be written or read
//! checksum.rs    files that hold their own SHA-256
//! storage.rs     the few file operations, so that a faulty disk can be put underneath
//! ```

#[cfg(feature = "sweeps")]
pub mod arrow;
#[cfg(feature = "sweeps")]
pub mod checksum;
pub mod columns;
#[cfg(feature = "sweeps")]
pub mod error;
#[cfg(feature = "sweeps")]
pub mod file;
pub mod selected;
#[cfg(feature = "sweeps")]
pub mod storage;
