//! The drive: a ramp and a cosine, u(t) = V0 t + Δ (cos(2πt/T) - 1), so that the shear force starts at zero.
//!
//! T and Δ may themselves be ramped, cycle by cycle: each cycle starts at a maximum, at t_c, and is a plain cosine,
//! u(t) = V0 t + Δ_c (cos(2π (t - t_c)/T_c) - 1), with the T_c and Δ_c that the ramp has at t_c. So u and u' are
//! continuous where cycles join. A [`Drive`] is that of one cycle, the present one; without a ramp, and after it, a
//! cycle has no end.
//!
//! Or the modulation is a pulse of n periods from t_p on, u(t) = V0 t + Δ (1 - cos(2π (t - t_p)/T)): the load rises by
//! up to 2Δ and returns. It is one cycle that starts at a maximum at t_p - T/2 and lies 2Δ higher, between two without
//! modulation.

use super::Parameters;
use super::theory::{eta, load_maximum_phase};
use std::f64::consts::{PI, TAU};

/// The far end of the driving spring, within one cycle of the modulation.
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
    pub period: f64,
    /// η of the cycle in force, see [`eta`].
    pub eta: f64,
    /// A maximum of the modulation, in s: the cycle starts there.
    pub cycle_start: f64,
    /// Where the next cycle starts, in s; infinite if none does.
    pub cycle_end: f64,
    /// How much higher the driven end is than in a lasting modulation, in m: 2Δ in a pulse, else 0.
    pub lift: f64,
    course: Course,
}

/// Displacement u(t) of the driven end, in m, and its velocity u'(t), in m/s.
#[derive(Clone, Copy, Debug)]
pub struct DriveMotion {
    pub displacement: f64,
    pub velocity: f64,
}

/// How the modulation goes on after a cycle.
#[derive(Clone, Copy, Debug)]
enum Course {
    Lasting,
    Ramp(Ramp),
    Pulse(Pulse),
}

/// Periods of the modulation from a time on, without modulation before and after.
#[derive(Clone, Copy, Debug)]
struct Pulse {
    /// From and to, in s.
    start: f64,
    end: f64,
    /// In s, and in m.
    period: f64,
    amplitude: f64,
    eta: f64,
}

impl Pulse {
    fn new(parameters: &Parameters) -> Option<Self> {
        let start = parameters.pulse_start?;
        let period = parameters.modulation_period?;
        Some(Self {
            start,
            end: start + parameters.pulse_cycles.unwrap_or(1) as f64 * period,
            period,
            amplitude: parameters.modulation_amplitude,
            eta: parameters.eta(),
        })
    }

    /// When its maximum would have been before it.
    fn cycle_start(&self) -> f64 {
        self.start - 0.5 * self.period
    }

    /// The first t in s with u(t) >= `velocity` `time`.
    fn first_passage(&self, time: f64, velocity: f64) -> f64 {
        let eta = self.eta;
        if time <= self.start || time > self.end + 2.0 * self.amplitude / velocity {
            return time;
        }
        // u is θ + η (cos θ + 1) in units of V0 T/2π.
        let level = TAU * (time - self.cycle_start()) / self.period - 2.0 * eta;
        let angle = match load_maximum_phase(eta) {
            Some(maximum) => {
                let highest = maximum + eta * (libm::cos(maximum) - 1.0);
                let turn = TAU * ((level - highest) / TAU).ceil().max(1.0);
                let begin = if turn > TAU { -PI - maximum } else { -PI };
                turn + rising_angle(eta, level - turn, [begin, maximum])
            }
            None => rising_angle(eta, level, [level, level + 2.0 * eta]),
        };
        let passage = self.cycle_start() + angle / TAU * self.period;
        if passage <= self.end { passage } else { time }
    }
}

/// The angle θ with θ + η (cos θ - 1) = `level`, between two where it is less and more and only grows.
fn rising_angle(eta: f64, level: f64, [mut low, mut high]: [f64; 2]) -> f64 {
    const STEPS: u32 = 60;
    let mut angle = 0.5 * (low + high);
    for _ in 0..STEPS {
        let (sine, cosine) = libm::sincos(angle);
        let rest = level - (angle + eta * (cosine - 1.0));
        if rest > 0.0 {
            low = angle;
        } else {
            high = angle;
        }
        let newton = angle + rest / (1.0 - eta * sine);
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - angle).abs() <= f64::EPSILON * TAU {
            break;
        }
        angle = next;
    }
    angle
}

/// A linear ramp of period and amplitude to the turning point and back.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    /// Duration in either direction, in s.
    time: f64,
    /// At the start and at the turning point: period in s, amplitude in m.
    period: [f64; 2],
    amplitude: [f64; 2],
}

impl Ramp {
    fn new(parameters: &Parameters) -> Option<Self> {
        let amplitude = parameters.modulation_amplitude;
        let time = parameters.ramp_time;
        let period = parameters.modulation_period.filter(|_| time > 0.0)?;
        Some(Self {
            time,
            period: [period, parameters.turning_period.unwrap_or(period)],
            amplitude: [amplitude, parameters.turning_amplitude.unwrap_or(amplitude)],
        })
    }

    /// A quantity at a time in s, from its values at the start and at the turning point.
    fn at(&self, time: f64, [start, turning]: [f64; 2]) -> f64 {
        let elapsed = time / self.time;
        let fraction = if elapsed <= 1.0 {
            elapsed
        } else {
            (2.0 - elapsed).max(0.0)
        };
        // With these weights both ends are met exactly, and nothing between them is zero.
        (1.0 - fraction) * start + fraction * turning
    }
}

impl Drive {
    /// The drive of a set of parameters, in its first cycle.
    pub fn new(parameters: &Parameters) -> Self {
        let period = parameters.modulation_period.unwrap_or(0.0);
        let lasting = Self {
            stiffness: parameters.drive_stiffness,
            velocity: parameters.drive_velocity,
            amplitude: parameters.modulation_amplitude,
            angular_frequency: parameters.modulation_frequency(),
            period,
            eta: parameters.eta(),
            cycle_start: 0.0,
            cycle_end: f64::INFINITY,
            lift: 0.0,
            course: Course::Lasting,
        };
        if let Some(pulse) = Pulse::new(parameters) {
            Self {
                cycle_end: pulse.start,
                course: Course::Pulse(pulse),
                ..lasting.still()
            }
        } else if let Some(ramp) = Ramp::new(parameters) {
            Self {
                cycle_end: period,
                course: Course::Ramp(ramp),
                ..lasting
            }
        } else {
            lasting
        }
    }

    /// The same without modulation from now on.
    const fn still(self) -> Self {
        Self {
            amplitude: 0.0,
            angular_frequency: 0.0,
            period: 0.0,
            eta: 0.0,
            cycle_end: f64::INFINITY,
            lift: 0.0,
            ..self
        }
    }

    /// Begins the next cycle, if there is one.
    pub fn next_cycle(&mut self) {
        match self.course {
            Course::Lasting => (),
            Course::Ramp(ramp) => self.next_of_ramp(&ramp),
            Course::Pulse(_) if self.is_modulated() => *self = self.still(),
            Course::Pulse(pulse) => {
                self.period = pulse.period;
                self.amplitude = pulse.amplitude;
                self.angular_frequency = TAU / pulse.period;
                self.eta = pulse.eta;
                self.cycle_start = pulse.cycle_start();
                self.cycle_end = pulse.end;
                self.lift = 2.0 * pulse.amplitude;
            }
        }
    }

    fn next_of_ramp(&mut self, ramp: &Ramp) {
        let start = self.cycle_end;
        self.period = ramp.at(start, ramp.period);
        self.amplitude = ramp.at(start, ramp.amplitude);
        self.angular_frequency = TAU / self.period;
        self.eta = eta(self.angular_frequency, self.amplitude, self.velocity);
        self.cycle_start = start;
        self.cycle_end = if start >= 2.0 * ramp.time {
            f64::INFINITY
        } else {
            start + self.period
        };
    }

    /// Advances to the cycle at a time in s, which is not before the present one.
    pub fn advance_to(&mut self, time: f64) {
        while time >= self.cycle_end {
            self.next_cycle();
        }
    }

    pub fn is_modulated(&self) -> bool {
        self.amplitude > 0.0
    }

    /// Phase of the modulation at a time in s, in (-2π, 2π) rad; reduced before scaling, so that it stays exact in long
    /// runs.
    pub fn phase(&self, time: f64) -> f64 {
        if self.is_modulated() {
            TAU * ((time - self.cycle_start) / self.period).fract()
        } else {
            0.0
        }
    }

    /// When the pulse begins and ends, in s, if there is one.
    pub const fn pulse(&self) -> Option<[f64; 2]> {
        match self.course {
            Course::Pulse(pulse) => Some([pulse.start, pulse.end]),
            _ => None,
        }
    }

    /// When the driven end first gets as far as it would be at a time in s without modulation, in s: the first t with
    /// u(t) >= V0 `time`. Of a lasting or ramped modulation, the time lies in the present cycle.
    pub fn first_passage(&self, time: f64) -> f64 {
        if let Course::Pulse(pulse) = self.course {
            return pulse.first_passage(time, self.velocity);
        }
        if !self.is_modulated() {
            return time;
        }
        let periods = (time - self.cycle_start) / self.period;
        // u is θ + η (cos θ - 1) in units of V0 T/2π, at most θ, and so not further before this turn begins.
        let whole = periods.floor();
        let level = TAU * periods.fract();
        let eta = self.eta;
        let load = |angle: f64| angle + eta * (libm::cos(angle) - 1.0);
        // It grows from 0 to the maximum, and from the minimum on.
        let ends = match load_maximum_phase(eta) {
            Some(maximum) if level <= load(maximum) => [0.0, maximum],
            Some(maximum) => [PI - maximum, TAU],
            None => [0.0, TAU],
        };
        let angle = rising_angle(eta, level, ends);
        self.cycle_start + (whole + angle / TAU) * self.period
    }

    /// The motion of the driven end at a time in s.
    pub fn motion(&self, time: f64) -> DriveMotion {
        let ramp = self.velocity * time;
        if self.is_modulated() {
            let (sine, cosine) = libm::sincos(self.phase(time));
            let rate = self.amplitude * self.angular_frequency;
            DriveMotion {
                displacement: ramp + self.amplitude * (cosine - 1.0) + self.lift,
                velocity: self.velocity - rate * sine,
            }
        } else {
            DriveMotion {
                displacement: ramp,
                velocity: self.velocity,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// T from 0.03 s to 0.05 s and Δ from 1 µm to 0, within 1 s, and back.
    fn ramped() -> Drive {
        Drive::new(&Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.03),
            turning_period: Some(0.05),
            turning_amplitude: Some(0.0),
            ramp_time: 1.0,
            ..Parameters::default()
        })
    }

    #[test]
    fn where_cycles_join_displacement_and_velocity_are_continuous() {
        let mut drive = ramped();
        let mut joints = 0;
        while drive.cycle_end.is_finite() {
            let joint = drive.cycle_end;
            let before = drive.motion(joint);
            drive.next_cycle();
            let after = drive.motion(joint);
            assert!(
                (before.displacement - after.displacement).abs() < 1e-18,
                "{before:?} and {after:?} at {joint} s"
            );
            assert!(
                (before.velocity - after.velocity).abs() < 1e-15,
                "{before:?} and {after:?} at {joint} s"
            );
            joints += 1;
        }
        // The mean frequency over the ramp is ln(0.05/0.03)/0.02 Hz.
        assert!((f64::from(joints) - 2.0 * 25.54).abs() < 2.0, "{joints}");
    }

    #[test]
    fn the_first_passage_is_where_the_driven_end_first_gets_that_far() {
        let drive = |amplitude: f64, period: f64| {
            Drive::new(&Parameters {
                modulation_amplitude: amplitude,
                modulation_period: Some(period),
                ..Parameters::default()
            })
        };
        let drives = [
            drive(1e-7, 0.03),
            drive(1e-6, 0.034),
            drive(4.77e-7, 0.03),
            drive(3e-6, 0.002),
            ramped(),
        ];
        for mut drive in drives {
            let mut walked = drive;
            let mut step = 0_u32;
            let mut furthest = 0.0_f64;
            for number in 1..200 {
                let time = 0.0107 * f64::from(number);
                drive.advance_to(time);
                let passage = drive.first_passage(time);
                let level = drive.velocity * time;
                assert!(passage >= time - 1e-12 && passage <= time + drive.period);
                assert!(
                    (drive.motion(passage).displacement - level).abs() < 1e-15,
                    "{number}"
                );
                // Nowhere before.
                while f64::from(step) * 1e-5 < passage - 1e-9 {
                    let now = f64::from(step) * 1e-5;
                    walked.advance_to(now);
                    furthest = furthest.max(walked.motion(now).displacement);
                    step += 1;
                }
                assert!(
                    furthest < level + 1e-15,
                    "{number}: {furthest:e} before {level:e}"
                );
            }
        }
    }

    #[test]
    fn a_pulse_joins_smoothly_and_its_first_passage_is_where_a_dense_walk_finds_it() {
        for (amplitude, period, start, cycles) in [
            (1e-6, 0.03, 0.1, 1),
            (1e-7, 0.03, 0.1, 3),
            (3e-6, 0.002, 0.01, 5),
            (4.77e-7, 0.03, 0.0, 2),
            (1e-5, 0.5, 0.3, 1),
        ] {
            let mut drive = Drive::new(&Parameters {
                modulation_amplitude: amplitude,
                modulation_period: Some(period),
                pulse_start: Some(start),
                pulse_cycles: Some(cycles),
                ..Parameters::default()
            });
            let end = start + cycles as f64 * period;
            let mut walked = drive;
            for joint in [start, end] {
                let before = drive.motion(joint);
                assert_eq!(drive.cycle_end, joint);
                drive.next_cycle();
                let after = drive.motion(joint);
                let displacement = before.displacement;
                let allowed = 1e-19 + 1e-15 * displacement;
                assert!((displacement - drive.velocity * joint).abs() < allowed);
                assert!(
                    (after.displacement - displacement).abs() < allowed,
                    "{before:?} {after:?}"
                );
                assert!(
                    (before.velocity - after.velocity).abs() < 1e-11 * before.velocity.abs(),
                    "{before:?} {after:?}"
                );
            }
            assert_eq!(drive.cycle_end, f64::INFINITY);
            let spacing = 1e-4 * period;
            let mut number = 0_u32;
            let mut furthest = 0.0;
            for step in 1..500 {
                let time = (end + 3.0 * amplitude / drive.velocity) * f64::from(step) / 400.0;
                let level = drive.velocity * time;
                while furthest < level - 1e-18 {
                    number += 1;
                    let now = spacing * f64::from(number);
                    walked.advance_to(now);
                    furthest = walked.motion(now).displacement.max(furthest);
                }
                let passage = drive.first_passage(time);
                assert!(passage <= time);
                let seen = spacing * f64::from(number);
                assert!(
                    passage <= seen + 1e-12 && passage > seen - 1.01 * spacing,
                    "{amplitude} {period} {time}: {passage} {seen}"
                );
            }
        }
    }

    #[test]
    fn cycles_follow_the_ramp_to_its_turning_point_and_back() {
        let mut drive = ramped();
        assert_eq!((drive.period, drive.amplitude), (0.03, 1e-6));
        drive.advance_to(0.5);
        assert!(drive.cycle_start <= 0.5 && drive.cycle_end > 0.5);
        let up = drive.cycle_start;
        assert!(
            (drive.period - (0.03 + 0.02 * up)).abs() < 1e-15
                && (drive.amplitude - 1e-6 * (1.0 - up)).abs() < 1e-20
        );
        drive.advance_to(1.7);
        let down = 2.0 - drive.cycle_start;
        assert!((drive.period - (0.03 + 0.02 * down)).abs() < 1e-15);
        drive.advance_to(100.0);
        assert_eq!(
            (drive.period, drive.amplitude, drive.cycle_end),
            (0.03, 1e-6, f64::INFINITY)
        );
    }
}
