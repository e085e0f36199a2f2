"""Writes docs/validation.md from measured results: ``python -m validation [RESULTS] [--to FILE]``.

Run it in the project's folder. Every measured number comes from the tables below RESULTS; scripts/reproduce makes them.
"""

import argparse
import sys
from pathlib import Path

from stickslip import ResultsError
from stickslip.tables import MissingResult

from . import beyond, claims, friction, intervals, phase, triggering
from .document import figure, paragraph, table

#: The paper's statements by the figures that show them.
STATEMENTS = {
    "Fig. 1 and 2: intervals, precursors, stress drops": (
        intervals.stick_slip,
        intervals.identical_contacts,
        intervals.integer_multiples,
        intervals.stress_drops,
    ),
    "Fig. 3: intervals and phases against the modulation": (intervals.many_periods, phase.phase, phase.below_one),
    "Mean friction": (friction.friction,),
    "Fig. 4: slow fronts": (friction.slow_fronts,),
    "Eq. 1 and the length of the slider": (friction.loading_profile, intervals.stochasticity, friction.edge),
}
QUESTIONS = (
    beyond.drag,
    beyond.locking_map,
    beyond.staircase,
    beyond.dependences,
    phase.stiff_drive,
    triggering.pulses,
    triggering.tides,
    claims.correlation,
    claims.weakening,
    beyond.choices,
    beyond.energies,
)


def document(results: Path) -> str:
    figures = {title: [section(results) for section in sections] for title, sections in STATEMENTS.items()}
    questions = [section(results) for section in QUESTIONS]
    statements = sorted(sum(figures.values(), []), key=lambda section: float(section.number()))
    summary = [section.summary() for section in statements + questions if section.checks]
    parts = [
        "# Validation",
        paragraph(
            "For readers who ask which statements of the paper the model confirms.",
            "`scripts/reproduce` writes this page from measured results.",
            "Brackets have 95 % intervals: jackknife over seeds or sets, bootstrap where a statistic is not smooth, Wilson's"
            " for shares ([`statistics.py`](../python/stickslip/statistics.py)).",
            "Where the paper gives no number, the criterion is a choice. *Undecided*: the interval includes the limit.",
            "*Random loads*: slips at independent loads. The [glossary](glossary.md#statistics) has the other terms, the"
            " [model](model.md#phase-and-locking) the definitions.",
        ),
        table(summary),
        "## The paper's statements",
        *(figure(title, sections) for title, sections in figures.items()),
        "## Beyond the paper",
        *(section.markdown() for section in questions),
    ]
    return "\n\n".join(parts) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m validation", description=__doc__)
    parser.add_argument(
        "results", nargs="?", type=Path, default=Path("results"), help="folder of all results (%(default)s)"
    )
    parser.add_argument("--to", type=Path, default=Path("docs/validation.md"), help="file to write (%(default)s)")
    options = parser.parse_args()
    try:
        text = document(options.results)
    except (MissingResult, ResultsError) as error:
        print(error, file=sys.stderr)
        return 2
    options.to.write_text(text)
    print(f"wrote {options.to}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
