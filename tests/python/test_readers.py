"""pandas, polars and DuckDB read the tables of a sweep without options, and find what the reduction found."""

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow.parquet as pq
import pytest
import read_duckdb
import read_pandas
import read_polars

JOBS, SLIPS = 2 * 5, 2 * 5 * 6

# The same sums in another order: some hundred roundings of 1e-16.
TOLERANCE = 1e-12

READERS = pytest.mark.parametrize("reader", [read_pandas, read_duckdb, read_polars])


def as_pandas(table):
    """Any reader's table by set_id, null as NaN."""
    if isinstance(table, pl.DataFrame):
        # Through plain rows: polars' own conversion needs pyarrow's types.
        table = pd.DataFrame(table.to_dicts())
    elif isinstance(table, duckdb.DuckDBPyRelation):
        table = table.df()
    return (table if table.index.name == "set_id" else table.set_index("set_id")).astype(float)


@READERS
def test_a_reader_finds_what_the_reduction_found(results, reader):
    reduced = pd.read_parquet(results / "reduced" / "sets.parquet").set_index("set_id")
    found = as_pandas(reader.sets(results)).reindex(reduced.index)
    assert len(reduced) == 2
    for column in ("tau_mean", "locking_index"):
        np.testing.assert_allclose(found[column], reduced[column].astype(float), rtol=TOLERANCE, atol=0)
    assert reduced["tau_mean"].gt(0).all()
    assert reduced["locking_index"].isna().sum() == 1, "null exactly without modulation"


@READERS
def test_a_reader_finds_the_units(results, reader):
    fields = pq.read_schema(next((results / "tables" / "slips").iterdir()))
    in_fields = {field.name: field.metadata[b"unit"].decode() for field in fields}
    units = reader.units(results)
    assert units == in_fields
    assert (units["V0"], units["interval"], units["phase"], units["periods"]) == ("m/s", "s", "rad", "")


@pytest.mark.parametrize("table, rows", [("slips", SLIPS), ("jobs", JOBS), ("precursors", None)])
def test_every_table_folder_reads_without_options(results, table, rows):
    folder = results / "tables" / table
    assert len(list(folder.iterdir())) >= 2, "the sweep was extended, so there are several files"
    shapes = {
        pd.read_parquet(folder).shape,
        pl.read_parquet(folder).shape,
        pl.read_parquet(f"{folder}/*.parquet").shape,
        duckdb.sql(f"select * from '{folder}/*.parquet'").df().shape,
    }
    assert len(shapes) == 1, shapes
    assert rows is None or shapes.pop()[0] == rows


def test_parameters_are_columns_of_numbers(results):
    jobs = pd.read_parquet(results / "tables" / "jobs")
    assert jobs["job_id"].is_unique
    assert set(jobs["outcome"]) == {"done"}
    assert set(jobs["N"]) == {9}
    assert set(jobs["seed"]) == {0, 1, 2, 3, 4}
    assert jobs["T"].dropna().eq(1 / 29).all() and jobs["T"].isna().eq(jobs["Delta"] == 0).all()


def test_tables_join_on_the_job(results):
    rows = duckdb.sql(f"""
        select jobs.slips, count(*) from '{results}/tables/slips/*.parquet' as slips
        join '{results}/tables/jobs/*.parquet' as jobs using (job_id) group by job_id, jobs.slips
    """).fetchall()
    assert len(rows) == JOBS
    assert all(in_jobs == counted for in_jobs, counted in rows)
