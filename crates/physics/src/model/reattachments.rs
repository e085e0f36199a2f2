//! The reattachments to come, in order of time: a calendar queue (R. Brown, Commun. ACM 31, 1220, 1988).
//!
//! Times fall into bins of a fraction of the mean delay; the present bin is sorted, those ahead are lists, and what
//! lies beyond a turn of the calendar waits aside. A contact has at most one reattachment, so lists run through the
//! contacts and bins allocate nothing. Contract: reattachments come in order of time, then block, then contact.

use super::Parameters;
use crate::value::floored;

/// Bins of a turn, and of a mean delay.
const BINS: usize = 4096;
const BINS_PER_DELAY: f64 = 512.0;
const BITS: usize = u64::BITS as usize;
/// The end of a list.
const NONE: u32 = u32::MAX;

/// A reattachment that is due, in order of time, then block, then contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Due {
    /// Bits of the time in s, which order as it does, since it is not negative.
    time: u64,
    block: u32,
    contact: u32,
}

impl Due {
    #[expect(clippy::cast_possible_truncation, reason = "at most 1e7 contacts")]
    pub fn new(time: f64, block: usize, contact: usize) -> Self {
        Self {
            time: time.to_bits(),
            block: block as u32,
            contact: contact as u32,
        }
    }

    pub fn time(self) -> f64 {
        f64::from_bits(self.time)
    }

    pub fn block(self) -> usize {
        self.block as usize
    }

    pub fn contact(self) -> usize {
        self.contact as usize
    }
}

#[derive(Clone, Debug)]
pub(super) struct Reattachments {
    contacts_per_block: usize,
    bins_per_second: f64,
    /// The next one, which lies in no bin.
    next: Option<Due>,
    /// Number of the present bin, and what is due up to its end, the latest first.
    present_bin: u64,
    present: Vec<Due>,
    /// For each bin of the turn ahead whether it holds anything, and the first contact of its list.
    occupied: [u64; BINS / BITS],
    first: Vec<u32>,
    /// For each contact what is due, and the contact after it in its list.
    due: Vec<Due>,
    after: Vec<u32>,
    /// What lies beyond the turn.
    beyond: Vec<Due>,
    work_space: Vec<Due>,
}

impl Reattachments {
    pub fn new(parameters: &Parameters) -> Self {
        let contacts = parameters.blocks * parameters.contacts_per_block;
        Self {
            contacts_per_block: parameters.contacts_per_block,
            bins_per_second: BINS_PER_DELAY / parameters.reattachment_time,
            next: None,
            present_bin: 0,
            present: Vec::new(),
            occupied: [0; BINS / BITS],
            first: vec![NONE; BINS],
            due: vec![Due::new(0.0, 0, 0); contacts],
            after: vec![NONE; contacts],
            beyond: Vec::new(),
            work_space: Vec::new(),
        }
    }

    /// The next one, if any contact is detached.
    #[inline]
    pub fn next(&self) -> Option<Due> {
        self.next
    }

    /// Adds one. Its contact has none yet.
    #[inline]
    pub fn push(&mut self, due: Due) {
        match &mut self.next {
            None => self.next = Some(due),
            Some(next) => {
                let later = (*next).max(due);
                *next = (*next).min(due);
                self.file(later);
            }
        }
    }

    /// Takes the next one out.
    #[inline]
    pub fn pop(&mut self) -> Option<Due> {
        let next = self.next?;
        if self.present.is_empty() {
            self.turn();
        }
        self.next = self.present.pop();
        Some(next)
    }

    /// Visits them in order, as long as `visit` is true.
    pub fn look_ahead(&mut self, mut visit: impl FnMut(Due) -> bool) {
        let mut sorted = std::mem::take(&mut self.work_space);
        let mut goes_on = self
            .next
            .into_iter()
            .chain(self.present.iter().rev().copied())
            .all(&mut visit);
        let mut ahead = 1;
        while goes_on && let Some(found) = self.occupied_from(ahead) {
            sorted.clear();
            sorted.extend(self.list((place_of(self.present_bin) + found) % BINS));
            sorted.sort_unstable();
            goes_on = sorted.iter().copied().all(&mut visit);
            ahead = found + 1;
        }
        if goes_on && !self.beyond.is_empty() {
            sorted.clone_from(&self.beyond);
            sorted.sort_unstable();
            let _ = sorted.iter().copied().all(visit);
        }
        self.work_space = sorted;
    }

    /// How many bins ahead, from `ahead` on and within the turn, the next one is that holds anything.
    fn occupied_from(&self, mut ahead: usize) -> Option<usize> {
        let here = place_of(self.present_bin);
        while ahead < BINS {
            let bin = (here + ahead) % BINS;
            let bits = self.occupied[bin / BITS] >> (bin % BITS);
            if bits != 0 {
                let found = ahead + bits.trailing_zeros() as usize;
                return (found < BINS).then_some(found);
            }
            ahead += BITS - bin % BITS;
        }
        None
    }

    /// What a bin holds, in no order.
    fn list(&self, bin: usize) -> impl Iterator<Item = Due> {
        let contact = |contact: u32| (contact != NONE).then_some(contact as usize);
        std::iter::successors(contact(self.first[bin]), move |&last| {
            contact(self.after[last])
        })
        .map(|at| self.due[at])
    }

    /// Moves the origin of time: subtracts `shift` s from every one.
    pub fn shift(&mut self, shift: f64) {
        for word in 0..BINS / BITS {
            while self.occupied[word] != 0 {
                self.empty(word * BITS + self.occupied[word].trailing_zeros() as usize);
            }
        }
        let mut all = std::mem::take(&mut self.present);
        all.extend(self.next.take());
        all.append(&mut self.beyond);
        self.present_bin = 0;
        for due in all {
            // Not negative, whatever rounding does; see `Due`.
            self.push(Due {
                time: (due.time() - shift).max(0.0).to_bits(),
                ..due
            });
        }
    }

    fn bin(&self, due: Due) -> u64 {
        floored(due.time() * self.bins_per_second) as u64
    }

    /// Puts one into its bin.
    #[inline]
    fn file(&mut self, due: Due) {
        let bin = self.bin(due);
        if bin <= self.present_bin {
            let place = self.present.partition_point(|other| *other > due);
            self.present.insert(place, due);
        } else if bin - self.present_bin < BINS as u64 {
            let bin = place_of(bin);
            let contact = due.block() * self.contacts_per_block + due.contact();
            self.due[contact] = due;
            self.after[contact] = self.first[bin];
            #[expect(clippy::cast_possible_truncation, reason = "at most 1e7 contacts")]
            (self.first[bin] = contact as u32);
            self.occupied[bin / BITS] |= 1 << (bin % BITS);
        } else {
            self.beyond.push(due);
        }
    }

    /// Turns to the next bin that holds anything, and sorts it.
    fn turn(&mut self) {
        if let Some(ahead) = self.occupied_from(1) {
            self.present_bin += ahead as u64;
            self.empty(place_of(self.present_bin));
        }
        if !self.beyond.is_empty() {
            // Nothing may stay aside that now lies within the turn.
            if self.present.is_empty() {
                let bins = self.beyond.iter().map(|due| self.bin(*due));
                self.present_bin = bins.min().unwrap_or(0);
            }
            for due in std::mem::take(&mut self.beyond) {
                self.file(due);
            }
        }
        self.present.sort_unstable_by(|a, b| b.cmp(a));
    }

    /// Takes everything out of a bin, to what is due in the present one.
    fn empty(&mut self, bin: usize) {
        let mut contact = std::mem::replace(&mut self.first[bin], NONE);
        while contact != NONE {
            self.present.push(self.due[contact as usize]);
            contact = self.after[contact as usize];
        }
        self.occupied[bin / BITS] &= !(1 << (bin % BITS));
    }
}

#[expect(clippy::cast_possible_truncation, reason = "under the number of bins")]
fn place_of(bin: u64) -> usize {
    (bin % BINS as u64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::cmp::Reverse;
    use std::collections::BinaryHeap;

    proptest! {
        /// Whatever the delays, the pauses and the shifts.
        #[test]
        fn they_come_in_the_order_of_a_heap(
            steps in prop::collection::vec((0_usize..40, -4.0_f64..5.0, 0_usize..60), 1..400), shifts in any::<bool>()
        ) {
            let mut queue = Reattachments::new(&Parameters {
                blocks: 8,
                contacts_per_block: 5,
                reattachment_time: 1e-3,
                ..Parameters::default()
            });
            let mut heap = BinaryHeap::new();
            let mut time = 0.0;
            let mut waiting = [false; 40];
            for (step, (contact, exponent, pops)) in steps.into_iter().enumerate() {
                if !std::mem::replace(&mut waiting[contact], true) {
                    // Ties, too.
                    let delay = 1e-3 * libm::exp2(exponent.floor());
                    let due = Due::new(time + delay, contact / 5, contact % 5);
                    queue.push(due);
                    heap.push(Reverse(due));
                }
                if shifts && step % 7 == 6 {
                    let by = 0.5 * time;
                    time -= by;
                    queue.shift(by);
                    heap = heap.into_iter().map(|Reverse(due): Reverse<Due>| {
                        Reverse(Due { time: (due.time() - by).max(0.0).to_bits(), ..due })
                    }).collect();
                }
                let mut ahead = Vec::new();
                queue.look_ahead(|due| {
                    ahead.push(due);
                    ahead.len() < pops
                });
                let mut expected: Vec<Due> = heap.iter().map(|Reverse(due)| *due).collect();
                expected.sort_unstable();
                expected.truncate(pops.max(1));
                prop_assert_eq!(ahead, expected);
                for _ in 0..pops / 20 {
                    let expected = heap.pop().map(|Reverse(due)| due);
                    prop_assert_eq!(queue.next(), expected);
                    prop_assert_eq!(queue.pop(), expected);
                    if let Some(due) = expected {
                        time = due.time();
                        waiting[due.block() * 5 + due.contact()] = false;
                    }
                }
            }
            while let Some(Reverse(due)) = heap.pop() {
                prop_assert_eq!(queue.pop(), Some(due));
            }
            prop_assert_eq!(queue.pop(), None);
        }
    }
}
