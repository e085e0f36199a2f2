//! Logs: where, when and how fast a run worked, as lines of JSON in `run/log/`. Results never depend on them.
//!
//! One file for each run, so that runs on several hosts do not write into each other's.

use crate::results::commit::create_folder;
use crate::results::layout::Layout;
use crate::table::file::PROGRAM;
use crate::table::storage::{Storage, StorageError, StoredFile};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write as _};
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

/// Something that happened during a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Entry {
    /// The run begins.
    Started {
        /// Name of the host.
        host: String,
        /// Id of the process.
        process: u32,
        /// Program and version.
        program: String,
        /// Shard, as `K/N`.
        shard: String,
        /// Number of threads.
        threads: usize,
        /// Jobs to run.
        jobs: u64,
        /// Their predicted CPU time, in s.
        predicted: f64,
    },
    /// A job failed.
    Failed {
        /// Its id.
        job_id: String,
        /// Why.
        reason: String,
        /// The command that does the same.
        command: String,
    },
    /// A part is committed.
    Part {
        /// Name of the part.
        part: String,
        /// Jobs that were run for it.
        jobs: usize,
        /// Those that failed.
        failed: usize,
        /// Predicted CPU time, in s.
        predicted: f64,
        /// Sum of the wall times of its jobs, in s.
        measured: f64,
    },
    /// A committed part was taken away, so that it is run again.
    Withdrawn {
        /// Name of the part.
        part: String,
    },
    /// The run ends by itself.
    Finished {
        /// Whether it was stopped before all was done.
        stopped: bool,
        /// Wall time of the run, in s.
        wall: f64,
    },
    /// The run ends with an error.
    Error {
        /// The error.
        error: String,
    },
}

/// A line of a log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Seconds since 1970 UTC.
    pub time: f64,
    /// What happened.
    #[serde(flatten)]
    pub entry: Entry,
}

/// What a host is called that does not tell its name.
pub(super) const UNKNOWN_HOST: &str = "unknown";

/// Name of this host, or "unknown".
#[must_use]
pub fn host() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").ok()).or_else(|| std::env::var("COMPUTERNAME").ok());
    let name = name.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
    name.unwrap_or_else(|| UNKNOWN_HOST.to_owned())
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

/// The log of one run.
pub struct Log {
    path: PathBuf,
    file: Box<dyn StoredFile>,
}

impl Log {
    /// Begins a log.
    ///
    /// # Errors
    /// When it cannot be created.
    pub fn create(storage: &dyn Storage, layout: &Layout) -> Result<Self, StorageError> {
        let folder = layout.logs();
        create_folder(storage, &folder)?;
        let plain: String =
            host().chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect();
        let path = folder.join(format!("{:.3}-{plain}-{}.jsonl", now(), std::process::id()));
        let file = storage.create(&path).map_err(StorageError::at("create", &path))?;
        Ok(Self { path, file })
    }

    /// Appends a line.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&mut self, entry: Entry) -> Result<(), StorageError> {
        let line = serde_json::to_string(&Line { time: now(), entry }).map_err(std::io::Error::from);
        let written = line.and_then(|line| self.file.write_all(format!("{line}\n").as_bytes()));
        written.map_err(StorageError::at("write", &self.path))
    }
}

impl Entry {
    /// The entry with which a run begins.
    #[must_use]
    pub fn started(shard: String, threads: usize, jobs: u64, predicted: f64) -> Self {
        let program = PROGRAM.to_owned();
        Self::Started { host: host(), process: std::process::id(), program, shard, threads, jobs, predicted }
    }
}

/// Goes through the lines of all logs of a directory, in order of their beginnings. What a killed run left half-written is
/// passed over.
///
/// # Errors
/// When a log cannot be read.
pub fn read(storage: &dyn Storage, layout: &Layout, mut visit: impl FnMut(Line)) -> Result<(), StorageError> {
    let folder = layout.logs();
    for name in storage.list(&folder).map_err(StorageError::at("list", &folder))? {
        let path = folder.join(name);
        let file = storage.open(&path).map_err(StorageError::at("read", &path))?;
        for line in BufReader::new(file).split(b'\n') {
            let line = line.map_err(StorageError::at("read", &path))?;
            if let Ok(line) = serde_json::from_slice(&line) {
                visit(line);
            }
        }
    }
    Ok(())
}

/// Measured over predicted cost of all parts that the logs of a directory tell of; `None` before the first.
///
/// # Errors
/// When a log cannot be read.
pub fn pace(storage: &dyn Storage, layout: &Layout) -> Result<Option<f64>, StorageError> {
    let (mut predicted_so_far, mut measured_so_far) = (0.0, 0.0);
    read(storage, layout, |line| {
        if let Entry::Part { predicted, measured, .. } = line.entry {
            predicted_so_far += predicted;
            measured_so_far += measured;
        }
    })?;
    Ok((predicted_so_far > 0.0).then(|| measured_so_far / predicted_so_far))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::storage::Disk;

    #[test]
    fn a_log_reads_back_without_its_half_written_end() {
        let root = tempfile::tempdir().unwrap();
        let layout = Layout::new(root.path());
        let mut log = Log::create(&Disk, &layout).unwrap();
        let entries = [Entry::started("1/1".to_owned(), 2, 3, 4.0), Entry::Error { error: "disk full".to_owned() }];
        for entry in &entries {
            log.write(entry.clone()).unwrap();
        }
        log.file.write_all(b"{\"time\": 1, \"ev").unwrap();
        let mut read_back = Vec::new();
        read(&Disk, &layout, |line| read_back.push(line.entry)).unwrap();
        assert_eq!(read_back, entries);
    }
}
