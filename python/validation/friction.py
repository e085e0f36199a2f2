"""Statements 6 to 8 and 12: mean friction, slow fronts, the loading profile and what it makes of a modulation."""

import math
from pathlib import Path

import numpy
import pandas
from scipy import stats

from stickslip.statistics import friction_difference, jackknife, over_time, share
from stickslip.tables import Sweep, parameters, read, select

from .document import Section
from .intervals import LARGE, without_modulation
from .kinematics import in_words, under_minimum

#: Frequencies in Hz at which friction is compared.
FREQUENCIES = (29, 58, 200)
#: A slow front: this many small precursors within this time before a slip, in s, spread over more than a fifth of it.
FRONT_STEPS, FRONT_TIME = 3, 0.05


def friction(results: Path) -> Section:
    section = Section(
        "6. Small perturbations do not change the mean friction",
        "`sweeps/friction.toml` and `sweeps/friction-drives.toml`",
        ("friction",),
    )
    sweep = Sweep(results / "friction")
    jobs, slips = sweep.table("jobs"), sweep.slips()
    still, still_slips = select(jobs, Delta=0.0), select(slips, Delta=0.0)
    peak, stiffness, reference = still_slips["peak_force"].mean(), still["Kd"].iloc[0], over_time(still)
    curves = {f: [] for f in FREQUENCIES}
    for amplitude in sorted(set(jobs["Delta"]) - {0.0}):
        for f, curve in curves.items():
            change = friction_difference(select(jobs, Delta=amplitude, T=1 / f), still)
            curve.append((stiffness * amplitude / peak, 100 * change.value / reference))
    tenth = {f: first_below(curve, -10) for f, curve in curves.items()}
    at_velocities(section, Sweep(results / "friction-drives"))
    waits, free = (1e3 * rows["interval"].mean() for rows in (select(slips, Delta=6e-7, T=1 / 29), still_slips))
    weakest, strongest = (
        f"from {tenth[f]:.2f} at {f} Hz" for f in (min(tenth, key=tenth.get), max(tenth, key=tenth.get))
    )
    section.remark(
        f"In the control the mean peak force F_m is {peak:.1f} N, the mean friction {reference:.1f} N.",
        "Weak modulation can raise it, as slips wait for a maximum of the load:"
        f" {waits:.0f} ms at 29 Hz and ΔF/F_m = {stiffness * 6e-7 / peak:.2f}, instead of {free:.0f} ms.",
        f"Strong modulation lowers it by 10 % {weakest} and {strongest}.",
    )
    return section


def at_velocities(section: Section, sweep: Sweep) -> None:
    """Adds the checks, each over eight frequencies, for either drive velocity; and the verdict."""
    sets = sweep.reduced("sets")
    changed, singles, thresholds, strongest, negligible, reduced = [], [], [], [], [], []
    for velocity, rows in sets.groupby("V0"):
        still = select(rows, Delta=0.0).iloc[0]
        rows = rows[rows["Delta"] > 0]
        ratio = (rows["Kd"] * rows["Delta"] / still["peak_force_mean"]).round(3)
        changes = (100 * (rows["mean_friction"] / still["mean_friction"] - 1)).groupby(ratio).describe()
        small = changes[(changes.index > 0.04) & (changes.index < 0.11)]
        least, most = small["50%"].min(), small["50%"].max()
        threshold = first_below(list(changes["50%"].items()), -20)
        changed.append(f"{least:.0f} to {most:.0f} %".replace("-", "−") + f" at {in_words(velocity)}")
        singles.append(f"{small['min'].min():.1f} to {small['max'].max():.1f} %".replace("-", "−"))
        thresholds.append(f"{threshold:.2f}")
        strongest.append(f"{changes['50%'].iloc[-1]:.0f} %".replace("-", "−"))
        negligible.append(max(abs(least), abs(most)) < 10)
        reduced.append(0.2 <= threshold <= 0.3)
    section.check(
        "negligible effect of small perturbations",
        "median change over eight frequencies below 10 % for ΔF/F_m from 0.05 to 0.1, as in Fig. 3",
        f"{', '.join(changed)}; at single frequencies {', '.join(singles)}",
        *negligible,
    )
    section.check(
        "significant reduction from 0.2 to 0.3 on",
        "median change reaches 20 % between these",
        f"at {', '.join(thresholds)}; {', '.join(strongest)} at 0.5",
        *reduced,
    )
    section.verdict = f"holds for V0 = {in_words(sets['V0'].max())}"


def first_below(curve: list[tuple[float, float]], level: float) -> float:
    """Where a curve of points (x, y) falls below a level for good, by linear interpolation."""
    last = max(index for index, (_, y) in enumerate(curve) if y > level)
    (x, y), (next_x, next_y) = curve[last : last + 2]
    return x + (next_x - x) * (y - level) / (y - next_y)


def slow_fronts(results: Path) -> Section:
    section = Section(
        "7. Modulation removes the slow fronts",
        "`sweeps/fig4.toml`; four values are those at 29, 58, 116 and 200 Hz",
        ("fig4d",),
    )
    sweep = Sweep(results / "fig4")
    of_slip = ["job_id", "slip"]
    slips = sweep.slips().set_index(of_slip)
    precursors = sweep.table("precursors").join(slips["nucleation"], on=of_slip, rsuffix="_of_slip")
    precursors = precursors.assign(
        before=precursors["nucleation_of_slip"] - precursors["nucleation"],
        last=precursors["nucleation"] + precursors["duration"],
    )
    is_large = precursors["size"] >= LARGE
    large = precursors[is_large]
    small = precursors[~is_large & (precursors["before"] < FRONT_TIME)].groupby(of_slip)["before"]
    is_front = (small.size() >= FRONT_STEPS) & (small.max() - small.min() > FRONT_TIME / 5)
    slips = slips.assign(
        slow=is_front.reindex(slips.index, fill_value=False),
        fast=(large.groupby(of_slip).size() > 0).reindex(slips.index, fill_value=False),
    ).reset_index()
    slow, fast = {}, {}
    for frequency in (None, 29, 58, 116, 200):
        mine = select(slips, Delta=1e-6, frequency=frequency) if frequency else select(slips, Delta=0.0)
        slow[frequency], fast[frequency] = (share(mine[column], mine["seed"]) for column in ("slow", "fast"))
    unmodulated = slow.pop(None)
    section.check(
        "",
        "fewer than half as many slips have a slow front as in the control",
        f"{', '.join(one.text(2) for one in slow.values())}; control {unmodulated.text(2)}",
        *(one.high < 0.5 * unmodulated.low for one in slow.values()),
    )
    section.check(
        "but fast rupture, 58 Hz",
        f"more slips with a precursor of {LARGE} breaks",
        f"{fast[58].text(2)}; control {fast[None].text(2)}",
        fast[58].low > fast[None].high,
    )
    section.remark(
        f"A *slow front* is {FRONT_STEPS} or more precursors of fewer than {LARGE} breaks over more than"
        f" {1e3 * FRONT_TIME / 5:.0f} ms, within {1e3 * FRONT_TIME:.0f} ms before a slip; the cut was chosen on other seeds."
    )
    still = select(slips, Delta=0.0)
    slow_speed, fast_speed = (still[column].median() for column in ("slow_front_speed", "front_speed"))
    section.check(
        "slow fronts are two orders of magnitude slower",
        "ratio of median speeds in the control from 30 to 300",
        f"{slow_speed:.1f} m/s, {fast_speed:.0f} m/s",
        30 <= fast_speed / slow_speed <= 300,
    )
    first = still["nucleation_block"]
    section.check(
        "ruptures start at the loaded edge",
        "more than half of the slips of the control begin in blocks 1 to 7",
        f"{(first <= 7).mean():.2f} of {len(first)}",
        (first <= 7).mean() > 0.5,
    )
    arrest(section, precursors[~is_large])
    section.why = "at 200 Hz the fronts are arrested in each period, which is shorter than a front"
    return section


def arrest(section: Section, small: pandas.DataFrame) -> None:
    """Adds the check where in a period the precursors of slow fronts begin and end."""
    still = select(small, Delta=0.0)
    found, agrees = [], []
    for frequency in (29, 58, 116, 200):
        rows = select(small, Delta=1e-6, T=1 / frequency)
        eta = rows["eta"].iloc[0]

        def outside(rows: pandas.DataFrame) -> float:
            """The share of precursors that end under φ_min, by a clock of this frequency."""
            phases = 2 * math.pi * frequency * rows["last"]
            return under_minimum(phases, phases * 0 + eta).mean()

        ratio = jackknife(lambda rows, still: outside(rows) / outside(still), rows, still)
        found.append(ratio.text(2))
        agrees.append(ratio.lies(below=0.5))
    section.check(
        "slow fronts are arrested for φ < φ_min",
        f"precursors of fewer than {LARGE} breaks end there or on falling load less than half as often as the control's by the"
        " same clock",
        f"ratios of {', '.join(found)}",
        *agrees,
    )


def loading_profile(results: Path) -> Section:
    section = Section(
        "8. Eq. 1: exponential decay from the trailing edge", "`stickslip simulate --set dfs=0 --set max_time=0.063` (before the first break)"
    )
    file = results / "eq1" / "profile.parquet"
    profile = read(file, "scripts/reproduce eq1").sort_values("block")
    given = parameters(file)
    coupling = (given["N"] - 1) * given["K"]
    continuum = math.sqrt(given["ki"] * given["Ns"] / coupling)
    discrete = 2 * math.asinh(0.5 * continuum)
    # Away from the free end, whose reflection is e^(-2κ(N-j)).
    half = profile[profile["block"] <= given["N"] // 2]
    decay = -stats.linregress(half["block"], numpy.log(half["displacement"])).slope
    section.check(
        "",
        "decay per block within 1 % of √(K_s/K_int)",
        f"{decay:.6f}; Eq. 1 gives {continuum:.6f}, the discrete chain {discrete:.6f}",
        abs(decay / continuum - 1) < 0.01,
    )
    return section


def edge(results: Path) -> Section:
    section = Section("12. The modulation is amplified near the loaded edge", "`sweeps/fig2.toml`")
    file = results / "eq1" / "profile.parquet"
    displacement = read(file, "scripts/reproduce eq1").sort_values("block")["displacement"]
    given = parameters(file)
    peak = without_modulation(Sweep(results / "fig2").slips())["peak_force"].mean()
    carried = displacement.iloc[0] / displacement.sum()
    loads = {"its strength N_s f_s": given["Ns"] * given["fs"], "the mean load of the blocks then": peak / given["N"]}
    parts = ", ".join(
        f"{4 * peak * carried / load:.0f} to {5 * peak * carried / load:.0f} % of {what}" for what, load in loads.items()
    )
    section.check(
        "4 to 5 % of modulation become 20 % near the edge",
        "the first block carries at least 5 times the mean of all",
        f"{given['N'] * carried:.2f} times",
        given["N"] * carried >= 5,
    )
    section.remark(
        "Until the first break a slow modulation spreads as the displacement does: the first block carries"
        f" {carried:.3f} of F_S. For it, 4 to 5 % of the peak force are {parts}.",
    )
    section.why = "the paper does not say of what its 20 % are"
    return section
