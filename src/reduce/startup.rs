//! Start-up: whether the first recorded slips differ from the later ones.

use super::rank::{Sample, holm, rank_test};
use super::slip_stats::SlipStats;
use crate::table::columns::{Table, columns};

/// Slip numbers that are looked at one by one; all from this one on are what they are held against.
pub const STARTUP_NUMBERS: usize = 20;
/// Slips at the beginning of each job that are held against its later half.
pub const FIRST_SLIPS: usize = 3;
/// Jobs below which a single slip number is not tested, nor against fewer slips.
const MIN_JOBS: usize = 10;
/// Intervals of either sample below which a set is not tested: the least number for which the normal limit of the rank test
/// is right to some percent near p = 0.05.
const MIN_INTERVALS: usize = 6;

columns! {
    /// A slip number of a set, over its jobs. `None` where there is too little data.
    #[derive(Clone, Debug, PartialEq)]
    pub struct StartupRow {
        set_id: String = "", "the set, a row of the sets table";
        slip: u64 = "", "number of the slip within its job, from 0 past discarded ones";
        jobs: u64 = "", "jobs with such a slip";
        interval_mean: Option<f64> = "s", "mean interval before it";
        interval_p: Option<f64> = "",
            "p-value of the rank test of these intervals against those of slips from number 20 on";
        interval_holm_p: Option<f64> = "", "the same, adjusted (Holm) for the numbers of the set";
        drop_mean: Option<f64> = "N", "mean stress drop";
        drop_p: Option<f64> = "", "p-value of the same test of the stress drops";
        drop_holm_p: Option<f64> = "", "the same, adjusted";
    }
}

impl Table for StartupRow {
    const NAME: &'static str = "startup";
    const MEANING: &'static str =
        "One row per parameter set and slip number below 20: how the first slips differ from the later ones";
}

/// p-value of a rank test of the intervals of the first slips of all jobs against those of their later halves. A rank test,
/// as intervals have several peaks; with effective numbers, as those of a job are correlated.
pub(super) fn startup_probability(jobs: &[&[SlipStats]], inflation: f64) -> Option<f64> {
    let intervals = |of: &dyn Fn(usize) -> std::ops::Range<usize>| -> Vec<f64> {
        jobs.iter().flat_map(|job| &job[of(job.len())]).filter_map(SlipStats::interval).collect()
    };
    let first = intervals(&|length| 0..length.min(FIRST_SLIPS));
    let later = intervals(&|length| length.div_ceil(2).max(FIRST_SLIPS).min(length)..length);
    (first.len().min(later.len()) >= MIN_INTERVALS)
        .then(|| rank_test(Sample { values: &first, inflation }, Sample { values: &later, inflation }))
        .flatten()
}

/// A quantity at a slip number: its mean over the jobs, the p-value and the adjusted p-value.
#[derive(Clone, Copy)]
struct AtNumber {
    mean: Option<f64>,
    p: Option<f64>,
    holm_p: Option<f64>,
}

/// A quantity at each of the first slip numbers.
fn by_number(jobs: &[&[SlipStats]], inflation: f64, value: impl Fn(&SlipStats) -> Option<f64>) -> Vec<AtNumber> {
    let mut later: Vec<f64> = jobs.iter().flat_map(|job| job.iter().skip(STARTUP_NUMBERS)).filter_map(&value).collect();
    later.sort_by(f64::total_cmp);
    let numbers = jobs.iter().map(|job| job.len()).max().unwrap_or(0).min(STARTUP_NUMBERS);
    let (means, tested): (Vec<_>, Vec<_>) = (0..numbers)
        .map(|number| {
            let values: Vec<f64> = jobs.iter().filter_map(|job| job.get(number)).filter_map(&value).collect();
            let mean = (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
            let enough = values.len().min(later.len()) >= MIN_JOBS;
            // At one number there is one slip of each job: independent values.
            let (one, later) = (Sample { values: &values, inflation: 1.0 }, Sample { values: &later, inflation });
            (mean, enough.then(|| rank_test(one, later)).flatten())
        })
        .unzip();
    let adjusted = holm(&tested);
    means.into_iter().zip(tested).zip(adjusted).map(|((mean, p), holm_p)| AtNumber { mean, p, holm_p }).collect()
}

/// The rows of a set; n/n_eff is that of its intervals and of its stress drops.
pub(super) fn startup_rows(set_id: &str, jobs: &[&[SlipStats]], inflation: [f64; 2]) -> Vec<StartupRow> {
    let intervals = by_number(jobs, inflation[0], SlipStats::interval);
    let drops = by_number(jobs, inflation[1], |slip| Some(slip.drop));
    let row = |(number, (interval, drop)): (usize, (AtNumber, AtNumber))| StartupRow {
        set_id: set_id.to_owned(),
        slip: number as u64,
        jobs: jobs.iter().filter(|job| job.len() > number).count() as u64,
        interval_mean: interval.mean,
        interval_p: interval.p,
        interval_holm_p: interval.holm_p,
        drop_mean: drop.mean,
        drop_p: drop.p,
        drop_holm_p: drop.holm_p,
    };
    intervals.into_iter().zip(drops).enumerate().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::super::PhaseLimits;
    use super::super::confidence::tests::Draws;
    use super::super::set::tests::slip as slip_of;
    use super::*;
    use crate::observe::Slip;

    /// Jobs of 60 slips; the first `slow` intervals are two standard deviations longer.
    fn jobs(seed: u64, count: usize, slow: usize) -> Vec<Vec<SlipStats>> {
        let mut draws = Draws::new(seed);
        let mut job = |_| {
            let slip = |number: usize, draws: &mut Draws| {
                let excess = if number < slow { 0.02 } else { 0.0 };
                let interval = (number > 0).then(|| 0.11 + excess + 0.01 * draws.normal());
                let sample = Slip { drop: 100.0 + draws.normal(), ..slip_of(interval, None) };
                SlipStats::of(&sample, &PhaseLimits::at(0.0))
            };
            (0..60).map(|number| slip(number, &mut draws)).collect()
        };
        (0..count).map(&mut job).collect()
    }

    fn slices(jobs: &[Vec<SlipStats>]) -> Vec<&[SlipStats]> {
        jobs.iter().map(Vec::as_slice).collect()
    }

    #[test]
    fn the_slips_of_start_up_are_told_by_their_number() {
        let jobs = jobs(7, 40, 4);
        let rows = startup_rows("set", &slices(&jobs), [1.0, 1.0]);
        assert_eq!(rows.len(), STARTUP_NUMBERS);
        let different: Vec<u64> =
            rows.iter().filter(|row| row.interval_holm_p.is_some_and(|p| p < 0.05)).map(|row| row.slip).collect();
        assert_eq!(different, [1, 2, 3], "the first slip has no interval");
        assert!((rows[2].interval_mean.unwrap() - 0.13).abs() < 0.005);
        assert!(rows.iter().all(|row| row.drop_holm_p.is_some_and(|p| p > 0.05) && row.jobs == 40));
        assert_eq!((rows[0].interval_mean, rows[0].interval_p), (None, None));
    }

    #[test]
    fn a_set_whose_first_slips_differ_has_a_small_p_and_one_of_few_slips_none() {
        assert!(startup_probability(&slices(&jobs(7, 10, 4)), 1.0).unwrap() < 1e-3);
        let alike =
            (0..400).filter(|&seed| startup_probability(&slices(&jobs(seed, 10, 0)), 1.0).unwrap() < 0.05).count();
        assert!((10..30).contains(&alike), "{alike} of 400 at a level of 5 %");
        let short: Vec<Vec<SlipStats>> = jobs(7, 2, 0).into_iter().map(|job| job[..4].to_vec()).collect();
        assert_eq!(startup_probability(&slices(&short), 1.0), None);
        let few = startup_rows("set", &slices(&jobs(7, 9, 4)), [1.0, 1.0]);
        assert!(few.iter().all(|row| row.interval_p.is_none()) && few[2].interval_mean.is_some());
    }
}
