//! Measured slips: tables of an experiment become a sweep whose jobs are looked up, not computed.
//!
//! ```text
//! tables -> rows -> series -> a sweep with a job for each, and their slips
//! traces -> rows
//! ```
//!
//! `keys.rs`: what gives a key; `files.rs`: Parquet and CSV; `rows.rs`: typed columns; `trace.rs`: rows of the slips in a trace; `series.rs`: stretches of rows
//! of one run and with the same parameters, whose numbers are seeds. Contract: the statistics of measured slips are
//! those of the model's, by the same code. Nothing is guessed: what is not understood is refused with its place. Ids
//! follow from what was read, not from where it lay.

mod files;
mod keys;
mod rows;
mod series;
mod trace;

pub use files::{Compared, compare_files};
pub use keys::{Given, Sources};
pub use trace::{DropSizes, Excerpt, NoPlateau, TraceRequest, stretch};

use crate::model::Symbol;
use crate::model::theory::to_twelve_digits;
use crate::observe::{MakesSlips, Measurements, Modulation, Slip, phase};
use crate::solver::Summary;
use crate::sweep::{Job, MAX_NAME, SourceFile, Sweep};
use crate::table::checksum::hexadecimal;
use crate::table::shown::shown;
use crate::table::value::Shortest;
use anyhow::{Context, Result, bail};
use files::SourceTable;
use keys::Key;
use rows::Rows;
use series::{PARAMETERS, Series, series_of};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml_edit::{Array, Value as Toml};

/// Slips from which two series that are equal are one.
const MIN_TWIN: usize = 10;
/// Relative bias of a mean interval that matters.
const BIAS: f64 = 0.01;

/// How tables are to be read.
#[derive(Clone, Debug, Default)]
pub struct Request {
    pub sources: Sources,
    /// Whether numbers of texts have decimal commas.
    pub decimal_comma: bool,
    /// The flags that say so, as a shell takes them.
    pub options: String,
    /// How slips are found, if rows are samples.
    pub trace: Option<TraceRequest>,
}

/// A sweep with a job for each series, and their rows.
#[derive(Debug)]
pub struct Experiment {
    pub sweep: Sweep,
    slips: Arc<SlipColumns>,
    series: Vec<Series>,
    /// What was read, each with its heading.
    pub read: Vec<(String, String)>,
    /// Of a trace.
    pub drop_sizes: Option<DropSizes>,
}

/// Numbers of slips, each list empty if no table has them, NaN where one is missing.
#[derive(Debug, Default)]
struct SlipColumns {
    onsets: Vec<f64>,
    drops: Vec<f64>,
    peak_forces: Vec<f64>,
    /// Times of a maximum of the modulation.
    maxima: Vec<f64>,
}

impl SlipColumns {
    fn of_keys(&mut self) -> [(Key, &mut Vec<f64>); 4] {
        [
            (Key::Onset, &mut self.onsets),
            (Key::Drop, &mut self.drops),
            (Key::PeakForce, &mut self.peak_forces),
            (Key::Maximum, &mut self.maxima),
        ]
    }

    fn add(&mut self, rows: &mut Rows) {
        let before = self.onsets.len();
        let count = before + rows.count;
        for (key, all) in self.of_keys() {
            let mut columns = rows.columns.iter_mut();
            let own = columns.find(|column| column.given.key == key);
            let own = own.map(|column| std::mem::take(&mut column.numbers));
            if own.is_some() || !all.is_empty() {
                all.resize(before, f64::NAN);
                all.extend(own.unwrap_or_default());
                all.resize(count, f64::NAN);
            }
        }
    }

    /// The numbers of a series, bit by bit.
    fn bits<'a>(column: &'a [f64], series: &Series) -> impl Iterator<Item = u64> + use<'a> {
        let numbers = column.get(series.rows.clone()).unwrap_or_default();
        numbers.iter().map(|number| number.to_bits())
    }
}

impl Experiment {
    /// Reads files. An error names the file, and the line if it is about one; [`NoPlateau`] is one of a trace.
    pub fn read(paths: &[PathBuf], request: &Request) -> Result<Self> {
        let mut files = Vec::new();
        let mut tables = Vec::new();
        for path in paths {
            let name = shown(path).to_string();
            let (table, file) = files::open(path).with_context(|| name.clone())?;
            tables.push((name.clone(), table));
            files.push(SourceFile { name, ..file });
        }
        Self::of_tables(&tables, &files, &sweep_name(&paths[0]), request)
    }

    /// Reads a table that a program has at hand, as a stream in Arrow's own format.
    pub fn read_stream(stream: Vec<u8>, request: &Request) -> Result<Self> {
        let table = ("table".to_owned(), SourceTable::Stream(stream));
        Self::of_tables(&[table], &[], "measured", request)
    }

    fn of_tables(
        tables: &[(String, SourceTable)],
        files: &[SourceFile],
        name: &str,
        request: &Request,
    ) -> Result<Self> {
        let mut reading = Reading::default();
        if let Some(trace) = &request.trace {
            let traced = trace::find(tables, request, trace)?;
            reading.columns = traced.columns;
            reading.found = traced.found;
            reading.drop_sizes = Some(traced.sizes);
            for ((name, _), rows) in tables.iter().zip(traced.rows) {
                reading.add(name, rows).with_context(|| name.clone())?;
            }
        } else {
            for (name, table) in tables {
                let rows = table.rows(&request.sources, request.decimal_comma);
                let added = rows.and_then(|rows| reading.add(name, rows));
                added.with_context(|| name.clone())?;
            }
        }
        reading.finish(files, name, request)
    }

    /// What was measured of a job.
    pub fn measurements(&self, job: &Job) -> Measurements {
        let parameters = &job.parameters;
        let series = usize::try_from(parameters.seed).unwrap_or(usize::MAX);
        let series = &self.series[series];
        Measurements {
            made: Some(Arc::new(SlipsOfSeries {
                slips: Arc::clone(&self.slips),
                rows: series.rows.clone(),
                modulation: Modulation {
                    period: parameters.modulation_period.filter(|_| series.has_phases()),
                    amplitude: parameters.modulation_amplitude,
                },
                eta: parameters.eta(),
            })),
            summary: Summary {
                // A record that is known to end cuts an interval, as `max_time` does.
                satisfied: series.end.is_none(),
                ..Summary::default()
            },
            ..Measurements::default()
        }
    }
}

/// The slips of a series under its modulation.
#[derive(Debug)]
struct SlipsOfSeries {
    slips: Arc<SlipColumns>,
    rows: Range<usize>,
    modulation: Modulation,
    eta: f64,
}

impl MakesSlips for SlipsOfSeries {
    fn count(&self) -> usize {
        self.rows.len()
    }

    fn slip(&self, place: usize) -> Slip {
        let slips = &self.slips;
        let row = self.rows.start + place;
        let number = |column: &[f64]| column.get(row).copied().unwrap_or(f64::NAN);
        let onset = slips.onsets[row];
        let interval = (place > 0).then(|| onset - slips.onsets[row - 1]);
        let maximum = number(&slips.maxima);
        let maximum = if maximum.is_nan() { 0.0 } else { maximum };
        let phase_in = |period| phase(onset - maximum, period, self.eta);
        Slip {
            number: place as u64,
            onset,
            interval,
            modulation: self.modulation,
            periods: interval.and_then(|interval| self.modulation.periods(interval)),
            phase: self.modulation.period.map(phase_in),
            drop: number(&slips.drops),
            peak_force: number(&slips.peak_forces),
            ..Slip::default()
        }
    }
}

/// What has been read of some tables.
#[derive(Debug, Default)]
struct Reading {
    slips: SlipColumns,
    series: Vec<Series>,
    /// The column of each key, and the range of its numbers.
    columns: Vec<(Given, [f64; 2])>,
    unused: Vec<String>,
    /// Of a trace, as of [`Experiment`].
    found: Vec<(String, String)>,
    drop_sizes: Option<DropSizes>,
}

impl Reading {
    fn add(&mut self, table: &str, mut rows: Rows) -> Result<()> {
        let first = self.slips.onsets.len();
        let own = series_of(&rows)?.into_iter().map(|series| Series {
            rows: first + series.rows.start..first + series.rows.end,
            place: format!("{table}, {}", series.place),
            ..series
        });
        self.series.extend(own);
        for column in rows.columns.iter().filter(|column| column.place.is_some()) {
            self.note(&column.given, &column.numbers);
        }
        self.unused.append(&mut rows.unused);
        self.slips.add(&mut rows);
        Ok(())
    }

    fn note(&mut self, given: &Given, numbers: &[f64]) {
        let mut known = self.columns.iter_mut();
        let widen = |range: [f64; 2], number: &f64| [range[0].min(*number), range[1].max(*number)];
        let unbounded = [f64::INFINITY, f64::NEG_INFINITY];
        if let Some((_, range)) = known.find(|(known, _)| known.key == given.key) {
            *range = numbers.iter().fold(*range, widen);
        } else {
            let range = numbers.iter().fold(unbounded, widen);
            self.columns.push((given.clone(), range));
        }
    }

    fn finish(mut self, files: &[SourceFile], name: &str, request: &Request) -> Result<Experiment> {
        self.refuse_twins()?;
        let names: Array = files.iter().map(|file| &*file.name).collect();
        let lengths: Array = files.iter().map(|file| file.bytes.cast_signed()).collect();
        let checksums: Array = files.iter().map(|file| &*file.sha256).collect();
        let begins: Array = self.series.iter().map(|series| &*series.place).collect();
        let options = Toml::from(&*request.options);
        let rows = self.checksum();
        let mut rest = self.rest_of_sweep(&request.sources)?;
        if request.trace.is_some() && self.series.len() == 1 {
            let [columns, settings] = request.sources.flags();
            let decimal_comma = request.decimal_comma;
            rest = format!(
                "trace = {columns}\nsettings = {settings}\ncommas = {decimal_comma}\n{rest}"
            );
        }
        let text = format!(
            "name = \"{name}\"\n[measured]\nfiles = {names}\nbytes = {lengths}\nsha256 = {checksums}\n\
             rows = \"{rows}\"\noptions = {options}\nseries = {begins}\n{rest}"
        );
        let sweep = Sweep::parse_made(&text, "tables")?;
        let drop_sizes = self.drop_sizes.take();
        Ok(Experiment {
            drop_sizes,
            read: self.in_words(&sweep, &request.sources),
            sweep,
            slips: Arc::new(self.slips),
            series: self.series,
        })
    }

    /// The checksum of the slips of all series, on which ids depend.
    fn checksum(&self) -> String {
        let mut hasher = Sha256::new();
        let SlipColumns {
            onsets,
            drops,
            peak_forces,
            maxima,
        } = &self.slips;
        for series in &self.series {
            hasher.update(series.rows.len().to_le_bytes());
            hasher.update(series.end.unwrap_or(f64::NAN).to_bits().to_le_bytes());
            for column in [onsets, drops, peak_forces, maxima] {
                SlipColumns::bits(column, series)
                    .for_each(|bits| hasher.update(bits.to_le_bytes()));
            }
        }
        hexadecimal(&hasher.finalize())
    }

    /// Refuses series that are the same slips twice, as onsets and drops say. Without drops they may be others, read
    /// with the same coarse clock, and regular ones are equal anyway.
    fn refuse_twins(&self) -> Result<()> {
        let mut seen = HashMap::new();
        for series in &self.series {
            let drops = self
                .slips
                .drops
                .get(series.rows.clone())
                .unwrap_or_default();
            let has_drops = drops.iter().any(|drop| !drop.is_nan());
            let is_short = series.rows.len() < MIN_TWIN;
            if is_short || !has_drops || series.is_regular(&self.slips.onsets) {
                continue;
            }
            let onsets = SlipColumns::bits(&self.slips.onsets, series);
            let numbers: Vec<u64> = onsets
                .chain(SlipColumns::bits(&self.slips.drops, series))
                .collect();
            if let Some(twin) = seen.insert(numbers, &series.place) {
                let place = &series.place;
                bail!(
                    "{place}: a series begins with the onsets and drops of that at {twin}; the same slips count once"
                );
            }
        }
        Ok(())
    }

    /// The sections of a sweep of these series, with what is known of their slips.
    fn rest_of_sweep(&self, sources: &Sources) -> Result<String> {
        let is_known = |column: &[f64]| column.iter().any(|number| !number.is_nan());
        let drop = is_known(&self.slips.drops).then_some("drop");
        let force = is_known(&self.slips.peak_forces).then_some("peak_force");
        let known: Array = drop.into_iter().chain(force).collect();
        let is_pure = sources.all().any(Given::is_pure);
        let pure: Array = drop.filter(|_| is_pure).into_iter().collect();
        let series = &self.series;
        let is_modulated = series.iter().any(|series| series.period().is_some());
        let mut axes = String::new();
        for (place, symbol) in PARAMETERS.into_iter().enumerate() {
            let values = || series.iter().map(|series| series.parameters[place]);
            let is_of_none = values().all(|value| value.is_none());
            if is_of_none || (symbol.is_of_modulation() && !is_modulated) {
                continue;
            }
            let key = symbol.key();
            let lacks = values().position(|value| value.is_none());
            if let Some(lacks) = lacks.filter(|_| symbol != Symbol::T) {
                bail!(
                    "{}: {key} is missing, and others have it",
                    series[lacks].place
                );
            }
            let or_none = |value: Option<f64>| value.map_or(Toml::from("none"), Toml::from);
            let values: Array = values().map(or_none).collect();
            axes.extend([key, " = ", &values.to_string(), "\n"]);
        }
        let count = series.len();
        let most = series.iter().map(|series| series.rows.len()).max();
        let most = most.unwrap_or(1);
        Ok(format!(
            "columns = {known}\npure = {pure}\n[axes.zip]\nseed = {{ count = {count} }}\n{axes}\
             [record]\nslips = {most}\ndiscard = 0\n"
        ))
    }

    fn in_words(&self, sweep: &Sweep, sources: &Sources) -> Vec<(String, String)> {
        let column = |(given, [low, high]): &(Given, [f64; 2])| {
            let Given {
                key, from, unit, ..
            } = given;
            let si = key.unit();
            let [low, high] = [low, high].map(|end| Shortest(to_twelve_digits(*end)));
            let range = format!(" ({unit}), {low} to {high} {si}");
            let range = if *key == Key::Run {
                String::new()
            } else {
                range
            };
            (key.word().to_owned(), format!("column {from}{range}"))
        };
        let setting = |set: &Given| {
            (
                set.key.word().to_owned(),
                format!("{} {}", set.from, set.unit),
            )
        };
        let columns = self.columns.iter().map(column);
        let mut words: Vec<_> = columns
            .chain(sources.settings.iter().map(setting))
            .collect();
        words.extend_from_slice(&self.found);
        let mut add = |head: &str, text: String| words.push((head.to_owned(), text));
        let uncertainties = self.series.iter().filter_map(|series| series.uncertainty);
        if let Some(most) = uncertainties.max_by(f64::total_cmp) {
            let count = self.series.iter().filter(|series| !series.has_phases());
            let lost = match count.count() {
                0 => String::new(),
                count => format!("; more than T/10 in {count} series, whose R and excess are null"),
            };
            let most = trace::short(most);
            add(
                "onsets",
                format!("known to {most} s, the largest median of a series{lost}"),
            );
        }
        if !self.unused.is_empty() {
            add("not used", self.unused.join(", "));
        }
        if sweep.unknown().contains(&Symbol::Delta) {
            let unknown = "not given: eta, the drive alone and the excess are not known";
            add("Delta", unknown.to_owned());
        }
        let slips = self.slips.onsets.len();
        let series = self.series.len();
        if slips > series && self.series.iter().all(|series| series.end.is_none()) {
            let intervals = (slips - series) as f64 / series as f64;
            let variation = (BIAS * intervals).sqrt();
            let percent = 100.0 * BIAS;
            let cut = format!(
                "not given: the interval that the end of a record cuts counts for nothing; from a coefficient of \
                 variation of {variation:.2} on this makes the mean interval more than {percent} % too short"
            );
            add("end", cut);
        }
        add("series", series.to_string());
        add("slips", slips.to_string());
        words
    }
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
