//! `stickslip measured`: slips of an experiment, or a trace of it, as a results directory.

use super::run::reduce_and_draw;
use super::{Exit, UsageError, catch_signals, layout, output};
use crate::figure::draw_drop_size;
use crate::measured::{DropSizes, Experiment, Given, NoPlateau, Request, Sources, TraceRequest};
use crate::run::{Options, Shard, join};
use crate::sweep::Job;
use crate::table::shown::{shown, shown_text};
use anyhow::Result;
use clap::Args;
use std::panic;
use std::path::PathBuf;

/// Read measured slips into a results directory, for the statistics and figures of the model's slips
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  stickslip measured slips.csv -o results/mine --set V0=100:um/s --set Delta=0
  stickslip measured slips.csv -o results/mine --column onset=t_slip:ms --column drop=dF:mN --set V0=1e-4 \\
    --set Delta=0.6:um --set frequency=29 --maximum 0.0123
  stickslip measured rig1.csv rig2.csv -o results/mine --column run=id --column V0=velocity:mm/s --set Delta=0
  stickslip measured slips.csv -o results/mine --set V0=1e-4 --set Delta=0 --dry-run
  stickslip measured trace.parquet -o results/mine --column time=t:s --column force=F:mN --drop-size 30:mN \\
    --set V0=100:um/s --set Delta=0

A file is CSV, also with semicolons or tabs, or Parquet, and has a row for each slip. Keys are onset (s); drop (N, or
1 for what is no force) and peak_force (N); run, where series begin; V0 (m/s), Kd (N/m), Delta (m), T (s) or frequency
(Hz); maximum (s), as the flag, if series differ in it; and end (s), when the record of a series ended. Units may have
prefixes; times may be in min or h. V0 is needed, and Delta, which is 0 without modulation; only slips with T or
frequency may lack it. With --drop-size, a file is a trace, and has a row for each sample: keys are then time (s), and
force (N, or 1 for what is no force) or displacement of the slider (m), in place of those of slips. Series with Delta = 0 are the control of those with the same V0 and Kd.")]
pub struct Arguments {
    /// Tables of slips
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// New results directory
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// The column that gives a key, and its unit, in SI if left out [default: the column of that name]. Repeatable
    #[arg(long = "column", value_name = "KEY=NAME:UNIT")]
    columns: Vec<String>,
    /// The value of a key in all rows. Repeatable
    #[arg(long = "set", value_name = "KEY=VALUE:UNIT")]
    settings: Vec<String>,
    /// A time at which the modulation has a maximum, in s unless a unit follows, as in 12.3:ms [default: 0]
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    maximum: Option<String>,
    /// Numbers in CSV have decimal commas
    #[arg(long)]
    decimal_comma: bool,
    /// Rows are samples of a trace, and slips its falls by at least this much, as in 30:mN; or auto
    #[arg(long, value_name = "SIZE:UNIT")]
    drop_size: Option<String>,
    /// Samples of a trace of which the mean is taken for one, against noise
    #[arg(long, value_name = "N", default_value_t = 1, requires = "drop_size")]
    smooth: usize,
    /// Report what would be read, and write nothing
    #[arg(long)]
    dry_run: bool,
}

impl Arguments {
    fn request(&self) -> Result<Request> {
        let times = self.maximum.iter();
        let maximum = times.map(|time| format!("maximum={time}"));
        let settings: Vec<String> = self.settings.iter().cloned().chain(maximum).collect();
        let mut options = Vec::new();
        for (flag, texts) in [("--column", &self.columns), ("--set", &settings)] {
            let quoted = texts.iter().map(|text| output::quoted(text));
            options.extend(quoted.map(|text| format!("{flag} {text}")));
        }
        options.extend(self.decimal_comma.then(|| "--decimal-comma".to_owned()));
        if let Some(size) = &self.drop_size {
            options.push(format!("--drop-size {size} --smooth {}", self.smooth));
        }
        let drop_size = self.drop_size.as_ref();
        let trace = drop_size
            .map(|size| TraceRequest::new(size, self.smooth))
            .transpose()?;
        let columns = Given::parse_all("--column", &self.columns)?;
        let settings = Given::parse_all("--set", &settings)?;
        Ok(Request {
            sources: Sources::new(columns, settings, trace.is_some())?,
            decimal_comma: self.decimal_comma,
            options: options.join(" "),
            trace,
        })
    }
}

pub fn measured(arguments: &Arguments) -> Result<Exit> {
    let refused = |error: anyhow::Error| UsageError(shown_text(&format!("{error:#}")).to_string());
    let request = arguments.request().map_err(refused)?;
    // Reading catches the panic of a library on a damaged file; its message is of no use to a user.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| ()));
    let outcome = Experiment::read(&arguments.files, &request);
    panic::set_hook(hook);
    let layout = layout(&arguments.out);
    let draw = |sizes: &DropSizes| -> Result<()> {
        let files = draw_drop_size(&layout, sizes)?;
        output::lines(files.iter().map(|path| format!("figure  {}", shown(path))))
    };
    if let Err(error) = &outcome
        && let Some(refused) = error.downcast_ref::<NoPlateau>()
        && !arguments.dry_run
    {
        draw(&refused.sizes)?;
    }
    let experiment = outcome.map_err(refused)?;
    let sweep = &experiment.sweep;
    let pairs = experiment.read.iter();
    let read: Vec<_> = pairs.map(|(head, text)| (&**head, text.clone())).collect();
    output::pairs(&read)?;
    output::warn(&sweep.warnings());
    if arguments.dry_run {
        return Ok(Exit::Done);
    }
    let options = Options {
        threads: None,
        stop: catch_signals()?,
        retry_failed: false,
        shard: Shard::default(),
        walltime: None,
    };
    join(&layout, sweep, options, |joined| {
        let report = joined.run(
            &|job: &Job, _| Ok(experiment.measurements(job)),
            &mut |_| (),
        )?;
        if report.jobs_left > 0 {
            return Ok(Exit::Stopped);
        }
        if let Some(reduced) = reduce_and_draw(&layout)? {
            output::pairs(&reduced.lines)?;
            reduced.print()?;
        }
        if let Some(sizes) = &experiment.drop_sizes {
            draw(sizes)?;
        }
        Ok(Exit::Done)
    })
}
