//! One Taylor step, and the contact events on its way.
//!
//! An event changes the force on one block j, by (ΔP - ΔK x_j)/m per mass, where K and P are the sums of k_i and of k_i a_i
//! over its attached contacts. With ξ the position in the step since the event, x_j(ξ) = Σ c_p ξ^p and g_p = h² (ΔP - ΔK x_j)_p/m,
//! the motion changes by
//!
//! ```text
//! at j:         δ2 ξ² + δ3 ξ³ + δ4 ξ⁴,   δ2 = g_0/2,   δ3 = g_1/6 - γh δ2/3,   δ4 = g_2/12 - γh δ3/4 - h² S_jj/m δ2/12
//! at j-1, j+1:  h² K_int/m δ2/12 ξ⁴
//! ```
//!
//! and by terms of higher order that spread along the chain. As long as these are under a small part of the error of a step, the
//! event is merged into it: the change is added to the series, which stays right from the event on. The step ends where it no longer
//! would. Contract: events in the right order, also of blocks whose series has changed.

use super::crossing::first_exit;
use super::taylor::{DriveTerms, StepInput};
use super::{FRAME_SPAN, LONGEST_STEP, MOST_HALVINGS, Run};
use crate::model::Change;
use crate::solver::polynomial;
use crate::solver::segment::{ForceAt, ForcePath, Segment};
use crate::solver::{Observer, SimulationError};

/// Halvings at which a series that does not converge ends the run.
const HOPELESS_HALVINGS: usize = 60;
/// A step must span so many units in the last place of the time, so that events are located to a millionth of it.
const LEAST_RESOLUTION: f64 = 1_048_576.0;
/// Order up to which an event changes the series.
const MERGED_ORDER: usize = 4;
/// Events that may be merged into one step.
const MOST_MERGED: u32 = 16;
/// An event is merged only if the step can go on for so long, in units of how far recent steps came.
const LEAST_WINDOW: f64 = 0.5;
/// Part of a step's error that one merged event may leave out: little, since these errors have one sign.
const MERGED_SHARE: f64 = 2e-3;

impl Run<'_> {
    /// One Taylor step of at most `horizon` s, to its end or soon after the first events on its way.
    pub(super) fn step(&mut self, horizon: f64, observer: &mut dyn Observer) -> Result<(), SimulationError> {
        let until_attach = self.interface.next_reattachment() - self.time + self.attach_window;
        let length = self.expand(horizon.min(until_attach))?;
        if length < LEAST_RESOLUTION * f64::EPSILON * self.time.max(FRAME_SPAN) {
            return Err(SimulationError::StepTooShort { time: self.epoch + self.time, step: length });
        }
        self.summary.steps += 1;
        let start = self.time;
        let (mut done, mut end, mut merged) = (0.0, (horizon / length).min(1.0), 0);
        let mut force = ForceAt { force: self.force[0], integral: 0.0 };
        self.kernels.reachable(&self.chain, &mut self.series, &mut self.candidates);
        self.breaks.clear();
        while let Some((row, lane)) = self.candidates.pop() {
            let found = self.look_for_break(self.chain.layout.block(row, lane), 0.0, end);
            // What comes so long after an event is left to the next step.
            end = end.min(found + self.break_window / length);
        }
        loop {
            let due = ((self.interface.next_reattachment() - start) / length).max(done);
            let event = match self.first_break() {
                Some((s, block)) if s <= due && s <= end => Some((Change::Break, block, s)),
                _ if due <= end => self.interface.next_reattachment_block().map(|block| (Change::Attach, block, due)),
                _ => None,
            };
            let s = event.map_or(end, |(_, _, s)| s);
            force = self.tell(start, [done, s], force, length, observer);
            done = s;
            self.time = start + s * length;
            let Some((change, block, _)) = event else { break };
            if change == Change::Attach {
                self.time = self.interface.next_reattachment();
            }
            let window = self.change(change, block, s, force.force, length, observer);
            match change {
                Change::Break => self.break_window = window * length,
                Change::Attach => self.attach_window = window * length,
            }
            merged += 1;
            if window == 0.0 || merged == MOST_MERGED {
                break;
            }
            end = end.min(s + window);
            while let Some(block) = self.amended.pop() {
                self.breaks.retain(|&(_, other)| other != block);
                self.look_for_break(block, s, end);
                if block == 0 {
                    // The same force from here on, as another polynomial.
                    force.integral = ForceAt::new(&self.force, s).integral;
                }
            }
        }
        self.kernels.evaluate(&self.series, done, length, &mut self.state);
        self.set_time(self.time);
        self.passed_force = self.passed_force.max(force.force);
        let covered = if done == 1.0 { 2.0 * length } else { done * length };
        self.typical_advance += 0.25 * (covered - self.typical_advance);
        Ok(())
    }

    /// Tells the observer, and the ledger if there is one, of a part of the step; `force` is the shear force at its start.
    /// Returns that at its end.
    fn tell(
        &mut self,
        start: f64,
        [first, last]: [f64; 2],
        force: ForceAt,
        length: f64,
        observer: &mut dyn Observer,
    ) -> ForceAt {
        let end_force = ForceAt::new(&self.force, last);
        let (coefficients, bend, scale, ends) = (&self.force[..], self.force_bend, length, [force, end_force]);
        observer.advance(&Segment {
            start: self.epoch + (start + first * length),
            duration: (last - first) * length,
            path: ForcePath::Polynomial { coefficients, bend, first, scale, ends },
        });
        if let Some(audit) = &mut self.audit {
            audit.follow_series(self.kernels, &self.chain, &self.series, [first, last], length);
        }
        end_force
    }

    /// Notes when a block first breaks in a part of the step, if it does, and returns it; else infinite.
    fn look_for_break(&mut self, block: usize, from: f64, end: f64) -> f64 {
        let (row, lane) = self.chain.layout.slot(block);
        let levels = [self.chain.lower[row][lane], self.chain.upper[row][lane]];
        let [least, most] = self.series.range(row, lane);
        if least > levels[0] && most < levels[1] {
            return f64::INFINITY;
        }
        self.series.block(row, lane, &mut self.coefficients);
        let Some(s) = first_exit(&mut self.coefficients, levels, from, end) else { return f64::INFINITY };
        self.breaks.push((s, block));
        s
    }

    /// The first break noted; ties go to the smaller block.
    fn first_break(&self) -> Option<(f64, usize)> {
        self.breaks.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
    }

    /// Breaks what is reached at a block, or attaches what is due there, at s in the step. Returns how far beyond s the
    /// series stays right; 0 if the step must end.
    fn change(
        &mut self,
        change: Change,
        block: usize,
        s: f64,
        force: f64,
        length: f64,
        observer: &mut dyn Observer,
    ) -> f64 {
        let (row, lane) = self.chain.layout.slot(block);
        self.series.block(row, lane, &mut self.coefficients);
        let [x, slope, bend] = polynomial::expanded(&self.coefficients, s);
        let (stiffness, pull) = (self.interface.block_stiffness[block], self.interface.block_pull[block]);
        match change {
            Change::Break => self.break_block(block, x, force, observer),
            Change::Attach => self.attach_next(x, observer),
        }
        if self.series.order < MERGED_ORDER {
            return 0.0;
        }
        let square = length * length;
        let stiffened = (self.interface.block_stiffness[block] - stiffness) * square / self.mass;
        let pulled = (self.interface.block_pull[block] - pull) * square / self.mass;
        let damping = self.chain.damping_rate * length;
        let second = 0.5 * (pulled - stiffened * x);
        let third = -stiffened * slope / 6.0 - damping * second / 3.0;
        let own = square * self.chain.diagonal[row][lane];
        let fourth = -stiffened * bend / 12.0 - 0.25 * damping * third - own * second / 12.0;
        let window = self.window(second, third, length);
        if window * length < LEAST_WINDOW * self.typical_advance {
            return 0.0;
        }
        self.amend(block, about_zero([second, third, fourth], s));
        if change == Change::Break {
            let beside = about_zero([0.0, 0.0, square * self.chain.coupling[0][0] * second / 12.0], s);
            if block > 0 {
                self.amend(block - 1, beside);
            }
            if block + 1 < self.chain.layout.blocks {
                self.amend(block + 1, beside);
            }
        }
        window
    }

    /// How far the terms of higher order that follow from δ2 and δ3 stay under the error of a step. At the fastest frequency
    /// ω they are at most (ωh)² (δ3/20 + γh δ2/60) ξ⁵ and (ωh)⁴ δ2/720 ξ⁶.
    fn window(&self, second: f64, third: f64, length: f64) -> f64 {
        let angle = LONGEST_STEP * length / self.longest_step;
        let square = angle * angle;
        let damping = self.chain.damping_rate * length;
        let fifth = square * (third.abs() / 20.0 + damping * second.abs() / 60.0);
        let sixth = square * square * second.abs() / 720.0;
        let error = MERGED_SHARE * self.truncation;
        root_below::<5>(error / fifth).min(root_below::<6>(error / sixth)).min(1.0)
    }

    /// Adds to the series of a block.
    fn amend(&mut self, block: usize, coefficients: [f64; MERGED_ORDER + 1]) {
        let (row, lane) = self.chain.layout.slot(block);
        self.series.add(row, lane, &coefficients);
        self.amended.push(block);
        if block == 0 {
            for (force, coefficient) in self.force.iter_mut().zip(coefficients) {
                *force -= self.drive.stiffness * coefficient;
            }
            self.force_bend = polynomial::second_derivative_bound(&self.force);
        }
    }

    /// Expands the state into a series that reaches at least `horizon` or as far as events let it; returns its length.
    pub(super) fn expand(&mut self, horizon: f64) -> Result<f64, SimulationError> {
        let wanted = self.typical_advance.min(horizon).min(self.longest_step);
        let mut halvings = 0;
        let mut length = self.longest_step;
        while halvings < MOST_HALVINGS && 0.5 * length >= wanted {
            halvings += 1;
            length *= 0.5;
        }
        loop {
            let least_order = self.least_orders.get(halvings).copied().unwrap_or(0);
            let drive = self.drive_terms(length);
            let pulling = self.drive.stiffness / self.mass;
            let input = StepInput { length, error: self.truncation, least_order, pulling, drive };
            if self.kernels.expand(&self.chain, &self.state, &input, &mut self.series) {
                if let Some(least_order) = self.least_orders.get_mut(halvings) {
                    // Reached at the first look: look earlier next time.
                    let order = self.series.order;
                    *least_order = if order <= *least_order + 1 { order - 2 } else { order };
                }
                self.series.shear_force(drive, self.drive.stiffness, &mut self.force);
                self.force_bend = polynomial::second_derivative_bound(&self.force);
                return Ok(length);
            }
            halvings += 1;
            length *= 0.5;
            if halvings > HOPELESS_HALVINGS {
                return Err(SimulationError::NotFinite { time: self.epoch + self.time });
            }
        }
    }

    /// The drive's displacement over a step of so many seconds.
    fn drive_terms(&self, length: f64) -> DriveTerms {
        let ramp = self.ramp_at_epoch + self.drive.velocity * self.time;
        DriveTerms {
            ramp: [ramp, self.drive.velocity * length],
            swing: self.swing,
            angle: self.drive.angular_frequency * length,
        }
    }
}

/// A number somewhat below the N-th root of a positive one: the N-th part of its logarithm, as its bits give it.
fn root_below<const N: u64>(value: f64) -> f64 {
    const ONE: u64 = 1.0_f64.to_bits();
    0.9 * f64::from_bits(value.to_bits() / N + (ONE - ONE / N))
}

/// The coefficients in s of δ2 ξ² + δ3 ξ³ + δ4 ξ⁴, with ξ = s - `at`.
fn about_zero([second, third, fourth]: [f64; 3], at: f64) -> [f64; MERGED_ORDER + 1] {
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
        fn a_root_from_the_bits_lies_below_the_root_and_not_far(exponent in -60.0_f64..0.0) {
            let value = libm::pow(10.0, exponent);
            for (root, exact) in
                [(root_below::<5>(value), libm::pow(value, 0.2)), (root_below::<6>(value), libm::pow(value, 1.0 / 6.0))]
            {
                prop_assert!(root <= exact && root > 0.8 * exact, "{} for {}", root, exact);
            }
        }

        #[test]
        fn terms_about_an_event_are_the_same_about_the_start(
            second in -1.0_f64..1.0, third in -1.0_f64..1.0, fourth in -1.0_f64..1.0, at in 0.0_f64..1.0, s in 0.0_f64..1.0
        ) {
            let beyond = s - at;
            let expected = beyond * beyond * (second + beyond * (third + beyond * fourth));
            prop_assert!((polynomial::value(&about_zero([second, third, fourth], at), s) - expected).abs() < 1e-13);
        }
    }
}
