//! `stickslip show`: the result of a sweep, a line for each set. `run` ends with its first lines.

use super::output::{self, TextTable};
use super::{Exit, UsageError, layout};
use crate::model::{Parameters, Selected, Selection, Symbol, Value as Parameter};
use crate::reduce::{
    Comparison, Condition, Difference, EdgePair, EdgeRow, PulseRow, SetInRounds, TriggerRow,
    Values, add_intervals, ascending, compare, differing, means_of_slips, pairs_of_edges,
    read_optional, read_sets, read_sets_in_rounds, renew,
};
use crate::results::Results;
use crate::sets::{
    AllButSeed, Digits, FOUND, by_frequency, column_of, label, symbol_of, with_decimals,
};
use crate::sets::{FREQUENCY, SetRow};
use crate::sweep::Sweep;
use crate::table::arrow::json;
use crate::table::columns::Interval;
use crate::table::columns::{Kind, Row as _};
use crate::table::shown::shown;
use crate::table::value::floored;
use anyhow::Result;
use clap::Args;
use serde_json::{Map, Value as Json};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Show the result of a sweep: a line for each parameter set, with 95 % intervals
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// Results directory
    #[arg(value_name = "DIR")]
    directory: PathBuf,
    /// A second one: what differs, seed by seed, between the sets of both that agree in all that either varies
    #[arg(value_name = "OTHER", conflicts_with_all = ["columns", "condition", "sort"])]
    other: Option<PathBuf>,
    /// Columns of the sets, or formulas of such, separated by commas, beside what was swept; of columns of slips, the
    /// means [default: what was found]
    #[arg(long, value_name = "COLUMN", value_delimiter = ',')]
    columns: Vec<String>,
    /// Only sets for which a condition on their columns, by name or heading, holds, in SI
    #[arg(long = "where", value_name = "CONDITION", allow_hyphen_values = true)]
    condition: Option<String>,
    /// Column to sort by, least first; -COLUMN: largest first
    #[arg(long, value_name = "COLUMN", allow_hyphen_values = true)]
    sort: Option<String>,
    /// Print CSV, in SI
    #[arg(long, conflicts_with = "json")]
    csv: bool,
    /// Print JSON, in SI
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  stickslip show results/fig3
  stickslip show results/fig3 --where 'V0 > 1e-4 and resultant_length > 0.5' --sort -resultant_excess
  stickslip show results/sliding-velocity --where 'slip_share >= 0.95'   the sets that slide
  stickslip show results/soft results/stiff                   what another Kd changes, say
  stickslip show results/fig3 --columns tau_mean,tau_sd/tau_mean --csv > fig3.csv

Columns are those of stickslip plot --list.";

const JSON_FORMAT: u32 = 2;

/// Sets that the end of a run shows, and reads for its columns and for what ended otherwise.
const FIRST: usize = 12;
const MAX_READ: usize = 10_000;
/// Sets that a note names.
const MAX_NAMED: usize = 4;

pub fn show(arguments: &Arguments) -> Result<Exit> {
    let results = Results::read(&layout(&arguments.directory))?;
    match &arguments.other {
        Some(other) => show_differences(arguments, &results, other)?,
        None => show_sets(arguments, &renew(&results)?)?,
    }
    Ok(Exit::Done)
}

impl Arguments {
    const fn is_text(&self) -> bool {
        !self.json && !self.csv
    }

    /// Prints the chosen columns of the chosen sets, as JSON with the fields of `found`. `rows` are the sets of a single
    /// directory.
    fn print(
        &self,
        columns: &[Values],
        count: usize,
        rows: &[SetRow],
        mut found: Json,
    ) -> Result<()> {
        if self.json {
            let records = (0..count).map(|set| record(columns, set).into_iter().collect());
            let sets: Vec<Map<String, Json>> = records.collect();
            found["sets"] = serde_json::json!(sets);
            output::json(JSON_FORMAT, &found)
        } else if self.csv {
            print_csv(columns, count)
        } else {
            output::print(&aligned(columns, rows, count))
        }
    }
}

/// Shows in what the sets of two directories differ.
fn show_differences(arguments: &Arguments, results: &Results<'_>, other: &Path) -> Result<()> {
    let others = Results::read(&layout(other))?;
    let Comparison {
        columns,
        differences,
    } = compare(results, &others)?;
    let count = columns.first().map_or(0, |values| values.numbers.len());
    if count == 0 {
        let problem = "no set agrees with one of the first in all parameters that either varies";
        return Err(UsageError(format!("{}: {problem}", shown(other))).into());
    }
    let named = [("A", &*arguments.directory), ("B", other)]
        .into_iter()
        .enumerate();
    let mut lines: Vec<String> = named
        .map(|(place, (letter, path))| {
            let settings = Difference::settings(&differences, place).replace('\u{a0}', " ");
            let line = format!("{letter} is {}: {settings}", shown(path));
            line.trim_end_matches(": ").to_owned()
        })
        .collect();
    let sweeps = [results.sweep(), others.sweep()];
    if sweeps.iter().all(|sweep| sweep.measured().is_none()) {
        // Parameters are those of the sets.
        let rest = sweeps[0].differences(sweeps[1]).into_iter();
        lines.extend(rest.filter(|line| !line.starts_with("name") && !line.starts_with("model.")));
    }
    if arguments.is_text() {
        output::lines(lines)?;
    } else {
        for line in &lines {
            output::report(line);
        }
    }
    let of_drive = differences
        .iter()
        .filter(|difference| difference.is_of_drive());
    let symbols: Vec<String> = of_drive
        .map(|difference| symbol_of(difference.symbol))
        .collect();
    if !symbols.is_empty() {
        let drive = symbols.join(", ");
        output::warn(&[format!(
            "A and B differ in {drive}, which enters all differences below"
        )]);
    }
    let constants: BTreeMap<&str, &Vec<Option<Parameter>>> = differences
        .iter()
        .map(|difference| (difference.symbol.key(), &difference.constants))
        .collect();
    arguments.print(
        &columns,
        count,
        &[],
        serde_json::json!({ "differences": constants }),
    )
}

/// Shows the sets of a directory whose reduced data are up to date.
fn show_sets(arguments: &Arguments, results: &Results<'_>) -> Result<()> {
    let mut all: Vec<SetInRounds> =
        read_sets_in_rounds(results.layout()).collect::<Result<_, _>>()?;
    let usual = usual_names(&all.iter().map(|(row, _)| row));
    if let Some(text) = &arguments.condition {
        let refuse = |problem: String| UsageError(format!("--where {text}: {problem}"));
        let condition = Condition::read(text, &SetInRounds::columns()).map_err(refuse)?;
        if !all.iter().any(|row| condition.holds(row)) {
            return Err(refuse(condition.unmatched("sets", &all)).into());
        }
        all.retain(|row| condition.holds(row));
    }
    match &arguments.sort {
        Some(column) => sort(&mut all, column)?,
        None => by_frequency(&mut all, |(row, _)| &row.parameters),
    }
    let rows: Vec<SetRow> = all.iter().map(|(row, _)| row.clone()).collect();
    let columns = if arguments.columns.is_empty() {
        usual_columns(&usual, &rows)
    } else {
        chosen_columns(results, usual, &arguments.columns, &all, &rows)?
    };
    let pulses = pulses(results)?;
    let mut edges: Vec<EdgeRow> = read_optional(results.layout())?;
    if arguments.condition.is_some() {
        edges.retain(|edge| rows.iter().any(|row| is_on_line(row, edge)));
    }
    if arguments.is_text() {
        if let Some(unfinished) = output::unfinished(results)? {
            output::print(&format!("so far: {unfinished}\n\n"))?;
        }
        output::print(&table_of_edges(&edges, &rows))?;
        output::print(&table_of_pairs(&pairs_of_edges(results)?))?;
        output::print(&table_of_pulses(results, &pulses)?)?;
    }
    let edges: Vec<Json> = edges.iter().map(json).collect();
    let pulses: Vec<Json> = pulses.iter().map(json).collect();
    let found = serde_json::json!({ "edges": edges, "pulses": pulses });
    arguments.print(&columns, rows.len(), &rows, found)?;
    if arguments.is_text() {
        output::lines(notes(results, &rows, &columns))?;
    }
    Ok(())
}

/// The first of the `count` sets of a directory, and notes on its jobs. Memory: [`MAX_READ`] sets.
pub fn summary(results: &Results<'_>, count: u64) -> Result<String> {
    let results = &renew(results)?;
    let mut rows = sets(results, MAX_READ)?;
    by_frequency(&mut rows, |row| &row.parameters);
    let columns = usual_columns(&usual_names(&rows.iter()), &rows);
    // A line that says how many more there are is as long as one of these.
    let first = FIRST + usize::from(count == FIRST as u64 + 1);
    let mut text = table_of_edges(&read_optional(results.layout())?, &rows);
    text += &table_of_pulses(results, &pulses(results)?)?;
    text += &aligned(&columns, &rows, first);
    if let Some(more @ 1..) = count.checked_sub(first as u64) {
        let root = output::quoted_path(results.layout().root());
        text = format!("{text}… {more} more: stickslip show {root}\n");
    }
    for note in notes(results, &rows, &columns) {
        text += &(note + "\n");
    }
    Ok(text)
}

/// The first of the reduced sets.
fn sets(results: &Results<'_>, most: usize) -> Result<Vec<SetRow>> {
    let sets = read_sets(results.layout()).take(most);
    Ok(sets.collect::<Result<_, _>>()?)
}

/// The parameters in which sets differ.
fn usual_names<'a>(rows: &(impl Iterator<Item = &'a SetRow> + Clone)) -> Vec<&'static str> {
    let mut names: Vec<&str> = differing(rows).into_iter().map(column_of).collect();
    names.extend(names.contains(&FREQUENCY).then_some("eta"));
    names
}

fn columns_of<'a>(names: impl IntoIterator<Item = &'a str>, rows: &[SetRow]) -> Vec<Values> {
    names
        .into_iter()
        .filter_map(|name| Values::of(rows, name).ok())
        .collect()
}

/// Parameters of these names, and what was found of sets.
fn usual_columns(names: &[&str], rows: &[SetRow]) -> Vec<Values> {
    let mut columns = columns_of([names, FOUND].concat(), rows);
    columns.retain(|values| values.numbers.iter().any(Option::is_some));
    columns
}

/// The parameters of these names, and columns by name, heading or formula, each once; of slips, their means.
fn chosen_columns(
    results: &Results<'_>,
    parameters: Vec<&'static str>,
    chosen: &[String],
    all: &[SetInRounds],
    rows: &[SetRow],
) -> Result<Vec<Values>> {
    let mut columns = Vec::new();
    for name in chosen {
        columns.push(match Values::of(all, name) {
            Ok(mut values) => {
                let mut sources = values.sources.iter();
                if sources.all(|source| source.name != values.name()) {
                    add_intervals(results, rows, &mut values)?;
                }
                values
            }
            Err(problem) => means_of_slips(results, rows, name)?
                .ok_or_else(|| UsageError(format!("--columns {name}: {problem}")))?,
        });
    }
    let mut all = columns_of(parameters, rows);
    all.retain(|values| columns.iter().all(|chosen| chosen.name() != values.name()));
    all.append(&mut columns);
    Ok(all)
}

fn sort(rows: &mut Vec<SetInRounds>, column: &str) -> Result<()> {
    let (name, sign) = match column.strip_prefix('-') {
        Some(name) => (name, -1.0),
        None => (column, 1.0),
    };
    let values = Values::of(rows, name)
        .map_err(|problem| UsageError(format!("--sort {column}: {problem}")))?;
    // Sets without a value come last.
    let key = |set: &usize| values.numbers[*set].map_or(f64::INFINITY, |number| sign * number);
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|left, right| key(left).total_cmp(&key(right)));
    *rows = order.into_iter().map(|set| rows[set].clone()).collect();
    Ok(())
}

/// The values of a set with their intervals, in SI, by the names of the table of sets, each name once.
fn record(columns: &[Values], set: usize) -> Vec<(String, Json)> {
    let mut record = Vec::new();
    for values in columns {
        let name = &values.column.name;
        let value = match values.numbers[set] {
            Some(number) if values.is_worded() => values.word(number).into(),
            #[expect(clippy::cast_possible_truncation, reason = "a count")]
            Some(number) if values.column.kind == Kind::Count => Json::from(number as i64),
            number => Json::from(number),
        };
        record.push((name.to_string(), value));
        if values.intervals.iter().any(Option::is_some) {
            let ends = values.intervals[set].map(|ends| (ends.low, ends.high));
            let (low, high) = ends.unzip();
            record.push((format!("{name}_low"), low.into()));
            record.push((format!("{name}_high"), high.into()));
        }
    }
    let mut known = BTreeSet::new();
    record.retain(|(name, _)| known.insert(name.clone()));
    record
}

/// Prints the first sets, under the names of the columns of all.
fn print_csv(columns: &[Values], sets: usize) -> Result<()> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let first = record(columns, 0);
    writer.write_record(first.iter().map(|(name, _)| name))?;
    for set in 0..sets {
        let of_set = record(columns, set);
        writer.write_record(of_set.iter().map(|(_, value)| match value {
            Json::Null => String::new(),
            Json::String(word) => word.clone(),
            value => value.to_string(),
        }))?;
    }
    output::print(&String::from_utf8(writer.into_inner()?)?)
}

/// A table for people: symbols and units at its head, values with half of their 95 % intervals.
fn aligned(columns: &[Values], rows: &[SetRow], most: usize) -> String {
    let mut text = TextTable::default();
    for values in columns {
        add_column(&mut text, values, rows, most);
    }
    text.to_string()
}

/// Adds a column of the first sets.
fn add_column(columns: &mut TextTable, values: &Values, rows: &[SetRow], most: usize) {
    let label = &values.label;
    let described = SetRow::columns();
    let bound_of = described
        .iter()
        .find(|other| other.class.bounded() == Some(values.name()));
    let bounds = bound_of.and_then(|bound| Values::of(rows, &bound.name).ok());
    let bound = |set: usize| *bounds.as_ref()?.numbers.get(set)?;
    let given = (0..values.numbers.len()).filter_map(bound);
    let (factor, unit) = label.scale(given.fold(values.largest, f64::max));
    let digits = values.digits();
    let cell = |set: usize| match (values.numbers[set], values.intervals[set]) {
        (Some(value), _) if values.is_worded() => values.word(value).unwrap_or_default().to_owned(),
        (Some(value), Some(ends)) => {
            with_interval(factor * value, factor * ends.low, factor * ends.high)
        }
        (Some(value), None) => digits.number(factor * value),
        (None, _) => match bound(set) {
            Some(tau) => format!("> {}", digits.number(factor * tau)),
            None => "–".to_owned(),
        },
    };
    let cells = (0..values.numbers.len().min(most)).map(cell);
    columns.add(values.is_worded(), label.short(&unit), cells);
}

/// The parameters but one in which some rows differ.
fn parameters_but(symbol: Symbol, rows: impl Iterator<Item = Parameters>) -> TextTable {
    let as_set = |parameters: Parameters| SetRow {
        frequency: parameters.frequency(),
        parameters: Selected::new(parameters),
        ..SetRow::default()
    };
    let sets: Vec<SetRow> = rows.map(as_set).collect();
    let mut parameters = differing(&sets.iter());
    parameters.retain(|other| *other != symbol);
    let mut columns = TextTable::default();
    for values in columns_of(parameters.into_iter().map(column_of), &sets) {
        add_column(&mut columns, &values, &sets, sets.len());
    }
    columns
}

/// What pulses did, for people, and a blank line; empty if none says something.
fn table_of_pulses(results: &Results<'_>, pulses: &[PulseRow]) -> Result<String> {
    if pulses.is_empty() {
        return Ok(String::new());
    }
    let parameters = pulses.iter().map(PulseRow::pulse);
    let mut columns = parameters_but(Symbol::PulseStart, parameters);
    columns.numbers("pulses", pulses, |row| row.jobs.to_string());
    let mut add = |name: &str, of: fn(&PulseRow) -> (Option<f64>, Option<Interval>)| {
        columns.numbers(name, pulses, |row| match of(row) {
            (Some(value), Some(Interval { low, high })) => with_interval(value, low, high),
            (Some(value), None) => Digits::THREE.number(value),
            (None, _) => "–".to_owned(),
        });
    };
    // By the drive alone they are exact for the control's slips, whose error the excess has.
    add("advance/⟨τ⟩", |row| {
        (row.advance_mean, row.advance_interval)
    });
    add("drive alone", |row| (row.advance_drive, None));
    add("excess", |row| {
        (row.advance_excess, row.advance_excess_interval)
    });
    add("triggered", |row| {
        (Some(row.triggered_share), row.triggered_interval)
    });
    add("drive alone", |row| (Some(row.triggered_drive), None));
    add("excess", |row| {
        (Some(row.triggered_excess), row.triggered_excess_interval)
    });
    let triggers: Vec<TriggerRow> = read_optional(results.layout())?;
    let silent = triggers.iter().filter(|row| row.advance.is_none()).count();
    let noises = triggers.iter().filter_map(|row| row.noise);
    let noise = noises.reduce(f64::max).map_or_else(String::new, |noise| {
        format!("; pulses of 1e-12 m at most advance slips by up to {noise:.1e} s, by the error of the solver")
    });
    Ok(format!(
        "{columns}without a slip to compare: {silent} of {} pulses{noise}\n\n",
        triggers.len()
    ))
}

/// What pulses did, wherever in the interval they begin.
fn pulses(results: &Results<'_>) -> Result<Vec<PulseRow>> {
    let mut pulses: Vec<PulseRow> = read_optional(results.layout())?;
    pulses.retain(PulseRow::is_of_whole_interval);
    Ok(pulses)
}

/// Whether a set differs from those of an edge in nothing but the refined axis.
fn is_on_line(row: &SetRow, edge: &EdgeRow) -> bool {
    let axis = Symbol::from_key(&edge.axis).unwrap_or(Symbol::T);
    let mut others = AllButSeed::SYMBOLS.iter().filter(|symbol| **symbol != axis);
    others.all(|&symbol| row.parameters.get(symbol) == edge.parameters.get(symbol))
}

/// On which side of the threshold all sets lie, where nothing crosses it.
fn side(edge: &EdgeRow, rows: &[SetRow]) -> &'static str {
    if let Some(way_out) = edge.way_out() {
        return way_out;
    }
    let of_edge = rows.iter().filter(|row| is_on_line(row, edge));
    let values: Vec<f64> = of_edge
        .filter_map(|row| row.number(&edge.statistic))
        .collect();
    match &values[..] {
        [] => "none",
        values if values.iter().all(|value| *value > edge.threshold) => "none: all above",
        values if values.iter().all(|value| *value < edge.threshold) => "none: all below",
        _ => "not between clear sets",
    }
}

/// Edges for people, and a blank line; empty if there are none.
fn table_of_edges(edges: &[EdgeRow], sets: &[SetRow]) -> String {
    let Some(first) = edges.first() else {
        return String::new();
    };
    let axis = Symbol::from_key(&first.axis).unwrap_or(Symbol::T);
    let parameters = edges.iter().map(|edge| edge.parameters.all.clone());
    let mut columns = parameters_but(axis, parameters);
    let label = label(&first.axis);
    let brackets = edges.iter().map(|edge| edge.bracket_high);
    let (factor, unit) = label.scale(brackets.fold(0.0, f64::max));
    let mut digits = Digits::FOUR;
    for edge in edges {
        let interval = edge
            .edge_interval
            .map(|interval| [interval.low, interval.high]);
        for ends in [Some([edge.bracket_low, edge.bracket_high]), interval] {
            digits = digits.distinguishing(&ascending(ends.into_iter().flatten()));
        }
    }
    let number = |value: f64| digits.number(factor * value);
    columns.words("edge of", edges, EdgeRow::crossed);
    columns.words(label.short(&unit), edges, |edge| {
        edge.edge
            .map_or_else(|| side(edge, sets).to_owned(), number)
    });
    columns.words("95 %", edges, |edge| {
        let (from, low, high) = match edge.edge_interval {
            Some(Interval { low, high }) => ("", low, high),
            None => ("from ", edge.bracket_low, edge.bracket_high),
        };
        format!("{from}{} to {}", number(low), number(high))
    });
    columns.words("", edges, |edge| match edge.rises {
        Some(true) => "rises".to_owned(),
        Some(false) => "falls".to_owned(),
        None => String::new(),
    });
    columns.words("jobs", edges, |edge| edge.jobs.to_string());
    columns.words("ended by", edges, |edge| edge.ended.word().to_owned());
    format!("{columns}\n")
}

/// By how much edges of other statistics lie further than those of the first, and a blank line; empty if there are none.
fn table_of_pairs(pairs: &[EdgePair]) -> String {
    let Some(first) = pairs.first() else {
        return String::new();
    };
    let axis = Symbol::from_key(&first.edges[0].axis).unwrap_or(Symbol::T);
    let parameters = pairs
        .iter()
        .map(|pair| pair.edges[0].parameters.all.clone());
    let mut columns = parameters_but(axis, parameters);
    let label = label(axis.key());
    let largest = pairs
        .iter()
        .filter_map(|pair| pair.edges[1].edge)
        .fold(0.0, f64::max);
    let (factor, unit) = label.scale(largest);
    columns.words("edge of", pairs, |pair| pair.edges[1].crossed());
    columns.words("less that of", pairs, |pair| pair.edges[0].crossed());
    columns.words(label.short(&unit), pairs, |pair| {
        let [low, high] = pair.interval.map_or([f64::NAN; 2], |ends| {
            [ends.low, ends.high].map(|end| factor * end)
        });
        with_interval(factor * pair.difference, low, high)
    });
    format!("{columns}\n")
}

/// How far the middle of an interval may lie from its value, as a share of the half-width, to be shown as ±.
const LOPSIDED: f64 = 0.2;

/// Sizes of numbers that are read without an exponent.
const PLAIN: Range<f64> = 1e-6..1e5;

/// A value and the half-width of its interval, with the digits that this leaves; or its ends, if the value is not in
/// the middle, or ± would reach beyond zero and the interval does not.
fn with_interval(value: f64, low: f64, high: f64) -> String {
    let half = 0.5 * (high - low);
    // Up to rounding there is no interval.
    if half.is_nan() || half <= 1e-12 * value.abs() {
        return Digits::THREE.number(value);
    }
    let crosses = low >= 0.0 && value < half || high <= 0.0 && value > -half;
    let is_lopsided = crosses || (value - low - half).abs() > LOPSIDED * half;
    let largest = value.abs().max(low.abs()).max(high.abs());
    let power = if PLAIN.contains(&largest) {
        0.0
    } else {
        libm::floor(libm::log10(largest))
    };
    // Two digits of an error that begins with 1, and of ends.
    let exponent = libm::floor(libm::log10(half));
    let has_two = is_lopsided || half / libm::exp10(exponent) < 1.95;
    let digits = floored(f64::from(u8::from(has_two)) - exponent + power).min(18);
    let ending = if power == 0.0 {
        String::new()
    } else {
        format!("e{power}")
    };
    let number = |number: f64| with_decimals(number / libm::exp10(power), digits) + &ending;
    let [value, low, high, half] = [value, low, high, half].map(number);
    if is_lopsided {
        format!("{value} ({low} to {high})")
    } else {
        format!("{value} ± {half}")
    }
}

const SINGLE_SERIES: &str =
    "with a single series: the error is from the correlation within the series";
const BELOW_DRIVE: &str = "with less R than the drive alone makes: are all times counted from a maximum of the modulation?";

/// Columns that notes on the drive alone are about.
const OF_DRIVE_ALONE: [&str; 3] = ["resultant_length", "resultant_drive", "resultant_excess"];

/// Notes on jobs that ended early, each kind with a command that shows one, on sets that left the sweep, and on what is
/// shown of R.
fn notes(results: &Results<'_>, rows: &[SetRow], columns: &[Values]) -> Vec<String> {
    let sweep = results.sweep();
    let failed: u64 = rows.iter().map(|row| row.failed_jobs).sum();
    let failed = (failed > 0).then(|| {
        let jobs = output::count(failed, "job");
        let root = output::quoted_path(results.layout().root());
        format!("{jobs} failed: stickslip status {root} says why")
    });
    let measured = sweep.measured().map_or(&[][..], |_| rows);
    let shows_r = columns
        .iter()
        .any(|column| OF_DRIVE_ALONE.contains(&column.name()));
    let with_r = if shows_r { rows } else { &[] };
    let is_below_drive = |row: &SetRow| {
        let excess = row.resultant_excess_interval;
        excess.is_some_and(|excess| excess.high < 0.0)
    };
    let notes = [
        note_on_sliding(sweep, rows),
        note_on_cut_jobs(sweep, rows),
        note_on_few_cycles(rows),
        note_on_start(rows),
        note_on_control(sweep, with_r),
        note_on_drive(with_r),
        note_on_sets(measured, |row| row.finished_jobs == 1, SINGLE_SERIES),
        note_on_sets(measured, is_below_drive, BELOW_DRIVE),
        note_on_model(sweep, rows),
        failed,
        note_on_removed_sets(sweep, rows),
    ];
    notes.into_iter().flatten().collect()
}

/// The jobs of some kind, and of how many sets they are; `None` if there are none.
fn jobs_of_sets(rows: &[SetRow], jobs: impl Fn(&SetRow) -> u64) -> Option<String> {
    let counts: Vec<u64> = rows.iter().map(jobs).filter(|jobs| *jobs > 0).collect();
    let jobs = output::count(counts.iter().sum(), "job");
    let sets = output::count(counts.len() as u64, "set");
    (!counts.is_empty()).then(|| format!("{jobs} of {sets}"))
}

fn note_on_sliding(sweep: &Sweep, rows: &[SetRow]) -> Option<String> {
    let jobs = jobs_of_sets(rows, |row| row.jobs_without_slips)?;
    let without = rows.iter().filter(|row| row.jobs_without_slips > 0);
    let mut places = without.filter_map(|row| sweep.set_with(&row.parameters));
    let job = places
        .next()
        .and_then(|set| sweep.jobs_at(set..set + 1).next());
    let command = job.map_or_else(String::new, |job| {
        format!("; a job of one such set: {}", sweep.command(&job))
    });
    Some(format!(
        "{jobs} ended because no further slip came: the slider slides, or give_up_after is too short{command}"
    ))
}

/// A bias of `tau_mean` below this share is given as a bound, as its digits would be zeros.
const SMALL_SHARE: f64 = 1e-3;

fn note_on_cut_jobs(sweep: &Sweep, rows: &[SetRow]) -> Option<String> {
    let jobs: u64 = rows.iter().map(|row| row.jobs_cut).sum();
    if jobs == 0 {
        return None;
    }
    let most_off = rows.iter().filter_map(|row| row.tau_off).reduce(f64::min);
    let off = match most_off.map(|off| -off) {
        None => String::new(),
        Some(small) if small < SMALL_SHARE => ", by less than 0.1 %".to_owned(),
        Some(share) => format!(", by up to about {:.1} %", 100.0 * share),
    };
    let too_short =
        format!("within an interval, which counts for nothing: tau_mean is too short{off}");
    if sweep.measured().is_some() {
        let end = if jobs == 1 { "ends" } else { "end" };
        return Some(format!("{jobs} series {end} {too_short}"));
    }
    let jobs = jobs_of_sets(rows, |row| row.jobs_cut)?;
    Some(format!(
        "{jobs} cut by max_time {too_short}; `time` in place of max_time ends jobs with a slip"
    ))
}

/// How many sets something applies to, and what; `None` if there are none.
fn note_on_sets(rows: &[SetRow], applies: impl Fn(&SetRow) -> bool, note: &str) -> Option<String> {
    let sets = rows.iter().filter(|row| applies(row)).count() as u64;
    (sets > 0).then(|| format!("{} {note}", output::count(sets, "set")))
}

fn note_on_few_cycles(rows: &[SetRow]) -> Option<String> {
    let has_few_cycles = |row: &SetRow| {
        let times = row.parameters.modulation_period.zip(row.tau_mean);
        row.phase_mean.is_none() && times.is_some_and(|(period, tau)| period >= tau)
    };
    let note = "without a phase: the jobs hold less than two cycles of the modulation; more slips give one";
    note_on_sets(rows, has_few_cycles, note)
}

fn note_on_start(rows: &[SetRow]) -> Option<String> {
    let note = "in which seeds still share their start, so that intervals of R and φ are too narrow: raise discard, \
                or take longer jobs";
    note_on_sets(rows, |row| row.shares_start, note)
}

/// Where R needs a control to be judged.
fn note_on_control(sweep: &Sweep, rows: &[SetRow]) -> Option<String> {
    let lacks_control =
        |row: &&SetRow| row.resultant_length.is_some() && row.resultant_drive.is_none();
    let row = rows.iter().find(lacks_control)?;
    let control = if sweep.measured().is_some() {
        let setting = |symbol: Symbol| {
            let value = row.parameters.get(symbol).number()?;
            let digits = Digits::THREE.distinguishing(&[value]);
            Some(label(symbol.key()).setting(value, digits))
        };
        let known = [Symbol::V0, Symbol::Kd].into_iter().filter_map(setting);
        let settings: Vec<String> = known.collect();
        format!("a control, slips at Δ = 0 and {}", settings.join(", "))
    } else {
        "control = true".to_owned()
    };
    Some(format!(
        "R without {control}: the drive alone makes some of it, and the part due to the slider is not known"
    ))
}

/// How much of R the drive alone makes, where that is not seen at a glance.
fn note_on_drive(rows: &[SetRow]) -> Option<String> {
    let is_explained = |row: &SetRow| {
        let excess = row.resultant_excess_interval;
        excess.is_some_and(|excess| excess.low <= 0.0 && excess.high >= 0.0)
    };
    let note = "whose R the data do not tell from that of the drive alone";
    note_on_sets(rows, is_explained, note)
}

/// What swept parameters change beside what their names say.
const SIDE_EFFECTS: [(Symbol, &str); 3] = [
    (
        Symbol::M,
        "M: at the same gamma, a rate per mass, a heavier slider has more drag",
    ),
    (
        Symbol::Ns,
        "Ns: a precursor has at least Ns breaks unless precursor_size is set",
    ),
    (
        Symbol::TauR,
        "tau_r: contacts do not age; a longer hold does not strengthen them",
    ),
];

fn note_on_model(sweep: &Sweep, rows: &[SetRow]) -> Option<String> {
    let varied = differing(&rows.iter());
    let applies = |symbol: &Symbol| match symbol {
        Symbol::M => !varied.contains(&Symbol::Gamma),
        Symbol::Ns => sweep.recording().precursor_size.is_none(),
        _ => true,
    };
    let relevant = SIDE_EFFECTS
        .iter()
        .filter(|(symbol, _)| varied.contains(symbol) && applies(symbol));
    let notes: Vec<&str> = relevant.map(|(_, note)| *note).collect();
    (!notes.is_empty()).then(|| notes.join("\n"))
}

fn note_on_removed_sets(sweep: &Sweep, rows: &[SetRow]) -> Option<String> {
    let is_gone = |set: &usize| sweep.set_with(&rows[*set].parameters).is_none();
    let gone: Vec<usize> = (0..rows.len()).filter(is_gone).collect();
    if gone.is_empty() {
        return None;
    }
    let parameters = differing(&rows.iter()).into_iter();
    let columns = columns_of(parameters.map(column_of), rows);
    let setting = |&set: &usize| {
        let settings = columns
            .iter()
            .filter_map(|values| Some(values.setting(values.numbers[set]?)));
        settings.collect::<Vec<_>>().join(", ")
    };
    let mut named: Vec<String> = gone.iter().take(MAX_NAMED).map(setting).collect();
    if let Some(more @ 1..) = gone.len().checked_sub(MAX_NAMED) {
        named.push(format!("{more} more"));
    }
    let sets = output::count(gone.len() as u64, "set");
    let names = named.join("; ");
    Some(format!("no longer in the sweep: {sets} of these: {names}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_the_digits_that_their_errors_leave() {
        let shown = [
            (136.42, 0.83),
            (136.42, 1.24),
            (0.9412, 0.0171),
            (297.3, 21.0),
            (3.0, 0.0),
            (-0.02, 0.06),
            (-3e-4, 2e-3),
        ];
        assert_eq!(
            shown.map(|(value, half)| with_interval(value, value - half, value + half)),
            [
                "136.4 ± 0.8",
                "136.4 ± 1.2",
                "0.941 ± 0.017",
                "297 ± 21",
                "3",
                "-0.02 ± 0.06",
                "0.000 ± 0.002"
            ]
        );
    }

    #[test]
    fn what_is_very_large_or_small_has_an_exponent() {
        let shown = [(1.234e8, 2e5), (3e-9, 4e-10), (2e5, 0.0), (5.0e7, 4.9e7)];
        let shown = shown.map(|(value, half)| with_interval(value, value - half, value + half));
        assert_eq!(
            shown,
            ["1.234e8 ± 0.002e8", "3.0e-9 ± 0.4e-9", "2e5", "5e7 ± 5e7"]
        );
    }

    #[test]
    fn an_interval_that_is_not_symmetric_is_shown_by_its_ends() {
        let shown = [
            (4.03, 1.42, 13.78),
            (0.9, 0.05, 1.9),
            (136.4, 120.0, 150.0),
            (0.046, 0.031, 0.112),
            (-0.5, -1.1, -0.01),
        ];
        assert_eq!(
            shown.map(|(value, low, high)| with_interval(value, low, high)),
            [
                "4.0 (1.4 to 13.8)",
                "0.90 (0.05 to 1.90)",
                "136 ± 15",
                "0.046 (0.031 to 0.112)",
                "-0.50 (-1.10 to -0.01)"
            ]
        );
    }
}
