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
from .kinematics import SOURCE, bounds_text

#: Frequencies in Hz of Fig. 2e and 2f.
FREQUENCIES = (29, 58)
FIG_2 = "`sweeps/fig2.toml`; two values are those at 29 and 58 Hz"
#: Minimum break counts at which precursors are counted; 20 is one block's worth.
SIZES = (20, 30, 40, 60, 100)
#: Breaks from which a precursor is large: ten blocks' worth.
LARGE = 200
#: Samples of half of the seeds in which modes are counted.
SAMPLES = 60


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


def modes_of_halves(slips: pandas.DataFrame) -> list[int]:
    """How many modes each of `SAMPLES` samples of half of the seeds has."""
    generator = numpy.random.default_rng(2011)
    seeds = slips["seed"].unique()
    halves = [generator.choice(seeds, len(seeds) // 2, replace=False) for _ in range(SAMPLES)]
    return [len(peaks(slips.loc[slips["seed"].isin(half), "interval"])) for half in halves]


def count_by_slip(slips: pandas.DataFrame, precursors: pandas.DataFrame, size: int) -> pandas.Series:
    """Precursors of at least `size` breaks before each slip."""
    large = precursors[precursors["size"] >= size].groupby(["job_id", "slip"]).size()
    return large.reindex(slips.set_index(["job_id", "slip"]).index, fill_value=0)


def stick_slip(results: Path) -> Section:
    section = Section("1. Stick-slip is regular but stochastic", FIG_2, ("fig2",))
    sweep = Sweep(results / "fig2")
    slips = without_modulation(sweep.slips())
    spread = jackknife(lambda rows: rows["interval"].std() / rows["interval"].mean(), slips)
    section.check(
        "intervals are stochastic",
        "s.d. over mean of the control from 0.05 to 0.3",
        spread.text(),
        spread.lies(above=0.05, below=0.3),
    )
    modes = peaks(slips["interval"])
    having_two = modes_of_halves(slips).count(2)
    is_decided = having_two >= 0.95 * SAMPLES or having_two <= 0.05 * SAMPLES
    section.check(
        "their distribution has two peaks",
        "two modes at Silverman's width in 95 of 100 samples of half of the seeds, and not in 5",
        f"in {having_two} of {SAMPLES}; modes of all at {', '.join(f'{1e3 * mode:.0f}' for mode in modes)} ms",
        having_two >= 0.95 * SAMPLES if is_decided else None,
    )
    ends = [0, *((low + high) / 2 for low, high in pairwise(modes)), slips["interval"].max()]
    of_modes = [slips[slips["interval"].between(low, high)] for low, high in pairwise(ends)]
    # Slips of one seed give no interval.
    of_modes = [rows for rows in of_modes if rows["seed"].nunique() > 1]
    precursors = of_same_jobs(sweep.table("precursors"), slips)
    counts = {size: count_by_slip(slips, precursors, size) for size in SIZES}
    numbers = {size: [of_slips(count, rows) for rows in of_modes] for size, count in counts.items()}
    section.check(
        "the peaks differ in their precursors",
        f"different mean numbers of those of at least {', '.join(map(str, SIZES))} breaks",
        "; ".join(", ".join(one.text(1) for one in found) for found in numbers.values()),
        *(before.high < after.low for found in numbers.values() for before, after in pairwise(found)),
    )
    drops = share(slips["drops_before"].isin([2, 3]), slips["seed"])
    two_or_three = (f"{count.isin([2, 3]).mean():.2f}" for count in counts.values())
    section.remark(
        f"Two or three precursors, as most slips of the paper, have {', '.join(two_or_three)} of the slips at these sizes,"
        f" {drops.text(2)} by drops of the force of 0.5 N or more."
    )
    parts = ", ".join(f"{len(rows) / len(slips):.0%}" for rows in of_modes)
    section.why = f"two modes, with {parts} of the slips; {having_two} of {SAMPLES} halves of the seeds have two"
    return section


def of_slips(count: pandas.Series, slips: pandas.DataFrame) -> Estimate:
    """The mean over some slips of a count by slip."""
    count = count.loc[pandas.MultiIndex.from_frame(slips[["job_id", "slip"]])]
    return jackknife(lambda rows: rows["count"].mean(), slips.assign(count=count.to_numpy()))


def identical_contacts(results: Path) -> Section:
    section = Section("2. Identical contacts keep the distribution broad", FIG_2)
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
    section = Section("3. Intervals are integer multiples of the period", FIG_2)
    sweep = Sweep(results / "fig2")
    slips, precursors = sweep.slips(), sweep.table("precursors")
    still = without_modulation(slips)
    modulated = [select(slips, frequency=frequency, Delta=1e-6).dropna(subset="periods") for frequency in FREQUENCIES]
    indices = [jackknife(lambda rows: locking_index(rows["tau_over_T"]), rows) for rows in modulated]
    unmodulated = [locking_index(still["interval"] * frequency) for frequency in FREQUENCIES]
    reduced = [select(sweep.sets(), T=1 / frequency, Delta=1e-6).iloc[0] for frequency in FREQUENCIES]
    section.check(
        "τ locks",
        "locking index > 0.7",
        f"{texts(indices)}; control {', '.join(f'{chance:.3f}' for chance in unmodulated)}",
        *(index.lies(above=0.7) for index in indices),
    )
    by_drive = (f"{row['locking_index_drive']:.3f}" for row in reduced)
    excesses = (
        f"{row['locking_index_excess']:.3f}"
        f" ({row['locking_index_excess_low']:.3f}–{row['locking_index_excess_high']:.3f})"
        for row in reduced
    )
    section.check(
        "",
        "excess of the locking index above 0",
        f"{', '.join(excesses)}; drive alone {', '.join(by_drive)}",
        *(row["locking_index_excess_low"] > 0 for row in reduced),
    )
    for what, intervals, column in (
        ("so do times from largest precursor to slip", lead_times(sweep), "lead"),
        ("so do times between precursors above T/2", precursors, "interval"),
    ):
        found = [index_of(column, select(intervals, T=1 / frequency), frequency) for frequency in FREQUENCIES]
        chances = [index_of(column, of_same_jobs(intervals, still), frequency) for frequency in FREQUENCIES]
        section.check(
            what,
            "locking index > 0.5 and above the control's",
            f"{texts(found)}; control {', '.join(f'{chance.value:.3f}' for chance in chances)}",
            *(index.low > max(chance.high, 0.5) for index, chance in zip(found, chances, strict=True)),
        )
    return section


def index_of(column: str, rows: pandas.DataFrame, frequency: float) -> Estimate:
    """The locking index of the times in a column that are longer than half a period."""
    rows = rows[rows[column] * frequency > 0.5]
    return jackknife(lambda rows: locking_index(rows[column] * frequency), rows)


def texts(found: list[Estimate]) -> str:
    return ", ".join(one.text() for one in found)


def lead_times(sweep: Sweep) -> pandas.DataFrame:
    """The largest precursor of each slip, with the time `lead` in s from its onset to the slip's."""
    precursors, slips = sweep.table("precursors"), sweep.table("slips")
    largest = precursors.loc[precursors.groupby(["job_id", "slip"])["size"].idxmax()]
    pairs = largest.merge(slips[["job_id", "slip", "onset"]], on=["job_id", "slip"], suffixes=("", "_of_slip"))
    return pairs.assign(lead=pairs["onset_of_slip"] - pairs["onset"])


def many_periods(results: Path) -> Section:
    section = Section("4. τ = nT over a broad range of loading", SOURCE, ("fig3-tau-T",))
    sweep = Sweep(results / "fig3")
    slips = sweep.slips().merge(sweep.sets()[["set_id", "resultant_length"]], on="set_id")
    slips = slips[(slips["eta"] >= 1) & slips["interval"].notna()]
    slips = slips.assign(near=near_whole(slips["tau_over_T"]))
    whole, bunched = (share(rows["near"], rows["set_id"]) for rows in (slips, slips[slips["resultant_length"] > 0.5]))
    section.check("", "more than the 0.2 of chance within 0.1 T of nT, for η > 1", whole.text(), whole.lies(above=0.2))
    section.check("once locked", "more than 0.5 where R is above 0.5", bunched.text(), bunched.lies(above=0.5))
    sets = Sweep(results / "locking-drive-alone").sets()
    section.note = "; for slow drives the drive alone makes it so"
    section.why = f"up to 1e-5 m/s the excess of the locking index is {bounds_text(sets[sets['eta'] > 1], 'locking_index')}"
    return section


def stress_drops(results: Path) -> Section:
    section = Section("9. Stress drops synchronise in part", FIG_2)
    slips = Sweep(results / "fig2").slips()
    still = without_modulation(slips).dropna(subset="interval")

    def common(rows: pandas.DataFrame) -> float:
        """The share of the drops' variance that a straight line in τ explains."""
        return rows["interval"].corr(rows["drop"]) ** 2

    of_tau = [jackknife(common, still)]
    modulated, chances = [], []
    for frequency in FREQUENCIES:
        rows = select(slips, Delta=1e-6, frequency=frequency).dropna(subset="periods")

        def index(rows: pandas.DataFrame) -> float:
            """The locking index of the drops, in units of what the force gains in a period."""
            return locking_index(rows["drop"] * frequency / stats.linregress(rows["interval"], rows["drop"]).slope)

        of_tau.append(jackknife(common, rows))
        modulated.append(jackknife(index, rows))
        chances.append(jackknife(index, still))
    section.check(
        "",
        "locking index of drops, in units of the force gained in T, above the control's",
        f"{texts(modulated)}; control {texts(chances)}",
        *(one.low > chance.high for one, chance in zip(modulated, chances, strict=True)),
    )
    section.remark(
        "Drops follow τ, as the force grows at the rate K_d V0: their squared correlation is"
        f" {texts(of_tau[1:])}; control {of_tau[0].text()}.",
    )
    section.verdict = "restates statement 3"
    section.why = "drops follow τ"
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
        "interquartile range of τ over its median at least twice as large for √(K_int/K_s) < N/8 as for > N/2",
        f"{min(long):.3f} to {max(long):.3f}; {min(stiff):.3f} to {max(stiff):.3f};"
        f" between N/8 and N/2 {min(middle):.3f} to {max(middle):.3f}",
        min(long) > 2 * max(stiff),
    )
    return section
