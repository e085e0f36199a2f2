//! Slips and precursors as rows of measurements.

/// One slip: a rupture that breaks contacts at every block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slip {
    /// Number of the slip within its job, 0 for the first after start-up.
    pub number: u64,
    /// Onset: time of the largest shear force since the previous slip's end, in s.
    pub onset: f64,
    /// Interval τ since the onset of the previous slip, in s; `None` if there was none.
    pub interval: Option<f64>,
    /// Phase φ of the onset against the modulation, in rad; `None` without modulation.
    pub phase: Option<f64>,
    /// Shear force `F_S` at the onset, in N.
    pub peak_force: f64,
    /// Stress drop: peak force minus the least shear force during the slip, in N.
    pub drop: f64,
    /// Time of the rupture's first break, in s.
    pub nucleation: f64,
    /// Block of the first break, counted from 1 at the trailing edge.
    pub nucleation_block: u64,
    /// From the first to the last break, in s.
    pub duration: f64,
    /// Breaks in the rupture.
    pub size: u64,
    /// Speed of the rupture front, in m/s; `None` if fewer than three blocks lie on it.
    pub front_speed: Option<f64>,
    /// Precursors since the previous slip.
    pub precursors: u64,
    /// Speed of the slow front: advance of the reach through these precursors, in m/s; `None` for fewer than two.
    pub slow_front_speed: Option<f64>,
}

/// One precursor: a rupture of at least the precursor size that does not break contacts at every block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precursor {
    /// Number of the slip that it precedes.
    pub slip: u64,
    /// Number of the precursor before that slip, from 0.
    pub precursor: u64,
    /// Onset: time of the largest shear force since the previous rupture of at least this size, in s.
    pub onset: f64,
    /// Interval since the onset of the previous precursor of the same slip, in s; `None` for the first.
    pub interval: Option<f64>,
    /// Time of the first break, in s.
    pub nucleation: f64,
    /// Block of the first break, counted from 1.
    pub nucleation_block: u64,
    /// From the first to the last break, in s.
    pub duration: f64,
    /// Breaks.
    pub size: u64,
    /// Distinct blocks with a break.
    pub extent: u64,
    /// The furthest of them, counted from 1.
    pub reach: u64,
    /// Speed of its front, in m/s; `None` if fewer than three blocks lie on it.
    pub front_speed: Option<f64>,
}
