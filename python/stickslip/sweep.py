"""Sweeps: run or resume one."""

import warnings
from collections.abc import Callable, Mapping
from datetime import timedelta
from os import PathLike
from typing import Any

from . import _stickslip, arguments, toml
from .progress import Progress, display
from .results import Results


def run(
    sweep: str | PathLike[str] | Mapping[str, Any],
    out: str | PathLike[str] | None = None,
    *,
    threads: int | None = None,
    progress: bool | Callable[[Progress], object] = True,
    retry_failed: bool = False,
    walltime: float | timedelta | None = None,
    reduce: bool = True,
) -> Results:
    """Runs a sweep, or what is missing of it, and opens its results; then reduces and plots, as `stickslip run` does.

    Ctrl-C stops the run and raises `KeyboardInterrupt`: finished jobs are kept, and the same call resumes. So does an
    exception in `progress`. Failed and missing jobs are warned of. Other processes may run the same sweep meanwhile, also
    on other hosts with a common disk: they share the work.

    Raises `SweepError` for mistakes in the sweep, and `ResultsError` if the directory does not fit or fails.

    Parameters
    ----------
    sweep
        A sweep file, a results directory to resume, or a dict with the structure of a sweep file. Arrays may be numpy's.
    out
        Results directory; by default `results/<name of the sweep>`, or the one to resume.
    threads
        By default those that a batch system grants, else all cores.
    progress
        `True`: a bar (tqdm) if that is installed, else plain lines, on standard error. `False`: nothing.
        Or a function that is called with a `Progress`, about twenty times a second at most.
    retry_failed
        Whether to run failed jobs again.
    walltime
        End within this time, in s, and keep what is done.
    reduce
        Whether to reduce the tables and to draw the figures, when all is done.

    Examples
    --------
    >>> results = stickslip.run({
    ...     "name": "first",
    ...     "model": {"Delta": 1e-6},
    ...     "axes": {"frequency": [29, 58], "seed": {"count": 4}},
    ...     "record": {"slips": 20},
    ... })
    >>> results.sets().to_pandas()[["T", "tau_mean", "locking_index"]]
    """
    file, text = (None, toml.dumps(sweep)) if isinstance(sweep, Mapping) else (arguments.path("sweep", sweep), "")
    if file is None and not text:
        raise TypeError("sweep = None: must be a path or a dict")
    out, threads, walltime = arguments.path("out", out), arguments.threads(threads), arguments.walltime(walltime)
    retry_failed, reduce = arguments.flag("retry_failed", retry_failed), arguments.flag("reduce", reduce)
    shown = display(progress)
    try:
        directory, warned = _stickslip.run(
            file=file,
            text=text,
            out=out,
            threads=threads,
            retry_failed=retry_failed,
            walltime=walltime,
            reduce=reduce,
            callback=shown,
        )
    finally:
        shown.close()
    for warning in warned:
        warnings.warn(warning, stacklevel=2)
    return Results(directory)
