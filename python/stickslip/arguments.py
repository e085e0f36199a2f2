"""Arguments that are no part of a sweep: each refused one is named, with what is allowed."""

import math
import operator
from datetime import timedelta
from os import PathLike
from typing import Any

from ._stickslip import MAX_THREADS


def flag(name: str, given: Any) -> bool:
    """True or False, also numpy's."""
    if isinstance(given, bool) or type(given).__name__ in ("bool_", "bool"):
        return bool(given)
    raise TypeError(f"{name} = {given!r}: must be True or False")


def path(name: str, given: Any) -> str | PathLike[str] | None:
    """A path, or None."""
    if given is None or isinstance(given, str | PathLike):
        return given
    raise TypeError(f"{name} = {given!r}: must be a path")


def threads(given: Any) -> int | None:
    """A number of threads, or None."""
    try:
        count = None if given is None or isinstance(given, bool) else operator.index(given)
    except TypeError:
        count = 0
    if isinstance(given, bool) or (count is not None and not 1 <= count <= MAX_THREADS):
        raise ValueError(f"threads = {given!r}: must be a whole number from 1 to {MAX_THREADS}, or None")
    return count


def seconds(name: str, given: Any) -> float:
    """A finite number > 0, in s."""
    try:
        number = math.nan if isinstance(given, bool | str) else float(given)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if math.isfinite(number) and number > 0:
        return number
    raise ValueError(f"{name} = {given!r}: must be a finite number > 0, in s")


def walltime(given: Any) -> timedelta | None:
    """A time of at most 100 years, or None."""
    if given is None or isinstance(given, timedelta):
        number = None if given is None else seconds("walltime", given.total_seconds())
    else:
        number = seconds("walltime", given)
    return None if number is None else timedelta(seconds=min(number, 3e9))
