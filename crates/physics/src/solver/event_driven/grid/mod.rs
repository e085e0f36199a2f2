//! The grid: motion in constant steps of time, of two stencils each ([`step`], where they are derived from the exact
//! recurrence of a damped oscillator), corrected for contact events where they happen ([`contacts`]).
//!
//! Setting: `tolerance`, from which [`step_length`] follows; errors are of fourth order in the step. At tolerances of
//! 1e-7 and above it is several times as fast as Taylor steps, as nothing is computed twice when an event comes.

mod contacts;
mod history;
mod step;

pub(super) use self::step::{GridStep, velocity};

use self::contacts::{StepEvents, change_contacts};
use self::history::ForceHistory;
use self::step::{MAX_RUN, march};
use super::moving_frame::{MIN_RESOLUTION, MovingFrame, StepDrive};
use super::slider::{Chain, Slider, State};
use super::taylor::StepInput;
use super::{Integration, WORTHWHILE_GRID_LEAP};
use crate::model::equation::largest_frequency;
use crate::model::simd::Simd;
use crate::model::{Change, ContactChange, ContactEvent, Parameters};
use crate::solver::segment::CubicStep;
use crate::solver::{Observer, SimulationError};
use crate::value::floored;

/// Step in units of 1/ω_max at a tolerance of 1e-3, and at most: stable below 2√3.
const STEP_AT_DEFAULT: f64 = 2.0;
const MAX_STEP: f64 = 2.5;
/// The step in units of 1/ω_s of a block on its contacts alone, by that in units of 1/ω_max.
const CONTACT_SHARE: f64 = 0.12;
/// Time in the frame at which it moves, in s: rounding is far below the errors of the grid.
pub(super) const FRAME_SPAN: f64 = 4.0;
/// Steps of history after which it is reported.
const MAX_HISTORY: usize = 4 * MAX_RUN;

/// Length of a step for a tolerance relative to the contact reach, in s.
fn step_length(parameters: &Parameters, tolerance: f64) -> f64 {
    let share = (STEP_AT_DEFAULT * (tolerance / 1e-3).sqrt().sqrt()).min(MAX_STEP);
    let contacts = (parameters.block_contact_stiffness() / parameters.block_mass()).sqrt();
    let fastest = largest_frequency(parameters)
        .max(2.0 / CONTACT_SHARE * contacts)
        .max(4.0 * parameters.damping_rate)
        .max(8.0 * parameters.largest_modulation_frequency());
    share / fastest
}

/// The grid, and the motion while it is on it.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    pub step: GridStep,
    /// Whether the motion is on it: displacements are then those of the slider, velocities are not.
    pub is_on: bool,
    pub drive: StepDrive,
    events: StepEvents,
    /// Shear force since the last segment reported.
    history: ForceHistory,
    /// Shear force at the present point, in N.
    force: f64,
    /// The last break reported since an entry or a move of the frame, in s in the frame, and the pause after which a
    /// rupture may begin, in s: half of that after which it does.
    last_break: f64,
    pause: f64,
    /// The state one step before an entry.
    before: State,
    /// Where in the last step the dissipation that is entered ends.
    entered: f64,
}

/// The shear force at the start of a step, and its second derivative by steps there, both in N.
#[derive(Clone, Copy, Debug)]
struct ForceAtStart {
    force: f64,
    bend: f64,
}

impl Grid {
    pub fn new(parameters: &Parameters, tolerance: f64, chain: &Chain, state: &State) -> Self {
        Self {
            step: GridStep::new(parameters, chain, step_length(parameters, tolerance)),
            is_on: false,
            drive: StepDrive::default(),
            events: StepEvents::default(),
            history: ForceHistory::default(),
            force: 0.0,
            last_break: f64::NEG_INFINITY,
            pause: 0.5 * parameters.wave_crossing_time(),
            before: state.clone(),
            entered: 1.0,
        }
    }

    /// Whether a clock that runs to [`FRAME_SPAN`] resolves the step.
    pub fn is_resolved(parameters: &Parameters, tolerance: f64) -> bool {
        step_length(parameters, tolerance) >= MIN_RESOLUTION * f64::EPSILON * FRAME_SPAN
    }

    /// Whether attachments are reported to the observer.
    pub fn wants_attachments(&self) -> bool {
        self.events.wants_attachments
    }

    /// Notes what the observer follows, and whether the dissipation is kept.
    pub fn set_observed(&mut self, observer: &dyn Observer, is_audited: bool) {
        self.step.end_phi = is_audited.then(|| self.step.phi.clone());
        self.events.wants_attachments = observer.follows_attachments();
    }

    /// Takes over a frame that has moved.
    pub fn follow_frame(&mut self, chain: &Chain, frame: &MovingFrame) {
        self.step.update_all(chain);
        self.drive = frame.step_drive(self.step.length);
        self.step.turn = libm::sincos(self.drive.angle).into();
        self.history.restart(frame.time);
        self.last_break = f64::NEG_INFINITY;
    }

    /// Adds the last run of steps to the history, but for its last step. `before` is the shear force one step before
    /// its start. Returns the force at the start of the last step.
    #[inline(always)]
    fn follow_run(&mut self, steps: usize, before: f64) -> ForceAtStart {
        let mut here = self.force;
        let mut bend = (self.step.trail[0] - here) - (here - before);
        for pair in self.step.trail[..steps].windows(2) {
            let [next, beyond] = [pair[0], pair[1]];
            let next_bend = (beyond - next) - (next - here);
            self.history.push(CubicStep {
                force: [here, next],
                bend: [bend, next_bend],
            });
            (here, bend) = (next, next_bend);
        }
        ForceAtStart { force: here, bend }
    }

    /// Adds the last step to the history, once its events are known.
    #[inline(always)]
    fn follow_last(
        &mut self,
        chain: &Chain,
        state: &State,
        ForceAtStart { force, bend }: ForceAtStart,
        start_bend: f64,
    ) {
        let step = &self.step;
        let drive = &self.drive;
        let place = &step.places[0];
        let here = state.displacement[0][0];
        let rise = step.increment[0][0];
        let beside = place.beside(&state.displacement);
        let own = step.phi_on(place, here, beside, drive.displacement());
        // h² x'' at the start of the step and, from the law of motion, at its end.
        let first = start_bend - bend * step.inverse_stiffness;
        let last = (own - step.damping * (rise + first / 6.0)) * step.inverse_end;
        let end = chain.drive_stiffness * (drive.displacement() - here);
        let end_bend = chain.drive_stiffness * (drive.bend() - last);
        self.history.push(CubicStep {
            force: [force, end],
            bend: [bend, end_bend],
        });
        self.force = end;
    }
}

/// Takes at most `steps` steps from `time` s in the frame on, and none after one with an event. Returns how many.
#[inline(always)]
pub(super) fn advance<S: Simd, const R: usize>(
    simd: S,
    slider: &mut Slider,
    grid: &mut Grid,
    time: f64,
    steps: usize,
) -> usize {
    let Slider { chain, state, .. } = slider;
    let before = chain.drive_stiffness
        * (grid.drive.before(grid.step.turn).displacement()
            - (state.displacement[0][0] - grid.step.increment[0][0]));
    let done = march::<S, R>(
        simd,
        chain,
        &mut grid.step,
        &mut grid.drive,
        &mut state.displacement,
        steps,
    );
    let at_start = grid.follow_run(done, before);
    let start_bend = grid.drive.before(grid.step.turn).bend();
    let start = time + (done - 1) as f64 * grid.step.length;
    grid.events.changes.clear();
    grid.events.attachments.clear();
    (grid.events.breaks, grid.events.reattachments) = (0, 0);
    if !grid.step.reached.is_empty()
        || slider.interface.next_reattachment() <= start + grid.step.length
    {
        change_contacts(simd, slider, grid, start);
        if grid.events.breaks > 0 {
            let Slider { chain, state, .. } = slider;
            grid.events.mean_displacement = chain.mean(simd, &state.displacement);
            grid.events.mean_increment = chain.mean(simd, &grid.step.increment);
        }
    }
    grid.follow_last(&slider.chain, &slider.state, at_start, start_bend);
    done
}

impl Integration<'_> {
    /// Writes the state s steps from the present one, from -1 to 0, into that before.
    fn look_back(&mut self, s: f64) -> Result<(), SimulationError> {
        let length = self.grid.step.length;
        let drive = self.frame.step_drive(length);
        let input = StepInput {
            length,
            error: self.tolerances.step_error,
            min_order: 0,
            drive,
        };
        let chain = &self.slider.chain;
        let state = &self.slider.state;
        if !self
            .kernels
            .expand(chain, state, &input, &mut self.step.series)
        {
            return Err(SimulationError::NotFinite {
                time: self.frame.now(),
            });
        }
        self.kernels
            .evaluate(&self.step.series, s, length, &mut self.grid.before);
        Ok(())
    }

    /// Takes the motion on the grid, from the state.
    fn enter_grid(&mut self) -> Result<(), SimulationError> {
        self.frame.check_resolution(self.grid.step.length)?;
        self.look_back(-1.0)?;
        let Slider { chain, state, .. } = &self.slider;
        let grid = &mut self.grid;
        for ((increment, now), before) in grid
            .step
            .increment
            .iter_mut()
            .zip(&state.displacement)
            .zip(&grid.before.displacement)
        {
            for lane in 0..increment.len() {
                increment[lane] = now[lane] - before[lane];
            }
        }
        grid.follow_frame(chain, &self.frame);
        grid.force = self.frame.shear_force(state.displacement[0][0]);
        grid.is_on = true;
        Ok(())
    }

    /// Completes the state, if it is on the grid, by velocities, and reports what is left to report.
    pub(super) fn update_velocities(&mut self, observer: &mut dyn Observer) {
        if self.grid.is_on {
            self.report_force(1.0, observer);
            let Self {
                kernels,
                slider,
                grid,
                ..
            } = self;
            kernels.velocity(
                &slider.chain,
                &mut grid.step,
                &grid.drive,
                &mut slider.state,
            );
            grid.step.hand_back(&mut slider.chain);
            self.frame.set_time(self.frame.time);
        }
    }

    /// Takes the motion off the grid.
    pub(super) fn leave_grid(&mut self, observer: &mut dyn Observer) {
        self.update_velocities(observer);
        self.grid.is_on = false;
    }

    /// Leaves the grid at the cut, in the last step: up to there all is as in a run without it.
    fn step_back(&mut self, observer: &mut dyn Observer) -> Result<(), SimulationError> {
        let s = (self.cut - self.frame.time) * self.grid.step.inverse_length;
        self.report_force(1.0 + s, observer);
        self.grid.history.restart(self.cut);
        self.leave_grid(observer);
        self.look_back(s)?;
        if let Some(audit) = self.audit {
            self.enter_damping(audit, self.grid.step.length, [0.0, s]);
        }
        self.slider.state.clone_from(&self.grid.before);
        self.frame.set_time(self.cut);
        Ok(())
    }

    /// Takes steps of the grid, to the end of the next that holds an event, or to the cut.
    pub(super) fn take_grid_steps(
        &mut self,
        observer: &mut dyn Observer,
    ) -> Result<(), SimulationError> {
        let length = self.grid.step.length;
        if !self.grid.is_on {
            self.enter_grid()?;
        }
        let steps_until = |time: f64| {
            // Casts saturate: nothing need be due.
            floored((time - self.frame.time) * self.grid.step.inverse_length).saturating_add(1)
        };
        // To the next reattachment, the cut, and where a leap may be tried.
        let mut steps = steps_until(self.slider.interface.next_reattachment().min(self.cut));
        if self.next_leap > self.frame.time {
            steps = steps.min(steps_until(self.next_leap));
        }
        self.grid.events.cut = self.cut;
        let done = self
            .kernels
            .advance(&mut self.slider, &mut self.grid, self.frame.time, steps);
        self.summary.steps += done as u64;
        self.summary.grid_steps += done as u64;
        self.summary.breaks += self.grid.events.breaks;
        self.summary.reattachments += self.grid.events.reattachments;
        let start = self.frame.time + (done - 1) as f64 * length;
        self.frame.time += done as f64 * length;
        if self.grid.events.breaks > 0 {
            self.next_leap = self
                .next_leap
                .max(self.frame.time + WORTHWHILE_GRID_LEAP * length);
        }
        self.grid.entered = 0.0;
        let step = &self.grid.step;
        self.enter_dissipation(step.dissipation - step.last_dissipation);
        self.report_changes(start, observer);
        self.enter_dissipation_to(1.0);
        if self.frame.time >= self.cut {
            return self.step_back(observer);
        }
        self.largest_force = self.largest_force.max(self.grid.force);
        if self.grid.history.steps.len() > MAX_HISTORY {
            self.report_force(1.0, observer);
        }
        Ok(())
    }

    /// Enters the damping loss that goes with ∫ X'² ds in m².
    fn enter_dissipation(&self, dissipation: f64) {
        if let Some(audit) = self.audit {
            let chain = &self.slider.chain;
            let by_square = chain.mass * chain.damping_rate * self.grid.step.inverse_length;
            audit.damping.update(|sum| sum + by_square * dissipation);
        }
    }

    /// Enters that of the last step up to s, as if it were even there.
    fn enter_dissipation_to(&mut self, s: f64) {
        self.enter_dissipation(self.grid.step.last_dissipation * (s - self.grid.entered));
        self.grid.entered = s;
    }

    /// Reports the shear force up to s in the last step.
    fn report_force(&mut self, s: f64, observer: &mut dyn Observer) {
        let length = self.grid.step.length;
        let grid = &mut self.grid;
        if let Some(segment) = grid
            .history
            .segment_to(s, length, self.frame.absolute_time(0.0))
        {
            observer.advance(&segment);
            grid.history
                .forget_to(s, self.frame.time - (1.0 - s) * length);
        }
    }

    /// Reports what has happened in the last step, which began at `start` s in the frame, and the shear force up to it:
    /// change after change to an observer that follows attachments; else up to the last break, and before to those at
    /// the leading edge, at which a slip's onset is known, and to the first if it may begin a rupture.
    fn report_changes(&mut self, start: f64, observer: &mut dyn Observer) {
        if self.grid.events.changes.is_empty() {
            for due in &self.grid.events.attachments {
                self.slider.interface.count(Change::Attach, *due);
            }
            return;
        }
        let changes = std::mem::take(&mut self.grid.events.changes);
        let attachments = std::mem::take(&mut self.grid.events.attachments);
        let mut uncounted = &attachments[..];
        let inverse_length = self.grid.step.inverse_length;
        let place = |change: &ContactChange| (change.time - start) * inverse_length;
        let mut backwards = changes.iter().rev();
        if let Some(last) = backwards.find(|change| change.change == Change::Break) {
            self.largest_force = self.grid.history.last_force(place(last));
        }
        let leading = self.slider.chain.layout.blocks - 1;
        let mut rest = &changes[..];
        while let [first, ..] = rest {
            let may_begin =
                rest.len() == changes.len() && first.time - self.grid.last_break > self.grid.pause;
            let last = if may_begin || self.grid.wants_attachments() {
                Some(0)
            } else {
                rest.iter().position(|change| change.block == leading)
            };
            let (reported, later) = rest.split_at(last.map_or(rest.len(), |last| last + 1));
            let s = place(reported.last().unwrap_or(first)).clamp(0.0, 1.0);
            self.report_force(s, observer);
            self.enter_dissipation_to(s);
            for change in reported {
                while let [due, later @ ..] = uncounted
                    && *due <= change.time
                {
                    self.slider.interface.count(Change::Attach, *due);
                    uncounted = later;
                }
                let count = self.slider.interface.count(change.change, change.time);
                let left = 1.0 - place(change);
                let events = &self.grid.events;
                let mean = events.mean_displacement - left * events.mean_increment;
                observer.contact(&ContactEvent::new(
                    self.frame.absolute(*change),
                    count,
                    self.frame.absolute_displacement(mean),
                ));
            }
            rest = later;
        }
        for due in uncounted {
            self.slider.interface.count(Change::Attach, *due);
        }
        if let Some(last) = changes.last() {
            self.grid.last_break = last.time;
        }
        self.grid.events.changes = changes;
        self.grid.events.attachments = attachments;
    }
}
