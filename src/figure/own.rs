//! Figures of one's own: any column of the sets against any other, with error bars where there is an interval.

use super::BadOption;
use super::axis::{Axis, bounds, logarithmic_bounds};
use super::frame::{LEFT, Layout};
use super::hues::Hues;
use super::legend::{Mark, entry};
use super::panel::{self, Layer, Panel};
use super::picture::{Dot, Picture, Stroke};
use super::sets::ascending;
use super::style::{BAR_WIDTH, GREY, INKS, Look, RADIUS, dot};
use super::values::{axis_label, setting, short_label};
use crate::model::Symbol;
use crate::reduce::{FREQUENCY, SetRow, Values};
use clap::Args;
use std::cmp::Ordering;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 400.0;
/// Panels in a row, and in all.
const MAX_COLUMNS: usize = 3;
const MAX_PANELS: usize = 9;
const PANEL_WIDTH: f64 = 260.0;
const PANEL_HEIGHT: f64 = 220.0;
const PANEL_GAP: f64 = 26.0;
const MAX_WORDS: usize = 12;
/// Lines between sets; more would be a net.
const MAX_LINES: usize = 24;
const LINE_WIDTH: f64 = 1.0;
/// Sets up to which dots have their full size.
const FEW_SETS: usize = 500;
const SMALL_RADIUS: f64 = 2.5;

/// The ends of an axis.
pub type Limits = (Option<f64>, Option<f64>);

#[derive(Clone, Debug, Default, PartialEq, Args)]
#[command(next_help_heading = "A figure of your own")]
pub struct OwnFigure {
    /// Column on the x axis of a figure of your own
    #[arg(long, value_name = "COLUMN", requires = "y")]
    pub x: Option<String>,
    /// Column on the y axis, with error bars if it has an interval
    #[arg(long, value_name = "COLUMN", requires = "x")]
    pub y: Option<String>,
    /// Column that colours show: up to six values in the legend, more on a scale
    #[arg(long, value_name = "COLUMN", requires = "x")]
    pub colour: Option<String>,
    /// Column whose values get a panel each, up to nine
    #[arg(long, value_name = "COLUMN", requires = "x")]
    pub panels: Option<String>,
    /// Logarithmic axes
    #[arg(long, value_name = "AXES", requires = "x", value_parser = ["x", "y", "xy"])]
    pub log: Option<String>,
    /// Ends of the x axis; either may be left out
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    pub xlim: Option<Limits>,
    /// Ends of the y axis
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    pub ylim: Option<Limits>,
    /// Label of the x axis [default: meaning, name and unit of the column]
    #[arg(long, value_name = "TEXT", requires = "x")]
    pub xlabel: Option<String>,
    /// Label of the y axis
    #[arg(long, value_name = "TEXT", requires = "x")]
    pub ylabel: Option<String>,
}

fn limits(text: &str) -> Result<Limits, &'static str> {
    const WANTED: &str = "must be LOW:HIGH with finite numbers, such as 1e-6:1e-3, 0: or :5";
    let end = |text: &str| match text.trim() {
        "" => Ok(None),
        number => number.parse().ok().filter(|end: &f64| end.is_finite()).map(Some).ok_or(WANTED),
    };
    match text.split_once(':') {
        Some((low, high)) if text.trim() != ":" => Ok((end(low)?, end(high)?)),
        _ => Err(WANTED),
    }
}

/// An axis as it is asked for.
struct Asked<'a> {
    option: &'static str,
    values: Values,
    is_log: bool,
    limits: Limits,
    label: Option<&'a str>,
}

/// Draws a dot for each set; sets that differ in a parameter on the x axis alone are joined by a line.
pub(super) fn own(rows: &[SetRow], figure: &OwnFigure, look: &Look) -> Result<Picture, BadOption> {
    let asked = |option, name: &Option<String>, limits: Option<Limits>, label| -> Result<Asked<'_>, BadOption> {
        let values = of(rows, option, name.as_deref().unwrap_or_default())?;
        let is_log = figure.log.as_ref().is_some_and(|axes| axes.contains(option));
        Ok(Asked { option, values, is_log, limits: limits.unwrap_or_default(), label })
    };
    let x = asked("x", &figure.x, figure.xlim, figure.xlabel.as_deref())?;
    let y = asked("y", &figure.y, figure.ylim, figure.ylabel.as_deref())?;
    let colour = figure.colour.as_ref().map(|name| of(rows, "colour", name)).transpose()?;
    let panels = figure.panels.as_ref().map(|name| of(rows, "panels", name)).transpose()?;
    let sets: Vec<usize> = (0..rows.len()).filter(|&set| x.has(set) && y.has(set)).collect();
    let [x_name, y_name] = [&x, &y].map(|asked| &asked.values.column.name);
    if sets.is_empty() {
        let kind = if x.is_log || y.is_log { "no set has a value > 0" } else { "no set has a value" };
        return Err(y.refuse(&format!("{kind} of both {x_name} and {y_name}; nothing can be drawn")));
    }
    let (x_axis, y_axis) = (x.axis(&sets)?, y.axis(&sets)?);
    let place = |set: usize| x.values.numbers[set].zip(y.values.numbers[set]);
    let places = sets.iter().filter_map(|&set| place(set));
    let inside = places.filter(|&(x, y)| x_axis.contains(x) && y_axis.contains(y)).count();
    if inside == 0 {
        let problem = format!("none of {} sets lies within --xlim and --ylim; give wider ones", sets.len());
        return Err(x.refuse(&problem));
    }

    let hues = colour.as_ref().map(hues).transpose()?;
    let groups = groups(panels.as_ref(), &sets)?;
    let (count, columns) = (groups.len(), if groups.len() == 4 { 2 } else { groups.len().min(MAX_COLUMNS) });
    let (width, height) = if count == 1 { (WIDTH, HEIGHT) } else { (PANEL_WIDTH, PANEL_HEIGHT) };
    let layout = Layout { columns, column_gap: LEFT, row_gap: PANEL_GAP, ..Layout::column(width) };
    let radius = if inside > FEW_SETS { SMALL_RADIUS } else { RADIUS };
    let mut entries = hues.as_ref().map_or_else(Vec::new, |hues| hues.entries(RADIUS));
    if let Some(colour) = colour.as_ref().filter(|colour| sets.iter().any(|&set| colour.numbers[set].is_none())) {
        entries.push(entry(Mark::Dot(dot(GREY)), format!("no {}", colour.label().symbol)));
    }
    let left_out = rows.len() - inside;
    let note = match left_out {
        0 => String::new(),
        _ => format!("not shown: {left_out} of {} sets, without a value or outside the axes", rows.len()),
    };
    let ink = |set: usize| {
        let Some((colour, hues)) = colour.as_ref().zip(hues.as_ref()) else { return INKS[0] };
        colour.numbers[set].map_or(GREY, |value| hues.ink(value))
    };
    let lines = lines(rows, x_name, &sets, &x.values);
    let layers = |members: &[usize]| {
        let mut layers = Vec::new();
        for line in &lines {
            let line: Vec<usize> = line.iter().copied().filter(|set| members.binary_search(set).is_ok()).collect();
            for pair in line.windows(2).filter(|pair| ink(pair[0]) == ink(pair[1])) {
                let stroke = Stroke::solid(ink(pair[0]), LINE_WIDTH);
                layers.push(Layer::Curve(pair.iter().filter_map(|&set| place(set)).collect(), stroke));
            }
        }
        // Confidence intervals, along both axes.
        for &set in members {
            let Some((at_x, at_y)) = place(set) else { continue };
            let stroke = Stroke::solid(ink(set), BAR_WIDTH);
            layers.extend(y.values.intervals[set].map(|ends| Layer::Bars(vec![(at_x, ends)], stroke)));
            layers.extend(x.values.intervals[set].map(|(low, high)| {
                let left = if x_axis.place(low).is_finite() { low } else { x_axis.low };
                Layer::Curve(vec![(left, at_y), (high, at_y)], stroke)
            }));
        }
        let dot = |set| Dot { opacity: 0.9, ..Dot::solid(ink(set), radius) };
        let dots = members.iter().map(|&set| Layer::Dots(place(set).into_iter().collect(), dot(set)));
        std::iter::once(Layer::Inside(layers)).chain(dots).collect()
    };
    let panel = |(index, (title, members)): (usize, (String, Vec<usize>))| {
        let mut panel = Panel::new(height, x_axis.clone(), y_axis.clone(), layers(&members));
        if index % columns > 0 {
            panel.y.label.clear();
        }
        panel.heading = (count > 1).then(|| (title, String::new()));
        panel.bar = hues.as_ref().and_then(Hues::bar).filter(|_| index + 1 == columns);
        panel
    };
    let panels = groups.into_iter().enumerate().map(panel).collect();
    Ok(panel::draw(&format!("{y_name}-{x_name}"), &look.with_note(&note), layout, &entries, panels))
}

fn of(rows: &[SetRow], option: &str, name: &str) -> Result<Values, BadOption> {
    Values::of(rows, name).map_err(|problem| BadOption::new(option, name, &problem))
}

/// Why an option cannot name a column.
fn refuse(option: &str, values: &Values, problem: &str) -> BadOption {
    BadOption::new(option, &values.column.name, problem)
}

impl Asked<'_> {
    fn refuse(&self, problem: &str) -> BadOption {
        refuse(self.option, &self.values, problem)
    }

    fn refuse_limits(&self, problem: &str) -> BadOption {
        let [low, high] = [self.limits.0, self.limits.1].map(|end| end.map_or_else(String::new, |end| end.to_string()));
        BadOption::new(&format!("{}lim", self.option), &format!("{low}:{high}"), problem)
    }

    /// Whether a set has a place on the axis.
    fn has(&self, set: usize) -> bool {
        self.values.numbers[set].is_some_and(|value| !self.is_log || self.values.is_worded() || value > 0.0)
    }

    /// The axis, from one limit or end of the data to the other.
    fn axis(&self, sets: &[usize]) -> Result<Axis, BadOption> {
        const SLACK: f64 = 1e-9;
        let label = self.label.map_or_else(|| axis_label(&self.values), str::to_owned);
        let short_label = self.label.is_none().then(|| short_label(&self.values));
        if self.values.is_worded() {
            let (name, count) = (&self.values.column.name, self.values.words.len());
            if self.is_log {
                let problem = format!("{name} holds words; a logarithmic axis takes numbers");
                return Err(BadOption::new("log", self.option, &problem));
            }
            if self.limits != (None, None) {
                return Err(self.refuse_limits(&format!("{name} holds words; limits are for numbers")));
            }
            if count > MAX_WORDS {
                let problem = format!("has {count} words, and {MAX_WORDS} fit an axis; take another column");
                return Err(self.refuse(&problem));
            }
            let words: Vec<&str> = self.values.words.iter().map(String::as_str).collect();
            return Ok(Axis::categories(&label, &words).with_short_label(short_label));
        }
        if self.is_log && [self.limits.0, self.limits.1].into_iter().flatten().any(|end| end <= 0.0) {
            return Err(self.refuse_limits("must be > 0 on a logarithmic axis"));
        }
        let ends = |&set: &usize| {
            let bar = self.values.intervals[set].map(|(low, high)| [low, high]);
            self.values.numbers[set].into_iter().chain(bar.into_iter().flatten())
        };
        let values = sets.iter().flat_map(ends);
        let natural = if self.is_log { logarithmic_bounds(values) } else { bounds(values).map(widened) };
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
        let short_label = short_label.map(|label| axis(&label, low, high).label);
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
    let (count, inks) = (values.words.len(), INKS.len());
    if count > inks {
        return Err(refuse(
            "colour",
            values,
            &format!("has {count} words, and there are {inks} colours; take another column"),
        ));
    }
    let mut known = values.numbers.iter().copied().flatten().peekable();
    known.peek().ok_or_else(|| refuse("colour", values, "no set has a value of it"))?;
    Ok(Hues::of(&short_label(values), known, |value| setting(values, value)))
}

/// The sets of each panel and its title.
fn groups(panels: Option<&Values>, sets: &[usize]) -> Result<Vec<(String, Vec<usize>)>, BadOption> {
    let Some(values) = panels else { return Ok(vec![(String::new(), sets.to_vec())]) };
    let of = |value: f64| {
        let members: Vec<usize> = sets.iter().copied().filter(|&set| values.numbers[set] == Some(value)).collect();
        (setting(values, value), members)
    };
    let mut groups: Vec<_> = ascending(values.numbers.iter().copied().flatten()).into_iter().map(of).collect();
    groups.retain(|(_, sets)| !sets.is_empty());
    let problem = match groups.len() {
        0 => "no set has a value of it".to_owned(),
        1..=MAX_PANELS => return Ok(groups),
        count => format!("has {count} values, and {MAX_PANELS} panels fit a page; show it with --colour"),
    };
    Err(refuse("panels", values, &problem))
}

/// Sets that differ in the x axis alone, if that is a parameter, η or 1/T, in the order of x.
fn lines(rows: &[SetRow], x_name: &str, sets: &[usize], x: &Values) -> Vec<Vec<usize>> {
    let symbol = if ["eta", FREQUENCY].contains(&x_name) { Some(Symbol::T) } else { Symbol::from_key(x_name) };
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
                frequency: parameters.modulation_period.map(|period| 1.0 / period),
                parameters: Selected::new(parameters.validated().unwrap()),
                tau_mean: Some(tau),
                tau_interval: Some(Interval { low: 0.9 * tau, high: 1.1 * tau }),
                ..SetRow::default()
            }
        };
        (0..count).map(row).collect()
    }

    fn figure() -> OwnFigure {
        OwnFigure { x: Some("V0".into()), y: Some("tau_mean".into()), ..OwnFigure::default() }
    }

    fn svg(figure: &OwnFigure) -> String {
        own(&rows(8), figure, &Look::default()).unwrap().svg()
    }

    fn problem(figure: &OwnFigure) -> String {
        own(&rows(8), figure, &Look::default()).err().unwrap().to_string()
    }

    #[test]
    fn either_end_of_an_axis_may_be_left_out() {
        let ends = |text: &str| limits(text).map(|limits| (limits.0, limits.1));
        assert_eq!(ends("1e-6:1e-3"), Ok((Some(1e-6), Some(1e-3))));
        assert_eq!((ends("-1:"), ends(":5")), (Ok((Some(-1.0), None)), Ok((None, Some(5.0)))));
        for wrong in ["", ":", "1", "a:b", "1:nan", "1:2:3", "inf:"] {
            assert!(ends(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn each_option_changes_what_it_says() {
        let plain = svg(&figure());
        assert!(plain.contains(">Drive velocity V₀ (10⁻⁶ m/s)<") && plain.contains(">Mean interval (s)<"));
        let bars = |svg: &str| svg.matches(&format!(r#"stroke-width="{BAR_WIDTH}""#)).count();
        let no_interval = OwnFigure { y: Some("eta".into()), ..figure() };
        assert_eq!((bars(&plain), bars(&svg(&no_interval))), (8, 0));
        let logarithmic = svg(&OwnFigure { log: Some("xy".into()), ..figure() });
        assert!(logarithmic.contains(">10⁻⁵<") && !plain.contains(">10⁻⁵<"));
        let colour = svg(&OwnFigure { colour: Some("Delta".into()), ..figure() });
        assert!(colour.contains(">Δ = 0 m<") && colour.contains(">Δ = 1e-6 m<") && colour.contains(INKS[1]));
        let scale = svg(&OwnFigure { colour: Some("V0".into()), ..figure() });
        assert!(scale.contains(">V₀ (m/s)<") && !scale.contains("V₀ = "));
        let panels = svg(&OwnFigure { panels: Some("Delta".into()), ..figure() });
        assert!(panels.contains(">(a)<") && panels.contains(">(b)<") && panels.contains(">Δ = 0 m<"));
        let limits = svg(&OwnFigure { xlim: Some((Some(1e-6), Some(1e-5))), ..figure() });
        assert!(limits.contains("not shown: 4 of 8 sets, without a value or outside the axes"), "{limits}");
        let label = svg(&OwnFigure { ylabel: Some("τ".into()), ..figure() });
        assert!(label.contains(">τ<") && !label.contains("Mean interval"));
        let without = svg(&OwnFigure { colour: Some("T".into()), ..figure() });
        assert!(without.contains(">T = 0.02 s<") && without.contains(">no T<"));
        let words = svg(&OwnFigure { x: Some("break_on".into()), ..figure() });
        assert!(words.contains(">magnitude<"));
    }

    #[test]
    fn mistakes_are_refused_with_what_to_do() {
        for (figure, expected) in [
            (OwnFigure { x: Some("v0".into()), ..figure() }, "--x v0: no such column; did you mean V0?"),
            (
                OwnFigure { colour: Some("colour".into()), ..figure() },
                "--colour colour: no such column; there are set_id",
            ),
            (
                OwnFigure { x: Some("break_on".into()), log: Some("x".into()), ..figure() },
                "--log x: break_on holds words",
            ),
            (
                OwnFigure { x: Some("break_on".into()), xlim: Some((Some(1.0), None)), ..figure() },
                "--xlim 1:: break_on holds words",
            ),
            (OwnFigure { y: Some("drop_mean".into()), ..figure() }, "no set has a value of both V0 and drop_mean"),
            (
                OwnFigure { y: Some("eta".into()), x: Some("T_to".into()), log: Some("y".into()), ..figure() },
                "no set has a value > 0",
            ),
            (OwnFigure { xlim: Some((Some(2.0), Some(1.0))), ..figure() }, "--xlim 2:1: the lower end must be less"),
            (
                OwnFigure { xlim: Some((Some(-1.0), None)), log: Some("x".into()), ..figure() },
                "--xlim -1:: must be > 0",
            ),
            (OwnFigure { xlim: Some((Some(1.0), Some(2.0))), ..figure() }, "none of 8 sets lies within"),
            (OwnFigure { panels: Some("regime".into()), ..figure() }, "--panels regime: no set has a value of it"),
        ] {
            let found = problem(&figure);
            assert!(found.contains(expected), "{found}");
        }
        let many = OwnFigure { panels: Some("V0".into()), ..figure() };
        let error = own(&rows(12), &many, &Look::default()).err().unwrap().to_string();
        assert!(
            error.contains("--panels V0: has 12 values, and 9 panels fit a page; show it with --colour"),
            "{error}"
        );
    }

    #[test]
    fn only_sets_that_differ_in_x_alone_are_joined() {
        let rows = rows(8);
        let x = Values::of(&rows, "V0").unwrap();
        let sets: Vec<usize> = (0..8).collect();
        assert_eq!(lines(&rows, "V0", &sets, &x), [vec![1, 3, 5, 7], vec![0, 2, 4, 6]]);
        assert!(lines(&rows, "tau_mean", &sets, &x).is_empty() && lines(&rows, "Delta", &sets, &x).is_empty());
        let mut periods = vec![rows[0].clone(); 3];
        for (row, period) in periods.iter_mut().zip([0.02, 0.01, 0.04]) {
            row.parameters.parameters.modulation_period = Some(period);
            row.frequency = Some(1.0 / period);
        }
        let x = Values::of(&periods, "frequency").unwrap();
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
