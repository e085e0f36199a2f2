//! What is known of a set: the columns of the reduced table of sets, with their names in figures. Reduction fills them
//! in; a sweep file may name those that are statistics. `label.rs`: columns and their values as figures write them.

mod label;

pub use label::{Digits, Label, is_same, label, power_of_ten, setting, symbol_of, with_decimals};

use crate::model::{Selected, Selection, Symbol};
use crate::observe::Regime;
use crate::table::columns::{Column, Interval, Kind, Row, columns};
use crate::table::tables;
use std::borrow::Cow;
use std::sync::LazyLock;

/// The column of 1/T, as which a swept period is shown.
pub const FREQUENCY: &str = "frequency";

/// The column that shows a parameter: of the period, the frequency.
pub const fn column_of(symbol: Symbol) -> &'static str {
    match symbol {
        Symbol::T => FREQUENCY,
        symbol => symbol.key(),
    }
}

/// What tables show of a set, where there is anything.
pub const FOUND: &[&str] = &[
    "regime",
    "slips",
    "tau_mean",
    "tau_sd",
    "mean_friction",
    "friction_coefficient",
    "resultant_length",
    "resultant_drive",
    "resultant_excess",
];

/// All parameters of a set: a set has no seed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AllButSeed;

impl Selection for AllButSeed {
    const SYMBOLS: &'static [Symbol] = Symbol::ALL.split_last().expect("there are parameters").1;
}

columns! {
    /// A row of the reduced sets. Quantities are SI; `None` where there is nothing to average.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct SetRow {
        set_id: String = "", "hash of all that defines a job but the seed";
        parameters: Selected<AllButSeed>;
        frequency: Option<f64> = "Hz", "1/T; null without modulation", "1/T" "Modulation frequency";
        eta: f64 = "", "2 pi Delta / (T V0); 0 without modulation", "η" "η = 2πΔ / (T V₀)";
        finished_jobs as "jobs": u64 = "", "jobs run to an end (finished), one per seed";
        failed_jobs: u64 = "", "jobs that failed";
        is_control as "control": bool = "", "whether its jobs are controls alone (`control = true`)";
        jobs_without_slips: u64 = "", "finished jobs that gave up as no slip came";
        jobs_cut: u64 = "", "finished jobs whose last interval `max_time` cut";
        regime: Option<Regime> = "", "`stick-slip`, `mixed` or `sliding`, as all jobs; `mixed` if they differ", "regime";
        slip_share: Option<f64> = "", "share of time within slips, over the time of all jobs", "slip share" "Share of time within slips";
        slip_share_interval as "slip_share": Option<Interval> = "", "lower end of its 95 % confidence interval, of jobs as units";
        slips: u64 = "", "slips of all seeds";
        intervals: u64 = "", "intervals between slips";
        tau_mean: Option<f64> = "s", "mean interval", "⟨τ⟩";
        tau_interval as "tau_mean": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_bound as "tau_mean_bound": Option<f64> = "s",
            "lower bound of tau_mean, if it is null as a job gave up", "⟨τ⟩, at least" "Least mean interval";
        tau_control: Option<f64> = "s", "mean interval of the control; null without a control", "⟨τ⟩, control" "Mean interval of the control";
        tau_off as "tau_mean_off": Option<f64> = "",
            "relative bias of tau_mean where `max_time` cut intervals; null if it cut none", "tau mean off" "Relative bias of the mean interval";
        tau_deviation as "tau_sd": Option<f64> = "s", "standard deviation of the intervals", "σ(τ)" "S.d. of the intervals";
        tau_deviation_interval as "tau_sd": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_05: Option<f64> = "s", "5 % quantile of the intervals", "τ(5 %)";
        tau_25: Option<f64> = "s", "25 % quantile of the intervals", "τ(25 %)";
        tau_50: Option<f64> = "s", "median of the intervals", "median τ";
        median_interval as "tau_50": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_75: Option<f64> = "s", "75 % quantile of the intervals", "τ(75 %)";
        tau_95: Option<f64> = "s", "95 % quantile", "τ(95 %)" "95 % quantile of the intervals";
        periods: Option<u64> = "", "n of tau = n T: the median of the intervals over T at their onset, rounded", "n" "Periods per slip";
        locking_index: Option<f64> = "", "|<exp(2 pi i tau / T)>|: 1 if all intervals leave the same remainder modulo T; for tau < T a narrow tau suffices, so compare with the drive alone; null where `periods` is 0", "locking" "Locking index of τ";
        locking_interval as "locking_index": Option<Interval> = "", "lower end of its 95 % confidence interval";
        locking_index_drive: Option<f64> = "",
            "the same by the drive alone: slips at the loads of the control; null without a control", "locking, drive" "Locking index by the drive alone";
        locking_index_excess: Option<f64> = "", "locking_index less locking_index_drive: what the slider adds", "locking, excess" "Locking index beyond the drive's";
        locking_excess_interval as "locking_index_excess": Option<Interval> = "", "lower end of its 95 % confidence interval";
        phase_mean: Option<f64> = "rad", "circular mean of the phase; if T is tau_mean or more, over whole cycles from the first onset of each job, and null below two of them a job", "⟨φ⟩" "Mean phase";
        phase_interval as "phase_mean": Option<Interval> = "rad",
            "lower end of its 95 % confidence interval; the whole turn if the phases may have no direction";
        has_phase: bool = "", "whether the interval of phase_mean is narrower than 3/2 pi", "has phase";
        shares_start: bool = "", "whether phases differ between slips of different number more than four times as much as between seeds: the jobs still share their start, and intervals of R and phase are too narrow", "shares start";
        resultant_length: Option<f64> = "", "|<exp(i phi)>|: 1 if every slip has the same phase", "R" "Resultant length of the phase";
        length_interval as "resultant_length": Option<Interval> = "", "lower end of its 95 % confidence interval";
        resultant_drive: Option<f64> = "",
            "the same by the drive alone: slips at the loads of the control; null without a control", "R, drive" "Resultant length by the drive alone";
        resultant_excess: Option<f64> = "", "resultant_length less resultant_drive: what the slider adds", "R, excess" "Resultant length beyond the drive's";
        resultant_excess_interval as "resultant_excess": Option<Interval> = "", "lower end of its 95 % confidence interval";
        schuster as "schuster_log10_p": Option<f64> = "", "log10 of Schuster's p, that phases have no direction, correlated slips counting less; it rejects this where the drive alone makes R, too: quote resultant_excess", "log p" "log₁₀ of Schuster's p";
        drop_mean: Option<f64> = "N", "mean stress drop", "⟨ΔF⟩";
        drop_interval as "drop_mean": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        drop_deviation as "drop_sd": Option<f64> = "N", "standard deviation of the stress drop", "σ(ΔF)" "S.d. of the stress drop";
        drop_deviation_interval as "drop_sd": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        drop_variation as "drop_cv": Option<f64> = "", "drop_sd over drop_mean: the shape of drops in any unit", "cv(ΔF)" "Coefficient of variation of the stress drop";
        peak_force_mean: Option<f64> = "N", "mean shear force at the onset of slips", "⟨F⟩ at onsets" "Mean peak force";
        peak_force_interval as "peak_force_mean": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        mean_friction: Option<f64> = "N", "shear force, over the time of all jobs", "⟨Fₛ⟩" "Mean friction";
        mean_friction_interval as "mean_friction": Option<Interval> = "N",
            "lower end of its 95 % confidence interval, of jobs as units";
        friction_coefficient: Option<f64> = "", "mean_friction over the normal force FN", "μ" "Friction coefficient";
        friction_coefficient_interval as "friction_coefficient": Option<Interval> = "", "lower end of its 95 % confidence interval";
    }
}

tables! { SetRow = "sets", "One row per parameter set, all seeds together"; }

impl SetRow {
    /// The number in a column of this name; `None` if it has none.
    pub fn number(&self, column: &str) -> Option<f64> {
        let columns = Self::columns();
        let place = columns.iter().position(|known| known.name == column)?;
        let mut numbers = Vec::new();
        self.cells(&mut |cell| numbers.push(cell.number()));
        numbers.swap_remove(place)
    }
}

/// A column of a set that a sweep file may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Statistic {
    pub key: &'static str,
    /// Its SI unit; empty for a pure number or a word.
    pub unit: &'static str,
    /// Kind of its values: a real number, or a flag, word or count that distinguishes sets.
    pub kind: Kind,
    pub has_interval: bool,
}

/// All that a sweep file may name, in the order of the table: measured quantities with a symbol.
pub static STATISTICS: LazyLock<Vec<Statistic>> = LazyLock::new(|| {
    let columns = SetRow::columns();
    let has_interval = |key: &str| {
        let low = format!("{key}_low");
        columns.iter().any(|column| column.name == low)
    };
    let statistic = |column: &Column| {
        let Cow::Borrowed(key) = column.name else {
            return None;
        };
        let is_given = key == FREQUENCY || Symbol::from_key(key).is_some();
        // Counts of jobs, slips and intervals are never missing.
        let is_measured = column.nullable || column.kind == Kind::Flag;
        (is_measured && !is_given && !column.symbol.is_empty()).then(|| Statistic {
            key,
            unit: column.unit,
            kind: column.kind,
            has_interval: has_interval(key),
        })
    };
    columns.iter().filter_map(statistic).collect()
});

impl Statistic {
    /// Whether a relative error of it means nothing.
    pub fn is_angle(self) -> bool {
        self.unit == "rad"
    }

    /// Whether it can cross a threshold: the population has a value of it, whose error a jackknife over seeds gives.
    /// Quantiles jump, bounds change with the number of values, and angles have no order.
    pub fn can_cross(self) -> bool {
        let is_of_sample =
            self.key.starts_with("tau_") && !["tau_mean", "tau_sd"].contains(&self.key);
        self.kind == Kind::Real && !self.is_angle() && !is_of_sample
    }

    /// Whether it says what the drive alone explains, or what it does not.
    pub fn needs_control(self) -> bool {
        self.key.ends_with("_drive") || self.key.ends_with("_excess")
    }

    pub fn from_key(key: &str) -> Option<Self> {
        let mut statistics = STATISTICS.iter().copied();
        statistics.find(|statistic| statistic.key == key)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_are_what_jobs_and_slips_say_of_a_set() {
        let of = |key: &str| {
            Statistic::from_key(key).map(|known| (known.unit, known.kind, known.has_interval))
        };
        assert_eq!(of("tau_mean"), Some(("s", Kind::Real, true)));
        assert_eq!(of("phase_mean"), Some(("rad", Kind::Real, true)));
        assert_eq!(of("slip_share"), Some(("", Kind::Real, true)));
        assert_eq!(of("tau_95"), Some(("s", Kind::Real, false)));
        for (class, kind) in [
            ("has_phase", Kind::Flag),
            ("regime", Kind::Text),
            ("periods", Kind::Count),
        ] {
            assert_eq!(of(class), Some(("", kind, false)), "{class}");
        }
        for other in ["set_id", "V0", "T", "eta", "jobs", "slips", "tau_mean_low"] {
            assert_eq!(of(other), None, "{other}");
        }
        assert_eq!(
            STATISTICS
                .iter()
                .filter(|statistic| statistic.has_interval)
                .count(),
            14
        );
    }
}
