//! `stickslip accuracy`: speed against error of the solvers, measured in one run.

use super::exit::{Exit, UsageError};
use super::output;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use stickslip::accuracy::{
    self, Findings, MethodRow, Quantity, Scaling, ScalingFindings, Stability, Study, described, drive_in_words,
    hard_cases, scaling_json, stability_json,
};
use stickslip::store::storage::Disk;

/// Measure speed against error of the solvers in one run
#[derive(Debug, Args)]
#[command(after_help = "\
Before chaos: errors of the first break times against the tightest tolerance. After chaos: Wasserstein-1 and
Kolmogorov-Smirnov distances of intervals, phases and drops from a reference ensemble, with bootstrap intervals.
And the residual of the energy ledger. Cost is CPU time of one thread; keep the machine free of other work.

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
    /// Fewer settings and slips
    #[arg(long)]
    quick: bool,
    /// Realisations of each ensemble [default: 8, with --quick 2]
    #[arg(long, value_name = "N")]
    seeds: Option<u64>,
    /// Slips of each realisation [default: 100, with --quick 12]
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
    let findings = study.run(&mut |next| output::tell(next))?;
    let files = accuracy::write(&Disk, &arguments.out, &study, &findings)?;
    if arguments.json {
        output::json(&accuracy::as_json(&study, &findings))?;
    } else {
        output::print(&study_text(&study, &findings))?;
        print_files(&files)?;
    }
    Ok(Exit::Done)
}

fn run_scaling(arguments: &Arguments) -> Result<Exit> {
    let scaling = if arguments.quick { Scaling::quick() } else { Scaling::full() };
    let findings = scaling.run(&mut |next| output::tell(next))?;
    let files = accuracy::write_scaling(&Disk, &arguments.out, &findings)?;
    if arguments.json {
        output::json(&scaling_json(&findings))?;
    } else {
        output::print(&scaling_text(&findings))?;
        print_files(&files)?;
    }
    Ok(Exit::Done)
}

fn run_hard_cases(arguments: &Arguments) -> Result<Exit> {
    let mut rows = Vec::new();
    for case in hard_cases() {
        output::tell(&format!("{}: {}", case.threat, case.name()));
        rows.push(case.run());
    }
    let files = accuracy::write_stability(&Disk, &arguments.out, &rows)?;
    if arguments.json {
        output::json(&stability_json(&rows))?;
    } else {
        output::print(&stability_text(&rows))?;
        print_files(&files)?;
    }
    Ok(if rows.iter().all(|row| row.passed) { Exit::Done } else { Exit::Failed })
}

fn print_files(files: &[PathBuf]) -> Result<()> {
    files.iter().try_for_each(|file| output::print(&format!("{}\n", file.display())))
}

fn or_dash(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1e}"))
}

fn study_text(study: &Study, findings: &Findings) -> String {
    let mut lines = vec![format!("{}; one thread; first {} breaks", accuracy::cpu::processor(), study.breaks)];
    let mut drive = None;
    for row in &findings.methods {
        if drive != Some(&row.parameters) {
            drive = Some(&row.parameters);
            lines.push(format!("\n{}", drive_in_words(&row.parameters)));
            lines.push(format!(
                "{:30} {:>10} {:>10} {:>8} {:>10} {:>10} {:>22} {:>9} {:>24} {:>13}",
                "solver",
                "CPU/sim. s",
                "CPU/slip s",
                "ns/step",
                "break med.",
                "break max.",
                "together",
                "ledger",
                "W1 of tau (by chance) s",
                "KS of tau"
            ));
        }
        lines.push(study_line(row, findings));
    }
    lines.push("\n* extrapolated from the cost of a step; > together as far as the reference reaches\n".to_owned());
    lines.join("\n")
}

fn study_line(row: &MethodRow, findings: &Findings) -> String {
    let cost = &row.cost;
    let mark = if cost.timed_slips == 0 { "*" } else { "" };
    let together = row.break_times.map_or_else(
        || "-".to_owned(),
        |errors| {
            let mark = if errors.together_throughout { ">" } else { "" };
            format!("{mark}{} breaks, {:.3} s", errors.together, errors.together_seconds)
        },
    );
    let distance = findings.distances.iter().find(|distance| {
        distance.quantity == Quantity::Interval
            && distance.parameters == row.parameters
            && distance.solver == row.solver
    });
    let (wasserstein, kolmogorov) = distance.map_or_else(
        || ("-".to_owned(), "-".to_owned()),
        |row| {
            let (w, k) = (row.distances.wasserstein, row.distances.kolmogorov);
            (format!("{:.2e} ({:.2e})", w.value, w.floor), format!("{:.3} ({:.3})", k.value, k.floor))
        },
    );
    format!(
        "{:30} {:>10.2e} {:>10} {:>8.0} {:>10} {:>10} {:>22} {:>9} {:>24} {:>13}",
        described(row.solver),
        cost.per_simulated_second,
        format!("{:.2e}{mark}", cost.per_slip),
        1e9 * cost.per_step,
        or_dash(row.break_times.map(|errors| errors.median)),
        or_dash(row.break_times.map(|errors| errors.largest)),
        together,
        or_dash(row.ledger_residual.map(f64::abs)),
        wasserstein,
        kolmogorov
    )
}

fn scaling_text(findings: &ScalingFindings) -> String {
    let mut lines = vec![format!("{}; one thread; per slip past start-up", accuracy::cpu::processor())];
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
            format!("; {time:.3} s in {steps} steps, ledger {}, {cpu:.2} s", or_dash(row.ledger_residual))
        });
        lines.push(format!("  {mark} {} ({}): {}{time}", row.case, row.solver, row.outcome));
    }
    let failed = rows.iter().filter(|row| !row.passed).count();
    lines.push(format!("\n{} of {} cases passed\n", rows.len() - failed, rows.len()));
    lines.join("\n")
}
