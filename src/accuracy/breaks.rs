//! Before chaos: break times against a reference, contact by contact.
//!
//! A break is identified by block, contact and generation, which mean the same contact in every solver. It is missing if
//! it has not come a tenth of the wave crossing time after the last of the reference.

use crate::model::{Change, ContactEvent, Parameters};
use crate::solver::{Observer, Segment};
use crate::table::columns::columns;
use std::collections::HashMap;

/// A break that comes later than the last of the reference by this part of the wave crossing time is missing.
const LATE: f64 = 0.1;

/// One attachment of a contact: block, contact, generation.
type Key = (usize, usize, u32);

fn key(event: &ContactEvent) -> Key {
    (event.block, event.contact, event.generation)
}

/// An observer that keeps the first breaks of a reference.
#[derive(Clone, Debug)]
pub struct Reference {
    wanted: usize,
    /// How long to wait for a break, in s.
    late: f64,
    order: HashMap<Key, usize>,
    times: Vec<f64>,
}

impl Reference {
    /// Keeps this number of breaks.
    pub fn new(parameters: &Parameters, wanted: usize) -> Self {
        Self {
            wanted,
            late: LATE * parameters.wave_crossing_time(),
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

/// An observer that compares breaks with those of a reference.
#[derive(Clone, Debug)]
pub struct Comparison<'a> {
    reference: &'a Reference,
    /// Error of each break of the reference, in s; NaN until the break occurs.
    errors: Vec<f64>,
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
    }
}

impl<'a> Comparison<'a> {
    pub fn new(reference: &'a Reference) -> Self {
        Self {
            reference,
            errors: vec![f64::NAN; reference.times.len()],
            now: 0.0,
        }
    }

    pub fn errors(&self) -> BreakErrors {
        let errors = self.errors.iter().copied();
        let mut made: Vec<f64> = errors.filter(|error| !error.is_nan()).collect();
        made.sort_by(f64::total_cmp);
        BreakErrors {
            breaks: Some(self.errors.len() as u64),
            missing: Some((self.errors.len() - made.len()) as u64),
            median: made.get(made.len() / 2).copied(),
            largest: made.last().copied(),
        }
    }
}

impl Observer for Comparison<'_> {
    fn advance(&mut self, segment: &Segment<'_>) {
        self.now = segment.end();
    }

    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break
            && let Some(&index) = self.reference.order.get(&key(event))
        {
            self.errors[index] = (event.time - self.reference.times[index]).abs();
        }
    }

    fn is_satisfied(&self) -> bool {
        let last = self.reference.times.last();
        last.is_none_or(|last| self.now > last + self.reference.late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::ContactChange;

    fn break_at(time: f64, contact: usize) -> ContactEvent {
        let what = ContactChange {
            time,
            block: 0,
            contact,
            generation: 0,
            change: Change::Break,
            displacement: 0.0,
            force: 1.0,
            threshold: 1.0,
            stiffness: 1.0,
        };
        ContactEvent {
            what,
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
        let mut comparison = Comparison::new(&reference);
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
        assert_eq!(errors.missing, Some(0));
    }

    #[test]
    fn a_late_break_has_an_error_and_one_that_never_comes_is_missing() {
        let late = compared(&[(0.1, 0), (0.21, 1), (0.3, 2), (0.4, 3)]);
        assert_eq!(late.missing, Some(0));
        assert!((late.largest.unwrap() - 0.01).abs() < 1e-12, "{late:?}");
        let missing = compared(&[(0.1, 0), (0.2, 1), (0.4, 3)]);
        assert_eq!((missing.breaks, missing.missing), (Some(4), Some(1)));
    }
}
