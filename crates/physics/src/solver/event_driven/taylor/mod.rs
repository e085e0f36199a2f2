//! Taylor steps: motion as a series in time ([`series`]), each step up to its next contact events.
//!
//! Setting: `tolerance`, of which each step may take a share ([`super::tolerances`]). Method: Taylor series to the
//! order at which they converge, as described by À. Jorba and M. Zou, Exp. Math. 14, 99 (2005); a bound on each block's
//! motion isolates the first crossing of a break position ([`first_exit`](polynomial::first_exit)).
//!
//! An event changes the motion from there on ([`event`](super::event)). As long as the terms left out stay below a
//! small part of the error of a step, it is merged into the step: the change is added to the series, which stays
//! accurate after the event. The step ends where the series would no longer be accurate. Contract: events in the right
//! order, also of blocks whose series has changed.
//!
//! In short: [`Integration::take_step`] expands the state into a series, looks for the first break in it, goes there or
//! to the next reattachment, changes the contact and with it the series, and goes on in the same step as long as it may.

mod series;

pub(super) use self::series::{StepInput, TaylorSeries, evaluate, expand, reachable};

use super::Integration;
use super::event::{own_terms, term_beside};
use super::slider::{BlockLayout, Chain, Slider, Slot};
use crate::model::Change;
use crate::solver::ledger::{Audit, Node};
use crate::solver::polynomial;
use crate::solver::segment::{ForceAt, ForcePath, PolynomialPath, Segment};
use crate::solver::{Observer, SimulationError};

/// Steps are halved at most this often where events crowd; further only if a series does not converge.
const MAX_HALVINGS: usize = 7;
/// Halvings at which a series that does not converge ends the run.
const HOPELESS_HALVINGS: usize = 60;
/// Order up to which an event changes the series.
const MERGED_ORDER: usize = 4;
/// Events that may be merged into one step.
const MAX_MERGED: u32 = 16;
/// An event is merged only if the step can go on for this long, in units of how far recent steps came.
const MIN_WINDOW: f64 = 0.5;

/// What recent steps say about the next.
#[derive(Clone, Debug, Default)]
pub(super) struct StepControl {
    /// How far steps come, in s.
    typical_advance: f64,
    /// How long a step could go on after the last break and after the last reattachment, in s.
    break_window: f64,
    attach_window: f64,
    /// Order from which on terms are checked, by the number of halvings.
    min_orders: [usize; MAX_HALVINGS + 1],
}

impl StepControl {
    pub fn new(max_step: f64) -> Self {
        Self {
            typical_advance: max_step,
            ..Self::default()
        }
    }

    fn note_order(&mut self, halvings: usize, order: usize) {
        if let Some(min_order) = self.min_orders.get_mut(halvings) {
            // Reached at the first check: check earlier next time.
            *min_order = if order <= *min_order + 1 {
                order - 2
            } else {
                order
            };
        }
    }
}

/// A contact event to come in the step.
#[derive(Clone, Copy, Debug)]
struct EventAhead {
    change: Change,
    block: usize,
    /// Where in the step, from 0 to 1.
    s: f64,
}

/// The step in progress: its series, and what may still happen in it.
#[derive(Clone, Debug, Default)]
pub(super) struct Step {
    /// Its first instant in the frame and its length, in s.
    start: f64,
    pub length: f64,
    pub series: TaylorSeries,
    /// Coefficients of F_S over the step, in N.
    force: Vec<f64>,
    /// Bound on the second derivative of F_S by s, in N.
    curvature_bound: f64,
    /// The blocks that may break.
    candidates: Vec<Slot>,
    /// Breaks to come.
    breaks: Vec<EventAhead>,
    /// Blocks whose series an event has changed.
    amended: Vec<usize>,
    /// Work space for the coefficients of a block.
    coefficients: Vec<f64>,
}

impl Step {
    pub fn new(layout: BlockLayout) -> Self {
        Self {
            series: TaylorSeries::new(layout),
            ..Self::default()
        }
    }

    /// The shear force along a part of the step that starts at s = `first`; `ends` are its values there and at the end.
    fn force_path(&self, first: f64, ends: [ForceAt; 2]) -> ForcePath<'_> {
        ForcePath::Polynomial(PolynomialPath {
            coefficients: &self.force,
            curvature_bound: self.curvature_bound,
            first,
            scale: self.length,
            ends,
        })
    }

    /// Notes and returns where in a part of the step a block first breaks; infinite if it does not.
    fn look_for_break(&mut self, chain: &Chain, block: usize, from: f64, end: f64) -> f64 {
        let slot = chain.layout.slot(block);
        let Slot { row, lane } = slot;
        let levels = [chain.lower[row][lane], chain.upper[row][lane]];
        let [lowest, highest] = self.series.range(slot);
        if lowest > levels[0] && highest < levels[1] {
            return f64::INFINITY;
        }
        self.series.block(slot, &mut self.coefficients);
        let Some(s) = polynomial::first_exit(&mut self.coefficients, levels, from, end) else {
            return f64::INFINITY;
        };
        self.breaks.push(EventAhead {
            change: Change::Break,
            block,
            s,
        });
        s
    }

    /// The first break noted; ties go to the smaller block.
    fn first_break(&self) -> Option<EventAhead> {
        self.breaks
            .iter()
            .copied()
            .min_by(|a, b| a.s.total_cmp(&b.s).then(a.block.cmp(&b.block)))
    }

    /// Value, slope and half the second derivative of a block's displacement at s, in m.
    fn expanded(&mut self, chain: &Chain, block: usize, s: f64) -> [f64; 3] {
        let slot = chain.layout.slot(block);
        self.series.block(slot, &mut self.coefficients);
        polynomial::expanded(&self.coefficients, s)
    }

    /// Adds coefficients to the series of a block, and changes F_S accordingly.
    fn amend(&mut self, chain: &Chain, block: usize, coefficients: [f64; MERGED_ORDER + 1]) {
        self.series.add(chain.layout.slot(block), &coefficients);
        self.amended.push(block);
        if block == 0 {
            for (force, coefficient) in self.force.iter_mut().zip(coefficients) {
                *force -= chain.drive_stiffness * coefficient;
            }
            self.curvature_bound = polynomial::second_derivative_bound(&self.force);
        }
    }
}

impl Integration<'_> {
    /// Takes one Taylor step, to its end or soon after its first events, or to the cut.
    pub(super) fn take_step(&mut self, observer: &mut dyn Observer) -> Result<(), SimulationError> {
        let until_attach = self.slider.interface.next_reattachment() - self.frame.time;
        self.expand(until_attach + self.control.attach_window)?;
        let start = self.step.start;
        let length = self.step.length;
        self.frame.check_resolution(length)?;
        self.summary.steps += 1;
        let mut done = 0.0;
        let cut = (self.cut - start) / length;
        let mut merged = 0;
        let mut force = ForceAt {
            force: self.step.force[0],
            integral: 0.0,
        };
        let mut end = self.look_for_breaks(1.0);
        loop {
            let event = self.next_event(done, end.min(cut));
            let s = event.map_or(end.min(cut), |event| event.s);
            force = self.report([done, s], force, observer);
            done = s;
            self.frame.time = start + s * length;
            let Some(EventAhead { change, block, .. }) = event else {
                break;
            };
            if change == Change::Attach {
                self.frame.time = self.slider.interface.next_reattachment();
            }
            let window = self.change(change, block, s, force.force, observer);
            match change {
                Change::Break => self.control.break_window = window * length,
                Change::Attach => self.control.attach_window = window * length,
            }
            merged += 1;
            if window == 0.0 || merged == MAX_MERGED {
                break;
            }
            end = end.min(s + window);
            while let Some(block) = self.step.amended.pop() {
                self.step.breaks.retain(|ahead| ahead.block != block);
                self.step.look_for_break(&self.slider.chain, block, s, end);
                if block == 0 {
                    // The same force from here on, as another polynomial.
                    force.integral = ForceAt::new(&self.step.force, s).integral;
                }
            }
        }
        self.kernels
            .evaluate(&self.step.series, done, length, &mut self.slider.state);
        self.frame.set_time(self.frame.time);
        self.largest_force = self.largest_force.max(force.force);
        let covered = if done == 1.0 {
            2.0 * length
        } else {
            done * length
        };
        self.control.typical_advance += 0.25 * (covered - self.control.typical_advance);
        Ok(())
    }

    /// Notes where blocks first break up to `end`, and returns where the step should end for them.
    fn look_for_breaks(&mut self, mut end: f64) -> f64 {
        let Slider { chain, .. } = &self.slider;
        let Step {
            series, candidates, ..
        } = &mut self.step;
        self.kernels.reachable(chain, series, candidates);
        self.step.breaks.clear();
        while let Some(slot) = self.step.candidates.pop() {
            let block = chain.layout.block(slot);
            let found = self.step.look_for_break(chain, block, 0.0, end);
            // Events this long after the first are left to the next step.
            end = end.min(found + self.control.break_window / self.step.length);
        }
        end
    }

    /// The first event from `done` to `end` in the step.
    fn next_event(&self, done: f64, end: f64) -> Option<EventAhead> {
        let interface = &self.slider.interface;
        let Step { start, length, .. } = self.step;
        let due = ((interface.next_reattachment() - start) / length).max(done);
        match self.step.first_break() {
            Some(ahead) if ahead.s <= due && ahead.s <= end => Some(ahead),
            _ if due <= end => {
                let next = interface.next_reattachment_by(f64::INFINITY)?;
                Some(EventAhead {
                    change: Change::Attach,
                    block: next.block(),
                    s: due,
                })
            }
            _ => None,
        }
    }

    /// Reports a part of the step to the observer, and to the ledger if there is one; `force` is the shear force at its
    /// start. Returns that at its end.
    fn report(
        &mut self,
        [first, last]: [f64; 2],
        force: ForceAt,
        observer: &mut dyn Observer,
    ) -> ForceAt {
        let start = self.step.start;
        let length = self.step.length;
        let end_force = ForceAt::new(&self.step.force, last);
        observer.advance(&Segment {
            start: self.frame.absolute_time(start + first * length),
            duration: (last - first) * length,
            path: self.step.force_path(first, [force, end_force]),
        });
        if let Some(audit) = self.audit {
            self.enter_damping(audit, length, [first, last]);
        }
        end_force
    }

    /// Enters the damping loss over a part of the present series, a step of `length` s: ∫ mγ Σ v² dt, exact for the
    /// polynomial.
    pub(super) fn enter_damping(&self, audit: &Audit, length: f64, [first, last]: [f64; 2]) {
        let Slider { chain, state, .. } = &self.slider;
        let series = &self.step.series;
        let mut probe = state.clone();
        let nodes = audit.quadrature.nodes(series.order).iter();
        let mean_square: f64 = nodes
            .map(|&Node { at, weight }| {
                let s = first + at * (last - first);
                self.kernels.evaluate(series, s, length, &mut probe);
                let velocities = probe.velocity.iter().flat_map(|row| row.iter());
                weight * velocities.map(|v| v * v).sum::<f64>()
            })
            .sum();
        let loss = chain.mass * chain.damping_rate * (last - first) * length * mean_square;
        audit.damping.update(|sum| sum + loss);
    }

    /// Breaks the contacts that a block has reached, or attaches the one that is due there, at s in the step. Returns
    /// how far beyond s the series stays accurate; 0 if the step must end.
    fn change(
        &mut self,
        change: Change,
        block: usize,
        s: f64,
        force: f64,
        observer: &mut dyn Observer,
    ) -> f64 {
        let [x, slope, half_curvature] = self.step.expanded(&self.slider.chain, block, s);
        let stiffness = self.slider.interface.block_stiffness[block];
        let pull = self.slider.interface.block_pull[block];
        match change {
            Change::Break => {
                let mean = self.step.series.mean(&self.slider.chain, s);
                self.break_block(block, x, mean, force, observer);
            }
            Change::Attach => self.attach_next(x, observer),
        }
        if self.step.series.order < MERGED_ORDER {
            return 0.0;
        }
        let chain = &self.slider.chain;
        let interface = &self.slider.interface;
        let length = self.step.length;
        let square = length * length;
        let stiffened = (interface.block_stiffness[block] - stiffness) * square / chain.mass;
        let pulled = (interface.block_pull[block] - pull) * square / chain.mass;
        let forces = [
            pulled - stiffened * x,
            -stiffened * slope,
            -stiffened * half_curvature,
        ];
        let damping = chain.damping_rate * length;
        let own = square * chain.at(&chain.diagonal, block);
        let [second, third, fourth] = own_terms(forces, damping, own);
        let window = self
            .tolerances
            .merged_window([second, third], length, chain.damping_rate);
        if window * length < MIN_WINDOW * self.control.typical_advance {
            return 0.0;
        }
        self.step
            .amend(chain, block, about_start([second, third, fourth], s));
        if change == Change::Break {
            let beside = term_beside(second, square * chain.coupling[0][0]);
            let beside = about_start([0.0, 0.0, beside], s);
            if block > 0 {
                self.step.amend(chain, block - 1, beside);
            }
            if block + 1 < chain.layout.blocks {
                self.step.amend(chain, block + 1, beside);
            }
        }
        window
    }

    /// Expands the state into the series of a step that reaches at least `horizon` or as far as events let it.
    pub(super) fn expand(&mut self, horizon: f64) -> Result<(), SimulationError> {
        let max_step = self.tolerances.max_step;
        let wanted = self.control.typical_advance.min(horizon).min(max_step);
        let mut halvings = 0;
        let mut length = max_step;
        while halvings < MAX_HALVINGS && 0.5 * length >= wanted {
            halvings += 1;
            length *= 0.5;
        }
        let Slider { chain, state, .. } = &self.slider;
        loop {
            let min_order = self.control.min_orders.get(halvings).copied().unwrap_or(0);
            let drive = self.frame.step_drive(length);
            let input = StepInput {
                length,
                error: self.tolerances.step_error,
                min_order,
                drive,
            };
            let step = &mut self.step;
            if self.kernels.expand(chain, state, &input, &mut step.series) {
                self.control.note_order(halvings, step.series.order);
                step.series
                    .shear_force(drive, chain.drive_stiffness, &mut step.force);
                step.curvature_bound = polynomial::second_derivative_bound(&step.force);
                (step.start, step.length) = (self.frame.time, length);
                return Ok(());
            }
            halvings += 1;
            length *= 0.5;
            if halvings > HOPELESS_HALVINGS {
                return Err(SimulationError::NotFinite {
                    time: self.frame.now(),
                });
            }
        }
    }
}

/// The coefficients in s of δ2 ξ² + δ3 ξ³ + δ4 ξ⁴, with ξ = s - `at`.
fn about_start([second, third, fourth]: [f64; 3], at: f64) -> [f64; MERGED_ORDER + 1] {
    [
        at * at * (second - at * (third - at * fourth)),
        -at * (2.0 * second - at * (3.0 * third - 4.0 * at * fourth)),
        second - at * (3.0 * third - 6.0 * at * fourth),
        third - 4.0 * at * fourth,
        fourth,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn terms_about_an_event_are_the_same_about_the_start(
            second in -1.0_f64..1.0, third in -1.0_f64..1.0, fourth in -1.0_f64..1.0, at in 0.0_f64..1.0,
            s in 0.0_f64..1.0
        ) {
            let beyond = s - at;
            let expected = beyond * beyond * (second + beyond * (third + beyond * fourth));
            prop_assert!((polynomial::value(&about_start([second, third, fourth], at), s) - expected).abs() < 1e-13);
        }
    }
}
