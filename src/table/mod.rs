//! Tables: columns described once, and Parquet files that are whole or not there.
//!
//! ```text
//! columns.rs     name, unit, meaning and value of each column -> schema, rows, documentation
//! file.rs        one table as a file: the same rows, the same bytes
//! checksum.rs    files that hold their own SHA-256
//! storage.rs     the few file operations, so that a faulty disk can be put underneath
//! ```

pub mod checksum;
pub mod columns;
pub mod file;
pub mod storage;
