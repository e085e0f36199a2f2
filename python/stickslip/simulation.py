"""One realisation, simulated."""

import inspect
import textwrap
import warnings
from collections.abc import Mapping
from os import PathLike
from typing import Any

from . import _stickslip, arguments, toml
from ._stickslip import SimulationError, Table
from .guesses import Guessed

_KEYS = _stickslip.keys()
# What a simulation takes where a sweep has another default.
_DEFAULTS = {"slips": 20}


class Simulation(Guessed):
    """What one job did: `outcome`, its row among the jobs, and its tables (`stickslip.Table`)."""

    def __init__(self, job: dict[str, Any], sweep: str, tables: dict[str, Table]) -> None:
        self.job: dict[str, Any] = job
        """The row that a sweep would have for it among its jobs: parameters, outcome, mean friction (N), counts."""
        self.outcome: str = job["outcome"]
        """`done`, `time limit` or `no slips`."""
        self.sweep: str = sweep
        """The text of the sweep with this one job, as TOML."""
        self._tables = tables

    def __repr__(self) -> str:
        tables = ", ".join(f"{name}: {len(table)} rows" for name, table in self._tables.items())
        return f"<stickslip.Simulation {self.outcome}; {tables}>"

    def slips(self) -> Table:
        """One row per slip past start-up, with the columns of a sweep."""
        return self._table("slips")

    def precursors(self) -> Table:
        """One row per precursor; needs `precursors=True`."""
        return self._table("precursors")

    def trace(self) -> Table:
        """Shear force (N), displacement (m) and attached fraction over time (s); needs `trace=True`."""
        return self._table("trace")

    def map(self) -> Table:
        """Attached fraction of every block over time (s); needs `map=True`."""
        return self._table("map")

    def profile(self) -> Table:
        """Displacement of every block (m) at the end; needs `profile=True`."""
        return self._table("profile")

    def contacts(self) -> Table:
        """Every contact event, in order; needs `contacts=True`."""
        return self._table("contacts")

    def _table(self, name: str) -> Table:
        if name not in self._tables:
            raise SimulationError(f"{name} was not recorded: give {name}=True")
        return self._tables[name]


def simulate(
    sweep: str | PathLike[str] | Mapping[str, Any] | None = None,
    /,
    *,
    trace: bool = False,
    map: bool = False,
    profile: bool = False,
    contacts: bool = False,
    sample: float = 1e-4,
    **keys: Any,
) -> Simulation:
    """Simulates one realisation, given by keys or by a sweep with one job; the same bits as `stickslip simulate`.

    `trace`, `map`, `profile` and `contacts` record more than slips; `sample` is the time between samples, in s.
    Without `slips` it records 20, or with `time` or `max_time` alone all until then. Ctrl-C ends it. Other threads of Python run meanwhile.

    Raises `SweepError` for a bad key or value, and `SimulationError` if the simulation cannot continue.

    >>> one = stickslip.simulate(Delta=1e-6, frequency=29, slips=20, trace=True)
    >>> one.outcome, one.job["mean_friction"]
    >>> one.slips().to_pandas()[["onset", "interval", "phase"]]
    """
    file, source, text = None, "keys", ""
    if sweep is None:
        text = _stickslip.sweep_text([(key, toml.value(key, given)) for key, given in keys.items() if given is not None])
    elif keys:
        raise TypeError(f"simulate() takes a sweep or keys, not both: {', '.join(keys)}")
    elif isinstance(sweep, Mapping):
        source, text = "sweep", toml.dumps(sweep)
    else:
        file = arguments.path("sweep", sweep)
    recorded = {"trace": trace, "map": map, "profile": profile, "contacts": contacts}
    job, text, warned, tables = _stickslip.simulate(
        file=file,
        text=text,
        source=source,
        sample=arguments.seconds("sample", sample),
        **{name: arguments.flag(name, given) for name, given in recorded.items()},
    )
    for warning in warned:
        warnings.warn(warning, stacklevel=2)
    return Simulation(job, text, tables)


def _describe() -> None:
    """Gives `simulate` its keys, from their one description: for `help`, and for completion."""
    signature = inspect.signature(simulate)
    fixed = [one for one in signature.parameters.values() if one.kind is not inspect.Parameter.VAR_KEYWORD]
    described, lines = [], ["", "Keys", "----"]
    for key, (meaning, allowed, default) in _KEYS.items():
        default = _DEFAULTS.get(key, default)
        described.append(inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=default))
        default = "" if default is None else f" Default: {default}."
        about = f"{_sentence(meaning)} {_sentence(allowed)}{default}"
        lines += [key, *textwrap.wrap(about, 112, initial_indent="    ", subsequent_indent="    ")]
    simulate.__signature__ = signature.replace(parameters=[*fixed, *described])  # type: ignore[attr-defined]
    simulate.__doc__ = inspect.cleandoc(simulate.__doc__ or "") + "\n" + "\n".join(lines)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


_describe()
