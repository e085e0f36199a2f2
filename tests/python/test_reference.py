"""The reference results in tests/reference: this program agrees with them, and what is wrong does not."""

import subprocess
import sys

import pandas as pd
import pytest
from conftest import ROOT


def reference(*arguments):
    command = [sys.executable, "-m", "validation.reference", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT / "python", capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def entry(tmp_path_factory):
    folder = tmp_path_factory.mktemp("entry")
    done = reference("entry", "grid", folder)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_default_solver_agrees(entry):
    done = reference("compare", entry)
    assert done.returncode == 0 and "of 27, off by" in done.stdout, done.stdout + done.stderr
    # Before trajectories part.
    own, theirs = (pd.read_csv(folder / "contacts.csv") for folder in (ROOT / "tests" / "reference", entry))
    first = own.merge(theirs, on=["block", "contact", "generation", "event"], suffixes=("", "_theirs"))
    first = first[(first["event"] == "break") & (first["generation"] == 0)]
    assert len(first) == 20 and (first["time_theirs"] - first["time"]).abs().max() < 1e-6


@pytest.mark.parametrize("change", ["one value", "a row"])
def test_a_code_that_differs_is_told(entry, tmp_path, change):
    statistics = pd.read_csv(entry / "statistics.csv")
    if change == "a row":
        statistics = statistics[:-1]
    else:
        statistics.loc[5, ["value", "low", "high"]] *= 1.05
    (tmp_path / "contacts.csv").write_bytes((entry / "contacts.csv").read_bytes())
    statistics.to_csv(tmp_path / "statistics.csv", index=False)
    done = reference("compare", tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
