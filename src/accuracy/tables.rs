//! Columns of the tables that an accuracy study, scaling and the hard cases write; their JSON has the same fields.
//!
//! Unlike the tables of a sweep these hold times, of the machine that they were measured on.

use super::breaks::BreakErrors;
use super::cpu::Cost;
use super::hard_cases::Stability;
use super::scaling::{Exponents, SizeRow};
use super::study::{DistanceRow, MethodRow};
use crate::model::{Parameters, Symbol};
use crate::solver::Solver;
use crate::table::columns::{Column, Getter, Table};

/// Method of a solver, as sweep files name it.
pub(super) fn method(solver: Solver) -> &'static str {
    match solver {
        Solver::EventDriven { .. } => "event-driven",
        Solver::FixedStep { .. } => "fixed-step",
    }
}

/// Its one setting: tolerance, or dt in s.
fn setting(solver: Solver) -> f64 {
    match solver {
        Solver::EventDriven { tolerance } => tolerance,
        Solver::FixedStep { time_step } => time_step,
    }
}

/// A row about one solver under one drive.
trait Solved {
    fn parameters(&self) -> &Parameters;
    fn solver(&self) -> Solver;
}

impl Solved for MethodRow {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn solver(&self) -> Solver {
        self.solver
    }
}

impl Solved for DistanceRow {
    fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    fn solver(&self) -> Solver {
        self.solver
    }
}

/// The drive and the solver.
fn solved<Row: Solved>() -> [Column<Row>; 5] {
    [
        Column::parameter(Symbol::V0, Row::parameters),
        Column::parameter(Symbol::Delta, Row::parameters),
        Column::parameter(Symbol::T, Row::parameters),
        Column::new("method", "", "event-driven or fixed-step", Getter::Text(|row| method(row.solver()).to_owned())),
        Column::new("setting", "", "tolerance, or dt in s", Getter::Real(|row| setting(row.solver()))),
    ]
}

/// A row about something that was timed.
trait Timed {
    fn cost(&self) -> &Cost;
}

impl Timed for MethodRow {
    fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Timed for SizeRow {
    fn cost(&self) -> &Cost {
        &self.cost
    }
}

/// What it costs.
fn timed<Row: Timed>() -> [Column<Row>; 5] {
    [
        Column::new(
            "cpu_per_simulated_second",
            "",
            "CPU seconds per simulated second, one thread",
            Getter::Real(|row| row.cost().per_simulated_second),
        ),
        Column::new("cpu_per_slip", "s", "CPU time per slip", Getter::Real(|row| row.cost().per_slip)),
        Column::new("cpu_per_step", "s", "CPU time per step", Getter::Real(|row| row.cost().per_step)),
        Column::new("steps_per_slip", "", "steps per slip", Getter::Real(|row| row.cost().steps_per_slip)),
        Column::new(
            "timed_slips",
            "",
            "slips that were timed; 0 if the cost per slip is extrapolated from that of a step",
            Getter::Count(|row| row.cost().timed_slips),
        ),
    ]
}

/// Cost and errors of every solver under every drive.
pub fn methods() -> Table<MethodRow> {
    type Row = MethodRow;
    fn breaks(row: &Row, of: fn(&BreakErrors) -> f64) -> Option<f64> {
        row.break_times.as_ref().map(of).filter(|value| value.is_finite())
    }
    let errors = [
        Column::new(
            "cpu_spread",
            "",
            "CPU time per step of the dearest realisation over that of the cheapest, which the costs are",
            Getter::Real(|row: &Row| row.cost_spread),
        ),
        Column::new(
            "compared_breaks",
            "",
            "number K of first breaks whose times are compared with those at the tightest tolerance",
            Getter::OptionalCount(|row| row.break_times.map(|errors| errors.breaks)),
        ),
        Column::new(
            "missing_breaks",
            "",
            "of these, breaks that were not made",
            Getter::OptionalCount(|row| row.break_times.map(|errors| errors.missing)),
        ),
        Column::new(
            "median_break_error",
            "s",
            "median error of their times",
            Getter::OptionalReal(|row| breaks(row, |errors| errors.median)),
        ),
        Column::new(
            "largest_break_error",
            "s",
            "largest error of their times",
            Getter::OptionalReal(|row| breaks(row, |errors| errors.largest)),
        ),
        Column::new(
            "together_breaks",
            "",
            "breaks before the trajectories are apart",
            Getter::OptionalCount(|row| row.break_times.map(|errors| errors.together)),
        ),
        Column::new(
            "together_seconds",
            "s",
            "model time before the trajectories are apart",
            Getter::OptionalReal(|row| breaks(row, |errors| errors.together_seconds)),
        ),
        Column::new(
            "together_throughout",
            "",
            "whether they are not, as far as the reference reaches",
            Getter::Flag(|row| row.break_times.is_some_and(|errors| errors.together_throughout)),
        ),
        Column::new(
            "ledger_residual",
            "",
            "residual of the energy ledger, relative to the work of the drive",
            Getter::OptionalReal(|row| row.ledger_residual),
        ),
    ];
    Table {
        name: "methods",
        meaning: "One row per drive and solver setting",
        columns: solved().into_iter().chain(timed()).chain(errors).collect(),
    }
}

/// A distance, the ends of its interval and what it is by chance.
macro_rules! distance {
    ($name:literal, $field:ident, $meaning:literal) => {
        [
            Column::new($name, "", $meaning, Getter::Real(|row: &DistanceRow| row.distances.$field.value)),
            Column::new(
                concat!($name, "_low"),
                "",
                "lower end of its 95 % interval",
                Getter::Real(|row| row.distances.$field.low),
            ),
            Column::new(concat!($name, "_high"), "", "upper end", Getter::Real(|row| row.distances.$field.high)),
            Column::new(
                concat!($name, "_floor"),
                "",
                "95 % quantile of the distance by chance alone",
                Getter::Real(|row| row.distances.$field.floor),
            ),
        ]
    };
}

/// A bias and the ends of its interval.
macro_rules! bias {
    ($name:literal, $field:ident, $meaning:literal) => {
        [
            Column::new($name, "", $meaning, Getter::Real(|row: &DistanceRow| row.distances.$field.value)),
            Column::new(
                concat!($name, "_low"),
                "",
                "lower end of its 95 % interval",
                Getter::Real(|row| row.distances.$field.low),
            ),
            Column::new(concat!($name, "_high"), "", "upper end", Getter::Real(|row| row.distances.$field.high)),
        ]
    };
}

/// Distances of distributions from those of the reference ensemble.
pub fn distances() -> Table<DistanceRow> {
    let samples = [
        Column::new(
            "quantity",
            "",
            "interval, phase, drop, peak_force, duration or front_speed",
            Getter::Text(|row: &DistanceRow| row.quantity.name().to_owned()),
        ),
        Column::new("slips", "", "size of the sample", Getter::Count(|row| row.sizes.0)),
        Column::new("reference_slips", "", "size of the reference sample", Getter::Count(|row| row.sizes.1)),
        Column::new("mean", "", "mean", Getter::Real(|row| row.means.0)),
        Column::new("reference_mean", "", "mean of the reference", Getter::Real(|row| row.means.1)),
        Column::new("deviation", "", "standard deviation", Getter::Real(|row| row.deviations.0)),
        Column::new(
            "reference_deviation",
            "",
            "standard deviation of the reference",
            Getter::Real(|row| row.deviations.1),
        ),
    ];
    let wasserstein = distance!("w1", wasserstein, "Wasserstein-1 distance");
    let kolmogorov = distance!("ks", kolmogorov, "Kolmogorov-Smirnov distance");
    let mean = bias!("mean_bias", mean, "mean less that of the reference");
    let deviation = bias!("deviation_bias", deviation, "standard deviation less that of the reference");
    let biases = mean.into_iter().chain(deviation);
    Table {
        name: "distances",
        meaning: "One row per drive, solver setting and quantity; means, deviations, their biases and w1 are in its unit, \
                  that of the column of this name in `slips`",
        columns: solved().into_iter().chain(samples).chain(biases).chain(wasserstein).chain(kolmogorov).collect(),
    }
}

/// Cost at every size of the slider.
pub fn sizes() -> Table<SizeRow> {
    let sizes = [
        Column::parameter(Symbol::N, |row: &SizeRow| &row.parameters),
        Column::parameter(Symbol::Ns, |row| &row.parameters),
        Column::new("tolerance", "", "tolerance of the event-driven solver", Getter::Real(|row| row.tolerance)),
    ];
    let events = [
        Column::new(
            "leaps_per_slip",
            "",
            "of the steps, leaps per slip",
            Getter::Real(|row: &SizeRow| row.leaps_per_slip),
        ),
        Column::new(
            "breaks_per_slip",
            "",
            "contacts broken per slip, those between slips included",
            Getter::Real(|row| row.breaks_per_slip),
        ),
        Column::new(
            "reattachments_per_slip",
            "",
            "contacts reattached per slip",
            Getter::Real(|row| row.reattachments_per_slip),
        ),
    ];
    Table {
        name: "scaling",
        meaning: "One row per size of the slider and tolerance; start-up is left out",
        columns: sizes.into_iter().chain(timed()).chain(events).collect(),
    }
}

/// How the cost grows with the size.
pub fn exponents() -> Table<Exponents> {
    Table {
        name: "scaling-exponents",
        meaning: "One row per what grows and tolerance: exponents of the powers of it that fit the rows of `scaling` best",
        columns: vec![
            Column::new(
                "size",
                "",
                "what grows, N or Ns; the other is at its default",
                Getter::Text(|row: &Exponents| row.size.key().to_owned()),
            ),
            Column::new("tolerance", "", "tolerance of the event-driven solver", Getter::Real(|row| row.tolerance)),
            Column::new("cpu_per_slip", "", "exponent of CPU time per slip", Getter::Real(|row| row.cpu_per_slip)),
            Column::new(
                "cpu_per_simulated_second",
                "",
                "exponent of CPU time per simulated time",
                Getter::Real(|row| row.cpu_per_simulated_second),
            ),
            Column::new("cpu_per_step", "", "exponent of CPU time per step", Getter::Real(|row| row.cpu_per_step)),
            Column::new("steps_per_slip", "", "exponent of steps per slip", Getter::Real(|row| row.steps_per_slip)),
            Column::new("breaks_per_slip", "", "exponent of breaks per slip", Getter::Real(|row| row.breaks_per_slip)),
        ],
    }
}

/// How the hard cases went.
pub fn stability() -> Table<Stability> {
    Table {
        name: "hard-cases",
        meaning: "One row per hard case",
        columns: vec![
            Column::new("threat", "", "what breaks a naive code", Getter::Text(|row: &Stability| row.threat.clone())),
            Column::new("case", "", "what differs from the defaults", Getter::Text(|row| row.case.clone())),
            Column::new("solver", "", "method and setting", Getter::Text(|row| row.solver.clone())),
            Column::new("passed", "", "whether it ended as it must", Getter::Flag(|row| row.passed)),
            Column::new("outcome", "", "how it ended", Getter::Text(|row| row.outcome.clone())),
            Column::new("simulated_time", "s", "model time", Getter::OptionalReal(|row| row.simulated_seconds)),
            Column::new("slips", "", "slips", Getter::Count(|row| row.slips)),
            Column::new("steps", "", "steps of the solver", Getter::Count(|row| row.steps)),
            Column::new("leaps", "", "of these, leaps", Getter::Count(|row| row.leaps)),
            Column::new("breaks", "", "contacts broken", Getter::Count(|row| row.breaks)),
            Column::new(
                "ledger_residual",
                "",
                "residual of the energy ledger, relative to the work of the drive",
                Getter::OptionalReal(|row| row.ledger_residual),
            ),
            Column::new("cpu_time", "s", "CPU time with the audit", Getter::Real(|row| row.cpu_seconds)),
        ],
    }
}

/// All tables in Markdown, one section each.
#[must_use]
pub fn markdown() -> String {
    let study = [methods().markdown(), distances().markdown()];
    let others = [sizes().markdown(), exponents().markdown(), stability().markdown()];
    [&study[..], &others].concat().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::columns::tests::assert_documented;

    #[test]
    fn documented_tables_of_accuracy_are_those_written() {
        let text = format!(
            "# Tables of `stickslip accuracy`\n\nUnits are SI. Times are CPU times of one thread; the processor is in the \
             footer of each file, under `processor`. The JSON has the same rows, see \
             [results.md](results.md#json-output).\n\n{}",
            markdown()
        );
        assert_documented("accuracy-tables.md", &text);
    }
}
