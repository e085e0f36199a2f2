"""The built program, and local runs with one process to compare with."""

import os
import subprocess
from pathlib import Path

import pytest
from sharing import BLOCKS, write_sweep

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def program():
    target = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
    program = Path(os.environ.get("STICKSLIP", target / "release" / "stickslip")).resolve()
    if not program.exists():
        pytest.fail(f"{program} is missing: run cargo build --release, or set STICKSLIP to the program")
    return program


@pytest.fixture(scope="session")
def local_run(program, tmp_path_factory):
    """Runs the sweep in one process, once for each number of slips and blocks; its results."""
    done = {}

    def run(slips, blocks=BLOCKS):
        if (blocks, slips) not in done:
            folder = tmp_path_factory.mktemp("local")
            sweep = write_sweep(folder / "shared.toml", blocks, slips)
            results = folder / "results"
            subprocess.run([program, "run", sweep, "--out", results], check=True, capture_output=True, timeout=600)
            done[blocks, slips] = results
        return done[blocks, slips]

    return run
