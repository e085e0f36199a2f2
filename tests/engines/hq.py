"""HyperQueue through its Python package: a server, and workers in processes on hosts of their own, which can be killed.

The package has no program `hq`, and its workers are threads of the server's process. So each worker here is a process
with a server of its own that nobody uses, which is pointed to the common server before it adds its worker.
"""

import sys
from pathlib import Path

from hyperqueue import Job, LocalCluster
from hyperqueue.cluster import WorkerConfig
from hosts import Host, wait_until

# The link, in a server's folder, to what a worker needs to find the server.
CURRENT = "hq-current"


class HyperQueue:
    """A running server, and workers by their hostnames."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.cluster = LocalCluster(str(folder / "server"))
        self.workers = {}

    def start_worker(self, host, cores):
        log = (self.folder / f"{host}.log").open("wb")
        command = [sys.executable, __file__, self.folder / "server", self.folder / host, cores]
        self.workers[host] = Host(host, command, log)
        file = self.folder / host / "added"
        wait_until(file.exists, 20, f"worker {host} starts")

    def kill_worker(self, host):
        self.workers.pop(host).kill()

    def submit(self, job: Job):
        """Submits a job, and returns what waits for it; that raises an exception if a task has failed."""
        client = self.cluster.client()
        submitted = client.submit(job)
        return lambda: client.wait_for_jobs([submitted])

    def stop(self):
        for host in list(self.workers):
            self.kill_worker(host)
        self.cluster.stop()


def work(server, own, cores):
    """Adds a worker to a server that runs elsewhere, and works until the standard input ends."""
    cluster = LocalCluster(own)
    link = Path(own, CURRENT)
    link.unlink()
    link.symlink_to(Path(server, CURRENT))
    cluster.start_worker(WorkerConfig(cores=int(cores)))
    Path(own, "added").touch()
    sys.stdin.read()


if __name__ == "__main__":
    work(*sys.argv[1:])
