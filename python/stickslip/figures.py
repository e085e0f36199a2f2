"""Figures of a results directory with matplotlib, in the look of the program's, as a start for your own.

Each returns its axes, so that anything can be added or changed: `axes.set_xlim(...)`, `axes.figure.savefig(...)`.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ._stickslip import ResultsError, Table, minimum_phase, side_by_side
from .guesses import Guessed

if TYPE_CHECKING:
    import numpy
    import pandas
    from matplotlib.axes import Axes


class Tables(Protocol):
    """What figures read of `stickslip.Results`."""

    directory: Path
    name: str

    def sets(self, columns: Sequence[str] | None = None) -> Table: ...
    def histograms(self, columns: Sequence[str] | None = None) -> Table: ...
    def backbone(self, columns: Sequence[str] | None = None) -> Table: ...
    def points(self, columns: Sequence[str] | None = None) -> Table: ...


#: The program's colours: slips of sets with a phase and others, averages, theory, bars; and lines side by side (Okabe and Ito).
PHASED, OTHERS, AVERAGE, THEORY, BARS = "black", "#8c8c8c", "#1f55c4", "#d62020", "#9db4d6"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")

STYLE: Any = {
    "axes.labelsize": 12,
    "axes.linewidth": 0.8,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.minor.visible": True,
    "ytick.minor.visible": True,
}
#: Width and height of a figure, and height of a panel of histograms, in inches.
SIZE, PANEL = (6.4, 4.6), 1.9
#: Sets that go onto a sheet of histograms.
MAX_PANELS = 8
#: Multiples of T that are marked; more would be a grey area.
MAX_MULTIPLES = 40
#: Least ratio of two n with a line each: closer ones would merge.
MIN_RATIO = 1.4
#: Size of a slip.
MARKER = 3.5


@contextmanager
def _styled() -> Iterator[None]:
    """In the program's look, whatever is set elsewhere."""
    from matplotlib import rc_context

    with rc_context(STYLE):
        yield


def _new_axes() -> "Axes":
    from matplotlib import pyplot

    return pyplot.subplots(figsize=SIZE)[1]


class Plot(Guessed):
    """The figures of a results directory. `axes` are matplotlib's to draw on; new ones if they are not given."""

    def __init__(self, results: Tables) -> None:
        self._results = results

    def __call__(self, figure: str, **options: Any) -> Any:
        """A figure by name: `results.plot("intervals")`."""
        return getattr(self, figure.replace("-", "_"))(**options)

    @_styled()
    def phase_eta(
        self, axes: "Axes | None" = None, others: "Sequence[Tables]" = (), legend: Sequence[str] = ()
    ) -> "Axes":
        """Phases of slips (rad) against eta, with means of all slips in bins of eta and where Eq. 2 lets slips begin (Fig. 3e).

        Of other directories, computed or measured, the means are hollow marks:
        `results.plot.phase_eta(others=[stickslip.open("results/mine")])`. `legend` names all directories, this one first; by
        default, they have those of their folders, or their paths where folders have the same name. What differs between them
        stands above the axes.
        """
        described = side_by_side([results.directory for results in (self._results, *others)], list(legend))
        points = self._slips("phase")
        axes = axes or _new_axes()
        low, high = 0.8 * points["eta"].min(), 1.25 * points["eta"].max()
        axes.axvspan(min(low, 1), 1, color="0.9", zorder=0, label=r"$\eta$ < 1")
        _scatter(axes, points, "eta", "phase")
        label = r"mean in ¼ decade of $\eta$, 95 %"
        label = f"{described[0][0]}: {label}" if described else label
        _mark(axes, self._mean_phases(points), fmt="o", color=AVERAGE, markersize=4.5, label=label)
        for other, (name, _), marker in zip(others, described[1:], "Dsv^p", strict=False):
            plot = Plot(other)
            means = plot._mean_phases(plot._slips("phase"))
            hollow = {"markerfacecolor": "white", "markersize": 6, "zorder": 4}
            _mark(axes, means, fmt=marker, color="black", label=name, **hollow)
            low, high = min(low, 0.8 * means["eta_low"].min()), max(high, 1.25 * means["eta_high"].max())
        axes.plot(*_least_phases(high), color=THEORY, linewidth=1.6, label=r"$\phi_{\min}$, Eq. 2")
        label = r"$\eta = 2\pi\Delta/(T\,V_0)$"
        axes.set(xscale="log", xlim=(low, high), xlabel=label, ylabel=r"Phase $\phi$ (rad)")
        differing = [f"{name}: {settings}".replace("$", r"\$") for name, settings in described if settings]
        axes.set_title("\n".join(differing), loc="left", fontsize=9)
        axes.xaxis.set_major_formatter("{x:g}")
        _in_units_of_pi(axes)
        # No slip begins there.
        axes.legend(loc="lower right", markerscale=1.5)
        return axes

    @_styled()
    def intervals(self, axes: "Axes | None" = None) -> "Axes":
        """Intervals in periods, tau/T, against the period T (s), with a line for each of the most frequent n (Fig. 3c)."""
        points = self._slips("interval")
        points = points.assign(tau_over_T=points["interval"] / points["T"])
        axes = axes or _new_axes()
        _scatter(axes, points, "T", "tau_over_T")
        for n, colour in zip(_frequent(points), COLOURS, strict=False):
            of_n = points[points["periods"] == n]
            low, high = of_n["T"].min() / 1.25, of_n["T"].max() * 1.25
            axes.plot([low, high], [n, n], color=colour, linewidth=1, zorder=0)
            axes.annotate(f"{n:.0f}", (high, n), (3, 0), textcoords="offset points", color=colour, va="center")
            of_n = of_n[of_n["has_phase"]]
            axes.plot(of_n["T"], of_n["tau_over_T"], ".", color=colour, markersize=MARKER)
        label = r"Slip interval $\tau/T$; coloured: near $n$"
        axes.set(xscale="log", yscale="log", xlabel="Modulation period $T$ (s)", ylabel=label)
        axes.legend(loc="best", markerscale=1.5)
        return axes

    @_styled()
    def histograms(self, sets: "list[str] | None" = None) -> "numpy.ndarray":
        """Histograms of the interval tau (s), a panel for each set, by rising frequency; at most 8 (Fig. 2).

        `sets` are ids of sets, such as those of `results.sets()`; by default all. Returns an array of axes.
        """
        from matplotlib import pyplot

        table = self._results.sets().to_pandas().set_index("set_id")
        table = (table if sets is None else table.loc[sets]).dropna(subset="tau_mean").sort_values("T", ascending=False)
        # Those without modulation first.
        table = table.iloc[table["T"].notna().argsort(kind="stable")]
        if not 1 <= len(table) <= MAX_PANELS:
            raise ValueError(f"there are {len(table)} sets with intervals; name 1 to {MAX_PANELS} of them in sets=")
        bins = self._results.histograms().to_pandas()
        size = (SIZE[0], 0.8 + PANEL * len(table))
        figure, panels = pyplot.subplots(len(table), sharex=True, squeeze=False, figsize=size)
        for axes, letter, (set_id, one) in zip(panels[:, 0], "abcdefgh", table.iterrows(), strict=False):
            bars = bins[bins["set_id"] == set_id]
            width = bars["high"] - bars["low"]
            axes.bar(bars["low"], bars["density"], width, align="edge", color=BARS, edgecolor="0.25", linewidth=0.6)
            axes.set_title(f"({letter})  {_named(one)}, {one['intervals']:.0f} intervals", loc="left", fontsize=10)
        for axes, period in zip(panels[:, 0], table["T"], strict=True):
            _mark_multiples(axes, period)
        panels[-1, 0].set_xlabel(r"Slip interval $\tau$ (s)")
        figure.supylabel("Probability density (1/s)", fontsize=12)
        return panels[:, 0]

    def _mean_phases(self, points: "pandas.DataFrame") -> "pandas.DataFrame":
        """Bins of eta: ends of the eta of their slips, mean phase (rad) and its interval; those in which a direction is known."""
        from math import tau

        columns = ["eta_low", "eta_high", "phase_mean", "phase_mean_low", "phase_mean_high"]
        bins = self._results.backbone(columns).to_pandas().dropna()
        bins = bins[bins["phase_mean_high"] - bins["phase_mean_low"] < tau * (1 - 1e-9)]
        within = [points["eta"].between(low, high, "left") for low, high in zip(bins["eta_low"], bins["eta_high"], strict=True)]
        etas = [points["eta"][of_bin] for of_bin in within]
        return bins.assign(eta_low=[eta.min() for eta in etas], eta_high=[eta.max() for eta in etas])

    def _slips(self, column: str) -> "pandas.DataFrame":
        """Slips under modulation with a value in a column."""
        points = self._results.points().to_pandas().dropna(subset=["T", column])
        if points.empty:
            raise ResultsError(f"{self._results.directory}: has no slips under modulation to draw")
        return points


def _scatter(axes: "Axes", points: "pandas.DataFrame", x: str, y: str) -> None:
    """Slips, those of sets with a phase over the others."""
    for has_phase, colour, label in ((False, OTHERS, "other slips"), (True, PHASED, "slips of sets with a phase")):
        of_kind = points[points["has_phase"] == has_phase]
        axes.plot(of_kind[x], of_kind[y], ".", color=colour, markersize=MARKER, alpha=0.5, markeredgewidth=0, label=label)


def _mark(axes: "Axes", means: "pandas.DataFrame", **marks: Any) -> None:
    """Mean phases with their intervals, over the eta of their slips."""
    eta, mean = (means["eta_low"] * means["eta_high"]) ** 0.5, means["phase_mean"]
    across = abs(means[["eta_low", "eta_high"]].sub(eta, axis=0)).T
    along = abs(means[["phase_mean_low", "phase_mean_high"]].sub(mean, axis=0)).T
    axes.errorbar(eta, mean, along, across, elinewidth=1, **marks)


def _least_phases(high: float) -> "tuple[numpy.ndarray, numpy.ndarray]":
    """eta from 1, and the least phase (rad) at which slips can begin there."""
    import numpy

    eta = numpy.geomspace(1, max(high, 1.01), 400)
    return eta, numpy.array([minimum_phase(one) for one in eta], dtype=float)


def _in_units_of_pi(axes: "Axes") -> None:
    from fractions import Fraction
    from math import pi

    from matplotlib.ticker import AutoMinorLocator, FuncFormatter, MultipleLocator

    def named(value: float, _: int) -> str:
        share = Fraction(round(2 * value / pi), 2)
        above = {1: "π", -1: "−π"}.get(share.numerator, f"{share.numerator}π".replace("-", "−"))
        return "0" if share == 0 else above if share.denominator == 1 else f"{above}/{share.denominator}"

    axes.yaxis.set_major_locator(MultipleLocator(pi / 2))
    axes.yaxis.set_minor_locator(AutoMinorLocator(3))
    axes.yaxis.set_major_formatter(FuncFormatter(named))


def _named(one: "pandas.Series") -> str:
    if not one["Delta"] > 0:
        return r"$\Delta$ = 0"
    return rf"$\Delta$ = {one['Delta'] * 1e6:.3g} µm, $1/T$ = {1 / one['T']:.4g} Hz"


def _frequent(points: "pandas.DataFrame") -> list[float]:
    """The n of the most slips, of sets with a phase if there are any, not too close to each other, in order."""
    phased = points[points["has_phase"] & (points["periods"] > 0)]
    counts = (phased if len(phased) else points[points["periods"] > 0])["periods"].value_counts()
    chosen: list[float] = []
    for n in counts.index:
        if len(chosen) < len(COLOURS) and all(max(n, other) >= MIN_RATIO * min(n, other) for other in chosen):
            chosen.append(n)
    return sorted(chosen)


def _mark_multiples(axes: "Axes", period: float) -> None:
    """Marks the multiples of a period, unless they are too many."""
    from math import ceil

    low, high = axes.get_xlim()
    if (high - low) / period <= MAX_MULTIPLES:  # never without a period, which is NaN
        places = [n * period for n in range(ceil(low / period), int(high / period) + 1)]
        dashed = {"color": OTHERS, "linewidth": 0.7, "linestyle": (0, (3, 3)), "zorder": 0}
        lines = [axes.axvline(place, **dashed) for place in places]
        axes.legend(lines[:1], [r"$\tau = nT$"], loc="upper right")
