//! The shear force between two contact events, as a closed-form function of time: values, extremes and integral of F_S.

use super::polynomial;

/// How F_S runs along a segment.
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

impl Segment<'_> {
    /// Its last instant, in s.
    pub fn end(&self) -> f64 {
        self.start + self.duration
    }

    /// F_S in N, at a time in s after the start.
    pub fn force_after(&self, elapsed: f64) -> f64 {
        match self.path {
            ForcePath::Polynomial { coefficients, scale } => polynomial::value(coefficients, elapsed / scale),
        }
    }

    /// Time in s and value in N of the largest F_S, if it lies above `floor`.
    pub fn maximum_above(&self, floor: f64) -> Option<(f64, f64)> {
        let ForcePath::Polynomial { coefficients, scale } = self.path;
        self.extreme_above(floor, coefficients, scale)
    }

    /// Time in s and value in N of the least F_S, if it lies below `ceiling`.
    pub fn minimum_below(&self, ceiling: f64) -> Option<(f64, f64)> {
        let ForcePath::Polynomial { coefficients, scale } = self.path;
        let mut mirrored = [0.0; polynomial::MOST_COEFFICIENTS];
        for (mirror, c) in mirrored.iter_mut().zip(coefficients) {
            *mirror = -c;
        }
        let (time, force) = self.extreme_above(-ceiling, &mirrored[..coefficients.len()], scale)?;
        Some((time, -force))
    }

    /// Integral of F_S over the segment, in N s.
    pub fn impulse(&self) -> f64 {
        match self.path {
            ForcePath::Polynomial { coefficients, scale } => {
                scale * polynomial::integral(coefficients, self.duration / scale)
            }
        }
    }

    fn extreme_above(&self, floor: f64, coefficients: &[f64], scale: f64) -> Option<(f64, f64)> {
        let reachable = coefficients[0] + coefficients[1..].iter().map(|c| c.abs()).sum::<f64>();
        let within_scale = self.duration <= scale;
        if within_scale && reachable <= floor {
            return None;
        }
        let (s, force) = polynomial::maximum(coefficients, self.duration / scale);
        (force > floor).then_some((self.start + s * scale, force))
    }
}
