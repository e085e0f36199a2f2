"""Circular statistics, and estimates with 95 % confidence intervals.

Jobs of different seeds are independent, slips of one job are not. So the units that are left out (jackknife) or drawn
again (bootstrap) are seeds or parameter sets, never slips.
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

    def excludes_zero(self) -> bool:
        """Whether the interval lies on one side of zero."""
        return self.low > 0 or self.high < 0

    def scaled(self, factor: float) -> "Estimate":
        return Estimate(factor * self.value, factor * self.low, factor * self.high, self.units)

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


def share(flags: pandas.Series, units: pandas.Series) -> Estimate:
    """The share of rows with a flag, by the jackknife over the unit of each row."""
    frame = pandas.DataFrame({"flag": flags.to_numpy(dtype=float), "unit": units.to_numpy()})
    return jackknife(lambda rows: rows["flag"].mean(), frame, unit="unit")


def proportion(flags: pandas.Series) -> Estimate:
    """The share of independent units with a flag, by the exact binomial interval, also where none or all have it."""
    ends = stats.binomtest(int(flags.sum()), len(flags)).proportion_ci(LEVEL)
    return Estimate(float(flags.mean()), float(ends.low), float(ends.high), len(flags))


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
