"""Questions that the paper leaves open: each a sweep, a figure and a finding, with its statistical error."""

from itertools import pairwise
from pathlib import Path

import numpy
import pandas
from scipy import stats

from stickslip.statistics import difference, jackknife, locking_index, mean, near_whole, resultant_length, share
from stickslip.tables import Sweep, select

from .document import Section
from .intervals import SIZES, count_by_slip, of_same_jobs, without_modulation
from .kinematics import beyond_text

#: Periods in s up to which the locking index shows locking: near T = τ it is large for any narrow distribution of τ.
SHORT = 0.04
#: Frequencies in Hz of the sweeps of size, contacts and disorder.
FREQUENCIES = (29, 58, 116)
#: η from which the window of the phase holds φ_min (docs/model.md).
WHOLE_WINDOW = 1.014


def drag(results: Path) -> Section:
    section = Section(
        "Drag: T changed slowly within one run",
        "`sweeps/drag.toml` (Δ = 1 µm) and `sweeps/drag-strong.toml` (3 µm)",
        ("drag", "drag-strong"),
    )
    followed, texts, memories = [], [], []
    for sweep, amplitude in (("drag", "1 µm"), ("drag-strong", "3 µm")):
        slips = Sweep(results / sweep).slips()
        slips = slips[slips["interval"].notna() & (slips["onset"] < 2 * slips["ramp_time"])]
        near = share(near_whole(slips["interval"] / slips["T_onset"]), slips["seed"])
        followed.append(near.low > 0.5)
        texts.append(f"{near.text()} at {amplitude}")
        edges = numpy.linspace(slips["T_onset"].min(), slips["T_onset"].max(), 13)
        slips = slips.assign(
            is_up=slips["onset"] < slips["ramp_time"], bin=numpy.digitize(slips["T_onset"], edges[1:-1])
        )
        means = slips.groupby(["seed", "bin", "is_up"])["periods"].mean().unstack()
        whole = mean((means[False] - means[True]).groupby("seed").mean())
        memory = "a small memory" if whole.excludes_zero() else "no memory"
        memories.append(f"{whole.text(3)} at {amplitude}, {memory}")
    section.check(
        "T drags τ with it (page 3)",
        "more than 0.5 of the intervals within 0.1 T of nT while T changes",
        ", ".join(texts),
        *followed,
    )
    section.remark("Hysteresis is the mean n while T falls minus that while T rises.", f"It is {'; '.join(memories)}.")
    return section


def locking_map(results: Path) -> Section:
    title = "Arnold tongues: locking over period and amplitude"
    section = Section(title, "`sweeps/locking-map.toml`", ("locking-map",))
    sets = Sweep(results / "locking-map").sets()
    for low, high in pairwise((0, 0.5, 1, 1.5, 2, 3, 5, 10, 20)):
        mine = sets[(sets["eta"] >= low) & (sets["eta"] < high)]
        if len(mine) < 2:
            continue
        section.rows.append(
            {
                "η": f"{low:g} to {high:g}",
                "R above 0.5": f"{(mine['resultant_length'] > 0.5).mean():.2f}",
                "by the drive alone": f"{(mine['resultant_drive'] > 0.5).mean():.2f}",
                "R beyond the drive's": beyond_text(mine, "resultant"),
                "locking index beyond the drive's": beyond_text(mine, "locking_index"),
            }
        )
    natural = without_modulation(Sweep(results / "fig2").slips())["interval"]
    section.remark(
        f"{len(sets)} parameter sets, {sets['intervals'].sum()} intervals.",
        "A set lies beyond the drive's part if the interval of the difference does; by chance 0.025 of the sets do on"
        " either side. All sets have the same control of two seeds, so they err together.",
    )
    # How well a tongue locks may depend on where τ without modulation lies between two multiples of T.
    tongues = sets[(sets["eta"] > 1) & (sets["eta"] < 3)]
    beyond = (natural.mean() / tongues["T"]) % 1
    quarters = [
        mean(tongues["locking_index"][(beyond >= low) & (beyond < high)])
        for low, high in pairwise((0, 0.25, 0.5, 0.75, 1))
    ]
    matters = max(one.low for one in quarters) > min(one.high for one in quarters)
    section.remark(
        f"For η from 1 to 3 it {'matters' if matters else 'matters little'} where the unmodulated interval lies between"
        f" multiples of T: by quarters of T the locking index is {', '.join(f'{one.value:.2f}' for one in quarters)}."
    )
    return section


def stretches(holds: pandas.Series) -> str:
    """The periods at which something holds, in ms: each run of neighbours by its ends. The index is in s."""
    runs = (holds != holds.shift()).cumsum()
    found = [run.index for _, run in holds.groupby(runs) if run.iloc[0]]
    ends = [[f"{1e3 * end:.0f}" for end in (run[0], run[-1])] for run in found]
    return "; ".join(first if first == last else f"{first} to {last}" for first, last in ends) or "none"


def median_periods(slips: pandas.DataFrame) -> tuple[pandas.Series, pandas.Series]:
    """Median of τ/T by T, and whether it is on a step: within 0.05 of a whole number."""
    medians = slips.groupby("T")["tau_over_T"].median()
    return medians, (medians - medians.round()).abs() < 0.05


def staircase(results: Path) -> Section:
    title = "Devil's staircase: intervals in periods against the period"
    section = Section(title, "`sweeps/staircase.toml`", ("staircase",))
    slips = Sweep(results / "staircase").slips().dropna(subset="interval")
    shares = {}
    for amplitude, mine in slips.groupby("Delta"):
        medians, on_step = median_periods(mine)
        shares[amplitude] = jackknife(lambda rows: median_periods(rows)[1].mean(), mine)
        steps = {f"n = {n}: T (ms)": stretches(on_step & (medians.round() == n)) for n in range(1, 4)}
        section.rows.append({"Δ (µm)": f"{1e6 * amplitude:.1f}", "on a step": shares[amplitude].text(2)} | steps)
    widens = shares[max(shares)].low > shares[min(shares)].high
    section.remark(
        "A period is on a step if the median τ is within 0.05 T of nT, by chance 0.1 of them.",
        f"The steps {'widen' if widens else 'do not widen beyond their errors'} with the amplitude.",
    )
    return section


def dependences(results: Path) -> Section:
    title = "Locking against blocks, contacts and disorder"
    section = Section(
        title,
        "`sweeps/size.toml`, `sweeps/contacts.toml` and `sweeps/disorder.toml`, Δ = 1 µm",
        ("size", "contacts", "disorder"),
    )
    bunched, beyond = [], []
    for sweep, column, symbol in (("size", "N", "N"), ("contacts", "Ns", "N_s"), ("disorder", "disorder", "Δf_s/f_s")):
        slips = Sweep(results / sweep).slips()
        slips = slips.assign(disorder=(slips["dfs"] / slips["fs"]).round(3))
        still = select(slips, Delta=0.0).groupby(column)["interval"]
        tau, spread = 1e3 * still.mean(), still.std() / still.mean()
        modulated = select(slips, Delta=1e-6)
        lengths = [
            jackknife(lambda rows: resultant_length(rows["phase"]), rows)
            for _, rows in modulated[modulated["frequency"].isin(FREQUENCIES)].groupby([column, "frequency"])
        ]
        bunched += [length.low > 0.5 for length in lengths]
        sets = select(Sweep(results / sweep).sets(), Delta=1e-6)
        beyond.append(f"{beyond_text(sets, 'resultant')} ({symbol})")
        section.rows.append(
            {
                "varied": f"{symbol} from {slips[column].min():g} to {slips[column].max():g}",
                "τ unmodulated (ms)": f"{tau.min():.1f} to {tau.max():.1f}",
                "s.d. over mean": f"{spread.min():.2f} to {spread.max():.2f}",
                "least resultant of φ": min(lengths, key=lambda length: length.value).text(2),
            }
        )
    section.remark(
        f"At {', '.join(map(str, FREQUENCIES))} Hz the resultant of φ lies above 0.5 with its interval in"
        f" {sum(bunched)} of {len(bunched)} cases; beyond what the drive alone gives it lies in {'; '.join(beyond)}."
    )
    return section


def choices(results: Path) -> Section:
    source = "`sweeps/choices.toml`, `sweeps/startup.toml`, `sweeps/fig3.toml`"
    section = Section("What the model's choices change", source, ("choices",))
    sweep = Sweep(results / "choices")
    slips = sweep.slips()
    changes = []
    for name, values in (
        ("without modulation", {"Delta": 0.0}),
        ("at 29 Hz", {"Delta": 1e-6, "T": 1 / 29}),
        ("at 58 Hz", {"Delta": 1e-6, "T": 1 / 58}),
        ("at Δ = 5 µm, 200 Hz", {"Delta": 5e-6, "T": 1 / 200}),
    ):
        tension, magnitude = (select(slips, break_on=rule, **values) for rule in ("tension", "magnitude"))
        change = difference(tension, magnitude, "interval").scaled(1e3)
        pairs = tension.merge(magnitude, on=["seed", "slip"], suffixes=("", "_other"))
        same = (pairs["interval"] == pairs["interval_other"]).mean()
        changes.append(f"{change.text(3)} ms {name} ({100 * same:.0f} %)")
    section.item(
        '`break_on = "tension"` changes mean τ, and leaves some intervals the same to the last bit:'
        f" {'; '.join(changes)}."
    )
    still = select(slips, Delta=0.0, break_on="magnitude")
    precursors = of_same_jobs(sweep.table("precursors"), still)
    counts = (f"{count_by_slip(still, precursors, size).mean():.2f} at {size}" for size in (5, 10, *SIZES))
    section.item(f"`precursor_size`: precursors per slip by their least number of breaks: {', '.join(counts)}.")
    phases = Sweep(results / "fig3").slips()
    phases = phases[phases["eta"] > WHOLE_WINDOW]
    past = phases["phase"] - numpy.arcsin(1 / phases["eta"])
    section.item(
        f"Window of the phase: {100 * (past > 0).mean():.2f} % of the slips of `fig3` at η > {WHOLE_WINDOW} lie past"
        f" Φ_max, by at most {past.max():.3f} rad of 0.5."
    )
    slips = Sweep(results / "startup").slips()
    p = startup(slips)
    needed = p.index[p < 0.05].max() + 1 if (p < 0.05).any() else 0
    section.item(
        f"Start-up (`discard`): in {slips['set_id'].nunique()} sets of {slips['seed'].nunique()} seeds the first {needed}"
        " slips differ from those from 20 on (Mann-Whitney, Holm's correction, 5 %); after them the least p is"
        f" {p[p.index >= needed].min():.2f}."
    )
    return section


def startup(slips: pandas.DataFrame, numbers: int = 20) -> pandas.Series:
    """By slip number, the least p-value of a set that its intervals or drops are those of slips from `numbers` on.

    Those at one number are independent, a slip of each seed. The later ones of a seed are not, but there are so many
    that their error hardly counts.
    """
    least = pandas.Series(1.0, index=range(numbers))
    for _, mine in slips.groupby("set_id"):
        for column in ("interval", "drop"):
            values = mine.dropna(subset=[column])
            later = values[column][values["slip"] >= numbers]
            if later.empty:
                continue
            early = values[values["slip"] < numbers].groupby("slip")[column]
            p = early.apply(lambda sample: stats.mannwhitneyu(sample, later, method="asymptotic").pvalue).sort_values()
            # Holm, Scand. J. Stat. 6, 65 (1979).
            adjusted = (p * numpy.arange(len(p), 0, -1)).cummax()
            least = least.combine(adjusted, min, fill_value=1.0)
    return least


def energies(results: Path) -> Section:
    section = Section("Where the work of the drive goes", "`sweeps/energies.toml`, Δ = 0 and 1 µm")
    slips = Sweep(results / "energies").slips()
    for period, mine in slips.groupby("T", dropna=False):
        broken = jackknife(lambda frame: frame["break_loss"].sum() / frame["drive_work"].sum(), mine)
        section.rows.append(
            {
                "modulation": "none" if numpy.isnan(period) else f"{1 / period:.0f} Hz",
                "work per slip (mJ)": mean(1e3 * mine.groupby("seed")["drive_work"].mean()).text(2),
                "lost in broken contacts": broken.text(3),
            }
        )
    section.remark("The rest is lost in damping.")
    return section
