//! Hues: a quantity as colours. Few values have an ink each and stand in the legend; many are a scale beside the frame.

use super::axis::Axis;
use super::colour_bar::ColourBar;
use super::ink::{Dot, Ink};
use super::legend::{Entry, Mark, entry};
use super::style::{BLACK, INKS, SCALE, shade};
use crate::reduce::{ascending, is_same};
use crate::table::value::floored;

/// How the values of a quantity become colours.
pub(super) enum Hues {
    /// Each value and what it is called, in the order of inks.
    Inks(Vec<(f64, String)>),
    Scale(Axis),
}

impl Hues {
    /// For these values of a quantity with this label, each called as `word` says.
    pub(super) fn of(
        label: &str,
        values: impl Iterator<Item = f64>,
        word: impl Fn(f64) -> String,
    ) -> Self {
        let values = ascending(values.filter(|value| value.is_finite()));
        match values[..] {
            [low, .., high] if values.len() > INKS.len() => {
                Self::Scale(Axis::spanning(label, (low, high)))
            }
            _ => Self::Inks(
                values
                    .into_iter()
                    .map(|value| (value, word(value)))
                    .collect(),
            ),
        }
    }

    pub(super) fn ink(&self, value: f64) -> Ink {
        match self {
            Self::Inks(values) => {
                // What is off is black, so that others have the colours that they have without it.
                let first = usize::from(values.first().is_some_and(|(least, _)| *least == 0.0));
                let index = values
                    .iter()
                    .position(|(known, _)| is_same(*known, value))
                    .unwrap_or(0);
                if index < first {
                    BLACK
                } else {
                    INKS[(index - first) % INKS.len()]
                }
            }
            Self::Scale(axis) => {
                let steps = SCALE.len() as f64;
                let step = floored((axis.place(value) * steps).min(steps - 1.0));
                SCALE[step]
            }
        }
    }

    /// Entries of the legend, with dots of this radius, of values that are shown.
    pub(super) fn entries(&self, radius: f64, is_shown: impl Fn(f64) -> bool) -> Vec<Entry> {
        let Self::Inks(values) = self else {
            return Vec::new();
        };
        let values = values.iter().filter(|(value, _)| is_shown(*value));
        values
            .map(|(value, name)| entry(Mark::Dot(Dot::solid(self.ink(*value), radius)), name))
            .collect()
    }

    /// The colour bar, if there is a scale.
    pub(super) fn bar(&self) -> Option<ColourBar> {
        let Self::Scale(axis) = self else { return None };
        Some(ColourBar {
            colours: SCALE.to_vec(),
            ..ColourBar::of_axis(axis, shade)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_have_inks_and_many_a_scale() {
        let hues = |count: u32| {
            Hues::of("", (0..count).map(|step| f64::from(1 << step)), |value| {
                value.to_string()
            })
        };
        let few = hues(3);
        assert_eq!(
            [1.0, 2.0, 4.0].map(|value| few.ink(value)),
            [INKS[0], INKS[1], INKS[2]]
        );
        assert!(few.entries(1.0, |_| true).len() == 3 && few.bar().is_none());
        let many = hues(7);
        assert!(many.entries(1.0, |_| true).is_empty() && many.bar().is_some());
        assert_eq!(
            (many.ink(1.0), many.ink(8.0), many.ink(64.0)),
            (SCALE[0], SCALE[5], SCALE[9])
        );
        assert!(SCALE.contains(&many.ink(f64::NAN)), "no panic");
    }
}
