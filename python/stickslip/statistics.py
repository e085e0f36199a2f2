"""Circular statistics, and estimates with 95 % confidence intervals.

Jobs of different seeds are independent, slips of one job are not. So the units that are left out (jackknife) or drawn
again (bootstrap) are seeds or parameter sets, never slips. The jackknife is that of the reduced tables, without their
allowances for slips that were not seen and for the ends of jobs (docs/model.md).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy
import pandas
from numpy.typing import ArrayLike
from scipy import stats

LEVEL = 0.95
"""Confidence level of all intervals."""
RESAMPLES = 400
"""Resamples of a bootstrap, enough for the ends of an interval to two digits."""


def resultant_length(angles: ArrayLike) -> float:
    """|<exp(iφ)>| of angles in rad, 1 if all are equal; missing ones are left out."""
    return float(abs(numpy.nanmean(numpy.exp(1j * numpy.asarray(angles)))))


def locking_index(periods: ArrayLike) -> float:
    """|<exp(2πi τ/T)>| of intervals in periods, 1 if all are whole numbers; missing ones are left out."""
    return resultant_length(2 * numpy.pi * numpy.asarray(periods))


def near_whole(periods: pandas.Series) -> pandas.Series:
    """Whether intervals are within 0.1 periods of a whole number of periods; by chance a fifth of them are."""
    return (periods - periods.round()).abs() < 0.1


@dataclass(frozen=True)
class Estimate:
    """A value and the ends of its 95 % interval, equal to it if nothing varies, from this many independent units."""

    value: float
    low: float
    high: float
    units: int

    @classmethod
    def from_error(cls, value: float, error: float, units: int) -> "Estimate":
        """Student's interval for a standard error."""
        half_width = stats.t.ppf(0.5 + LEVEL / 2, units - 1) * error
        return cls(*map(float, (value, value - half_width, value + half_width)), units)

    def lies(self, above: float = -numpy.inf, below: float = numpy.inf) -> bool | None:
        """Whether it does so with its interval; None if the interval holds a limit: the data do not decide."""
        if self.high < above or self.low > below:
            return False
        return True if above < self.low and self.high < below else None

    def among(self, comparisons: int) -> "Estimate":
        """The same with Bonferroni's correction for this number of comparisons."""
        one, all_of_them = (stats.t.ppf(1 - (1 - LEVEL) / 2 / number, self.units - 1) for number in (1, comparisons))
        ends = (self.value + all_of_them / one * (end - self.value) for end in (self.low, self.high))
        return Estimate(self.value, *map(float, ends), self.units)

    def scaled(self, factor: float) -> "Estimate":
        return Estimate(factor * self.value, factor * self.low, factor * self.high, self.units)

    def root(self) -> "Estimate":
        """Of an estimated square. If that is negative by chance, its upper end is as far above zero as above the estimate."""
        value = max(self.value, 0.0)
        ends = value, max(self.low, 0.0), value + self.high - self.value
        return Estimate(*(end**0.5 for end in ends), self.units)

    def text(self, digits: int = 3) -> str:
        """Value and interval with `digits` decimals."""
        # Adding zero turns a negative one into zero.
        ends = (round(x, digits) + 0.0 for x in (self.value, self.low, self.high))
        value, low, high = (f"{x:.{digits}f}".replace("-", "−") for x in ends)
        # A dash between numbers, but for negative ones.
        return value if low == high else f"{value} ({low}{' to ' if '−' in low else '–'}{high})"


def mean(values: pandas.Series) -> Estimate:
    """The mean of independent values; missing ones are left out."""
    values = values.dropna()
    return Estimate.from_error(values.mean(), stats.sem(values), len(values))


def jackknife(statistic: Callable[..., float], *frames: pandas.DataFrame, unit: str = "seed") -> Estimate:
    """A smooth statistic of one or more frames, over the units that all of them have.

    The interval is Student's t for the estimates that leave out one unit each (Efron and Stein, Ann. Stat. 9, 586
    (1981)). A difference of two frames is thus paired: what both owe to a unit, such as the disorder of a seed, drops
    out. With equally many rows for each unit, the interval of a difference of means is that of the paired t-test.
    """
    units = sorted(set.intersection(*(set(frame[unit]) for frame in frames)))
    if len(units) < 2:
        raise ValueError(f"{len(units)} values of {unit} are common to all; at least 2 are needed: raise its count")
    frames = [frame[frame[unit].isin(units)] for frame in frames]
    left_out = [statistic(*(frame[frame[unit].to_numpy() != one] for frame in frames)) for one in units]
    return Estimate.from_error(statistic(*frames), (len(units) - 1) * stats.sem(left_out, ddof=1), len(units))


def share(flags: pandas.Series, units: pandas.Series | pandas.Index) -> Estimate:
    """The share of rows with a flag, by Wilson's interval with their effective number and Student's t.

    So many independent rows would have the variance of the jackknife over the unit of each row. Where nothing varies it is
    the number of units.
    """
    frame = pandas.DataFrame({"flag": flags.to_numpy(dtype=float), "unit": units.to_numpy()})
    rough = jackknife(lambda rows: rows["flag"].mean(), frame, unit="unit")
    value, t = rough.value, stats.t.ppf(0.5 + LEVEL / 2, rough.units - 1)
    error = (rough.high - value) / t
    number = min(value * (1 - value) / error**2, len(flags)) if error > 0 else rough.units
    # Wilson, J. Am. Stat. Assoc. 22, 209 (1927); Kish's effective number.
    middle = (value + t**2 / (2 * number)) / (1 + t**2 / number)
    half_width = t / (1 + t**2 / number) * (value * (1 - value) / number + (t / (2 * number)) ** 2) ** 0.5
    low, high = max(middle - half_width, 0.0), min(middle + half_width, 1.0)
    # Rounding must not leave 0 or 1 outside where none or all are seen.
    return Estimate(value, min(low, value), max(high, value), rough.units)


def difference(
    left: pandas.DataFrame,
    right: pandas.DataFrame,
    column: str,
    statistic: Callable[[pandas.Series], float] = pandas.Series.mean,
) -> Estimate:
    """The difference left - right of a statistic of a column, by default the mean, paired by seed."""
    rows = [frame.dropna(subset=column) for frame in (left, right)]
    return jackknife(lambda left, right: statistic(left[column]) - statistic(right[column]), *rows)


def over_time(jobs: pandas.DataFrame, column: str = "mean_friction") -> float:
    """An average of jobs over the time of all of them."""
    return float((jobs[column] * jobs["averaged_time"]).sum() / jobs["averaged_time"].sum())


def friction_difference(left: pandas.DataFrame, right: pandas.DataFrame) -> Estimate:
    """The difference left - right of the mean friction of jobs, paired by seed."""
    rows = [frame.dropna(subset="mean_friction") for frame in (left, right)]
    return jackknife(lambda left, right: over_time(left) - over_time(right), *rows)


def bootstrap(statistic: Callable[[pandas.DataFrame], float], frame: pandas.DataFrame, unit: str) -> Estimate:
    """A statistic that is not smooth, such as a quantile: percentiles over units drawn with replacement."""
    rows = list(frame.groupby(unit).indices.values())
    generator = numpy.random.default_rng(2011)
    draws = [
        statistic(frame.take(numpy.concatenate([rows[one] for one in generator.integers(len(rows), size=len(rows))])))
        for _ in range(RESAMPLES)
    ]
    low, high = numpy.nanquantile(draws, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2])
    return Estimate(statistic(frame), float(low), float(high), len(rows))
