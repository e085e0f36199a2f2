"""Slurm arrays share a sweep: whole, and with elements that are cancelled, preempted, out of time or lose their node."""

import subprocess

import pytest
from hosts import wait_until
from sharing import BLOCKS, PARTS, abandoned, assert_each_part_ran_once, assert_same, done_parts, write_sweep
from slurm import Slurm

ELEMENTS = range(1, 9)
COMPLETED = {element: ["COMPLETED"] for element in ELEMENTS}

# Some 26 s of CPU time.
SLIPS = 200


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    return Slurm(tmp_path_factory.mktemp("slurm"))


class Array:
    """An array of eight elements that runs a sweep, by the script of `stickslip batch`."""

    def __init__(self, slurm, program, folder, slips):
        self.slurm = slurm
        self.results = folder / "results"
        self.script = folder / "submit.sh"
        sweep = write_sweep(folder / "shared.toml", BLOCKS, slips)
        options = ["--out", self.results, "--workers", str(len(ELEMENTS)), "--threads", "1", "--time", "1h"]
        self.script.write_text(
            subprocess.run(
                [program, "batch", "slurm", sweep, *options], check=True, capture_output=True, text=True
            ).stdout
        )

    def submit(self, *options):
        """Submits the array; its id."""
        return self.slurm.submit(["sh", self.script], *options)

    def submit_and_wait(self, parts):
        """Submits the array and waits until some parts are done, with all elements at work; its id and their nodes."""
        job = self.submit()
        wait_until(lambda: done_parts(self.results) >= parts, 60, f"{parts} parts are done")
        nodes = self.slurm.elements(job)
        assert sorted(nodes) == list(ELEMENTS)
        return job, nodes


@pytest.fixture
def array(slurm, program, tmp_path):
    wait_until(slurm.is_idle, 60, "all nodes are idle")
    return lambda slips=SLIPS: Array(slurm, program, tmp_path, slips)


def test_an_array_shares_a_sweep_and_runs_each_part_once(slurm, array, local_run):
    array = array()
    assert slurm.wait_for(array.submit(), 180) == COMPLETED
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS))
    assert_same(array.results, local_run(SLIPS))


def test_the_parts_of_a_cancelled_element_are_run_by_the_others(slurm, array, local_run):
    array = array()
    job, _ = array.submit_and_wait(parts=8)
    slurm.call("scancel", f"{job}_5")
    assert slurm.wait_for(job, 180) == COMPLETED | {5: ["CANCELLED"]}
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS))
    assert_same(array.results, local_run(SLIPS))


def test_preempted_elements_are_requeued_and_find_their_work_done(slurm, array, local_run):
    array = array()
    job, nodes = array.submit_and_wait(parts=8)
    urgent = slurm.submit(["sbatch"], "--partition=high", "--cpus-per-task=2", "--nodelist=n2", "--wrap=sleep 1")
    wait_until(lambda: slurm.has_ended(urgent), 60, "the urgent job ends")
    assert slurm.start_requeued(job)
    preempted = {element: ["PREEMPTED", "COMPLETED"] for element, node in nodes.items() if node == "n2"}
    assert slurm.wait_for(job, 180) == COMPLETED | preempted
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS))
    assert_same(array.results, local_run(SLIPS))


def test_the_parts_of_a_node_that_dies_are_taken_over(slurm, array, local_run):
    array = array()
    job, nodes = array.submit_and_wait(parts=8)
    slurm.kill_node("n3")
    assert abandoned(array.results, "n3")
    wait_until(lambda: slurm.start_requeued(job), 60, "Slurm finds the node dead")
    outcomes = slurm.wait_for(job, 240)
    slurm.start_node("n3")
    lost = {element: ["NODE_FAIL", "COMPLETED"] for element, node in nodes.items() if node == "n3"}
    assert outcomes == COMPLETED | lost
    assert done_parts(array.results) == PARTS
    assert_same(array.results, local_run(SLIPS))


def test_what_a_time_limit_leaves_is_run_by_the_next_array(slurm, array, local_run):
    # One core for both elements, so that they leave something on any machine. Slurm looks every 30 s for jobs that are
    # out of time, and warns of that 30 s before.
    slips = 4 * SLIPS
    array = array(slips)
    array.script.write_text(array.script.read_text().replace("\nexec ", "\nexec taskset -c 0 "))
    warned, ended = (array.submit("--array=1") for _ in range(2))
    wait_until(lambda: slurm.elements(warned) and slurm.elements(ended), 30, "the elements run")
    slurm.call("scontrol", "update", f"JobId={warned}_1", "EndTime=now+45seconds")
    slurm.call("scontrol", "update", f"JobId={ended}_1", "EndTime=now+1seconds")
    assert slurm.wait_for(ended, 90) == {1: ["TIMEOUT"]}
    assert slurm.wait_for(warned, 90) == {1: ["FAILED"]}, "it ends with 3 in the time that it has"
    assert 0 < done_parts(array.results) < PARTS
    array.script.write_text(array.script.read_text().replace("taskset -c 0 ", ""))
    assert slurm.wait_for(array.submit(), 240) == COMPLETED
    assert_each_part_ran_once(array.results, workers=len(ELEMENTS) + 2)
    assert_same(array.results, local_run(slips))
