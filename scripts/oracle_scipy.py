"""Checks the oracle itself: the first breaks of a contact log, integrated numerically by SciPy's DOP853.

Shares no method with oracle.py: the equations of motion are integrated step by step (explicit Runge-Kutta of order 8,
rtol 1e-13) and each break is found by an event function, the distance of the nearest break position. Of the log only
thresholds, stiffnesses and the times of reattachments are taken; which contact breaks next, and when, comes out. Each
break is compared with the log and with oracle.py. An event is polished by integrating again from the last step before
it, since the dense output of a step is less accurate than its end.

    python scripts/oracle_scipy.py log.parquet --breaks 40

Needs NumPy, SciPy and PyArrow; the first break of 70 blocks takes it some seconds.

Exit code: 0 if every break is that of the log and both comparisons are within --worst, 1 if not, 2 for a log that
cannot be replayed.
"""

import argparse
import sys

import numpy as np
from scipy.integrate import solve_ivp

import contact_log
import oracle
from contact_log import LogError

#: Relative tolerance of the integration; the absolute one is this times f_s/k and times f_s/k · ω_max.
RELATIVE = 1e-13


class Integration:
    """The slider, integrated from contact event to contact event."""

    def __init__(self, parameters, log):
        self.parameters, self.log = parameters, log
        self.contacts = oracle.Contacts(parameters)
        first = parameters.N * parameters.Ns
        for row in range(first):
            self.attach(row, 0.0)
        self.attachments = list(np.flatnonzero(~log["is_break"][first:]) + first)
        self.time, self.state = 0.0, np.zeros(2 * parameters.N)
        fastest = np.sqrt(
            (4 * parameters.coupling + parameters.Kd + 2 * parameters.Ns * parameters.k) / parameters.mass
        )
        self.absolute = RELATIVE * parameters.reach * np.repeat([1.0, fastest], parameters.N)

    def attach(self, row, anchor):
        """Attaches the contact of a row of the log."""
        log = self.log
        self.contacts.attach(
            (log["block"][row], log["contact"][row]), log["threshold"][row], log["stiffness"][row], anchor
        )

    def prepare(self):
        """Right-hand side of the equations of motion, and distance to the nearest break position (negative beyond)."""
        p, n = self.parameters, self.parameters.N
        upper, lower = self.contacts.levels(np.zeros(n))
        stiffness = self.contacts.block_stiffness()
        pull = self.contacts.force(np.zeros(n))
        highest, lowest = upper.min(axis=1), lower.max(axis=1)

        def derivative(time, state):
            x, v = state[:n], state[n:]
            force = pull - stiffness * x - p.mass * p.gamma * v
            stretch = p.coupling * np.diff(x)
            force[:-1] += stretch
            force[1:] -= stretch
            force[0] += p.Kd * (p.drive(time) - x[0])
            return np.concatenate([v, force / p.mass])

        def distance(_, state):
            x = state[:n]
            return min((highest - x).min(), (x - lowest).min())

        distance.terminal = True
        distance.direction = -1
        return derivative, distance, upper, lower

    def integrate(self, derivative, start, state, end, events=None):
        """SciPy's integration between two times."""
        solution = solve_ivp(
            derivative, (start, end), state, method="DOP853", rtol=RELATIVE, atol=self.absolute, events=events
        )
        if not solution.success:
            raise LogError(f"at t = {start}: SciPy says: {solution.message}")
        return solution

    def next_break(self):
        """Goes on to the next break, through any reattachments before it: its time and the contacts that break."""
        n = self.parameters.N
        while True:
            derivative, distance, upper, lower = self.prepare()
            end = self.log["time"][self.attachments[0]] if self.attachments else self.log["time"][-1] * 1.01
            if distance(self.time, self.state) > 0 and end > self.time:
                solution = self.integrate(derivative, self.time, self.state, end, distance)
                if solution.t_events[0].size:
                    self.polish(derivative, solution, upper, lower)
                    break
                self.time, self.state = end, solution.y[:, -1]
            elif distance(self.time, self.state) <= 0:
                break
            if not self.attachments:
                raise LogError("the log ends before the wanted number of breaks")
            row = self.attachments.pop(0)
            self.attach(row, self.state[self.log["block"][row]])
        x = self.state[:n, None]
        # All that are reached within rounding: identical contacts break together.
        hair = oracle.SAME * self.parameters.reach
        reached = np.argwhere((upper - x <= hair) | (x - lower <= hair))
        for place in reached:
            self.contacts.detach(tuple(place))
        return self.time, [tuple(int(i) for i in place) for place in reached]

    def polish(self, derivative, solution, upper, lower):
        """Moves to the crossing by Newton's method, each time integrating from the last step before it."""
        n = self.parameters.N
        start, state = solution.t[-2], solution.y[:, -2]
        time = solution.t_events[0][0]
        x = solution.y_events[0][0][:n]
        above, below = upper.min(axis=1) - x, x - lower.max(axis=1)
        sign = 1.0 if above.min() < below.min() else -1.0
        block = above.argmin() if sign > 0 else below.argmin()
        level = upper[block].min() if sign > 0 else lower[block].max()
        for _ in range(4):
            end = self.integrate(derivative, start, state, time).y[:, -1]
            time -= (end[block] - level) / end[n + block]
        self.time = time
        self.state = self.integrate(derivative, start, state, time).y[:, -1]
        # On the level to the last digit, so that it counts as reached.
        self.state[block] = level


def break_times(integration, replay, wanted):
    """Times at which SciPy sees the first `wanted` breaks of a replayed log; None, and a message, if it sees others."""
    due = {}
    for index, row in enumerate(replay.rows):
        due.setdefault(tuple(int(i) for i in replay.place(row)), []).append(index)
    times = np.full(len(replay.rows), np.nan)
    while np.isnan(times[:wanted]).any():
        time, places = integration.next_break()
        for place in places:
            if not due.get(place):
                print(
                    f"SciPy breaks block {place[0] + 1}, contact {place[1] + 1} at t = {time:.9g} s; the log does not"
                )
                return None
            times[due[place].pop(0)] = time
    return times[:wanted]


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    contact_log.add_options(parser)
    parser.add_argument("--breaks", type=int, default=40, help="compare so many breaks (%(default)d)")
    parser.add_argument("--worst", type=float, default=1e-8, help="limit on the time differences, in s (%(default)g)")
    options = parser.parse_args()
    try:
        log, footer = contact_log.read(options.log)
        parameters = contact_log.parameters_from(options, footer)
        if parameters.ramp_time > 0:
            raise LogError("the modulation is ramped, which is not followed here; oracle.py does")
        contact_log.check(log, parameters)
        # A few more than are compared: within the limits, two breaks may come in either order.
        replay = oracle.Replay(parameters, log, options.breaks + parameters.Ns, np.inf).run()
        wanted = min(options.breaks, len(replay.rows))
        times = break_times(Integration(parameters, log), replay, wanted)
    except LogError as error:
        print(f"{options.log}: {error}", file=sys.stderr)
        return 2
    if times is None:
        return 1
    against_oracle = np.abs(times - replay.predicted[:wanted])
    against_log = np.abs(times - log["time"][replay.rows[:wanted]])
    print(f"""breaks               {len(times)}, to t = {times[-1]:.9g} s
SciPy - oracle       worst {against_oracle.max():.1e} s, median {np.median(against_oracle):.1e} s
SciPy - log          worst {against_log.max():.1e} s, median {np.median(against_log):.1e} s""")
    return 0 if max(against_oracle.max(), against_log.max()) <= options.worst else 1


if __name__ == "__main__":
    sys.exit(main())
