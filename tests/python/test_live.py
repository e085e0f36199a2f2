"""pandas, polars and DuckDB read a table folder without options while a run writes it, and after a kill."""

import subprocess
import time

import duckdb
import pandas as pd
import polars as pl
import pytest

# Many jobs of some 50 µs, in parts of 4096: files appear all the time.
SWEEP = """
name = "live"

[model]
N = 1
Ns = 1

[axes]
seed = { count = 1_000_000 }

[record]
slips = 2
discard = 0
"""
SLIPS_OF_A_JOB = 2

# Rows and distinct jobs of a folder, as each reader finds them.
READERS = {
    "pandas": lambda folder: (len(table := pd.read_parquet(folder)), table["job_id"].nunique()),
    "polars": lambda folder: (len(table := pl.read_parquet(folder)), table["job_id"].n_unique()),
    "duckdb": lambda folder: duckdb.sql(
        f"select count(*), count(distinct job_id) from '{folder}/*.parquet'"
    ).fetchall()[0],
}
SECONDS = 5


@pytest.fixture
def writer(program, tmp_path):
    """A run that outlasts the test, with a first part committed, and the folder of its slips."""
    sweep, results = tmp_path / "live.toml", tmp_path / "results"
    sweep.write_text(SWEEP)
    slips = results / "tables" / "slips"
    command = [program, "run", sweep, "--out", results, "--threads", "1"]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    begin = time.monotonic()
    while not list(slips.glob("*")):
        assert run.poll() is None and time.monotonic() < begin + 60, "no part is committed"
        time.sleep(0.01)
    yield run, slips
    run.kill()
    run.wait()


def test_all_readers_read_while_a_run_writes_and_after_a_kill(writer):
    run, slips = writer
    found = {name: [] for name in READERS}

    def read_all():
        for name, read in READERS.items():
            rows, jobs = read(slips)
            assert rows == SLIPS_OF_A_JOB * jobs, f"{name}: each job that is there is there once, and whole"
            assert not found[name] or rows >= found[name][-1], f"{name}: rows were there and are gone"
            found[name].append(rows)

    begin = time.monotonic()
    while time.monotonic() < begin + SECONDS:
        read_all()
    assert run.poll() is None, "the run was to outlast the readers"
    run.kill()
    run.wait()
    read_all()
    assert len({rows[-1] for rows in found.values()}) == 1
    for name, rows in found.items():
        print(f"{name}: {len(rows)} reads, {len(set(rows))} different numbers of rows, up to {rows[-1]}")
        assert len(set(rows)) >= 3, f"{name}: nothing was written meanwhile"
