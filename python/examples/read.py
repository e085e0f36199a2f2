"""Reads the tables of a sweep with pandas, polars and DuckDB.

    .venv/bin/python python/examples/read.py results/fig3

Prints the columns of the slips table with their units; then, by each library, the mean interval of every set, computed
from the slips, and its locking index, read from the reduced data.
"""

import sys

import duckdb
import polars

import stickslip


def with_pandas(results):
    """Mean interval in s and locking index by set_id; the index is NaN without modulation."""
    slips = results.slips(["set_id", "interval"]).to_pandas()
    sets = results.sets(["set_id", "locking_index"]).to_pandas().set_index("set_id")
    return slips.groupby("set_id").agg(tau_mean=("interval", "mean")).join(sets)


def with_polars(results):
    """The same; the index is null without modulation."""
    slips = polars.DataFrame(results.slips(["set_id", "interval"]))
    sets = polars.DataFrame(results.sets(["set_id", "locking_index"]))
    means = slips.group_by("set_id").agg(tau_mean=polars.col("interval").mean())
    return means.join(sets, on="set_id").sort("set_id")


def with_duckdb(results):
    """The same, from variables of these names."""
    slips, sets = results.slips(), results.sets()
    return duckdb.sql("""
        select set_id, avg("interval") as tau_mean, any_value(sets.locking_index) as locking_index
        from slips join sets using (set_id) group by set_id order by set_id
    """)


if __name__ == "__main__":
    results = stickslip.open(sys.argv[1] if len(sys.argv) > 1 else "results/fig3")
    for column, unit in results.slips().units.items():
        print(f"{column:18} {unit}")
    for read in (with_pandas, with_polars, with_duckdb):
        print(read(results))
