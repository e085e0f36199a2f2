"""Reads the tables of a sweep with DuckDB.

    .venv/bin/python python/examples/read_duckdb.py results/fig3

Prints the columns of the slips table with their units, then the mean interval of every set, computed from the slips,
and its locking index, read from the reduced data.
"""

import json
import sys

import duckdb


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text. All files have the same."""
    query = f"""
        select decode(value) from parquet_kv_metadata('{results}/tables/slips/*.parquet')
        where decode(key) = 'units' limit 1
    """
    return json.loads(duckdb.sql(query).fetchall()[0][0])


def sets(results):
    """Mean interval in s and locking index by set_id; the index is null without modulation."""
    return duckdb.sql(f"""
        select set_id, avg("interval") as tau_mean, any_value(locking_index) as locking_index
        from '{results}/tables/slips/*.parquet' as slips
        join '{results}/reduced/sets.parquet' using (set_id)
        group by set_id order by set_id
    """)


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
