//! What a job records: one struct, each field described once.

use crate::columns::Row;
use crate::model::Parameters;
use crate::model::fields::fields;
use crate::model::theory::typical_interval;
use crate::observe::{Drops, Energies};
use std::borrow::Cow;

fields! {
    /// What a job records: how many slips, from where, and which tables.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Recording by RecordingKey {
        Slips("slips") slips: Option<u64> = Some(40), "", HELD,
            "Slips to record after start-up; then the job ends. With `time` alone there is no such end";
        Time("time") time: Option<f64> = None, "s", POSITIVE and "time < max_time",
            "Model time, counted as onsets are; the first recorded slip with its onset then or later is the last";
        Discard("discard") discard: u64 = 5, "", COUNT_OR_ZERO, "Slips of start-up, not recorded";
        MaxTime("max_time") max_time: Option<f64> = None, "s", POSITIVE,
            "Longest model time of a job; one that it ends has the outcome `time limit`, and a longer one in the same directory runs it again";
        MaxEvents("max_events") max_events: u64 = 1_000_000_000, "", COUNT,
            "Contact events after which a job counts as failed; may be raised for `--retry-failed` in the same directory";
        PrecursorSize("precursor_size") precursor_size: Option<u64> = None, "", COUNT,
            "Minimum number of breaks of a precursor; none: `Ns` of the job, another for each along an axis of Ns";
        Precursors("precursors") precursors: bool = false, "", FLAG,
            "Whether each precursor becomes a row of its own; their number before each slip is always recorded";
        DropSize("drop_size") drop_size: Option<f64> = None, "N", POSITIVE,
            "Minimum drop of the shear force to look for; none: drops are not looked for";
        Energies("energies") energies: bool = false, "", FLAG,
            "Whether the work of the drive and its losses are recorded for each slip, at some twice the cost";
        Control("control") control: bool = false, "", FLAG,
            "Whether each modulated set is also run without modulation, for what the drive alone explains";
        GiveUpAfter("give_up_after") give_up_after: Option<f64> = None, "m", POSITIVE,
            "Distance `V0 t` of the drive without a slip after which a job ends, with the outcome `no slips`; none: 20 typical intervals between slips and two periods";
    }
}

/// Intervals between slips, as [`typical_interval`] has them, and periods without a slip after which a job ends by
/// default.
const GIVE_UP_INTERVALS: f64 = 20.0;
const GIVE_UP_PERIODS: f64 = 2.0;

impl Recording {
    /// Time without a slip after which a job ends, in s.
    pub fn give_up_time(&self, parameters: &Parameters) -> f64 {
        let Some(distance) = self.give_up_after else {
            let periods = [parameters.modulation_period, parameters.turning_period];
            let longest = periods.into_iter().flatten().fold(0.0, f64::max);
            return GIVE_UP_INTERVALS * typical_interval(parameters) + GIVE_UP_PERIODS * longest;
        };
        distance / parameters.drive_velocity
    }

    /// Model time at which a job ends that has slips at this interval, in s: with the last of `slips`, one interval
    /// after `time`, or at `max_time`.
    pub fn expected_time(&self, interval: f64) -> f64 {
        let slips = self.slips.map_or(f64::INFINITY, |slips| slips as f64);
        ((slips + self.discard as f64) * interval).min(self.time_limit(interval))
    }

    /// The slips that it then records.
    pub fn expected_slips(&self, interval: f64) -> f64 {
        let slips = self.slips.map_or(f64::INFINITY, |slips| slips as f64);
        let in_time = self.time_limit(interval) / interval - self.discard as f64;
        in_time.max(0.0).min(slips)
    }

    /// When it ends in any case; infinite if slips alone end it.
    fn time_limit(&self, interval: f64) -> f64 {
        let start_up = self.discard as f64 * interval;
        let of_time = self.time.map(|time| time.max(start_up) + interval);
        let ends = [of_time, self.max_time];
        ends.into_iter().flatten().fold(f64::INFINITY, f64::min)
    }

    /// Names of the columns of slips that are not recorded.
    pub fn left_out(&self) -> Vec<Cow<'static, str>> {
        let energies = (!self.energies).then(Energies::names);
        let drops = self.drop_size.is_none().then(Drops::names);
        energies.into_iter().chain(drops).flatten().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::{Precursor, Slip};

    #[test]
    fn a_job_is_expected_to_end_with_its_slips_one_interval_after_its_time_or_at_the_longest_time()
    {
        let expected = |slips, time, max_time| {
            let recording = Recording {
                slips,
                time,
                max_time,
                discard: 5,
                ..Recording::default()
            };
            (recording.expected_slips(0.5), recording.expected_time(0.5))
        };
        assert_eq!(expected(Some(40), None, None), (40.0, 22.5));
        assert_eq!(expected(None, Some(10.0), None), (16.0, 10.5));
        assert_eq!(expected(Some(3), Some(10.0), None), (3.0, 4.0));
        assert_eq!(expected(Some(40), None, Some(10.0)), (15.0, 10.0));
        assert_eq!(expected(None, Some(8.0), Some(10.0)), (12.0, 8.5));
        // The first slip past start-up is recorded in any case.
        assert_eq!(expected(None, Some(0.1), None), (1.0, 3.0));
        assert_eq!(expected(Some(40), None, Some(1.0)), (0.0, 1.0));
    }

    #[test]
    fn slips_and_precursors_take_as_much_memory_as_is_said() {
        assert_eq!(size_of::<Slip>(), 320);
        assert_eq!(size_of::<Precursor>(), 136);
        assert!(
            RecordingKey::Slips
                .description()
                .range
                .words
                .contains("10000000: a job holds them in memory, 320 bytes each")
        );
    }
}
