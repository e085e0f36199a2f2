"""The example that redraws figures shows all reduced data, on what the program wrote."""

import re
import subprocess
import sys

import pandas as pd
import pytest
import redraw
from conftest import ROOT


def drawn(axes):
    """Number of points in the lines of some axes."""
    return sum(len(line.get_xdata()) for line in axes.get_lines())


def test_every_slip_and_every_set_is_drawn(results):
    points = pd.read_parquet(results / "reduced" / "points.parquet")
    bins = pd.read_parquet(results / "reduced" / "backbone.parquet")
    (axes,) = redraw.phase_eta(results).axes
    slips = axes.get_lines()[:2]
    assert sum(len(line.get_xdata()) for line in slips) == points["phase"].notna().sum() > 0
    assert (pd.Series(axes.get_lines()[2].get_xdata()).between(bins["eta_low"], bins["eta_high"])).all()

    sets = pd.read_parquet(results / "reduced" / "sets.parquet").dropna(subset="T")
    above, below = redraw.staircase(results).axes
    assert drawn(above) == drawn(below) == len(sets) > 0
    assert above.get_lines()[0].get_ydata() == pytest.approx(sets["tau_50"] / sets["T"])


def test_the_example_writes_its_figures(results, tmp_path):
    done = subprocess.run(
        [sys.executable, redraw.__file__, results], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["phase-eta.png", "staircase.png"]
    for name in done.stdout.split():
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["fig1d", "fig4b", "fig4d"])
def test_the_pictures_of_one_simulation_are_those_that_their_commands_draw(stickslip, tmp_path, name):
    text = (ROOT / "results" / "README.md").read_text()
    command = re.search(rf"`stickslip (simulate [^`]*--plot {name}\.png)`", text)[1]
    stickslip(*command.replace(f"{name}.png", str(tmp_path / f"{name}.png")).split())
    assert (tmp_path / f"{name}.png").read_bytes() == (ROOT / "results" / f"{name}.png").read_bytes()
