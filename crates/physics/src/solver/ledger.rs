//! The energy ledger: what the drive put in, against what is stored and what was lost.
//!
//! The work of the drive, ∫ F_S u' dt, equals the elastic and kinetic energy at the end (both are zero at the start)
//! and the losses in damping, ∫ mγ Σ v² dt, and in breaking contacts, f²/2k each. Work and breaks are read off the
//! segments and events that every observer sees, by Gauss-Legendre quadrature or in closed form; the rest comes from
//! the solver. A break found late, a contact attached stressed or a series cut short all show as a residual.
//!
//! A leap drops the free motion about the driven solution. Its energy is what damping would have taken, and is entered
//! as such; [`Ledger::left_out`] reports how much that was.

use super::harmonic::Harmonic;
use super::segment::{CubicStep, ForcePath, PolynomialPath, Segment};
use super::{Observer, SimulationError, Summary};
use crate::model::{Change, ContactEvent, Drive, Interface, Parameters};
use std::cell::Cell;
use std::f64::consts::PI;

/// Nodes beyond those that a polynomial needs: exact to 1e-13 for a modulation that turns by four radians in a segment.
const NODES_FOR_DRIVE: usize = 8;

/// Nodes in a step of the grid, in which a modulation turns by a third of a radian at most: exact to 1e-8 there.
const NODES_OF_STEP: usize = 3;

/// The energy balance of one simulation, from its start to its end. All in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ledger {
    pub work: f64,
    /// Elastic energy of chain, attached contacts and driving spring at the end.
    pub elastic: f64,
    /// Kinetic energy at the end.
    pub kinetic: f64,
    pub damping: f64,
    /// The part of the damping loss that leaps entered: the energy of the free motion that they dropped.
    pub left_out: f64,
    pub broken: f64,
}

impl Ledger {
    /// What does not balance, relative to the work of the drive. Zero for an exact solution; 0 if no work was done.
    pub fn residual(&self) -> f64 {
        let spent = self.elastic + self.kinetic + self.damping + self.broken;
        if self.work == 0.0 {
            0.0
        } else {
            (self.work - spent) / self.work
        }
    }
}

/// What the drive has put in since the start, and where it was lost. All in J; the rest is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spent {
    pub work: f64,
    pub damping: f64,
    pub broken: f64,
}

/// The entries that a solver makes: losses in damping as it goes, and the energies once, at the end. Cells, since the
/// meter reads them while it makes them.
#[derive(Clone, Debug)]
pub(super) struct Audit {
    /// Mass of a block in kg, and stiffness of the springs between blocks and of the driving spring in N/m.
    mass: f64,
    coupling: f64,
    stiffness: f64,
    pub quadrature: Quadrature,
    /// Without what leaps leave out.
    pub damping: Cell<f64>,
    pub left_out: Cell<f64>,
    pub elastic: Cell<f64>,
    pub kinetic: Cell<f64>,
}

impl Audit {
    fn new(parameters: &Parameters) -> Self {
        Self {
            mass: parameters.block_mass(),
            coupling: parameters.coupling_stiffness(),
            stiffness: parameters.drive_stiffness,
            quadrature: Quadrature::new(),
            damping: Cell::new(0.0),
            left_out: Cell::new(0.0),
            elastic: Cell::new(0.0),
            kinetic: Cell::new(0.0),
        }
    }

    /// Enters the energies at the end: of blocks at these displacements in m with these velocities in m/s, their
    /// contacts, and the driving spring, with its far end at `driven` m.
    pub fn record_final_energy(
        &self,
        interface: &Interface,
        x: &[f64],
        velocity: &[f64],
        driven: f64,
    ) {
        let stretched: f64 = x
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) * (pair[1] - pair[0]))
            .sum();
        let pulled = driven - x[0];
        let springs = self.coupling * stretched + self.stiffness * pulled * pulled;
        self.elastic
            .set(0.5 * springs + interface.elastic_energy(x));
        let squares: f64 = velocity.iter().map(|v| v * v).sum();
        self.kinetic.set(0.5 * self.mass * squares);
    }
}

/// An observer that keeps the work of the drive and the loss in breaks, and passes on all that it sees.
struct Meter<'a> {
    observer: &'a mut dyn Observer,
    audit: &'a Audit,
    drive: Drive,
    work: f64,
    broken: f64,
}

impl Meter<'_> {
    fn so_far(&self) -> Spent {
        Spent {
            work: self.work,
            damping: self.audit.damping.get() + self.audit.left_out.get(),
            broken: self.broken,
        }
    }
}

impl Observer for Meter<'_> {
    fn advance(&mut self, segment: &Segment<'_>) {
        // Rounding may put the ends of a segment beyond those of its cycle, but not its middle.
        self.drive
            .advance_to(segment.start + 0.5 * segment.duration);
        self.work += work(&self.drive, &self.audit.quadrature, segment);
        self.observer.advance(segment);
    }

    fn contact(&mut self, event: &ContactEvent) {
        if event.change == Change::Break {
            self.broken += 0.5 * event.threshold * event.threshold / event.stiffness;
            self.observer.spent(self.so_far());
        }
        self.observer.contact(event);
    }

    fn is_satisfied(&self) -> bool {
        self.observer.is_satisfied()
    }

    fn end(&mut self, time: f64, displacement: &[f64]) {
        self.observer.end(time, displacement);
    }
}

/// Runs a solver with an audit and returns the ledger.
pub(super) fn audited(
    parameters: &Parameters,
    observer: &mut dyn Observer,
    run: impl FnOnce(&mut dyn Observer, &Audit) -> Result<Summary, SimulationError>,
) -> Result<(Summary, Ledger), SimulationError> {
    let audit = Audit::new(parameters);
    let mut meter = Meter {
        observer,
        audit: &audit,
        drive: Drive::new(parameters),
        work: 0.0,
        broken: 0.0,
    };
    let summary = run(&mut meter, &audit)?;
    let spent = meter.so_far();
    let ledger = Ledger {
        work: spent.work,
        elastic: audit.elastic.get(),
        kinetic: audit.kinetic.get(),
        damping: spent.damping,
        left_out: audit.left_out.get(),
        broken: spent.broken,
    };
    Ok((summary, ledger))
}

/// Work of the drive along a segment, in J.
pub(super) fn work(drive: &Drive, quadrature: &Quadrature, segment: &Segment<'_>) -> f64 {
    if !drive.is_modulated() {
        return drive.velocity * segment.impulse();
    }
    match segment.path {
        ForcePath::Polynomial(PolynomialPath { coefficients, .. }) => {
            let nodes = quadrature.nodes(coefficients.len().div_ceil(2) + NODES_FOR_DRIVE);
            let power = |s: f64| {
                let elapsed = s * segment.duration;
                segment.force_after(elapsed) * drive.motion(segment.start + elapsed).velocity
            };
            segment.duration
                * nodes
                    .iter()
                    .map(|node| node.weight * power(node.at))
                    .sum::<f64>()
        }
        ForcePath::Harmonic(harmonic) => {
            let Harmonic {
                start,
                rate,
                amplitude,
                phase,
                angular_frequency,
            } = harmonic;
            // ∫ (start + rate τ + amplitude cos(ωτ + phase)) (-Δω sin(ωτ + drive_phase)) dτ, term by term.
            let drive_phase = drive.phase(segment.start);
            let angle = harmonic.turn(segment.duration);
            let (sine, cosine) = libm::sincos(angle + drive_phase);
            let (sine_before, cosine_before) = libm::sincos(drive_phase);
            let ramp = (start + rate * segment.duration) * cosine
                - start * cosine_before
                - rate / angular_frequency * (sine - sine_before);
            let beat = 0.25
                * (libm::cos(2.0 * angle + phase + drive_phase) - libm::cos(phase + drive_phase));
            let drift = 0.5 * angular_frequency * segment.duration * libm::sin(drive_phase - phase);
            drive.velocity * segment.impulse()
                + drive.amplitude * (ramp + amplitude * (beat - drift))
        }
        ForcePath::Grid(path) => {
            let end = path.first + segment.duration / path.spacing;
            let nodes = quadrature.nodes(NODES_OF_STEP);
            let of_step = |(begin, step): (usize, &CubicStep)| {
                let begin = begin as f64;
                let from = (path.first - begin).max(0.0);
                let part = (end - begin).min(1.0) - from;
                let power = |at: f64| {
                    let s = from + part * at;
                    let elapsed = (begin + s - path.first) * path.spacing;
                    step.value(s) * drive.motion(segment.start + elapsed).velocity
                };
                let mean = nodes.iter().map(|node| node.weight * power(node.at));
                part * mean.sum::<f64>()
            };
            path.spacing * path.steps.iter().enumerate().map(of_step).sum::<f64>()
        }
    }
}

/// Largest number of nodes of a rule.
const MAX_NODES: usize = 33;
/// Newton's method doubles the correct digits of a node each time, and starts with two.
const NEWTON_STEPS: usize = 6;

/// A node of a rule in (0, 1), and its weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub at: f64,
    pub weight: f64,
}

/// Gauss-Legendre rules on [0, 1] of 1 to [`MAX_NODES`] nodes; n nodes integrate polynomials of degree 2n - 1 exactly.
#[derive(Clone, Debug)]
pub(super) struct Quadrature {
    rules: Vec<Vec<Node>>,
}

impl Quadrature {
    pub fn new() -> Self {
        Self {
            rules: (1..=MAX_NODES).map(rule).collect(),
        }
    }

    /// The rule with `count` nodes, limited to 1 to [`MAX_NODES`]; weights sum to 1.
    pub fn nodes(&self, count: usize) -> &[Node] {
        &self.rules[count.clamp(1, MAX_NODES) - 1]
    }
}

/// Roots of the Legendre polynomial by Newton's method, with the weights 2/((1 - z²) P'(z)²), moved to [0, 1].
fn rule(count: usize) -> Vec<Node> {
    let order = count as f64;
    let node = |i: usize| {
        let mut z = libm::cos(PI * (i as f64 + 0.75) / (order + 0.5));
        let mut slope = 1.0;
        for _ in 0..NEWTON_STEPS {
            let mut before = 1.0;
            let mut value = z;
            for k in 2..=count {
                let k = k as f64;
                (before, value) = (
                    value,
                    ((2.0 * k - 1.0) * z * value - (k - 1.0) * before) / k,
                );
            }
            slope = order * (before - z * value) / (1.0 - z * z);
            z -= value / slope;
        }
        Node {
            at: 0.5 * (1.0 - z),
            weight: 1.0 / ((1.0 - z * z) * slope * slope),
        }
    };
    (0..count).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A modulated drive, and the rule to check the closed form against.
    fn modulated() -> (Drive, Quadrature) {
        let parameters = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(1.0 / 58.0),
            ..Parameters::default()
        };
        (Drive::new(&parameters), Quadrature::new())
    }

    #[test]
    fn work_over_a_leap_is_that_of_many_short_quadratures() {
        let (drive, quadrature) = modulated();
        let angular_frequency = drive.angular_frequency;
        let path = ForcePath::Harmonic(Harmonic {
            start: 120.0,
            rate: 3e3,
            amplitude: 38.0,
            phase: 0.7,
            angular_frequency,
        });
        let segment = Segment {
            start: 0.3,
            duration: 0.07,
            path,
        };
        let pieces = 200;
        let width = segment.duration / f64::from(pieces);
        let power = |elapsed: f64| {
            segment.force_after(elapsed) * drive.motion(segment.start + elapsed).velocity
        };
        let numeric: f64 = (0..pieces)
            .flat_map(|piece| {
                quadrature
                    .nodes(8)
                    .iter()
                    .map(move |node| (f64::from(piece) + node.at, node.weight))
            })
            .map(|(s, weight)| weight * width * power(s * width))
            .sum();
        let closed = work(&drive, &quadrature, &segment);
        assert!(
            (closed - numeric).abs() < 1e-12 * numeric.abs(),
            "{closed} against {numeric}"
        );
    }

    #[test]
    fn work_along_a_polynomial_is_that_of_its_halves() {
        let (drive, quadrature) = modulated();
        let coefficients = [100.0, 20.0, -7.0, 3.0];
        let whole = work(
            &drive,
            &quadrature,
            &Segment::polynomial(0.2, 0.01, &coefficients),
        );
        let halved = [50.0 * 2.0, 20.0 / 2.0, -7.0 / 4.0, 3.0 / 8.0];
        let moved = [
            100.0 + 10.0 - 1.75 + 0.375,
            10.0 - 3.5 + 1.125,
            -1.75 + 1.125,
            0.375,
        ];
        let half = |start: f64, coefficients: &[f64]| {
            work(
                &drive,
                &quadrature,
                &Segment::polynomial(start, 0.005, coefficients),
            )
        };
        let parts = half(0.2, &halved) + half(0.205, &moved);
        assert!(
            (whole - parts).abs() < 1e-13 * whole.abs(),
            "{whole} against {parts}"
        );
    }

    #[test]
    fn a_rule_is_exact_up_to_twice_its_nodes_less_one() {
        let quadrature = Quadrature::new();
        for count in 1..=MAX_NODES {
            for degree in 0..2 * count {
                let terms = quadrature
                    .nodes(count)
                    .iter()
                    .map(|node| node.weight * node.at.powi(i32::try_from(degree).unwrap()));
                let error = terms.sum::<f64>() * (degree + 1) as f64 - 1.0;
                // Rounding, times the degree by which the integral is scaled.
                assert!(
                    error.abs() < 1e-15 * (degree + 4) as f64,
                    "{count} nodes, degree {degree}: {error:e}"
                );
            }
        }
    }
}
