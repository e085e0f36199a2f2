//! Work against precision: what an error costs with each method, a panel for each kind of error; all logarithmic. A
//! method has an ink, a drive a shape. Dots are not joined where errors are chance.

use super::axis::{Axis, logarithmic_bounds};
use super::chart::Chart;
use super::frame::{Ends, Layout};
use super::legend::{Mark, entry};
use super::panel::Layer;
use super::picture::Picture;
use super::quantity::Quantity;
use super::style::{Look, STRIPE};
use crate::reduce::Values;
use crate::sets::Label;
use crate::table::columns::Interval;
use crate::table::columns::Kind;
use anyhow::{Result, anyhow};

const NAME: &str = "work-precision";
const WIDTH: f64 = 250.0;
const COLUMN_GAP: f64 = 70.0;
const HEIGHT: f64 = 340.0;

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
    pub points: Vec<WorkPrecision>,
}

impl ErrorPanel {
    fn x_axis(&self) -> Option<Axis> {
        let points = self.points.iter();
        // Lower ends may be 0: they run out of the panel.
        let ends = points.flat_map(|point| [point.error, point.uncertainty.1]);
        let (low, high) = logarithmic_bounds(ends.chain(self.by_chance))?;
        Some(Axis::logarithmic(&self.label, low, high))
    }
}

/// Draws panels side by side, one for each kind of error, with a line per method and drive through its settings; values
/// that are not > 0 are left out.
pub fn work_precision(work_label: &str, panels: &[ErrorPanel], look: &Look) -> Result<Picture> {
    let drawn = draw(work_label, panels, look);
    drawn.ok_or_else(|| anyhow!("figure {NAME}: there are no errors and costs to draw"))
}

fn draw(work_label: &str, kinds: &[ErrorPanel], look: &Look) -> Option<Picture> {
    let points = || {
        kinds
            .iter()
            .flat_map(|kind| kind.points.iter().map(move |point| (kind, point)))
    };
    let words = |name, of: &dyn Fn(&ErrorPanel, &WorkPrecision) -> String| {
        let all: Vec<String> = points().map(|(kind, point)| of(kind, point)).collect();
        Values::of_words(name, &all)
    };
    let numbers = |name, of: fn(&WorkPrecision) -> (Option<f64>, Option<Interval>)| {
        let all = points().map(|(_, point)| of(point));
        let mut quantity = Quantity::of_values(
            name,
            Values::computed(name, Label::new(name), Kind::Real, all),
        );
        quantity.is_log = true;
        quantity
    };
    // Errors by chance make no curve: each is a series of its own.
    let curve = words("curve", &|kind, point| match kind.by_chance {
        Some(_) => format!("{} {:e} {:e}", kind.label, point.work, point.error),
        None => String::new(),
    });
    let series = [
        words("method", &|_, point| point.method.clone()),
        words("drive", &|_, point| point.drive.clone()),
        curve,
    ];
    let mut work = numbers("y", |point| (Some(point.work), None));
    work.label = Some(work_label);
    let error = numbers("x", |point| {
        let (low, high) = point.uncertainty;
        (Some(point.error), Some(Interval { low, high }))
    });
    let chart = Chart {
        panels: Some(words("panels", &|kind, _| kind.label.clone())),
        ..Chart::of_series("errors", &series, error, work)
    };
    let mut parts = chart.parts().ok()?;
    for panel in &mut parts.panels {
        let heading = panel.heading.take();
        let kind = kinds
            .iter()
            .find(|kind| heading.as_ref().is_none_or(|label| *label == kind.label))?;
        panel.height = HEIGHT;
        panel.x = kind.x_axis()?;
        let chance = kind
            .by_chance
            .map(|by_chance| Layer::Stripe((panel.x.low, by_chance), STRIPE));
        panel.layers.splice(..0, chance);
    }
    if kinds.iter().any(|kind| kind.by_chance.is_some()) {
        let text = "what chance alone gives in 95 of 100 cases";
        parts.legend.push(entry(Mark::Patch(STRIPE), text));
    }
    let layout = Layout {
        columns: parts.panels.len(),
        column_gap: COLUMN_GAP,
        ..Layout::column(WIDTH)
    };
    Some(parts.draw(NAME, look, layout))
}

#[cfg(test)]
mod tests {
    use super::super::chart::LINE_WIDTH;
    use super::super::style::{BAR_WIDTH, INKS};
    use super::*;

    #[test]
    fn a_method_has_one_ink_in_all_panels_and_an_entry_for_each_drive() {
        let panel = |label: &str, by_chance, lines: &[(&str, &str)]| ErrorPanel {
            label: label.to_owned(),
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
            panel("error", None, &[("a", "quiet"), ("b", "quiet")]),
            panel("bias", Some(1e-5), &[("b", "quiet"), ("b", "loud")]),
        ];
        let svg = work_precision("cost", &panels, &Look::default())
            .unwrap()
            .svg();
        for text in [
            "error",
            "bias",
            "a",
            "b",
            "quiet",
            "loud",
            "what chance alone gives in 95 of 100 cases",
        ] {
            assert_eq!(svg.matches(&format!(">{text}<")).count(), 1, "{text}");
        }
        assert!(svg.contains(">(a) cost<") && svg.contains(">(b) cost<"));
        let lines = |width: f64| svg.matches(&format!(r#"stroke-width="{width}""#)).count();
        let strokes = lines(LINE_WIDTH);
        let bars = lines(BAR_WIDTH);
        // Where errors are chance there is no line.
        assert_eq!((strokes, bars), (2, 8));
        // Of the first method a line, two bars and two dots, and the mark in the legend; the second has twice as many
        // dots in the other panel, too.
        assert_eq!(svg.matches(&INKS[0].to_string()).count(), 5 + 2 * 4 + 1);
        assert!(work_precision("cost", &[], &Look::default()).is_err());
    }
}
