//! Work against precision: what an error costs with each method, a panel for each kind of error; all logarithmic. A
//! method has an ink, a drive a pattern of the line and a mark. Dots are not joined where errors are chance.

use super::axis::{Axis, logarithmic_bounds};
use super::frame::{Ends, Layout};
use super::legend::{LegendEntry, Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::distinct;
use super::style::{Dot, INKS, Ink, Look, RADIUS, STRIPE, Stroke, WHITE};
use anyhow::{Result, anyhow};

const NAME: &str = "work-precision";
const WIDTH: f64 = 250.0;
const COLUMN_GAP: f64 = 70.0;
const HEIGHT: f64 = 340.0;
/// Width of the bars of uncertainty.
const UNCERTAINTY: f64 = 1.0;

/// The line of a method under a drive.
struct MethodLine<'a> {
    method: &'a str,
    drive: &'a str,
    ink: Ink,
    dashes: Option<(f64, f64)>,
    /// Of its dots, and of the holes in them.
    radius: f64,
    hole: f64,
}

impl<'a> MethodLine<'a> {
    /// No two of twelve drives look the same.
    fn new(method: &'a str, ink: Ink, drive: &'a str, number: usize) -> Self {
        let radius = RADIUS * [1.0, 1.5, 2.0, 0.7][number / 3 % 4];
        Self {
            method,
            drive,
            ink,
            dashes: (number > 0).then_some((5.0 + number as f64, 3.0)),
            radius,
            hole: radius * [0.0, 0.62, 0.3][number % 3],
        }
    }

    fn has(&self, point: &WorkPrecision) -> bool {
        point.method == self.method && point.drive == self.drive
    }

    fn entry(&self) -> LegendEntry {
        let mark = if self.hole > 0.0 {
            Mark::Ring(self.ink, WHITE, self.radius, self.hole)
        } else {
            Mark::Dot(Dot::solid(self.ink, self.radius))
        };
        entry(mark, format!("{}, {}", self.method, self.drive))
    }
}

/// Error and cost of a method at one setting, under one drive.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkPrecision {
    pub method: String,
    pub drive: String,
    /// Error, > 0.
    pub error: f64,
    /// Lower and upper end of the error's uncertainty.
    pub uncertainty: Ends,
    /// Cost, > 0.
    pub work: f64,
}

#[derive(Clone, Debug, PartialEq)]
pub struct ErrorPanel {
    pub label: String,
    /// The largest error that chance alone gives, > 0, if it gives any.
    pub by_chance: Option<f64>,
    /// Those of a method under a drive in the order of settings.
    pub points: Vec<WorkPrecision>,
}

impl ErrorPanel {
    fn usable(&self) -> impl Iterator<Item = &WorkPrecision> {
        self.points
            .iter()
            .filter(|point| point.error > 0.0 && point.work > 0.0)
    }

    /// A line on an axis of errors that begins at `least`: dots are joined unless errors are chance.
    fn layer<'a>(&self, line: &MethodLine<'_>, least: f64) -> Layer<'a> {
        let MethodLine { ink, dashes, .. } = *line;
        let points = || self.usable().filter(|point| line.has(point));
        let places = || points().map(|point| (point.error, point.work)).collect();
        let mut layers = Vec::new();
        if self.by_chance.is_none() {
            let stroke = Stroke {
                ink,
                width: 1.8,
                dashes,
            };
            layers.push(Layer::Curve(places(), stroke));
        }
        for point in points() {
            let (low, high) = point.uncertainty;
            let ends = vec![(low.max(least), point.work), (high, point.work)];
            layers.push(Layer::Curve(ends, Stroke::solid(ink, UNCERTAINTY)));
        }
        layers.push(Layer::Dots(places(), Dot::solid(ink, line.radius)));
        if line.hole > 0.0 {
            layers.push(Layer::Dots(places(), Dot::solid(WHITE, line.hole)));
        }
        Layer::Inside(layers)
    }
}

/// Draws panels side by side, one for each kind of error, with a line per method and drive through its settings in the
/// given order; values that are not > 0 are left out.
pub fn work_precision(work_label: &str, panels: &[ErrorPanel], look: &Look) -> Result<Picture> {
    let empty = || anyhow!("figure {NAME}: there are no errors and costs to draw");
    let usable = panels.iter().flat_map(ErrorPanel::usable);
    let (least, most) = logarithmic_bounds(usable.map(|point| point.work)).ok_or_else(empty)?;
    let all = || panels.iter().flat_map(|panel| &panel.points);
    let methods = distinct(all().map(|point| &*point.method));
    let drives = distinct(all().map(|point| &*point.drive));
    let mut lines = Vec::new();
    for (&method, ink) in methods.iter().zip(INKS.into_iter().cycle()) {
        let of_drive = |(number, &drive): (usize, &_)| MethodLine::new(method, ink, drive, number);
        lines.extend(drives.iter().enumerate().map(of_drive));
    }
    lines.retain(|line| all().any(|point| line.has(point)));
    let mut legend: Vec<LegendEntry> = lines.iter().map(MethodLine::entry).collect();
    if panels.iter().any(|panel| panel.by_chance.is_some()) {
        let text = "what chance alone gives in 95 of 100 cases";
        legend.push(entry(Mark::Patch(STRIPE), text));
    }
    let layout = Layout {
        columns: panels.len(),
        column_gap: COLUMN_GAP,
        ..Layout::column(WIDTH)
    };
    let panel = |(column, panel): (usize, &ErrorPanel)| {
        // Lower ends may be 0: they run out of the panel.
        let points = panel.usable();
        let ends = points.flat_map(|point| [point.error, point.uncertainty.1]);
        let (low, high) = logarithmic_bounds(ends.chain(panel.by_chance))?;
        let y = Axis::logarithmic(if column == 0 { work_label } else { "" }, least, most);
        let x = Axis::logarithmic(&panel.label, low, high);
        let errors = panel.by_chance.into_iter();
        let chance = errors.map(|by_chance| Layer::Stripe((low, by_chance), STRIPE));
        let curves = lines.iter().map(|line| panel.layer(line, x.low));
        let layers = chance.chain(curves).collect();
        Some(Panel::new(HEIGHT, x, y, layers))
    };
    let drawn: Option<Vec<Panel<'_>>> = panels.iter().enumerate().map(panel).collect();
    let panels = drawn.ok_or_else(empty)?;
    Ok(panel::draw(NAME, look, layout, &legend, panels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twelve_drives_look_different() {
        let looks: Vec<(f64, f64)> = (0..12)
            .map(|number| MethodLine::new("", INKS[0], "", number))
            .map(|line| (line.radius, line.hole))
            .collect();
        assert!(
            looks
                .iter()
                .enumerate()
                .all(|(place, look)| !looks[..place].contains(look)),
            "{looks:?}"
        );
    }

    #[test]
    fn a_method_has_one_ink_in_all_panels_and_an_entry_for_each_drive() {
        let panel = |by_chance, lines: &[(&str, &str)]| ErrorPanel {
            label: "error".to_owned(),
            by_chance,
            points: lines
                .iter()
                .flat_map(|(method, drive)| [1e-6, 1e-5].map(|error| (method, drive, error)))
                .map(|(method, drive, error)| WorkPrecision {
                    method: (*method).to_owned(),
                    drive: (*drive).to_owned(),
                    error,
                    uncertainty: (0.0, 2.0 * error),
                    work: 0.01,
                })
                .collect(),
        };
        let panels = [
            panel(None, &[("a", "quiet"), ("b", "quiet")]),
            panel(Some(1e-5), &[("b", "quiet"), ("b", "loud")]),
        ];
        let svg = work_precision("cost", &panels, &Look::default())
            .unwrap()
            .svg();
        let texts = [
            ("error", 2),
            ("(a) cost", 1),
            ("a, quiet", 1),
            ("a, loud", 0),
            ("b, quiet", 1),
            ("b, loud", 1),
        ];
        for (text, times) in texts
            .into_iter()
            .chain([("what chance alone gives in 95 of 100 cases", 1)])
        {
            assert_eq!(svg.matches(&format!(">{text}<")).count(), times, "{text}");
        }
        // Of each solid line in a panel the line itself, two bars and two dots, and the mark in the legend.
        assert_eq!(svg.matches(&INKS[0].to_string()).count(), 5 + 1);
        // Where errors are chance there is no line: of the two methods in either panel two, one, two bars, and two
        // dots.
        assert_eq!(svg.matches(&INKS[1].to_string()).count(), 5 + 2 * 4 + 2);
        assert!(work_precision("cost", &[], &Look::default()).is_err());
    }
}
