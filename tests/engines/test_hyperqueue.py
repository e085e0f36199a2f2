"""HyperQueue's tasks share a sweep, also if a worker is killed, and a dependent task finds it complete.

And the commands of docs/clusters.md run as they are.
"""

import os
import subprocess
from pathlib import Path

import pytest
from hosts import wait_until
from hq import HyperQueue
from hyperqueue import Job
from hyperqueue.ffi.protocol import ResourceRequest
from sharing import (
    BLOCKS,
    PARTS,
    abandoned,
    assert_each_part_ran_once,
    assert_same,
    done_parts,
    logged,
    prepare_screen,
    screens,
    write_sweep,
)

TASKS = 6

# Some 12 s of CPU time, so that all tasks start before the end: of 2 s, one task of 16 threads may take all.
SLIPS = 150


@pytest.fixture
def hyperqueue(tmp_path):
    hyperqueue = HyperQueue(tmp_path)
    for host in ("w1", "w2", "w3"):
        hyperqueue.start_worker(host, cores=2)
    yield hyperqueue
    hyperqueue.stop()


class Call:
    """How the commands of a shell call `hq submit`: folder, options and the command of each task."""

    def __init__(self, commands, program, folder):
        hq = folder / "bin" / "hq"
        hq.parent.mkdir()
        hq.write_text('#!/bin/sh\nprintf "%s\\n" "$PWD" "$@"\n')
        hq.chmod(0o755)
        environment = os.environ | {"PATH": f"{hq.parent}:{program.parent}:{os.environ['PATH']}"}
        printed = subprocess.check_output(["sh", "-ec", commands], cwd=folder, env=environment, text=True)
        self.folder, word, *words = printed.splitlines()
        assert word == "submit"
        end = words.index("--")
        self.options = dict(option.removeprefix("--").split("=", 1) for option in words[:end])
        self.command = words[end + 1 :]
        self.results = Path(self.command[self.command.index("--out") + 1])

    def submit(self, hyperqueue, tasks):
        """Submits the tasks, and one that reduces after them; what waits for all."""
        assert self.options["array"] == f"1-{tasks}"
        job = Job(name=self.options["name"], default_workdir=self.folder)
        resources = ResourceRequest(cpus=int(self.options["cpus"]))
        output = {name: self.options[name] for name in ("stdout", "stderr")}
        tasks = [job.program(self.command, resources=resources, **output) for _ in range(tasks)]
        job.program([self.command[0], "reduce", str(self.results)], deps=tasks, **output)
        return hyperqueue.submit(job)


@pytest.fixture
def call(program, tmp_path):
    """The call of a script that `stickslip batch` prints."""
    sweep = write_sweep(tmp_path / "shared.toml", BLOCKS, SLIPS)
    options = f"--out {tmp_path / 'results'} --workers {TASKS} --threads 1 --time 1h"
    return Call(f"stickslip batch hyperqueue {sweep} {options} | sh", program, tmp_path)


def test_tasks_share_a_sweep_and_run_each_part_once(hyperqueue, call, local_run):
    call.submit(hyperqueue, TASKS)()
    assert_each_part_ran_once(call.results, workers=TASKS)
    assert_same(call.results, local_run(SLIPS))


def test_the_parts_of_a_killed_worker_are_taken_over(hyperqueue, call, local_run):
    wait = call.submit(hyperqueue, TASKS)
    wait_until(lambda: len(logged(call.results)) == TASKS, 180, "each task has done a part")
    hyperqueue.kill_worker("w2")
    assert abandoned(call.results, "w2")
    wait()
    assert done_parts(call.results) == PARTS
    assert_same(call.results, local_run(SLIPS))


def test_the_commands_of_the_page_on_clusters_run_as_they_are(hyperqueue, program, local_run, tmp_path):
    hyperqueue.start_worker("large", cores=64)
    for number, screen in enumerate(screens("HyperQueue")):
        folder = tmp_path / str(number)
        call = Call(prepare_screen(screen, folder, SLIPS), program, folder)
        call.submit(hyperqueue, tasks=40)()
        # Standard output and standard error of the tasks, and of the one that reduces.
        assert len(list(call.results.glob("run/batch/*"))) == 2 * 41
        assert_each_part_ran_once(call.results, workers=2)
        assert_same(call.results, local_run(SLIPS))
