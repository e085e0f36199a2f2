"""Reads the tables of a sweep with polars.

    .venv/bin/python scripts/read_polars.py results/fig3

Prints the columns of the slips table with their units, then the mean interval and the locking index of every set, computed
from the slips; they are those of reduced/sets.parquet.
"""

import json
import sys
from pathlib import Path

import numpy as np
import polars as pl


def slips_folder(results):
    """The folder of the slips table."""
    return Path(results) / "tables" / "slips"


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text. Every file tells the same."""
    any_file = next(slips_folder(results).glob("*.parquet"))
    return json.loads(pl.read_parquet_metadata(any_file)["units"])


def sets(results):
    """Mean interval in s and locking index |<exp(2 pi i interval / T)>| by set_id; null without modulation."""
    angle = 2 * np.pi * (pl.col("interval") / pl.col("T") % 1)
    return (
        pl.scan_parquet(slips_folder(results))
        .group_by("set_id")
        .agg(
            tau_mean=pl.col("interval").mean(),
            locking_index=(angle.cos().mean() ** 2 + angle.sin().mean() ** 2).sqrt(),
        )
        .sort("set_id")
        .collect()
    )


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
