"""Measured slips: the page of docs/measured.md as written, and the null on data that no code of this project made."""

import csv
import datetime
import decimal
import json
import math
import os
import pathlib
import random
import re
import resource
import shlex
import subprocess
import sys

import numpy
import pandas
import pyarrow
import pytest
from conftest import ROOT
from pyarrow import parquet

import stickslip as module

PAGE = (ROOT / "docs" / "measured.md").read_text()
CODE = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)


@pytest.fixture(scope="module")
def tried(program, tmp_path_factory):
    """A folder in which the commands of the page were given."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "docs").mkdir()
    subprocess.run([sys.executable, ROOT / "python" / "examples" / "trace.py", folder / "trace.parquet"], check=True)
    (folder / "docs" / "experiment.csv").write_bytes((ROOT / "docs" / "experiment.csv").read_bytes())
    for block in re.findall(r"^```sh\n(.*?)^```", PAGE, re.M | re.S):
        for command in block.replace("\\\n", " ").splitlines():
            words = [program, *shlex.split(command)[1:]]
            done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
            with (folder / "printed").open("a") as printed:
                printed.write(done.stdout)
    return folder


def test_the_page_leads_from_the_table_to_its_figure(tried):
    figure = (tried / "results" / "model" / "figures" / "phi-eta.png").read_bytes()
    shown = ROOT / "docs" / "measured-phase.png"
    if os.environ.get("UPDATE_DOCS"):
        shown.write_bytes(figure)
    assert figure == shown.read_bytes(), "UPDATE_DOCS=1 draws docs/measured-phase.png again"
    assert (tried / "results" / "model" / "figures" / "tau_mean-frequency.png").exists()


def test_what_the_page_shows_is_what_is_printed(program, tried):
    shown = subprocess.run([program, "show", "results/experiment"], cwd=tried, capture_output=True, text=True).stdout
    for line in re.findall(r"^```text\n(Δ.*?)^```", PAGE, re.M | re.S)[0].splitlines():
        assert line in shown.splitlines(), line


def test_the_page_shows_what_is_found_in_its_trace(tried):
    printed = (tried / "printed").read_text().splitlines()
    for line in re.findall(r"^```text\n(samples.*?)^```", PAGE, re.M | re.S)[0].splitlines():
        assert line in printed, line
    assert (tried / "results" / "trace" / "figures" / "drop-size.png").exists()
    # Blocks that slip at random strengths know nothing of the modulation but what it does to the load.
    sets = module.open(tried / "results" / "trace").sets().to_pandas()
    sets = sets[sets["Delta"] > 0]
    assert len(sets) == 6
    assert ((sets["resultant_excess_low"] < 0.02) & (sets["resultant_excess_high"] > -0.02)).all()


def test_a_trace_in_python_has_the_slips_of_the_file(tried, tmp_path):
    trace = parquet.read_table(tried / "trace.parquet")
    columns = {"time": "t", "force": ("F", "mN"), "Delta": ("amplitude", "um")}
    for size in ("auto", 8.21, (8210, "mN")):
        out = tmp_path / str(size)
        mine = module.measured(trace, out, columns=columns, set={"V0": 1e-4}, drop_size=size)
        expected = module.open(tried / "results" / "trace").slips(["onset", "drop"]).to_pandas()
        assert mine.slips(["onset", "drop"]).to_pandas().equals(expected), size
        assert (out / "figures" / "drop-size.svg").exists()
    with pytest.raises(module.SweepError, match="no plateau"):
        module.measured(trace, tmp_path / "none", columns=columns, set={"V0": 1e-4}, drop_size=30)
    assert (tmp_path / "none" / "figures" / "drop-size.svg").exists()


def test_the_experiment_of_the_page_is_what_its_script_makes(tmp_path):
    made = tmp_path / "experiment.csv"
    subprocess.run([sys.executable, ROOT / "python" / "examples" / "experiment.py", made], check=True)
    assert made.read_bytes() == (ROOT / "docs" / "experiment.csv").read_bytes()


def test_figures_in_python_have_other_directories_as_hollow_marks(tried, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tried)
    exec(CODE[0], {})
    mine = module.open("results/experiment")
    axes = module.open("results/model").plot.phase_eta(others=[mine, mine])
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels.count("results/experiment") == 2 and any(label.startswith("model: ") for label in labels)
    assert mine.slips(["onset", "size"]).to_pandas()["size"].isna().all()
    (tried / "copy.toml").write_text(mine.sweep)
    for sweep in ("copy.toml", mine.directory):
        with pytest.raises(module.SweepError, match="its slips were measured"):
            module.run(sweep)


def test_files_of_other_programs_come_in_through_python(tmp_path, monkeypatch, capsys):
    pandas, scipy = pytest.importorskip("pandas"), pytest.importorskip("scipy.io")
    monkeypatch.chdir(tmp_path)
    onsets = numpy.cumsum(numpy.random.default_rng(1).uniform(0.1, 0.2, 20))
    rows = "".join(f"{1000 * onset},7\n" for onset in onsets)
    pathlib.Path("rig.csv").write_text(f"Rig 3\nMonday\ntime,channel\n{rows}")
    scipy.savemat("rig.mat", {"t": onsets})
    pandas.DataFrame({"onset": onsets, "dF": 300.0}).to_excel("rig.xlsx", sheet_name="run 3")
    for code in CODE[1:]:
        exec(code, {})
    for name in ("rig", "mat", "excel"):
        found = module.open(f"results/{name}").slips().to_pandas()["onset"]
        assert numpy.allclose(found, onsets, rtol=1e-14), name
    said = capsys.readouterr().err
    assert "not used   channel" in said and "column time (ms)" in said and "Delta      0.6 um" in said


#: Onsets as each type holds them, in the unit of the column, and what they are in s.
WHOLE = numpy.array([1, 3, 6, 10, 15], dtype="int64")
COLUMNS = {
    "int8": (pyarrow.array(WHOLE, "int8"), WHOLE),
    "uint16": (pyarrow.array(WHOLE, "uint16"), WHOLE),
    "int32": (pyarrow.array(WHOLE, "int32"), WHOLE),
    "uint64": (pyarrow.array(WHOLE, "uint64"), WHOLE),
    "float16": (pyarrow.array((WHOLE / 8).astype("float16")), WHOLE / 8),
    "float32": (pyarrow.array((WHOLE / 7).astype("float32")), (WHOLE / 7).astype("float32")),
    "float64": (pyarrow.array(WHOLE / 7), WHOLE / 7),
    "decimal": (pyarrow.array([decimal.Decimal(int(n)) / 100 for n in WHOLE], pyarrow.decimal128(9, 2)), WHOLE / 100),
    "decimal256": (pyarrow.array([decimal.Decimal(int(n)) / 10 for n in WHOLE], pyarrow.decimal256(50, 4)), WHOLE / 10),
    "duration s": (pyarrow.array(WHOLE, pyarrow.duration("s")), WHOLE),
    "duration ms": (pyarrow.array(WHOLE, pyarrow.duration("ms")), WHOLE / 1e3),
    "duration ns": (pyarrow.array(WHOLE, pyarrow.duration("ns")), WHOLE / 1e9),
}


@pytest.mark.parametrize("kind", COLUMNS)
def test_numbers_of_every_type_are_those_of_numpy(kind, stickslip, tmp_path):
    column, expected = COLUMNS[kind]
    # What is not used may be of any type, names and texts included.
    others = {"a;b": ["x\ny"] * 5, "#": [True] * 5, "when": [datetime.datetime(2026, 1, 1)] * 5}
    table = pyarrow.table({"onset": column, **others})
    parquet.write_table(table, tmp_path / "slips.parquet", compression="brotli")
    stickslip("measured", tmp_path / "slips.parquet", "-o", tmp_path / "out", "--set", "V0=1e-4", "--set", "Delta=0")
    found = module.open(tmp_path / "out").slips().to_pandas()["onset"].to_numpy()
    assert (found == expected.astype("float64")).all(), (found, expected)


@pytest.mark.parametrize("compression", ["none", "snappy", "gzip", "brotli", "lz4", "zstd"])
def test_all_codecs_of_pyarrow_are_read(compression, stickslip, tmp_path):
    table = pyarrow.table({"onset": numpy.cumsum(numpy.linspace(1, 2, 200))})
    parquet.write_table(table, tmp_path / "slips.parquet", compression=compression)
    stickslip("measured", tmp_path / "slips.parquet", "-o", tmp_path / "out", "--set", "V0=1e-4", "--set", "Delta=0")
    assert len(module.open(tmp_path / "out").slips()) == 200


@pytest.mark.parametrize(
    "column",
    [
        pyarrow.array([True, False, True, True, False]),
        pyarrow.array([datetime.datetime(2026, 1, day) for day in range(1, 6)]),
        pyarrow.array(["1", "2", "3", "4", "5"]),
        pyarrow.array([1.0, 2.0, None, 4.0, 5.0]),
        pyarrow.array([1.0, 2.0, float("inf"), 4.0, 5.0]),
        pyarrow.array([1, 2, None, 4, 5], pyarrow.duration("s")),
    ],
)
def test_what_is_no_number_is_refused_with_file_and_column(column, program, tmp_path):
    parquet.write_table(pyarrow.table({"onset": column}), tmp_path / "slips.parquet")
    flags = ["-o", tmp_path / "out", "--set", "V0=1e-4", "--set", "Delta=0"]
    done = subprocess.run([program, "measured", tmp_path / "slips.parquet", *flags], capture_output=True, text=True)
    assert done.returncode == 2 and "slips.parquet" in done.stderr and "onset" in done.stderr, done.stderr
    assert not (tmp_path / "out").exists()


def test_a_duration_is_no_length_and_needs_no_unit(program, tmp_path):
    table = pyarrow.table({"onset": pyarrow.array(WHOLE, pyarrow.duration("s")), "Delta": pyarrow.array(WHOLE, pyarrow.duration("s"))})
    parquet.write_table(table, tmp_path / "slips.parquet")
    command = [program, "measured", tmp_path / "slips.parquet", "-o", tmp_path / "out", "--set", "V0=1e-4"]
    for flags in (["--set", "T=1"], ["--column", "onset=onset:ms", "--set", "Delta=0"]):
        done = subprocess.run([*command, *flags], capture_output=True, text=True)
        assert done.returncode == 2 and "duration" in done.stderr.lower(), done.stderr


def test_parameters_in_single_precision_make_the_sets_of_the_model(stickslip, tmp_path):
    """6e-7 in float32 is another double; read as written, it pairs with a set of the model."""
    rows = pandas.DataFrame({"onset": numpy.cumsum(numpy.linspace(1, 2, 40)), "Delta": 6e-7, "frequency": 58, "V0": 1e-4})
    rows = rows.astype({"Delta": "float32", "frequency": "float16", "V0": "float32"})
    rows.to_parquet(tmp_path / "slips.parquet")
    stickslip("measured", tmp_path / "slips.parquet", "-o", tmp_path / "out")
    one = module.open(tmp_path / "out").sets().to_pandas().iloc[0]
    assert (one["Delta"], one["frequency"], one["V0"]) == (6e-7, 58, 1e-4)
    (tmp_path / "model.toml").write_text('name = "m"\n[model]\nN = 2\nDelta = 6e-7\nfrequency = 58\n[axes]\nseed = [0, 1]\n[record]\nslips = 3\n')
    stickslip("run", tmp_path / "model.toml", "-o", tmp_path / "model")
    both = json.loads(stickslip("show", tmp_path / "model", tmp_path / "out", "--json").stdout)
    assert len(both["sets"]) == 1


@pytest.mark.parametrize("library", ["pandas", "polars", "duckdb", "pyarrow", "dict"])
def test_tables_of_python_are_read_as_their_files(library, stickslip, tmp_path):
    rows = pandas.DataFrame(
        {
            "run": pandas.Categorical(["a"] * 20 + ["b"] * 20),
            "t": pandas.to_timedelta(numpy.tile(numpy.cumsum(numpy.linspace(1, 2, 20)), 2) + numpy.repeat([0, 0.5], 20), unit="s"),
            "mu": numpy.linspace(0.1, 0.2, 40).astype("float32"),
            "amp": numpy.float32(0.6),
        }
    )
    if library == "duckdb":
        duckdb = pytest.importorskip("duckdb")
        rows = rows.assign(run=rows["run"].astype(str), t=rows["t"].dt.total_seconds())
        table = duckdb.sql("select * from rows")
    else:
        polars = pytest.importorskip("polars")
        makers = {
            "pandas": lambda: rows,
            "polars": lambda: polars.from_pandas(rows),
            "pyarrow": lambda: pyarrow.table(rows),
            "dict": lambda: {name: rows[name].to_numpy() if name != "run" else list(rows[name]) for name in rows},
        }
        table = makers[library]()
    columns, values = {"onset": "t", "drop": ("mu", "1"), "Delta": ("amp", "um")}, {"V0": (100, "um/s"), "frequency": 29}
    mine = module.measured(table, tmp_path / "out", columns=columns, set=values, maximum=(5, "ms"))
    slips = mine.slips().to_pandas()
    assert len(slips) == 40 and slips["seed"].nunique() == 2
    onsets = rows["t"].dt.total_seconds() if library != "duckdb" else rows["t"]
    assert numpy.allclose(slips["onset"], onsets, rtol=1e-12)
    assert numpy.array_equal(slips["drop"].to_numpy(), rows["mu"].to_numpy().astype("float64"))
    assert mine.sets().to_pandas().iloc[0]["Delta"] == 6e-7
    verified = stickslip("verify", mine.directory).stdout
    assert "intact" in verified
    with pytest.raises(module.SweepError, match="Delta is missing"):
        module.measured(table, tmp_path / "no", columns={"onset": "t"}, set={"V0": 1e-4})
    with pytest.raises(module.SweepError, match="did you mean onset"):
        module.measured(table, tmp_path / "no", columns={"onst": "t"})


def test_300_damaged_files_of_parquet_make_no_panic(program, tmp_path):
    rows = pandas.DataFrame({"run": ["a"] * 30 + ["b"] * 30, "onset": numpy.arange(60.0) ** 1.1, "drop": numpy.float32(3)})
    draws = random.Random(1)
    for round in range(300):
        rows.to_parquet(tmp_path / "whole.parquet", compression=draws.choice(["snappy", "gzip", "lz4", "zstd", None]))
        data = bytearray((tmp_path / "whole.parquet").read_bytes())
        for _ in range(draws.randint(1, 8)):
            # The footer is where a reader believes most.
            begin = draws.choice([0, max(0, len(data) - 700)])
            data[draws.randrange(begin, len(data))] = draws.randrange(256)
        if draws.random() < 0.2:
            del data[draws.randrange(len(data)) :]
        (tmp_path / "slips.parquet").write_bytes(data)
        flags = ["-o", tmp_path / "out", "--set", "V0=1e-4", "--set", "Delta=0", "--dry-run"]
        command = [program, "measured", tmp_path / "slips.parquet", *flags]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, preexec_fn=limit_memory)
        assert done.returncode in (0, 2) and "panicked" not in done.stderr, (round, done.stderr)
        assert done.returncode == 0 or "slips.parquet" in done.stderr, (round, done.stderr)


def limit_memory():
    resource.setrlimit(resource.RLIMIT_AS, (1 << 31, 1 << 31))


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
