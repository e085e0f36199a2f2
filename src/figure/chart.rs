//! Charts: a dot for each set against a column, with error bars where there are intervals. The overview of a sweep,
//! custom figures and some standing ones are charts.

use super::axis::Axis;
use super::beside::Beside;
use super::frame::{Ends, LEFT, Layout};
use super::hues::{ColourBar, Hues};
use super::legend::{LegendEntry, Mark, entry};
use super::options::BadOption;
use super::panel::{self, Layer, Panel};
use super::picture::Picture;
use super::quantity::{Quantity, belongs_to_all, distinct, shows_angle, without_value};
use super::style::{
    BAR_WIDTH, BLACK, DARK_GREY, Dot, GREY, GRID, INKS, Ink, Look, Place, Polygon, RADIUS,
    REFERENCE, SHAPES, STRIPE, Stroke, WHITE, drive_alone,
};
use crate::model::Symbol;
use crate::model::theory::resultant_at_random;
use crate::observe::Regime;
use crate::reduce::{Values, swept};
use crate::sets::parameter;
use crate::sets::{SetRow, is_same};
use crate::table::columns::{Class, Column};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::LazyLock;

/// Where the paper finds a significant reduction of the friction to begin, as a share of the peak force.
const REDUCTION: Ends = (0.2, 0.3);
const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 400.0;
/// Panels in a row, and in all.
pub(super) const MAX_COLUMNS: usize = 3;
const MAX_PANELS: usize = 9;
const PANEL_WIDTH: f64 = 260.0;
const PANEL_HEIGHT: f64 = 220.0;
const PANEL_GAP: f64 = 26.0;
/// Between columns, for the labels of their axes.
const LABEL_GAP: f64 = 16.0;
const CURVE_POINTS: usize = 200;
/// Whole numbers of periods with a line; those above lie too close.
const WHOLE: std::ops::RangeInclusive<u32> = 1..=10;
/// Lines between sets; more would be a net.
const MAX_LINES: usize = 24;
pub(super) const LINE_WIDTH: f64 = 1.0;
/// Sets up to which dots and bars have their full size.
const FEW_SETS: usize = 200;
const SMALL_RADIUS: f64 = 2.5;
/// Rows from which on even small dots hide each other.
const MANY_ROWS: usize = 5_000;
const MIN_RADIUS: f64 = 1.8;
/// What the drive alone explains of a set that is on no line.
const ALONE: Dot = Dot::solid(GREY, SMALL_RADIUS);
/// By how much the hole in the dot of a set that slides is smaller.
const HOLE: f64 = 1.6;

/// The sets of a chart, if each has a dot, and of which directories they are.
pub(super) struct ChartRows<'a> {
    pub(super) sets: &'a [SetRow],
    /// The only set that was run as a control alone.
    pub(super) control: Option<&'a SetRow>,
    /// The swept parameters of the first directory, which decide which of its sets are joined and share a mark. For
    /// other rows, the columns that split them into series; empty if they are not joined.
    pub(super) swept: &'a [Values],
    pub(super) beside: &'a Beside,
    /// Which of the sets are those of each other directory.
    pub(super) others: Vec<Range<usize>>,
}

impl<'a> ChartRows<'a> {
    /// Rows that are no sets: the columns that split them into series, or none.
    pub(super) fn in_series(series: &'a [Values]) -> Self {
        Self {
            sets: &[],
            control: None,
            swept: series,
            beside: &NOTHING_BESIDE,
            others: Vec::new(),
        }
    }
}

static NOTHING_BESIDE: LazyLock<Beside> = LazyLock::new(Beside::default);

/// Sets against a column: a panel for each quantity and each value of another column.
pub(super) struct Chart<'a> {
    /// What has a dot each, in the plural.
    pub(super) of: &'static str,
    pub(super) rows: ChartRows<'a>,
    pub(super) x: Quantity<'a>,
    pub(super) ys: Vec<Quantity<'a>>,
    pub(super) colour: Option<Quantity<'a>>,
    pub(super) panels: Option<Values>,
}

/// How the sets of a chart are drawn.
struct Marks {
    x_axis: Axis,
    hues: Option<Hues>,
    radius: f64,
    /// Sets that are joined, line by line, and whether each set is one of them.
    lines: Vec<Vec<usize>>,
    is_on_line: Vec<bool>,
    /// Sets without modulation that are levels.
    free: Vec<usize>,
    /// The control on each axis of y, where it lies on it.
    control: Vec<Option<f64>>,
    /// The parameter that shapes show, where colours leave one, and the place of each set among its values.
    shape: Option<Values>,
    places: Vec<Option<usize>>,
}

/// The panels of a chart, quantity by quantity, without a height, and what explains them.
pub(super) struct ChartParts {
    pub(super) panels: Vec<Panel<'static>>,
    pub(super) bar: Option<ColourBar>,
    pub(super) legend: Vec<LegendEntry>,
    note: String,
}

impl ChartParts {
    /// Draws the panels as they are now, with their legend.
    pub(super) fn draw(self, name: &str, look: &Look, layout: Layout) -> Picture {
        panel::draw(name, look, layout, &self.legend, self.panels)
    }
}

impl<'a> Chart<'a> {
    /// Of rows that are no sets, in series: the first column that splits them gives colours, the second shapes.
    pub(super) fn of_series(
        of: &'static str,
        series: &'a [Values],
        x: Quantity<'a>,
        y: Quantity<'a>,
    ) -> Self {
        Self {
            of,
            rows: ChartRows::in_series(series),
            x,
            ys: vec![y],
            colour: series
                .first()
                .map(|colour| Quantity::of_values("colour", colour.clone())),
            panels: None,
        }
    }

    pub(super) fn draw(&self, name: &str, look: &Look) -> Result<Picture, BadOption> {
        let ChartParts {
            mut panels,
            bar,
            legend,
            note,
        } = self.parts()?;
        let (layout, height) = layout(self.ys.len(), panels.len() / self.ys.len());
        for (place, panel) in panels.iter_mut().enumerate() {
            panel.height = height;
            if panel.heading.is_some() && !place.is_multiple_of(layout.columns) {
                panel.y.label.clear();
            }
        }
        panels[layout.columns - 1].bar = bar;
        Ok(panel::draw(
            name,
            &look.with_note(&note),
            layout,
            &legend,
            panels,
        ))
    }

    pub(super) fn parts(&self) -> Result<ChartParts, BadOption> {
        let Self { x, ys, .. } = self;
        let sets: Vec<usize> = (0..self.count())
            .filter(|&set| x.has(set) && ys.iter().any(|y| y.has(set)))
            .collect();
        if sets.is_empty() {
            return Err(self.refuse_empty());
        }
        let free = self.free();
        let x_axis = x.axis(&sets)?;
        let y_axis = |y: &Quantity<'_>| {
            let all = sets.iter().chain(&free).copied();
            y.axis(&all.filter(|&set| y.has(set)).collect::<Vec<_>>())
        };
        let y_axes: Vec<Axis> = ys.iter().map(y_axis).collect::<Result<_, BadOption>>()?;
        let is_on = |axis: &Axis, quantity: &Quantity<'_>, set| {
            let number = quantity.number(set);
            number.is_some_and(|value| axis.contains(value))
        };
        let is_inside = |set: &usize| {
            let mut pairs = ys.iter().zip(&y_axes);
            is_on(&x_axis, x, *set) && pairs.any(|(y, axis)| is_on(axis, y, *set))
        };
        let inside: Vec<usize> = sets.iter().copied().filter(is_inside).collect();
        if inside.is_empty() {
            let problem = format!(
                "none of {} {} lies within --xlim and --ylim; give wider ones",
                sets.len(),
                self.of
            );
            return Err(x.refuse(&problem));
        }
        let cut = |(quantity, axis): (&Quantity<'_>, &Axis)| {
            let bars = inside.iter().filter_map(|&set| quantity.interval(set));
            bars.filter(|(low, high)| *low < axis.low || *high > axis.high)
                .count()
        };
        let axes = ys.iter().zip(&y_axes).chain([(x, &x_axis)]);
        let bars_cut = axes.map(cut).sum();
        let shape = self.shaped();
        let control = self.control();
        let level = |(y, axis): (&Quantity<'_>, &Axis)| {
            let value = y.factor * control?.number(y.name())?;
            Some(value).filter(|value| axis.contains(*value))
        };
        let lines = self.lines(&sets);
        let mut is_on_line = vec![false; self.count()];
        for &set in lines.iter().flatten() {
            is_on_line[set] = true;
        }
        let dots = Marks {
            hues: self.colour.as_ref().map(Quantity::hues).transpose()?,
            radius: radius(inside.len()),
            lines,
            is_on_line,
            x_axis,
            control: ys.iter().zip(&y_axes).map(level).collect(),
            free,
            places: shape.as_ref().map_or_else(Vec::new, Values::places),
            shape,
        };
        let groups = groups(self.panels.as_ref(), &sets)?;
        let mut panels: Vec<Panel<'_>> = Vec::new();
        for ((y, axis), control) in ys.iter().zip(y_axes).zip(&dots.control) {
            for (title, members) in &groups {
                let control = control.map(|level| Layer::Level(level, REFERENCE));
                let layers = control
                    .into_iter()
                    .chain(self.layers(y, &dots, members))
                    .collect();
                let mut panel = Panel::new(0.0, dots.x_axis.clone(), axis.clone(), layers);
                panel.heading = (groups.len() > 1).then(|| title.clone());
                panels.push(panel);
            }
        }
        Ok(ChartParts {
            panels,
            bar: dots.hues.as_ref().and_then(Hues::bar),
            legend: self.legend(&inside, &dots),
            note: self.note(&inside, &dots, bars_cut),
        })
    }

    fn count(&self) -> usize {
        self.x.column.numbers.len()
    }

    fn refuse_empty(&self) -> BadOption {
        let Self { x, ys, .. } = self;
        let is_log_x = x.is_log && x.column.distinct.first().is_none_or(|least| *least <= 0.0);
        let is_log = is_log_x || ys.iter().any(|y| y.is_log);
        let kind = if is_log { "a value > 0" } else { "a value" };
        let names: Vec<&str> = std::iter::once(x).chain(ys).map(Quantity::name).collect();
        let problem = format!(
            "none of the {} has {kind} of both {}; nothing can be drawn",
            self.of,
            names.join(" and ")
        );
        ys.first().unwrap_or(x).refuse(&problem)
    }

    /// Sets without modulation, where the axis is that of the modulation: they have no place on it, but a level.
    fn free(&self) -> Vec<usize> {
        let is_free = |&set: &usize| {
            self.x.symbol == Some(Symbol::T)
                && self.rows.sets[set].parameters.modulation_period.is_none()
                && !self.x.has(set)
                && self.ys.iter().any(|y| y.has(set))
        };
        let own = (0..self.rows.sets.len()).filter(|set| self.other(*set).is_none());
        let free: Vec<usize> = own.filter(is_free).collect();
        if free.len() > INKS.len() {
            Vec::new()
        } else {
            free
        }
    }

    /// The control, if it is that of all sets.
    fn control(&self) -> Option<&'a SetRow> {
        let is_of = |set: &SetRow, control: &SetRow| {
            set.parameters.without_modulation() == *control.parameters
        };
        let is_of_all = |control: &&SetRow| self.rows.sets.iter().all(|set| is_of(set, control));
        self.rows.control.filter(is_of_all)
    }

    /// Sets that differ in the x axis alone, in its order; or the rows of each series.
    fn lines(&self, sets: &[usize]) -> Vec<Vec<usize>> {
        let Self { x, rows, .. } = self;
        let is_series = rows.sets.is_empty() && !rows.swept.is_empty();
        let along = x.joined_along(rows.swept);
        // What is measured makes no line: neighbours of one colour, or at one value of y, have nothing else in common.
        let mut colour = self.colour.iter();
        let is_measured = colour.any(|colour| colour.symbol.is_none())
            || self.ys.iter().any(|y| y.symbol.is_some());
        if !is_series && (is_measured || along.is_none()) {
            return Vec::new();
        }
        let is_other = |swept: &&Values| along.is_none() || parameter(&swept.column) != along;
        let others = rows.swept.iter().filter(is_other);
        let of_others: Vec<_> = others.map(Values::places).collect();
        let mut lines: BTreeMap<Vec<Option<usize>>, Vec<usize>> = BTreeMap::new();
        for &set in sets.iter().filter(|set| self.other(**set).is_none()) {
            let key = of_others.iter().map(|places| places[set]).collect();
            lines.entry(key).or_default().push(set);
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

    /// The swept parameter that nothing else shows, if it has few values. The marks of other directories are shapes, too.
    fn shaped(&self) -> Option<Values> {
        let free = self.unshown().into_iter().next()?;
        let is_free = self.rows.others.is_empty() && free.distinct.len() <= SHAPES.len();
        is_free.then_some(free)
    }

    /// The shape of the dot of a set: of a parameter that colours do not show, else of its colour.
    fn shape(&self, dots: &Marks, set: usize) -> Option<Polygon> {
        if dots.shape.is_some() {
            return dots.places[set].and_then(|place| SHAPES[place]);
        }
        self.shape_of_colour(dots, self.colour.as_ref()?.number(set))
    }

    /// That of a colour, unless shapes show something else.
    fn shape_of_colour(&self, dots: &Marks, value: Option<f64>) -> Option<Polygon> {
        let is_free = dots.shape.is_none() && self.rows.others.is_empty();
        dots.hues.as_ref()?.shape(value).filter(|_| is_free)
    }

    fn ink(&self, dots: &Marks, set: usize) -> Ink {
        let Some((colour, hues)) = self.colour.as_ref().zip(dots.hues.as_ref()) else {
            // As in the legend.
            return self.other(set).map_or(INKS[0], |_| BLACK);
        };
        colour.number(set).map_or(GREY, |value| hues.ink(value))
    }

    /// Sets as dots, joined, with their intervals along both axes, over those without modulation and the drive's part.
    fn layers(&self, y: &Quantity<'_>, dots: &Marks, members: &[usize]) -> Vec<Layer<'static>> {
        let level = |set: &usize| {
            let hues = dots.hues.as_ref();
            let ink = hues.map_or(GREY, |_| self.ink(dots, *set));
            Some(Layer::Level(y.number(*set)?, Stroke { ink, ..REFERENCE }))
        };
        let mut layers: Vec<Layer<'static>> = Vec::new();
        layers.extend(self.reduction(y).map(|ends| Layer::Stripe(ends, STRIPE)));
        if y.column.column.class == Class::Excess {
            layers.push(Layer::Level(0.0, GRID));
        }
        if is_in_periods(y) {
            layers.extend(WHOLE.map(|n| Layer::Level(f64::from(n), GRID)));
        }
        if y.name() == "slip_share" {
            layers.extend(Regime::MIN_SHARES.map(|share| Layer::Level(share, REFERENCE)));
        }
        if self.is_against_eta(y) {
            let places = dots.x_axis.evenly_placed(CURVE_POINTS).into_iter();
            let curve = places.map(|eta| (eta, resultant_at_random(eta)));
            layers.push(Layer::Curve(curve.collect(), REFERENCE));
        }
        layers.extend(dots.free.iter().filter_map(level));
        for line in &dots.lines {
            let mut of_members = line.clone();
            of_members.retain(|set| members.contains(set));
            self.add_line(&mut layers, y, dots, &of_members);
        }
        let dotted = members.iter().filter(|set| Self::is_dotted(dots, **set));
        let alone = dotted.filter_map(|&set| self.drive_at(y, set));
        layers.push(Layer::Dots(alone.collect(), ALONE));
        for &set in members {
            self.add_bars(&mut layers, y, dots, set);
        }
        let mut all = vec![Layer::Inside(layers)];
        for &set in members {
            let place: Vec<Place> = self.place(y, set).into_iter().collect();
            if let Some(other) = self.other(set) {
                all.push(Layer::Hollow(place, other, self.ink(dots, set)));
                continue;
            }
            let shape = self.shape(dots, set);
            let dot = Dot::solid(self.ink(dots, set), dots.radius).with_shape(shape);
            all.push(Layer::Dots(place.clone(), dot.with_opacity(0.9)));
            if self.slides(set) {
                let hole = Dot::solid(WHITE, dots.radius - HOLE).with_shape(shape);
                all.push(Layer::Dots(place, hole));
            }
        }
        all
    }

    /// The number of the other directory that a set is of.
    fn other(&self, set: usize) -> Option<usize> {
        let mut others = self.rows.others.iter();
        others.position(|sets| sets.contains(&set))
    }

    fn place(&self, y: &Quantity<'_>, set: usize) -> Option<Place> {
        self.x.number(set).zip(y.number(set))
    }

    /// Whether what the drive alone explains of a set is a dot, and not on a line.
    fn is_dotted(dots: &Marks, set: usize) -> bool {
        !dots.is_on_line[set]
    }

    /// The place of what the drive alone explains.
    fn drive_at(&self, y: &Quantity<'_>, set: usize) -> Option<Place> {
        self.x.number(set).zip(y.drive.as_ref()?.numbers[set])
    }

    /// Joins sets, those of one colour, and what the drive alone explains of them.
    fn add_line(
        &self,
        layers: &mut Vec<Layer<'static>>,
        y: &Quantity<'_>,
        dots: &Marks,
        line: &[usize],
    ) {
        let Some(first) = line.first() else {
            return;
        };
        let alone = line.iter().filter_map(|&set| self.drive_at(y, set));
        let alone: Vec<Place> = alone.collect();
        layers.push(match alone.len() {
            1 => Layer::Dots(alone, ALONE),
            _ => Layer::Curve(alone, drive_alone(self.ink(dots, *first))),
        });
        let known: Vec<usize> = line.iter().copied().filter(|&set| y.has(set)).collect();
        for pair in known.windows(2) {
            let ink = self.ink(dots, pair[0]);
            if ink == self.ink(dots, pair[1]) {
                let ends = pair.iter().filter_map(|&set| self.place(y, set));
                layers.push(Layer::Curve(ends.collect(), Stroke::solid(ink, LINE_WIDTH)));
            }
        }
    }

    /// The intervals of a set along both axes.
    fn add_bars(
        &self,
        layers: &mut Vec<Layer<'static>>,
        y: &Quantity<'_>,
        dots: &Marks,
        set: usize,
    ) {
        let Some((at_x, at_y)) = self.place(y, set) else {
            return;
        };
        let is_small = dots.radius < RADIUS;
        let width = if is_small { LINE_WIDTH } else { BAR_WIDTH };
        let stroke = Stroke::solid(self.ink(dots, set), width);
        if let Some(ends) = y.interval(set) {
            layers.push(Layer::Bars(vec![(at_x, ends)], stroke));
        }
        if let Some((low, high)) = self.x.interval(set) {
            let is_finite = dots.x_axis.place(low).is_finite();
            let left = if is_finite { low } else { dots.x_axis.low };
            layers.push(Layer::Curve(vec![(left, at_y), (high, at_y)], stroke));
        }
    }

    fn slides(&self, set: usize) -> bool {
        let set = self.rows.sets.get(set);
        set.is_some_and(|set| set.regime == Some(Regime::Sliding))
    }

    /// Whether the resultant at random loads is a curve, as it depends on η alone.
    fn is_against_eta(&self, y: &Quantity<'_>) -> bool {
        y.name() == "resultant_length" && self.x.name() == "eta"
    }

    /// Amplitudes at which the paper finds a significant reduction of the friction to begin, on the x axis.
    fn reduction(&self, y: &Quantity<'_>) -> Option<Ends> {
        let is_fixed = |symbol| {
            let mut swept = self.rows.swept.iter();
            swept.all(|swept| parameter(&swept.column) != Some(symbol))
        };
        let is_of_both = y.name() == "mean_friction" && self.x.symbol == Some(Symbol::Delta);
        let mut sets = self.rows.sets.iter();
        let own = sets.find(|row| row.parameters.modulation_period.is_none());
        let control = own.or_else(|| self.control());
        let free =
            control.filter(|_| is_of_both && is_fixed(Symbol::Kd) && is_fixed(Symbol::V0))?;
        let unit = self.x.factor * free.peak_force_mean? / free.parameters.drive_stiffness;
        Some((REDUCTION.0 * unit, REDUCTION.1 * unit))
    }
}

/// What the marks mean: the legend and the small print.
impl Chart<'_> {
    /// The meaning of each mark that is drawn.
    fn legend(&self, inside: &[usize], dots: &Marks) -> Vec<LegendEntry> {
        let mut entries = Vec::new();
        if let Some((colour, hues)) = self.colour.as_ref().zip(dots.hues.as_ref()) {
            let shown = [inside, &dots.free].concat();
            let numbers: Vec<Option<f64>> = shown.iter().map(|&set| colour.number(set)).collect();
            let dot = |value| {
                let shape = self.shape_of_colour(dots, Some(value));
                Dot::solid(hues.ink(value), RADIUS).with_shape(shape)
            };
            entries.extend(hues.entries(dot, |value| numbers.contains(&Some(value))));
            if inside.iter().any(|&set| colour.number(set).is_none()) {
                let shape = self.shape_of_colour(dots, None);
                let dot = Dot::solid(GREY, RADIUS).with_shape(shape);
                entries.push(entry(Mark::Dot(dot), colour.without.as_str()));
            }
        }
        if let Some(shaped) = &dots.shape {
            for (&value, shape) in shaped.distinct.iter().zip(SHAPES) {
                let dot = Dot::solid(DARK_GREY, RADIUS).with_shape(shape);
                entries.push(entry(Mark::Dot(dot), shaped.setting(value)));
            }
        }
        let has_marks = |other| inside.iter().any(|&set| self.other(set) == other);
        let ink = dots.hues.as_ref().map_or(INKS[0], |_| DARK_GREY);
        let dot = has_marks(None).then_some(Mark::Dot(Dot::solid(ink, RADIUS)));
        let own = dot.or((!dots.free.is_empty()).then_some(Mark::Line(REFERENCE)));
        let beside = self.rows.beside;
        entries.extend(beside.entries(own, |other| has_marks(Some(other))));
        if !dots.free.is_empty() || dots.control.iter().any(Option::is_some) {
            entries.push(entry(Mark::Line(REFERENCE), "Δ = 0"));
        }
        if inside.iter().any(|&set| self.slides(set)) {
            let mark = Mark::Ring(BLACK, WHITE, RADIUS, RADIUS - HOLE);
            entries.push(entry(mark, "sliding"));
        }
        if self.ys.iter().any(|y| y.name() == "slip_share") {
            let [mixed, sliding] = Regime::MIN_SHARES;
            let text = format!("mixed above {mixed}, sliding above {sliding}");
            entries.push(entry(Mark::Line(REFERENCE), text));
        }
        if self.ys.iter().any(|y| self.is_against_eta(y)) {
            entries.push(entry(Mark::Line(REFERENCE), "at random loads"));
        }
        if self.ys.iter().any(is_in_periods) {
            entries.push(entry(Mark::Line(GRID), "τ = nT"));
        }
        let has_drive = |set: &&usize| self.ys.iter().any(|y| self.drive_at(y, **set).is_some());
        let explained = inside.iter().filter(&has_drive);
        let (dotted, joined): (Vec<usize>, Vec<usize>) =
            explained.partition(|set| Self::is_dotted(dots, **set));
        let mut lines = dots.lines.iter();
        let has_curve = lines.any(|line| line.iter().filter(&has_drive).count() > 1);
        if !joined.is_empty() {
            let mark = if has_curve {
                Mark::Line(drive_alone(BLACK))
            } else {
                Mark::Dot(ALONE)
            };
            entries.push(entry(mark, "by the drive alone"));
        }
        if !dotted.is_empty() {
            let is_of_others = dotted.iter().all(|&set| self.other(set).is_some());
            let of = if is_of_others && !joined.is_empty() {
                ", for hollow marks"
            } else {
                ""
            };
            entries.push(entry(Mark::Dot(ALONE), format!("by the drive alone{of}")));
        }
        if self.ys.iter().any(|y| self.reduction(y).is_some()) {
            let text = "K_d Δ = 0.2 to 0.3 of the peak force: friction falls (Capozza et al.)";
            entries.push(entry(Mark::Patch(STRIPE), text));
        }
        entries
    }

    /// Swept parameters that neither axes, colours nor panels show.
    fn unshown(&self) -> Vec<Values> {
        let quantities = self.ys.iter().chain([&self.x]).chain(&self.colour);
        let asked = quantities.map(|quantity| &quantity.column);
        let all_asked: Vec<&Values> = asked.chain(&self.panels).collect();
        let is_shown = |swept: &Values| all_asked.iter().any(|values| values.shows(&swept.column));
        let ranges = self.rows.others.iter();
        let others = ranges.flat_map(|sets| swept(&self.rows.sets[sets.clone()]));
        let all = self.rows.swept.iter().cloned().chain(others);
        all.filter(|swept| !is_shown(swept)).collect()
    }

    /// Those that shapes do not show, either, of which there are marks with several values.
    fn pooled(&self, inside: &[usize], dots: &Marks) -> Option<String> {
        let shaped = usize::from(dots.shape.is_some());
        let marked = inside
            .iter()
            .chain(&dots.free)
            .map(|&set| &self.rows.sets[set]);
        let is_several = |swept: &Values| {
            let values = |symbol| marked.clone().map(move |set| set.parameters.get(symbol));
            parameter(&swept.column).is_none_or(|symbol| !is_single(values(symbol)))
        };
        let pooled = self.unshown().into_iter().skip(shaped).filter(is_several);
        let symbols: Vec<String> = pooled.map(|swept| swept.label.symbol).collect();
        let symbols = distinct(symbols.iter().map(String::as_str));
        (!symbols.is_empty()).then(|| format!("pooled: sets that differ in {}", symbols.join(", ")))
    }

    /// What bars are, and what is not there.
    fn note(&self, inside: &[usize], dots: &Marks, bars_cut: usize) -> String {
        let mut notes = Vec::new();
        let has_bars = |y: &Quantity<'_>| inside.iter().any(|&set| y.interval(set).is_some());
        if self.ys.iter().any(has_bars) {
            notes.push("bars: 95 %".to_owned());
        }
        if bars_cut > 0 {
            notes.push(format!("bars cut at the frame: {bars_cut}"));
        }
        let count = self.count();
        let is_still = |set: &usize| {
            let has_no_interval = self.slides(*set) && self.rows.sets[*set].tau_mean.is_none();
            has_no_interval && self.ys.iter().any(|y| !y.has(*set))
        };
        let still = (0..count).filter(is_still).count();
        if still > 0 {
            notes.push(format!("{still} of {count} sets slide: no intervals"));
        }
        let mut quantities = self.ys.iter().chain([&self.x]);
        let shows_phase = quantities.any(|shown| shows_angle(&shown.column));
        let has_none = |row: &SetRow| !row.has_phase && row.phase_mean.is_some();
        let is_unphased =
            |set: &usize| shows_phase && self.rows.sets.get(*set).is_some_and(has_none);
        let unphased = (0..count).filter(is_unphased).count();
        if unphased > 0 {
            let text = format!("not shown: {unphased} of {count} sets, without a preferred phase");
            notes.push(text);
        }
        let is_left_out = |set: &usize| {
            let is_shown = inside.contains(set) || dots.free.contains(set);
            !(is_shown || is_still(set) || is_unphased(set))
        };
        let left_out = (0..count).filter(is_left_out).count();
        if left_out > 0 {
            notes.push(format!(
                "not shown: {left_out} of {count} {}, without a value or outside the axes",
                self.of
            ));
        }
        notes.extend(self.pooled(inside, dots));
        notes.join("; ")
    }
}

/// The radius of the dots of this many rows.
const fn radius(rows: usize) -> f64 {
    if rows <= FEW_SETS {
        RADIUS
    } else if rows < MANY_ROWS {
        SMALL_RADIUS
    } else {
        MIN_RADIUS
    }
}

/// Whether there is one value at most.
fn is_single<V: PartialEq>(mut values: impl Iterator<Item = V>) -> bool {
    let first = values.next();
    values.all(|value| Some(&value) == first.as_ref())
}

/// Whether it is an interval in periods: a pure number of nothing but a statistic in s and the period.
fn is_in_periods(y: &Quantity<'_>) -> bool {
    let [one, other] = &y.column.sources[..] else {
        return false;
    };
    let is_interval = |column: &Column| column.unit == "s" && parameter(column).is_none();
    let is_period = |column: &Column| parameter(column) == Some(Symbol::T);
    let is_pair = |one, other| is_interval(one) && is_period(other);
    y.column.label.unit.is_empty() && (is_pair(one, other) || is_pair(other, one))
}

/// Columns and widths of panels, and their height.
fn layout(quantities: usize, groups: usize) -> (Layout, f64) {
    let (columns, [width, height]) = match (quantities, groups) {
        (1, 1) => (1, [WIDTH, HEIGHT]),
        (1, 4) => (2, [PANEL_WIDTH, PANEL_HEIGHT]),
        (1, count) => (count.min(MAX_COLUMNS), [PANEL_WIDTH, PANEL_HEIGHT]),
        // Quantities one under the other, or two and two.
        (2 | 3, 1) => (1, [WIDTH, 0.5 * HEIGHT]),
        (_, 1) => (2, [1.25 * PANEL_WIDTH, PANEL_HEIGHT]),
        (_, count) => (count, [PANEL_WIDTH, 0.8 * PANEL_HEIGHT]),
    };
    let mut layout = Layout {
        columns,
        column_gap: LEFT + LABEL_GAP,
        ..Layout::column(width)
    };
    if quantities == 1 {
        layout.row_gap = PANEL_GAP;
    }
    (layout, height)
}

/// The sets of each panel and its title.
fn groups(panels: Option<&Values>, sets: &[usize]) -> Result<Vec<(String, Vec<usize>)>, BadOption> {
    let Some(values) = panels else {
        return Ok(vec![(String::new(), sets.to_vec())]);
    };
    let of = |&value: &f64| {
        let is_of = |set: &usize| values.numbers[*set].is_some_and(|number| is_same(value, number));
        let members: Vec<usize> = sets.iter().copied().filter(is_of).collect();
        (values.setting(value), members)
    };
    let mut groups: Vec<_> = values.distinct.iter().map(of).collect();
    groups.retain(|(_, sets)| !sets.is_empty());
    let mut without = sets.to_vec();
    without.retain(|&set| values.numbers[set].is_none());
    if belongs_to_all(values) {
        for (_, members) in &mut groups {
            members.extend(&without);
        }
    } else if !groups.is_empty() && !without.is_empty() {
        groups.insert(0, (without_value(values), without));
    }
    let problem = match groups.len() {
        0 => "no set has a value of it".to_owned(),
        1..=MAX_PANELS => return Ok(groups),
        count => {
            format!("has {count} values, and {MAX_PANELS} panels fit a page; show it with --colour")
        }
    };
    Err(BadOption::new("panels", &values.column.name, &problem))
}

#[cfg(test)]
mod tests {
    use super::super::custom::tests::rows;
    use super::*;

    #[test]
    fn only_sets_that_differ_in_x_alone_are_joined() {
        let lines = |rows: &[SetRow], name: &str| {
            let swept = swept(rows);
            let x = Quantity::of(rows, "x", name).unwrap();
            let sets: Vec<usize> = (0..rows.len()).collect();
            Chart {
                of: "sets",
                rows: ChartRows {
                    sets: rows,
                    control: None,
                    swept: &swept,
                    beside: &Beside::default(),
                    others: Vec::new(),
                },
                x,
                ys: Vec::new(),
                colour: None,
                panels: None,
            }
            .lines(&sets)
        };
        let rows = rows(8);
        assert_eq!(lines(&rows, "V0"), [vec![1, 3, 5, 7], vec![0, 2, 4, 6]]);
        assert_eq!(lines(&rows, "V0*V0"), lines(&rows, "V0"));
        assert!(lines(&rows, "V0*tau_mean").is_empty());
        assert!(lines(&rows, "tau_mean").is_empty() && lines(&rows, "Delta").is_empty());
        let mut periods = vec![rows[0].clone(); 3];
        for (row, period) in periods.iter_mut().zip([0.02, 0.01, 0.04]) {
            row.parameters.all.modulation_period = Some(period);
            row.frequency = Some(1.0 / period);
        }
        assert_eq!(lines(&periods, "frequency"), [vec![2, 0, 1]]);
    }
}
