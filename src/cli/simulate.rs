//! `stickslip simulate`: one job, everything visible.
//!
//! The job is the only one of a sweep: of a file, or of the text that flags make. So values, messages and the id of the
//! job are those of a sweep.

use super::output::{self, TextTable};
use super::plot::picture_file;
use super::sweep::{self, PresetFlag, Variation, changes};
use super::{Exit, UsageError, catch_signals};
use crate::figure::simulation;
use crate::model::{Parameters, Selected, Symbol};
use crate::observe::{ContactRow, Measurements, RecordingKey, Regime, Slip};
use crate::results::destination::Destination;
use crate::results::tables::{self, All, DriveAndSeed, JobOutcome, JobRecord, SlipRow};
use crate::sets::Digits;
use crate::single_job::{self, JobRecords, RecordRequest};
use crate::sweep::{KeyChange, Sweep};
use crate::table::Table;
use crate::table::arrow::{self, Gaps};
use crate::table::file::{Footer, TableWriter};
use anyhow::Result;
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Simulate one realisation and show what it does
#[derive(Debug, Args)]
#[command(after_help = after_help())]
pub struct Arguments {
    /// Sweep file with exactly one job, once the flags below have set what they name
    #[arg(value_name = "SWEEP.toml")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    #[command(flatten)]
    job: JobFlags,
    #[command(flatten)]
    tables: TableFlags,
    #[command(flatten)]
    plot: PlotFlags,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "The job")]
struct JobFlags {
    /// Set a parameter of the model, or a key of [record] or [solver]; repeatable
    #[arg(long = "set", visible_alias = "record", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Slips to record after start-up [default: that of the file; without one 20, unless --time is given]
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    slips: Option<String>,
    /// Longest model time, in s: `max_time` of [record], where `time` waits for a slip
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS")]
    time: Option<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Tables, as .parquet")]
struct TableFlags {
    /// Write shear force, displacement and attached fraction over time
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Write the attached fraction of every block over time
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Write the displacement of every block at the end
    #[arg(long, value_name = "FILE")]
    profile: Option<PathBuf>,
    /// Write every contact event
    #[arg(long, value_name = "FILE")]
    contacts: Option<PathBuf>,
    /// Write the slips with the columns of a sweep
    #[arg(long, value_name = "FILE")]
    slip_table: Option<PathBuf>,
    /// Time between samples of trace, map and plot, in s
    #[arg(
        long,
        allow_negative_numbers = true,
        value_name = "SECONDS",
        default_value_t = 1e-4
    )]
    sample: f64,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "A plot")]
struct PlotFlags {
    /// Draw the shear force and the attached fraction, as .svg, .png or .pdf; repeatable
    #[arg(long = "plot", value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Panels of the plot
    #[arg(long, value_enum, default_value_t = PlotPanel::Both, requires = "files")]
    panel: PlotPanel,
    /// First instant of the plot, in s
    #[arg(
        long,
        allow_negative_numbers = true,
        value_name = "SECONDS",
        default_value_t = 0.0,
        requires = "files"
    )]
    from: f64,
    /// Last instant of the plot, in s [default: the end]
    #[arg(
        long,
        allow_negative_numbers = true,
        value_name = "SECONDS",
        requires = "files"
    )]
    until: Option<f64>,
}

impl Arguments {
    fn request(&self) -> RecordRequest {
        let tables = &self.tables;
        RecordRequest {
            sample: tables.sample,
            trace: tables.trace.is_some() || self.plot.draws(PlotPanel::Force),
            map: tables.map.is_some() || self.plot.draws(PlotPanel::Map),
            profile: tables.profile.is_some(),
            contacts: tables.contacts.is_some(),
        }
    }
}

impl PlotFlags {
    fn check(&self, longest: f64) -> Result<(), String> {
        let from = self.from;
        if !(from >= 0.0 && from.is_finite()) {
            return Err(format!("--from {from}: must be a finite number >= 0, in s"));
        }
        if from >= longest {
            let problem = "must lie before the end";
            return Err(format!("--from {from}: {problem}, {longest} s"));
        }
        match self.until {
            Some(until) if !(until > from && until.is_finite()) => Err(format!(
                "--until {until}: must be a finite number > {from}, the first instant, in s"
            )),
            _ => Ok(()),
        }
    }

    /// Whether there is a plot with this panel.
    fn draws(&self, panel: PlotPanel) -> bool {
        !self.files.is_empty() && (self.panel == panel || self.panel == PlotPanel::Both)
    }
}

fn after_help() -> String {
    let lines = |keys: &[&str]| {
        keys.chunks(17)
            .map(|keys| keys.join(" "))
            .collect::<Vec<_>>()
            .join("\n")
    };
    format!(
        "\
Examples:
  stickslip simulate --slips 20
  stickslip simulate --set Delta=1e-6 --set frequency=58 --time 2 --plot slips.png
  stickslip simulate --set dfs=0 --slips 1 --record discard=0 --contacts contacts.parquet
  stickslip simulate --slips 9 --panel force --from 0.6 --until 1.4 --plot fig1d.svg --plot fig1d.png
  stickslip simulate sweeps/fig3.toml --set V0=1e-4 --set Delta=1e-6 --set eta=2 --set seed=0

Keys of --set, in SI units; and eta or frequency (Hz) in place of T:
{}
{}",
        lines(&Symbol::ALL.map(Symbol::key)),
        lines(&RecordingKey::ALL.map(RecordingKey::key)),
    )
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PlotPanel {
    Force,
    Map,
    Both,
}

const JSON_FORMAT: u32 = 1;
/// The extension of tables.
const TABLE: &str = "parquet";

pub fn simulate(arguments: &Arguments) -> Result<Exit> {
    let changes = arguments.job.changes()?;
    let sweep = sweep::read(arguments.sweep.as_deref(), arguments.preset, &changes)?;
    let job = single_job::only_job(&sweep).map_err(|error| UsageError(error.to_string()))?;
    let parameters = &job.parameters;
    arguments.check(&sweep, parameters)?;
    output::warn(&sweep.warnings());
    let begin = Instant::now();
    let never = AtomicBool::new(false);
    let predicted = output::duration(job.cost);
    let waiting = output::waiting(format!("simulating; about {predicted} predicted"));
    let request = arguments.request();
    let (measured, records) = single_job::simulate(&sweep, parameters, request, &never)?;
    drop(waiting);
    let wall = begin.elapsed().as_secs_f64();

    let label = tables::label::<DriveAndSeed>(&sweep, parameters);
    let slips = (measured.slips.iter())
        .map(|slip| -> SlipRow<'_> { (Cow::Borrowed(&label), Cow::Borrowed(slip)) });
    let contacts = records.contacts.iter().map(ContactRow::from);
    let all = arrow::json(&Selected::<All>::new(parameters.clone()));
    let footer = Footer::default()
        .with_sweep(sweep.name(), sweep.text())
        .with("parameters", &all.to_string());
    let tables = Tables {
        footer: &footer,
        gaps: &tables::gaps(&sweep),
    };
    let files = &arguments.tables;
    tables.write(files.trace.as_deref(), records.trace.iter().copied())?;
    tables.write(files.map.as_deref(), records.map.iter().copied())?;
    tables.write(files.profile.as_deref(), records.profile.iter().copied())?;
    tables.write(files.contacts.as_deref(), contacts)?;
    tables.write(files.slip_table.as_deref(), slips)?;
    arguments.write_plots(parameters, &records, &measured)?;

    let report = JobReport {
        job_id: &label.0.job_id,
        tau_mean: mean_interval(&measured.slips),
        wall,
        job: arrow::json(&JobRecord::new(Ok(&measured))),
    };
    if arguments.json {
        output::json(JSON_FORMAT, &report)?;
    } else {
        output::print(&table_of_slips(&measured.slips))?;
        report.print(&measured)?;
    }
    Ok(Exit::Done)
}

/// What the tables of a job have in common.
struct Tables<'a> {
    footer: &'a Footer,
    gaps: &'a Gaps,
}

impl Tables<'_> {
    fn write<R: Table>(&self, path: Option<&Path>, rows: impl Iterator<Item = R>) -> Result<()> {
        let Some(path) = path else { return Ok(()) };
        Destination::new(path, TABLE)?.write(catch_signals()?, |file| {
            let mut writer = TableWriter::new(self.gaps, path, file, self.footer)?;
            for row in rows {
                writer.push(&row)?;
            }
            writer.finish()?;
            Ok(())
        })
    }
}

impl Arguments {
    /// Refuses what could not be written or drawn, before anything runs.
    fn check(&self, sweep: &Sweep, parameters: &Parameters) -> Result<()> {
        let recording = sweep.recording();
        let request = self.request().check(parameters, recording);
        request.map_err(|error| UsageError(format!("--{error}")))?;
        let longest = recording.max_time.unwrap_or(f64::INFINITY);
        self.plot.check(longest).map_err(UsageError)?;
        let tables = &self.tables;
        let tables = [
            &tables.trace,
            &tables.map,
            &tables.profile,
            &tables.contacts,
            &tables.slip_table,
        ];
        let mut all = Vec::new();
        for table in tables.into_iter().flatten() {
            all.push(Destination::new(table, TABLE)?);
        }
        for file in &self.plot.files {
            all.push(picture_file(file)?.0);
        }
        Ok(Destination::refuse_same(&all)?)
    }

    fn write_plots(
        &self,
        parameters: &Parameters,
        records: &JobRecords,
        measured: &Measurements,
    ) -> Result<()> {
        let PlotFlags { files, from, .. } = &self.plot;
        if files.is_empty() {
            return Ok(());
        }
        let refused = |problem: String| UsageError(format!("--from {from}: {problem}"));
        let of_trace = records.trace.last().map(|row| row.time);
        let of_map = records.map.last().map(|row| row.time);
        let last = of_trace.or(of_map).unwrap_or(0.0);
        if *from >= last {
            return Err(refused(format!(
                "the simulation ended at {last} s; take an earlier instant, or a longer --time"
            ))
            .into());
        }
        // The sample at an end is shown, however its time is rounded.
        let slack = 1e-6 * self.tables.sample;
        let shown = from - slack..=self.plot.until.unwrap_or(f64::INFINITY) + slack;
        let samples = records.trace.iter().filter(|row| shown.contains(&row.time));
        let trace: Vec<(f64, f64)> = samples.map(|row| (row.time, row.force)).collect();
        let cells = records.map.iter().filter(|row| shown.contains(&row.time));
        let map: Vec<_> = cells.copied().collect();
        let onsets: Vec<f64> = measured.slips.iter().map(|slip| slip.onset).collect();
        let trace = self.plot.draws(PlotPanel::Force).then_some(&*trace);
        let map = self.plot.draws(PlotPanel::Map).then_some(&*map);
        let picture = simulation(parameters, trace, map, [&measured.start_up, &onsets])
            .map_err(|error| refused(error.to_string()))?;
        for path in files {
            let (destination, format) = picture_file(path)?;
            output::write(&destination, &picture.encoded(format)?)?;
        }
        Ok(())
    }
}

impl JobFlags {
    /// What the flags set, each as a key of a sweep file.
    fn changes(&self) -> Result<Vec<KeyChange>, UsageError> {
        let pairs = [("slips", &self.slips), ("max_time", &self.time)].into_iter();
        let of_flags = pairs.filter_map(|(key, value)| Some(format!("{key}={}", value.as_ref()?)));
        changes(&Variation {
            settings: self.settings.iter().cloned().chain(of_flags).collect(),
            axes: Vec::new(),
        })
    }
}

/// What is printed of a job.
#[derive(Serialize)]
struct JobReport<'a> {
    job_id: &'a str,
    /// Mean interval, in s.
    tau_mean: Option<f64>,
    /// Wall time, in s.
    wall: f64,
    /// Its columns of the table of jobs.
    #[serde(flatten)]
    job: serde_json::Value,
}

fn mean_interval(slips: &[Slip]) -> Option<f64> {
    let intervals: Vec<f64> = slips.iter().filter_map(|slip| slip.interval).collect();
    let mean = intervals.iter().sum::<f64>() / intervals.len() as f64;
    Some(mean).filter(|mean| mean.is_finite())
}

impl JobReport<'_> {
    fn print(&self, measured: &Measurements) -> Result<()> {
        let Measurements {
            summary, averages, ..
        } = measured;
        // A mean of few slips is not better known.
        let mean = |value: Option<f64>, unit: &str| {
            let number = value.map(|value| Digits::FOUR.number(value));
            number.map_or_else(|| "none".to_owned(), |number| format!("{number} {unit}"))
        };
        let regime = match measured.regime().map(Regime::word).zip(*averages) {
            None => "none".to_owned(),
            Some((regime, _)) if measured.slips.is_empty() => regime.to_owned(),
            Some((regime, averages)) => {
                let percent = 100.0 * averages.slip_share;
                format!("{regime}, {percent:.3} % of the time within slips")
            }
        };
        let contacts = format!(
            "{} breaks, {} reattachments",
            summary.breaks, summary.reattachments
        );
        let outcome = JobOutcome::of(measured);
        let early = match outcome {
            JobOutcome::NoSlips => ": ended early, as no further slip came within give_up_after",
            JobOutcome::Done | JobOutcome::TimeLimit | JobOutcome::Failed => "",
        };
        let steps = format!("{}, of which {} leaps", summary.steps, summary.leaps);
        let friction = averages.map(|averages| averages.friction);
        output::pairs(&[
            ("job", self.job_id.to_owned()),
            ("simulated time", format!("{:.6} s", summary.end_time)),
            ("slips", measured.slips.len().to_string()),
            ("outcome", format!("{}{early}", outcome.word())),
            ("regime", regime),
            ("mean interval", mean(self.tau_mean, "s")),
            ("mean friction", mean(friction, "N")),
            ("contacts", contacts),
            ("steps", steps),
            ("wall time", output::duration(self.wall)),
        ])
    }
}

/// A line for each slip; empty without slips.
fn table_of_slips(slips: &[Slip]) -> String {
    if slips.is_empty() {
        return String::new();
    }
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let mut columns = TextTable::default();
    columns.numbers("slip", slips, |slip| slip.number.to_string());
    columns.numbers("onset (s)", slips, |slip| format!("{:.6}", slip.onset));
    columns.numbers("interval (s)", slips, |slip| {
        or_none(slip.interval.map(|interval| format!("{interval:.6}")))
    });
    columns.numbers("phase (rad)", slips, |slip| {
        or_none(slip.phase.map(|phase| format!("{phase:.4}")))
    });
    columns.numbers("peak (N)", slips, |slip| format!("{:.2}", slip.peak_force));
    columns.numbers("drop (N)", slips, |slip| format!("{:.2}", slip.drop));
    columns.numbers("precursors", slips, |slip| slip.precursors.to_string());
    columns.to_string()
}
