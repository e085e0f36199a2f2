"""Results directories, and their tables."""

from collections.abc import Sequence
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

from . import _stickslip, arguments
from ._stickslip import Table
from .guesses import Guessed

if TYPE_CHECKING:
    from .figures import Plot


def open(directory: str | PathLike[str]) -> "Results":
    """Opens a results directory, also one whose sweep still runs.

    Raises `ResultsError` for any other directory.

    >>> results = stickslip.open("results/fig3")
    >>> slips = results.slips().to_pandas()
    """
    return Results(directory)


class Results(Guessed):
    """The results directory of a sweep, finished or not. Each call reads its table again; reduced data that are out of date
    are made again first.

    Every table is an Arrow table with units (`stickslip.Table`), which pandas, polars, DuckDB and pyarrow take directly.
    `columns` are names of columns to read, which saves time and memory; `Table.meaning` describes them.
    """

    def __init__(self, directory: str | PathLike[str]) -> None:
        self.directory: Path = Path(fspath(directory))
        """Where the results are."""
        self.name: str
        """Name of the sweep."""
        self.sweep: str
        """The text of the sweep, as TOML."""
        self.name, self.sweep = _stickslip.sweep_of(self.directory)

    def __repr__(self) -> str:
        return f"stickslip.open({str(self.directory)!r})"

    def slips(self, columns: Sequence[str] | None = None, *, join: bool = False) -> Table:
        """One row per slip past start-up: onset and interval (s), phase (rad), forces (N), and more.

        V0, Delta, T, seed and eta are columns. Any other parameter, or column of the jobs, can be named in `columns`;
        `join=True` adds them all.

        >>> results.slips(["Kd", "interval", "phase"]).to_polars()
        """
        return self._table("slips", columns, join)

    def precursors(self, columns: Sequence[str] | None = None, *, join: bool = False) -> Table:
        """One row per precursor, if the sweep records them; `columns` and `join` as in `slips`."""
        return self._table("precursors", columns, join)

    def jobs(self, columns: Sequence[str] | None = None) -> Table:
        """One row per job: all parameters, outcome, mean friction (N), counts."""
        return self._table("jobs", columns)

    def sets(self, columns: Sequence[str] | None = None) -> Table:
        """One row per parameter set, all seeds together: statistics of intervals, phases and friction, with intervals."""
        return self._table("sets", columns)

    def edges(self, columns: Sequence[str] | None = None) -> Table:
        """One row per edge, with its 95 % interval, and per row of sets without one, if the sweep has `[refine]`.

        >>> results.edges(["T", "edge", "edge_low", "edge_high", "ended"]).to_pandas()
        """
        return self._table("edges", columns)

    def triggers(self, columns: Sequence[str] | None = None) -> Table:
        """One row per job with a pulse: how much earlier (s) its next slip came than without it, and by the drive alone."""
        return self._table("triggers", columns)

    def pulses(self, columns: Sequence[str] | None = None) -> Table:
        """One row per pulse and per tenth of the interval in which it begins: mean advance and share of triggered slips."""
        return self._table("pulses", columns)

    def histograms(self, columns: Sequence[str] | None = None) -> Table:
        """One row per bin of the intervals of a set."""
        return self._table("histograms", columns)

    def backbone(self, columns: Sequence[str] | None = None) -> Table:
        """One row per bin of eta: phases of all its slips."""
        return self._table("backbone", columns)

    def points(self, columns: Sequence[str] | None = None) -> Table:
        """Slips for scatter figures: all up to 20,000, or every k-th."""
        return self._table("points", columns)

    def reduce(self) -> None:
        """Reduces the finished parts of the tables. `sets` and the others do so themselves when needed."""
        _stickslip.reduce(self.directory)

    @cached_property
    def plot(self) -> "Plot":
        """Figures with matplotlib: `results.plot.phase_eta()`."""
        from .figures import Plot

        return Plot(self)

    def _table(self, name: str, columns: Sequence[str] | None, join: bool = False) -> Table:
        if columns is not None:
            columns = [columns] if isinstance(columns, str) else list(columns)
            if not columns or len(set(columns)) < len(columns) or not all(isinstance(one, str) for one in columns):
                raise ValueError(f"columns = {columns!r}: must be names of columns, each once, at least one")
        return _stickslip.read(self.directory, name, columns, arguments.flag("join", join))
