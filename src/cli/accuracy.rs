//! `stickslip accuracy`: speed against error of the solvers, measured in one run.

use super::exit::{Exit, UsageError};
use super::output;
use super::sweep::settings_as_sweep;
use crate::accuracy::{
    self, DistanceRow, Distances, Findings, MethodRow, Quantity, Report, Scaling, ScalingFindings, Stability, Study,
    hard_cases, scaling_report, set_in_words, solver_in_words, stability_report, study_report,
};
use crate::model::Parameters;
use crate::sweep::Sweep;
use crate::table::shown::shown;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// A study of more sets than this would take long, and nobody could read it.
const MAX_SETS: usize = 12;

/// Measure speed against error of the solvers in one run
#[derive(Debug, Args)]
#[command(after_help = "\
Before chaos: errors of the first break times against the tightest tolerance. After chaos: distances of the
distributions of slips from a reference ensemble, and biases, with bootstrap intervals. And the residual of the
energy ledger. The event-driven solver counts as two methods, on the grid and in Taylor steps. Cost is CPU time of
one thread, that of the cheapest realisation; keep the machine free of other work: the spread over realisations,
which are timed in turn with those of the other solvers, shows how free it was.

The study of the paper's parameters is the default. With a sweep file or --set it is about those: which tolerance of
the event-driven solver biases what, by how much, and what a slip costs.

Examples:
  stickslip accuracy --quick                 a first look, in about a minute
  stickslip accuracy --out results/accuracy  the full study: tables, accuracy.json, work-precision figures
  stickslip accuracy --set Kd=1e8 --set V0=1e-5
  stickslip accuracy my.toml --seeds 16      all sets of a sweep file, 12 at most, and its solver
  stickslip accuracy --scaling               what a slip costs with N and Ns, in two minutes; --quick: in seconds
  stickslip accuracy --hard-cases            parameters that break a naive code, one row each")]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub struct Arguments {
    /// Sweep file whose sets and solver to study, in the place of the paper's
    #[arg(value_name = "SWEEP.toml", conflicts_with_all = ["settings", "scaling", "hard_cases"])]
    sweep: Option<PathBuf>,
    /// Set a parameter of the model, and study this one set; repeatable
    #[arg(long = "set", value_name = "KEY=VALUE", conflicts_with_all = ["scaling", "hard_cases"])]
    settings: Vec<String>,
    /// Folder for tables, JSON and figures
    #[arg(long, value_name = "DIR", default_value = "results/accuracy")]
    out: PathBuf,
    /// Fewer slips, or sizes
    #[arg(long)]
    quick: bool,
    /// Realisations of each ensemble; 8 times as many, not all timed, at Delta = 0 and 1e-4 m/s unless --quick
    /// [default: 8, with --quick 4]
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// Slips of each realisation [default: 100, with --quick 6]
    #[arg(long, value_name = "N")]
    slips: Option<u64>,
    /// Measure what a slip costs with the size of the slider instead
    #[arg(long, conflicts_with_all = ["hard_cases", "seeds", "slips"])]
    scaling: bool,
    /// Run the hard cases instead
    #[arg(long, conflicts_with_all = ["quick", "seeds", "slips"])]
    hard_cases: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub fn accuracy(arguments: &Arguments) -> Result<Exit> {
    if arguments.hard_cases {
        return run_hard_cases(arguments);
    }
    if arguments.scaling {
        return run_scaling(arguments);
    }
    let mut study = if arguments.quick { Study::quick() } else { Study::full() };
    let sweep = match &arguments.sweep {
        Some(path) => Some(Sweep::from_file(path)?),
        None if arguments.settings.is_empty() => None,
        None => Some(settings_as_sweep(&arguments.settings)?),
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
    let findings = study.run(&mut |next| output::report(next))?;
    write_and_print(arguments, &study_report(&study, &findings)?, &study_text(&study, &findings))?;
    Ok(Exit::Done)
}

fn run_scaling(arguments: &Arguments) -> Result<Exit> {
    let scaling = if arguments.quick { Scaling::quick() } else { Scaling::full() };
    let findings = scaling.run(&mut |next| output::report(next))?;
    write_and_print(arguments, &scaling_report(&findings)?, &scaling_text(&findings))?;
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
        return output::json(report.json());
    }
    output::print(text)?;
    files.iter().try_for_each(|file| output::print(&format!("{}\n", shown(file))))
}

fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1e}"))
}

/// The sets of a sweep, with seed 0.
fn sets_of(sweep: &Sweep) -> Result<Vec<Parameters>> {
    let mut sets: Vec<Parameters> = Vec::new();
    for job in sweep.jobs() {
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
        "{}; one thread; CPU time per slip by the cheapest of {} realisations, and the median and dearest as multiples of \
         it; errors of the first {} breaks: median (largest)",
        accuracy::cost::processor(),
        study.seeds,
        study.breaks
    )];
    for set in &study.sets {
        let rows: Vec<&MethodRow> = findings.methods.iter().filter(|row| *row.parameters == *set).collect();
        lines.extend(cost_table(set, &rows));
        lines.extend(bias_table(findings, &rows));
    }
    lines.push("\n* extrapolated from the cost of a step; > together as far as the reference reaches".to_owned());
    lines.push("! zero lies outside of the 95 % interval, as by chance in one of 20".to_owned());
    let exceed = |of: fn(&Distances) -> bool| findings.distances.iter().filter(|row| of(&row.distances)).count();
    lines.push(format!(
        "of {}, {} biases show, {} W1 and {} KS distances exceed what 95 % of equal distributions stay under",
        findings.distances.len(),
        exceed(is_biased),
        exceed(|found| found.wasserstein.value > found.wasserstein.floor),
        exceed(|found| found.kolmogorov.value > found.kolmogorov.floor)
    ));
    lines.push(String::new());
    lines.join("\n")
}

fn is_biased(found: &Distances) -> bool {
    found.mean.low > 0.0 || found.mean.high < 0.0
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
            let mark = if errors.together_throughout { ">" } else { "" };
            format!("{mark}{breaks} breaks, {seconds:.3} s")
        });
        let mark = if row.cost.timed_slips == 0 { "*" } else { "" };
        lines.push(format!(
            "{:30}{:>9} {:>7.2} {:>7.2} {:>8.0} {:>18} {:>24} {:>9}",
            solver_in_words(row.solver),
            format!("{:.3}{mark}", 1e3 * row.cost.per_slip),
            row.median_per_slip / row.cost.per_slip,
            row.largest_per_slip / row.cost.per_slip,
            1e9 * row.cost.per_step,
            times.unwrap_or_else(|| "-".to_owned()),
            together.unwrap_or_else(|| "-".to_owned()),
            or_dash(row.ledger_residual.map(f64::abs)),
        ));
    }
    lines
}

/// Biases of the means of slips at a set.
fn bias_table(findings: &Findings, rows: &[&MethodRow]) -> Vec<String> {
    let of = |row: &MethodRow, quantity: Quantity| {
        findings.distances.iter().find(|other| {
            other.quantity == quantity && other.parameters == row.parameters && other.solver == row.solver
        })
    };
    let found = |quantity: &Quantity| rows.iter().find_map(|row| of(row, *quantity));
    let quantities: Vec<Quantity> = Quantity::ALL.into_iter().filter(|quantity| found(quantity).is_some()).collect();
    let Some(slips) = quantities.first().and_then(found) else { return Vec::new() };
    let cells = |texts: Vec<String>| texts.iter().map(|text| format!("{text:>18}")).collect::<Vec<_>>().concat();
    let unit = |quantity: Quantity| if quantity == Quantity::Phase { "rad" } else { "%" };
    let heading = quantities.iter().map(|&quantity| format!("{} ({})", quantity.name(), unit(quantity))).collect();
    let mut lines = vec![
        format!("bias of the mean of {} slips against {} of the reference", slips.slips, slips.reference_slips),
        format!("{:30}{}", "", cells(heading)),
    ];
    for row in rows {
        let bias = |&quantity: &Quantity| {
            of(row, quantity).map_or_else(
                || "-".to_owned(),
                |row| {
                    let scale = if unit(quantity) == "%" { 100.0 / row.reference_mean.abs() } else { 1.0 };
                    let (bias, mark) = (row.distances.mean, if is_biased(&row.distances) { "!" } else { " " });
                    let half = 0.5 * scale * (bias.high - bias.low);
                    format!("{:+.3} ± {half:.3}{mark}", scale * bias.value)
                },
            )
        };
        let biases: Vec<String> = quantities.iter().map(bias).collect();
        if biases.iter().any(|bias| bias != "-") {
            lines.push(format!("{:30}{}", solver_in_words(row.solver), cells(biases)));
        }
    }
    let half = |row: &DistanceRow| 50.0 * (row.distances.mean.high - row.distances.mean.low) / row.reference_mean;
    let halves = rows.iter().filter_map(|row| of(row, Quantity::Interval)).map(half);
    if let Some(hidden) = halves.max_by(f64::total_cmp) {
        lines.push(format!(
            "with this many slips a bias of the interval below {hidden:.1} % may not show; take more --seeds to see smaller ones"
        ));
    }
    lines
}

fn scaling_text(findings: &ScalingFindings) -> String {
    let mut lines = vec![format!("{}; one thread; per slip past start-up", accuracy::cost::processor())];
    lines.push(format!(
        "\n{:>6} {:>6} {:>9} {:>6} {:>10} {:>10} {:>9} {:>9} {:>9} {:>7} {:>8}",
        "N", "Ns", "tolerance", "slips", "CPU s", "CPU/sim. s", "steps", "breaks", "reattach.", "leaps", "ns/step"
    ));
    for row in &findings.sizes {
        lines.push(format!(
            "{:>6} {:>6} {:>9e} {:>6} {:>10.2e} {:>10.2e} {:>9.0} {:>9.0} {:>9.0} {:>7.0} {:>8.0}",
            row.parameters.blocks,
            row.parameters.contacts_per_block,
            row.tolerance,
            row.cost.timed_slips,
            row.cost.per_slip,
            row.cost.per_simulated_second,
            row.cost.steps_per_slip,
            row.breaks_per_slip,
            row.reattachments_per_slip,
            row.leaps_per_slip,
            1e9 * row.cost.per_step
        ));
    }
    lines.push(format!(
        "\n{:13} {:>9} {:>17} {:>10} {:>9} {:>9} {:>8}",
        "exponents of", "tolerance", "CPU s", "CPU/sim. s", "steps", "breaks", "ns/step"
    ));
    for row in &findings.exponents {
        lines.push(format!(
            "{:>13} {:>9e} {:>17.2} {:>10.2} {:>9.2} {:>9.2} {:>8.2}",
            row.size.key(),
            row.tolerance,
            row.cpu_per_slip,
            row.cpu_per_simulated_second,
            row.steps_per_slip,
            row.breaks_per_slip,
            row.cpu_per_step
        ));
    }
    lines.push(String::new());
    lines.join("\n")
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
