"""Reads the tables of a sweep with pandas.

    .venv/bin/python python/examples/read_pandas.py results/fig3

Prints the columns of the slips table with their units, then the mean interval of every set, computed from the slips,
and its locking index, read from the reduced data.
"""

import sys
from pathlib import Path

import pandas as pd


def read_slips(results):
    """All slips of a sweep; units of the columns are in `.attrs["units"]`."""
    return pd.read_parquet(Path(results) / "tables" / "slips")


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text."""
    return read_slips(results).attrs["units"]


def sets(results):
    """Mean interval in s and locking index by set_id; the index is NaN without modulation."""
    reduced = pd.read_parquet(Path(results) / "reduced" / "sets.parquet").set_index("set_id")
    return read_slips(results).groupby("set_id").agg(tau_mean=("interval", "mean")).join(reduced["locking_index"])


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
