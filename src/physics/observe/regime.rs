//! Averages of a job over time, and the regime that they show.

use crate::value::words;

/// What a job measures as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Averages {
    /// The time that they are over, in s.
    pub time: f64,
    /// Time average of the shear force, in N.
    pub friction: f64,
    /// Time average of the fraction of contacts that are attached.
    pub attached_fraction: f64,
    /// Share of the time within slips.
    pub slip_share: f64,
}

words! {
    /// How a slider moves, by the share of time within slips.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Regime {
        /// It sticks for most of the time.
        StickSlip = "stick-slip",
        /// It slips for most of the time.
        Mixed = "mixed",
        Sliding = "sliding",
    }
}

impl Regime {
    /// Least share of time within slips of the mixed regime, and of sliding.
    pub const MIN_SHARES: [f64; 2] = [0.5, 0.95];

    /// The regime at a share of time within slips.
    pub fn at(slip_share: f64) -> Self {
        let [mixed, sliding] = Self::MIN_SHARES;
        if slip_share < mixed {
            Self::StickSlip
        } else if slip_share < sliding {
            Self::Mixed
        } else {
            Self::Sliding
        }
    }
}
