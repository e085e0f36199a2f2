"""What the package takes from the library in Rust. Use it through `stickslip`."""

from collections.abc import Callable
from datetime import timedelta
from os import PathLike
from pathlib import Path
from typing import Any, final

import pandas
import polars
import pyarrow

__all__ = [
    "MAX_THREADS",
    "ResultsError",
    "SimulationError",
    "SweepError",
    "Table",
    "VERSION",
    "keys",
    "main",
    "measured",
    "minimum_phase",
    "read",
    "reduce",
    "run",
    "side_by_side",
    "simulate",
    "sweep_of",
    "sweep_text",
]

MAX_THREADS: int
"""Most threads of a run."""

VERSION: str
"""Version of the program and of the module."""

class SweepError(ValueError):
    """A mistake in a sweep, or in the keys of a simulation."""

class ResultsError(RuntimeError):
    """A results directory that cannot be used, read or written."""

class SimulationError(RuntimeError):
    """A simulation that cannot continue."""

@final
class Table:
    """A table with its units, in Arrow's memory layout.

    pandas, polars, DuckDB and pyarrow take it without a copy: `pyarrow.table(slips)`,
    `polars.DataFrame(slips)`, `duckdb.sql("from slips")`. All quantities are in SI units.
    `slips["interval"]` is a column as a `pandas.Series`.
    """

    @property
    def name(self) -> str:
        """Name of the table."""

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column; "" for a pure number or a text."""

    @property
    def meaning(self) -> dict[str, str]:
        """Meaning of each column."""

    def __getitem__(self, key: str, /) -> "pandas.Series[Any]": ...
    def __len__(self) -> int: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> Any: ...
    def __arrow_c_schema__(self) -> Any: ...
    def to_pyarrow(self) -> pyarrow.Table:
        """The table as a `pyarrow.Table`; units and meanings are in the metadata of its fields."""

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a `pandas.DataFrame`; units and meanings are in `.attrs["units"]` and `.attrs["meaning"]`."""

    def to_polars(self) -> polars.DataFrame:
        """The table as a `polars.DataFrame`, which keeps no units: see `units`."""

def keys() -> dict[str, tuple[str, str, Any]]: ...
def sweep_text(keys: list[tuple[str, str]]) -> str: ...
def simulate(
    *,
    file: str | PathLike[str] | None,
    text: str,
    source: str,
    sample: float,
    trace: bool,
    map: bool,
    profile: bool,
    contacts: bool,
) -> tuple[dict[str, Any], str, list[str], dict[str, Table]]: ...
def run(
    *,
    file: str | PathLike[str] | None,
    text: str,
    out: str | PathLike[str] | None,
    threads: int | None,
    retry_failed: bool,
    walltime: timedelta | None,
    reduce: bool,
    callback: Callable[[int, int, float, list[str]], object] | None,
) -> tuple[Path, list[str]]: ...
def measured(
    stream: bytes,
    columns: list[tuple[str, str, str | None]],
    set: list[tuple[str, str, str | None]],
    trace: tuple[str, int] | None,
    out: str | PathLike[str],
) -> list[tuple[str, str]]: ...
def sweep_of(directory: str | PathLike[str]) -> tuple[str, str]: ...
def side_by_side(directories: list[Path], names: list[str]) -> list[tuple[str, str]]: ...
def reduce(directory: str | PathLike[str]) -> None: ...
def read(directory: str | PathLike[str], table: str, columns: list[str] | None, join: bool) -> Table: ...
def main(program: str | PathLike[str], arguments: list[str]) -> int: ...
def minimum_phase(eta: float) -> float | None: ...
