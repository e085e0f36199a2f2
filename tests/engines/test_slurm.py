"""Slurm arrays share a sweep: whole, and with elements that are cancelled, preempted, out of time or lose their node.

And the commands of docs/clusters.md run as they are.
"""

import subprocess

import pytest
from hosts import wait_until
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
from slurm import Slurm

ELEMENTS = range(1, 9)
COMPLETED = {element: ["COMPLETED"] for element in ELEMENTS}

# Some 24 s of CPU time, so that all elements start before the end, also on a busy machine.
SLIPS = 300

# Before the worker in a script: stops its process but for 4 % of the time, so that some work is left on any machine.
SLOWLY = "(trap '' TERM USR1; while kill -STOP $$; do sleep 0.96; kill -CONT $$; sleep 0.04; done) 2>/dev/null &\n"


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    return Slurm(tmp_path_factory.mktemp("slurm"))


class Array:
    """Eight workers for a sweep, by the script of `stickslip batch`."""

    def __init__(self, slurm, program, folder):
        self.slurm = slurm
        self.program = program
        self.results = folder / "results"
        self.script = folder / "submit.sh"
        self.sweep = write_sweep(folder / "shared.toml", BLOCKS, SLIPS)

    def submit(self, *options, time="1h", is_slow=False):
        """Submits the array; its id."""
        workers = ["--workers", str(len(ELEMENTS)), "--threads", "1", "--time", time]
        batch = [self.program, "batch", "slurm", self.sweep, "--out", self.results, *workers, "--", "--partition=low"]
        script = subprocess.run(batch, check=True, capture_output=True, text=True).stdout
        self.script.write_text(script.replace("\nexec ", f"\n{SLOWLY}exec ") if is_slow else script)
        return self.slurm.submit(["sh", self.script], *options)

    def submit_and_wait(self):
        """Submits the array and waits until each element has done a part; its id and the nodes of its elements."""
        job = self.submit()
        wait_until(lambda: len(logged(self.results)) == len(ELEMENTS), 180, "each element has done a part")
        nodes = self.slurm.elements(job)
        assert sorted(nodes) == list(ELEMENTS)
        return job, nodes


@pytest.fixture
def array(slurm, program, tmp_path):
    wait_until(slurm.is_idle, 60, "all nodes are idle")
    return Array(slurm, program, tmp_path)


def test_an_array_shares_a_sweep_and_runs_each_part_once(slurm, array, local_run):
    assert slurm.wait_for(array.submit(), 300) == COMPLETED
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS))
    assert_same(array.results, local_run(SLIPS))


def test_the_parts_of_a_cancelled_element_are_run_by_the_others(slurm, array, local_run):
    job, _ = array.submit_and_wait()
    slurm.call("scancel", f"{job}_5")
    assert slurm.wait_for(job, 300) == COMPLETED | {5: ["CANCELLED"]}
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS))
    assert_same(array.results, local_run(SLIPS))


def test_preempted_elements_are_requeued_and_find_their_work_done(slurm, array, local_run):
    job, nodes = array.submit_and_wait()
    urgent = slurm.submit(["sbatch"], "--partition=high", "--cpus-per-task=2", "--nodelist=n2", "--wrap=sleep 1")
    wait_until(lambda: slurm.has_ended(urgent), 60, "the urgent job ends")
    assert slurm.start_requeued(job)
    preempted = {element: ["PREEMPTED", "COMPLETED"] for element, node in nodes.items() if node == "n2"}
    assert slurm.wait_for(job, 300) == COMPLETED | preempted
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS))
    assert_same(array.results, local_run(SLIPS))


def test_the_parts_of_a_node_that_dies_are_taken_over(slurm, array, local_run):
    job, nodes = array.submit_and_wait()
    slurm.kill_node("n3")
    assert abandoned(array.results, "n3")
    wait_until(lambda: slurm.start_requeued(job), 60, "Slurm finds the node dead")
    outcomes = slurm.wait_for(job, 300)
    slurm.start_node("n3")
    lost = {element: ["NODE_FAIL", "COMPLETED"] for element, node in nodes.items() if node == "n3"}
    assert outcomes == COMPLETED | lost
    assert done_parts(array.results) == PARTS
    assert_same(array.results, local_run(SLIPS))


def test_what_a_time_limit_leaves_is_run_by_the_next_array(slurm, array, local_run):
    # Slurm looks every 30 s for jobs that are out of time, and warns of that 30 s before.
    limited = array.submit("--array=1", time="1m", is_slow=True)
    warned, ended = (array.submit("--array=1", is_slow=True) for _ in range(2))
    wait_until(lambda: len(logged(array.results)) == 3, 180, "each element has done a part")
    slurm.call("scontrol", "update", f"JobId={warned}_1", "EndTime=now+45seconds")
    slurm.call("scontrol", "update", f"JobId={ended}_1", "EndTime=now")
    assert slurm.wait_for(ended, 90) == {1: ["TIMEOUT"]}
    for job in (limited, warned):
        assert slurm.wait_for(job, 90) == {1: ["COMPLETED"]}
        assert slurm.wait_for(job, 1, "ExitCode") == {1: ["0:0"]}
    assert 0 < done_parts(array.results) < PARTS
    next_array = array.submit(f"--dependency=afterok:{limited}:{warned}")
    assert slurm.wait_for(next_array, 300) == COMPLETED
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS) + 3)
    assert_same(array.results, local_run(SLIPS))


def test_the_commands_of_the_page_on_clusters_run_as_they_are(slurm, program, local_run, tmp_path):
    environment = slurm.environment | {"PATH": f"{program.parent}:{slurm.environment['PATH']}"}
    for number, screen in enumerate(screens("Slurm")):
        folder = tmp_path / str(number)
        commands = prepare_screen(screen, folder, SLIPS)
        printed = subprocess.check_output(["sh", "-ec", commands], cwd=folder, env=environment, text=True)
        job = printed.removeprefix("Submitted batch job ").strip()
        assert slurm.wait_for(job, 300) == {element: ["COMPLETED"] for element in range(1, 41)}
        (logs,) = folder.glob("*/*/run/batch")
        assert len(list(logs.iterdir())) == 40
        results = logs.parents[1]
        assert_each_part_ran_once(results, workers=2)
        assert_same(results, local_run(SLIPS))
