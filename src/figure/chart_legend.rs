//! What the marks of a chart mean: its legend and its small print.

use super::chart::{Chart, Dots, HOLE, SMALL_RADIUS};
use super::ink::Dot;
use super::legend::{Entry, Mark, entry};
use super::quantity::{Quantity, parameter, without_value};
use super::style::{BLACK, GREY, RADIUS, REFERENCE, STRIPE, dot, drive_alone};
use crate::model::Symbol;
use crate::observe::Regime;

impl Chart<'_> {
    /// What each mark means that is drawn.
    pub(super) fn legend(&self, inside: &[usize], free: &[usize], dots: &Dots) -> Vec<Entry> {
        let mut entries = Vec::new();
        if let Some((colour, hues)) = self.colour.as_ref().zip(dots.hues.as_ref()) {
            let numbers: Vec<Option<f64>> = inside.iter().map(|&set| colour.number(set)).collect();
            entries.extend(hues.entries(RADIUS, |value| numbers.contains(&Some(value))));
            if numbers.contains(&None) {
                let text = without_value(&colour.column.values);
                entries.push(entry(Mark::Dot(dot(GREY)), text));
            }
        }
        if !free.is_empty() {
            entries.push(entry(Mark::Line(REFERENCE), "Δ = 0"));
        }
        if inside.iter().any(|&set| self.slides(set)) {
            entries.push(entry(Mark::Ring(BLACK, RADIUS, RADIUS - HOLE), "sliding"));
        }
        if self.ys.iter().any(|y| y.name() == "slip_share") {
            let [mixed, sliding] = Regime::MIN_SHARES;
            let text = format!("mixed above {mixed}, sliding above {sliding}");
            entries.push(entry(Mark::Line(REFERENCE), text));
        }
        if self.ys.iter().any(|y| y.drive.is_some()) {
            let mark = if dots.lines.is_empty() {
                Mark::Dot(Dot::solid(GREY, SMALL_RADIUS))
            } else {
                Mark::Line(drive_alone(BLACK))
            };
            entries.push(entry(mark, "by the drive alone"));
        }
        if self.ys.iter().any(|y| self.reduction(y).is_some()) {
            let text = "K_d Δ = 0.2 to 0.3 of the peak force: friction falls, says the paper";
            entries.push(entry(Mark::Patch(STRIPE), text));
        }
        entries
    }

    /// Swept parameters that nothing shows.
    fn pooled(&self) -> Option<String> {
        let asked = [Some(&self.x), self.colour.as_ref()]
            .into_iter()
            .flatten()
            .chain(&self.ys)
            .map(Quantity::name);
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
    pub(super) fn note(&self, inside: &[usize], levels: usize) -> String {
        let mut notes = Vec::new();
        let has_bars = |y: &Quantity<'_>| inside.iter().any(|&set| y.interval(set).is_some());
        if self.ys.iter().any(has_bars) {
            notes.push("bars: 95 %".to_owned());
        }
        let count = self.rows.len();
        let shows_intervals = self.ys.iter().any(|y| y.name().starts_with("tau"));
        let is_still = |set: &usize| {
            shows_intervals && self.slides(*set) && self.rows[*set].tau_mean.is_none()
        };
        let still: Vec<usize> = (0..count).filter(is_still).collect();
        if !still.is_empty() {
            let slide = still.len();
            notes.push(format!("{slide} of {count} sets slide: no intervals"));
        }
        let still_outside = still.iter().filter(|set| !inside.contains(set)).count();
        let left_out = count - inside.len() - levels - still_outside;
        if left_out > 0 {
            notes.push(format!(
                "not shown: {left_out} of {count} sets, without a value or outside the axes"
            ));
        }
        notes.extend(self.pooled());
        notes.join("; ")
    }
}
