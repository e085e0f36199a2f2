"""Processes of a host of the sandbox: a host is a UTS namespace, so it has a hostname, and all it runs can be killed.

The sandbox is a process namespace of its own (scripts/test-engines), whose processes end with it.
"""

import os
import signal
import time
from pathlib import Path


def wait_until(condition, seconds, what):
    """Waits until a condition holds, and returns its value. `what` is said if it does not: a text or what makes it."""
    end = time.monotonic() + seconds
    while True:
        if value := condition():
            return value
        assert time.monotonic() < end, f"not within {seconds} s: {what() if callable(what) else what}"
        time.sleep(0.1)


def host_of(pid):
    """The UTS namespace of a process; none if it is gone."""
    try:
        return os.readlink(f"/proc/{pid}/ns/uts")
    except OSError:
        return None


def processes_beside(pid):
    """The ids of all processes on the host of a process."""
    host = host_of(pid)
    assert host and host != host_of("self"), f"process {pid} runs, on a host of its own"
    pids = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    return [other for other in pids if host_of(other) == host]


def kill_host(pid):
    """Kills all processes on the host of a process, as a power cut would."""
    for other in processes_beside(pid):
        try:
            os.kill(other, signal.SIGKILL)
        except ProcessLookupError:
            pass
