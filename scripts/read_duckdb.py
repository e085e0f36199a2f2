"""Reads the tables of a sweep with DuckDB.

    .venv/bin/python scripts/read_duckdb.py results/fig3

Prints the columns of the slips table with their units, then the mean interval and the locking index of every set, computed
from the slips; they are those of reduced/sets.parquet.
"""

import json
import sys
from pathlib import Path

import duckdb


def slip_files(results):
    """The files of the slips table as DuckDB names them."""
    return (Path(results) / "tables" / "slips" / "*.parquet").as_posix()


def units(results):
    """Units of the slips table, by column; "" for a pure number or a text."""
    query = f"""
        select decode(value) from parquet_kv_metadata('{slip_files(results)}')
        where decode(key) = 'units' limit 1
    """
    return json.loads(duckdb.sql(query).fetchall()[0][0])


def sets(results):
    """Mean interval in s and locking index |<exp(2 pi i interval / T)>| by set_id; null without modulation."""
    return duckdb.sql(f"""
        with slips as (
            select set_id, "interval", 2 * pi() * ("interval" / T % 1) as angle from '{slip_files(results)}'
        )
        select
            set_id,
            avg("interval") as tau_mean,
            sqrt(avg(cos(angle)) ** 2 + avg(sin(angle)) ** 2) as locking_index
        from slips group by set_id order by set_id
    """)


if __name__ == "__main__":
    folder = sys.argv[1] if len(sys.argv) > 1 else "results/fig3"
    for column, unit in units(folder).items():
        print(f"{column:18} {unit}")
    print(sets(folder))
