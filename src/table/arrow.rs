//! Rows as Arrow record batches and as JSON.
//!
//! Units stand in the metadata of every Arrow field (`unit`, `description`) and, as JSON under `PANDAS_ATTRS`, in that
//! of the Arrow schema, where pandas finds them for `DataFrame.attrs`. Counts are signed: differences of unsigned
//! columns wrap around in every reader.

use super::columns::{Column, Field as _, Kind, Row, Value};
use arrow_array::builder::{BooleanBuilder, Float64Builder, Int64Builder, StringBuilder};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, FieldRef, Fields, Schema, SchemaRef};
use serde_json::{Map, Value as Json, json};
use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

pub const UNIT: &str = "unit";
pub const DESCRIPTION: &str = "description";
/// Key under which pandas looks for `DataFrame.attrs` in the metadata of an Arrow schema.
pub const PANDAS_ATTRS: &str = "PANDAS_ATTRS";

fn data_type(kind: Kind) -> DataType {
    match kind {
        Kind::Real => DataType::Float64,
        Kind::Count => DataType::Int64,
        Kind::Flag => DataType::Boolean,
        Kind::Text => DataType::Utf8,
    }
}

fn field(column: &Column) -> Field {
    let metadata = HashMap::from([
        (UNIT.to_owned(), column.unit.to_owned()),
        (DESCRIPTION.to_owned(), column.meaning.to_owned()),
    ]);
    let kind = data_type(column.kind);
    Field::new(&*column.name, kind, column.nullable).with_metadata(metadata)
}

/// Arrow schema of a row, with units and meanings in the metadata of its fields and, for pandas, of the schema.
pub fn schema<R: Row>() -> SchemaRef {
    schema_of(R::columns().iter().map(field).collect::<Fields>())
}

/// The same of fields that have a unit and a description.
pub fn schema_of(fields: impl Into<Fields>) -> SchemaRef {
    let fields = fields.into();
    let by_name = |key| by_name(&fields, key);
    let attributes = json!({ "meaning": by_name(DESCRIPTION), "units": by_name(UNIT) });
    Arc::new(Schema::new_with_metadata(
        fields,
        HashMap::from([(PANDAS_ATTRS.to_owned(), attributes.to_string())]),
    ))
}

/// What the metadata of fields hold under a key, by the names of the fields.
pub(super) fn by_name(fields: &Fields, key: &str) -> Json {
    let text = |field: &Field| field.metadata().get(key).cloned().unwrap_or_default();
    let texts = fields
        .iter()
        .map(|field| (field.name().clone(), Json::from(text(field))));
    texts.collect::<Map<_, _>>().into()
}

/// The rows of a batch as texts, which read back as the same values; empty where a value is missing.
pub fn texts(rows: &RecordBatch) -> impl Iterator<Item = Vec<String>> {
    let text = |array: &ArrayRef, row: usize| match cell(array, row) {
        Value::Null => String::new(),
        Value::Real(real) => format!("{real:?}"),
        Value::Count(count) => count.cast_signed().to_string(),
        other => other.to_string(),
    };
    let texts = move |row| {
        rows.columns()
            .iter()
            .map(|array| text(array, row))
            .collect()
    };
    (0..rows.num_rows()).map(texts)
}

/// A row as JSON: an object with the names of the columns; null where a value is missing or not finite.
pub fn json<R: Row>(row: &R) -> Json {
    let columns = R::columns();
    let mut object = Map::new();
    row.cells(&mut |cell| {
        object.insert(columns[object.len()].name.to_string(), json!(cell));
    });
    object.into()
}

/// In what a table has not all that its row type describes, by the names of columns.
#[derive(Clone, Debug, Default)]
pub struct Gaps {
    /// Columns that are not there.
    pub left_out: Vec<Cow<'static, str>>,
    /// Columns that are null in all rows.
    pub unknown: Vec<Cow<'static, str>>,
    /// Columns whose numbers have no unit.
    pub pure: Vec<String>,
}

/// Rows of one table, column by column, before they become a record batch. How rows came in leaves no trace in the
/// batch.
pub struct RowBuffer {
    schema: SchemaRef,
    /// One for each column of the row type; `None` for a column that is left out.
    cells: Vec<Option<Cells>>,
    /// For each of these, whether all its cells are null.
    is_unknown: Vec<bool>,
    pub(super) rows: usize,
}

enum Cells {
    Real(Float64Builder),
    Count(Int64Builder),
    Flag(BooleanBuilder),
    Text(StringBuilder),
}

impl RowBuffer {
    pub fn new<R: Row>() -> Self {
        let builders = R::columns().into_iter().map(|column| {
            Some(match column.kind {
                Kind::Real => Cells::Real(Float64Builder::new()),
                Kind::Count => Cells::Count(Int64Builder::new()),
                Kind::Flag => Cells::Flag(BooleanBuilder::new()),
                Kind::Text => Cells::Text(StringBuilder::new()),
            })
        });
        let cells: Vec<Option<Cells>> = builders.collect();
        Self {
            schema: schema::<R>(),
            is_unknown: vec![false; cells.len()],
            cells,
            rows: 0,
        }
    }

    pub fn with(mut self, gaps: &Gaps) -> Self {
        let mut fields = Vec::new();
        for (place, field) in self.schema.fields().iter().enumerate() {
            if gaps.left_out.iter().any(|name| name == field.name()) {
                self.cells[place] = None;
            } else if gaps.unknown.iter().any(|name| name == field.name()) {
                self.is_unknown[place] = true;
                fields.push(Arc::new(field.as_ref().clone().with_nullable(true)));
            } else if gaps.pure.contains(field.name()) {
                let mut metadata = field.metadata().clone();
                metadata.insert(UNIT.to_owned(), String::new());
                fields.push(Arc::new(field.as_ref().clone().with_metadata(metadata)));
            } else {
                fields.push(FieldRef::clone(field));
            }
        }
        self.schema = schema_of(fields);
        self
    }

    pub const fn schema(&self) -> &SchemaRef {
        &self.schema
    }

    pub fn push<R: Row>(&mut self, row: &R) {
        let mut columns = self.cells.iter_mut().zip(&self.is_unknown);
        row.cells(&mut |cell| {
            if let Some((Some(column), is_unknown)) = columns.next() {
                column.push(if *is_unknown { Value::Null } else { cell });
            }
        });
        self.rows += 1;
    }

    /// Appends some rows of a batch of the same table.
    pub fn copy(&mut self, batch: &RecordBatch, rows: Range<usize>) -> Result<(), ArrowError> {
        let fields = self.schema.fields().iter();
        for (field, cells) in fields.zip(self.cells.iter_mut().flatten()) {
            let array =
                column(batch, field.name(), field.data_type()).map_err(ArrowError::SchemaError)?;
            rows.clone().for_each(|row| cells.push(cell(array, row)));
        }
        self.rows += rows.len();
        Ok(())
    }

    pub fn take(&mut self) -> Result<RecordBatch, ArrowError> {
        self.rows = 0;
        let columns = self.cells.iter_mut().flatten().map(Cells::take);
        RecordBatch::try_new(Arc::clone(&self.schema), columns.collect())
    }
}

impl Cells {
    fn push(&mut self, cell: Value<'_>) {
        // A cell is of the kind of its column, or missing.
        match self {
            Self::Real(cells) => cells.append_option(f64::from_value(cell)),
            Self::Count(cells) => {
                cells.append_option(u64::from_value(cell).map(u64::cast_signed));
            }
            Self::Flag(cells) => cells.append_option(bool::from_value(cell)),
            Self::Text(cells) => match cell {
                Value::Text(text) => cells.append_value(text),
                _ => cells.append_null(),
            },
        }
    }

    fn take(&mut self) -> ArrayRef {
        match self {
            Self::Real(cells) => Arc::new(cells.finish()),
            Self::Count(cells) => Arc::new(cells.finish()),
            Self::Flag(cells) => Arc::new(cells.finish()),
            Self::Text(cells) => Arc::new(cells.finish()),
        }
    }
}

fn column<'a>(
    batch: &'a RecordBatch,
    name: &str,
    expected: &DataType,
) -> Result<&'a ArrayRef, String> {
    let array = batch
        .column_by_name(name)
        .ok_or_else(|| format!("there is no column {name}"))?;
    match array.data_type() {
        found if found == expected => Ok(array),
        found => Err(format!("column {name} is {found}, not {expected}")),
    }
}

fn cell(array: &ArrayRef, row: usize) -> Value<'_> {
    match array.data_type() {
        _ if array.is_null(row) => Value::Null,
        DataType::Float64 => Value::Real(array.as_primitive::<Float64Type>().value(row)),
        DataType::Int64 => {
            Value::Count(array.as_primitive::<Int64Type>().value(row).cast_unsigned())
        }
        DataType::Boolean => Value::Flag(array.as_boolean().value(row)),
        _ => Value::Text(array.as_string::<i32>().value(row)),
    }
}

/// The rows of a batch. Columns that the row does not have are passed over; those that may be null may be missing.
pub fn rows<R: Row>(batch: &RecordBatch) -> Result<Vec<R>, String> {
    let columns = R::columns();
    let found = columns.iter().map(|described| {
        if described.nullable && batch.column_by_name(&described.name).is_none() {
            return Ok(None);
        }
        column(batch, &described.name, &data_type(described.kind)).map(Some)
    });
    let arrays = found.collect::<Result<Vec<Option<&ArrayRef>>, String>>()?;
    let row = |row: usize| {
        let mut columns = arrays.iter().copied();
        R::from_cells("", &mut || {
            let column = columns.next().flatten();
            column.map_or(Value::Null, |array| cell(array, row))
        })
    };
    (0..batch.num_rows()).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Reading, Readings, readings};
    use super::*;
    use arrow_array::{BooleanArray, Float64Array, Int64Array, StringArray};

    fn batch() -> RecordBatch {
        let mut buffer = RowBuffer::new::<Readings>();
        for row in &readings() {
            buffer.push(row);
        }
        assert_eq!(buffer.rows, 2);
        let batch = buffer.take().unwrap();
        assert_eq!(buffer.rows, 0);
        batch
    }

    #[test]
    fn rows_become_columns_of_the_described_types_with_nulls_where_a_value_is_missing() {
        let expected: Vec<ArrayRef> = vec![
            Arc::new(Float64Array::from(vec![1.5, -2.5])),
            Arc::new(Float64Array::from(vec![None, Some(0.25)])),
            Arc::new(Int64Array::from(vec![1, 2])),
            Arc::new(StringArray::from(vec!["reading 1", "reading 2"])),
            Arc::new(BooleanArray::from(vec![true, false])),
            Arc::new(StringArray::from(vec![None, Some("tension")])),
            Arc::new(Float64Array::from(vec![0.0, 1e-6])),
            Arc::new(Float64Array::from(vec![None, Some(0.01)])),
            Arc::new(StringArray::from(vec!["magnitude", "magnitude"])),
        ];
        assert_eq!(
            batch(),
            RecordBatch::try_new(schema::<Readings>(), expected).unwrap()
        );
    }

    #[test]
    fn rows_read_back_whole_and_as_projections() {
        assert_eq!(rows::<Readings>(&batch()).unwrap(), readings());
        let alone: Vec<Reading> = readings().map(|(reading, _)| reading).to_vec();
        assert_eq!(rows::<Reading>(&batch()).unwrap(), alone);
    }

    #[test]
    fn columns_that_are_left_out_read_back_as_nulls_if_they_may_be_null() {
        let without = |name: &'static str| {
            let mut buffer = RowBuffer::new::<Readings>().with(&Gaps {
                left_out: vec![name.into()],
                ..Gaps::default()
            });
            for row in &readings() {
                buffer.push(row);
            }
            buffer.take().unwrap()
        };
        let [(first, of_first), (second, of_second)] = readings();
        let expected = [
            (first, of_first),
            (
                Reading {
                    phase: None,
                    ..second
                },
                of_second,
            ),
        ];
        assert_eq!(without("phase").num_columns(), 8);
        assert_eq!(rows::<Readings>(&without("phase")).unwrap(), expected);
        assert_eq!(
            rows::<Readings>(&without("force")).unwrap_err(),
            "there is no column force"
        );
    }

    #[test]
    fn what_is_not_known_is_null_and_reads_back_as_what_stands_for_it() {
        let gaps = Gaps {
            unknown: vec!["force".into(), "Delta".into()],
            ..Gaps::default()
        };
        let mut buffer = RowBuffer::new::<Readings>().with(&gaps);
        buffer.push(&readings()[1]);
        let batch = buffer.take().unwrap();
        let is_null = |name: &str| batch.column_by_name(name).unwrap().is_null(0);
        assert!(is_null("force") && is_null("Delta") && !is_null("phase"));
        let (reading, selected) = rows::<Readings>(&batch).unwrap().remove(0);
        assert!(reading.force.is_nan());
        let delta = crate::model::Symbol::Delta;
        assert_eq!(selected.unknown, [delta]);
        assert_eq!(selected.get(delta), Value::Null);
    }

    #[test]
    fn copied_rows_equal_pushed_rows() {
        let mut copied = RowBuffer::new::<Readings>();
        copied.copy(&batch(), 0..1).unwrap();
        copied.copy(&batch(), 1..2).unwrap();
        assert_eq!(copied.take().unwrap(), batch());
    }

    #[test]
    fn a_batch_of_another_table_is_refused_by_column() {
        let other = RecordBatch::try_from_iter([(
            "force",
            Arc::new(Int64Array::from(vec![1])) as ArrayRef,
        )])
        .unwrap();
        let error = RowBuffer::new::<Reading>().copy(&other, 0..1).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("column force is Int64, not Float64"),
            "{error}"
        );
        assert_eq!(
            rows::<Reading>(&other).unwrap_err(),
            "column force is Int64, not Float64"
        );
    }

    #[test]
    fn rows_become_json_by_the_names_of_the_columns() {
        let [first, (second, selected)] = readings();
        let expected = json!({
            "force": 1.5, "phase": null, "number": 1, "name": "reading 1", "high": true, "rule": null, "Delta": 0.0,
            "T": null, "break_on": "magnitude"
        });
        assert_eq!(json(&first), expected);
        let second = json(&(
            Reading {
                force: f64::NAN,
                ..second
            },
            selected,
        ));
        assert_eq!(
            (&second["force"], &second["phase"], &second["T"]),
            (&Json::Null, &json!(0.25), &json!(0.01))
        );
    }

    #[test]
    fn units_are_in_the_fields_and_where_pandas_looks() {
        let schema = schema::<Readings>();
        assert_eq!(schema.field(0).metadata()[UNIT], "N");
        assert_eq!(
            schema.field(1).metadata()[DESCRIPTION],
            "phase of the onset"
        );
        let attributes: Json = serde_json::from_str(&schema.metadata()[PANDAS_ATTRS]).unwrap();
        assert_eq!(attributes["units"]["T"], "s");
        assert_eq!(attributes["meaning"]["force"], "shear force");
    }
}
