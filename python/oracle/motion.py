"""The contacts, and the exact motion of the slider between two contact events (see the package's docstring)."""

from typing import NamedTuple

import numpy as np

from .contact_log import ContactLog, Parameters

#: A touch of a break position shallower than this, over f_s/k, is rounding and no crossing.
TOUCH = 1e-16
#: Longest time in s by which a break may precede the event before it, where a log has two events in the wrong order.
MAX_BACKWARD = 1e-5


class Contacts:
    """The state of all contacts: arrays of N blocks by N_s contacts. A place is a block and a contact, from 0."""

    def __init__(self, parameters: Parameters, log: ContactLog) -> None:
        """All contacts attached for the first time, unstressed, with the slider at rest at 0."""
        shape = (parameters.N, parameters.Ns)
        self.is_two_sided = parameters.break_on == "magnitude"
        self.attached = np.zeros(shape, dtype=bool)
        #: Attached, and not yet found to be missed.
        self.watched = np.zeros(shape, dtype=bool)
        self.threshold, self.stiffness, self.anchor = np.zeros((3, *shape))
        for row in range(parameters.contacts):
            self.attach(log, row, 0.0)

    def attach(self, log: ContactLog, row: int, anchor: float) -> None:
        """Attaches the contact of a row of the log, unstressed at `anchor`, in m."""
        place = log.place(row)
        self.attached[place] = self.watched[place] = True
        self.threshold[place], self.stiffness[place] = log.threshold[row], log.stiffness[row]
        self.anchor[place] = anchor

    def detach(self, place: tuple[int, int]) -> None:
        self.attached[place] = self.watched[place] = False

    def block_stiffness(self) -> np.ndarray:
        """Σ k_i of the attached contacts of each block, in N/m."""
        return np.where(self.attached, self.stiffness, 0.0).sum(axis=1)

    def force(self, displacement: np.ndarray) -> np.ndarray:
        """Force of the attached contacts on each block, in N, with the blocks at `displacement`, in m."""
        return np.where(self.attached, self.stiffness * (self.anchor - displacement[:, None]), 0.0).sum(axis=1)

    def levels(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Break positions of each contact above and below, in m relative to its block; infinite if there is none."""
        offset = self.anchor - displacement[:, None]
        reach = np.divide(self.threshold, self.stiffness, out=np.zeros_like(offset), where=self.attached)
        upper = np.where(self.attached, offset + reach, np.inf)
        lower = np.where(self.attached & self.is_two_sided, offset - reach, -np.inf)
        return upper, lower


class Bounds(NamedTuple):
    """The motion at some times, and bounds that hold from then on: arrays of times by blocks, in SI units.

    `displacement` counts from the start, `drift` is its linear part; `curvature` bounds |x''|, `distance` |x - drift|.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    drift: np.ndarray
    curvature: np.ndarray
    distance: np.ndarray


class Crossing(NamedTuple):
    """A block that reaches one of its levels: time since the start in s, block, and +1 for the upper level or -1."""

    time: float
    block: int
    sign: float


class Motion:
    """The exact motion from a given state, for as long as no contact breaks or attaches. Times count from the start."""

    def __init__(
        self, parameters: Parameters, contacts: Contacts, time: float, displacement: np.ndarray, velocity: np.ndarray
    ) -> None:
        """The state at `time`, in s: `displacement` in m and `velocity` in m/s of each block."""
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
        #: Blocks by modes.
        self.shape = np.ascontiguousarray(rows.T)
        self.gamma, self.omega = p.gamma, p.angular_frequency

        # The driven motion of the modes: drift_start + drift_rate t + Re(response exp(iωt)).
        square = self.sigma**2
        pull = self.shape[0] * p.Kd / p.mass
        wave = p.Delta * np.exp(1j * p.phase(time)) if p.Delta > 0 else 0.0
        self.response = pull * wave / (square - self.omega**2 + 1j * self.gamma * self.omega)
        self.drift_rate = pull * p.V0 / square
        unbalanced = self.shape.T @ force / p.mass
        self.drift_start = (unbalanced - pull * np.real(wave) - self.gamma * self.drift_rate) / square
        #: Amplitude of the cosine in each block, in m.
        self.amplitude = np.abs(self.shape @ self.response)

        # The free motion starts with what the driven motion lacks.
        self.free = -self.drift_start - self.response.real
        self.free_rate = self.shape.T @ velocity - self.drift_rate + self.omega * self.response.imag
        self.half = 0.5 * self.gamma
        difference = square - self.half**2
        self.is_underdamped = difference > 0
        # At critical damping sin(wτ)/w is τ to the last digit for any w this small.
        self.w = np.maximum(np.sqrt(np.abs(difference)), 1e-6)
        self.slow = square / (self.half + self.w)

    def free_motion(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The free motion and its first two derivatives: arrays of times by modes."""
        tau = np.asarray(tau)[:, None]
        under = self.is_underdamped
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
        return y, rate, -self.gamma * rate - self.sigma**2 * y

    def driven_motion(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The drift, and the cosine with its rate: arrays of times by modes."""
        tau = np.asarray(tau)[:, None]
        rotated = self.response * np.exp(1j * (self.omega * tau))
        return self.drift_start + self.drift_rate * tau, rotated.real, -self.omega * rotated.imag

    def at(self, tau: float, block: int | slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """Displacement since the start in m and velocity in m/s at a time: of all blocks, or of one."""
        tau = np.atleast_1d(tau)
        y, rate, _ = self.free_motion(tau)
        drift, cosine, cosine_rate = self.driven_motion(tau)
        shape = self.shape[block].T
        return ((y + drift + cosine) @ shape)[0], ((rate + self.drift_rate + cosine_rate) @ shape)[0]

    def bounds(self, tau: np.ndarray) -> Bounds:
        y, rate, second = self.free_motion(tau)
        drift, cosine, cosine_rate = self.driven_motion(tau)
        shape, magnitude = self.shape.T, np.abs(self.shape.T)
        block_drift = drift @ shape
        return Bounds(
            displacement=(y + cosine) @ shape + block_drift,
            velocity=(rate + self.drift_rate + cosine_rate) @ shape,
            drift=block_drift,
            curvature=np.hypot(second, self.sigma * rate) @ magnitude + self.omega**2 * self.amplitude,
            distance=np.hypot(y, rate / self.sigma) @ magnitude + self.amplitude,
        )

    def root(self, low: float, high: float, block: int, sign: float, level: float) -> float:
        """Time at which sign · x of a block rises through `level`, below it at `low` and not below it at `high`."""
        tau = high
        for _ in range(200):
            x, v = self.at(tau, block)
            height, slope = sign * x - level, sign * v
            low, high = (low, tau) if height >= 0 else (tau, high)
            newton = tau - height / slope if slope > 0 else np.inf
            following = newton if low <= newton <= high else 0.5 * (low + high)
            if abs(following - tau) <= 4e-16 * abs(following) or not low < following < high:
                return following
            tau = following
        return tau

    def root_before(self, block: int, sign: float, level: float) -> float:
        """Time before the start at which the same motion, run backward, passed a level that it has just passed."""
        tau = 0.0
        for _ in range(50):
            x, v = self.at(tau, block)
            if sign * v <= 0:
                return 0.0
            step = (sign * x - level) / (sign * v)
            tau -= step
            if not -MAX_BACKWARD < tau <= 0:
                return 0.0
            if abs(step) <= 1e-15 * abs(tau):
                break
        return tau

    def first_crossing(self, horizon: float, upper: np.ndarray, lower: np.ndarray, unit: float) -> Crossing | None:
        """The first time in [0, horizon] at which a block is not inside its levels.

        `upper` and `lower` hold one level per block, in m relative to the start; `unit` is f_s/k.
        """
        low, high = np.array([0.0]), np.array([horizon])
        brackets, earliest = [], horizon
        while low.size:
            start, end = self.bounds(low), self.bounds(high)
            length = (high - low)[:, None]
            bulge = length**2 / 8 * start.curvature
            is_flat = bulge <= TOUCH * unit
            undecided = np.zeros(len(low), dtype=bool)
            for sign, level in ((1.0, upper), (-1.0, -lower)):
                before, after = sign * start.displacement - level, sign * end.displacement - level
                by_chord = np.maximum(before, after) + bulge
                by_drift = np.maximum(sign * start.drift, sign * end.drift) - level + start.distance
                near = (np.minimum(by_chord, by_drift) >= 0) & ((before >= 0) | (after >= 0) | ~is_flat)
                slope_before, slope_after = sign * start.velocity, sign * end.velocity
                rises = np.minimum(slope_before, slope_after) > 0.5 * length * start.curvature
                falls = np.maximum(slope_before, slope_after) < -0.5 * length * start.curvature
                past = near & (before >= 0)
                crossed = near & ~past & (after >= 0) & (rises | is_flat)
                for found, ends in ((past, low), (crossed, high)):
                    for row, block in np.argwhere(found):
                        brackets.append((low[row], ends[row], int(block), sign))
                        earliest = min(earliest, ends[row])
                undecided |= (near & ~past & ~rises & ~falls & ~is_flat).any(axis=1)
            keep = undecided & (low < earliest)
            middle = 0.5 * (low[keep] + high[keep])
            low, high = np.concatenate([low[keep], middle]), np.concatenate([middle, high[keep]])
        crossings = []
        for start, end, block, sign in brackets:
            if start <= earliest:
                level = upper[block] if sign > 0 else -lower[block]
                time = self.root(start, end, block, sign, level) if end > start else start
                crossings.append(Crossing(time, block, sign))
        return min(crossings, default=None)
