//! Tables of Arrow, handed on without a copy through the C interface of Arrow.

use crate::errors::Error;
use arrow_array::ffi::FFI_ArrowSchema;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{RecordBatch, RecordBatchIterator};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{DataType, Field, SchemaRef};
use pyo3::exceptions::PyAttributeError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule, PyDict, PyTuple};
use stickslip::table::Table as TableRow;
use stickslip::table::arrow::{DESCRIPTION, Gaps, RowBuffer, UNIT};

/// A table with its units, in Arrow's memory layout.
///
/// pandas, polars, DuckDB and pyarrow take it without a copy: `pyarrow.table(slips)`,
/// `polars.DataFrame(slips)`, `duckdb.sql("from slips")`. All quantities are in SI units.
/// `slips["interval"]` is a column as a `pandas.Series`.
#[pyclass(frozen, mapping, module = "stickslip")]
pub struct Table {
    name: String,
    schema: SchemaRef,
    batches: Vec<RecordBatch>,
}

impl Table {
    pub fn new(name: &str, schema: SchemaRef, batches: Vec<RecordBatch>) -> Self {
        Self {
            name: name.to_owned(),
            schema,
            batches,
        }
    }

    /// A table of rows in memory.
    pub fn of_rows<R: TableRow>(rows: impl Iterator<Item = R>) -> Result<Self, Error> {
        Self::with(&Gaps::default(), rows)
    }

    pub fn with<R: TableRow>(gaps: &Gaps, rows: impl Iterator<Item = R>) -> Result<Self, Error> {
        let mut buffer = RowBuffer::new::<R>().with(gaps);
        rows.for_each(|row| buffer.push(&row));
        let batch = buffer.take()?;
        Ok(Self::new(R::NAME, batch.schema(), vec![batch]))
    }

    /// What the metadata of the columns have under a key.
    fn described<'py>(&self, py: Python<'py>, key: &str) -> PyResult<Bound<'py, PyDict>> {
        let texts = PyDict::new(py);
        for field in self.schema.fields() {
            texts.set_item(field.name(), metadata(field, key))?;
        }
        Ok(texts)
    }
}

fn metadata<'f>(field: &'f Field, key: &str) -> &'f str {
    field.metadata().get(key).map_or("", String::as_str)
}

/// A column's type in words.
fn kind(field: &Field) -> &'static str {
    match field.data_type() {
        DataType::Float64 => "float",
        DataType::Int64 => "int",
        DataType::Boolean => "bool",
        _ => "str",
    }
}

#[pymethods]
impl Table {
    /// Name of the table.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<&str> {
        self.schema
            .fields()
            .iter()
            .map(|field| field.name().as_str())
            .collect()
    }

    /// Unit of each column; "" for a pure number or a text.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.described(py, UNIT)
    }

    /// Meaning of each column.
    #[getter]
    fn meaning<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.described(py, DESCRIPTION)
    }

    fn __getitem__<'py>(slf: &Bound<'py, Self>, column: &str) -> PyResult<Bound<'py, PyAny>> {
        Self::to_pandas(slf)?.get_item(column)
    }

    fn __getattr__(&self, name: &str) -> PyResult<()> {
        let table = &self.name;
        Err(PyAttributeError::new_err(format!(
            "Table has no {name}: columns are {table}[NAME], and to_pandas() gives a table with more methods"
        )))
    }

    /// Number of rows.
    fn __len__(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    fn __repr__(&self) -> String {
        let fields = self.schema.fields();
        let width = |text: fn(&Field) -> &str| {
            fields
                .iter()
                .map(|field| text(field).chars().count())
                .max()
                .unwrap_or(0)
        };
        let names = width(|field| field.name());
        let units = width(|field| metadata(field, UNIT));
        let line = |field: &std::sync::Arc<Field>| {
            let name = field.name();
            let kind = kind(field);
            let unit = metadata(field, UNIT);
            let meaning = metadata(field, DESCRIPTION);
            format!("  {name:names$}  {kind:5}  {unit:units$}  {meaning}")
        };
        let rows = match self.__len__() {
            1 => "1 row".to_owned(),
            rows => format!("{rows} rows"),
        };
        let lines: Vec<String> = fields
            .iter()
            .map(|field| line(field).trim_end().to_owned())
            .collect();
        format!("{}: {rows}\n{}", self.name, lines.join("\n"))
    }

    /// Hands the table on as a stream of Arrow; `requested_schema` is not looked at.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // A consumer casts by itself what it wants in another type, as the interface allows.
        drop(requested_schema);
        let batches = self.batches.clone().into_iter().map(Ok);
        let reader = RecordBatchIterator::new(batches, SchemaRef::clone(&self.schema));
        PyCapsule::new_with_value(
            py,
            FFI_ArrowArrayStream::new(Box::new(reader)),
            c"arrow_array_stream",
        )
    }

    /// Hands on the names, types, units and meanings of the columns.
    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.schema.as_ref()).map_err(Error::from)?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    /// Pickled, it is a stream of Arrow IPC.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let stream = || -> Result<Vec<u8>, Error> {
            let mut writer = StreamWriter::try_new(Vec::new(), &self.schema)?;
            self.batches
                .iter()
                .try_for_each(|batch| writer.write(batch))?;
            Ok(writer.into_inner()?)
        };
        let arguments = (&self.name, PyBytes::new(py, &stream()?)).into_pyobject(py)?;
        Ok((
            py.get_type::<Self>().getattr(intern!(py, "_of_stream"))?,
            arguments,
        ))
    }

    #[staticmethod]
    fn _of_stream(name: &str, bytes: &[u8]) -> PyResult<Self> {
        let read = || -> Result<Self, Error> {
            let reader = StreamReader::try_new(bytes, None)?;
            Ok(Self::new(
                name,
                reader.schema(),
                reader.collect::<Result<_, _>>()?,
            ))
        };
        Ok(read()?)
    }

    /// The table as a `pyarrow.Table`; units and meanings are in the metadata of its fields.
    fn to_pyarrow<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        py.import(intern!(py, "pyarrow"))?
            .call_method1(intern!(py, "table"), (slf,))
    }

    /// The table as a `pandas.DataFrame`; units and meanings are in `.attrs["units"]` and `.attrs["meaning"]`.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let frame = Self::to_pyarrow(slf)?.call_method0(intern!(py, "to_pandas"))?;
        let attributes = PyDict::new(py);
        attributes.set_item("units", slf.get().units(py)?)?;
        attributes.set_item("meaning", slf.get().meaning(py)?)?;
        frame.setattr(intern!(py, "attrs"), attributes)?;
        Ok(frame)
    }

    /// The table as a `polars.DataFrame`, which keeps no units: see `units`.
    fn to_polars<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        py.import(intern!(py, "polars"))?
            .call_method1(intern!(py, "DataFrame"), (slf,))
    }
}
