"""Claims of the literature on other sliders, put to this one: each a sweep, and criteria that can fail."""

import math
from pathlib import Path

import numpy
import pandas
from matplotlib import rc_context
from matplotlib.figure import Figure
from scipy.optimize import isotonic_regression

from stickslip import figures
from stickslip.statistics import Estimate, bootstrap
from stickslip.tables import Sweep

from .document import Section
from .kinematics import random_load_phases

#: Frequency in Hz from which correlation depends on the amplitude alone in the laboratory; R that says nothing more.
HIGH, SATURATED = 80, 0.95
#: Share of the friction without modulation at which a slider counts as weakened.
WEAKENED = 0.8
RANKS = (numpy.arange(4000) + 0.5) / 4000


def at_random(eta: float) -> float:
    """R of slips at random loads."""
    return abs(numpy.exp(1j * random_load_phases(eta, RANKS)).mean())


def rms(values: pandas.Series) -> float:
    return math.sqrt((values**2).mean())


def off_others(sets: pandas.DataFrame, column: str) -> pandas.Series:
    """R of each set less the mean of the others with the same value of a column."""
    own = sets["resultant_length"]
    groups = own.groupby(sets[column].round(12))
    return own - (groups.transform("sum") - own) / (groups.transform("size") - 1)


def correlation(results: Path) -> Section:
    title = "Correlation with the load is a function of η"
    section = Section(title, "`sweeps/correlation.toml`", ("correlation",))
    sets = Sweep(results / "correlation").sets()
    sets = sets[sets["resultant_length"].notna()]
    sets = sets.assign(off=sets["resultant_length"] - sets["eta"].map(at_random))
    off = {"η": sets["off"], "f": off_others(sets, "frequency"), "Δ": off_others(sets, "Delta")}
    curve, *others = (
        bootstrap(lambda frame: rms(frame["off"]), sets.assign(off=values), "set_id") for values in off.values()
    )
    section.check(
        "of nothing else",
        "rms of R about that of random loads, nothing fitted, below that about the mean of other sets of a frequency or"
        " amplitude",
        f"{curve.text(3)}; {others[0].text(2)}, {others[1].text(2)}",
        *(curve.high < other.low for other in others),
    )
    ends = [f"resultant_excess{end}" for end in ("", "_low", "_high")]
    excesses = [Estimate(*map(float, one), units=sets["jobs"].min()).among(len(sets)) for one in sets[ends].to_numpy()]
    beyond = pandas.Series([abs(one.value) for one in excesses if one.low > 0 or one.high < 0], dtype=float)
    section.check(
        "the drive alone makes it",
        "no R is significantly off the drive's (Bonferroni) by 0.05 or more",
        f"{len(beyond)} of {len(sets)} are off at all" + (f", by {beyond.max():.4f} at most" if len(beyond) else ""),
        not (beyond > 0.05).any(),
    )
    high = sets[sets["frequency"] > HIGH]["resultant_length"].groupby(sets["Delta"].round(12))
    spans = (high.max() - high.min())[high.min() < SATURATED]
    section.check(
        "amplitude alone at high frequency, as in Savage and Marone (2007)",
        f"R of an amplitude is the same to 0.05 above {HIGH} Hz, where it is below {SATURATED} at some",
        f"it spans {', '.join(f'{span:.3f} at {1e6 * amplitude:g} µm' for amplitude, span in spans.items())}",
        *(bool(span < 0.05) for span in spans),
    )
    low, top = sets[sets["eta"] < 1].query("has_phase"), sets[sets["eta"] > 100]
    section.check(
        "failure at the peak of the rate at low frequency, later at high",
        "mean phase within 0.3 rad of −π/2 for η < 1 and of 0 for η > 100",
        f"{low['phase_mean'].mean():.2f} rad, {top['phase_mean'].mean():.2f} rad".replace("-", "−"),
        abs(low["phase_mean"].mean() + math.pi / 2) < 0.3,
        abs(top["phase_mean"].mean()) < 0.3,
    )
    rejected = sets["schuster_log10_p"] < -5
    section.remark(
        f"Schuster's test rejects random times with p < 1e-5 in {rejected.sum()} of {len(sets)} sets, down to"
        f" 1e{sets['schuster_log10_p'].min():.0f}.",
        "Contacts of the model do not age, as those of a laboratory fault do.",
    )
    return section


def thresholds(jobs: pandas.DataFrame) -> pandas.Series:
    """By frequency in Hz, the amplitude in m at which the friction has fallen to `WEAKENED`, from an isotonic curve."""
    impulses = jobs.assign(impulse=jobs["mean_friction"] * jobs["averaged_time"])
    sums = impulses.groupby(["frequency", "Delta"])[["impulse", "averaged_time"]].sum()
    means = sums["impulse"] / sums["averaged_time"]
    still = means.xs(0.0, level="frequency").iloc[0]
    found = {}
    for frequency, curve in means.drop(0.0, level="frequency").groupby(level="frequency"):
        ratio = isotonic_regression(curve.to_numpy() / still, increasing=False).x
        amplitudes = numpy.log(curve.index.get_level_values("Delta"))
        found[frequency] = math.exp(numpy.interp(WEAKENED, ratio[::-1], amplitudes[::-1]))
    return pandas.Series(found)


def slope(jobs: pandas.DataFrame) -> float:
    """Of the threshold against frequency, both as logarithms."""
    found = thresholds(jobs)
    return float(numpy.polyfit(numpy.log(found.index), numpy.log(found), 1)[0])


def draw_thresholds(amplitudes: dict[float, Estimate], picture: Path) -> list[float]:
    """Draws amplitudes by frequency as displacement, velocity and acceleration, each over its geometric mean.

    What sets the weakening would be a level line. Returns the factors that the three span.
    """
    factors = []
    with rc_context(figures.STYLE):
        drawn = Figure(figsize=figures.SIZE)
        axes = drawn.subplots()
        axes.axhline(1, color="0.6", linewidth=0.8)
        kinds = ("displacement Δ", "velocity 2π f Δ", "acceleration (2π f)² Δ")
        for power, (kind, colour, marker) in enumerate(zip(kinds, figures.COLOURS, "osD", strict=False)):
            scaled = [amplitude.scaled(frequency**power) for frequency, amplitude in amplitudes.items()]
            mean = numpy.exp(numpy.mean([math.log(one.value) for one in scaled]))
            values, lows, highs = numpy.array([(one.value, one.low, one.high) for one in scaled]).T / mean
            bars = [values - lows, highs - values]
            axes.errorbar(list(amplitudes), values, bars, color=colour, marker=marker, markersize=4, capsize=3, label=kind)
            factors.append(max(values) / min(values))
        axes.set(xscale="log", yscale="log", xlabel="Modulation frequency $f$ (Hz)")
        axes.set_ylabel("Threshold over its geometric mean")
        axes.minorticks_off()
        axes.set_xticks(list(amplitudes), [f"{frequency:g}" for frequency in amplitudes])
        axes.yaxis.set_major_formatter("{x:g}")
        axes.legend(loc="upper left", title=f"Where friction falls by {100 * (1 - WEAKENED):.0f} %, 95 %:")
        drawn.savefig(picture, dpi=200)
    return factors


def weakening(results: Path) -> Section:
    title = "A displacement sets the weakening by vibration"
    section = Section(title, "`sweeps/weakening.toml`", ("weakening-threshold", "weakening", "weakening-velocity"))
    jobs = Sweep(results / "weakening").table("jobs")
    jobs = jobs.assign(frequency=(1 / jobs["T"]).fillna(0.0).round(6))
    found = thresholds(jobs)
    exponent = bootstrap(slope, jobs, "seed")
    section.check(
        "neither a velocity nor an acceleration",
        "slope of the amplitude at which friction has fallen by 20 % against frequency (logarithms): its interval excludes"
        " −1 (a velocity, as in Lastakowski et al., 2015) and −2 (an acceleration)",
        exponent.text(2),
        *(not exponent.low <= power <= exponent.high for power in (-1, -2)),
    )
    each = {at: bootstrap(lambda frame, at=at: 1e6 * thresholds(frame)[at], jobs, "seed") for at in found.index}
    spans = draw_thresholds(each, results / "weakening-threshold.png")
    microns = ", ".join(f"{one.text(2)} µm at {frequency:.0f} Hz" for frequency, one in each.items())
    section.remark(
        f"The amplitudes are {microns}; they span a factor of {spans[0]:.1f}, as velocities {spans[1]:.1f}, as"
        f" accelerations {spans[2]:.0f}.",
        "The model is loaded at its edge alone, by the force K_d Δ.",
    )
    return section
