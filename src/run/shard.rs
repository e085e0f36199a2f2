//! Shards: a share of the parts for each of several runs that work side by side on one directory.

use crate::sweep::Part;
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
    /// All parts.
    fn default() -> Self {
        Self { number: 1, count: NonZeroU64::MIN }
    }
}

/// A text that names no shard.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?}: must be K/N with whole numbers 1 <= K <= N, such as 2/8")]
pub struct ShardError(String);

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parsed = text.split_once('/').and_then(|(number, count)| {
            let shard = Self { number: number.parse().ok()?, count: count.parse().ok()? };
            (1..=shard.count.get()).contains(&shard.number).then_some(shard)
        });
        parsed.ok_or_else(|| ShardError(text.to_owned()))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl Shard {
    /// Whether a part is one of its own. Each part belongs to one shard of N, whatever the others do.
    #[must_use]
    pub fn owns(&self, part: &Part) -> bool {
        (part.epoch as u64 + part.index) % self.count == self.number - 1
    }

    /// Name of its lock and of its staging folder.
    #[must_use]
    pub fn writer(&self) -> String {
        format!("shard-{}-of-{}", self.number, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_part_belongs_to_one_shard() {
        let shards: Vec<Shard> = (1..=3).map(|number| format!("{number}/3").parse().unwrap()).collect();
        for epoch in 0..2 {
            for index in 0..10 {
                let part = Part { epoch, index, jobs: Vec::new(), cost: 0.0 };
                assert_eq!(shards.iter().filter(|shard| shard.owns(&part)).count(), 1);
                assert!(Shard::default().owns(&part));
            }
        }
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for text in ["0/3", "4/3", "1/0", "1", "a/b", "-1/3", ""] {
            assert!(text.parse::<Shard>().unwrap_err().to_string().contains("K/N"), "{text}");
        }
        assert_eq!("2/8".parse::<Shard>().unwrap().to_string(), "2/8");
    }
}
