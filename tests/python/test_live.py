"""pandas, polars and DuckDB read a table folder without options while a run writes it or a compaction replaces it, and
after a kill."""

import os
import shutil
import subprocess
import time

import duckdb
import pandas as pd
import polars as pl
import pyarrow.dataset
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
    run = subprocess.Popen(
        [program, "run", sweep, "--out", results, "--threads", "1"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
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


# 65 parts, which are compacted into one file.
FINISHED = SWEEP.replace("1_000_000", "9200")
ROWS = SLIPS_OF_A_JOB * 9200
COMPACTIONS = 2


def files(folder):
    """The files of a folder, for readers that would pass over one which they do not find."""
    return sorted(str(path) for path in folder.glob("*.parquet"))


# The rows of a folder, or an error where files that were listed have gone since.
ROWS_OF = {
    "pandas": lambda folder: len(pd.read_parquet(files(folder))),
    "pyarrow": lambda folder: pyarrow.dataset.dataset(files(folder)).count_rows(),
    "polars": lambda folder: pl.read_parquet(folder).height,
    "duckdb": lambda folder: duckdb.connect()
    .sql(f"select count(*) from '{folder}/*.parquet'")
    .fetchall()[0][0],
}
GONE = (FileNotFoundError, duckdb.IOException)


@pytest.fixture
def finished(stickslip, tmp_path):
    """The results of a small sweep."""
    sweep, results = tmp_path / "live.toml", tmp_path / "results"
    sweep.write_text(FINISHED)
    stickslip("run", sweep, "--out", results, "--no-reduce")
    return results


@pytest.mark.parametrize("reader", ["listdir", "glob", *ROWS_OF])
def test_readers_find_all_rows_or_a_file_gone_and_never_an_empty_folder_beside_compactions(
    program, finished, tmp_path, reader
):
    complete = 0
    for number in range(COMPACTIONS):
        results = tmp_path / f"copy-{number}"
        shutil.copytree(finished, results)
        slips = results / "tables" / "slips"
        opened, listed = os.scandir(slips), files(slips)
        compaction = subprocess.Popen([program, "compact", results], stdout=subprocess.DEVNULL)
        is_running = True
        while is_running:
            # Once more after its end.
            is_running = compaction.poll() is None
            if reader == "listdir":
                assert os.listdir(slips)
            elif reader == "glob":
                assert list(slips.glob("*.parquet"))
            else:
                try:
                    assert ROWS_OF[reader](slips) == ROWS
                except GONE:
                    continue
            complete += 1
        assert compaction.returncode == 0
        assert len(list(opened)) == len(listed) > 1, "who opened the folder before lists all its files later"
        with pytest.raises(FileNotFoundError):
            open(listed[0])
    print(f"{reader}: {complete} complete reads")
    assert complete >= COMPACTIONS
