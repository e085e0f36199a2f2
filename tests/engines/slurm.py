"""Slurm with four small nodes and a large one, without systemd, cgroups or accounting; its files are in one folder."""

import os
import re
import subprocess
from collections import defaultdict
from pathlib import Path

from hosts import Host, wait_until

NODES = ["n1", "n2", "n3", "n4", "n5"]

CONFIGURATION = """
ClusterName=engines
SlurmctldHost=localhost
SlurmUser=root
SlurmdUser=root
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/%n.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc={folder}/outcomes
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
ReturnToService=2
SlurmdTimeout=15
KillWait=5
NodeName=n[1-4] NodeHostname=localhost NodeAddr=127.0.0.1 Port=[17001-17004] CPUs=2
NodeName=n5 NodeHostname=localhost NodeAddr=127.0.0.1 Port=17005 CPUs=160
PartitionName=low Nodes=n[1-4] PriorityTier=1 PreemptMode=REQUEUE
PartitionName=high Nodes=n[1-4] PriorityTier=10 PreemptMode=OFF
PartitionName=short Nodes=n5 Default=YES
"""


class Slurm:
    """A running Slurm.

    The partitions `low` and `high` have the nodes of two cores, and jobs of `high` preempt those of `low`, which are
    requeued. The partition `short`, the default, has a node that claims to have 160 cores.
    """

    def __init__(self, folder: Path):
        self.folder = folder
        self.environment = os.environ | {
            "SLURM_CONF": str(folder / "slurm.conf"),
            "PATH": os.environ["PATH"] + ":/usr/sbin:/sbin",
        }
        (folder / "slurm.conf").write_text(CONFIGURATION.format(folder=folder))
        for name in ("munge", "state"):
            (folder / name).mkdir()
        munge = folder / "munge"
        self.call("mungekey", "--create", f"--keyfile={munge}/key")
        files = [f"--{name}-file={munge}/{name}" for name in ("key", "pid", "log", "seed")]
        # --force: as root, too, and below a folder that others may write.
        self.call("munged", "--force", f"--socket={munge}/socket", *files)
        self.call("slurmctld")
        self.nodes = {}
        for node in NODES:
            self.start_node(node)
        wait_until(self.is_idle, 30, "all nodes are idle")

    def call(self, *command):
        """Runs a command of Slurm, which must succeed, and returns what it prints."""
        done = subprocess.run(
            [str(word) for word in command],
            env=self.environment,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 0, f"{command}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def start_node(self, node):
        log = (self.folder / f"{node}.out").open("ab")
        self.nodes[node] = Host(node, ["slurmd", "-D", "-N", node], log, env=self.environment, cwd=self.folder)

    def kill_node(self, node):
        self.nodes.pop(node).kill()

    def is_idle(self):
        """All nodes are up and have nothing to do."""
        return self.call("sinfo", "-h", "-N", "-p", "low,short", "-o", "%t").split() == ["idle"] * len(NODES)

    def submit(self, command, *options):
        """Submits a job with a command that takes options of sbatch; the job's id."""
        return self.call(*command, "--parsable", *options).strip()

    def elements(self, job):
        """The nodes of the elements of an array that run."""
        rows = [line.split() for line in self.call("squeue", "-h", "-r", "-t", "R", "-o", "%F %K %N").splitlines()]
        return {int(element): node for array, element, node in rows if array == job}

    def start_requeued(self, job):
        """Lets elements that were requeued start at once, and not after two minutes; whether there are any."""
        rows = [line.split() for line in self.call("squeue", "-h", "-r", "-t", "PD", "-o", "%F %i").splitlines()]
        requeued = [element for array, element in rows if array == job]
        for element in requeued:
            self.call("scontrol", "update", f"JobId={element}", "StartTime=now")
        return bool(requeued)

    def has_ended(self, job):
        """No element of an array waits or runs."""
        return job not in self.call("squeue", "-h", "-o", "%F").split()

    def wait_for(self, job, seconds, field="JobState"):
        """Waits until an array has ended, and returns a field of its elements' outcomes, in order of time."""
        wait_until(lambda: self.has_ended(job), seconds, f"job {job} ends")
        outcomes = defaultdict(list)
        for line in (self.folder / "outcomes").read_text().splitlines():
            fields = dict(re.findall(r"(\w+)=(\S*)", line))
            if fields.get("ArrayJobId", fields["JobId"]) == job:
                outcomes[int(fields.get("ArrayTaskId", 0))].append(fields[field])
        return dict(sorted(outcomes.items()))
