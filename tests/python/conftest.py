"""A small sweep, run by the built program: two parameter sets, extended once, so that every table has several files."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

SWEEP = """
name = "tiny"

[model]
N = 9

[[axes.zip]]
Delta     = [0, 1e-6]
frequency = [29, 29]

[axes]
seed = {{ count = {seeds} }}

[record]
slips = 6
discard = 2
precursors = true
"""


def tree(folder):
    """The bytes of all files in a folder, by their paths within it."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def results_in(directory):
    """Those of the tables and the reduced data."""
    return {path: data for path, data in tree(directory).items() if path.startswith(("tables/", "reduced/"))}


@pytest.fixture(scope="session")
def program():
    target = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
    program = Path(os.environ.get("STICKSLIP", target / "release" / "stickslip"))
    if not program.exists():
        pytest.fail(f"{program} is missing: run cargo build --release, or set STICKSLIP to the program")
    return program


@pytest.fixture(scope="session")
def stickslip(program):
    """Runs the program with some arguments; it must succeed."""

    def run(*arguments):
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{arguments}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done

    return run


@pytest.fixture(scope="session")
def results(stickslip, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    sweep, results = folder / "tiny.toml", folder / "results"
    for seeds in (3, 5):
        sweep.write_text(SWEEP.format(seeds=seeds))
        stickslip("run", sweep, "--out", results)
    return results
