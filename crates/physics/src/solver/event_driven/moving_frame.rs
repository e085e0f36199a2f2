//! The moving frame: time, displacement and drive, counted from an origin that follows the slider, so that neither time
//! nor displacement loses digits in long runs.

use crate::model::{ContactChange, Drive};
use crate::solver::SimulationError;
use crate::solver::harmonic::Harmonic;

/// Time in the frame at which it moves where Taylor steps locate events to rounding, in s.
pub(super) const SPAN: f64 = 0.0625;
/// A step must span this many units in the last place of the time, so that events are located to a millionth of it.
pub(super) const MIN_RESOLUTION: f64 = 1_048_576.0;
/// The frame moves by multiples of these, so that its sums are exact: 2^-20 s and 2^-40 m.
const TIME_QUANTUM: f64 = 1.0 / 1_048_576.0;
const DISPLACEMENT_QUANTUM: f64 = 1.0 / 1_099_511_627_776.0;

/// The drive's displacement at the start of a step of h s: its derivatives times powers of h, and what takes it to the
/// next step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StepDrive {
    /// Displacement of the ramp, and its rise in a step, in m.
    pub ramp: f64,
    pub rise: f64,
    /// Δ cos θ and -Δ sin θ at the phase θ, in m.
    pub swing: [f64; 2],
    /// ωh, in rad; 0 if the drive is never modulated.
    pub angle: f64,
}

impl StepDrive {
    /// Displacement, in m.
    #[inline(always)]
    pub fn displacement(&self) -> f64 {
        self.ramp + self.swing[0]
    }

    /// h u', in m.
    #[inline(always)]
    pub fn increment(&self) -> f64 {
        self.rise + self.angle * self.swing[1]
    }

    /// h² u'', in m.
    #[inline(always)]
    pub fn bend(&self) -> f64 {
        -self.angle * self.angle * self.swing[0]
    }

    /// Its derivative, as the displacement of another drive: h^p u^(p) is the displacement after p of them.
    #[inline(always)]
    pub fn derivative(&self) -> Self {
        Self {
            ramp: self.rise,
            rise: 0.0,
            swing: [self.angle * self.swing[1], -self.angle * self.swing[0]],
            angle: self.angle,
        }
    }

    /// A step later, or before with a negative sine; `turn` is sine and cosine of ωh.
    #[inline(always)]
    fn turned(&self, [sine, cosine]: [f64; 2]) -> [f64; 2] {
        let [along, across] = self.swing;
        // Δ cos(θ + ωh) and -Δ sin(θ + ωh).
        [
            along * cosine + across * sine,
            across * cosine - along * sine,
        ]
    }

    /// Goes on by a step.
    #[inline(always)]
    pub fn advance(&mut self, turn: [f64; 2]) {
        self.ramp += self.rise;
        if self.angle != 0.0 {
            self.swing = self.turned(turn);
        }
    }

    /// A step before.
    #[inline(always)]
    pub fn before(&self, [sine, cosine]: [f64; 2]) -> Self {
        Self {
            ramp: self.ramp - self.rise,
            swing: self.turned([-sine, cosine]),
            ..*self
        }
    }
}

/// How far the origin moves: in s, and in m.
#[derive(Clone, Copy, Debug)]
pub(super) struct OriginShift {
    pub time: f64,
    pub displacement: f64,
}

/// The frame, and the drive in it.
#[derive(Clone, Debug)]
pub(super) struct MovingFrame {
    pub drive: Drive,
    /// Time in the frame at which it moves, in s.
    pub span: f64,
    /// Time and displacement of the origin since the start of the run, in s and m.
    origin_time: f64,
    origin_displacement: f64,
    /// Time since the origin, in s.
    pub time: f64,
    /// Displacement of the drive's ramp at the origin of time, in m.
    ramp_at_origin: f64,
    /// Δ cos θ and -Δ sin θ at the present phase θ.
    swing: [f64; 2],
}

impl MovingFrame {
    /// The frame at the start of a run, which moves at a time of `span` s in it.
    pub fn new(drive: Drive, span: f64) -> Self {
        Self {
            drive,
            span,
            origin_time: 0.0,
            origin_displacement: 0.0,
            time: 0.0,
            // The cosine is counted from its own zero, so the ramp starts Δ below.
            ramp_at_origin: -drive.amplitude,
            swing: [drive.amplitude, 0.0],
        }
    }

    /// The present time since the start of the run, in s.
    #[inline]
    pub fn now(&self) -> f64 {
        self.origin_time + self.time
    }

    /// Checks that the clock is fine enough to locate events within a step of `length` s.
    pub fn check_resolution(&self, length: f64) -> Result<(), SimulationError> {
        if length >= MIN_RESOLUTION * f64::EPSILON * self.time.max(self.span) {
            return Ok(());
        }
        Err(SimulationError::StepTooShort {
            time: self.now(),
            step: length,
        })
    }

    /// Time since the start of the run, in s, for a time in the frame.
    #[inline]
    pub fn absolute_time(&self, time: f64) -> f64 {
        self.origin_time + time
    }

    /// Displacement since the start of the run, in m, for a displacement in the frame.
    pub fn absolute_displacement(&self, displacement: f64) -> f64 {
        self.origin_displacement + displacement
    }

    /// A change in the frame with time and displacement counted from the start of the run.
    #[inline]
    pub fn absolute(&self, change: ContactChange) -> ContactChange {
        ContactChange {
            time: self.absolute_time(change.time),
            displacement: self.absolute_displacement(change.displacement),
            ..change
        }
    }

    /// Seconds until a time that is counted from the start of the run.
    #[inline]
    pub fn until(&self, time: f64) -> f64 {
        time - self.origin_time - self.time
    }

    /// Whether an instant that is `seconds` s away has come, within rounding.
    #[inline]
    pub fn has_come(&self, seconds: f64) -> bool {
        seconds <= 4.0 * f64::EPSILON * self.now()
    }

    /// Sets the time in the frame, in s.
    #[inline]
    pub fn set_time(&mut self, time: f64) {
        self.time = time;
        if self.drive.is_modulated() {
            let (sine, cosine) = libm::sincos(self.phase());
            self.swing = [self.drive.amplitude * cosine, -self.drive.amplitude * sine];
        }
    }

    /// Begins the next cycle: at the maximum where two of a ramp join, or at the minimum where a pulse begins or ends.
    pub fn next_cycle(&mut self) {
        let before = self.drive.lift - self.drive.amplitude;
        self.drive.next_cycle();
        let amplitude = self.drive.amplitude;
        self.ramp_at_origin += (self.drive.lift - amplitude) - before;
        let along = if self.drive.lift > 0.0 {
            -amplitude
        } else {
            amplitude
        };
        self.swing = [along, 0.0];
    }

    /// Moves the origin close to the present time and a displacement, in m.
    pub fn move_origin(&mut self, displacement: f64) -> OriginShift {
        let time = (self.time / TIME_QUANTUM).floor() * TIME_QUANTUM;
        let displacement = (displacement / DISPLACEMENT_QUANTUM).floor() * DISPLACEMENT_QUANTUM;
        self.ramp_at_origin += self.drive.velocity * time - displacement;
        self.time -= time;
        self.origin_time += time;
        self.origin_displacement += displacement;
        OriginShift { time, displacement }
    }

    /// Present phase of the modulation, in rad.
    #[inline]
    fn phase(&self) -> f64 {
        self.drive.phase(self.origin_time) + self.drive.angular_frequency * self.time
    }

    /// Present displacement of the drive's ramp, without the cosine, in m.
    #[inline]
    fn ramp(&self) -> f64 {
        self.ramp_at_origin + self.drive.velocity * self.time
    }

    /// F_S at a displacement of the trailing edge, in N.
    #[inline]
    pub fn shear_force(&self, displacement: f64) -> f64 {
        self.drive.stiffness * (self.ramp() + self.swing[0] - displacement)
    }

    /// The drive's displacement from now on, within the cycle, in m.
    pub fn drive_motion(&self) -> Harmonic {
        Harmonic {
            start: self.ramp(),
            rate: self.drive.velocity,
            amplitude: self.drive.amplitude,
            phase: self.phase(),
            angular_frequency: self.drive.angular_frequency,
        }
    }

    /// The drive for steps of `length` s, from the present on.
    #[inline]
    pub fn step_drive(&self, length: f64) -> StepDrive {
        StepDrive {
            ramp: self.ramp(),
            rise: self.drive.velocity * length,
            swing: self.swing,
            angle: self.drive.angular_frequency * length,
        }
    }
}
