//! Work against precision: what an error costs with each method, a panel for each kind of error; all logarithmic.

use super::FigureError;
use super::axis::{Axis, logarithmic_bounds};
use super::frame::{Frame, LEFT, LEGEND, Layout, LegendPlace, Mark, entry};
use super::picture::{Dot, Fill, GREY, INKS, Ink, Picture, Sheet, Stroke};

const NAME: &str = "work-precision";
/// The stripe of errors that chance alone gives.
const CHANCE: Fill = Fill { ink: GREY, opacity: 0.3 };

/// Error and cost of a method at one setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkPrecision {
    /// Error, > 0.
    pub error: f64,
    /// Lower and upper end of the error's uncertainty, if it is known.
    pub uncertainty: Option<(f64, f64)>,
    /// Cost, > 0.
    pub work: f64,
}

impl WorkPrecision {
    fn is_usable(&self) -> bool {
        self.error > 0.0 && self.work > 0.0
    }
}

/// One kind of error.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorPanel {
    /// What the error is.
    pub label: String,
    /// The largest error that chance alone gives, > 0, if it gives any.
    pub by_chance: Option<f64>,
    /// A name for each method and its settings.
    pub methods: Vec<(String, Vec<WorkPrecision>)>,
}

impl ErrorPanel {
    fn usable(&self) -> impl Iterator<Item = &WorkPrecision> {
        self.methods.iter().flat_map(|(_, points)| points).filter(|point| point.is_usable())
    }
}

/// Draws panels side by side, one for each kind of error, with a line per method through its settings in the given
/// order; values that are not > 0 are left out.
///
/// # Errors
/// When a panel, or the figure, has nothing left.
pub fn work_precision(work_label: &str, panels: &[ErrorPanel]) -> Result<Picture, FigureError> {
    let empty = || FigureError::Empty { figure: NAME, what: "errors and costs" };
    let works = panels.iter().flat_map(ErrorPanel::usable).map(|point| point.work);
    let (least, most) = logarithmic_bounds(works).ok_or_else(empty)?;
    let columns = panels.len();
    let layout = Layout { columns, width: 270.0, column_gap: LEFT, heights: &[360.0], row_gap: 0.0, right: LEGEND };
    let mut sheet = layout.sheet(NAME);
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in panels.iter().flat_map(|panel| &panel.methods) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    let ink_of = |name: &str| INKS[names.iter().position(|known| *known == name).unwrap_or(0) % INKS.len()];
    for (column, panel) in panels.iter().enumerate() {
        // Lower ends may be 0: they run out of the panel.
        let ends = panel.usable().flat_map(|point| [point.error, point.uncertainty.map_or(point.error, |ends| ends.1)]);
        let (low, high) = logarithmic_bounds(ends.chain(panel.by_chance)).ok_or_else(empty)?;
        let y = Axis::logarithmic(if column == 0 { work_label } else { "" }, least, most);
        let frame = layout.frame(0, column, Axis::logarithmic(&panel.label, low, high), y);
        if let Some(by_chance) = panel.by_chance {
            frame.stripe(&mut sheet, low, by_chance, CHANCE);
        }
        for (name, points) in &panel.methods {
            draw(&mut sheet, &frame, points, ink_of(name));
        }
        frame.axes(&mut sheet);
        frame.x_label(&mut sheet);
        frame.y_label(&mut sheet);
        if column + 1 == columns {
            let lines = names.iter().map(|name| entry(Mark::Line(line(ink_of(name))), *name));
            let has_chance = panels.iter().any(|panel| panel.by_chance.is_some());
            let chance = has_chance.then(|| entry(Mark::Patch(CHANCE), "by chance, 95 %"));
            frame.legend(&mut sheet, LegendPlace::Beside, &lines.chain(chance).collect::<Vec<_>>());
        }
    }
    Ok(sheet.finish())
}

const fn line(ink: Ink) -> Stroke {
    Stroke::solid(ink, 1.8)
}

/// A method's settings, with the uncertainty of their errors.
fn draw(sheet: &mut Sheet, frame: &Frame, points: &[WorkPrecision], ink: Ink) {
    let points: Vec<&WorkPrecision> = points.iter().filter(|point| point.is_usable()).collect();
    let places = || points.iter().map(|point| (point.error, point.work));
    frame.clipped(sheet, |sheet| {
        frame.curve(sheet, places(), line(ink));
        for point in &points {
            if let Some((low, high)) = point.uncertainty {
                let ends = [low.max(frame.x.low), high].map(|end| (end, point.work));
                frame.curve(sheet, ends, Stroke::solid(ink, 1.2));
            }
        }
        frame.points(sheet, places(), Dot::solid(ink, 4.0));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_has_one_ink_in_all_panels_and_one_entry() {
        let point = |error| WorkPrecision { error, uncertainty: Some((0.0, 2.0 * error)), work: 0.01 };
        let method = |name: &str| (name.to_owned(), vec![point(1e-6), point(1e-5)]);
        let panel = |by_chance, methods: &[&str]| ErrorPanel {
            label: "error".to_owned(),
            by_chance,
            methods: methods.iter().map(|name| method(name)).collect(),
        };
        let panels = [panel(None, &["a", "b"]), panel(Some(1e-5), &["b"])];
        let svg = work_precision("cost", &panels).unwrap().svg();
        for (text, times) in [("error", 2), ("cost", 1), ("a", 1), ("b", 1), ("by chance, 95 %", 1)] {
            assert_eq!(svg.matches(&format!(">{text}<")).count(), times, "{text}");
        }
        // Of each method in a panel a line and two whiskers, and the mark in the legend.
        assert_eq!((svg.matches(INKS[0]).count(), svg.matches(INKS[1]).count()), (3 + 2 + 1, 2 * (3 + 2) + 1));
        assert!(work_precision("cost", &[]).is_err());
    }
}
