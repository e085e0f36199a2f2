"""Contact logs and parameters, as the independent integrators read them. Nothing here solves anything.

A contact log is the Parquet file that ``stickslip simulate --contacts FILE`` writes: every contact event in order, the
initial attachment of every contact first, as generation 0 at time 0. docs/tables.md has its columns; the footer holds
the parameters.
"""

import argparse
import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow.parquet

from stickslip.tables import parameters


#: Parameters that the motion does not depend on once every draw of the disorder is given.
NOT_NEEDED = {"FN", "L", "dfs", "seed", "tau_r"}


class LogError(Exception):
    """A contact log that cannot be replayed: what is wrong, and where."""


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Parameters of the model under their symbols in the paper, in SI units: those that the motion depends on."""

    N: int
    Ns: int
    M: float
    K: float
    Kd: float
    ki: float
    fs: float
    gamma: float
    V0: float
    Delta: float
    break_on: str
    T: float | None = None
    T_to: float | None = None
    Delta_to: float | None = None
    ramp_time: float = 0.0
    pulse_start: float | None = None
    pulse_cycles: int | None = None
    #: A maximum of the modulation, in s, from which its phase is counted.
    cycle_start: float = 0.0
    #: Added to the displacement of the driven end, in m.
    lift: float = 0.0

    def __post_init__(self) -> None:
        if self.break_on not in ("magnitude", "tension"):
            raise LogError(f'break_on = {self.break_on}: must be "magnitude" or "tension"')
        if self.Delta > 0 and not (self.T and self.T > 0):
            raise LogError(f"T = {self.T}: a period > 0 must be given when Delta > 0 (--T)")

    @classmethod
    def from_values(cls, given: dict) -> Self:
        """The parameters among some values by name; those that have no default must be there."""
        fields = dataclasses.fields(cls)
        missing = [field.name for field in fields if field.default is dataclasses.MISSING and field.name not in given]
        if missing:
            flags = ", ".join("--" + name.replace("_", "-") for name in missing)
            raise LogError(f"parameters are missing in its footer: give {flags}")
        return cls(**{field.name: given[field.name] for field in fields if field.name in given})

    @property
    def contacts(self) -> int:
        return self.N * self.Ns

    @property
    def mass(self) -> float:
        """Mass m = M/N of a block, in kg."""
        return self.M / self.N

    @property
    def coupling(self) -> float:
        """Stiffness K_int = (N-1) K between neighbouring blocks, in N/m."""
        return (self.N - 1) * self.K

    @property
    def angular_frequency(self) -> float:
        """Angular frequency 2π/T of the modulation, in rad/s; 0 without modulation."""
        return 2 * np.pi / self.T if self.Delta > 0 else 0.0

    @property
    def reach(self) -> float:
        """Contact reach f_s/k, in m: the unit in which displacements are judged."""
        return self.fs / self.ki

    def phase(self, time: float) -> float:
        """Phase of the modulation at a time in s, in rad, without whole periods."""
        return 2 * np.pi * (((time - self.cycle_start) / self.T) % 1.0) if self.Delta > 0 else 0.0

    def drive(self, time: float) -> float:
        """Displacement V0 t + Δ (cos(2πt/T) - 1) of the driven end, in m, and 2Δ more in a pulse."""
        return self.V0 * time + self.Delta * (np.cos(self.phase(time)) - 1.0) + self.lift

    def cycles(self) -> Iterator[tuple[Self, float]]:
        """The cycles of the modulation: the parameters of each, and its end in s. The last one is endless."""
        if self.pulse_start is not None:
            still, end = dataclasses.replace(self, Delta=0.0), self.pulse_start + (self.pulse_cycles or 1) * self.T
            yield still, self.pulse_start
            # It rises from a minimum.
            yield dataclasses.replace(self, cycle_start=self.pulse_start - 0.5 * self.T, lift=2 * self.Delta), end
            yield still, np.inf
            return
        cycle = self
        while self.ramp_time > 0 and cycle.cycle_start < 2 * self.ramp_time:
            end = cycle.cycle_start + cycle.T
            yield cycle, end
            share = max(0.0, 1.0 - abs(end / self.ramp_time - 1.0))
            ends = ((self.T, self.T_to), (self.Delta, self.Delta_to))
            period, amplitude = (a if b is None else (1.0 - share) * a + share * b for a, b in ends)
            cycle = dataclasses.replace(self, T=period, Delta=amplitude, cycle_start=end)
        yield cycle, np.inf


@dataclasses.dataclass(frozen=True)
class ContactLog:
    """A contact log: arrays with one entry per event, in SI units. Blocks and contacts are counted from 0."""

    time: np.ndarray
    block: np.ndarray
    contact: np.ndarray
    generation: np.ndarray
    displacement: np.ndarray
    threshold: np.ndarray
    stiffness: np.ndarray
    is_break: np.ndarray

    @classmethod
    def read(cls, path: Path) -> Self:
        names = [field.name for field in dataclasses.fields(cls) if field.name != "is_break"]
        table = pyarrow.parquet.read_table(path)
        columns = {name: table.column(name).to_numpy() for name in names}
        columns |= {name: columns[name].astype(int) - 1 for name in ("block", "contact")}
        return cls(**columns, is_break=np.array(table.column("event").to_pylist()) == "break")

    def __len__(self) -> int:
        return len(self.time)

    def place(self, row: int) -> tuple[int, int]:
        return int(self.block[row]), int(self.contact[row])

    def place_text(self, row: int) -> str:
        """Block and contact of a row as people count them."""
        return f"block {self.block[row] + 1}, contact {self.contact[row] + 1}"

    def check(self, given: Parameters) -> None:
        """Rejects a log that contradicts the model or itself, whatever the motion: see the messages."""
        expected = given.ki * np.sqrt(self.threshold / given.fs)
        if np.any(np.abs(self.stiffness / expected - 1) > 1e-12):
            raise LogError("stiffness is not k sqrt(f_i/f_s): are --ki and --fs those of the run?")
        if np.any(np.diff(self.time) < 0):
            raise LogError(f"row {np.argmax(np.diff(self.time) < 0) + 1}: time runs backward")
        attached = np.zeros((given.N, given.Ns), dtype=bool)
        generation = np.full((given.N, given.Ns), -1)
        for row, is_break in enumerate(self.is_break):
            place = self.place(row)
            if not (0 <= place[0] < given.N and 0 <= place[1] < given.Ns):
                raise LogError(f"row {row}: there is no {self.place_text(row)}: are --N and --Ns those of the run?")
            if is_break != attached[place] or self.generation[row] != generation[place] + (not is_break):
                raise LogError(f"row {row}: {self.place_text(row)} breaks or attaches out of turn")
            if row < given.contacts and (is_break or self.generation[row] != 0 or self.time[row] != 0):
                raise LogError(f"row {row}: the log must begin with the initial attachment of every contact")
            attached[place] = not is_break
            generation[place] = self.generation[row]
        if np.any(generation < 0):
            raise LogError("the initial attachment of some contacts is missing")


def parser(module: str, description: str) -> argparse.ArgumentParser:
    """The command line of a module of the package, with the log and an option for each parameter."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=description)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("log", type=Path, help="contact log (Parquet)")
    group = parser.add_argument_group("parameters", "SI units; they override those in the footer of the log")
    for field in dataclasses.fields(Parameters)[:-2]:
        kind = {"N": int, "Ns": int, "pulse_cycles": int, "break_on": str}.get(field.name, float)
        group.add_argument("--" + field.name.replace("_", "-"), dest=field.name, type=kind, default=argparse.SUPPRESS)
    return parser


def read(options: argparse.Namespace) -> tuple[ContactLog, Parameters]:
    """The log that a command line names and its parameters, checked against each other."""
    try:
        log, footer = ContactLog.read(options.log), parameters(options.log)
    except (OSError, KeyError, ValueError) as error:
        raise LogError(f"cannot be read as a contact log: {error}") from error
    known = {field.name for field in dataclasses.fields(Parameters)} | NOT_NEEDED
    if unknown := sorted(footer.keys() - known):
        raise LogError(f"this replay does not know the parameters {', '.join(unknown)} in its footer")
    given = Parameters.from_values(footer | vars(options))
    log.check(given)
    return log, given
