//! The shear force between two contact events, as a closed-form function of time.

/// How `F_S` runs along a segment.
#[derive(Clone, Copy, Debug)]
pub enum ForcePath<'a> {
    /// `Σ c_p s^p` newtons, with s = (time since the start)/`scale`.
    Polynomial {
        /// Coefficients c_p, in N.
        coefficients: &'a [f64],
        /// Time that s = 1 stands for, in s.
        scale: f64,
    },
}

/// A stretch of time without a contact event.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    /// Its first instant, in s.
    pub start: f64,
    /// Its length, in s.
    pub duration: f64,
    /// The shear force along it.
    pub path: ForcePath<'a>,
}
