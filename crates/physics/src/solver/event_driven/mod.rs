//! Event-driven: from contact event to contact event, in closed form where nothing happens.
//!
//! Between events the model is linear with constant coefficients. While it is quiet, a leap follows the driven solution
//! to the next event ([`leap`]). While it moves, it is resolved in one of two ways: on a constant grid of time, which
//! events correct to fourth order ([`grid`]); or in Taylor series, of which each locates the first crossing of a break
//! position rigorously ([`taylor`]). Contract: errors of displacement of the order of `tolerance` · f_s/k,
//! and events in the right order within that.
//!
//! Displacements and times are kept in a [`moving_frame`], so that neither loses digits in long runs.

mod event;
mod grid;
mod kernels;
mod leap;
mod moving_frame;
mod slider;
#[cfg(test)]
mod speed_tests;
mod taylor;
mod tolerances;

use self::grid::Grid;
use self::kernels::Kernels;
use self::leap::{LeapBounds, PlannedLeap, Split};
use self::moving_frame::MovingFrame;
use self::slider::{BlockLayout, Slider};
use self::taylor::{Step, StepControl};
use self::tolerances::Tolerances;
use super::harmonic::Harmonic;
use super::ledger::Audit;
use super::segment::{ForcePath, Segment};
use super::{Limits, Observer, SimulationError, Solver, SolverKey, Summary};
use crate::model::{AttachedContacts, Change, ContactChange, ContactEvent, Drive, Parameters};
use crate::value::{Field, words};
use std::sync::atomic::Ordering;

pub(super) const SETTINGS: &[SolverKey] = &[SolverKey::Tolerance, SolverKey::Resolve];

words! {
    /// How motion between leaps is resolved.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Resolve {
        /// On the grid from a tolerance of [`GRID_TOLERANCE`] on, if the clock resolves its step; else in Taylor
        /// steps.
        Auto = "auto",
        /// On a constant grid of time, corrected for events to fourth order.
        Grid = "grid",
        /// In Taylor series, each up to the next event.
        Taylor = "taylor",
    }
}

impl Resolve {
    /// Whether motion is resolved on the grid at a tolerance, but for the exceptions of [`Self::Auto`].
    pub fn takes_grid(self, tolerance: f64) -> bool {
        match self {
            Self::Auto => tolerance >= GRID_TOLERANCE,
            Self::Grid => true,
            Self::Taylor => false,
        }
    }
}

/// Least tolerance at which [`Resolve::Auto`] takes the grid: it is cheaper down to some 1e-8.
pub const GRID_TOLERANCE: f64 = 1e-7;

/// A leap is tried only if no reattachment is due within this many longest Taylor steps, or steps of the grid.
const WORTHWHILE_LEAP: f64 = 6.0;
const WORTHWHILE_GRID_LEAP: f64 = 80.0;

/// Turn of a pulse in the longest Taylor step from which on it is resolved in such steps, in rad.
const MAX_PULSE_TURN: f64 = 0.5;

pub(super) fn check(tolerance: f64) -> Result<(), SimulationError> {
    match SolverKey::Tolerance.checked(tolerance.value()) {
        Some(_) => Ok(()),
        None => Err(SimulationError::BadSetting {
            setting: format!("tolerance = {tolerance:e}"),
            allowed: SolverKey::Tolerance.description().allowed(),
        }),
    }
}

/// Runs the method with a tolerance in its range; see [`super::simulate`].
pub(super) fn run(
    solver: Solver,
    parameters: &Parameters,
    limits: Limits<'_>,
    observer: &mut dyn Observer,
    audit: Option<&Audit>,
) -> Result<Summary, SimulationError> {
    let Solver {
        tolerance, resolve, ..
    } = solver;
    let rows = BlockLayout::new(parameters.blocks).rows;
    let is_possible = resolve == Resolve::Grid || Grid::is_resolved(parameters, tolerance);
    let takes_grid = resolve.takes_grid(tolerance) && is_possible;
    let kernels = kernels::fastest(rows);
    Integration::new(parameters, tolerance, takes_grid, limits, kernels, audit).integrate(observer)
}

/// One simulation in progress. Times and displacements are those of the frame unless stated otherwise.
struct Integration<'a> {
    limits: Limits<'a>,
    kernels: Box<dyn Kernels>,
    tolerances: Tolerances,
    frame: MovingFrame,
    slider: Slider,
    control: StepControl,
    step: Step,
    split: Split,
    /// Whether motion is resolved on the grid, and not in Taylor steps.
    takes_grid: bool,
    grid: Grid,
    /// Time in the frame at which a pulse begins or ends, or the run, in s: the step in which it comes is cut there.
    cut: f64,
    /// Time before which no leap is tried, in s.
    next_leap: f64,
    /// Largest shear force at the last break and at the ends of steps since, in N.
    largest_force: f64,
    summary: Summary,
    audit: Option<&'a Audit>,
}

impl<'a> Integration<'a> {
    fn new(
        parameters: &Parameters,
        tolerance: f64,
        takes_grid: bool,
        limits: Limits<'a>,
        kernels: Box<dyn Kernels>,
        audit: Option<&'a Audit>,
    ) -> Self {
        let tolerances = Tolerances::new(parameters, tolerance);
        let slider = Slider::new(parameters);
        let layout = slider.chain.layout;
        let span = if takes_grid {
            grid::FRAME_SPAN
        } else {
            moving_frame::SPAN
        };
        Self {
            limits,
            kernels,
            tolerances,
            frame: MovingFrame::new(Drive::new(parameters), span),
            takes_grid,
            grid: Grid::new(parameters, tolerance, &slider.chain, &slider.state),
            split: Split::new(&slider.chain),
            slider,
            control: StepControl::new(tolerances.max_step),
            step: Step::new(layout),
            cut: f64::INFINITY,
            next_leap: 0.0,
            largest_force: 0.0,
            summary: Summary::default(),
            audit,
        }
    }

    /// The loop is not inlined where the integration is owned, nor is what is rare inlined here: so it is short, and
    /// has nothing to drop if an observer panics.
    #[inline(never)]
    fn integrate(&mut self, observer: &mut dyn Observer) -> Result<Summary, SimulationError> {
        self.grid.set_observed(observer, self.audit.is_some());
        for event in self.slider.interface.initial_attachments() {
            observer.contact(&event);
        }
        loop {
            // Asked first, so that no job is done by what a step shows that the end has cut.
            let until_end = self.frame.until(self.limits.end_time);
            let is_over = self.frame.has_come(until_end);
            if is_over || observer.is_satisfied() {
                return self.finish(!is_over, observer);
            }
            let mut until_change = self.frame.until(self.frame.drive.cycle_end);
            if self.frame.has_come(until_change) {
                self.leave_grid(observer);
                self.frame.next_cycle();
                until_change = self.frame.until(self.frame.drive.cycle_end);
            }
            // Steps before a change of the drive, and before the end, are those of a run without it.
            self.cut = self.frame.time + until_change.min(until_end);
            // The step of the grid is not that of a pulse.
            let turn = self.frame.drive.angular_frequency * self.tolerances.max_step;
            let takes_grid =
                self.takes_grid && (self.frame.drive.lift == 0.0 || turn < MAX_PULSE_TURN);
            let until_attach = self.slider.interface.next_reattachment() - self.frame.time;
            // Leaps from the grid pass reattachments.
            let is_worthwhile =
                takes_grid || until_attach > WORTHWHILE_LEAP * self.tolerances.max_step;
            let may_leap = is_worthwhile && self.frame.time >= self.next_leap;
            let has_leapt = may_leap && self.try_leap(until_attach, observer);
            match (has_leapt, takes_grid) {
                (true, _) => {}
                (false, true) => self.take_grid_steps(observer)?,
                (false, false) => self.take_step(observer)?,
            }
            if self.summary.breaks + self.summary.reattachments > self.limits.events {
                return Err(SimulationError::EventBudget {
                    time: self.frame.now(),
                    events: self.limits.events,
                });
            }
            // A value that is not finite spreads to the driven edge, if the run lasts.
            if !self.slider.state.displacement[0][0].is_finite() {
                return Err(SimulationError::NotFinite {
                    time: self.frame.now(),
                });
            }
            if self.frame.time > self.frame.span {
                self.move_frame(observer);
            }
            let interrupt = self.limits.interrupt;
            if interrupt.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
                return Err(SimulationError::Interrupted {
                    time: self.frame.now(),
                });
            }
        }
    }

    #[inline(never)]
    fn finish(
        &mut self,
        satisfied: bool,
        observer: &mut dyn Observer,
    ) -> Result<Summary, SimulationError> {
        self.leave_grid(observer);
        self.summary.end_time = self.frame.now();
        let displacement: Vec<f64> = self
            .slider
            .displacements()
            .map(|x| self.frame.absolute_displacement(x))
            .collect();
        if !displacement.iter().sum::<f64>().is_finite() {
            return Err(SimulationError::NotFinite {
                time: self.summary.end_time,
            });
        }
        observer.end(self.summary.end_time, &displacement);
        self.summary.satisfied = satisfied;
        if let Some(audit) = self.audit {
            let slider = &self.slider;
            let blocks = 0..slider.chain.layout.blocks;
            let velocity = blocks.map(|block| slider.chain.at(&slider.state.velocity, block));
            audit.record_final_energy(
                &slider.interface,
                &slider.displacements().collect::<Vec<_>>(),
                &velocity.collect::<Vec<_>>(),
                self.frame.drive_motion().value(0.0),
            );
        }
        Ok(self.summary)
    }

    /// Tries a leap, up to the next reattachment in `horizon` s, or from the grid further. False if none is allowed yet.
    #[inline(never)]
    fn try_leap(&mut self, horizon: f64, observer: &mut dyn Observer) -> bool {
        self.update_velocities(observer);
        let drive = self.frame.drive_motion();
        let start = self.frame.now();
        let began = self.frame.time;
        let least = WORTHWHILE_GRID_LEAP * self.grid.step.length;
        // The drive beyond the cycle of a ramp is another, and force may peak there; a run knows no pulse.
        let until_cycle_end = match self.frame.drive.pulse() {
            Some(_) => f64::INFINITY,
            None => self.frame.until(self.frame.drive.cycle_end),
        };
        let bounds = LeapBounds {
            start: began,
            horizon: horizon.min(until_cycle_end),
            until_cycle_end,
            until_cut: self.cut - began,
            error: self.tolerances.leap_error,
            largest_force: self.largest_force,
            passing: self.takes_grid.then_some(least),
        };
        let attempt = self.kernels.leap(
            &mut self.split,
            &mut self.slider,
            &drive,
            bounds,
            self.audit,
        );
        let plan = match attempt {
            Ok(plan) => plan,
            Err(seconds) => {
                self.next_leap = began + seconds.max(self.tolerances.max_step);
                return false;
            }
        };
        self.report_leap(&plan, &drive, start, began, observer);
        self.grid.is_on = false;
        self.summary.steps += 1;
        self.summary.leaps += 1;
        self.next_leap = 0.0;
        let due = self.slider.interface.next_reattachment();
        let reached = began + plan.duration;
        let is_due = plan.is_whole && (due - reached).abs() <= 4.0 * f64::EPSILON * reached;
        self.frame.set_time(if is_due { due } else { reached });
        match plan.reached {
            Some(block) => {
                let x = self.slider.displacement(block);
                let trailing = self.slider.state.displacement[0][0];
                let mean = self.slider.mean_displacement();
                self.break_block(block, x, mean, self.frame.shear_force(trailing), observer);
            }
            None => self.reattach_due(observer),
        }
        true
    }

    /// Reports the shear force along a leap that began at `start` s, at `began` s in the frame, and attaches on the
    /// driven solution what it passed from the grid.
    fn report_leap(
        &mut self,
        leap: &PlannedLeap,
        drive: &Harmonic,
        start: f64,
        began: f64,
        observer: &mut dyn Observer,
    ) {
        let mut reported = 0.0;
        let mut report = |until: f64, observer: &mut dyn Observer| {
            let path = Harmonic {
                start: leap.force.start + leap.force.rate * reported,
                phase: leap.force.phase + leap.force.turn(reported),
                ..leap.force
            };
            observer.advance(&Segment {
                start: start + reported,
                duration: until - reported,
                path: ForcePath::Harmonic(path),
            });
            reported = until;
        };
        // What is due at the very end is attached to the state there.
        while let Some(due) = self
            .slider
            .interface
            .next_reattachment_by(began + leap.duration)
            && due.time() - began < leap.duration
        {
            let elapsed = due.time() - began;
            if self.grid.wants_attachments() {
                report(elapsed, observer);
            }
            let x = self
                .split
                .driven(&self.slider.chain, due.block())
                .displacement(drive, elapsed);
            self.attach_next(x, observer);
        }
        report(leap.duration, observer);
    }

    /// Breaks the contacts of a block that has reached a break position, at displacement `x` m of it and `mean` m of all
    /// blocks on average, and a shear force of `force` N.
    fn break_block(
        &mut self,
        block: usize,
        x: f64,
        mean: f64,
        force: f64,
        observer: &mut dyn Observer,
    ) {
        self.largest_force = force;
        let frame = &self.frame;
        let summary = &mut self.summary;
        let mean_displacement = frame.absolute_displacement(mean);
        let mut log = |change: ContactChange, attached: AttachedContacts| {
            summary.breaks += 1;
            observer.contact(&ContactEvent::new(
                frame.absolute(change),
                attached,
                mean_displacement,
            ));
        };
        self.slider.break_reached(block, frame.time, x, &mut log);
    }

    /// Reattaches all contacts that are due.
    fn reattach_due(&mut self, observer: &mut dyn Observer) {
        let now = self.frame.time;
        while let Some(due) = self.slider.interface.next_reattachment_by(now) {
            self.attach_next(self.slider.displacement(due.block()), observer);
        }
    }

    /// Attaches the contact that is due next, at displacement `x` m of its block.
    fn attach_next(&mut self, x: f64, observer: &mut dyn Observer) {
        let change = self.slider.attach_next(x);
        self.summary.reattachments += 1;
        let count = self.slider.interface.count(Change::Attach, change.time);
        if self.grid.wants_attachments() {
            observer.contact(&ContactEvent::new(self.frame.absolute(change), count, 0.0));
        }
    }

    /// Moves the frame to where the slider and the clock are.
    #[inline(never)]
    fn move_frame(&mut self, observer: &mut dyn Observer) {
        self.update_velocities(observer);
        let shift = self.frame.move_origin(self.slider.state.displacement[0][0]);
        self.slider.move_origin(shift);
        self.next_leap -= shift.time;
        if self.grid.is_on {
            self.grid.follow_frame(&self.slider.chain, &self.frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Change, ContactEvent};
    use crate::observe::{ContactLog, Recording, SlipObserver};

    fn in_taylor_steps(tolerance: f64) -> Solver {
        Solver {
            resolve: Resolve::Taylor,
            ..Solver::event_driven(tolerance)
        }
    }

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
        for (parameters, takes_grid) in [
            (&plain, true),
            (&plain, false),
            (&modulated, true),
            (&modulated, false),
        ] {
            let logs: Vec<(&str, Vec<ContactEvent>)> =
                kernels::available(BlockLayout::new(parameters.blocks).rows)
                    .into_iter()
                    .map(|(name, kernels)| {
                        let limits = Limits {
                            end_time: 0.25,
                            events: u64::MAX,
                            interrupt: None,
                        };
                        let mut log = ContactLog::default();
                        Integration::new(parameters, 1e-6, takes_grid, limits, kernels, None)
                            .integrate(&mut log)
                            .unwrap();
                        (name, log.events)
                    })
                    .collect();
            assert!(
                logs[0].1.len() > 2 * parameters.blocks * parameters.contacts_per_block,
                "no slip to compare"
            );
            for (name, log) in &logs[1..] {
                assert_eq!(*log, logs[0].1, "{name} differs from {}", logs[0].0);
            }
        }
    }

    #[test]
    fn events_that_share_a_step_come_in_the_order_and_at_the_times_of_those_that_do_not() {
        let plain = Parameters::default();
        let modulated = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(1.0 / 58.0),
            ..Parameters::default()
        };
        for parameters in [plain, modulated] {
            let log = |tolerance: f64| {
                let limits = Limits {
                    end_time: 0.1,
                    events: u64::MAX,
                    interrupt: None,
                };
                let mut log = ContactLog::default();
                let summary = run(
                    in_taylor_steps(tolerance),
                    &parameters,
                    limits,
                    &mut log,
                    None,
                )
                .unwrap();
                (summary.steps, log.events)
            };
            let (steps_alone, alone) = log(1e-10);
            let later = alone.iter().filter(|event| event.generation > 0).count();
            assert!(later > 150, "too few events to compare");
            let which = |event: &ContactEvent| {
                (
                    event.block,
                    event.contact,
                    event.generation,
                    event.change == Change::Break,
                )
            };
            for tolerance in [1e-3, 1e-4] {
                let ((steps, mut merged), mut alone) = (log(tolerance), alone.clone());
                assert!(
                    10 * steps < 8 * steps_alone,
                    "nothing is merged: {steps} steps, {steps_alone} at 1e-10"
                );
                assert_eq!(merged.len(), alone.len());
                assert!(merged.is_sorted_by_key(|event| event.time));
                if tolerance > 1e-4 {
                    // Some breaks at different blocks lie closer together than their errors.
                    merged.sort_by_key(which);
                    alone.sort_by_key(which);
                }
                for (event, exact) in merged.iter().zip(&alone) {
                    assert_eq!(which(event), which(exact), "at t = {} s", exact.time);
                    // Errors grow from event to event: seen 3e-6 s at 1e-3.
                    let late = event.time - exact.time;
                    assert!(
                        late.abs() < 0.01 * tolerance,
                        "{} s, not {} s",
                        event.time,
                        exact.time
                    );
                }
            }
        }
    }

    #[test]
    fn leaps_hide_no_event_and_no_largest_force() {
        let plain = Parameters {
            drive_velocity: 1e-5,
            ..Parameters::default()
        };
        let modulated = Parameters {
            modulation_amplitude: 1e-7,
            modulation_period: Some(1.0 / 58.0),
            ..plain.clone()
        };
        for parameters in [plain, modulated] {
            let slips = |next_leap: f64| {
                let limits = Limits {
                    end_time: 5.0,
                    events: u64::MAX,
                    interrupt: None,
                };
                let kernels = kernels::fastest(BlockLayout::new(parameters.blocks).rows);
                let recording = Recording {
                    discard: 0,
                    ..Recording::default()
                };
                let mut observer = SlipObserver::new(&parameters, &recording);
                let integration =
                    Integration::new(&parameters, 1e-10, false, limits, kernels, None);
                let summary = Integration {
                    next_leap,
                    ..integration
                }
                .integrate(&mut observer)
                .unwrap();
                (summary, observer.into_measurements(summary).slips)
            };
            let ((leaping, leapt), (stepping, stepped)) = (slips(0.0), slips(f64::INFINITY));
            assert!(
                leaping.leaps > 100 && stepping.leaps == 0,
                "{leaping:?} {stepping:?}"
            );
            assert_eq!(
                (leaping.breaks, leapt.len()),
                (stepping.breaks, stepped.len())
            );
            assert!(leapt.len() >= 3, "too few slips to compare");
            for (slip, exact) in leapt.iter().zip(&stepped) {
                assert!(
                    (slip.onset - exact.onset).abs() < 1e-7,
                    "{slip:?} {exact:?}"
                );
                assert!(
                    (slip.peak_force - exact.peak_force).abs() < 1e-4,
                    "{slip:?} {exact:?}"
                );
                assert!((slip.drop - exact.drop).abs() < 1e-4, "{slip:?} {exact:?}");
            }
        }
    }

    #[test]
    fn truncations_of_many_steps_do_not_add_up_with_heavy_damping() {
        let parameters = Parameters {
            blocks: 1,
            damping_rate: 1e7,
            ..Parameters::default()
        };
        let log = |tolerance: f64| {
            let limits = Limits {
                end_time: 0.5,
                events: u64::MAX,
                interrupt: None,
            };
            let mut log = ContactLog::default();
            run(
                in_taylor_steps(tolerance),
                &parameters,
                limits,
                &mut log,
                None,
            )
            .unwrap();
            log.events
        };
        let loose = log(1e-4);
        let tight = log(1e-10);
        assert!(tight.len() > 200, "too few events to compare");
        assert_eq!(loose.len(), tight.len());
        for (event, exact) in loose.iter().zip(&tight) {
            assert_eq!(
                (event.contact, event.change),
                (exact.contact, exact.change),
                "at t = {} s",
                exact.time
            );
            // A million steps, of which each may be off by a tenth of the tolerance.
            let error =
                (event.displacement - exact.displacement).abs() / parameters.contact_reach();
            assert!(
                error < 1e-3,
                "off by {error} of the reach at t = {} s",
                exact.time
            );
        }
    }
}
