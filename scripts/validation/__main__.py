"""Writes docs/validation.md from measured results: `python -m scripts.validation [RESULTS] [--to FILE]`, from the project's
folder. Every number in the document comes from the tables below RESULTS; scripts/reproduce makes them."""

import argparse
import sys
from pathlib import Path

from .beyond import questions
from .document import Section, table
from .paper import statements
from .results import Missing, Results

HEAD = """# Validation

Written by `scripts/reproduce` from measured results; no measured number here is typed by hand. Brackets hold 95 % intervals: jackknife over seeds with Student's t, or bootstrap over parameter sets or seeds where a statistic is
not smooth ([`scripts/validation`](../scripts/validation)). Slips of one job are correlated, jobs are not; so seeds and sets are what is left out or drawn again. Differences between parameter sets are taken seed by seed,
as equal seeds have the same contacts. Where the paper gives no number, the criterion is a choice, and stands beside the result."""


def summary(sections: list[Section]) -> str:
    rows = [
        [section.title, f"{sum(check.agrees for check in section.checks)} of {len(section.checks)}"]
        for section in sections
        if section.checks
    ]
    return table(["statement", "checks that agree"], rows)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m scripts.validation", description=__doc__)
    parser.add_argument("results", nargs="?", type=Path, default=Path("results"), help="folder of the results (default: results)")
    parser.add_argument("--to", type=Path, default=Path("docs/validation.md"), help="file to write (default: docs/validation.md)")
    arguments = parser.parse_args()
    results = Results(arguments.results)
    try:
        paper, further = statements(results), questions(results)
    except Missing as missing:
        print(missing, file=sys.stderr)
        return 2
    parts = [
        HEAD,
        summary(paper + further),
        "## The paper's statements",
        *(section.markdown() for section in paper),
        "## Beyond the paper",
        *(section.markdown() for section in further),
    ]
    arguments.to.write_text("\n\n".join(parts) + "\n")
    print(f"wrote {arguments.to}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
