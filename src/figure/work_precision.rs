//! Work against precision: what an error costs with each method, a panel for each kind of error; all logarithmic. A
//! method has an ink, a drive a pattern of the line.

use super::FigureError;
use super::axis::{Axis, logarithmic_bounds};
use super::frame::{Frame, LEFT, LEGEND, Layout, LegendPlace, Mark, entry};
use super::picture::{Dot, Fill, GREY, INKS, Picture, Sheet, Stroke};

const NAME: &str = "work-precision";
/// The stripe of errors that chance alone gives.
const CHANCE: Fill = Fill { ink: GREY, opacity: 0.3 };
/// Patterns of the lines, drive by drive.
const PATTERNS: [Option<(f64, f64)>; 2] = [None, Some((5.0, 3.0))];

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

/// A method under one drive, setting by setting.
#[derive(Clone, Debug, PartialEq)]
pub struct MethodLine {
    /// Name of the method.
    pub method: String,
    /// Name of the drive.
    pub drive: String,
    /// In the order of settings.
    pub points: Vec<WorkPrecision>,
}

/// One kind of error.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorPanel {
    /// What the error is.
    pub label: String,
    /// The largest error that chance alone gives, > 0, if it gives any.
    pub by_chance: Option<f64>,
    /// A line for each method and drive.
    pub lines: Vec<MethodLine>,
}

impl ErrorPanel {
    fn usable(&self) -> impl Iterator<Item = &WorkPrecision> {
        self.lines.iter().flat_map(|line| &line.points).filter(|point| point.is_usable())
    }
}

/// Draws panels side by side, one for each kind of error, with a line per method and drive through its settings in the
/// given order; values that are not > 0 are left out.
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
    let all = || panels.iter().flat_map(|panel| &panel.lines);
    let (methods, drives) = (distinct(all().map(|line| &*line.method)), distinct(all().map(|line| &*line.drive)));
    let place = |name: &str, names: &[&str]| names.iter().position(|known| *known == name).unwrap_or(0);
    let look = |method: &str, drive: &str| {
        let (ink, dashes) =
            (INKS[place(method, &methods) % INKS.len()], PATTERNS[place(drive, &drives) % PATTERNS.len()]);
        Stroke { ink, width: 1.8, dashes }
    };
    for (column, panel) in panels.iter().enumerate() {
        // Lower ends may be 0: they run out of the panel.
        let ends = panel.usable().flat_map(|point| [point.error, point.uncertainty.map_or(point.error, |ends| ends.1)]);
        let (low, high) = logarithmic_bounds(ends.chain(panel.by_chance)).ok_or_else(empty)?;
        let y = Axis::logarithmic(if column == 0 { work_label } else { "" }, least, most);
        let frame = layout.frame(0, column, Axis::logarithmic(&panel.label, low, high), y);
        if let Some(by_chance) = panel.by_chance {
            frame.stripe(&mut sheet, low, by_chance, CHANCE);
        }
        for MethodLine { method, drive, points } in &panel.lines {
            draw(&mut sheet, &frame, points, look(method, drive));
        }
        frame.axes(&mut sheet);
        frame.x_label(&mut sheet);
        frame.y_label(&mut sheet);
        if column + 1 == columns {
            let each = methods.iter().flat_map(|method| drives.iter().map(move |drive| (*method, *drive)));
            let known =
                each.filter(|(method, drive)| all().any(|line| (&*line.method, &*line.drive) == (method, drive)));
            let lines =
                known.map(|(method, drive)| entry(Mark::Line(look(method, drive)), format!("{method}, {drive}")));
            let has_chance = panels.iter().any(|panel| panel.by_chance.is_some());
            let chance = has_chance.then(|| entry(Mark::Patch(CHANCE), "by chance, 95 %"));
            frame.legend(&mut sheet, LegendPlace::Beside, &lines.chain(chance).collect::<Vec<_>>());
        }
    }
    Ok(sheet.finish())
}

/// Each name once, in the order of first appearance.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.fold(Vec::new(), |mut known, name| {
        if !known.contains(&name) {
            known.push(name);
        }
        known
    })
}

/// A method's settings, with the uncertainty of their errors.
fn draw(sheet: &mut Sheet, frame: &Frame, points: &[WorkPrecision], look: Stroke) {
    let points: Vec<&WorkPrecision> = points.iter().filter(|point| point.is_usable()).collect();
    let places = || points.iter().map(|point| (point.error, point.work));
    frame.clipped(sheet, |sheet| {
        frame.curve(sheet, places(), look);
        for point in &points {
            if let Some((low, high)) = point.uncertainty {
                let ends = [low.max(frame.x.low), high].map(|end| (end, point.work));
                frame.curve(sheet, ends, Stroke::solid(look.ink, 1.2));
            }
        }
        frame.points(sheet, places(), Dot::solid(look.ink, 4.0));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_method_has_one_ink_in_all_panels_and_an_entry_for_each_drive() {
        let point = |error| WorkPrecision { error, uncertainty: Some((0.0, 2.0 * error)), work: 0.01 };
        let line = |(method, drive): &(&str, &str)| MethodLine {
            method: (*method).to_owned(),
            drive: (*drive).to_owned(),
            points: vec![point(1e-6), point(1e-5)],
        };
        let panel = |by_chance, lines: &[(&str, &str)]| ErrorPanel {
            label: "error".to_owned(),
            by_chance,
            lines: lines.iter().map(line).collect(),
        };
        let panels =
            [panel(None, &[("a", "quiet"), ("b", "quiet")]), panel(Some(1e-5), &[("b", "quiet"), ("b", "loud")])];
        let svg = work_precision("cost", &panels).unwrap().svg();
        let texts = [("error", 2), ("cost", 1), ("a, quiet", 1), ("a, loud", 0), ("b, quiet", 1), ("b, loud", 1)];
        for (text, times) in texts.into_iter().chain([("by chance, 95 %", 1)]) {
            assert_eq!(svg.matches(&format!(">{text}<")).count(), times, "{text}");
        }
        // Of each solid line in a panel the line itself, two whiskers and two dots, and the mark in the legend; a dashed
        // one is drawn dash by dash.
        assert_eq!(svg.matches(INKS[0]).count(), 5 + 1);
        assert!(svg.matches(INKS[1]).count() > 3 * 5 + 2);
        assert!(work_precision("cost", &[]).is_err());
    }
}
