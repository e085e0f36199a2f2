//! Which rows belong to controls: a column that tables lack, as it depends on all sweeps of the directory.

use crate::model::selected::Selected;
use crate::results::directory::Results;
use crate::results::tables::{All, JOBS, Names};
use crate::table::arrow::schema;
use crate::table::columns::columns;
use crate::table::error::ResultsError;
use arrow_array::cast::AsArray;
use arrow_array::{ArrayRef, BooleanArray, RecordBatch};
use arrow_schema::Field;
use std::collections::HashSet;
use std::sync::Arc;

/// Name of the column.
pub const CONTROL: &str = "control";
/// The column by which it follows.
pub const SET_ID: &str = "set_id";

columns! {
    struct OfSet {
        is_control as "control": bool = "", "whether its set was run as a control alone (`control = true`)";
    }
}

/// The sets of a directory that were run as controls alone.
pub struct ControlSets(HashSet<String>);

impl ControlSets {
    pub fn field() -> Field {
        schema::<OfSet>().field(0).clone()
    }

    pub fn of(results: &Results<'_>) -> Result<Self, ResultsError> {
        let plan = results.plan();
        let mut sets = HashSet::new();
        if plan.sweeps().any(|sweep| sweep.recording().control) {
            for batch in results.dataset(JOBS)?.rows::<(Names, Selected<All>)>() {
                for (names, set) in batch? {
                    if plan.is_control(&set.parameters) {
                        sets.insert(names.set_id);
                    }
                }
            }
        }
        Ok(Self(sets))
    }

    /// The column, for rows with the ids of their sets.
    pub fn column(&self, rows: &RecordBatch) -> Option<ArrayRef> {
        let ids = rows.column_by_name(SET_ID)?.as_string_opt::<i32>()?;
        let flags = ids.iter().map(|id| id.map(|id| self.0.contains(id)));
        Some(Arc::new(flags.collect::<BooleanArray>()))
    }
}
