"""Writes docs/validation.md from measured results: ``python -m stickslip.validation [RESULTS] [--to FILE]``.

Run it in the project's folder. Every measured number comes from the tables below RESULTS; scripts/reproduce makes them.
"""

import argparse
import sys
from pathlib import Path

from ..tables import MissingResult
from . import beyond, friction, intervals, phase
from .document import paragraph, table

STATEMENTS = (
    intervals.stick_slip,
    intervals.identical_contacts,
    intervals.integer_multiples,
    intervals.many_periods,
    phase.phase,
    friction.friction,
    friction.slow_fronts,
    friction.loading_profile,
    intervals.stress_drops,
    intervals.stochasticity,
    phase.below_one,
    friction.edge,
)
QUESTIONS = (
    *beyond.DRAGS,
    beyond.locking_map,
    beyond.staircase,
    *beyond.DEPENDENCES,
    phase.stiff_drive,
    beyond.choices,
    beyond.energies,
)


def document(results: Path) -> str:
    """The document in Markdown."""
    statements, questions = ([section(results) for section in sections] for sections in (STATEMENTS, QUESTIONS))
    summary = [section.summary() for section in statements + questions if section.checks]
    parts = [
        "# Validation",
        paragraph(
            "Written by `scripts/reproduce` from measured results; no measured number here is typed by hand.",
            "Brackets hold 95 % intervals: the jackknife over seeds with Student's t, or the bootstrap over parameter"
            " sets or seeds where a statistic is not smooth"
            " ([`stickslip.statistics`](../python/stickslip/statistics.py)).",
            "Slips of one job are correlated, jobs are not; so seeds and sets are what is left out or drawn again.",
            "Differences between parameter sets are taken seed by seed, as equal seeds have the same contacts.",
            "Where the paper gives no number, the criterion is a choice and stands beside the result.",
            "*Kinematics* is what slips show that come at a random load among those that exceed all before:"
            " they are bunched in φ for η > 1, and their intervals near multiples of T, without any locking.",
        ),
        table(summary),
        "## The paper's statements",
        *(section.markdown() for section in statements),
        "## Beyond the paper",
        *(section.markdown() for section in questions),
    ]
    return "\n\n".join(parts) + "\n"


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m stickslip.validation", description=__doc__)
    parser.add_argument(
        "results", nargs="?", type=Path, default=Path("results"), help="folder of all results (%(default)s)"
    )
    parser.add_argument("--to", type=Path, default=Path("docs/validation.md"), help="file to write (%(default)s)")
    options = parser.parse_args()
    try:
        text = document(options.results)
    except MissingResult as error:
        print(error, file=sys.stderr)
        return 2
    options.to.write_text(text)
    print(f"wrote {options.to}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
