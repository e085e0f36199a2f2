"""Contact logs and parameters, as the independent integrators read them.

A contact log is the Parquet file that ``stickslip simulate --contacts FILE`` writes: every contact event in order, with
the columns time, block (counted from 1 at the trailing edge), contact (counted from 1 within its block), generation,
event ("attach" or "break"), displacement, force, threshold and stiffness, in SI units. The initial attachment of every
contact comes first, as generation 0 at time 0. The footer holds the parameters as JSON under "parameters". Nothing here
solves anything.
"""

import argparse
import dataclasses
import json

import numpy as np
import pyarrow.parquet as parquet


#: Columns of a log that hold numbers.
NUMBERS = ("time", "block", "contact", "generation", "displacement", "force", "threshold", "stiffness")


class LogError(Exception):
    """A contact log that cannot be replayed: what is wrong, and where."""


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Parameters of the model under their symbols in the paper, in SI units. Defaults: Fig. 1."""

    N: int = 70
    Ns: int = 20
    M: float = 11.5
    K: float = 1e8
    Kd: float = 4e7
    k: float = 5e6
    fs: float = 1.37
    dfs: float = 6.9e-3
    gamma: float = 6462.0
    V0: float = 1e-4
    Delta: float = 0.0
    T: float | None = None
    T_to: float | None = None
    Delta_to: float | None = None
    ramp_time: float = 0.0
    break_on: str = "magnitude"
    #: A maximum of the modulation, in s, from which its phase is counted.
    cycle_start: float = 0.0

    def __post_init__(self):
        if self.break_on not in ("magnitude", "tension"):
            raise LogError(f'break_on = {self.break_on}: must be "magnitude" or "tension"')
        if self.Delta > 0 and not (self.T and self.T > 0):
            raise LogError(f"T = {self.T}: a period > 0 must be given when Delta > 0 (--T)")

    @property
    def mass(self):
        """Mass m = M/N of a block, in kg."""
        return self.M / self.N

    @property
    def coupling(self):
        """Stiffness K_int = (N-1) K between neighbouring blocks, in N/m."""
        return (self.N - 1) * self.K

    @property
    def angular_frequency(self):
        """Angular frequency 2π/T of the modulation, in rad/s; 0 without modulation."""
        return 2 * np.pi / self.T if self.Delta > 0 else 0.0

    @property
    def reach(self):
        """Contact reach f_s/k, in m: the unit in which displacements are judged."""
        return self.fs / self.k

    def phase(self, time):
        """Phase of the modulation at a time in s, in rad, whole periods taken off."""
        return 2 * np.pi * (((time - self.cycle_start) / self.T) % 1.0) if self.Delta > 0 else 0.0

    def drive(self, time):
        """Displacement V0 t + Δ (cos(2πt/T) - 1) of the driven end, in m."""
        return self.V0 * time + self.Delta * (np.cos(self.phase(time)) - 1.0)

    def cycles(self):
        """The cycles of a ramped modulation: the parameters of each, and where it ends, in s; the last one is endless."""
        cycle = self
        while self.ramp_time > 0 and cycle.cycle_start < 2 * self.ramp_time:
            end = cycle.cycle_start + cycle.T
            yield cycle, end
            share = max(0.0, 1.0 - abs(end / self.ramp_time - 1.0))
            ends = ((self.T, self.T_to), (self.Delta, self.Delta_to))
            period, amplitude = (a if b is None else (1.0 - share) * a + share * b for a, b in ends)
            cycle = dataclasses.replace(self, T=period, Delta=amplitude, cycle_start=end)
        yield cycle, np.inf


def add_options(parser):
    """Adds one option for the log and one for each parameter to a command line."""
    parser.add_argument("log", help="contact log (Parquet)")
    group = parser.add_argument_group("parameters", "SI units; they win over those in the footer of the log")
    for field in dataclasses.fields(Parameters)[:-1]:
        kind = {"N": int, "Ns": int, "break_on": str}.get(field.name, float)
        group.add_argument("--" + field.name.replace("_", "-"), dest=field.name, type=kind, default=argparse.SUPPRESS)


def parameters_from(options, footer):
    """Parameters: the defaults, then those in the footer of the log, then those of the command line."""
    names = {field.name for field in dataclasses.fields(Parameters)}
    given = {name: value for name, value in footer.items() if name in names}
    given |= {name: value for name, value in vars(options).items() if name in names}
    return Parameters(**given)


def read(path):
    """Reads a log: its columns (block and contact counted from 0), and the parameters in the footer, if any."""
    try:
        table = parquet.read_table(path)
        columns = {name: table.column(name).to_numpy() for name in NUMBERS}
        columns["is_break"] = np.array(table.column("event").to_pylist()) == "break"
        footer = json.loads((parquet.read_metadata(path).metadata or {}).get(b"parameters", b"{}"))
    except (OSError, KeyError, ValueError) as error:
        raise LogError(f"cannot be read as a contact log: {error}") from error
    for name in ("block", "contact"):
        columns[name] = columns[name].astype(int) - 1
    return columns, footer


def check(log, parameters):
    """Refuses a log that contradicts the model or itself, whatever the motion: see the messages."""
    state = np.zeros((parameters.N, parameters.Ns), dtype=bool)
    life = np.full((parameters.N, parameters.Ns), -1)
    stiffness = parameters.k * np.sqrt(log["threshold"] / parameters.fs)
    if np.any(np.abs(log["stiffness"] / stiffness - 1) > 1e-12):
        raise LogError("stiffness is not k sqrt(f_i/f_s): are --k and --fs those of the run?")
    if np.any(np.diff(log["time"]) < 0):
        raise LogError(f"row {np.argmax(np.diff(log['time']) < 0) + 1}: time runs backward")
    for row, (time, block, contact, generation, is_break) in enumerate(
        zip(log["time"], log["block"], log["contact"], log["generation"], log["is_break"])
    ):
        place = (block, contact)
        if not (0 <= block < parameters.N and 0 <= contact < parameters.Ns):
            raise LogError(
                f"row {row}: there is no block {block + 1}, contact {contact + 1}: are --N and --Ns those of the run?"
            )
        if is_break != state[place] or generation != life[place] + (not is_break):
            raise LogError(f"row {row}: block {block + 1}, contact {contact + 1} breaks or attaches out of turn")
        if row < parameters.N * parameters.Ns and (is_break or generation != 0 or time != 0):
            raise LogError(f"row {row}: the log must begin with the initial attachment of every contact")
        state[place] = not is_break
        life[place] = generation
    if np.any(life < 0):
        raise LogError("the initial attachment of some contacts is missing")
