"""pandas, polars and DuckDB read the tables of a sweep without options, and find what the reduction found."""

import json
import re
import sqlite3
import subprocess
import sys

import duckdb
import numpy as np
import pandas as pd
import polars as pl
import pyarrow.parquet as pq
import pytest
import read

import stickslip

JOBS, SLIPS = 2 * 5, 2 * 5 * 6


def as_pandas(table):
    """Any reader's table by set_id, null as NaN."""
    if isinstance(table, pl.DataFrame):
        # Through plain rows: polars' own conversion needs pyarrow's types.
        table = pd.DataFrame(table.to_dicts())
    elif isinstance(table, duckdb.DuckDBPyRelation):
        table = table.df()
    return (table if table.index.name == "set_id" else table.set_index("set_id")).astype(float)


@pytest.mark.parametrize("reader", [read.with_pandas, read.with_polars, read.with_duckdb])
def test_a_reader_finds_what_the_reduction_found(results, reader):
    reduced = pd.read_parquet(results / "reduced" / "sets.parquet").set_index("set_id")
    found = as_pandas(reader(stickslip.open(results))).reindex(reduced.index)
    assert len(reduced) == 2
    for column in ("tau_mean", "locking_index"):
        # The same sums in another order: some hundred roundings of 1e-16.
        np.testing.assert_allclose(found[column], reduced[column].astype(float), rtol=1e-12, atol=0)
    assert reduced["tau_mean"].gt(0).all()
    assert reduced["locking_index"].isna().sum() == 1, "null exactly without modulation"


def test_the_example_prints_the_units_and_what_each_library_finds(results):
    done = subprocess.run([sys.executable, read.__file__, results], capture_output=True, text=True, check=True)
    assert re.search(r"^interval +s$", done.stdout, re.M) and done.stdout.count("tau_mean") == 3


def test_units_are_in_the_fields_and_in_the_footer(results):
    file = next((results / "tables" / "slips").iterdir())
    in_fields = {field.name: field.metadata[b"unit"].decode() for field in pq.read_schema(file)}
    query = f"select decode(value) from parquet_kv_metadata('{file}') where decode(key) = 'units'"
    assert json.loads(duckdb.sql(query).fetchall()[0][0]) == stickslip.open(results).slips().units == in_fields
    assert [in_fields[name] for name in ("V0", "interval", "phase", "periods")] == ["m/s", "s", "rad", ""]


def sql_of(engine, column, name):
    """A value of a column, under this name, as SQL finds it."""
    query = f"select avg({name}), {name} from t where {name} > 1 group by {name} order by {name}"
    if engine == "polars":
        return pl.SQLContext(t=pl.DataFrame({column: [1.5]})).execute(query, eager=True).rows()[0]
    connection = duckdb.connect() if engine == "duckdb" else sqlite3.connect(":memory:")
    connection.execute(f'create table t ("{column}" real)')
    connection.execute("insert into t values (1.5)")
    return connection.execute(query).fetchall()[0]


@pytest.mark.parametrize("engine, keywords", [("duckdb", set()), ("polars", {"interval"}), ("sqlite3", {"drop"})])
def test_the_columns_that_need_quotes_in_sql_are_those_of_the_document(results, engine, keywords):
    files = [*results.glob("tables/*/*.parquet"), *results.glob("reduced/*.parquet")]
    columns = {name for file in files for name in pq.read_schema(file).names}
    assert len(columns) > 100
    needy = set()
    for column in columns:
        assert sql_of(engine, column, f'"{column}"') == (1.5, 1.5)
        try:
            assert sql_of(engine, column, column) == (1.5, 1.5)
        except (duckdb.Error, pl.exceptions.PolarsError, sqlite3.Error):
            needy.add(column)
    assert needy == keywords


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


@pytest.mark.parametrize("folder, is_column", [("V0=9", True), ("v0=9", True), ("eta=2/deeper", True), ("run=3", False)])
def test_a_folder_that_duckdb_takes_for_a_column_is_warned_of_and_the_documented_option_reads_it(
    program, tmp_path, folder, is_column
):
    above = tmp_path / folder
    above.mkdir(parents=True)
    (above / "a.toml").write_text('name = "a"\n[model]\nN = 3\nNs = 2\n[record]\nslips = 3\n')
    for command in (["plan", "a.toml", "-o", "r"], ["run", "a.toml", "-o", "r", "--no-reduce"]):
        done = subprocess.run([program, *command], cwd=above, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        assert ("hive_partitioning = false" in done.stderr) == is_column, done.stderr
    files = f"{above}/r/tables/slips/*.parquet"
    columns = 'V0, eta, "interval"'
    plain = duckdb.sql(f"select {columns} from '{files}'").fetchall()
    right = duckdb.sql(f"select {columns} from read_parquet('{files}', hive_partitioning = false)").fetchall()
    assert (plain != right) == is_column, plain
    assert {row[:2] for row in right} == {(1e-4, 0.0)}
