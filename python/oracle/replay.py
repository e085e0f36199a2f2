"""The replay of a contact log by the exact motion, and what it finds (see the package's docstring)."""

from typing import Self

import numpy as np

from .contact_log import ContactLog, LogError, Parameters
from .motion import Contacts, Motion

#: Break positions of one block that are closer than this, over f_s/k, are reached at one instant (identical contacts).
COINCIDENT = 1e-12
#: A break may come late by this many times the time in which the drive covers the limit on the residual.
MAX_LATENESS = 10.0


class Replay:
    def __init__(
        self, parameters: Parameters, log: ContactLog, max_breaks: int, slack: float, follow: bool = False
    ) -> None:
        """A contact past its threshold by `slack` f_s counts as missed.

        With `follow` the state continues from the logged times of breaks, otherwise from the predicted ones.
        """
        self.parameters, self.log, self.slack, self.follow = parameters, log, slack, follow
        self.contacts = Contacts(parameters, log)
        self.time, self.row = 0.0, parameters.contacts
        self.displacement, self.velocity = np.zeros((2, parameters.N))
        breaks = np.flatnonzero(log.is_break)
        self.end = len(log) if len(breaks) <= max_breaks else breaks[max_breaks]
        self.motion = None
        #: Of each break: its row in the log, predicted time in s (NaN if unreached) and residual over f_s.
        self.rows, self.predicted, self.residuals = [], [], []
        #: Over breaks and reattachments, in m.
        self.displacement_errors = []
        #: Time in s, block and contact.
        self.missed = []

    def run(self) -> Self:
        """Replays the log to its end, or to the last wanted break."""
        cycles = self.parameters.cycles()
        cycle, cycle_end = next(cycles)
        while self.row < self.end:
            self.motion = Motion(cycle, self.contacts, self.time, self.displacement, self.velocity)
            if cycle_end < self.log.time[self.row]:
                self.watch_and_move_to(cycle_end)
                cycle, cycle_end = next(cycles)
            elif self.log.is_break[self.row]:
                self.take_breaks()
            else:
                self.take_reattachment()
        return self

    def take_reattachment(self) -> None:
        """Moves to the next reattachment, whose time is known."""
        row = self.row
        self.watch_and_move_to(self.log.time[row])
        anchor = self.displacement[self.log.block[row]]
        self.contacts.attach(self.log, row, anchor)
        self.displacement_errors.append(abs(anchor - self.log.displacement[row]))
        self.row += 1

    def take_breaks(self) -> None:
        """Predicts the next break, and takes with it the following ones of the same block that come at that instant."""
        unit = self.parameters.reach
        upper, lower = self.contacts.levels(self.displacement)
        place = self.log.place(self.row)
        tau, sign = self.predict(self.row, upper[place], lower[place])
        logged = self.log.time[self.row]
        advance = logged - self.time if self.follow or np.isnan(tau) else tau
        # Its own time is judged below.
        self.contacts.watched[place] = False
        self.watch(advance)
        level = upper if sign > 0 else lower
        while self.row < self.end and self.log.is_break[self.row]:
            following = self.log.place(self.row)
            is_together = following[0] == place[0] and abs(level[following] - level[place]) <= COINCIDENT * unit
            if not is_together or (self.follow and self.log.time[self.row] != logged):
                break
            self.judge(self.row, tau)
            self.contacts.detach(following)
            self.row += 1
        self.displacement, self.velocity = self.moved(advance)
        self.time = logged if self.follow else self.time + advance

    def predict(self, row: int, upper: float, lower: float) -> tuple[float, float]:
        """Time from now at which the contact of a row reaches its level, NaN if it does not, and on which side."""
        block = self.log.block[row]
        if upper <= 0 or lower >= 0:
            sign = 1.0 if upper <= 0 else -1.0
            return self.motion.root_before(block, sign, upper if sign > 0 else -lower), sign
        levels = np.full((2, self.parameters.N), np.inf) * [[1], [-1]]
        levels[:, block] = upper, lower
        # The logged time says how far to look; what is found is the first crossing in any case.
        logged = self.log.time[row] - self.time
        near = max(logged, 0.0) * (1 + 1e-6) + 1e-7
        for horizon in (near, near + MAX_LATENESS * self.slack * self.parameters.reach / self.parameters.V0):
            found = self.motion.first_crossing(horizon, *levels, self.parameters.reach)
            if found:
                return found.time, found.sign
        x, _ = self.motion.at(logged, block)
        return np.nan, 1.0 if upper - x < x - lower else -1.0

    def judge(self, row: int, tau: float) -> None:
        place = self.log.place(row)
        moved, _ = self.motion.at(self.log.time[row] - self.time, place[0])
        x = self.displacement[place[0]] + moved
        force = self.contacts.stiffness[place] * (x - self.contacts.anchor[place])
        self.rows.append(row)
        self.predicted.append(self.time + tau)
        self.residuals.append(abs(abs(force) - self.contacts.threshold[place]) / self.parameters.fs)
        self.displacement_errors.append(abs(x - self.log.displacement[row]))

    def watch(self, tau: float) -> None:
        """Looks for contacts that pass their threshold by more than the slack within the next `tau` s."""
        while tau > 0:
            upper, lower = self.contacts.levels(self.displacement)
            slack = self.slack * self.parameters.reach
            upper = np.where(self.contacts.watched, upper, np.inf) + slack
            lower = np.where(self.contacts.watched, lower, -np.inf) - slack
            found = self.motion.first_crossing(tau, upper.min(axis=1), lower.max(axis=1), self.parameters.reach)
            if found is None:
                return
            contact = upper[found.block].argmin() if found.sign > 0 else lower[found.block].argmax()
            self.contacts.watched[found.block, contact] = False
            self.missed.append((self.time + found.time, found.block, int(contact)))

    def moved(self, tau: float) -> tuple[np.ndarray, np.ndarray]:
        displacement, velocity = self.motion.at(tau)
        return self.displacement + displacement, velocity

    def watch_and_move_to(self, time: float) -> None:
        """Moves to a time at which no contact is due to break."""
        self.watch(time - self.time)
        self.displacement, self.velocity = self.moved(time - self.time)
        self.time = time


def report(replay: Replay) -> dict:
    """The result as a dictionary of plain numbers; blocks and contacts are counted from 1."""
    if not replay.rows:
        raise LogError("the log holds no break")
    log, logged = replay.log, replay.log.time[replay.rows]
    errors = np.abs(np.array(replay.predicted) - logged)
    reached = errors[~np.isnan(errors)]
    residuals = np.array(replay.residuals)

    def describe(time: float, block: int, contact: int) -> dict:
        return {"time": float(time), "block": int(block) + 1, "contact": int(contact) + 1}

    def at(index: int) -> dict:
        return {"break": int(index)} | describe(logged[index], *log.place(replay.rows[index]))

    return {
        "breaks": len(errors),
        "reattachments": int(replay.row - replay.parameters.contacts - len(errors)),
        "end_time": float(replay.time),
        "worst_time_error": float(reached.max(initial=0.0)),
        "median_time_error": float(np.median(reached)) if len(reached) else 0.0,
        "worst_time_error_at": at(np.nanargmax(errors)) if len(reached) else None,
        "worst_residual": float(residuals.max()),
        "median_residual": float(np.median(residuals)),
        "worst_residual_at": at(residuals.argmax()),
        "worst_displacement_error": float(max(replay.displacement_errors) / replay.parameters.reach),
        "unreached": [at(index) for index in np.flatnonzero(np.isnan(errors))],
        "missed": [describe(*missed) for missed in replay.missed],
    }
