//! The interface: the contacts between the blocks and the substrate, and the force that they exert on each block.
//!
//! A block's contacts act together: force on block j = (Σ k_i a_i) - (Σ k_i) x_j over its attached contacts, so a step
//! costs O(N). Single contacts are examined only when the block reaches its nearest break position or a reattachment
//! is due. Contract: decisions are by contact identity; simultaneous events go in the order of blocks, then contacts.

use super::disorder::Contact;
use super::reattachments::{Due, Reattachments};
use super::simd::{LANES, Row, Simd, Vector};
use super::{BreakOn, Disorder, Parameters};
use crate::value::words;
use pulp::Scalar512b;
use std::array;
use std::ops::Deref;

words! {
    /// What happened to a contact.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Change {
        /// It attached, unstressed.
        Attach = "attach",
        Break = "break",
    }
}

/// What happens to one contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactChange {
    /// Time, in s.
    pub time: f64,
    /// Block, counted from 0 at the trailing edge.
    pub block: usize,
    /// Contact within its block, counted from 0.
    pub contact: usize,
    /// Life of the contact: 0 is the initial attachment.
    pub generation: u32,
    pub change: Change,
    /// Displacement of the block, in m.
    pub displacement: f64,
    /// Force of the contact at this instant, in N; positive when it pulls the block back.
    pub force: f64,
    /// Threshold `f_i` of this life, in N.
    pub threshold: f64,
    /// Stiffness `k_i` of this life, in N/m.
    pub stiffness: f64,
}

/// A contact that its block reaches.
#[derive(Clone, Copy, Debug)]
pub struct ReachedContact {
    /// Within its block, from 0.
    pub contact: usize,
    /// Where it breaks, in m.
    pub level: f64,
}

/// A contact breaks or attaches, as observers see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEvent {
    pub what: ContactChange,
    /// Contacts of the whole slider that are attached after it.
    pub attached: u64,
    /// Integral of that number over time up to here, in s.
    pub attached_time: f64,
    /// Mean displacement of the blocks at a break, in m, which the solver knows; 0 for an attachment.
    pub mean_displacement: f64,
}

impl ContactEvent {
    /// A change with what [`Interface::count`] gives for it.
    #[inline(always)]
    pub(crate) const fn new(
        what: ContactChange,
        attached: AttachedContacts,
        mean_displacement: f64,
    ) -> Self {
        Self {
            what,
            attached: attached.number,
            attached_time: attached.time,
            mean_displacement,
        }
    }
}

impl Deref for ContactEvent {
    type Target = ContactChange;

    fn deref(&self) -> &ContactChange {
        &self.what
    }
}

/// Contacts of the whole slider that are attached after a change.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AttachedContacts {
    number: u64,
    /// Integral of that number over time up to the change, in s.
    time: f64,
}

/// The number of attached contacts, and its integral over time.
#[derive(Clone, Copy, Debug)]
struct Attached {
    count: u64,
    /// The integral up to the origin of time, if nothing changed from there on, in s.
    offset: f64,
}

impl Attached {
    /// Counts what happens at a time in s.
    #[inline(always)]
    fn change(&mut self, change: Change, time: f64) {
        match change {
            Change::Attach => {
                self.count += 1;
                self.offset -= time;
            }
            Change::Break => {
                self.count -= 1;
                self.offset += time;
            }
        }
    }

    /// The integral up to a time in s.
    #[inline(always)]
    fn integral(&self, time: f64) -> f64 {
        self.offset + self.count as f64 * time
    }
}

/// The force of eight contacts on their block, and where they break. Contact i of a block lies in row i div 8 of the
/// block, lane i mod 8. Lanes beyond the last contact stay detached for ever.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
struct ContactLanes {
    /// Stiffness while attached, else 0.
    attached_stiffness: Row,
    anchor: Row,
    /// Break positions a_i ± reach, infinite while detached (and below, if only tension breaks).
    upper: Row,
    lower: Row,
}

/// The lives of eight contacts, apart from their rows: of these all are read at every break, of lives one.
#[derive(Clone, Debug, Default)]
struct Lives {
    /// The present life, or, while detached, the next.
    life: [Contact; LANES],
    generation: [u32; LANES],
}

impl ContactLanes {
    /// One bit a lane: whether its contact breaks up to a displacement in m.
    #[inline(always)]
    fn reached<S: Simd>(&self, simd: S, displacement: f64) -> u8 {
        let x = simd.splat(displacement);
        x.reaches(simd.load(&self.upper)) | simd.load(&self.lower).reaches(x)
    }
}

/// All contacts of the slider. Displacements are those of the caller's frame; see [`Interface::move_origin`].
#[derive(Clone, Debug)]
pub struct Interface {
    contacts_per_block: usize,
    rows_per_block: usize,
    break_on: BreakOn,
    disorder: Disorder,
    /// The rows of the first block, then of the second, and so on.
    rows: Vec<ContactLanes>,
    lives: Vec<Lives>,
    reattachments: Reattachments,
    attached: Attached,
    /// Per block: Σ k_i of the attached contacts, in N/m.
    pub block_stiffness: Vec<f64>,
    /// Per block: Σ k_i a_i of the attached contacts, in N.
    pub block_pull: Vec<f64>,
    /// Per block: the nearest position above at which a contact breaks, in m.
    pub block_upper: Vec<f64>,
    /// Per block: the nearest position below at which a contact breaks, in m.
    pub block_lower: Vec<f64>,
}

impl Interface {
    /// All contacts attached and unstressed at displacement 0, each in generation 0.
    pub fn new(parameters: &Parameters) -> Self {
        let blocks = parameters.blocks;
        let rows_per_block = parameters.contacts_per_block.div_ceil(LANES);
        let detached = ContactLanes {
            attached_stiffness: Row::filled(0.0),
            anchor: Row::filled(0.0),
            upper: Row::filled(f64::INFINITY),
            lower: Row::filled(f64::NEG_INFINITY),
        };
        let mut interface = Self {
            contacts_per_block: parameters.contacts_per_block,
            rows_per_block,
            break_on: parameters.break_on,
            disorder: Disorder::new(parameters),
            rows: vec![detached; blocks * rows_per_block],
            lives: vec![Lives::default(); blocks * rows_per_block],
            reattachments: Reattachments::new(parameters),
            attached: Attached {
                count: (blocks * parameters.contacts_per_block) as u64,
                offset: 0.0,
            },
            block_stiffness: vec![0.0; blocks],
            block_pull: vec![0.0; blocks],
            block_upper: vec![0.0; blocks],
            block_lower: vec![0.0; blocks],
        };
        for block in 0..blocks {
            for contact in 0..parameters.contacts_per_block {
                let (row, lane) = interface.place(block, contact);
                interface.lives[row].life[lane] = interface
                    .disorder
                    .draw(block * parameters.contacts_per_block + contact, 0);
                interface.attach(Scalar512b, block, contact, 0.0);
            }
            interface.gather(Scalar512b, block);
        }
        interface
    }

    /// The initial attachment of every contact as events at time 0, in order.
    pub fn initial_attachments(&self) -> impl Iterator<Item = ContactEvent> {
        let contacts = 0..self.block_stiffness.len() * self.contacts_per_block;
        let attached = AttachedContacts {
            number: self.attached.count,
            time: 0.0,
        };
        contacts.map(move |index| {
            let block = index / self.contacts_per_block;
            let contact = index % self.contacts_per_block;
            let what = self.change(block, contact, 0.0, 0.0, Change::Attach);
            ContactEvent::new(what, attached, 0.0)
        })
    }

    /// Time of the next reattachment, in s; infinite when no contact is detached.
    #[inline(always)]
    pub fn next_reattachment(&self) -> f64 {
        self.reattachments.next().map_or(f64::INFINITY, Due::time)
    }

    /// The next reattachment, if it is due by a time in s.
    #[inline(always)]
    pub fn next_reattachment_by(&self, time: f64) -> Option<Due> {
        self.reattachments.next().filter(|due| due.time() <= time)
    }

    /// Time in s of the next reattachment at a block, if it is due by a time in s; else infinite.
    #[inline(always)]
    pub fn next_reattachment_at(&mut self, block: usize, by: f64) -> f64 {
        if self.next_reattachment() <= by {
            self.find_reattachment_at(block, by)
        } else {
            f64::INFINITY
        }
    }

    /// The same where something is due. Not inlined in the loops over contacts, where that is rare.
    #[inline(never)]
    fn find_reattachment_at(&mut self, block: usize, by: f64) -> f64 {
        let mut next = f64::INFINITY;
        self.look_ahead(|due, other, _| {
            if due <= by && other == block {
                next = due;
            }
            due <= by && other != block
        });
        next
    }

    /// Visits the reattachments to come, in order, with time in s, block, and the life that begins, as long as `visit`
    /// is true.
    pub fn look_ahead(&mut self, mut visit: impl FnMut(f64, usize, &Contact) -> bool) {
        let lives = &self.lives;
        let rows_per_block = self.rows_per_block;
        self.reattachments.look_ahead(|due| {
            let row = due.block() * rows_per_block + due.contact() / LANES;
            let life = &lives[row].life[due.contact() % LANES];
            visit(due.time(), due.block(), life)
        });
    }

    /// Attaches the contact that is due next, unstressed where its block is at that moment.
    ///
    /// # Panics
    /// When nothing is due: a bug in the solver.
    #[inline(always)]
    pub fn reattach_next(&mut self, displacement: f64) -> ContactChange {
        let change = self.reattach_running(Scalar512b, displacement);
        self.gather(Scalar512b, change.block);
        change
    }

    /// The same with the sums of the block carried on, rounded once more, and not computed again.
    ///
    /// # Panics
    /// When nothing is due: a bug in the solver.
    #[inline(always)]
    pub(crate) fn reattach_running<S: Simd>(
        &mut self,
        simd: S,
        displacement: f64,
    ) -> ContactChange {
        let due = self.reattachments.pop().expect("a reattachment is due");
        let block = due.block();
        let contact = due.contact();
        let [upper, lower] = self.attach(simd, block, contact, displacement);
        self.block_upper[block] = self.block_upper[block].min(upper);
        self.block_lower[block] = self.block_lower[block].max(lower);
        let change = self.change(block, contact, due.time(), displacement, Change::Attach);
        self.block_stiffness[block] += change.stiffness;
        self.block_pull[block] += change.stiffness * displacement;
        change
    }

    /// Breaks and counts every contact of a block whose threshold is reached at this displacement, in the order of
    /// contacts. Passes each to `log`, with what `count` gives.
    #[inline(always)]
    pub(crate) fn break_reached(
        &mut self,
        block: usize,
        time: f64,
        displacement: f64,
        mut log: impl FnMut(ContactChange, AttachedContacts),
    ) {
        for row in 0..self.rows_per_block {
            let mut reached = self.rows_of(block)[row].reached(Scalar512b, displacement);
            while reached != 0 {
                let contact = LANES * row + reached.trailing_zeros() as usize;
                if contact >= self.contacts_per_block {
                    // A displacement that is not finite reaches lanes beyond the last contact.
                    break;
                }
                let (change, _) =
                    self.break_contact(Scalar512b, block, contact, time, displacement);
                log(change, self.count(Change::Break, time));
                reached &= reached - 1;
            }
        }
        self.gather(Scalar512b, block);
    }

    /// Writes the contacts of a block that break up to a displacement in m, in the order in which the block comes to
    /// them.
    #[inline(always)]
    pub(crate) fn reached<S: Simd>(
        &self,
        simd: S,
        block: usize,
        displacement: f64,
        contacts: &mut Vec<ReachedContact>,
    ) {
        contacts.clear();
        let falls = displacement <= self.block_lower[block];
        // As many rows at a time as have a bit for each contact.
        for (chunk, rows) in self.rows_of(block).chunks(LANES).enumerate() {
            let mut reached = 0;
            for (index, row) in rows.iter().enumerate() {
                reached |= u64::from(row.reached(simd, displacement)) << (LANES * index);
            }
            while reached != 0 {
                let contact = reached.trailing_zeros() as usize;
                reached &= reached - 1;
                let row = &rows[contact / LANES];
                let level = if falls {
                    row.lower[contact % LANES]
                } else {
                    row.upper[contact % LANES]
                };
                // A displacement that is not finite reaches lanes beyond the last contact.
                if level.is_finite() {
                    contacts.push(ReachedContact {
                        contact: chunk * LANES * LANES + contact,
                        level,
                    });
                }
            }
        }
        if contacts.len() > 1 {
            contacts.sort_by(|a, b| {
                if falls {
                    b.level.total_cmp(&a.level)
                } else {
                    a.level.total_cmp(&b.level)
                }
            });
        }
    }

    /// Breaks one contact, at a break position in m. Returns the change, and when the contact reattaches, in s. Leaves
    /// the block's sums and nearest break positions unchanged: see [`Self::gather`].
    #[inline(always)]
    pub(crate) fn break_contact<S: Simd>(
        &mut self,
        simd: S,
        block: usize,
        contact: usize,
        time: f64,
        displacement: f64,
    ) -> (ContactChange, f64) {
        let change = self.change(block, contact, time, displacement, Change::Break);
        let (row, lane) = self.place(block, contact);
        let lives = &mut self.lives[row];
        let row = &mut self.rows[row];
        simd.set(&mut row.attached_stiffness, lane, 0.0);
        simd.set(&mut row.upper, lane, f64::INFINITY);
        simd.set(&mut row.lower, lane, f64::NEG_INFINITY);
        lives.generation[lane] += 1;
        lives.life[lane] = self.disorder.draw(
            block * self.contacts_per_block + contact,
            lives.generation[lane],
        );
        let due = time + lives.life[lane].delay;
        self.reattachments.push(Due::new(due, block, contact));
        (change, due)
    }

    /// Counts a change at a time in s, in the order of time.
    #[inline(always)]
    pub(crate) fn count(&mut self, change: Change, time: f64) -> AttachedContacts {
        self.attached.change(change, time);
        AttachedContacts {
            number: self.attached.count,
            time: self.attached.integral(time),
        }
    }

    /// Moves the origin by `time` s and `displacement` m.
    pub fn move_origin(&mut self, time: f64, displacement: f64) {
        self.reattachments.shift(time);
        self.attached.offset = self.attached.integral(time);
        for row in &mut self.rows {
            for positions in [&mut row.anchor, &mut row.upper, &mut row.lower] {
                positions
                    .iter_mut()
                    .for_each(|position| *position -= displacement);
            }
        }
        for block in 0..self.block_stiffness.len() {
            self.gather(Scalar512b, block);
        }
    }

    /// Elastic energy in the attached contacts for given displacements in m, in J.
    pub fn elastic_energy(&self, displacements: &[f64]) -> f64 {
        let of_row = |displacement: f64, row: &ContactLanes| -> [f64; LANES] {
            array::from_fn(|lane| {
                let elongation = displacement - row.anchor[lane];
                0.5 * row.attached_stiffness[lane] * elongation * elongation
            })
        };
        let rows = self.rows.iter().enumerate();
        rows.flat_map(|(i, row)| of_row(displacements[i / self.rows_per_block], row))
            .sum()
    }

    /// Row and lane of a contact.
    #[inline(always)]
    fn place(&self, block: usize, contact: usize) -> (usize, usize) {
        (
            block * self.rows_per_block + contact / LANES,
            contact % LANES,
        )
    }

    #[inline(always)]
    fn rows_of(&self, block: usize) -> &[ContactLanes] {
        &self.rows[block * self.rows_per_block..][..self.rows_per_block]
    }

    #[inline(always)]
    fn change(
        &self,
        block: usize,
        contact: usize,
        time: f64,
        displacement: f64,
        change: Change,
    ) -> ContactChange {
        let (row, lane) = self.place(block, contact);
        let lives = &self.lives[row];
        let life = &lives.life[lane];
        ContactChange {
            time,
            block,
            contact,
            generation: lives.generation[lane],
            change,
            displacement,
            force: life.stiffness * (displacement - self.rows[row].anchor[lane]),
            threshold: life.threshold,
            stiffness: life.stiffness,
        }
    }

    /// Begins a life of a contact. Returns the positions above and below at which it breaks.
    #[inline(always)]
    fn attach<S: Simd>(
        &mut self,
        simd: S,
        block: usize,
        contact: usize,
        displacement: f64,
    ) -> [f64; 2] {
        let (row, lane) = self.place(block, contact);
        let life = self.lives[row].life[lane];
        let reach = life.reach;
        let row = &mut self.rows[row];
        let levels = match self.break_on {
            BreakOn::Magnitude => [displacement + reach, displacement - reach],
            BreakOn::Tension => [displacement + reach, f64::NEG_INFINITY],
        };
        simd.set(&mut row.attached_stiffness, lane, life.stiffness);
        simd.set(&mut row.anchor, lane, displacement);
        simd.set(&mut row.upper, lane, levels[0]);
        simd.set(&mut row.lower, lane, levels[1]);
        levels
    }

    /// Computes the sums, in fixed lanes, and nearest break positions of a block again.
    #[inline(always)]
    pub(crate) fn gather<S: Simd>(&mut self, simd: S, block: usize) {
        let mut stiffness = simd.splat(0.0);
        let mut pull = simd.splat(0.0);
        let mut upper = simd.splat(f64::INFINITY);
        let mut lower = simd.splat(f64::NEG_INFINITY);
        for row in self.rows_of(block) {
            let attached = simd.load(&row.attached_stiffness);
            stiffness = stiffness.plus(attached);
            pull = pull.plus(attached.times(simd.load(&row.anchor)));
            upper = upper.smaller(simd.load(&row.upper));
            lower = lower.larger(simd.load(&row.lower));
        }
        self.block_stiffness[block] = stiffness.reduce(|a, b| a + b);
        self.block_pull[block] = pull.reduce(|a, b| a + b);
        self.block_upper[block] = upper.reduce(|a, b| if a < b { a } else { b });
        self.block_lower[block] = lower.reduce(|a, b| if a > b { a } else { b });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_breaks_what_is_reached_in_the_order_of_contacts() {
        // More contacts than are tested together.
        let parameters = Parameters {
            blocks: 2,
            contacts_per_block: 150,
            threshold_deviation: 0.4,
            ..Parameters::default()
        };
        let whole = Interface::new(&parameters);
        let reaches: Vec<f64> = (0..150)
            .map(|contact| whole.disorder.clone().draw(150 + contact, 0).reach)
            .collect();
        for displacement in [parameters.contact_reach(), -parameters.contact_reach()] {
            let expected: Vec<usize> = (0..150)
                .filter(|&contact| reaches[contact] <= displacement.abs())
                .collect();
            assert!(
                expected.len() > 50 && expected.len() < 100,
                "{} of 150 reached",
                expected.len()
            );
            let mut interface = whole.clone();
            let mut broken = Vec::new();
            interface.break_reached(1, 0.0, displacement, |change, _| {
                broken.push((change.block, change.contact));
            });
            assert_eq!(
                broken,
                expected
                    .iter()
                    .map(|&contact| (1, contact))
                    .collect::<Vec<_>>()
            );
            while interface.next_reattachment().is_finite() {
                let change = interface.reattach_running(Scalar512b, 0.3 * displacement);
                let known = [
                    interface.block_upper[change.block],
                    interface.block_lower[change.block],
                ];
                interface.gather(Scalar512b, change.block);
                assert_eq!(
                    known,
                    [
                        interface.block_upper[change.block],
                        interface.block_lower[change.block]
                    ]
                );
            }
        }
    }
}
