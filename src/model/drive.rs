//! The drive: a ramp and a cosine, u(t) = V0 t + Δ (cos(2πt/T) - 1), so that the shear force starts at zero.

use super::Parameters;
use std::f64::consts::TAU;

/// The far end of the driving spring.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// Stiffness `K_d`, in N/m.
    pub stiffness: f64,
    /// Velocity `V_0` of the ramp, in m/s.
    pub velocity: f64,
    /// Amplitude Δ of the modulation, in m.
    pub amplitude: f64,
    /// Angular frequency 2π/T of the modulation, in rad/s; 0 when it is off.
    pub angular_frequency: f64,
    /// Period T, in s; 0 when the modulation is off.
    period: f64,
}

impl Drive {
    /// The drive of a set of parameters.
    #[must_use]
    pub fn new(parameters: &Parameters) -> Self {
        Self {
            stiffness: parameters.drive_stiffness,
            velocity: parameters.drive_velocity,
            amplitude: parameters.modulation_amplitude,
            angular_frequency: parameters.modulation_frequency(),
            period: parameters.modulation_period.unwrap_or(0.0),
        }
    }

    /// Whether the modulation is on.
    #[must_use]
    pub fn is_modulated(&self) -> bool {
        self.amplitude > 0.0
    }

    /// Phase of the modulation at a time in s, in [0, 2π) rad; reduced before scaling, so that it stays exact in long runs.
    #[must_use]
    pub fn phase(&self, time: f64) -> f64 {
        if self.is_modulated() { TAU * (time / self.period).fract() } else { 0.0 }
    }

    /// Displacement u(t) in m and velocity u'(t) in m/s of the driven end, at a time in s.
    pub fn motion(&self, time: f64) -> (f64, f64) {
        let ramp = self.velocity * time;
        if self.is_modulated() {
            let (sine, cosine) = libm::sincos(self.phase(time));
            let rate = self.amplitude * self.angular_frequency;
            (ramp + self.amplitude * (cosine - 1.0), self.velocity - rate * sine)
        } else {
            (ramp, self.velocity)
        }
    }
}
