"""Eq. 2, and what phases show by kinematics alone: slips at a random load among those that exceed all before.

For η < 1 the load never falls and these are all loads; for η > 1 they lie between φ_min and Φ_max of each period.
"""

import math
from functools import cache

import numpy
import pandas
from numpy.typing import ArrayLike

from stickslip._stickslip import minimum_phase
from stickslip.statistics import rayleigh_p_of, resultant_length

#: A set is locked if its Rayleigh p is below the one and its resultant length above the other (docs/model.md).
LOCKED_P, LOCKED_LENGTH = 0.001, 0.5


def load_window(eta: float) -> tuple[float, float]:
    """The phases in rad between which the load exceeds all before."""
    return (minimum_phase(eta), math.asin(1 / eta)) if eta > 1 else (-math.pi, math.pi)


def random_load_phases(eta: float, ranks: ArrayLike) -> numpy.ndarray:
    """Phases in rad of slips at these ranks, 0 to 1, among the loads that exceed all before."""
    grid = numpy.linspace(*load_window(eta), 4001)
    # The load grows along this range; its first and last rounding may not.
    load = numpy.maximum.accumulate(grid + eta * numpy.cos(grid))
    return numpy.interp(ranks, (load - load[0]) / (load[-1] - load[0]), grid)


def random_load_share(eta: float) -> float:
    """The share of intervals within 0.1 T of a whole number of periods between such slips, if independent."""
    phases = random_load_phases(eta, (numpy.arange(300) + 0.5) / 300)
    turns = numpy.subtract.outer(phases, phases) / (2 * math.pi)
    return float((abs(turns - turns.round()) < 0.1).mean())


@cache
def locked_by_chance(eta: float, slips: int, draws: int) -> tuple[float, float]:
    """The share of ``draws`` sets of ``slips`` such slips, drawn independently, that count as locked; mean locking index."""
    phases = random_load_phases(eta, numpy.random.default_rng(2011).random((draws, slips)))
    lengths = abs(numpy.exp(1j * phases).mean(axis=1))
    locked = (rayleigh_p_of(slips, lengths) < LOCKED_P) & (lengths > LOCKED_LENGTH)
    indices = abs(numpy.exp(1j * numpy.diff(phases)).mean(axis=1))
    return float(locked.mean()), float(indices.mean())


def load_phase(slips: pandas.DataFrame) -> pandas.Series:
    """φ + η cos φ in rad, which grows in proportion to the load."""
    return slips["phase"] + slips["eta"] * numpy.cos(slips["phase"])


def locked_in_load(sets: pandas.DataFrame, slips: pandas.DataFrame) -> pandas.Series:
    """Whether sets with η < 1 are locked by their load phases, in which slips at random loads are uniform."""
    lengths = load_phase(slips).groupby(slips["set_id"]).apply(resultant_length)
    return (sets["load_rayleigh_p"] < LOCKED_P) & (sets["set_id"].map(lengths) > LOCKED_LENGTH)


def nucleation_phase(slips: pandas.DataFrame) -> pandas.Series:
    """The phase in rad of the first break of each slip, against the same maximum as that of its onset."""
    return slips["phase"] + 2 * math.pi * (slips["nucleation"] - slips["onset"]) / slips["T_onset"]


def under_minimum(phases: pandas.Series, eta: pandas.Series, tolerance: float = 0.0) -> pandas.Series:
    """Whether phases in rad, modulo 2π, are off the window of loads above all before by a tolerance or more. η > 1."""
    windows = {one: load_window(one) for one in eta.unique()}
    low, high = (eta.map({one: window[end] for one, window in windows.items()}) for end in (0, 1))
    end = high + tolerance
    return (phases - end) % (2 * math.pi) + end - 2 * math.pi < low - tolerance
