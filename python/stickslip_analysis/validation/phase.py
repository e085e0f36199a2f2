"""Statement 5, the phase against η, and the same with the experiment's drive."""

import math
from pathlib import Path

import numpy
import pandas
from scipy import optimize, stats

from ..statistics import bootstrap, jackknife, mean, rayleigh_p, resultant_length, share
from ..tables import Sweep
from .document import Section, Verdict


def minimum_phase(eta: float) -> float:
    """φ_min of Eq. 2 in rad, as an equality: the load equals its preceding maximum, on the rising branch. η > 1."""
    top = math.asin(1 / eta)
    maximum = top - 2 * math.pi + eta * math.cos(top)
    # The load rises from its minimum at -π - Φ_max to its maximum at Φ_max.
    return optimize.brentq(lambda phase: phase + eta * math.cos(phase) - maximum, -math.pi - top, top, xtol=1e-15)


def random_load_phases(eta: float, count: int = 300) -> numpy.ndarray:
    """Evenly likely phases in rad of slips at a random load among those that exceed all before. η > 1."""
    grid = numpy.linspace(minimum_phase(eta), math.asin(1 / eta), 4001)
    # The load grows along this range; its first and last rounding may not.
    load = numpy.maximum.accumulate(grid + eta * numpy.cos(grid))
    return numpy.interp((numpy.arange(count) + 0.5) / count, (load - load[0]) / (load[-1] - load[0]), grid)


def random_load_share(eta: float) -> float:
    """The share of intervals within 0.1 T of a whole number of periods between such slips, if independent."""
    phases = random_load_phases(eta)
    turns = numpy.subtract.outer(phases, phases) / (2 * math.pi)
    return float((abs(turns - turns.round()) < 0.1).mean())


def nucleation_phase(slips: pandas.DataFrame) -> pandas.Series:
    """The phase in rad of the first break of each slip."""
    return slips["phase"] + 2 * math.pi * (slips["nucleation"] - slips["onset"]) / slips["T_onset"]


def above_minimum(slips: pandas.DataFrame) -> pandas.Series:
    """How far the phase of each slip is above φ_min, in rad."""
    return slips["phase"] - slips["eta"].map({eta: minimum_phase(eta) for eta in slips["eta"].unique()})


def load_phase(slips: pandas.DataFrame) -> pandas.Series:
    """φ + η cos φ in rad, which grows in proportion to the load."""
    return slips["phase"] + slips["eta"] * numpy.cos(slips["phase"])


def phase(results: Path) -> Section:
    """Statement 5."""
    section = Section("5. The phase against η", "`sweeps/fig3.toml` (Fig. 3e)", "fig3-phase")
    sweep = Sweep(results / "fig3")
    sets = sweep.reduced("sets")
    slips = sweep.slips().dropna(subset="phase")
    low = slips[slips["eta"] < 0.7]
    angle = numpy.angle(numpy.exp(1j * low["phase"]).mean())
    section.check(
        "below η = 1 all phases are equally probable",
        "Rayleigh p > 0.01 for η < 0.7",
        f"p = {rayleigh_p(low['phase']):.1e}, resultant length {resultant_length(low['phase']):.3f} at {angle:.2f} rad,"
        f" {len(low)} slips",
        rayleigh_p(low["phase"]) > 0.01,
    )
    load_p = rayleigh_p(load_phase(low))
    section.check(
        '... "the loading force changes monotonically with time and harmonic oscillations do not influence" the slips',
        "the same for the load phase φ + η cos φ",
        f"p = {load_p:.3f}",
        load_p > 0.01,
    )
    section.remark(
        "The first does not hold, and cannot: slips that come at a random *load* have the density 1 − η sin φ in φ,"
        " since the load changes faster there.",
        "That is a resultant of η/2 at −π/2.",
        "In the load itself, slips of slow drives are uniform: there the modulation does not influence them, which is"
        " what the paper means.",
    )
    under_one = sets[(sets["eta"] > 0) & (sets["eta"] < 1)]
    locked = share(under_one["locked"], under_one["set_id"])
    section.check(
        "below η ≃ 1 no phase-locking is observed",
        "fewer than 0.05 of the sets with η < 1 locked"
        " (Rayleigh p < 0.001 by effective numbers, resultant length > 0.5)",
        f"{locked.text(2)} of {len(under_one)} sets",
        locked.high < 0.05,
    )
    for velocity, those in under_one.groupby("V0"):
        load = load_phase(slips[slips["set_id"].isin(those["set_id"])])
        section.rows.append(
            {
                "V0 (m/s)": f"{velocity:.2g}",
                "sets with η < 1": len(those),
                "of these locked": those["locked"].sum(),
                "resultant length of the load phase": f"{resultant_length(load):.3f}",
                "p, slips taken as independent": f"{rayleigh_p(load):.2g}",
            }
        )
    lengths = []
    for eta, rows in low.groupby(low["eta"].round(4)):
        length = jackknife(lambda rows: resultant_length(rows["phase"]), rows, unit="set_id")
        lengths.append(f"{length.text(2)} at η = {eta:.2f} (η/2 = {eta / 2:.2f})")
    section.remark(f"Resultant length of φ: {'; '.join(lengths)}.")
    those = under_one[under_one["locked"]]
    ratios = 1 / those["periods_mean"]
    section.remark(
        f"Of the {len(those)} locked sets below η = 1, {(those['V0'] >= 9e-5).sum()} have V0 of 1e-4 m/s or more;"
        f" over all of them T lies between {ratios.min():.2f} and {ratios.max():.2f} τ, {ratios.median():.2f} in the"
        " median.",
        "The paper asks only whether the load ever falls; why fast drives lock without that was not investigated.",
    )
    high = slips[slips["eta"] > 2]
    margin = above_minimum(high)
    under = share(margin < -0.15, high["set_id"])
    section.check(
        "almost no slip under the back-bone",
        "share of slips more than 0.15 rad under φ_min below 0.02, η > 2",
        f"{under.text(4)}; under φ_min itself {(margin < 0).mean():.4f}",
        under.high < 0.02,
    )
    early = high.assign(phase=nucleation_phase(high))
    shares = []
    for low, top in ((5, 30), (30, 200), (200, 1001)):
        rows = early[(early["eta"] >= low) & (early["eta"] < top)]
        shares.append(share(above_minimum(rows) < -0.15, rows["set_id"]))
    section.check(
        "... by the first break, since the onset is a largest load by definition",
        "the same share below 0.02 for η from 5 to 30, to 200, and above",
        "; ".join(one.text(4) for one in shares),
        max(one.high for one in shares) < 0.02,
    )
    beyond_kinematics(section, sets)
    section.check(*envelope(high))
    tops = jackknife(lambda rows: rows["phase"].mean(), high[high["eta"] > 300], unit="set_id")
    section.check(
        "φ saturates to zero for η ≫ 1",
        "mean φ within 0.1 rad of 0 for η > 300",
        f"{tops.text()} rad",
        abs(tops.low) < 0.1,
    )
    return section


def beyond_kinematics(section: Section, sets: pandas.DataFrame) -> None:
    """Adds how far phases are bunched beyond what slips at random loads show, by velocity; and the verdict."""
    locking = sets[(sets["eta"] > 1) & (sets["eta"] < 5)]
    excess = locking["resultant_length"] - locking["expected_resultant"]
    fast = locking["V0"] > 9e-5
    found = {name: mean(excess[those]) for name, those in (("slow", ~fast), ("fast", fast))}
    for name, velocity in (("slow", "below 1e-4 m/s"), ("fast", "1e-4 m/s and above")):
        section.check(
            f"above η = 1 slips lock to the modulation, V0 {velocity}",
            "resultant length of φ beyond that of slips at random loads by more than 0.05, 1 < η < 5",
            f"{found[name].text()} beyond; {locking['resultant_length'][fast == (name == 'fast')].mean():.3f} in the mean",
            found[name].low > 0.05,
        )
    section.verdict = Verdict(
        "holds; for slow drives it follows from kinematics",
        f"below 1e-4 m/s the phases are bunched as those of slips at random loads, {found['slow'].text()} beyond;"
        f" from 1e-4 m/s on {found['fast'].text()} beyond",
    )


def envelope(slips: pandas.DataFrame) -> tuple[str, str, str, bool]:
    """The check of the exponent of the lower envelope: the 2 % quantile of φ against η on logarithmic scales.

    From η = 5, where the exact φ_min has the asymptotic exponent to 0.02, to η = 200, above which inertia shifts φ by
    as much as φ_min.
    """
    slips = slips[(slips["eta"] > 5) & (slips["eta"] < 200)]
    slips = slips[["phase", "set_id"]].assign(eta=slips["eta"].round(6))

    def exponent(rows: pandas.DataFrame) -> float:
        quantiles = rows.groupby("eta")["phase"].quantile(0.02)
        return stats.linregress(numpy.log(quantiles.index), numpy.log(-quantiles)).slope

    fitted = bootstrap(exponent, slips, "set_id")
    etas = numpy.unique(slips["eta"])
    exact = stats.linregress(numpy.log(etas), numpy.log([-minimum_phase(eta) for eta in etas])).slope
    return (
        "φ ∝ −η^(−1/2)",
        "exponent of the lower envelope (2 % quantile, 5 < η < 200) within 0.1 of −1/2",
        f"{fitted.text()}; the exact φ_min over the same η gives {exact:.3f}".replace("-", "−"),
        abs(fitted.value + 0.5) < 0.1,
    )


def stiff_drive(results: Path) -> Section:
    """The phase against η with the experiment's stiffness of the drive."""
    section = Section(
        "The experiment's drive: K_d = 1e9 N/m", "`sweeps/stiff-drive.toml`, K_d Δ = 20 to 100 N", "stiff-drive-phase"
    )
    slips = Sweep(results / "stiff-drive").slips().dropna(subset="phase")
    high = slips[slips["eta"] > 2]
    under = share(above_minimum(high) < -0.15, high["set_id"])
    section.check(
        "(d) the experiment: almost no slip under the back-bone",
        "share of slips more than 0.15 rad under φ_min below 0.02, η > 2",
        under.text(4),
        under.high < 0.02,
    )
    section.check(*envelope(high))
    for low, high in ((0, 0.7), (1, 2), (2, 5), (5, 20), (20, 100), (100, 1001)):
        mine = slips[(slips["eta"] >= low) & (slips["eta"] < high)]
        if not mine.empty:
            lengths = mean(mine.groupby("set_id")["phase"].apply(resultant_length))
            section.rows.append(
                {
                    "η": f"{low} to {min(high, 1000)}",
                    "sets": lengths.units,
                    "resultant length of φ, mean over sets": lengths.text(2),
                }
            )
    return section
