//! Figures of one's own: any column of the sets against any other, with error bars where there is an interval.

use super::BadOption;
use super::axis::{Axis, bounds, logarithmic_bounds};
use super::frame::{Frame, LEFT, Layout, RIGHT};
use super::hues::Hues;
use super::legend::{Mark, entry};
use super::picture::{Dot, Ink, Picture, Sheet, Stroke};
use super::sets::ascending;
use super::style::{BAR_WIDTH, GREY, INKS, Look, RADIUS, dot};
pub use super::values::columns;
use super::values::{FREQUENCY_COLUMN, Values};
use crate::model::Symbol;
use crate::reduce::SetRow;
use std::cmp::Ordering;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 400.0;
/// Panels in a row, and in all.
const MAX_COLUMNS: usize = 3;
const MAX_PANELS: usize = 9;
const PANEL_WIDTH: f64 = 260.0;
const PANEL_HEIGHTS: &[f64] = &[220.0; MAX_PANELS / MAX_COLUMNS];
const MAX_WORDS: usize = 12;
/// Lines between sets; more would be a net.
const MAX_LINES: usize = 24;
const LINE_WIDTH: f64 = 1.0;
/// Sets up to which dots have their full size.
const FEW_SETS: usize = 500;
const SMALL_RADIUS: f64 = 2.5;

/// The ends of an axis.
pub type Limits = (Option<f64>, Option<f64>);

/// What a figure shows: columns by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnFigure {
    pub x: String,
    pub y: String,
    pub colour: Option<String>,
    /// Column of which each value has a panel.
    pub panels: Option<String>,
    pub is_log_x: bool,
    pub is_log_y: bool,
    /// Ends of the x axis, those of the data if they are not given.
    pub x_limits: Limits,
    pub y_limits: Limits,
    /// Label of the x axis in the place of that of its column.
    pub x_label: Option<String>,
    pub y_label: Option<String>,
}

/// An axis as it is asked for.
struct Asked<'a> {
    option: &'static str,
    values: &'a Values,
    is_log: bool,
    limits: Limits,
    label: &'a Option<String>,
}

/// Draws a dot for each set; sets that differ in a parameter on the x axis alone are joined by a line.
pub(super) fn own(rows: &[SetRow], figure: &OwnFigure, look: &Look) -> Result<Picture, BadOption> {
    let [x, y] = [("x", &figure.x), ("y", &figure.y)].map(|(option, name)| Values::of(rows, option, name));
    let (x, y) = (x?, y?);
    let colour = figure.colour.as_ref().map(|name| Values::of(rows, "colour", name)).transpose()?;
    let panels = figure.panels.as_ref().map(|name| Values::of(rows, "panels", name)).transpose()?;
    let asked = |option, values, is_log, limits, label| Asked { option, values, is_log, limits, label };
    let asked_x = asked("x", &x, figure.is_log_x, figure.x_limits, &figure.x_label);
    let asked_y = asked("y", &y, figure.is_log_y, figure.y_limits, &figure.y_label);
    let sets: Vec<usize> = (0..rows.len()).filter(|&set| asked_x.has(set) && asked_y.has(set)).collect();
    if sets.is_empty() {
        let kind = if figure.is_log_x || figure.is_log_y { "no set has a value > 0" } else { "no set has a value" };
        return Err(asked_y.refuse(&format!("{kind} of both {} and {}; nothing can be drawn", figure.x, figure.y)));
    }
    let (x_axis, y_axis) = (asked_x.axis(&sets)?, asked_y.axis(&sets)?);
    let is_inside = |set: &usize| {
        x.numbers[*set].is_some_and(|x| x_axis.contains(x)) && y.numbers[*set].is_some_and(|y| y_axis.contains(y))
    };
    let inside = sets.iter().filter(|set| is_inside(set)).count();
    if inside == 0 {
        return Err(
            asked_x.refuse(&format!("none of {} sets lies within --xlim and --ylim; give wider ones", sets.len()))
        );
    }

    let hues = colour.as_ref().map(hues).transpose()?;
    let groups = groups(panels.as_ref(), &sets)?;
    let layout = layout(groups.len(), hues.as_ref().map_or(RIGHT, Hues::right));
    let radius = if inside > FEW_SETS { SMALL_RADIUS } else { RADIUS };
    let mut entries = hues.as_ref().map_or_else(Vec::new, |hues| hues.entries(RADIUS));
    if let Some(colour) = colour.as_ref().filter(|colour| sets.iter().any(|&set| colour.numbers[set].is_none())) {
        entries.push(entry(Mark::Dot(dot(GREY)), format!("no {}", colour.name())));
    }
    let left_out = rows.len() - inside;
    let note = match left_out {
        0 => String::new(),
        _ => format!("not shown: {left_out} of {} sets, without a value or outside the axes", rows.len()),
    };
    let name = format!("{}-{}", figure.y, figure.x);
    let (page, mut sheet) = layout.page(&name, &look.with_note(&note), &entries);
    let ink = |set: usize| {
        let Some((colour, hues)) = colour.as_ref().zip(hues.as_ref()) else { return INKS[0] };
        colour.numbers[set].map_or(GREY, |value| hues.ink(value))
    };
    let lines = lines(rows, &figure.x, &sets, &x);
    for (index, (title, members)) in groups.iter().enumerate() {
        let (row, column) = (index / layout.columns, index % layout.columns);
        let mut frame = page.frame(row, column, x_axis.clone(), y_axis.clone());
        if column > 0 {
            frame.y.label.clear();
        }
        frame.is_lowest |= index + layout.columns >= groups.len();
        let drawn = Drawn { x: &x, y: &y, ink: &ink, radius };
        drawn.draw(&mut sheet, &frame, members, &lines);
        frame.axes(&mut sheet);
        if groups.len() > 1 {
            frame.heading(&mut sheet, title, "");
        }
        if let Some(bar) = hues.as_ref().and_then(Hues::bar).filter(|_| index + 1 == layout.columns.min(groups.len())) {
            bar.draw(&mut sheet, &frame);
        }
    }
    Ok(sheet.finish())
}

impl Asked<'_> {
    fn refuse(&self, problem: &str) -> BadOption {
        BadOption::new(self.option, &self.values.column.name, problem)
    }

    fn refuse_limits(&self, problem: &str) -> BadOption {
        let end = |end: Option<f64>| end.map_or_else(String::new, |end| end.to_string());
        let value = format!("{}:{}", end(self.limits.0), end(self.limits.1));
        BadOption::new(&format!("{}lim", self.option), &value, problem)
    }

    /// Whether a set has a place on the axis.
    fn has(&self, set: usize) -> bool {
        self.values.numbers[set].is_some_and(|value| !self.is_log || self.values.is_worded() || value > 0.0)
    }

    /// The axis, from one limit or end of the data to the other.
    fn axis(&self, sets: &[usize]) -> Result<Axis, BadOption> {
        const SLACK: f64 = 1e-9;
        let label = self.label.clone().unwrap_or_else(|| self.values.label());
        if self.values.is_worded() {
            let name = &self.values.column.name;
            if self.is_log {
                let problem = format!("{name} holds words; a logarithmic axis takes numbers");
                return Err(BadOption::new("log", self.option, &problem));
            }
            if self.limits != (None, None) {
                return Err(self.refuse_limits(&format!("{name} holds words; limits are for numbers")));
            }
            if self.values.words.len() > MAX_WORDS {
                let count = self.values.words.len();
                return Err(
                    self.refuse(&format!("has {count} words, and {MAX_WORDS} fit an axis; take another column"))
                );
            }
            let short_label = self.label.is_none().then(|| self.values.short_label());
            let words: Vec<&str> = self.values.words.iter().map(String::as_str).collect();
            return Ok(Axis::categories(&label, &words).with_short_label(short_label));
        }
        if self.is_log && [self.limits.0, self.limits.1].into_iter().flatten().any(|end| end <= 0.0) {
            return Err(self.refuse_limits("must be > 0 on a logarithmic axis"));
        }
        let ends = |&set: &usize| {
            let value = self.values.numbers[set];
            let bar = self.values.intervals[set].map(|(low, high)| [low, high]);
            value.into_iter().chain(bar.into_iter().flatten())
        };
        let values = || sets.iter().flat_map(ends);
        let natural = if self.is_log { logarithmic_bounds(values()) } else { bounds(values()).map(widened) };
        let (low, high) = natural.ok_or_else(|| self.refuse("has no finite value"))?;
        // Values at a limit are shown, however they are rounded.
        let low = self.limits.0.map_or(low, |end| end - SLACK * end.abs());
        let high = self.limits.1.map_or(high, |end| end + SLACK * end.abs());
        if low >= high {
            return Err(
                self.refuse_limits("the lower end must be less than the upper; with one end given, than the data's")
            );
        }
        let axis = if self.is_log { Axis::logarithmic } else { Axis::linear };
        let short_label = self.label.is_none().then(|| axis(&self.values.short_label(), low, high).label);
        Ok(axis(&label, low, high).with_short_label(short_label).with_enough_numbers())
    }
}

/// A range with a margin on both sides, also where it is a single value.
fn widened((low, high): (f64, f64)) -> (f64, f64) {
    const MARGIN: f64 = 0.05;
    let margin = if high > low { MARGIN * (high - low) } else { 0.5 * if low == 0.0 { 1.0 } else { low.abs() } };
    (low - margin, high + margin)
}

fn hues(values: &Values) -> Result<Hues, BadOption> {
    if values.is_worded() && values.words.len() > INKS.len() {
        let problem =
            format!("has {} words, and there are {} colours; take another column", values.words.len(), INKS.len());
        return Err(BadOption::new("colour", &values.column.name, &problem));
    }
    let Some(_) = values.numbers.iter().flatten().next() else {
        return Err(BadOption::new("colour", &values.column.name, "no set has a value of it"));
    };
    Ok(Hues::of(&values.short_label(), values.numbers.iter().copied().flatten(), |value| values.setting(value)))
}

/// The sets of each panel and its title.
fn groups(panels: Option<&Values>, sets: &[usize]) -> Result<Vec<(String, Vec<usize>)>, BadOption> {
    let Some(values) = panels else { return Ok(vec![(String::new(), sets.to_vec())]) };
    let of = |value: f64| {
        let members: Vec<usize> = sets.iter().copied().filter(|&set| values.numbers[set] == Some(value)).collect();
        (values.setting(value), members)
    };
    let mut groups: Vec<_> = ascending(values.numbers.iter().copied().flatten()).into_iter().map(of).collect();
    groups.retain(|(_, sets)| !sets.is_empty());
    let problem = match groups.len() {
        0 => "no set has a value of it".to_owned(),
        1..=MAX_PANELS => return Ok(groups),
        count => format!("has {count} values, and {MAX_PANELS} panels fit a page; show it with --colour"),
    };
    Err(BadOption::new("panels", &values.column.name, &problem))
}

fn layout(panels: usize, right: f64) -> Layout<'static> {
    const ONE: &[f64] = &[HEIGHT];
    if panels == 1 {
        return Layout::column(WIDTH, ONE, 0.0, right);
    }
    let columns = if panels == 4 { 2 } else { panels.min(MAX_COLUMNS) };
    let heights = &PANEL_HEIGHTS[..panels.div_ceil(columns)];
    Layout { columns, column_gap: LEFT, has_headings: true, ..Layout::column(PANEL_WIDTH, heights, 26.0, right) }
}

/// Sets that differ in the x axis alone, if that is a parameter, η or 1/T, in the order of x.
fn lines(rows: &[SetRow], x_name: &str, sets: &[usize], x: &Values) -> Vec<Vec<usize>> {
    let symbol = if ["eta", FREQUENCY_COLUMN].contains(&x_name) { Some(Symbol::T) } else { Symbol::from_key(x_name) };
    let Some(symbol) = symbol else { return Vec::new() };
    let others = |set: usize| {
        let others = Symbol::ALL.into_iter().filter(|other| *other != symbol && *other != Symbol::Seed);
        others.map(|other| rows[set].parameters.get(other)).collect::<Vec<_>>()
    };
    let mut sets: Vec<_> = sets.iter().map(|&set| (others(set), set)).collect();
    sets.sort_by(|(left, _), (right, _)| left.partial_cmp(right).unwrap_or(Ordering::Equal));
    let lines = sets.chunk_by(|(left, _), (right, _)| left == right).filter(|line| line.len() > 1);
    let mut lines: Vec<Vec<usize>> = lines.map(|line| line.iter().map(|(_, set)| *set).collect()).collect();
    if lines.len() > MAX_LINES {
        return Vec::new();
    }
    for line in &mut lines {
        line.sort_by(|&left, &right| x.numbers[left].unwrap_or(0.0).total_cmp(&x.numbers[right].unwrap_or(0.0)));
    }
    lines
}

struct Drawn<'a> {
    x: &'a Values,
    y: &'a Values,
    ink: &'a dyn Fn(usize) -> Ink,
    radius: f64,
}

impl Drawn<'_> {
    fn place(&self, set: usize) -> Option<(f64, f64)> {
        self.x.numbers[set].zip(self.y.numbers[set])
    }

    fn draw(&self, sheet: &mut Sheet, frame: &Frame, sets: &[usize], lines: &[Vec<usize>]) {
        frame.clipped(sheet, |sheet| {
            for line in lines {
                let members: Vec<usize> = line.iter().copied().filter(|set| sets.binary_search(set).is_ok()).collect();
                for pair in members.windows(2).filter(|pair| (self.ink)(pair[0]) == (self.ink)(pair[1])) {
                    let stroke = Stroke::solid((self.ink)(pair[0]), LINE_WIDTH);
                    frame.curve(sheet, pair.iter().filter_map(|&set| self.place(set)), stroke);
                }
            }
            // Confidence intervals, along both axes.
            for &set in sets {
                let Some((x, y)) = self.place(set) else { continue };
                let stroke = Stroke::solid((self.ink)(set), BAR_WIDTH);
                if let Some(ends) = self.y.intervals[set] {
                    frame.error_bar(sheet, x, ends, stroke);
                }
                if let Some((low, high)) = self.x.intervals[set] {
                    let left = if frame.x.place(low).is_finite() { low } else { frame.x.low };
                    frame.curve(sheet, [(left, y), (high, y)], stroke);
                }
            }
        });
        for &set in sets {
            frame.points(sheet, self.place(set), Dot { opacity: 0.9, ..Dot::solid((self.ink)(set), self.radius) });
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::model::Parameters;
    use crate::model::selected::Selected;
    use crate::reduce::Interval;

    /// Sets at rising V0, and two amplitudes.
    pub(in crate::figure) fn rows(count: u32) -> Vec<SetRow> {
        let row = |step: u32| {
            let parameters = Parameters {
                drive_velocity: 1e-6 * f64::from(1 << step),
                modulation_amplitude: if step.is_multiple_of(2) { 1e-6 } else { 0.0 },
                modulation_period: step.is_multiple_of(2).then_some(0.02),
                ..Parameters::default()
            };
            let tau = 10.0 / f64::from(1 << step);
            SetRow {
                parameters: Selected::new(parameters.validated().unwrap()),
                tau_mean: Some(tau),
                tau_interval: Some(Interval { low: 0.9 * tau, high: 1.1 * tau }),
                ..SetRow::default()
            }
        };
        (0..count).map(row).collect()
    }

    fn figure() -> OwnFigure {
        OwnFigure { x: "V0".to_owned(), y: "tau_mean".to_owned(), ..OwnFigure::default() }
    }

    fn svg(figure: &OwnFigure) -> String {
        own(&rows(8), figure, &Look::default()).unwrap().svg()
    }

    fn problem(figure: &OwnFigure) -> String {
        own(&rows(8), figure, &Look::default()).err().unwrap().to_string()
    }

    #[test]
    fn each_option_changes_what_it_says() {
        let plain = svg(&figure());
        assert!(plain.contains(">Drive velocity V₀ (10⁻⁶ m/s)<") && plain.contains(">Mean interval (s)<"));
        let bars = |svg: &str| svg.matches(&format!(r#"stroke-width="{BAR_WIDTH}""#)).count();
        let no_interval = OwnFigure { y: "eta".to_owned(), ..figure() };
        assert_eq!((bars(&plain), bars(&svg(&no_interval))), (8, 0));
        let logarithmic = svg(&OwnFigure { is_log_x: true, is_log_y: true, ..figure() });
        assert!(logarithmic.contains(">10⁻⁵<") && !plain.contains(">10⁻⁵<"));
        let colour = svg(&OwnFigure { colour: Some("Delta".to_owned()), ..figure() });
        assert!(colour.contains(">Δ = 0 m<") && colour.contains(">Δ = 1e-6 m<") && colour.contains(INKS[1]));
        let scale = svg(&OwnFigure { colour: Some("V0".to_owned()), ..figure() });
        assert!(scale.contains(">V₀ (m/s)<") && !scale.contains("V₀ = "));
        let panels = svg(&OwnFigure { panels: Some("Delta".to_owned()), ..figure() });
        assert!(panels.contains(">(a)<") && panels.contains(">(b)<") && panels.contains(">Δ = 0 m<"));
        let limits = svg(&OwnFigure { x_limits: (Some(1e-6), Some(1e-5)), ..figure() });
        assert!(limits.contains("not shown: 4 of 8 sets, without a value or outside the axes"), "{limits}");
        let label = svg(&OwnFigure { y_label: Some("τ".to_owned()), ..figure() });
        assert!(label.contains(">τ<") && !label.contains("Mean interval"));
        let without = svg(&OwnFigure { colour: Some("T".to_owned()), ..figure() });
        assert!(without.contains(">T = 0.02 s<") && without.contains(">no T<"));
        let words = svg(&OwnFigure { x: "break_on".to_owned(), ..figure() });
        assert!(words.contains(">magnitude<"));
    }

    #[test]
    fn mistakes_are_refused_with_what_to_do() {
        let named = |name: &str| Some(name.to_owned());
        for (figure, expected) in [
            (OwnFigure { x: "v0".to_owned(), ..figure() }, "--x v0: no such column; did you mean V0?"),
            (OwnFigure { colour: named("colour"), ..figure() }, "--colour colour: no such column; there are set_id"),
            (OwnFigure { x: "break_on".to_owned(), is_log_x: true, ..figure() }, "--log x: break_on holds words"),
            (
                OwnFigure { x: "break_on".to_owned(), x_limits: (Some(1.0), None), ..figure() },
                "--xlim 1:: break_on holds words",
            ),
            (OwnFigure { y: "drop_mean".to_owned(), ..figure() }, "no set has a value of both V0 and drop_mean"),
            (
                OwnFigure { y: "eta".to_owned(), x: "T_to".to_owned(), is_log_y: true, ..figure() },
                "no set has a value > 0",
            ),
            (OwnFigure { x_limits: (Some(2.0), Some(1.0)), ..figure() }, "--xlim 2:1: the lower end must be less"),
            (OwnFigure { x_limits: (Some(-1.0), None), is_log_x: true, ..figure() }, "--xlim -1:: must be > 0"),
            (OwnFigure { x_limits: (Some(1.0), Some(2.0)), ..figure() }, "none of 8 sets lies within"),
            (OwnFigure { panels: named("regime"), ..figure() }, "--panels regime: no set has a value of it"),
        ] {
            let found = problem(&figure);
            assert!(found.contains(expected), "{found}");
        }
        let many = OwnFigure { panels: named("V0"), ..figure() };
        let error = own(&rows(12), &many, &Look::default()).err().unwrap().to_string();
        assert!(
            error.contains("--panels V0: has 12 values, and 9 panels fit a page; show it with --colour"),
            "{error}"
        );
    }

    #[test]
    fn only_sets_that_differ_in_x_alone_are_joined() {
        let rows = rows(8);
        let x = Values::of(&rows, "x", "V0").unwrap();
        let sets: Vec<usize> = (0..8).collect();
        assert_eq!(lines(&rows, "V0", &sets, &x), [vec![1, 3, 5, 7], vec![0, 2, 4, 6]]);
        assert!(lines(&rows, "tau_mean", &sets, &x).is_empty() && lines(&rows, "Delta", &sets, &x).is_empty());
        let mut periods = vec![rows[0].clone(); 3];
        for (row, period) in periods.iter_mut().zip([0.02, 0.01, 0.04]) {
            row.parameters.parameters.modulation_period = Some(period);
        }
        let x = Values::of(&periods, "x", "frequency").unwrap();
        assert_eq!(lines(&periods, "frequency", &[0, 1, 2], &x), [vec![2, 0, 1]]);
    }

    #[test]
    fn a_style_does_not_change_the_data() {
        use super::super::style::Style;
        let dots = |style| {
            let look = Look { style, ..Look::default() };
            own(&rows(8), &figure(), &look).unwrap().svg().matches("<circle").count()
        };
        assert_eq!(dots(Style::Screen), dots(Style::Print));
    }
}
