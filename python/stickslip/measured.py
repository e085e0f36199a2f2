"""Measured slips as a results directory, from a table of another library."""

import sys
from collections.abc import Mapping
from os import PathLike
from typing import Any

from . import _stickslip, arguments
from ._stickslip import SweepError
from .results import Results


def measured(
    table: Any,
    out: str | PathLike[str],
    *,
    columns: Mapping[str, str | tuple[str, str]] | None = None,
    set: Mapping[str, float | str | tuple[float | str, str]] | None = None,
    maximum: float | tuple[float, str] | None = None,
    drop_size: float | str | tuple[float, str] | None = None,
    smooth: int = 1,
) -> Results:
    """Reads measured slips, or those of a trace, into a results directory, as `stickslip measured` does; needs pyarrow.

    Prints what was read on standard error. The directory keeps the checksum of the rows, not the table.

    Raises `SweepError` for what is not understood, and `ResultsError` if the directory does not fit or fails.

    Parameters
    ----------
    table
        A row for each slip, or for each sample of a trace: of pandas, polars, DuckDB or pyarrow, or a dict of columns.
    out
        New results directory.
    columns
        The column of each key, with its unit if that is not of SI; by default the columns of these names.
    set
        The value of a key in all rows, with its unit if that is not of SI.
    maximum
        A time at which the modulation has a maximum, in s, or with its unit; 0 by default.
    drop_size
        Rows are samples of a trace, and slips its falls by at least this much, in N or with its unit; or "auto".
    smooth
        Samples of a trace of which the mean is taken for one.

    Examples
    --------
    >>> mine = stickslip.measured(
    ...     pandas.read_excel("slips.xlsx"),
    ...     "results/mine",
    ...     columns={"onset": ("t_slip", "ms")},
    ...     set={"V0": (100, "um/s"), "Delta": 0},
    ... )
    """
    settings = dict(set or {})
    if maximum is not None:
        settings["maximum"] = maximum
    path = arguments.path("out", out)
    trace = None
    if drop_size is not None:
        size, *unit = drop_size if isinstance(drop_size, tuple) else (drop_size,)
        trace = (":".join([str(size), *unit]), smooth)
    given = (_given("columns", columns or {}), _given("set", settings))
    read = _stickslip.measured(_stream(table), *given, trace, path)
    for key, words in read:
        print(f"{key:<10} {words}", file=sys.stderr)
    return Results(path)


def _given(argument: str, values: Mapping[str, Any]) -> list[tuple[str, str, str | None]]:
    """Key, column or value, and unit."""
    given = []
    for key, value in values.items():
        value, unit = value if isinstance(value, tuple) else (value, None)
        if not isinstance(key, str) or not isinstance(unit, str | None):
            raise TypeError(f"{argument}[{key!r}] = {value!r}, {unit!r}: must be a value, or a tuple of value and unit")
        given.append((key, value if isinstance(value, str) else repr(float(value)), unit))
    return given


def _stream(table: Any) -> bytes:
    """A table in Arrow's own format."""
    import pyarrow

    if not isinstance(table, Mapping) and not hasattr(table, "__arrow_c_stream__") and hasattr(table, "to_arrow_table"):
        table = table.to_arrow_table()
    try:
        table = pyarrow.table(table)
    except (TypeError, ValueError, pyarrow.ArrowInvalid) as error:
        raise SweepError(f"table: is none of pandas, polars, DuckDB or pyarrow, or of mixed types: {error}") from error
    sink = pyarrow.BufferOutputStream()
    with pyarrow.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return sink.getvalue().to_pybytes()
