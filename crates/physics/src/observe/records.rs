//! Records on request: traces, space-time maps and the contact log of one job. A sweep holds none of these.

use crate::columns::columns;
use crate::model::{Change, ContactEvent, Drive, Parameters};
use crate::solver::{Observer, Segment, Spent};

/// Several observers of one run; the first decides when it has seen enough.
pub struct Observers<'a>(pub Vec<&'a mut dyn Observer>);

impl Observer for Observers<'_> {
    fn advance(&mut self, segment: &Segment<'_>) {
        self.0.iter_mut().for_each(|each| each.advance(segment));
    }

    fn contact(&mut self, event: &ContactEvent) {
        self.0.iter_mut().for_each(|each| each.contact(event));
    }

    fn spent(&mut self, spent: Spent) {
        self.0.iter_mut().for_each(|each| each.spent(spent));
    }

    fn follows_attachments(&self) -> bool {
        self.0.iter().any(|each| each.follows_attachments())
    }

    fn is_satisfied(&self) -> bool {
        self.0[0].is_satisfied()
    }

    fn end(&mut self, time: f64, displacement: &[f64]) {
        self.0
            .iter_mut()
            .for_each(|each| each.end(time, displacement));
    }
}

/// Regular instants, 0, d, 2d, ..., as time passes.
#[derive(Clone, Debug)]
struct Sampling {
    spacing: f64,
    next: u64,
}

impl Sampling {
    /// The next instant, if it lies before the end of the segment.
    fn within(&mut self, segment: &Segment<'_>) -> Option<f64> {
        let time = self.next as f64 * self.spacing;
        let is_within = time < segment.end();
        self.next += u64::from(is_within);
        is_within.then_some(time)
    }
}

columns! {
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct TraceRow {
        time: f64 = "s", "time";
        force: f64 = "N", "shear force F_S";
        displacement: f64 = "m", "displacement of the trailing edge";
        attached_fraction: f64 = "", "attached contacts over all contacts";
    }
}

/// An observer that samples the shear force at regular instants.
#[derive(Clone, Debug)]
pub struct Trace {
    drive: Drive,
    contacts: f64,
    attached: u64,
    sampling: Sampling,
    pub rows: Vec<TraceRow>,
}

impl Trace {
    pub fn new(parameters: &Parameters, spacing: f64) -> Self {
        let contacts = (parameters.blocks * parameters.contacts_per_block) as f64;
        Self {
            drive: Drive::new(parameters),
            contacts,
            attached: 0,
            sampling: Sampling { spacing, next: 0 },
            rows: Vec::new(),
        }
    }
}

impl Observer for Trace {
    fn advance(&mut self, segment: &Segment<'_>) {
        while let Some(time) = self.sampling.within(segment) {
            let force = segment.force_after(time - segment.start);
            self.drive.advance_to(time);
            let driven = self.drive.motion(time).displacement;
            self.rows.push(TraceRow {
                time,
                force,
                displacement: driven - force / self.drive.stiffness,
                attached_fraction: self.attached as f64 / self.contacts,
            });
        }
    }

    fn contact(&mut self, event: &ContactEvent) {
        self.attached = event.attached;
    }
}

columns! {
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MapRow {
        time: f64 = "s", "time";
        block: u64 = "", "from 1 at the trailing edge";
        attached_fraction: f64 = "", "attached contacts over the contacts of the block";
    }
}

/// An observer that samples the attached fraction of every block at regular instants (Fig. 4).
#[derive(Clone, Debug)]
pub struct AttachedMap {
    contacts_per_block: f64,
    attached: Vec<u32>,
    sampling: Sampling,
    /// The cells so far, instant by instant.
    pub rows: Vec<MapRow>,
}

impl AttachedMap {
    pub fn new(parameters: &Parameters, spacing: f64) -> Self {
        Self {
            contacts_per_block: parameters.contacts_per_block as f64,
            attached: vec![0; parameters.blocks],
            sampling: Sampling { spacing, next: 0 },
            rows: Vec::new(),
        }
    }
}

impl Observer for AttachedMap {
    fn advance(&mut self, segment: &Segment<'_>) {
        while let Some(time) = self.sampling.within(segment) {
            for (block, &attached) in (1..).zip(&self.attached) {
                self.rows.push(MapRow {
                    time,
                    block,
                    attached_fraction: f64::from(attached) / self.contacts_per_block,
                });
            }
        }
    }

    fn contact(&mut self, event: &ContactEvent) {
        match event.change {
            Change::Attach => self.attached[event.block] += 1,
            Change::Break => self.attached[event.block] -= 1,
        }
    }
}

columns! {
    /// The displacement of one block at the end of a run (Eq. 1).
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ProfileRow {
        time: f64 = "s", "time of the end";
        block: u64 = "", "from 1 at the trailing edge";
        position: f64 = "m", "position j L/N of the block";
        displacement: f64 = "m", "displacement of the block since the start";
    }
}

/// An observer that keeps where the blocks are at the end.
#[derive(Clone, Debug)]
pub struct Profile {
    spacing: f64,
    /// One row a block; empty until the end.
    pub rows: Vec<ProfileRow>,
}

impl Profile {
    pub fn new(parameters: &Parameters) -> Self {
        Self {
            spacing: parameters.slider_length / parameters.blocks as f64,
            rows: Vec::new(),
        }
    }
}

impl Observer for Profile {
    fn end(&mut self, time: f64, displacement: &[f64]) {
        let row = |(block, &displacement): (u64, &f64)| ProfileRow {
            time,
            block,
            position: block as f64 * self.spacing,
            displacement,
        };
        self.rows = (1..).zip(displacement).map(row).collect();
    }
}

columns! {
    /// A contact event as a row of the contact log.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ContactRow {
        time: f64 = "s", "time of the event";
        block: u64 = "", "from 1 at the trailing edge";
        contact: u64 = "", "number within its block, from 1";
        generation: u64 = "", "life of the contact, 0 is the initial attachment";
        change as "event": Change = "", "attach or break";
        displacement: f64 = "m", "displacement of the block";
        force: f64 = "N", "force of the contact at the event, positive when it pulls the block back";
        threshold: f64 = "N", "threshold of this life";
        stiffness: f64 = "N/m", "stiffness of this life";
    }
}

impl From<&ContactEvent> for ContactRow {
    fn from(event: &ContactEvent) -> Self {
        Self {
            time: event.time,
            block: event.block as u64 + 1,
            contact: event.contact as u64 + 1,
            generation: u64::from(event.generation),
            change: event.change,
            displacement: event.displacement,
            force: event.force,
            threshold: event.threshold,
            stiffness: event.stiffness,
        }
    }
}

/// An observer that keeps every contact event in order.
#[derive(Clone, Debug, Default)]
pub struct ContactLog {
    pub events: Vec<ContactEvent>,
}

impl Observer for ContactLog {
    fn contact(&mut self, event: &ContactEvent) {
        self.events.push(*event);
    }
}
