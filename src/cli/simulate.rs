//! `stickslip simulate`: one job, everything visible.
//!
//! The flags are turned into the text of a sweep with one point, so that values, messages and the id of the job are those
//! of a sweep file.

use super::exit::{Exit, UsageError};
use super::output;
use anyhow::{Context, Result, anyhow};
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;
use stickslip::figure::{self, Picture};
use stickslip::model::{ContactEvent, Parameters, Symbol, Value};
use stickslip::observe::{AttachedMap, ContactLog, MapRow, SlipObserver, Together, Trace, TraceRow};
use stickslip::run::{limits, measured};
use stickslip::solver::{self, Observer};
use stickslip::store::columns::Table;
use stickslip::store::dataset::{Footer, TableWriter};
use stickslip::store::storage::Disk;
use stickslip::store::tables::{JobLabel, JobResult, SlipRow};
use stickslip::store::{records, tables};
use stickslip::sweep::{Sweep, SweepError, predicted_interval};

/// Simulate one realisation and show what it does
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip simulate --slips 20
  stickslip simulate --set Delta=1e-6 --set frequency=58 --time 2 --plot slips.png
  stickslip simulate --set dfs=0 --slips 1 --contacts contacts.parquet

Every key of the model can be set: N Ns M K Kd k fs dfs tau_r gamma V0 Delta T FN L break_on seed, in SI
units; and eta or frequency (Hz) in place of T.")]
pub struct Arguments {
    /// Set a parameter of the model; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Record so many slips past start-up [default: 20, unless --time is given]
    #[arg(long, value_parser = count, allow_negative_numbers = true, value_name = "N")]
    slips: Option<u64>,
    /// End at this model time, in s
    #[arg(long, value_parser = number, allow_negative_numbers = true, value_name = "SECONDS")]
    time: Option<String>,
    /// Slips discarded as start-up
    #[arg(long, value_parser = count, allow_negative_numbers = true, value_name = "N", default_value_t = 5)]
    discard: u64,
    /// Fail after so many contact events
    #[arg(long, value_parser = count, allow_negative_numbers = true, value_name = "N")]
    max_events: Option<u64>,
    /// Least breaks of a precursor [default: Ns]
    #[arg(long, value_parser = count, allow_negative_numbers = true, value_name = "N")]
    precursor_size: Option<u64>,
    /// Look for drops of the shear force of at least so many newtons
    #[arg(long, value_parser = number, allow_negative_numbers = true, value_name = "NEWTONS")]
    drop_size: Option<String>,
    /// Method
    #[arg(long, value_enum, default_value_t = Method::EventDriven)]
    solver: Method,
    /// Tolerance of the event-driven solver, relative to fs/k
    #[arg(long, value_parser = number, allow_negative_numbers = true, value_name = "X")]
    tolerance: Option<String>,
    /// Step of the fixed-step solver, in s
    #[arg(long, value_parser = number, allow_negative_numbers = true, value_name = "SECONDS")]
    dt: Option<String>,
    /// Write shear force, displacement and attached fraction over time, as Parquet
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Write the attached fraction of every block over time, as Parquet
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Write every contact event, as Parquet
    #[arg(long, value_name = "FILE")]
    contacts: Option<PathBuf>,
    /// Write the slips with the columns of a sweep, as Parquet
    #[arg(long, value_name = "FILE")]
    slip_table: Option<PathBuf>,
    /// Draw the shear force and the attached fraction, as .svg or .png
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Time between samples of trace, map and plot, in s
    #[arg(long, value_parser = real, allow_negative_numbers = true, value_name = "SECONDS", default_value_t = 1e-4)]
    sample: f64,
    /// First instant of the plot, in s
    #[arg(long, value_parser = real, allow_negative_numbers = true, value_name = "SECONDS", default_value_t = 0.0)]
    from: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    EventDriven,
    FixedStep,
}

/// Version of [`Report`] as JSON.
const FORMAT: u32 = 1;
/// More samples than this, of 24 bytes each, are a mistake.
const MOST_SAMPLES: f64 = 1e8;

#[derive(Serialize)]
struct Report {
    format: u32,
    job_id: String,
    simulated_seconds: f64,
    slips: usize,
    mean_interval_seconds: Option<f64>,
    mean_friction_newtons: Option<f64>,
    breaks: u64,
    reattachments: u64,
    ruptures: u64,
    steps: u64,
    leaps: u64,
    wall_seconds: f64,
}

fn count(text: &str) -> Result<u64, &'static str> {
    text.parse().map_err(|_| "must be a whole number >= 0")
}

fn real(text: &str) -> Result<f64, &'static str> {
    text.parse().map_err(|_| "must be a number")
}

/// A number in the form that a sweep file takes.
fn number(text: &str) -> Result<String, &'static str> {
    if let Ok(whole) = text.parse::<i128>() {
        return Ok(whole.to_string());
    }
    real(text).map(|real| if real.is_nan() { "nan".to_owned() } else { format!("{real:?}") })
}

pub fn simulate(arguments: &Arguments) -> Result<Exit> {
    let sweep = Sweep::parse(&as_sweep(arguments)?, Path::new("flags")).map_err(as_flags)?;
    let job = sweep.jobs().next().ok_or_else(|| UsageError("the flags name no job".to_owned()))?;
    let parameters = &job.parameters;
    check_outputs(arguments, &sweep, parameters)?;

    let mut slips = SlipObserver::new(parameters, sweep.recording());
    let mut trace = Trace::new(parameters, arguments.sample);
    let mut map = AttachedMap::new(parameters, arguments.sample);
    let mut log = ContactLog::default();
    let mut others: Vec<&mut dyn Observer> = Vec::new();
    let plots = arguments.plot.is_some();
    if plots || arguments.trace.is_some() {
        others.push(&mut trace);
    }
    if plots || arguments.map.is_some() {
        others.push(&mut map);
    }
    if arguments.contacts.is_some() {
        others.push(&mut log);
    }
    let never = AtomicBool::new(false);
    let begin = Instant::now();
    let mut observer = Together { lead: &mut slips, others };
    let summary = solver::simulate(parameters, sweep.solver(), limits(sweep.recording(), &never), &mut observer)?;
    let wall = begin.elapsed().as_secs_f64();
    let result = measured(slips, summary);

    let footer = Footer::default().with_sweep(&sweep).with("parameters", &as_json(parameters));
    write_records(arguments, &footer, &trace.rows, &map.rows, &log.events)?;
    let label = JobLabel {
        job_id: sweep.job_id(parameters).to_string(),
        set_id: sweep.set_id(parameters).to_string(),
        parameters: parameters.clone(),
    };
    if let Some(path) = &arguments.slip_table {
        let rows = result.slips.iter().map(|slip| SlipRow { job: &label, slip });
        write_table(path, tables::slips(), &footer, rows)?;
    }
    if let Some(path) = &arguments.plot {
        write_picture(path, &draw(parameters, &trace.rows, &map.rows, arguments.from)?)?;
    }
    report(arguments.json, &label, &result, wall)?;
    Ok(Exit::Done)
}

/// The flags as the text of a sweep with one point.
fn as_sweep(arguments: &Arguments) -> Result<String> {
    let (mut model, mut axes) = (String::new(), String::new());
    let mut keys = Vec::new();
    for setting in &arguments.settings {
        let (key, value) = setting
            .split_once('=')
            .ok_or_else(|| UsageError(format!("--set {setting}: must be KEY=VALUE, such as --set V0=1e-5")))?;
        let (key, value) = (key.trim(), value.trim());
        if keys.contains(&key) {
            return Err(UsageError(format!("--set {setting}: {key} is set before; keep one")).into());
        }
        keys.push(key);
        // A word such as tension needs quotes in a sweep file.
        let written = number(value).unwrap_or_else(|_| format!("{value:?}"));
        if matches!(key, "eta" | "frequency") {
            writeln!(axes, "{key} = [{written}]")?;
        } else if Symbol::from_key(key).is_some() {
            writeln!(model, "{key} = {written}")?;
        } else {
            let known: Vec<&str> = Symbol::ALL.iter().map(|symbol| symbol.key()).collect();
            let known = known.join(" ");
            return Err(UsageError(format!("--set {key}: no such key; there are {known}, eta, frequency")).into());
        }
    }
    // With a time alone, slips do not end the run.
    let slips = arguments.slips.unwrap_or(if arguments.time.is_some() { 1_000_000_000 } else { 20 });
    let optional =
        |key: &str, value: Option<String>| value.map_or_else(String::new, |value| format!("{key} = {value}\n"));
    let limits = [
        optional("max_time", arguments.time.clone()),
        optional("max_events", arguments.max_events.map(|events| events.to_string())),
        optional("precursor_size", arguments.precursor_size.map(|size| size.to_string())),
        optional("drop_size", arguments.drop_size.clone()),
    ]
    .concat();
    let solver = match (arguments.solver, &arguments.tolerance, &arguments.dt) {
        (Method::EventDriven, tolerance, None) => {
            format!("method = \"event-driven\"\n{}", optional("tolerance", tolerance.clone()))
        }
        (Method::FixedStep, None, Some(dt)) => format!("method = \"fixed-step\"\ndt = {dt}\n"),
        (Method::FixedStep, None, None) => "method = \"fixed-step\"\ndt = 1e-6\n".to_owned(),
        (Method::EventDriven, _, Some(_)) => {
            return Err(UsageError("--dt: goes with --solver fixed-step".to_owned()).into());
        }
        (Method::FixedStep, Some(_), _) => {
            return Err(UsageError("--tolerance: goes with --solver event-driven; use --dt".to_owned()).into());
        }
    };
    Ok(format!(
        "name = \"simulate\"\n[model]\n{model}[axes]\n{axes}[record]\nslips = {slips}\ndiscard = {}\n{limits}[solver]\n{solver}",
        arguments.discard
    ))
}

/// A message about the sweep text, told of the flags.
fn as_flags(error: SweepError) -> anyhow::Error {
    match error {
        SweepError::Invalid { problem, .. } => UsageError(format!("in the flags: {problem}")).into(),
        unreadable @ SweepError::Unreadable { .. } => unreadable.into(),
    }
}

/// Refuses what could not be written, before anything runs.
fn check_outputs(arguments: &Arguments, sweep: &Sweep, parameters: &Parameters) -> Result<()> {
    let sample = arguments.sample;
    if !(sample > 0.0 && sample.is_finite()) {
        return Err(UsageError(format!("--sample {sample}: must be a finite number > 0, in s")).into());
    }
    if !(arguments.from >= 0.0 && arguments.from.is_finite()) {
        return Err(UsageError(format!("--from {}: must be a finite number >= 0, in s", arguments.from)).into());
    }
    let recording = sweep.recording();
    let longest = recording.max_time.unwrap_or(f64::INFINITY);
    if arguments.plot.is_some() && arguments.from >= longest {
        let problem = format!("--from {}: must lie before the end, --time {longest}", arguments.from);
        return Err(UsageError(problem).into());
    }
    let cells = match arguments {
        Arguments { map: None, plot: None, trace: None, .. } => 0,
        Arguments { map: None, plot: None, .. } => 1,
        _ => parameters.blocks,
    };
    let slips = recording.slips as f64 + recording.discard as f64;
    let time = (slips * predicted_interval(parameters)).min(longest);
    if time / sample * cells as f64 > MOST_SAMPLES {
        let problem =
            format!("--sample {sample}: more than {MOST_SAMPLES:e} samples in about {time:.3} s; take a longer one");
        return Err(UsageError(problem).into());
    }
    if let Some(path) = &arguments.plot
        && !matches!(path.extension().and_then(|extension| extension.to_str()), Some("svg" | "png"))
    {
        return Err(UsageError(format!("--plot {}: must end in .svg or .png", path.display())).into());
    }
    let outputs = [
        ("--trace", &arguments.trace),
        ("--map", &arguments.map),
        ("--contacts", &arguments.contacts),
        ("--slip-table", &arguments.slip_table),
        ("--plot", &arguments.plot),
    ];
    let mut paths = Vec::new();
    for (flag, path) in outputs.into_iter().filter_map(|(flag, path)| Some((flag, path.as_ref()?))) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        // A device is not to be replaced by a file.
        if !folder.is_dir() || (path.exists() && !path.is_file()) {
            let path = path.display();
            let problem = format!("{flag} {path}: cannot be written; its folder must exist, and it must be a file");
            return Err(UsageError(problem).into());
        }
        if paths.contains(&path) {
            let problem = format!("{flag} {}: another flag writes this file, too; give each its own", path.display());
            return Err(UsageError(problem).into());
        }
        paths.push(path);
    }
    Ok(())
}

fn write_records(
    arguments: &Arguments,
    footer: &Footer,
    trace: &[TraceRow],
    map: &[MapRow],
    events: &[ContactEvent],
) -> Result<()> {
    if let Some(path) = &arguments.trace {
        write_table(path, records::trace(), footer, trace.iter().copied())?;
    }
    if let Some(path) = &arguments.map {
        write_table(path, records::map(), footer, map.iter().copied())?;
    }
    if let Some(path) = &arguments.contacts {
        write_table(path, records::contacts(), footer, events.iter().copied())?;
    }
    Ok(())
}

/// Writes a table beside its place and moves it there, so that no half of a file looks whole.
fn write_table<Row>(path: &Path, table: Table<Row>, footer: &Footer, rows: impl Iterator<Item = Row>) -> Result<()> {
    replace(path, |draft| {
        let mut writer = TableWriter::create(&Disk, draft, table, footer)?;
        for row in rows {
            writer.push(&row)?;
        }
        Ok(writer.finish()?)
    })
}

fn write_picture(path: &Path, picture: &Picture) -> Result<()> {
    let is_svg = path.extension().is_some_and(|extension| extension == "svg");
    let bytes = if is_svg { picture.svg().into_bytes() } else { picture.png()? };
    replace(path, |draft| Ok(std::fs::write(draft, &bytes)?))
}

fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(".draft");
    let draft = PathBuf::from(draft);
    write(&draft)
        .and_then(|()| Ok(std::fs::rename(&draft, path)?))
        .inspect_err(|_| {
            // What remains of a draft is of no use; the first error is the one to tell.
            let _ = std::fs::remove_file(&draft);
        })
        .with_context(|| format!("cannot write {}", path.display()))
}

fn draw(parameters: &Parameters, trace: &[TraceRow], map: &[MapRow], from: f64) -> Result<Picture> {
    let samples: Vec<(f64, f64)> =
        trace.iter().filter(|row| row.time >= from).map(|row| (row.time, row.force)).collect();
    let cells = || map.iter().filter(|row| row.time >= from);
    let times: Vec<f64> = cells().step_by(parameters.blocks).map(|row| row.time).collect();
    let fractions: Vec<f64> = cells().map(|row| row.attached_fraction).collect();
    let map = figure::AttachedMap {
        times: &times,
        blocks: parameters.blocks,
        fractions: &fractions,
        length: parameters.slider_length,
    };
    figure::simulation(&samples, Some(map)).map_err(|error| anyhow!(UsageError(format!("--from {from}: {error}"))))
}

/// The parameters as JSON, under their keys.
fn as_json(parameters: &Parameters) -> String {
    let entries = Symbol::ALL.into_iter().map(|symbol| {
        let value = match parameters.get(symbol) {
            Value::Count(count) => count.into(),
            Value::Real(real) => real.into(),
            Value::BreakOn(rule) => rule.word().into(),
            Value::Absent => serde_json::Value::Null,
        };
        (symbol.key().to_owned(), value)
    });
    serde_json::Value::Object(entries.collect()).to_string()
}

fn report(json: bool, label: &JobLabel, JobResult { slips, record, .. }: &JobResult, wall: f64) -> Result<()> {
    let summary = &record.summary;
    let intervals: Vec<f64> = slips.iter().filter_map(|slip| slip.interval).collect();
    let mean = (!intervals.is_empty()).then(|| intervals.iter().sum::<f64>() / intervals.len() as f64);
    let report = Report {
        format: FORMAT,
        job_id: label.job_id.clone(),
        simulated_seconds: summary.end_time,
        slips: slips.len(),
        mean_interval_seconds: mean,
        mean_friction_newtons: record.mean_friction,
        breaks: summary.breaks,
        reattachments: summary.reattachments,
        ruptures: record.ruptures,
        steps: summary.steps,
        leaps: summary.leaps,
        wall_seconds: wall,
    };
    if json {
        return output::json(&report);
    }
    if !slips.is_empty() {
        output::print("slip  onset (s)     interval (s)  phase (rad)  peak (N)  drop (N)  precursors\n")?;
    }
    for slip in slips {
        let optional = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        output::print(&format!(
            "{:4}  {:<12.6}  {:<12}  {:<11}  {:<8.2}  {:<8.2}  {}\n",
            slip.number,
            slip.onset,
            optional(slip.interval, 6),
            optional(slip.phase, 4),
            slip.peak_force,
            slip.drop,
            slip.precursors
        ))?;
    }
    let or_none =
        |value: Option<f64>, unit: &str| value.map_or_else(|| "none".to_owned(), |value| format!("{value:.6} {unit}"));
    output::pairs(&[
        ("job", report.job_id),
        ("simulated time", format!("{:.6} s", report.simulated_seconds)),
        ("slips", report.slips.to_string()),
        ("mean interval", or_none(report.mean_interval_seconds, "s")),
        ("mean friction", or_none(report.mean_friction_newtons, "N")),
        ("contacts", format!("{} breaks, {} reattachments", report.breaks, report.reattachments)),
        ("steps", format!("{}, of which {} leaps", report.steps, report.leaps)),
        ("wall time", output::duration(report.wall_seconds)),
    ])
}
