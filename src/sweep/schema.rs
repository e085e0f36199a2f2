//! JSON Schema of a sweep file, for editors that complete and check TOML.
//!
//! Keys, units, meanings and ranges are those of the one description of each field. What depends on several keys, such as
//! `dfs <= fs`, is left to [`Sweep::parse`](super::Sweep::parse).

use super::axes::MAX_ROWS;
use super::quantity::Quantity;
use super::read_rounds::{Keys, PRECISION, REFINE, is_refinable};
use super::rounds::MAX_SETS;
use super::statistic::STATISTICS;
use crate::model::{BreakOn, Description, Parameters, Value};
use crate::observe::{Recording, RecordingKey, Regime};
use crate::solver::{Resolve, Solver, TOLERANCES};
use serde_json::{Map, Value as Json, json};
use std::ops::Bound;

/// The schema, JSON Schema draft 7.
pub fn schema() -> Json {
    let model = Quantity::all().map(|quantity| (quantity.key(), described(quantity, single(quantity))));
    let axes = Quantity::all().map(|quantity| (quantity.key(), described(quantity, axis(quantity))));
    let zip = closed(Quantity::all().map(|quantity| (quantity.key(), described(quantity, axis(quantity)))));
    let [sobol, latin] = ["Sobol sequence", "Latin hypercube"].map(|kind| one_or_several(&sample(kind)));
    let tables = [
        ("zip", json!({ "type": "array", "items": zip, "description": "Columns of equal length that move together" })),
        ("sobol", sobol),
        ("latin", latin),
    ];
    let record = RecordingKey::ALL.map(|key| {
        let description = key.description();
        let value = value(&description, |value| key.checked(value));
        (description.key, with_words(value, &description, Recording::default().get(key)))
    });
    let text_or_texts = json!({ "anyOf": [{ "type": "string" }, { "type": "array", "items": { "type": "string" } }] });
    let mut file = closed([
        (
            "name",
            json!({ "type": "string", "pattern": "^[A-Za-z0-9_][A-Za-z0-9_-]{0,99}$",
            "description": "Name of the sweep and of its results directory" }),
        ),
        ("where", with(text_or_texts, "description", "Conditions that drop points, such as \"frequency < 500\"")),
        ("model", with(closed(model), "description", "Parameters that differ from those of Fig. 1, in SI units")),
        ("axes", with(closed(axes.chain(tables)), "description", "What is varied; every combination is a job")),
        ("record", with(closed(record), "description", "What each job records, and when it ends")),
        (
            "precision",
            with(precision(), "description", "How precise statistics are to be: sets get seeds until they are"),
        ),
        (
            "refine",
            with(refine(), "description", "Where the grid is to be finer: cells are divided where their sets differ"),
        ),
        ("solver", with(solver(), "description", "How motion is computed, and how accurately")),
    ]);
    file["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    file["title"] = json!("Sweep file of stickslip");
    file["required"] = json!(["name"]);
    file
}

/// An object with these properties and no others.
fn closed<'a>(properties: impl IntoIterator<Item = (&'a str, Json)>) -> Json {
    let properties: Map<String, Json> = properties.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    json!({ "type": "object", "additionalProperties": false, "properties": properties })
}

fn with(mut schema: Json, key: &str, value: &str) -> Json {
    schema[key] = json!(value);
    schema
}

fn one_or_several(table: &Json) -> Json {
    json!({ "anyOf": [table, { "type": "array", "items": table }] })
}

/// Adds meaning, allowed values and default of a field to its schema.
fn with_words(schema: Json, field: &Description, default: Value) -> Json {
    let mut schema = with(schema, "description", &format!("{}: {}", field.meaning, field.requirement()));
    if default != Value::Absent {
        schema["default"] = json!(default);
    }
    schema
}

fn described(quantity: Quantity, schema: Json) -> Json {
    match quantity {
        Quantity::Parameter(symbol) => with_words(schema, &symbol.description(), Parameters::default().get(symbol)),
        Quantity::Eta => with(schema, "description", "2 pi Delta / (T V0), fixes the period T"),
        Quantity::Frequency => with(schema, "description", "1/T, in Hz, fixes the period T"),
    }
}

/// A single value of a quantity.
fn single(quantity: Quantity) -> Json {
    match quantity {
        Quantity::Parameter(symbol) => value(&symbol.description(), |value| symbol.checked(value)),
        Quantity::Eta | Quantity::Frequency => json!({ "type": "number", "exclusiveMinimum": 0 }),
    }
}

/// A value of a field, by what the field takes.
fn value(field: &Description, checked: impl Fn(Value) -> Option<Value>) -> Json {
    if checked(Value::Flag(true)).is_some() {
        return json!({ "type": "boolean" });
    }
    if checked(Value::BreakOn(BreakOn::Magnitude)).is_some() {
        return json!({ "enum": [BreakOn::Magnitude.word(), BreakOn::Tension.word()] });
    }
    let takes_fractions = checked(Value::Real(1.5)).is_some();
    let mut number = json!({ "type": if takes_fractions { "number" } else { "integer" } });
    let mut bound = |key: &str, end: f64| {
        if end.is_finite() {
            number[key] = json!(end);
        }
    };
    let (low, high) = field.ends;
    match low {
        Bound::Included(low) => bound("minimum", low),
        Bound::Excluded(low) => bound("exclusiveMinimum", low),
        Bound::Unbounded => {}
    }
    match high {
        Bound::Included(high) => bound("maximum", high),
        Bound::Excluded(high) => bound("exclusiveMaximum", high),
        Bound::Unbounded => {}
    }
    number
}

/// Values of a quantity in one of the forms of an axis.
fn axis(quantity: Quantity) -> Json {
    let value = single(quantity);
    let mut forms = vec![json!({ "type": "array", "items": value, "minItems": 1 })];
    if quantity != Quantity::BREAK_ON {
        forms.extend(["linear", "log"].map(|spacing| {
            let mut form = closed([(spacing, ends(&value)), ("points", json!({ "type": "integer", "minimum": 2 }))]);
            form["required"] = json!([spacing, "points"]);
            form
        }));
    }
    if quantity.is_count() {
        let mut form = closed([
            ("count", json!({ "type": "integer", "minimum": 1 })),
            ("first", json!({ "type": "integer", "minimum": 0 })),
        ]);
        form["required"] = json!(["count"]);
        forms.push(form);
    }
    json!({ "anyOf": forms })
}

/// Both ends of a range.
fn ends(value: &Json) -> Json {
    json!({ "type": "array", "items": value, "minItems": 2, "maxItems": 2 })
}

fn sample(kind: &str) -> Json {
    let ranges = Quantity::all().filter(|quantity| *quantity != Quantity::BREAK_ON).map(|quantity| {
        let value = single(quantity);
        let forms = ["linear", "log"].map(|spacing| {
            let mut form = closed([(spacing, ends(&value))]);
            form["required"] = json!([spacing]);
            form
        });
        (quantity.key(), described(quantity, json!({ "anyOf": forms })))
    });
    // `seed` is that of the sample, a number, or the range of a quantity.
    let mut table = closed(ranges.chain([("points", json!({ "type": "integer", "minimum": 1 }))]));
    table["properties"]["seed"] = json!({ "type": "integer", "minimum": 0, "description": "Seed of the sample" });
    table["required"] = json!(["points"]);
    with(table, "description", &format!("A space-filling sample: {kind}"))
}

fn solver() -> Json {
    let resolves = Resolve::ALL.map(|(_, word)| word);
    let (min, max) = (TOLERANCES.start(), TOLERANCES.end());
    let mut tolerance = json!({ "type": "number", "minimum": min, "maximum": max,
        "description": "Target error of displacement, relative to the contact reach fs/k" });
    if let Solver::EventDriven { tolerance: default, .. } = Solver::default() {
        tolerance["default"] = json!(default);
    }
    closed([
        ("method", json!({ "enum": ["event-driven", "fixed-step"], "default": "event-driven" })),
        ("tolerance", tolerance),
        ("resolve", json!({ "enum": resolves, "default": Resolve::default().word() })),
        ("dt", json!({ "type": "number", "exclusiveMinimum": 0, "description": "The fixed step, in s" })),
    ])
}

/// An object with these keys, each with its meaning and a schema.
fn keyed(keys: &Keys, schemas: &[(&str, Json)], required: &[&str]) -> Json {
    let properties = schemas.iter().map(|(key, schema)| {
        let words = keys.iter().find(|(known, ..)| known == key);
        let meaning = words.map_or_else(String::new, |(_, meaning, allowed)| format!("{meaning}: {allowed}"));
        (*key, with(schema.clone(), "description", &meaning))
    });
    let mut table = closed(properties);
    table["required"] = json!(required);
    table
}

/// Exactly one of these keys, or none of them as well.
fn one_of(mut table: Json, keys: [&str; 2], or_none: bool) -> Json {
    let both = json!({ "not": { "required": keys } });
    let any = json!({ "anyOf": keys.map(|key| json!({ "required": [key] })) });
    table["allOf"] = if or_none { json!([both]) } else { json!([both, any]) };
    table
}

fn precision() -> Json {
    let estimates: Vec<&str> = STATISTICS.iter().filter(|known| known.has_interval()).map(|known| known.key).collect();
    let estimate = json!({ "enum": estimates });
    let of = json!({ "anyOf": [estimate, { "type": "array", "items": estimate, "minItems": 1 }] });
    let count = json!({ "type": "integer", "minimum": 2, "maximum": MAX_ROWS });
    let mut seeds = closed([("from", count.clone()), ("to", count)]);
    seeds["required"] = json!(["from", "to"]);
    let schemas = [
        ("of", of),
        ("relative", json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 })),
        ("absolute", json!({ "type": "number", "exclusiveMinimum": 0 })),
        ("seeds", seeds),
    ];
    one_of(keyed(PRECISION, &schemas, &["of", "seeds"]), ["relative", "absolute"], false)
}

fn refine() -> Json {
    let quantities: Vec<&str> = Quantity::all().filter(|quantity| is_refinable(*quantity)).map(Quantity::key).collect();
    let quantity = json!({ "enum": quantities });
    let step = json!({ "type": "number", "exclusiveMinimum": 0 });
    let schemas = [
        (
            "axes",
            json!({ "anyOf": [quantity, { "type": "array", "items": quantity, "minItems": 1, "uniqueItems": true }] }),
        ),
        ("by", json!({ "enum": STATISTICS.map(|known| known.key).to_vec() })),
        ("value", json!({ "anyOf": [{ "enum": Regime::ALL.map(Regime::word) }, { "type": "integer", "minimum": 0 }] })),
        ("threshold", json!({ "type": "number" })),
        ("step", step.clone()),
        ("to", closed(quantities.iter().map(|key| (*key, step.clone())))),
        ("sets", json!({ "type": "integer", "minimum": 1, "maximum": MAX_SETS })),
    ];
    one_of(keyed(REFINE, &schemas, &["axes", "by", "to", "sets"]), ["threshold", "step"], true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::documented::{assert_documented, assert_rows_documented};

    #[test]
    fn documented_keys_are_those_of_precision_and_refinement() {
        for (heading, keys, schema) in [("## [precision]", PRECISION, precision()), ("## [refine]", REFINE, refine())] {
            assert!(keys.iter().all(|(key, ..)| schema["properties"].get(key).is_some()), "{heading}: {schema}");
            let row = |(key, meaning, allowed): &(&str, &str, &str)| format!("| `{key}` | {meaning} | {allowed} |\n");
            let rows: String = keys.iter().map(row).collect();
            assert_rows_documented(
                "rounds.md",
                heading,
                &format!("| key | meaning | allowed |\n|---|---|---|\n{rows}"),
            );
        }
    }

    #[test]
    fn the_documented_schema_is_the_one_printed() {
        assert_documented("sweep.schema.json", &format!("{:#}\n", schema()));
    }
}
