"""Compares two parameter sets of a sweep seed by seed.

    .venv/bin/python -m stickslip.compare_sets results/fig2 SET_ID SET_ID

A seed gives the same disorder in every set, so its effect drops out of the difference of two sets, and what is left
shows smaller effects than two separate intervals. Prints the differences, first set minus second, of the mean interval
in s, the locking index and the mean friction in N, each with a 95 % confidence interval. The ids are those of
reduced/sets.parquet.
"""

import argparse
from pathlib import Path

from .statistics import Estimate, difference, friction_difference, locking_index
from .tables import Sweep


def compare(results: Path, first: str, second: str) -> dict[str, Estimate]:
    """Differences between two sets of a results directory, by column; the locking index only if both are modulated."""
    sweep = Sweep(Path(results))
    slips, jobs = sweep.slips(), sweep.table("jobs")
    slips, jobs = ([rows[rows["set_id"] == set_id] for set_id in (first, second)] for rows in (slips, jobs))
    found = {"interval": difference(*slips, "interval")}
    if all(rows["T"].notna().any() for rows in slips):
        found["locking_index"] = difference(*slips, "tau_over_T", locking_index)
    return found | {"mean_friction": friction_difference(*jobs)}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m stickslip.compare_sets", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("results", type=Path, help="results directory of a sweep")
    parser.add_argument("set_id", nargs=2, help="ids of the two sets")
    options = parser.parse_args()
    for column, found in compare(options.results, *options.set_id).items():
        print(f"{column:14} {found.value:12.6g}   {found.low:.6g} to {found.high:.6g}   {found.units} seeds")


if __name__ == "__main__":
    main()
