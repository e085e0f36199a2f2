//! Tables: columns described once, and Parquet files that are whole or not there.

pub mod arrow;
pub mod checksum;
pub mod error;
pub mod file;
pub mod formats;
pub mod shown;
pub mod storage;
#[cfg(test)]
pub(crate) mod tests;

pub use stickslip_physics::{columns, value};

pub trait Table: columns::Row {
    /// Name, which is also that of its folder or file.
    const NAME: &'static str;
    /// What a row is; one line, without a full stop.
    const MEANING: &'static str;
}

/// Row types of tables, each with the name of its table and what a row is.
macro_rules! tables {
    ($($row:ty = $name:expr, $meaning:expr;)*) => {
        $(impl $crate::table::Table for $row {
            const NAME: &'static str = $name;
            const MEANING: &'static str = $meaning;
        })*
    };
}
pub(crate) use tables;
