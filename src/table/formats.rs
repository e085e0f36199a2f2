//! Rows of any schema, in the formats of other programs. A format is a variant of [`Format`], its description, a variant of
//! `Encoder`, and an arm in each function of [`RowWriter`].

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
enum Encoder {
    Parquet(Box<ArrowWriter<StoredFile>>),
    Csv(csv::Writer<StoredFile>),
    Arrow(FileWriter<StoredFile>),
}

fn of_csv(error: impl Into<csv::Error>) -> ParquetError {
    ParquetError::External(error.into().into())
}

pub struct RowWriter {
    path: PathBuf,
    encoder: Encoder,
}

impl RowWriter {
    pub fn new(
        path: PathBuf,
        file: StoredFile,
        format: Format,
        schema: &SchemaRef,
        footer: &Footer,
    ) -> Result<Self, ResultsError> {
        let begin = || -> Result<Encoder, ParquetError> {
            Ok(match format {
                Format::Parquet => {
                    let properties = Some(footer.properties(schema)?);
                    let writer = ArrowWriter::try_new(file, Arc::clone(schema), properties)?;
                    Encoder::Parquet(Box::new(writer))
                }
                Format::Csv => {
                    let mut writer = csv::Writer::from_writer(file);
                    let names = schema.fields().iter().map(|field| field.name());
                    writer.write_record(names).map_err(of_csv)?;
                    Encoder::Csv(writer)
                }
                Format::Arrow => Encoder::Arrow(FileWriter::try_new(file, schema)?),
            })
        };
        let encoder = begin().map_err(ResultsError::unwritten(&path))?;
        Ok(Self { path, encoder })
    }

    pub fn write(&mut self, rows: &RecordBatch) -> Result<(), ResultsError> {
        let written = match &mut self.encoder {
            Encoder::Parquet(writer) => writer.write(rows),
            Encoder::Csv(writer) => arrow::texts(rows)
                .try_for_each(|texts| writer.write_record(texts))
                .map_err(of_csv),
            Encoder::Arrow(writer) => writer.write(rows).map_err(ParquetError::from),
        };
        written.map_err(ResultsError::unwritten(&self.path))
    }

    /// Writes what is left and brings the file to the disk.
    pub fn finish(self) -> Result<(), ResultsError> {
        let file = match self.encoder {
            Encoder::Parquet(writer) => writer.into_inner(),
            Encoder::Csv(writer) => writer
                .into_inner()
                .map_err(|error| of_csv(error.into_error())),
            Encoder::Arrow(mut writer) => writer
                .finish()
                .and_then(|()| writer.into_inner())
                .map_err(ParquetError::from),
        };
        Ok(file.map_err(ResultsError::unwritten(&self.path))?.sync()?)
    }
}
