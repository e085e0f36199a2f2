//! Merging: the rows of many files in one order, whatever files they came from, in bounded memory.
//!
//! An external merge sort (Knuth, The Art of Computer Programming 3, 5.4) of blocks, the consecutive rows of one job: runs
//! that fit in memory are sorted, then merged a few at a time. The order is (V0, Delta, T, set, seed), then that within the
//! job; every table has these columns. Memory: one run, or a batch of each of the files that are merged at once.

use crate::results::layout::compacted_file;
use crate::table::columns::Table;
use crate::table::file::{Batch, DatasetError, Footer, Reader, TableWriter};
use crate::table::storage::{Storage, StorageError};
use arrow_array::Array;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Rows that are sorted in memory: some 100 MB.
const RUN_ROWS: usize = 1 << 18;
/// Sources that are merged at once, each with a batch in memory.
const FAN_IN: usize = 8;
/// Rows of a file: 32 row groups.
const FILE_ROWS: usize = 1 << 22;

/// Sizes of a merge.
#[derive(Clone, Copy)]
struct Sizes {
    run_rows: usize,
    fan_in: usize,
    file_rows: usize,
}

const SIZES: Sizes = Sizes { run_rows: RUN_ROWS, fan_in: FAN_IN, file_rows: FILE_ROWS };

/// A table that is put in order.
pub struct Merge<'a, R> {
    /// Where files lie.
    pub storage: &'a dyn Storage,
    /// The table.
    pub table: std::marker::PhantomData<fn(&R)>,
    /// What the footers of its files tell.
    pub footer: &'a Footer,
    /// Folder of runs on their way.
    pub scratch: &'a Path,
    /// Whether the rows of a job are taken from files that are in order already, by its id.
    pub takes: &'a dyn Fn(&str) -> bool,
}

/// The order of jobs. No parameter among them is negative, so their bits are in the order of their values.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    drive_velocity: u64,
    amplitude: u64,
    period: Option<u64>,
    set_id: String,
    seed: i64,
}

/// Consecutive rows of one job.
#[derive(Clone)]
struct Block {
    key: Key,
    batch: Arc<Batch>,
    rows: Range<usize>,
}

/// Files whose rows follow each other in order.
struct Sorted {
    files: Vec<PathBuf>,
    /// Whether all rows are taken.
    is_run: bool,
}

impl Sorted {
    fn run(path: PathBuf) -> Self {
        Self { files: vec![path], is_run: true }
    }
}

/// What a merge wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Merged {
    /// Names of the files, in order.
    pub names: Vec<String>,
    /// Rows in all of them.
    pub rows: u64,
}

impl<R: Table> Merge<'_, R> {
    /// Writes the rows of files, and of others that are in order already, as files of a folder, in order. Of no
    /// rows there is one empty file.
    ///
    /// # Errors
    /// When a file cannot be read or written.
    pub fn write(&self, files: Vec<PathBuf>, sorted: Vec<PathBuf>, folder: &Path) -> Result<Merged, DatasetError> {
        self.write_by(SIZES, files, sorted, folder)
    }

    fn write_by(
        &self,
        sizes: Sizes,
        files: Vec<PathBuf>,
        sorted: Vec<PathBuf>,
        folder: &Path,
    ) -> Result<Merged, DatasetError> {
        let mut sources = Vec::new();
        for blocks in self.runs(files, sizes.run_rows) {
            let path = self.scratch.join(format!("{}-run-{:06}", R::NAME, sources.len()));
            sources.push(Sorted::run(self.write_run(&path, blocks?.into_iter().map(Ok))?));
        }
        sources.push(Sorted { files: sorted, is_run: false });
        let mut merged = 0;
        while sources.len() > sizes.fan_in {
            let rest = sources.split_off(sizes.fan_in);
            let path = self.scratch.join(format!("{}-merged-{merged:06}", R::NAME));
            let run = self.write_run(&path, self.merged(&sources)?)?;
            let runs = sources.iter().filter(|source| source.is_run).flat_map(|source| &source.files);
            for path in runs {
                self.storage.remove(path).map_err(StorageError::at("remove", path))?;
            }
            // At the end, so that every row is merged about as often.
            sources = rest;
            sources.push(Sorted::run(run));
            merged += 1;
        }
        let mut target = Target { merge: self, folder, rows_left: sizes.file_rows, names: Vec::new(), writer: None };
        let mut rows = 0;
        for block in self.merged(&sources)? {
            let block = block?;
            rows += block.rows.len() as u64;
            target.push(&block, sizes.file_rows)?;
        }
        Ok(Merged { names: target.finish()?, rows })
    }

    /// The blocks of files in runs of some rows, each sorted.
    fn runs(&self, files: Vec<PathBuf>, run_rows: usize) -> impl Iterator<Item = Result<Vec<Block>, DatasetError>> {
        let mut blocks = self.blocks(files, true);
        std::iter::from_fn(move || {
            let (mut run, mut rows) = (Vec::new(), 0);
            while rows < run_rows {
                match blocks.next() {
                    None => break,
                    Some(Err(error)) => return Some(Err(error)),
                    Some(Ok(block)) => {
                        rows += block.rows.len();
                        run.push(block);
                    }
                }
            }
            // Stable: what a job has in several blocks stays in order.
            run.sort_by(|left, right| left.key.cmp(&right.key));
            (!run.is_empty()).then_some(Ok(run))
        })
    }

    /// The blocks of files in their order: all, or those that are taken.
    fn blocks(&self, files: Vec<PathBuf>, all: bool) -> impl Iterator<Item = Result<Block, DatasetError>> {
        let takes = move |job: &str| all || (self.takes)(job);
        Reader::new(self.storage, files).flat_map(move |batch| {
            match batch.and_then(|batch| cut(&Arc::new(batch), &takes)) {
                Ok(blocks) => blocks.into_iter().map(Ok).collect::<Vec<_>>(),
                Err(error) => vec![Err(error)],
            }
        })
    }

    fn write_run(
        &self,
        path: &Path,
        blocks: impl Iterator<Item = Result<Block, DatasetError>>,
    ) -> Result<PathBuf, DatasetError> {
        let mut writer = TableWriter::<R>::create(self.storage, path, self.footer)?;
        for block in blocks {
            let Block { batch, rows, .. } = block?;
            writer.copy(&batch, rows)?;
        }
        writer.finish()?;
        Ok(path.to_owned())
    }

    /// The blocks of sorted sources in order. Neighbours in a batch come as one block.
    fn merged(&self, sources: &[Sorted]) -> Result<impl Iterator<Item = Result<Block, DatasetError>>, DatasetError> {
        let mut sources: Vec<_> =
            sources.iter().map(|source| self.blocks(source.files.clone(), source.is_run).peekable()).collect();
        let mut heads = BinaryHeap::new();
        for (number, source) in sources.iter_mut().enumerate() {
            match source.peek() {
                None => (),
                Some(Ok(block)) => heads.push(Reverse((block.key.clone(), number))),
                Some(Err(_)) => {
                    if let Some(Err(error)) = source.next() {
                        return Err(error);
                    }
                }
            }
        }
        Ok(std::iter::from_fn(move || {
            let Reverse((_, number)) = heads.pop()?;
            let source = &mut sources[number];
            let mut block = match source.next()? {
                Ok(block) => block,
                error => return Some(error),
            };
            let bound = heads.peek().map(|Reverse((key, _))| key);
            while let Some(Ok(next)) = source.peek()
                && bound.is_none_or(|bound| next.key < *bound)
                && next.rows.start == block.rows.end
                && Arc::ptr_eq(&next.batch, &block.batch)
            {
                block.rows.end = next.rows.end;
                source.next();
            }
            match source.peek() {
                None => (),
                Some(Ok(next)) => heads.push(Reverse((next.key.clone(), number))),
                Some(Err(_)) => return source.next(),
            }
            Some(Ok(block))
        }))
    }
}

/// Cuts a batch into blocks.
fn cut(batch: &Arc<Batch>, takes: &dyn Fn(&str) -> bool) -> Result<Vec<Block>, DatasetError> {
    let (job_id, set_id) = (batch.texts("job_id")?, batch.texts("set_id")?);
    let (velocity, amplitude, period) = (batch.reals("V0")?, batch.reals("Delta")?, batch.reals("T")?);
    let seed = batch.counts("seed")?;
    let mut blocks = Vec::new();
    let mut begin = 0;
    while begin < batch.rows.num_rows() {
        let job = job_id.value(begin);
        let end = (begin..job_id.len()).find(|&row| job_id.value(row) != job).unwrap_or(job_id.len());
        if takes(job) {
            let key = Key {
                drive_velocity: velocity.value(begin).to_bits(),
                amplitude: amplitude.value(begin).to_bits(),
                period: period.is_valid(begin).then(|| period.value(begin).to_bits()),
                set_id: set_id.value(begin).to_owned(),
                seed: seed.value(begin),
            };
            blocks.push(Block { key, batch: Arc::clone(batch), rows: begin..end });
        }
        begin = end;
    }
    Ok(blocks)
}

/// The files of a table in order, cut at fixed numbers of rows.
struct Target<'a, R> {
    merge: &'a Merge<'a, R>,
    folder: &'a Path,
    rows_left: usize,
    names: Vec<String>,
    writer: Option<TableWriter<R>>,
}

impl<R: Table> Target<'_, R> {
    fn path(&self) -> PathBuf {
        self.folder.join(self.names.len().to_string())
    }

    fn writer(&mut self) -> Result<&mut TableWriter<R>, DatasetError> {
        let writer = if let Some(writer) = self.writer.take() {
            writer
        } else {
            let Merge { storage, footer, .. } = self.merge;
            TableWriter::create(*storage, &self.path(), footer)?
        };
        Ok(self.writer.insert(writer))
    }

    fn push(&mut self, block: &Block, file_rows: usize) -> Result<(), DatasetError> {
        let mut rows = block.rows.clone();
        while !rows.is_empty() {
            let end = rows.end.min(rows.start + self.rows_left);
            self.writer()?.copy(&block.batch, rows.start..end)?;
            self.rows_left -= end - rows.start;
            rows.start = end;
            if self.rows_left == 0 {
                self.close()?;
                self.rows_left = file_rows;
            }
        }
        Ok(())
    }

    /// Finishes a file, which then has the name of its seal.
    fn close(&mut self) -> Result<(), DatasetError> {
        let path = self.path();
        if let Some(writer) = self.writer.take() {
            let name = compacted_file(self.names.len(), &writer.seal()?);
            let target = self.folder.join(&name);
            self.merge
                .storage
                .rename(&path, &target)
                .map_err(StorageError::at("move a finished file here", &target))?;
            self.names.push(name);
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Vec<String>, DatasetError> {
        if self.names.is_empty() {
            self.writer()?;
        }
        self.close()?;
        Ok(self.names)
    }
}
