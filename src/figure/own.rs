//! Sets against a column: the overview of a sweep, and figures of one's own, with error bars where there are intervals.

use super::BadOption;
use super::axis::{Axis, bounds, is_wide, logarithmic_bounds, widened};
use super::frame::{LEFT, Layout};
use super::hues::Hues;
use super::legend::{Entry, Mark, entry};
use super::panel::{self, Ends, Layer, Panel, Place};
use super::picture::{Dot, Ink, Picture, Stroke};
use super::style::{
    BAR_WIDTH, BLACK, GREY, INKS, Look, RADIUS, REFERENCE, STRIPE, WHITE, dot, drive_alone,
};
use crate::model::Symbol;
use crate::observe::Regime;
use crate::reduce::{FREQUENCY, SetRow, Swept, Values, ascending, is_same, swept};
use crate::sets::Label;
use clap::Args;
use std::collections::BTreeMap;

/// Quantities of the overview: intervals, friction, time within slips, phases.
const QUANTITIES: [&str; 5] = [
    "tau_mean",
    "tau_sd",
    "mean_friction",
    "slip_share",
    "resultant_length",
];
/// Where the paper finds a significant reduction of the friction to begin, as a share of the peak force.
const REDUCTION: Ends = (0.2, 0.3);
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 400.0;
/// Panels in a row, and in all.
const MAX_COLUMNS: usize = 3;
const MAX_PANELS: usize = 9;
const PANEL_WIDTH: f64 = 260.0;
const PANEL_HEIGHT: f64 = 220.0;
const PANEL_GAP: f64 = 26.0;
/// Between columns, for the labels of their axes.
const LABEL_GAP: f64 = 16.0;
/// Values of a parameter up to which each has its tick.
pub(super) const MAX_TICKS: usize = 6;
const MAX_WORDS: usize = 12;
/// Lines between sets; more would be a net.
const MAX_LINES: usize = 24;
const LINE_WIDTH: f64 = 1.0;
/// Sets up to which dots and bars have their full size.
const FEW_SETS: usize = 200;
const SMALL_RADIUS: f64 = 2.5;
/// By how much the hole in the dot of a set that slides is smaller.
const HOLE: f64 = 1.6;

/// The ends of an axis.
pub type Limits = (Option<f64>, Option<f64>);

#[derive(Clone, Debug, Default, PartialEq, Args)]
#[command(next_help_heading = "A figure of your own")]
pub struct OwnFigure {
    /// Column, or formula of columns such as 'Kd*Delta', on the x axis of a figure of your own
    #[arg(long, value_name = "COLUMN", requires = "y")]
    pub x: Option<String>,
    /// Column on the y axis, with error bars if it has an interval; or a formula, without
    #[arg(long, value_name = "COLUMN", requires = "x")]
    pub y: Option<String>,
    /// Column that colours show, up to six values in the legend, more on a scale [default: what else was swept]
    #[arg(long, value_name = "COLUMN", requires = "x")]
    pub colour: Option<String>,
    /// Column whose values get a panel each, up to nine
    #[arg(long, value_name = "COLUMN", requires = "x")]
    pub panels: Option<String>,
    /// Logarithmic axes [default: where it was swept so, or values lie decades apart]
    #[arg(long, value_name = "AXES", requires = "x", value_parser = ["x", "y", "xy", "none"])]
    pub log: Option<String>,
    /// Ends of the x axis, in SI; either may be left out
    #[arg(long, value_name = "LOW:HIGH", requires = "x", value_parser = limits, allow_hyphen_values = true)]
    pub xlim: Option<Limits>,
    /// Ends of the y axis, in SI
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
        number => number
            .parse()
            .ok()
            .filter(|end: &f64| end.is_finite())
            .map(Some)
            .ok_or(WANTED),
    };
    match text.split_once(':') {
        Some((low, high)) if text.trim() != ":" => Ok((end(low)?, end(high)?)),
        _ => Err(WANTED),
    }
}

/// A column as an axis or as colours.
pub(super) struct Asked<'a> {
    option: &'static str,
    pub(super) column: Swept,
    /// The parameter that it shows, if it shows one.
    symbol: Option<Symbol>,
    /// What the drive alone explains of it.
    drive: Option<Values>,
    /// To the unit of the axis.
    pub(super) factor: f64,
    unit: &'static str,
    is_log: bool,
    /// In SI.
    limits: Limits,
    label: Option<&'a str>,
}

/// Sets against a column: a panel for each quantity and each value of another column.
struct Chart<'a> {
    rows: &'a [SetRow],
    swept: &'a [Swept],
    x: Asked<'a>,
    ys: Vec<Asked<'a>>,
    colour: Option<Asked<'a>>,
    panels: Option<Values>,
}

/// Draws a dot for each set; those that differ in the parameter on the x axis alone are joined. If no colour is asked for, it
/// shows a second swept parameter; an axis is logarithmic where it was swept so, or where its values lie decades apart.
pub(super) fn own(rows: &[SetRow], figure: &OwnFigure, look: &Look) -> Result<Picture, BadOption> {
    let asked = |option, name: &Option<String>| {
        Asked::of(rows, option, name.as_deref().unwrap_or_default())
    };
    let axis = |option, name, limits: Option<Limits>, label| -> Result<_, BadOption> {
        let asked: Asked<'_> = asked(option, name)?;
        let is_log = figure
            .log
            .as_ref()
            .map_or(asked.is_log, |axes| axes.contains(option));
        Ok(Asked {
            is_log,
            limits: limits.unwrap_or_default(),
            label,
            ..asked
        })
    };
    let x = axis("x", &figure.x, figure.xlim, figure.xlabel.as_deref())?;
    let y = axis("y", &figure.y, figure.ylim, figure.ylabel.as_deref())?;
    let panels = figure
        .panels
        .is_some()
        .then(|| asked("panels", &figure.panels))
        .transpose()?;
    let swept = swept(rows);
    let is_free = |swept: &&Swept| {
        let shown = [Some(&x), panels.as_ref()].into_iter().flatten();
        shown
            .into_iter()
            .all(|shown| shown.symbol != parameter(swept.name()))
    };
    let second = || {
        swept
            .iter()
            .find(is_free)
            .map(|swept| swept.name().to_owned())
    };
    let colour = figure.colour.clone().or_else(second);
    let colour = colour
        .is_some()
        .then(|| asked("colour", &colour))
        .transpose()?;
    // Formulas have letters that no file name should have.
    let is_plain = |letter: char| letter.is_alphanumeric() || letter == '_';
    let name = format!("{}-{}", y.name(), x.name()).replace(|letter| !is_plain(letter), "-");
    let panels = panels.map(|panels| panels.column.values);
    Chart {
        rows,
        swept: &swept,
        x,
        ys: vec![y],
        colour,
        panels,
    }
    .draw(&name, look)
}

/// Draws what was found of the sets over the swept parameter with the most values; the second gives colours, the third panels.
/// A single set is a dot over its velocity. `None` if nothing was found.
pub(super) fn overview(rows: &[SetRow], look: &Look) -> Option<Picture> {
    let swept = swept(rows);
    let is_plain = rows.iter().all(|row| row.regime == Some(Regime::StickSlip));
    let asked = |place: usize, option| Asked::of(rows, option, swept.get(place)?.name()).ok();
    let x = asked(0, "x").or_else(|| Asked::of(rows, "x", "V0").ok())?;
    let found = QUANTITIES
        .into_iter()
        .filter(|name| !is_plain || *name != "slip_share");
    let found = found.filter_map(|name| Asked::of(rows, "y", name).ok());
    let shown = |y: &Asked<'_>| {
        (0..rows.len())
            .filter(|&set| x.has(set) && y.has(set))
            .collect::<Vec<_>>()
    };
    let ys: Vec<Asked<'_>> = found.filter(|y| !shown(y).is_empty()).collect();
    // No panel is to be empty.
    let fills = |place: &usize| {
        let Some(swept) = swept.get(*place) else {
            return false;
        };
        let places = swept.places();
        let mut values = places.clone();
        values.sort();
        values.dedup();
        let has_all = |y| {
            values
                .iter()
                .all(|value| shown(y).iter().any(|&set| places[set] == *value))
        };
        values.len() <= MAX_COLUMNS && ys.iter().all(has_all)
    };
    let panels = if swept.len() > 2 {
        [2, 1].into_iter().find(fills)
    } else {
        None
    };
    let colour = asked(if panels == Some(1) { 2 } else { 1 }, "colour");
    let panels = panels.map(|place| swept[place].values.clone());
    Chart {
        rows,
        swept: &swept,
        x,
        ys,
        colour,
        panels,
    }
    .draw("overview", look)
    .ok()
}

/// The parameter that a column shows.
fn parameter(column: &str) -> Option<Symbol> {
    if ["eta", FREQUENCY].contains(&column) {
        Some(Symbol::T)
    } else {
        Symbol::from_key(column)
    }
}

impl<'a> Chart<'a> {
    fn draw(&self, name: &str, look: &Look) -> Result<Picture, BadOption> {
        let Self { rows, x, ys, .. } = self;
        let sets: Vec<usize> = (0..rows.len())
            .filter(|&set| x.has(set) && ys.iter().any(|y| y.has(set)))
            .collect();
        if sets.is_empty() {
            let is_log = x.is_log && x.column.distinct.first().is_none_or(|least| *least <= 0.0);
            let kind = if is_log || ys.iter().any(|y| y.is_log) {
                "no set has a value > 0"
            } else {
                "no set has a value"
            };
            let names: Vec<&str> = std::iter::once(x).chain(ys).map(Asked::name).collect();
            let problem = format!(
                "{kind} of both {}; nothing can be drawn",
                names.join(" and ")
            );
            return Err(ys.first().unwrap_or(x).refuse(&problem));
        }
        let free = self.free();
        let x_axis = x.axis(&sets)?;
        let of_y = |y: &Asked<'_>| {
            let all = sets.iter().chain(&free).copied();
            y.axis(&all.filter(|&set| y.has(set)).collect::<Vec<_>>())
        };
        let y_axes = ys
            .iter()
            .map(of_y)
            .collect::<Result<Vec<Axis>, BadOption>>()?;
        let is_on = |axis: &Axis, asked: &Asked<'_>, set| {
            asked.number(set).is_some_and(|value| axis.contains(value))
        };
        let is_inside = |set: usize| {
            is_on(&x_axis, x, set) && ys.iter().zip(&y_axes).any(|(y, axis)| is_on(axis, y, set))
        };
        let inside: Vec<usize> = sets.iter().copied().filter(|&set| is_inside(set)).collect();
        if inside.is_empty() {
            let problem = format!(
                "none of {} sets lies within --xlim and --ylim; give wider ones",
                sets.len()
            );
            return Err(x.refuse(&problem));
        }
        let hues = self.colour.as_ref().map(hues).transpose()?;
        let groups = groups(self.panels.as_ref(), &sets)?;
        let (columns, [width, height]) = match (ys.len(), groups.len()) {
            (1, 1) => (1, [WIDTH, HEIGHT]),
            (1, count) => (
                if count == 4 {
                    2
                } else {
                    count.min(MAX_COLUMNS)
                },
                [PANEL_WIDTH, PANEL_HEIGHT],
            ),
            // Quantities one under the other, or two and two.
            (2 | 3, 1) => (1, [WIDTH, 0.5 * HEIGHT]),
            (_, 1) => (2, [1.25 * PANEL_WIDTH, PANEL_HEIGHT]),
            (_, count) => (count, [PANEL_WIDTH, 0.8 * PANEL_HEIGHT]),
        };
        let stack = Layout::column(width);
        let row_gap = if ys.len() == 1 {
            PANEL_GAP
        } else {
            stack.row_gap
        };
        let layout = Layout {
            columns,
            column_gap: LEFT + LABEL_GAP,
            row_gap,
            ..stack
        };
        let radius = if inside.len() > FEW_SETS {
            SMALL_RADIUS
        } else {
            RADIUS
        };
        let lines = self.lines(&sets);
        let mut cells: Vec<Panel<'_>> = Vec::new();
        for (y, axis) in ys.iter().zip(y_axes) {
            for (title, members) in &groups {
                let layers =
                    self.layers(y, &x_axis, hues.as_ref(), radius, [members, &free], &lines);
                let mut panel = Panel::new(height, x_axis.clone(), axis.clone(), layers);
                if groups.len() > 1 {
                    if !cells.len().is_multiple_of(columns) {
                        panel.y.label.clear();
                    }
                    panel.heading = Some(title.clone());
                }
                panel.bar = hues
                    .as_ref()
                    .and_then(Hues::bar)
                    .filter(|_| cells.len() + 1 == columns);
                cells.push(panel);
            }
        }
        let look = look.with_note(&self.note(&inside, free.len()));
        Ok(panel::draw(
            name,
            &look,
            layout,
            &self.legend(&inside, &free, hues.as_ref(), !lines.is_empty()),
            cells,
        ))
    }

    /// Sets without modulation, where the axis is that of the modulation: they have no place on it, but a level.
    fn free(&self) -> Vec<usize> {
        let is_free = |&set: &usize| {
            self.x.symbol == Some(Symbol::T)
                && self.rows[set].parameters.modulation_period.is_none()
                && !self.x.has(set)
        };
        let free: Vec<usize> = (0..self.rows.len()).filter(is_free).collect();
        if free.len() > INKS.len() {
            Vec::new()
        } else {
            free
        }
    }

    /// Sets that differ in the x axis alone, in its order.
    fn lines(&self, sets: &[usize]) -> Vec<Vec<usize>> {
        let Some(symbol) = self.x.symbol else {
            return Vec::new();
        };
        // What is measured makes no line: neighbours of one colour, or at one value of y, have nothing else in common.
        if self
            .colour
            .as_ref()
            .is_some_and(|colour| colour.symbol.is_none())
            || self.ys.iter().any(|y| y.symbol.is_some())
        {
            return Vec::new();
        }
        let others: Vec<_> = self
            .swept
            .iter()
            .filter(|other| parameter(other.name()) != Some(symbol))
            .map(Swept::places)
            .collect();
        let mut lines: BTreeMap<Vec<Option<usize>>, Vec<usize>> = BTreeMap::new();
        for &set in sets {
            lines
                .entry(others.iter().map(|places| places[set]).collect())
                .or_default()
                .push(set);
        }
        let mut lines: Vec<Vec<usize>> =
            lines.into_values().filter(|line| line.len() > 1).collect();
        let number = |set| self.x.number(set).unwrap_or(f64::NAN);
        for line in &mut lines {
            line.sort_by(|&left, &right| number(left).total_cmp(&number(right)));
        }
        if lines.len() > MAX_LINES {
            Vec::new()
        } else {
            lines
        }
    }

    fn ink(&self, hues: Option<&Hues>, set: usize) -> Ink {
        let Some((colour, hues)) = self.colour.as_ref().zip(hues) else {
            return INKS[0];
        };
        colour.number(set).map_or(GREY, |value| hues.ink(value))
    }

    /// Sets as dots, joined, with their intervals along both axes, over those without modulation and the drive's part.
    fn layers(
        &self,
        y: &Asked<'_>,
        x_axis: &Axis,
        hues: Option<&Hues>,
        radius: f64,
        [members, free]: [&[usize]; 2],
        lines: &[Vec<usize>],
    ) -> Vec<Layer<'a>> {
        let ink = |set: &usize| self.ink(hues, *set);
        let x = &self.x;
        let place = |set: &usize| x.number(*set).zip(y.number(*set));
        let drive = |set: &usize| x.number(*set).zip(y.drive.as_ref()?.numbers[*set]);
        let level = |set: &usize| {
            let ink = if hues.is_some() { ink(set) } else { GREY };
            Some(Layer::Level(y.number(*set)?, Stroke { ink, ..REFERENCE }))
        };
        let mut layers: Vec<Layer<'a>> = Vec::new();
        layers.extend(self.reduction(y).map(|ends| Layer::Stripe(ends, STRIPE)));
        if y.name() == "slip_share" {
            layers.extend(Regime::MIN_SHARES.map(|share| Layer::Level(share, REFERENCE)));
        }
        layers.extend(free.iter().filter_map(level));
        for line in lines {
            let line: Vec<usize> = line
                .iter()
                .copied()
                .filter(|set| members.contains(set))
                .collect();
            let alone: Vec<Place> = line.iter().filter_map(drive).collect();
            layers.extend(
                line.first()
                    .map(|first| Layer::Curve(alone, drive_alone(ink(first)))),
            );
            let known: Vec<usize> = line.into_iter().filter(|&set| y.has(set)).collect();
            for pair in known
                .windows(2)
                .filter(|pair| ink(&pair[0]) == ink(&pair[1]))
            {
                layers.push(Layer::Curve(
                    pair.iter().filter_map(place).collect(),
                    Stroke::solid(ink(&pair[0]), LINE_WIDTH),
                ));
            }
        }
        if lines.is_empty() {
            layers.push(Layer::Dots(
                members.iter().filter_map(drive).collect(),
                Dot::solid(GREY, SMALL_RADIUS),
            ));
        }
        for set in members {
            let Some((at_x, at_y)) = place(set) else {
                continue;
            };
            let stroke = Stroke::solid(
                ink(set),
                if radius < RADIUS {
                    LINE_WIDTH
                } else {
                    BAR_WIDTH
                },
            );
            layers.extend(
                y.interval(*set)
                    .map(|ends| Layer::Bars(vec![(at_x, ends)], stroke)),
            );
            layers.extend(x.interval(*set).map(|(low, high)| {
                let left = if x_axis.place(low).is_finite() {
                    low
                } else {
                    x_axis.low
                };
                Layer::Curve(vec![(left, at_y), (high, at_y)], stroke)
            }));
        }
        let dots = members.iter().flat_map(|set| {
            let dot = |dot| Layer::Dots(place(set).into_iter().collect(), dot);
            let hole = self
                .slides(*set)
                .then(|| dot(Dot::solid(WHITE, radius - HOLE)));
            std::iter::once(dot(Dot {
                opacity: 0.9,
                ..Dot::solid(ink(set), radius)
            }))
            .chain(hole)
        });
        std::iter::once(Layer::Inside(layers)).chain(dots).collect()
    }

    fn slides(&self, set: usize) -> bool {
        self.rows[set].regime == Some(Regime::Sliding)
    }

    /// Amplitudes at which the paper finds a significant reduction of the friction to begin, on the x axis.
    fn reduction(&self, y: &Asked<'_>) -> Option<Ends> {
        let is_fixed = |symbol| {
            self.swept
                .iter()
                .all(|swept| parameter(swept.name()) != Some(symbol))
        };
        let is_of_both = y.name() == "mean_friction" && self.x.symbol == Some(Symbol::Delta);
        let free = self
            .rows
            .iter()
            .find(|row| row.parameters.modulation_period.is_none());
        let free = free.filter(|_| is_of_both && is_fixed(Symbol::Kd) && is_fixed(Symbol::V0))?;
        let unit = self.x.factor * free.peak_force_mean? / free.parameters.drive_stiffness;
        Some((REDUCTION.0 * unit, REDUCTION.1 * unit))
    }

    /// What each mark means that is drawn.
    fn legend(
        &self,
        inside: &[usize],
        free: &[usize],
        hues: Option<&Hues>,
        has_lines: bool,
    ) -> Vec<Entry> {
        let mut entries = Vec::new();
        if let Some((colour, hues)) = self.colour.as_ref().zip(hues) {
            let numbers = || inside.iter().map(|&set| colour.number(set));
            entries.extend(hues.entries(RADIUS, |value| {
                numbers().any(|number| number == Some(value))
            }));
            let none = || entry(Mark::Dot(dot(GREY)), without_value(&colour.column.values));
            entries.extend(numbers().any(|number| number.is_none()).then(none));
        }
        entries.extend((!free.is_empty()).then(|| entry(Mark::Line(REFERENCE), "Δ = 0")));
        let slides = inside.iter().any(|&set| self.slides(set));
        entries.extend(slides.then(|| entry(Mark::Ring(BLACK, RADIUS, RADIUS - 1.6), "sliding")));
        if self.ys.iter().any(|y| y.name() == "slip_share") {
            let [mixed, sliding] = Regime::MIN_SHARES;
            entries.push(entry(
                Mark::Line(REFERENCE),
                format!("mixed above {mixed}, sliding above {sliding}"),
            ));
        }
        let has_drive = self.ys.iter().any(|y| y.drive.is_some());
        let alone = if has_lines {
            Mark::Line(drive_alone(BLACK))
        } else {
            Mark::Dot(Dot::solid(GREY, SMALL_RADIUS))
        };
        entries.extend(has_drive.then(|| entry(alone, "by the drive alone")));
        let is_reduced = self.ys.iter().any(|y| self.reduction(y).is_some());
        let stripe = "K_d Δ = 0.2 to 0.3 of the peak force: friction falls, says the paper";
        entries.extend(is_reduced.then(|| entry(Mark::Patch(STRIPE), stripe)));
        entries
    }

    /// Swept parameters that nothing shows.
    fn pooled(&self) -> Option<String> {
        let asked = [Some(&self.x), self.colour.as_ref()]
            .into_iter()
            .flatten()
            .chain(&self.ys)
            .map(Asked::name);
        let names = asked.chain(self.panels.as_ref().map(|panels| &*panels.column.name));
        let words = names
            .flat_map(|name| name.split(|letter: char| !letter.is_alphanumeric() && letter != '_'));
        let shown: Vec<Option<Symbol>> = words.map(parameter).collect();
        let pooled = self
            .swept
            .iter()
            .filter(|swept| !shown.contains(&parameter(swept.name())));
        let symbols: Vec<String> = pooled.map(|swept| swept.values.label().symbol).collect();
        (!symbols.is_empty())
            .then(|| format!("not told apart: sets that differ in {}", symbols.join(", ")))
    }

    /// What bars are, and what is not there.
    fn note(&self, inside: &[usize], levels: usize) -> String {
        let shows_intervals = self.ys.iter().any(|y| y.name().starts_with("tau"));
        let is_still = |set: &usize| {
            shows_intervals && self.slides(*set) && self.rows[*set].tau_mean.is_none()
        };
        let still: Vec<usize> = (0..self.rows.len()).filter(is_still).collect();
        let still_outside = still.iter().filter(|set| !inside.contains(set)).count();
        let count = self.rows.len();
        let left_out = count - inside.len() - levels - still_outside;
        let still = (!still.is_empty())
            .then(|| format!("{} of {count} sets slide: no intervals", still.len()));
        let left_out = (left_out > 0).then(|| {
            format!("not shown: {left_out} of {count} sets, without a value or outside the axes")
        });
        let bars = self
            .ys
            .iter()
            .any(|y| inside.iter().any(|&set| y.interval(set).is_some()))
            .then(|| "bars: 95 %".to_owned());
        [bars, still, left_out, self.pooled()]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join("; ")
    }
}

/// Values of a statistic from which on one alone says nothing of its scale.
const FEW_VALUES: usize = 8;

impl Asked<'_> {
    pub(super) fn of(rows: &[SetRow], option: &'static str, name: &str) -> Result<Self, BadOption> {
        let column =
            Swept::of(rows, name).map_err(|problem| BadOption::new(option, name, &problem))?;
        let drive = match name {
            "resultant_length" => Values::of(rows, "resultant_drive").ok(),
            "locking_index" => Values::of(rows, "locking_index_drive").ok(),
            _ => None,
        };
        let drive = drive.filter(|drive| drive.numbers.iter().any(Option::is_some));
        let (factor, unit) = column.values.scale();
        let symbol = parameter(name);
        let is_log = match (symbol, &column.distinct[..]) {
            (Some(_), _) => column.is_logarithmic(),
            (None, values @ [least, .., _]) => {
                let low = column
                    .values
                    .intervals
                    .iter()
                    .flatten()
                    .map(|(low, _)| *low)
                    .fold(*least, f64::min);
                // One set of its own, such as the only one that slides, changes no scale.
                let alone = usize::from(values.len() >= FEW_VALUES);
                let ends = (values[alone], values[values.len() - 1 - alone]);
                !column.values.is_worded() && low > 0.0 && is_wide(ends)
            }
            _ => false,
        };
        Ok(Self {
            option,
            column,
            symbol,
            drive,
            factor,
            unit,
            is_log,
            limits: (None, None),
            label: None,
        })
    }

    fn name(&self) -> &str {
        self.column.name()
    }

    fn label(&self) -> Label {
        self.column.values.label()
    }

    pub(super) fn axis_label(&self) -> String {
        self.label
            .map_or_else(|| self.label().axis(self.unit), str::to_owned)
    }

    /// Each value once, ascending.
    pub(super) fn distinct(&self) -> impl Iterator<Item = f64> + '_ {
        self.column.distinct.iter().map(|value| self.factor * value)
    }

    /// The period in s at a place on an axis of periods or frequencies.
    pub(super) fn period(&self, place: f64) -> f64 {
        if self.name() == FREQUENCY {
            self.factor / place
        } else {
            place / self.factor
        }
    }

    pub(super) fn number(&self, set: usize) -> Option<f64> {
        self.column.values.numbers[set].map(|number| self.factor * number)
    }

    fn interval(&self, set: usize) -> Option<Ends> {
        self.column.values.intervals[set].map(|(low, high)| (self.factor * low, self.factor * high))
    }

    fn refuse(&self, problem: &str) -> BadOption {
        refuse(self.option, &self.column.values, problem)
    }

    fn refuse_limits(&self, problem: &str) -> BadOption {
        let [low, high] = [self.limits.0, self.limits.1]
            .map(|end| end.map_or_else(String::new, |end| end.to_string()));
        BadOption::new(
            &format!("{}lim", self.option),
            &format!("{low}:{high}"),
            problem,
        )
    }

    /// Whether a set has a place on the axis.
    fn has(&self, set: usize) -> bool {
        self.number(set)
            .is_some_and(|value| !self.is_log || self.column.values.is_worded() || value > 0.0)
    }

    /// The axis, from one limit or end of the data to the other.
    fn axis(&self, sets: &[usize]) -> Result<Axis, BadOption> {
        const SLACK: f64 = 1e-9;
        let label = self.axis_label();
        let short_label = self.label.is_none().then(|| self.label().short(self.unit));
        let values = &self.column.values;
        if values.is_worded() {
            let (name, count) = (self.name(), values.words.len());
            if self.is_log {
                let problem = format!("{name} holds words; a logarithmic axis takes numbers");
                return Err(BadOption::new("log", self.option, &problem));
            }
            if self.limits != (None, None) {
                return Err(
                    self.refuse_limits(&format!("{name} holds words; limits are for numbers"))
                );
            }
            if count > MAX_WORDS {
                let problem =
                    format!("has {count} words, and {MAX_WORDS} fit an axis; take another column");
                return Err(self.refuse(&problem));
            }
            let words: Vec<&str> = values.words.iter().map(String::as_str).collect();
            return Ok(Axis::categories(&label, &words).with_short_label(short_label));
        }
        if self.is_log
            && [self.limits.0, self.limits.1]
                .into_iter()
                .flatten()
                .any(|end| end <= 0.0)
        {
            return Err(self.refuse_limits("must be > 0 on a logarithmic axis"));
        }
        let ends = |&set: &usize| {
            let bar = self.interval(set).map(|(low, high)| [low, high]);
            let drive = self.drive.as_ref().and_then(|drive| drive.numbers[set]);
            self.number(set)
                .into_iter()
                .chain(bar.into_iter().flatten())
                .chain(drive)
        };
        let values = sets.iter().flat_map(ends);
        let natural = if self.is_log {
            logarithmic_bounds(values)
        } else {
            bounds(values).map(widened)
        };
        let (low, high) = natural.ok_or_else(|| self.refuse("has no finite value"))?;
        // Values at a limit are shown, however they are rounded.
        let low = self
            .limits
            .0
            .map_or(low, |end| self.factor * (end - SLACK * end.abs()));
        let high = self
            .limits
            .1
            .map_or(high, |end| self.factor * (end + SLACK * end.abs()));
        if low >= high {
            return Err(self.refuse_limits(
                "the lower end must be less than the upper; with one end given, than the data's",
            ));
        }
        let axis = if self.is_log {
            Axis::logarithmic
        } else {
            Axis::linear
        };
        let has_few = (2..=MAX_TICKS).contains(&self.column.distinct.len());
        if self.symbol.is_some() && self.limits == (None, None) && has_few {
            let values: Vec<f64> = self.distinct().collect();
            let axis = axis(&label, low, high).with_ticks_at(&label, &values);
            return Ok(axis.with_short_label(short_label));
        }
        let short_label = short_label.map(|label| axis(&label, low, high).label);
        Ok(axis(&label, low, high)
            .with_short_label(short_label)
            .with_enough_numbers())
    }
}

/// Why an option cannot name a column.
fn refuse(option: &str, values: &Values, problem: &str) -> BadOption {
    BadOption::new(option, &values.column.name, problem)
}

fn hues(colour: &Asked<'_>) -> Result<Hues, BadOption> {
    let (count, inks) = (colour.column.values.words.len(), INKS.len());
    if count > inks {
        return Err(colour.refuse(&format!(
            "has {count} words, and there are {inks} colours; take another column"
        )));
    }
    if colour.column.distinct.is_empty() {
        return Err(colour.refuse("no set has a value of it"));
    }
    let known = colour
        .column
        .values
        .numbers
        .iter()
        .flatten()
        .map(|value| colour.factor * value);
    let word = |value: f64| colour.column.values.setting(value / colour.factor);
    Ok(Hues::of(&colour.label().short(colour.unit), known, word))
}

/// What is said of sets without a value of a column: of a period, that they have no modulation.
fn without_value(values: &Values) -> String {
    let is_period = parameter(&values.column.name) == Some(Symbol::T);
    if is_period {
        "Δ = 0".to_owned()
    } else {
        format!("no {}", values.label().symbol)
    }
}

/// The sets of each panel and its title.
fn groups(panels: Option<&Values>, sets: &[usize]) -> Result<Vec<(String, Vec<usize>)>, BadOption> {
    let Some(values) = panels else {
        return Ok(vec![(String::new(), sets.to_vec())]);
    };
    let of = |value: f64| {
        let is_of = |set: &usize| values.numbers[*set].is_some_and(|number| is_same(value, number));
        (
            values.setting(value),
            sets.iter().copied().filter(is_of).collect::<Vec<_>>(),
        )
    };
    let mut groups: Vec<_> = ascending(values.numbers.iter().copied().flatten())
        .into_iter()
        .map(of)
        .collect();
    groups.retain(|(_, sets)| !sets.is_empty());
    // Sets without a value, such as a frequency at Δ = 0, have a panel of their own.
    let without: Vec<usize> = sets
        .iter()
        .copied()
        .filter(|&set| values.numbers[set].is_none())
        .collect();
    if !groups.is_empty() && !without.is_empty() {
        groups.insert(0, (without_value(values), without));
    }
    let problem = match groups.len() {
        0 => "no set has a value of it".to_owned(),
        1..=MAX_PANELS => return Ok(groups),
        count => {
            format!("has {count} values, and {MAX_PANELS} panels fit a page; show it with --colour")
        }
    };
    Err(refuse("panels", values, &problem))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::sets::tests::set;
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
                tau_interval: Some(Interval {
                    low: 0.9 * tau,
                    high: 1.1 * tau,
                }),
                ..SetRow::default()
            }
        };
        (0..count).map(row).collect()
    }

    fn figure() -> OwnFigure {
        OwnFigure {
            x: Some("V0".into()),
            y: Some("tau_mean".into()),
            ..OwnFigure::default()
        }
    }

    fn svg(figure: &OwnFigure) -> String {
        own(&rows(8), figure, &Look::default()).unwrap().svg()
    }

    fn problem(figure: &OwnFigure) -> String {
        own(&rows(8), figure, &Look::default())
            .err()
            .unwrap()
            .to_string()
    }

    #[test]
    fn either_end_of_an_axis_may_be_left_out() {
        let ends = |text: &str| limits(text).map(|limits| (limits.0, limits.1));
        assert_eq!(ends("1e-6:1e-3"), Ok((Some(1e-6), Some(1e-3))));
        assert_eq!(
            (ends("-1:"), ends(":5")),
            (Ok((Some(-1.0), None)), Ok((None, Some(5.0))))
        );
        for wrong in ["", ":", "1", "a:b", "1:nan", "1:2:3", "inf:"] {
            assert!(ends(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn each_option_changes_what_it_says() {
        let plain = svg(&figure());
        // Velocities that double, and intervals that halve.
        assert!(
            plain.contains(">Drive velocity V₀ (m/s)<")
                && plain.contains(">Mean interval ⟨τ⟩ (s)<")
        );
        assert!(
            plain.contains(">10⁻⁵<") && plain.contains(">Δ = 0<") && plain.contains(">Δ = 1 µm<")
        );
        let bars = |svg: &str| {
            svg.matches(&format!(r#"stroke-width="{BAR_WIDTH}""#))
                .count()
        };
        let no_interval = OwnFigure {
            y: Some("eta".into()),
            ..figure()
        };
        assert_eq!((bars(&plain), bars(&svg(&no_interval))), (8, 0));
        let linear = svg(&OwnFigure {
            log: Some("none".into()),
            ..figure()
        });
        assert!(linear.contains(">Drive velocity V₀ (10⁻⁶ m/s)<") && !linear.contains(">10⁻⁵<"));
        let scale = svg(&OwnFigure {
            colour: Some("V0".into()),
            ..figure()
        });
        assert!(
            scale.contains(">V₀ (m/s)<") && !scale.contains("V₀ = ") && !scale.contains("Δ = ")
        );
        let panels = svg(&OwnFigure {
            panels: Some("Delta".into()),
            ..figure()
        });
        assert!(panels.contains(">(a)<") && panels.contains(">(b)<") && panels.contains(">Δ = 0<"));
        let limits = svg(&OwnFigure {
            xlim: Some((Some(1e-6), Some(1e-5))),
            ..figure()
        });
        assert!(
            limits.contains("not shown: 4 of 8 sets, without a value or outside the axes"),
            "{limits}"
        );
        let label = svg(&OwnFigure {
            ylabel: Some("τ".into()),
            ..figure()
        });
        assert!(label.contains(">τ<") && !label.contains("Mean interval"));
        let without = svg(&OwnFigure {
            colour: Some("T".into()),
            ..figure()
        });
        assert!(without.contains(">T = 20 ms<") && without.contains(">Δ = 0<"));
        let words = svg(&OwnFigure {
            x: Some("break_on".into()),
            ..figure()
        });
        assert!(words.contains(">magnitude<"));
    }

    #[test]
    fn mistakes_are_refused_with_what_to_do() {
        for (figure, expected) in [
            (
                OwnFigure {
                    x: Some("v0".into()),
                    ..figure()
                },
                "--x v0: no such column; did you mean V0?",
            ),
            (
                OwnFigure {
                    colour: Some("colour".into()),
                    ..figure()
                },
                "--colour colour: no such column; `stickslip plot --list`",
            ),
            (
                OwnFigure {
                    x: Some("break_on".into()),
                    log: Some("x".into()),
                    ..figure()
                },
                "--log x: break_on holds words",
            ),
            (
                OwnFigure {
                    x: Some("break_on".into()),
                    xlim: Some((Some(1.0), None)),
                    ..figure()
                },
                "--xlim 1:: break_on holds words",
            ),
            (
                OwnFigure {
                    y: Some("drop_mean".into()),
                    ..figure()
                },
                "no set has a value of both V0 and drop_mean",
            ),
            (
                OwnFigure {
                    y: Some("eta".into()),
                    x: Some("T_to".into()),
                    log: Some("y".into()),
                    ..figure()
                },
                "no set has a value > 0",
            ),
            (
                OwnFigure {
                    xlim: Some((Some(2.0), Some(1.0))),
                    ..figure()
                },
                "--xlim 2:1: the lower end must be less",
            ),
            (
                OwnFigure {
                    xlim: Some((Some(-1.0), None)),
                    log: Some("x".into()),
                    ..figure()
                },
                "--xlim -1:: must be > 0",
            ),
            (
                OwnFigure {
                    xlim: Some((Some(1.0), Some(2.0))),
                    ..figure()
                },
                "none of 8 sets lies within",
            ),
            (
                OwnFigure {
                    panels: Some("regime".into()),
                    ..figure()
                },
                "--panels regime: no set has a value of it",
            ),
        ] {
            let found = problem(&figure);
            assert!(found.contains(expected), "{found}");
        }
        let many = OwnFigure {
            panels: Some("V0".into()),
            ..figure()
        };
        let error = own(&rows(12), &many, &Look::default())
            .err()
            .unwrap()
            .to_string();
        assert!(
            error.contains(
                "--panels V0: has 12 values, and 9 panels fit a page; show it with --colour"
            ),
            "{error}"
        );
    }

    #[test]
    fn only_sets_that_differ_in_x_alone_are_joined() {
        let lines = |rows: &[SetRow], name: &str| {
            let (swept, x) = (swept(rows), Asked::of(rows, "x", name).unwrap());
            let sets: Vec<usize> = (0..rows.len()).collect();
            Chart {
                rows,
                swept: &swept,
                x,
                ys: Vec::new(),
                colour: None,
                panels: None,
            }
            .lines(&sets)
        };
        let rows = rows(8);
        assert_eq!(lines(&rows, "V0"), [vec![1, 3, 5, 7], vec![0, 2, 4, 6]]);
        assert!(lines(&rows, "tau_mean").is_empty() && lines(&rows, "Delta").is_empty());
        let mut periods = vec![rows[0].clone(); 3];
        for (row, period) in periods.iter_mut().zip([0.02, 0.01, 0.04]) {
            row.parameters.parameters.modulation_period = Some(period);
            row.frequency = Some(1.0 / period);
        }
        assert_eq!(lines(&periods, "frequency"), [vec![2, 0, 1]]);
    }

    #[test]
    fn sets_of_one_measured_colour_are_not_joined_and_what_nothing_shows_is_said() {
        let strokes = |figure: &OwnFigure| {
            svg(figure)
                .matches(&format!(r#"stroke-width="{LINE_WIDTH}""#))
                .count()
        };
        let measured = OwnFigure {
            colour: Some("tau_mean".into()),
            ..figure()
        };
        assert!(strokes(&figure()) > strokes(&measured));
        let pooled = "not told apart: sets that differ in Δ";
        assert!(svg(&measured).contains(pooled) && !svg(&figure()).contains(pooled));
        assert!(
            !svg(&OwnFigure {
                x: Some("V0*Delta".into()),
                ..measured
            })
            .contains(pooled)
        );
    }

    /// Sets with this spread of thresholds in N, under a modulation of this amplitude in m.
    fn spread(deviation: f64, amplitude: f64) -> SetRow {
        let mut set = set(amplitude, 0.02, 4.0);
        set.parameters.parameters.threshold_deviation = deviation;
        set
    }

    fn overview_of(sets: &[SetRow]) -> String {
        overview(sets, &Look::default()).unwrap().svg()
    }

    #[test]
    fn an_overview_has_the_longest_axis_the_next_as_colours_and_the_third_as_panels() {
        let mut sets: Vec<SetRow> = [0.0, 0.0137, 0.137]
            .iter()
            .flat_map(|&dfs| [spread(dfs, 0.0), spread(dfs, 1e-6)])
            .collect();
        let svg = overview_of(&sets);
        for text in ["(c) Mean friction ⟨Fₛ⟩ (N)", "Δ = 0", "Δ = 1 µm", "0.137"] {
            assert!(svg.contains(&format!(">{text}<")), "{text}");
        }
        assert!(
            svg.contains("Δfₛ (N)<")
                && !svg.contains("Share of time")
                && !svg.contains("by the drive alone")
        );
        let mut larger = sets.clone();
        for set in &mut larger {
            set.parameters.parameters.blocks = 9;
        }
        sets.extend(larger);
        let svg = overview_of(&sets);
        assert!(svg.contains(">N = 9<") && svg.contains(">N = 70<") && svg.contains(">Δ = 1 µm<"));
        for set in &mut sets {
            set.resultant_drive = Some(0.6);
        }
        let with = overview_of(&sets);
        assert!(with.contains(">by the drive alone<"));
        // A mark of few dashes, and curves of many.
        assert!(with.matches("<path").count() - svg.matches("<path").count() > 30);
        assert!(
            overview_of(&sets[..1]).contains("Drive velocity V₀"),
            "a single set"
        );
        assert!(overview(&[], &Look::default()).is_none());
    }

    #[test]
    fn sets_without_modulation_are_levels_over_the_frequency_and_the_first_amplitude() {
        let mut sets: Vec<SetRow> = [0.01, 0.02, 0.04]
            .map(|period| set(1e-6, period, 4.0))
            .to_vec();
        let dashes = |svg: &str| {
            svg.matches(&format!(r#"stroke="{}""#, REFERENCE.ink))
                .count()
        };
        let without = overview_of(&sets);
        sets.push(set(0.0, 1.0, 0.1));
        let with = overview_of(&sets);
        assert!(
            with.contains(">Δ = 0<")
                && !without.contains(">Δ = 0<")
                && dashes(&with) > dashes(&without) + 30
        );
        assert!(with.contains(">Modulation frequency 1/T (Hz)<") && !with.contains("not shown"));
        let amplitudes: Vec<SetRow> = (0..5)
            .map(|step| set(1e-6 * f64::from(step), 0.02, 4.0))
            .collect();
        let svg = overview_of(&amplitudes);
        assert!(svg.contains(">Amplitude Δ (µm)<") && svg.contains("of the peak force"));
    }

    #[test]
    fn sets_that_slide_are_open_circles_and_counted_where_there_is_no_interval() {
        let mut sets: Vec<SetRow> = (1..6)
            .map(|step| spread(0.01 * f64::from(step), 0.0))
            .collect();
        assert!(!overview_of(&sets).contains("slide"));
        for set in &mut sets[3..] {
            (set.regime, set.tau_mean, set.tau_deviation) = (Some(Regime::Sliding), None, None);
        }
        let svg = overview_of(&sets);
        assert!(
            svg.contains("2 of 5 sets slide: no")
                && svg.contains(">sliding<")
                && svg.contains("Share of time")
        );
        assert!(!svg.contains("not shown"));
    }

    #[test]
    fn a_style_does_not_change_the_data() {
        use super::super::style::Style;
        let dots = |style| {
            let look = Look {
                style,
                ..Look::default()
            };
            own(&rows(8), &figure(), &look)
                .unwrap()
                .svg()
                .matches("<circle")
                .count()
        };
        assert_eq!(dots(Style::Screen), dots(Style::Print));
    }
}
