//! Slips and precursors: found from the contact events, measured on the shear force.
//!
//! Definitions: a slip is a rupture that breaks contacts at every block and lets go of at least half of those that held, and
//! a tenth of all; a precursor any other of at least `precursor_size` breaks; smaller ones are creep. The onset of a slip is the largest shear force between the previous slip's end (its last break) and the
//! instant at which its rupture reaches the leading edge; it lies at an extreme of F_S or at an event, located exactly.

use super::Recording;
use super::drops::{DropDetector, Drops};
use super::phase::phase;
use super::regime::Averages;
use super::rupture::{Rupture, advance_speed};
use crate::columns::columns;
use crate::model::theory::eta;
use crate::model::{Change, ContactEvent, Drive, Parameters};
use crate::solver::{Observer, Segment, Spent};
use crate::value::floored;
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
        Self {
            period: (drive.period > 0.0).then_some(drive.period),
            amplitude: drive.amplitude,
        }
    }

    /// η at the onset, under a drive at this velocity in m/s; 0 without modulation.
    pub fn eta(&self, drive_velocity: f64) -> f64 {
        self.period.map_or(0.0, |period| {
            eta(TAU / period, self.amplitude, drive_velocity)
        })
    }

    /// Number n of periods nearest to an interval in s; `None` without modulation.
    pub fn periods(&self, interval: f64) -> Option<u64> {
        self.period
            .map(|period| floored((interval / period).round()) as u64)
    }
}

columns! {
    /// What the drive put in from the previous slip's last break to the slip's own, and where it was lost; not in
    /// tables unless recorded.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Energies {
        work as "drive_work": Option<f64> = "J", "work of the drive since the last break of the previous slip; not there unless the sweep records energies, as what follows";
        damping as "damping_loss": Option<f64> = "J", "loss in damping in that time";
        broken as "break_loss": Option<f64> = "J", "energy of the contacts that broke in that time";
    }
}

impl Energies {
    fn between(start: Spent, end: Spent) -> Self {
        Self {
            work: Some(end.work - start.work),
            damping: Some(end.damping - start.damping),
            broken: Some(end.broken - start.broken),
        }
    }
}

columns! {
    /// One slip: a rupture that breaks contacts at every block and lets go of at least half of those that held, and a tenth
    /// of all.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Slip {
        number as "slip": u64 = "", "number of the slip within its job, from 0 past start-up";
        onset: f64 = "s", "time of the largest shear force since the previous slip's end";
        interval: Option<f64> = "s", "time since the previous onset";
        modulation: Modulation;
        periods: Option<u64> = "", "interval in periods T_onset, rounded; null without modulation";
        phase: Option<f64> = "rad", "phase of the onset against the modulation";
        peak_force: f64 = "N", "shear force at the onset";
        drop: f64 = "N", "peak force minus the least shear force during the slip";
        nucleation: f64 = "s", "time of the first break";
        nucleation_block: u64 = "", "block of the first break, from 1 at the trailing edge";
        duration: f64 = "s", "from the first to the last break";
        size: u64 = "", "breaks in the rupture";
        attached_before: f64 = "", "fraction of the contacts that are attached before the first break";
        least_attached: f64 = "", "least fraction of the contacts that are attached during the rupture";
        distance as "slip_distance": f64 = "m", "mean distance that the blocks move, from the first to the last break";
        edge_distance: f64 = "m", "distance that the driven edge moves in that time";
        onset_cut: bool = "", "whether the shear force still rose when the rupture reached the leading edge";
        front_speed: Option<f64> = "m/s", "speed of the rupture front";
        precursors: u64 = "", "precursors since the previous slip";
        largest_precursor: u64 = "", "breaks in the largest of them; 0 if there is none";
        slow_front_speed: Option<f64> = "m/s",
            "advance of the reach through these precursors; null for fewer than two";
        energies: Energies;
        drops: Drops;
    }
}

columns! {
    /// One precursor: a rupture of at least the precursor size that is no slip.
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
        length: f64 = "m", "the same times the length of a block, L/N";
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

/// An instant, and what has been counted up to it.
#[derive(Clone, Copy, Debug, Default)]
struct Instant {
    time: f64,
    /// Shear force, in N.
    force: f64,
    /// Its integral over time, in N s.
    impulse: f64,
    /// Integral of the number of attached contacts, in s.
    attached_time: f64,
    /// Time within slips, in s.
    slipping: f64,
    /// Mean displacement of the blocks, in m.
    mean_displacement: f64,
    /// Zero unless energies are recorded.
    spent: Spent,
}

/// An observer that finds slips and precursors.
#[derive(Clone, Debug)]
pub struct SlipObserver {
    parameters: Parameters,
    /// The drive in its cycle at the last slip's onset, and at the last precursor's.
    at_slip: Drive,
    at_precursor: Drive,
    /// The same at the first or last break of the last slip.
    at_break: Drive,
    recording: Recording,
    precursor_size: u64,
    /// All contacts, attached or not.
    contacts: u64,
    crossing_time: f64,
    give_up_time: f64,
    /// The end of the last segment, but for what is counted at events; and the last event.
    now: Instant,
    at_event: Instant,
    attached: u64,
    /// Time within slips that have ended, in s.
    slipping: f64,
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
    largest_pending: u64,
    last_precursor_onset: Option<f64>,
    advances: Vec<(f64, f64)>,
    furthest: Option<usize>,
    /// The end of start-up and of the last slip.
    start_up_end: Option<Instant>,
    last_end: Option<Instant>,
    /// Halfway from the last slip to where the job gives up, and whether it has.
    settled: Option<Instant>,
    pub(super) has_given_up: bool,
    /// Ruptures of any size that have ended.
    pub(super) ruptures: u64,
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
    first: Instant,
    last: Instant,
    /// Whether the shear force was rising at the onset.
    onset_cut: bool,
}

impl Active {
    /// Whether it is a slip or, with at least this many breaks, a precursor.
    fn is_recorded(&self, precursor_size: u64, contacts: u64) -> bool {
        self.rupture.size >= precursor_size || self.rupture.is_slip(contacts)
    }
}

impl SlipObserver {
    pub fn new(parameters: &Parameters, recording: &Recording) -> Self {
        let start = Peak {
            time: 0.0,
            force: 0.0,
        };
        let contacts = (parameters.blocks * parameters.contacts_per_block) as u64;
        Self {
            parameters: parameters.clone(),
            at_slip: Drive::new(parameters),
            at_precursor: Drive::new(parameters),
            at_break: Drive::new(parameters),
            recording: *recording,
            precursor_size: recording
                .precursor_size
                .unwrap_or(parameters.contacts_per_block as u64),
            contacts,
            crossing_time: parameters.wave_crossing_time(),
            give_up_time: recording.give_up_time(parameters),
            now: Instant::default(),
            at_event: Instant::default(),
            attached: contacts,
            slipping: 0.0,
            since_slip: start,
            since_precursor: start,
            since_break: start,
            rupture: None,
            slips_seen: 0,
            last_onset: None,
            slips: Vec::new(),
            precursors: Vec::new(),
            pending: 0,
            largest_pending: 0,
            last_precursor_onset: None,
            advances: Vec::new(),
            furthest: None,
            start_up_end: None,
            last_end: None,
            settled: None,
            has_given_up: false,
            ruptures: 0,
            drops: recording
                .drop_size
                .map(|size| DropDetector::new(parameters, size)),
            spans: Vec::new(),
        }
    }

    /// Slips past start-up, and their precursors if they are recorded.
    pub fn into_rows(mut self) -> (Vec<Slip>, Vec<Precursor>) {
        // Precursors of a slip that the job does not have belong to none.
        let slips = self.slips.len() as u64;
        self.precursors.retain(|precursor| precursor.slip < slips);
        if let Some(drops) = self.drops {
            let discarded = self.spans.len() - self.slips.len();
            let of_slips = drops.of_slips(&self.spans).into_iter().skip(discarded);
            self.slips
                .iter_mut()
                .zip(of_slips)
                .for_each(|(slip, drops)| slip.drops = drops);
        }
        (self.slips, self.precursors)
    }

    /// Averages over time, from the end of start-up to that of the last slip. What follows belongs to it if no slip has come
    /// for half the time to give up: the slider then slides, and without a slip past start-up only that second half counts.
    /// `None` if nothing is left.
    pub fn averages(&self) -> Option<Averages> {
        let (start, end) = match self.settled {
            Some(settled) => {
                let start_up_end = self.start_up_end.filter(|_| !self.slips.is_empty());
                (start_up_end.unwrap_or(settled), self.sliding())
            }
            None => self.start_up_end.zip(self.last_end)?,
        };
        let time = end.time - start.time;
        (time > 0.0).then(|| Averages {
            time,
            friction: (end.impulse - start.impulse) / time,
            attached_fraction: (end.attached_time - start.attached_time)
                / (time * self.contacts as f64),
            slip_share: (end.slipping - start.slipping) / time,
        })
    }

    /// Time since the last onset, in s, of a job that gives up: what its interval is at least.
    pub fn running_interval(&self) -> Option<f64> {
        let last = self.last_onset.filter(|_| self.has_given_up)?;
        Some(self.now.time - last)
    }

    /// Whether the last slip that was asked for is recorded.
    fn is_complete(&self) -> bool {
        let Some(last) = self.slips.last() else {
            return false;
        };
        let Recording { slips, time, .. } = self.recording;
        slips.is_some_and(|slips| self.slips.len() as u64 >= slips)
            || time.is_some_and(|time| last.onset >= time)
    }

    /// The present instant with all that is counted, after sliding since the last slip; from the last event on at its rate.
    fn sliding(&self) -> Instant {
        Instant {
            attached_time: self.at_event.attached_time
                + self.attached as f64 * (self.now.time - self.at_event.time),
            slipping: self.slipping + self.now.time - self.last_end.map_or(0.0, |end| end.time),
            ..self.now
        }
    }

    fn begin_or_extend(&mut self, event: &ContactEvent) {
        if self
            .rupture
            .as_ref()
            .is_some_and(|active| event.time - active.last.time > self.crossing_time)
        {
            self.finish_rupture();
        }
        let blocks = self.parameters.blocks;
        let here = Instant {
            time: event.time,
            attached_time: event.attached_time,
            mean_displacement: event.mean_displacement,
            ..self.now
        };
        (self.at_event, self.attached) = (here, event.attached);
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
                first: here,
                last: here,
                onset_cut: false,
            })
        };
        if event.block + 1 == blocks && active.onset.is_none() {
            active.onset = Some(self.since_slip);
            active.onset_cut = self.now.force >= self.since_slip.force;
        }
        active.least_at_last_break = active.least;
        active.last = here;
        self.since_break = Peak {
            time: event.time,
            force: self.now.force,
        };
    }

    fn finish_rupture(&mut self) {
        let Some(active) = self.rupture.take() else {
            return;
        };
        self.ruptures += 1;
        if !active.is_recorded(self.precursor_size, self.contacts) {
            return;
        }
        if active.rupture.is_slip(self.contacts) {
            self.record_slip(&active);
        } else {
            self.record_precursor(&active);
        }
    }

    fn record_slip(&mut self, active: &Active) {
        let rupture = &active.rupture;
        // A slip has reached the leading edge.
        let onset = active.onset.unwrap_or(self.since_slip);
        let (first, last) = (active.first, active.last);
        let discard = self.recording.discard;
        self.at_slip.advance_to(onset.time);
        if self.slips_seen >= discard {
            let edge_distance = -self.edge_displacement(first) + self.edge_displacement(last);
            let drive = &self.at_slip;
            let modulation = Modulation::of(drive);
            let interval = self.last_onset.map(|last| onset.time - last);
            let spent = self.last_end.map_or(Spent::default(), |end| end.spent);
            let energies = self
                .recording
                .energies
                .then(|| Energies::between(spent, last.spent));
            self.slips.push(Slip {
                number: self.slips_seen - discard,
                onset: onset.time,
                interval,
                modulation,
                periods: interval.and_then(|interval| modulation.periods(interval)),
                phase: modulation
                    .period
                    .map(|period| phase(onset.time - drive.cycle_start, period, drive.eta)),
                peak_force: onset.force,
                drop: onset.force - active.least_at_last_break,
                nucleation: first.time,
                nucleation_block: rupture.first_block as u64 + 1,
                duration: last.time - first.time,
                size: rupture.size,
                attached_before: rupture.attached_before as f64 / self.contacts as f64,
                least_attached: rupture.least_attached as f64 / self.contacts as f64,
                distance: last.mean_displacement - first.mean_displacement,
                edge_distance,
                onset_cut: active.onset_cut,
                front_speed: rupture.front_speed(&self.parameters),
                precursors: self.pending,
                largest_precursor: self.largest_pending,
                slow_front_speed: advance_speed(self.advances.iter().copied()),
                energies: energies.unwrap_or_default(),
                drops: Drops::default(),
            });
        }
        if self.drops.is_some() {
            self.spans.push((first.time, last.time));
        }
        self.slips_seen += 1;
        self.slipping += last.time - first.time;
        let end = Instant {
            slipping: self.slipping,
            ..last
        };
        if self.slips_seen == discard.max(1) {
            self.start_up_end = Some(end);
        }
        self.last_end = Some(end);
        self.settled = None;
        self.last_onset = Some(onset.time);
        self.since_slip = self.since_break;
        self.since_precursor = self.since_break;
        (self.pending, self.largest_pending) = (0, 0);
        self.last_precursor_onset = None;
        self.advances.clear();
        self.furthest = None;
    }

    /// Displacement of the driven edge at a break of the last slip, from the force and the drive, in m.
    fn edge_displacement(&mut self, at: Instant) -> f64 {
        self.at_break.advance_to(at.time);
        self.at_break.motion(at.time).0 - at.force / self.at_break.stiffness
    }

    fn record_precursor(&mut self, active: &Active) {
        let Active {
            rupture,
            first,
            last,
            ..
        } = active;
        let onset = active.precursor_onset.time;
        if self.recording.precursors && self.slips_seen >= self.recording.discard {
            self.at_precursor.advance_to(onset);
            self.precursors.push(Precursor {
                slip: self.slips_seen - self.recording.discard,
                precursor: self.pending,
                onset,
                interval: self.last_precursor_onset.map(|last| onset - last),
                modulation: Modulation::of(&self.at_precursor),
                nucleation: first.time,
                nucleation_block: rupture.first_block as u64 + 1,
                duration: last.time - first.time,
                size: rupture.size,
                extent: rupture.extent() as u64,
                length: rupture.extent() as f64 * self.parameters.slider_length
                    / self.parameters.blocks as f64,
                reach: rupture.reach as u64 + 1,
                front_speed: rupture.front_speed(&self.parameters),
            });
        }
        if self
            .furthest
            .is_none_or(|furthest| rupture.reach > furthest)
        {
            let position = (rupture.reach + 1) as f64 * self.parameters.slider_length
                / self.parameters.blocks as f64;
            self.advances.push((first.time, position));
            self.furthest = Some(rupture.reach);
        }
        self.pending += 1;
        self.largest_pending = self.largest_pending.max(rupture.size);
        self.last_precursor_onset = Some(onset);
        self.since_precursor = self.since_break;
    }
}

impl Observer for SlipObserver {
    fn advance(&mut self, segment: &Segment<'_>) {
        // Each stretch contains the later ones, so a force that raises none of these peaks raises no other. The peak since the
        // last break counts only once its rupture ends, and if that is recorded.
        let recordable = self
            .rupture
            .as_ref()
            .is_some_and(|active| active.is_recorded(self.precursor_size, self.contacts));
        let floor = if recordable {
            self.since_break.force
        } else {
            self.since_precursor.force
        };
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
        let impulse = self.now.impulse + segment.impulse();
        self.now = Instant {
            time: segment.end(),
            force: segment.end_force(),
            impulse,
            ..self.now
        };
        if self
            .rupture
            .as_ref()
            .is_some_and(|active| self.now.time - active.last.time > self.crossing_time)
        {
            self.finish_rupture();
        }
        let since_slip = self.now.time - self.last_end.map_or(0.0, |end| end.time);
        if self.settled.is_none() && since_slip >= 0.5 * self.give_up_time {
            self.settled = Some(self.sliding());
        }
        self.has_given_up = since_slip >= self.give_up_time;
    }

    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break {
            self.begin_or_extend(event);
        }
    }

    fn spent(&mut self, spent: Spent) {
        self.now.spent = spent;
    }

    fn follows_attachments(&self) -> bool {
        false
    }

    fn follows_force(&self) -> bool {
        self.drops.is_some()
    }

    fn is_satisfied(&self) -> bool {
        self.is_complete() || self.has_given_up
    }
}
