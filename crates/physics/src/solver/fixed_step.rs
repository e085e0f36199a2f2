//! Fixed step: explicit velocity-Verlet with damping, contacts tested after each step.
//!
//! Source: the textbook scheme (Verlet 1967; Swope et al. 1982), the damping taken half before and half after the
//! force, implicitly after, so that its limit of stability dt < 2/ω_max holds for any damping rate. Contract:
//! first-order errors in the times of events, second-order between them; O(N) work per step through the block sums. It
//! is kept plain: the baseline of speed, and a check of the other solver. For a fair comparison its loops are compiled
//! for the features of the processor, chosen at run time, as those of the other solver are; nothing is fused
//! or reassociated, so all give the same bits.

use super::ledger::Audit;
use super::segment::{ForceAt, ForcePath, PolynomialPath, Segment};
use super::{Limits, Observer, SimulationError, SolverKey, Summary};
use crate::model::equation::largest_frequency;
use crate::model::{Change, ContactChange, ContactEvent, Drive, Interface, Parameters};
use pulp::{Simd, WithSimd};
use std::sync::atomic::Ordering;

pub(super) const SETTINGS: &[SolverKey] = &[SolverKey::TimeStep];

/// Steps between two checks of the interrupt flag and of whether the state is finite.
const STEPS_PER_CHECK: u64 = 4096;

/// Displacements, velocities and accelerations of the blocks, in m, m/s, m/s².
struct Motion {
    displacement: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Motion {
    /// Accelerations without damping, from the chain, the contacts and the shear force at the trailing edge, in N.
    #[inline(always)]
    fn accelerate(&mut self, interface: &Interface, shear_force: f64, coupling: f64, mass: f64) {
        let x = &self.displacement[..];
        let blocks = x.len();
        let stiffness = &interface.block_stiffness[..blocks];
        let pull = &interface.block_pull[..blocks];
        let a = &mut self.acceleration[..blocks];
        let inverse_mass = 1.0 / mass;
        for j in 1..blocks.saturating_sub(1) {
            let chain = coupling * ((x[j + 1] - x[j]) - (x[j] - x[j - 1]));
            a[j] = (chain + pull[j] - stiffness[j] * x[j]) * inverse_mass;
        }
        let last = blocks - 1;
        a[0] = pull[0] - stiffness[0] * x[0] + shear_force;
        if last > 0 {
            a[0] += coupling * (x[1] - x[0]);
            let chain = coupling * (x[last - 1] - x[last]);
            a[last] = (chain + pull[last] - stiffness[last] * x[last]) * inverse_mass;
        }
        a[0] *= inverse_mass;
    }

    /// Takes velocities to the middle of a step and displacements to its end.
    #[inline(always)]
    fn advance(&mut self, time_step: f64, damping: f64) {
        let half = 0.5 * time_step;
        let motion = self.displacement.iter_mut().zip(&mut self.velocity);
        for ((x, v), a) in motion.zip(&self.acceleration) {
            *v = *v * damping + half * a;
            *x += time_step * *v;
        }
    }

    /// Checks at a time in s that the state is finite.
    fn check(&self, time: f64) -> Result<(), SimulationError> {
        if self.displacement.iter().sum::<f64>().is_finite() {
            Ok(())
        } else {
            Err(SimulationError::NotFinite { time })
        }
    }

    /// Whether any block is at or past a break position.
    #[inline(always)]
    #[expect(
        clippy::needless_bitwise_bool,
        reason = "without branches the loop runs in vectors"
    )]
    fn reaches_a_break(&self, interface: &Interface) -> bool {
        let blocks = self.displacement.len();
        let x = &self.displacement[..blocks];
        let upper = &interface.block_upper[..blocks];
        let lower = &interface.block_lower[..blocks];
        (0..blocks).fold(false, |any, j| {
            any | (x[j] >= upper[j]) | (x[j] <= lower[j])
        })
    }
}

/// Checks that a time step, in s, is stable.
pub(super) fn check(time_step: f64, parameters: &Parameters) -> Result<(), SimulationError> {
    let limit = 2.0 / largest_frequency(parameters);
    if time_step > 0.0 && time_step < limit {
        Ok(())
    } else {
        Err(SimulationError::BadSetting {
            setting: format!("dt = {time_step:e} s"),
            allowed: format!(
                "below the stability limit 2/omega_max = {limit:.4e} s of these parameters"
            ),
        })
    }
}

/// A run with a stable time step, in s; see [`super::simulate`]. The method of a struct is compiled for the features of
/// the processor; a closure is not, and takes 1.2 times as long.
pub(super) struct FixedStepRun<'a> {
    pub parameters: &'a Parameters,
    pub time_step: f64,
    pub limits: Limits<'a>,
    pub observer: &'a mut dyn Observer,
    pub audit: Option<&'a Audit>,
}

impl WithSimd for FixedStepRun<'_> {
    type Output = Result<Summary, SimulationError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self {
            parameters,
            time_step,
            limits,
            observer,
            audit,
        } = self;
        let blocks = parameters.blocks;
        let mass = parameters.block_mass();
        let coupling = parameters.coupling_stiffness();
        let mut drive = Drive::new(parameters);
        let mut interface = Interface::new(parameters);
        let mut motion = Motion {
            displacement: vec![0.0; blocks],
            velocity: vec![0.0; blocks],
            acceleration: vec![0.0; blocks],
        };
        let mut summary = Summary::default();
        let half = 0.5 * time_step;
        let damp_before = 1.0 - half * parameters.damping_rate;
        let damp_after = 1.0 / (1.0 + half * parameters.damping_rate);

        for event in interface.initial_attachments() {
            observer.contact(&event);
        }
        let mut force = 0.0;
        let mut force_rate = drive.stiffness * drive.velocity;
        motion.accelerate(&interface, force, coupling, mass);
        loop {
            summary.satisfied = observer.is_satisfied();
            let start = summary.steps as f64 * time_step;
            if summary.satisfied || start >= limits.end_time {
                break;
            }
            summary.steps += 1;
            let time = summary.steps as f64 * time_step;
            motion.advance(time_step, damp_before);
            if let Some(audit) = audit {
                // These velocities are those of the middle of the step.
                let squares = motion.velocity.iter().map(|v| v * v).sum::<f64>();
                let loss = mass * parameters.damping_rate * time_step * squares;
                audit.damping.update(|sum| sum + loss);
            }
            drive.advance_to(time);
            let driven = drive.motion(time);
            let next_force = drive.stiffness * (driven.displacement - motion.displacement[0]);
            motion.accelerate(&interface, next_force, coupling, mass);
            for (v, a) in motion.velocity.iter_mut().zip(&motion.acceleration) {
                *v = (*v + half * a) * damp_after;
            }
            let next_rate = drive.stiffness * (driven.velocity - motion.velocity[0]);
            let forces = [force, next_force];
            report_force(observer, start, time_step, forces, [force_rate, next_rate]);
            force = next_force;
            force_rate = next_rate;
            summary.end_time = time;

            if interface.next_reattachment() <= time || motion.reaches_a_break(&interface) {
                change_contacts(
                    &mut interface,
                    &motion.displacement,
                    time,
                    &mut summary,
                    observer,
                );
                if summary.breaks + summary.reattachments > limits.events {
                    return Err(SimulationError::EventBudget {
                        time,
                        events: limits.events,
                    });
                }
                // The next step starts from the new contacts.
                motion.accelerate(&interface, force, coupling, mass);
            }
            if summary.steps.is_multiple_of(STEPS_PER_CHECK) {
                motion.check(time)?;
                if limits
                    .interrupt
                    .is_some_and(|flag| flag.load(Ordering::Relaxed))
                {
                    return Err(SimulationError::Interrupted { time });
                }
            }
        }
        motion.check(summary.end_time)?;
        if let Some(audit) = audit {
            let driven = drive.motion(summary.end_time).displacement;
            audit.record_final_energy(&interface, &motion.displacement, &motion.velocity, driven);
        }
        observer.end(summary.end_time, &motion.displacement);
        Ok(summary)
    }
}

/// Reattaches what is due and breaks what is reached, at the end of a step.
#[inline(always)]
fn change_contacts(
    interface: &mut Interface,
    displacement: &[f64],
    time: f64,
    summary: &mut Summary,
    observer: &mut dyn Observer,
) {
    let mean_displacement = displacement.iter().sum::<f64>() / displacement.len() as f64;
    while let Some(due) = interface.next_reattachment_by(time) {
        let change = interface.reattach_next(displacement[due.block()]);
        let count = interface.count(Change::Attach, change.time);
        summary.reattachments += 1;
        let change = ContactChange { time, ..change };
        observer.contact(&ContactEvent::new(change, count, 0.0));
    }
    for (block, &x) in displacement.iter().enumerate() {
        if x >= interface.block_upper[block] || x <= interface.block_lower[block] {
            interface.break_reached(block, time, x, |change, count| {
                summary.breaks += 1;
                observer.contact(&ContactEvent::new(change, count, mean_displacement));
            });
        }
    }
}

/// Reports the shear force over a step that begins at `start` s, from its values in N and rates in N/s at both ends.
#[inline(always)]
fn report_force(
    observer: &mut dyn Observer,
    start: f64,
    time_step: f64,
    [force, next_force]: [f64; 2],
    rates: [f64; 2],
) {
    let [slope, next_slope] = rates.map(|rate| time_step * rate);
    let rise = next_force - force;
    let square = 3.0 * rise - 2.0 * slope - next_slope;
    let cube = slope + next_slope - 2.0 * rise;
    let coefficients = [force, slope, square, cube];
    let whole = force + 0.5 * slope + square / 3.0 + 0.25 * cube;
    let ends = [(force, 0.0), (next_force, whole)];
    let path = PolynomialPath {
        coefficients: &coefficients,
        curvature_bound: 2.0 * square.abs() + 6.0 * cube.abs(),
        first: 0.0,
        scale: time_step,
        ends: ends.map(|(force, integral)| ForceAt { force, integral }),
    };
    observer.advance(&Segment {
        start,
        duration: time_step,
        path: ForcePath::Polynomial(path),
    });
}

#[cfg(test)]
mod tests {
    use super::super::ledger;
    use super::*;
    use pulp::Arch;
    #[cfg(target_arch = "x86_64")]
    use pulp::x86::{V3, V4};

    /// All that is reported to an observer.
    #[derive(Debug, Default, PartialEq)]
    struct Reported {
        forces: Vec<[f64; 2]>,
        events: Vec<ContactEvent>,
        displacement: Vec<f64>,
    }

    impl Observer for Reported {
        fn advance(&mut self, segment: &Segment<'_>) {
            self.forces.push([segment.end_force(), segment.impulse()]);
        }

        fn contact(&mut self, event: &ContactEvent) {
            self.events.push(*event);
        }

        fn end(&mut self, _: f64, displacement: &[f64]) {
            self.displacement = displacement.to_vec();
        }
    }

    /// The features for which the loops can be compiled and that this processor has.
    fn available() -> Vec<Arch> {
        #[cfg(target_arch = "x86_64")]
        let more = [V3::try_new().map(Arch::V3), V4::try_new().map(Arch::V4)]
            .into_iter()
            .flatten();
        #[cfg(not(target_arch = "x86_64"))]
        let more = [Arch::new()];
        [Arch::Scalar].into_iter().chain(more).collect()
    }

    #[test]
    fn every_set_of_processor_features_gives_the_same_bits() {
        // The second has a block beside the last whole register, and a modulation that breaks contacts in reverse.
        let modulated = Parameters {
            blocks: 13,
            modulation_amplitude: 1e-4,
            modulation_period: Some(0.02),
            seed: 5,
            ..Parameters::default()
        };
        for parameters in [Parameters::default(), modulated] {
            let runs = available().into_iter().map(|features| {
                let limits = Limits {
                    end_time: 0.25,
                    events: u64::MAX,
                    interrupt: None,
                };
                let mut reported = Reported::default();
                let audited = ledger::audited(&parameters, &mut reported, |observer, audit| {
                    features.dispatch(FixedStepRun {
                        parameters: &parameters,
                        time_step: 2e-6,
                        limits,
                        observer,
                        audit: Some(audit),
                    })
                });
                (format!("{features:?}"), (reported, audited.unwrap()))
            });
            let runs: Vec<_> = runs.collect();
            assert!(
                runs[0].1.0.events.len() > 2 * parameters.blocks * parameters.contacts_per_block,
                "no slip to compare"
            );
            for (name, run) in &runs[1..] {
                assert!(*run == runs[0].1, "{name} differs from {}", runs[0].0);
            }
        }
    }
}
