"""Reads the tables of a sweep with pandas.

    .venv/bin/python python/examples/read_pandas.py results/fig3

Prints the columns of the slips table with their units, then the mean interval of every set, computed from the slips,
and its locking index, read from the reduced data.
"""

import sys

import stickslip


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text."""
    return stickslip.open(results).slips().to_pandas().attrs["units"]


def sets(results):
    """Mean interval in s and locking index by set_id; the index is NaN without modulation."""
    opened = stickslip.open(results)
    slips = opened.slips(["set_id", "interval"]).to_pandas()
    reduced = opened.sets(["set_id", "locking_index"]).to_pandas().set_index("set_id")
    return slips.groupby("set_id").agg(tau_mean=("interval", "mean")).join(reduced)


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
