"""Statements 1 to 4 and 9: intervals between slips, precursors and stress drops.

A criterion is the paper's where it gives a number, otherwise a choice.
"""

from itertools import pairwise
from pathlib import Path

import numpy
import pandas
from scipy import signal, stats

from stickslip.statistics import Estimate, jackknife, locking_index, near_whole, share
from stickslip.tables import Sweep, select

from .document import Section
from .kinematics import FAST, beyond_drive, beyond_text

#: Frequencies in Hz of Fig. 2e and 2f.
FREQUENCIES = (29, 58)
#: Minimum break counts at which precursors are counted; 20 is one block's worth.
SIZES = (20, 30, 40, 60, 100)
#: Drops of F_S that a plot of it shows, in units of the peak force.
VISIBLE = 0.01
#: Breaks from which a precursor is large: ten blocks' worth.
LARGE = 200


def without_modulation(slips: pandas.DataFrame) -> pandas.DataFrame:
    """Slips of disordered contacts without modulation."""
    return select(slips[slips["dfs"] > 0], Delta=0.0)


def of_same_jobs(rows: pandas.DataFrame, slips: pandas.DataFrame) -> pandas.DataFrame:
    return rows[rows["job_id"].isin(slips["job_id"])]


def peaks(intervals: pandas.Series) -> list[float]:
    """Modes of a distribution of intervals, in s.

    They are the maxima of a kernel density of Silverman's width, with the scale of the quartiles, that rise above the
    valley beside them by 2 % of the highest.
    """
    intervals = numpy.asarray(intervals.dropna())
    quartiles = numpy.subtract(*numpy.quantile(intervals, [0.75, 0.25])) / 1.349
    width = 0.9 * min(intervals.std(), quartiles) * len(intervals) ** -0.2
    grid = numpy.linspace(intervals.min() - 3 * width, intervals.max() + 3 * width, 2000)
    density = stats.gaussian_kde(intervals, bw_method=width / intervals.std())(grid)
    found, _ = signal.find_peaks(density, prominence=0.02 * density.max())
    return list(grid[found])


def count_by_slip(slips: pandas.DataFrame, precursors: pandas.DataFrame, size: int) -> pandas.Series:
    """Precursors of at least `size` breaks before each slip."""
    large = precursors[precursors["size"] >= size].groupby(["job_id", "slip"]).size()
    return large.reindex(slips.set_index(["job_id", "slip"]).index, fill_value=0)


def stick_slip(results: Path) -> Section:
    section = Section("1. Stick-slip is regular but stochastic", "`sweeps/fig2.toml`", ("fig2",))
    sweep = Sweep(results / "fig2")
    slips = without_modulation(sweep.slips())
    spread = jackknife(lambda rows: rows["interval"].std() / rows["interval"].mean(), slips)
    section.check(
        "unmodulated intervals are stochastic",
        "s.d. over mean from 0.05 to 0.3",
        spread.text(),
        spread.low > 0.05 and spread.high < 0.3,
    )
    modes = peaks(slips["interval"])
    section.check(
        "their distribution has two peaks",
        "two modes at Silverman's width",
        f"at {', '.join(f'{1e3 * mode:.0f}' for mode in modes)} ms",
        len(modes) == 2,
    )
    ends = [0, *((low + high) / 2 for low, high in pairwise(modes)), slips["interval"].max()]
    of_modes = [slips[slips["interval"].between(low, high)] for low, high in pairwise(ends)]
    # Slips of one seed give no interval.
    of_modes = [rows for rows in of_modes if rows["seed"].nunique() > 1]
    large = [share(rows["largest_precursor"] >= LARGE, rows["seed"]) for rows in of_modes]
    numbers = [rows["precursors"].mean() for rows in of_modes]
    section.check(
        "the peaks differ in their precursors",
        f"different shares of slips after one of {LARGE} breaks (ten blocks' worth) or more",
        f"{', '.join(one.text(2) for one in large)}; precursors per slip {', '.join(f'{n:.1f}' for n in numbers)}",
        len(large) > 1 and all(before.high < after.low for before, after in pairwise(large)),
    )
    precursors = of_same_jobs(sweep.table("precursors"), slips)
    counts = {size: count_by_slip(slips, precursors, size) for size in SIZES}
    two_or_three = {size: share(count.isin([2, 3]), count.index.to_frame()["job_id"]) for size, count in counts.items()}
    section.check(
        "mainly two or three precursors per slip",
        f"more than half of the slips have two or three of at least {SIZES[0]} breaks (one block's worth)",
        f"{two_or_three[SIZES[0]].text(2)}, mean {counts[SIZES[0]].mean():.2f}",
        two_or_three[SIZES[0]].low > 0.5,
    )
    peak = slips["peak_force"].mean()
    seen = share(slips["largest_drop_before"] >= VISIBLE * peak, slips["seed"])
    section.check(
        "also as drops of F_S",
        f"more than half have two or three that a plot shows, of {100 * VISIBLE:.0f} % of the peak force",
        f"{seen.text(2)} have any, of {VISIBLE * peak:.1f} N",
        seen.low > 0.5,
    )
    parts = ", ".join(f"{len(rows) / len(slips):.0%}" for rows in of_modes)
    section.verdict = (
        "holds in part",
        f"τ has {len(modes)} modes{'' if len(modes) == 2 else ', not two'}, with {parts} of"
        f" the slips; {two_or_three[SIZES[0]].value:.2f} of the slips, not most, have two or three precursors",
    )
    most = [size for size, found in two_or_three.items() if found.low > 0.5]
    drops = share(slips["drops_before"].isin([2, 3]), slips["seed"])
    section.remark(
        "The number of precursors depends on what counts: more than half of the slips have two or three of at least"
        f" {' or '.join(map(str, most))} breaks, and {drops.text(2)} have two or three drops of 0.5 N."
    )
    return section


def identical_contacts(results: Path) -> Section:
    section = Section("2. Identical contacts keep the distribution broad", "`sweeps/fig2.toml`")
    slips = Sweep(results / "fig2").slips()
    identical, disordered = (
        jackknife(lambda rows: 1e3 * rows["interval"].std(), rows)
        for rows in (select(slips, Delta=0.0, dfs=0.0), without_modulation(slips))
    )
    section.check(
        "",
        "s.d. of τ at least half of that with disorder",
        f"{identical.text(1)} ms; with disorder {disordered.text(1)} ms",
        identical.low > 0.5 * disordered.high,
    )
    return section


def integer_multiples(results: Path) -> Section:
    section = Section("3. Intervals are integer multiples of the period", "`sweeps/fig2.toml`")
    sweep = Sweep(results / "fig2")
    slips, precursors = sweep.slips(), sweep.table("precursors")
    still = without_modulation(slips)
    modulated = [select(slips, frequency=frequency, Delta=1e-6).dropna(subset="periods") for frequency in FREQUENCIES]
    indices = [jackknife(lambda rows: locking_index(rows["tau_over_T"]), rows) for rows in modulated]
    unmodulated = [locking_index(still["interval"] * frequency) for frequency in FREQUENCIES]
    reduced = [select(sweep.sets(), T=1 / frequency, Delta=1e-6).iloc[0] for frequency in FREQUENCIES]
    near = [share(near_whole(rows["tau_over_T"]), rows["seed"]) for rows in modulated]
    section.check(
        "τ locks",
        "locking index > 0.7",
        f"{at_frequencies(indices)}; unmodulated {', '.join(f'{chance:.3f}' for chance in unmodulated)};"
        f" within 0.1 T of nT {', '.join(one.text() for one in near)}, by chance 0.2",
        *(index.low > 0.7 for index in indices),
    )
    section.check(
        "more than the drive alone makes",
        "locking index above that of slips at the loads of the unmodulated slider, with the interval of the difference",
        ", ".join(
            f"{row['locking_index_drive']:.3f} by the drive, excess {row['locking_index_excess']:.3f}"
            f" ({row['locking_index_excess_low']:.3f}–{row['locking_index_excess_high']:.3f}) at {frequency} Hz"
            for row, frequency in zip(reduced, FREQUENCIES, strict=True)
        ),
        *(row["locking_index_excess_low"] > 0 for row in reduced),
    )
    for what, intervals, column in (
        ("so do times from the largest precursor to its slip", lead_times(sweep), "lead"),
        ("so do those between precursors, if longer than T/2", precursors, "interval"),
    ):
        found = [index_of(column, select(intervals, T=1 / frequency), frequency) for frequency in FREQUENCIES]
        chances = [index_of(column, of_same_jobs(intervals, still), frequency) for frequency in FREQUENCIES]
        section.check(
            what,
            "locking index > 0.5 and above unmodulated",
            f"{at_frequencies(found)}; unmodulated {', '.join(f'{chance.value:.3f}' for chance in chances)}",
            *(index.low > max(chance.high, 0.5) for index, chance in zip(found, chances, strict=True)),
        )
    section.remark("Shorter intervals between precursors belong to bursts of small ones, with or without modulation.")
    return section


def index_of(column: str, rows: pandas.DataFrame, frequency: float) -> Estimate:
    """The locking index of the times in a column that are longer than half a period."""
    rows = rows[rows[column] * frequency > 0.5]
    return jackknife(lambda rows: locking_index(rows[column] * frequency), rows)


def at_frequencies(found: list[Estimate], digits: int = 3, unit: str = "") -> str:
    return ", ".join(f"{one.text(digits)}{unit} at {f} Hz" for one, f in zip(found, FREQUENCIES, strict=True))


def lead_times(sweep: Sweep) -> pandas.DataFrame:
    """The largest precursor of each slip, with the time `lead` in s from its onset to the slip's."""
    precursors, slips = sweep.table("precursors"), sweep.table("slips")
    largest = precursors.loc[precursors.groupby(["job_id", "slip"])["size"].idxmax()]
    pairs = largest.merge(slips[["job_id", "slip", "onset"]], on=["job_id", "slip"], suffixes=("", "_of_slip"))
    return pairs.assign(lead=pairs["onset_of_slip"] - pairs["onset"])


def many_periods(results: Path) -> Section:
    source = "`sweeps/fig3.toml` and `sweeps/drive-alone.toml`"
    section = Section("4. τ = nT over a broad range of loading", source, ("fig3-tau-T",))
    sweep = Sweep(results / "fig3")
    slips = sweep.slips().merge(sweep.sets()[["set_id", "resultant_length"]], on="set_id")
    slips = slips[(slips["eta"] >= 1) & slips["interval"].notna()]
    slips = slips.assign(near=near_whole(slips["tau_over_T"]))
    whole, bunched = (share(rows["near"], rows["set_id"]) for rows in (slips, slips[slips["resultant_length"] > 0.5]))
    section.check("", "more than the 0.2 of chance within 0.1 T of nT, for η > 1", whole.text(), whole.low > 0.2)
    section.check("once locked", "more than 0.5 where the resultant of φ is above 0.5", bunched.text(), bunched.low > 0.5)
    sets = Sweep(results / "drive-alone").sets()
    sets = sets[sets["eta"] > 1]
    for low, high in pairwise((1, 2, 4, 11)):
        mine = sets[(sets["eta"] >= low) & (sets["eta"] < high)]
        fast = mine["V0"] > FAST
        section.rows.append(
            {
                "η": f"{low} to {min(high, 10)}",
                "locking index": f"{mine['locking_index'].mean():.3f}",
                "by the drive alone": f"{mine['locking_index_drive'].mean():.3f}",
                "beyond the drive's, V0 up to 1e-5 m/s": beyond_text(mine[~fast], "locking_index"),
                "from 5e-5 m/s on": beyond_text(mine[fast], "locking_index"),
            }
        )
    slow = sets[sets["V0"] < FAST]
    above, _ = beyond_drive(slow, "locking_index")
    section.verdict = (
        "holds; for slow drives the drive alone makes it so",
        f"the locking index exceeds what the drive alone gives in {above.sum()} of {len(slow)} sets up to 1e-5 m/s",
    )
    return section


def stress_drops(results: Path) -> Section:
    section = Section("9. Stress drops synchronise in part", "`sweeps/fig2.toml`")
    slips = Sweep(results / "fig2").slips()
    still = without_modulation(slips).dropna(subset="interval")

    def common(rows: pandas.DataFrame) -> float:
        """The share of the drops' variance that a straight line in τ explains."""
        return rows["interval"].corr(rows["drop"]) ** 2

    def beside_line(rows: pandas.DataFrame) -> pandas.Series:
        """How far drops are off a straight line in τ, in N."""
        if len(rows) < 3:
            return pandas.Series(dtype=float)
        return rows["drop"] - numpy.polyval(numpy.polyfit(rows["interval"], rows["drop"], 1), rows["interval"])

    def left(rows: pandas.DataFrame) -> float:
        """The s.d. in N of the drops at given τ: about a line within each n, so that no curve of the whole is left."""
        return pandas.concat([beside_line(those) for _, those in rows.groupby("periods")]).std()

    of_tau = {"without modulation": jackknife(common, still)}
    modulated, chances, spreads = [], [], []
    for frequency in FREQUENCIES:
        rows = select(slips, Delta=1e-6, frequency=frequency).dropna(subset="periods")
        free = still.assign(periods=(still["interval"] * frequency).round())
        of_tau[f"at {frequency} Hz"] = jackknife(common, rows)
        modulated.append(jackknife(left, rows))
        chances.append(jackknife(left, free))
        spreads.append(f"{rows['drop'].std():.1f}")
    section.check(
        "",
        "at given τ (s.d. about a line for each n) drops vary less than unmodulated",
        f"{at_frequencies(modulated, 1, ' N')}; unmodulated {', '.join(one.text(1) for one in chances)} N;"
        f" s.d. of all {', '.join(spreads)} N",
        *(one.high < chance.low for one, chance in zip(modulated, chances, strict=True)),
    )
    section.remark(
        "Force grows at the rate K_d V0 between slips, so drops follow τ; the square of their correlation is"
        f" {', '.join(f'{found.text(3)} {where}' for where, found in of_tau.items())}."
    )
    section.verdict = ("restates statement 3", "drops follow τ; at given τ they vary more with modulation, not less")
    return section


def stochasticity(results: Path) -> Section:
    section = Section(
        "10. Stochasticity needs many more than √(K_int/K_s) blocks",
        "`sweeps/stochasticity.toml` (identical contacts, N = 35 to 140, K = 3e7 to 1e10 N/m)",
    )
    slips = Sweep(results / "stochasticity").slips().dropna(subset="interval")

    def spread(rows: pandas.DataFrame) -> float:
        """Interquartile range over the median."""
        low, middle, high = rows["interval"].quantile([0.25, 0.5, 0.75])
        return (high - low) / middle

    # By √(K_int/K_s) in units of N.
    spreads = {}
    for (blocks, stiffness), rows in slips.groupby(["N", "K"]):
        length = ((blocks - 1) * stiffness / (rows["ki"] * rows["Ns"]).iloc[0]) ** 0.5
        spreads[length / blocks] = spread(rows)
    long, middle, stiff = (
        [one for length, one in spreads.items() if low < length < high]
        for low, high in ((0, 1 / 8), (1 / 8, 1 / 2), (1 / 2, numpy.inf))
    )
    section.check(
        "",
        "interquartile range of τ over its median above 0.05 for √(K_int/K_s) < N/8, below 0.02 for > N/2",
        f"{min(long):.3f} to {max(long):.3f}; {min(stiff):.3f} to {max(stiff):.3f};"
        f" between N/8 and N/2 {min(middle):.3f} to {max(middle):.3f}",
        min(long) > 0.05 and max(stiff) < 0.02,
    )
    return section
