//! The table of sets: a row of statistics for each.

use super::confidence::Interval;
use super::moments::Moments;
use crate::model::{Parameters, Symbol};
use crate::table::columns::{Column, Getter, Table};

/// What the jobs table tells about a set.
#[derive(Clone, Debug, PartialEq)]
pub struct SetJobs {
    /// Id of the set, 32 hexadecimal characters.
    pub set_id: String,
    /// Its parameters; the seed is that of any of its jobs.
    pub parameters: Parameters,
    /// Jobs that were run to an end.
    pub finished: u64,
    /// Jobs that failed.
    pub failed: u64,
    /// Slips that the jobs recorded.
    pub slips: u64,
    /// Time-averaged shear force of the jobs, in N.
    pub friction: Moments,
}

/// A row of the reduced sets. Quantities are SI; `None` where there is nothing to average.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "each is described in `sets`, the table of these rows")]
pub struct SetRow {
    pub jobs: SetJobs,
    pub eta: f64,
    pub slips: u64,
    pub intervals: u64,
    pub effective_slips: Option<f64>,
    pub effective_intervals: Option<f64>,
    pub startup_p: Option<f64>,
    pub tau_mean: Option<f64>,
    pub tau_interval: Option<Interval>,
    pub tau_deviation: Option<f64>,
    pub tau_quantiles: [Option<f64>; 5],
    pub periods_mean: Option<f64>,
    pub locking_index: Option<f64>,
    pub locking_interval: Option<Interval>,
    pub phase_mean: Option<f64>,
    pub phase_interval: Option<Interval>,
    pub resultant_length: Option<f64>,
    pub length_interval: Option<Interval>,
    pub rayleigh_p: Option<f64>,
    pub load_rayleigh_p: Option<f64>,
    pub share_below: Option<f64>,
    pub is_locked: bool,
    pub drop_mean: Option<f64>,
    pub drop_interval: Option<Interval>,
    pub drop_deviation: Option<f64>,
    pub peak_force_mean: Option<f64>,
    pub duration_mean: Option<f64>,
    pub precursors_mean: Option<f64>,
    pub front_speed_mean: Option<f64>,
    pub slow_front_speed_mean: Option<f64>,
}

/// The table of sets.
#[must_use]
pub fn sets() -> Table<SetRow> {
    let mut columns = vec![Column::new(
        "set_id",
        "",
        "hash of all that defines a job but the seed",
        Getter::Text(|row: &SetRow| row.jobs.set_id.clone()),
    )];
    let parameters = Symbol::ALL.into_iter().filter(|&symbol| symbol != Symbol::Seed);
    columns.extend(parameters.map(|symbol| Column::parameter(symbol, |row: &SetRow| &row.jobs.parameters)));
    columns.extend([numbers(), intervals(), phases(), forces_and_fronts()].into_iter().flatten());
    Table { name: "sets", meaning: "One row per parameter set, all seeds together", columns }
}

/// How much there is.
fn numbers() -> Vec<Column<SetRow>> {
    use Getter::{Count, OptionalReal, Real};
    vec![
        Column::new("eta", "", "2 pi Delta / (T V0); 0 without modulation", Real(|row| row.eta)),
        Column::new("jobs", "", "jobs run to an end, one per seed", Count(|row| row.jobs.finished)),
        Column::new("failed_jobs", "", "jobs that failed", Count(|row| row.jobs.failed)),
        Column::new("slips", "", "slips of all seeds", Count(|row| row.slips)),
        Column::new("intervals", "", "intervals between slips", Count(|row| row.intervals)),
        Column::new(
            "effective_slips",
            "",
            "independent phases that tell as much as the correlated ones",
            OptionalReal(|row| row.effective_slips),
        ),
        Column::new("effective_intervals", "", "the same of intervals", OptionalReal(|row| row.effective_intervals)),
        Column::new(
            "startup_p",
            "",
            "p-value of the rank test of the intervals of each job's first 3 slips against those of its later half",
            OptionalReal(|row| row.startup_p),
        ),
    ]
}

/// Statistics of the interval τ.
fn intervals() -> Vec<Column<SetRow>> {
    use Getter::OptionalReal;
    vec![
        Column::new("tau_mean", "s", "mean interval", OptionalReal(|row| row.tau_mean)),
        Column::new(
            "tau_mean_low",
            "s",
            "lower end of its 95 % confidence interval",
            OptionalReal(|row| row.tau_interval.map(|interval| interval.low)),
        ),
        Column::new(
            "tau_mean_high",
            "s",
            "upper end",
            OptionalReal(|row| row.tau_interval.map(|interval| interval.high)),
        ),
        Column::new("tau_sd", "s", "standard deviation of the intervals", OptionalReal(|row| row.tau_deviation)),
        Column::new("tau_05", "s", "5 % quantile of the intervals", OptionalReal(|row| row.tau_quantiles[0])),
        Column::new("tau_25", "s", "25 % quantile", OptionalReal(|row| row.tau_quantiles[1])),
        Column::new("tau_50", "s", "median", OptionalReal(|row| row.tau_quantiles[2])),
        Column::new("tau_75", "s", "75 % quantile", OptionalReal(|row| row.tau_quantiles[3])),
        Column::new("tau_95", "s", "95 % quantile", OptionalReal(|row| row.tau_quantiles[4])),
        Column::new(
            "periods_mean",
            "",
            "mean of the intervals over T at their onset",
            OptionalReal(|row| row.periods_mean),
        ),
        Column::new(
            "locking_index",
            "",
            "|<exp(2 pi i tau / T)>|: 1 if every interval is a whole number of periods",
            OptionalReal(|row| row.locking_index),
        ),
        Column::new(
            "locking_index_low",
            "",
            "lower end of its 95 % confidence interval",
            OptionalReal(|row| row.locking_interval.map(|interval| interval.low)),
        ),
        Column::new(
            "locking_index_high",
            "",
            "upper end",
            OptionalReal(|row| row.locking_interval.map(|interval| interval.high)),
        ),
    ]
}

/// Statistics of the phase φ.
fn phases() -> Vec<Column<SetRow>> {
    use Getter::{Flag, OptionalReal};
    vec![
        Column::new("phase_mean", "rad", "circular mean of the phase", OptionalReal(|row| row.phase_mean)),
        Column::new(
            "phase_mean_low",
            "rad",
            "lower end of its 95 % confidence interval; the whole turn if no direction is excluded",
            OptionalReal(|row| row.phase_interval.map(|interval| interval.low)),
        ),
        Column::new(
            "phase_mean_high",
            "rad",
            "upper end",
            OptionalReal(|row| row.phase_interval.map(|interval| interval.high)),
        ),
        Column::new(
            "resultant_length",
            "",
            "|<exp(i phi)>|: 1 if every slip has the same phase",
            OptionalReal(|row| row.resultant_length),
        ),
        Column::new(
            "resultant_length_low",
            "",
            "lower end of its 95 % confidence interval",
            OptionalReal(|row| row.length_interval.map(|interval| interval.low)),
        ),
        Column::new(
            "resultant_length_high",
            "",
            "upper end",
            OptionalReal(|row| row.length_interval.map(|interval| interval.high)),
        ),
        Column::new(
            "rayleigh_p",
            "",
            "p-value of the Rayleigh test against uniform phases, with effective_slips",
            OptionalReal(|row| row.rayleigh_p),
        ),
        Column::new(
            "load_rayleigh_p",
            "",
            "the same of the load phases phi + eta cos(phi), with their effective number, for eta < 1: slips at random loads are uniform in it",
            OptionalReal(|row| row.load_rayleigh_p),
        ),
        Column::new(
            "share_below",
            "",
            "share of slips with a phase under phi_min(eta) - 0.15 rad; null for eta < 1",
            OptionalReal(|row| row.share_below),
        ),
        Column::new("locked", "", "rayleigh_p < 0.001 and resultant_length > 0.5", Flag(|row| row.is_locked)),
    ]
}

/// Means of the other measurements.
fn forces_and_fronts() -> Vec<Column<SetRow>> {
    use Getter::OptionalReal;
    vec![
        Column::new("drop_mean", "N", "mean stress drop", OptionalReal(|row| row.drop_mean)),
        Column::new(
            "drop_mean_low",
            "N",
            "lower end of its 95 % confidence interval",
            OptionalReal(|row| row.drop_interval.map(|interval| interval.low)),
        ),
        Column::new(
            "drop_mean_high",
            "N",
            "upper end",
            OptionalReal(|row| row.drop_interval.map(|interval| interval.high)),
        ),
        Column::new("drop_sd", "N", "standard deviation of the stress drop", OptionalReal(|row| row.drop_deviation)),
        Column::new(
            "peak_force_mean",
            "N",
            "mean shear force at the onset of slips",
            OptionalReal(|row| row.peak_force_mean),
        ),
        Column::new(
            "mean_friction",
            "N",
            "time-averaged shear force, mean over jobs",
            OptionalReal(|row| row.jobs.friction.mean()),
        ),
        Column::new(
            "mean_friction_low",
            "N",
            "lower end of its 95 % confidence interval, of jobs as units",
            OptionalReal(|row| row.jobs.friction.interval().map(|interval| interval.low)),
        ),
        Column::new(
            "mean_friction_high",
            "N",
            "upper end",
            OptionalReal(|row| row.jobs.friction.interval().map(|interval| interval.high)),
        ),
        Column::new("duration_mean", "s", "mean duration of slips", OptionalReal(|row| row.duration_mean)),
        Column::new("precursors_mean", "", "mean precursors per slip", OptionalReal(|row| row.precursors_mean)),
        Column::new("front_speed_mean", "m/s", "mean front speed of slips", OptionalReal(|row| row.front_speed_mean)),
        Column::new(
            "slow_front_speed_mean",
            "m/s",
            "mean speed of slow fronts, where there were any",
            OptionalReal(|row| row.slow_front_speed_mean),
        ),
    ]
}
