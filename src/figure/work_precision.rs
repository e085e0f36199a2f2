//! Work against precision: what an error costs with each method, both logarithmic.

use super::FigureError;
use super::axis::{Axis, logarithmic_bounds};
use super::frame::{Frame, LEGEND, LegendPlace, Mark};
use super::picture::{Dot, INKS, Picture, Sheet, Stroke};

const SIZE: (f64, f64) = (840.0, 500.0);

/// Error and cost of a method at one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkPrecision {
    /// Error, > 0.
    pub error: f64,
    /// Lower and upper end of the error's uncertainty, > 0, if it is known.
    pub uncertainty: Option<(f64, f64)>,
    /// Cost, > 0.
    pub work: f64,
}

/// Draws a line per method through its settings, in the given order; values that are not > 0 are left out.
///
/// # Errors
/// When nothing is left.
pub fn work_precision(
    error_label: &str,
    work_label: &str,
    methods: &[(String, Vec<WorkPrecision>)],
) -> Result<Picture, FigureError> {
    const NAME: &str = "work-precision";
    let usable = |points: &[WorkPrecision]| -> Vec<WorkPrecision> {
        points.iter().copied().filter(|point| point.error > 0.0 && point.work > 0.0).collect()
    };
    let methods: Vec<(&str, Vec<WorkPrecision>)> =
        methods.iter().map(|(name, points)| (name.as_str(), usable(points))).collect();
    let all = || methods.iter().flat_map(|(_, points)| points);
    let ends = |point: &WorkPrecision| {
        let (low, high) = point.uncertainty.unwrap_or((point.error, point.error));
        [low, point.error, high]
    };
    let empty = || FigureError::Empty { figure: NAME, what: "errors and costs" };
    let (low, high) = logarithmic_bounds(all().flat_map(ends)).ok_or_else(empty)?;
    let x = Axis::logarithmic(error_label, low, high);
    let (low, high) = logarithmic_bounds(all().map(|point| point.work)).ok_or_else(empty)?;
    let frame = Frame::filling(SIZE, LEGEND, x, Axis::logarithmic(work_label, low, high));
    let mut sheet = Sheet::new(NAME, SIZE);
    let mut entries = Vec::new();
    for (index, (name, points)) in methods.iter().enumerate() {
        let ink = INKS[index % INKS.len()];
        let stroke = Stroke::solid(ink, 1.8);
        frame.clipped(&mut sheet, |sheet| {
            frame.curve(sheet, points.iter().map(|point| (point.error, point.work)), stroke);
            for point in points {
                if let Some((low, high)) = point.uncertainty {
                    frame.curve(
                        sheet,
                        [(low.max(frame.x.low), point.work), (high, point.work)],
                        Stroke::solid(ink, 1.2),
                    );
                }
            }
            let dot = Dot { ink, radius: 4.0, opacity: 1.0 };
            frame.points(sheet, points.iter().map(|point| (point.error, point.work)), dot);
        });
        entries.push((Mark::Line(stroke), (*name).to_owned()));
    }
    frame.axes(&mut sheet, true);
    frame.x_label(&mut sheet);
    frame.y_label(&mut sheet);
    frame.legend(&mut sheet, LegendPlace::Beside, &entries);
    Ok(sheet.finish())
}
