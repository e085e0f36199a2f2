//! A file that is read from any place, by the checksum and by the decoder of Parquet, with one handle.
//!
//! The decoder passes some errors of the disk on as texts and takes others for an end of the file. So the file remembers
//! the first one: what cannot be read says nothing about what the file holds.

use crate::table::storage::{Storage, StorageError};
use bytes::Bytes;
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::reader::{ChunkReader, Length};
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A file that is open for reading. Clones are the same handle.
#[derive(Clone, Debug)]
pub struct ReadFile {
    length: u64,
    state: Arc<Mutex<State>>,
}

#[derive(Debug)]
struct State {
    file: File,
    /// The first error of the disk.
    refused: Option<io::Error>,
}

impl ReadFile {
    pub fn open(storage: &dyn Storage, path: &Path) -> Result<Self, StorageError> {
        let file = storage.open(path)?;
        let length = file.metadata().map_err(StorageError::at("look up", path))?.len();
        Ok(Self { length, state: Arc::new(Mutex::new(State { file, refused: None })) })
    }

    /// Its bytes from a place on.
    pub fn from(&self, start: u64) -> ReadFrom {
        ReadFrom { file: self.clone(), at: start }
    }

    /// A stretch of its bytes.
    pub fn bytes(&self, start: u64, length: usize) -> io::Result<Vec<u8>> {
        if start.checked_add(length as u64).is_none_or(|end| end > self.length) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut bytes = Vec::new();
        if bytes.try_reserve_exact(length).is_err() {
            return Err(self.state().refuse(io::ErrorKind::OutOfMemory.into()));
        }
        let read = self.from(start).take(length as u64).read_to_end(&mut bytes)?;
        if read == length { Ok(bytes) } else { Err(io::ErrorKind::UnexpectedEof.into()) }
    }

    /// The first error of the disk since the last call.
    pub fn take_refused(&self) -> Option<io::Error> {
        self.state().refused.take()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing panics while it is held.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Remembers an error of the disk, and gives one of the same kind.
    fn refuse(&mut self, error: io::Error) -> io::Error {
        let kind = error.kind();
        self.refused.get_or_insert(error);
        kind.into()
    }
}

/// Reads on from a place.
pub struct ReadFrom {
    file: ReadFile,
    at: u64,
}

impl Read for ReadFrom {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut state = self.file.state();
        let file = &mut state.file;
        match file.seek(SeekFrom::Start(self.at)).and_then(|_| file.read(buffer)) {
            Ok(read) => {
                self.at += read as u64;
                Ok(read)
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => Err(error),
            Err(error) => Err(state.refuse(error)),
        }
    }
}

impl Length for ReadFile {
    fn len(&self) -> u64 {
        self.length
    }
}

impl ChunkReader for ReadFile {
    type T = BufReader<ReadFrom>;

    fn get_read(&self, start: u64) -> ParquetResult<Self::T> {
        Ok(BufReader::new(self.from(start)))
    }

    fn get_bytes(&self, start: u64, length: usize) -> ParquetResult<Bytes> {
        Ok(self.bytes(start, length).map_err(ParquetError::from)?.into())
    }
}
