//! Event-driven: from contact event to contact event, in closed form where nothing happens.
//!
//! Between events the model is linear with constant coefficients. While it moves, a Taylor series resolves it and locates
//! the first crossing of a break position rigorously ([`taylor`], [`crossing`]); while it is quiet, a leap follows the
//! driven solution to the next event ([`leap`]). Contract: events in the right order, and errors of displacement of the
//! order of `tolerance` · f_s/k.
//!
//! Displacements and times are kept in a moving frame, so that neither loses digits in long runs.

mod audit;
mod chain;
mod crossing;
mod glide;
mod kernels;
mod lanes;
mod leap;
mod step;
mod taylor;
mod vector;

use self::chain::Chain;
use self::kernels::Kernels;
use self::lanes::Layout;
use self::leap::{Attempt, Bounds, DriveNow, Leap};
use self::taylor::{Series, State};
use super::ledger::Audit;
use super::segment::Segment;
use super::{Limits, Observer, SimulationError, Summary};
use crate::model::equation::largest_frequency;
use crate::model::{ContactEvent, Drive, Interface, Parameters};
use std::sync::atomic::Ordering;

/// Longest step, in units of the shortest time scale: the cheapest per unit of time, and still far from where the series
/// would lose digits.
const LONGEST_STEP: f64 = 4.0;
/// Steps are halved at most so often where events crowd; further only if a series does not converge.
const MOST_HALVINGS: usize = 7;
/// A leap is tried only if no reattachment is due within so many longest steps.
const WORTHWHILE_LEAP: f64 = 6.0;
/// Part of the tolerance that one step's truncation may take at most.
const TRUNCATION_SHARE: f64 = 0.1;
/// Multiple of the tolerance that the truncations of all steps may add up to within the slider's memory.
const REMEMBERED_SHARE: f64 = 4.0;
/// Steps that an undamped slider is taken to remember.
const MOST_REMEMBERED: f64 = 1e6;
/// Local time at which the frame moves, in s.
const FRAME_SPAN: f64 = 0.0625;
/// The frame moves by multiples of these, so that its sums are exact: 2^-20 s and 2^-40 m.
const TIME_QUANTUM: f64 = 1.0 / 1_048_576.0;
const DISPLACEMENT_QUANTUM: f64 = 1.0 / 1_099_511_627_776.0;
/// Steps between two looks at the interrupt flag.
const STEPS_PER_CHECK: u64 = 1024;

/// Runs the method with this tolerance, relative to the contact reach; see [`super::simulate`].
pub(super) fn run(
    parameters: &Parameters,
    tolerance: f64,
    limits: Limits<'_>,
    observer: &mut dyn Observer,
    audit: Option<&mut Audit>,
) -> Result<Summary, SimulationError> {
    let rows = Layout::new(parameters.blocks).rows;
    let kernels = Kernels::available(rows).pop().unwrap_or_else(|| unreachable!("there is always the baseline"));
    let run = Run::new(parameters, tolerance, limits, kernels);
    Run { audit, ..run }.finished(observer)
}

/// Part of the tolerance that one step's truncation may take, so that the sum of what the slider remembers stays bounded.
///
/// An error decays at the rate γ/2 if the motion of the attached slider oscillates, else at that of its slowest mode: with
/// very little and with very much damping, a million steps may add up, mostly with one sign.
fn truncation_share(parameters: &Parameters, longest_step: f64) -> f64 {
    let half = 0.5 * parameters.damping_rate;
    // The contacts alone bound the lowest squared frequency of the attached slider.
    let squared = parameters.block_contact_stiffness() / parameters.block_mass();
    let overdamped = (half * half - squared).max(0.0);
    let rate = if overdamped > 0.0 { squared / (half + overdamped.sqrt()) } else { half };
    let remembered = (1.0 / (rate * longest_step)).min(MOST_REMEMBERED);
    TRUNCATION_SHARE.min(REMEMBERED_SHARE / remembered)
}

/// One simulation in progress. Times and displacements are local to the frame but where said otherwise.
struct Run<'a> {
    limits: Limits<'a>,
    drive: Drive,
    mass: f64,
    kernels: Kernels,
    interface: Interface,
    chain: Chain,
    state: State,
    series: Series,
    leap: Leap,
    candidates: Vec<(usize, usize)>,
    /// Breaks to come in the step: where in it, and the block.
    breaks: Vec<(f64, usize)>,
    /// Blocks whose series an event has changed.
    amended: Vec<usize>,
    /// How long the step could go on after the last break and after the last reattachment, in s.
    break_window: f64,
    attach_window: f64,
    /// Coefficients of F_S over the step, in N, and room for those of a block.
    force: Vec<f64>,
    coefficients: Vec<f64>,
    /// Bound on the second derivative of F_S by s, in N.
    force_bend: f64,
    /// Order from which on terms are checked, by the number of halvings.
    least_orders: [usize; MOST_HALVINGS + 1],
    /// Largest error left in one step and by one leap, in m.
    truncation: f64,
    left_out: f64,
    /// Absolute time and displacement of the frame's origin, in s and m.
    epoch: f64,
    origin: f64,
    time: f64,
    /// Displacement of the drive's ramp at the epoch.
    ramp_at_epoch: f64,
    /// Δ cos θ and -Δ sin θ at the phase θ of now.
    swing: [f64; 2],
    longest_step: f64,
    typical_advance: f64,
    next_leap: f64,
    /// Largest shear force at the last break and at the ends of steps since, in N.
    passed_force: f64,
    summary: Summary,
    audit: Option<&'a mut Audit>,
}

impl<'a> Run<'a> {
    fn new(parameters: &Parameters, tolerance: f64, limits: Limits<'a>, kernels: Kernels) -> Self {
        let drive = Drive::new(parameters);
        let layout = Layout::new(parameters.blocks);
        let interface = Interface::new(parameters);
        let mass = parameters.block_mass();
        let fastest =
            largest_frequency(parameters).max(parameters.largest_modulation_frequency()).max(parameters.damping_rate);
        let longest_step = LONGEST_STEP / fastest;
        let mut run = Self {
            limits,
            drive,
            mass,
            kernels,
            chain: Chain::new(parameters, layout),
            interface,
            state: State { displacement: layout.filled(0.0), velocity: layout.filled(0.0) },
            series: Series::new(layout),
            leap: Leap::new(layout),
            candidates: Vec::new(),
            breaks: Vec::new(),
            amended: Vec::new(),
            break_window: 0.0,
            attach_window: 0.0,
            force: Vec::new(),
            coefficients: Vec::new(),
            force_bend: 0.0,
            least_orders: [0; MOST_HALVINGS + 1],
            truncation: truncation_share(parameters, longest_step) * tolerance * parameters.contact_reach(),
            left_out: tolerance * parameters.contact_reach(),
            epoch: 0.0,
            origin: 0.0,
            time: 0.0,
            // The cosine is counted from its own zero, so the ramp starts Δ below.
            ramp_at_epoch: -drive.amplitude,
            swing: [drive.amplitude, 0.0],
            longest_step,
            typical_advance: longest_step,
            next_leap: 0.0,
            passed_force: 0.0,
            summary: Summary::default(),
            audit: None,
        };
        for block in 0..parameters.blocks {
            run.chain.update(block, &run.interface);
        }
        run
    }

    /// Apart from where the run is owned, and what is rare apart from here: the loop is short, and has nothing to drop if
    /// an observer panics.
    #[inline(never)]
    fn finished(&mut self, observer: &mut dyn Observer) -> Result<Summary, SimulationError> {
        for event in self.interface.initial_attachments() {
            observer.contact(&event);
        }
        while !observer.is_satisfied() {
            let until_end = self.limits.end_time - self.epoch - self.time;
            if until_end <= 4.0 * f64::EPSILON * (self.epoch + self.time) {
                return self.ended(false, observer);
            }
            let mut until_turn = self.drive.cycle_end - self.epoch - self.time;
            if until_turn <= 4.0 * f64::EPSILON * (self.epoch + self.time) {
                self.next_cycle();
                until_turn = self.drive.cycle_end - self.epoch - self.time;
            }
            let until_change = until_turn.min(until_end);
            let until_attach = self.interface.next_reattachment() - self.time;
            let horizon = until_attach.min(until_change);
            let leapt = horizon > WORTHWHILE_LEAP * self.longest_step
                && self.time >= self.next_leap
                && self.try_leap(horizon, until_turn, observer);
            if !leapt {
                self.step(until_change, observer)?;
            }
            if self.summary.breaks + self.summary.reattachments > self.limits.events {
                let (time, events) = (self.epoch + self.time, self.limits.events);
                return Err(SimulationError::EventBudget { time, events });
            }
            // What is not finite anywhere comes to the driven edge, if the run lasts.
            if !self.state.displacement[0][0].is_finite() {
                return Err(SimulationError::NotFinite { time: self.epoch + self.time });
            }
            if self.time > FRAME_SPAN {
                self.move_frame();
            }
            let is_check = self.summary.steps.is_multiple_of(STEPS_PER_CHECK);
            if is_check && self.limits.interrupt.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
                return Err(SimulationError::Interrupted { time: self.epoch + self.time });
            }
        }
        self.ended(true, observer)
    }

    #[inline(never)]
    fn ended(&mut self, satisfied: bool, observer: &mut dyn Observer) -> Result<Summary, SimulationError> {
        self.summary.end_time = self.epoch + self.time;
        let blocks = 0..self.chain.layout.blocks;
        let displacement: Vec<f64> =
            blocks.map(|block| self.origin + self.chain.at(&self.state.displacement, block)).collect();
        if !displacement.iter().sum::<f64>().is_finite() {
            return Err(SimulationError::NotFinite { time: self.summary.end_time });
        }
        observer.end(self.summary.end_time, &displacement);
        self.summary.satisfied = satisfied;
        if let Some(audit) = self.audit.take() {
            let driven =
                self.ramp_at_epoch + self.drive.velocity * self.time + self.drive.amplitude * libm::cos(self.phase());
            audit.settle(&self.chain, &self.interface, &self.state, self.drive.stiffness, driven);
        }
        Ok(self.summary)
    }

    fn phase(&self) -> f64 {
        self.drive.phase(self.epoch) + self.drive.angular_frequency * self.time
    }

    /// Takes up the next cycle of a ramped modulation, at the maximum where the two join.
    fn next_cycle(&mut self) {
        let before = self.drive.amplitude;
        self.drive.next_cycle();
        self.ramp_at_epoch += before - self.drive.amplitude;
        self.swing = [self.drive.amplitude, 0.0];
    }

    /// Tries a leap of at most `horizon` s, in a cycle of the modulation that lasts for another `until_turn` s; false if it is
    /// not yet allowed.
    #[inline(never)]
    fn try_leap(&mut self, horizon: f64, until_turn: f64, observer: &mut dyn Observer) -> bool {
        let drive = DriveNow {
            stiffness: self.drive.stiffness,
            mass: self.mass,
            ramp: self.ramp_at_epoch + self.drive.velocity * self.time,
            velocity: self.drive.velocity,
            amplitude: self.drive.amplitude,
            phase: self.phase(),
            angular_frequency: self.drive.angular_frequency,
        };
        let start = self.epoch + self.time;
        let bounds = Bounds { horizon, until_turn, error: self.left_out, passed: self.passed_force };
        let mut shown = None;
        let emit = |segment: Segment<'static>| {
            let segment = Segment { start, ..segment };
            shown = Some(segment);
            observer.advance(&segment);
        };
        let before = self.audit.is_some().then(|| self.state.clone());
        let (state, audit) = (&mut self.state, self.audit.as_deref_mut());
        let attempt = self.leap.attempt(&self.chain, self.kernels, &drive, bounds, state, emit, audit);
        match attempt {
            Attempt::Wait { seconds } => {
                self.next_leap = self.time + seconds.max(self.longest_step);
                false
            }
            Attempt::Leapt { elapsed, reached, glided } => {
                if let (Some(before), Some(shown)) = (before.filter(|_| glided), shown) {
                    self.audit_glide(before, &shown);
                }
                self.summary.steps += 1;
                self.summary.leaps += 1;
                self.next_leap = 0.0;
                self.arrive(elapsed, elapsed == horizon);
                match reached {
                    Some(block) => {
                        let x = self.chain.at(&self.state.displacement, block);
                        self.break_block(block, x, self.shear_force(), observer);
                    }
                    None => self.reattach_due(observer),
                }
                true
            }
        }
    }

    /// Moves time on, exactly to the next reattachment if that is what came.
    fn arrive(&mut self, elapsed: f64, at_horizon: bool) {
        let due = self.interface.next_reattachment();
        let reached = self.time + elapsed;
        let is_due = at_horizon && (due - reached).abs() <= 4.0 * f64::EPSILON * reached;
        self.set_time(if is_due { due } else { reached });
    }

    fn set_time(&mut self, time: f64) {
        self.time = time;
        if self.drive.is_modulated() {
            let (sine, cosine) = libm::sincos(self.phase());
            self.swing = [self.drive.amplitude * cosine, -self.drive.amplitude * sine];
        }
    }

    /// Breaks what is reached at a block that was found at a break position, at displacement `x` m and shear force `force` N.
    fn break_block(&mut self, block: usize, x: f64, force: f64, observer: &mut dyn Observer) {
        let (row, lane) = self.chain.layout.slot(block);
        let (upper, lower) = (self.chain.upper[row][lane], self.chain.lower[row][lane]);
        self.passed_force = force;
        // Rounding may leave the block a hair before the position that it was found to reach.
        let reached = if upper - x <= x - lower { x.max(upper) } else { x.min(lower) };
        let (epoch, origin, summary) = (self.epoch, self.origin, &mut self.summary);
        self.interface.break_reached(block, self.time, reached, |event| {
            summary.breaks += 1;
            observer.contact(&absolute(event, epoch, origin));
        });
        self.chain.update(block, &self.interface);
    }

    /// F_S now, in N.
    fn shear_force(&self) -> f64 {
        let ramp = self.ramp_at_epoch + self.drive.velocity * self.time;
        self.drive.stiffness * (ramp + self.swing[0] - self.state.displacement[0][0])
    }

    /// Reattaches what is due now.
    fn reattach_due(&mut self, observer: &mut dyn Observer) {
        while self.interface.next_reattachment() <= self.time
            && let Some(block) = self.interface.next_reattachment_block()
        {
            self.attach_next(self.chain.at(&self.state.displacement, block), observer);
        }
    }

    /// Attaches the contact that is due next, at displacement `x` m of its block.
    fn attach_next(&mut self, x: f64, observer: &mut dyn Observer) {
        let event = self.interface.reattach_next(x);
        self.summary.reattachments += 1;
        observer.contact(&absolute(event, self.epoch, self.origin));
        self.chain.update(event.block, &self.interface);
    }

    /// Moves the frame to where the slider and the clock are.
    #[inline(never)]
    fn move_frame(&mut self) {
        let time = (self.time / TIME_QUANTUM).floor() * TIME_QUANTUM;
        let displacement = (self.state.displacement[0][0] / DISPLACEMENT_QUANTUM).floor() * DISPLACEMENT_QUANTUM;
        self.interface.shift_time(time);
        self.interface.shift(displacement);
        for block in 0..self.chain.layout.blocks {
            let (row, lane) = self.chain.layout.slot(block);
            self.state.displacement[row][lane] -= displacement;
            self.chain.update(block, &self.interface);
        }
        self.ramp_at_epoch += self.drive.velocity * time - displacement;
        self.next_leap -= time;
        self.time -= time;
        self.epoch += time;
        self.origin += displacement;
    }
}

/// An event with time and displacement counted from the start.
fn absolute(event: ContactEvent, epoch: f64, origin: f64) -> ContactEvent {
    ContactEvent { time: epoch + event.time, displacement: origin + event.displacement, ..event }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Change;
    use crate::observe::{ContactLog, Recording, SlipObserver};

    #[test]
    fn every_set_of_processor_features_gives_the_same_bits() {
        let plain = Parameters::default();
        let modulated = Parameters {
            blocks: 13,
            modulation_amplitude: 1e-6,
            modulation_period: Some(1.0 / 58.0),
            seed: 5,
            ..Parameters::default()
        };
        for parameters in [plain, modulated] {
            let logs: Vec<(&str, Vec<ContactEvent>)> = Kernels::available(Layout::new(parameters.blocks).rows)
                .into_iter()
                .map(|kernels| {
                    let limits = Limits { end_time: 0.25, events: u64::MAX, interrupt: None };
                    let mut log = ContactLog::default();
                    Run::new(&parameters, 1e-6, limits, kernels).finished(&mut log).unwrap();
                    (kernels.name, log.events)
                })
                .collect();
            assert!(logs[0].1.len() > 2 * parameters.blocks * parameters.contacts_per_block, "no slip to compare");
            for (name, log) in &logs[1..] {
                assert_eq!(*log, logs[0].1, "{name} differs from {}", logs[0].0);
            }
        }
    }

    #[test]
    fn events_that_share_a_step_come_in_the_order_and_at_the_times_of_those_that_do_not() {
        let plain = Parameters::default();
        let modulated =
            Parameters { modulation_amplitude: 1e-6, modulation_period: Some(1.0 / 58.0), ..Parameters::default() };
        for parameters in [plain, modulated] {
            let log = |tolerance: f64| {
                let limits = Limits { end_time: 0.1, events: u64::MAX, interrupt: None };
                let mut log = ContactLog::default();
                let summary = run(&parameters, tolerance, limits, &mut log, None).unwrap();
                (summary.steps, log.events)
            };
            let (steps_alone, alone) = log(1e-10);
            let later = alone.iter().filter(|event| event.generation > 0).count();
            assert!(later > 150, "too few events to compare");
            let which =
                |event: &ContactEvent| (event.block, event.contact, event.generation, event.change == Change::Break);
            for tolerance in [1e-3, 1e-4] {
                let ((steps, mut merged), mut alone) = (log(tolerance), alone.clone());
                assert!(10 * steps < 8 * steps_alone, "nothing is merged: {steps} steps, {steps_alone} at 1e-10");
                assert_eq!(merged.len(), alone.len());
                assert!(merged.is_sorted_by_key(|event| event.time));
                if tolerance > 1e-4 {
                    // Some breaks at different blocks lie closer than their errors by now.
                    merged.sort_by_key(which);
                    alone.sort_by_key(which);
                }
                for (event, exact) in merged.iter().zip(&alone) {
                    assert_eq!(which(event), which(exact), "at t = {} s", exact.time);
                    // Errors grow from event to event: seen 3e-6 s at 1e-3.
                    let late = event.time - exact.time;
                    assert!(late.abs() < 0.01 * tolerance, "{} s, not {} s", event.time, exact.time);
                }
            }
        }
    }

    #[test]
    fn leaps_hide_no_event_and_no_largest_force() {
        let plain = Parameters::default();
        let modulated =
            Parameters { modulation_amplitude: 1e-6, modulation_period: Some(1.0 / 58.0), ..Parameters::default() };
        for parameters in [plain, modulated] {
            let slips = |next_leap: f64| {
                let limits = Limits { end_time: 0.5, events: u64::MAX, interrupt: None };
                let kernels = Kernels::available(Layout::new(parameters.blocks).rows).pop().unwrap();
                let recording = Recording { discard: 0, ..Recording::default() };
                let mut observer = SlipObserver::new(&parameters, &recording);
                let mut run = Run { next_leap, ..Run::new(&parameters, 1e-10, limits, kernels) };
                let summary = run.finished(&mut observer).unwrap();
                (summary, observer.into_rows().0)
            };
            let ((leaping, leapt), (stepping, stepped)) = (slips(0.0), slips(f64::INFINITY));
            assert!(leaping.leaps > 100 && stepping.leaps == 0, "{leaping:?} {stepping:?}");
            assert_eq!((leaping.breaks, leapt.len()), (stepping.breaks, stepped.len()));
            assert!(leapt.len() >= 3, "too few slips to compare");
            for (slip, exact) in leapt.iter().zip(&stepped) {
                assert!((slip.onset - exact.onset).abs() < 1e-7, "{slip:?} {exact:?}");
                assert!((slip.peak_force - exact.peak_force).abs() < 1e-4, "{slip:?} {exact:?}");
                assert!((slip.drop - exact.drop).abs() < 1e-4, "{slip:?} {exact:?}");
            }
        }
    }

    #[test]
    fn truncations_of_many_steps_do_not_add_up_with_heavy_damping() {
        let parameters = Parameters { blocks: 1, damping_rate: 1e7, ..Parameters::default() };
        let log = |tolerance: f64| {
            let limits = Limits { end_time: 0.5, events: u64::MAX, interrupt: None };
            let mut log = ContactLog::default();
            run(&parameters, tolerance, limits, &mut log, None).unwrap();
            log.events
        };
        let (loose, tight) = (log(1e-4), log(1e-10));
        assert!(tight.len() > 200, "too few events to compare");
        assert_eq!(loose.len(), tight.len());
        for (event, exact) in loose.iter().zip(&tight) {
            assert_eq!((event.contact, event.change), (exact.contact, exact.change), "at t = {} s", exact.time);
            // A million steps, of which each may be off by a tenth of the tolerance.
            let error = (event.displacement - exact.displacement).abs() / parameters.contact_reach();
            assert!(error < 1e-3, "off by {error} of the reach at t = {} s", exact.time);
        }
    }
}
