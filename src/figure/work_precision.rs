//! Work against precision: what an error costs with each method, a panel for each kind of error; all logarithmic. A
//! method has an ink, a drive a pattern of the line and a mark. Errors that are chance are not joined by lines.

use super::axis::{Axis, logarithmic_bounds};
use super::frame::{Ends, Layout};
use super::legend::{Mark, entry};
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

/// The look of a drive: dashes and gaps of its line, and radii of its dots and of the holes in them.
type Pattern = (Option<(f64, f64)>, f64, f64);

/// No two of twelve drives look the same.
fn pattern(drive: usize) -> Pattern {
    let radius = RADIUS * [1.0, 1.5, 2.0, 0.7][drive / 3 % 4];
    let hole = radius * [0.0, 0.62, 0.3][drive % 3];
    let dashes = (drive > 0).then_some((5.0 + drive as f64, 3.0));
    (dashes, radius, hole)
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

    /// A method under a drive, on an axis of errors that begins at `least`: joined by a line unless errors are chance.
    fn layer<'a>(
        &self,
        of: (&str, &str),
        (ink, (dashes, radius, hole)): (Ink, Pattern),
        least: f64,
    ) -> Layer<'a> {
        let points = || {
            self.usable()
                .filter(|point| (&*point.method, &*point.drive) == of)
        };
        let places = || points().map(|point| (point.error, point.work)).collect();
        let line = self.by_chance.is_none().then(|| {
            Layer::Curve(
                places(),
                Stroke {
                    ink,
                    width: 1.8,
                    dashes,
                },
            )
        });
        let bars = points().map(
            |WorkPrecision {
                 uncertainty: (low, high),
                 work,
                 ..
             }| {
                Layer::Curve(
                    vec![(low.max(least), *work), (*high, *work)],
                    Stroke::solid(ink, UNCERTAINTY),
                )
            },
        );
        let dots = Layer::Dots(places(), Dot::solid(ink, radius));
        let holes = (hole > 0.0).then(|| Layer::Dots(places(), Dot::solid(WHITE, hole)));
        Layer::Inside(
            line.into_iter()
                .chain(bars)
                .chain([dots])
                .chain(holes)
                .collect(),
        )
    }
}

/// Draws panels side by side, one for each kind of error, with a line per method and drive through its settings in the
/// given order; values that are not > 0 are left out.
pub fn work_precision(work_label: &str, panels: &[ErrorPanel], look: &Look) -> Result<Picture> {
    let empty = || anyhow!("figure {NAME}: there are no errors and costs to draw");
    let works = panels
        .iter()
        .flat_map(ErrorPanel::usable)
        .map(|point| point.work);
    let (least, most) = logarithmic_bounds(works).ok_or_else(empty)?;
    let all = || panels.iter().flat_map(|panel| &panel.points);
    let methods = distinct(all().map(|point| &*point.method));
    let drives = distinct(all().map(|point| &*point.drive));
    let inks = methods.iter().zip(INKS.into_iter().cycle());
    let looks = inks.flat_map(|(method, ink)| {
        drives
            .iter()
            .enumerate()
            .map(move |(place, drive)| ((*method, *drive), (ink, pattern(place))))
    });
    let is_known = |of: (&str, &str)| all().any(|point| (&*point.method, &*point.drive) == of);
    let looks: Vec<_> = looks.filter(|(of, _)| is_known(*of)).collect();
    let lines = looks
        .iter()
        .map(|&((method, drive), (ink, (_, radius, hole)))| {
            let dot = Mark::Dot(Dot::solid(ink, radius));
            let mark = if hole > 0.0 {
                Mark::Ring(ink, radius, hole)
            } else {
                dot
            };
            entry(mark, format!("{method}, {drive}"))
        });
    let has_chance = panels.iter().any(|panel| panel.by_chance.is_some());
    let chance = has_chance.then(|| {
        entry(
            Mark::Patch(STRIPE),
            "what chance alone gives in 95 of 100 cases",
        )
    });
    let legend: Vec<_> = lines.chain(chance).collect();
    let layout = Layout {
        columns: panels.len(),
        column_gap: COLUMN_GAP,
        ..Layout::column(WIDTH)
    };
    let panel = |(column, panel): (usize, &ErrorPanel)| {
        // Lower ends may be 0: they run out of the panel.
        let ends = panel
            .usable()
            .flat_map(|point| [point.error, point.uncertainty.1]);
        let (low, high) = logarithmic_bounds(ends.chain(panel.by_chance))?;
        let y = Axis::logarithmic(if column == 0 { work_label } else { "" }, least, most);
        let x = Axis::logarithmic(&panel.label, low, high);
        let chance = panel
            .by_chance
            .map(|by_chance| Layer::Stripe((low, by_chance), STRIPE));
        let layers = chance
            .into_iter()
            .chain(looks.iter().map(|&(of, look)| panel.layer(of, look, x.low)))
            .collect();
        Some(Panel::new(HEIGHT, x, y, layers))
    };
    let panels: Option<Vec<Panel<'_>>> = panels.iter().enumerate().map(panel).collect();
    let panels = panels.ok_or_else(empty)?;
    Ok(panel::draw(NAME, look, layout, &legend, panels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twelve_drives_look_different() {
        let looks: Vec<(f64, f64)> = (0..12)
            .map(pattern)
            .map(|(_, radius, hole)| (radius, hole))
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
        // Where errors are chance there is no line: of the two methods in either panel two, one, two bars, and two dots.
        assert_eq!(svg.matches(&INKS[1].to_string()).count(), 5 + 2 * 4 + 2);
        assert!(work_precision("cost", &[], &Look::default()).is_err());
    }
}
