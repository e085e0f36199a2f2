//! Pages and tables in `docs/` that follow from the code. The tests compare them with it, and write them with
//! `UPDATE_DOCS=1`.

use crate::model::{Description, Parameters, Symbol, Value};
use crate::observe::{ContactRow, MapRow, ProfileRow, Recording, RecordingKey, TraceRow};
use crate::reduce::{BackboneBin, EdgeRow, HistogramBin, Point, RoundOfSet, SetRow};
use crate::results::tables::{JobRow, PrecursorRow, SlipRow};
use crate::table::columns::{Column, Kind, Table};
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
    let mut text =
        "| key | symbol | meaning | default | allowed |\n|---|---|---|---|---|\n".to_owned();
    for (field, default) in fields {
        let Description {
            key,
            symbol,
            meaning,
            ..
        } = field;
        // Shorter than in messages: most values are finite numbers.
        let allowed = field
            .requirement()
            .replace("a finite number ", "")
            .replace("a whole number from", "whole,");
        writeln!(
            text,
            "| `{key}` | {symbol} | {meaning} | {default} | {allowed} |"
        )
        .unwrap();
    }
    // A column that is empty everywhere says nothing.
    if fields.iter().all(|(field, _)| field.symbol.is_empty()) {
        text = text
            .replace("| symbol ", "")
            .replacen("|---", "", 1)
            .replace("` |  |", "` |");
    }
    text
}

/// The section of a table in the documentation, in Markdown. Parameters of the model, described on another page,
/// share a line, and so do a statistic and its interval; a unit with `?` is that of a column that may be null.
pub(crate) fn markdown<T: Table>() -> String {
    let is_parameter = |column: &Column| {
        Symbol::from_key(&column.name)
            .is_some_and(|symbol| symbol.description().meaning == column.meaning)
    };
    let share_a_line = |one: &Column, next: &Column| {
        let is_interval =
            next.meaning == INTERVAL && next.name.strip_suffix("_low") == Some(&*one.name);
        let is_pair = one
            .name
            .strip_suffix("_low")
            .is_some_and(|name| next.name.strip_suffix("_high") == Some(name));
        (is_parameter(one) && is_parameter(next))
            || is_interval
            || (is_pair && one.meaning.starts_with(LOWER_END))
    };
    let line = |columns: &[Column]| {
        let names: Vec<String> = columns
            .iter()
            .map(|column| format!("`{}`", column.name))
            .collect();
        let names = names.join(" ");
        let Column {
            unit,
            meaning,
            kind,
            nullable,
            ..
        } = &columns[0];
        if is_parameter(&columns[0]) {
            return format!("| {names} | | [parameters](model.md#parameters) |\n");
        }
        let unit = match kind {
            Kind::Real if unit.is_empty() => "1",
            Kind::Real => unit,
            kind => kind.word(),
        };
        let nullable = if *nullable { "?" } else { "" };
        let meaning = meaning
            .replace(LOWER_END, "ends of")
            .replace('|', "\\|")
            .replace('<', "\\<");
        format!("| {names} | {unit}{nullable} | {meaning} |\n")
    };
    let rows: String = T::columns().chunk_by(share_a_line).map(line).collect();
    format!(
        "## {}\n\n{}.\n\n| column | unit | meaning |\n|---|---|---|\n{rows}",
        T::NAME,
        T::MEANING
    )
}

/// The meaning of the lower end of an interval of which there is nothing else to say.
const INTERVAL: &str = "lower end of its 95 % confidence interval";

/// How the meaning of the lower end of any interval begins.
const LOWER_END: &str = "lower end of";

/// How the page of tables begins.
const TABLES: &str = "\
# Tables

For readers of the data: the columns of every file, in order.
[results.md](results.md) has the files and how to read them; units and meanings are also in the metadata of each.
Quantities are SI reals in the unit given (1: a pure number), `count` (a signed 64-bit integer), `flag` or `text`.
A `?` marks columns that may be null.
Names with `_low` and `_high` are the ends of a 95 % confidence interval.

";

#[test]
fn documented_tables_are_those_written() {
    let tables = [
        markdown::<SlipRow<'_>>(),
        markdown::<PrecursorRow<'_>>(),
        markdown::<JobRow>(),
        markdown::<SetRow>(),
        markdown::<RoundOfSet>(),
        markdown::<EdgeRow>(),
        markdown::<HistogramBin>(),
        markdown::<BackboneBin>(),
        markdown::<Point>(),
        markdown::<TraceRow>(),
        markdown::<MapRow>(),
        markdown::<ProfileRow>(),
        markdown::<ContactRow>(),
    ];
    assert_documented("tables.md", &format!("{TABLES}{}", tables.join("\n")));
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
