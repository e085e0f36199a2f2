//! Datasets: a table as Parquet files, written with the same bytes for the same rows, and read file by file.
//!
//! zstd; doubles plain, other columns with dictionaries, which every reader knows: byte streams would save 1 % of tables and
//! 4 % of reduced data. The footer holds program, model and sweep, sorted, and a checksum, but no clock, host or
//! thread count. Row groups are cut by row count alone, so bytes do not depend on how the rows came in.

use crate::model::{MODEL_VERSION, RNG_SCHEME};
use crate::table::arrow::{self, DESCRIPTION, RowBuffer, UNIT};
use crate::table::checksum;
use crate::table::columns::{FromRow, Row};
use crate::table::error::ResultsError;
use crate::table::storage::{Storage, StoredFile};
use arrow_array::RecordBatch;
use arrow_schema::{ArrowError, DataType, Schema};
use bytes::Bytes;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::arrow::{ArrowWriter, ProjectionMask};
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::{KeyValue, ParquetMetaDataReader};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;
use sha2::{Digest, Sha256};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The program's name and version, as files have it.
pub const PROGRAM: &str = concat!("stickslip ", env!("CARGO_PKG_VERSION"));

/// How the names of table files end.
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
        let texts = [
            ("program", PROGRAM),
            ("model_version", &MODEL_VERSION.to_string()),
            ("rng_scheme", RNG_SCHEME),
        ];
        Self(
            texts
                .into_iter()
                .map(|(key, text)| (key.to_owned(), text.to_owned()))
                .collect(),
        )
    }
}

impl Footer {
    /// The same, with the name and the text of a sweep.
    pub fn with_sweep(self, name: &str, text: &str) -> Self {
        self.with("sweep_name", name).with("sweep", text)
    }

    pub fn with(mut self, key: &str, text: &str) -> Self {
        self.0.insert(key.to_owned(), text.to_owned());
        self
    }

    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    pub(super) fn properties(&self, schema: &Schema) -> Result<WriterProperties, ParquetError> {
        let [units, meaning] = [UNIT, DESCRIPTION].map(|key| by_name(schema, key));
        let footer = self.clone().with(UNITS, &units).with("meaning", &meaning);
        let footer = footer.with(checksum::FOOTER_KEY, checksum::PLACEHOLDER);
        let texts = footer
            .0
            .into_iter()
            .map(|(key, text)| KeyValue::new(key, text));
        let mut properties = WriterProperties::builder()
            .set_created_by(concat!("stickslip version ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_compression(Compression::ZSTD(ZstdLevel::try_new(ZSTD_LEVEL)?))
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_max_row_group_row_count(Some(GROUP_ROWS))
            .set_key_value_metadata(Some(texts.collect()));
        for field in schema.fields() {
            if field.data_type() == &DataType::Float64 {
                let column = ColumnPath::from(field.name().as_str());
                properties = properties.set_column_dictionary_enabled(column, false);
            }
        }
        Ok(properties.build())
    }
}

/// The footer's key of the units.
const UNITS: &str = "units";

/// What the metadata of all fields hold under a key, as JSON.
fn by_name(schema: &Schema, key: &str) -> String {
    arrow::by_name(schema.fields().iter().map(AsRef::as_ref), key).to_string()
}

/// Whether a footer is that of a file with these columns.
pub fn has_columns(footer: &BTreeMap<String, String>, schema: &Schema) -> bool {
    footer
        .get(UNITS)
        .is_some_and(|units| *units == by_name(schema, UNIT))
}

/// Writes one file of a table. A file that was not finished is unreadable.
pub struct TableWriter<R> {
    row: PhantomData<fn(&R)>,
    buffer: RowBuffer,
    /// Encodes into memory, one row group at a time.
    writer: ArrowWriter<Vec<u8>>,
    file: StoredFile,
    hasher: Sha256,
}

impl<R: Row> TableWriter<R> {
    /// Writes into this file, which is empty.
    pub fn new(file: StoredFile, footer: &Footer) -> Result<Self, ResultsError> {
        Self::without(&[], file, footer)
    }

    /// The same without the columns of these names.
    pub fn without(
        left_out: &[Cow<'static, str>],
        file: StoredFile,
        footer: &Footer,
    ) -> Result<Self, ResultsError> {
        let buffer = RowBuffer::new::<R>().without(left_out);
        let writer = footer
            .properties(buffer.schema())
            .and_then(|properties| {
                ArrowWriter::try_new(Vec::new(), Arc::clone(buffer.schema()), Some(properties))
            })
            .map_err(ResultsError::unwritten(file.path()))?;
        Ok(Self {
            row: PhantomData,
            buffer,
            writer,
            file,
            hasher: Sha256::new(),
        })
    }

    pub fn push(&mut self, row: &R) -> Result<(), ResultsError> {
        self.buffer.push(row);
        if self.buffer.len() == GROUP_ROWS {
            self.flush()
        } else {
            Ok(())
        }
    }

    /// Appends rows that were read from a file of the same table.
    pub fn copy(&mut self, batch: &Batch, mut rows: Range<usize>) -> Result<(), ResultsError> {
        while !rows.is_empty() {
            let next = rows.end.min(rows.start + GROUP_ROWS - self.buffer.len());
            self.buffer
                .copy(&batch.rows, rows.start..next)
                .map_err(ResultsError::damage_at(&batch.path))?;
            rows.start = next;
            if self.buffer.len() == GROUP_ROWS {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Writes the buffered rows as a row group.
    fn flush(&mut self) -> Result<(), ResultsError> {
        let written = self
            .buffer
            .take()
            .map_err(ParquetError::from)
            .and_then(|batch| self.writer.write(&batch));
        let written = written
            .and_then(|()| self.writer.flush())
            .and_then(|()| Ok(self.writer.sync()?));
        written.map_err(ResultsError::unwritten(self.file.path()))?;
        let bytes = std::mem::take(self.writer.inner_mut());
        self.hasher.update(&bytes);
        Ok(self.file.write(&bytes)?)
    }

    /// Writes what is left and the footer, brings the file to the disk.
    /// Without it, the file is unreadable.
    pub fn finish(mut self) -> Result<(), ResultsError> {
        if !self.buffer.is_empty() {
            self.flush()?;
        }
        let mut file = self.file;
        let footer = self.writer.into_inner().and_then(|mut footer| {
            let missing =
                || ParquetError::General("the footer has no place for a checksum".to_owned());
            checksum::close(self.hasher, &mut footer)
                .ok_or_else(missing)
                .map(|()| footer)
        });
        let footer = footer.map_err(ResultsError::unwritten(file.path()))?;
        file.write(&footer)?;
        Ok(file.sync()?)
    }
}

/// Some rows of a file.
#[derive(Clone, Debug)]
pub struct Batch {
    pub path: Arc<Path>,
    pub rows: RecordBatch,
}

impl Batch {
    pub fn rows_of<R: FromRow>(&self) -> Result<Vec<R>, ResultsError> {
        arrow::rows(&self.rows).map_err(ResultsError::damage_at(&self.path))
    }
}

/// The bytes of a file that are those that were written.
fn load(storage: &dyn Storage, path: &Path) -> Result<Bytes, ResultsError> {
    let bytes = storage.read(path).map_err(ResultsError::of_reading)?;
    checksum::check(&bytes).map_err(ResultsError::damage_at(path))?;
    Ok(bytes.into())
}

/// The texts under keys in the footer of a file.
pub fn footer(
    storage: &dyn Storage,
    path: &Path,
) -> Result<BTreeMap<String, String>, ResultsError> {
    let bytes = load(storage, path)?;
    let metadata = ParquetMetaDataReader::new()
        .parse_and_finish(&bytes)
        .map_err(ResultsError::damage_at(path))?;
    let entries = metadata
        .file_metadata()
        .key_value_metadata()
        .into_iter()
        .flatten();
    Ok(entries
        .map(|entry| (entry.key.clone(), entry.value.clone().unwrap_or_default()))
        .collect())
}

/// How many rows a file must have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowCount {
    pub least: u64,
    /// Whether it may have more.
    pub may_exceed: bool,
}

impl RowCount {
    /// Says what is wrong with this number of rows.
    pub fn check(self, rows: u64) -> Result<(), String> {
        let Self { least, may_exceed } = self;
        if rows == least || (may_exceed && rows > least) {
            Ok(())
        } else {
            Err(format!(
                "it has {rows} rows, where the jobs of its part have {least}"
            ))
        }
    }
}

/// Files of a table, in this order.
#[derive(Clone)]
pub struct Dataset<'a> {
    storage: &'a dyn Storage,
    files: Vec<(PathBuf, Option<RowCount>)>,
}

impl<'a> Dataset<'a> {
    pub fn new(storage: &'a dyn Storage, files: Vec<PathBuf>) -> Self {
        Self {
            storage,
            files: files.into_iter().map(|path| (path, None)).collect(),
        }
    }

    /// Files of which it is known how many rows they must have; one with others is damaged.
    pub const fn of_known_rows(
        storage: &'a dyn Storage,
        files: Vec<(PathBuf, Option<RowCount>)>,
    ) -> Self {
        Self { storage, files }
    }

    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.files.iter().map(|(path, _)| path)
    }

    /// Reads all rows, one batch after the other, holding one file; an error ends it.
    pub fn batches(self) -> impl Iterator<Item = Result<Batch, ResultsError>> + use<'a> {
        self.read(Vec::new())
    }

    /// The same, as rows of one type.
    pub fn rows<R: FromRow>(
        self,
    ) -> impl Iterator<Item = Result<Vec<R>, ResultsError>> + use<'a, R> {
        self.read(R::columns().into_iter().map(|column| column.name).collect())
            .map(|batch| batch?.rows_of())
    }

    /// The same, of the columns with these names alone, of which there is at least one; in the order of the file.
    pub fn columns(
        self,
        names: &[String],
    ) -> impl Iterator<Item = Result<Batch, ResultsError>> + use<'a> {
        self.read(names.iter().cloned().map(Cow::Owned).collect())
    }

    /// Of columns with these names; of all if there are none.
    fn read(
        self,
        columns: Vec<Cow<'static, str>>,
    ) -> impl Iterator<Item = Result<Batch, ResultsError>> + use<'a> {
        let Self { storage, files } = self;
        let batches = files.into_iter().flat_map(move |(path, expected)| {
            let opened = open(storage, &path, expected, &columns);
            let (reader, error) = opened.map_or_else(
                |error| (None, Some(Err(error))),
                |reader| (Some(reader), None),
            );
            let path: Arc<Path> = path.into();
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
    path: &Path,
    expected: Option<RowCount>,
    columns: &[Cow<'static, str>],
) -> Result<ParquetRecordBatchReader, ResultsError> {
    let bytes = load(storage, path)?;
    let reader = || {
        let mut builder =
            ParquetRecordBatchReaderBuilder::try_new(bytes)?.with_batch_size(BATCH_ROWS);
        if let Some(expected) = expected {
            let rows = builder
                .metadata()
                .file_metadata()
                .num_rows()
                .cast_unsigned();
            expected.check(rows).map_err(ParquetError::General)?;
        }
        if !columns.is_empty() {
            let mask = ProjectionMask::columns(
                builder.parquet_schema(),
                columns.iter().map(AsRef::as_ref),
            );
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
        let mut writer = TableWriter::new(Disk.create(path).unwrap(), &footer).unwrap();
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
            .collect::<Result<Vec<Vec<Number>>, _>>();
        assert_eq!(
            rows.unwrap().concat(),
            (0..9).map(Number::of).collect::<Vec<_>>()
        );
    }

    #[test]
    fn bytes_do_not_depend_on_how_rows_came_in() {
        let folder = tempfile::tempdir().unwrap();
        let (whole, copied) = (
            folder.path().join("whole.parquet"),
            folder.path().join("copied.parquet"),
        );
        let rows = GROUP_ROWS as u64 + 1000;
        write(&whole, 0..rows);
        let footer = Footer::default().with("note", "test");
        let mut writer =
            TableWriter::<Number>::new(Disk.create(&copied).unwrap(), &footer).unwrap();
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
        assert!(is_of_disk(footer(&Unreadable, path).unwrap_err()));
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
        let read = |least, may_exceed| {
            let expected = Some(RowCount { least, may_exceed });
            Dataset::of_known_rows(&Disk, vec![(path.clone(), expected)])
                .batches()
                .next()
                .unwrap()
                .map(|_| ())
        };
        assert!(read(5, false).is_ok() && read(5, true).is_ok() && read(4, true).is_ok());
        for error in [read(4, false), read(6, false), read(6, true)].map(Result::unwrap_err) {
            assert!(
                error
                    .to_string()
                    .contains("it has 5 rows, where the jobs of its part have"),
                "{error}"
            );
        }
    }
}
