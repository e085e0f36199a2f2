//! The JSON Schema of sweep files against what the parser knows: keys, kinds and ranges of values, words. What follows
//! from descriptions in the code is written with `UPDATE_DOCS=1`.

use super::super::quantity::{DERIVABLE, Quantity};
use super::super::rounds::MAX_JOBS;
use super::super::{SCHEMA, Sweep};
use crate::model::{Description, Parameters, Value};
use crate::observe::{Recording, RecordingKey};
use crate::sets::{STATISTICS, Statistic};
use crate::solver::{Solver, SolverKey};
use crate::table::value::Kind;
use serde_json::{Value as Json, json};
use std::collections::BTreeSet;
use std::ops::Bound;
use std::path::Path;

fn schema() -> Json {
    serde_json::from_str(SCHEMA).unwrap()
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
    let text = format!("name = \"a\"\n{}", text.replace("???", "\"?\" = 1"));
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
            "/definitions/number_above_0_axis/anyOf/1",
            &["[axes]\nV0 = { log = [1, 2], points = 2, ??? }"],
            "log",
        ),
        (
            "/definitions/number_above_0_axis/anyOf/2",
            &["[axes]\nV0 = { log = [1, 2], points = 2, ??? }"],
            "linear",
        ),
        (
            "/definitions/number_above_0_range/anyOf/0",
            &["[axes.sobol]\nV0 = { log = [1, 2], ??? }"],
            "log",
        ),
        (
            "/definitions/number_above_0_range/anyOf/1",
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

/// A number or word that the parser allows, as the schema puts it.
fn value(kind: Kind, (low, high): (Bound<f64>, Bound<f64>), words: &[&str]) -> Json {
    let mut number = match kind {
        Kind::Flag => return json!({ "type": "boolean" }),
        Kind::Text => return json!({ "enum": words }),
        Kind::Count => json!({ "type": "integer" }),
        Kind::Real => json!({ "type": "number" }),
    };
    for (end, included, excluded) in [
        (low, "minimum", "exclusiveMinimum"),
        (high, "maximum", "exclusiveMaximum"),
    ] {
        match end {
            Bound::Included(end) if end.is_finite() => number[included] = whole(end),
            Bound::Excluded(end) if end.is_finite() => number[excluded] = whole(end),
            _ => {}
        }
    }
    number
}

/// A number, without a decimal point if it is whole and a double holds it exactly.
#[expect(
    clippy::cast_possible_truncation,
    reason = "it is whole, and a double holds it exactly"
)]
fn whole(number: f64) -> Json {
    if number.fract() == 0.0 && number.abs() <= 9_007_199_254_740_992.0 {
        json!(number as i64)
    } else {
        json!(number)
    }
}

/// A name for a definition of what a value can be: `number_above_0`.
fn name(value: &Json) -> String {
    if let Some(words) = value["enum"].as_array() {
        let words: Vec<&str> = words.iter().filter_map(Json::as_str).collect();
        return words.join("_or_");
    }
    let mut name = value["type"].as_str().unwrap().to_owned();
    for (key, word) in [
        ("minimum", "from"),
        ("exclusiveMinimum", "above"),
        ("maximum", "to"),
        ("exclusiveMaximum", "below"),
    ] {
        if let Some(end) = value.get(key) {
            name = format!("{name}_{word}_{end}");
        }
    }
    name
}

/// What a parameter can be, in words and by itself.
fn described(field: &Description, default: Value) -> Json {
    let mut described = value(field.kind, field.range.ends, field.choices);
    if default == Value::Null {
        described = json!({ "anyOf": [described, { "const": "none" }] });
    }
    described["description"] = json!(format!("{}: {}", field.meaning, field.requirement()));
    match default {
        Value::Null => {}
        Value::Real(number) => described["default"] = whole(number),
        other => described["default"] = json!(other),
    }
    described
}

/// The forms of an axis over values that a definition describes: a list, ranges, a count.
fn axis_forms(definition: &str, quantity: Quantity) -> Json {
    let items = json!({ "$ref": format!("#/definitions/{definition}") });
    let mut forms = vec![json!({ "type": "array", "items": items, "minItems": 1 })];
    if quantity != Quantity::BREAK_ON {
        forms.extend(SPACINGS.map(|spacing| {
            let mut form = range_form(spacing, &items);
            form["required"] = json!([spacing, "points"]);
            form["properties"]["points"] = json!({ "$ref": "#/definitions/points" });
            form
        }));
    }
    if quantity.is_count() {
        forms.push(json!({ "$ref": "#/definitions/count" }));
    }
    json!({ "anyOf": forms })
}

const SPACINGS: [&str; 2] = ["linear", "log"];

/// A range between two values, without a number of points.
fn range_form(spacing: &str, items: &Json) -> Json {
    let ends = json!({ "type": "array", "items": items, "minItems": 2, "maxItems": 2 });
    json!({
        "type": "object",
        "additionalProperties": false,
        "required": [spacing],
        "properties": { spacing: ends },
    })
}

/// The schema with all that follows from the descriptions of parameters, statistics and keys.
fn generated() -> Json {
    let mut schema = schema();
    let references = |of: &str| json!({ "$ref": of });
    for quantity in Quantity::all() {
        let key = quantity.key();
        let (values, model) = match quantity {
            Quantity::Parameter(symbol) => {
                let field = symbol.description();
                let default = Parameters::default().get(symbol);
                (
                    value(field.kind, field.range.ends, field.choices),
                    described(&field, default),
                )
            }
            // Their words are the schema's own.
            Quantity::Eta | Quantity::Frequency => {
                let ends = (
                    Bound::Included(*DERIVABLE.start()),
                    Bound::Included(*DERIVABLE.end()),
                );
                let values = value(Kind::Real, ends, &[]);
                let mut model = values.clone();
                model["description"] =
                    schema["properties"]["model"]["properties"][key]["description"].clone();
                (values, model)
            }
        };
        let definition = name(&values);
        let description = &model["description"];
        let axis = json!({
            "description": description,
            "allOf": [references(&format!("#/definitions/{definition}_axis"))],
        });
        let definitions = &mut schema["definitions"];
        definitions["columns"]["properties"][key] = axis;
        definitions[format!("{definition}_axis")] = axis_forms(&definition, quantity);
        if quantity != Quantity::BREAK_ON && quantity != Quantity::SEED {
            let items = references(&format!("#/definitions/{definition}"));
            let forms = SPACINGS.map(|spacing| range_form(spacing, &items));
            definitions[format!("{definition}_range")] = json!({ "anyOf": forms });
            definitions["sample"]["properties"][key] =
                references(&format!("#/definitions/{definition}_range"));
        }
        definitions[definition] = values;
        schema["properties"]["axes"]["properties"][key] =
            references(&format!("#/definitions/columns/properties/{key}"));
        schema["properties"]["model"]["properties"][key] = model;
    }
    for key in RecordingKey::ALL {
        schema["properties"]["record"]["properties"][key.key()] =
            described(&key.description(), Recording::default().get(key));
    }
    for key in SolverKey::ALL {
        schema["properties"]["solver"]["properties"][key.key()] =
            described(&key.description(), Solver::default().get(key));
    }
    let keys_of = |is_named: fn(&Statistic) -> bool| -> Json {
        let named = STATISTICS.iter().filter(|statistic| is_named(statistic));
        named.map(|statistic| statistic.key).collect()
    };
    let is_real = |quantity: &Quantity| *quantity != Quantity::BREAK_ON && !quantity.is_count();
    let definitions = &mut schema["definitions"];
    definitions["estimate"]["enum"] = keys_of(|statistic| statistic.has_interval);
    definitions["crossing"]["enum"] = keys_of(|statistic| statistic.can_cross);
    definitions["refinable"]["enum"] = Quantity::all().filter(is_real).map(Quantity::key).collect();
    schema
}

/// JSON with what fits into 120 columns on one line.
fn laid_out(json: &Json, indent: usize) -> String {
    let line = json.to_string();
    let (open, close, parts): (_, _, Vec<String>) = match json {
        _ if indent + line.len() <= 120 => return line,
        Json::Array(items) => {
            let items = items.iter().map(|item| laid_out(item, indent + 2));
            ('[', ']', items.collect())
        }
        Json::Object(fields) => {
            let fields = fields
                .iter()
                .map(|(key, field)| format!("\"{key}\": {}", laid_out(field, indent + 2)));
            ('{', '}', fields.collect())
        }
        _ => return line,
    };
    let inner = " ".repeat(indent + 2);
    let lines = parts.join(&format!(",\n{inner}"));
    format!("{open}\n{inner}{lines}\n{}{close}", " ".repeat(indent))
}

#[test]
fn the_documented_schema_follows_from_the_descriptions() {
    let text = laid_out(&generated(), 0) + "\n";
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/sweep.schema.json");
        std::fs::write(file, &text).unwrap();
    } else {
        assert!(
            text == SCHEMA,
            "docs/sweep.schema.json is out of date: run the tests with UPDATE_DOCS=1"
        );
    }
}

#[test]
fn the_schema_describes_the_keys_of_rounds_as_the_documentation_does() {
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
    assert_eq!(
        schema["properties"]["refine"]["properties"]["jobs"]["maximum"],
        json!(MAX_JOBS)
    );
}
