//! φ against η (Fig. 3e): slips, the back-bone of Eq. 2, and averages over locked sets.

use super::FigureError;
use super::axis::{Axis, angle_bounds, bounds};
use super::frame::{Frame, LegendPlace, Mark, RIGHT};
use super::picture::{BLACK, BLUE, Dot, GREY, LIGHT_GREY, Picture, RED, Sheet, Stroke};
use crate::model::theory::{minimum_phase, minimum_phase_asymptote};
use crate::reduce::{BackboneBin, Point};

const SIZE: (f64, f64) = (660.0, 500.0);
/// The paper's range of η; wider if the data are.
const ETA: (f64, f64) = (0.2, 1000.0);
const ANY_SLIP: Dot = Dot { ink: GREY, radius: 1.6, opacity: 0.45 };
const LOCKED_SLIP: Dot = Dot { ink: BLACK, radius: 1.6, opacity: 0.45 };
const AVERAGE: Dot = Dot { ink: BLUE, radius: 5.0, opacity: 1.0 };
const ASYMPTOTE: Stroke = Stroke::solid(RED, 2.6);
const EXACT: Stroke = Stroke::dashed(RED, 1.6, (7.0, 4.0));
const CURVE_POINTS: u32 = 400;

/// Draws phase against η. Phases lie as measured, in the turn that ends shortly past Φ_max; the axis holds them all.
///
/// # Errors
/// When no point has a phase.
pub fn backbone(points: &[Point], bins: &[BackboneBin]) -> Result<Picture, FigureError> {
    const NAME: &str = "phi-eta";
    let slips: Vec<(f64, f64, bool)> =
        points.iter().filter_map(|point| Some((point.eta, point.phase?, point.is_locked))).collect();
    let (low, high) =
        bounds(slips.iter().map(|slip| slip.0)).ok_or(FigureError::Empty { figure: NAME, what: "phases" })?;
    let x = Axis::logarithmic("η = 2πΔ / (T V₀)", low.min(ETA.0), high.max(ETA.1));
    let (low, high) = angle_bounds(slips.iter().map(|slip| slip.1));
    let frame = Frame::filling(SIZE, RIGHT, x, Axis::angle("Phase φ (rad)", low, high));
    let mut sheet = Sheet::new(NAME, SIZE);

    frame.clipped(&mut sheet, |sheet| {
        frame.stripe(sheet, frame.x.low, 1.0, LIGHT_GREY, 0.4);
        for (locked, dot) in [(false, ANY_SLIP), (true, LOCKED_SLIP)] {
            let such = slips.iter().filter(|slip| slip.2 == locked).map(|slip| (slip.0, slip.1));
            frame.points(sheet, such, dot);
        }
        let modulated = || frame.x.even(CURVE_POINTS).filter(|&eta| eta >= 1.0);
        frame.curve(sheet, modulated().map(|eta| (eta, minimum_phase_asymptote(eta))), ASYMPTOTE);
        frame.curve(sheet, modulated().filter_map(|eta| Some((eta, minimum_phase(eta)?))), EXACT);
        let averages = bins.iter().filter_map(|bin| Some((bin.eta_centre, bin.locked_phase_mean?)));
        frame.points(sheet, averages, AVERAGE);
    });
    frame.axes(&mut sheet, true);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    let entry = |mark, text: &str| (mark, text.to_owned());
    let entries = [
        entry(Mark::Dot(LOCKED_SLIP), "slips of locked sets"),
        entry(Mark::Dot(ANY_SLIP), "other slips"),
        entry(Mark::Dot(AVERAGE), "mean of locked sets"),
        entry(Mark::Line(ASYMPTOTE), "−2√(π/η)"),
        entry(Mark::Line(EXACT), "φₘᵢₙ, Eq. 2"),
        entry(Mark::Patch(LIGHT_GREY, 0.4), "η < 1"),
    ];
    frame.legend(&mut sheet, LegendPlace::LowerRight, &entries);
    Ok(sheet.finish())
}
