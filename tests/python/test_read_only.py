"""A user who may only read a directory sees its results, also if they were never reduced."""

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest

import stickslip

SWEEP = 'name = "a"\n[model]\nN = 5\n[axes]\nV0 = [1e-4, 2e-4]\nseed = { count = 3 }\n[record]\nslips = 4\n'


@pytest.fixture
def reader(program):
    """Runs commands where nothing can be written, and what they may write elsewhere."""
    folder = Path(tempfile.mkdtemp())
    (folder / "sweep.toml").write_text(SWEEP)
    shutil.copy(program, folder / "stickslip")
    subprocess.run([folder / "stickslip", "run", folder / "sweep.toml", "--out", folder / "r", "--no-reduce"], check=True, capture_output=True)
    (folder / "own").mkdir(mode=0o777)
    (folder / "own").chmod(0o777)
    folders = [folder, *(path for path in (folder / "r").rglob("*") if path.is_dir()), folder / "r"]
    for path in folders:
        path.chmod(0o555)
    # Root may write anywhere.
    user = {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}

    def run(*arguments):
        environment = {"HOME": str(folder / "own"), "PATH": "/usr/bin:/bin", "TMPDIR": str(folder / "own")}
        command = [folder / "stickslip", *arguments]
        return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60, **user)

    yield run, folder
    for path in folders:
        path.chmod(0o755)
    shutil.rmtree(folder)


def test_results_are_reduced_elsewhere_where_nothing_can_be_written(reader):
    run, folder = reader
    done = run("show", "r")
    assert done.returncode == 0 and done.stdout.count(" 12  ") == 2, done.stdout + done.stderr
    for command in (("plot", "r", "--x", "V0", "--y", "tau_mean", "-o", "own/a.png"), ("report", "r", "-o", "own/r.html")):
        done = run(*command)
        assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (folder / "own").iterdir()) == ["a.png", "r.html"]
    assert not (folder / "r" / "reduced").exists()
    done = run("reduce", "r")
    assert done.returncode == 3 and "r" in done.stderr, done.stderr


def test_the_module_reads_them_too(reader):
    _, folder = reader
    child = os.fork()
    if child == 0:
        sets = 0
        try:
            if os.geteuid() == 0:
                os.setgroups([])
                os.setgid(65534)
                os.setuid(65534)
            sets = len(stickslip.open(folder / "r").sets())
        finally:
            os._exit(sets)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 2
