//! What is known of a set: the columns of the reduced table of sets, with their names in figures. Reduction fills them
//! in; a sweep file may name those that are statistics. `label.rs`: columns and their values as figures write them.

mod label;

pub use label::{Digits, Label, is_same, label, power_of_ten, setting, symbol_of, with_decimals};

use crate::model::{Parameters, Selected, Selection, Symbol};
use crate::observe::Regime;
use crate::table::columns::{ANGLE, Class, Column, Interval, Row, columns, has_interval};
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

/// The parameter that a column shows.
pub fn parameter(column: &Column) -> Option<Symbol> {
    if column.class == Class::Period {
        return Some(Symbol::T);
    }
    Symbol::from_key(&column.name).filter(|_| column.class == Class::Parameter)
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

/// Sorts sets, which are in the order of their parameters, by frequencies, which are shown, in place of periods.
pub fn by_frequency<R>(sets: &mut [R], parameters: impl Fn(&R) -> &Parameters) {
    let all = AllButSeed::SYMBOLS.iter().copied();
    let before_the_period: Vec<Symbol> = all.take_while(|symbol| *symbol != Symbol::T).collect();
    let differ_in_period_at_most = |left: &R, right: &R| {
        let [left, right] = [left, right].map(&parameters);
        let mut symbols = before_the_period.iter();
        symbols.all(|symbol| left.get(*symbol) == right.get(*symbol))
    };
    for group in sets.chunk_by_mut(differ_in_period_at_most) {
        let frequency = |set: &R| parameters(set).frequency().unwrap_or(0.0);
        group.sort_by(|left, right| frequency(left).total_cmp(&frequency(right)));
    }
}

columns! {
    /// A row of the reduced sets. Quantities are SI; `None` where there is nothing to average.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct SetRow {
        set_id: String = "", "hash of all that defines a job but the seed";
        parameters: Selected<AllButSeed>;
        frequency: Option<f64> = "Hz", "1/T; null without modulation", "1/T" "Modulation frequency", Class::Period;
        eta: f64 = "", "2 pi Delta / (T V0); 0 without modulation", "η" "η = 2πΔ / (T V₀)", Class::Period;
        finished_jobs as "jobs": u64 = "", "jobs run to an end (finished), one per seed";
        failed_jobs: u64 = "", "jobs that failed";
        is_control as "control": bool = "", "whether its jobs are controls alone (`control = true`)";
        jobs_without_slips: u64 = "", "finished jobs that gave up as no slip came";
        jobs_cut: u64 = "", "finished jobs whose last interval `max_time` cut";
        regime: Option<Regime> = "", "`stick-slip`, `mixed` or `sliding`, as all jobs; `mixed` if they differ", "regime", Class::Category;
        slip_share: Option<f64> = "", "share of time within slips, over the time of all jobs", "slip share" "Share of time within slips", Class::Share;
        slip_share_interval as "slip_share": Option<Interval> = "", "lower end of its 95 % confidence interval, of jobs as units";
        slips: u64 = "", "slips of all seeds";
        intervals: u64 = "", "intervals between slips";
        tau_mean: Option<f64> = "s", "mean interval", "⟨τ⟩", Class::Mean;
        tau_interval as "tau_mean": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_bound as "tau_mean_bound": Option<f64> = "s",
            "lower bound of tau_mean, if it is null as a job gave up", "⟨τ⟩, at least" "Least mean interval", Class::Bound("tau_mean");
        tau_control: Option<f64> = "s", "mean interval of the control; null without a control", "⟨τ⟩, control" "Mean interval of the control", Class::Auxiliary;
        tau_off as "tau_mean_off": Option<f64> = "",
            "relative bias of tau_mean where `max_time` cut intervals; null if it cut none", "tau mean off" "Relative bias of the mean interval", Class::Auxiliary;
        tau_deviation as "tau_sd": Option<f64> = "s", "standard deviation of the intervals", "σ(τ)" "S.d. of the intervals", Class::Spread;
        tau_deviation_interval as "tau_sd": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_05: Option<f64> = "s", "5 % quantile of the intervals", "τ(5 %)", Class::Quantile;
        tau_25: Option<f64> = "s", "25 % quantile of the intervals", "τ(25 %)", Class::Quantile;
        tau_50: Option<f64> = "s", "median of the intervals", "median τ", Class::Quantile;
        median_interval as "tau_50": Option<Interval> = "s", "lower end of its 95 % confidence interval";
        tau_75: Option<f64> = "s", "75 % quantile of the intervals", "τ(75 %)", Class::Quantile;
        tau_95: Option<f64> = "s", "95 % quantile", "τ(95 %)" "95 % quantile of the intervals", Class::Quantile;
        periods: Option<u64> = "", "n of tau = n T: the median of the intervals over T at their onset, rounded", "n" "Periods per slip", Class::Category;
        locking_index: Option<f64> = "", "|<exp(2 pi i tau / T)>|: 1 if all intervals leave the same remainder modulo T; for tau < T a narrow tau suffices, so compare with the drive alone; null where `periods` is 0", "locking" "Locking index of τ", Class::Share;
        locking_interval as "locking_index": Option<Interval> = "", "lower end of its 95 % confidence interval";
        locking_index_drive: Option<f64> = "",
            "the same by the drive alone: slips at the loads of the control; null without a control", "locking, drive" "Locking index by the drive alone", Class::ByDrive("locking_index");
        locking_index_excess: Option<f64> = "", "locking_index less locking_index_drive: the part due to the slider", "locking, excess" "Excess of the locking index", Class::Excess;
        locking_excess_interval as "locking_index_excess": Option<Interval> = "", "lower end of its 95 % confidence interval";
        phase_mean: Option<f64> = "rad", "circular mean of the phase; if T is tau_mean or more, over whole cycles from the first onset of each job, and null below two of them a job", "⟨φ⟩" "Mean phase", Class::Mean;
        phase_interval as "phase_mean": Option<Interval> = "rad",
            "lower end of its 95 % confidence interval; the whole turn if the phases may have no direction";
        has_phase: bool = "", "whether the interval of phase_mean is narrower than the full circle", "has phase", Class::Category;
        shares_start: bool = "", "whether phases differ between slips of different number more than four times as much as between seeds: the jobs still share their start, and intervals of R and phase are too narrow", "shares start", Class::Category;
        resultant_length: Option<f64> = "", "|<exp(i phi)>|: 1 if every slip has the same phase", "R" "Resultant length of the phase", Class::Share;
        length_interval as "resultant_length": Option<Interval> = "", "lower end of its 95 % confidence interval";
        resultant_drive: Option<f64> = "",
            "the same by the drive alone: slips at the loads of the control; null without a control", "R, drive" "Resultant length by the drive alone", Class::ByDrive("resultant_length");
        resultant_excess: Option<f64> = "", "resultant_length less resultant_drive: the part due to the slider", "R, excess" "Excess of the resultant length", Class::Excess;
        resultant_excess_interval as "resultant_excess": Option<Interval> = "", "lower end of its 95 % confidence interval";
        schuster as "schuster_log10_p": Option<f64> = "", "log10 of Schuster's p, that phases have no direction, correlated slips counting less; it rejects this where the drive alone makes R, too: quote resultant_excess", "log p" "log₁₀ of Schuster's p", Class::Auxiliary;
        drop_mean: Option<f64> = "N", "mean force drop", "⟨ΔF⟩", Class::Mean;
        drop_interval as "drop_mean": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        drop_deviation as "drop_sd": Option<f64> = "N", "standard deviation of the force drop", "σ(ΔF)" "S.d. of the force drop", Class::Spread;
        drop_deviation_interval as "drop_sd": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        drop_variation as "drop_cv": Option<f64> = "", "drop_sd over drop_mean: the shape of drops in any unit", "cv(ΔF)" "Coefficient of variation of the force drop", Class::Spread;
        peak_force_mean: Option<f64> = "N", "mean shear force at the onset of slips", "⟨F⟩ at onsets" "Mean peak force", Class::Mean;
        peak_force_interval as "peak_force_mean": Option<Interval> = "N", "lower end of its 95 % confidence interval";
        mean_friction: Option<f64> = "N", "shear force, over the time of all jobs", "⟨F_S⟩" "Mean friction", Class::Mean;
        mean_friction_interval as "mean_friction": Option<Interval> = "N",
            "lower end of its 95 % confidence interval, of jobs as units";
        friction_coefficient: Option<f64> = "", "mean_friction over the normal force FN", "μ" "Friction coefficient", Class::Mean;
        friction_coefficient_interval as "friction_coefficient": Option<Interval> = "", "lower end of its 95 % confidence interval";
    }
}

tables! { SetRow = "sets", "One row per parameter set, all seeds together"; }

impl SetRow {
    /// The number in a column of this name; `None` if it has none.
    pub fn number(&self, column: &str) -> Option<f64> {
        self.estimate(column).map(|(number, _)| number)
    }

    /// The same with its interval.
    pub fn estimate(&self, column: &str) -> Option<(f64, Option<Interval>)> {
        let columns = Self::columns();
        let place = columns.iter().position(|known| known.name == column)?;
        let mut numbers = Vec::new();
        self.cells(&mut |cell| numbers.push(cell.number()));
        Some((numbers[place]?, Interval::of(&columns, place, &numbers)))
    }
}

/// A column of a set that a sweep file may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Statistic {
    pub key: &'static str,
    /// Its SI unit; empty for a pure number or a word.
    pub unit: &'static str,
    pub has_interval: bool,
    /// Whether it can cross a threshold: the population has a value of it, whose error a jackknife over seeds gives.
    /// Quantiles jump, bounds change with the number of values, and angles have no order.
    pub can_cross: bool,
    /// Whether it says what the drive alone explains, or what it does not.
    pub needs_control: bool,
}

/// All that a sweep file may name, in the order of the table.
pub static STATISTICS: LazyLock<Vec<Statistic>> = LazyLock::new(|| {
    let columns = SetRow::columns();
    let statistic = |(place, column): (usize, &Column)| {
        let (can_cross, needs_control) = match column.class {
            Class::Plain | Class::Parameter | Class::Period | Class::Low | Class::High => {
                return None;
            }
            Class::Mean | Class::Spread | Class::Share => (!column.is_angle(), false),
            Class::ByDrive(_) | Class::Excess => (true, true),
            Class::Quantile | Class::Auxiliary | Class::Bound(_) | Class::Category => {
                (false, false)
            }
        };
        let Cow::Borrowed(key) = column.name else {
            return None;
        };
        Some(Statistic {
            key,
            unit: column.unit,
            has_interval: has_interval(&columns, place),
            can_cross,
            needs_control,
        })
    };
    columns.iter().enumerate().filter_map(statistic).collect()
});

impl Statistic {
    /// Whether a relative error of it means nothing.
    pub fn is_angle(self) -> bool {
        self.unit == ANGLE
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
            Statistic::from_key(key).map(|known| (known.unit, known.can_cross, known.has_interval))
        };
        assert_eq!(of("tau_mean"), Some(("s", true, true)));
        assert_eq!(of("phase_mean"), Some(("rad", false, true)));
        assert_eq!(of("slip_share"), Some(("", true, true)));
        assert_eq!(of("tau_95"), Some(("s", false, false)));
        for kind in ["has_phase", "regime", "periods"] {
            assert_eq!(of(kind), Some(("", false, false)), "{kind}");
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
