//! Store: tables as Parquet files, committed so that a folder holds whole files only, whatever happens.

pub mod columns;
pub mod storage;
pub mod tables;
