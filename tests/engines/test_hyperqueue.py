"""HyperQueue's tasks share a sweep, also if a worker is killed, and a dependent task finds it complete."""

import os
import subprocess

import pytest
from hosts import wait_until
from hq import HyperQueue
from hyperqueue import Job
from hyperqueue.ffi.protocol import ResourceRequest
from sharing import BLOCKS, PARTS, abandoned, assert_each_part_ran_once, assert_same, done_parts, write_sweep

TASKS = 6

# Some 26 s of CPU time.
SLIPS = 200


@pytest.fixture
def hyperqueue(tmp_path):
    hyperqueue = HyperQueue(tmp_path)
    for host in ("w1", "w2", "w3"):
        hyperqueue.start_worker(host, cores=2)
    yield hyperqueue
    hyperqueue.stop()


def submission(program, folder):
    """How the script of `stickslip batch` calls `hq submit`: its options and the command of each task."""
    sweep = write_sweep(folder / "shared.toml", BLOCKS, SLIPS)
    options = ["--out", folder / "results", "--workers", str(TASKS), "--threads", "1", "--time", "1h"]
    batch = [program, "batch", "hyperqueue", sweep, *options]
    script = subprocess.run(batch, check=True, capture_output=True, text=True).stdout
    hq = folder / "bin" / "hq"
    hq.parent.mkdir()
    hq.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    hq.chmod(0o755)
    environment = os.environ | {"PATH": f"{hq.parent}:{os.environ['PATH']}"}
    called = subprocess.run(["sh"], input=script, env=environment, check=True, capture_output=True, text=True)
    word, *words = called.stdout.splitlines()
    assert word == "submit"
    end = words.index("--")
    return dict(option.removeprefix("--").split("=", 1) for option in words[:end]), words[end + 1 :]


def submit(hyperqueue, program, folder):
    """Submits the tasks of the script, and one that reduces after them; what waits for all."""
    options, command = submission(program, folder)
    assert options["array"] == f"1-{TASKS}"
    job = Job(name=options["name"], default_workdir=folder)
    resources = ResourceRequest(cpus=int(options["cpus"]))
    output = {name: options[name] for name in ("stdout", "stderr")}
    tasks = [job.program(command, resources=resources, **output) for _ in range(TASKS)]
    job.program([str(program), "reduce", str(folder / "results")], deps=tasks, **output)
    return hyperqueue.submit(job)


def test_tasks_share_a_sweep_and_run_each_part_once(hyperqueue, program, local_run, tmp_path):
    submit(hyperqueue, program, tmp_path)()
    assert_each_part_ran_once(tmp_path / "results", workers=TASKS)
    assert_same(tmp_path / "results", local_run(SLIPS))


def test_the_parts_of_a_killed_worker_are_taken_over(hyperqueue, program, local_run, tmp_path):
    results = tmp_path / "results"
    wait = submit(hyperqueue, program, tmp_path)
    wait_until(lambda: done_parts(results) >= 8, 60, "eight parts are done")
    hyperqueue.kill_worker("w2")
    assert abandoned(results, "w2")
    wait()
    assert done_parts(results) == PARTS
    assert_same(results, local_run(SLIPS))
