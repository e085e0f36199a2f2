//! The `[precision]` and `[refine]` of a sweep file.
//!
//! ```text
//! [precision]
//! of       = "tau_mean"             a statistic with an interval, or a list of them
//! relative = 0.01                   largest half-width of its 95 % interval; or absolute = .., in its unit
//! seeds    = { from = 24, to = 256 } seeds of a set: at first, and at most
//! [refine]
//! axes = ["frequency", "Delta"]     ranges of [axes]
//! by   = "has_phase"                a flag; a word or a count, or one value of it; a number with threshold or step
//! to   = { frequency = 0.1, Delta = 0.02 }
//! sets = 2000                       at most
//! ```
//!
//! `[refine]` is read before the axes, which become as fine as it wants, and held against them afterwards.

use super::axes::{Axis, MAX_ROWS};
use super::checks::Places;
use super::quantity::Quantity;
use super::rounds::{Contrast, MAX_SETS, Precision, RefinedAxis, Refinement, Target};
use super::samples::Range;
use super::set::{STATISTICS, Statistic, StatisticKind};
use super::source::{Entry, Refused, Section, all, hint};
use crate::model::Symbol;
use crate::observe::Regime;
use crate::table::value::Shortest;
use std::cell::Cell;

const PRECISION: &[&str] = &["of", "relative", "absolute", "seeds"];
const REFINE: &[&str] = &["axes", "by", "value", "threshold", "step", "to", "sets"];

/// Reads `[precision]`, and the axis of seeds that it makes.
pub(super) fn read_precision(section: &Section<'_>, places: &mut Places<'_>) -> Result<(Precision, Axis), Refused> {
    section.only(PRECISION).ok();
    let of = section.required("of", "the statistic that is to be precise, such as of = \"tau_mean\"");
    let statistics = of.and_then(|of| {
        let entries = of.list().unwrap_or_else(|| vec![of]);
        let statistics = all(entries.iter().map(read_estimate))?;
        if statistics.is_empty() { Err(of.refuse("at least one statistic")) } else { Ok(statistics) }
    });
    let target = read_target(section, statistics.as_deref().unwrap_or_default());
    let seeds = section.required("seeds", "write seeds = { from = 24, to = 256 }").and_then(|entry| {
        places.set(Quantity::Parameter(Symbol::Seed), entry.at, false);
        let form = "seeds of a set at first and at most, such as { from = 24, to = 256 }";
        let table = entry.section("seeds of [precision]").ok_or_else(|| entry.must_be(form))?;
        table.only(&["from", "to"])?;
        let from = table.required("from", form)?.count(2, MAX_ROWS)?;
        let to = table.required("to", form)?;
        let most = to.count(2, MAX_ROWS)?;
        if most < from {
            return Err(to.must_be(&format!("at least from, which is {from}")));
        }
        Ok(from..=most)
    });
    let (statistics, target, seeds) = (statistics?, target?, seeds?);
    let axis = Axis::Counted { symbol: Symbol::Seed, first: 0, count: *seeds.end() };
    Ok((Precision { statistics, target, seeds }, axis))
}

fn read_estimate(entry: &Entry<'_>) -> Result<Statistic, Refused> {
    let known: Vec<&str> = STATISTICS.iter().filter(|known| known.has_interval()).map(|known| known.key).collect();
    match entry.word().map(Statistic::from_key) {
        Some(Some(statistic)) if statistic.has_interval() => Ok(statistic),
        Some(Some(_)) => Err(entry.refuse(format!("has no confidence interval; allowed are {}", known.join(", ")))),
        Some(None) => {
            Err(entry.refuse(format!("is no statistic of a set; {}", hint(entry.word().unwrap_or_default(), &known))))
        }
        None => Err(entry.must_be(&format!("a statistic in quotes: {}", known.join(", ")))),
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
            match of.iter().find(|statistic| statistic.kind == StatisticKind::Angle) {
                Some(Statistic { key, .. }) => {
                    Err(entry.refuse(format!("{key} is an angle and has no relative error; set absolute, in rad")))
                }
                None => Ok(Target::Relative(share)),
            }
        }
        (None, Some(entry)) => {
            let [Statistic { unit, .. }, rest @ ..] = of else { return Ok(Target::Absolute(0.0)) };
            if rest.iter().any(|other| other.unit != *unit) {
                return Err(
                    entry.refuse("the statistics in of have different units; set relative, or keep one of them")
                );
            }
            Ok(Target::Absolute(entry.positive(if unit.is_empty() { "the unit of a pure number" } else { unit })?))
        }
    }
}

/// `[refine]` as it is read before the axes.
pub(super) struct Wanted<'a> {
    axes: Vec<WantedAxis<'a>>,
    by: Statistic,
    contrast: Contrast,
    pub max_sets: u64,
    pub max_sets_at: Entry<'a>,
}

/// An axis that is to be refined.
pub(super) struct WantedAxis<'a> {
    quantity: Quantity,
    entry: Entry<'a>,
    to: (f64, Entry<'a>),
    /// How often its cells can be halved, once the axis is read.
    levels: Cell<Option<u32>>,
}

/// Reads `[refine]` as far as it goes without the axes.
pub(super) fn read_refinement<'a>(section: &Section<'a>) -> Result<Wanted<'a>, Refused> {
    section.only(REFINE).ok();
    let axes = read_refined_axes(section);
    let by = section
        .required("by", "what tells sets apart, such as by = \"regime\"")
        .and_then(|entry| read_by(section, &entry));
    let sets = section.required("sets", "the most sets of the sweep, such as sets = 2000");
    let max_sets = sets.and_then(|entry| Ok((entry.count(1, MAX_SETS)?, entry)));
    let (axes, (by, contrast), (max_sets, max_sets_at)) = (axes?, by?, max_sets?);
    Ok(Wanted { axes, by, contrast, max_sets, max_sets_at })
}

fn read_refined_axes<'a>(section: &Section<'a>) -> Result<Vec<WantedAxis<'a>>, Refused> {
    let axes = section.required("axes", "the axes that are divided, such as axes = [\"frequency\"]")?;
    let named = axes.list().unwrap_or_else(|| vec![axes]);
    if named.is_empty() {
        return Err(axes.refuse("names no axis; name one, or remove [refine]"));
    }
    let quantities: Vec<(Quantity, Entry<'a>)> = all(named.iter().map(|entry| {
        let keys: Vec<&str> = Quantity::all().map(Quantity::key).collect();
        let word = entry.word().ok_or_else(|| entry.must_be("the name of an axis in quotes, or a list of them"))?;
        let quantity =
            Quantity::from_key(word).ok_or_else(|| entry.refuse(format!("is no axis; {}", hint(word, &keys))))?;
        if quantity == Quantity::BREAK_ON {
            return Err(entry.refuse("is a word: there is nothing between its values"));
        }
        if quantity.is_count() {
            return Err(entry.refuse("takes whole numbers: list those that are wanted in [axes]"));
        }
        Ok((quantity, *entry))
    }))?;
    for (position, (quantity, entry)) in quantities.iter().enumerate() {
        if quantities[..position].iter().any(|(earlier, _)| earlier == quantity) {
            return Err(entry.refuse("is named twice; keep one"));
        }
    }
    let form = "how fine each axis is to be, such as to = { frequency = 0.1 }";
    let entry = section.required("to", form)?;
    let to = entry.section("to of [refine]").ok_or_else(|| entry.must_be(form))?;
    let allowed: Vec<&str> = quantities.iter().map(|(quantity, _)| quantity.key()).collect();
    to.only(&allowed)?;
    all(quantities.into_iter().map(|(quantity, entry)| {
        let fine = to.required(quantity.key(), form)?;
        let step = fine.number("a finite number > 0", |step| step > 0.0)?;
        Ok(WantedAxis { quantity, entry, to: (step, fine), levels: Cell::new(None) })
    }))
}

fn read_by(section: &Section<'_>, entry: &Entry<'_>) -> Result<(Statistic, Contrast), Refused> {
    let known: Vec<&str> = STATISTICS.iter().map(|known| known.key).collect();
    let word = entry.word().ok_or_else(|| entry.must_be("a statistic in quotes, such as \"regime\""))?;
    let statistic = Statistic::from_key(word)
        .ok_or_else(|| entry.refuse(format!("is no statistic of a set; {}", hint(word, &known))))?;
    let is_class = statistic.kind == StatisticKind::Class;
    let contrast = match (section.entry("threshold"), section.entry("step")) {
        (None, None) if is_class => match section.entry("value") {
            Some(entry) => Contrast::Value(read_value(&entry, word)?),
            None => Contrast::Class,
        },
        _ if !is_class && let Some(entry) = section.entry("value") => {
            return Err(entry.refuse(format!("{word} is a number; set threshold or step in place of value")));
        }
        (None, None) => {
            return Err(
                entry.refuse("is a number: set threshold, a value that it crosses, or step, by which it may vary")
            );
        }
        (Some(entry), _) | (None, Some(entry)) if is_class => {
            return Err(entry.refuse(format!("{word} is no number, and has no {}; remove it", entry.key)));
        }
        (Some(_), Some(entry)) => return Err(entry.refuse("threshold is there too; keep one of them")),
        (Some(entry), None) => Contrast::Threshold(entry.number("a finite number", |_| true)?),
        (None, Some(entry)) => Contrast::Step(entry.number("a finite number > 0", |step| step > 0.0)?),
    };
    Ok((statistic, contrast))
}

/// The value of a statistic that sets are to have.
fn read_value(entry: &Entry<'_>, statistic: &str) -> Result<String, Refused> {
    let regimes = Regime::ALL.map(Regime::word);
    match statistic {
        "periods" => Ok(entry.count(0, MAX_ROWS)?.to_string()),
        "regime" => {
            let word = entry.word().filter(|word| regimes.contains(word));
            Ok(word.ok_or_else(|| entry.must_be(&format!("one of {}", regimes.join(", "))))?.to_owned())
        }
        _ => Err(entry.refuse(format!("{statistic} is true or false; remove value"))),
    }
}

impl<'a> Wanted<'a> {
    /// Whether this quantity is to be refined.
    pub fn axis(&self, quantity: Quantity) -> Option<&WantedAxis<'a>> {
        self.axes.iter().find(|axis| axis.quantity == quantity)
    }

    /// What it means for these axes.
    pub fn over(&self, axes: &[Axis]) -> Result<Refinement, Refused> {
        let axes = all(self.axes.iter().map(|wanted| {
            let swept = axes.iter().position(|axis| axis.quantities().contains(&wanted.quantity));
            match (swept, wanted.levels.get()) {
                (Some(axis), Some(levels)) => Ok(RefinedAxis { axis, levels }),
                (Some(axis), None) if axes[axis].quantities().len() > 1 => Err(wanted
                    .entry
                    .refuse("moves together with others in a zip or a sample; make it an axis of its own")),
                (Some(_), None) => Err(wanted.entry.refuse(
                    "has no values in between; write the axis as { linear = [low, high], points = n }, or log",
                )),
                (None, _) => Err(wanted.entry.refuse(why_not_swept(wanted.quantity, axes))),
            }
        }))?;
        Ok(Refinement { axes, by: self.by, contrast: self.contrast.clone(), max_sets: self.max_sets })
    }
}

fn why_not_swept(quantity: Quantity, axes: &[Axis]) -> String {
    let fixing = axes.iter().flat_map(Axis::quantities).find(|other| other.is_period());
    match fixing {
        Some(other) if quantity.is_period() => {
            let (key, other) = (quantity.key(), other.key());
            format!("{key} follows from the axis {other}; refine {other}")
        }
        _ => "is no axis of [axes]; add it there as a range".to_owned(),
    }
}

impl WantedAxis<'_> {
    /// The number of values of the axis once it is as fine as is wanted, from that in the file.
    pub fn points(&self, range: &Range, points: u64) -> Result<u64, Refused> {
        let (to, entry) = &self.to;
        let cells = (points - 1) as f64;
        // Of an axis with 2^level cells in place of each.
        let step = |level: u32| {
            let cells = cells * f64::from(level).exp2();
            if range.logarithmic {
                libm::expm1(libm::log(range.high / range.low) / cells)
            } else {
                (range.high - range.low) / cells
            }
        };
        if *to >= step(0) {
            let what = if range.logarithmic { "as a share of the value" } else { "the step of the axis in [axes]" };
            return Err(entry.must_be(&format!("finer than {}, {what}", Shortest(step(0)))));
        }
        let levels = (1..u64::BITS).find(|&level| step(level) <= *to * (1.0 + ROUNDING));
        let fine = levels.and_then(|level| (points - 1).checked_mul(1 << level)).map(|cells| cells + 1);
        match (levels, fine) {
            (Some(levels), Some(fine)) if fine <= MAX_ROWS => {
                self.levels.set(Some(levels));
                Ok(fine)
            }
            _ => Err(entry.refuse(format!("makes more than {MAX_ROWS} values of the axis; take a coarser one"))),
        }
    }
}

/// What rounding may add to a step that was meant to be that of the file, halved some times.
const ROUNDING: f64 = 1e-9;
