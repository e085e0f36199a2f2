"""Estimates with 95 % intervals. Jobs of different seeds are independent, slips within a job are not: so seeds are what is
left out (jackknife) or drawn again (bootstrap)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy
import pandas
from scipy import stats

from .. import compare_sets

LEVEL = 0.95
ROUNDS = 400


@dataclass(frozen=True)
class Estimate:
    """A value and the ends of its 95 % interval; a half-width of zero where nothing was sampled."""

    value: float
    low: float
    high: float

    def text(self, digits: int = 3, factor: float = 1.0) -> str:
        """Value and interval with `digits` decimals, in units of 1/`factor`."""
        value, low, high = (f"{factor * x:.{digits}f}".replace("-", "−") for x in (self.value, self.low, self.high))
        return value if low == high else f"{value} ({low} to {high})"


def jackknife(frame: pandas.DataFrame, of: Callable[[pandas.DataFrame], float], unit: str = "seed") -> Estimate:
    """A smooth statistic of all rows, with Student's t over estimates that leave out one `unit` each (Efron 1982)."""
    units = frame[unit].unique()
    return _spread(of(frame), numpy.array([of(frame[frame[unit] != one]) for one in units]))


def _spread(value: float, left_out: numpy.ndarray) -> Estimate:
    count = len(left_out)
    error = numpy.sqrt((count - 1) / count * ((left_out - left_out.mean()) ** 2).sum())
    reach = stats.t.ppf(0.5 + LEVEL / 2, count - 1) * error
    return Estimate(value, value - reach, value + reach)


def share(flags: pandas.Series, units: pandas.Series) -> Estimate:
    """The share of rows with a flag: the jackknife over units, in closed form."""
    sums = flags.astype(float).groupby(units.to_numpy()).agg(["sum", "size"])
    whole = sums.sum()
    left_out = (whole["sum"] - sums["sum"]) / (whole["size"] - sums["size"])
    return _spread(whole["sum"] / whole["size"], left_out.to_numpy())


def mean(values: pandas.Series) -> Estimate:
    """The mean of independent values."""
    values = values.dropna()
    reach = stats.t.ppf(0.5 + LEVEL / 2, len(values) - 1) * stats.sem(values)
    return Estimate(values.mean(), values.mean() - reach, values.mean() + reach)


def bootstrap(frame: pandas.DataFrame, of: Callable[[pandas.DataFrame], float], unit: str) -> Estimate:
    """A statistic that is not smooth, such as a quantile: percentiles over units drawn with replacement."""
    places = list(frame.groupby(unit).indices.values())
    generator = numpy.random.default_rng(2011)
    draws = [
        of(frame.take(numpy.concatenate([places[one] for one in generator.integers(len(places), size=len(places))])))
        for _ in range(ROUNDS)
    ]
    low, high = numpy.nanquantile(draws, [0.5 - LEVEL / 2, 0.5 + LEVEL / 2])
    return Estimate(of(frame), low, high)


def paired(left: pandas.DataFrame, right: pandas.DataFrame, column: str) -> Estimate:
    """The difference left - right of the mean of a column, seed by seed."""
    found = compare_sets.paired(left, right, column, LEVEL)
    return Estimate(found.difference, found.low, found.high)


def locking_index(periods: pandas.Series) -> float:
    """|<exp(2πi τ/T)>| of intervals in periods: 1 if all are whole numbers."""
    return float(abs(numpy.exp(2j * numpy.pi * periods.dropna()).mean()))


def near_whole(periods: pandas.Series) -> pandas.Series:
    """Whether intervals are within a tenth of a period of a whole number; a fifth are if they come anyhow."""
    return (periods - periods.round()).abs() < 0.1
