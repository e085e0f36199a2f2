"""Sweeps as dicts, written as the text of a sweep file."""

import json
import re
from collections.abc import Mapping
from typing import Any

from ._stickslip import SweepError

_BARE = re.compile(r"[A-Za-z0-9_-]+")
# Sweep files nest four deep.
_DEEPEST = 16


def dumps(sweep: Mapping[str, Any]) -> str:
    """The text of a sweep file with the structure of a dict: top-level keys first, then a section for each table."""
    tables = {key: value for key, value in sweep.items() if isinstance(value, Mapping)}
    lines = [_line(key, value) for key, value in sweep.items() if key not in tables]
    for title, table in tables.items():
        lines += ["", f"[{_key(title)}]", *(_line(key, value) for key, value in table.items())]
    return "\n".join(lines).lstrip("\n") + "\n"


def value(key: str, given: Any, depth: int = 0) -> str:
    """One value as TOML. Arrays of numpy, pandas, polars and pyarrow are lists, members of an enumeration their values."""
    if depth > _DEEPEST:
        raise SweepError(f"{key}: lists and dicts lie within each other {_DEEPEST} deep; nothing in a sweep does")
    for as_list in ("tolist", "to_list", "to_pylist"):
        if hasattr(given, as_list):
            given = getattr(given, as_list)()
    match given:
        case bool():
            return "true" if given else "false"
        case int():
            return int.__repr__(given)
        case float():
            return float.__repr__(given)
        case str():
            return json.dumps(given, ensure_ascii=False).replace("\x7f", "\\u007f")
        case Mapping():
            return "{ " + ", ".join(_line(inner, of, depth + 1) for inner, of in given.items()) + " }"
        case list() | tuple() | range():
            return "[" + ", ".join(value(key, one, depth + 1) for one in given) + "]"
    raise SweepError(f"{key} = {given!r}: must be a number, a text, true or false, a list or a dict")


def _line(key: str, given: Any, depth: int = 0) -> str:
    return f"{_key(key)} = {value(key, given, depth)}"


def _key(key: str) -> str:
    return key if isinstance(key, str) and _BARE.fullmatch(key) else value("key", str(key))
