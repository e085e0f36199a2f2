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
    beyond.drag,
    beyond.locking_map,
    beyond.staircase,
    beyond.dependences,
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
            "`scripts/reproduce` writes this page from measured results; no measured number is typed by hand.",
            "Brackets hold 95 % intervals: the jackknife over seeds or parameter sets, or the bootstrap where a statistic"
            " is not smooth ([`statistics.py`](../python/stickslip/statistics.py)).",
            "Where the paper gives no number, the criterion is a choice.",
            "*Random loads* are slips without any [locking](model.md#phase-and-locking): for η > 1 even these are bunched"
            " in φ, and their intervals near multiples of T.",
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
