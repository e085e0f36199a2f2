//! Measured slips: tables of an experiment become a sweep whose jobs are looked up, not computed.
//!
//! ```text
//! files -> rows -> series -> a sweep with a job for each, and their slips
//! ```
//!
//! A series is a stretch of rows of one run and with the same parameters; its number is its seed. Contract: the
//! statistics of measured slips are those of the model's, by the same code.

use crate::model::theory::to_twelve_digits;
use crate::model::{Symbol, Value};
use crate::observe::{Measurements, Modulation, Slip, phase};
use crate::solver::Summary;
use crate::sweep::{Job, Measured, Sweep, hint};
use crate::table::arrow::texts;
use crate::table::checksum::hexadecimal;
use crate::table::shown::shown;
use anyhow::{Context, Result, bail, ensure};
use arrow_schema::DataType;
use bytes::Bytes;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs;
use std::path::PathBuf;
use std::str;
use toml_edit::{Array, Value as Toml};

/// What columns, or the command line, can give, and in which unit.
const KEYS: [(&str, &str); 9] = [
    (ONSET, "s"),
    (DROP, "N"),
    (PEAK_FORCE, "N"),
    (RUN, ""),
    ("V0", "m/s"),
    ("Kd", "N/m"),
    ("Delta", "m"),
    ("T", "s"),
    (FREQUENCY, "Hz"),
];
const ONSET: &str = "onset";
const DROP: &str = "drop";
const PEAK_FORCE: &str = "peak_force";
const RUN: &str = "run";
const FREQUENCY: &str = "frequency";
const PARAMETERS: [Symbol; 4] = [Symbol::V0, Symbol::Kd, Symbol::Delta, Symbol::T];

/// What is to be read.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    pub files: &'a [PathBuf],
    /// `KEY=COLUMN:UNIT`, without a unit in SI. Other columns have the names of their keys.
    pub columns: &'a [String],
    /// `KEY=VALUE:UNIT`, for all rows.
    pub settings: &'a [String],
    /// The time of a maximum of the modulation, in s.
    pub maximum: f64,
    /// The name of the sweep.
    pub name: &'a str,
    /// The command that asks for it.
    pub command: &'a str,
}

/// A sweep with a job for each series, and the slips of each, by their seeds.
#[derive(Clone, Debug)]
pub struct Experiment {
    pub sweep: Sweep,
    slips: Vec<Vec<Slip>>,
}

impl Experiment {
    /// An error names the file, and the line if it is about one.
    pub fn read(request: Request<'_>) -> Result<Self> {
        let settings = Source::all("--set", request.settings)?;
        let mut columns = Source::all("--column", request.columns)?;
        let is_new = |key: &str| {
            settings
                .iter()
                .chain(&columns)
                .all(|source| source.key != key)
        };
        let others = KEYS.into_iter().filter(|(key, _)| is_new(key));
        let others: Vec<Source> = others.map(|(key, _)| Source::by_name(key)).collect();
        columns.extend(others);
        let mut files = Array::new();
        let mut beginnings = Array::new();
        let mut series: Vec<Vec<Row>> = Vec::new();
        for path in request.files {
            let file = shown(path);
            let bytes = fs::read(path).with_context(|| file.to_string())?;
            files.push(format!("{}  {file}", hexadecimal(&Sha256::digest(&bytes))));
            let mut table = Table {
                columns: &columns,
                settings: &settings,
                rows: Vec::new(),
            };
            table.read(&bytes).with_context(|| file.to_string())?;
            for rows in table.series().with_context(|| file.to_string())? {
                beginnings.push(format!("{file}:{}", rows[0].line));
                series.push(rows);
            }
        }
        let text = format!(
            "name = {:?}\n[measured]\ncommand = {}\nfiles = {files}\nseries = {beginnings}\n{}",
            request.name,
            Toml::from(request.command),
            rest_of_sweep(&series),
        );
        let slips = series.iter().map(|rows| slips(rows, request.maximum));
        Ok(Self {
            sweep: Sweep::parse_made(&text, "files")?,
            slips: slips.collect(),
        })
    }

    /// What was measured of a job.
    pub fn measurements(&self, job: &Job) -> Measurements {
        let series = usize::try_from(job.parameters.seed).unwrap_or(usize::MAX);
        Measurements {
            slips: self.slips[series].clone(),
            summary: Summary {
                satisfied: true,
                ..Summary::default()
            },
            ..Measurements::default()
        }
    }
}

/// Files of measured slips, compared with what was read.
pub fn compare_files(measured: &Measured) -> Vec<String> {
    let compared = measured.files.iter().map(|file| {
        let (checksum, path) = file.split_once("  ").unwrap_or_default();
        let state = match fs::read(path) {
            Err(_) => "cannot be read here",
            Ok(bytes) if hexadecimal(&Sha256::digest(&bytes)) == checksum => "as it was read",
            Ok(_) => "differs from what was read",
        };
        format!("{path}: {state}")
    });
    compared.collect()
}

/// What gives the values of a key: a column, or one value; and the factor of its unit.
struct Source {
    key: &'static str,
    from: String,
    factor: f64,
    is_needed: bool,
}

impl Source {
    /// A column with the name of its key, if it is there.
    fn by_name(key: &'static str) -> Self {
        Self {
            key,
            from: key.to_owned(),
            factor: 1.0,
            is_needed: key == ONSET,
        }
    }

    /// Reads the texts of a flag.
    fn all(flag: &str, texts: &[String]) -> Result<Vec<Self>> {
        let parse = |text: &String| Self::parse(text).with_context(|| format!("{flag} {text}"));
        let sources = texts.iter().map(parse).collect::<Result<Vec<_>>>()?;
        let keys: HashSet<&str> = sources.iter().map(|source| source.key).collect();
        ensure!(
            keys.len() == sources.len(),
            "{flag}: gives a key twice; keep one"
        );
        Ok(sources)
    }

    /// Reads `KEY=FROM` or `KEY=FROM:UNIT`.
    fn parse(text: &str) -> Result<Self> {
        let (key, from) = text.split_once('=').unwrap_or((text, ""));
        let known = KEYS.into_iter().find(|(known, _)| *known == key);
        let (key, si) = known.with_context(|| hint(key, &KEYS.map(|(key, _)| key)))?;
        let (from, unit) = from.rsplit_once(':').unwrap_or((from, si));
        ensure!(!from.is_empty(), "must be {key}=NAME or {key}=NAME:UNIT");
        let factor = factor(unit, si);
        Ok(Self {
            key,
            from: from.to_owned(),
            factor: factor.with_context(|| format!("{unit}: must be {si}, or with prefixes"))?,
            is_needed: true,
        })
    }
}

/// The factor from a unit to that of SI.
fn factor(unit: &str, si: &str) -> Option<f64> {
    const PREFIXES: [&str; 9] = ["", "n", "u", "µ", "μ", "m", "c", "k", "M"];
    const FACTORS: [f64; 9] = [1.0, 1e-9, 1e-6, 1e-6, 1e-6, 1e-3, 1e-2, 1e3, 1e6];
    if let (Some((above, below)), Some((of, over))) = (unit.split_once('/'), si.split_once('/')) {
        return Some(factor(above, of)? / factor(below, over)?);
    }
    let mut prefixes = PREFIXES.iter();
    let place = prefixes.position(|prefix| unit.strip_prefix(prefix) == Some(si));
    match (unit, si) {
        ("min", "s") => Some(60.0),
        ("h", "s") => Some(3600.0),
        _ => place.map(|place| FACTORS[place]),
    }
}

/// The rows of a file.
struct Table<'a> {
    columns: &'a [Source],
    settings: &'a [Source],
    rows: Vec<Row>,
}

#[derive(Clone, Debug)]
struct Row {
    /// Its line, or of Parquet its number, counted from 1.
    line: u64,
    /// Of its series.
    run: String,
    /// Those of [`PARAMETERS`].
    parameters: [Option<f64>; 4],
    onset: f64,
    /// NaN if it is not given.
    drop: f64,
    peak_force: f64,
}

impl<'a> Table<'a> {
    fn read(&mut self, bytes: &[u8]) -> Result<()> {
        if bytes.starts_with(b"PAR1") {
            self.read_parquet(bytes)?;
        } else {
            let text = str::from_utf8(bytes).context("is neither Parquet nor UTF-8 text")?;
            self.read_text(text.trim_start_matches('\u{feff}'))?;
        }
        ensure!(
            !self.rows.is_empty(),
            "has no slips below its names of columns"
        );
        Ok(())
    }

    fn read_text(&mut self, text: &str) -> Result<()> {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let names = lines.next().unwrap_or_default();
        let count = |delimiter: &u8| names.bytes().filter(|byte| byte == delimiter).count();
        let delimiter = b"\t;,".iter().copied().max_by_key(count).unwrap_or(b',');
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes());
        let names: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
        let places = self.places(&names)?;
        for record in reader.records() {
            let record = record?;
            let line = record.position().map_or(0, csv::Position::line);
            let [found, expected] = [record.len(), names.len()];
            ensure!(
                found == expected,
                "line {line}: has {found} cells for {expected} columns: cut off, or decimal commas between commas?"
            );
            let cell = |(_, place): &(&Source, usize)| match delimiter {
                b',' => record[*place].to_owned(),
                _ => record[*place].replace(',', "."),
            };
            let cells: Vec<String> = places.iter().map(cell).collect();
            self.add(line, &places, &cells)?;
        }
        Ok(())
    }

    fn read_parquet(&mut self, bytes: &[u8]) -> Result<()> {
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
        let bytes = Bytes::from(bytes.to_vec());
        let reader = ParquetRecordBatchReaderBuilder::try_new_with_options(bytes, options)?;
        let fields = reader.schema().fields().clone();
        let names: Vec<String> = fields.iter().map(|field| field.name().clone()).collect();
        let places = self.places(&names)?;
        for &(source, place) in &places {
            let kind = fields[place].data_type();
            let is_known = [DataType::Float64, DataType::Int64, DataType::Utf8].contains(kind);
            ensure!(
                is_known,
                "column {} is {kind}; save it as Float64",
                source.from
            );
        }
        let indices: Vec<usize> = places.iter().map(|(_, place)| *place).collect();
        for batch in reader.build()? {
            for cells in texts(&batch?.project(&indices)?) {
                self.add(self.rows.len() as u64 + 1, &places, &cells)?;
            }
        }
        Ok(())
    }

    /// The columns among these names, each with its place.
    fn places(&self, names: &[String]) -> Result<Vec<(&'a Source, usize)>> {
        let mut places = Vec::new();
        for source in self.columns {
            let place = names.iter().position(|name| *name == source.from);
            places.extend(place.map(|place| (source, place)));
            if place.is_none() && source.is_needed {
                let Source { key, from, .. } = source;
                let known: Vec<&str> = names.iter().map(String::as_str).collect();
                let hint = hint(from, &known);
                bail!("has no column {from}; {hint}, in --column {key}=NAME:UNIT");
            }
        }
        Ok(places)
    }

    fn add(&mut self, line: u64, columns: &[(&Source, usize)], cells: &[String]) -> Result<()> {
        let cells = columns.iter().map(|(source, _)| *source).zip(cells);
        let set = self.settings.iter().map(|source| (source, &source.from));
        let cells: Vec<(&Source, &String)> = cells.chain(set).collect();
        let row = Row::read(line, &cells).with_context(|| format!("line {line}"))?;
        self.rows.push(row);
        Ok(())
    }

    /// Stretches of rows of one run and with the same parameters, in which time goes on.
    fn series(self) -> Result<Vec<Vec<Row>>> {
        let mut runs = HashSet::new();
        let is_of_series =
            |row: &Row, next: &Row| row.run == next.run && row.parameters == next.parameters;
        for rows in self.rows.chunk_by(is_of_series) {
            let Row {
                line,
                run,
                parameters,
                ..
            } = &rows[0];
            let is_new = run.is_empty() || runs.insert(format!("{run} {parameters:?}"));
            ensure!(
                is_new,
                "line {line}: run {run} begins again; sort by run and onset"
            );
            let back = rows.windows(2).find(|pair| pair[0].onset >= pair[1].onset);
            if let Some([before, Row { line, onset, .. }]) = back {
                let before = before.onset;
                bail!(
                    "line {line}: onset {onset} s is not after {before} s above it; if a series begins here, name a column \
                     that says so, in --column run=NAME"
                );
            }
        }
        let series = self.rows.chunk_by(is_of_series).map(<[Row]>::to_vec);
        Ok(series.collect())
    }
}

impl Row {
    fn read(line: u64, cells: &[(&Source, &String)]) -> Result<Self> {
        let cell = |key: &str| cells.iter().find(|(source, _)| source.key == key);
        let number = |key: &str| {
            let Some((source, text)) = cell(key).filter(|(_, text)| !text.is_empty()) else {
                return Ok(None);
            };
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            let number = number.map(|number| number * source.factor);
            number
                .map(Some)
                .with_context(|| format!("{key} = {text}: must be a number"))
        };
        let onset = number(ONSET)?.context("onset: is empty")?;
        ensure!(
            onset >= 0.0,
            "onset = {onset} s: must be 0 or later; shift the times"
        );
        Ok(Self {
            line,
            run: cell(RUN).map_or_else(String::new, |(_, run)| (*run).clone()),
            parameters: parameters(&number)?,
            onset,
            drop: number(DROP)?.unwrap_or(f64::NAN),
            peak_force: number(PEAK_FORCE)?.unwrap_or(f64::NAN),
        })
    }
}

/// The parameters of a row with these numbers.
fn parameters(number: &dyn Fn(&str) -> Result<Option<f64>>) -> Result<[Option<f64>; 4]> {
    let mut found = [None; PARAMETERS.len()];
    for (found, symbol) in found.iter_mut().zip(PARAMETERS) {
        let mut value = number(symbol.key())?;
        if symbol == Symbol::T && value.is_none() {
            value = number(FREQUENCY)?.map(|frequency| 1.0 / frequency);
        }
        // The factor of a unit leaves a rounding error behind.
        *found = value.map(to_twelve_digits);
        if let Some(value) = *found {
            let allowed = symbol.description().allowed();
            let is_allowed = symbol.checked(Value::Real(value)).is_some();
            ensure!(is_allowed, "{} = {value}: must be {allowed}", symbol.key());
        }
    }
    let [velocity, _, amplitude, period] = &mut found;
    ensure!(
        velocity.is_some(),
        "V0 is missing: --column V0=NAME:UNIT, or --set V0=VALUE:UNIT"
    );
    let is_modulated = *amplitude.get_or_insert(0.0) > 0.0;
    ensure!(
        period.is_some() || !is_modulated,
        "Delta > 0: needs T or frequency"
    );
    *period = period.filter(|_| is_modulated);
    Ok(found)
}

/// The slips of a series, with phases against a maximum of the modulation at this time in s.
fn slips(rows: &[Row], maximum: f64) -> Vec<Slip> {
    let [velocity, _, amplitude, period] = rows[0].parameters;
    let modulation = Modulation {
        period,
        amplitude: amplitude.unwrap_or_default(),
    };
    let eta = modulation.eta(velocity.unwrap_or_default());
    let mut last = None;
    let slip = |(number, row): (u64, &Row)| {
        let interval = last.replace(row.onset).map(|last| row.onset - last);
        Slip {
            number,
            onset: row.onset,
            interval,
            modulation,
            periods: interval.and_then(|interval| modulation.periods(interval)),
            phase: period.map(|period| phase(row.onset - maximum, period, eta)),
            peak_force: row.peak_force,
            drop: row.drop,
            ..Slip::default()
        }
    };
    (0..).zip(rows).map(slip).collect()
}

/// The sections of a sweep of these series, with what is known of their slips.
fn rest_of_sweep(series: &[Vec<Row>]) -> String {
    let rows = || series.iter().flatten();
    let drops = rows().any(|row| !row.drop.is_nan()).then_some(DROP);
    let forces = rows()
        .any(|row| !row.peak_force.is_nan())
        .then_some(PEAK_FORCE);
    let columns: Array = drops.into_iter().chain(forces).collect();
    let is_modulated = rows().any(|row| row.parameters[3].is_some());
    let mut axes = String::new();
    for (place, symbol) in PARAMETERS.into_iter().enumerate() {
        let values = || series.iter().map(|rows| rows[0].parameters[place]);
        if values().any(|value| value.is_some()) && (is_modulated || !symbol.is_of_modulation()) {
            let or_none = |value: Option<f64>| value.map_or(Toml::from("none"), Toml::from);
            let values: Array = values().map(or_none).collect();
            axes += &format!("{} = {values}\n", symbol.key());
        }
    }
    let count = series.len();
    let most = series.iter().map(Vec::len).max().unwrap_or(1);
    format!(
        "columns = {columns}\n[axes.zip]\nseed = {{ count = {count} }}\n{axes}[record]\nslips = {most}\ndiscard = 0\n"
    )
}
