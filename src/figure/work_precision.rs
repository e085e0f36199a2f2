//! Work against precision: what an error costs with each method, a panel for each kind of error; all logarithmic. A
//! method has an ink, a drive a pattern of the line and a mark. Errors that are chance are not joined by lines.

use super::axis::{Axis, logarithmic_bounds};
use super::frame::Layout;
use super::legend::{Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::{Dot, Ink, Picture, Stroke};
use super::style::{INKS, Look, RADIUS, STRIPE, WHITE};
use anyhow::{Result, anyhow};

const NAME: &str = "work-precision";
const WIDTH: f64 = 250.0;
const COLUMN_GAP: f64 = 70.0;
const HEIGHT: f64 = 340.0;
/// Width of the bars of uncertainty.
const UNCERTAINTY: f64 = 1.0;

/// The look of a drive: dashes and gaps of its line, and whether its dots have a hole.
type Pattern = (Option<(f64, f64)>, bool);

const PATTERNS: [Pattern; 2] = [(None, false), (Some((5.0, 3.0)), true)];

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
    pub method: String,
    pub drive: String,
    /// In the order of settings.
    pub points: Vec<WorkPrecision>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct ErrorPanel {
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
pub fn work_precision(work_label: &str, panels: &[ErrorPanel], look: &Look) -> Result<Picture> {
    let empty = || anyhow!("figure {NAME}: there are no errors and costs to draw");
    let works = panels.iter().flat_map(ErrorPanel::usable).map(|point| point.work);
    let (least, most) = logarithmic_bounds(works).ok_or_else(empty)?;
    let columns = panels.len();
    let all = || panels.iter().flat_map(|panel| &panel.lines);
    let (methods, drives) = (distinct(all().map(|line| &*line.method)), distinct(all().map(|line| &*line.drive)));
    let place = |name: &str, names: &[&str]| names.iter().position(|known| *known == name).unwrap_or(0);
    let look_of = |method: &str, drive: &str| {
        (INKS[place(method, &methods) % INKS.len()], PATTERNS[place(drive, &drives) % PATTERNS.len()])
    };
    let each = methods.iter().flat_map(|method| drives.iter().map(move |drive| (*method, *drive)));
    let known = each.filter(|(method, drive)| all().any(|line| (&*line.method, &*line.drive) == (method, drive)));
    let lines = known.map(|(method, drive)| {
        let (ink, (_, has_holes)) = look_of(method, drive);
        let mark = if has_holes { Mark::Ring(ink, RADIUS) } else { Mark::Dot(Dot::solid(ink, RADIUS)) };
        entry(mark, format!("{method}, {drive}"))
    });
    let has_chance = panels.iter().any(|panel| panel.by_chance.is_some());
    let chance = has_chance.then(|| entry(Mark::Patch(STRIPE), "what chance alone gives in 95 of 100 cases"));
    let legend: Vec<_> = lines.chain(chance).collect();
    let layout = Layout { columns, column_gap: COLUMN_GAP, ..Layout::column(WIDTH) };
    let panel = |(column, panel): (usize, &ErrorPanel)| {
        // Lower ends may be 0: they run out of the panel.
        let ends = panel.usable().flat_map(|point| [point.error, point.uncertainty.map_or(point.error, |ends| ends.1)]);
        let (low, high) = logarithmic_bounds(ends.chain(panel.by_chance))?;
        let y = Axis::logarithmic(if column == 0 { work_label } else { "" }, least, most);
        let x = Axis::logarithmic(&panel.label, low, high);
        let chance = panel.by_chance.map(|by_chance| Layer::Stripe((low, by_chance), STRIPE));
        let lines = panel.lines.iter().map(|MethodLine { method, drive, points }| {
            Layer::Inside(layers(points, look_of(method, drive), x.low, panel.by_chance.is_none()))
        });
        let layers = chance.into_iter().chain(lines).collect();
        Some(Panel::new(HEIGHT, x, y, layers))
    };
    let panels: Option<Vec<Panel<'_>>> = panels.iter().enumerate().map(panel).collect();
    Ok(panel::draw(NAME, look, layout, &legend, panels.ok_or_else(empty)?))
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

/// A method's settings, with the uncertainty of their errors, on an axis of errors that begins at `least`.
fn layers<'a>(
    points: &[WorkPrecision],
    (ink, (dashes, has_holes)): (Ink, Pattern),
    least: f64,
    is_joined: bool,
) -> Vec<Layer<'a>> {
    let points = || points.iter().filter(|point| point.is_usable());
    let places = || points().map(|point| (point.error, point.work)).collect();
    let line = is_joined.then(|| Layer::Curve(places(), Stroke { ink, width: 1.8, dashes }));
    let bars = points().filter_map(|point| {
        let (low, high) = point.uncertainty?;
        Some(Layer::Curve([low.max(least), high].map(|end| (end, point.work)).into(), Stroke::solid(ink, UNCERTAINTY)))
    });
    let holes = has_holes.then(|| Layer::Dots(places(), Dot::solid(WHITE, RADIUS - 1.6)));
    line.into_iter().chain(bars).chain([Layer::Dots(places(), Dot::solid(ink, RADIUS))]).chain(holes).collect()
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
        let svg = work_precision("cost", &panels, &Look::default()).unwrap().svg();
        let texts = [("error", 2), ("(a) cost", 1), ("a, quiet", 1), ("a, loud", 0), ("b, quiet", 1), ("b, loud", 1)];
        for (text, times) in texts.into_iter().chain([("what chance alone gives in 95 of 100 cases", 1)]) {
            assert_eq!(svg.matches(&format!(">{text}<")).count(), times, "{text}");
        }
        // Of each solid line in a panel the line itself, two bars and two dots, and the mark in the legend.
        assert_eq!(svg.matches(INKS[0]).count(), 5 + 1);
        // Where errors are chance there is no line: of the two methods in either panel two, one, two bars, and two dots.
        assert_eq!(svg.matches(INKS[1]).count(), 5 + 2 * 4 + 2);
        assert!(work_precision("cost", &[], &Look::default()).is_err());
    }
}
