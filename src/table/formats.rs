//! Rows of any schema, in the formats of other programs. A format is a variant of [`Format`], its description, its arm
//! in [`RowWriter::new`], and an `Encoder`.

use crate::table::arrow;
use crate::table::error::ResultsError;
use crate::table::file::Footer;
use crate::table::storage::StoredFile;
use crate::table::value::words;
use arrow_array::RecordBatch;
use arrow_ipc::writer::FileWriter;
use arrow_schema::SchemaRef;
use parquet::arrow::ArrowWriter;
use parquet::errors::ParquetError;
use std::path::PathBuf;
use std::sync::Arc;

words! {
    /// The word is also the extension of its files.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Format {
        Parquet = "parquet",
        Csv = "csv",
        Arrow = "arrow",
    }
}

impl Format {
    /// What the help says of it.
    pub const fn description(self) -> Option<&'static str> {
        match self {
            Self::Parquet => None,
            Self::Csv => Some(
                "Plain text with a line of names; real numbers with as many digits as they have",
            ),
            Self::Arrow => Some("The file format of Arrow"),
        }
    }
}

/// Turns rows into the bytes of a file.
trait Encoder {
    fn write(&mut self, rows: &RecordBatch) -> Result<(), ParquetError>;

    /// Writes what is left.
    fn finish(self: Box<Self>) -> Result<StoredFile, ParquetError>;
}

impl Encoder for ArrowWriter<StoredFile> {
    fn write(&mut self, rows: &RecordBatch) -> Result<(), ParquetError> {
        self.write(rows)
    }

    fn finish(self: Box<Self>) -> Result<StoredFile, ParquetError> {
        self.into_inner()
    }
}

impl Encoder for csv::Writer<StoredFile> {
    fn write(&mut self, rows: &RecordBatch) -> Result<(), ParquetError> {
        arrow::texts(rows)
            .try_for_each(|texts| self.write_record(texts))
            .map_err(of_csv)
    }

    fn finish(self: Box<Self>) -> Result<StoredFile, ParquetError> {
        self.into_inner()
            .map_err(|error| of_csv(error.into_error()))
    }
}

fn of_csv(error: impl Into<csv::Error>) -> ParquetError {
    ParquetError::External(error.into().into())
}

impl Encoder for FileWriter<StoredFile> {
    fn write(&mut self, rows: &RecordBatch) -> Result<(), ParquetError> {
        Ok(self.write(rows)?)
    }

    fn finish(mut self: Box<Self>) -> Result<StoredFile, ParquetError> {
        FileWriter::finish(&mut self)?;
        Ok(self.into_inner()?)
    }
}

pub struct RowWriter {
    path: PathBuf,
    encoder: Box<dyn Encoder>,
}

impl RowWriter {
    pub fn new(
        file: StoredFile,
        format: Format,
        schema: &SchemaRef,
        footer: &Footer,
    ) -> Result<Self, ResultsError> {
        let path = file.path().to_owned();
        let encoder = || -> Result<Box<dyn Encoder>, ParquetError> {
            Ok(match format {
                Format::Parquet => {
                    let properties = Some(footer.properties(schema)?);
                    Box::new(ArrowWriter::try_new(file, Arc::clone(schema), properties)?)
                }
                Format::Csv => {
                    let mut writer = csv::Writer::from_writer(file);
                    let names = schema.fields().iter().map(|field| field.name());
                    writer.write_record(names).map_err(of_csv)?;
                    Box::new(writer)
                }
                Format::Arrow => Box::new(FileWriter::try_new(file, schema)?),
            })
        };
        let encoder = encoder().map_err(ResultsError::unwritten(&path))?;
        Ok(Self { path, encoder })
    }

    pub fn write(&mut self, rows: &RecordBatch) -> Result<(), ResultsError> {
        let written = self.encoder.write(rows);
        written.map_err(ResultsError::unwritten(&self.path))
    }

    /// Writes what is left and brings the file to the disk.
    pub fn finish(self) -> Result<(), ResultsError> {
        let file = self.encoder.finish();
        Ok(file.map_err(ResultsError::unwritten(&self.path))?.sync()?)
    }
}
