//! The JSON Schema of sweep files against what the parser knows: keys, kinds and ranges of values, words.

use super::super::quantity::Quantity;
use super::super::rounds::MAX_JOBS;
use super::super::{SCHEMA, Sweep};
use crate::model::{Description, Parameters, Value};
use crate::observe::{Recording, RecordingKey};
use crate::sets::STATISTICS;
use crate::solver::{Solver, SolverKey};
use crate::table::value::Kind;
use serde_json::{Value as Json, json};
use std::collections::BTreeSet;
use std::ops::Bound;
use std::path::Path;

fn schema() -> Json {
    serde_json::from_str(SCHEMA).unwrap()
}

/// A part of the schema, past references.
fn part<'a>(schema: &'a Json, mut part: &'a Json) -> &'a Json {
    while let Some(reference) = part["$ref"]
        .as_str()
        .or_else(|| part["allOf"][0]["$ref"].as_str())
    {
        part = schema
            .pointer(&reference[1..])
            .unwrap_or_else(|| panic!("{reference}"));
    }
    part
}

fn keys(table: &Json) -> BTreeSet<String> {
    table["properties"]
        .as_object()
        .unwrap()
        .keys()
        .cloned()
        .collect()
}

/// The keys that the parser allows in place of `???`.
fn allowed(text: &str) -> BTreeSet<String> {
    let text = format!("name = \"a\"\n{}", text.replace("???", "xxxxxxxxxxxx = 1"));
    let error = Sweep::parse(&text, Path::new("a.toml"))
        .unwrap_err()
        .to_string();
    let keys = error
        .split_once("allowed are ")
        .unwrap_or_else(|| panic!("{error}"))
        .1;
    keys.lines()
        .next()
        .unwrap()
        .split(", ")
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_table_of_the_schema_has_the_keys_that_the_parser_allows() {
    let schema = schema();
    for (pointer, texts, without) in [
        ("", &["???"][..], ""),
        ("/properties/model", &["[model]\n???"], ""),
        ("/properties/axes", &["[axes]\n???"], ""),
        ("/definitions/columns", &["[axes.zip]\n???"], ""),
        (
            "/definitions/count",
            &["[axes]\nseed = { count = 1, ??? }"],
            "",
        ),
        // Of the two spacings a form has one, and a word has no range.
        (
            "/definitions/positive_axis/anyOf/1",
            &["[axes]\nV0 = { log = [1, 2], points = 2, ??? }"],
            "log",
        ),
        (
            "/definitions/positive_axis/anyOf/2",
            &["[axes]\nV0 = { log = [1, 2], points = 2, ??? }"],
            "linear",
        ),
        (
            "/definitions/positive_range/anyOf/0",
            &["[axes.sobol]\nV0 = { log = [1, 2], ??? }"],
            "log",
        ),
        (
            "/definitions/positive_range/anyOf/1",
            &["[axes.sobol]\nV0 = { log = [1, 2], ??? }"],
            "linear",
        ),
        (
            "/definitions/sample",
            &["[axes.sobol]\npoints = 1\n???"],
            "break_on",
        ),
        ("/properties/record", &["[record]\n???"], ""),
        (
            "/properties/solver",
            &["[solver]\n???", "[solver]\nmethod = \"fixed-step\"\n???"],
            "",
        ),
        ("/properties/precision", &["[precision]\n???"], ""),
        ("/definitions/seeds", &["[precision]\nseeds = { ??? }"], ""),
        ("/properties/refine", &["[refine]\n???"], ""),
    ] {
        let mut known: BTreeSet<String> = texts.iter().flat_map(|text| allowed(text)).collect();
        known.remove(without);
        let table = schema.pointer(pointer).unwrap();
        assert_eq!(
            (keys(table), &table["additionalProperties"]),
            (known, &json!(false)),
            "{pointer}"
        );
    }
}

/// What the schema says of a value that the parser describes so.
fn value(field: &Description) -> Json {
    let mut number = match field.kind {
        Kind::Flag => return json!({ "type": "boolean" }),
        Kind::Text => return json!({ "enum": field.choices }),
        Kind::Count => json!({ "type": "integer" }),
        Kind::Real => json!({ "type": "number" }),
    };
    for (end, included, excluded) in [
        (field.range.ends.0, "minimum", "exclusiveMinimum"),
        (field.range.ends.1, "maximum", "exclusiveMaximum"),
    ] {
        match end {
            Bound::Included(end) if end.is_finite() => number[included] = json!(end),
            Bound::Excluded(end) if end.is_finite() => number[excluded] = json!(end),
            _ => {}
        }
    }
    number
}

/// Asserts that a part of the schema allows these values; with `words` also that it describes them so.
fn assert_value(
    schema: &Json,
    found: &Json,
    expected: &Json,
    words: Option<(&Description, Value)>,
) {
    if let Some((field, default)) = words {
        assert_eq!(
            found["description"],
            json!(format!("{}: {}", field.meaning, field.requirement()))
        );
        let default = if default == Value::Null {
            None
        } else {
            Some(json!(default))
        };
        assert_eq!(
            numbers(found.get("default")),
            numbers(default.as_ref()),
            "{}",
            field.key
        );
    }
    let found = part(schema, found);
    for key in [
        "type",
        "enum",
        "minimum",
        "exclusiveMinimum",
        "maximum",
        "exclusiveMaximum",
    ] {
        assert_eq!(
            numbers(found.get(key)),
            numbers(expected.get(key)),
            "{key} of {found}"
        );
    }
}

/// Whole numbers as reals, which are the same in JSON.
fn numbers(value: Option<&Json>) -> Option<Json> {
    value.map(|value| value.as_f64().map_or_else(|| value.clone(), Json::from))
}

#[test]
fn every_value_of_the_schema_has_kind_range_default_and_words_of_the_parser() {
    let schema = schema();
    let [model, axes, record] =
        ["model", "axes", "record"].map(|key| &schema["properties"][key]["properties"]);
    let [columns, sample] =
        ["columns", "sample"].map(|key| &schema["definitions"][key]["properties"]);
    for quantity in Quantity::all() {
        let key = quantity.key();
        let (expected, words) = match quantity {
            Quantity::Parameter(symbol) => (
                value(&symbol.description()),
                Some((symbol.description(), Parameters::default().get(symbol))),
            ),
            _ => (
                json!({ "type": "number", "minimum": 1e-100, "maximum": 1e100 }),
                None,
            ),
        };
        assert_value(
            &schema,
            &model[key],
            &expected,
            words.as_ref().map(|(field, default)| (field, *default)),
        );
        assert_value(
            &schema,
            &columns[key],
            &Json::Null,
            words.as_ref().map(|(field, _)| (field, Value::Null)),
        );
        assert_eq!(
            part(&schema, &axes[key]),
            part(&schema, &columns[key]),
            "{key}"
        );
        let forms = [&columns[key], &sample[key]].map(|of| part(&schema, of)["anyOf"].as_array());
        let mut found = Vec::new();
        for form in forms
            .into_iter()
            .flatten()
            .flatten()
            .map(|form| part(&schema, form))
        {
            let ends = ["linear", "log"]
                .into_iter()
                .find(|spacing| form["properties"].get(spacing).is_some());
            let items = ends
                .map_or(form, |spacing| &form["properties"][spacing])
                .get("items");
            if let Some(items) = items {
                assert_value(&schema, items, &expected, None);
            }
            found.push(ends.unwrap_or(if items.is_some() { "list" } else { "count" }));
        }
        let spacings: &[&str] = if quantity == Quantity::BREAK_ON {
            &[]
        } else {
            &["linear", "log"]
        };
        let count: &[&str] = if quantity.is_count() { &["count"] } else { &[] };
        let of_sample = if key == "seed" { &[] } else { spacings };
        assert_eq!(
            found,
            [&["list"], spacings, count, of_sample].concat(),
            "{key}"
        );
    }
    for key in RecordingKey::ALL {
        let field = key.description();
        let expected = value(&field);
        assert_value(
            &schema,
            &record[field.key],
            &expected,
            Some((&field, Recording::default().get(key))),
        );
    }
    let solver = &schema["properties"]["solver"]["properties"];
    for key in SolverKey::ALL {
        let field = key.description();
        let expected = value(&field);
        assert_value(
            &schema,
            &solver[field.key],
            &expected,
            Some((&field, Solver::default().get(key))),
        );
    }
}

#[test]
fn the_schema_names_what_rounds_can_be_told_as_the_documentation_does() {
    let schema = schema();
    let page = include_str!("../../../docs/rounds.md");
    for section in ["precision", "refine"] {
        let table = page
            .split_once(&format!("\n## [{section}]\n"))
            .unwrap()
            .1
            .split("\n## ")
            .next()
            .unwrap();
        let properties = schema["properties"][section]["properties"]
            .as_object()
            .unwrap();
        for (key, property) in properties {
            let row = table.lines().find_map(|line| {
                line.strip_prefix(&format!("| `{key}` | "))?
                    .strip_suffix(" |")
            });
            let (meaning, allowed) = row
                .and_then(|row| row.split_once(" | "))
                .unwrap_or_else(|| panic!("{key}"));
            assert_eq!(
                property["description"],
                json!(format!("{meaning}: {allowed}"))
            );
        }
    }
    let estimates: Vec<&str> = STATISTICS
        .iter()
        .filter(|known| known.has_interval)
        .map(|known| known.key)
        .collect();
    let between = |quantity: &Quantity| *quantity != Quantity::BREAK_ON && !quantity.is_count();
    let refinable: Vec<&str> = Quantity::all().filter(between).map(Quantity::key).collect();
    let crossing: Vec<&str> = STATISTICS
        .iter()
        .filter(|known| known.can_cross())
        .map(|known| known.key)
        .collect();
    assert_eq!(schema["definitions"]["estimate"]["enum"], json!(estimates));
    assert_eq!(schema["definitions"]["refinable"]["enum"], json!(refinable));
    assert_eq!(schema["definitions"]["crossing"]["enum"], json!(crossing));
    assert_eq!(
        schema["properties"]["refine"]["properties"]["jobs"]["maximum"],
        json!(MAX_JOBS)
    );
}
