"""Statements 5 and 11, the phase against η above and below 1, and the same with the experiment's drive."""

from pathlib import Path

import numpy
import pandas
from scipy import stats

from stickslip.statistics import Estimate, bootstrap, jackknife, resultant_length, share
from stickslip.tables import Sweep

from .document import Section
from .kinematics import (
    SOURCE,
    bounds_text,
    in_words,
    load_phase,
    mean_excess,
    minimum_phase,
    nucleation_phase,
    random_load_phases,
    under_minimum,
)

#: Part of the slips below what is called the lower envelope of their phases.
ENVELOPE = 0.02


def phase(results: Path) -> Section:
    section = Section("5. The phase against η, above η = 1", SOURCE, ("fig3-phase", "drive-alone"))
    slips = Sweep(results / "fig3").slips().dropna(subset="phase")
    slips = slips[slips["eta"] > 1].assign(eta=slips["eta"].round(6))
    slips = slips.assign(first=nucleation_phase(slips))
    high = slips[slips["eta"] > 2]
    under = first_breaks(
        section, high, "fewer than 0.02 of first breaks (modulo 2π) more than 0.15 rad below φ_min, for η > 2"
    )
    sets = Sweep(results / "locking-drive-alone").sets()
    above = sets[sets["eta"] > 1]
    seen = share(above["resultant_length_low"] > 0.5, above.index)
    section.check(
        "slips lock, as seen",
        "R above 0.5 with its interval in more than 0.9 of the sets",
        f"{seen.text(2)} of {len(above)} sets",
        seen.lies(above=0.9),
    )
    section.check(
        "the backbone is φ_min of Eq. 2",
        "lower envelope of onsets (2 % quantile) within 15 % of φ_min, up to η = 100",
        *follows_minimum(slips[slips["eta"] < 100]),
    )
    section.check(*envelope(high))
    least = slips["eta"].min()
    start = bootstrap(lambda rows: rows["phase"].quantile(ENVELOPE), slips[slips["eta"] == least], "set_id")
    chance = float(random_load_phases(least, ENVELOPE))
    section.check(
        "slips appear with a phase of −π for small η",
        "lower envelope at the least η > 1 within 0.5 rad of −π",
        f"{start.text(2)} rad at η = {least:.2f}; random loads {chance:.2f} rad".replace("-", "−"),
        start.lies(above=-numpy.pi - 0.5, below=0.5 - numpy.pi),
    )
    last = high[high["eta"] > 300]
    top = jackknife(lambda rows: direction(rows["phase"]), last, unit="set_id")
    ends = [minimum_phase(last["eta"].min()), minimum_phase(last["eta"].max())]
    section.check(
        "φ saturates to zero for η ≫ 1",
        "mean phase of onsets within 0.15 rad of 0 for η > 300",
        f"{top.text()} rad; φ_min {ends[0]:.2f} to {ends[1]:.2f} rad".replace("-", "−"),
        top.lies(above=-0.15, below=0.15),
    )
    section.remark(
        "An onset is a largest load by definition, so only inertia can put it more than 0.15 rad below φ_min:"
        f" {under_minimum(high['phase'], high['eta'], 0.15).mean():.4f} of them.",
    )
    section.note = "; for slow drives the drive alone makes it so"
    section.why = (
        f"{under[1].value:.2f} of first breaks lie below φ_min where T < τ_r;"
        f" up to 1e-5 m/s the excess of R is {bounds_text(above, 'resultant')}"
    )
    return section


def follows_minimum(slips: pandas.DataFrame) -> tuple[str, bool]:
    """The lower envelope of the phases in units of φ_min, over η."""
    ratios = [rows["phase"].quantile(ENVELOPE) / minimum_phase(eta) for eta, rows in slips.groupby("eta")]
    return f"{min(ratios):.2f} to {max(ratios):.2f} of φ_min", min(ratios) > 0.85 and max(ratios) < 1.15


def direction(phases: pandas.Series) -> float:
    """The circular mean of phases in rad."""
    return float(numpy.angle(numpy.exp(1j * numpy.asarray(phases)).mean()))


def first_breaks(section: Section, slips: pandas.DataFrame, criterion: str) -> list[Estimate]:
    """Adds the shares of slips under the backbone by their first break, for periods longer and shorter than τ_r."""
    is_long = slips["T"] > slips["tau_r"]
    under = under_minimum(slips["first"], slips["eta"], 0.15)
    found = [share(under[those], slips["set_id"][those]) for those in (is_long, ~is_long)]
    section.check(
        "almost no slip below the backbone",
        criterion,
        f"{found[0].text(4)} of {is_long.sum()} where T > τ_r, {found[1].text(4)} of {(~is_long).sum()} where T < τ_r",
        *(share.lies(below=0.02) for share in found),
    )
    return found


def envelope(slips: pandas.DataFrame) -> tuple[str, str, str, bool | None]:
    """The check of the exponent of the lower envelope: the 2 % quantile of a phase against η on logarithmic scales.

    It is that of the first breaks up to the onset, as onsets follow φ_min by definition. From η = 5, where the exact
    φ_min has the asymptotic exponent to 0.02, to η = 200, above which inertia shifts φ by as much as φ_min.
    """
    slips = slips[(slips["eta"] > 5) & (slips["eta"] < 200)].assign(eta=slips["eta"].round(6))

    def exponent(rows: pandas.DataFrame, column: str) -> float:
        quantiles = rows.groupby("eta")[column].quantile(ENVELOPE)
        return stats.linregress(numpy.log(quantiles.index), numpy.log(-quantiles)).slope

    early = slips[slips["first"] <= slips["phase"]]
    fitted = bootstrap(lambda rows: exponent(rows, "first"), early, "set_id")
    etas = numpy.unique(slips["eta"])
    exact = stats.linregress(numpy.log(etas), numpy.log([-minimum_phase(eta) for eta in etas])).slope
    return (
        "φ ∝ −η^(−1/2)",
        "exponent of the lower envelope of first breaks up to the onset (5 < η < 200) within 0.1 of −1/2",
        f"{fitted.text()}; exact φ_min {exact:.3f}, onsets {exponent(slips, 'phase'):.3f}".replace("-", "−"),
        fitted.lies(above=-0.6, below=-0.4),
    )


def influence(slips: pandas.DataFrame) -> dict[float, Estimate]:
    """By V0, how far the mean vector of load phases at η < 1 is off the drive's alone: root mean square over sets.

    Its direction differs from set to set, so that vectors of sets are not added up. The square is that of pairs of
    different seeds, whose errors are independent: it is not too large by chance, and may be negative.
    """
    still = slips[slips["Delta"] == 0]
    found = []
    for (velocity, period, eta), seen in slips[(slips["eta"] > 0) & (slips["eta"] < 1)].groupby(["V0", "T", "eta"]):
        control = still[still["V0"] == velocity]
        # The load never falls, and the drive alone slips where it reaches that of the control.
        phases = load_phase(seen), 2 * numpy.pi * control["onset"] / period + eta
        of_seeds = [numpy.exp(1j * phase).groupby(rows["seed"]).mean() for phase, rows in zip(phases, (seen, control))]
        found.append((of_seeds[0] - of_seeds[1]).rename("vector").reset_index().assign(V0=velocity, T=period))

    def square(rows: pandas.DataFrame) -> float:
        sums = rows.assign(square=rows["vector"].abs() ** 2).groupby("T").agg({"vector": ["sum", "count"], "square": "sum"})
        count = sums["vector", "count"]
        return ((sums["vector", "sum"].abs() ** 2 - sums["square", "sum"]) / (count * (count - 1))).mean()

    return {velocity: jackknife(square, rows).root() for velocity, rows in pandas.concat(found).groupby("V0")}


def below_one(results: Path) -> Section:
    section = Section("11. No phase-locking below η ≃ 1", SOURCE)
    sweep = Sweep(results / "locking-drive-alone")
    sets = sweep.sets()
    off = influence(sweep.table("slips"))
    texts = ", ".join(f"{one.text(2)} at {in_words(velocity)}" for velocity, one in off.items())
    # Undecided if it may be zero, but also large.
    absent = {velocity: False if one.low > 0 else one.lies(below=0.1) for velocity, one in off.items()}
    section.check(
        "oscillations have no influence",
        "rms over sets of the excess of the mean vector of the load phase: interval from 0 to below 0.1",
        texts,
        *absent.values(),
    )
    for velocity, mine in sets.groupby("V0"):
        section.rows.append(
            {
                "V0": in_words(velocity),
                "excess of R, η < 1": mean_excess(mine[mine["eta"] < 1], "resultant").text(2),
                "excess of R, η > 1": mean_excess(mine[mine["eta"] > 1], "resultant").text(2),
                "excess of the locking index, η > 1": mean_excess(mine[mine["eta"] > 1], "locking_index").text(2),
            }
        )
    slips = Sweep(results / "fig3").slips().dropna(subset="phase")
    low = slips[slips["eta"] < 0.7]
    phases = jackknife(lambda rows: resultant_length(rows["phase"]), low, unit="set_id")
    section.remark(
        "The table has means over sets, with intervals as if all sets erred alike.",
        "Below η = 1 phases of random loads have an R of η/2 at −π/2, so the criterion is on the load phase."
        f" For η < 0.7 R is {phases.text()} at {direction(low['phase']):.2f} rad; the mean of η/2 is"
        f" {low['eta'].mean() / 2:.3f}.".replace(" -", " −"),
    )
    if any(absent.values()):
        section.verdict = f"holds for V0 up to {in_words(max(v for v in absent if absent[v]))}"
    return section


def stiff_drive(results: Path) -> Section:
    section = Section(
        "The experiment's drive: K_d = 1e9 N/m",
        "`sweeps/locking-stiff-drive.toml`, K_d Δ = 20 to 100 N",
        ("stiff-drive-phase",),
    )
    slips = Sweep(results / "locking-stiff-drive").slips().dropna(subset="phase")
    high = slips[slips["eta"] > 2]
    high = high.assign(first=nucleation_phase(high))
    under = first_breaks(section, high, "as in statement 5")
    claim, _, *found = envelope(high)
    section.check(claim, "as in statement 5", *found)
    section.why = f"{under[1].value:.2f} of first breaks lie below φ_min where T < τ_r"
    return section
