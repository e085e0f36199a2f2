//! The `[axes]` of a sweep file: lists, ranges, counts, zips and samples become axes. `docs/sweeps.md` has their forms.
//! An axis reports its first mistake, a zip or a sample that of each column.

use super::axes::{Axis, AxisColumn, AxisRange, MAX_ROWS, MAX_SAMPLE, Repeated};
use super::checks::Places;
use super::quantity::Quantity;
use super::source::{Entry, Refused, Section, all};
use crate::model::Value;

const RANGE_FORMS: &str =
    "{ linear = [low, high], points = n } or { log = [low, high], points = n }";
const AXIS_FORMS: &str = "a list [..], { linear = [low, high], points = n }, { log = [low, high], points = n } or { count = n }";
const SAMPLE_FORMS: &str = "{ linear = [low, high] } or { log = [low, high] } in a sample";

type TableReader = fn(&Section<'_>, &mut Places<'_>) -> Result<Axis, Refused>;

pub(super) fn read(section: &Section<'_>, places: &mut Places<'_>) -> Result<Vec<Axis>, Refused> {
    let axes = all(section.entries().iter().map(|entry| {
        let (title, read): (_, TableReader) = match entry.key {
            "zip" => ("[axes.zip]", read_zip),
            "sobol" => ("[axes.sobol]", read_sample),
            _ => return Ok(vec![read_single(entry, places)?]),
        };
        let sections = tables(entry, title)?;
        all(sections.iter().map(|table| read(table, places)))
    }));
    Ok(axes?.into_iter().flatten().collect())
}

/// One table, or the tables of a list.
fn tables<'a>(entry: &Entry<'a>, title: &'static str) -> Result<Vec<Section<'a>>, Refused> {
    let entries = entry.list().unwrap_or_else(|| vec![*entry]);
    let form = format!("a table {title} or several, [{title}]");
    let table = |entry: &Entry<'a>| entry.section(title).ok_or_else(|| entry.must_be(&form));
    all(entries.iter().map(table))
}

/// The quantity that an entry sets.
pub(super) fn known(
    entry: &Entry<'_>,
    title: &'static str,
    also: &[&'static str],
    places: &mut Places<'_>,
) -> Result<Quantity, Refused> {
    let quantity = Quantity::from_key(entry.key).ok_or_else(|| {
        let keys = Quantity::all().map(Quantity::key);
        let allowed: Vec<&str> = keys.chain(also.iter().copied()).collect();
        entry.unknown(title, &allowed)
    })?;
    places.set(quantity, entry.at, title);
    Ok(quantity)
}

fn read_single(entry: &Entry<'_>, places: &mut Places<'_>) -> Result<Axis, Refused> {
    let quantity = known(entry, "[axes]", &["zip", "sobol"], places)?;
    if let (Some(values), Quantity::Parameter(symbol)) = (read_count(entry, quantity)?, quantity) {
        return Ok(Axis::Counted { symbol, values });
    }
    let column = AxisColumn {
        quantity,
        values: read_values(entry, quantity)?,
    };
    Axis::table(vec![column.clone()]).map_err(|Repeated { earlier, later }| {
        let at = entry.list().map_or(entry.at, |list| list[later].at);
        let problem = format!(
            "{} = {}: repeats value {} of this axis as value {}; keep one, or take fewer points",
            entry.key,
            column.values[later],
            earlier + 1,
            later + 1
        );
        entry.source.refuse(at, problem)
    })
}

fn read_values(entry: &Entry<'_>, quantity: Quantity) -> Result<Vec<Value>, Refused> {
    if let Some(list) = entry.list() {
        if list.is_empty() {
            return Err(entry.refuse("an axis needs at least one value"));
        }
        if list.len() as u64 > MAX_ROWS {
            return Err(entry.refuse(format!(
                "an axis has at most {MAX_ROWS} listed values; split it into two axes"
            )));
        }
        let values = list.iter().map(|value| read_value(value, quantity));
        return values.collect();
    }
    if let Some(values) = read_count(entry, quantity)? {
        if values.end - values.start > MAX_ROWS {
            let key = quantity.key();
            return Err(entry.refuse(format!(
                "a zip has at most {MAX_ROWS} rows; make {key} a separate axis"
            )));
        }
        return Ok(values.map(Value::Count).collect());
    }
    let (range, points) = read_spaced(entry, quantity)?;
    let values = range.spaced(points).map(|value| ranged(quantity, value));
    Ok(values.collect())
}

/// Reads a range of an axis, and the number of its values.
pub(super) fn read_spaced(
    entry: &Entry<'_>,
    quantity: Quantity,
) -> Result<(AxisRange, u64), Refused> {
    let table = entry.section("an axis").ok_or_else(|| {
        entry.must_be(&format!("{AXIS_FORMS}; a single value belongs in [model]"))
    })?;
    let range = read_range(&table, quantity)?.ok_or_else(|| entry.must_be(AXIS_FORMS))?;
    table.only(&["linear", "log", "points"])?;
    // One point would leave out an end.
    let points = table.required("points", &format!("write {RANGE_FORMS}"))?;
    Ok((range, points.count(2, MAX_ROWS)?))
}

/// The axis of a range with this many values; `None` if two of these are one.
pub(super) fn spaced(range: &AxisRange, points: u64, quantity: Quantity) -> Option<Axis> {
    let spaced = range.spaced(points);
    let values = spaced.map(|value| ranged(quantity, value)).collect();
    Axis::table(vec![AxisColumn { quantity, values }]).ok()
}

/// Reads counted values; `None` if the entry has another form.
fn read_count(
    entry: &Entry<'_>,
    quantity: Quantity,
) -> Result<Option<std::ops::Range<u64>>, Refused> {
    let Some(table) = entry.section("an axis") else {
        return Ok(None);
    };
    let Some(count) = table.entry("count") else {
        return Ok(None);
    };
    table.only(&["count", "first"])?;
    if !quantity.is_count() {
        return Err(
            entry.must_be("a list or a range: { count = n } fits whole numbers only, such as seed")
        );
    }
    // Far above any seed: the last value is checked below.
    let max = 1 << 53;
    let count = count.count(1, max)?;
    let first = table
        .entry("first")
        .map_or(Ok(0), |first| first.count(0, max))?;
    for value in [first, first + count - 1] {
        if quantity.checked(Value::Count(value)).is_none() {
            let problem = format!(
                "{} = {value}: must be {}; use first and count",
                entry.key,
                quantity.allowed()
            );
            return Err(entry.source.refuse(entry.at, problem));
        }
    }
    Ok(Some(first..first + count))
}

/// Reads one value of a quantity, as a list or `[model]` gives it.
pub(super) fn read_value(entry: &Entry<'_>, quantity: Quantity) -> Result<Value, Refused> {
    let node = entry.node.get_ref();
    let hint = if node.is_array() || node.is_table() {
        "; several values belong in [axes]"
    } else {
        ""
    };
    let value = entry.value().and_then(|value| quantity.checked(value));
    value.ok_or_else(|| entry.must_be(&format!("{}{hint}", quantity.allowed())))
}

fn read_range(table: &Section<'_>, quantity: Quantity) -> Result<Option<AxisRange>, Refused> {
    let (entry, logarithmic) = match (table.entry("linear"), table.entry("log")) {
        (Some(entry), None) => (entry, false),
        (None, Some(entry)) => (entry, true),
        (Some(_), Some(entry)) => return Err(entry.refuse("linear is there too; keep one of them")),
        (None, None) => return Ok(None),
    };
    let ends = entry.list().unwrap_or_default();
    let [low, high] = ends.as_slice() else {
        return Err(entry.must_be("two numbers [low, high]"));
    };
    if quantity == Quantity::BREAK_ON {
        return Err(entry.refuse("break_on is a word and has no range; list its values"));
    }
    let end = |entry: &Entry<'_>| {
        let allowed = quantity.allowed();
        let problem = format!("must be {allowed} ({} of {})", entry.key, quantity.key());
        let value = entry.value().and_then(|value| quantity.checked(value));
        let number = value.and_then(Value::number);
        number.ok_or_else(|| entry.refuse(problem))
    };
    let range = AxisRange {
        low: end(low)?,
        high: end(high)?,
        logarithmic,
        whole: quantity.is_count(),
    };
    if range.low >= range.high {
        let written = |end: &Entry<'_>| entry.source.text[end.node.span()].to_owned();
        let other = if range.low > range.high {
            format!(": [{}, {}]", written(high), written(low))
        } else {
            String::new()
        };
        return Err(entry.must_be(&format!("[low, high] with low < high{other}")));
    }
    if logarithmic && range.low <= 0.0 {
        return Err(entry.must_be(
            "two numbers > 0: 0 has no logarithm; use linear, or list 0 beside a range in a zip",
        ));
    }
    Ok(Some(range))
}

/// A value within a range.
fn ranged(quantity: Quantity, value: f64) -> Value {
    quantity
        .checked(Value::Real(value))
        .expect("no quantity has a gap between two values that are allowed")
}

fn read_zip(table: &Section<'_>, places: &mut Places<'_>) -> Result<Axis, Refused> {
    let entries = table.entries();
    let columns = all(entries.iter().map(|entry| {
        let quantity = known(entry, table.title, &[], places)?;
        let values = read_values(entry, quantity)?;
        Ok(AxisColumn { quantity, values })
    }))?;
    let [first, _, ..] = columns.as_slice() else {
        let problem =
            "zip: needs at least two columns that move together; a single one is a separate axis";
        return Err(table.source.refuse(table.at, problem));
    };
    let key = first.quantity.key();
    let expected = first.values.len();
    let lengths = columns.iter().map(|column| column.values.len());
    let mut lengths = entries.iter().zip(lengths);
    if let Some((entry, length)) = lengths.find(|(_, length)| *length != expected) {
        let problem = format!(
            "has {length} values, {key} has {expected}: columns of a zip have equal length"
        );
        return Err(entry.refuse(problem));
    }
    of_columns(table, columns)
}

fn read_sample(table: &Section<'_>, places: &mut Places<'_>) -> Result<Axis, Refused> {
    const SETTINGS: [&str; 2] = ["points", "seed"];
    let points = table
        .required("points", "the number of points of the sample")
        .and_then(|points| points.count(1, MAX_SAMPLE));
    let seed = table
        .entry("seed")
        .map_or(Ok(0), |seed| seed.count(0, u64::from(u32::MAX)));
    let mut entries = table.entries();
    entries.retain(|entry| !SETTINGS.contains(&entry.key));
    let ranges = all(entries.iter().map(|entry| {
        let quantity = known(entry, table.title, &SETTINGS, places)?;
        let wrong_form = || entry.must_be(SAMPLE_FORMS);
        let form = entry
            .section("a range of a sample")
            .ok_or_else(wrong_form)?;
        form.only(&["linear", "log"])?;
        let range = read_range(&form, quantity)?.ok_or_else(wrong_form)?;
        Ok((quantity, range))
    }))?;
    if ranges.is_empty() {
        let problem = format!(
            "{}: needs a range for at least one quantity, such as V0 = {{ log = [1e-5, 1e-4] }}",
            table.title
        );
        return Err(table.source.refuse(table.at, problem));
    }
    let number = |number: u64| u32::try_from(number).unwrap_or(u32::MAX);
    let points = number(points?);
    let seed = number(seed?);
    let columns = (0..).zip(ranges).map(|(dimension, (quantity, range))| {
        let coordinates = (0..points).map(|point| sobol_burley::sample(point, dimension, seed));
        let values = coordinates.map(|x| ranged(quantity, range.at(f64::from(x))));
        AxisColumn {
            quantity,
            values: values.collect(),
        }
    });
    of_columns(table, columns.collect())
}

fn of_columns(table: &Section<'_>, columns: Vec<AxisColumn>) -> Result<Axis, Refused> {
    Axis::table(columns).map_err(|Repeated { earlier, later }| {
        let problem = format!(
            "{}: row {} repeats row {} (counted from 1); keep one, or take fewer points",
            table.title,
            later + 1,
            earlier + 1
        );
        table.source.refuse(table.at, problem)
    })
}
