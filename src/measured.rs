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
use crate::sweep::{Job, MAX_NAME, Measured, Sweep, hint};
use crate::table::arrow::texts;
use crate::table::checksum::hexadecimal;
use crate::table::shown::shown;
use anyhow::{Context, Result, bail, ensure};
use arrow_schema::DataType;
use bytes::Bytes;
use csv::StringRecord;
use parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use toml_edit::{Array, Value as Toml};

/// What columns, or the command line, can give, and in which unit.
const KEYS: [(&str, &str); 10] = [
    ("onset", "s"),
    ("drop", "N"),
    ("peak_force", "N"),
    ("run", ""),
    ("V0", "m/s"),
    ("Kd", "N/m"),
    ("Delta", "m"),
    ("T", "s"),
    ("frequency", "Hz"),
    ("maximum", "s"),
];
const PARAMETERS: [Symbol; 4] = [Symbol::V0, Symbol::Kd, Symbol::Delta, Symbol::T];

/// What is to be read.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    pub files: &'a [PathBuf],
    /// `KEY=COLUMN:UNIT`, without a unit in SI. Other columns have the names of their keys.
    pub columns: &'a [String],
    /// `KEY=VALUE:UNIT`, for all rows.
    pub settings: &'a [String],
    /// The command that asks for it, as far as the directory of the results.
    pub command: &'a str,
}

/// A sweep with a job for each series, and the rows of each, by their seeds.
#[derive(Debug)]
pub struct Experiment {
    pub sweep: Sweep,
    series: Vec<Vec<Row>>,
}

impl Experiment {
    /// An error names the file, and the line if it is about one.
    pub fn read(request: Request<'_>) -> Result<Self> {
        let columns = parse_all("--column", request.columns)?;
        let settings = parse_all("--set", request.settings)?;
        let mut checksums = HashSet::new();
        let mut files = Array::new();
        let mut begins = Array::new();
        let mut series: Vec<Vec<Row>> = Vec::new();
        for path in request.files {
            let file = shown(path);
            let bytes = fs::read(path).with_context(|| file.to_string())?;
            let checksum = hexadecimal(&Sha256::digest(&bytes));
            let is_new = checksums.insert(checksum.clone());
            ensure!(
                is_new,
                "{file}: holds the same as a file before it; name it once"
            );
            files.push(format!("{checksum}  {file}"));
            let mut table = Table {
                columns: &columns,
                settings: &settings,
                series: Vec::new(),
            };
            table.read(bytes).with_context(|| file.to_string())?;
            let lines = table.series.iter().map(|rows| rows[0].line);
            begins.extend(lines.map(|line| format!("{file}:{line}")));
            series.extend(table.series);
        }
        let command = Toml::from(request.command);
        let name = sweep_name(&request.files[0]);
        let rest = rest_of_sweep(&series)?;
        let text = format!(
            "name = \"{name}\"\n[measured]\nfiles = {files}\nseries = {begins}\ncommand = {command}\n{rest}"
        );
        let sweep = Sweep::parse_made(&text, "files")?;
        Ok(Self { sweep, series })
    }

    /// What was measured of a job.
    pub fn measurements(&self, job: &Job) -> Measurements {
        let parameters = &job.parameters;
        let series = usize::try_from(parameters.seed).unwrap_or(usize::MAX);
        let modulation = Modulation {
            period: parameters.modulation_period,
            amplitude: parameters.modulation_amplitude,
        };
        let mut last = None;
        let slip = |(number, row): (u64, &Row)| {
            let onset = row.slip.onset;
            let interval = last.replace(onset).map(|last| onset - last);
            let phase_in = |period| phase(onset - row.maximum, period, parameters.eta());
            Slip {
                number,
                interval,
                modulation,
                periods: interval.and_then(|interval| modulation.periods(interval)),
                phase: modulation.period.map(phase_in),
                ..row.slip
            }
        };
        Measurements {
            slips: (0..).zip(&self.series[series]).map(slip).collect(),
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

/// A key, the column or text of its values, and the factor of their unit.
type Source<'a> = (&'static str, &'a str, f64);

/// Reads the texts of a flag.
fn parse_all<'a>(flag: &str, texts: &'a [String]) -> Result<Vec<Source<'a>>> {
    let parse = |text: &'a String| parse(text).with_context(|| format!("{flag} {text}"));
    let sources = texts.iter().map(parse).collect::<Result<Vec<_>>>()?;
    let keys: HashSet<&str> = sources.iter().map(|(key, ..)| *key).collect();
    ensure!(
        keys.len() == sources.len(),
        "{flag}: gives a key twice; keep one"
    );
    Ok(sources)
}

/// Reads `KEY=FROM` or `KEY=FROM:UNIT`.
fn parse(text: &str) -> Result<Source<'_>> {
    let (key, from) = text.split_once('=').unwrap_or((text, ""));
    let known = KEYS.into_iter().find(|(known, _)| *known == key);
    let (key, si) = known.with_context(|| hint(key, &KEYS.map(|(key, _)| key)))?;
    let (from, unit) = from.rsplit_once(':').unwrap_or((from, si));
    ensure!(!from.is_empty(), "must be {key}=NAME or {key}=NAME:UNIT");
    let factor = factor(unit, si);
    let factor = factor.with_context(|| format!("{unit}: must be {si}, or with prefixes"))?;
    Ok((key, from, factor))
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
    columns: &'a [Source<'a>],
    settings: &'a [Source<'a>],
    series: Vec<Vec<Row>>,
}

/// Columns by their keys, with their places and the factors of their units.
type Places = Vec<(&'static str, usize, f64)>;

#[derive(Clone, Debug)]
struct Row {
    /// Its line, counted from 1; of Parquet below one of names.
    line: u64,
    /// The run, and the parameters of [`PARAMETERS`].
    series: (String, [Option<f64>; 4]),
    /// Its onset, peak force and drop; NaN if they are not given.
    slip: Slip,
    /// The time of a maximum of the modulation, in s.
    maximum: f64,
}

impl Table<'_> {
    fn read(&mut self, bytes: Vec<u8>) -> Result<()> {
        let text = if bytes.starts_with(b"PAR1") {
            text_of_parquet(bytes)?
        } else {
            let text = String::from_utf8(bytes).ok();
            let text = text.context("is neither Parquet nor UTF-8 text; save it as UTF-8")?;
            // For the reader to count lines right.
            text.replace("\r\n", "\n") + "\n"
        };
        self.read_text(text.trim_start_matches('\u{feff}'))?;
        ensure!(
            !self.series.is_empty(),
            "has no slips below its names of columns"
        );
        Ok(())
    }

    fn read_text(&mut self, text: &str) -> Result<()> {
        let is_head = |line: &&str| line.starts_with('#') || line.trim().is_empty();
        let head = text.lines().take_while(is_head).count();
        let text: String = text.split_inclusive('\n').skip(head).collect();
        let names = text.lines().next().unwrap_or_default();
        let mut others = b"\t;".iter().copied();
        let other = others.find(|delimiter| names.as_bytes().contains(delimiter));
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(other.unwrap_or(b','))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes());
        let names: Vec<String> = reader.headers()?.iter().map(str::to_owned).collect();
        let places = self.places(&names)?;
        let point = if other.is_some() { "." } else { "," };
        let mut record = StringRecord::new();
        let mut last = head as u64 + 1;
        while reader.read_record(&mut record)? {
            let begin = last + 1;
            // The next one begins below it.
            last = head as u64 + reader.position().line() - 1;
            let is_broken = record.iter().any(|cell| cell.contains('\n'));
            ensure!(
                !is_broken,
                "line {begin}: a cell has several lines: is a quote left open?"
            );
            let [found, expected] = [record.len(), names.len()];
            ensure!(
                found == expected,
                "line {last}: {found} cells for {expected} columns: cut off, or decimal commas between commas?"
            );
            let mut cells: Vec<String> = record.iter().map(str::to_owned).collect();
            for &(_, place, _) in places.iter().filter(|place| place.0 != "run") {
                cells[place] = cells[place].replace(',', point);
            }
            let added = self.add(last, &places, &cells);
            added.with_context(|| format!("line {last}"))?;
        }
        Ok(())
    }

    /// The columns among these names that give a key, unless it is set.
    fn places(&self, names: &[String]) -> Result<Places> {
        let mut places = Vec::new();
        for (key, _) in KEYS {
            let asked = self.columns.iter().find(|column| column.0 == key);
            let (_, name, factor) = asked.copied().unwrap_or((key, key, 1.0));
            let mut found = (0..names.len()).filter(|&place| names[place] == name);
            let place = found.next();
            ensure!(
                found.next().is_none(),
                "has several columns {name}; rename one"
            );
            let is_set = self.settings.iter().any(|set| set.0 == key);
            ensure!(
                !is_set || place.is_none(),
                "has a column {name} beside --set {key}; keep one"
            );
            places.extend(place.map(|place| (key, place, factor)));
            if place.is_none() && (asked.is_some() || key == "onset") {
                let known: Vec<&str> = names.iter().map(String::as_str).collect();
                let hint = hint(name, &known);
                bail!("has no column {name}; {hint}, in --column {key}=NAME:UNIT");
            }
        }
        Ok(places)
    }

    fn add(&mut self, line: u64, places: &Places, cells: &[String]) -> Result<()> {
        let cells = places
            .iter()
            .map(|&(key, place, factor)| (key, &*cells[place], factor));
        let cells: Vec<_> = cells.chain(self.settings.iter().copied()).collect();
        let row = Row::read(line, &cells)?;
        let onset = row.slip.onset;
        let last = self.series.last_mut();
        let last = last.filter(|rows| rows[0].series == row.series);
        let Some(rows) = last else {
            let run = &row.series.0;
            let is_new =
                run.is_empty() || self.series.iter().all(|rows| rows[0].series != row.series);
            ensure!(
                is_new,
                "run {run} begins again: sort by run and onset, and give it one V0, Kd, Delta and T"
            );
            self.series.push(vec![row]);
            return Ok(());
        };
        let before = rows.last().map_or(-1.0, |row| row.slip.onset);
        ensure!(
            onset > before,
            "onset {onset} s is not after {before} s above it; where series begin, a column must say so: --column run=NAME"
        );
        rows.push(row);
        Ok(())
    }
}

/// The columns of numbers and texts of a Parquet file as CSV.
fn text_of_parquet(bytes: Vec<u8>) -> Result<String> {
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let reader =
        ParquetRecordBatchReaderBuilder::try_new_with_options(Bytes::from(bytes), options)?;
    let fields = reader.schema().fields().clone();
    let kinds = [DataType::Float64, DataType::Int64, DataType::Utf8];
    let is_read = |place: &usize| kinds.contains(fields[*place].data_type());
    let places: Vec<usize> = (0..fields.len()).filter(is_read).collect();
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(places.iter().map(|place| fields[*place].name()))?;
    for batch in reader.build()? {
        for cells in texts(&batch?.project(&places)?) {
            writer.write_record(cells)?;
        }
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}

impl Row {
    fn read(line: u64, cells: &[Source<'_>]) -> Result<Self> {
        let cell = |key: &str| cells.iter().find(|cell| cell.0 == key);
        let is_given = |text: &str| !["", "-", "NA"].contains(&text);
        let number = |key: &str| {
            let Some((_, text, factor)) = cell(key).filter(|cell| is_given(cell.1)) else {
                return Ok(None);
            };
            let number = text
                .trim()
                .parse::<f64>()
                .ok()
                .map(|number| number * factor);
            let number = number.filter(|number| number.is_finite());
            number
                .map(Some)
                .with_context(|| format!("{key} = {text}: must be a number"))
        };
        let onset = number("onset")?.context("onset: is empty")?;
        ensure!(
            onset >= 0.0,
            "onset = {onset} s: must be 0 or later; shift the times"
        );
        let run = cell("run").map_or_else(String::new, |cell| cell.1.to_owned());
        Ok(Self {
            line,
            series: (run, parameters(&number)?),
            slip: Slip {
                onset,
                drop: number("drop")?.unwrap_or(f64::NAN),
                peak_force: number("peak_force")?.unwrap_or(f64::NAN),
                ..Slip::default()
            },
            maximum: number("maximum")?.unwrap_or(0.0),
        })
    }
}

/// The parameters of a row with these numbers.
fn parameters(number: &dyn Fn(&str) -> Result<Option<f64>>) -> Result<[Option<f64>; 4]> {
    let mut found = [None; PARAMETERS.len()];
    for (found, symbol) in found.iter_mut().zip(PARAMETERS) {
        // The factor of a unit leaves a rounding error behind.
        *found = number(symbol.key())?.map(to_twelve_digits);
        let frequency = number("frequency")?.filter(|frequency| *frequency != 0.0);
        if let Some(frequency) = frequency.filter(|_| symbol == Symbol::T) {
            ensure!(found.is_none(), "T and frequency are given; keep one");
            *found = Some(1.0 / to_twelve_digits(frequency));
        }
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

/// The name of a file without its ending, as far as a sweep can be called so.
fn sweep_name(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let allowed = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
    let name = stem.replace(|letter| !allowed(letter), "-");
    let name = name.trim_matches('-');
    let end = name.len().min(MAX_NAME);
    if name.is_empty() {
        "measured".to_owned()
    } else {
        name[..end].to_owned()
    }
}

/// The sections of a sweep of these series, with what is known of their slips.
fn rest_of_sweep(series: &[Vec<Row>]) -> Result<String> {
    let rows = || series.iter().flatten();
    let drops = rows().any(|row| !row.slip.drop.is_nan()).then_some("drop");
    let forces = rows()
        .any(|row| !row.slip.peak_force.is_nan())
        .then_some("peak_force");
    let columns: Array = drops.into_iter().chain(forces).collect();
    let is_modulated = rows().any(|row| row.series.1[3].is_some());
    let mut axes = String::new();
    for (place, symbol) in PARAMETERS.into_iter().enumerate() {
        let values = || series.iter().map(|rows| rows[0].series.1[place]);
        let is_of_all = symbol == Symbol::T || values().all(|value| value.is_some());
        let is_of_none = values().all(|value| value.is_none());
        ensure!(
            is_of_all || is_of_none,
            "{} of some series is missing",
            symbol.key()
        );
        if !is_of_none && (is_modulated || !symbol.is_of_modulation()) {
            let or_none = |value: Option<f64>| value.map_or(Toml::from("none"), Toml::from);
            let values: Array = values().map(or_none).collect();
            axes.extend([symbol.key(), " = ", &values.to_string(), "\n"]);
        }
    }
    let count = series.len();
    let most = series.iter().map(Vec::len).max().unwrap_or(1);
    Ok(format!(
        "columns = {columns}\n[axes.zip]\nseed = {{ count = {count} }}\n{axes}[record]\nslips = {most}\ndiscard = 0\n"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_prefixes_and_times_minutes_and_hours() {
        let factors = [
            ("ms", "s", 1e-3),
            ("min", "s", 60.0),
            ("h", "s", 3600.0),
            ("µm/s", "m/s", 1e-6),
            ("mm/min", "m/s", 1e-3 / 60.0),
            ("N/um", "N/m", 1e6),
            ("kHz", "Hz", 1e3),
            ("", "", 1.0),
        ];
        for (unit, si, expected) in factors {
            let found = factor(unit, si).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-12, "{unit}: {found}");
        }
        for (unit, si) in [("N", "s"), ("m", "m/s"), ("m/s", "m"), ("furlong", "m")] {
            assert_eq!(factor(unit, si), None, "{unit}");
        }
    }
}
