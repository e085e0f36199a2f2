//! `stickslip accuracy`: speed against error of the solvers, measured in one run.

use super::output::{self, TextTable};
use super::sweep::{self, PresetFlag, Variation, changes};
use super::{Exit, UsageError, catch_signals};
use crate::accuracy::{
    self, Findings, MethodRow, Study, set_in_words, shows_bias, too_few_slips, verdict,
};
use crate::model::Parameters;
use crate::model::theory::typical_interval;
use crate::results::layout::Layout;
use crate::run::limits::{self, Threads};
use crate::sweep::Sweep;
use crate::table::shown::shown;
use crate::table::value::floored;
use anyhow::{Context, Result};
use clap::{Args, value_parser};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// More sets would take long, and their tables would be too many to read.
const MAX_SETS: usize = 12;
/// Most seeds, and most slips of each.
const MAX_COUNT: u64 = 1_000_000;

/// Measure speed against error of the solvers in one run
#[derive(Debug, Args)]
#[command(after_help = "\
Before trajectories diverge, the first break times are compared with those at the tightest tolerance. After that,
mean and standard deviation of the slips are compared with those of a reference ensemble, with intervals by the spread
of realisations. The event-driven solver counts as two methods, on the grid and in Taylor steps.

The cost is the CPU time of one thread in the cheapest realisation. Realisations of all solvers are timed in turn; keep
the machine free meanwhile. --threads is about what is not timed.

The first lines say how exact a sweep with this solver is: whether a bias was found, which must be larger than what
chance gives in as many comparisons; by how much breaks are off; and whether the slips that the sweep records could
tell. Below, each setting has what a slip costs, and its bias; -> marks the solver of the sweep.

By default the study takes the paper's parameters and the default solver. A sweep file or --set chooses others.
Realisations begin at the first seed of these, such as --set seed=1000, and are as many as --seeds says.

Examples:
  stickslip accuracy --quick                 a first look, in about a minute
  stickslip accuracy                         the full study of the paper's parameters
  stickslip accuracy --set Kd=1e8 --set V0=1e-5
  stickslip accuracy my.toml --seeds 16      all sets of a sweep file, 12 at most, and its solver")]
pub struct Arguments {
    /// Sweep file, or results directory, whose sets and solver are studied in place of the paper's
    #[arg(value_name = "SWEEP.toml")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    #[command(flatten)]
    variation: Variation,
    /// Folder for tables, JSON and figures [default: results/<name of the sweep>-accuracy, or results/accuracy]
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Take fewer slips: enough for costs and break times, too few for biases
    #[arg(long)]
    quick: bool,
    /// Realisations of each ensemble; without a sweep file, --set and --quick, 8 times as many, not all timed, at
    /// Delta = 0 and 1e-4 m/s [default: 8, with --quick 4]
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..=MAX_COUNT))]
    seeds: Option<u64>,
    /// Slips of each realisation [default: 100, with --quick 6]
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..=MAX_COUNT))]
    slips: Option<u64>,
    /// Threads [default: those that the batch system grants, else all cores]
    #[arg(long, value_name = "N", value_parser = limits::parse_threads)]
    threads: Option<NonZeroUsize>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn accuracy(arguments: &Arguments) -> Result<Exit> {
    let mut study = if arguments.quick {
        Study::quick()
    } else {
        Study::full()
    };
    let changes = changes(&arguments.variation)?;
    let has_file = arguments.sweep.is_some() || arguments.preset.preset.is_some();
    let mut out = PathBuf::from("results/accuracy");
    if has_file || !changes.is_empty() {
        let sweep = sweep::read(arguments.sweep.as_deref(), arguments.preset, &changes)?;
        output::warn(&sweep.warnings());
        let (sets, slips): (Vec<_>, Vec<f64>) = sets_of(&sweep)?.into_iter().unzip();
        study = study.at(sets, sweep.solver());
        if has_file {
            let whole = |slips: f64| floored(slips.round()) as u64;
            study.slips_of_sets = slips.into_iter().map(whole).collect();
            out = Layout::default_root(&sweep);
            out.as_mut_os_string().push("-accuracy");
        }
        let seeds = sweep.jobs_of_grid().map(|job| job.parameters.seed);
        study.first_seed = seeds.min().unwrap_or_default();
    }
    let out = arguments.out.clone().unwrap_or(out);
    if !out.is_dir() && out.symlink_metadata().is_ok() {
        let problem = "must be a folder, or not be there yet";
        return Err(UsageError(format!("--out {}: {problem}", shown(&out))).into());
    }
    study.seeds = arguments.seeds.unwrap_or(study.seeds);
    study.slips = arguments.slips.unwrap_or(study.slips);
    let threads = Threads::choose(arguments.threads, |variable| std::env::var_os(variable))?.count;
    let threads = limits::or_all_cores(threads);
    limits::check_threads(threads)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool =
        pool.with_context(|| format!("cannot start {threads} threads; take fewer with --threads"))?;
    accuracy::check(&out)?;
    if let Some(few) = too_few_slips(&study) {
        output::report(&few);
    }
    let findings = pool.install(|| study.run(&mut |next| output::report(next)))?;
    let files = accuracy::write(&study, &findings, &out, catch_signals()?)?;
    if arguments.json {
        output::print(&format!("{:#}\n", accuracy::to_json(&study, &findings)))?;
    } else {
        output::print(&study_text(&study, &findings))?;
        output::lines(files.iter().map(|file| shown(file).to_string()))?;
    }
    Ok(Exit::Done)
}

/// The sets of a sweep, with seed 0, and the slips that the jobs of each are expected to record.
fn sets_of(sweep: &Sweep) -> Result<Vec<(Parameters, f64)>> {
    let name = sweep.name();
    let mut sets: Vec<(Parameters, f64)> = Vec::new();
    for job in sweep.jobs_of_grid() {
        let slips = sweep
            .recording()
            .expected_slips(typical_interval(&job.parameters));
        let set = job.parameters.with_seed(0);
        match sets.iter_mut().find(|(known, _)| *known == set) {
            Some((_, sum)) => *sum += slips,
            None => sets.push((set, slips)),
        }
        if sets.len() > MAX_SETS {
            let problem = format!(
                "sweep {name} has more than {MAX_SETS} sets; choose one by the values of its axes, such as --set V0=1e-5 --set N=35"
            );
            return Err(UsageError(problem).into());
        }
    }
    if sets.is_empty() {
        let problem = format!("sweep {name} has no jobs: its conditions drop all points");
        return Err(UsageError(problem).into());
    }
    Ok(sets)
}

/// The verdict, and what is behind it: costs, errors of break times and biases of the interval.
fn study_text(study: &Study, findings: &Findings) -> String {
    let mut lines = verdict(study, findings);
    lines.push(format!(
        "\n{}; one thread\n\
         ms/slip: CPU time in the cheapest of {} realisations, * extrapolated from that of a step\n\
         break times: median (largest) error of the first {}; interval: bias of the mean, or what it is below,\n\
         with 95 % for all lines together, all against the same reference; accuracy.json has more quantities",
        accuracy::processor(),
        study.seeds,
        study.breaks
    ));
    let tables = study.sets.iter().map(|set| table(study, findings, set));
    lines.join("\n") + "\n" + &tables.collect::<String>()
}

/// A line for each solver at a set; -> before that of the sweep.
fn table(study: &Study, findings: &Findings, set: &Parameters) -> String {
    let methods = findings.methods.iter();
    let rows: Vec<&MethodRow> = methods.filter(|row| *row.parameters == *set).collect();
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let mut columns = TextTable::default();
    columns.words("   solver", &rows, |row| {
        let is_own = row.solver == study.own.into();
        format!("{} {}", if is_own { "->" } else { "  " }, row.solver)
    });
    columns.numbers("ms/slip", &rows, |row| {
        let mark = if row.cost.is_extrapolated() { "*" } else { "" };
        format!("{:.3}{mark}", 1e3 * row.cost.per_slip)
    });
    columns.numbers("break times (s)", &rows, |row| {
        let times = row.break_times.median.zip(row.break_times.largest);
        or_none(times.map(|(median, largest)| format!("{median:.0e} ({largest:.0e})")))
    });
    let biases = findings.biases.iter();
    let comparisons = biases.filter(|row| row.quantity == "interval").count();
    columns.numbers("interval (%)", &rows, |row| {
        or_none(findings.bias_of(row, "interval").and_then(|row| {
            let scale = 100.0 / row.reference_mean.abs();
            let bias = scale * row.bias.of_mean;
            let half = scale * row.bias.half_width_among(comparisons)?;
            Some(if shows_bias(row, comparisons) {
                format!("{bias:+.3} ± {half:.3}")
            } else {
                format!("< {:.3}", bias.abs() + half)
            })
        }))
    });
    format!("\n{}\n{columns}", set_in_words(set))
}
