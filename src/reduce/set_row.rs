//! The table of sets: a row of statistics for each.

use super::confidence::Interval;
use super::moments::Moments;
use crate::model::{Parameters, Symbol};
use crate::table::columns::{Table, columns};
use crate::table::selected::{Selected, Selection};

/// What the jobs table says about a set.
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

/// All parameters but the seed, which a set has not.
#[derive(Clone, Debug, PartialEq)]
pub struct AllButSeed;

impl Selection for AllButSeed {
    const SYMBOLS: &'static [Symbol] = Symbol::ALL.split_last().expect("there are parameters").1;
}

columns! {
    /// A row of the reduced sets. Quantities are SI; `None` where there is nothing to average.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SetRow {
        set_id: String = "", "hash of all that defines a job but the seed";
        parameters: Selected<AllButSeed>;
        eta: f64 = "", "2 pi Delta / (T V0); 0 without modulation";
        finished_jobs as "jobs": u64 = "", "jobs run to an end, one per seed";
        failed_jobs: u64 = "", "jobs that failed";
        slips: u64 = "", "slips of all seeds";
        intervals: u64 = "", "intervals between slips";
        effective_slips: Option<f64> = "", "independent phases that tell as much as the correlated ones";
        effective_intervals: Option<f64> = "", "the same of intervals";
        startup_p: Option<f64> = "",
            "p-value of the rank test of the intervals of each job's first 3 slips against those of its later half";
        tau_mean: Option<f64> = "s", "mean interval";
        tau_interval as "tau_mean": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_deviation as "tau_sd": Option<f64> = "s", "standard deviation of the intervals";
        tau_05: Option<f64> = "s", "5 % quantile of the intervals";
        tau_25: Option<f64> = "s", "25 % quantile";
        tau_50: Option<f64> = "s", "median";
        tau_75: Option<f64> = "s", "75 % quantile";
        tau_95: Option<f64> = "s", "95 % quantile";
        periods_mean: Option<f64> = "", "mean of the intervals over T at their onset";
        locking_index: Option<f64> = "", "|<exp(2 pi i tau / T)>|: 1 if every interval is a whole number of periods";
        locking_interval as "locking_index": Option<Interval> = "", "lower end of its 95 % confidence interval";
        phase_mean: Option<f64> = "rad", "circular mean of the phase";
        phase_interval as "phase_mean": Option<Interval> = "rad",
            "lower end of its 95 % confidence interval; the whole turn if no direction is excluded";
        resultant_length: Option<f64> = "", "|<exp(i phi)>|: 1 if every slip has the same phase";
        length_interval as "resultant_length": Option<Interval> = "", "lower end of its 95 % confidence interval";
        rayleigh_p: Option<f64> = "", "p-value of the Rayleigh test against uniform phases, with effective_slips";
        load_rayleigh_p: Option<f64> = "",
            "the same of the load phases phi + eta cos(phi), with their effective number, for eta < 1: slips at random loads are uniform in it";
        share_below: Option<f64> = "", "share of slips with a phase under phi_min(eta) - 0.15 rad; null for eta < 1";
        is_locked as "locked": bool = "", "rayleigh_p < 0.001 and resultant_length > 0.5";
        drop_mean: Option<f64> = "N", "mean stress drop";
        drop_interval as "drop_mean": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        drop_deviation as "drop_sd": Option<f64> = "N", "standard deviation of the stress drop";
        peak_force_mean: Option<f64> = "N", "mean shear force at the onset of slips";
        mean_friction: Option<f64> = "N", "time-averaged shear force, mean over jobs";
        mean_friction_interval as "mean_friction": Option<Interval> = "N",
            "lower end of its 95 % confidence interval, of jobs as units";
        duration_mean: Option<f64> = "s", "mean duration of slips";
        precursors_mean: Option<f64> = "", "mean precursors per slip";
        front_speed_mean: Option<f64> = "m/s", "mean front speed of slips";
        slow_front_speed_mean: Option<f64> = "m/s", "mean speed of slow fronts, where there were any";
    }
}

impl Table for SetRow {
    const NAME: &'static str = "sets";
    const MEANING: &'static str = "One row per parameter set, all seeds together";
}
