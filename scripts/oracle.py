"""Replays a contact log with the exact solution of the model and says how far the solver that wrote it was off.

Between two contact events the model is linear, with damping proportional to mass, so that it decouples into modes.
With displacements u counted from the state at the last event, mode z with angular frequency σ obeys

    z'' + γ z' + σ² z = g + e (V0 τ + Δ [cos(ωτ + φ) - cos φ]),

g the unbalanced force and e the share of the driving spring, both over the block mass. The solution is a ramp, a
cosine and a free motion, under-, over- or critically damped: closed forms, evaluated without a time step. σ and the
modes come from the singular values of B with S = m BᵀB (a row sqrt(stiffness/m) for every spring), which keeps the
digits of slow modes beside fast ones.

The log gives thresholds, stiffnesses and the times of reattachment. It does *not* give the times of breaks: these are
solved for (safeguarded Newton on the exact motion, in a bracket that holds the first crossing), compared with the
log, and the state goes on from the oracle's own time. Anchors of reattached contacts are the oracle's own
displacements. Between events every contact is watched: one that is past its threshold by more than the limit on the
residual and does not break counts as missed. The search for crossings halves intervals until bounds decide: over an
interval of length h that starts at a,

    |z''| <= sqrt(z''(a)² + σ² z'(a)²) for each free mode (its energy only falls), so that
    x stays within h²/8 max|x''| of its chord, and x' within h/2 max|x''| of its nearer end.

Nothing is sampled on trust, so nothing is missed in long intervals either.

Reported, over all breaks:
    time error      |predicted - logged| in s, worst and median;
    residual        ||k_i (x - a_i)| - f_i| / f_s, with x the oracle's displacement at the *logged* time;
    displacement    |oracle's - logged| displacement at breaks and reattachments, over f_s/k;
    unreached       breaks in the log where the exact motion turns back or is still short of the threshold much later:
                    they have a residual but no time error;
    missed          contacts past their threshold that the log does not break.

Trajectories of the model are chaotic, the more so the slower the drive: a break that comes a little late meets another
phase of the fast motion. Errors then grow with the number of breaks without any mistake, by a factor of ten
every few breaks for a single block at 1e-6 m/s. With --follow the state goes on from the *logged* time of each break
instead of the predicted one. Given the times of all events the motion is linear and damped, so errors do not grow, and
the residuals certify each break of a log of any length and tolerance. The solver's displacements are used in neither
mode.

A solver that leaps leaves out motions of tolerance · f_s/k, which show as residuals of that order: for tolerances
above 1e-8 give --residual, and with it --worst and --median, accordingly.

    stickslip simulate --set Delta=1e-6 --set frequency=58 --time 0.2 --tolerance 1e-10 --contacts log.parquet
    python scripts/oracle.py log.parquet --breaks 1200
    python scripts/oracle.py log.parquet --follow

Parameters come from the footer of the log; options (--N, --V0, ...) win over it. Needs NumPy and PyArrow. A replay
takes about 3 ms an event at N = 70.

Exit code: 0 within the limits and nothing missed, 1 beyond one of them, 2 for a log that cannot be replayed.
"""

import argparse
import json
import sys

import numpy as np

import contact_log
from contact_log import LogError

#: Break positions of one block that are closer than this, over f_s/k, are reached at one instant (identical contacts).
SAME = 1e-12
#: A touch of a break position shallower than this, over f_s/k, is rounding and no crossing.
TOUCH = 1e-16
#: A break may come late by so many times the time in which the drive covers the limit on the residual.
LATE = 10.0
#: Longest time in s by which a break may precede the event before it, where a log has two events in the wrong order.
BACKWARD = 1e-5


class Contacts:
    """The contacts: arrays of N blocks by N_s contacts."""

    def __init__(self, parameters):
        shape = (parameters.N, parameters.Ns)
        self.parameters = parameters
        self.attached = np.zeros(shape, dtype=bool)
        #: Attached, not yet found to be missed.
        self.watched = np.zeros(shape, dtype=bool)
        self.threshold = np.zeros(shape)
        self.stiffness = np.zeros(shape)
        self.anchor = np.zeros(shape)

    def attach(self, place, threshold, stiffness, anchor):
        """Attaches a contact, unstressed at `anchor`."""
        self.attached[place] = self.watched[place] = True
        self.threshold[place], self.stiffness[place], self.anchor[place] = threshold, stiffness, anchor

    def detach(self, place):
        """Breaks a contact."""
        self.attached[place] = self.watched[place] = False

    def block_stiffness(self):
        """Σ k_i of the attached contacts of each block, in N/m."""
        return np.where(self.attached, self.stiffness, 0.0).sum(axis=1)

    def force(self, displacement):
        """Force of the attached contacts on each block, in N."""
        return np.where(self.attached, self.stiffness * (self.anchor - displacement[:, None]), 0.0).sum(axis=1)

    def levels(self, displacement):
        """Break positions of each contact above and below, relative to its block; infinite where there is none."""
        offset = self.anchor - displacement[:, None]
        reach = np.divide(self.threshold, self.stiffness, out=np.zeros_like(offset), where=self.attached)
        upper = np.where(self.attached, offset + reach, np.inf)
        two_sided = self.attached & (self.parameters.break_on == "magnitude")
        lower = np.where(two_sided, offset - reach, -np.inf)
        return upper, lower


class Motion:
    """The exact motion from a given state, as long as no contact breaks or attaches."""

    def __init__(self, parameters, contacts, time, displacement, velocity):
        p = parameters
        stiffness = contacts.block_stiffness()
        stiffness[0] += p.Kd
        force = contacts.force(displacement)
        stretch = p.coupling * np.diff(displacement)
        force[:-1] += stretch
        force[1:] -= stretch
        force[0] += p.Kd * (p.drive(time) - displacement[0])

        springs = np.zeros((2 * p.N - 1, p.N))
        springs[np.arange(p.N), np.arange(p.N)] = np.sqrt(stiffness / p.mass)
        chain = np.arange(p.N - 1)
        springs[p.N + chain, chain] = np.sqrt(p.coupling / p.mass)
        springs[p.N + chain, chain + 1] = -np.sqrt(p.coupling / p.mass)
        _, self.sigma, rows = np.linalg.svd(springs, full_matrices=False)
        self.shape = np.ascontiguousarray(rows.T)
        self.magnitude = np.abs(self.shape)
        self.damping = p.gamma
        self.omega = p.angular_frequency

        square = self.sigma**2
        pull = self.shape[0] * p.Kd / p.mass
        wave = p.Delta * np.exp(1j * p.phase(time)) if p.Delta > 0 else 0.0
        self.wave = pull * wave / (square - self.omega**2 + 1j * self.damping * self.omega)
        self.rate = pull * p.V0 / square
        unbalanced = self.shape.T @ force / p.mass
        self.start = (unbalanced - pull * np.real(wave) - self.damping * self.rate) / square
        self.free = -self.start - self.wave.real
        self.free_rate = self.shape.T @ velocity - self.rate + self.omega * self.wave.imag
        #: Amplitude of the cosine in each block, in m.
        self.swing = np.abs(self.shape @ self.wave)

        half = 0.5 * self.damping
        difference = square - half**2
        self.half = half
        self.is_under = difference > 0
        # At critical damping sin(wτ)/w is τ to the last digit with any w this small.
        self.w = np.maximum(np.sqrt(np.abs(difference)), 1e-6)
        self.slow = square / (half + self.w)

    def free_motion(self, tau):
        """Free part of the modes and its first two derivatives; a row for each time since the start."""
        tau = np.asarray(tau)[:, None]
        under = self.is_under
        cosine, sine = np.empty((2, len(tau), len(self.sigma)))
        angle = self.w[under] * tau
        decay = np.exp(-self.half * tau)
        cosine[:, under] = decay * np.cos(angle)
        sine[:, under] = decay * np.sin(angle) / self.w[under]
        if not under.all():
            w = self.w[~under]
            decay = np.exp(-self.slow[~under] * tau)
            cosine[:, ~under] = decay * 0.5 * (1.0 + np.exp(-2.0 * w * tau))
            sine[:, ~under] = decay * -np.expm1(-2.0 * w * tau) / (2.0 * w)
        y = cosine * self.free + sine * (self.free_rate + self.half * self.free)
        rate = cosine * self.free_rate - sine * (self.sigma**2 * self.free + self.half * self.free_rate)
        return y, rate, -self.damping * rate - self.sigma**2 * y

    def driven_motion(self, tau):
        """Ramp of the modes without the cosine, and value and rate of the cosine, at times since the start."""
        tau = np.asarray(tau)[:, None]
        turned = self.wave * np.exp(1j * (self.omega * tau))
        return self.start + self.rate * tau, turned.real, -self.omega * turned.imag

    def at(self, tau, blocks=slice(None)):
        """Displacements since the start in m and velocities in m/s at times since the start: a row for each time."""
        tau = np.atleast_1d(tau)
        y, rate, _ = self.free_motion(tau)
        ramp, cosine, cosine_rate = self.driven_motion(tau)
        shape = self.shape[blocks].T
        return (y + ramp + cosine) @ shape, (rate + self.rate + cosine_rate) @ shape

    def bounds(self, tau):
        """Displacement, velocity and the ramp alone of each block, at times since the start, and bounds from then on.

        The bounds are the largest |x''| and the largest distance from the ramp.
        """
        y, rate, second = self.free_motion(tau)
        ramp, cosine, cosine_rate = self.driven_motion(tau)
        shape, magnitude = self.shape.T, self.magnitude.T
        bend = np.hypot(second, self.sigma * rate) @ magnitude + self.omega**2 * self.swing
        stray = np.hypot(y, rate / self.sigma) @ magnitude + self.swing
        driven = ramp @ shape
        return (y + cosine) @ shape + driven, (rate + self.rate + cosine_rate) @ shape, driven, bend, stray

    def root(self, low, high, block, sign, level):
        """Time at which sign · x of a block rises through `level`, below it at `low` and not below it at `high`."""
        tau = high
        for _ in range(200):
            x, v = (float(value[0, 0]) for value in self.at(tau, [block]))
            height, slope = sign * x - level, sign * v
            low, high = (low, tau) if height >= 0 else (tau, high)
            newton = tau - height / slope if slope > 0 else np.inf
            following = newton if low <= newton <= high else 0.5 * (low + high)
            if abs(following - tau) <= 4e-16 * abs(following) or not low < following < high:
                return following
            tau = following
        return tau

    def root_before(self, block, sign, level):
        """Time before the start at which the same motion, run backward, passed a level that it is past by a hair."""
        tau = 0.0
        for _ in range(50):
            x, v = (float(value[0, 0]) for value in self.at(tau, [block]))
            if sign * v <= 0:
                return 0.0
            step = (sign * x - level) / (sign * v)
            tau -= step
            if not -BACKWARD < tau <= 0:
                return 0.0
            if abs(step) <= 1e-15 * abs(tau):
                break
        return tau

    def first_crossing(self, horizon, upper, lower, unit):
        """The first time in [0, horizon] at which a block is not inside its levels: (time, block, sign), or None.

        `upper` and `lower` hold one level a block, relative to the start; `unit` is f_s/k.
        """
        low, high = np.array([0.0]), np.array([horizon])
        brackets, earliest = [], horizon
        while low.size:
            here, there = (self.bounds(tau) for tau in (low, high))
            length = (high - low)[:, None]
            bend, stray = here[3], here[4]
            undecided = np.zeros(len(low), dtype=bool)
            for sign, level in ((1.0, upper), (-1.0, -lower)):
                before, after = sign * here[0] - level, sign * there[0] - level
                by_chord = np.maximum(before, after) + length**2 / 8 * bend
                by_ramp = np.maximum(sign * here[2], sign * there[2]) - level + stray
                near = (np.minimum(by_chord, by_ramp) >= 0) & (
                    (before >= 0) | (after >= 0) | (length**2 / 8 * bend > TOUCH * unit)
                )
                slope_before, slope_after = sign * here[1], sign * there[1]
                rises = np.minimum(slope_before, slope_after) > 0.5 * length * bend
                falls = np.maximum(slope_before, slope_after) < -0.5 * length * bend
                tiny = length**2 / 8 * bend <= TOUCH * unit
                past = near & (before >= 0)
                crossed = near & ~past & (after >= 0) & (rises | tiny)
                for start, end in ((past, low), (crossed, high)):
                    for row, block in np.argwhere(start):
                        brackets.append((low[row], end[row], block, sign))
                        earliest = min(earliest, end[row])
                undecided |= (near & ~past & ~rises & ~falls & ~tiny).any(axis=1)
            keep = undecided & (low < earliest)
            middle = 0.5 * (low[keep] + high[keep])
            low, high = np.concatenate([low[keep], middle]), np.concatenate([middle, high[keep]])
        found = []
        for start, end, block, sign in brackets:
            if start <= earliest:
                level = upper[block] if sign > 0 else -lower[block]
                found.append((self.root(start, end, block, sign, level) if end > start else start, block, sign))
        return min(found, default=None)


class Replay:
    """The replay of one log."""

    def __init__(self, parameters, log, breaks, slack, follow=False):
        """Replays at most `breaks` breaks; a contact past its threshold by `slack` f_s counts as missed.

        With `follow` the state goes on from the logged times of breaks, else from the predicted ones.
        """
        self.parameters, self.log, self.slack, self.follow = parameters, log, slack, follow
        self.contacts = Contacts(parameters)
        self.time, self.row = 0.0, parameters.N * parameters.Ns
        self.displacement, self.velocity = np.zeros((2, parameters.N))
        broken = np.flatnonzero(log["is_break"])
        self.end = len(log["time"]) if len(broken) <= breaks else broken[breaks]
        for row in range(self.row):
            self.contacts.attach(self.place(row), log["threshold"][row], log["stiffness"][row], 0.0)
        self.motion = None
        #: Of each break: its row in the log, predicted time (NaN if unreached) and residual.
        self.rows, self.predicted, self.residuals = [], [], []
        self.displacement_errors, self.missed = [], []

    def place(self, row):
        """Block and contact of a row."""
        return self.log["block"][row], self.log["contact"][row]

    def run(self):
        """Replays the log to its end, or to the last wanted break."""
        cycles = self.parameters.cycles()
        cycle, cycle_end = next(cycles)
        while self.row < self.end:
            self.motion = Motion(cycle, self.contacts, self.time, self.displacement, self.velocity)
            if cycle_end < self.log["time"][self.row]:
                self.watch(cycle_end - self.time)
                self.move_to(cycle_end - self.time)
                self.time = cycle_end
                cycle, cycle_end = next(cycles)
            elif self.log["is_break"][self.row]:
                self.take_breaks()
            else:
                self.take_reattachment()
        return self

    def take_reattachment(self):
        """Moves on to the next reattachment, whose time is known."""
        row = self.row
        self.watch(self.log["time"][row] - self.time)
        self.move_to(self.log["time"][row] - self.time)
        self.time = self.log["time"][row]
        place = self.place(row)
        self.contacts.attach(place, self.log["threshold"][row], self.log["stiffness"][row], self.displacement[place[0]])
        self.displacement_errors.append(abs(self.displacement[place[0]] - self.log["displacement"][row]))
        self.row += 1

    def take_breaks(self):
        """Predicts the next break; takes along the following ones of the same block that come at the same instant."""
        unit = self.parameters.reach
        upper, lower = self.contacts.levels(self.displacement)
        place = self.place(self.row)
        tau, sign = self.predict(self.row, upper[place], lower[place])
        logged = self.log["time"][self.row]
        advance = logged - self.time if self.follow or np.isnan(tau) else tau
        # It is about to be judged by its time.
        self.contacts.watched[place] = False
        self.watch(advance)
        level = upper if sign > 0 else lower
        while self.row < self.end and self.log["is_break"][self.row]:
            following = self.place(self.row)
            is_together = following[0] == place[0] and abs(level[following] - level[place]) <= SAME * unit
            if not is_together or (self.follow and self.log["time"][self.row] != logged):
                break
            self.judge(self.row, tau)
            self.contacts.detach(following)
            self.row += 1
        self.move_to(advance)
        self.time = logged if self.follow else self.time + advance

    def predict(self, row, upper, lower):
        """Time from now at which the contact of a row reaches its level, NaN if it does not, and on which side."""
        block = self.log["block"][row]
        levels = np.full((2, self.parameters.N), np.inf) * [[1], [-1]]
        levels[:, block] = upper, lower
        if upper <= 0 or lower >= 0:
            sign = 1.0 if upper <= 0 else -1.0
            return self.motion.root_before(block, sign, upper if sign > 0 else -lower), sign
        # The logged time says how far to look; what is found is the first crossing whatever it says.
        logged = self.log["time"][row] - self.time
        near = max(logged, 0.0) * (1 + 1e-6) + 1e-7
        for horizon in (near, near + LATE * self.slack * self.parameters.reach / self.parameters.V0):
            found = self.motion.first_crossing(horizon, *levels, self.parameters.reach)
            if found:
                return found[0], found[2]
        x = self.motion.at(logged, [block])[0][0, 0]
        return np.nan, 1.0 if upper - x < x - lower else -1.0

    def judge(self, row, tau):
        """Compares a predicted break with the log."""
        p, place = self.parameters, self.place(row)
        logged = self.log["time"][row]
        x = self.displacement[place[0]] + self.motion.at(logged - self.time, [place[0]])[0][0, 0]
        force = self.contacts.stiffness[place] * (x - self.contacts.anchor[place])
        self.rows.append(row)
        self.predicted.append(self.time + tau)
        self.residuals.append(abs(abs(force) - self.contacts.threshold[place]) / p.fs)
        self.displacement_errors.append(abs(x - self.log["displacement"][row]))

    def watch(self, tau):
        """Looks for contacts that pass their threshold, by more than the slack, within the next `tau` s."""
        while tau > 0:
            upper, lower = self.contacts.levels(self.displacement)
            slack = self.slack * self.parameters.reach
            upper = np.where(self.contacts.watched, upper, np.inf) + slack
            lower = np.where(self.contacts.watched, lower, -np.inf) - slack
            found = self.motion.first_crossing(tau, upper.min(axis=1), lower.max(axis=1), self.parameters.reach)
            if found is None:
                return
            after, block, sign = found
            contact = upper[block].argmin() if sign > 0 else lower[block].argmax()
            self.contacts.watched[block, contact] = False
            self.missed.append((self.time + after, int(block), int(contact)))

    def move_to(self, tau):
        """Moves the state on by `tau` s."""
        moved, velocity = self.motion.at(tau)
        self.displacement = self.displacement + moved[0]
        self.velocity = velocity[0]


def report(replay):
    """The result as a dictionary of plain numbers."""
    if not replay.rows:
        raise LogError("the log holds no break")
    logged = replay.log["time"][replay.rows]
    errors = np.abs(np.array(replay.predicted) - logged)
    reached = errors[~np.isnan(errors)]
    residuals = np.array(replay.residuals)

    def place(row):
        return {"block": int(replay.log["block"][row]) + 1, "contact": int(replay.log["contact"][row]) + 1}

    def at(index):
        return {"break": int(index), "time": float(logged[index])} | place(replay.rows[index])

    return {
        "breaks": len(errors),
        "reattachments": int(replay.row - replay.parameters.N * replay.parameters.Ns - len(errors)),
        "end_time": float(replay.time),
        "worst_time_error": float(reached.max(initial=0.0)),
        "median_time_error": float(np.median(reached)) if len(reached) else 0.0,
        "worst_time_error_at": at(np.nanargmax(errors)) if len(reached) else None,
        "worst_residual": float(residuals.max()),
        "median_residual": float(np.median(residuals)),
        "worst_residual_at": at(residuals.argmax()),
        "worst_displacement_error": float(max(replay.displacement_errors) / replay.parameters.reach),
        "unreached": [at(index) for index in np.flatnonzero(np.isnan(errors))],
        "missed": [
            {"time": float(time), "block": block + 1, "contact": contact + 1} for time, block, contact in replay.missed
        ],
    }


def print_table(result):
    """The result for people."""

    def where(at):
        return f"(break {at['break']}, block {at['block']}, t = {at['time']:.9g} s)" if at else ""

    counts = f"{result['breaks']}, reattachments {result['reattachments']}, to t = {result['end_time']:.9g} s"
    print(f"""breaks               {counts}
time error           worst {result["worst_time_error"]:.1e} s {where(result["worst_time_error_at"])}
                     median {result["median_time_error"]:.1e} s
residual             worst {result["worst_residual"]:.1e} f_s {where(result["worst_residual_at"])}
                     median {result["median_residual"]:.1e} f_s
displacement error   worst {result["worst_displacement_error"]:.1e} f_s/k
missed contacts      {len(result["missed"])}""")
    for missed in result["missed"][:5]:
        print(
            f"                     block {missed['block']}, contact {missed['contact']} from t = {missed['time']:.9g} s"
        )
    print(f"unreached breaks     {len(result['unreached'])}")
    for at in result["unreached"][:5]:
        print("                     " + where(at))
    print("within the limits" if result["within_limits"] else "BEYOND the limits")


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    contact_log.add_options(parser)
    parser.add_argument("--breaks", type=int, default=sys.maxsize, help="replay so many breaks (default: all)")
    parser.add_argument("--follow", action="store_true", help="go on from the logged times of breaks (see above)")
    parser.add_argument("--worst", type=float, default=1e-8, help="limit on the worst time error, in s (%(default)g)")
    parser.add_argument(
        "--median", type=float, default=1e-11, help="limit on the median time error, in s (%(default)g)"
    )
    parser.add_argument("--residual", type=float, default=1e-8, help="limit on the residual, in f_s (%(default)g)")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args()
    try:
        log, footer = contact_log.read(options.log)
        parameters = contact_log.parameters_from(options, footer)
        contact_log.check(log, parameters)
        result = report(Replay(parameters, log, options.breaks, options.residual, options.follow).run())
    except LogError as error:
        print(f"{options.log}: {error}", file=sys.stderr)
        return 2
    result["within_limits"] = (
        result["worst_time_error"] <= options.worst
        and result["median_time_error"] <= options.median
        and result["worst_residual"] <= options.residual
        and not result["missed"]
    )
    if options.json:
        print(json.dumps(result, indent=2))
    else:
        print_table(result)
    return 0 if result["within_limits"] else 1


if __name__ == "__main__":
    sys.exit(main())
