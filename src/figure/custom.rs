//! Custom figures: any column of the table of sets, or of slips, or a formula of columns, against any other.

use super::beside::Beside;
use super::chart::{Chart, ChartRows};
use super::files::ADVICE;
use super::note::common;
use super::options::{BadOption, check_text};
use super::picture::Picture;
use super::quantity::{AxisLimits, Quantity};
use super::style::Look;
use crate::model::Symbol;
use crate::reduce::{
    Condition, SlipOfSet, Values, advise, means_of_slips, read_control, read_sets, sample_of_slips,
    swept,
};
use crate::results::Results;
use crate::results::tables::gaps;
use crate::sets::{SetRow, parameter};
use crate::table::columns::Row;
use crate::table::value::words;
use anyhow::Result;

words! {
    /// What has a dot each in a custom figure.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Dots {
        #[default]
        Sets = "sets",
        Slips = "slips",
    }
}

/// What a custom figure shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CustomFigure {
    pub of: Dots,
    /// Column, or formula of columns such as `Kd*Delta`, on the x axis.
    pub x: String,
    /// Column on the y axis, with error bars if it has an interval; or a formula, without.
    pub y: String,
    /// Column that colours show; else the next parameter that was swept.
    pub colour: Option<String>,
    /// Column whose values get a panel each.
    pub panels: Option<String>,
    /// Condition on the columns of what is drawn.
    pub condition: Option<String>,
    /// The letters of the logarithmic axes; else those that were swept so, or whose values lie decades apart.
    pub log: Option<String>,
    pub xlim: AxisLimits,
    pub ylim: AxisLimits,
    pub xlabel: Option<String>,
    pub ylabel: Option<String>,
}

impl CustomFigure {
    /// The condition on rows of which it shows columns.
    pub(super) fn condition<R: Row>(&self) -> Result<Option<Condition>, BadOption> {
        let text = self.condition.as_deref();
        let condition = text.map(|text| Condition::read(text, &R::columns()));
        condition
            .transpose()
            .map_err(|problem| self.refuse(&problem))
    }

    /// That none of these rows fulfils its condition.
    pub(super) fn unmatched<R: Row>(&self, condition: &Condition, rows: &[R]) -> BadOption {
        self.refuse(&condition.unmatched(self.of.word(), rows))
    }

    fn refuse(&self, problem: &str) -> BadOption {
        let text = self.condition.as_deref().unwrap_or_default();
        BadOption::new("where", text, problem)
    }

    /// The condition, as the small print ends.
    pub(super) fn shown_condition(&self) -> String {
        let shown = |text| format!("; where {text}");
        self.condition.as_ref().map_or_else(String::new, shown)
    }
}

/// Draws a dot for each row of which there are these quantities, with the next of the swept parameters as colours. If the
/// rows are `sets`, those that differ in one parameter of the x axis alone are joined; if they are slips, there are none.
fn custom<'a>(
    quantity: &dyn Fn(&'static str, &str) -> Result<Quantity<'a>>,
    rows: ChartRows<'a>,
    figure: &'a CustomFigure,
    look: &Look,
) -> Result<Picture> {
    let label = |option, text: &'a Option<String>| {
        let label = text.as_deref();
        label.map_or(Ok(()), |text| check_text(option, text))?;
        Ok::<_, BadOption>(label)
    };
    let mut x = quantity("x", &figure.x)?;
    x.limits = figure.xlim;
    x.label = label("xlabel", &figure.xlabel)?;
    let mut y = quantity("y", &figure.y)?;
    y.limits = figure.ylim;
    y.label = label("ylabel", &figure.ylabel)?;
    if let Some(axes) = &figure.log {
        x.is_log = axes.contains('x');
        y.is_log = axes.contains('y');
    }
    let named = |option, name: &Option<String>| {
        name.as_ref().map(|name| quantity(option, name)).transpose()
    };
    let panels = named("panels", &figure.panels)?;
    let swept = rows.swept;
    let mut shown: Vec<Symbol> = x.joined_along(swept).into_iter().collect();
    shown.extend(panels.iter().flat_map(Quantity::parameters));
    let is_free =
        |swept: &&Values| parameter(&swept.column).is_some_and(|symbol| !shown.contains(&symbol));
    let next = || Some(swept.iter().find(is_free)?.name().to_owned());
    // Formulas have letters that no file name should have.
    let is_plain = |letter: char| letter.is_alphanumeric() || letter == '_';
    let name = format!("{}-{}", y.name(), x.name()).replace(|letter| !is_plain(letter), "-");
    let chart = Chart {
        of: figure.of.word(),
        rows: ChartRows {
            swept: if rows.sets.is_empty() { &[] } else { swept },
            ..rows
        },
        colour: named("colour", &figure.colour.clone().or_else(next))?,
        panels: panels.map(|panels| panels.column.of_modulated()),
        x,
        ys: vec![y],
    };
    Ok(chart.draw(&name, look)?)
}

/// Draws a custom figure of the sets or slips of a results directory; writes nothing.
pub fn draw_custom(
    results: &Results<'_>,
    beside: &Beside,
    figure: &CustomFigure,
    look: &Look,
) -> Result<Picture> {
    let sets = read_sets(results.layout())
        .collect::<Result<Vec<_>, _>>()
        .map_err(advise(ADVICE))?;
    match figure.of {
        Dots::Sets => draw_sets(results, sets, beside, figure, look),
        Dots::Slips => draw_slips(results, &sets, figure, look),
    }
}

fn draw_sets(
    results: &Results<'_>,
    mut own: Vec<SetRow>,
    beside: &Beside,
    figure: &CustomFigure,
    look: &Look,
) -> Result<Picture> {
    let mut beside = beside.clone();
    if let Some(condition) = figure.condition::<SetRow>()? {
        if !own.iter().any(|set| condition.holds(set)) {
            return Err(figure.unmatched(&condition, &own).into());
        }
        beside.retain(&condition);
        own.retain(|set| condition.holds(set));
    }
    let mut look = beside.look(look, &own);
    look.note += &figure.shown_condition();
    let swept = swept(&own);
    let control = read_control(results.layout()).map_err(advise(ADVICE))?;
    let (sets, others) = beside.with_others(own);
    let quantity = |option, name: &str| {
        Quantity::of(&sets, option, name).or_else(|unknown| {
            let mean = means_of_slips(results, &sets, name)?.ok_or(unknown)?;
            Ok(Quantity::of_values(option, mean))
        })
    };
    let rows = ChartRows {
        sets: &sets,
        control: control.as_ref(),
        swept: &swept,
        beside: &beside,
        others,
    };
    custom(&quantity, rows, figure, &look)
}

fn draw_slips(
    results: &Results<'_>,
    sets: &[SetRow],
    figure: &CustomFigure,
    look: &Look,
) -> Result<Picture> {
    let condition = figure.condition::<SlipOfSet>()?;
    let sample = sample_of_slips(results, sets, condition.as_ref())?;
    let slips = &sample.kept;
    if let Some(condition) = condition.filter(|_| slips.is_empty()) {
        let all = sample_of_slips(results, sets, None)?.kept;
        return Err(figure.unmatched(&condition, &all).into());
    }
    let part = if sample.every > 1 {
        format!("one in {} of ", sample.every)
    } else {
        String::new()
    };
    let shared = common(slips.iter().map(|slip| &*slip.0.1), &[]);
    let condition = figure.shown_condition();
    let matching = sample.count;
    let noted = look.with_note(&format!("{shared}{condition}; {part}{matching} slips"));
    let unknown = gaps(results.sweep()).unknown;
    let quantity = |option, name: &str| {
        let quantity = Quantity::of(slips, option, name)?;
        let mut sources = quantity.column.sources.iter();
        match sources.find(|source| unknown.contains(&source.name)) {
            Some(source) => Err(BadOption::new(option, &source.name, "was not measured").into()),
            None => Ok(quantity),
        }
    };
    let swept = swept(sets);
    let rows = ChartRows::in_series(&swept);
    custom(&quantity, rows, figure, &noted)
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::chart::LINE_WIDTH;
    use super::super::quantity::tests::set;
    use super::super::style::{BAR_WIDTH, Style};
    use super::*;
    use crate::model::Parameters;
    use crate::model::Selected;
    use crate::table::columns::Interval;

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

    fn figure() -> CustomFigure {
        CustomFigure {
            x: "V0".into(),
            y: "tau_mean".into(),
            ..CustomFigure::default()
        }
    }

    fn drawn_of(rows: &[SetRow], figure: &CustomFigure, look: &Look) -> Result<Picture> {
        let quantity = |option, name: &str| Ok(Quantity::of(rows, option, name)?);
        let rows = ChartRows {
            sets: rows,
            control: None,
            swept: &swept(rows),
            beside: &Beside::default(),
            others: Vec::new(),
        };
        custom(&quantity, rows, figure, look)
    }

    fn drawn(count: u32, figure: &CustomFigure, look: &Look) -> Result<Picture> {
        drawn_of(&rows(count), figure, look)
    }

    fn svg(figure: &CustomFigure) -> String {
        drawn(8, figure, &Look::default()).unwrap().svg()
    }

    fn problem(figure: &CustomFigure) -> String {
        drawn(8, figure, &Look::default())
            .err()
            .unwrap()
            .to_string()
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
        let no_interval = CustomFigure {
            y: "eta".into(),
            ..figure()
        };
        assert_eq!((bars(&plain), bars(&svg(&no_interval))), (8, 0));
        let linear = svg(&CustomFigure {
            log: Some("none".into()),
            ..figure()
        });
        assert!(linear.contains(">Drive velocity V₀ (10⁻⁶ m/s)<") && !linear.contains(">10⁻⁵<"));
        let scale = svg(&CustomFigure {
            colour: Some("V0".into()),
            ..figure()
        });
        assert!(scale.contains(">V₀ (m/s)<") && !scale.contains("V₀ = "));
        let shapes = |svg: &str| svg.matches("<path").count();
        assert!(
            scale.contains("Δ = ") && shapes(&scale) > 4,
            "shapes show Δ"
        );
        let panels = svg(&CustomFigure {
            panels: Some("Delta".into()),
            ..figure()
        });
        assert!(panels.contains(">(a)<") && panels.contains(">(b)<") && panels.contains(">Δ = 0<"));
        let limits = svg(&CustomFigure {
            xlim: (Some(1e-6), Some(1e-5)),
            ..figure()
        });
        assert!(
            limits.contains("not shown: 4 of 8 sets, without a value or outside the axes"),
            "{limits}"
        );
        // The lower end of the bar at 1.25 s is 1.125 s.
        let cut = svg(&CustomFigure {
            ylim: (Some(1.2), None),
            ..figure()
        });
        let sign = "bars cut at the frame: ";
        assert!(cut.contains(&format!("{sign}1")) && !plain.contains(sign));
        let label = svg(&CustomFigure {
            ylabel: Some("τ".into()),
            ..figure()
        });
        assert!(label.contains(">τ<") && !label.contains("Mean interval"));
        let without = svg(&CustomFigure {
            colour: Some("T".into()),
            ..figure()
        });
        assert!(without.contains(">T = 20 ms<") && without.contains(">Δ = 0<"));
        let words = svg(&CustomFigure {
            x: "break_on".into(),
            ..figure()
        });
        assert!(words.contains(">magnitude<"));
    }

    #[test]
    fn mistakes_are_refused_with_what_to_do() {
        for (figure, expected) in [
            (
                CustomFigure {
                    x: "v0".into(),
                    ..figure()
                },
                "--x v0: no such column; did you mean V0?",
            ),
            (
                CustomFigure {
                    colour: Some("colour".into()),
                    ..figure()
                },
                "--colour colour: no such column; `stickslip plot --list`",
            ),
            (
                CustomFigure {
                    x: "break_on".into(),
                    log: Some("x".into()),
                    ..figure()
                },
                "--log x: break_on holds words",
            ),
            (
                CustomFigure {
                    x: "break_on".into(),
                    xlim: (Some(1.0), None),
                    ..figure()
                },
                "--xlim 1:: break_on holds words",
            ),
            (
                CustomFigure {
                    y: "drop_mean".into(),
                    ..figure()
                },
                "none of the sets has a value of both V0 and drop_mean",
            ),
            (
                CustomFigure {
                    y: "eta".into(),
                    x: "T_to".into(),
                    log: Some("y".into()),
                    ..figure()
                },
                "none of the sets has a value > 0",
            ),
            (
                CustomFigure {
                    xlim: (Some(2.0), Some(1.0)),
                    ..figure()
                },
                "--xlim 2:1: the lower end must be less",
            ),
            (
                CustomFigure {
                    xlim: (Some(-1.0), None),
                    log: Some("x".into()),
                    ..figure()
                },
                "--xlim -1:: must be > 0",
            ),
            (
                CustomFigure {
                    xlim: (Some(1.0), Some(2.0)),
                    ..figure()
                },
                "none of 8 sets lies within",
            ),
            (
                CustomFigure {
                    panels: Some("regime".into()),
                    ..figure()
                },
                "--panels regime: no set has a value of it",
            ),
        ] {
            let found = problem(&figure);
            assert!(found.contains(expected), "{found}");
        }
        let many = CustomFigure {
            panels: Some("V0".into()),
            ..figure()
        };
        let error = drawn(12, &many, &Look::default())
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
    fn the_control_of_all_sets_is_a_level_where_it_lies_on_the_axis() {
        let mut rows = rows(8);
        for row in &mut rows {
            row.parameters.all.drive_velocity = 1e-5;
        }
        let levels = |rows: &[SetRow], tau: f64| {
            let control = SetRow {
                tau_mean: Some(tau),
                ..rows[1].clone()
            };
            let quantity = |option, name: &str| Ok(Quantity::of(rows, option, name)?);
            let chart = ChartRows {
                sets: rows,
                control: Some(&control),
                swept: &swept(rows),
                beside: &Beside::default(),
                others: Vec::new(),
            };
            let picture = custom(&quantity, chart, &figure(), &Look::default());
            picture.unwrap().svg().matches(">Δ = 0<").count()
        };
        // Colours name sets of Δ = 0, too.
        assert_eq!([levels(&rows, 1.0), levels(&rows, 1e6)], [2, 1]);
        rows[0].parameters.all.drive_velocity = 2e-5;
        assert_eq!(levels(&rows, 1.0), 1, "another set has another control");
    }

    #[test]
    fn sets_of_one_measured_colour_are_not_joined_and_what_nothing_shows_is_said() {
        let strokes = |figure: &CustomFigure| {
            svg(figure)
                .matches(&format!(r#"stroke-width="{LINE_WIDTH}""#))
                .count()
        };
        let measured = CustomFigure {
            colour: Some("tau_mean".into()),
            ..figure()
        };
        assert!(strokes(&figure()) > strokes(&measured));
        let pooled = "pooled: sets that differ in V₀";
        let over = |x: &str| {
            let figure = CustomFigure {
                x: x.into(),
                ..measured.clone()
            };
            drawn(12, &figure, &Look::default()).unwrap().svg()
        };
        assert!(over("Delta").contains(pooled), "more values than shapes");
        assert!(!over("V0").contains(pooled) && !over("V0*Delta").contains(pooled));
        // What has no mark is not pooled.
        let mut of_one_velocity = rows(12);
        let velocity = of_one_velocity[0].parameters.drive_velocity;
        for row in &mut of_one_velocity {
            row.tau_mean = row
                .tau_mean
                .filter(|_| row.parameters.drive_velocity == velocity);
        }
        let figure = CustomFigure {
            x: "Delta".into(),
            y: "tau_mean".into(),
            ..measured.clone()
        };
        let all = drawn(12, &figure, &Look::default()).unwrap().svg();
        let one = drawn_of(&of_one_velocity, &figure, &Look::default());
        assert!(all.contains(pooled) && !one.unwrap().svg().contains(pooled));
    }

    #[test]
    fn a_series_without_a_mark_has_no_entry() {
        let sets = [(1e-6, 0.02), (1e-6, 0.03), (0.0, 0.01)];
        let sets = sets.map(|(amplitude, period)| set(amplitude, period, 4.0));
        let figure = CustomFigure {
            x: "frequency".into(),
            y: "resultant_length".into(),
            ..figure()
        };
        let svg = drawn_of(&sets, &figure, &Look::default()).unwrap().svg();
        assert!(!svg.contains(">Δ = 0<") && svg.contains("not shown: 1 of 3 sets"));
    }

    #[test]
    fn a_style_does_not_change_the_data() {
        let dots = |style| {
            let look = Look {
                style,
                ..Look::default()
            };
            drawn(8, &figure(), &look)
                .unwrap()
                .svg()
                .matches("<circle")
                .count()
        };
        assert_eq!(dots(Style::Screen), dots(Style::Print));
    }
}
