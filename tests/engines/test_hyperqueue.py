"""HyperQueue's tasks share a sweep, also if a worker is killed, and a dependent task finds it complete."""

import pytest
from hq import HyperQueue
from hyperqueue import Job
from hosts import wait_until
from sharing import PARTS, assert_each_part_ran_once, assert_same, done_parts, write_sweep

BLOCKS = 100
TASKS = 6


@pytest.fixture
def hyperqueue(tmp_path):
    hyperqueue = HyperQueue(tmp_path)
    for host in ("w1", "w2", "w3"):
        hyperqueue.start_worker(host, cores=2)
    yield hyperqueue
    hyperqueue.stop()


def submit(hyperqueue, program, folder, slips):
    """Submits tasks that run a sweep and one that reduces it after them; the results and what waits for the tasks."""
    results = folder / "results"
    sweep = write_sweep(folder / "shared.toml", BLOCKS, slips)
    job = Job(default_workdir=folder)
    run = [str(word) for word in (program, "run", sweep, "--out", results, "--threads", 1, "--worker")]
    tasks = [job.program(run, stdout=f"run-{task}.out", stderr=f"run-{task}.err") for task in range(TASKS)]
    job.program([str(program), "reduce", str(results)], deps=tasks, stdout="reduce.out", stderr="reduce.err")
    return results, hyperqueue.submit(job)


def test_tasks_share_a_sweep_and_run_each_part_once(hyperqueue, program, local_run, tmp_path):
    results, wait = submit(hyperqueue, program, tmp_path, slips=100)
    wait()
    assert_each_part_ran_once(results)
    assert_same(results, local_run(BLOCKS, 100))


def test_the_parts_of_a_killed_worker_are_taken_over(hyperqueue, program, local_run, tmp_path):
    results, wait = submit(hyperqueue, program, tmp_path, slips=200)
    wait_until(lambda: done_parts(results) >= 8, 60, "eight parts are done")
    hyperqueue.kill_worker("w2")
    wait()
    assert done_parts(results) == PARTS
    assert_same(results, local_run(BLOCKS, 200))
