"""Does a pulse of the load trigger slips, and at which phase of a tide do they come? Both against the drive alone."""

from pathlib import Path

import numpy
import pandas

from stickslip.statistics import Estimate, jackknife, share
from stickslip.tables import Sweep

from .document import Section
from .kinematics import excess_text

#: Pulses up to this amplitude in m move nothing.
NO_PULSE = 1e-12
#: Comparisons of pulses: six, each of a share and two advances as measured and as excess.
COMPARISONS = 36
#: An excess of R from which a set is locked beyond what the drive alone makes.
LOCKED = 0.05


def of_mean(rows: pandas.DataFrame, column: str, less: str | None = None) -> Estimate:
    """The mean of a column over pulses, or of its difference to another one, by seeds."""
    return jackknife(lambda rows: (rows[column] - (rows[less] if less else 0)).mean(), rows)


def texts(found: dict[float, Estimate], digits: int) -> str:
    return ", ".join(one.text(digits) for one in found.values())


def of_thirds(rows: pandas.DataFrame) -> Estimate:
    """The excess of the share triggered in the last third of the interval, less that in the middle third."""
    rows = rows.assign(third=(3 * rows["place"]).astype(int), more=rows["triggered"] - rows["triggered_drive"])

    def less(rows: pandas.DataFrame) -> float:
        shares = rows.groupby("third")["more"].mean()
        return shares[2] - shares[1]

    return jackknife(less, rows)


def pulses(results: Path) -> Section:
    section = Section(
        "Triggering: a pulse of the load",
        "`sweeps/triggering.toml`; two values are those at 29 and 116 Hz",
        ("triggering",),
    )
    all_rows = Sweep(results / "triggering").reduced("triggers")
    rows = all_rows[all_rows["advance"].notna() & (all_rows["Delta"] > NO_PULSE)]
    rows = rows.assign(
        Hz=(1 / rows["T"]).round(),
        **{name: rows[name] / rows["tau_control"] for name in ("advance", "advance_drive", "next_advance")},
        **{name: rows[name].astype(float) for name in ("triggered", "triggered_drive")},
    )
    for (amplitude, frequency), mine in rows.groupby(["Delta", "Hz"]):
        middle = mine[mine["place"].between(1 / 3, 2 / 3)]
        late = mine[mine["place"] >= 2 / 3]
        section.rows.append(
            {
                "pulse": f"{1e6 * amplitude:.1f} µm, {frequency:.0f} Hz",
                "triggered": share(mine["triggered"], mine["seed"]).text(),
                "advance/⟨τ⟩, middle third": of_mean(middle, "advance").text(2),
                "last third": of_mean(late, "advance").text(3),
            }
        )
    strongest = rows[rows["Delta"] == rows["Delta"].max()]
    by_frequency = dict(list(strongest.groupby("Hz")))
    excess = {
        frequency: of_mean(mine, "triggered", "triggered_drive").among(COMPARISONS)
        for frequency, mine in by_frequency.items()
    }
    section.check(
        "pulses trigger slips",
        "excess of the share above 0, at 1 µm",
        texts(excess, 2),
        *(found.lies(above=0) for found in excess.values()),
    )
    short, long = (by_frequency[frequency] for frequency in (max(by_frequency), min(by_frequency)))
    gain = jackknife(lambda short, long: short["triggered"].mean() - long["triggered"].mean(), short, long)
    gain = gain.among(COMPARISONS)
    section.check(
        "short pulses trigger more",
        "share at 116 Hz above that at 29 Hz, at 1 µm",
        f"{gain.text(2)} more",
        gain.lies(above=0),
    )
    later = {frequency: of_thirds(mine).among(COMPARISONS) for frequency, mine in by_frequency.items()}
    section.check(
        "excess over the drive alone, most late in the interval",
        "excess of the share greater in the last third than in the middle third, at 1 µm",
        f"by {texts(later, 2)}",
        *(found.lies(above=0) for found in later.values()),
    )
    late = rows[(rows["Delta"] == rows["Delta"].min()) & (rows["place"] >= 2 / 3)]
    advance, more = of_mean(late, "advance").among(COMPARISONS), of_mean(late, "advance", "advance_drive")
    section.check(
        "weak pulses advance slips before they trigger any",
        "mean advance above 0 in the last third, at 0.1 µm",
        f"{advance.text()} ⟨τ⟩, excess {more.text()}",
        advance.lies(above=0),
    )
    weakest = rows[rows["Delta"] == rows["Delta"].min()]
    beyond = {
        frequency: of_mean(mine, "advance", "advance_drive").among(COMPARISONS)
        for frequency, mine in weakest.groupby("Hz")
    }
    section.check(
        "weak pulses do what the drive alone does",
        "excess of the mean advance within ±0.01 ⟨τ⟩, at 0.1 µm",
        texts(beyond, 3),
        *(found.lies(above=-0.01, below=0.01) for found in beyond.values()),
    )
    held = {
        frequency: of_mean(mine[mine["place"].between(1 / 3, 2 / 3)], "advance").among(COMPARISONS)
        for frequency, mine in by_frequency.items()
    }
    section.check(
        "in the middle of the interval they hold slips up",
        "mean advance below 0 in the middle third, at 1 µm",
        f"{texts(held, 2)} ⟨τ⟩",
        *(found.lies(below=0) for found in held.values()),
    )
    both = strongest.dropna(subset=["next_advance"])
    kept = jackknife(lambda rows: numpy.polyfit(rows["advance"], rows["next_advance"], 1)[0], both)
    section.remark(
        "The first three are known from rate-and-state friction ([van der Elst and Savage"
        " 2015](https://doi.org/10.1002/2014JB011611)), responses of either sign from block chains ([Franović et al."
        " 2016](https://arxiv.org/abs/1606.03079)).",
        f"The slip after the next keeps {kept.text(2)} of the advance.",
        f"Negligible pulses (1e-15 m) shift slips by up to {1e3 * all_rows['noise'].max():.1f} ms: rounding errors grow (chaos).",
    )
    section.remark(
        f"Intervals of criteria are corrected for {COMPARISONS} comparisons (Bonferroni): the columns of the table, measured and"
        " excess."
    )
    section.why = (
        "weak pulses do what the drive alone does; in the middle of the interval strong ones hold slips up at 29 Hz, and"
        " have the greatest excess at 116 Hz"
    )
    return section


def tides(results: Path) -> Section:
    section = Section(
        "Tides: periods from far below to far above ⟨τ⟩",
        "`sweeps/tide.toml`; two values are those at 1e-6 and 1e-4 m/s",
        ("tide-phase", "tide-excess"),
    )
    sets = Sweep(results / "tide").sets()
    sets = sets.assign(periods=sets["T"] / sets["tau_control"])
    slow, fast = (sets[sets["V0"] == velocity].sort_values("periods") for velocity in sorted(sets["V0"].unique()))
    section.check(
        "from the peak of the load",
        "mean phase more than 0.5 rad above −π/2 at the shortest period",
        ", ".join(f"{signed(mine['phase_mean'].iloc[0])} rad" for mine in (slow, fast)),
        *(bool(mine["phase_mean_low"].iloc[0] > 0.5 - numpy.pi / 2) for mine in (slow, fast)),
    )
    longer = [mine[mine["periods"].between(0.2, 5)] for mine in (slow, fast)]
    medians = [mine["phase_mean"].median() for mine in longer]
    section.check(
        "to the peak of its rate",
        "median of the mean phases at T from ⟨τ⟩/5 to 5⟨τ⟩ within 0.2 rad of −π/2",
        ", ".join(f"{signed(median)} rad" for median in medians),
        *(bool(abs(median + numpy.pi / 2) < 0.2) for median in medians),
    )
    locked = [mine[mine["resultant_excess_low"] > LOCKED] for mine in (slow, fast)]
    window = locked[1]["periods"]
    section.check(
        "locking in a window of periods only",
        f"excess of R above {LOCKED} with its interval at some T, and at none above ⟨τ⟩",
        f"in {len(locked[0])} sets; in {len(window)}, with T/⟨τ⟩ of"
        f" {', '.join(f'{periods:.2f}' for periods in window) or 'none'}",
        *(bool(len(mine)) and bool(mine["periods"].max() < 1) for mine in locked),
    )
    section.remark(
        "[Zhou et al. 2026](https://arxiv.org/abs/2602.06703) find all three with rate-and-state friction.",
        f"At {speed(slow)} the intervals of the excess of R lie from {excess_text(slow, 'resultant').split('; ')[1]}.",
    )
    section.why = "only the fast drive locks, where T is a part of ⟨τ⟩"
    return section


def signed(value: float) -> str:
    """A number with two decimals and a minus sign."""
    return f"{value:.2f}".replace("-", "−")


def speed(sets: pandas.DataFrame) -> str:
    """The drive velocity that all sets have."""
    return f"{sets['V0'].iloc[0]:.0e} m/s".replace("e-0", "e-")
