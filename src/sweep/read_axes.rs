//! The `[axes]` of a sweep file: lists, ranges, counts, zips and samples become axes.
//!
//! ```text
//! V0    = [1e-5, 1e-4]                          a list
//! Delta = { linear = [3e-7, 1e-6], points = 8 } ends included; log = [..] likewise
//! seed  = { count = 4 }                         0, 1, 2, 3; with first = 100: 100, 101, 102, 103
//! [[axes.zip]]                                  columns of equal length that move together
//! [axes.sobol], [axes.latin]                    points, seed and a range for each quantity
//! ```
//!
//! Axes stand in the order of the file; the last moves fastest. A range of a whole-number quantity is rounded to whole
//! numbers.

use super::axes::{Axis, Column, MAX_ROWS, Repeated};
use super::quantity::Quantity;
use super::samples::{MAX_SOBOL_POINTS, Range, Sample};
use super::source::{Entry, Section, SweepError};
use crate::model::{Shortest, Value};

const RANGE_FORMS: &str = "{ linear = [low, high], points = n } or { log = [low, high], points = n }";
const AXIS_FORMS: &str =
    "a list [..], { linear = [low, high], points = n }, { log = [low, high], points = n } or { count = n }";

/// An axis, and for each quantity on it the byte of the text that sets it.
pub(super) struct PlacedAxis {
    pub axis: Axis,
    pub places: Vec<(Quantity, usize)>,
}

/// Reads all axes.
pub(super) fn read(section: &Section<'_>) -> Result<Vec<PlacedAxis>, SweepError> {
    let mut axes = Vec::new();
    for entry in section.entries() {
        match entry.key {
            "zip" => {
                for table in tables(&entry, "[axes.zip]")? {
                    axes.push(read_zip(&table)?);
                }
            }
            "sobol" => {
                for table in tables(&entry, "[axes.sobol]")? {
                    axes.push(read_sample(&table, Sample::Sobol, MAX_SOBOL_POINTS)?);
                }
            }
            "latin" => {
                for table in tables(&entry, "[axes.latin]")? {
                    axes.push(read_sample(&table, Sample::Latin, MAX_ROWS)?);
                }
            }
            _ => axes.push(read_single(&entry)?),
        }
    }
    Ok(axes)
}

/// One table, or the tables of a list.
fn tables<'a>(entry: &Entry<'a>, title: &'static str) -> Result<Vec<Section<'a>>, SweepError> {
    let entries = entry.list().unwrap_or_else(|| vec![*entry]);
    let table = |entry: &Entry<'a>| {
        entry.section(title).ok_or_else(|| entry.must_be(&format!("a table {title} or several, [{title}]")))
    };
    entries.iter().map(table).collect()
}

fn known(entry: &Entry<'_>, title: &str, also: &[&'static str]) -> Result<Quantity, SweepError> {
    Quantity::from_key(entry.key).ok_or_else(|| {
        let allowed: Vec<&str> = Quantity::all().map(Quantity::key).chain(also.iter().copied()).collect();
        entry.unknown(title, &allowed)
    })
}

/// Values as an entry gives them.
enum Values {
    Listed { values: Vec<Value>, places: Vec<usize> },
    Counted { first: u64, count: u64 },
}

fn read_single(entry: &Entry<'_>) -> Result<PlacedAxis, SweepError> {
    let quantity = known(entry, "[axes]", &["zip", "sobol", "latin"])?;
    let places = vec![(quantity, entry.at)];
    let axis = match (read_values(entry, quantity)?, quantity) {
        (Values::Counted { first, count }, Quantity::Parameter(symbol)) => Axis::Counted { symbol, first, count },
        (values, _) => {
            let (values, positions) = listed(entry, quantity, values)?;
            Axis::table(vec![Column { quantity, values: values.clone() }]).map_err(|Repeated { earlier, later }| {
                let (key, value) = (entry.key, values[later]);
                let problem = format!(
                    "{key} = {value}: repeats value {} of this axis, or nearly, as value {}; \
                     keep one, or take fewer points",
                    earlier + 1,
                    later + 1
                );
                entry.source.error(positions.get(later).copied().unwrap_or(entry.at), problem)
            })?
        }
    };
    Ok(PlacedAxis { axis, places })
}

/// Writes counted values out.
fn listed(entry: &Entry<'_>, quantity: Quantity, values: Values) -> Result<(Vec<Value>, Vec<usize>), SweepError> {
    match values {
        Values::Listed { values, places } => Ok((values, places)),
        Values::Counted { count, .. } if count > MAX_ROWS => {
            Err(entry.refuse(format!("a zip has at most {MAX_ROWS} rows; make {} an axis of its own", quantity.key())))
        }
        Values::Counted { first, count } => Ok(((first..first + count).map(Value::Count).collect(), Vec::new())),
    }
}

fn read_values(entry: &Entry<'_>, quantity: Quantity) -> Result<Values, SweepError> {
    if let Some(list) = entry.list() {
        if list.is_empty() {
            return Err(entry.refuse("an axis needs at least one value"));
        }
        if list.len() as u64 > MAX_ROWS {
            return Err(entry.refuse(format!("an axis has at most {MAX_ROWS} listed values; split it into two axes")));
        }
        let values = list.iter().map(|value| read_value(value, quantity)).collect::<Result<_, _>>()?;
        return Ok(Values::Listed { values, places: list.iter().map(|value| value.at).collect() });
    }
    let Some(table) = entry.section("an axis") else {
        let setting =
            if matches!(quantity, Quantity::Parameter(_)) { "; a single value belongs in [model]" } else { "" };
        return Err(entry.must_be(&format!("{AXIS_FORMS}{setting}")));
    };
    if table.entry("count").is_some() {
        return read_count(entry, &table, quantity);
    }
    let Some(range) = read_range(&table, quantity)? else {
        return Err(entry.must_be(AXIS_FORMS));
    };
    table.only(&["linear", "log", "points"])?;
    // One point would leave out an end.
    let points = table.required("points", &format!("write {RANGE_FORMS}"))?.count(2, MAX_ROWS)?;
    let values = range.spaced(points).map(|value| ranged(entry, quantity, value)).collect::<Result<_, _>>()?;
    Ok(Values::Listed { values, places: Vec::new() })
}

fn read_count(entry: &Entry<'_>, table: &Section<'_>, quantity: Quantity) -> Result<Values, SweepError> {
    table.only(&["count", "first"])?;
    if !quantity.is_count() {
        return Err(entry.must_be("a list or a range: { count = n } fits N, Ns and seed only"));
    }
    // Far above any seed: the last value is checked below.
    let most = 1 << 53;
    let count = table.required("count", "write { count = n }")?.count(1, most)?;
    let first = table.entry("first").map_or(Ok(0), |first| first.count(0, most))?;
    for value in [first, first + count - 1] {
        if quantity.checked(Value::Count(value)).is_none() {
            let problem = format!("{} = {value}: must be {}; use first and count", entry.key, quantity.allowed());
            return Err(entry.source.error(entry.at, problem));
        }
    }
    Ok(Values::Counted { first, count })
}

/// Reads one value of a quantity, as a list or `[model]` gives it.
pub(super) fn read_value(entry: &Entry<'_>, quantity: Quantity) -> Result<Value, SweepError> {
    let hint = if entry.node.get_ref().is_array() || entry.node.get_ref().is_table() {
        "; several values belong in [axes]"
    } else {
        ""
    };
    entry
        .value()
        .and_then(|value| quantity.checked(value))
        .ok_or_else(|| entry.must_be(&format!("{}{hint}", quantity.allowed())))
}

fn read_range(table: &Section<'_>, quantity: Quantity) -> Result<Option<Range>, SweepError> {
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
        let problem = format!("must be {} ({} of {})", quantity.allowed(), entry.key, quantity.key());
        let value = entry.value().and_then(|value| quantity.checked(value));
        value.and_then(Value::number).ok_or_else(|| entry.refuse(problem))
    };
    let range = Range { low: end(low)?, high: end(high)?, logarithmic };
    if range.low >= range.high {
        return Err(entry.must_be("[low, high] with low < high"));
    }
    if logarithmic && range.low <= 0.0 {
        return Err(entry.must_be("two numbers > 0: 0 has no logarithm; use linear, or list 0 beside a range in a zip"));
    }
    Ok(Some(range))
}

/// A value within a range, whole where the quantity is.
fn ranged(entry: &Entry<'_>, quantity: Quantity, value: f64) -> Result<Value, SweepError> {
    let value = if quantity.is_count() { value.round() } else { value };
    // Between two allowed ends everything is allowed; a quantity with a gap would be refused here.
    quantity.checked(Value::Real(value)).ok_or_else(|| {
        let problem = format!("{} = {}: must be {}", entry.key, Shortest(value), quantity.allowed());
        entry.source.error(entry.at, problem)
    })
}

fn read_zip(table: &Section<'_>) -> Result<PlacedAxis, SweepError> {
    let mut columns: Vec<Column> = Vec::new();
    let mut places = Vec::new();
    for entry in table.entries() {
        let quantity = known(&entry, table.title, &[])?;
        let (values, _) = listed(&entry, quantity, read_values(&entry, quantity)?)?;
        if let Some(first) = columns.first().filter(|first| first.values.len() != values.len()) {
            let (key, expected) = (first.quantity.key(), first.values.len());
            let problem =
                format!("has {} values, {key} has {expected}: columns of a zip have equal length", values.len());
            return Err(entry.refuse(problem));
        }
        columns.push(Column { quantity, values });
        places.push((quantity, entry.at));
    }
    if columns.len() < 2 {
        let problem = "zip: needs at least two columns that move together; a single one is an axis of its own";
        return Err(table.source.error(table.at, problem));
    }
    let axis = Axis::table(columns).map_err(|Repeated { earlier, later }| {
        let problem = format!("zip: row {} repeats row {} (counted from 1); keep one", later + 1, earlier + 1);
        table.source.error(table.at, problem)
    })?;
    Ok(PlacedAxis { axis, places })
}

fn read_sample(table: &Section<'_>, sample: Sample, most_points: u64) -> Result<PlacedAxis, SweepError> {
    const SETTINGS: [&str; 2] = ["points", "seed"];
    let points = table.required("points", "the number of points of the sample")?.count(1, most_points)?;
    let seed = table.entry("seed").map_or(Ok(0), |seed| seed.count(0, u64::from(u32::MAX)))?;
    let [points, seed] = [points, seed].map(|number| u32::try_from(number).unwrap_or(u32::MAX));
    let mut columns: Vec<Column> = Vec::new();
    let mut places = Vec::new();
    for entry in table.entries().into_iter().filter(|entry| !SETTINGS.contains(&entry.key)) {
        let quantity = known(&entry, table.title, &SETTINGS)?;
        let forms = "{ linear = [low, high] } or { log = [low, high] } in a sample";
        let form = entry.section("a range of a sample").ok_or_else(|| entry.must_be(forms))?;
        form.only(&["linear", "log"])?;
        let range = read_range(&form, quantity)?.ok_or_else(|| entry.must_be(forms))?;
        let dimension = u32::try_from(columns.len()).unwrap_or(u32::MAX);
        let coordinates = sample.coordinates(dimension, points, seed);
        let values =
            coordinates.into_iter().map(|x| ranged(&entry, quantity, range.at(x))).collect::<Result<_, _>>()?;
        columns.push(Column { quantity, values });
        places.push((quantity, entry.at));
    }
    if columns.is_empty() {
        let problem =
            format!("{}: needs a range for at least one quantity, such as V0 = {{ log = [1e-5, 1e-4] }}", table.title);
        return Err(table.source.error(table.at, problem));
    }
    let axis = Axis::table(columns).map_err(|Repeated { earlier, later }| {
        let problem = format!(
            "{}: point {} falls on point {}; widen the ranges, or take fewer points",
            table.title,
            later + 1,
            earlier + 1
        );
        table.source.error(table.at, problem)
    })?;
    Ok(PlacedAxis { axis, places })
}
