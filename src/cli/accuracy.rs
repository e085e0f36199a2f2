//! `stickslip accuracy`: speed against error of the solvers, measured in one run.

use super::exit::{Exit, UsageError};
use super::output;
use crate::accuracy::{
    self, Distances, Findings, MethodRow, Quantity, Report, Scaling, ScalingFindings, Stability, Study, drive_in_words,
    hard_cases, scaling_report, solver_in_words, stability_report, study_report,
};
use crate::table::shown::shown;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Measure speed against error of the solvers in one run
#[derive(Debug, Args)]
#[command(after_help = "\
Before chaos: errors of the first break times against the tightest tolerance. After chaos: distances of the
distributions of slips from a reference ensemble, and biases, with bootstrap intervals. And the residual of the
energy ledger. The event-driven solver counts as two methods, on the grid and in Taylor steps. Cost is CPU time of
one thread, that of the cheapest realisation; keep the machine free of other work: the spread over realisations,
which are timed in turn with those of the other solvers, shows how free it was.

Examples:
  stickslip accuracy --quick                 a first look, in about a minute
  stickslip accuracy --out results/accuracy  the full study: tables, accuracy.json, work-precision figures
  stickslip accuracy --scaling               what a slip costs with N and Ns, in two minutes; --quick: in seconds
  stickslip accuracy --hard-cases            parameters that break a naive code, one row each")]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub struct Arguments {
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

/// The table of docs/numerics.md, and how far the distributions of slips are from those of the reference.
fn study_text(study: &Study, findings: &Findings) -> String {
    let mut lines = vec![format!("{}; one thread; first {} breaks", accuracy::cost::processor(), study.breaks)];
    for is_modulated in [false, true] {
        let such = |row: &&MethodRow| row.parameters.modulation_period.is_some() == is_modulated;
        let rows: Vec<&MethodRow> = findings.methods.iter().filter(such).collect();
        lines.extend(cost_table(study, &rows));
    }
    lines.push("* extrapolated from the cost of a step; > together as far as the reference reaches".to_owned());
    lines.extend(distance_table(findings));
    lines.push(String::new());
    lines.join("\n")
}

/// Texts side by side.
fn cells(texts: impl Iterator<Item = String>) -> String {
    texts.map(|text| format!("{text:>13}")).collect::<Vec<_>>().concat()
}

/// Costs at every velocity; errors at the first, where every solver has them.
fn cost_table(study: &Study, rows: &[&MethodRow]) -> Vec<String> {
    let Some(first) = rows.first() else { return Vec::new() };
    let at = |velocity: f64| move |row: &&&MethodRow| row.parameters.drive_velocity == velocity;
    let costs = cells(study.velocities.iter().map(|velocity| format!("{velocity:e} m/s")));
    let mut lines = vec![
        format!(
            "\nCPU time per slip in ms, by the cheapest of {} realisations, timed in turn; the rest, with the CPU time of the \
             median and of the dearest over that, at {}",
            first.timings,
            drive_in_words(&first.parameters)
        ),
        format!(
            "{:30}{costs} {:>8} {:>7} {:>7} {:>18} {:>24} {:>9}",
            "solver", "ns/step", "median", "dearest", "break times (s)", "together", "ledger"
        ),
    ];
    for row in rows.iter().filter(at(first.parameters.drive_velocity)) {
        let same = |velocity: &f64| rows.iter().filter(at(*velocity)).find(|other| other.solver == row.solver);
        let cost = |row: &&MethodRow| {
            let mark = if row.cost.timed_slips == 0 { "*" } else { "" };
            format!("{:.2}{mark}", 1e3 * row.cost.per_slip)
        };
        let costs = cells(study.velocities.iter().filter_map(same).map(cost));
        let errors = row.break_times;
        let times = errors.median.zip(errors.largest).map(|(median, largest)| format!("{median:.0e} ({largest:.0e})"));
        let together = errors.together.zip(errors.together_seconds).map(|(breaks, seconds)| {
            let mark = if errors.together_throughout { ">" } else { "" };
            format!("{mark}{breaks} breaks, {seconds:.3} s")
        });
        lines.push(format!(
            "{:30}{costs} {:>8.0} {:>7.2} {:>7.2} {:>18} {:>24} {:>9}",
            solver_in_words(row.solver),
            1e9 * row.cost.per_step,
            row.median_per_slip / row.cost.per_slip,
            row.largest_per_slip / row.cost.per_slip,
            times.unwrap_or_else(|| "-".to_owned()),
            together.unwrap_or_else(|| "-".to_owned()),
            or_dash(row.ledger_residual.map(f64::abs)),
        ));
    }
    lines
}

/// Wasserstein-1 distances over their bounds by chance, drive by drive.
fn distance_table(findings: &Findings) -> Vec<String> {
    let mut lines = vec!["\nW1 of distributions over the 95 % bound by chance".to_owned()];
    let mut drive = None;
    let heading = cells(Quantity::ALL.iter().map(|quantity| quantity.name().to_owned()));
    for row in &findings.methods {
        let found: Vec<Option<&Distances>> =
            Quantity::ALL.iter().map(|&quantity| findings.distances_of(row, quantity)).collect();
        if found.iter().all(Option::is_none) {
            continue;
        }
        if drive != Some(&row.parameters) {
            drive = Some(&row.parameters);
            let slips = findings.distances.iter().find(|other| other.parameters == row.parameters);
            let slips = slips.map_or(0, |row| row.slips);
            lines.push(format!("\n{}, about {slips} slips\n{:30}{heading}", drive_in_words(&row.parameters), "solver"));
        }
        let ratio = |found: Option<&Distances>| {
            let ratio = found.map(|found| found.wasserstein.value / found.wasserstein.floor);
            ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.2}"))
        };
        lines.push(format!("{:30}{}", solver_in_words(row.solver), cells(found.into_iter().map(ratio))));
    }
    let exceed = |of: fn(&Distances) -> bool| findings.distances.iter().filter(|row| of(&row.distances)).count();
    let (rows, wasserstein) =
        (findings.distances.len(), exceed(|found| found.wasserstein.value > found.wasserstein.floor));
    let kolmogorov = exceed(|found| found.kolmogorov.value > found.kolmogorov.floor);
    lines.push(format!("\nof {rows}, {wasserstein} W1 and {kolmogorov} KS distances exceed their bounds"));
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
