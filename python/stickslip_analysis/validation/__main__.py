"""Writes docs/validation.md from measured results: ``python -m stickslip_analysis.validation [RESULTS] [--to FILE]``.

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
            "`scripts/reproduce` writes this page from measured results; no measured number is typed by hand.",
            "Brackets hold 95 % intervals: the jackknife over seeds or parameter sets, or the bootstrap where a statistic"
            " is not smooth ([`statistics.py`](../python/stickslip_analysis/statistics.py)).",
            "Differences between sets are taken seed by seed, since equal seeds have the same contacts.",
            "Claims are the paper's; where it gives no number, the criterion is a choice.",
            "*Random loads* are slips that come at a random load among those that exceed all before: without any locking"
            " they are bunched in φ for η > 1, and their intervals near multiples of T.",
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
    parser = argparse.ArgumentParser(prog="python -m stickslip_analysis.validation", description=__doc__)
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
