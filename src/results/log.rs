//! Events of a run, for displays and for the log.
//!
//! The log is lines of JSON in `run/log/`, one file for each run, so that no two hosts write into one file. Tables
//! never depend on it.

use crate::results::claims::Marked;
use crate::results::commit::own_number;
use crate::results::directory::Results;
use crate::results::layout::is_hidden;
use crate::results::next_round::RoundsSoFar;
use crate::results::workers::{host, plain};
use crate::table::error::ResultsError;
use crate::table::storage::{StorageError, StoredFile};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Read};
use std::time::{SystemTime, UNIX_EPOCH};

/// Something that happened. Costs are CPU times, and all times are in s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum RunEvent {
    Started {
        host: String,
        process: u32,
        program: String,
        /// Shard, as `K/N`.
        shard: String,
        others: usize,
        threads: usize,
        jobs: u64,
        jobs_there: u64,
        predicted_cost: f64,
    },
    RoundBegun {
        jobs: u64,
        predicted_cost: f64,
        #[serde(flatten)]
        rounds: RoundsSoFar,
    },
    /// A job is done, though not yet committed.
    JobDone {
        predicted_cost: f64,
    },
    JobTakesLong {
        /// The command that does the same, to look at it alone.
        command: String,
        predicted_cost: f64,
        wall: f64,
    },
    /// Memory, and not threads, limits the jobs at once: bytes that are free, and bytes that the next job is predicted
    /// to take.
    ShortOfMemory {
        allowed: f64,
        needed: f64,
    },
    Tick,
    /// What other workers have committed since the run began.
    OthersDone {
        jobs: u64,
        predicted_cost: f64,
    },
    /// A job failed; the others continue.
    JobFailed {
        job_id: String,
        reason: String,
        /// The command that does the same, to look at it alone.
        command: String,
        predicted_cost: f64,
    },
    PartCommitted {
        part: String,
        jobs: usize,
        failed: usize,
        predicted_cost: f64,
        measured_cost: f64,
        wall: f64,
    },
    /// The run was asked to stop, or its time is over; jobs in flight are interrupted.
    Stopping,
    /// Not all parts would end in time; the parts that have begun do.
    OutOfTime,
    Finished(RunReport),
    Error {
        error: String,
    },
}

/// What a run did. Jobs count when they are committed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// Jobs run, failed ones included.
    pub jobs_run: u64,
    /// Jobs that count as failed: all that are asked for if all are done and no other worker is there, else those of
    /// this run.
    pub jobs_failed: u64,
    /// Jobs that are missing; other workers run them if this run was not stopped.
    pub jobs_left: u64,
    /// Finished jobs of unfinished parts, which are kept.
    pub jobs_spilled: u64,
    pub parts_committed: u64,
    /// Whether a signal or the walltime stopped the run before all was done.
    pub stopped: bool,
    pub marked: Vec<Marked>,
    /// Hosts of the workers that run the jobs which are left.
    pub hosts: Vec<String>,
    /// Predicted CPU time of the jobs run, in s.
    pub predicted_cost: f64,
    /// Their measured CPU time, in s.
    pub measured_cost: f64,
    /// Wall time of the run, in s.
    pub wall: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rounds: Option<RoundsSoFar>,
}

const MAX_LINE: u64 = 1 << 24;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct LogLine {
    /// Seconds since 1970 UTC.
    time: f64,
    #[serde(flatten)]
    event: RunEvent,
}

/// Seconds since 1970 UTC.
pub fn now() -> f64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0.0, |time| time.as_secs_f64())
}

pub struct Log(StoredFile);

impl Log {
    /// Appends an event. Events of each job or second are left out: they would be millions of lines.
    pub fn write(&mut self, event: &RunEvent) -> Result<(), StorageError> {
        if matches!(
            event,
            RunEvent::JobDone { .. } | RunEvent::OthersDone { .. } | RunEvent::Tick
        ) {
            return Ok(());
        }
        let line = LogLine {
            time: now(),
            event: event.clone(),
        };
        // Texts and numbers always have a form as JSON.
        let json = serde_json::to_string(&line).unwrap_or_default();
        self.0.write(format!("{json}\n").as_bytes())
    }
}

impl Results<'_> {
    pub fn begin_log(&self) -> Result<Log, ResultsError> {
        self.check_place()?;
        let folder = self.layout().logs();
        self.layout().ensure_folder(&folder)?;
        let host = plain(&host());
        let process = std::process::id();
        let number = own_number();
        let path = folder.join(format!("{:.3}-{host}-{process}-{number:016x}.jsonl", now()));
        Ok(Log(self.layout().storage.create(&path)?))
    }

    /// Visits all logged events, run after run. Half-written lines and other than regular files are passed over.
    pub fn events(&self, mut visit: impl FnMut(RunEvent)) -> Result<(), StorageError> {
        let folder = self.layout().logs();
        let storage = self.layout().storage;
        let names = storage.list(&folder)?.into_iter();
        for name in names.filter(|name| !is_hidden(name)) {
            let path = folder.join(name);
            let mut log = match storage.open(&path) {
                Err(error) if error.is_no_file() => continue,
                log => BufReader::new(log?),
            };
            loop {
                let mut line = Vec::new();
                let read = log.by_ref().take(MAX_LINE).read_until(b'\n', &mut line);
                let length = read.map_err(StorageError::at("read", &path))? as u64;
                if let Ok(LogLine { event, .. }) = serde_json::from_slice(&line) {
                    visit(event);
                }
                // The end of the file, or a file that is no log.
                if length == 0 || length == MAX_LINE {
                    break;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::layout::Layout;
    use crate::results::workers::tests::open;
    use crate::sweep::Sweep;
    use crate::table::storage::Disk;
    use std::path::Path;

    #[test]
    fn a_log_reads_back_without_its_half_written_end() {
        let root = tempfile::tempdir().unwrap();
        let sweep = Sweep::parse("name = \"test\"\n", Path::new("test.toml")).unwrap();
        let results = open(&Layout::new(&Disk, root.path()), &sweep).unwrap();
        let mut log = results.begin_log().unwrap();
        let events = [
            RunEvent::RoundBegun {
                jobs: 3,
                predicted_cost: 4.0,
                rounds: RoundsSoFar::default(),
            },
            RunEvent::Finished(RunReport {
                jobs_run: 3,
                wall: 1.5,
                ..RunReport::default()
            }),
            RunEvent::Error {
                error: "disk full".to_owned(),
            },
            RunEvent::Stopping,
        ];
        for event in &events {
            log.write(event).unwrap();
        }
        log.write(&RunEvent::JobDone {
            predicted_cost: 1.0,
        })
        .unwrap();
        log.0.write(b"{\"time\": 1, \"ev").unwrap();
        let mut read_back = Vec::new();
        results.events(|event| read_back.push(event)).unwrap();
        assert_eq!(read_back, events);
    }

    #[test]
    fn a_log_without_ends_of_lines_and_what_is_no_file_are_passed_over() {
        let root = tempfile::tempdir().unwrap();
        let sweep = Sweep::parse("name = \"test\"\n", Path::new("test.toml")).unwrap();
        let results = open(&Layout::new(&Disk, root.path()), &sweep).unwrap();
        results
            .begin_log()
            .unwrap()
            .write(&RunEvent::Stopping)
            .unwrap();
        let logs = results.layout().logs();
        std::fs::create_dir(logs.join("0")).unwrap();
        std::fs::File::create(logs.join("1"))
            .unwrap()
            .set_len(1 << 42)
            .unwrap();
        let mut events = 0;
        results.events(|_| events += 1).unwrap();
        assert_eq!(events, 1);
    }
}
