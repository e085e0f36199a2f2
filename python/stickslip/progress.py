"""Progress of a run, as a bar (tqdm), as plain lines, or through a callback."""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

#: Seconds between two plain lines.
SPACING = 10.0


@dataclass(frozen=True)
class Progress:
    """How far a run is, with the jobs of other processes that share the work."""

    jobs_done: int
    jobs: int
    """All jobs to run."""
    share: float
    """Share of the predicted cost that is done, from 0 to 1."""
    elapsed: float
    """Seconds since the run began."""
    messages: list[str] = field(default_factory=list)
    """What happened since the last call, such as a job that failed."""

    @property
    def remaining(self) -> float | None:
        """Seconds left, extrapolated from the share; None while nothing is done."""
        return self.elapsed * (1 - self.share) / self.share if self.share > 0 else None


def display(progress: bool | Callable[[Progress], object]) -> "_Display":
    """A display: `True` for a bar or lines, `False` for none, or a callback."""
    if callable(progress):
        return _Display(progress)
    if not isinstance(progress, bool):
        raise TypeError(f"progress = {progress!r}: must be True, False or a function of a Progress")
    if not progress:
        return _Display(None)
    try:
        from tqdm import tqdm  # type: ignore[import-untyped]
    except ImportError:
        return _Lines()
    return _Bar(tqdm)


class _Display:
    """Passes progress on to a callback. The run calls it."""

    def __init__(self, callback: Callable[[Progress], object] | None) -> None:
        self.callback = callback
        self.begin = time.monotonic()

    def __call__(self, jobs_done: int, jobs: int, share: float, messages: list[str]) -> None:
        if self.callback is not None:
            self.callback(Progress(jobs_done, jobs, share, time.monotonic() - self.begin, messages))

    def close(self) -> None:
        """Nothing is open here."""


class _Lines(_Display):
    """Lines on standard error, now and then."""

    def __init__(self) -> None:
        super().__init__(self.show)
        self.last = self.begin

    def show(self, progress: Progress) -> None:
        for message in progress.messages:
            print(message, file=sys.stderr)
        if time.monotonic() - self.last >= SPACING:
            self.last = time.monotonic()
            print(f"{progress.jobs_done} of {progress.jobs} jobs, {100 * progress.share:.0f} %", file=sys.stderr)


class _Bar(_Display):
    """A bar of tqdm; it counts jobs."""

    def __init__(self, tqdm: Callable[..., Any]) -> None:
        super().__init__(self.show)
        self.tqdm = tqdm
        self.bar: Any = None

    def show(self, progress: Progress) -> None:
        if self.bar is None:
            self.bar = self.tqdm(total=progress.jobs, unit="job")
        for message in progress.messages:
            self.bar.write(message, file=sys.stderr)
        self.bar.total = progress.jobs
        self.bar.update(progress.jobs_done - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
