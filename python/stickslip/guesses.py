"""Attributes that people look for where they are not: the error says what to write instead."""

from difflib import get_close_matches
from typing import TYPE_CHECKING

#: By class and guess.
INSTEAD = {
    "Results": {
        "show": "write results.sets().to_pandas(), or `stickslip show {directory}`",
        "status": "write results.jobs()['outcome'].value_counts(), or `stickslip status {directory}`",
        "export": "write results.slips().to_pandas().to_csv('slips.csv'), or `stickslip export {directory} -o FOLDER`",
        "to_pandas": "write results.slips().to_pandas(), say",
        **{command: f"write `stickslip {command} {{directory}}`" for command in ("report", "verify", "run")},
    },
    "Simulation": {
        "plot": "with trace=True write one.trace().to_pandas().plot('time', 'force'), or `stickslip simulate --plot one.svg`",
        "to_pandas": "write one.slips().to_pandas()",
    },
    "Plot": {"phi_eta": "write phase_eta", "tau_T": "write intervals", "tau_histograms": "write histograms"},
}
#: What is elsewhere, by class.
ELSEWHERE = {"Plot": "; `stickslip plot {_results.directory}` draws others"}


class Guessed:
    """Answers guesses. Type checkers do not see it, and name them as mistakes."""

    if not TYPE_CHECKING:
        def __getattr__(self, name):
            known = [one for one in dir(self) if not one.startswith("_")]
            near = get_close_matches(name, known, 1)
            elsewhere = ELSEWHERE.get(type(self).__name__, "")
            answer = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}{elsewhere}"
            if name in vars(self).get("job", ()):
                answer = f"write one.job[{name!r}]"
            answer = INSTEAD[type(self).__name__].get(name, answer).format(**vars(self))
            # With the name alone, Python adds no guess of its own.
            raise AttributeError(f"{type(self).__name__} has no {name}: {answer}", name=name)
