//! Finds slips and precursors from the contact events, and measures them on the shear force.
//!
//! A precursor is a rupture of at least `precursor_size` breaks that is no slip; smaller ones are creep. The onset of a
//! slip is the largest shear force between the previous slip's end (its last break) and the instant at which its
//! rupture reaches the leading edge; it lies at an extreme of F_S or at an event, located exactly.

use super::drops::{DropDetector, Drops};
use super::rupture::{FrontPoint, Peak, RunningTotals, Rupture, advance_speed};
use super::slip::{Energies, Modulation, Precursor, Slip, phase};
use super::{Averages, Measurements, Recording};
use crate::model::{Change, ContactEvent, Drive, Parameters};
use crate::solver::{Observer, Segment, Spent, Summary};

/// Largest shear forces since the last slip's end, the last rupture of precursor size, and the last break.
#[derive(Clone, Debug, Default)]
struct PeaksSince {
    slip: Peak,
    precursor: Peak,
    last_break: Peak,
}

/// Precursors of the slip to come.
#[derive(Clone, Debug, Default)]
struct PendingPrecursors {
    count: u64,
    /// Breaks in the largest.
    largest: u64,
    last_onset: Option<f64>,
    /// Where those that advanced the reach brought it.
    advances: Vec<FrontPoint>,
    /// Blocks up to the furthest that they reach.
    furthest: usize,
}

/// The instants between which averages over time are taken.
#[derive(Clone, Debug, Default)]
struct Span {
    start_up_end: Option<RunningTotals>,
    /// The start, as long as there is no slip.
    last_slip_end: RunningTotals,
    /// Halfway from the last slip to where the job gives up.
    settled: Option<RunningTotals>,
}

#[derive(Clone, Debug)]
pub struct SlipObserver {
    parameters: Parameters,
    recording: Recording,
    /// All contacts, attached or not.
    contacts: u64,
    /// Least breaks of a precursor.
    precursor_size: u64,
    crossing_time: f64,
    give_up_time: f64,
    /// The drive in its cycle at the last slip's end.
    drive: Drive,
    /// The end of the last segment, but for what is counted at events.
    now: RunningTotals,
    /// The last event, and the contacts attached after it.
    at_event: RunningTotals,
    attached: u64,
    peaks_since: PeaksSince,
    rupture: Option<Rupture>,
    slips_seen: u64,
    last_onset: Option<f64>,
    /// What has been found so far.
    measured: Measurements,
    pending: PendingPrecursors,
    span: Span,
    /// Drops, if they are recorded, and first and last break of every slip.
    drops: Option<DropDetector>,
    breaks_of_slips: Vec<(f64, f64)>,
}

impl SlipObserver {
    pub fn new(parameters: &Parameters, recording: &Recording) -> Self {
        let contacts = (parameters.blocks * parameters.contacts_per_block) as u64;
        let size_of_block = parameters.contacts_per_block as u64;
        let drops = recording.drop_size;
        Self {
            parameters: parameters.clone(),
            recording: *recording,
            contacts,
            precursor_size: recording.precursor_size.unwrap_or(size_of_block),
            crossing_time: parameters.wave_crossing_time(),
            give_up_time: recording.give_up_time(parameters),
            drive: Drive::new(parameters),
            now: RunningTotals::default(),
            at_event: RunningTotals::default(),
            attached: contacts,
            peaks_since: PeaksSince::default(),
            rupture: None,
            slips_seen: 0,
            last_onset: None,
            measured: Measurements::default(),
            pending: PendingPrecursors::default(),
            span: Span::default(),
            drops: drops.map(|size| DropDetector::new(parameters, size)),
            breaks_of_slips: Vec::new(),
        }
    }

    /// What has been measured in a simulation that ended with this summary.
    pub fn into_measurements(mut self, summary: Summary) -> Measurements {
        self.measured.summary = summary;
        self.measured.averages = self.averages();
        let last_onset = self.last_onset.filter(|_| self.measured.has_given_up);
        self.measured.running_interval = last_onset.map(|last| self.now.time - last);
        let Measurements {
            slips, precursors, ..
        } = &mut self.measured;
        // Precursors of a slip that the job does not have belong to none.
        precursors.retain(|precursor| precursor.slip < slips.len() as u64);
        if let Some(drops) = self.drops {
            let discarded = self.breaks_of_slips.len() - slips.len();
            let of_slips = drops.of_slips(&self.breaks_of_slips).into_iter();
            for (slip, drops) in slips.iter_mut().zip(of_slips.skip(discarded)) {
                slip.drops = drops;
            }
        }
        self.measured
    }

    /// Averages over time, from the end of start-up to that of the last slip. What follows belongs to it if no slip has
    /// come for half the time to give up: the slider then slides, and without a slip past start-up only that second
    /// half counts. `None` for an empty span.
    fn averages(&self) -> Option<Averages> {
        let (start, end) = match self.span.settled {
            Some(settled) => {
                let has_slips = !self.measured.slips.is_empty();
                let start_up_end = self.span.start_up_end.filter(|_| has_slips);
                (start_up_end.unwrap_or(settled), self.sliding())
            }
            None => (self.span.start_up_end?, self.span.last_slip_end),
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

    /// Whether the last slip that was asked for is recorded.
    fn is_complete(&self) -> bool {
        let Some(last) = self.measured.slips.last() else {
            return false;
        };
        let Recording { slips, time, .. } = self.recording;
        slips.is_some_and(|slips| self.measured.slips.len() as u64 >= slips)
            || time.is_some_and(|time| last.onset >= time)
    }

    /// The present instant with all that is counted, after sliding since the last slip; from the last event on at its
    /// rate.
    fn sliding(&self) -> RunningTotals {
        RunningTotals {
            attached_time: self.at_event.attached_time
                + self.attached as f64 * (self.now.time - self.at_event.time),
            slipping: self.span.last_slip_end.slipping + self.now.time
                - self.span.last_slip_end.time,
            ..self.now
        }
    }

    fn begin_or_extend(&mut self, event: &ContactEvent) {
        self.finish_rupture_before(event.time);
        let blocks = self.parameters.blocks;
        let here = RunningTotals {
            time: event.time,
            attached_time: event.attached_time,
            mean_displacement: event.mean_displacement,
            ..self.now
        };
        self.at_event = here;
        self.attached = event.attached;
        let precursor_onset = self.peaks_since.precursor;
        let begin = || Rupture::new(event, here, precursor_onset, blocks);
        let rupture = self.rupture.get_or_insert_with(begin);
        rupture.include(event);
        if event.block + 1 == blocks && rupture.onset.is_none() {
            rupture.onset = Some(self.peaks_since.slip);
            rupture.onset_cut = self.now.force >= self.peaks_since.slip.force;
        }
        rupture.least_at_last_break = rupture.least;
        rupture.last = here;
        self.peaks_since.last_break = Peak {
            time: event.time,
            force: self.now.force,
        };
    }

    /// Ends the rupture if no break has come in the wave crossing time before a time in s.
    #[inline(always)]
    fn finish_rupture_before(&mut self, time: f64) {
        let is_over = |rupture: &mut Rupture| time - rupture.last.time > self.crossing_time;
        let Some(rupture) = self.rupture.take_if(is_over) else {
            return;
        };
        self.measured.ruptures += 1;
        if rupture.is_slip(self.contacts) {
            self.record_slip(&rupture);
        } else if rupture.size >= self.precursor_size {
            self.record_precursor(&rupture);
        }
    }

    fn record_slip(&mut self, rupture: &Rupture) {
        // A slip has reached the leading edge.
        let onset = rupture.onset.unwrap_or(self.peaks_since.slip);
        let first = rupture.first;
        let last = rupture.last;
        let discard = self.recording.discard;
        if self.slips_seen >= discard {
            let slip = self.slip(rupture, onset);
            self.measured.slips.push(slip);
        } else {
            self.measured.start_up.push(onset.time);
        }
        if self.drops.is_some() {
            self.breaks_of_slips.push((first.time, last.time));
        }
        self.slips_seen += 1;
        let end = RunningTotals {
            slipping: self.span.last_slip_end.slipping + (last.time - first.time),
            ..last
        };
        if self.slips_seen == discard.max(1) {
            self.span.start_up_end = Some(end);
        }
        self.span.last_slip_end = end;
        self.drive.advance_to(last.time);
        self.span.settled = None;
        self.last_onset = Some(onset.time);
        self.peaks_since.slip = self.peaks_since.last_break;
        self.peaks_since.precursor = self.peaks_since.last_break;
        self.pending = PendingPrecursors::default();
    }

    /// The row of a slip; drops are found at the end.
    fn slip(&self, rupture: &Rupture, onset: Peak) -> Slip {
        let first = rupture.first;
        let last = rupture.last;
        let edge_distance = -self.edge_displacement(first) + self.edge_displacement(last);
        let drive = self.drive_at(onset.time);
        let modulation = Modulation::of(&drive);
        let interval = self.last_onset.map(|last| onset.time - last);
        let spent = self.span.last_slip_end.spent;
        let has_energies = self.recording.energies;
        let energies = has_energies.then(|| Energies::between(spent, last.spent));
        let contacts = self.contacts as f64;
        let since_cycle = onset.time - drive.cycle_start;
        Slip {
            number: self.slips_seen - self.recording.discard,
            onset: onset.time,
            interval,
            modulation,
            periods: interval.and_then(|interval| modulation.periods(interval)),
            phase: modulation
                .period
                .map(|period| phase(since_cycle, period, drive.eta)),
            peak_force: onset.force,
            drop: onset.force - rupture.least_at_last_break,
            nucleation: first.time,
            nucleation_block: rupture.first_block as u64 + 1,
            duration: last.time - first.time,
            size: rupture.size,
            attached_before: rupture.attached_before as f64 / contacts,
            least_attached: rupture.least_attached as f64 / contacts,
            distance: last.mean_displacement - first.mean_displacement,
            edge_distance,
            onset_cut: rupture.onset_cut,
            front_speed: rupture.front_speed(&self.parameters),
            precursors: self.pending.count,
            largest_precursor: self.pending.largest,
            slow_front_speed: advance_speed(&self.pending.advances),
            energies: energies.unwrap_or_default(),
            drops: Drops::default(),
        }
    }

    /// The drive in its cycle at a time in s since the last slip's end.
    fn drive_at(&self, time: f64) -> Drive {
        let mut drive = self.drive;
        drive.advance_to(time);
        drive
    }

    /// Displacement of the driven edge at an instant since the last slip's end, from the force and the drive, in m.
    fn edge_displacement(&self, at: RunningTotals) -> f64 {
        let drive = self.drive_at(at.time);
        drive.motion(at.time).displacement - at.force / drive.stiffness
    }

    fn record_precursor(&mut self, rupture: &Rupture) {
        let first = rupture.first;
        let last = rupture.last;
        let onset = rupture.precursor_onset.time;
        if self.recording.precursors && self.slips_seen >= self.recording.discard {
            self.measured.precursors.push(Precursor {
                slip: self.slips_seen - self.recording.discard,
                precursor: self.pending.count,
                onset,
                interval: self.pending.last_onset.map(|last| onset - last),
                modulation: Modulation::of(&self.drive_at(onset)),
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
        let reach = rupture.reach + 1;
        if reach > self.pending.furthest {
            let position =
                reach as f64 * self.parameters.slider_length / self.parameters.blocks as f64;
            self.pending.advances.push(FrontPoint {
                time: first.time,
                position,
            });
            self.pending.furthest = reach;
        }
        self.pending.count += 1;
        self.pending.largest = self.pending.largest.max(rupture.size);
        self.pending.last_onset = Some(onset);
        self.peaks_since.precursor = self.peaks_since.last_break;
    }
}

impl Observer for SlipObserver {
    fn advance(&mut self, segment: &Segment<'_>) {
        // Each stretch contains the later ones, so a force that raises none of these peaks raises no other. The peak
        // since the last break counts only once its rupture ends, and if that is recorded.
        let is_recorded = |rupture: &Rupture| {
            rupture.size >= self.precursor_size || rupture.is_slip(self.contacts)
        };
        let recordable = self.rupture.as_ref().is_some_and(is_recorded);
        let floor = if recordable {
            self.peaks_since.last_break.force
        } else {
            self.peaks_since.precursor.force
        };
        if let Some(largest) = segment.maximum_above(floor) {
            let peak = Peak {
                time: largest.at,
                force: largest.value,
            };
            self.peaks_since.last_break = peak;
            self.peaks_since.precursor.raise(peak);
            self.peaks_since.slip.raise(peak);
        }
        if let Some(rupture) = &mut self.rupture
            && let Some(least) = segment.minimum_below(rupture.least)
        {
            rupture.least = least.value;
        }
        if let Some(drops) = &mut self.drops {
            drops.advance(segment);
        }
        let impulse = self.now.impulse + segment.impulse();
        self.now = RunningTotals {
            time: segment.end(),
            force: segment.end_force(),
            impulse,
            ..self.now
        };
        self.finish_rupture_before(self.now.time);
        let since_slip = self.now.time - self.span.last_slip_end.time;
        if self.span.settled.is_none() && since_slip >= 0.5 * self.give_up_time {
            self.span.settled = Some(self.sliding());
        }
        self.measured.has_given_up = since_slip >= self.give_up_time;
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

    fn is_satisfied(&self) -> bool {
        self.is_complete() || self.measured.has_given_up
    }
}
