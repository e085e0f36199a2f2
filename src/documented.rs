//! Pages and tables in `docs/` that follow from the code: the tests hold them against it, and write them with
//! `UPDATE_DOCS=1`.

use crate::model::{Description, Value};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Asserts that a page has this text.
pub(crate) fn assert_documented(page: &str, text: &str) {
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(file(page), text).unwrap();
    }
    assert!(
        std::fs::read_to_string(file(page)).unwrap_or_default() == text,
        "docs/{page} is out of date: run the tests with UPDATE_DOCS=1"
    );
}

/// Asserts that the first table below a heading of a page describes these fields with their defaults.
pub(crate) fn assert_table_documented(page: &str, heading: &str, fields: &[(Description, Value)]) {
    assert_rows_documented(page, heading, &table(fields));
}

/// Asserts that the first table below a heading of a page is this one.
pub(crate) fn assert_rows_documented(page: &str, heading: &str, table: &str) {
    let text = std::fs::read_to_string(file(page)).unwrap();
    let start = text.find(&format!("\n{heading}\n")).unwrap();
    let start = start + text[start..].find("\n|").unwrap() + 1;
    let end = text[start..].find("\n\n").map_or(text.len(), |end| start + end + 1);
    assert_documented(page, &format!("{}{table}{}", &text[..start], &text[end..]));
}

fn file(page: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(page)
}

fn table(fields: &[(Description, Value)]) -> String {
    let mut text = "| key | symbol | meaning | default | allowed |\n|---|---|---|---|---|\n".to_owned();
    for (field, default) in fields {
        let Description { key, symbol, meaning, .. } = field;
        // Shorter than in messages: most values are finite numbers.
        let allowed = field.requirement().replace("a finite number ", "").replace("a whole number from", "whole,");
        writeln!(text, "| `{key}` | {symbol} | {meaning} | {default} | {allowed} |").unwrap();
    }
    // A column that is empty everywhere says nothing.
    if fields.iter().all(|(field, _)| field.symbol.is_empty()) {
        text = text.replace("| symbol ", "").replacen("|---", "", 1).replace("` |  |", "` |");
    }
    text
}
