"""Reads the tables of a sweep with pandas.

    .venv/bin/python scripts/read_pandas.py results/fig3

Prints the columns of the slips table with their units, then the mean interval and the locking index of every set, computed
from the slips; they are those of reduced/sets.parquet.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd


def read_slips(results):
    """All slips of a sweep; units of the columns are in `.attrs["units"]`."""
    return pd.read_parquet(Path(results) / "tables" / "slips")


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text."""
    return read_slips(results).attrs["units"]


def sets(results):
    """Mean interval in s and locking index |<exp(2 pi i interval / T)>| by set_id; NaN without modulation."""
    slips = read_slips(results)
    angle = 2 * np.pi * (slips["interval"] / slips["T"] % 1)
    slips = slips.assign(cosine=np.cos(angle), sine=np.sin(angle))
    mean = slips.groupby("set_id")[["interval", "cosine", "sine"]].mean()
    return pd.DataFrame({"tau_mean": mean["interval"], "locking_index": np.hypot(mean["cosine"], mean["sine"])})


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
