"""Questions that the paper leaves open: each a sweep, a figure and a finding, with its statistical error."""

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy
import pandas

from ..statistics import difference, jackknife, locking_index, mean, near_whole, resultant_length, share
from ..tables import Sweep, select
from .document import Section
from .intervals import SIZES, count_by_slip, of_same_jobs, without_modulation
from .kinematics import locked_by_chance, locked_in_load

#: Locking index from which a set is called strongly locked here.
STRONG = 0.8
#: Periods in s up to which the locking index shows locking: near T = τ it is large for any narrow distribution of τ.
SHORT = 0.04
#: Frequencies in Hz of the sweeps of size, contacts and disorder.
FREQUENCIES = (29, 58, 116)
#: η from which the window of the phase holds φ_min (docs/model.md).
WHOLE_WINDOW = 1.014


def drag(results: Path, *, sweep: str, amplitude: str) -> Section:
    """Whether intervals follow a period that changes slowly, and whether they remember where it came from."""
    title = f"Drag: T changed slowly within one run, Δ = {amplitude}"
    section = Section(title, f"`sweeps/{sweep}.toml`", sweep)
    slips = Sweep(results / sweep).slips()
    slips = slips[slips["interval"].notna() & (slips["onset"] < 2 * slips["ramp_time"])]
    edges = numpy.linspace(slips["T_onset"].min(), slips["T_onset"].max(), 13)
    slips = slips.assign(is_up=slips["onset"] < slips["ramp_time"], bin=numpy.digitize(slips["T_onset"], edges[1:-1]))
    near = share(near_whole(slips["interval"] / slips["T_onset"]), slips["seed"])
    section.check(
        "T drags τ with it (page 3)",
        "more than 0.5 of the intervals within 0.1 T of nT while T changes",
        near.text(),
        near.low > 0.5,
    )
    differences = []
    for _, mine in slips.groupby("bin"):
        differences.append(difference(mine[~mine["is_up"]], mine[mine["is_up"]], "n"))
    means = slips.groupby(["seed", "bin", "is_up"])["n"].mean().unstack()
    whole = mean((means[False] - means[True]).groupby("seed").mean())
    section.remark(
        f"Hysteresis: n while T falls minus n while T rises is {whole.text(3)} in the mean, and beyond its interval in"
        f" {sum(one.excludes_zero() for one in differences)} of {len(differences)} bins of T"
        f" (by chance {0.05 * len(differences):.1f}): {'a small memory' if whole.excludes_zero() else 'no memory is seen'}.",
    )
    return section


DRAGS = (
    partial(drag, sweep="drag", amplitude="1 µm"),
    partial(drag, sweep="drag-strong", amplitude="3 µm"),
)


def locking_map(results: Path) -> Section:
    """Where slips lock, over period and amplitude."""
    section = Section("Arnold tongues: locking over period and amplitude", "`sweeps/locking-map.toml`", "locking-map")
    sweep = Sweep(results / "locking-map")
    sets = sweep.reduced("sets")
    chance = [locked_by_chance(*one, 200) for one in zip(sets["eta"], sets["slips"], strict=True)]
    sets = sets.assign(chance=[locked for locked, _ in chance], chance_index=[index for _, index in chance])
    for low, high in pairwise((0, 0.5, 1, 1.5, 2, 3, 5, 10, 20)):
        mine = sets[(sets["eta"] >= low) & (sets["eta"] < high)]
        if len(mine) < 2:
            continue
        is_short = mine["T"] < SHORT
        short, expected = mine["locking_index"][is_short], mine["chance_index"][is_short]
        section.rows.append(
            {
                "η": f"{low:g} to {high:g}",
                "sets": len(mine),
                "locked by φ": mean(mine["locked"].astype(float)).text(2),
                "random loads": f"{mine['chance'].mean():.2f}",
                f"locking index, T < {1e3 * SHORT:.0f} ms": mean(short).text(2) if len(short) > 1 else "",
                "beyond random loads": mean(short - expected).text(2) if len(short) > 1 else "",
                f"above {STRONG}": f"{(short > STRONG).mean():.2f}" if len(short) else "",
            }
        )
    natural = without_modulation(Sweep(results / "fig2").slips())["interval"]
    under = sets[sets["eta"] < 1]
    slips = sweep.slips()
    in_load = locked_in_load(under, slips[slips["eta"] < 1].dropna(subset="phase"))
    over = sets[(sets["eta"] > 1) & (sets["eta"] < 2)]
    section.remark(
        f"{len(sets)} parameter sets, {sets['intervals'].sum()} intervals.",
        f"For η from 1 to 2 {over['locked'].mean():.2f} are locked by φ, random loads {over['chance'].mean():.2f}; below 1"
        f" {under['locked'].sum()} of {len(under)}, random loads {under['chance'].sum():.0f}, and by the load phase"
        f" {in_load.sum()}.",
        "Not all beyond random loads is locking, as τ varies little: unmodulated, its locking index is"
        f" {locking_index(29 * natural):.2f} at 29 Hz.",
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
        f"For η from 1 to 3 it {'matters' if matters else 'matters little'} where the unmodulated interval,"
        f" {natural.mean():.4f} s, lies between multiples of T: in the four quarters of a period the locking index is"
        f" {', '.join(one.text(2) for one in quarters)}."
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
    medians = slips.groupby("T")["periods"].median()
    return medians, (medians - medians.round()).abs() < 0.05


def staircase(results: Path) -> Section:
    """How wide the steps of τ = nT are."""
    section = Section(
        "Devil's staircase: intervals in periods against the period", "`sweeps/staircase.toml`", "staircase"
    )
    slips = Sweep(results / "staircase").slips().dropna(subset="interval")
    shares, rises = {}, []
    for amplitude, mine in slips.groupby("Delta"):
        medians, on_step = median_periods(mine)
        shares[amplitude] = jackknife(lambda rows: median_periods(rows)[1].mean(), mine)
        rises.append(f"{(medians[on_step].round().diff() > 0).sum()} times at {1e6 * amplitude:.1f} µm")
        stated = "on a step"
        steps = {f"n = {n}: T (ms)": stretches(on_step & (medians.round() == n)) for n in range(1, 7)}
        section.rows.append({"Δ (µm)": f"{1e6 * amplitude:.1f}", stated: shares[amplitude].text(2)} | steps)
    weakest, strongest = min(shares), max(shares)
    widens = shares[strongest].low > shares[weakest].high
    section.remark(
        f"A period T is on a step if the median τ is within 0.05 T of nT: 0.1 are by chance, of {slips['T'].nunique()}.",
        f"The steps {'widen' if widens else 'do not widen beyond their errors'} with the amplitude.",
        f"As T grows n should fall from step to step; it rises {', '.join(rises)}: steps of neighbouring n overlap.",
    )
    return section


def dependence(results: Path, *, sweep: str, column: str, what: str, symbol: str, digits: int = 0) -> Section:
    """How interval and locking depend on a parameter of the interface."""
    section = Section(f"Locking against {what}", f"`sweeps/{sweep}.toml`, Δ = 1 µm", sweep)
    slips = Sweep(results / sweep).slips()
    slips = slips.assign(disorder=slips["dfs"] / slips["fs"])
    weakest = []
    for value, mine in slips.groupby(column):
        still = select(mine, Delta=0.0)
        tau = jackknife(lambda rows: 1e3 * rows["interval"].mean(), still)
        spread = jackknife(lambda rows: rows["interval"].std() / rows["interval"].mean(), still)
        lengths = (
            jackknife(lambda rows: resultant_length(rows["phase"]), select(mine, Delta=1e-6, frequency=frequency))
            for frequency in FREQUENCIES
        )
        weakest.append(min(lengths, key=lambda length: length.value))
        section.rows.append(
            {
                symbol: f"{value:.{digits}f}",
                "τ unmodulated (ms)": tau.text(1),
                "s.d. over mean": spread.text(2),
                "least resultant of φ": weakest[-1].text(2),
            }
        )
    locked = [row[symbol] for row, length in zip(section.rows, weakest, strict=True) if length.low > 0.5]
    where = "everywhere" if len(locked) == len(weakest) else f"at {', '.join(locked)}" if locked else "nowhere"
    section.remark(
        f"At {', '.join(map(str, FREQUENCIES))} Hz phases are locked {where} (resultant and interval above 0.5)."
    )
    return section


DEPENDENCES = (
    partial(dependence, sweep="size", column="N", what="the number of blocks", symbol="N"),
    partial(dependence, sweep="contacts", column="Ns", what="the contacts per block", symbol="N_s"),
    partial(dependence, sweep="disorder", column="disorder", what="the disorder", symbol="Δf_s/f_s", digits=3),
)


def choices(results: Path) -> Section:
    """What would change if the model's choices were others."""
    source = "`sweeps/choices.toml`, `sweeps/startup.toml`, `sweeps/fig3.toml`"
    section = Section("What the model's choices change", source, "choices")
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
        '`break_on = "tension"` changes mean τ, and leaves a share of the intervals as they are to the last bit:'
        f" {'; '.join(changes)}."
    )
    still = select(slips, Delta=0.0, break_on="magnitude")
    precursors = of_same_jobs(sweep.table("precursors"), still)
    counts = (f"{count_by_slip(still, precursors, size).mean():.2f} at {size}" for size in (5, 10, *SIZES))
    section.item(
        f"`precursor_size`: precursors per slip by their least number of breaks: {', '.join(counts)}."
    )
    phases = Sweep(results / "fig3").slips()
    phases = phases[phases["eta"] > WHOLE_WINDOW]
    past = phases["phase"] - numpy.arcsin(1 / phases["eta"])
    section.item(
        f"Window of the phase: {100 * (past > 0).mean():.2f} % of the slips of `fig3` at η > {WHOLE_WINDOW} lie past"
        f" Φ_max, by at most {past.max():.3f} rad of 0.5."
    )
    startup = Sweep(results / "startup").reduced("startup")
    p = startup[["interval_holm_p", "drop_holm_p"]].min(axis=1)
    needed = startup["slip"][p < 0.05].max() + 1 if (p < 0.05).any() else 0
    section.item(
        f"Start-up (`discard`): in {startup['set_id'].nunique()} sets of {startup['jobs'].max()} seeds the first {needed}"
        " slips differ from those from 20 on (Mann-Whitney, Holm's correction, 5 %); after them the least p is"
        f" {p[startup['slip'] >= needed].min():.2f}."
    )
    return section


def energies(results: Path) -> Section:
    """Where the work of the drive goes."""
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
    section.remark(
        "The rest is lost in damping, which the paper introduces to avoid artificial vibrations of the blocks.",
    )
    return section
