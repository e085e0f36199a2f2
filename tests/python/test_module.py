"""The module stickslip: the same bits as the command line, tables that every library takes, and no way to hang or crash."""

import ast
import enum
import inspect
import math
import multiprocessing
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import tomllib
from concurrent.futures import ProcessPoolExecutor
from datetime import timedelta
from operator import attrgetter
from pathlib import Path
from zipfile import ZipFile

import duckdb
import nbformat
import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import ROOT, results_in
from nbclient import NotebookClient

import stickslip as module
from stickslip import guesses
from stickslip.tables import Sweep

KEYS = {"N": 9, "Delta": 1e-6, "frequency": 29, "slips": 6}
FLAGS = ("--set", "N=9", "--set", "Delta=1e-6", "--set", "frequency=29", "--slips", 6)
SWEEP = {
    "name": "from-a-dict",
    "where": ["Delta < 1e-5"],
    "model": {"N": 9, "break_on": "magnitude"},
    "axes": {"zip": [{"Delta": [0, 1e-6], "frequency": [29, 29]}], "seed": {"count": 3}},
    "record": {"slips": 6, "discard": 2, "precursors": True},
}
# More work than any test waits for.
LONG = {"name": "long", "axes": {"seed": {"count": 5000}}, "record": {"slips": 200}}


@pytest.fixture(scope="module")
def opened(results):
    return module.open(results)


def bare(table):
    return pa.table(table).replace_schema_metadata(None)


def test_a_simulation_has_the_bits_of_the_command(stickslip, tmp_path):
    tables = ("trace", "map", "profile", "contacts")
    paths = {name: tmp_path / f"{name}.parquet" for name in (*tables, "slip_table")}
    flags = [word for name, path in paths.items() for word in (f"--{name.replace('_', '-')}", path)]
    stickslip("simulate", *FLAGS, *flags)
    one = module.simulate(**KEYS, **dict.fromkeys(tables, True))
    assert one.outcome == "done" and len(one.slips()) == 6
    for name, path in paths.items():
        written = pq.ParquetFile(path).read()
        found = pa.table(getattr(one, name.removeprefix("slip_").replace("table", "slips"))())
        assert found.equals(written.replace_schema_metadata(None)), name
        assert [field.metadata for field in found.schema] == [
            {key: text for key, text in field.metadata.items() if key != b"PARQUET:field_id"} for field in written.schema
        ]


def test_a_simulation_has_the_bits_of_a_sweep(opened):
    jobs = opened.jobs().to_pandas()
    job = jobs[(jobs["Delta"] > 0) & (jobs["seed"] == 1)].iloc[0]
    one = module.simulate(
        {"name": "one", "model": {"N": 9, "Delta": 1e-6, "frequency": 29, "seed": 1},
         "record": {"slips": 6, "discard": 2, "precursors": True}}
    )
    assert one.job["job_id"] == job["job_id"] and one.job["mean_friction"] == job["mean_friction"]
    for name in ("slips", "precursors"):
        table = pl.DataFrame(getattr(opened, name)()).filter(pl.col("job_id") == job["job_id"])
        assert table.equals(pl.DataFrame(getattr(one, name)())), name


def test_a_dict_runs_as_the_file_with_its_text_does(stickslip, tmp_path):
    ran = module.run(SWEEP, tmp_path / "dict", progress=False)
    assert tomllib.loads(ran.sweep) == SWEEP and ran.name == "from-a-dict"
    (tmp_path / "sweep.toml").write_text(ran.sweep)
    stickslip("run", tmp_path / "sweep.toml", "--out", tmp_path / "command")
    module.run(tmp_path / "sweep.toml", out=tmp_path / "file", threads=1, progress=False)
    expected = results_in(tmp_path / "command")
    # Three tables of six parts, one for each job, and the reduced data.
    assert len(expected) == 3 * 6 + 4
    assert results_in(tmp_path / "dict") == results_in(tmp_path / "file") == expected
    again = module.run(tmp_path / "dict", progress=False)
    assert again.directory == tmp_path / "dict" and results_in(tmp_path / "dict") == expected


@pytest.mark.parametrize("array", [np.array, pd.Series, pl.Series, pa.array])
def test_arrays_of_every_library_are_lists(tmp_path, array):
    velocities = list(np.geomspace(1e-5, 1e-4, 3))
    sweep = {"name": "arrays", "axes": {"V0": array(velocities), "seed": array([0, 1])}, "record": {"slips": 1}}
    jobs = module.run(sweep, tmp_path / "arrays", progress=False).jobs().to_pandas()
    assert sorted(set(jobs["V0"])) == velocities and set(jobs["seed"]) == {0, 1}


def test_every_library_takes_the_slips(results, opened):
    written = pd.read_parquet(results / "tables" / "slips")
    slips = opened.slips()
    assert len(slips) == len(written) > 0
    pd.testing.assert_frame_equal(slips.to_pandas(), written)
    pd.testing.assert_frame_equal(pd.DataFrame.from_arrow(slips), written, check_dtype=False)
    assert slips.to_polars().equals(pl.read_parquet(results / "tables" / "slips"))
    assert slips.to_pyarrow().equals(pa.table(slips))
    found = duckdb.sql("select count(*), avg(\"interval\") from slips").fetchall()[0]
    assert found == (len(written), pytest.approx(written["interval"].mean()))


def test_tables_are_handed_on_without_a_copy(opened):
    slips = opened.slips(["phase"])
    addresses = {pa.table(slips)["phase"].chunk(0).buffers()[1].address for _ in range(2)}
    assert len(addresses) == 1


def test_every_table_is_that_of_its_files(results, opened):
    for name in ("jobs", "precursors"):
        # Which jobs are controls follows from all sweeps, and is no column of tables.
        written = pd.read_parquet(results / "tables" / name)
        found = getattr(opened, name)().to_pandas()
        if name == "jobs":
            assert not found.pop("control").any()
        pd.testing.assert_frame_equal(found, written)
    for name in ("sets", "histograms", "backbone", "points"):
        written = pd.read_parquet(results / "reduced" / f"{name}.parquet")
        pd.testing.assert_frame_equal(getattr(opened, name)().to_pandas(), written)


def test_units_are_everywhere(opened):
    slips = opened.slips(join=True)
    units = {"V0": "m/s", "interval": "s", "phase": "rad", "Kd": "N/m", "mean_friction": "N", "periods": ""}
    assert {name: slips.units[name] for name in units} == units
    assert pa.table(slips).schema.field("Kd").metadata[b"unit"] == b"N/m"
    assert pa.schema(slips).field("Kd").metadata[b"description"] == slips.meaning["Kd"].encode()
    assert slips.to_pandas().attrs == {"units": slips.units, "meaning": slips.meaning}
    assert re.search(r"^  interval +float +s +time since", repr(slips), re.M), repr(slips)
    assert repr(slips).startswith(f"slips: {len(slips)} rows\n")


def test_parameters_of_the_job_join_the_slips(opened):
    slips, jobs = opened.slips().to_pandas(), opened.jobs().to_pandas()
    others = [column for column in jobs if column not in slips]
    expected = slips.merge(jobs[["job_id", *others]], on="job_id")
    pd.testing.assert_frame_equal(opened.slips(join=True).to_pandas(), expected)
    columns = ["Kd", "phase", "outcome", "seed"]
    pd.testing.assert_frame_equal(opened.slips(columns).to_pandas(), expected[columns])
    assert opened.slips("N").columns == ["N"]
    with pytest.raises(ValueError, match="slips: there is no column Kdd; did you mean Kd?"):
        opened.slips(["Kdd"])
    with pytest.raises(ValueError, match="jobs: there is no column phase; there are job_id"):
        opened.jobs(["phase"])


DAMAGES = {
    "missing": Path.unlink,
    "without its folder": lambda file: shutil.rmtree(file.parent),
    "cut": lambda file: file.write_bytes(file.read_bytes()[:-9]),
    "in the place of another": lambda file: shutil.copy(max(file.parent.iterdir()), file),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("table", ["slips", "precursors"])
def test_a_damaged_part_is_an_error_that_says_what_to_do_and_never_fewer_rows(results, tmp_path, table, damage):
    copy = shutil.copytree(results, tmp_path / "copy")
    file = min((copy / "tables" / table).iterdir())
    DAMAGES[damage](file)
    opened = module.open(copy)
    read = getattr(opened, table)
    readers = [read, lambda: read("onset"), lambda: read(["Kd"]), lambda: read(join=True), lambda: Sweep(copy).table(table)]
    if table == "slips":
        readers += [opened.reduce, Sweep(copy).slips]
    for reader in readers:
        with pytest.raises(module.ResultsError, match=rf"{file.name}: .*`?stickslip verify"):
            reader()
    assert len(opened.jobs()) == 10


def test_mistakes_have_the_words_of_the_command(program, tmp_path):
    def command(*arguments):
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=60)
        assert done.returncode == 2
        return done.stderr.removeprefix("error: ").strip()

    with pytest.raises(module.SweepError) as found:
        module.simulate(V0=-1)
    assert str(found.value) == command("simulate", "--set", "V0=-1").replace("in the flags", "in the keys")
    with pytest.raises(module.SweepError, match="in the keys: Vo = 1: unknown key; did you mean V0?"):
        module.simulate(Vo=1)
    with pytest.raises(module.SweepError, match="slipz = 1: unknown key; did you mean slips?"):
        module.simulate(slipz=1)
    with pytest.raises(module.SweepError, match="in the sweep: name is missing"):
        module.run({"model": {"V0": 1e-5}}, tmp_path / "none")
    with pytest.raises(module.SweepError, match="model = None: must be a number"):
        module.run({"name": "none", "model": None}, tmp_path / "none")
    (tmp_path / "bad.toml").write_text('name = "bad"\n[model]\nV1 = 3\nT = -1\n')
    with pytest.raises(module.SweepError) as found:
        module.run(tmp_path / "bad.toml")
    assert str(found.value) == command("run", tmp_path / "bad.toml")
    with pytest.raises(module.ResultsError) as found:
        module.open(tmp_path)
    assert str(found.value) == command("status", tmp_path)
    assert issubclass(module.SweepError, ValueError)


def test_a_simulation_records_energies_as_a_sweep_does():
    slips = module.simulate(N=9, slips=2, energies=True).slips().to_pandas()
    assert (slips["drive_work"] > 0).all() and slips["break_loss"].notna().all()


def test_what_was_not_recorded_is_named(tmp_path):
    with pytest.raises(module.SimulationError, match="give trace=True"):
        module.simulate(N=9, slips=1).trace()
    results = module.run({"name": "a", "model": {"N": 9}, "record": {"slips": 1}}, tmp_path / "a", progress=False, reduce=False)
    with pytest.raises(module.ResultsError, match="precursors = true"):
        results.precursors()


def test_sets_are_always_those_of_the_tables_that_are_there(tmp_path):
    def run(seeds):
        sweep = {"name": "a", "model": {"N": 9}, "axes": {"seed": seeds}, "record": {"slips": 1}}
        return module.run(sweep, tmp_path / "a", progress=False, reduce=False)

    assert run([0]).sets(["jobs"]).to_pandas()["jobs"].tolist() == [1]
    # Another worker extends the sweep, and does not reduce it.
    assert run([0, 1]).sets(["jobs"]).to_pandas()["jobs"].tolist() == [2]
    (tmp_path / "a" / "reduced" / "sets.parquet").write_bytes(b"half")
    assert module.open(tmp_path / "a").sets(["jobs"]).to_pandas()["jobs"].tolist() == [2]


def test_progress_is_shown_and_ends_at_one(tmp_path):
    seen = []
    module.run({**SWEEP, "where": []}, tmp_path / "seen", progress=seen.append)
    assert (seen[-1].jobs_done, seen[-1].jobs, seen[-1].share) == (6, 6, 1.0)
    assert "6 jobs to run" in seen[0].messages[0]


def test_a_failed_job_is_a_warning_and_a_row(tmp_path):
    sweep = {"name": "fails", "model": {"N": 9}, "record": {"slips": 5, "max_events": 100}}
    with pytest.warns(UserWarning, match="jobs failed: 1"):
        results = module.run(sweep, tmp_path / "fails", progress=False)
    assert results.jobs().to_pandas()["outcome"].tolist() == ["failed"]
    with pytest.raises(module.SimulationError, match="events"):
        module.simulate(N=9, slips=5, max_events=100)


def test_an_exception_in_the_callback_stops_the_run_and_keeps_what_is_done(tmp_path):
    def stop(progress):
        if progress.jobs_done >= 2:
            raise RuntimeError("enough")

    begin = time.monotonic()
    with pytest.raises(RuntimeError, match="enough"):
        module.run(LONG, tmp_path / "long", progress=stop)
    assert time.monotonic() - begin < 60
    assert module.open(tmp_path / "long").name == "long"


INTERRUPTED = """
import sys, stickslip
def show(progress):
    if progress.jobs_done >= 3:
        print("running", flush=True)
try:
    stickslip.run({sweep}, sys.argv[1], progress=show, reduce=False)
except KeyboardInterrupt:
    sys.exit(42)
"""


def test_ctrl_c_raises_keyboard_interrupt_and_keeps_finished_jobs(stickslip, tmp_path):
    script = INTERRUPTED.format(sweep=LONG)
    child = subprocess.Popen([sys.executable, "-c", script, tmp_path / "long"], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "running\n"
    child.send_signal(signal.SIGINT)
    assert child.wait(timeout=60) == 42
    child.stdout.close()
    status = stickslip("status", tmp_path / "long").stdout
    kept = [int(number) for number in re.findall(r"(\d+)", status)]
    spilled = list((tmp_path / "long" / "run" / "spill").glob("*"))
    assert spilled or len(module.open(tmp_path / "long").jobs()) > 0, (status, kept)


def test_ctrl_c_ends_a_simulation():
    script = "import stickslip\nprint('running', flush=True)\nstickslip.simulate(slips=10_000_000)"
    child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "running\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=60)
    assert "KeyboardInterrupt" in errors and child.returncode == -signal.SIGINT


TINY = {"name": "a", "model": {"N": 3, "Ns": 4}, "axes": {"seed": [1, 2]}, "record": {"slips": 2}}
ENDLESS = []
ENDLESS.append(ENDLESS)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        *(({"threads": given}, "threads = .*: must be a whole number from 1 to 1024") for given in (0, -1, 2**62, 1.5, "2", True)),
        *(({"walltime": given}, "walltime = .*: must be a finite number > 0, in s") for given in (math.nan, -1, "1 h", math.inf)),
        ({"walltime": timedelta(seconds=-1)}, "walltime = -1.0: must be a finite number > 0, in s"),
        ({"progress": "no"}, "progress = 'no': must be True, False or a function"),
        ({"retry_failed": "no"}, "retry_failed = 'no': must be True or False"),
        ({"reduce": None}, "reduce = None: must be True or False"),
        ({"out": 3}, "out = 3: must be a path"),
        ({"sweep": 3}, "sweep = 3: must be a path"),
        ({"sweep": None}, "sweep = None: must be a path or a dict"),
        ({"sweep": TINY | {"model": {"N": {1, 2}}}}, "N = {1, 2}: must be a number"),
        ({"sweep": TINY | {"axes": {"V0": ENDLESS}}}, "V0: lists and dicts lie within each other 16 deep"),
        ({"sweep": TINY | {"axes": {"seed": [2**70]}}}, "seed"),
    ],
)
def test_arguments_that_are_refused_are_named_with_what_is_allowed(tmp_path, call, words):
    with pytest.raises((TypeError, ValueError), match=words):
        module.run(**{"sweep": TINY, "out": tmp_path / "a"} | call)
    assert not (tmp_path / "a").exists()


def test_what_a_simulation_and_a_table_cannot_take_is_named(opened):
    for sample in (0, math.nan, "1", None):
        with pytest.raises(ValueError, match=f"sample = {sample!r}: must be a finite number > 0, in s"):
            module.simulate(sample=sample)
    with pytest.raises(TypeError, match="trace = 1: must be True or False"):
        module.simulate(trace=1)
    for columns in ([], ["onset", "onset"], [3]):
        with pytest.raises(ValueError, match="must be names of columns, each once, at least one"):
            opened.slips(columns)


def test_numbers_of_other_libraries_and_enumerations_are_values(tmp_path):
    class Size(enum.IntEnum):
        SMALL = 3

    model = {"N": Size.SMALL, "Ns": np.int64(4), "V0": np.float32(2.0**-13), "Delta": np.array(0.0)}
    options = {"threads": np.int64(1), "walltime": np.float64(60), "reduce": np.True_, "progress": False}
    results = module.run(TINY | {"model": model}, tmp_path / "a", **options)
    assert 'N = 3\nNs = 4\nV0 = 0.0001220703125\nDelta = 0.0' in results.sweep and len(results.jobs()) == 2


def test_simulations_and_tables_come_back_from_other_processes(opened):
    one = module.simulate(**KEYS, trace=True)
    other = pickle.loads(pickle.dumps(one))
    assert other.job == one.job and other.slips().units == one.slips().units
    for table in (one.slips(), one.trace(), opened.slips(), opened.sets(), opened.histograms(["count"])):
        copy = pickle.loads(pickle.dumps(table))
        assert pa.table(copy).equals(pa.table(table), check_metadata=True) and copy.name == table.name
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        sweeps = [{"name": "a", "record": {"slips": slips}} for slips in (1, 2)]
        lengths = [len(one.slips()) for one in pool.map(module.simulate, sweeps)]
    assert lengths == [1, 2]


def test_other_threads_run_meanwhile():
    ticks, over = 0, threading.Event()

    def tick():
        nonlocal ticks
        while not over.wait(0.001):
            ticks += 1

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    module.simulate(slips=400)
    elapsed = time.monotonic() - begin
    over.set()
    thread.join()
    # With the lock held there would be one at most.
    assert ticks > 5 and elapsed > 0.05, (ticks, elapsed)


def test_simulations_run_in_threads_at_once():
    expected = module.simulate(N=9, slips=3).slips().to_pandas()
    found = []
    threads = [threading.Thread(target=lambda: found.append(module.simulate(N=9, slips=3))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    for one in found:
        pd.testing.assert_frame_equal(one.slips().to_pandas(), expected)


def test_keys_are_described_where_people_look():
    signature = inspect.signature(module.simulate)
    assert signature.parameters["V0"].default == 1e-4 and signature.parameters["slips"].default == 20
    assert "V0\n    Drive velocity. A finite number > 0, in m/s, not so low" in module.simulate.__doc__
    assert {"eta", "frequency", "max_time", "tolerance", "dt", "method"} <= set(signature.parameters)


def test_figures_show_the_data(results, opened):
    points = pd.read_parquet(results / "reduced" / "points.parquet")
    axes = opened.plot.phase_eta()
    slips = [line for line in axes.get_lines() if line.get_label() in ("other slips", "slips of sets with a phase")]
    assert sum(len(line.get_xdata()) for line in slips) == points["phase"].notna().sum() > 0
    (means,) = axes.containers
    bins = pd.read_parquet(results / "reduced" / "backbone.parquet")
    assert means.lines[0].get_ydata() == pytest.approx(bins["phase_mean"]) and means.has_yerr
    assert set(means.lines[0].get_xdata().astype(float).round(9)) <= set(points["eta"].round(9))
    assert "rad" in axes.get_ylabel()
    axes = opened.plot.intervals()
    assert "(s)" in axes.get_xlabel()
    lines = [line.get_xydata() for line in axes.get_lines() if len(line.get_xydata()) == 2]
    assert lines and all(np.isfinite(line).all() and line[0, 1] == line[1, 1] == round(line[0, 1]) for line in lines)
    panels = opened.plot.histograms()
    assert len(panels) == 2 and "(s)" in panels[-1].get_xlabel()
    heights = [sum(bar.get_height() * bar.get_width() for bar in axes.patches) for axes in panels]
    assert heights == pytest.approx([1, 1])


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    build = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
    # As in scripts/python-packages.
    folders = {"CARGO_BUILD_BUILD_DIR": str(build), "CARGO_TARGET_DIR": str(build / "module")}
    environment = os.environ | folders | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    # What `pip install .` does, but for the download of maturin.
    command = [sys.executable, "-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--wheel-dir", folder, "."]
    subprocess.run(command, cwd=ROOT, env=environment, check=True)
    return next(folder.glob("*.whl"))


def test_a_wheel_holds_the_package_alone(wheel):
    with ZipFile(wheel) as archive:
        files = {name for name in archive.namelist() if ".dist-info/" not in name}
    sources = ROOT / "python" / "stickslip"
    assert files == {f"stickslip/{path.name}" for path in sources.iterdir() if path.name != "__pycache__"}


def test_two_commands_lead_from_a_wheel_to_a_figure_without_rust(wheel, tmp_path):
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    environment = {"PATH": f"{tmp_path}/venv/bin:/usr/bin:/bin", "HOME": str(tmp_path)}
    for command in (["pip", "install", "--no-index", wheel], ["stickslip", "run", "--preset", "sliding-velocity", "--set", "N=9", "-o", "r"]):
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "r" / "figures" / "overview.png").stat().st_size > 10_000 and "⟨τ⟩" in done.stdout


def test_importing_it_imports_no_other_library():
    script = "import sys, stickslip; print(*sorted(set(sys.modules) & {'numpy', 'pandas', 'polars', 'pyarrow', 'matplotlib'}))"
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "\n"


def test_the_notebook_runs_and_holds_no_output(tmp_path):
    path = ROOT / "python" / "examples" / "tutorial.ipynb"
    notebook = nbformat.read(path, as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(cells) > 3 and not any(cell.outputs or cell.execution_count for cell in cells)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()


def test_the_stubs_are_those_of_the_module(tmp_path):
    # The other libraries are many and large, and their types are not what is compared.
    (tmp_path / "mypy.ini").write_text("[mypy]\nfollow_imports = skip\nignore_missing_imports = True\n")
    command = [sys.executable, "-m", "mypy.stubtest", "stickslip._stickslip", "--mypy-config-file", tmp_path / "mypy.ini"]
    environment = {**os.environ, "MYPY_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_stubs_have_the_words_of_the_module():
    stubs = ast.parse((ROOT / "python" / "stickslip" / "_stickslip.pyi").read_text())
    classes = [node for node in stubs.body if isinstance(node, ast.ClassDef)]
    words = {node.name: ast.get_docstring(node) for node in classes}
    table = next(node for node in classes if node.name == "Table")
    words |= {f"Table.{node.name}": ast.get_docstring(node) for node in table.body if isinstance(node, ast.FunctionDef)}
    # Those between underscores have none.
    words = {name: text for name, text in words.items() if text or "__" not in name}
    assert len(words) == 11
    assert words == {name: attrgetter(name)(module._stickslip).__doc__ for name in words}


def test_sweeps_in_rounds_have_edges_and_say_whether_targets_are_met(tmp_path, opened):
    def run(name, section):
        axes = {"V0": {"log": [1e-4, 1e-3], "points": 3}}
        sweep = {"name": name, "model": {"N": 3, "Ns": 4}, "axes": axes, "record": {"slips": 2}, **section}
        return module.run(sweep, tmp_path / name, progress=False)

    precise = run("precise", {"precision": {"of": "mean_friction", "relative": 0.5, "seeds": {"from": 2, "to": 3}}})
    sets = pa.table(precise.sets())
    assert len(sets) == 3 and {"first_round", "seeds", "target_met"} <= set(sets.column_names)
    seeds = {"first": 7, "from": 24, "to": 48}
    refine = {"axis": "V0", "by": "slip_share", "threshold": 0.5, "to": 0.3, "seeds": seeds, "jobs": 200}
    refined = run("refined", {"refine": refine})
    edges = pa.table(refined.edges())
    assert set(edges["axis"].to_pylist()) == {"V0"} and {"edge", "edge_low", "ended"} <= set(edges.column_names)
    assert min(pa.table(refined.jobs())["seed"].to_pylist()) == 7
    with pytest.raises(module.ResultsError, match="refine"):
        opened.edges()
    with pytest.raises(module.ResultsError, match="pulse_start"):
        opened.triggers()


def test_pulses_have_a_table_of_what_they_did(tmp_path):
    axes = {"pulse_start": [0.5, 0.52], "seed": {"count": 3}}
    sweep = {"name": "pulses", "model": {"N": 10, "Ns": 5, "Delta": 1e-6, "frequency": 29}, "axes": axes}
    results = module.run({**sweep, "record": {"time": 0.7, "control": True}}, tmp_path / "pulses", progress=False)
    triggers = pa.table(results.triggers(["seed", "place", "advance", "advance_drive", "excluded"]))
    pulses = pa.table(results.pulses(["place_high", "jobs", "advance_mean"]))
    assert pulses["place_high"][0].as_py() == 1 and pulses["jobs"][0].as_py() == sum(pulses["jobs"].to_pylist()[1:])
    assert len(triggers) == 2 * 3 and min(triggers["advance_drive"].drop_null().to_pylist()) >= 0


def test_a_column_of_a_table_has_its_name(opened):
    slips = opened.slips()
    pd.testing.assert_series_equal(slips["interval"], slips.to_pandas()["interval"])
    with pytest.raises(KeyError, match="intervall"):
        slips["intervall"]


@pytest.mark.parametrize(
    ("guess", "words"),
    [
        ("results.show()", r"write results.sets\(\).to_pandas\(\), or `stickslip show {directory}`"),
        ("results.status()", r"or `stickslip status {directory}`"),
        ("results.report()", r"write `stickslip report {directory}`"),
        ("results.to_pandas()", r"write results.slips\(\).to_pandas\(\)"),
        ("results.slip()", r"Results has no slip: did you mean slips\?"),
        ("results.xyz", "there are backbone, directory, edges,"),
        ("results.slips().interval", r"columns are slips\[NAME\], and to_pandas\(\) gives"),
        ("results.plot.phi_eta()", "write phase_eta"),
        ("results.plot('tau-T')", "write intervals"),
        ("results.plot.tau_histograms()", "write histograms"),
        ("results.plot.overview()", "`stickslip plot {directory}` draws others"),
        ("results.plot('locking-map')", "`stickslip plot {directory}` draws others"),
        ("one.plot()", r"trace=True write one.trace\(\).to_pandas\(\).plot\('time', 'force'\), or `stickslip simulate --plot"),
        ("one.mean_friction", r"write one.job\['mean_friction'\]"),
        ("one.slip()", r"Simulation has no slip: did you mean slips\?"),
    ],
)
def test_a_guess_gets_the_answer(opened, guess, words):
    one = module.simulate(N=3, Ns=4, slips=1)
    with pytest.raises(AttributeError, match=words.format(directory=opened.directory)):
        eval(guess, {"results": opened, "one": one})


def test_what_answers_to_guesses_name_is_there(opened):
    one = module.simulate(**KEYS, trace=True)
    assert {"time", "force"} <= set(one.trace().columns)
    assert opened.jobs()["outcome"].value_counts()["done"] > 0
    assert opened.plot("intervals").get_ylabel() == opened.plot.intervals().get_ylabel()
    sources = "".join(path.read_text() for path in (ROOT / "src" / "figure").glob("*.rs"))
    figures = set(re.findall(r'^pub\(super\) const [A-Z]+: &str = "([\w-]+)";', sources, re.M))
    assert {figure.replace("-", "_") for figure in figures} > set(guesses.INSTEAD["Plot"])
