"""Slurm arrays share a sweep: whole, and with elements that are cancelled, preempted, out of time or lose their node."""

import pytest
from hosts import wait_until
from sharing import PARTS, assert_each_part_ran_once, assert_same, done_parts, write_sweep
from slurm import Slurm

BLOCKS = 100
ELEMENTS = range(8)


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    return Slurm(tmp_path_factory.mktemp("slurm"))


class Array:
    """An array of eight elements on one sweep, as `stickslip batch slurm` writes it, and its results."""

    def __init__(self, slurm, program, folder, slips):
        self.slurm = slurm
        self.slips = slips
        self.results = folder / "results"
        sweep = write_sweep(folder / "shared.toml", BLOCKS, slips)
        self.script = folder / "array.sh"
        self.script.write_text(
            "#!/bin/bash\n"
            "#SBATCH --array=0-7\n#SBATCH --cpus-per-task=1\n#SBATCH --requeue\n#SBATCH --signal=B:USR1@20\n"
            f"exec {program} run {sweep} --out {self.results} --worker\n"
        )

    def submit(self, *options):
        """Submits the array; its id."""
        return self.slurm.submit(self.script, *options)

    def run_until(self, parts):
        """Submits the array and waits until this many parts are done and all elements run; its id and their nodes."""
        job = self.submit()
        wait_until(lambda: done_parts(self.results) >= parts, 60, f"{parts} parts are done")
        nodes = self.slurm.elements(job)
        assert list(nodes) == list(ELEMENTS)
        return job, nodes

    def complete(self, local_run):
        """Submits the array again, which completes the sweep, and compares the results."""
        outcomes = self.slurm.wait_for(self.submit(), 300)
        assert outcomes == {element: ["COMPLETED"] for element in ELEMENTS}
        assert_same(self.results, local_run(BLOCKS, self.slips))


@pytest.fixture
def array(slurm, program, tmp_path):
    return lambda slips: Array(slurm, program, tmp_path, slips)


def test_an_array_shares_a_sweep_and_runs_each_part_once(slurm, array, local_run):
    array = array(slips=100)
    outcomes = slurm.wait_for(array.submit(), 120)
    assert outcomes == {element: ["COMPLETED"] for element in ELEMENTS}
    assert_each_part_ran_once(array.results)
    assert_same(array.results, local_run(BLOCKS, array.slips))


def test_the_parts_of_a_cancelled_element_are_run_by_the_others(slurm, array, local_run):
    array = array(slips=200)
    job, _ = array.run_until(parts=8)
    slurm.call("scancel", f"{job}_5")
    outcomes = slurm.wait_for(job, 120)
    assert outcomes.pop(5) == ["CANCELLED"]
    assert set(map(tuple, outcomes.values())) == {("COMPLETED",)}
    assert done_parts(array.results) == PARTS
    assert_same(array.results, local_run(BLOCKS, array.slips))
    array.complete(local_run)


def test_preempted_elements_are_requeued_and_the_sweep_is_completed(slurm, array, local_run, tmp_path):
    array = array(slips=200)
    job, nodes = array.run_until(parts=8)
    urgent = tmp_path / "urgent.sh"
    urgent.write_text("#!/bin/bash\nsleep 1\n")
    other = slurm.submit(urgent, "--partition=high", "--cpus-per-task=2", "--nodelist=n2")
    preempted = [element for element, node in nodes.items() if node == "n2"]
    wait_until(lambda: slurm.has_ended(other), 60, "the urgent job ends")
    slurm.start_requeued(job)
    outcomes = slurm.wait_for(job, 120)
    assert outcomes == {e: ["PREEMPTED"] * (e in preempted) + ["COMPLETED"] for e in ELEMENTS}
    assert done_parts(array.results) == PARTS
    assert_same(array.results, local_run(BLOCKS, array.slips))


def test_the_parts_of_a_node_that_dies_are_taken_over(slurm, array, local_run):
    array = array(slips=200)
    job, nodes = array.run_until(parts=8)
    lost = [element for element, node in nodes.items() if node == "n3"]
    slurm.kill_node("n3")
    try:
        wait_until(lambda: slurm.start_requeued(job), 60, "Slurm finds the node dead")
        outcomes = slurm.wait_for(job, 180)
    finally:
        slurm.start_node("n3")
    assert outcomes == {e: ["NODE_FAIL"] * (e in lost) + ["COMPLETED"] for e in ELEMENTS}
    array.complete(local_run)


def test_what_a_time_limit_leaves_is_run_by_the_next_array(slurm, array, local_run):
    array = array(slips=1500)
    warned = array.submit("--array=0", "--time=1")
    ended = array.submit("--array=0", "--time=1", "--signal=0")
    assert slurm.wait_for(warned, 120) == {0: ["COMPLETED"]}, "the warning ends it in time"
    assert slurm.wait_for(ended, 120) == {0: ["TIMEOUT"]}
    assert 0 < done_parts(array.results) < PARTS
    array.complete(local_run)
    assert_each_part_ran_once(array.results)
