//! `stickslip accuracy`: speed against error of the solvers, measured in one run.

use super::exit::{Exit, UsageError};
use super::output;
use super::sweep::{self, PresetFlag, changes};
use super::threads::ThreadsFlag;
use crate::accuracy::{
    self, DistanceRow, Distances, Findings, MethodRow, QUANTITIES, Report, Stability, Study, hard_cases, set_in_words,
    stability_report, study_report,
};
use crate::model::Parameters;
use crate::sweep::Sweep;
use crate::table::shown::shown;
use anyhow::{Context, Result};
use clap::Args;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// More sets would take long, and their tables would be too many to read.
const MAX_SETS: usize = 12;

/// Measure speed against error of the solvers in one run
#[derive(Debug, Args)]
#[command(after_help = "\
Before trajectories diverge, the first break times are compared with those at the tightest tolerance. After that,
the distributions of slips are compared with a reference ensemble: their distances and the biases of their means,
with bootstrap intervals. The energy ledger is checked, too. The event-driven solver counts as two methods, on the
grid and in Taylor steps.

The cost is the CPU time of one thread in the cheapest realisation. Realisations of all solvers are timed in turn;
their spread shows whether other work disturbed the timing, so keep the machine free. --threads is about what is not
timed.

By default the study takes the paper's parameters. A sweep file or --set chooses others: it then shows what a slip
costs at each tolerance of the event-driven solver, and by how much the tolerance biases slips.

Examples:
  stickslip accuracy --quick                 a first look, in about a minute
  stickslip accuracy --out results/accuracy  the full study: tables, accuracy.json, work-precision figures
  stickslip accuracy --set Kd=1e8 --set V0=1e-5
  stickslip accuracy my.toml --seeds 16      all sets of a sweep file, 12 at most, and its solver
  stickslip accuracy --hard-cases            parameters that break a naive code, one row each")]
pub struct Arguments {
    /// Sweep file whose sets and solver are studied in place of the paper's
    #[arg(value_name = "SWEEP.toml", conflicts_with = "hard_cases")]
    sweep: Option<PathBuf>,
    #[command(flatten)]
    preset: PresetFlag,
    /// Set a key of the sweep file, or a parameter of the model if there is none; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE", conflicts_with = "hard_cases")]
    settings: Vec<String>,
    /// Folder for tables, JSON and figures
    #[arg(short, long, value_name = "DIR", default_value = "results/accuracy")]
    out: PathBuf,
    /// Take fewer slips
    #[arg(long)]
    quick: bool,
    /// Realisations of each ensemble; 8 times as many, not all timed, at Delta = 0 and 1e-4 m/s unless --quick
    /// [default: 8, with --quick 4]
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// Slips of each realisation [default: 100, with --quick 6]
    #[arg(long, value_name = "N")]
    slips: Option<u64>,
    #[command(flatten)]
    threads: ThreadsFlag,
    /// Run the hard cases instead
    #[arg(long, conflicts_with_all = ["preset", "quick", "seeds", "slips", "threads"])]
    hard_cases: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn accuracy(arguments: &Arguments) -> Result<Exit> {
    let out = &arguments.out;
    if !out.is_dir() && out.symlink_metadata().is_ok() {
        return Err(UsageError(format!("--out {}: must be a folder, or not be there yet", shown(out))).into());
    }
    if arguments.hard_cases {
        return run_hard_cases(arguments);
    }
    if let Some(setting) =
        arguments.settings.iter().find(|setting| setting.split('=').next().map(str::trim) == Some("seed"))
    {
        let problem = format!("--set {setting}: a study has seeds of its own; --seeds says how many");
        return Err(UsageError(problem).into());
    }
    let mut study = if arguments.quick { Study::quick() } else { Study::full() };
    let changes = changes(&arguments.settings, &[])?;
    let sweep = match (arguments.sweep.as_deref(), arguments.preset.preset) {
        (None, None) if changes.is_empty() => None,
        (None, None) => Some(sweep::point(&changes)?),
        (file, preset) => Some(sweep::read(file, preset, &changes)?),
    };
    if let Some(sweep) = sweep {
        output::warn(&sweep.warnings());
        study = study.at(sets_of(&sweep)?, sweep.solver());
    }
    study.seeds = arguments.seeds.unwrap_or(study.seeds);
    study.slips = arguments.slips.unwrap_or(study.slips);
    for (flag, count) in [("--seeds", study.seeds), ("--slips", study.slips)] {
        if !(1..=1_000_000).contains(&count) {
            return Err(UsageError(format!("{flag} {count}: must lie from 1 to 1000000")).into());
        }
    }
    let threads = arguments.threads.choose()?.count.map_or(0, NonZeroUsize::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.with_context(|| format!("cannot start {threads} threads; take fewer with --threads"))?;
    let findings = pool.install(|| study.run(&mut |next| output::report(next)))?;
    write_and_print(arguments, &study_report(&study, &findings)?, &study_text(&study, &findings))?;
    Ok(Exit::Done)
}

fn run_hard_cases(arguments: &Arguments) -> Result<Exit> {
    let mut rows = Vec::new();
    for case in hard_cases() {
        output::report(&format!("{}: {}", case.threat, case.name()));
        rows.extend(case.run());
    }
    write_and_print(arguments, &stability_report(&rows), &stability_text(&rows))?;
    Ok(if rows.iter().all(|row| row.passed) { Exit::Done } else { Exit::Failed })
}

/// Writes the report, and prints it as JSON or text.
fn write_and_print(arguments: &Arguments, report: &Report<'_>, text: &str) -> Result<()> {
    let files = report.write(&arguments.out)?;
    if arguments.json {
        return output::plain_json(&report.json);
    }
    output::print(text)?;
    files.iter().try_for_each(|file| output::print(&format!("{}\n", shown(file))))
}

/// The sets of a sweep, with seed 0.
fn sets_of(sweep: &Sweep) -> Result<Vec<Parameters>> {
    let mut sets: Vec<Parameters> = Vec::new();
    for job in sweep.jobs_of_grid() {
        let set = Parameters { seed: 0, ..job.parameters };
        if !sets.contains(&set) {
            sets.push(set);
        }
        if sets.len() > MAX_SETS {
            let problem = format!(
                "sweep {} has more than {MAX_SETS} sets; keep the values that matter in a copy, or name one set with --set",
                sweep.name()
            );
            return Err(UsageError(problem).into());
        }
    }
    if sets.is_empty() {
        return Err(UsageError(format!("sweep {} has no jobs: its conditions drop all points", sweep.name())).into());
    }
    Ok(sets)
}

/// What each solver costs at each set, how far its first breaks are off, and by how much it biases the means of slips.
fn study_text(study: &Study, findings: &Findings) -> String {
    let mut lines = vec![format!(
        "{}; one thread\n\
         ms/slip: CPU time in the cheapest of {} realisations; median and dearest: as multiples of it\n\
         break times: median (largest) error of the first {} breaks; together: breaks and model time until the\n\
         trajectory leaves that of the reference; ledger: residual of the energy over the work of the drive",
        accuracy::cost::processor(),
        study.seeds,
        study.breaks
    )];
    for set in &study.sets {
        let rows: Vec<&MethodRow> = findings.methods.iter().filter(|row| *row.parameters == *set).collect();
        lines.extend(cost_table(set, &rows));
        lines.extend(bias_table(findings, &rows));
    }
    lines.push(String::new());
    lines.extend(legend(findings));
    let exceed = |of: fn(&Distances) -> bool| findings.distances.iter().filter(|row| of(&row.distances)).count();
    lines.push(format!(
        "of {} comparisons with the reference, {} show a bias of the mean; in {} the W1 distance, and in {} the KS distance\n\
         is larger than in 95 % of comparisons of equal distributions",
        findings.distances.len(),
        exceed(is_biased),
        exceed(|found| found.w1 > found.w1_floor),
        exceed(|found| found.ks > found.ks_floor)
    ));
    lines.push(String::new());
    lines.join("\n")
}

/// What the marks mean that occur in the tables.
fn legend(findings: &Findings) -> Vec<String> {
    let methods = || findings.methods.iter();
    let marks = [
        (methods().any(|row| row.cost.is_extrapolated()), "* extrapolated from the cost of a step"),
        (methods().any(is_together_throughout), "> or longer: the reference ends here"),
        (
            findings.distances.iter().any(|row| is_biased(&row.distances)),
            "! the 95 % interval excludes zero, which happens by chance in one of 20",
        ),
    ];
    marks.into_iter().filter(|(occurs, _)| *occurs).map(|(_, meaning)| meaning.to_owned()).collect()
}

/// Whether the breaks agree as far as the reference reaches.
const fn is_together_throughout(row: &MethodRow) -> bool {
    row.break_times.together_throughout && row.break_times.together.is_some()
}

fn is_biased(found: &Distances) -> bool {
    found.mean_bias_low > 0.0 || found.mean_bias_high < 0.0
}

/// Costs and errors of the solvers at a set.
fn cost_table(set: &Parameters, rows: &[&MethodRow]) -> Vec<String> {
    let mut lines = vec![
        format!("\n{}", set_in_words(set)),
        format!(
            "{:30}{:>9} {:>7} {:>7} {:>8} {:>18} {:>24} {:>9}",
            "solver", "ms/slip", "median", "dearest", "ns/step", "break times (s)", "together", "ledger"
        ),
    ];
    for row in rows {
        let errors = row.break_times;
        let times = errors.median.zip(errors.largest).map(|(median, largest)| format!("{median:.0e} ({largest:.0e})"));
        let together = errors.together.zip(errors.together_seconds).map(|(breaks, seconds)| {
            let mark = if is_together_throughout(row) { ">" } else { "" };
            format!("{mark}{breaks} breaks, {seconds:.3} s")
        });
        let mark = if row.cost.is_extrapolated() { "*" } else { "" };
        lines.push(format!(
            "{:30}{:>9} {:>7.2} {:>7.2} {:>8.0} {:>18} {:>24} {:>9}",
            row.solver.to_string(),
            format!("{:.3}{mark}", 1e3 * row.cost.per_slip),
            row.median_per_slip / row.cost.per_slip,
            row.largest_per_slip / row.cost.per_slip,
            1e9 * row.cost.per_step,
            times.unwrap_or_else(|| "-".to_owned()),
            together.unwrap_or_else(|| "-".to_owned()),
            row.ledger_residual.map_or_else(|| "-".to_owned(), |residual| format!("{:.1e}", residual.abs())),
        ));
    }
    lines
}

/// Of the interval of a bias.
fn half_width(row: &DistanceRow) -> f64 {
    0.5 * (row.distances.mean_bias_high - row.distances.mean_bias_low)
}

/// Biases of the means of slips at a set.
fn bias_table(findings: &Findings, rows: &[&MethodRow]) -> Vec<String> {
    let found = |quantity: &str| rows.iter().find_map(|row| findings.distances_of(row, quantity));
    let quantities = QUANTITIES.map(|(quantity, _)| quantity);
    let quantities: Vec<&str> = quantities.into_iter().filter(|quantity| found(quantity).is_some()).collect();
    let Some(slips) = quantities.first().and_then(|quantity| found(quantity)) else { return Vec::new() };
    let cells = |texts: Vec<String>| texts.iter().map(|text| format!("{text:>18}")).collect::<Vec<_>>().concat();
    let unit = |quantity: &str| if quantity == "phase" { "rad" } else { "%" };
    let heading = quantities.iter().map(|quantity| format!("{quantity} ({})", unit(quantity))).collect();
    let mut lines = vec![
        format!(
            "bias of the mean ± 95 % interval: {} slips compared with {} of one reference, so that marks in a column come together",
            slips.slips, slips.reference_slips
        ),
        format!("{:30}{}", "", cells(heading)),
    ];
    for row in rows {
        let bias = |quantity: &&str| {
            findings.distances_of(row, quantity).map_or_else(
                || "-".to_owned(),
                |row| {
                    let scale = if unit(quantity) == "%" { 100.0 / row.reference_mean.abs() } else { 1.0 };
                    let mark = if is_biased(&row.distances) { "!" } else { " " };
                    format!("{:+.3} ± {:.3}{mark}", scale * row.distances.mean_bias, scale * half_width(row))
                },
            )
        };
        let biases: Vec<String> = quantities.iter().map(bias).collect();
        if biases.iter().any(|bias| bias != "-") {
            lines.push(format!("{:30}{}", row.solver.to_string(), cells(biases)));
        }
    }
    let intervals = rows.iter().filter_map(|row| findings.distances_of(row, "interval"));
    let halves = intervals.map(|row| 100.0 * half_width(row) / row.reference_mean);
    if let Some(hidden) = halves.max_by(f64::total_cmp) {
        lines.push(format!(
            "these slips may hide a bias of the interval below {hidden:.1} %; more --seeds show smaller ones"
        ));
    }
    lines
}

fn stability_text(rows: &[Stability]) -> String {
    let mut lines = Vec::new();
    let mut threat = "";
    for row in rows {
        if row.threat != threat {
            threat = &row.threat;
            lines.push(format!("\n{threat}"));
        }
        let mark = if row.passed { "ok    " } else { "FAILED" };
        let time = row.simulated_seconds.map_or_else(String::new, |time| {
            let (steps, cpu) = (row.steps, row.cpu_seconds);
            let (breaks, grid) = (row.breaks, if row.grid_steps > 0 { " on the grid" } else { "" });
            let ledger = row.ledger_residual.map_or_else(String::new, |residual| format!(", ledger {residual:.1e}"));
            format!("; {time:.3} s in {steps} steps{grid}, {breaks} breaks{ledger}, {cpu:.2} s")
        });
        lines.push(format!("  {mark} {} ({}): {}{time}", row.case, row.solver, row.outcome));
    }
    let failed = rows.iter().filter(|row| !row.passed).count();
    lines.push(format!("\n{} of {} runs passed\n", rows.len() - failed, rows.len()));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accuracy::Cost;
    use crate::accuracy::breaks::BreakErrors;
    use crate::model::selected::Selected;
    use crate::solver::Solver;

    /// The lines below the tables of a study with one solver, of which this number of slips was timed.
    fn explained(timed_slips: u64, together_throughout: bool) -> String {
        let parameters = Parameters::default();
        let row = MethodRow {
            parameters: Selected::new(parameters.clone()),
            case: String::new(),
            solver: Solver::default().into(),
            cost: Cost { per_slip: 1e-3, timed_slips, ..Cost::default() },
            timings: 1,
            median_per_slip: 1e-3,
            largest_per_slip: 1e-3,
            break_times: BreakErrors {
                together: Some(9),
                together_seconds: Some(0.1),
                together_throughout,
                ..BreakErrors::default()
            },
            ledger_residual: None,
        };
        let study = Study { sets: vec![parameters], ..Study::quick() };
        study_text(&study, &Findings { methods: vec![row], distances: Vec::new() })
    }

    #[test]
    fn a_mark_is_explained_if_it_occurs() {
        let (star, further) = ("\n* extrapolated", "\n> or longer");
        let text = explained(0, true);
        assert!(text.contains("1.000*") && text.contains(star) && text.contains(further), "{text}");
        let text = explained(6, false);
        assert!(!text.contains('*') && !text.contains(further) && !text.contains("\n! "), "{text}");
    }
}
