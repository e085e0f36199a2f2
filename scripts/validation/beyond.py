"""Questions that the paper leaves open: each a sweep, a figure and a finding, with its statistical error."""

import math

import numpy
import pandas

from .document import Section
from .estimate import jackknife, locking_index, mean, near_whole, paired, share
from .paper import SIZES, count_by_slip, envelope, minimum_phase
from .results import Results, of

#: Locking index from which a set is called strongly locked here.
STRONG = 0.8
#: Periods in s up to which the locking index tells locking: near T = τ it is large for any narrow distribution of τ.
SHORT = 0.04
FREQUENCIES = (29, 58, 116)


def questions(results: Results) -> list[Section]:
    return [
        drag(results, "drag", "1 µm", "drag"),
        drag(results, "drag-strong", "3 µm", "drag-strong"),
        locking_map(results),
        staircase(results),
        against(results, "size", "N", "the number of blocks N", lambda value: f"{value:.0f}"),
        against(results, "contacts", "Ns", "the number of contacts per block N_s", lambda value: f"{value:.0f}"),
        against(results, "disorder", "dfs", "the disorder of the thresholds Δf_s/f_s", lambda value: f"{value / 1.37:.3f}"),
        stiff_drive(results),
        choices(results),
    ]


def length_of(phases) -> float:
    """Resultant length |<exp(iφ)>|."""
    return float(abs(numpy.exp(1j * phases).mean()))


def by_set(slips, column, statistic):
    """A statistic of a column for each parameter set."""
    return slips.groupby("set_id")[column].apply(statistic)


def drag(results: Results, sweep: str, amplitude: str, picture: str) -> Section:
    title = f"Drag: the period changed slowly within one run, Δ = {amplitude}"
    section = Section(title, f"`sweeps/{sweep}.toml`", picture)
    slips = results.slips(sweep)
    slips = slips[slips["interval"].notna() & (slips["onset"] < 2 * slips["ramp_time"])]
    slips = slips.assign(periods=slips["interval"] / slips["T_onset"], there=slips["onset"] < slips["ramp_time"])
    near = share(near_whole(slips["periods"]), slips["seed"])
    section.check(
        "T changed during a run drags τ with it (page 3)",
        "more than 0.5 of the intervals within 0.1 T of nT, while T changes",
        near.text(),
        near.low > 0.5,
    )
    edges = numpy.linspace(slips["T_onset"].min(), slips["T_onset"].max(), 13)
    rows, differences = [], []
    for low, high in zip(edges, edges[1:]):
        bin = slips[(slips["T_onset"] >= low) & (slips["T_onset"] <= high)]
        there, back = bin[bin["there"]], bin[~bin["there"]]
        difference = paired(back, there, "n")
        differences.append(difference)
        rows.append(
            [
                f"{1e3 * low:.1f} to {1e3 * high:.1f}",
                *(f"{1e3 * part['interval'].median():.1f}" for part in (there, back)),
                *(f"{part['n'].mean():.2f}" for part in (there, back)),
                difference.text(2),
            ]
        )
    section.table = (
        ["T (ms)", "median τ (ms), there", "back", "mean n, there", "back", "back − there, paired by seed"],
        rows,
    )
    distinct = sum(difference.low > 0 or difference.high < 0 for difference in differences)
    binned = slips.assign(bin=numpy.digitize(slips["T_onset"], edges[1:-1])).groupby(["seed", "bin", "there"])["n"].mean().unstack()
    whole = mean((binned[False] - binned[True]).groupby("seed").mean())
    remembers = whole.low > 0 or whole.high < 0
    section.remarks.append(
        f"Hysteresis: n on the way back differs from n on the way there, beyond its 95 % interval, in {distinct} of {len(differences)} bins of T (by chance about {0.05 * len(differences):.1f}); "
        f"averaged over the bins by {whole.text(3)}. "
        + (
            "So where T came from leaves a trace, of a small part of a period."
            if remembers
            else "No memory of where T came from is seen: n is drawn anew at each slip, and follows T alike on both ways."
        )
    )
    return section


def locking_map(results: Results) -> Section:
    section = Section("Arnold tongues: locking over period and amplitude", "`sweeps/locking-map.toml`", "locking-map")
    slips = results.slips("locking-map")
    slips = slips[slips["interval"].notna()]
    single = slips.groupby("set_id").agg(eta=("eta", "first"), Delta=("Delta", "first"), T=("T", "first"))
    single["index"] = by_set(slips, "periods", locking_index)
    single["locked"] = results.reduced("locking-map", "sets").set_index("set_id")["locked"]
    edges = [0, 0.5, 1, 1.5, 2, 3, 5, 10, 20]
    rows = []
    for low, high in zip(edges, edges[1:]):
        sets = single[(single["eta"] >= low) & (single["eta"] < high)]
        if len(sets) < 2:
            continue
        short = sets[sets["T"] < SHORT]
        rows.append(
            [
                f"{low:g} to {high:g}",
                len(sets),
                mean(sets["locked"].astype(float)).text(2),
                mean(short["index"]).text() if len(short) > 1 else "",
                f"{(short['index'] > STRONG).mean():.2f}" if len(short) else "",
            ]
        )
    section.table = (
        ["η", "sets", "share with locked phases", f"mean locking index, T < {1e3 * SHORT:.0f} ms", f"share of these above {STRONG}"],
        rows,
    )
    free = numpy.sqrt(math.pi / 4 / (slips.groupby("set_id").size().mean()))
    section.remarks.append(
        f"{len(single)} parameter sets, {len(slips)} intervals. A set without any locking has an index of {free:.2f} on average, as it has {slips.groupby('set_id').size().mean():.0f} intervals."
    )
    # How well a tongue locks depends on where τ without modulation lies between two multiples of T.
    strong = single[(single["eta"] > 1) & (single["eta"] < 3)]
    natural = of(results.slips("fig2"), Delta=0.0, dfs=6.9e-3)["interval"].mean()
    beyond = (natural / strong["T"]) % 1
    ends = [0, 0.25, 0.5, 0.75, 1]
    means = [mean(strong["index"][(beyond >= low) & (beyond < high)]) for low, high in zip(ends, ends[1:])]
    matters = max(one.low for one in means) > min(one.high for one in means)
    section.remarks.append(
        f"For η from 1 to 3 it {'matters' if matters else 'matters little'} where the interval without modulation, τ_0 = {natural:.4f} s, lies between two multiples of T: for τ_0/T modulo 1 in the four quarters of a turn the mean locking index is "
        + ", ".join(one.text(2) for one in means)
        + "."
    )
    return section


def stretches(holds: pandas.Series) -> str:
    """The periods, in ms, at which something holds: each run of neighbours by its ends."""
    runs = (holds != holds.shift()).cumsum()
    found = [run.index for _, run in holds.groupby(runs) if run.iloc[0]]
    ends = [[f"{1e3 * end:.0f}" for end in (run[0], run[-1])] for run in found]
    return "; ".join(first if first == last else f"{first} to {last}" for first, last in ends) or "none"


def staircase(results: Results) -> Section:
    section = Section("Devil's staircase: intervals in periods against the period", "`sweeps/staircase.toml`", "staircase")
    slips = results.slips("staircase")
    slips = slips[slips["interval"].notna()]
    rows, shares, jumps = [], {}, {}
    for amplitude in sorted(set(slips["Delta"])):
        mine = of(slips, Delta=amplitude)
        steps = mine.groupby("T")["periods"].median()
        on_step = (steps - steps.round()).abs() < 0.05
        widths = [stretches(on_step & (steps.round() == n)) for n in range(1, 7)]
        shares[amplitude] = jackknife(mine, near_step)
        whole_steps = steps[on_step].round()
        jumps[amplitude] = int((whole_steps.diff().dropna() > 0).sum())
        rows.append([f"{1e6 * amplitude:.1f}", shares[amplitude].text(2), *widths])
    section.table = (
        ["Δ (µm)", "share of the periods T whose median τ is within 0.05 T of nT", *(f"n = {n}: T (ms)" for n in range(1, 7))],
        rows,
    )
    weakest, strongest = min(shares), max(shares)
    widens = shares[strongest].low > shares[weakest].high
    section.remarks.append(
        f"By chance the share would be 0.1. The steps {'widen' if widens else 'do not widen beyond their errors'} with the amplitude: {shares[weakest].text(2)} of the periods lie on one at {1e6 * weakest:.1f} µm, "
        f"{shares[strongest].text(2)} at {1e6 * strongest:.1f} µm. As T grows n should fall from step to step; it rises again "
        + ", ".join(f"{count} times at {1e6 * amplitude:.1f} µm" for amplitude, count in jumps.items())
        + f", over {slips['T'].nunique()} periods: steps of neighbouring n overlap, since each slip draws its n. Only steps of whole n are looked for; a median half-way between two says that slips take both in turn or at random."
    )
    return section


def near_step(rows) -> float:
    """Share of the periods T at which the median of τ lies within 0.05 T of a whole number of periods."""
    steps = rows.groupby("T")["periods"].median()
    return float(((steps - steps.round()).abs() < 0.05).mean())


def against(results: Results, sweep: str, key: str, what: str, shown) -> Section:
    section = Section(f"Locking against {what}", f"`sweeps/{sweep}.toml`, Δ = 1 µm", sweep)
    slips = results.slips(sweep)
    rows, weakest = [], {}
    for value in sorted(set(slips[key])):
        mine = slips[slips[key] == value]
        still = mine[mine["Delta"] == 0]
        tau = jackknife(still, lambda rows: 1e3 * rows["interval"].mean())
        spread = jackknife(still, lambda rows: rows["interval"].std() / rows["interval"].mean())
        lengths = [jackknife(of(mine, Delta=1e-6, frequency=frequency), lambda rows: length_of(rows["phase"])) for frequency in FREQUENCIES]
        weakest[value] = min(lengths, key=lambda length: length.value)
        rows.append([shown(value), tau.text(1), spread.text(2), *(length.text(2) for length in lengths)])
    section.table = (
        [what, "τ without modulation (ms)", "its s.d. over mean", *(f"resultant length of φ at {f} Hz" for f in FREQUENCIES)],
        rows,
    )
    locked = [value for value, length in weakest.items() if length.low > 0.5]
    section.remarks.append(
        "The phases are locked at all three frequencies (resultant length above 0.5 beyond its 95 % interval) at "
        + (("all of these values" if len(locked) == len(weakest) else ", ".join(map(shown, locked))) if locked else "none of these values")
        + ". At its weakest the resultant length is "
        + ", ".join(f"{length.text(2)} at {shown(value)}" for value, length in weakest.items())
        + "."
    )
    return section


def stiff_drive(results: Results) -> Section:
    section = Section("The experiment's drive: K_d = 1e9 N/m", "`sweeps/stiff-drive.toml`, K_d Δ = 20 to 100 N", "stiff-drive-phase")
    slips = results.slips("stiff-drive")
    slips = slips[slips["phase"].notna()]
    above = slips[slips["eta"] > 2]
    limits = above["eta"].map({eta: minimum_phase(eta) for eta in above["eta"].unique()})
    under = share(above["phase"] < limits - 0.15, above["set_id"])
    section.check(
        "(d) the experiment: almost no slip under the back-bone",
        "share of slips more than 0.15 rad under φ_min below 0.02, η > 2",
        under.text(4),
        under.high < 0.02,
    )
    section.check(*envelope(above))
    rows = []
    for low, high in ((0, 0.7), (1, 2), (2, 5), (5, 20), (20, 100), (100, 1001)):
        bin = slips[(slips["eta"] >= low) & (slips["eta"] < high)]
        if not bin.empty:
            lengths = by_set(bin, "phase", length_of)
            rows.append([f"{low} to {min(high, 1000)}", len(lengths), mean(lengths).text(2)])
    section.table = (["η", "sets", "resultant length of φ, mean over sets"], rows)
    return section


def choices(results: Results) -> Section:
    section = Section("What the model's choices change", "`sweeps/choices.toml`, `sweeps/startup.toml`, `sweeps/fig3.toml`", "choices")
    slips, jobs = results.slips("choices"), results.table("choices", "jobs")
    for name, values in (
        ("no modulation", {"Delta": 0.0}),
        ("29 Hz", {"Delta": 1e-6, "T": 1 / 29}),
        ("58 Hz", {"Delta": 1e-6, "T": 1 / 58}),
        ("Δ = 5 µm, 200 Hz", {"Delta": 5e-6, "T": 1 / 200}),
    ):
        tension, magnitude = (of(slips, break_on=rule, **values) for rule in ("tension", "magnitude"))
        difference = paired(tension, magnitude, "interval")
        pairs = tension.merge(magnitude, on=["seed", "slip"], suffixes=("", "_other"))
        same = (pairs["interval"] == pairs["interval_other"]).mean()
        section.remarks.append(
            f"- `break_on = \"tension\"` instead of `\"magnitude\"`, {name}: mean τ differs by {difference.text(3, 1e3)} ms, paired by seed; {100 * same:.0f} % of {len(pairs)} intervals are the same to the last bit."
        )
    precursors = results.table("choices", "precursors")
    still = of(slips, Delta=0.0, break_on="magnitude")
    precursors = precursors[precursors["job_id"].isin(still["job_id"])]
    counts = ", ".join(f"{count_by_slip(still, precursors, size).mean():.2f} at {size}" for size in (5, 10, *SIZES))
    section.remarks.append(f"- `precursor_size`: precursors per slip without modulation, by the least number of breaks: {counts}.")
    phases = results.slips("fig3")
    phases = phases[phases["eta"] > 1.014]
    past = phases["phase"] - numpy.arcsin(1 / phases["eta"])
    section.remarks.append(
        f"- Window of the phase: {100 * (past > 0).mean():.2f} % of the slips of `fig3` at η > 1.014 lie past Φ_max, by at most {past.max():.3f} rad; the window reaches 0.5 rad past it."
    )
    section.remarks.append(startup(results))
    return section


def startup(results: Results) -> str:
    """How many slips differ from later ones, by the rank tests of the reduction."""
    table = results.reduced("startup", "startup")
    differs = table[table[["interval_holm_p", "drop_holm_p"]].min(axis=1) < 0.05]
    needed = int(differs["slip"].max()) + 1 if len(differs) else 0
    beyond = table[table["slip"] >= needed][["interval_holm_p", "drop_holm_p"]].min().min()
    return (
        f"- Start-up (5 slips discarded by default; F_S(0) = 0): over {table['set_id'].nunique()} sets of {int(table['jobs'].max())} seeds, intervals and stress drops differ from those of slips 20 on "
        f"(Mann-Whitney, Holm's correction, 5 %) in the first {needed} slips; from then on the smallest corrected p is {beyond:.2f}."
    )
