//! Tables: columns described once, and Parquet files that are whole or not there.
//!
//! ```text
//! value.rs       the value of a field outside its struct, and the types of fields
//! columns.rs     name, unit, meaning and value of each column -> row types
//! arrow.rs       rows as record batches and as JSON
//! file.rs        one table as a file: the same rows, the same bytes
//! formats.rs     rows in the formats of other programs
//! error.rs       why a file cannot be written or read
//! checksum.rs    files that hold their own SHA-256
//! shown.rs       paths and texts in messages
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
#[cfg(feature = "sweeps")]
pub mod formats;
#[cfg(feature = "sweeps")]
pub mod shown;
#[cfg(feature = "sweeps")]
pub mod storage;
pub mod value;
