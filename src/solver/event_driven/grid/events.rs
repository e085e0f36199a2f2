//! Contact events within a step of the grid, without redoing it.
//!
//! Within a step, σ from 0 to 1, a block moves as X(σ) = x + σ q + ((r³ - r) a0 + (σ³ - σ) a1)/6 with r = 1 - σ, where
//! a0 and a1 are h² x'' at both ends: of fourth order. An event at s changes the force on its block and so its motion by
//! δ2 ξ² + δ3 ξ³ + δ4 ξ⁴, ξ = σ - s, and that of its neighbours by h² K_int/m δ2/12 ξ⁴; see [`super::super::step`], where
//! the same terms are derived. Added at ξ = 1 - s they correct the displacement, and at ξ = -s, backwards, the increment.

use super::super::slider::Slider;
use super::Grid;
use super::step::{GridDrive, GridStep};
use crate::model::{ContactEvent, Interface};

const SIXTH: f64 = 1.0 / 6.0;
/// A step of third order below this leaves an error of its cube, and one of Newton's an error of its square: a billionth of a
/// step or less.
const CUBIC: f64 = 1e-3;
const QUADRATIC: f64 = 1e-5;
const MAX_NEWTON_STEPS: usize = 4;

/// The motion of one block within a step, as a polynomial about its last event.
#[derive(Clone, Copy, Debug)]
struct Path {
    block: usize,
    /// Row and lane of the block, and its entry in the diagonal of S without contacts, in N/m.
    slot: (usize, usize),
    bare: f64,
    /// Where in the step it is expanded.
    about: f64,
    /// Coefficients in σ - `about`, in m.
    coefficients: [f64; 5],
    /// Displacement at the end of the step and increment up to there without events, in m.
    eventless: Correction,
    /// What events add to the blocks beside.
    beside: Correction,
}

/// Displacement at the end of a step and increment from its start, or what events add to them, in m.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Correction {
    pub displacement: f64,
    pub increment: f64,
}

impl Path {
    /// The path of a block over the last step.
    #[inline(always)]
    fn new(slider: &Slider, step: &GridStep, drive: &GridDrive, block: usize, (row, lane): (usize, usize)) -> Self {
        let layout = slider.chain.layout;
        let x = &slider.state.displacement;
        let end = x[row][lane];
        let rise = step.increment[row][lane];
        let [before, after] = layout.beside(row, lane).map(|slot| slot.map_or(0.0, |(row, lane)| x[row][lane]));
        let mut force = step.force_on(row, lane, [before, end, after]);
        if block == 0 {
            force += step.pulling * drive.displacement();
        }
        // x'' = φ - γh x' at both ends, with the slopes of this very path.
        let damping = step.damping;
        let (from, to) = (step.force[row][lane] - damping * rise, force - damping * rise);
        let inverse = step.inverse_damped;
        let first = ((1.0 + 2.0 * SIXTH * damping) * from + SIXTH * damping * to) * inverse;
        let last = ((1.0 - 2.0 * SIXTH * damping) * to - SIXTH * damping * from) * inverse;
        let coefficients = [end - rise, rise - (2.0 * first + last) * SIXTH, 0.5 * first, (last - first) * SIXTH, 0.0];
        let bare = slider.chain.bare[row][lane];
        let eventless = Correction { displacement: end, increment: rise };
        Self { block, slot: (row, lane), bare, about: 0.0, coefficients, eventless, beside: Correction::default() }
    }

    /// Displacement at a point of the step, in m.
    #[inline(always)]
    fn at(&self, s: f64) -> f64 {
        let [c0, c1, c2, c3, c4] = self.coefficients;
        let beyond = s - self.about;
        c0 + beyond * (c1 + beyond * (c2 + beyond * (c3 + beyond * c4)))
    }

    /// Adds δ2 ξ² + δ3 ξ³ + δ4 ξ⁴ from the point of expansion on.
    #[inline(always)]
    fn change_by(&mut self, [second, third, fourth]: [f64; 3]) {
        self.coefficients[2] += second;
        self.coefficients[3] += third;
        self.coefficients[4] += fourth;
    }

    /// Expands it about another point of the step.
    #[inline(always)]
    fn move_to(&mut self, s: f64) {
        let by = s - self.about;
        let [c0, c1, c2, c3, c4] = self.coefficients;
        self.coefficients = [
            c0 + by * (c1 + by * (c2 + by * (c3 + by * c4))),
            c1 + by * (2.0 * c2 + by * (3.0 * c3 + by * 4.0 * c4)),
            c2 + by * (3.0 * c3 + by * 6.0 * c4),
            c3 + by * 4.0 * c4,
            c4,
        ];
        self.about = s;
    }

    /// Where in the rest of the step the block reaches `level` m, which it has passed at the end: two steps of Halley's,
    /// the first from the point of expansion, and where they do not suffice Newton's.
    #[inline(always)]
    fn crossing(&self, level: f64) -> f64 {
        let [c0, c1, c2, c3, c4] = self.coefficients;
        let (before, left) = (c0 - level, 1.0 - self.about);
        let within = |beyond: f64| if beyond > 0.0 { if beyond < left { beyond } else { left } } else { 0.0 };
        let halley = |height: f64, slope: f64, half: f64| height * slope / (slope * slope - height * half);
        let s = within(-halley(before, c1, c2));
        let height = before + s * (c1 + s * (c2 + s * (c3 + s * c4)));
        let slope = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4)));
        let half = c2 + s * (3.0 * c3 + s * (6.0 * c4));
        let (mut last, mut enough) = (s, CUBIC);
        let mut s = within(s - halley(height, slope, half));
        for _ in 0..MAX_NEWTON_STEPS {
            if (s - last).abs() < enough {
                break;
            }
            let height = before + s * (c1 + s * (c2 + s * (c3 + s * c4)));
            let slope = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4)));
            (s, last, enough) = (within(s - height / slope), s, QUADRATIC);
        }
        self.about + s
    }
}

/// The events of a step.
#[derive(Clone, Debug, Default)]
pub(super) struct StepEvents {
    /// Whether attachments are collected, too.
    pub tells_attachments: bool,
    /// What has happened, in the order of time, in the frame; and how often in this run of steps.
    pub events: Vec<ContactEvent>,
    pub breaks: u64,
    pub reattachments: u64,
    /// Paths of the blocks to which it has.
    paths: Vec<Path>,
    /// Contacts that a block reaches, and where they break, in m.
    contacts: Vec<(f64, usize)>,
}

/// Breaks and attaches what the last step reaches and what is due in it, in the order of time at each block. The step began
/// at `start` s in the frame.
#[inline(always)]
pub(super) fn change_contacts(slider: &mut Slider, grid: &mut Grid, start: f64) {
    let Grid { step, drive, events, .. } = grid;
    let StepEvents { paths, .. } = events;
    paths.clear();
    for &(row, lane) in &step.reached {
        let block = slider.chain.layout.block(row, lane);
        paths.push(Path::new(slider, step, drive, block, (row, lane)));
    }
    let end = start + step.length;
    loop {
        let mut paths = std::mem::take(&mut events.paths);
        for path in &mut paths {
            break_along(&mut slider.interface, step, events, path, start);
        }
        events.paths = paths;
        // Breaks may have made something due within the step.
        let Some((due, block)) = slider.interface.next_reattachment_by(end) else { break };
        let known = events.paths.iter().position(|path| path.block == block);
        let mut path = match known {
            Some(index) => events.paths.swap_remove(index),
            None => Path::new(slider, step, drive, block, slider.chain.layout.slot(block)),
        };
        path.move_to(((due - start) * step.inverse_length).clamp(0.0, 1.0));
        attach(&mut slider.interface, step, events, &mut path);
        events.paths.push(path);
    }
    for path in &events.paths {
        settle(slider, step, path);
    }
    if !events.events.is_sorted_by(|a, b| a.time <= b.time) {
        events.events.sort_by(|a, b| a.time.total_cmp(&b.time));
    }
}

/// Breaks what a block reaches along its path, contact after contact, up to where the next one is due to attach.
#[inline(always)]
fn break_along(interface: &mut Interface, step: &GridStep, events: &mut StepEvents, path: &mut Path, start: f64) {
    let block = path.block;
    loop {
        let end = path.at(1.0);
        if end < interface.block_upper[block] && end > interface.block_lower[block] {
            return;
        }
        interface.reached(block, end, &mut events.contacts);
        let own = step.by_mass * (path.bare + interface.block_stiffness[block]);
        let mut until = interface.next_reattachment_at(block, start + step.length);
        let mut broken = 0;
        for &(level, contact) in &events.contacts {
            let s = path.crossing(level);
            let time = start + s * step.length;
            if time > until {
                break;
            }
            path.move_to(s);
            path.coefficients[0] = level;
            let (event, due) = interface.break_contact(block, contact, time, level);
            let [_, slope, half_curvature, ..] = path.coefficients;
            let stiffened = -step.by_mass * event.stiffness;
            let second = 0.5 * step.by_mass * event.force;
            let third = -SIXTH * (stiffened * slope + 2.0 * step.damping * second);
            let fourth = -0.5 * SIXTH * (stiffened * half_curvature + own * second) - 0.25 * step.damping * third;
            path.change_by([second, third, fourth]);
            let (ahead, back) = (1.0 - path.about, path.about);
            let [ahead, back] = [ahead * ahead, back * back].map(|square| square * square);
            let beside = 0.5 * SIXTH * step.coupling * second;
            path.beside.displacement += beside * ahead;
            path.beside.increment += beside * (ahead - back);
            events.events.push(event);
            until = until.min(due);
            broken += 1;
        }
        if broken == 0 {
            // Something attaches before, or the path is not a number and the run ends soon.
            return;
        }
        events.breaks += broken;
        interface.gather(block);
    }
}

/// Attaches the contact that is due where a path is expanded: unstressed there, so that its force only grows.
#[inline(always)]
fn attach(interface: &mut Interface, step: &GridStep, events: &mut StepEvents, path: &mut Path) {
    let [x, slope, half_curvature, ..] = path.coefficients;
    let event = interface.reattach_next(x);
    if events.tells_attachments {
        events.events.push(event);
    }
    events.reattachments += 1;
    let stiffened = step.by_mass * event.stiffness;
    let third = -SIXTH * stiffened * slope;
    let fourth = -0.5 * SIXTH * stiffened * half_curvature - 0.25 * step.damping * third;
    path.change_by([0.0, third, fourth]);
}

/// Enters what has happened to a block into the motion.
#[inline(always)]
fn settle(slider: &mut Slider, step: &mut GridStep, path: &Path) {
    let Slider { chain, interface, state } = slider;
    chain.update(path.block, interface);
    let displacement = path.at(1.0);
    let own = Correction {
        displacement: displacement - path.eventless.displacement,
        increment: displacement - path.at(0.0) - path.eventless.increment,
    };
    step.correct(chain, path.block, path.slot, [own, path.beside], &mut state.displacement);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn path(coefficients: [f64; 5], about: f64) -> Path {
        let none = Correction::default();
        Path { block: 0, slot: (0, 0), bare: 0.0, about, coefficients, eventless: none, beside: none }
    }

    proptest! {
        #[test]
        fn a_path_is_the_same_about_any_point(
            coefficients in prop::array::uniform5(-1.0_f64..1.0), from in 0.0_f64..1.0, to in 0.0_f64..1.0, s in 0.0_f64..1.0
        ) {
            let before = path(coefficients, from);
            let mut after = before;
            after.move_to(to);
            prop_assert!((before.at(s) - after.at(s)).abs() < 1e-14);
        }

        /// Paths that rise: a block that has passed a break position mostly came straight to it.
        #[test]
        fn a_crossing_is_where_the_path_is_at_the_level(
            slope in 0.2_f64..1.0, curved in prop::array::uniform3(-0.05_f64..0.05), about in 0.0_f64..0.9, part in 0.0_f64..1.0,
            falls in any::<bool>()
        ) {
            let sign = if falls { -1.0 } else { 1.0 };
            let path = path([0.3, sign * slope, curved[0], curved[1], curved[2]], about);
            let level = path.at(about) + part * (path.at(1.0) - path.at(about));
            let s = path.crossing(level);
            prop_assert!((about..=1.0).contains(&s), "{}", s);
            prop_assert!((path.at(s) - level).abs() < 1e-8, "{} at {}, not {}", path.at(s), s, level);
        }
    }

    #[test]
    fn a_path_that_does_not_move_crosses_within_the_step() {
        let s = path([0.3, 0.0, 0.0, 0.0, 0.0], 0.25).crossing(0.3);
        assert!((0.25..=1.0).contains(&s), "{s}");
    }
}
