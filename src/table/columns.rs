//! Columns: name, unit, meaning and value described once, giving Arrow schema, units in metadata, arrays and documentation.
//!
//! Units stand in the metadata of every Arrow field (`unit`, `description`) and, as JSON under `PANDAS_ATTRS`, in that of the
//! Arrow schema, where pandas finds them for `DataFrame.attrs`. Counts are signed: differences of unsigned columns wrap
//! around in every reader.

use crate::model::{Parameters, Symbol, Value};
use arrow_array::{Array, ArrayRef, BooleanArray, Float64Array, Int64Array, RecordBatch, StringArray};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use serde_json::{Map, Value as Json, json};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::ops::Range;
use std::sync::Arc;

/// Key of the unit in a field's metadata.
pub const UNIT: &str = "unit";
/// Key of the meaning in a field's metadata.
pub const DESCRIPTION: &str = "description";
/// Key under which pandas looks for `DataFrame.attrs` in the metadata of an Arrow schema.
pub const PANDAS_ATTRS: &str = "PANDAS_ATTRS";

/// How a column's value comes out of a row. The optional ones may be null.
#[derive(Clone, Copy)]
pub enum Getter<Row> {
    /// A double.
    Real(fn(&Row) -> f64),
    /// A double that may be missing.
    OptionalReal(fn(&Row) -> Option<f64>),
    /// A whole number.
    Count(fn(&Row) -> u64),
    /// A whole number that may be missing.
    OptionalCount(fn(&Row) -> Option<u64>),
    /// A text.
    Text(fn(&Row) -> String),
    /// A text that may be missing.
    OptionalText(fn(&Row) -> Option<String>),
    /// Yes or no.
    Flag(fn(&Row) -> bool),
    /// A parameter of the model; null for a period when the modulation is off.
    Parameter(Symbol, fn(&Row) -> &Parameters),
}

impl<Row> Getter<Row> {
    fn json(&self, row: &Row) -> Json {
        match self {
            Self::Real(get) => get(row).into(),
            Self::OptionalReal(get) => get(row).into(),
            Self::Count(get) => get(row).into(),
            Self::OptionalCount(get) => get(row).into(),
            Self::Text(get) => get(row).into(),
            Self::OptionalText(get) => get(row).into(),
            Self::Flag(get) => get(row).into(),
            Self::Parameter(symbol, of) => match of(row).get(*symbol) {
                Value::Real(real) => real.into(),
                Value::Count(count) => count.into(),
                Value::BreakOn(rule) => rule.word().into(),
                Value::Flag(flag) => flag.into(),
                Value::Absent => Json::Null,
            },
        }
    }
}

/// A column of a table whose rows are of type `Row`.
#[derive(Clone, Copy)]
pub struct Column<Row> {
    /// Name, fixed for readers.
    pub name: &'static str,
    /// SI unit; empty for a pure number or a text.
    pub unit: &'static str,
    /// One line, without a full stop.
    pub meaning: &'static str,
    /// The value.
    pub value: Getter<Row>,
}

impl<Row> Column<Row> {
    /// Describes a column.
    #[must_use]
    pub const fn new(name: &'static str, unit: &'static str, meaning: &'static str, value: Getter<Row>) -> Self {
        Self { name, unit, meaning, value }
    }

    /// The column of a parameter, under its key and with its unit and meaning.
    #[must_use]
    pub const fn parameter(symbol: Symbol, of: fn(&Row) -> &Parameters) -> Self {
        let described = symbol.description();
        Self::new(described.key, described.unit, described.meaning, Getter::Parameter(symbol, of))
    }

    fn field(&self) -> Field {
        let (data_type, nullable) = match self.value {
            Getter::Real(_) => (DataType::Float64, false),
            Getter::OptionalReal(_) => (DataType::Float64, true),
            Getter::Count(_) => (DataType::Int64, false),
            Getter::OptionalCount(_) => (DataType::Int64, true),
            Getter::Text(_) => (DataType::Utf8, false),
            Getter::OptionalText(_) => (DataType::Utf8, true),
            Getter::Flag(_) => (DataType::Boolean, false),
            Getter::Parameter(symbol, _) => match Parameters::default().get(symbol) {
                Value::Count(_) => (DataType::Int64, false),
                Value::Real(_) => (DataType::Float64, false),
                Value::BreakOn(_) | Value::Flag(_) => (DataType::Utf8, false),
                Value::Absent => (DataType::Float64, true),
            },
        };
        Field::new(self.name, data_type, nullable).with_metadata(HashMap::from([
            (UNIT.to_owned(), self.unit.to_owned()),
            (DESCRIPTION.to_owned(), self.meaning.to_owned()),
        ]))
    }
}

/// A table: its name, its meaning and its columns in order.
#[derive(Clone)]
pub struct Table<Row> {
    /// Name, which is also that of its folder.
    pub name: &'static str,
    /// What a row is; one line, without a full stop.
    pub meaning: &'static str,
    /// Columns, in order.
    pub columns: Vec<Column<Row>>,
}

impl<Row> Table<Row> {
    /// Arrow schema with units and meanings in the metadata of its fields and, for pandas, of the schema.
    #[must_use]
    pub fn schema(&self) -> SchemaRef {
        let by_name = |text: fn(&Column<Row>) -> &'static str| {
            self.columns.iter().map(|column| (column.name.to_owned(), text(column).into())).collect::<Map<_, _>>()
        };
        let attributes = json!({ "meaning": by_name(|column| column.meaning), "units": by_name(|column| column.unit) });
        let fields: Vec<Field> = self.columns.iter().map(Column::field).collect();
        Arc::new(Schema::new_with_metadata(fields, HashMap::from([(PANDAS_ATTRS.to_owned(), attributes.to_string())])))
    }

    /// The table's section of the documentation, in Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut text =
            format!("## {}\n\n{}.\n\n| column | type | unit | meaning |\n|---|---|---|---|\n", self.name, self.meaning);
        for column in &self.columns {
            let field = column.field();
            let kind = match field.data_type() {
                DataType::Float64 => "real",
                DataType::Int64 => "count",
                DataType::Boolean => "flag",
                _ => "text",
            };
            let nullable = if field.is_nullable() { ", may be null" } else { "" };
            // Writing to a string cannot fail.
            let _ = writeln!(text, "| `{}` | {kind}{nullable} | {} | {} |", column.name, column.unit, column.meaning);
        }
        text
    }

    /// A row as JSON: an object with the names of the columns; null where a value is missing or not finite.
    #[must_use]
    pub fn json(&self, row: &Row) -> Json {
        self.columns.iter().map(|column| (column.name.to_owned(), column.value.json(row))).collect()
    }

    /// An empty buffer for rows of this table.
    #[must_use]
    pub fn buffer(&self) -> RowBuffer {
        let schema = self.schema();
        let cells = schema.fields().iter().map(|field| Cells::of(field.data_type())).collect();
        RowBuffer { schema, cells, rows: 0 }
    }

    /// Appends a row to a buffer of this table.
    pub fn push(&self, buffer: &mut RowBuffer, row: &Row) {
        for (column, cells) in self.columns.iter().zip(&mut buffer.cells) {
            cells.push(&column.value, row);
        }
        buffer.rows += 1;
    }
}

/// Rows of one table, column by column, before they become a record batch. How rows came in leaves no trace in the batch.
pub struct RowBuffer {
    schema: SchemaRef,
    cells: Vec<Cells>,
    rows: usize,
}

impl RowBuffer {
    /// Number of rows.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows
    }

    /// Whether there is no row.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.rows == 0
    }

    /// Schema of the rows.
    #[must_use]
    pub const fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    /// Appends some rows of a batch of the same table.
    ///
    /// # Errors
    /// When the batch has other columns or types; the buffer may then not be used further.
    pub fn copy(&mut self, batch: &RecordBatch, rows: Range<usize>) -> Result<(), ArrowError> {
        for (field, cells) in self.schema.fields().iter().zip(&mut self.cells) {
            let array = batch
                .column_by_name(field.name())
                .ok_or_else(|| ArrowError::SchemaError(format!("there is no column {}", field.name())))?;
            cells.extend(array.slice(rows.start, rows.len()).as_ref()).ok_or_else(|| {
                ArrowError::SchemaError(format!(
                    "column {} is {}, not {}",
                    field.name(),
                    array.data_type(),
                    field.data_type()
                ))
            })?;
        }
        self.rows += rows.len();
        Ok(())
    }

    /// Takes all rows out as one batch.
    ///
    /// # Errors
    /// When a column that may not be null holds a null, copied from a batch.
    pub fn take(&mut self) -> Result<RecordBatch, ArrowError> {
        self.rows = 0;
        RecordBatch::try_new(Arc::clone(&self.schema), self.cells.iter_mut().map(Cells::take).collect())
    }
}

/// The cells of one column.
enum Cells {
    Real(Vec<Option<f64>>),
    Count(Vec<Option<i64>>),
    Text(Vec<Option<String>>),
    Flag(Vec<Option<bool>>),
}

impl Cells {
    fn of(data_type: &DataType) -> Self {
        match data_type {
            DataType::Float64 => Self::Real(Vec::new()),
            DataType::Int64 => Self::Count(Vec::new()),
            DataType::Boolean => Self::Flag(Vec::new()),
            _ => Self::Text(Vec::new()),
        }
    }

    fn push<Row>(&mut self, value: &Getter<Row>, row: &Row) {
        match value {
            Getter::Real(get) => self.push_real(Some(get(row))),
            Getter::OptionalReal(get) => self.push_real(get(row)),
            Getter::Count(get) => self.push_count(Some(get(row))),
            Getter::OptionalCount(get) => self.push_count(get(row)),
            Getter::Text(get) => self.push_text(Some(get(row))),
            Getter::OptionalText(get) => self.push_text(get(row)),
            Getter::Flag(get) => {
                if let Self::Flag(cells) = self {
                    cells.push(Some(get(row)));
                }
            }
            Getter::Parameter(symbol, of) => match of(row).get(*symbol) {
                Value::Real(real) => self.push_real(Some(real)),
                Value::Absent => self.push_real(None),
                Value::Count(count) => self.push_count(Some(count)),
                value => self.push_text(Some(value.to_string())),
            },
        }
    }

    fn push_real(&mut self, real: Option<f64>) {
        if let Self::Real(cells) = self {
            cells.push(real);
        }
    }

    fn push_count(&mut self, count: Option<u64>) {
        if let Self::Count(cells) = self {
            cells.push(count.map(u64::cast_signed));
        }
    }

    fn push_text(&mut self, text: Option<String>) {
        if let Self::Text(cells) = self {
            cells.push(text);
        }
    }

    fn extend(&mut self, array: &dyn Array) -> Option<()> {
        let array = array.as_any();
        match self {
            Self::Real(cells) => cells.extend(array.downcast_ref::<Float64Array>()?.iter()),
            Self::Count(cells) => cells.extend(array.downcast_ref::<Int64Array>()?.iter()),
            Self::Flag(cells) => cells.extend(array.downcast_ref::<BooleanArray>()?.iter()),
            Self::Text(cells) => {
                cells.extend(array.downcast_ref::<StringArray>()?.iter().map(|text| text.map(str::to_owned)));
            }
        }
        Some(())
    }

    fn take(&mut self) -> ArrayRef {
        match self {
            Self::Real(cells) => Arc::new(std::mem::take(cells).into_iter().collect::<Float64Array>()),
            Self::Count(cells) => Arc::new(std::mem::take(cells).into_iter().collect::<Int64Array>()),
            Self::Flag(cells) => Arc::new(std::mem::take(cells).into_iter().collect::<BooleanArray>()),
            Self::Text(cells) => Arc::new(std::mem::take(cells).into_iter().collect::<StringArray>()),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Holds a page of the documentation that is made from columns; writes it anew if `UPDATE_DOCS` is set.
    pub(crate) fn assert_documented(page: &str, text: &str) {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(page);
        if std::env::var_os("UPDATE_DOCS").is_some() {
            std::fs::write(&file, text).unwrap();
        }
        assert!(
            std::fs::read_to_string(&file).unwrap_or_default() == text,
            "docs/{page} is out of date: run the tests with UPDATE_DOCS=1"
        );
    }

    struct Reading {
        force: f64,
        phase: Option<f64>,
        number: u64,
        parameters: Parameters,
    }

    fn table() -> Table<Reading> {
        Table {
            name: "readings",
            meaning: "One row per reading",
            columns: vec![
                Column::new("force", "N", "shear force", Getter::Real(|row| row.force)),
                Column::new("phase", "rad", "phase of the onset", Getter::OptionalReal(|row| row.phase)),
                Column::new("number", "", "number of the reading", Getter::Count(|row| row.number)),
                Column::new("name", "", "its name", Getter::Text(|row| format!("reading {}", row.number))),
                Column::new("high", "", "above 1 N", Getter::Flag(|row| row.force > 1.0)),
                Column::parameter(Symbol::T, |row| &row.parameters),
                Column::parameter(Symbol::BreakOn, |row| &row.parameters),
            ],
        }
    }

    fn rows() -> [Reading; 2] {
        let modulated =
            Parameters { modulation_amplitude: 1e-6, modulation_period: Some(0.01), ..Parameters::default() };
        [
            Reading { force: 1.5, phase: None, number: 1, parameters: Parameters::default() },
            Reading { force: -2.5, phase: Some(0.25), number: 2, parameters: modulated },
        ]
    }

    #[test]
    fn rows_become_columns_of_the_described_types_with_nulls_where_a_value_is_missing() {
        let (table, mut buffer) = (table(), table().buffer());
        for row in &rows() {
            table.push(&mut buffer, row);
        }
        assert_eq!(buffer.len(), 2);
        let batch = buffer.take().unwrap();
        let expected: Vec<ArrayRef> = vec![
            Arc::new(Float64Array::from(vec![1.5, -2.5])),
            Arc::new(Float64Array::from(vec![None, Some(0.25)])),
            Arc::new(Int64Array::from(vec![1, 2])),
            Arc::new(StringArray::from(vec!["reading 1", "reading 2"])),
            Arc::new(BooleanArray::from(vec![true, false])),
            Arc::new(Float64Array::from(vec![None, Some(0.01)])),
            Arc::new(StringArray::from(vec!["magnitude", "magnitude"])),
        ];
        assert_eq!(batch, RecordBatch::try_new(table.schema(), expected).unwrap());
        assert!(buffer.is_empty());
    }

    #[test]
    fn copied_rows_equal_pushed_rows() {
        let (table, mut pushed, mut copied) = (table(), table().buffer(), table().buffer());
        for row in &rows() {
            table.push(&mut pushed, row);
        }
        let batch = pushed.take().unwrap();
        copied.copy(&batch, 0..1).unwrap();
        copied.copy(&batch, 1..2).unwrap();
        assert_eq!(copied.take().unwrap(), batch);
    }

    #[test]
    fn a_batch_of_another_table_is_refused_by_column() {
        let batch = RecordBatch::try_from_iter([("force", Arc::new(Int64Array::from(vec![1])) as ArrayRef)]).unwrap();
        let error = table().buffer().copy(&batch, 0..1).unwrap_err();
        assert!(error.to_string().contains("column force is Int64, not Float64"), "{error}");
    }

    #[test]
    fn rows_become_json_by_the_names_of_the_columns() {
        let [first, second] = rows();
        let expected = json!({
            "force": 1.5, "phase": null, "number": 1, "name": "reading 1", "high": true, "T": null, "break_on": "magnitude"
        });
        assert_eq!(table().json(&first), expected);
        let second = table().json(&Reading { force: f64::NAN, ..second });
        assert_eq!((&second["force"], &second["phase"], &second["T"]), (&Json::Null, &json!(0.25), &json!(0.01)));
    }

    #[test]
    fn units_are_in_the_fields_and_where_pandas_looks() {
        let schema = table().schema();
        assert_eq!(schema.field(0).metadata()[UNIT], "N");
        assert_eq!(schema.field(1).metadata()[DESCRIPTION], "phase of the onset");
        let attributes: serde_json::Value = serde_json::from_str(&schema.metadata()[PANDAS_ATTRS]).unwrap();
        assert_eq!(attributes["units"]["T"], "s");
        assert_eq!(attributes["meaning"]["force"], "shear force");
    }
}
