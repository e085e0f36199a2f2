//! `stickslip simulate`: one job, everything visible.
//!
//! The job is that of a sweep with one point, a file or the text that flags make: values, messages and the id of the job
//! are the same.

mod outputs;

use self::outputs::{Tables, check_outputs, write_pictures};
use super::exit::{Exit, UsageError};
use super::output::{self, Columns};
use super::sweep::{self, PresetFlag, Variation, changes};
use crate::model::{Parameters, Symbol};
use crate::observe::{ContactRow, Measurements, RecordingKey, Regime, Slip};
use crate::results::tables::{self, DriveAndSeed, JobOutcome, SlipRow};
use crate::simulate::{self as single, Request};
use crate::sweep::Change;
use crate::table::file::Footer;
use anyhow::Result;
use clap::{Args, ValueEnum};
use serde_json::json;
use std::path::PathBuf;
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
    /// Set a parameter of the model, or what else a sweep file has; repeatable
    #[arg(long = "set", visible_alias = "record", value_name = "KEY=VALUE")]
    settings: Vec<String>,
    /// Slips to record after start-up [default: that of the file; without one 20, unless --time is given]
    #[arg(long, allow_negative_numbers = true, value_name = "N")]
    slips: Option<String>,
    /// Model time at which the job ends even without its slips, in s: `max_time` of [record], where `time` waits for a slip
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS")]
    time: Option<String>,
    /// Method [default: event-driven]
    #[arg(long, value_parser = ["event-driven", "fixed-step"])]
    solver: Option<String>,
    /// Tolerance of the event-driven solver, relative to fs/k [default: 1e-3]
    #[arg(long, allow_negative_numbers = true, value_name = "X")]
    tolerance: Option<String>,
    /// How the event-driven solver resolves motion: on a grid, in Taylor steps, or whichever is better
    #[arg(long, value_name = "auto|grid|taylor")]
    resolve: Option<String>,
    /// Step of the fixed-step solver, in s [default: 1e-6]
    #[arg(long, allow_negative_numbers = true, value_name = "SECONDS")]
    dt: Option<String>,
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Tables, as Parquet")]
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
    #[arg(long, value_enum, default_value_t = Panel::Both, requires = "files")]
    panel: Panel,
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
    fn request(&self) -> Request {
        let TableFlags {
            sample,
            trace,
            map,
            profile,
            contacts,
            ..
        } = &self.tables;
        Request {
            sample: *sample,
            trace: trace.is_some() || self.plot.draws(Panel::Force),
            map: map.is_some() || self.plot.draws(Panel::Map),
            profile: profile.is_some(),
            contacts: contacts.is_some(),
        }
    }
}

impl PlotFlags {
    /// Whether there is a plot with this panel.
    fn draws(&self, panel: Panel) -> bool {
        !self.files.is_empty() && (self.panel == panel || self.panel == Panel::Both)
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
enum Panel {
    Force,
    Map,
    Both,
}

/// Version of the JSON.
const FORMAT: u32 = 1;

pub fn simulate(arguments: &Arguments) -> Result<Exit> {
    let changes = arguments.job.changes()?;
    let sweep = sweep::read(
        arguments.sweep.as_deref(),
        arguments.preset.preset,
        &changes,
    )?;
    let job = single::only_job(&sweep).map_err(|error| UsageError(error.to_string()))?;
    let parameters = &job.parameters;
    check_outputs(arguments, &sweep, parameters)?;
    output::warn(&sweep.warnings());
    let begin = Instant::now();
    let never = AtomicBool::new(false);
    let waiting = output::waiting(format!(
        "simulating; about {} predicted",
        output::duration(job.cost)
    ));
    let (result, recorded) = single::simulate(&sweep, parameters, arguments.request(), &never)?;
    drop(waiting);
    let wall = begin.elapsed().as_secs_f64();

    let footer = Footer::default()
        .with_sweep(sweep.name(), sweep.text())
        .with("parameters", &as_json(parameters));
    let label = tables::label::<DriveAndSeed>(&sweep, parameters);
    let slips = result
        .slips
        .iter()
        .map(|slip| -> SlipRow<'_> { (&label, slip) });
    let tables = Tables {
        footer: &footer,
        left_out: &sweep.recording().left_out(),
    };
    let files = &arguments.tables;
    tables.write(files.trace.as_deref(), recorded.trace.iter().copied())?;
    tables.write(files.map.as_deref(), recorded.map.iter().copied())?;
    tables.write(files.profile.as_deref(), recorded.profile.iter().copied())?;
    let contacts = recorded.contacts.iter().map(ContactRow::from);
    tables.write(files.contacts.as_deref(), contacts)?;
    tables.write(files.slip_table.as_deref(), slips)?;
    write_pictures(arguments, parameters, &recorded, &result.slips)?;
    report(arguments.json, &label.0.job_id, &result, wall)?;
    Ok(Exit::Done)
}

impl JobFlags {
    /// What the flags set, each as a key of a sweep file.
    fn changes(&self) -> Result<Vec<Change>, UsageError> {
        let is_fixed = self.solver.as_deref() == Some("fixed-step");
        let flags = [
            ("slips", &self.slips),
            ("max_time", &self.time),
            ("method", &self.solver),
            ("tolerance", &self.tolerance),
            ("resolve", &self.resolve),
            (
                "dt",
                &self
                    .dt
                    .clone()
                    .or_else(|| is_fixed.then(|| "1e-6".to_owned())),
            ),
        ];
        let flags = flags
            .into_iter()
            .filter_map(|(key, value)| Some(format!("{key}={}", value.as_ref()?)));
        changes(&Variation {
            settings: self.settings.iter().cloned().chain(flags).collect(),
            axes: Vec::new(),
        })
    }
}

/// The parameters as JSON, under their keys.
fn as_json(parameters: &Parameters) -> String {
    let entries = Symbol::ALL
        .into_iter()
        .map(|symbol| (symbol.key().to_owned(), json!(parameters.get(symbol))));
    serde_json::Value::Object(entries.collect()).to_string()
}

fn report(in_json: bool, job_id: &str, measured: &Measurements, wall: f64) -> Result<()> {
    let (slips, summary, averages) = (&measured.slips, &measured.summary, measured.averages);
    let intervals: Vec<f64> = slips.iter().filter_map(|slip| slip.interval).collect();
    let mean =
        (!intervals.is_empty()).then(|| intervals.iter().sum::<f64>() / intervals.len() as f64);
    let (outcome, regime) = (
        JobOutcome::of(measured).word(),
        measured.regime().map(Regime::word),
    );
    let friction = averages.map(|averages| averages.friction);
    let slip_share = averages.map(|averages| averages.slip_share);
    if in_json {
        let report = json!({
            "job_id": job_id,
            "simulated_seconds": summary.end_time,
            "slips": slips.len(),
            "mean_interval_seconds": mean,
            "outcome": outcome,
            "regime": regime,
            "mean_friction_newtons": friction,
            "attached_fraction": averages.map(|averages| averages.attached_fraction),
            "slip_share": slip_share,
            "breaks": summary.breaks,
            "reattachments": summary.reattachments,
            "ruptures": measured.ruptures,
            "steps": summary.steps,
            "leaps": summary.leaps,
            "wall_seconds": wall,
        });
        return output::json(FORMAT, &report);
    }
    let mut columns = Columns::default();
    let mut add = |head: &str, cell: &dyn Fn(&Slip) -> String| {
        columns.add(
            false,
            std::iter::once(head.to_owned())
                .chain(slips.iter().map(cell))
                .collect(),
        );
    };
    add("slip", &|slip| slip.number.to_string());
    add("onset (s)", &|slip| format!("{:.6}", slip.onset));
    add("interval (s)", &|slip| {
        slip.interval
            .map_or_else(|| "-".to_owned(), |interval| format!("{interval:.6}"))
    });
    add("phase (rad)", &|slip| {
        slip.phase
            .map_or_else(|| "-".to_owned(), |phase| format!("{phase:.4}"))
    });
    add("peak (N)", &|slip| format!("{:.2}", slip.peak_force));
    add("drop (N)", &|slip| format!("{:.2}", slip.drop));
    add("precursors", &|slip| slip.precursors.to_string());
    if !slips.is_empty() {
        output::print(&columns.to_string())?;
    }
    let or_none = |value: Option<f64>, unit: &str| {
        value.map_or_else(|| "none".to_owned(), |value| format!("{value:.6} {unit}"))
    };
    let regime = match regime.zip(slip_share) {
        None => "none".to_owned(),
        Some((regime, _)) if slips.is_empty() => regime.to_owned(),
        Some((regime, share)) => {
            format!("{regime}, {:.3} % of the time within slips", 100.0 * share)
        }
    };
    output::pairs(&[
        ("job", job_id.to_owned()),
        ("simulated time", format!("{:.6} s", summary.end_time)),
        ("slips", slips.len().to_string()),
        ("outcome", outcome.to_owned()),
        ("regime", regime),
        ("mean interval", or_none(mean, "s")),
        ("mean friction", or_none(friction, "N")),
        (
            "contacts",
            format!(
                "{} breaks, {} reattachments",
                summary.breaks, summary.reattachments
            ),
        ),
        (
            "steps",
            format!("{}, of which {} leaps", summary.steps, summary.leaps),
        ),
        ("wall time", output::duration(wall)),
    ])
}
