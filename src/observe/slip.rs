//! Slips and precursors: found from the contact events, measured on the shear force.
//!
//! Definitions: a slip is a rupture of all blocks; a precursor any other of at least `precursor_size` breaks; smaller ones
//! are creep. The onset of a slip is the largest shear force between the previous slip's end (its last break) and the
//! instant at which its rupture reaches the leading edge; it lies at an extreme of F_S or at an event, located exactly.

use super::Recording;
use super::drops::{DropDetector, Drops};
use super::phase::phase;
use super::rupture::{Rupture, advance_speed};
use crate::model::theory::eta;
use crate::model::{Change, ContactEvent, Drive, Parameters};
use crate::solver::{Observer, Segment};
use crate::table::columns::columns;
use std::f64::consts::TAU;

columns! {
    /// The cycle of the modulation in force at an onset.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Modulation {
        period as "T_onset": Option<f64> = "s",
            "period of the modulation at the onset, T unless ramped; null without modulation";
        amplitude as "Delta_onset": f64 = "m",
            "amplitude of the modulation at the onset, Delta unless ramped; 0 without modulation";
    }
}

impl Modulation {
    fn of(drive: &Drive) -> Self {
        Self { period: (drive.period > 0.0).then_some(drive.period), amplitude: drive.amplitude }
    }

    /// η at the onset, under a drive at this velocity in m/s; 0 without modulation.
    #[must_use]
    pub fn eta(&self, drive_velocity: f64) -> f64 {
        self.period.map_or(0.0, |period| eta(TAU / period, self.amplitude, drive_velocity))
    }

    /// Number n of periods nearest to an interval in s; `None` without modulation.
    #[must_use]
    pub fn periods(&self, interval: f64) -> Option<u64> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "intervals are > 0")]
        self.period.map(|period| (interval / period).round() as u64)
    }
}

columns! {
    /// One slip: a rupture that breaks contacts at every block.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Slip {
        number as "slip": u64 = "", "number of the slip within its job, from 0 past start-up";
        onset: f64 = "s", "time of the largest shear force since the previous slip's end";
        interval: Option<f64> = "s", "time since the previous onset";
        modulation: Modulation;
        periods as "n": Option<u64> = "", "interval in periods T_onset, rounded; null without modulation";
        phase: Option<f64> = "rad", "phase of the onset against the modulation";
        peak_force: f64 = "N", "shear force at the onset";
        drop: f64 = "N", "peak force minus the least shear force during the slip";
        nucleation: f64 = "s", "time of the first break";
        nucleation_block: u64 = "", "block of the first break, from 1 at the trailing edge";
        duration: f64 = "s", "from the first to the last break";
        size: u64 = "", "breaks in the rupture";
        front_speed: Option<f64> = "m/s", "speed of the rupture front";
        precursors: u64 = "", "precursors since the previous slip";
        slow_front_speed: Option<f64> = "m/s",
            "advance of the reach through these precursors; null for fewer than two";
        drops: Drops;
    }
}

columns! {
    /// One precursor: a rupture of at least the precursor size that does not break contacts at every block.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Precursor {
        slip: u64 = "", "number of the slip that it precedes";
        precursor: u64 = "", "number of the precursor before that slip, from 0";
        onset: f64 = "s", "time of the largest shear force since the previous rupture of at least this size";
        interval: Option<f64> = "s", "time since the onset of the previous precursor of the same slip";
        modulation: Modulation;
        nucleation: f64 = "s", "time of the first break";
        nucleation_block: u64 = "", "block of the first break, from 1 at the trailing edge";
        duration: f64 = "s", "from the first to the last break";
        size: u64 = "", "breaks in the rupture";
        extent: u64 = "", "distinct blocks with a break";
        reach: u64 = "", "the furthest of them, from 1";
        front_speed: Option<f64> = "m/s", "speed of the rupture front";
    }
}

/// A largest shear force, in N, and its time, in s.
#[derive(Clone, Copy, Debug)]
struct Peak {
    time: f64,
    force: f64,
}

impl Peak {
    fn raise(&mut self, other: Peak) {
        if other.force > self.force {
            *self = other;
        }
    }
}

/// An observer that finds slips and precursors.
#[derive(Clone, Debug)]
pub struct SlipObserver {
    parameters: Parameters,
    /// The drive in its cycle at the last slip's onset, and at the last precursor's.
    at_slip: Drive,
    at_precursor: Drive,
    recording: Recording,
    precursor_size: u64,
    crossing_time: f64,
    /// Shear force at the end of the last segment, and the impulse since the start, in N s.
    now: Peak,
    impulse: f64,
    /// Peaks since the last slip's end, since the last rupture of precursor size, and since the last break.
    since_slip: Peak,
    since_precursor: Peak,
    since_break: Peak,
    rupture: Option<Active>,
    slips_seen: u64,
    last_onset: Option<f64>,
    slips: Vec<Slip>,
    precursors: Vec<Precursor>,
    /// Precursors of the slip to come: onset of the last, and those that advanced the reach (time, position).
    pending: u64,
    last_precursor_onset: Option<f64>,
    advances: Vec<(f64, f64)>,
    furthest: Option<usize>,
    /// Time and impulse at the end of start-up and of the last slip.
    first_mark: Option<(f64, f64)>,
    last_mark: Option<(f64, f64)>,
    ruptures: u64,
    /// Drops, if they are recorded, and first and last break of every slip.
    drops: Option<DropDetector>,
    spans: Vec<(f64, f64)>,
}

/// A rupture in progress, with what is measured on its force.
#[derive(Clone, Debug)]
struct Active {
    rupture: Rupture,
    /// Peak since the last slip, when the rupture reached the leading edge.
    onset: Option<Peak>,
    /// Peak since the last precursor, when the rupture began.
    precursor_onset: Peak,
    /// Least force so far, and up to the last break, in N.
    least: f64,
    least_at_last_break: f64,
    /// Impulse at the last break, in N s.
    impulse_at_last_break: f64,
}

impl Active {
    /// Whether it is a slip or, with at least this many breaks, a precursor.
    fn is_recorded(&self, precursor_size: u64) -> bool {
        self.rupture.size >= precursor_size || self.rupture.spans_slider()
    }
}

impl SlipObserver {
    /// An observer for one job.
    pub fn new(parameters: &Parameters, recording: &Recording) -> Self {
        let start = Peak { time: 0.0, force: 0.0 };
        Self {
            parameters: parameters.clone(),
            at_slip: Drive::new(parameters),
            at_precursor: Drive::new(parameters),
            recording: *recording,
            precursor_size: recording.precursor_size.unwrap_or(parameters.contacts_per_block as u64),
            crossing_time: parameters.wave_crossing_time(),
            now: start,
            impulse: 0.0,
            since_slip: start,
            since_precursor: start,
            since_break: start,
            rupture: None,
            slips_seen: 0,
            last_onset: None,
            slips: Vec::new(),
            precursors: Vec::new(),
            pending: 0,
            last_precursor_onset: None,
            advances: Vec::new(),
            furthest: None,
            first_mark: None,
            last_mark: None,
            ruptures: 0,
            drops: recording.drop_size.map(|size| DropDetector::new(parameters, size)),
            spans: Vec::new(),
        }
    }

    /// Slips past start-up, and their precursors if they are recorded.
    pub fn into_rows(mut self) -> (Vec<Slip>, Vec<Precursor>) {
        if let Some(drops) = self.drops {
            let discarded = self.spans.len() - self.slips.len();
            let of_slips = drops.of_slips(&self.spans).into_iter().skip(discarded);
            self.slips.iter_mut().zip(of_slips).for_each(|(slip, drops)| slip.drops = drops);
        }
        (self.slips, self.precursors)
    }

    /// Ruptures of any size that have ended.
    pub fn ruptures(&self) -> u64 {
        self.ruptures
    }

    /// Mean friction: the time mean of F_S over whole cycles, from the end of the last slip of start-up (of the first slip,
    /// if none is discarded) to the end of the last slip, in N. `None` if no cycle is whole.
    pub fn mean_friction(&self) -> Option<f64> {
        let ((start, from), (end, to)) = (self.first_mark?, self.last_mark?);
        (end > start).then(|| (to - from) / (end - start))
    }

    fn begin_or_extend(&mut self, event: &ContactEvent) {
        if self.rupture.as_ref().is_some_and(|active| event.time - active.rupture.last_time > self.crossing_time) {
            self.finish_rupture();
        }
        let blocks = self.parameters.blocks;
        let active = if let Some(active) = &mut self.rupture {
            active.rupture.include(event);
            active
        } else {
            self.rupture.insert(Active {
                rupture: Rupture::new(event, blocks),
                onset: None,
                precursor_onset: self.since_precursor,
                least: self.now.force,
                least_at_last_break: self.now.force,
                impulse_at_last_break: self.impulse,
            })
        };
        if event.block + 1 == blocks && active.onset.is_none() {
            active.onset = Some(self.since_slip);
        }
        active.least_at_last_break = active.least;
        active.impulse_at_last_break = self.impulse;
        self.since_break = Peak { time: event.time, force: self.now.force };
    }

    fn finish_rupture(&mut self) {
        let Some(active) = self.rupture.take() else { return };
        self.ruptures += 1;
        if !active.is_recorded(self.precursor_size) {
            return;
        }
        if active.rupture.spans_slider() {
            self.record_slip(&active);
        } else {
            self.record_precursor(&active);
        }
    }

    fn record_slip(&mut self, active: &Active) {
        let rupture = &active.rupture;
        // A rupture of all blocks has reached the leading edge.
        let onset = active.onset.unwrap_or(self.since_slip);
        let discard = self.recording.discard;
        self.at_slip.advance_to(onset.time);
        if self.slips_seen >= discard {
            let drive = &self.at_slip;
            let modulation = Modulation::of(drive);
            let interval = self.last_onset.map(|last| onset.time - last);
            self.slips.push(Slip {
                number: self.slips_seen - discard,
                onset: onset.time,
                interval,
                modulation,
                periods: interval.and_then(|interval| modulation.periods(interval)),
                phase: modulation.period.map(|period| phase(onset.time - drive.cycle_start, period, drive.eta())),
                peak_force: onset.force,
                drop: onset.force - active.least_at_last_break,
                nucleation: rupture.first_time,
                nucleation_block: rupture.first_block as u64 + 1,
                duration: rupture.last_time - rupture.first_time,
                size: rupture.size,
                front_speed: rupture.front_speed(&self.parameters),
                precursors: self.pending,
                slow_front_speed: advance_speed(self.advances.iter().copied()),
                drops: Drops::default(),
            });
        }
        if self.drops.is_some() {
            self.spans.push((rupture.first_time, rupture.last_time));
        }
        self.slips_seen += 1;
        let mark = (rupture.last_time, active.impulse_at_last_break);
        if self.slips_seen == discard.max(1) {
            self.first_mark = Some(mark);
        }
        self.last_mark = Some(mark);
        self.last_onset = Some(onset.time);
        self.since_slip = self.since_break;
        self.since_precursor = self.since_break;
        self.pending = 0;
        self.last_precursor_onset = None;
        self.advances.clear();
        self.furthest = None;
    }

    fn record_precursor(&mut self, active: &Active) {
        let rupture = &active.rupture;
        let onset = active.precursor_onset.time;
        if self.recording.precursors && self.slips_seen >= self.recording.discard {
            self.at_precursor.advance_to(onset);
            self.precursors.push(Precursor {
                slip: self.slips_seen - self.recording.discard,
                precursor: self.pending,
                onset,
                interval: self.last_precursor_onset.map(|last| onset - last),
                modulation: Modulation::of(&self.at_precursor),
                nucleation: rupture.first_time,
                nucleation_block: rupture.first_block as u64 + 1,
                duration: rupture.last_time - rupture.first_time,
                size: rupture.size,
                extent: rupture.extent() as u64,
                reach: rupture.reach as u64 + 1,
                front_speed: rupture.front_speed(&self.parameters),
            });
        }
        if self.furthest.is_none_or(|furthest| rupture.reach > furthest) {
            let position = (rupture.reach + 1) as f64 * self.parameters.slider_length / self.parameters.blocks as f64;
            self.advances.push((rupture.first_time, position));
            self.furthest = Some(rupture.reach);
        }
        self.pending += 1;
        self.last_precursor_onset = Some(onset);
        self.since_precursor = self.since_break;
    }
}

impl Observer for SlipObserver {
    fn advance(&mut self, segment: &Segment<'_>) {
        // Each stretch contains the later ones, so a force that raises none of these peaks raises no other. The peak since the
        // last break counts only once its rupture ends, and if that is recorded.
        let recordable = self.rupture.as_ref().is_some_and(|active| active.is_recorded(self.precursor_size));
        let floor = if recordable { self.since_break.force } else { self.since_precursor.force };
        if let Some((time, force)) = segment.maximum_above(floor) {
            let peak = Peak { time, force };
            self.since_break = peak;
            self.since_precursor.raise(peak);
            self.since_slip.raise(peak);
        }
        if let Some(active) = &mut self.rupture
            && let Some((_, force)) = segment.minimum_below(active.least)
        {
            active.least = force;
        }
        if let Some(drops) = &mut self.drops {
            drops.advance(segment);
        }
        self.impulse += segment.impulse();
        self.now = Peak { time: segment.end(), force: segment.end_force() };
        if self.rupture.as_ref().is_some_and(|active| self.now.time - active.rupture.last_time > self.crossing_time) {
            self.finish_rupture();
        }
    }

    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break {
            self.begin_or_extend(event);
        }
    }

    fn follows_attachments(&self) -> bool {
        false
    }

    fn is_satisfied(&self) -> bool {
        self.slips.len() as u64 >= self.recording.slips
    }
}
