"""Hosts of the sandbox: name spaces with a hostname and processes of their own, so that none sees another's."""

import subprocess
import time


def wait_until(condition, seconds, what):
    """Waits until a condition holds, and returns its value. `what` is said if it does not: a text or what makes it."""
    end = time.monotonic() + seconds
    while True:
        if value := condition():
            return value
        assert time.monotonic() < end, f"not within {seconds} s: {what() if callable(what) else what}"
        time.sleep(0.1)


class Host:
    """A host that runs a command, and is there until that ends."""

    def __init__(self, name, command, log, **options):
        # The shell stays, as the first process, to collect orphans that have ended.
        script = 'hostname "$0" && "$@"; exit $?'
        words = ["unshare", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc", "bash", "-c", script, name]
        self.process = subprocess.Popen(
            [*words, *map(str, command)], stdin=subprocess.PIPE, stdout=log, stderr=log, **options
        )

    def kill(self):
        """Kills all its processes, as a power cut would."""
        self.process.kill()
        self.process.wait()
