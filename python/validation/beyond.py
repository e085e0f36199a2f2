"""Questions that the paper leaves open: each a sweep, a figure and a finding, with its statistical error."""

from itertools import pairwise
from pathlib import Path

import numpy
import pandas
from scipy import stats

from stickslip.statistics import difference, jackknife, mean, near_whole, share
from stickslip.tables import Sweep, select

from .document import Section
from .intervals import count_by_slip, of_same_jobs
from .kinematics import load_phase, mean_excess

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
        followed.append(near.lies(above=0.5))
        texts.append(f"{near.text()} at {amplitude}")
        edges = numpy.linspace(slips["T_onset"].min(), slips["T_onset"].max(), 13)
        slips = slips.assign(
            is_up=slips["onset"] < slips["ramp_time"], bin=numpy.digitize(slips["T_onset"], edges[1:-1])
        )
        means = slips.groupby(["seed", "bin", "is_up"])["periods"].mean().unstack()
        whole = mean((means[False] - means[True]).groupby("seed").mean())
        memories.append(f"{whole.text(3)} at {amplitude}")
    section.check(
        "T drags τ with it (page 3)",
        "more than 0.5 of the intervals within 0.1 T of nT while T changes",
        ", ".join(texts),
        *followed,
    )
    section.remark("Hysteresis is the mean n while T falls minus that while T rises.", f"It is {', '.join(memories)}.")
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
                "R": f"{mine['resultant_length'].mean():.3f}",
                "of the drive alone": f"{mine['resultant_drive'].mean():.3f}",
                "locking index": f"{mine['locking_index'].mean():.3f}",
                "of the drive alone ": f"{mine['locking_index_drive'].mean():.3f}",
            }
        )
    section.remark(
        f"Means over {len(sets)} sets with {sets['intervals'].sum()} intervals. They share a control of two seeds, so they err"
        " together.",
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
    section = Section(title, "`sweeps/locking-staircase.toml`", ("staircase",))
    slips = Sweep(results / "locking-staircase").slips().dropna(subset="interval")
    shares = {}
    for amplitude, mine in slips.groupby("Delta"):
        medians, on_step = median_periods(mine)
        shares[amplitude] = jackknife(lambda rows: median_periods(rows)[1].mean(), mine)
        steps = {f"n = {n}: T (ms)": stretches(on_step & (medians.round() == n)) for n in range(1, 4)}
        section.rows.append({"Δ (µm)": f"{1e6 * amplitude:.1f}", "on a step": shares[amplitude].text(2)} | steps)
    widens = shares[max(shares)].low > shares[min(shares)].high
    section.remark(
        "A period is on a step if the median τ is within 0.05 T of nT; 0.1 are by chance.",
        f"The steps {'widen' if widens else 'do not widen beyond their errors'} with the amplitude.",
    )
    return section


def dependences(results: Path) -> Section:
    title = "Locking against blocks, contacts and disorder"
    section = Section(
        title,
        "`sweeps/locking-size.toml`, `locking-contacts.toml` and `locking-disorder.toml`, Δ = 1 µm",
        ("size", "contacts", "disorder"),
    )
    bunched = []
    for sweep, column, symbol in (("size", "N", "N"), ("contacts", "Ns", "N_s"), ("disorder", "disorder", "Δf_s/f_s")):
        sets = Sweep(results / f"locking-{sweep}").sets()
        sets = sets.assign(disorder=(sets["dfs"] / sets["fs"]).round(3))
        still, modulated = (select(sets, Delta=amplitude) for amplitude in (0.0, 1e-6))
        tau, spread = 1e3 * still["tau_mean"], still["tau_sd"] / still["tau_mean"]
        bunched += list(modulated["resultant_length_low"] > 0.5)
        section.rows.append(
            {
                "varied": f"{symbol} from {sets[column].min():g} to {sets[column].max():g}",
                "τ of the control (ms)": f"{tau.min():.1f} to {tau.max():.1f}",
                "s.d. over mean": f"{spread.min():.2f} to {spread.max():.2f}",
                "least R": f"{modulated['resultant_length'].min():.2f}",
                "excess of R": mean_excess(modulated, "resultant").text(2),
            }
        )
    section.remark(
        f"R lies above 0.5 with its interval in {sum(bunched)} of {len(bunched)} sets.",
    )
    return section


def choices(results: Path) -> Section:
    source = "`sweeps/choices.toml`, `sweeps/choices-startup.toml`, `sweeps/fig3.toml`"
    section = Section("What the model's choices change", source)
    sweep = Sweep(results / "choices")
    slips = sweep.slips()
    changes, unchanged = [], []
    for name, values in (
        ("in the control", {"Delta": 0.0}),
        ("at 29 Hz", {"Delta": 1e-6, "T": 1 / 29}),
        ("at 58 Hz", {"Delta": 1e-6, "T": 1 / 58}),
        ("at Δ = 5 µm, 200 Hz", {"Delta": 5e-6, "T": 1 / 200}),
    ):
        tension, magnitude = (select(slips, V0=1e-4, break_on=rule, **values) for rule in ("tension", "magnitude"))
        change = difference(tension, magnitude, "interval").scaled(1e3)
        pairs = tension.merge(magnitude, on=["seed", "slip"], suffixes=("", "_other"))
        same = (pairs["interval"] == pairs["interval_other"]).mean()
        # Intervals of either rule that have the same bits.
        (unchanged if same == 1 else changes).append(name if same == 1 else f"mean τ by {change.text(3)} ms {name}")
    section.item(
        f'`break_on = "tension"` changes {", ".join(changes) or "nothing"};'
        f" no interval {', '.join(unchanged) or 'is the same everywhere'}."
    )
    slips = slips[slips["break_on"] == "magnitude"]
    paper = slips[(slips["V0"] < 2e-4) & (slips["Delta"] < 2e-6)]
    still = select(paper, Delta=0.0)
    precursors = of_same_jobs(sweep.table("precursors"), still)
    counts = (f"{count_by_slip(still, precursors, size).mean():.2f} from {size} breaks on" for size in (5, 20, 40, 100))
    section.item(f"`precursor_size`: precursors of a slip of the control: {', '.join(counts)}.")
    whole = of_same_jobs(sweep.table("precursors"), slips)["extent"] >= slips["N"].iloc[0]
    released = 1 - slips["least_attached"] / slips["attached_before"]
    section.item(
        f"Cut of a slip (half of the attached contacts, a tenth of all): it rejects {whole.sum()} ruptures of extent N."
        f" Slips release at least {released.min():.2f} of the attached contacts, {released[paper.index].min():.2f} for Δ up to"
        " 1 µm at 1e-4 m/s."
    )
    sizes = ", ".join(f"{(still['largest_drop_before'] >= size).mean():.2f} from {size} N" for size in (0.5, 2, 10))
    section.item(
        f"`drop_size`: for the same Δ and V0 the least drop of a slip is {paper['drop_during'].min():.0f} N."
        f" The share of the slips of the control that follow another drop is {sizes}."
    )
    sliding = sweep.table("jobs").query("slips == 0 and Delta == 0")
    given_up = (sliding["V0"] * sliding["simulated_time"]).min()
    waits = (slips["V0"] * slips["interval"])[slips["Delta"] == 0].max()
    section.item(
        f"`give_up_after`: the longest wait for a slip of the control is {waits / given_up:.2f} of it, from 1e-4 to 1e-3 m/s."
    )
    shares = select(sweep.sets(), Delta=0.0, break_on="magnitude").sort_values("V0")
    levels = (0.4, 0.5, 0.6, 0.9, 0.95, 0.99)
    edges = 1e3 * numpy.interp(levels, shares["slip_share"], shares["V0"])
    section.item(
        "Edges of the regimes in mm/s, by the share of time within slips:"
        f" {', '.join(f'{edge:.2f} at {level:g}' for edge, level in zip(edges, levels, strict=True))}."
    )
    phases = Sweep(results / "fig3").slips()
    high = phases[phases["eta"] > WHOLE_WINDOW]
    past = high["phase"] - numpy.arcsin(1 / high["eta"])
    section.item(
        f"Window of the phase: {100 * (past > 0).mean():.2f} % of the slips of `fig3` at η > {WHOLE_WINDOW} lie past"
        f" Φ_max, by at most {past.max():.3f} rad of 0.5."
    )
    low = phases[phases["eta"].between(0.28, 0.29) & (phases["Delta"] > 9e-7)]
    memory = numpy.exp(1j * load_phase(low)).groupby(low["slip"]).mean().abs()
    later = len(memory) // 2
    # A short sweep has no such sets.
    if not memory.empty:
        section.item(
            "Start at a maximum of the modulation: at η = 0.285 and Δ = 1 µm in `fig3`, load phases of"
            f" {low['job_id'].nunique()} jobs have an R of {memory.iloc[0]:.2f} at the first slip and of"
            f" {memory.iloc[later:].max():.2f} at most from slip {later + 1} on."
        )
    slips = Sweep(results / "choices-startup").slips()
    p = startup(slips)
    needed = p.index[p < 0.05].max() + 1 if (p < 0.05).any() else 0
    section.item(
        f"Start-up (`discard`): in {slips['set_id'].nunique()} sets of {slips['seed'].nunique()} seeds the first {needed}"
        " slips differ from those from 20 on (Mann-Whitney, Holm's correction, 5 %); the least p of later ones is"
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
