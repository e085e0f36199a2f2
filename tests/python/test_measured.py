"""Measured slips: the page of docs/measured.md as written, and the null on data that no code of this project made."""

import csv
import math
import random
import re
import shlex
import subprocess
import sys

import pytest
from conftest import ROOT

import stickslip as module

PAGE = (ROOT / "docs" / "measured.md").read_text()


@pytest.fixture(scope="module")
def tried(program, tmp_path_factory):
    """A folder in which the commands of the page were given."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "docs").mkdir()
    (folder / "docs" / "experiment.csv").write_bytes((ROOT / "docs" / "experiment.csv").read_bytes())
    for block in re.findall(r"^```sh\n(.*?)^```", PAGE, re.M | re.S):
        for command in block.replace("\\\n", " ").splitlines():
            words = [program, *shlex.split(command)[1:]]
            done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return folder


def test_the_page_leads_from_the_table_to_its_figure(tried):
    figure = (tried / "results" / "model" / "figures" / "phi-eta.png").read_bytes()
    assert figure == (ROOT / "docs" / "measured-phase.png").read_bytes(), "draw docs/measured-phase.png again"
    assert (tried / "results" / "model" / "figures" / "tau_mean-frequency.png").exists()


def test_what_the_page_shows_is_what_is_printed(program, tried):
    shown = subprocess.run([program, "show", "results/experiment"], cwd=tried, capture_output=True, text=True).stdout
    for line in re.findall(r"^```text\n(Δ.*?)^```", PAGE, re.M | re.S)[0].splitlines():
        assert line in shown.splitlines(), line


def test_the_experiment_of_the_page_is_what_its_script_makes(tmp_path):
    made = tmp_path / "experiment.csv"
    subprocess.run([sys.executable, ROOT / "python" / "examples" / "experiment.py", made], check=True)
    assert made.read_bytes() == (ROOT / "docs" / "experiment.csv").read_bytes()


def test_figures_in_python_have_other_directories_as_hollow_marks(tried, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tried)
    [code] = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    exec(code, {})
    mine = module.open("results/experiment")
    axes = module.open("results/model").plot.phase_eta(others=[mine, mine])
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels.count("experiment") == 2
    assert mine.slips(["onset", "size"]).to_pandas()["size"].isna().all()
    (tried / "copy.toml").write_text(mine.sweep)
    for sweep in ("copy.toml", mine.directory):
        with pytest.raises(module.SweepError, match="its slips were measured"):
            module.run(sweep)


def test_parquet_as_pandas_writes_it_is_read_whatever_else_it_holds(stickslip, tmp_path):
    pandas = pytest.importorskip("pandas")
    slips = pandas.DataFrame({"onset": [0.1, 0.3, 0.6], "V0": 1e-4, "n": pandas.array([1, 2, 3], dtype="int32")})
    slips.assign(when=pandas.Timestamp("2026-01-01")).to_parquet(tmp_path / "slips.parquet")
    stickslip("measured", tmp_path / "slips.parquet", "-o", tmp_path / "out")
    assert module.open(tmp_path / "out").slips().to_pandas()["onset"].tolist() == [0.1, 0.3, 0.6]


VELOCITY, ETA, PERIOD = 1e-6, 0.2, 7.0
AMPLITUDE = ETA * VELOCITY * PERIOD / (2 * math.pi)


def loads(draws, count):
    """Loads in m at which slips begin, of independent intervals."""
    load, found = 0.0, []
    for _ in range(count):
        load += VELOCITY * abs(draws.gauss(11, 1.5))
        found.append(load)
    return found


def passage(load):
    """When the drive first gets there, in s: below eta = 1 it never falls."""
    low, high = (load - 2 * AMPLITUDE) / VELOCITY, (load + 2 * AMPLITUDE) / VELOCITY
    for _ in range(80):
        time = (low + high) / 2
        moved = VELOCITY * time + AMPLITUDE * math.cos(2 * math.pi * time / PERIOD)
        low, high = (time, high) if moved < load else (low, time)
    return low


def excess(stickslip, folder, modulated):
    """The excess of R of runs with these times, beside a control of independent loads, and its interval."""
    draws = random.Random(1)
    with (folder / "slips.csv").open("w") as file:
        table = csv.writer(file)
        table.writerow(["onset", "run", "Delta", "T"])
        for run in range(5):
            table.writerows([load / VELOCITY, f"control {run}", 0, ""] for load in loads(draws, 100))
        for run, times in enumerate(modulated):
            table.writerows([time, f"run {run}", AMPLITUDE, PERIOD] for time in times)
    stickslip("measured", folder / "slips.csv", "-o", folder / "out", "--set", f"V0={VELOCITY}")
    one = module.open(folder / "out").sets().to_pandas().query("Delta > 0").iloc[0]
    assert one["slips"] == 500 and abs(one["eta"] - ETA) < 1e-6
    return [one[f"resultant_excess{end}"] for end in ("_low", "", "_high")]


def test_500_slips_without_locking_are_no_more_than_the_drive_alone(stickslip, tmp_path):
    draws = random.Random(2)
    low, _, high = excess(stickslip, tmp_path, [[passage(load) for load in loads(draws, 100)] for _ in range(5)])
    assert low <= 0 <= high and high - low < 0.4


def test_500_slips_that_lock_are_more(stickslip, tmp_path):
    draws = random.Random(3)

    def locked():
        """Slips at one phase, up to a tenth of a period, one or two periods apart."""
        cycle, times = 0, []
        for _ in range(100):
            cycle += draws.choice([1, 2])
            times.append(PERIOD * (cycle - 0.2 + 0.1 * draws.gauss(0, 1)))
        return sorted(times)

    low, _, _ = excess(stickslip, tmp_path, [locked() for _ in range(5)])
    assert low > 0.4
