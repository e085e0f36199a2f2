//! Pages and tables in `docs/` that follow from the code. The tests compare them with it, and write them with
//! `UPDATE_DOCS=1`.

use crate::model::{Description, Parameters, Symbol, Value};
use crate::observe::{ContactRow, MapRow, ProfileRow, Recording, RecordingKey, TraceRow};
use crate::reduce::{BackboneBin, EdgeRow, HistogramBin, Point, PulseRow, RoundOfSet, TriggerRow};
use crate::results::tables::{JobRow, OptionalTable, PrecursorRow, RecordedTable, SlipRow};
use crate::sets::SetRow;
use crate::solver::{Solver, SolverKey};
use crate::table::Table;
use crate::table::columns::{Class, Column, Kind, Row};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Asserts that a page has this text.
fn assert_documented(page: &str, text: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(file(page), text).unwrap();
    }
    assert!(
        std::fs::read_to_string(file(page)).unwrap_or_default() == text,
        "docs/{page} is out of date: run the tests with UPDATE_DOCS=1"
    );
}

/// Asserts that the first table below a heading of a page describes these fields with their defaults.
fn assert_table_documented(page: &str, heading: &str, fields: &[(Description, Value)]) {
    assert_rows_documented(page, heading, &table(fields));
}

/// Asserts that the first table below a heading of a page is this one.
fn assert_rows_documented(page: &str, heading: &str, table: &str) {
    let text = std::fs::read_to_string(file(page)).unwrap();
    let start = text.find(&format!("\n{heading}\n")).unwrap();
    let start = start + text[start..].find("\n|").unwrap() + 1;
    let end = text[start..]
        .find("\n\n")
        .map_or(text.len(), |end| start + end + 1);
    assert_documented(page, &format!("{}{table}{}", &text[..start], &text[end..]));
}

fn file(page: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("docs")
        .join(page)
}

fn table(fields: &[(Description, Value)]) -> String {
    // A column that is empty everywhere says nothing.
    let has_symbols = fields.iter().any(|(field, _)| !field.symbol.is_empty());
    let symbol_cell = |symbol: &str| {
        if has_symbols {
            format!(" {symbol} |")
        } else {
            String::new()
        }
    };
    let head = symbol_cell("symbol");
    let rule = if has_symbols { "---|" } else { "" };
    let mut text =
        format!("| key |{head} meaning | default | allowed |\n|---|{rule}---|---|---|\n");
    for (field, default) in fields {
        let key = &field.name;
        let meaning = field.meaning;
        let symbol = symbol_cell(field.symbol);
        // Shorter than in messages: most values are finite numbers.
        let allowed = field
            .requirement()
            .replace("a finite number ", "")
            .replace("a whole number from", "whole,");
        writeln!(
            text,
            "| `{key}` |{symbol} {meaning} | {default} | {allowed} |"
        )
        .unwrap();
    }
    text
}

/// The section of a table in the documentation, in Markdown: a line for each column. Parameters of the model, described
/// on another page, share a line, and so do columns that an earlier table has, and a statistic and its interval.
pub(crate) fn markdown<T: Table>(earlier: &[(&'static str, Vec<Column>)]) -> String {
    let is_parameter = |column: &Column| column.class == Class::Parameter;
    let earlier_table = |column: &Column| {
        let stored = |of: &Column| (of.name.clone(), of.unit, of.meaning, of.kind, of.nullable);
        let is_same = |known: &Column| stored(known) == stored(column);
        let has_it = |(_, columns): &&(_, Vec<Column>)| columns.iter().any(is_same);
        let table = earlier.iter().find(has_it).map(|(name, _)| *name);
        table.filter(|_| !is_parameter(column))
    };
    let share_a_line = |one: &Column, next: &Column| {
        let is_known = |column| earlier_table(column).is_some();
        (is_known(one) && is_known(next) && earlier_table(one) == earlier_table(next))
            || (is_parameter(one) && is_parameter(next))
            || next.is_end()
    };
    let line = |columns: &[Column]| {
        let names: Vec<String> = columns
            .iter()
            .map(|column| format!("`{}`", column.name))
            .collect();
        let first = &names[0];
        let last = &names[names.len() - 1];
        if let Some(table) = earlier_table(&columns[0]) {
            return format!("- {}: as in [{table}](#{table})\n", names.join(", "));
        }
        if is_parameter(&columns[0]) {
            let names = if names.len() > 4 {
                format!("{first} to {last}")
            } else {
                names.join(", ")
            };
            return format!("- {names}: [parameters](model.md#parameters)\n");
        }
        let Column {
            unit,
            meaning,
            kind,
            nullable,
            ..
        } = &columns[0];
        let unit = match kind {
            Kind::Real if unit.is_empty() => "1",
            Kind::Real => unit,
            kind => kind.word(),
        };
        let nullable = if *nullable { "?" } else { "" };
        let has_interval = if columns.len() == 3 { " ±" } else { "" };
        let of_interval = columns
            .get(1)
            .and_then(|low| low.meaning.strip_prefix(INTERVAL))
            .map(|more| more.trim_start_matches([',', ';', ' ']))
            .filter(|more| !more.is_empty())
            .map(|more| format!("; interval: {more}"));
        let of_interval = of_interval.unwrap_or_default();
        let meaning = meaning.replace('<', "\\<");
        format!("- {first}{has_interval} ({unit}{nullable}): {meaning}{of_interval}\n")
    };
    let rows: String = T::columns().chunk_by(share_a_line).map(line).collect();
    let wrapped = rows.lines().map(wrapped).collect::<String>();
    format!("## {}\n\n{}.\n\n{wrapped}", T::NAME, T::MEANING)
}

/// An item of a list on lines of at most 120 characters.
fn wrapped(item: &str) -> String {
    let mut text = String::new();
    let mut length = 0;
    for word in item.split(' ') {
        let added = word.chars().count() + 1;
        if length + added > 120 {
            text.push_str("\n ");
            length = 1;
        }
        if length > 0 {
            text.push(' ');
        }
        text.push_str(word);
        length += added;
    }
    text + "\n"
}

/// How the meaning of the lower end of an interval begins.
const INTERVAL: &str = "lower end of its 95 % confidence interval";

/// How the page of tables begins.
const TABLES: &str = "\
# Tables

The columns of every file, in order; [results.md](results.md) says how to read them.
Units and meanings are also in the metadata of each file.
Quantities are SI reals in the unit given (1: a pure number), `count` (a signed 64-bit integer), `flag` or `text`.
A `?` marks columns that may be null, and ± those with a 95 % confidence interval in two more columns, which end in
`_low` and `_high`.

";

#[test]
fn documented_tables_are_those_written() {
    let mut sections: Vec<String> = Vec::new();
    let mut earlier: Vec<(&str, Vec<Column>)> = Vec::new();
    macro_rules! document {
        ($($row:ty)*) => {$(
            sections.push(markdown::<$row>(&earlier));
            earlier.push((<$row as Table>::NAME, <$row>::columns()));
        )*};
    }
    document! {
        SlipRow<'_> PrecursorRow<'_> JobRow SetRow RoundOfSet EdgeRow TriggerRow PulseRow HistogramBin BackboneBin Point TraceRow
        MapRow ProfileRow ContactRow
    }
    let recorded = RecordedTable::ALL.map(RecordedTable::word);
    let optional = OptionalTable::ALL.map(OptionalTable::word);
    for name in recorded.iter().chain(&optional) {
        let is_there = earlier.iter().any(|(known, _)| known == name);
        assert!(is_there, "`document!` above lacks the rows of {name}");
    }
    assert_documented("tables.md", &format!("{TABLES}{}", sections.join("\n")));
}

#[test]
fn documented_parameters_are_those_of_the_model() {
    let defaults = Parameters::default();
    let rows = Symbol::ALL.map(|symbol| (symbol.description(), defaults.get(symbol)));
    assert_table_documented("model.md", "## Parameters", &rows);
}

#[test]
fn documented_keys_are_those_of_a_recording() {
    let rows = RecordingKey::ALL.map(|key| (key.description(), Recording::default().get(key)));
    assert_table_documented("sweeps.md", "## [record]", &rows);
}

#[test]
fn documented_settings_are_those_of_a_solver() {
    let rows = SolverKey::ALL.map(|key| (key.description(), Solver::default().get(key)));
    assert_table_documented("sweeps.md", "## [solver]", &rows);
}
