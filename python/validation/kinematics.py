"""Eq. 2, and what phases show by kinematics alone: slips at a random load among those that exceed all before.

For η < 1 the load never falls and these are all loads; for η > 1 they lie between φ_min and Φ_max of each period.
"""

import math

import numpy
import pandas
from numpy.typing import ArrayLike

from stickslip._stickslip import minimum_phase
from stickslip.statistics import Estimate

#: Drive velocity in m/s below which drives are called slow: between two values of the sweep, 1e-5 and 5e-5.
SLOW = 3e-5
SOURCE = "`sweeps/fig3.toml` and `sweeps/locking-drive-alone.toml`"


def in_words(velocity: float) -> str:
    """As in 5e-5 m/s."""
    return f"{velocity:.0e} m/s".replace("e-0", "e-")


def load_window(eta: float) -> tuple[float, float]:
    """The phases in rad between which the load exceeds all before."""
    return (minimum_phase(eta), math.asin(1 / eta)) if eta > 1 else (-math.pi, math.pi)


def random_load_phases(eta: float, ranks: ArrayLike) -> numpy.ndarray:
    """Phases in rad of slips at these ranks, 0 to 1, among the loads that exceed all before."""
    grid = numpy.linspace(*load_window(eta), 4001)
    # The load grows along this range; its first and last rounding may not.
    load = numpy.maximum.accumulate(grid + eta * numpy.cos(grid))
    return numpy.interp(ranks, (load - load[0]) / (load[-1] - load[0]), grid)


def load_phase(slips: pandas.DataFrame) -> pandas.Series:
    """φ + η cos φ in rad, which grows in proportion to the load."""
    return slips["phase"] + slips["eta"] * numpy.cos(slips["phase"])


def mean_excess(sets: pandas.DataFrame, column: str) -> Estimate:
    """The mean excess of sets over what the drive alone gives, with the means of the ends of their intervals.

    Sets have seeds in common, so these ends hold even if all sets err alike.
    """
    ends = [f"{column}_excess{end}" for end in ("", "_low", "_high")]
    return Estimate(*sets[ends].dropna().mean(), len(sets))


def excess_text(sets: pandas.DataFrame, column: str) -> str:
    """The same, and the lowest and highest end of the interval of any set."""
    low, high = sets[f"{column}_excess_low"].min(), sets[f"{column}_excess_high"].max()
    return f"{mean_excess(sets, column).text(2)}; {low:.2f} to {high:.2f}".replace("-", "−")


def bounds_text(sets: pandas.DataFrame, column: str) -> str:
    """The greatest excess of sets with slow drives, of either sign."""
    sets = sets[sets["V0"] < SLOW]
    mean = mean_excess(sets, column)
    each = sets[[f"{column}_excess_low", f"{column}_excess_high"]].abs().max(axis=None)
    return f"at most {max(-mean.low, mean.high):.2f} in the mean over sets, {each:.2f} in each"


def nucleation_phase(slips: pandas.DataFrame) -> pandas.Series:
    """The phase in rad of the first break of each slip, against the same maximum as that of its onset."""
    return slips["phase"] + 2 * math.pi * (slips["nucleation"] - slips["onset"]) / slips["T_onset"]


def under_minimum(phases: pandas.Series, eta: pandas.Series, tolerance: float = 0.0) -> pandas.Series:
    """Whether phases in rad, modulo 2π, are off the window of loads above all before by a tolerance or more. η > 1."""
    windows = {one: load_window(one) for one in eta.unique()}
    low, high = (eta.map({one: window[end] for one, window in windows.items()}) for end in (0, 1))
    end = high + tolerance
    return (phases - end) % (2 * math.pi) + end - 2 * math.pi < low - tolerance
