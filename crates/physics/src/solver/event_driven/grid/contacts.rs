//! Contact events within a step of the grid, without redoing it.
//!
//! Within a step, s from 0 to 1, a block moves as X(s) = x + s q + ((r³ - r) a0 + (s³ - s) a1)/6 with r = 1 - s, where
//! a0 and a1 are h² x'' at both ends: of fourth order. An event at s' changes it by terms in ξ = s - s'
//! ([`event`](super::super::event)). Added at s = 1 they correct the displacement, and at s = 0, backwards, the
//! increment.
//!
//! In short: after a step, [`change_contacts`] first breaks what blocks have reached, then attaches what is due, in the
//! order of time at each block. Blocks beside see the change at the end of the step, not in it. For a block, [`Path`] is its motion within the step: breaks are found along it
//! ([`break_along`]) and bend it, and what has become of its end is added to the grid's motion ([`settle`]).

use super::Grid;
use super::step::{Correction, GridStep, add};
use crate::model::simd::Simd;
use crate::model::{ContactChange, Interface, ReachedContact};
use crate::solver::event_driven::event::{own_terms, term_beside};
use crate::solver::event_driven::moving_frame::StepDrive;
use crate::solver::event_driven::slider::{Slider, Slot};
use crate::solver::polynomial::{CUBIC, halley_step, rising_root, value_and_integral};

const SIXTH: f64 = 1.0 / 6.0;
/// A step of third order below this leaves an error of its cube: a billionth of a step of the grid.
const ENOUGH: f64 = 1e-3;
const MAX_HALLEY_STEPS: usize = 4;

/// The motion of one block within a step.
#[derive(Clone, Copy, Debug)]
struct Path {
    block: usize,
    /// Row and lane of the block, and its entry in the diagonal of S without contacts, in N/m.
    slot: Slot,
    bare: f64,
    /// Coefficients by s, in m.
    coefficients: [f64; 5],
    /// Where in the step its last event is.
    from: f64,
    /// Displacement at the end of the step and increment up to there without events, in m.
    eventless: Correction,
    /// What events add to the blocks beside.
    beside: Correction,
    /// What events add to ∫ X'² ds over the step, in m².
    dissipation: f64,
}

impl Path {
    /// The path of a block over the last step, under the present law.
    #[inline(always)]
    fn new(slider: &Slider, step: &GridStep, drive: &StepDrive, block: usize) -> Self {
        let x = &slider.state.displacement;
        let q = &step.increment;
        let place = step.places[block];
        let Slot { row, lane } = place.slot;
        let end = x[row][lane];
        let rise = q[row][lane];
        let beside = place.beside(x);
        let beside_start = beside - place.beside(q);
        let last_phi = step.phi_on(&place, end, beside, drive.displacement());
        let driven_before = drive.before(step.turn).displacement();
        let first_phi = step.phi_on(&place, end - rise, beside_start, driven_before);
        // x'' = φ - γh x' at both ends, with the slopes of this very path.
        let damping = step.damping;
        let from = damping.mul_add(-rise, first_phi);
        let to = damping.mul_add(-rise, last_phi);
        let [across, along_first, along_last] = step.damped;
        let first = across.mul_add(to, along_first * from);
        let last = across.mul_add(-from, along_last * to);
        let slope = SIXTH.mul_add(-2.0f64.mul_add(first, last), rise);
        let coefficients = [end - rise, slope, 0.5 * first, (last - first) * SIXTH, 0.0];
        Self {
            block,
            slot: place.slot,
            bare: slider.chain.bare[row][lane],
            coefficients,
            from: 0.0,
            eventless: Correction {
                displacement: end,
                increment: rise,
            },
            beside: Correction::default(),
            dissipation: 0.0,
        }
    }

    /// Displacement, slope and half the curvature at s, in m.
    #[inline(always)]
    fn at(&self, s: f64) -> [f64; 3] {
        let [c0, c1, c2, c3, c4] = self.coefficients;
        [
            c4.mul_add(s, c3)
                .mul_add(s, c2)
                .mul_add(s, c1)
                .mul_add(s, c0),
            (4.0 * c4)
                .mul_add(s, 3.0 * c3)
                .mul_add(s, 2.0 * c2)
                .mul_add(s, c1),
            (6.0 * c4).mul_add(s, 3.0 * c3).mul_add(s, c2),
        ]
    }

    /// Displacement at the end of the step, in m.
    #[inline(always)]
    fn end(&self) -> f64 {
        let [c0, c1, c2, c3, c4] = self.coefficients;
        (c0 + c1) + ((c2 + c3) + c4)
    }

    /// Adds δ2 ξ² + δ3 ξ³ + δ4 ξ⁴ from an event at s on.
    #[inline(always)]
    fn change_by(&mut self, s: f64, [second, third, fourth]: [f64; 3]) {
        let [c0, c1, c2, c3, c4] = &mut self.coefficients;
        *c0 = fourth
            .mul_add(s, -third)
            .mul_add(s, second)
            .mul_add(s * s, *c0);
        *c1 = (4.0 * fourth)
            .mul_add(s, -3.0 * third)
            .mul_add(s, 2.0 * second)
            .mul_add(-s, *c1);
        *c2 += (6.0 * fourth).mul_add(s, -3.0 * third).mul_add(s, second);
        *c3 += (4.0 * fourth).mul_add(-s, third);
        *c4 += fourth;
        self.from = s;
    }

    /// The same, with the dissipation, which is left out where nobody asks for it.
    #[cold]
    #[inline(never)]
    fn change_audited(&mut self, s: f64, terms: [f64; 3]) {
        let before = self.dissipation_from(s);
        self.change_by(s, terms);
        self.dissipation += self.dissipation_from(s) - before;
    }

    /// ∫ X'² ds from s to the end of the step, in m².
    fn dissipation_from(&self, s: f64) -> f64 {
        let [_, c1, c2, c3, c4] = self.coefficients;
        let slope = [c1, 2.0 * c2, 3.0 * c3, 4.0 * c4];
        let mut square = [0.0; 7];
        for (i, one) in slope.into_iter().enumerate() {
            for (j, other) in slope.into_iter().enumerate() {
                square[i + j] += one * other;
            }
        }
        let until = |s| value_and_integral(&square, s).1;
        until(1.0) - until(s)
    }

    /// Where in the rest of the step the block reaches `level` m, which it has passed at the end: Halley's steps from
    /// where Hermite's cubic has it, that of s by displacement with the slopes at both ends of the step.
    #[inline(always)]
    fn crossing(&self, level: f64) -> f64 {
        let within = |s: f64| {
            if s > self.from {
                if s < 1.0 { s } else { 1.0 }
            } else {
                self.from
            }
        };
        let [c0, c1, c2, c3, c4] = self.coefficients;
        let rise = self.end() - c0;
        // Slopes above 3 let a cubic turn back.
        let limited = |slope: f64| {
            if slope > 0.0 && slope < 3.0 {
                slope
            } else {
                3.0
            }
        };
        let [at_start, at_end] = [
            limited(rise / c1),
            limited(rise / (c1 + 2.0 * c2 + (3.0 * c3 + 4.0 * c4))),
        ];
        let part = (level - c0) / rise;
        let rest = 1.0 - part;
        let mut s =
            within(part * (part * (1.0 + 2.0 * rest) + rest * (rest * at_start - part * at_end)));
        let mut is_there = false;
        for _ in 0..MAX_HALLEY_STEPS {
            let [x, slope, half_curvature] = self.at(s);
            let short = level - x;
            s = within(s + short * slope / slope.mul_add(slope, short * half_curvature));
            is_there = short.abs() < ENOUGH * slope.abs() && s > self.from && s < 1.0;
            if is_there {
                break;
            }
        }
        if is_there {
            s
        } else {
            self.careful_crossing(level, s)
        }
    }

    /// The same where a path turns about.
    #[cold]
    #[inline(never)]
    fn careful_crossing(&self, level: f64, guess: f64) -> f64 {
        let sign = if self.end() >= level { 1.0 } else { -1.0 };
        let mut beyond = self.coefficients.map(|coefficient| sign * coefficient);
        beyond[0] -= sign * level;
        rising_root(self.from, 1.0, guess, CUBIC, |s| halley_step(&beyond, s))
    }
}

/// The events of a step.
#[derive(Clone, Debug, Default)]
pub(super) struct StepEvents {
    /// Whether attachments are collected, too.
    pub wants_attachments: bool,
    /// Time in the frame up to which anything happens, in s.
    pub cut: f64,
    /// What has happened, in the order of time, in the frame; and how often in this run of steps.
    pub changes: Vec<ContactChange>,
    pub breaks: u64,
    pub reattachments: u64,
    /// Means over the blocks after breaks, in m.
    pub mean_displacement: f64,
    pub mean_increment: f64,
    /// Blocks that reach a break position, and where in the step.
    paths: Vec<(Path, f64)>,
    /// Times of attachments that are not collected, in the frame, in s, in order.
    pub attachments: Vec<f64>,
    /// Contacts that a block reaches.
    contacts: Vec<ReachedContact>,
}

/// Breaks and attaches what the last step reaches and what is due in it, in the order of time at each block. The step
/// began at `start` s in the frame.
#[inline(always)]
pub(super) fn change_contacts<S: Simd>(simd: S, slider: &mut Slider, grid: &mut Grid, start: f64) {
    break_reached(simd, slider, grid, start);
    attach_due(simd, slider, grid, start);
    let changes = &mut grid.events.changes;
    if !changes.is_sorted_by(|a, b| a.time <= b.time) {
        changes.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
}

/// Breaks what the last step reaches: stage after stage over all blocks, as one alone would wait for its own results.
#[inline(always)]
fn break_reached<S: Simd>(simd: S, slider: &mut Slider, grid: &mut Grid, start: f64) {
    let Grid {
        step,
        drive,
        events,
        ..
    } = grid;
    let mut paths = std::mem::take(&mut events.paths);
    paths.clear();
    for &slot in &step.reached {
        let block = slider.chain.layout.block(slot);
        paths.push((Path::new(slider, step, drive, block), 0.0));
    }
    for (path, first) in &mut paths {
        let upper = slider.interface.block_upper[path.block];
        let lower = slider.interface.block_lower[path.block];
        let is_above = path.eventless.displacement >= upper;
        *first = path.crossing(if is_above { upper } else { lower });
    }
    for (path, first) in &mut paths {
        let interface = &mut slider.interface;
        break_along(simd, interface, step, events, path, Some(*first), start);
        settle(simd, slider, step, path);
    }
    events.paths = paths;
}

/// Attaches what is due within the last step: breaks may have made it so, and what attaches lets a block reach other
/// contacts or not.
#[inline(always)]
fn attach_due<S: Simd>(simd: S, slider: &mut Slider, grid: &mut Grid, start: f64) {
    let Grid {
        step,
        drive,
        events,
        ..
    } = grid;
    let end = events.cut.min(start + step.length);
    while let Some(due) = slider.interface.next_reattachment_by(end) {
        let block = due.block();
        let s = ((due.time() - start) * step.inverse_length).clamp(0.0, 1.0);
        let left = 1.0 - s;
        let place = step.places[block];
        let Slot { row, lane } = place.slot;
        let x = &slider.state.displacement;
        let end = x[row][lane];
        let rise = step.increment[row][lane];
        let phi = step.phi_on(&place, end, place.beside(x), drive.displacement());
        // A cubic from the end is enough, as the force of an unstressed contact only grows.
        let bend = step.damping.mul_add(-rise, phi);
        let jerk = step.gain_of_phi(&place, rise, place.beside(&step.increment), drive);
        let x = end - left * (rise + s * (0.5 * bend - SIXTH * (1.0 + left) * jerk));
        let change = slider.interface.reattach_running(simd, x);
        if events.wants_attachments {
            events.changes.push(change);
        } else {
            events.attachments.push(change.time);
        }
        events.reattachments += 1;
        let slope = rise + (s - 0.5) * bend;
        let third = -SIXTH * step.by_mass * change.stiffness * slope;
        if step.end_phi.is_some() {
            let mut path = Path::new(slider, step, drive, block);
            path.change_audited(s, [0.0, third, 0.0]);
            step.add_dissipation(path.dissipation);
        }
        let [ahead, back] = [left, s].map(|part| third * (part * part * part));
        add(simd, &mut slider.state.displacement, place.slot, ahead);
        add(simd, &mut step.increment, place.slot, ahead + back);
        let interface = &mut slider.interface;
        let levels = [interface.block_upper[block], interface.block_lower[block]];
        if end + ahead < levels[0] && end + ahead > levels[1] {
            let diagonal = slider.chain.bare[row][lane] + interface.block_stiffness[block];
            step.update(
                simd,
                place.slot,
                diagonal,
                interface.block_pull[block],
                levels,
            );
            continue;
        }
        let mut path = Path::new(slider, step, drive, block);
        path.from = s;
        break_along(
            simd,
            &mut slider.interface,
            step,
            events,
            &mut path,
            None,
            start,
        );
        settle(simd, slider, step, &path);
    }
}

/// Breaks what a block reaches along its path, contact after contact, up to where the next one is due to attach.
/// `first` is where it reaches the nearest break position, if that is known.
#[inline(always)]
fn break_along<S: Simd>(
    simd: S,
    interface: &mut Interface,
    step: &GridStep,
    events: &mut StepEvents,
    path: &mut Path,
    mut first: Option<f64>,
    start: f64,
) {
    let block = path.block;
    loop {
        let end = path.end();
        if end < interface.block_upper[block] && end > interface.block_lower[block] {
            return;
        }
        interface.reached(simd, block, end, &mut events.contacts);
        let own = step.by_mass * (path.bare + interface.block_stiffness[block]);
        let mut until = interface.next_reattachment_at(block, start + step.length);
        until = until.min(events.cut);
        let mut broken = 0;
        for &ReachedContact { contact, level } in &events.contacts {
            let s = first.take().unwrap_or_else(
                #[inline(always)]
                || path.crossing(level),
            );
            let time = start + s * step.length;
            if time > until {
                break;
            }
            let (change, due) = interface.break_contact(simd, block, contact, time, level);
            let [_, slope, half_curvature] = path.at(s);
            let stiffened = -step.by_mass * change.stiffness;
            let forces = [
                step.by_mass * change.force,
                -stiffened * slope,
                -stiffened * half_curvature,
            ];
            let terms = own_terms(forces, step.damping, own);
            if step.end_phi.is_some() {
                path.change_audited(s, terms);
            } else {
                path.change_by(s, terms);
            }
            let [ahead, back] = [(1.0 - s) * (1.0 - s), s * s];
            let [ahead, back] = [ahead * ahead, back * back];
            let beside = term_beside(terms[0], step.coupling);
            path.beside.displacement += beside * ahead;
            path.beside.increment += beside * (ahead - back);
            events.changes.push(change);
            until = until.min(due);
            broken += 1;
        }
        if broken == 0 {
            // Something attaches before, or the path is not a number and the run ends soon.
            return;
        }
        events.breaks += broken;
        interface.gather(simd, block);
    }
}

/// Enters what has happened to a block into the motion.
#[inline(always)]
fn settle<S: Simd>(simd: S, slider: &mut Slider, step: &mut GridStep, path: &Path) {
    let Slider {
        interface, state, ..
    } = slider;
    let block = path.block;
    let levels = [interface.block_upper[block], interface.block_lower[block]];
    step.update(
        simd,
        path.slot,
        path.bare + interface.block_stiffness[block],
        interface.block_pull[block],
        levels,
    );
    let displacement = path.end();
    let own = Correction {
        displacement: displacement - path.eventless.displacement,
        increment: displacement - path.coefficients[0] - path.eventless.increment,
    };
    step.correct(simd, block, [own, path.beside], &mut state.displacement);
    step.add_dissipation(path.dissipation);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn path(coefficients: [f64; 5], from: f64) -> Path {
        let none = Correction::default();
        Path {
            block: 0,
            slot: Slot::FIRST,
            bare: 0.0,
            coefficients,
            from,
            eventless: none,
            beside: none,
            dissipation: 0.0,
        }
    }

    proptest! {
        #[test]
        fn an_event_changes_a_path_about_where_it_is(
            coefficients in prop::array::uniform5(-1.0_f64..1.0), change in prop::array::uniform3(-1.0_f64..1.0),
            event in 0.0_f64..1.0, s in 0.0_f64..1.0
        ) {
            let before = path(coefficients, 0.0);
            let mut after = before;
            after.change_by(event, change);
            let (by, [second, third, fourth]) = (s - event, change);
            let expected = [
                by * by * (second + by * (third + by * fourth)),
                by * (2.0 * second + by * (3.0 * third + by * 4.0 * fourth)),
                second + by * (3.0 * third + by * 6.0 * fourth),
            ];
            for ((after, before), expected) in after.at(s).into_iter().zip(before.at(s)).zip(expected) {
                prop_assert!((after - before - expected).abs() < 1e-14);
            }
            prop_assert!((after.end() - after.at(1.0)[0]).abs() < 1e-14);
        }

        /// Blocks that have passed a break position mostly came straight to it; some turn about.
        #[test]
        fn a_crossing_is_where_the_path_is_at_the_level(
            slope in 0.2_f64..1.0, curved in prop::array::uniform3(-0.05_f64..0.05), about in 0.0_f64..0.9, part in 0.0_f64..1.0,
            falls in any::<bool>()
        ) {
            let sign = if falls { -1.0 } else { 1.0 };
            let path = path([0.3, sign * slope, curved[0], curved[1], curved[2]], about);
            let [from, to] = [about, 1.0].map(|s| path.at(s)[0]);
            let level = from + part * (to - from);
            let s = path.crossing(level);
            prop_assert!((about..=1.0).contains(&s), "{}", s);
            let [x, ..] = path.at(s);
            prop_assert!((x - level).abs() < 1e-8, "{} at {}, not {}", x, s, level);
        }
    }

    #[test]
    fn a_path_is_at_once_at_the_level_where_it_begins() {
        let curved = [
            0.028_374_695_423_159_856,
            0.045_693_419_018_870_99,
            0.026_611_963_530_136_448,
        ];
        let from = 0.278_173_423_255_389_96;
        let path = path(
            [
                0.3,
                -0.281_292_960_401_967_8,
                curved[0],
                curved[1],
                curved[2],
            ],
            from,
        );
        let s = path.crossing(path.at(from)[0]);
        assert!((s - from).abs() < 1e-8, "{s}");
    }

    #[test]
    fn a_path_that_does_not_move_crosses_within_the_step() {
        let s = path([0.3, 0.0, 0.0, 0.0, 0.0], 0.25).crossing(0.3);
        assert!((0.25..=1.0).contains(&s), "{s}");
    }
}
