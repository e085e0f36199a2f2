//! Axes: range, scale, and where ticks go.

use crate::sets::{power_of_ten, with_decimals};
use std::f64::consts::{FRAC_PI_2, LN_10, PI};

#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// What it shows, with its unit; an empty label is not drawn.
    pub(super) label: String,
    /// The same in short, for frames that have no room for it.
    pub(super) short_label: String,
    pub(super) low: f64,
    pub(super) high: f64,
    is_log: bool,
    pub(super) ticks: Vec<(f64, String)>,
    pub(super) minor: Vec<f64>,
}

/// Ticks with a number on an axis.
const MAX_TICKS: f64 = 6.0;
/// Fewest numbers that show the scale of an axis.
const FEWEST: usize = 3;
/// Mantissas with a number on logarithmic axes: over several decades, over few, and over ranges so short that those give
/// one or two numbers.
const MANTISSAS: [&[f64]; 4] = [
    &[1.0],
    &[1.0, 2.0, 5.0],
    &[1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0],
    &[
        1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0,
    ],
];
/// Numbers of values within these limits are written out, if they need no more decimals than this; others are multiples
/// of a power of ten that stands in the label.
const WRITTEN_OUT: std::ops::Range<f64> = 1e-2..1e6;
const MAX_DECIMALS: usize = 3;
/// Ratio of the largest to the least value above which a scale is logarithmic.
const DECADES: f64 = 20.0;
/// Largest number of ticks of any kind, as absurd values would give no end of them.
const MAX_MULTIPLES: usize = 1000;
/// No quantity is larger than this, nor smaller than its inverse.
const LARGEST: f64 = 1e100;

impl Axis {
    pub(super) fn linear(label: &str, low: f64, high: f64) -> Self {
        Self::linear_with(label, low, high, MAX_TICKS)
    }

    /// Linear from `low` to `high` with half as many ticks, for low frames.
    pub(super) fn sparse(label: &str, low: f64, high: f64) -> Self {
        Self::linear_with(label, low, high, 0.5 * MAX_TICKS)
    }

    fn linear_with(label: &str, low: f64, high: f64, max_ticks: f64) -> Self {
        // Also where the data are a single value.
        let high = if high > low {
            high
        } else {
            low + low.abs().max(1.0)
        };
        let largest = low.abs().max(high.abs());
        let is_small = largest < WRITTEN_OUT.start
            && decimals(nice_step((high - low) / max_ticks)) > MAX_DECIMALS;
        // Thousandths, millionths, thousands, ...: those that units have prefixes for.
        let is_scaled = is_small || (WRITTEN_OUT.end..LARGEST).contains(&largest);
        let power = if is_scaled {
            3 * exponent(largest).div_euclid(3)
        } else {
            0
        };
        let mut axis = Self::bare(&with_power(label, power), low, high);
        // Finer steps, where these would give one or two numbers.
        for count in [max_ticks, MAX_TICKS, 1.5 * MAX_TICKS] {
            if axis.ticks.len() < FEWEST {
                axis.set_steps(nice_step((high - low) / count), power);
            }
        }
        axis
    }

    fn set_steps(&mut self, step: f64, power: i32) {
        let unit = libm::exp10(f64::from(power));
        let digits = decimals(step / unit);
        self.ticks = multiples(step, self.low, self.high)
            .map(|tick| (tick, number(tick / unit, digits)))
            .collect();
        // A step of 2 is halved, others are cut in five.
        let parts = if (step / libm::exp10(f64::from(exponent(step)))).round() == 2.0 {
            2.0
        } else {
            5.0
        };
        self.minor = multiples(step / parts, self.low, self.high).collect();
    }

    /// Whether the ticks between numbers would stand close on this length.
    pub(super) fn is_crowded(&self, length: f64) -> bool {
        const CLOSE: f64 = 5.0;
        !self.is_log && self.minor.len() as f64 * CLOSE > length
    }

    /// From `low` to `high`: logarithmic if these lie decades apart.
    pub(super) fn spanning(label: &str, (low, high): (f64, f64)) -> Self {
        Self::of_scale(is_wide((low, high)), label, low, high)
    }

    pub(super) fn of_scale(is_log: bool, label: &str, low: f64, high: f64) -> Self {
        if is_log {
            Self::logarithmic(label, low, high)
        } else {
            Self::linear(label, low, high)
        }
    }

    /// Logarithmic from `low` to `high`, both > 0.
    pub(super) fn logarithmic(label: &str, low: f64, high: f64) -> Self {
        let [low, high] = [low, high].map(|end| end.clamp(1.0 / LARGEST, LARGEST));
        let mut axis = Self::bare(label, low, high);
        axis.is_log = true;
        for mantissas in &MANTISSAS[usize::from(libm::log10(high / low) < 2.0)..] {
            if axis.ticks.len() < FEWEST {
                axis.set_mantissas(mantissas);
            }
        }
        axis
    }

    fn set_mantissas(&mut self, mantissas: &[f64]) {
        let Self { low, high, .. } = *self;
        // Every decade up to 7 of them, then every second, third, ...
        #[expect(
            clippy::cast_possible_truncation,
            reason = "at most some hundred decades"
        )]
        let every = ((libm::log10(high / low) / 7.0).ceil() as i32).max(1);
        let number = if low >= 9e-4 && high <= 1.1e4 {
            plain_power
        } else {
            power_of_ten
        };
        self.ticks.clear();
        self.minor.clear();
        for power in exponent(low)..=exponent(high) {
            let decade = libm::exp10(f64::from(power));
            let between = mantissas
                .iter()
                .copied()
                .filter(|mantissa| mantissa.fract() != 0.0);
            let mut all: Vec<f64> = (1..10).map(f64::from).chain(between).collect();
            all.sort_by(f64::total_cmp);
            for mantissa in all {
                let value = mantissa * decade;
                if value < low * (1.0 - 1e-9) || value > high * (1.0 + 1e-9) {
                    continue;
                }
                if mantissas.contains(&mantissa) && power.rem_euclid(every) == 0 {
                    self.ticks.push((value, number(mantissa, power)));
                } else if every == 1 || mantissa == 1.0 {
                    self.minor.push(value);
                }
            }
        }
    }

    /// Angles in rad between multiples of π/2.
    pub(super) fn angle(label: &str, low: f64, high: f64) -> Self {
        let mut axis = Self::bare(label, low, high);
        axis.ticks = multiples(FRAC_PI_2, low, high)
            .map(|tick| (tick, halves_of_pi(tick)))
            .collect();
        axis.minor = multiples(FRAC_PI_2 / 3.0, low, high).collect();
        axis
    }

    /// Words at 0, 1, 2, ...
    pub(super) fn categories(label: &str, words: &[String]) -> Self {
        let mut axis = Self::bare(label, -0.5, words.len() as f64 - 0.5);
        axis.ticks = (0..).map(f64::from).zip(words.iter().cloned()).collect();
        axis
    }

    /// Linear, without ticks.
    fn bare(label: &str, low: f64, high: f64) -> Self {
        Self {
            label: label.to_owned(),
            short_label: label.to_owned(),
            low,
            high,
            is_log: false,
            ticks: Vec::new(),
            minor: Vec::new(),
        }
    }

    /// Place of a value, 0 at the low end and 1 at the high end.
    pub(super) fn place(&self, value: f64) -> f64 {
        if self.is_log {
            libm::log(value / self.low) / libm::log(self.high / self.low)
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Whether a value lies on the axis.
    pub(super) fn contains(&self, value: f64) -> bool {
        value >= self.low && value <= self.high
    }

    /// The multiples of a period on it; none if the axis is longer than so many periods.
    pub(super) fn multiples_of(&self, period: f64, most: f64) -> Vec<f64> {
        if (self.high - self.low) / period > most {
            return Vec::new();
        }
        multiples(period, self.low, self.high).collect()
    }

    /// `count` >= 2 values from end to end, evenly placed.
    pub(super) fn evenly_placed(&self, count: usize) -> Vec<f64> {
        let value = |step: usize| {
            let place = step as f64 / (count - 1) as f64;
            if self.is_log {
                self.low * libm::exp(place * libm::log(self.high / self.low))
            } else {
                self.low + place * (self.high - self.low)
            }
        };
        (0..count).map(value).collect()
    }
}

/// Whether values so far apart are seen on a logarithmic axis only.
pub(super) fn is_wide((low, high): (f64, f64)) -> bool {
    low > 0.0 && high > DECADES * low
}

/// Bounds of a logarithmic axis for data: a little wider than the data; `None` without any value > 0.
pub(super) fn logarithmic_bounds(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    const MARGIN: f64 = 0.08;
    let (low, high) = bounds(values.filter(|&value| value > 1.0 / LARGEST))?;
    // At least half a decade, or there would be no tick.
    let margin = (MARGIN * libm::log(high / low)).max(0.5 * (0.5 * LN_10 - libm::log(high / low)));
    Some((low * libm::exp(-margin), high * libm::exp(margin)))
}

/// A range with a margin on both sides, also where it is a single value.
pub(super) fn widened((low, high): (f64, f64)) -> (f64, f64) {
    const MARGIN: f64 = 0.05;
    let margin = if high > low {
        MARGIN * (high - low)
    } else {
        0.5 * if low == 0.0 { 1.0 } else { low.abs() }
    };
    (low - margin, high + margin)
}

/// Bounds in multiples of π/2 that enclose some angles in rad.
pub(super) fn angle_bounds(angles: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = bounds(angles).unwrap_or((-PI, PI));
    let low = (low / FRAC_PI_2).floor() * FRAC_PI_2;
    let high = (high / FRAC_PI_2).ceil() * FRAC_PI_2;
    (low, high.max(low + FRAC_PI_2))
}

/// Least and largest of the values that can be.
pub(super) fn bounds(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .filter(|value| value.abs() < LARGEST)
        .fold(None, |bounds, value| {
            let (low, high) = bounds.unwrap_or((value, value));
            Some((value.min(low), value.max(high)))
        })
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the decimal exponent of a double"
)]
fn exponent(value: f64) -> i32 {
    // The logarithm of a power of ten may round to just below a whole number.
    (libm::log10(value) + 1e-9).floor() as i32
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `step`.
fn nice_step(step: f64) -> f64 {
    let decade = libm::exp10(f64::from(exponent(step)));
    let nice = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|mantissa| mantissa * decade >= step * (1.0 - 1e-9))
        .unwrap_or(10.0);
    nice * decade
}

fn multiples(step: f64, low: f64, high: f64) -> impl Iterator<Item = f64> {
    let slack = 1e-6;
    #[expect(clippy::cast_possible_truncation, reason = "a few dozen multiples")]
    let whole = |multiple: f64| multiple as i64;
    let first = whole((low / step - slack).ceil());
    let last = whole((high / step + slack).floor());
    (first..=last)
        .take(MAX_MULTIPLES)
        .map(move |multiple| multiple as f64 * step)
}

/// Decimals that the multiples of a step need.
fn decimals(step: f64) -> usize {
    usize::try_from(-exponent(step)).unwrap_or(0)
}

/// The label of an axis whose numbers are the values over a power of ten: the power stands before the unit.
fn with_power(label: &str, power: i32) -> String {
    if power == 0 || label.is_empty() {
        return label.to_owned();
    }
    let factor = power_of_ten(1.0, power);
    match label.rsplit_once(" (") {
        Some((what, unit)) if unit.ends_with(')') => format!("{what} ({factor} {unit}"),
        _ => format!("{label} ({factor})"),
    }
}

/// With a true minus sign.
fn number(value: f64, decimals: usize) -> String {
    with_decimals(value, decimals).replace('-', "−")
}

fn plain_power(mantissa: f64, power: i32) -> String {
    let more = i32::from(mantissa.fract() != 0.0);
    let decimals = usize::try_from(more - power).unwrap_or(0);
    number(mantissa * libm::exp10(f64::from(power)), decimals)
}

fn halves_of_pi(angle: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "a few halves")]
    let halves = (angle / FRAC_PI_2).round() as i64;
    let sign = if halves < 0 { "−" } else { "" };
    let (count, over) = if halves % 2 == 0 {
        (halves.abs() / 2, "")
    } else {
        (halves.abs(), "/2")
    };
    match count {
        0 => "0".to_owned(),
        1 => format!("{sign}π{over}"),
        _ => format!("{sign}{count}π{over}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn values_that_make_no_sense_have_few_ticks() {
        let huge = [1.0, f64::MAX, f64::INFINITY, f64::NAN, 1e-320];
        assert!(logarithmic_bounds(huge.into_iter()).unwrap().1 < 10.0);
        assert_eq!(bounds(huge.into_iter()), Some((1e-320, 1.0)));
        let logarithmic = [(-1.0, 1.0), (0.0, 1.0), (1.0, f64::INFINITY)];
        for (low, high) in logarithmic {
            let axis = Axis::logarithmic("", low, high);
            assert!(
                axis.ticks.len() + axis.minor.len() <= 2 * MAX_MULTIPLES
                    && axis.place(1.0).is_finite()
            );
        }
        for axis in [
            Axis::angle("", 0.0, 1e300),
            Axis::linear("", 1e300, 1e300_f64.next_up()),
            Axis::linear("", 0.0, f64::INFINITY),
        ] {
            assert!(axis.ticks.len() + axis.minor.len() <= 2 * MAX_MULTIPLES);
        }
    }

    #[test]
    fn ticks_are_round_and_have_no_more_digits_than_they_need() {
        assert_eq!(
            labels(&Axis::linear("", 0.0, 0.25)),
            ["0.00", "0.05", "0.10", "0.15", "0.20", "0.25"]
        );
        assert_eq!(
            labels(&Axis::linear("", -210.0, 480.0)),
            ["−200", "0", "200", "400"]
        );
        assert_eq!(
            labels(&Axis::logarithmic("", 0.2, 1000.0)),
            ["1", "10", "100", "1000"]
        );
        assert_eq!(
            labels(&Axis::logarithmic("", 0.05, 0.6)),
            ["0.05", "0.1", "0.2", "0.5"]
        );
        assert_eq!(
            labels(&Axis::logarithmic("", 1e-12, 1e-6))[0..2],
            ["10⁻¹²", "10⁻¹¹"]
        );
        assert_eq!(
            labels(&Axis::angle("", -1.5 * PI, PI)),
            ["−3π/2", "−π", "−π/2", "0", "π/2", "π"]
        );
    }

    #[test]
    fn no_axis_is_crowded_or_bare() {
        for exponent in -12..12 {
            for span in [0.0, 0.3, 1.0, 7.7, 100.0] {
                let low = 3.3 * libm::exp10(f64::from(exponent));
                let (start, end) = widened((low, low * (1.0 + span)));
                let linear = Axis::linear("", start, end);
                assert!(
                    (2..=8).contains(&linear.ticks.len()),
                    "{low} {span}: {:?}",
                    linear.ticks
                );
                let (low, high) =
                    logarithmic_bounds([low, low * (1.0 + span)].into_iter()).unwrap();
                let logarithmic = Axis::logarithmic("", low, high);
                assert!(
                    (1..=9).contains(&logarithmic.ticks.len()),
                    "{low} {high}: {:?}",
                    logarithmic.ticks
                );
            }
        }
    }

    #[test]
    fn an_axis_has_three_numbers_or_more() {
        for (axis, expected) in [
            (
                Axis::logarithmic("", 40.0, 125.0),
                ["40", "60", "80", "100"],
            ),
            (
                Axis::logarithmic("", 0.012, 0.05),
                ["0.015", "0.02", "0.03", "0.04"],
            ),
            (Axis::logarithmic("", 0.3, 6.0), ["0.5", "1", "2", "5"]),
            (Axis::sparse("", 0.0, 78.0), ["0", "20", "40", "60"]),
        ] {
            assert_eq!(labels(&axis), expected);
        }
        for exponent in -12..12 {
            for (start, span) in [
                (1.01, 3.2),
                (2.1, 3.2),
                (3.3, 10.0),
                (5.5, 3.2),
                (9.9, 11.0),
            ] {
                let low = start * libm::exp10(f64::from(exponent));
                for axis in [
                    Axis::logarithmic("", low, span * low),
                    Axis::sparse("", low, span * low),
                ] {
                    let count = axis.ticks.len();
                    assert!((3..=9).contains(&count), "{low} {span}: {count}");
                }
            }
        }
    }

    #[test]
    fn numbers_with_many_zeros_are_over_a_power_of_ten_that_the_label_shows() {
        let axis = Axis::linear("Amplitude Δ (m)", 0.0, 4e-6);
        assert_eq!(
            (axis.label.as_str(), labels(&axis)),
            ("Amplitude Δ (10⁻⁶ m)", vec!["0", "1", "2", "3", "4"])
        );
        let axis = Axis::linear("K_d (N/m)", 0.0, 4e7);
        assert_eq!(
            (axis.label.as_str(), labels(&axis)),
            ("K_d (10⁶ N/m)", vec!["0", "10", "20", "30", "40"])
        );
        assert_eq!(Axis::linear("share", 0.0, 1e-5).label, "share (10⁻⁶)");
        let axis = Axis::linear("Period T (s)", 0.0, 0.05);
        assert_eq!(
            (axis.label.as_str(), labels(&axis)[1]),
            ("Period T (s)", "0.01")
        );
    }

    #[test]
    fn even_places_go_from_end_to_end() {
        let axis = Axis::logarithmic("", 0.2, 1000.0);
        let values = axis.evenly_placed(5);
        assert!((values[0] - 0.2).abs() < 1e-12 && (values[4] - 1000.0).abs() < 1e-9);
        assert!((axis.place(values[2]) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn angle_bounds_hold_all_data() {
        assert_eq!(angle_bounds([].into_iter()), (-PI, PI));
        let (low, high) = angle_bounds([-4.8, 0.1].into_iter());
        assert!((low + 2.0 * PI).abs() < 1e-12 && (high - FRAC_PI_2).abs() < 1e-12);
        assert_eq!(angle_bounds([0.0].into_iter()), (0.0, FRAC_PI_2));
    }
}
