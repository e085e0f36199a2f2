"""Redraws two figures of a sweep from its reduced data, as a start for your own.

    .venv/bin/python python/examples/redraw.py results/fig3

Writes two files into the current folder: phase-eta.png, phases against eta with the backbone (Fig. 3e), from
reduced/points.parquet and reduced/backbone.parquet; staircase.png, intervals in periods against the period, a colour
for each amplitude, from reduced/sets.parquet.
"""

import sys

import matplotlib

matplotlib.use("Agg")  # draws into files; needs no screen

import matplotlib.pyplot as plt
import numpy as np

import stickslip


def phase_eta(results):
    """Phases of slips, means of all slips in bins of eta, and where Eq. 2 lets slips begin."""
    opened = stickslip.open(results)
    points = opened.points().to_pandas().dropna(subset="phase")
    bins = opened.backbone().to_pandas()
    figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
    for has_phase, colour, label in ((False, "0.6", "no phase"), (True, "black", "sets with a phase")):
        slips = points[points["has_phase"] == has_phase]
        axes.plot(slips["eta"], slips["phase"], ".", color=colour, markersize=2, label=label)
    etas = [points["eta"][points["eta"].between(one.eta_low, one.eta_high, "left")] for one in bins.itertuples()]
    middles = [(eta.min() * eta.max()) ** 0.5 for eta in etas]
    bars = abs(bins[["phase_mean_low", "phase_mean_high"]].sub(bins["phase_mean"], axis=0)).T
    axes.errorbar(middles, bins["phase_mean"], bars, fmt="o", color="tab:blue", label="mean of all slips in a bin, 95 %")
    eta = np.geomspace(1, max(10, points["eta"].max()))
    axes.plot(eta, -2 * np.sqrt(np.pi / eta), color="tab:red", label=r"$-2\sqrt{\pi/\eta}$")
    axes.plot(bins["eta_centre"], bins["phi_min"], "x", color="tab:red", label=r"$\phi_{\min}$, Eq. 2")
    axes.axvspan(min(0.2, points["eta"].min()), 1, color="0.9", zorder=0)
    axes.set(xscale="log", xlabel=r"$\eta = 2\pi\Delta / (T V_0)$", ylabel=r"phase $\phi$ (rad)")
    axes.legend()
    return figure


def staircase(results):
    """Median interval in periods with its quartiles, and the locking index, against the period."""
    sets = stickslip.open(results).sets().to_pandas().dropna(subset=["T", "tau_50"])
    figure, (above, below) = plt.subplots(2, sharex=True, figsize=(6, 6), height_ratios=[2, 1], layout="constrained")
    for amplitude, group in sets.sort_values("T").groupby("Delta"):
        quartiles = group[["tau_25", "tau_50", "tau_75"]].div(group["T"], axis=0)
        (line,) = above.plot(group["T"], quartiles["tau_50"], ".", label=rf"$\Delta$ = {amplitude * 1e6:.3g} µm")
        above.vlines(group["T"], quartiles["tau_25"], quartiles["tau_75"], color=line.get_color(), alpha=0.4)
        below.plot(group["T"], group["locking_index"], ".", color=line.get_color())
    above.set(xscale="log", yscale="log", ylabel=r"interval $\tau / T$")
    below.set(ylim=(0, 1), xlabel=r"modulation period $T$ (s)", ylabel="locking index")
    above.legend()
    return figure


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for name, draw in (("phase-eta", phase_eta), ("staircase", staircase)):
        draw(folder).savefig(f"{name}.png", dpi=200)
        print(f"{name}.png")
