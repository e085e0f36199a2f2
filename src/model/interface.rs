//! The interface: the contacts between the blocks and the substrate, and what each block feels of them.
//!
//! A block's contacts act together: force on block j = (Σ k_i a_i) - (Σ k_i) x_j over its attached contacts, so a step
//! costs O(N). Single contacts are examined only when the block reaches its nearest break position or a reattachment
//! is due. Contract: decisions are by contact identity; simultaneous events go in the order of blocks, then contacts.

use super::disorder::Contact;
use super::lanes::{LANES, Row};
use super::reattachments::{Due, Reattachments};
use super::{BreakOn, Disorder, Parameters};
use crate::table::value::words;
use std::array;

words! {
    /// What happened to a contact.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Change {
        /// It attached, unstressed.
        Attach = "attach",
        Break = "break",
    }
}

/// One event of one contact, as observers see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactEvent {
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
    /// Contacts of the whole slider that are attached after it.
    pub attached: u64,
    /// Integral of that number over time up to here, in s.
    pub attached_time: f64,
    /// Mean displacement of the blocks at a break, in m, which the solver knows; 0 for an attachment.
    pub mean_displacement: f64,
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

    /// Moves the origin of time: subtracts `shift` s.
    fn shift(&mut self, shift: f64) {
        self.offset = self.integral(shift);
    }
}

/// Eight bytes that are 0 or 1 each, times this, hold their bits in the highest byte, in order.
const GATHER_BITS: u64 = 0x0102_0408_1020_4080;

/// The contacts of a row, side by side in memory as they are read: contact i of a block lies in row i div 8 of the
/// block, lane i mod 8. Lanes beyond the last contact stay detached for ever.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
struct ContactRow {
    /// Stiffness while attached, else 0.
    attached_stiffness: Row,
    anchor: Row,
    /// Break positions a_i ± reach, infinite while detached (and below, if only tension breaks).
    upper: Row,
    lower: Row,
    /// The present life, or, while detached, the next.
    life: [Contact; LANES],
    generation: [u32; LANES],
}

impl ContactRow {
    /// One bit a lane: whether its contact breaks up to a displacement in m.
    #[inline(always)]
    #[expect(clippy::needless_bitwise_bool, reason = "without branches a row is tested in vectors")]
    fn reached(&self, displacement: f64) -> u64 {
        let lanes: [u8; LANES] =
            array::from_fn(|lane| u8::from((self.upper[lane] <= displacement) | (self.lower[lane] >= displacement)));
        u64::from_le_bytes(lanes).wrapping_mul(GATHER_BITS) >> 56
    }
}

/// All contacts of the slider. Displacements are those of the caller's frame; see [`Interface::shift`].
#[derive(Clone, Debug)]
pub struct Interface {
    contacts_per_block: usize,
    rows_per_block: usize,
    break_on: BreakOn,
    disorder: Disorder,
    /// The rows of the first block, then of the second, and so on.
    rows: Vec<ContactRow>,
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
        let detached = ContactRow {
            attached_stiffness: Row::filled(0.0),
            anchor: Row::filled(0.0),
            upper: Row::filled(f64::INFINITY),
            lower: Row::filled(f64::NEG_INFINITY),
            life: [Contact { threshold: 0.0, stiffness: 0.0, reach: 0.0, delay: 0.0 }; LANES],
            generation: [0; LANES],
        };
        let mut interface = Self {
            contacts_per_block: parameters.contacts_per_block,
            rows_per_block,
            break_on: parameters.break_on,
            disorder: Disorder::new(parameters),
            rows: vec![detached; blocks * rows_per_block],
            reattachments: Reattachments::new(blocks, parameters.contacts_per_block, parameters.reattachment_time),
            attached: Attached { count: (blocks * parameters.contacts_per_block) as u64, offset: 0.0 },
            block_stiffness: vec![0.0; blocks],
            block_pull: vec![0.0; blocks],
            block_upper: vec![0.0; blocks],
            block_lower: vec![0.0; blocks],
        };
        for block in 0..blocks {
            for contact in 0..parameters.contacts_per_block {
                let (row, lane) = interface.place(block, contact);
                interface.rows[row].life[lane] =
                    interface.disorder.draw(block * parameters.contacts_per_block + contact, 0);
                interface.attach(block, contact, 0.0);
            }
            interface.gather(block);
        }
        interface
    }

    /// The initial attachment of every contact as events at time 0, in order.
    pub fn initial_attachments(&self) -> impl Iterator<Item = ContactEvent> {
        (0..self.block_stiffness.len())
            .flat_map(move |block| (0..self.contacts_per_block).map(move |contact| (block, contact)))
            .map(|(block, contact)| self.event(block, contact, 0.0, 0.0, Change::Attach))
    }

    /// Time of the next reattachment, in s; infinite when no contact is detached.
    #[inline(always)]
    pub fn next_reattachment(&self) -> f64 {
        self.reattachments.next().map_or(f64::INFINITY, Due::time)
    }

    /// Block of the next reattachment, if any contact is detached.
    #[inline(always)]
    pub fn next_reattachment_block(&self) -> Option<usize> {
        self.reattachments.next().map(Due::block)
    }

    /// Time in s and block of the next reattachment, if it is due by a time in s.
    #[inline(always)]
    pub fn next_reattachment_by(&self, time: f64) -> Option<(f64, usize)> {
        self.reattachments.next().map(|due| (due.time(), due.block())).filter(|(due, _)| *due <= time)
    }

    /// Time in s of the next reattachment at a block, if it is due by a time in s; else infinite.
    #[inline(always)]
    pub fn next_reattachment_at(&mut self, block: usize, by: f64) -> f64 {
        let mut next = f64::INFINITY;
        if self.next_reattachment() <= by {
            self.look_ahead(|due, other| {
                if due <= by && other == block {
                    next = due;
                }
                due <= by && other != block
            });
        }
        next
    }

    /// Visits the reattachments to come, with time in s and block, in order, until told to stop.
    pub fn look_ahead(&mut self, mut visit: impl FnMut(f64, usize) -> bool) {
        self.reattachments.look_ahead(|due| visit(due.time(), due.block()));
    }

    /// Attaches the contact that is due next, unstressed where its block is at that moment.
    ///
    /// # Panics
    /// When nothing is due: a bug in the solver.
    #[inline(always)]
    pub fn reattach_next(&mut self, displacement: f64) -> ContactEvent {
        let due = self.reattachments.pop().expect("a reattachment is due");
        let (block, contact) = (due.block(), due.contact());
        let [upper, lower] = self.attach(block, contact, displacement);
        self.sum(block);
        self.block_upper[block] = self.block_upper[block].min(upper);
        self.block_lower[block] = self.block_lower[block].max(lower);
        self.attached.change(Change::Attach, due.time());
        self.event(block, contact, due.time(), displacement, Change::Attach)
    }

    /// Breaks every contact of a block whose threshold is reached at this displacement, in the order of contacts, and
    /// passes each to `log`.
    #[inline(always)]
    pub fn break_reached(&mut self, block: usize, time: f64, displacement: f64, mut log: impl FnMut(ContactEvent)) {
        // As many rows at a time as have a bit for each contact.
        for start in (0..self.rows_per_block).step_by(LANES) {
            let mut reached = 0_u64;
            for (index, row) in self.rows_of(block)[start..].iter().take(LANES).enumerate() {
                reached |= row.reached(displacement) << (LANES * index);
            }
            while reached != 0 {
                let contact = LANES * start + reached.trailing_zeros() as usize;
                if contact >= self.contacts_per_block {
                    // A displacement that is not finite reaches lanes beyond the last contact.
                    break;
                }
                log(self.break_contact(block, contact, time, displacement).0);
                reached &= reached - 1;
            }
        }
        self.gather(block);
    }

    /// Writes the contacts of a block that break up to a displacement in m, with their break positions in m, in the order
    /// in which the block comes to them.
    #[inline(always)]
    pub fn reached(&self, block: usize, displacement: f64, contacts: &mut Vec<(f64, usize)>) {
        contacts.clear();
        let mut is_sorted = true;
        for (index, row) in self.rows_of(block).iter().enumerate() {
            let mut reached = row.reached(displacement);
            while reached != 0 {
                let lane = reached.trailing_zeros() as usize;
                // Further along in the direction of motion is larger.
                let position = if row.upper[lane] <= displacement { row.upper[lane] } else { -row.lower[lane] };
                reached &= reached - 1;
                // A displacement that is not finite reaches lanes beyond the last contact.
                if position.is_finite() {
                    is_sorted &= contacts.last().is_none_or(|(last, _)| *last <= position);
                    contacts.push((position, LANES * index + lane));
                }
            }
        }
        if !is_sorted {
            contacts.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        if displacement <= self.block_lower[block] {
            for (position, _) in contacts {
                *position = -*position;
            }
        }
    }

    /// Breaks one contact, at a break position in m. Returns the event, and when the contact reattaches, in s. The block's
    /// sums and nearest break positions are left as they are: see [`Self::gather`].
    #[inline(always)]
    pub fn break_contact(&mut self, block: usize, contact: usize, time: f64, displacement: f64) -> (ContactEvent, f64) {
        self.attached.change(Change::Break, time);
        let event = self.event(block, contact, time, displacement, Change::Break);
        (event, self.detach(block, contact, time))
    }

    /// Moves the frame: subtracts `shift` m from every position.
    pub fn shift(&mut self, shift: f64) {
        for row in &mut self.rows {
            for position in row.anchor.iter_mut().chain(row.upper.iter_mut()).chain(row.lower.iter_mut()) {
                *position -= shift;
            }
        }
        for block in 0..self.block_stiffness.len() {
            self.gather(block);
        }
    }

    /// Moves the origin of time: subtracts `shift` s from every reattachment that is due.
    pub fn shift_time(&mut self, shift: f64) {
        self.reattachments.shift(shift);
        self.attached.shift(shift);
    }

    /// Elastic energy in the attached contacts for given displacements in m, in J.
    pub fn elastic_energy(&self, displacements: &[f64]) -> f64 {
        let of_row = |displacement: f64, row: &ContactRow| -> [f64; LANES] {
            array::from_fn(|lane| {
                let elongation = displacement - row.anchor[lane];
                0.5 * row.attached_stiffness[lane] * elongation * elongation
            })
        };
        let rows = self.rows.iter().enumerate();
        rows.flat_map(|(i, row)| of_row(displacements[i / self.rows_per_block], row)).sum()
    }

    /// Row and lane of a contact.
    #[inline(always)]
    fn place(&self, block: usize, contact: usize) -> (usize, usize) {
        (block * self.rows_per_block + contact / LANES, contact % LANES)
    }

    #[inline(always)]
    fn rows_of(&self, block: usize) -> &[ContactRow] {
        &self.rows[block * self.rows_per_block..][..self.rows_per_block]
    }

    #[inline(always)]
    fn event(&self, block: usize, contact: usize, time: f64, displacement: f64, change: Change) -> ContactEvent {
        let (row, lane) = self.place(block, contact);
        let ContactRow { life, generation, anchor, .. } = &self.rows[row];
        let Contact { threshold, stiffness, .. } = life[lane];
        ContactEvent {
            time,
            block,
            contact,
            generation: generation[lane],
            change,
            displacement,
            force: stiffness * (displacement - anchor[lane]),
            threshold,
            stiffness,
            attached: self.attached.count,
            attached_time: self.attached.integral(time),
            mean_displacement: 0.0,
        }
    }

    /// Begins a life of a contact. Returns the positions above and below at which it breaks.
    #[inline(always)]
    fn attach(&mut self, block: usize, contact: usize, displacement: f64) -> [f64; 2] {
        let (row, lane) = self.place(block, contact);
        let row = &mut self.rows[row];
        let Contact { stiffness, reach, .. } = row.life[lane];
        let levels = match self.break_on {
            BreakOn::Magnitude => [displacement + reach, displacement - reach],
            BreakOn::Tension => [displacement + reach, f64::NEG_INFINITY],
        };
        row.attached_stiffness.set(lane, stiffness);
        row.anchor.set(lane, displacement);
        row.upper.set(lane, levels[0]);
        row.lower.set(lane, levels[1]);
        levels
    }

    /// Ends the life of a contact and draws the next, which begins at the time returned, in s.
    #[inline(always)]
    fn detach(&mut self, block: usize, contact: usize, time: f64) -> f64 {
        let (row, lane) = self.place(block, contact);
        let row = &mut self.rows[row];
        row.attached_stiffness.set(lane, 0.0);
        row.upper.set(lane, f64::INFINITY);
        row.lower.set(lane, f64::NEG_INFINITY);
        row.generation[lane] += 1;
        row.life[lane] = self.disorder.draw(block * self.contacts_per_block + contact, row.generation[lane]);
        let due = time + row.life[lane].delay;
        self.reattachments.push(Due::new(due, block, contact));
        due
    }

    /// Computes the sums and nearest break positions of a block again.
    #[inline(always)]
    pub fn gather(&mut self, block: usize) {
        self.sum(block);
        let (mut upper, mut lower) = (Row::filled(f64::INFINITY), Row::filled(f64::NEG_INFINITY));
        for row in self.rows_of(block) {
            for lane in 0..LANES {
                upper[lane] = if row.upper[lane] < upper[lane] { row.upper[lane] } else { upper[lane] };
                lower[lane] = if row.lower[lane] > lower[lane] { row.lower[lane] } else { lower[lane] };
            }
        }
        self.block_upper[block] = upper.reduce(|a, b| if a < b { a } else { b });
        self.block_lower[block] = lower.reduce(|a, b| if a > b { a } else { b });
    }

    /// Computes the sums of a block again, in fixed lanes.
    #[inline(always)]
    fn sum(&mut self, block: usize) {
        let (mut stiffness, mut pull) = (Row::filled(0.0), Row::filled(0.0));
        for row in self.rows_of(block) {
            let attached = row.attached_stiffness.0;
            stiffness.0 = array::from_fn(|lane| stiffness[lane] + attached[lane]);
            pull.0 = array::from_fn(|lane| pull[lane] + attached[lane] * row.anchor[lane]);
        }
        self.block_stiffness[block] = stiffness.reduce(|a, b| a + b);
        self.block_pull[block] = pull.reduce(|a, b| a + b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_breaks_what_is_reached_in_the_order_of_contacts() {
        // More contacts than are tested together.
        let parameters =
            Parameters { blocks: 2, contacts_per_block: 150, threshold_deviation: 0.4, ..Parameters::default() };
        let whole = Interface::new(&parameters);
        let reaches: Vec<f64> = (0..150).map(|contact| whole.disorder.clone().draw(150 + contact, 0).reach).collect();
        for displacement in [parameters.contact_reach(), -parameters.contact_reach()] {
            let expected: Vec<usize> = (0..150).filter(|&contact| reaches[contact] <= displacement.abs()).collect();
            assert!(expected.len() > 50 && expected.len() < 100, "{} of 150 reached", expected.len());
            let (mut interface, mut broken) = (whole.clone(), Vec::new());
            interface.break_reached(1, 0.0, displacement, |event| broken.push((event.block, event.contact)));
            assert_eq!(broken, expected.iter().map(|&contact| (1, contact)).collect::<Vec<_>>());
            while interface.next_reattachment_block().is_some() {
                let event = interface.reattach_next(0.3 * displacement);
                let known = [interface.block_upper[event.block], interface.block_lower[event.block]];
                interface.gather(event.block);
                assert_eq!(known, [interface.block_upper[event.block], interface.block_lower[event.block]]);
            }
        }
    }
}
