"""Does a pulse of the load trigger slips, and at which phase of a tide do they come? Both against the drive alone."""

from pathlib import Path

import numpy
import pandas

from stickslip.statistics import Estimate, jackknife, share
from stickslip.tables import Sweep

from .document import Section
from .kinematics import beyond_text

#: Pulses up to this amplitude in m move nothing.
NO_PULSE = 1e-12
#: Comparisons of the table of pulses: six pulses, each of a share and two advances as seen and beyond the drive's.
COMPARISONS = 36
#: An excess of R from which a set is locked beyond what the drive alone makes.
LOCKED = 0.05


def of_mean(rows: pandas.DataFrame, column: str, less: str | None = None) -> Estimate:
    """The mean of a column over pulses, or of its difference to another one, by seeds."""
    return jackknife(lambda rows: (rows[column] - (rows[less] if less else 0)).mean(), rows)


def of_thirds(rows: pandas.DataFrame) -> Estimate:
    """The share triggered beyond the drive in the last third of the cycle, less that in the middle third."""
    rows = rows.assign(third=(3 * rows["place"]).astype(int), more=rows["triggered"] - rows["triggered_drive"])

    def less(rows: pandas.DataFrame) -> float:
        shares = rows.groupby("third")["more"].mean()
        return shares[2] - shares[1]

    return jackknife(less, rows)


def pulses(results: Path) -> Section:
    section = Section("Triggering: a pulse of the load", "`sweeps/triggering.toml`", ("triggering",))
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
                "by the drive": f"{mine['triggered_drive'].mean():.3f}",
                "advance/⟨τ⟩, middle third": of_mean(middle, "advance").text(2),
                "last third": of_mean(late, "advance").text(3),
                "by the drive ": f"{late['advance_drive'].mean():.3f}",
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
        "more of them than the drive alone, at 1 µm",
        ", ".join(f"{found.text(2)} more at {frequency:.0f} Hz" for frequency, found in excess.items()),
        *(found.lies(above=0) for found in excess.values()),
    )
    short, long = (by_frequency[frequency] for frequency in (max(by_frequency), min(by_frequency)))
    gain = jackknife(lambda short, long: short["triggered"].mean() - long["triggered"].mean(), short, long)
    gain = gain.among(COMPARISONS)
    section.check(
        "short pulses trigger more",
        "share at 116 Hz above that at 29 Hz, at 1 µm",
        f"by {gain.text(2)}",
        gain.lies(above=0),
    )
    later = {frequency: of_thirds(mine).among(COMPARISONS) for frequency, mine in by_frequency.items()}
    section.check(
        "beyond the drive, they trigger most late in the cycle",
        "share less the drive's in the last third of the cycle above that in the middle third, at 1 µm",
        ", ".join(f"by {found.text(2)} at {frequency:.0f} Hz" for frequency, found in later.items()),
        *(found.lies(above=0) for found in later.values()),
    )
    late = rows[(rows["Delta"] == rows["Delta"].min()) & (rows["place"] >= 2 / 3)]
    advance, more = of_mean(late, "advance").among(COMPARISONS), of_mean(late, "advance", "advance_drive")
    section.check(
        "weak pulses advance slips before they trigger any",
        "mean advance above 0 in the last third of the cycle, at 0.1 µm",
        f"{advance.text()} of ⟨τ⟩, {more.text()} more than by the drive alone",
        advance.lies(above=0),
    )
    weakest = rows[rows["Delta"] == rows["Delta"].min()]
    beyond = {
        frequency: of_mean(mine, "advance", "advance_drive").among(COMPARISONS)
        for frequency, mine in weakest.groupby("Hz")
    }
    section.check(
        "what weak pulses do is the drive's",
        "mean advance beyond the drive's within ±0.01 ⟨τ⟩, at 0.1 µm",
        ", ".join(f"{found.text()} of ⟨τ⟩ at {frequency:.0f} Hz" for frequency, found in beyond.items()),
        *(found.lies(above=-0.01, below=0.01) for found in beyond.values()),
    )
    held = {
        frequency: of_mean(mine[mine["place"].between(1 / 3, 2 / 3)], "advance").among(COMPARISONS)
        for frequency, mine in by_frequency.items()
    }
    section.check(
        "in the middle of the cycle they hold slips up",
        "mean advance below 0 in the middle third, at 1 µm",
        ", ".join(f"{found.text(2)} of ⟨τ⟩ at {frequency:.0f} Hz" for frequency, found in held.items()),
        *(found.lies(below=0) for found in held.values()),
    )
    both = strongest.dropna(subset=["next_advance"])
    kept = jackknife(lambda rows: numpy.polyfit(rows["advance"], rows["next_advance"], 1)[0], both)
    section.remark(
        "The first three are known of faults with rate-and-state friction ([van der Elst and Savage"
        " 2015](https://doi.org/10.1002/2014JB011611)), responses of either sign of block chains ([Franović et al."
        " 2016](https://arxiv.org/abs/1606.03079)).",
        f"The slip after the next keeps {kept.text(2)} of the advance.",
        f"Negligible pulses (1e-15 m) shift slips by up to {1e3 * all_rows['noise'].max():.1f} ms: rounding errors grow (chaos).",
    )
    section.remark("Intervals of the criteria, not of the table, are corrected for the 36 comparisons of the table (Bonferroni).")
    section.why = (
        "weak pulses do what the drive does; in the middle of the cycle strong ones hold slips up at 29 Hz,"
        " and trigger most beyond the drive at 116 Hz"
    )
    return section


def tides(results: Path) -> Section:
    section = Section("Tides: periods from far below to far above ⟨τ⟩", "`sweeps/tide.toml`", ("tide-phase", "tide-excess"))
    sets = Sweep(results / "tide").sets()
    sets = sets.assign(periods=sets["T"] / sets["tau_control"])
    slow, fast = (sets[sets["V0"] == velocity].sort_values("periods") for velocity in sorted(sets["V0"].unique()))
    section.check(
        "from the peak of the load",
        "mean phase more than 0.5 rad above −π/2 at the shortest period",
        ", ".join(f"{signed(mine['phase_mean'].iloc[0])} rad at {speed(mine)}" for mine in (slow, fast)),
        *(bool(mine["phase_mean_low"].iloc[0] > 0.5 - numpy.pi / 2) for mine in (slow, fast)),
    )
    longer = [mine[mine["periods"].between(0.2, 5)] for mine in (slow, fast)]
    medians = [mine["phase_mean"].median() for mine in longer]
    section.check(
        "to the peak of its rate",
        "median of the mean phases at T from ⟨τ⟩/5 to 5⟨τ⟩ within 0.2 rad of −π/2",
        ", ".join(f"{signed(median)} rad at {speed(mine)}" for median, mine in zip(medians, (slow, fast), strict=True)),
        *(bool(abs(median + numpy.pi / 2) < 0.2) for median in medians),
    )
    locked = [mine[mine["resultant_excess_low"] > LOCKED] for mine in (slow, fast)]
    window = locked[1]["periods"]
    section.check(
        "locking in a window of periods only",
        f"excess of R above {LOCKED} with its interval at some T, and at none above ⟨τ⟩",
        f"{len(locked[0])} sets at {speed(slow)}; {len(window)} at {speed(fast)}, with T/⟨τ⟩ of"
        f" {', '.join(f'{periods:.2f}' for periods in window) or 'none'}",
        *(bool(len(mine)) and bool(mine["periods"].max() < 1) for mine in locked),
    )
    section.remark(
        "[Zhou et al. 2026](https://arxiv.org/abs/2602.06703) find all three with rate-and-state friction.",
        f"At {speed(slow)} R is the drive's in each set, with ends of {beyond_text(slow, 'resultant').split('; ')[1]}.",
    )
    section.why = "the phases are those of the drive alone; only the fast drive locks, where T is a part of ⟨τ⟩"
    return section


def signed(value: float) -> str:
    """A number with two decimals and a minus sign."""
    return f"{value:.2f}".replace("-", "−")


def speed(sets: pandas.DataFrame) -> str:
    """The drive velocity that all sets have."""
    return f"{sets['V0'].iloc[0]:.0e} m/s".replace("e-0", "e-")
