//! Tables: columns described once, and Parquet files that are whole or not there.
//!
//! ```text
//! columns.rs     the name of each table
//! arrow.rs       rows as record batches and as JSON
//! file.rs        one table as a file: the same rows, the same bytes
//! formats.rs     rows in the formats of other programs
//! error.rs       why a directory or a file of it cannot be used, written or changed
//! checksum.rs    files that hold their own SHA-256
//! shown.rs       paths and texts in messages
//! storage.rs     the few file operations, so that a faulty disk can be put underneath
//! ```

pub mod arrow;
pub mod checksum;
pub mod columns;
pub mod error;
pub mod file;
pub mod formats;
pub mod shown;
pub mod storage;

pub use stickslip_physics::value;
