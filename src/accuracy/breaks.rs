//! Before chaos: break times against a reference, contact by contact, and for how long two trajectories stay together.
//!
//! A break is identified by block, contact and generation, which mean the same contact in every solver. Two
//! trajectories are apart from the first break of the reference on that the other misses, or makes earlier or later by
//! more than a tenth of the wave crossing time.

use crate::model::{Change, ContactEvent, Parameters};
use crate::solver::{Observer, Segment};
use crate::table::columns::columns;
use std::collections::HashMap;

/// Trajectories are apart when a break differs by more than this part of the wave crossing time.
const APART: f64 = 0.1;

/// One attachment of a contact: block, contact, generation.
type Key = (usize, usize, u32);

fn key(event: &ContactEvent) -> Key {
    (event.block, event.contact, event.generation)
}

/// An observer that keeps the first breaks of a reference.
#[derive(Clone, Debug)]
pub struct Reference {
    wanted: usize,
    apart: f64,
    order: HashMap<Key, usize>,
    times: Vec<f64>,
}

impl Reference {
    /// Keeps this number of breaks.
    pub fn new(parameters: &Parameters, wanted: usize) -> Self {
        Self {
            wanted,
            apart: APART * parameters.wave_crossing_time(),
            order: HashMap::new(),
            times: Vec::new(),
        }
    }
}

impl Observer for Reference {
    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break && self.times.len() < self.wanted {
            self.order.insert(key(event), self.times.len());
            self.times.push(event.time);
        }
    }

    fn is_satisfied(&self) -> bool {
        self.times.len() == self.wanted
    }
}

/// An observer that compares breaks with those of a reference: at least the first `counted`, and until the two are
/// apart.
#[derive(Clone, Debug)]
pub struct Comparison<'a> {
    reference: &'a Reference,
    counted: usize,
    /// Error of each break of the reference, in s; NaN until the break occurs.
    errors: Vec<f64>,
    /// Breaks of the reference that must have occurred by now.
    due: usize,
    apart: Option<usize>,
    now: f64,
}

columns! {
    /// What a comparison gives; nothing where none was made.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct BreakErrors {
        breaks as "compared_breaks": Option<u64> = "",
            "number K of first breaks whose times are compared with those at the tightest tolerance";
        missing as "missing_breaks": Option<u64> = "", "of these, breaks that were not made";
        median as "median_break_error": Option<f64> = "s", "median error of their times";
        largest as "largest_break_error": Option<f64> = "s", "largest error of their times";
        together as "together_breaks": Option<u64> = "", "breaks before the trajectories are apart";
        together_seconds: Option<f64> = "s", "model time before the trajectories are apart";
        together_throughout: bool = "", "whether they are not, as far as the reference reaches";
    }
}

impl<'a> Comparison<'a> {
    /// Compares the first `counted` breaks, at most those that the reference has.
    pub fn new(reference: &'a Reference, counted: usize) -> Self {
        let breaks = reference.times.len();
        let counted = counted.min(breaks);
        Self {
            reference,
            counted,
            errors: vec![f64::NAN; breaks],
            due: 0,
            apart: None,
            now: 0.0,
        }
    }

    pub fn errors(&self) -> BreakErrors {
        let mut made: Vec<f64> = self.errors[..self.counted]
            .iter()
            .copied()
            .filter(|error| !error.is_nan())
            .collect();
        made.sort_by(f64::total_cmp);
        let together = self.apart.unwrap_or(self.errors.len());
        let times = &self.reference.times;
        BreakErrors {
            breaks: Some(self.counted as u64),
            missing: Some((self.counted - made.len()) as u64),
            median: made.get(made.len() / 2).copied(),
            largest: made.last().copied(),
            together: Some(together as u64),
            together_seconds: times.get(together).or(times.last()).copied().or(Some(0.0)),
            together_throughout: self.apart.is_none(),
        }
    }

    /// Moves on past the breaks that must have occurred by now.
    fn pass(&mut self, now: f64) {
        self.now = now;
        while let Some(time) = self.reference.times.get(self.due)
            && time + self.reference.apart < now
        {
            let is_apart =
                self.errors[self.due].is_nan() || self.errors[self.due] > self.reference.apart;
            if is_apart && self.apart.is_none() {
                self.apart = Some(self.due);
            }
            self.due += 1;
        }
    }
}

impl Observer for Comparison<'_> {
    fn advance(&mut self, segment: &Segment<'_>) {
        self.pass(segment.end());
    }

    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break
            && let Some(&index) = self.reference.order.get(&key(event))
        {
            self.errors[index] = (event.time - self.reference.times[index]).abs();
        }
    }

    fn is_satisfied(&self) -> bool {
        self.due >= self.counted && (self.apart.is_some() || self.due == self.errors.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn break_at(time: f64, contact: usize) -> ContactEvent {
        ContactEvent {
            time,
            block: 0,
            contact,
            generation: 0,
            change: Change::Break,
            displacement: 0.0,
            force: 1.0,
            threshold: 1.0,
            stiffness: 1.0,
            attached: 0,
            attached_time: 0.0,
            mean_displacement: 0.0,
        }
    }

    fn compared(times: &[(f64, usize)]) -> BreakErrors {
        let mut reference = Reference::new(&Parameters::default(), 4);
        for contact in 0..4 {
            reference.contact(&break_at(0.1 * (contact + 1) as f64, contact));
        }
        assert!(reference.is_satisfied());
        let mut comparison = Comparison::new(&reference, 3);
        for &(time, contact) in times {
            comparison.contact(&break_at(time, contact));
        }
        comparison.advance(&Segment::polynomial(0.0, 1.0, &[0.0]));
        assert!(comparison.is_satisfied());
        comparison.errors()
    }

    #[test]
    fn breaks_are_matched_by_contact_and_not_by_order() {
        let errors = compared(&[(0.2 + 2e-6, 1), (0.1 + 1e-6, 0), (0.3 + 3e-6, 2), (0.4, 3)]);
        assert!(
            (errors.median.unwrap() - 2e-6).abs() < 1e-12
                && (errors.largest.unwrap() - 3e-6).abs() < 1e-12,
            "{errors:?}"
        );
        assert!(
            errors.together_throughout && errors.missing == Some(0) && errors.together == Some(4)
        );
    }

    #[test]
    fn a_late_or_missing_break_ends_the_time_together() {
        let late = compared(&[(0.1, 0), (0.21, 1), (0.3, 2), (0.4, 3)]);
        assert_eq!(
            (late.together, late.together_seconds, late.missing),
            (Some(1), Some(0.2), Some(0))
        );
        let missing = compared(&[(0.1, 0), (0.2, 1), (0.4, 3)]);
        assert_eq!(
            (
                missing.together,
                missing.missing,
                missing.together_throughout
            ),
            (Some(2), Some(1), false)
        );
    }
}
