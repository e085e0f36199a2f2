//! Shards: a share of the parts for each of several runs without a common disk.
//!
//! Parts are dealt in the order of the plan, each to the shard with the least predicted cost so far. Contract: a
//! function of the plan alone, so each part belongs to one shard of N whatever the others do; an extension deals on,
//! and changes nothing that was dealt before; no two shards differ by more than the costliest part.

use crate::sweep::Outline;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt;
use std::num::NonZeroU64;
use std::str::FromStr;

/// Shard number K of N, written `K/N` with 1 <= K <= N.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: u64,
    count: NonZeroU64,
}

impl Default for Shard {
    fn default() -> Self {
        Self {
            number: 1,
            count: NonZeroU64::MIN,
        }
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(number, count)| {
            let number: u64 = number.parse().ok()?;
            let count: NonZeroU64 = count.parse().ok()?;
            (1..=count.get())
                .contains(&number)
                .then_some(Self { number, count })
        });
        parsed.ok_or_else(|| {
            format!("{text:?}: must be K/N with whole numbers 1 <= K <= N, such as 2/8")
        })
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl Shard {
    /// The parts of a plan that belong to this shard. Memory: a few bytes for each of the N.
    pub fn parts<P: Iterator<Item = Outline>>(
        self,
        plan: P,
    ) -> impl Iterator<Item = Outline> + use<P> {
        // Costs are >= 0, so their bits have their order.
        let mut loads: BinaryHeap<Reverse<(u64, u64)>> = BinaryHeap::new();
        plan.filter(move |part| {
            let dealt = loads.len() as u64;
            let (load, number) = match loads.peek() {
                Some(&Reverse((bits, number))) if dealt == self.count.get() => {
                    loads.pop();
                    (f64::from_bits(bits), number)
                }
                _ => (0.0, dealt + 1),
            };
            loads.push(Reverse(((load + part.cost).to_bits(), number)));
            number == self.number
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::PartName;
    use proptest::prelude::*;

    fn plan(costs: &[f64]) -> impl Iterator<Item = Outline> {
        let part = |(index, &cost): (usize, &f64)| {
            let point = index as u64;
            Outline {
                name: PartName {
                    extension: index / 7,
                    index: point,
                },
                points: point..=point,
                job_count: 1,
                cost,
                memory: 0.0,
            }
        };
        costs
            .iter()
            .enumerate()
            .map(part)
            .collect::<Vec<_>>()
            .into_iter()
    }

    fn shards(count: u64) -> impl Iterator<Item = Shard> {
        (1..=count).map(move |number| format!("{number}/{count}").parse().unwrap())
    }

    proptest! {
        #[test]
        fn shards_are_disjoint_complete_balanced_and_kept_by_an_extension(
            costs in proptest::collection::vec(prop_oneof![0.0..10.0, Just(5.0), 100.0..200.0], 0..60),
            count in 1_u64..12,
            before in 0_usize..60,
        ) {
            let before = &costs[..before.min(costs.len())];
            let mut all = Vec::new();
            let mut loads = Vec::new();
            for shard in shards(count) {
                let own: Vec<Outline> = shard.parts(plan(&costs)).collect();
                let earlier: Vec<Outline> = shard.parts(plan(before)).collect();
                prop_assert!(own.starts_with(&earlier));
                loads.push(own.iter().map(|part| part.cost).sum::<f64>());
                all.extend(own);
            }
            all.sort_by_key(|part| part.name.index);
            prop_assert_eq!(all, plan(&costs).collect::<Vec<_>>());
            let spread = loads.iter().copied().fold(0.0, f64::max) - loads.iter().copied().fold(f64::INFINITY, f64::min);
            // Sums in another order differ by roundings.
            prop_assert!(spread <= costs.iter().copied().fold(0.0, f64::max) + 1e-9, "{loads:?}");
        }
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for text in ["0/3", "4/3", "1/0", "1", "a/b", "-1/3", ""] {
            assert!(text.parse::<Shard>().unwrap_err().contains("K/N"), "{text}");
        }
        assert_eq!("2/8".parse::<Shard>().unwrap().to_string(), "2/8");
    }
}
