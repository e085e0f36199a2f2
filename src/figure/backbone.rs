//! φ against η (Fig. 3e): slips, the back-bone of Eq. 2, and averages over locked sets.

use super::axis::{Axis, angle_bounds, bounds};
use super::frame::{Layout, LegendPlace, Mark, RIGHT, entry};
use super::picture::{BLUE, Dot, Fill, LIGHT_GREY, Picture, RED, Stroke};
use super::scatter::Scatter;
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::reduce::{BackboneBin, Point};

const LAYOUT: Layout = Layout::column(558.0, &[398.0], 0.0, RIGHT);
/// The paper's range of η; wider if the data are.
const ETA: (f64, f64) = (0.2, 1000.0);
const AVERAGE: Dot = Dot::solid(BLUE, 5.0);
const ASYMPTOTE: Stroke = Stroke::solid(RED, 2.6);
const EXACT: Stroke = Stroke::dashed(RED, 1.6, (7.0, 4.0));
/// Where the theory has no back-bone.
const SLOW: Fill = Fill { ink: LIGHT_GREY, opacity: 0.4 };
const CURVE_POINTS: u32 = 400;

/// Draws phase against η; `None` without any phase. Phases lie as measured, in the turn that ends shortly past Φ_max;
/// the axis holds them all.
pub(super) fn backbone(points: &[Point], bins: &[BackboneBin]) -> Option<Picture> {
    let slips = Scatter::new(points, 1.6, 0.45, |point| Some((point.eta, point.phase?)));
    let (low, high) = bounds(slips.xs())?;
    let x = Axis::logarithmic("η = 2πΔ / (T V₀)", low.min(ETA.0), high.max(ETA.1));
    let (low, high) = angle_bounds(slips.ys());
    let frame = LAYOUT.frame(0, 0, x, Axis::angle("Phase φ (rad)", low, high));
    let mut sheet = LAYOUT.sheet("phi-eta");

    frame.clipped(&mut sheet, |sheet| {
        frame.stripe(sheet, frame.x.low, 1.0, SLOW);
        slips.draw(sheet, &frame);
        let modulated = || frame.x.evenly_placed(CURVE_POINTS).filter(|&eta| eta >= 1.0);
        frame.curve(sheet, modulated().map(|eta| (eta, minimum_phase_asymptote(eta))), ASYMPTOTE);
        frame.curve(sheet, modulated().filter_map(|eta| Some((eta, minimum_phase(eta)?))), EXACT);
        let averages = bins.iter().filter_map(|bin| Some((bin.eta_centre, bin.locked_phase_mean?)));
        frame.points(sheet, averages, AVERAGE);
    });
    frame.axes(&mut sheet);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    let mut entries = slips.legend().to_vec();
    entries.extend([
        entry(Mark::Dot(AVERAGE), "mean of locked sets"),
        entry(Mark::Line(ASYMPTOTE), "−2√(π/η)"),
        entry(Mark::Line(EXACT), "φₘᵢₙ, Eq. 2"),
        entry(Mark::Patch(SLOW), "η < 1"),
    ]);
    frame.legend(&mut sheet, LegendPlace::LowerRight, &entries);
    Some(sheet.finish())
}
