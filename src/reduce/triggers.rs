//! Triggering: how much earlier a slip comes after a pulse than without it.
//!
//! The control of a pulsed job is the same run until the pulse begins, so that its next onset is that of the same slip
//! without the pulse. By the drive alone that slip comes when the pulsed drive first gets as far as the control's had
//! at its onset. Without an exact counterfactual, experiments compare catalogues before and after waves (van der Elst
//! and Savage, J. Geophys. Res. 120 (2015), 10.1002/2014JB011611).

use super::sequence::{Estimate, Sequences};
use super::set::SetJobs;
use crate::model::{Drive, Parameters, Selected, Selection, Symbol};
use crate::results::ResultsError;
use crate::results::tables::JobOfSlip;
use crate::sweep::Plan;
use crate::table::columns::{Interval, columns};
use crate::table::file::Dataset;
use crate::table::tables;
use crate::table::value::words;
use std::collections::{BTreeMap, HashMap};

/// Amplitude in m up to which a pulse moves nothing: what advances by it shows the error of the solver.
const NO_PULSE: f64 = 1e-12;

/// The parameters of a row: those of the pulse, and of the drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OfPulse;

impl Selection for OfPulse {
    const SYMBOLS: &'static [Symbol] = &[
        Symbol::V0,
        Symbol::Delta,
        Symbol::T,
        Symbol::PulseStart,
        Symbol::PulseCycles,
        Symbol::Seed,
    ];
}

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
        set_id: String = "", "hash of all that defines the job but the seed";
        parameters: Selected<OfPulse>;
        eta: f64 = "", "2 pi Delta / (T V0) of the pulse";
        tau_control: Option<f64> = "s", "mean interval of the controls of the set";
        cycle: Option<f64> = "s", "interval between the onsets of the control before and after the pulse begins";
        place: Option<f64> = "", "share of this interval that is over when the pulse begins";
        advance: Option<f64> = "s", "how much earlier the next onset comes than that of the control";
        advance_drive: Option<f64> = "s", "the same by the drive alone";
        next_advance: Option<f64> = "s", "how much earlier the onset after the next comes";
        triggered: Option<bool> = "", "whether the next onset lies within the pulse, and that of the control after its end";
        triggered_drive: Option<bool> = "", "the same by the drive alone";
        delayed: Option<bool> = "", "whether it is not triggered, and earlier by more than `noise`; null without `noise`";
        noise: Option<f64> = "s", "largest advance, of either sign, by pulses of at most 1e-12 m in this directory";
        excluded: Option<Excluded> = "",
            "why nothing is known: there is `no control`, or the pulse begins `before the first slip` that is recorded, `within a slip`, or `after the last slip` with one after it";
    }
}

tables! { TriggerRow = "triggers", "One row per job with a pulse, if there are any"; }

columns! {
    /// When a slip begins, and when its first and last contact break.
    #[derive(Clone, Copy, Debug)]
    struct Times {
        onset: f64;
        interval: Option<f64>;
        nucleation: f64;
        duration: f64;
    }
}

/// Slips of jobs, by their seeds.
type Jobs = BTreeMap<u64, Vec<Times>>;

/// The rows of the sets that have a pulse, set by set, in the order of their seeds.
///
/// Memory: 40 bytes for each slip of a control, 80 for each pulsed job.
pub(super) fn trigger_rows(
    slips: Dataset<'_>,
    plan: Plan<'_>,
    sets: &[SetJobs],
) -> Result<Vec<TriggerRow>, ResultsError> {
    let pulsed = sets
        .iter()
        .filter(|set| set.parameters.pulse_start.is_some());
    let pulsed: Vec<&SetJobs> = pulsed.collect();
    let control = |set: &SetJobs| plan.control_of(&set.parameters);
    let mut controls: HashMap<String, Jobs> = pulsed
        .iter()
        .filter_map(|set| Some((control(set)?, Jobs::new())))
        .collect();
    let mut runs: HashMap<String, (f64, Jobs)> = pulsed
        .iter()
        .filter_map(|set| {
            Some((
                set.set_id.clone(),
                (set.parameters.pulse_start?, Jobs::new()),
            ))
        })
        .collect();
    for row in slips.rows::<(JobOfSlip, Times)>() {
        let (job, slip) = row?;
        if let Some(control) = controls.get_mut(&job.set_id) {
            control.entry(job.seed).or_default().push(slip);
        } else if let Some((start, run)) = runs.get_mut(&job.set_id)
            && slip.onset > *start
        {
            let after = run.entry(job.seed).or_default();
            // The next, and the one after it.
            if after.len() < 2 {
                after.push(slip);
            }
        }
    }
    let mut rows = Vec::new();
    for set in pulsed {
        let none = Jobs::new();
        let controls = control(set)
            .and_then(|id| controls.get(&id))
            .unwrap_or(&none);
        let run = runs.get(&set.set_id).map_or(&none, |(_, run)| run);
        let intervals = controls.values().flatten().filter_map(|slip| slip.interval);
        let intervals: Vec<f64> = intervals.collect();
        let tau_control =
            (!intervals.is_empty()).then(|| intervals.iter().sum::<f64>() / intervals.len() as f64);
        for &seed in &set.finished {
            let after = run.get(&seed).map_or(&[][..], Vec::as_slice);
            let control = controls.get(&seed).map(Vec::as_slice);
            rows.push(TriggerRow {
                set_id: set.set_id.clone(),
                tau_control,
                ..row_of(&set.parameters, seed, control, after)
            });
        }
    }
    note_delays(&mut rows);
    Ok(rows)
}

/// The row of a job, from the slips of its control and those of its own after the pulse began.
fn row_of(
    parameters: &Parameters,
    seed: u64,
    control: Option<&[Times]>,
    after: &[Times],
) -> TriggerRow {
    let parameters = Parameters {
        seed,
        ..parameters.clone()
    };
    let row = TriggerRow {
        eta: parameters.eta(),
        ..TriggerRow::default()
    };
    let found = find(&parameters, control, after, &row);
    TriggerRow {
        parameters: Selected::new(parameters),
        ..found.unwrap_or_else(|excluded| TriggerRow {
            excluded: Some(excluded),
            ..row
        })
    }
}

fn find(
    parameters: &Parameters,
    control: Option<&[Times]>,
    after: &[Times],
    row: &TriggerRow,
) -> Result<TriggerRow, Excluded> {
    let control = control.ok_or(Excluded::NoControl)?;
    let drive = Drive::new(parameters);
    let [start, end] = drive.pulse().unwrap_or_default();
    let number = control.partition_point(|slip| slip.onset <= start);
    let free = control.get(number).ok_or(Excluded::AfterLast)?;
    let before = number.checked_sub(1).ok_or(Excluded::BeforeFirst)?;
    let last = control[before];
    if start < last.nucleation + last.duration || free.nucleation <= start {
        return Err(Excluded::WithinSlip);
    }
    let next = after.first().ok_or(Excluded::AfterLast)?;
    let cycle = free.onset - last.onset;
    let passage = drive.first_passage(free.onset);
    let is_triggered = |onset: f64| Some(onset <= end && free.onset > end);
    let following = control.get(number + 1).zip(after.get(1));
    Ok(TriggerRow {
        cycle: Some(cycle),
        place: Some((start - last.onset) / cycle),
        advance: Some(free.onset - next.onset),
        advance_drive: Some(free.onset - passage),
        next_advance: following.map(|(free, next)| free.onset - next.onset),
        triggered: is_triggered(next.onset),
        triggered_drive: is_triggered(passage),
        ..row.clone()
    })
}

/// Says which advances are larger than those by no pulse at all.
fn note_delays(rows: &mut [TriggerRow]) {
    let without = rows
        .iter()
        .filter(|row| row.parameters.modulation_amplitude <= NO_PULSE);
    let noise = without.filter_map(|row| row.advance).map(f64::abs);
    let noise = noise.reduce(f64::max);
    for row in rows {
        row.noise = noise;
        let advance = row.advance.zip(row.triggered).zip(noise);
        row.delayed = advance.map(|((advance, triggered), noise)| !triggered && advance > noise);
    }
}

/// The pulses of one drive velocity, amplitude, period and number of periods that say something.
#[derive(Clone, Debug)]
pub struct Pulses<'a> {
    pub rows: Vec<&'a TriggerRow>,
}

impl<'a> Pulses<'a> {
    /// All but those that move nothing, in the order of the rows.
    pub fn of(rows: &'a [TriggerRow]) -> Vec<Self> {
        let mut all: Vec<Self> = Vec::new();
        let known = rows.iter().filter(|row| row.advance.is_some());
        for row in known.filter(|row| row.parameters.modulation_amplitude > NO_PULSE) {
            let is_same = |pulses: &&mut Self| {
                let other = &pulses.rows[0].parameters;
                let start = other.pulse_start;
                let seed = other.seed;
                let alike = Parameters {
                    pulse_start: start,
                    seed,
                    ..row.parameters.parameters.clone()
                };
                alike == **other
            };
            match all.iter_mut().find(is_same) {
                Some(pulses) => pulses.rows.push(row),
                None => all.push(Self { rows: vec![row] }),
            }
        }
        all
    }

    /// The mean of a quantity, with its interval over seeds; both `None` without a value.
    pub fn mean(
        &self,
        quantity: impl Fn(&TriggerRow) -> Option<f64>,
    ) -> (Option<f64>, Option<Interval>) {
        let mut jobs: BTreeMap<u64, Vec<[f64; 1]>> = BTreeMap::new();
        for row in &self.rows {
            let job = jobs.entry(row.parameters.seed).or_default();
            job.extend(quantity(row).map(|value| [value]));
        }
        let mean: Estimate<1> = Sequences::of(jobs.into_values()).estimate();
        (mean.value(), mean.interval())
    }

    /// Those that begin between two shares of the interval of the control.
    pub fn between(&self, low: f64, high: f64) -> Self {
        let mut rows = self.rows.clone();
        rows.retain(|row| row.place.is_some_and(|place| (low..high).contains(&place)));
        Self { rows }
    }
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

    fn slips(onsets: &[f64]) -> Vec<Times> {
        let slip = |&onset: &f64| Times {
            onset,
            interval: None,
            nucleation: onset - 0.001,
            duration: 0.006,
        };
        onsets.iter().map(slip).collect()
    }

    #[test]
    fn the_next_onset_is_compared_with_that_of_the_control_and_with_the_drive_alone() {
        let control = slips(&[1.0, 1.1, 1.21, 1.3]);
        let row = |start: f64, after: &[f64]| {
            row_of(&pulsed(start, 1e-6), 4, Some(&control), &slips(after))
        };
        let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-12;
        let triggered = row(1.15, &[1.16, 1.28]);
        assert_eq!(triggered.parameters.seed, 4);
        assert!(near(triggered.cycle, 0.11) && near(triggered.place, 0.05 / 0.11));
        assert!(near(triggered.advance, 0.05) && near(triggered.next_advance, 0.02));
        assert_eq!(triggered.triggered, Some(true));
        // The drive rises by 2 Δ = 2 µm, as far as in 20 ms: too early for a slip 60 ms later.
        assert_eq!(
            (triggered.advance_drive, triggered.triggered_drive),
            (Some(0.0), Some(false))
        );
        let by_drive = row(1.195, &[1.2]);
        assert!(by_drive.advance_drive > Some(0.005) && by_drive.triggered_drive == Some(false));
        assert_eq!(
            row(1.195, &[1.2]).triggered,
            Some(false),
            "the control slips within the pulse"
        );
        assert!(row(1.185, &[1.19]).triggered_drive == Some(true));
        for (start, excluded) in [
            (0.9, Excluded::BeforeFirst),
            (1.1, Excluded::WithinSlip),
            (1.104, Excluded::WithinSlip),
            (1.2095, Excluded::WithinSlip),
            (1.31, Excluded::AfterLast),
        ] {
            assert_eq!(row(start, &[2.0]).excluded, Some(excluded), "{start}");
        }
        assert_eq!(row(1.15, &[]).excluded, Some(Excluded::AfterLast));
        let alone = row_of(&pulsed(1.0, 1e-6), 0, None, &[]);
        assert_eq!(alone.excluded, Some(Excluded::NoControl));
    }

    #[test]
    fn what_pulses_of_nothing_advance_is_noise() {
        let control = slips(&[1.0, 1.1, 1.2]);
        let row = |amplitude: f64, next: f64| {
            row_of(&pulsed(1.13, amplitude), 0, Some(&control), &slips(&[next]))
        };
        let mut rows = [
            row(1e-15, 1.2 + 2e-9),
            row(1e-7, 1.2 - 1e-9),
            row(1e-7, 1.19),
        ];
        note_delays(&mut rows);
        assert!(
            rows.iter()
                .all(|row| (row.noise.unwrap() - 2e-9).abs() < 1e-15)
        );
        assert_eq!(
            rows.map(|row| row.delayed),
            [Some(false), Some(false), Some(true)]
        );
    }
}
