"""Reads the tables of a sweep with polars.

    .venv/bin/python python/examples/read_polars.py results/fig3

Prints the columns of the slips table with their units, then the mean interval of every set, computed from the slips,
and its locking index, read from the reduced data.
"""

import json
import sys
from pathlib import Path

import polars as pl


def slips_folder(results):
    """The folder of the slips table."""
    return Path(results) / "tables" / "slips"


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text. All files have the same."""
    any_file = next(slips_folder(results).glob("*.parquet"))
    return json.loads(pl.read_parquet_metadata(any_file)["units"])


def sets(results):
    """Mean interval in s and locking index by set_id; the index is null without modulation."""
    reduced = pl.scan_parquet(Path(results) / "reduced" / "sets.parquet").select("set_id", "locking_index")
    slips = pl.scan_parquet(slips_folder(results))
    means = slips.group_by("set_id").agg(tau_mean=pl.col("interval").mean())
    return means.join(reduced, on="set_id").sort("set_id").collect()


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
