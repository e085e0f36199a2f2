//! Columns of the tables that an accuracy study and the hard cases write.
//!
//! Unlike the tables of a sweep these hold times, of the machine that they were measured on.

use super::breaks::BreakErrors;
use super::hard_cases::Stability;
use super::study::{DistanceRow, MethodRow};
use crate::model::Symbol;
use crate::solver::Solver;
use crate::store::columns::{Column, Getter, Table};

/// Method of a solver, as sweep files name it.
pub(super) fn method(solver: Solver) -> &'static str {
    match solver {
        Solver::EventDriven { .. } => "event-driven",
        Solver::FixedStep { .. } => "fixed-step",
    }
}

/// Its one setting: tolerance, or dt in s.
pub(super) fn setting(solver: Solver) -> f64 {
    match solver {
        Solver::EventDriven { tolerance } => tolerance,
        Solver::FixedStep { time_step } => time_step,
    }
}

/// Cost and errors of every solver under every drive.
pub fn methods() -> Table<MethodRow> {
    type Row = MethodRow;
    fn breaks(row: &Row, of: fn(&BreakErrors) -> f64) -> Option<f64> {
        row.break_times.as_ref().map(of).filter(|value| value.is_finite())
    }
    Table {
        name: "methods",
        meaning: "One row per drive and solver setting",
        columns: vec![
            Column::parameter(Symbol::V0, |row: &Row| &row.parameters),
            Column::parameter(Symbol::Delta, |row: &Row| &row.parameters),
            Column::parameter(Symbol::T, |row: &Row| &row.parameters),
            Column::new("method", "", "event-driven or fixed-step", Getter::Text(|row| method(row.solver).to_owned())),
            Column::new("setting", "", "tolerance, or dt in s", Getter::Real(|row| setting(row.solver))),
            Column::new(
                "cpu_per_simulated_second",
                "",
                "CPU seconds per simulated second, one thread",
                Getter::Real(|row| row.cost.per_simulated_second),
            ),
            Column::new("cpu_per_slip", "s", "CPU time per slip", Getter::Real(|row| row.cost.per_slip)),
            Column::new("cpu_per_step", "s", "CPU time per step", Getter::Real(|row| row.cost.per_step)),
            Column::new("steps_per_slip", "", "steps per slip", Getter::Real(|row| row.cost.steps_per_slip)),
            Column::new(
                "timed_slips",
                "",
                "slips that were timed; 0 if the cost per slip is extrapolated from that of a step",
                Getter::Count(|row| row.cost.timed_slips),
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
                "ledger_residual",
                "",
                "residual of the energy ledger, relative to the work of the drive",
                Getter::OptionalReal(|row| row.ledger_residual),
            ),
        ],
    }
}

/// Distances of distributions from those of the reference ensemble.
pub fn distances() -> Table<DistanceRow> {
    type Row = DistanceRow;
    Table {
        name: "distances",
        meaning: "One row per drive, solver setting and quantity; distances are in its unit: s for interval, rad for phase, N \
                  for drop",
        columns: vec![
            Column::parameter(Symbol::V0, |row: &Row| &row.parameters),
            Column::parameter(Symbol::Delta, |row: &Row| &row.parameters),
            Column::parameter(Symbol::T, |row: &Row| &row.parameters),
            Column::new("method", "", "event-driven or fixed-step", Getter::Text(|row| method(row.solver).to_owned())),
            Column::new("setting", "", "tolerance, or dt in s", Getter::Real(|row| setting(row.solver))),
            Column::new("quantity", "", "interval, phase or drop", Getter::Text(|row| row.quantity.name().to_owned())),
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
            Column::new("w1", "", "Wasserstein-1 distance", Getter::Real(|row| row.distances.wasserstein.value)),
            Column::new(
                "w1_low",
                "",
                "lower end of its 95 % interval",
                Getter::Real(|row| row.distances.wasserstein.low),
            ),
            Column::new("w1_high", "", "upper end", Getter::Real(|row| row.distances.wasserstein.high)),
            Column::new(
                "w1_floor",
                "",
                "95 % quantile of the distance by chance alone",
                Getter::Real(|row| row.distances.wasserstein.floor),
            ),
            Column::new("ks", "", "Kolmogorov-Smirnov distance", Getter::Real(|row| row.distances.kolmogorov.value)),
            Column::new(
                "ks_low",
                "",
                "lower end of its 95 % interval",
                Getter::Real(|row| row.distances.kolmogorov.low),
            ),
            Column::new("ks_high", "", "upper end", Getter::Real(|row| row.distances.kolmogorov.high)),
            Column::new(
                "ks_floor",
                "",
                "95 % quantile of the distance by chance alone",
                Getter::Real(|row| row.distances.kolmogorov.floor),
            ),
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
