//! Failed jobs by reason.

use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Numbers of failed jobs by reason. The numbers in a reason, which differ from job to job, are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Reasons(BTreeMap<String, u64>);

impl Reasons {
    /// Counts a job; returns how many there are now.
    pub fn add(&mut self, reason: &str) -> u64 {
        *self.0.entry(without_numbers(reason)).or_default() += 1;
        self.0.values().sum()
    }

    /// The most frequent first.
    pub fn sorted(&self) -> Vec<(&str, u64)> {
        let mut reasons: Vec<(&str, u64)> = self
            .0
            .iter()
            .map(|(reason, jobs)| (reason.as_str(), *jobs))
            .collect();
        reasons.sort_by_key(|(_, jobs)| Reverse(*jobs));
        reasons
    }
}

fn without_numbers(reason: &str) -> String {
    let words = reason.split(' ').map(|word| {
        let number = word.trim_matches([',', ';', ':', '.', '(', ')']);
        if number.parse::<f64>().is_ok() {
            word.replace(number, "…")
        } else {
            word.to_owned()
        }
    });
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_are_counted_by_reason_without_its_numbers_and_the_most_frequent_comes_first() {
        let mut reasons = Reasons::default();
        assert_eq!(reasons.sorted(), []);
        assert_eq!(reasons.add("index 99 out of bounds"), 1);
        for events in 10..14 {
            reasons.add(&format!(
                "at t = {events}.5e-3 s: {events} events, the shortest of 1/omega_max (s.d. {events})"
            ));
        }
        assert_eq!(reasons.add("index 7 out of bounds"), 6);
        assert_eq!(
            reasons.sorted(),
            [
                (
                    "at t = … s: … events, the shortest of 1/omega_max (s.d. …)",
                    4
                ),
                ("index … out of bounds", 2)
            ]
        );
    }
}
