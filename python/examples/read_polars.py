"""Reads the tables of a sweep with polars.

    .venv/bin/python python/examples/read_polars.py results/fig3

Prints the columns of the slips table with their units, then the mean interval of every set, computed from the slips,
and its locking index, read from the reduced data. The folder `tables/slips` can also be scanned as it is, for tables that do
not fit into memory.
"""

import sys

import polars as pl

import stickslip


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text."""
    return stickslip.open(results).slips().units


def sets(results):
    """Mean interval in s and locking index by set_id; the index is null without modulation."""
    opened = stickslip.open(results)
    slips = pl.DataFrame(opened.slips(["set_id", "interval"]))
    reduced = pl.DataFrame(opened.sets(["set_id", "locking_index"]))
    means = slips.group_by("set_id").agg(tau_mean=pl.col("interval").mean())
    return means.join(reduced, on="set_id").sort("set_id")


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
