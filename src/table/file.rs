//! Datasets: a table as Parquet files, written with the same bytes for the same rows, and read file by file.
//!
//! zstd; doubles plain, other columns with dictionaries, which every reader knows: byte streams would save 1 % of
//! tables and 4 % of reduced data. The footer holds program, model and sweep, sorted, and a checksum, but no clock,
//! host or thread count. Row groups are cut by row count alone, so bytes do not depend on how the rows came in.

use crate::model::{MODEL_VERSION, RNG_SCHEME};
use crate::table::arrow::{self, DESCRIPTION, Gaps, RowBuffer, UNIT};
use crate::table::checksum;
use crate::table::columns::Row;
use crate::table::error::ResultsError;
use crate::table::storage::{Sink, Storage, StorageError, StoredFile};
use arrow_array::{RecordBatch, RecordBatchReader as _};
use arrow_schema::{ArrowError, DataType, Schema, SchemaRef};
use bytes::Bytes;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::arrow::{ArrowWriter, ProjectionMask};
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, ParquetMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The program's name and version, as files have it.
pub const PROGRAM: &str = concat!("stickslip ", env!("CARGO_PKG_VERSION"));

pub const FILE_EXTENSION: &str = "parquet";
/// Rows of a group: readers slow down on groups below 5,000 rows, and a writer holds one group, some 50 MB.
const GROUP_ROWS: usize = 1 << 17;
/// Rows that a reader gets at once.
const BATCH_ROWS: usize = 1 << 14;
/// zstd's level: higher ones gain little on random doubles.
const ZSTD_LEVEL: i32 = 3;

/// What the footer of a file holds beside the columns: sorted texts under keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Footer(BTreeMap<String, String>);

impl Default for Footer {
    /// Program, model version and scheme of random numbers.
    fn default() -> Self {
        Self::empty()
            .with("program", PROGRAM)
            .with("model_version", &MODEL_VERSION.to_string())
            .with("rng_scheme", RNG_SCHEME)
    }
}

const PLACE: &str = "file";

fn place(path: &Path) -> String {
    let parts = [path.parent().and_then(Path::file_name), path.file_name()];
    let names = parts.map(|name| name.unwrap_or_default().to_string_lossy());
    names.join("/")
}

impl Footer {
    pub const fn empty() -> Self {
        Self(BTreeMap::new())
    }

    pub fn with_sweep(self, name: &str, text: &str) -> Self {
        self.with("sweep_name", name).with("sweep", text)
    }

    pub fn with(mut self, key: &str, text: &str) -> Self {
        self.0.insert(key.to_owned(), text.to_owned());
        self
    }

    pub fn and(mut self, other: &Self) -> Self {
        self.0.extend(other.0.clone());
        self
    }

    pub fn at(self, path: &Path) -> Self {
        self.with(PLACE, &place(path))
    }

    pub(super) fn properties(&self, schema: &Schema) -> Result<WriterProperties, ParquetError> {
        let by_name = |key| arrow::by_name(schema.fields(), key).to_string();
        let footer = self
            .clone()
            .with("units", &by_name(UNIT))
            .with("meaning", &by_name(DESCRIPTION));
        let texts = footer.0.into_iter();
        let entries = texts.map(|(key, text)| KeyValue::new(key, text));
        let mut properties = WriterProperties::builder()
            .set_created_by(concat!("stickslip version ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_compression(Compression::ZSTD(ZstdLevel::try_new(ZSTD_LEVEL)?))
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_max_row_group_row_count(Some(GROUP_ROWS))
            .set_key_value_metadata(Some(entries.collect()));
        for field in schema.fields() {
            if field.data_type() == &DataType::Float64 {
                let column = ColumnPath::from(field.name().as_str());
                properties = properties.set_column_dictionary_enabled(column, false);
            }
        }
        Ok(properties.build())
    }
}

/// Writes one file of a table, to the disk or into memory. A file that was not finished is unreadable.
pub struct TableWriter<R, S = StoredFile> {
    row: PhantomData<fn(&R)>,
    buffer: RowBuffer,
    /// Encodes into memory, one row group at a time.
    writer: ArrowWriter<Vec<u8>>,
    path: PathBuf,
    file: S,
    hasher: Sha256,
}

impl<R: Row, S: Sink> TableWriter<R, S> {
    /// Writes into the empty file of this path, or makes its bytes.
    pub fn new(gaps: &Gaps, path: &Path, file: S, footer: &Footer) -> Result<Self, ResultsError> {
        let buffer = RowBuffer::new::<R>().with(gaps);
        let schema = buffer.schema();
        let footer = footer.clone();
        let sealed = footer.with(checksum::FOOTER_KEY, checksum::PLACEHOLDER);
        let writer = sealed.properties(schema).and_then(|properties| {
            ArrowWriter::try_new(Vec::new(), Arc::clone(schema), Some(properties))
        });
        let writer = writer.map_err(ResultsError::unwritten(path))?;
        Ok(Self {
            row: PhantomData,
            buffer,
            writer,
            path: path.to_owned(),
            file,
            hasher: Sha256::new(),
        })
    }

    pub fn push(&mut self, row: &R) -> Result<(), ResultsError> {
        self.buffer.push(row);
        if self.buffer.rows == GROUP_ROWS {
            self.flush()
        } else {
            Ok(())
        }
    }

    /// Appends rows that were read from a file of the same table.
    pub fn copy(&mut self, batch: &Batch, mut rows: Range<usize>) -> Result<(), ResultsError> {
        while !rows.is_empty() {
            let next = rows.end.min(rows.start + GROUP_ROWS - self.buffer.rows);
            self.buffer
                .copy(&batch.rows, rows.start..next)
                .map_err(ResultsError::damage_at(&batch.path))?;
            rows.start = next;
            if self.buffer.rows == GROUP_ROWS {
                self.flush()?;
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), ResultsError> {
        let mut encode = || -> Result<(), ParquetError> {
            self.writer.write(&self.buffer.take()?)?;
            self.writer.flush()?;
            Ok(self.writer.sync()?)
        };
        encode().map_err(ResultsError::unwritten(&self.path))?;
        let bytes = std::mem::take(self.writer.inner_mut());
        self.hasher.update(&bytes);
        let written = self.file.write_all(&bytes);
        Ok(written.map_err(StorageError::at("write", &self.path))?)
    }

    /// Writes what is left and the footer, brings the file to the disk.
    pub fn finish(mut self) -> Result<S, ResultsError> {
        if self.buffer.rows > 0 {
            self.flush()?;
        }
        let close = || -> Result<Vec<u8>, ParquetError> {
            let mut footer = self.writer.into_inner()?;
            let no_place = "the footer has no place for a checksum";
            checksum::close(self.hasher, &mut footer)
                .ok_or_else(|| ParquetError::General(no_place.to_owned()))?;
            Ok(footer)
        };
        let footer = close().map_err(ResultsError::unwritten(&self.path))?;
        let mut file = self.file;
        let written = file.write_all(&footer).and_then(|()| file.sync());
        written.map_err(StorageError::at("write", &self.path))?;
        Ok(file)
    }
}

#[derive(Clone, Debug)]
pub struct Batch {
    pub path: Arc<Path>,
    pub rows: RecordBatch,
}

impl Batch {
    pub fn rows_of<R: Row>(&self) -> Result<Vec<R>, ResultsError> {
        arrow::rows(&self.rows).map_err(ResultsError::damage_at(&self.path))
    }
}

/// Compares a footer with where the file lies, and with the texts that it must have. Earlier programs wrote fewer.
fn check_footer(path: &Path, metadata: &ParquetMetaData, expected: &Footer) -> Result<(), String> {
    let entries = metadata.file_metadata().key_value_metadata();
    let text = |key: &str| {
        let entry = entries.into_iter().flatten().find(|entry| entry.key == key);
        entry.and_then(|entry| entry.value.as_deref())
    };
    if let Some(written) = text(PLACE).filter(|written| *written != place(path)) {
        return Err(format!("it was written as {written}, and is not that file"));
    }
    for (key, expected) in &expected.0 {
        if text(key).is_some_and(|found| found != expected) {
            return Err(format!(
                "its {key} differs: the file does not belong to this directory now"
            ));
        }
    }
    Ok(())
}

/// Compares a number of rows with the fewest and the most.
pub fn check_count(rows: u64, expected: &RangeInclusive<u64>) -> Result<(), String> {
    if expected.contains(&rows) {
        return Ok(());
    }
    let least = expected.start();
    Err(format!(
        "it has {rows} rows, where the jobs of its part have {least}"
    ))
}

/// A file of a table, and what is known of it: if it differs from that, it is damaged.
#[derive(Clone)]
pub struct DataFile {
    pub path: PathBuf,
    /// The fewest, and the most.
    pub rows: RangeInclusive<u64>,
    pub footer: Arc<Footer>,
}

impl DataFile {
    /// A file of which only these texts of its footer are known.
    pub fn with_footer(path: PathBuf, footer: Footer) -> Self {
        Self {
            path,
            rows: 0..=u64::MAX,
            footer: Arc::new(footer),
        }
    }

    /// Whether it is whole and agrees with what is known of it.
    pub fn check(&self, storage: &dyn Storage) -> Result<(), ResultsError> {
        open(storage, self, &[]).map(drop)
    }
}

/// Files of a table, in this order.
#[derive(Clone)]
pub struct Dataset<'a> {
    storage: &'a dyn Storage,
    files: Vec<DataFile>,
}

impl<'a> Dataset<'a> {
    /// Files of which nothing is known.
    pub fn new(storage: &'a dyn Storage, files: Vec<PathBuf>) -> Self {
        let file = |path| DataFile::with_footer(path, Footer::empty());
        Self::of(storage, files.into_iter().map(file).collect())
    }

    pub const fn of(storage: &'a dyn Storage, files: Vec<DataFile>) -> Self {
        Self { storage, files }
    }

    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.iter().map(|file| &file.path)
    }

    /// The columns of the first file.
    pub fn schema(&self) -> Result<SchemaRef, ResultsError> {
        let reader = open(self.storage, &self.files[0], &[])?;
        Ok(arrow::schema_of(reader.schema().fields().clone()))
    }

    /// Reads all rows, one batch after the other, holding one file; an error ends it.
    pub fn batches(self) -> impl Iterator<Item = Result<Batch, ResultsError>> + use<'a> {
        self.read(Vec::new())
    }

    /// The same, row by row.
    pub fn rows<R: Row>(self) -> impl Iterator<Item = Result<R, ResultsError>> + use<'a, R> {
        self.read(R::names()).flat_map(|batch| {
            let (rows, error) = match batch.and_then(|batch| batch.rows_of()) {
                Ok(rows) => (rows, None),
                Err(error) => (Vec::new(), Some(Err(error))),
            };
            rows.into_iter().map(Ok).chain(error)
        })
    }

    /// The same, of the columns with these names alone, of which there is at least one; in the order of the file.
    pub fn columns(
        self,
        names: &[String],
    ) -> impl Iterator<Item = Result<Batch, ResultsError>> + use<'a> {
        self.read(names.iter().cloned().map(Cow::Owned).collect())
    }

    /// Reads the columns with these names; all columns if the list is empty.
    fn read(
        self,
        columns: Vec<Cow<'static, str>>,
    ) -> impl Iterator<Item = Result<Batch, ResultsError>> + use<'a> {
        let Self { storage, files } = self;
        let batches = files.into_iter().flat_map(move |file| {
            let (reader, error) = match open(storage, &file, &columns) {
                Ok(reader) => (Some(reader), None),
                Err(error) => (None, Some(Err(error))),
            };
            let path: Arc<Path> = file.path.into();
            let batch = move |rows: Result<RecordBatch, ArrowError>| {
                Ok(Batch {
                    path: Arc::clone(&path),
                    rows: rows.map_err(ResultsError::damage_at(&path))?,
                })
            };
            reader.into_iter().flatten().map(batch).chain(error)
        });
        let mut has_failed = false;
        batches.take_while(move |batch| !std::mem::replace(&mut has_failed, batch.is_err()))
    }
}

fn open(
    storage: &dyn Storage,
    file: &DataFile,
    columns: &[Cow<'static, str>],
) -> Result<ParquetRecordBatchReader, ResultsError> {
    let path = &file.path;
    let bytes = storage.read(path).map_err(ResultsError::of_reading)?;
    checksum::check(&bytes).map_err(ResultsError::damage_at(path))?;
    let reader = || {
        let mut builder = ParquetRecordBatchReaderBuilder::try_new(Bytes::from(bytes))?
            .with_batch_size(BATCH_ROWS);
        let metadata = builder.metadata();
        check_footer(path, metadata, &file.footer).map_err(ParquetError::General)?;
        let rows = metadata.file_metadata().num_rows().cast_unsigned();
        check_count(rows, &file.rows).map_err(ParquetError::General)?;
        if !columns.is_empty() {
            let names = columns.iter().map(AsRef::as_ref);
            let mask = ProjectionMask::columns(builder.parquet_schema(), names);
            builder = builder.with_projection(mask);
        }
        builder.build()
    };
    reader().map_err(|error| match error {
        ParquetError::General(problem) => ResultsError::damaged(path, problem),
        error => ResultsError::damage_at(path)(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::columns::columns;
    use crate::table::error::ErrorKind;
    use crate::table::storage::over_disk::OverDisk;
    use crate::table::storage::{Disk, StorageError};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use std::fs::{self, File};

    columns! {
        /// A number.
        #[derive(Clone, Debug, PartialEq)]
        struct Number {
            value as "number": u64 = "", "a number";
            root: f64 = "m", "its root";
            odd: bool = "", "whether it is odd";
            text: String = "", "in words";
        }
    }

    impl Number {
        fn of(number: u64) -> Self {
            Self {
                value: number,
                root: (number as f64).sqrt(),
                odd: number % 2 == 1,
                text: format!("number {}", number % 10),
            }
        }
    }

    fn write(path: &Path, numbers: Range<u64>) {
        let footer = Footer::default().with("note", "test");
        let mut writer =
            TableWriter::new(&Gaps::default(), path, Disk.create(path).unwrap(), &footer).unwrap();
        numbers.for_each(|number| writer.push(&Number::of(number)).unwrap());
        writer.finish().unwrap();
    }

    fn dataset(folder: &Path) -> Dataset<'static> {
        let names = Disk.list(folder).unwrap();
        Dataset::new(
            &Disk,
            names.into_iter().map(|name| folder.join(name)).collect(),
        )
    }

    fn numbers(folder: &Path) -> Result<Vec<u64>, ResultsError> {
        let mut numbers = Vec::new();
        for batch in dataset(folder).batches() {
            numbers.extend(
                batch?
                    .rows_of()?
                    .into_iter()
                    .map(|number: Number| number.value),
            );
        }
        Ok(numbers)
    }

    #[test]
    fn a_folder_reads_back_in_order_of_its_files() {
        let folder = tempfile::tempdir().unwrap();
        write(&folder.path().join("b.parquet"), 5..9);
        write(&folder.path().join("a.parquet"), 0..5);
        write(&folder.path().join("c.parquet"), 0..0);
        assert_eq!(numbers(folder.path()).unwrap(), (0..9).collect::<Vec<_>>());
        let rows = dataset(folder.path())
            .rows()
            .collect::<Result<Vec<Number>, _>>();
        assert_eq!(rows.unwrap(), (0..9).map(Number::of).collect::<Vec<_>>());
    }

    #[test]
    fn bytes_do_not_depend_on_how_rows_came_in() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("whole.parquet");
        let copied = folder.path().join("copied.parquet");
        let rows = GROUP_ROWS as u64 + 1000;
        write(&whole, 0..rows);
        let footer = Footer::default().with("note", "test");
        let mut writer = TableWriter::<Number>::new(
            &Gaps::default(),
            &copied,
            Disk.create(&copied).unwrap(),
            &footer,
        )
        .unwrap();
        for batch in Dataset::new(&Disk, vec![whole.clone()]).batches() {
            let batch = batch.unwrap();
            let middle = batch.rows.num_rows() / 3;
            writer.copy(&batch, 0..middle).unwrap();
            writer.copy(&batch, middle..batch.rows.num_rows()).unwrap();
        }
        writer.finish().unwrap();
        assert!(fs::read(&whole).unwrap() == fs::read(&copied).unwrap());
        let groups = SerializedFileReader::new(File::open(&whole).unwrap())
            .unwrap()
            .num_row_groups();
        assert_eq!(groups, 2);
    }

    #[test]
    fn the_footer_is_sorted_and_holds_units() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        write(&path, 0..3);
        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        let metadata = reader.metadata().file_metadata();
        let entries = metadata.key_value_metadata().unwrap();
        let keys: Vec<_> = entries.iter().map(|entry| entry.key.as_str()).collect();
        // The Arrow schema is appended by the format's library.
        let expected = [
            "meaning",
            "model_version",
            "note",
            "program",
            "rng_scheme",
            "seal",
            "units",
            "ARROW:schema",
        ];
        assert_eq!(keys, expected);
        assert!(entries[6].value.as_ref().unwrap().contains(r#""root":"m""#));
    }

    #[test]
    fn a_cut_or_changed_file_is_named_and_never_panics() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        write(&path, 0..500);
        let bytes = fs::read(&path).unwrap();
        let step = bytes.len() / 97;
        for cut in (0..bytes.len()).step_by(step) {
            fs::write(&path, &bytes[..cut]).unwrap();
            let error = numbers(folder.path()).unwrap_err();
            assert!(
                error.to_string().contains("a.parquet: damaged"),
                "cut at {cut}: {error}"
            );
        }
        for changed in (0..bytes.len()).step_by(7) {
            let mut changed_bytes = bytes.clone();
            changed_bytes[changed] ^= 0x55;
            fs::write(&path, &changed_bytes).unwrap();
            let error = numbers(folder.path()).unwrap_err();
            assert!(
                error.to_string().contains("a.parquet"),
                "changed at {changed}: {error}"
            );
        }
    }

    /// A disk on which a folder has the name of every file: it opens, and no byte of it can be read.
    struct Unreadable;

    impl OverDisk for Unreadable {
        fn open_file(&self, _: &Path) -> Result<File, StorageError> {
            Ok(File::open(std::env::temp_dir()).unwrap())
        }
    }

    #[test]
    fn an_error_of_the_disk_is_no_damage() {
        let path = Path::new("a.parquet");
        let is_of_disk =
            |error: ResultsError| matches!(error.kind, ErrorKind::Disk(_)) && error.path == path;
        assert!(is_of_disk(
            Dataset::new(&Unreadable, vec![path.to_owned()])
                .batches()
                .next()
                .unwrap()
                .unwrap_err()
        ));
    }

    #[test]
    fn a_file_with_other_numbers_of_rows_than_expected_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        write(&path, 0..5);
        let read = |rows| {
            let file = DataFile {
                path: path.clone(),
                rows,
                footer: Arc::new(Footer::empty()),
            };
            file.check(&Disk)
        };
        let more = |least| read(least..=u64::MAX);
        assert!(read(5..=5).is_ok() && more(5).is_ok() && more(4).is_ok());
        for error in [read(4..=4), read(6..=6), more(6)].map(Result::unwrap_err) {
            assert!(
                error
                    .to_string()
                    .contains("it has 5 rows, where the jobs of its part have"),
                "{error}"
            );
        }
    }

    #[test]
    fn a_file_under_another_name_or_with_another_text_than_expected_is_damaged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("numbers/a.parquet");
        let others = ["numbers/b.parquet", "others/a.parquet"].map(|name| folder.path().join(name));
        for file in others.iter().chain([&path]) {
            fs::create_dir_all(file.parent().unwrap()).unwrap();
        }
        let expected = Footer::empty().with("sweep", "one");
        let written = Footer::default().and(&expected).at(&path);
        let mut writer = TableWriter::new(
            &Gaps::default(),
            &path,
            Disk.create(&path).unwrap(),
            &written,
        )
        .unwrap();
        writer.push(&Number::of(1)).unwrap();
        writer.finish().unwrap();
        let check = |path: &Path, footer: &Footer| {
            DataFile::with_footer(path.to_owned(), footer.clone()).check(&Disk)
        };
        check(&path, &expected).unwrap();
        // Earlier programs wrote fewer keys.
        check(&path, &expected.clone().with("unknown", "key")).unwrap();
        let error = check(&path, &Footer::empty().with("sweep", "another")).unwrap_err();
        assert!(error.to_string().contains("its sweep differs"), "{error}");
        for other in &others {
            fs::copy(&path, other).unwrap();
            let errors = [
                check(other, &expected).unwrap_err(),
                Dataset::new(&Disk, vec![other.clone()])
                    .batches()
                    .next()
                    .unwrap()
                    .unwrap_err(),
            ];
            for error in errors {
                assert!(
                    error.kind == ErrorKind::Damaged
                        && error
                            .to_string()
                            .contains("it was written as numbers/a.parquet"),
                    "{error}"
                );
            }
        }
    }
}
