//! The `[precision]` or the `[refine]` of a sweep file, see `docs/rounds.md`. The axis of `[refine]` becomes as
//! fine as its `to`.

use super::axes::{Axis, AxisRange, MAX_ROWS};
use super::checks::Places;
use super::quantity::{Quantity, hint};
use super::read_axes::{read_spaced, spaced};
use super::rounds::{Goal, MAX_JOBS, MIN_SEEDS, Precision, Refinement, Rounds, Target};
use super::source::{Entry, Refused, Section, all};
use crate::model::Symbol;
use crate::sets::{STATISTICS, Statistic};
use crate::table::value::Shortest;

/// Share of the intervals at which the edge of a tongue lies, if nothing is said.
const HALF: f64 = 0.5;

/// Reads `[precision]` without its seeds.
pub(super) fn read_precision(section: &Section<'_>) -> Result<Precision, Refused> {
    section.only(&["of", "relative", "absolute", "seeds"]).ok();
    let need = "the statistic that is to be precise, such as of = \"tau_mean\"";
    let of = section.required("of", need);
    let problem = "has no confidence interval; allowed are ";
    let statistics = of.and_then(|of| read_statistics(&of, |known| known.has_interval, problem));
    let target = read_target(section, statistics.as_deref().unwrap_or_default());
    Ok(Precision {
        statistics: statistics?,
        target: target?,
    })
}

/// Reads the seeds of `[precision]` or `[refine]`, and adds an axis of all of them.
pub(super) fn read_seeds(
    section: &Section<'_>,
    goal: Result<Goal, Refused>,
    axes: &mut Result<Vec<Axis>, Refused>,
    places: &mut Places<'_>,
) -> Result<Rounds, Refused> {
    let form = "seeds of a set at first and at most, such as { from = 24, to = 256 }";
    let entry = section.required("seeds", "write seeds = { from = 24, to = 256 }")?;
    places.set(Quantity::SEED, entry.at, section.title);
    let table = entry.section("seeds").ok_or_else(|| entry.must_be(form))?;
    table.only(&["first", "from", "to"])?;
    let asked = table.required("from", form)?.count(2, MAX_ROWS)?;
    let to = table.required("to", form)?;
    let max = to.count(2, MAX_ROWS)?;
    if max < asked {
        return Err(to.must_be(&format!("at least from, which is {asked}")));
    }
    let first = table
        .entry("first")
        .map_or(Ok(0), |first| first.count(0, u64::from(u32::MAX)))?;
    if let Ok(axes) = axes {
        axes.push(Axis::Counted {
            symbol: Symbol::Seed,
            values: first..first + max,
        });
    }
    Ok(Rounds {
        seeds: asked.max(MIN_SEEDS.min(max))..=max,
        asked,
        goal: goal?,
    })
}

/// Reads a statistic that is allowed, or a list of them; `problem` is what is wrong with others, before the allowed
/// ones.
fn read_statistics(
    entry: &Entry<'_>,
    is_allowed: fn(Statistic) -> bool,
    problem: &str,
) -> Result<Vec<Statistic>, Refused> {
    let allowed = STATISTICS.iter().filter(|known| is_allowed(**known));
    let keys: Vec<&str> = allowed.map(|known| known.key).collect();
    let list = keys.join(", ");
    let entries = entry.list().unwrap_or_else(|| vec![*entry]);
    let statistics = all(entries.iter().map(|entry| {
        let form = format!("a statistic in quotes, or a list of them: {list}");
        let word = entry.word().ok_or_else(|| entry.must_be(&form))?;
        match Statistic::from_key(word) {
            Some(statistic) if is_allowed(statistic) => Ok(statistic),
            Some(_) => Err(entry.refuse(format!("{problem}{list}"))),
            None => Err(entry.refuse(format!("is no statistic of a set; {}", hint(word, &keys)))),
        }
    }))?;
    if statistics.is_empty() {
        Err(entry.refuse("at least one statistic"))
    } else {
        Ok(statistics)
    }
}

fn read_target(section: &Section<'_>, of: &[Statistic]) -> Result<Target, Refused> {
    match (section.entry("relative"), section.entry("absolute")) {
        (Some(_), Some(entry)) => Err(entry.refuse("relative is there too; keep one of them")),
        (None, None) => {
            let problem = "relative is missing in [precision]: the largest error as a share, such as relative = 0.01; or absolute";
            Err(section.source.refuse(section.at, problem))
        }
        (Some(entry), None) => {
            let allowed = "a number > 0 and < 1, as a share of the statistic";
            let share = entry.number(allowed, |share| share > 0.0 && share < 1.0)?;
            match of.iter().find(|statistic| statistic.is_angle()) {
                Some(Statistic { key, .. }) => Err(entry.refuse(format!(
                    "{key} is an angle and has no relative error; set absolute, in rad"
                ))),
                None => Ok(Target::Relative(share)),
            }
        }
        (None, Some(entry)) => {
            let [Statistic { unit, .. }, rest @ ..] = of else {
                return Ok(Target::Absolute(0.0));
            };
            if rest.iter().any(|other| other.unit != *unit) {
                return Err(entry.refuse(
                    "the statistics in of have different units; set relative, or keep one of them",
                ));
            }
            let unit = if unit.is_empty() {
                "the unit of a pure number"
            } else {
                unit
            };
            let allowed = format!("a finite number > 0, in {unit}");
            let error = entry.number(&allowed, |error| error > 0.0)?;
            Ok(Target::Absolute(error))
        }
    }
}

/// Reads `[refine]` without its seeds, and makes its axis, one of these, as fine as is wanted.
pub(super) fn read_refinement(
    section: &Section<'_>,
    file: &Section<'_>,
    axes: &mut Result<Vec<Axis>, Refused>,
) -> Result<Refinement, Refused> {
    let keys = ["axis", "by", "value", "threshold", "to", "seeds", "jobs"];
    section.only(&keys).ok();
    let need = "the axis along which edges are looked for, such as axis = \"Delta\"";
    let axis = section.required("axis", need);
    let quantity = axis.and_then(|entry| read_refinable(&entry));
    let need = "what crosses the threshold, such as by = \"resultant_length\"";
    let by = section
        .required("by", need)
        .and_then(|entry| read_by(section, &entry));
    let need = "the largest width of the interval of an edge, such as to = 0.03";
    let to = section.required("to", need);
    let width = to.and_then(|entry| entry.number("a finite number > 0", |width| width > 0.0));
    let jobs = section.required("jobs", "the most jobs of the sweep, such as jobs = 4000");
    let max_jobs = jobs.and_then(|entry| entry.count(1, MAX_JOBS));
    let wanted = Refinement {
        to: width?,
        max_jobs: max_jobs?,
        ..by?
    };
    let axes = axes.as_mut().map_err(|refused| *refused)?;
    let quantity = quantity?;
    let place = axes.iter().position(|axis| axis.quantities() == [quantity]);
    let listed = file.entry("axes").and_then(|axes| axes.section("[axes]"));
    let entry = listed.and_then(|axes| axes.entry(quantity.key()));
    let range = entry.filter(|entry| entry.list().is_none());
    let Some((place, range)) = place.zip(range) else {
        let problem = "has no range of its own in [axes], and only there are values in between; write it there as \
                       { linear = [low, high], points = n }, or log";
        return Err(axis?.refuse(problem));
    };
    let (range, points) = read_spaced(&range, quantity)?;
    let (levels, finer) = finer(&range, points, quantity, wanted.to, &to?)?;
    axes[place] = finer;
    Ok(Refinement {
        axis: place,
        levels,
        is_log: range.logarithmic,
        ..wanted
    })
}

fn read_refinable(entry: &Entry<'_>) -> Result<Quantity, Refused> {
    let keys: Vec<&str> = Quantity::all().map(Quantity::key).collect();
    let word = entry
        .word()
        .ok_or_else(|| entry.must_be("the name of one axis in quotes"))?;
    let quantity = Quantity::from_key(word)
        .ok_or_else(|| entry.refuse(format!("is no axis; {}", hint(word, &keys))))?;
    match quantity {
        Quantity::BREAK_ON => Err(entry.refuse("is a word: there is nothing between its values")),
        quantity if quantity.is_count() => {
            Err(entry.refuse("takes whole numbers: list those that are wanted in [axes]"))
        }
        quantity => Ok(quantity),
    }
}

/// Reads the statistics, the number of periods if their share is asked for, and the threshold.
fn read_by(section: &Section<'_>, entry: &Entry<'_>) -> Result<Refinement, Refused> {
    let threshold = section
        .entry("threshold")
        .map(|entry| entry.number("a finite number", |_| true))
        .transpose();
    if entry.word() == Some("periods") {
        let need = "the n of tau = n T, of which the share of intervals is taken";
        let value = section
            .required("value", need)
            .and_then(|value| value.count(0, MAX_ROWS));
        return Ok(Refinement {
            by: Statistic::from_key("periods").into_iter().collect(),
            periods: Some(value?),
            threshold: threshold?.unwrap_or(HALF),
            ..Refinement::default()
        });
    }
    let problem = "crosses no threshold; allowed are periods, ";
    let by = read_statistics(entry, |known| known.can_cross, problem)?;
    if let Some(value) = section.entry("value") {
        return Err(value.refuse("belongs to by = \"periods\"; remove it"));
    }
    let need = "the value that is crossed, such as threshold = 0.5";
    section.required("threshold", need)?;
    Ok(Refinement {
        by,
        threshold: threshold?.unwrap_or_default(),
        ..Refinement::default()
    })
}

/// What rounding may add to a step of the file's axis that is halved several times.
const ROUNDING: f64 = 1e-9;

/// How often each step of a range is halved until it is as short as is wanted, and the axis of these steps.
fn finer(
    range: &AxisRange,
    points: u64,
    quantity: Quantity,
    wanted: f64,
    to: &Entry<'_>,
) -> Result<(u32, Axis), Refused> {
    // Of an axis with 2^level steps in place of each.
    let step = |level: u32| {
        let steps = (points - 1) as f64 * f64::from(level).exp2();
        if range.logarithmic {
            libm::expm1(libm::log(range.high / range.low) / steps)
        } else {
            (range.high - range.low) / steps
        }
    };
    if wanted >= step(0) {
        let what = if range.logarithmic {
            "as a share of the value"
        } else {
            "the step of the axis in [axes]"
        };
        return Err(to.must_be(&format!("finer than {}, {what}", Shortest(step(0)))));
    }
    let levels = (1..u64::BITS).find(|&level| step(level) <= wanted * (1.0 + ROUNDING));
    let fine = levels.and_then(|levels| {
        let points = (points - 1).checked_mul(1 << levels)? + 1;
        let is_held = points <= MAX_ROWS;
        let axis = is_held.then(|| spaced(range, points, quantity))??;
        Some((levels, axis))
    });
    fine.ok_or_else(|| {
        let problem = format!("makes more than {MAX_ROWS} values of the axis; take a coarser one");
        to.refuse(problem)
    })
}
