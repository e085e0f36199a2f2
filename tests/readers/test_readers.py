"""The oldest readers that are promised, and the newest, find the same values in every kind of file of the program, without
an option."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pyarrow.feather
import pyarrow.parquet
import pytest
from values import plain

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# Made by scripts/test-readers.
OLDEST = ROOT / ".venv" / "oldest" / "bin" / "python"
READERS = ("pyarrow", "pandas", "fastparquet", "polars", "duckdb", "datafusion")
SWEEP = """
name = "read"
model = {{ N = 9 }}
axes = {{ seed = {{ count = {seeds} }}, zip = [{{ Delta = [0, 1e-6, 1e-6], frequency = [29, 29, 58] }}] }}
record = {{ slips = 6, discard = 2, precursors = true, control = true }}
"""
RECORDS = ("trace", "map", "contacts", "slip-table")


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """Folders of tables of an extended sweep, and files of every other kind."""
    folder = tmp_path_factory.mktemp("read")
    built = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release" / "stickslip"
    program = os.environ.get("STICKSLIP", built)

    def stickslip(*arguments):
        subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, cwd=folder, timeout=300)

    for seeds in (2, 3):
        (folder / "sweep.toml").write_text(SWEEP.format(seeds=seeds))
        stickslip("run", "sweep.toml", "--out", "results")
    for format in ("parquet", "arrow"):
        stickslip("export", "results", "--out", format, "--format", format)
    records = [argument for name in RECORDS for argument in (f"--{name}", f"{name}.parquet")]
    stickslip("simulate", "--set", "N=5", "--slips", 3, *records)
    tables = sorted((folder / "results" / "tables").iterdir())
    assert len(tables) == 3 and all(len(list(table.iterdir())) >= 2 for table in tables)
    places = ("results/reduced/*.parquet", "*.parquet", "parquet/*", "arrow/*")
    found = [file for place in places for file in sorted(folder.glob(place))]
    assert len(found) == 4 + len(RECORDS) + 4 + 4
    return [*tables, *found]


def expected(path):
    table = pyarrow.feather.read_table(path) if path.suffix == ".arrow" else pyarrow.parquet.read_table(path)
    return {name: [plain(value) for value in column] for name, column in table.to_pydict().items()}


def rows(columns):
    """The rows of a table, sorted, as a reader may take the files of a folder in any order."""
    assert columns and len(next(iter(columns.values()))) > 0
    return sorted(zip(*columns.values(), strict=True), key=str)


@pytest.mark.parametrize("age", ["oldest", "newest"])
@pytest.mark.parametrize("reader", READERS)
def test_a_promised_reader_finds_every_value_without_an_option(files, reader, age):
    if reader in ("fastparquet", "duckdb", "datafusion"):
        files = [file for file in files if file.suffix != ".arrow"]
    python = OLDEST if age == "oldest" else sys.executable
    command = [python, "-W", "ignore", HERE / "values.py", reader, *files]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    for file, line in zip(files, done.stdout.splitlines(), strict=True):
        found, wanted = json.loads(line), expected(file)
        assert list(found) == list(wanted), file
        assert rows(found) == rows(wanted), file


def test_the_oldest_are_those_of_the_list():
    """A venv of another list would show nothing."""
    installed = subprocess.run([OLDEST, "-m", "pip", "freeze"], capture_output=True, text=True, check=True).stdout
    wanted = [line for line in (HERE / "oldest.txt").read_text().splitlines() if not line.startswith("#")]
    assert set(wanted) <= set(installed.splitlines())
