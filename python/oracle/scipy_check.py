"""Checks the oracle itself: the first breaks of a contact log, integrated numerically by SciPy's DOP853.

    .venv/bin/python -m oracle.scipy_check log.parquet --breaks 40

Shares no method with the oracle: the equations of motion are integrated step by step (explicit Runge-Kutta of order 8,
rtol 1e-13) and each break is found by an event function, the distance of the nearest break position. Of the log only
thresholds, stiffnesses and the times of reattachments are taken; which contact breaks next, and when, comes out. Each
break is compared with the log and with the oracle. An event is polished by integrating again from the last step before
it, since the dense output of a step is less accurate than its end.

The first break of 70 blocks takes some seconds.

Exit code: 0 if every break is that of the log and both comparisons are within --worst, 1 if not, 2 for a log that
cannot be replayed.
"""

import sys
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from . import contact_log
from .contact_log import ContactLog, LogError, Parameters
from .motion import Contacts
from .replay import COINCIDENT, Replay

#: Relative tolerance of the integration; the absolute one is this times f_s/k and times f_s/k · ω_max.
RELATIVE_TOLERANCE = 1e-13


class Integration:
    """The slider, integrated from contact event to contact event.

    A state holds N displacements in m, then N velocities in m/s.
    """

    def __init__(self, parameters: Parameters, log: ContactLog) -> None:
        """At rest at time 0, with the contacts of the beginning of the log."""
        self.parameters, self.log = parameters, log
        self.contacts = Contacts(parameters, log)
        first = parameters.contacts
        self.reattachments = list(np.flatnonzero(~log.is_break[first:]) + first)
        self.time, self.state = 0.0, np.zeros(2 * parameters.N)
        stiffest = 4 * parameters.coupling + parameters.Kd + 2 * parameters.Ns * parameters.ki
        fastest = np.sqrt(stiffest / parameters.mass)
        self.absolute_tolerance = RELATIVE_TOLERANCE * parameters.reach * np.repeat([1.0, fastest], parameters.N)

    def derivative(self) -> Callable[[float, np.ndarray], np.ndarray]:
        """The right-hand side of the equations of motion with the present contacts."""
        p, n = self.parameters, self.parameters.N
        stiffness = self.contacts.block_stiffness()
        pull = self.contacts.force(np.zeros(n))

        def derivative(time: float, state: np.ndarray) -> np.ndarray:
            x, v = state[:n], state[n:]
            force = pull - stiffness * x - p.mass * p.gamma * v
            stretch = p.coupling * np.diff(x)
            force[:-1] += stretch
            force[1:] -= stretch
            force[0] += p.Kd * (p.drive(time) - x[0])
            return np.concatenate([v, force / p.mass])

        return derivative

    def integrate(self, start: float, state: np.ndarray, end: float, event: Callable | None = None):
        """SciPy's solution between two times in s."""
        solution = solve_ivp(
            self.derivative(),
            (start, end),
            state,
            method="DOP853",
            rtol=RELATIVE_TOLERANCE,
            atol=self.absolute_tolerance,
            events=event,
        )
        if not solution.success:
            raise LogError(f"at t = {start}: SciPy reports: {solution.message}")
        return solution

    def next_break(self) -> tuple[float, list[tuple[int, int]]]:
        """Moves to the next break, through any reattachments before it: its time in s and the places that break."""
        n = self.parameters.N
        while True:
            upper, lower = self.contacts.levels(np.zeros(n))
            highest, lowest = upper.min(axis=1), lower.max(axis=1)

            def distance(_: float, state: np.ndarray) -> float:
                """Distance to the nearest break position, in m; negative beyond it."""
                return min((highest - state[:n]).min(), (state[:n] - lowest).min())

            distance.terminal, distance.direction = True, -1
            if distance(self.time, self.state) <= 0:
                break
            end = self.log.time[self.reattachments[0]] if self.reattachments else self.log.time[-1] * 1.01
            if end > self.time:
                solution = self.integrate(self.time, self.state, end, distance)
                if solution.t_events[0].size:
                    self.polish(solution, highest, lowest)
                    break
                self.time, self.state = end, solution.y[:, -1]
            if not self.reattachments:
                raise LogError("the log ends before the wanted number of breaks")
            row = self.reattachments.pop(0)
            self.contacts.attach(self.log, row, self.state[self.log.block[row]])
        x = self.state[:n, None]
        # All that are reached within rounding: identical contacts break together.
        margin = COINCIDENT * self.parameters.reach
        reached = [(int(i), int(j)) for i, j in np.argwhere((upper - x <= margin) | (x - lower <= margin))]
        for place in reached:
            self.contacts.detach(place)
        return self.time, reached

    def polish(self, solution, highest: np.ndarray, lowest: np.ndarray) -> None:
        """Moves to the crossing by Newton's method, each time integrating from the last step before it."""
        n = self.parameters.N
        start, state = solution.t[-2], solution.y[:, -2]
        self.time = solution.t_events[0][0]
        x = solution.y_events[0][0][:n]
        above, below = highest - x, x - lowest
        block, level = (above.argmin(), highest) if above.min() < below.min() else (below.argmin(), lowest)
        for _ in range(4):
            end = self.integrate(start, state, self.time).y[:, -1]
            self.time -= (end[block] - level[block]) / end[n + block]
        self.state = self.integrate(start, state, self.time).y[:, -1]
        # On the level to the last digit, so that it counts as reached.
        self.state[block] = level[block]


def break_times(integration: Integration, replay: Replay, wanted: int) -> np.ndarray | None:
    """Times in s at which SciPy finds the first `wanted` breaks of a replayed log.

    None, and a message, if it finds others.
    """
    due = {}
    for index, row in enumerate(replay.rows):
        due.setdefault(replay.log.place(row), []).append(index)
    times = np.full(len(replay.rows), np.nan)
    while np.isnan(times[:wanted]).any():
        time, places = integration.next_break()
        for block, contact in places:
            if not due.get((block, contact)):
                print(f"SciPy breaks block {block + 1}, contact {contact + 1} at t = {time:.9g} s; the log does not")
                return None
            times[due[block, contact].pop(0)] = time
    return times[:wanted]


def main() -> int:
    parser = contact_log.parser("oracle.scipy_check", __doc__)
    parser.add_argument("--breaks", type=int, default=40, help="number of breaks to compare (%(default)d)")
    parser.add_argument("--worst", type=float, default=1e-8, help="limit on the time differences, in s (%(default)g)")
    options = parser.parse_args()
    try:
        log, parameters = contact_log.read(options)
        if parameters.ramp_time > 0 or parameters.pulse_start is not None:
            raise LogError("the modulation is ramped or a pulse, which is not followed here; the oracle follows both")
        # A few more than are compared: within the limits, two breaks may come in either order.
        replay = Replay(parameters, log, options.breaks + parameters.Ns, np.inf).run()
        wanted = min(options.breaks, len(replay.rows))
        times = break_times(Integration(parameters, log), replay, wanted)
    except LogError as error:
        print(f"{options.log}: {error}", file=sys.stderr)
        return 2
    if times is None:
        return 1
    against_oracle = np.abs(times - replay.predicted[:wanted])
    against_log = np.abs(times - log.time[replay.rows[:wanted]])
    print(f"breaks               {wanted}, to t = {times[-1]:.9g} s")
    for name, errors in (("SciPy - oracle", against_oracle), ("SciPy - log", against_log)):
        print(f"{name:20} worst {errors.max():.1e} s, median {np.median(errors):.1e} s")
    return 0 if max(against_oracle.max(), against_log.max()) <= options.worst else 1


if __name__ == "__main__":
    sys.exit(main())
