//! Triggering: how much earlier a slip comes after a pulse than without it.
//!
//! The control of a pulsed job is the same run until the pulse begins, so that its next slip has the same number: its
//! onset may lie just before the pulse that makes it. By the drive alone it comes when the pulsed drive first gets as
//! far as the control's had at its onset. Without an exact counterfactual, experiments compare catalogues before and after
//! waves (van der Elst and Savage, J. Geophys. Res. 120 (2015), 10.1002/2014JB011611).

use super::drive_alone::{Explained, Times};
use super::estimate::{Estimate, MAX_UNSEEN, Sums, Units, plus};
use super::gather::Gathered;
use crate::model::{Drive, Parameters, Selected};
use crate::results::tables::All;
use crate::sets::AllButSeed;
use crate::table::columns::{Class, Interval, columns};
use crate::table::tables;
use crate::table::value::words;
use std::collections::{BTreeMap, BTreeSet};
use std::iter::once;

/// Amplitude in m up to which a pulse moves nothing: what advances by it shows the error of the solver.
const NO_PULSE: f64 = 1e-12;

/// Seeds that a mean needs for an interval.
const MIN_SEEDS: usize = 8;
/// Parts of the control's interval that have means of their own.
const PARTS_OF_INTERVAL: u32 = 10;

words! {
    /// Why a job does not say what its pulse did.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Excluded {
        NoControl = "no control",
        BeforeFirst = "before the first slip",
        WithinSlip = "within a slip",
        AfterLast = "after the last slip",
    }
}

columns! {
    /// A job with a pulse, beside its control.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct TriggerRow {
        set_id: String = "", "hash of all that defines a job but the seed";
        parameters: Selected<All>;
        tau_control: Option<f64> = "s", "mean interval of the control; null without a control";
        control_interval: Option<f64> = "s", "interval of the control in which the pulse begins";
        place: Option<f64> = "", "share of it elapsed by then";
        advance: Option<f64> = "s", "how much earlier the onset of the next slip comes";
        advance_drive: Option<f64> = "s", "the same by the drive alone";
        next_advance: Option<f64> = "s", "the same of the slip after it";
        triggered: Option<bool> = "", "whether the next onset comes by the end of the pulse, and without it after";
        triggered_drive: Option<bool> = "", "the same by the drive alone";
        noise: Option<f64> = "s", "largest advance, of either sign, by pulses up to 1e-12 m of the same slider and drive";
        excluded: Option<Excluded> = "",
            "why these are null: `no control`, or the pulse begins `before the first slip`, `within a slip` or `after the last slip`";
    }
}

tables! { TriggerRow = "triggers", "One row per job with a pulse, if there are any"; }

columns! {
    /// Pulses that differ in their start and seed alone, and begin in the same part of an interval of the control.
    /// Parameters are those of the first.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct PulseRow {
        parameters: Selected<AllButSeed>;
        place_low: f64 = "", "elapsed fraction of the interval of the control from which on they begin";
        place_high: f64 = "", "the fraction before which they begin; 0 and 1: the whole interval";
        jobs: u64 = "", "jobs with such a pulse and a slip to compare";
        advance_mean: Option<f64> = "", "mean advance over the mean interval of the control",
            "advance / ⟨τ⟩" "Advance / ⟨τ⟩", Class::Mean;
        advance_interval as "advance_mean": Option<Interval> = "", "lower end of its 95 % confidence interval; null with fewer than 8 seeds";
        advance_drive: Option<f64> = "", "the same by the drive alone", "advance, drive", Class::ByDrive("advance_mean");
        advance_excess: Option<f64> = "", "advance_mean less advance_drive";
        advance_excess_interval as "advance_excess": Option<Interval> = "", "lower end of its 95 % confidence interval";
        triggered_share: f64 = "", "share of slips that the pulse triggers", "triggered" "Share of triggered slips", Class::Share;
        triggered_interval as "triggered_share": Option<Interval> = "", "lower end of its 95 % confidence interval; null with fewer than 8 seeds";
        triggered_drive: f64 = "", "the same by the drive alone", "triggered, drive", Class::ByDrive("triggered_share");
        triggered_excess: f64 = "", "triggered_share less triggered_drive";
        triggered_excess_interval as "triggered_excess": Option<Interval> = "", "lower end of its 95 % confidence interval";
    }
}

tables! {
    PulseRow = "pulses", "One row per pulse, and one per tenth of the control's interval in which it begins; `pulse_start` is that of the first";
}

impl PulseRow {
    pub fn is_of_whole_interval(&self) -> bool {
        self.place_high - self.place_low > 0.5
    }

    /// The parameters of the pulse, where it begins left out.
    pub fn pulse(&self) -> Parameters {
        Parameters {
            pulse_start: None,
            ..self.parameters.all.clone()
        }
    }
}

/// The interval of a control in which a pulse begins, with what the drive alone makes of its next slip. Times in s.
#[derive(Clone, Copy, Debug)]
struct ControlInterval {
    /// Onsets before and after the pulse begins, and the one after, if there is one.
    last: f64,
    free: f64,
    /// How many slips are recorded before that.
    number: usize,
    following: Option<f64>,
    passage: f64,
    pulse: [f64; 2],
}

impl ControlInterval {
    /// Of the slips of the control of a job with these parameters, in order.
    fn of(parameters: &Parameters, control: &[Times]) -> Result<Self, Excluded> {
        let drive = Drive::new(parameters);
        let pulse = drive.pulse().unwrap_or_default();
        let [start, _] = pulse;
        let number = control.partition_point(|slip| slip.onset <= start);
        let free = control.get(number).ok_or(Excluded::AfterLast)?;
        let before = number.checked_sub(1).ok_or(Excluded::BeforeFirst)?;
        let last = control[before];
        if start < last.nucleation + last.duration || free.nucleation <= start {
            return Err(Excluded::WithinSlip);
        }
        Ok(Self {
            last: last.onset,
            free: free.onset,
            number,
            following: control.get(number + 1).map(|slip| slip.onset),
            passage: drive.first_passage(free.onset),
            pulse,
        })
    }

    /// The row of a pulse with these onsets in its run.
    fn row(&self, onsets: &[f64]) -> Result<TriggerRow, Excluded> {
        let next = *onsets.get(self.number).ok_or(Excluded::AfterLast)?;
        let [start, end] = self.pulse;
        let interval = self.free - self.last;
        let following = self.following.zip(onsets.get(self.number + 1));
        let is_triggered = |onset: f64| Some(onset <= end && self.free > end);
        Ok(TriggerRow {
            control_interval: Some(interval),
            place: Some((start - self.last) / interval),
            advance: Some(self.free - next),
            advance_drive: Some(self.free - self.passage),
            next_advance: following.map(|(free, next)| free - next),
            triggered: is_triggered(next),
            triggered_drive: is_triggered(self.passage),
            ..TriggerRow::default()
        })
    }
}

/// The rows of a set, in the order of its seeds, before [`note_noise`]; none without a pulse.
pub(super) fn trigger_rows(set: &Gathered, explained: &Explained) -> Vec<TriggerRow> {
    let Gathered { jobs, slips, .. } = set;
    if jobs.parameters.pulse_start.is_none() {
        return Vec::new();
    }
    let row = |&seed: &u64| {
        let of_job = slips.of_job(seed).iter();
        let onsets = of_job.map(|slip| slip.onset).collect::<Vec<_>>();
        let control = explained.control.get(&seed).ok_or(Excluded::NoControl);
        let interval = control.and_then(|control| ControlInterval::of(&jobs.parameters, control));
        let row = interval.and_then(|interval| interval.row(&onsets));
        let parameters = jobs.parameters.with_seed(seed);
        TriggerRow {
            set_id: jobs.set_id.clone(),
            parameters: Selected::new(parameters),
            tau_control: explained.tau_control,
            ..row.unwrap_or_else(TriggerRow::excluded)
        }
    };
    jobs.finished.iter().map(row).collect()
}

/// Notes how large advances by no pulse at all are, for each slider and drive.
pub(super) fn note_noise(rows: &mut [TriggerRow]) {
    let control_of = |row: &TriggerRow| row.parameters.without_modulation().with_seed(0);
    let nothing = rows.iter().filter(|row| row.is_nothing());
    let noise = |pulses: Pulses<'_>| {
        let advances = pulses.rows.iter().filter_map(|row| row.advance);
        let noise = advances.map(f64::abs).reduce(f64::max);
        (pulses.parameters, noise)
    };
    let pulses = Pulses::grouped(nothing, control_of).into_iter();
    let noises: Vec<(Parameters, Option<f64>)> = pulses.map(noise).collect();
    for row in rows {
        let control = control_of(row);
        let noise = noises.iter().find(|(of, _)| *of == control);
        row.noise = noise.and_then(|(_, noise)| *noise);
    }
}

impl TriggerRow {
    fn excluded(why: Excluded) -> Self {
        Self {
            excluded: Some(why),
            ..Self::default()
        }
    }

    /// Whether the pulse moves nothing.
    fn is_nothing(&self) -> bool {
        self.parameters.modulation_amplitude <= NO_PULSE
    }

    /// The advance as seen and by the drive alone, over the mean interval.
    fn advances(&self) -> Option<[f64; 2]> {
        let mean = self.tau_control?;
        Some([self.advance? / mean, self.advance_drive? / mean])
    }

    /// Whether the slip is triggered as seen and by the drive alone: 1 or 0.
    fn triggers(&self) -> Option<[f64; 2]> {
        let number = |is_so: bool| f64::from(u8::from(is_so));
        Some([number(self.triggered?), number(self.triggered_drive?)])
    }
}

/// The rows of pulses, in the order of `rows`.
pub(super) fn pulse_rows(rows: &[TriggerRow]) -> Vec<PulseRow> {
    let tenth = |part: u32| f64::from(part) / f64::from(PARTS_OF_INTERVAL);
    let parts = (0..PARTS_OF_INTERVAL).map(|part| [tenth(part), tenth(part + 1)]);
    let parts: Vec<[f64; 2]> = once([0.0, 1.0]).chain(parts).collect();
    let pulses = Pulses::of(rows);
    let of_pulse = |pulses: &Pulses<'_>| {
        let rows = parts
            .iter()
            .filter_map(|&part| pulses.between(part).row(part));
        rows.collect::<Vec<_>>()
    };
    pulses.iter().flat_map(of_pulse).collect()
}

/// The pulses that differ in their start and seed alone, and say something.
#[derive(Clone, Debug)]
pub(crate) struct Pulses<'a> {
    pub parameters: Parameters,
    pub rows: Vec<&'a TriggerRow>,
}

impl<'a> Pulses<'a> {
    /// All but those that move nothing, in the order of the rows.
    pub fn of(rows: &'a [TriggerRow]) -> Vec<Self> {
        let says = |row: &&TriggerRow| row.advance.is_some() && !row.is_nothing();
        Self::grouped(rows.iter().filter(says), |row| Parameters {
            pulse_start: None,
            ..row.parameters.with_seed(0)
        })
    }

    fn grouped(
        rows: impl Iterator<Item = &'a TriggerRow>,
        parameters: impl Fn(&TriggerRow) -> Parameters,
    ) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        for row in rows {
            let parameters = parameters(row);
            let mut known = all.iter_mut();
            match known.find(|pulses| pulses.parameters == parameters) {
                Some(pulses) => pulses.rows.push(row),
                None => all.push(Self {
                    parameters,
                    rows: vec![row],
                }),
            }
        }
        all
    }

    /// Those that begin between two fractions of the interval.
    pub fn between(&self, [low, high]: [f64; 2]) -> Self {
        let mut some = self.clone();
        some.rows
            .retain(|row| row.place.is_some_and(|place| (low..high).contains(&place)));
        some
    }

    /// Their means; `None` if there are none. Pulses of a seed meet the same slip, so intervals need `MIN_SEEDS` of them.
    pub fn row(&self, [place_low, place_high]: [f64; 2]) -> Option<PulseRow> {
        let first = self.rows.first()?;
        let count = self.rows.len() as f64;
        let seeds: BTreeSet<u64> = self.rows.iter().map(|row| row.parameters.seed).collect();
        let if_many = |interval: Option<Interval>| interval.filter(|_| seeds.len() >= MIN_SEEDS);
        let advance = self.means(TriggerRow::advances);
        let triggered = self.means(TriggerRow::triggers)?;
        // A slip that was not seen may be triggered, or not.
        let excess = triggered.excess.allowing_for(MAX_UNSEEN / count);
        let interval = |of: fn(&Means) -> &Estimate| if_many(of(advance.as_ref()?).interval());
        Some(PulseRow {
            parameters: Selected::new(first.parameters.with_seed(0)),
            place_low,
            place_high,
            jobs: self.rows.len() as u64,
            advance_mean: advance.as_ref().map(|means| means.seen.value),
            advance_interval: interval(|means| &means.seen),
            advance_drive: advance.as_ref().map(|means| means.by_drive.value),
            advance_excess: advance.as_ref().map(|means| means.excess.value),
            advance_excess_interval: interval(|means| &means.excess),
            triggered_share: triggered.seen.value,
            triggered_interval: if_many(triggered.seen.share_interval(count)),
            triggered_drive: triggered.by_drive.value,
            triggered_excess: excess.value,
            triggered_excess_interval: if_many(excess.interval()),
        })
    }

    /// `None` without values.
    fn means(&self, quantity: impl Fn(&TriggerRow) -> Option<[f64; 2]>) -> Option<Means> {
        let mut seeds: BTreeMap<u64, Vec<Sums>> = BTreeMap::new();
        for row in &self.rows {
            if let Some([seen, drive]) = quantity(row) {
                let of_seed = seeds.entry(row.parameters.seed).or_default();
                // As one value: pulses have no order.
                let sums = of_seed.pop().unwrap_or_default();
                of_seed.push(plus(sums, 1.0, [1.0, seen, drive]));
            }
        }
        let units = Units::of(seeds);
        let mean = |of: fn([f64; 2]) -> f64| {
            units.estimate(|[weight, seen, drive]| {
                (weight > 0.0).then(|| of([seen, drive]) / weight)
            })
        };
        Some(Means {
            seen: mean(|[seen, _]| seen)?,
            by_drive: mean(|[_, drive]| drive)?,
            excess: mean(|[seen, drive]| seen - drive)?,
        })
    }
}

/// Of a quantity of pulses.
struct Means {
    seen: Estimate,
    by_drive: Estimate,
    excess: Estimate,
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 0.02;

    fn pulsed(start: f64, amplitude: f64) -> Parameters {
        let parameters = Parameters {
            modulation_amplitude: amplitude,
            modulation_period: Some(PERIOD),
            pulse_start: Some(start),
            ..Parameters::default()
        };
        parameters.validated().unwrap()
    }

    const CONTROL: [f64; 4] = [1.0, 1.1, 1.21, 1.3];

    /// Of a run with these onsets after those that its control has before the pulse.
    fn row(start: f64, amplitude: f64, later: &[f64]) -> TriggerRow {
        let before = CONTROL.iter().filter(|onset| **onset <= start);
        let onsets: Vec<f64> = before.chain(later).copied().collect();
        let slip = |onset: f64| Times {
            onset,
            interval: None,
            nucleation: onset - 0.001,
            duration: 0.006,
        };
        let parameters = pulsed(start, amplitude);
        let interval = ControlInterval::of(&parameters, &CONTROL.map(slip));
        let row = interval.and_then(|interval| interval.row(&onsets));
        TriggerRow {
            parameters: Selected::new(parameters),
            ..row.unwrap_or_else(TriggerRow::excluded)
        }
    }

    #[test]
    fn the_next_slip_is_that_with_the_number_of_the_controls_though_its_onset_lies_before_the_pulse()
     {
        let made = row(1.205, 1e-6, &[1.2049, 1.29, 1.41]);
        assert!((made.advance.unwrap() - 0.0051).abs() < 1e-12);
        assert!((made.next_advance.unwrap() - 0.01).abs() < 1e-12);
        assert_eq!(made.triggered, Some(false));
        assert_eq!(row(1.185, 1e-6, &[1.1849, 1.29]).triggered, Some(true));
    }

    #[test]
    fn the_next_onset_is_compared_with_that_of_the_control_and_with_the_drive_alone() {
        let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-12;
        let triggered = row(1.15, 1e-6, &[1.16, 1.28]);
        assert!(near(triggered.control_interval, 0.11) && near(triggered.place, 0.05 / 0.11));
        assert!(near(triggered.advance, 0.05) && near(triggered.next_advance, 0.02));
        assert_eq!(triggered.triggered, Some(true));
        // The drive rises by 2 Δ = 2 µm, as far as in 20 ms: too early for a slip 60 ms later.
        let by_drive = [
            triggered.advance_drive,
            triggered.triggers().map(|[_, it]| it),
        ];
        assert_eq!(by_drive, [Some(0.0); 2]);
        // The control slips within the pulse.
        let early = row(1.195, 1e-6, &[1.2]);
        assert!(early.advance_drive > Some(0.005));
        assert_eq!(early.triggers(), Some([0.0, 0.0]));
        assert_eq!(row(1.185, 1e-6, &[1.19]).triggers(), Some([1.0, 1.0]));
        for (start, after, excluded) in [
            (0.9, &[2.0][..], Excluded::BeforeFirst),
            (1.1, &[2.0], Excluded::WithinSlip),
            (1.104, &[2.0], Excluded::WithinSlip),
            (1.2095, &[2.0], Excluded::WithinSlip),
            (1.31, &[2.0], Excluded::AfterLast),
            (1.15, &[], Excluded::AfterLast),
        ] {
            assert_eq!(row(start, 1e-6, after).excluded, Some(excluded), "{start}");
        }
    }

    #[test]
    fn what_pulses_of_nothing_advance_is_noise_of_the_same_slider_alone() {
        let mut rows = [
            row(1.13, 1e-15, &[1.21 + 2e-9]),
            row(1.15, 1e-15, &[1.21 - 1e-9]),
            row(1.13, 1e-7, &[1.2]),
            row(1.13, 1e-15, &[1.23]),
            row(1.13, 1e-7, &[1.2]),
            row(1.13, 1e-7, &[1.2]),
        ];
        rows[1].parameters.all.seed = 3;
        for row in &mut rows[3..5] {
            row.parameters.all.damping_rate = 30.0;
        }
        rows[5].parameters.all.drive_velocity = 1e-5;
        note_noise(&mut rows);
        for (row, noise) in rows.iter().zip([2e-9, 2e-9, 2e-9, 0.02, 0.02]) {
            assert!((row.noise.unwrap() - noise).abs() < 1e-15);
        }
        assert_eq!(rows[5].noise, None);
    }

    #[test]
    fn a_share_of_which_none_is_seen_has_an_interval_and_none_reaches_below_0() {
        let rows = |triggered: usize| -> Vec<TriggerRow> {
            let row = |number: usize| TriggerRow {
                parameters: Selected::new(pulsed(1.15, 1e-7).with_seed(number as u64 % 8)),
                place: Some(0.5),
                advance: Some(0.0),
                triggered: Some(number < triggered),
                triggered_drive: Some(false),
                ..TriggerRow::default()
            };
            (0..80).map(row).collect()
        };
        for triggered in [0, 1, 3, 80] {
            let rows = rows(triggered);
            let row = &pulse_rows(&rows)[0];
            let share = triggered as f64 / 80.0;
            let Interval { low, high } = row.triggered_interval.unwrap();
            assert!(0.0 <= low && low <= share && share <= high && high <= 1.0);
            assert!(high - low > 0.03, "{low} {high}");
            let Interval { low, high } = row.triggered_excess_interval.unwrap();
            assert!(low < share && share < high && row.triggered_drive == 0.0);
        }
    }

    #[test]
    fn pulses_that_differ_in_start_and_seed_alone_have_one_mean_and_an_interval_by_seeds() {
        let of_seed = |seed: u64, amplitude: f64, advance: f64| {
            let mut row = row(1.15, amplitude, &[1.21 - advance]);
            row.tau_control = Some(0.1);
            row.parameters.all.seed = seed;
            row.parameters.all.pulse_start = Some(1.15 + 1e-3 * advance);
            row
        };
        let mut rows = vec![of_seed(0, 1e-15, 0.0), of_seed(0, 2e-7, 0.02)];
        rows.extend((0..20).map(|seed| of_seed(seed, 1e-7, 0.01 + 1e-4 * seed as f64)));
        let pulses = pulse_rows(&rows);
        let places = pulses.iter().map(|row| (row.place_low, row.jobs));
        // All begin in the middle of the interval.
        assert_eq!(
            places.collect::<Vec<_>>(),
            [(0.0, 1), (0.4, 1), (0.0, 20), (0.4, 20)]
        );
        let mean = pulses[2].advance_mean.unwrap();
        assert!((mean - 0.1095).abs() < 1e-9, "{mean}");
        assert_eq!(pulses[2].advance_drive, Some(0.0));
        let interval = pulses[2].advance_excess_interval.unwrap();
        assert!(interval.low < mean && mean < interval.high);
        assert!(interval.high - interval.low < 0.01);
        assert!((pulses[0].advance_mean.unwrap() - 0.2).abs() < 1e-9);
        assert_eq!(pulses[0].advance_interval, None);
    }
}
