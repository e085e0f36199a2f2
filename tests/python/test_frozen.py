"""A worker that was frozen, as on a suspended laptop, wakes when others have taken it for dead and finished the sweep:
each part is there once, with its bytes, and the worker ends with the true reason."""

import os
import signal
import subprocess
import time

import pytest
from conftest import tree

SWEEP = """
name = "frozen"
model = { N = 100, V0 = 2e-5 }
axes = { seed = { count = 16 } }
record = { slips = 20 }
"""
# In a name space of its own nobody can look its process up, and only its beats count.
UNSHARE = ["unshare", "--pid", "--fork", "--kill-child", "--mount-proc"]


def freeze(process, results, parts):
    """Stops the worker once it has claimed so many parts, as if it had been silent for long; its process id."""
    claims, end = results / "run" / "claims", time.monotonic() + 60
    while len(list(claims.glob("*"))) < parts:
        assert process.poll() is None and time.monotonic() < end, "it claims parts"
        time.sleep(0.001)
    with open(f"/proc/{process.pid}/task/{process.pid}/children") as children:
        worker = int(children.read())
    os.kill(worker, signal.SIGSTOP)
    for beat in (results / "run" / "workers").iterdir():
        os.utime(beat, (time.time() - 600,) * 2)
    return worker


@pytest.mark.skipif(subprocess.run([*UNSHARE, "true"], capture_output=True).returncode != 0, reason="needs root")
@pytest.mark.parametrize("parts", [1, 4, 16])
def test_a_worker_that_wakes_when_others_have_finished_its_sweep_adds_nothing(program, stickslip, tmp_path, parts):
    (tmp_path / "frozen.toml").write_text(SWEEP)
    run, results = ["run", tmp_path / "frozen.toml", "--no-reduce", "--out"], tmp_path / "results"
    stickslip(*run, tmp_path / "alone")
    whole = tree(tmp_path / "alone" / "tables")
    frozen = subprocess.Popen([*UNSHARE, program, *run, results, "--threads", "1"], stderr=subprocess.PIPE, text=True)
    worker = freeze(frozen, results, parts)
    stickslip(*run, results)
    stickslip("export", results, "--out", tmp_path / "exported")
    os.kill(worker, signal.SIGCONT)
    _, errors = frozen.communicate(timeout=60)
    # Names and bytes of a run by one, so no job is there twice.
    assert tree(results / "tables") == whole
    stickslip("verify", results)
    assert frozen.returncode == 0 or "gave no sign of life" in errors, errors
